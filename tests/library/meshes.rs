//! Mesh files as people's programs write them: what is not needed is not parsed, polygons are what they are, solid cells of
//! every kind are taken, and legacy `.vtk` means what `vtkio` reads and writes.

use std::path::Path;

use ao4d::inspect::Info;
use ao4d::io::vtk::{self, DataSet, UnstructuredGrid};
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs, surface_measure};
use ao4d::scene::{Error, build_object};
use serde_json::json;
use vtkio::model as oracle;

/// The corners and the triangles of a unit cube, facing outwards.
const CORNERS: [[i32; 3]; 8] = [[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 1, 1], [1, 0, 0], [1, 0, 1], [1, 1, 0], [1, 1, 1]];
const TRIANGLES: [[usize; 3]; 12] = [
    [1, 3, 0],
    [4, 1, 0],
    [0, 3, 2],
    [2, 4, 0],
    [1, 7, 3],
    [5, 1, 4],
    [5, 7, 1],
    [3, 7, 2],
    [6, 4, 2],
    [2, 7, 6],
    [6, 5, 4],
    [7, 5, 6],
];

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<Surface<3>, Error> {
        std::fs::write(self.0.path().join(name), bytes).unwrap();
        build_object::<3>(&serde_json::from_value(json!({"file": name})).unwrap(), self.0.path())
    }

    /// The file holds the cube, for a scene and for `info` alike.
    fn is_cube(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let surface = self.read(name, bytes).unwrap_or_else(|e| panic!("{e}"));
        is_closed(name, &surface, 6.0, 1.0);
        assert_eq!((surface.vertices.len(), surface.simplices.len()), (8, 12), "{name}");
        let text = Info::read(&self.0.path().join(name)).unwrap_or_else(|e| panic!("{e}")).to_string();
        assert!(text.contains("closed, 1 piece\n  oriented\n  manifold"), "{name}: {text}");
    }
}

fn is_closed(name: &str, surface: &Surface<3>, area: f64, volume: f64) {
    let pairs = facet_pairs(&surface.simplices);
    assert!(pairs.is_closed() && pairs.is_manifold(), "{name}: {pairs:?}");
    let corners = || corners(&surface.vertices, &surface.simplices);
    let (found, inside) = (surface_measure(corners()), enclosed_volume(corners()));
    assert!((found - area).abs() < 1e-12 && (inside - volume).abs() < 1e-12, "{name}: area {found}, volume {inside}");
}

fn numbers(list: &[usize]) -> String {
    list.iter().map(usize::to_string).collect::<Vec<_>>().join(" ")
}

fn corners_as_text(before: &str) -> String {
    CORNERS.iter().map(|[x, y, z]| format!("{before}{x} {y} {z}\n")).collect()
}

fn obj(head: &[u8]) -> Vec<u8> {
    let faces: String = TRIANGLES.iter().map(|t| format!("f {}\n", numbers(&t.map(|i| i + 1)))).collect();
    [head, b"\n", corners_as_text("v ").as_bytes(), faces.as_bytes()].concat()
}

