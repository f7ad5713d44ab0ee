//! Image and mesh files: what is written is read back, by ourselves and by VTK, and what VTK writes is read by us.
//!
//! The tests that need VTK run `tests/python/check_vtk.py` with the Python of `AO4D_PYTHON`, or else of `.venv`.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;

use ao4d::inspect::compare::{self, Tolerance};
use ao4d::io::vti::{self, ArraySpec, Compression, Encoding, Settings, VtiWriter};
use ao4d::io::vtk::{self, DataSet};
use ao4d::io::{AtomicFile, raw, vtu};
use ao4d::volume::{Array, Grid, Kind, Values, Volume};

const ENCODINGS: [Encoding; 2] = [Encoding::Appended, Encoding::Inline];
const COMPRESSIONS: [Compression; 3] = [Compression::None, Compression::Zlib, Compression::Lz4];

/// An image that looks different from every side, with every array that a render makes.
fn volume(dimensions: [usize; 3]) -> Volume {
    let grid = Grid { dimensions, origin: [-1.0 / 3.0, 0.1, 1e-300], spacing: [1.0 / 3.0, 0.7, 2.0 / 49.0] };
    let n = grid.len();
    let float = |i: usize| ((i * 7919) % 1009) as f32 / 1009.0;
    Volume {
        grid,
        arrays: vec![
            Array::new("rgba", 4, (0..4 * n).map(|i| (i / 3 % 251) as u8).collect::<Vec<_>>()),
            Array::new("ambient_occlusion", 1, (0..n).map(float).collect::<Vec<_>>()),
            Array::new("object", 1, (0..n).map(|i| (i % 65536) as u16).collect::<Vec<_>>()),
            Array::new("normal", 4, (0..4 * n).map(|i| float(i) - 0.5).collect::<Vec<_>>()),
            Array::new(
                "depth",
                1,
                (0..n).map(|i| if i % 5 == 0 { f32::INFINITY } else { float(i) }).collect::<Vec<_>>(),
            ),
        ],
        field_data: vec![
            ("pipeline".into(), "name: \"ä & <b>\"\nstages: []\n".into()),
            ("version".into(), "0.1.0".into()),
            ("nothing".into(), String::new()),
        ],
    }
}

fn settings(encoding: Encoding, compression: Compression, volume: &Volume) -> Settings {
    Settings { encoding, compression, field_data: volume.field_data.clone(), ..Settings::default() }
}

fn written(volume: &Volume, settings: &Settings) -> Vec<u8> {
    vti::write(Cursor::new(Vec::new()), volume, settings).unwrap().into_inner()
}

fn parsed(bytes: &[u8]) -> Volume {
    match vtk::parse(bytes).unwrap() {
        DataSet::Image(image) => image.into_volume().unwrap(),
        DataSet::Unstructured(_) => panic!("no image"),
    }
}

#[test]
fn every_encoding_and_compression_reads_back() {
    // One voxel, one layer, a size not divisible by 3 (base64), and arrays of whole and of broken blocks.
    for dimensions in [[1, 1, 1], [5, 7, 1], [3, 4, 5], [64, 32, 32], [50, 51, 52]] {
        let volume = volume(dimensions);
        for encoding in ENCODINGS {
            for compression in COMPRESSIONS {
                let bytes = written(&volume, &settings(encoding, compression, &volume));
                assert_eq!(parsed(&bytes), volume, "{dimensions:?} {encoding:?} {compression:?}");
            }
        }
    }
}

#[test]
fn slabs_give_the_same_bytes_as_the_whole() {
    let volume = volume([9, 5, 7]);
    let specs: Vec<_> = volume.arrays.iter().map(|a| ArraySpec::new(&a.name, a.values.kind(), a.components)).collect();
    for encoding in ENCODINGS {
        for compression in COMPRESSIONS {
            let settings = settings(encoding, compression, &volume);
            let mut writer = VtiWriter::new(Cursor::new(Vec::new()), &volume.grid, &specs, &settings).unwrap();
            for layers in [0..3, 3..4, 4..7] {
                for (i, array) in volume.arrays.iter().enumerate() {
                    let layer = volume.grid.layer_len() * array.components;
                    let mut bytes = Vec::new();
                    array.values.extend_le_bytes(layers.start * layer..layers.end * layer, &mut bytes);
                    let slab = array.values.kind().decode(&bytes, true);
                    writer.write_slab(i, layers.start, &slab).unwrap();
                }
            }
            assert_eq!(writer.finish().unwrap().into_inner(), written(&volume, &settings));
        }
    }
}

#[test]
fn numbers_may_be_set_until_the_file_is_finished() {
    let volume = volume([9, 5, 7]);
    let specs: Vec<_> = volume.arrays.iter().map(|a| ArraySpec::new(&a.name, a.values.kind(), a.components)).collect();
    for encoding in ENCODINGS {
        for compression in COMPRESSIONS {
            // As long as a number's text can be, and as short.
            for number in [0.0, -1.797_693_134_862_315_7e308, 0.1 + 0.2] {
                let with = |number| Settings {
                    numbers: vec![("error".into(), number)],
                    ..settings(encoding, compression, &volume)
                };
                let write = |first: f64| {
                    let mut writer =
                        VtiWriter::new(Cursor::new(Vec::new()), &volume.grid, &specs, &with(first)).unwrap();
                    for (i, array) in volume.arrays.iter().enumerate() {
                        writer.write_slab(i, 0, &array.values).unwrap();
                    }
                    writer.set_number("error", number);
                    writer.finish().unwrap().into_inner()
                };
                let bytes = write(0.0);
                assert_eq!(bytes, write(number), "{number} {encoding:?} {compression:?}");
                let read = parsed(&bytes);
                assert_eq!((&read.grid, &read.arrays), (&volume.grid, &volume.arrays));
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let told = text.split("Name=\"error\"").nth(1).unwrap().split(['>', '<']).nth(1).unwrap();
                assert_eq!(told.trim().parse::<f64>().unwrap(), number);
            }
        }
    }
}

#[test]
fn what_was_not_announced_is_refused() {
    let volume = volume([2, 3, 4]);
    let specs = [ArraySpec::new("opacity", Kind::F32, 1)];
    let new = |grid: &Grid, specs: &[ArraySpec], settings: &Settings| {
        VtiWriter::new(Cursor::new(Vec::new()), grid, specs, settings)
    };
    let writer = || new(&volume.grid, &specs, &Settings::default()).unwrap();
    assert!(writer().write_slab(1, 0, &Values::F32(vec![0.0; 6])).is_err());
    assert!(writer().write_slab(0, 0, &Values::F64(vec![0.0; 6])).is_err());
    assert!(writer().write_slab(0, 1, &Values::F32(vec![0.0; 6])).is_err());
    assert!(writer().write_slab(0, 0, &Values::F32(vec![0.0; 7])).is_err());
    assert!(writer().write_slab(0, 0, &Values::F32(vec![0.0; 30])).is_err());
    let mut unfinished = writer();
    unfinished.write_slab(0, 0, &Values::F32(vec![0.0; 18])).unwrap();
    let error = unfinished.finish().err().unwrap().to_string();
    assert!(error.contains("`opacity`: 3 layers where 4"), "{error}");

    let grid = |dimensions, spacing| Grid { dimensions, spacing, ..volume.grid };
    assert!(new(&grid([0, 1, 1], [1.0; 3]), &specs, &Settings::default()).is_err());
    assert!(new(&grid([1 << 30; 3], [1.0; 3]), &specs, &Settings::default()).is_err());
    assert!(new(&grid([1; 3], [f64::NAN, 1.0, 1.0]), &specs, &Settings::default()).is_err());
    assert!(new(&volume.grid, &[specs[0].clone(), specs[0].clone()], &Settings::default()).is_err());
    let named = |name: &str| Settings { field_data: vec![(name.into(), "a\0b".into())], ..Settings::default() };
    assert!(new(&volume.grid, &specs, &named("\u{1}")).is_err());
    assert!(new(&volume.grid, &specs, &named("text")).is_err());
}

#[test]
fn no_part_of_a_file_is_taken_for_the_whole() {
    let volume = volume([3, 4, 5]);
    for encoding in ENCODINGS {
        for compression in COMPRESSIONS {
            let bytes = written(&volume, &settings(encoding, compression, &volume));
            // The last byte is a newline.
            for length in 0..bytes.len() - 1 {
                assert!(vtk::parse(&bytes[..length]).is_err(), "{encoding:?} {compression:?} cut at {length}");
            }
        }
    }
}