fn ply(comment: &[u8], properties: &str, values: &[&str]) -> Vec<u8> {
    let vertices = CORNERS.iter().enumerate().map(|(i, [x, y, z])| {
        let value = if values.is_empty() { "" } else { values[i % values.len()] };
        format!("{x} {y} {z} {value}\n")
    });
    let faces: String = TRIANGLES.iter().map(|t| format!("3 {}\n", numbers(t))).collect();
    let head = format!(
        "element vertex 8\nproperty float x\nproperty float y\nproperty float z\n{properties}element face 12\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    let vertices: String = vertices.collect();
    let start = [b"ply\nformat ascii 1.0\ncomment ", comment, b"\n"].concat();
    [start.as_slice(), head.as_bytes(), vertices.as_bytes(), faces.as_bytes()].concat()
}

fn ascii_stl(name: &[u8], normal: &str, behind: &str) -> Vec<u8> {
    let facet = |t: &[usize; 3]| {
        let corners = t.map(|i| format!("vertex {} {} {}\n", CORNERS[i][0], CORNERS[i][1], CORNERS[i][2])).concat();
        format!("facet normal {normal}\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let facets: String = TRIANGLES.iter().map(facet).collect();
    [b"solid ", name, b"\n", facets.as_bytes(), b"endsolid\n", behind.as_bytes()].concat()
}

fn binary_stl(header: &[u8], behind: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(12u32.to_le_bytes());
    for t in TRIANGLES {
        [f32::NAN; 3].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        t.iter().flat_map(|&i| CORNERS[i]).for_each(|x| bytes.extend((x as f32).to_le_bytes()));
        bytes.extend([0, 0]);
    }
    [&bytes, behind].concat()
}

#[test]
fn what_is_not_needed_is_not_parsed() {
    let folder = Folder::new();
    folder.is_cube("empty-material.obj", obj(b"mtllib a.mtl\nusemtl \nusemtl\nmtllib"));
    folder.is_cube("umlaut.obj", obj(b"# \xe4\no Gel\xe4nde\ng \xff\xfe\nusemtl Gel\xe4nde"));
    folder.is_cube("normals.obj", obj(b"vn nan nan nan\nvt 1,5 x\nvp 1\nvn"));
    folder.is_cube("umlaut.ply", ply(b"Ger\xe4t 3", "", &[]));
    let odd = [".5", "1.", "+1", "nan", "inf", "1e5", "-nan(ind)", "-.25"];
    folder.is_cube("numbers.ply", ply(b"", "property float quality\n", &odd));
    folder.is_cube("list.ply", ply(b"", "property list uchar float weights\n", &["2 a b", "0"]));
    for normal in ["-nan(ind) -nan(ind) -nan(ind)", "1.#QNAN 1.#IND 0", "0 0 0", "nan nan nan", "n/a n/a n/a"] {
        folder.is_cube("normals.stl", ascii_stl(b"part", normal, ""));
    }
    folder.is_cube("umlaut.stl", ascii_stl(b"Geh\xe4use", "0 0 0", ""));
    for name in [&b"a facet vertex 1"[..], b"solid endsolid endfacet", b"vertex 1 2"] {
        folder.is_cube("name.stl", ascii_stl(name, "0 0 0", ""));
    }
    let line = String::from_utf8(ascii_stl(b"", "0 0 0", "")).unwrap().replace('\n', " ");
    folder.is_cube("line.stl", line.into_bytes());
    for behind in ["; exported by a program\n", "facets: 12\n", "\n\nEOF", "solid \nendsolid\n"] {
        folder.is_cube("behind.stl", ascii_stl(b"", "0 0 1", behind));
    }
    // A mark that editors put before texts.
    for (name, text) in
        [("mark.obj", obj(b"")), ("mark.ply", ply(b"", "", &[])), ("mark.stl", ascii_stl(b"", "0 0 0", ""))]
    {
        let text = text.strip_prefix(b"\n").unwrap_or(&text);
        folder.is_cube(name, [b"\xef\xbb\xbf", text].concat());
    }
    for behind in [&b""[..], b"\n", b"\0", b"# written by a program, facet by facet"] {
        folder.is_cube("solid.stl", binary_stl(b"solid part 7", behind));
        folder.is_cube("binary.stl", binary_stl(b"", behind));
    }
}

#[test]
fn cells_of_points_that_are_not_there_are_refused() {
    let folder = Folder::new();
    let refused = |name: &str, bytes: Vec<u8>, told: &str| {
        let error = folder.read(name, bytes).unwrap_err().to_string();
        let info = Info::read(&folder.0.path().join(name)).unwrap_err().to_string();
        assert!(error.contains(told) && info.contains(told), "{error}\n{info}");
    };
    let text = String::from_utf8(ply(b"", "", &[])).unwrap();
    refused("beyond.ply", text.replace("3 7 5 6\n", "3 7 5 8\n").into(), "cell 11 names point 8 of 8");
    let text = String::from_utf8(obj(b"")).unwrap();
    refused("beyond.obj", text.replace("f 8 6 7\n", "f 8 6 9\n").into(), "names vertex 9 of 8");
    // What is no format for this program is told with the way to one that is.
    for (name, told) in
        [("a.vtm", "Merge Blocks"), ("a.step", "gmsh -2"), ("a.off", "Blender"), ("a.inp", "meshio convert")]
    {
        refused(name, b"x".to_vec(), told);
    }
}

#[test]
fn concave_polygons_are_what_they_are() {
    let folder = Folder::new();
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    // A further corner on a straight edge, which both its faces have.
    let pricked = [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    for (case, outline) in [("l", &outline[..]), ("pricked", &pricked)] {
        let n = outline.len();
        let points: Vec<[i32; 3]> =
            (0..2 * n).map(|i| [outline[i % n][0], outline[i % n][1], (i / n) as i32]).collect();
        let mut faces: Vec<Vec<usize>> = vec![(0..n).rev().collect(), (n..2 * n).collect()];
        faces.extend((0..n).map(|i| vec![i, (i + 1) % n, n + (i + 1) % n, n + i]));
        let lines =
            |before: &str| -> String { points.iter().map(|[x, y, z]| format!("{before}{x} {y} {z}\n")).collect() };
        let obj: String =
            faces.iter().map(|f| format!("f {}\n", numbers(&f.iter().map(|i| i + 1).collect::<Vec<_>>()))).collect();
        let lists: String = faces.iter().map(|f| format!("{} {}\n", f.len(), numbers(f))).collect();
        let size: usize = faces.iter().map(|f| f.len() + 1).sum();
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_index\nend_header\n{}{lists}",
            2 * n,
            n + 2,
            lines("")
        );
        let vtk = format!(
            "# vtk DataFile Version 3.0\nl\nASCII\nDATASET POLYDATA\nPOINTS {} float\n{}POLYGONS {} {size}\n{lists}",
            2 * n,
            lines(""),
            n + 2
        );
        let ends: Vec<usize> = faces.iter().scan(0, |end, f| Some((*end += f.len(), *end).1)).collect();
        let vtp = format!(
            "<VTKFile type=\"PolyData\" version=\"1.0\"><PolyData><Piece NumberOfPoints=\"{}\" NumberOfPolys=\"{}\"><Points>\
             <DataArray type=\"Float64\" NumberOfComponents=\"3\">{}</DataArray></Points><Polys>\
             <DataArray type=\"Int64\" Name=\"connectivity\">{}</DataArray>\
             <DataArray type=\"Int64\" Name=\"offsets\">{}</DataArray></Polys></Piece></PolyData></VTKFile>",
            2 * n,
            n + 2,
            lines(""),
            numbers(&faces.concat()),
            numbers(&ends)
        );
        for (ending, text) in [("obj", lines("v ") + &obj), ("ply", ply), ("vtk", vtk), ("vtp", vtp)] {
            let name = format!("{case}.{ending}");
            let surface = folder.read(&name, text).unwrap_or_else(|e| panic!("{e}"));
            is_closed(&name, &surface, 14.0, 3.0);
        }
    }
}

#[test]
fn lines_are_no_faces() {
    let folder = Folder::new();
    let lines = corners_as_text("v ") + "l 1 2 3 4\nl 5 6 7 8\nl 1 2 6 5\n";
    assert!(
        folder
            .read("wire.obj", &lines)
            .unwrap_err()
            .to_string()
            .contains("holds no triangle, only 3 vertices and lines")
    );
    let surface = folder.read("both.obj", [lines.as_bytes(), &obj(b"")].concat()).unwrap();
    assert_eq!(surface.simplices.len(), 12);
    assert!(
        Info::read(&folder.0.path().join("both.obj")).unwrap().to_string().contains("3 (poly-line), 12 (triangle)")
    );
}

#[test]
fn fields_stand_anywhere_in_a_legacy_file() {
    let folder = Folder::new();
    let cells: String = TRIANGLES.iter().map(|t| format!("3 {}\n", numbers(t))).collect();
    let field = "FIELD TimesAndCycles 3\nTIME 1 1 double\n172800\nCYCLE 1 1 int\n2\nby 1 1 string\nme%20and%20you\n";
    let (points, cells) = (format!("POINTS 8 float\n{}", corners_as_text("")), format!("POLYGONS 12 48\n{cells}"));
    let head = "# vtk DataFile Version 3.0\ncube\nASCII\nDATASET POLYDATA\n";
    let behind = "POINT_DATA 8\nSCALARS a float\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\nVECTORS v int\n0 0 0 0 0 0 0 0 0 0 0 0 \
        0 0 0 0 0 0 0 0 0 0 0 9\nCELL_DATA 12\nFIELD f 1\nc 1 12 short\n0 1 2 3 4 5 6 7 8 9 10 11\n";
    for (i, text) in [
        format!("{head}{field}{points}{cells}{behind}"),
        format!("{head}{points}{field}{cells}{behind}"),
        format!("{head}{points}{cells}{field}{behind}"),
    ]
    .iter()
    .enumerate()
    {
        let name = format!("{i}.vtk");
        folder.is_cube(&name, text);
        let text = Info::read(&folder.0.path().join(&name)).unwrap().to_string();
        for told in ["TIME: 172800", "CYCLE: 2", "by: me and you", "  a, ", "  v, ", "  c, "] {
            assert!(text.contains(told), "{name}: {told} is missing in {text}");
        }
    }
    // A scene needs no attribute; `info` takes all or says what it can't.
    folder.read("odd.vtk", format!("{head}{points}{cells}POINT_DATA 8\nODDITIES 1 2 3\n")).unwrap();
    let told = Info::read(&folder.0.path().join("odd.vtk")).unwrap_err().to_string();
    assert!(told.contains("ODDITIES"), "{told}");
}

#[test]
fn solid_cells_of_every_kind_are_taken() {
    // A wedge on a hexahedron on which a pyramid stands: neighbours share quadrilaterals.
    let points = "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1 .5 .5 2 0 -1 0 1 -1 0\n";
    let text = format!(
        "# vtk DataFile Version 2.0\nc\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 11 double\n{points}CELLS 3 22\n\
         8 0 1 2 3 4 5 6 7\n5 4 5 6 7 8\n6 0 4 9 1 5 10\nCELL_TYPES 3\n12 14 13\n"
    );
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("m.vtk"), text).unwrap();
    let spec = json!({"extrude": {"mesh": "m.vtk", "from": 0, "to": 1}});
    let body = build_object::<4>(&serde_json::from_value(spec).unwrap(), folder.0.path()).unwrap();
    let pairs = facet_pairs(&body.simplices);
    assert!(pairs.is_closed() && pairs.is_manifold(), "{pairs:?}");
    let volume = enclosed_volume(corners(&body.vertices, &body.simplices));
    assert!((volume - (1.0 + 1.0 / 3.0 + 0.5)).abs() < 1e-12, "{volume}");
}

#[test]
fn gmsh_binary_is_what_the_text_is() {
    let folder = Folder::new();
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0f64]];
    let tags = [7u64, 3, 12, 5];
    for little in [true, false] {
        let int = |n: i32| if little { n.to_le_bytes() } else { n.to_be_bytes() };
        let size = |n: u64| if little { n.to_le_bytes() } else { n.to_be_bytes() };
        let double = |x: f64| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let place = |p: &[f64; 3]| p.map(double).concat();
        let head = |version: &str| {
            [format!("$MeshFormat\n{version} 1 8\n").as_bytes(), &int(1), b"\n$EndMeshFormat\n"].concat()
        };
        let mut old = head("2.2");
        old.extend(b"$PhysicalNames\n1\n3 1 \"$Nodes of \xe4\"\n$EndPhysicalNames\n$Nodes\n4\n");
        tags.iter().zip(&points).for_each(|(&tag, p)| old.extend([&int(tag as i32)[..], &place(p)].concat()));
        old.extend(b"\n$EndNodes\n$Elements\n3\n");
        // Two points, with two tags each, and the tetrahedron.
        [15, 2, 2, 1, 0, 1, 7, 2, 0, 1, 3, 4, 1, 2, 9, 0, 1, 7, 3, 12, 5].iter().for_each(|&n| old.extend(int(n)));
        old.extend(b"\n$EndElements\n");
        let mut new = head("4.1");
        new.extend(b"$Nodes\n");
        [2, 4, 3, 12].iter().for_each(|&n| new.extend(size(n)));
        [0, -1, 0].iter().for_each(|&n| new.extend(int(n)));
        [1, 7].iter().for_each(|&n| new.extend(size(n)));
        new.extend(place(&points[0]));
        // A block with parametric coordinates, three a node.
        [3, 1, 1].iter().for_each(|&n| new.extend(int(n)));
        [3, 3, 12, 5].iter().for_each(|&n| new.extend(size(n)));
        points[1..].iter().for_each(|p| new.extend([place(p), place(&[0.5; 3])].concat()));
        new.extend(b"\n$EndNodes\n$Elements\n");
        [1, 1, 9, 9].iter().for_each(|&n| new.extend(size(n)));
        [3, 1, 4].iter().for_each(|&n| new.extend(int(n)));
        [1, 9, 7, 3, 12, 5].iter().for_each(|&n| new.extend(size(n)));
        new.extend(b"\n$EndElements\n");
        for (name, bytes) in [("old.msh", old), ("new.msh", new)] {
            std::fs::write(folder.0.path().join(name), &bytes).unwrap();
            let spec = json!({"extrude": {"mesh": name, "from": 0, "to": 1}});
            let body = build_object::<4>(&serde_json::from_value(spec).unwrap(), folder.0.path()).unwrap();
            let volume = enclosed_volume(corners(&body.vertices, &body.simplices));
            assert!((volume - 1.0 / 6.0).abs() < 1e-14, "{name}: {volume}");
            assert!(Info::read(&folder.0.path().join(name)).unwrap().to_string().contains("1 (tetrahedron)"));
            for length in 0..bytes.len() - 16 {
                folder.read("cut.msh", &bytes[..length]).unwrap_err();
            }
        }
    }
}