/// Numbers from a fixed seed, for mutations (Marsaglia's xorshift).
fn random(state: &mut u64) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 16) as usize
}

#[test]
fn damaged_files_neither_panic_nor_ask_for_memory() {
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let volume = volume([3, 4, 5]);
    let mut files = Vec::new();
    for encoding in ENCODINGS {
        files.extend(COMPRESSIONS.map(|c| written(&volume, &settings(encoding, c, &volume))));
    }
    let mut mesh = Vec::new();
    let points = [[0f32; 3], [1.0; 3], [2.0; 3], [3.0; 3]];
    vtu::write(&mut mesh, &points, vtu::Cells::Tetrahedra(&[[0, 1, 2, 3]]), &[], &[]).unwrap();
    files.push(mesh);
    let (mut refused, mut taken) = (0, 0);
    for file in &files {
        let interesting: Vec<usize> = (0..file.len()).filter(|&i| file[i] != b' ').collect();
        for _ in 0..1500 {
            let mut bytes = file.clone();
            for _ in 0..1 + random(&mut state) % 3 {
                let at = interesting[random(&mut state) % interesting.len()];
                // A digit often, as sizes and counts are what hurts most.
                bytes[at] = match random(&mut state) % 3 {
                    0 => b'0' + (random(&mut state) % 10) as u8,
                    1 => random(&mut state) as u8,
                    _ => bytes[at] ^ 1 << (random(&mut state) % 8),
                };
            }
            match vtk::parse(&bytes) {
                Ok(_) => taken += 1,
                Err(e) => refused += usize::from(!e.to_string().is_empty()),
            }
        }
    }
    // Most bytes are numbers that nothing protects; both outcomes must have been seen.
    assert!(refused > 500 && taken > 500, "{refused} refused, {taken} taken");
}

#[test]
fn claims_of_astronomic_size_are_refused() {
    let volume = volume([3, 4, 5]);
    for encoding in ENCODINGS {
        for compression in COMPRESSIONS {
            let bytes = written(&volume, &settings(encoding, compression, &volume));
            let text = bytes.iter().map(|&b| char::from(b)).collect::<String>();
            for extent in ["0 2000000000 0 2000000000 0 4", "0 99999999 0 3 0 4", "0 -2 0 3 0 4", "0 1e9 0 3 0 4"] {
                let changed = text.replace("0 2 0 3 0 4", extent);
                let changed: Vec<u8> = changed.chars().map(|c| c as u8).collect();
                assert!(vtk::parse(&changed).is_err(), "{extent}");
            }
        }
    }
}

#[test]
fn foreign_files_are_named() {
    let message = |bytes: &[u8]| vtk::parse(bytes).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(message(b"").contains("empty"));
    assert!(message(b"\x89PNG\r\n\x1a\n....").contains("not a VTK file"));
    assert!(message(b"solid ant\nfacet").contains("begins with \"solid ant"));
    assert!(message(b"# vtk DataFile Version 3.0\n").contains("cut off"));
    assert!(message(b"<VTKFile type=\"Table\"><Table/></VTKFile>").contains("holds Table"));
    let missing = ao4d::io::vtk::read_volume(Path::new("does/not/exist.vti")).unwrap_err().to_string();
    assert!(missing.contains("does/not/exist.vti"), "{missing}");
}

/// A fresh folder for one test's files.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs the checks in Python, which must be there.
fn python(task: &str, folder: &Path) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("AO4D_PYTHON").map_or_else(|| root.join(".venv/bin/python"), PathBuf::from);
    let script = root.join("tests/python/check_vtk.py");
    let output = Command::new(&python).arg(script).arg(task).arg(folder).output();
    let output = output.unwrap_or_else(|e| {
        panic!("{}: {e}; set AO4D_PYTHON to a Python that has the packages vtk and numpy", python.display())
    });
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