/// A mesh with arrays, as `vtkio` models it.
fn model() -> oracle::Vtk {
    let scalar = |name: &str, components, data| {
        oracle::Attribute::DataArray(oracle::DataArray {
            name: name.into(),
            elem: oracle::ElementType::Generic(components),
            data,
        })
    };
    let piece = oracle::UnstructuredGridPiece {
        points: oracle::IOBuffer::F64((0..15).map(|i| f64::from(i * i) / 7.0).collect()),
        cells: oracle::Cells {
            cell_verts: oracle::VertexNumbers::Legacy {
                num_cells: 3,
                vertices: vec![4, 0, 1, 2, 3, 3, 2, 3, 4, 2, 0, 4],
            },
            types: vec![oracle::CellType::Tetra, oracle::CellType::Triangle, oracle::CellType::Line],
        },
        data: oracle::Attributes {
            point: vec![
                scalar("p", 2, oracle::IOBuffer::F32((0..10).map(|i| i as f32 / 3.0).collect())),
                scalar("q", 1, oracle::IOBuffer::U16(vec![0, 1, 2, 3, 65535])),
            ],
            cell: vec![scalar("c", 1, oracle::IOBuffer::I32(vec![-1, 0, 7]))],
        },
    };
    oracle::Vtk {
        version: oracle::Version::new_legacy(3, 0),
        title: "made by another program".into(),
        byte_order: oracle::ByteOrder::BigEndian,
        data: oracle::DataSet::UnstructuredGrid { meta: None, pieces: vec![oracle::Piece::Inline(Box::new(piece))] },
        file_path: None,
    }
}

#[test]
fn legacy_files_mean_what_another_program_means() {
    let mut binary = Vec::new();
    model().write_legacy(&mut binary).unwrap();
    let mut text = String::new();
    model().write_legacy_ascii(&mut text).unwrap();
    for bytes in [binary.as_slice(), text.as_bytes()] {
        let DataSet::Unstructured(grid) = vtk::parse(bytes).unwrap() else { panic!("no mesh") };
        let expected = UnstructuredGrid {
            points: (0..5).map(|i| [0, 1, 2].map(|a| f64::from((3 * i + a) * (3 * i + a)) / 7.0)).collect(),
            connectivity: vec![0, 1, 2, 3, 2, 3, 4, 0, 4],
            offsets: vec![4, 7, 9],
            types: vec![10, 5, 3],
            ..UnstructuredGrid::default()
        };
        assert_eq!((&grid.points, &grid.connectivity), (&expected.points, &expected.connectivity));
        assert_eq!((&grid.offsets, &grid.types), (&expected.offsets, &expected.types));
        let names = |arrays: &[ao4d::volume::Array]| arrays.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
        assert_eq!(
            (names(&grid.point_arrays), names(&grid.cell_arrays)),
            (vec!["p".into(), "q".into()], vec!["c".into()])
        );
        assert_eq!(grid.point_arrays[0].values, (0..10).map(|i| i as f32 / 3.0).collect::<Vec<_>>().into());
        assert_eq!(grid.point_arrays[1].values, vec![0u16, 1, 2, 3, 65535].into());
        assert_eq!(grid.cell_arrays[0].values, vec![-1i32, 0, 7].into());
        for length in 0..bytes.len() - 8 {
            // Cut off, it is refused, or a file that ends before its attributes.
            if let Ok(DataSet::Unstructured(part)) = vtk::parse(&bytes[..length]) {
                assert_eq!(part.points, expected.points, "{length}");
            }
        }
    }
}