#[test]
#[ignore = "needs VTK: run tests/all"]
fn vtk_reads_what_is_written() {
    let folder = folder("ours");
    let mut count = 0;
    for dimensions in [[1, 1, 1], [5, 7, 1], [9, 4, 5], [64, 32, 32]] {
        let volume = volume(dimensions);
        for encoding in ENCODINGS {
            for compression in COMPRESSIONS {
                let [w, h, d] = dimensions;
                let name = format!("{w}x{h}x{d}-{encoding:?}-{compression:?}.vti");
                let settings = Settings { time: Some(0.1), ..settings(encoding, compression, &volume) };
                let file = AtomicFile::create(folder.join(name)).unwrap();
                vti::write(file, &volume, &settings).unwrap().commit().unwrap();
                count += 1;
            }
        }
        let rgb: Vec<f32> = (0..3 * volume.grid.len()).map(|i| i as f32 / 7.0).collect();
        let [w, h, d] = dimensions;
        let file = AtomicFile::create(folder.join(format!("{w}x{h}x{d}.raw"))).unwrap();
        let mut writer = raw::RawWriter::new(file, &volume.grid);
        writer.write_slab(0, &rgb).unwrap();
        writer.finish().unwrap().commit().unwrap();
        count += 1;
    }
    let points = [[0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / 3.0], [1.0; 3]];
    let arrays = [
        Array::new("position", 4, (0..20).map(|i| i as f32 / 3.0).collect::<Vec<_>>()),
        Array::new("ambient_occlusion", 1, (0..5).map(|i| i as f32 / 4.0).collect::<Vec<_>>()),
        Array::new("object", 1, vec![1u16, 1, 2, 2, 65535]),
    ];
    let measure = [Array::new("measure", 1, vec![0.1f64, 0.2])];
    let tetrahedra = vtu::Cells::Tetrahedra(&[[0, 1, 2, 3], [1, 2, 3, 4]]);
    let triangles = vtu::Cells::Triangles(&[[0, 1, 2], [1, 2, 4]]);
    let none = vtu::Cells::Tetrahedra(&[]);
    for (name, points, cells, arrays, measure) in [
        ("tetrahedra.vtu", &points[..], tetrahedra, &arrays[..], &measure[..]),
        ("triangles.vtu", &points, triangles, &arrays, &measure),
        ("points.vtu", &points, none, &arrays, &[]),
        ("nothing.vtu", &[], none, &[], &[]),
    ] {
        let mut file = AtomicFile::create(folder.join(name)).unwrap();
        vtu::write(&mut file, points, cells, arrays, measure).unwrap();
        file.commit().unwrap();
        count += 1;
    }
    let text = python("ours", &folder);
    assert!(text.contains(&format!("{count} files checked")), "{text}");
}

#[test]
#[ignore = "needs VTK: run tests/all"]
fn what_vtk_writes_is_read() {
    let folder = folder("theirs");
    python("theirs", &folder);
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let read = |path: &Path| vtk::read(path).unwrap_or_else(|e| panic!("{e}"));
    let is_reference = |path: &PathBuf| path.to_string_lossy().contains("-reference.");
    let (references, files): (Vec<_>, Vec<_>) = files.into_iter().partition(is_reference);
    let (mut images, mut meshes) = (0, 0);
    for reference in references {
        let case = reference.file_name().unwrap().to_string_lossy();
        let case = case.split_once('-').unwrap().0;
        // Each case is also written as text without VTK's writers; all of VTK's ways must say the same.
        let expected = read(&reference);
        for path in files.iter().filter(|p| p.file_name().unwrap().to_string_lossy().starts_with(case)) {
            let found = read(path);
            let comparison = compare::data_sets(&found, &expected, &Tolerance::default());
            assert!(comparison.same && !comparison.arrays.is_empty(), "{}:\n{comparison}", path.display());
            match (&found, &expected) {
                (DataSet::Image(found), DataSet::Image(expected)) => {
                    assert_eq!((found.grid, &found.field_data), (expected.grid, &expected.field_data));
                    images += 1;
                }
                (DataSet::Unstructured(found), DataSet::Unstructured(expected)) => {
                    assert_eq!(found.field_data, expected.field_data);
                    assert!(found.cells().count() > 0);
                    meshes += 1;
                }
                _ => panic!("{}", path.display()),
            }
        }
    }
    // Cases times modes times compressors times header types and byte orders: see `WAYS` in the script.
    assert_eq!((images, meshes), (4 * 27, 2 * 27));
}