#[test]
fn small_files_that_ask_for_all_memory_are_told_before() {
    // Blocks that claim to hold an exabyte, of an array as large as that.
    let mut stream: Vec<u8> = [1u64 << 20, 1 << 40, 0].iter().flat_map(|n| n.to_le_bytes()).collect();
    stream.resize((3 + (1 << 20)) * 8, 0);
    let head = "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
        compressor=\"vtkZLibDataCompressor\"><ImageData WholeExtent=\"0 1048575 0 1048575 0 1048575\"><Piece><PointData>\
        <DataArray type=\"UInt8\" Name=\"a\" format=\"appended\" offset=\"0\"/></PointData></Piece></ImageData>\
        <AppendedData encoding=\"raw\">_";
    let bytes = [head.as_bytes(), &stream, b"</AppendedData></VTKFile>"].concat();
    let told = vtk::parse(&bytes).unwrap_err().to_string();
    assert!(told.contains("array `a` takes 1152921504606846976 bytes, and there is room for"), "{told}");
    // What nobody asks for is not looked at.
    let wanted = vtk::Wanted::Named(&["b"]);
    assert!(
        matches!(vtk::parse_wanted(&bytes, wanted).unwrap(), DataSet::Image(image) if image.point_arrays.is_empty())
    );
    let folder = Folder::new();
    let path = folder.0.path().join("b.vti");
    std::fs::write(&path, bytes).unwrap();
    assert!(Info::read(Path::new(&path)).is_err());
}

#[test]
fn points_that_differ_by_rounding_are_welded_within_a_tolerance() {
    let folder = Folder::new();
    // Each triangle has corners of its own, a little off.
    let mut text = String::new();
    for (i, corner) in TRIANGLES.as_flattened().iter().enumerate() {
        let [x, y, z] = CORNERS[*corner].map(|x| f64::from(x) + 1e-6 * (i % 7) as f64);
        text += &format!("v {x} {y} {z}\n");
    }
    (0..TRIANGLES.len()).for_each(|i| text += &format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3));
    let open = folder.read("a.obj", &text).unwrap();
    assert_eq!(facet_pairs(&open.simplices).open, 36);
    let welded = |weld: f64, shape: serde_json::Value| {
        let mut object = shape;
        object["weld"] = weld.into();
        let mut notes = Vec::new();
        let spec = serde_json::from_value(object).unwrap();
        (ao4d::scene::build_object_with_notes::<3>(&spec, folder.0.path(), &mut notes), notes)
    };
    let (closed, notes) = welded(1e-5, json!({"file": "a.obj"}));
    let closed = closed.unwrap();
    assert_eq!((closed.vertices.len(), closed.simplices.len()), (8, 12));
    assert!(facet_pairs(&closed.simplices).is_closed());
    assert_eq!(notes, ["weld: 28 points became one with others, or belong to nothing"]);
    for (weld, shape, message) in [
        (-1.0, json!({"file": "a.obj"}), "weld: -1 is below 0"),
        (0.5, json!({"file": "a.obj"}), "weld: 0.5 is more than a hundredth of the mesh's extent"),
        (1e-5, json!({"sphere": {"radius": 1, "subdivisions": 2}}), "weld: a sphere has no points to weld"),
    ] {
        let error = welded(weld, shape).0.unwrap_err().to_string();
        assert!(error.starts_with(message), "{error}");
    }
    let spec = |weld: f64| {
        let object = json!({"extrude": {"mesh": "a.obj", "from": 0, "to": 1, "caps": true}, "weld": weld});
        build_object::<4>(&serde_json::from_value(object).unwrap(), folder.0.path())
    };
    assert!(spec(0.0).unwrap_err().to_string().contains("is open at 36 edges"));
    assert!(facet_pairs(&spec(1e-5).unwrap().simplices).is_closed());
}
