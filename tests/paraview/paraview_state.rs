//! ParaView itself runs the states that the library writes, and the pictures are looked at pixel by pixel.
//!
//! These tests need ParaView, Xvfb and the Python environment that `tests/install` makes; `tests/all` runs them.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ao4d::io::paraview::{Axis, ColorBy, Cut, Figure, Hidden, Kind, Panel, Source, Style, Tubes, state};
use ao4d::volume::Grid;

/// A small image: its grid, and the colour of each voxel, none where there is nothing.
struct Image {
    grid: Grid,
    voxels: Vec<Option<[u8; 3]>>,
}

impl Image {
    fn new(grid: Grid, colour: impl Fn([usize; 3]) -> Option<[u8; 3]>) -> Self {
        let [nx, ny, nz] = grid.dimensions;
        let voxels = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
        Image { grid, voxels: voxels.map(colour).collect() }
    }

    /// As `.vti`, in characters, so that these tests stand on no writer of the library. Ambient occlusion is a tenth in
    /// red voxels, else 1; bodies are told apart by their red.
    fn write_vti(&self, path: &Path) {
        let [x, y, z] = self.grid.dimensions.map(|n| n - 1);
        let ([ox, oy, oz], [sx, sy, sz]) = (self.grid.origin, self.grid.spacing);
        let (mut rgba, mut opacity, mut occlusion, mut object) = <(String, String, String, String)>::default();
        for voxel in &self.voxels {
            let [r, g, b] = voxel.unwrap_or([255; 3]);
            let opaque = u8::from(voxel.is_some());
            write!(rgba, "{r} {g} {b} {} ", 255 * opaque).unwrap();
            write!(opacity, "{opaque} ").unwrap();
            write!(occlusion, "{} ", if r > g { 0.1 } else { 1.0 }).unwrap();
            write!(object, "{} ", opaque * (1 + u8::from(r > g))).unwrap();
        }
        let text = format!(
            r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<ImageData WholeExtent="0 {x} 0 {y} 0 {z}" Origin="{ox} {oy} {oz}" Spacing="{sx} {sy} {sz}">
<Piece Extent="0 {x} 0 {y} 0 {z}"><PointData Scalars="opacity">
<DataArray type="UInt8" Name="rgba" NumberOfComponents="4" format="ascii">{rgba}</DataArray>
<DataArray type="Float32" Name="opacity" format="ascii">{opacity}</DataArray>
<DataArray type="Float32" Name="ambient_occlusion" format="ascii">{occlusion}</DataArray>
<DataArray type="UInt16" Name="object" format="ascii">{object}</DataArray>
</PointData></Piece></ImageData></VTKFile>"#
        );
        fs::write(path, text).unwrap();
    }

    /// As `.raw`: float32 triples.
    fn write_raw(&self, path: &Path) {
        let channels = self.voxels.iter().flat_map(|v| v.unwrap_or([255; 3]));
        let bytes: Vec<u8> = channels.flat_map(|c| (f32::from(c) / 255.0).to_le_bytes()).collect();
        fs::write(path, bytes).unwrap();
    }
}

fn cube(n: usize) -> Grid {
    let spacing = 2.0 / n as f64;
    Grid { dimensions: [n; 3], origin: [spacing / 2.0 - 1.0; 3], spacing: [spacing; 3] }
}

/// A ball in the middle, grey all over, or dark towards -x as if occluded.
fn ball(occluded: bool) -> Image {
    let grid = cube(20);
    Image::new(grid, |index| {
        let [x, y, z] = grid.point(index);
        let inside = x * x + y * y + z * z < 0.7;
        inside.then_some([if occluded { 4 + 10 * index[0] as u8 } else { 204 }; 3])
    })
}

/// Bars from the middle: red towards +x, green towards +y, blue towards +z.
fn axes() -> Image {
    let grid = Grid { dimensions: [21; 3], origin: [-7.0, 0.5, 3.0], spacing: [0.1; 3] };
    Image::new(grid, |index| {
        let along = |axis: usize| index[axis] > 12 && (0..3).all(|a| a == axis || index[a].abs_diff(10) < 3);
        if index.iter().all(|i| i.abs_diff(10) < 3) {
            return Some([90, 90, 90]);
        }
        (0..3).find(|&axis| along(axis)).map(|axis| std::array::from_fn(|c| if c == axis { 200 } else { 0 }))
    })
}

fn figure(source: Source, panels: &[(&str, &str, &Image)]) -> Figure {
    let panel = |&(file, caption, image): &(&str, &str, &Image)| Panel {
        kind: Kind::Volume,
        files: vec![file.into()],
        caption: caption.into(),
        grid: Some(image.grid),
        edges: None,
    };
    Figure {
        title: "test".into(),
        program: "ao4d".into(),
        panels: panels.iter().map(panel).collect(),
        source,
        cut: Cut::Octant { corner: None },
        film: None,
        screenshot: Some("figure.png".into()),
        size: Some([800, 500]),
        style: Style::Voxels,
        color_by: ColorBy::Rgba,
        colorbar: false,
        tubes: None,
    }
}

/// Runs a program under an X server of its own; ParaView is given five minutes.
fn run(program: &str, arguments: &[&Path], folder: &Path) -> Output {
    let headless = Path::new(env!("CARGO_MANIFEST_DIR")).join("paraview/headless");
    Command::new(&headless)
        .args(["timeout", "300", program])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap_or_else(|e| panic!("{} does not start: {e}; run tests/install", headless.display()))
}

/// Runs a state that is to succeed.
fn draw(program: &str, arguments: &[&Path], folder: &Path) {
    let output = run(program, arguments, folder);
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{program} failed with {}:\n{out}\n{err}", output.status);
    assert!(!err.contains("ERR|") && !err.contains("Traceback"), "{program} complains:\n{out}\n{err}");
    assert!(out.contains("wrote "), "{program} wrote nothing:\n{out}\n{err}");
}

#[derive(PartialEq)]
struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn read(path: &Path) -> Self {
        let file = fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.bit_depth, png::BitDepth::Eight);
        let pixels = bytes.chunks_exact(info.color_type.samples()).map(|p| [p[0], p[1], p[2]]).collect();
        Picture { width: info.width as usize, height: info.height as usize, pixels }
    }

    /// The pixels of a part, its corners given in fractions from the left and from the top, with their places in it
    /// from 0 to 1.
    fn part(&self, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> Vec<([f64; 2], [u8; 3])> {
        let at = |fraction: f64, size: usize| (fraction * size as f64).round() as usize;
        let (x0, x1) = (at(left, self.width), at(right, self.width));
        let (y0, y1) = (at(top, self.height), at(bottom, self.height));
        let place = |x: usize, y: usize| [(x - x0) as f64 / (x1 - x0) as f64, (y - y0) as f64 / (y1 - y0) as f64];
        let rows = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y)));
        rows.map(|(x, y)| (place(x, y), self.pixels[x + self.width * y])).collect()
    }
}

/// How many pixels have a colour.
fn count(part: &[([f64; 2], [u8; 3])], colour: impl Fn([u8; 3]) -> bool) -> usize {
    part.iter().filter(|p| colour(p.1)).count()
}

/// The mean place of the pixels in which one channel stands out.
fn centre(part: &[([f64; 2], [u8; 3])], channel: usize) -> [f64; 2] {
    let stands_out = |c: &[u8; 3]| (0..3).all(|k| k == channel || i32::from(c[channel]) - i32::from(c[k]) > 60);
    let found: Vec<_> = part.iter().filter(|p| stands_out(&p.1)).map(|p| p.0).collect();
    assert!(found.len() > 20, "channel {channel} is seen in {} pixels only", found.len());
    std::array::from_fn(|a| found.iter().map(|p| p[a]).sum::<f64>() / found.len() as f64)
}

fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// Writes a state and returns where it is.
fn write_state(folder: &Path, figure: &Figure) -> PathBuf {
    let path = folder.join("figure.py");
    fs::write(&path, state(figure)).unwrap();
    path
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn the_picture_shows_both_volumes_wherever_the_folder_is() {
    let folder = scratch();
    let (with, without) = (ball(true), ball(false));
    with.write_vti(&folder.path().join("with.vti"));
    without.write_vti(&folder.path().join("without.vti"));
    let figure =
        figure(Source::Vti, &[("with.vti", "with ambient occlusion", &with), ("without.vti", "without", &without)]);
    write_state(folder.path(), &figure);
    draw("pvbatch", &[Path::new("figure.py")], folder.path());
    let picture = Picture::read(&folder.path().join("figure.png"));
    assert_eq!((picture.width, picture.height), (800, 500));

    // The captions and the corners: black on white.
    assert!(count(&picture.part([0.0, 0.5], [0.0, 0.1]), |c| c[0] < 40) > 50, "no caption");
    for corner in [0, 799, 800 * 499, 800 * 500 - 1] {
        assert_eq!(picture.pixels[corner], [255; 3], "the background is white");
    }
    // The slices show the colours of the files exactly: all the greys on the left, the one grey on the right.
    let (left, right) = (picture.part([0.0, 0.5], [0.72, 0.92]), picture.part([0.5, 1.0], [0.72, 0.92]));
    for grey in (4..18).map(|i| 4 + 10 * i as u8) {
        assert!(count(&left, |c| c == [grey; 3]) > 20, "no pixel has the grey {grey} of the file");
    }
    assert!(count(&right, |c| c == [204; 3]) > 3000, "the second volume is not seen");
    assert_eq!(count(&right, |c| c[0] < 120), 0, "the second volume has dark voxels");
    assert_eq!(count(&left, |c| c[0] != c[1] || c[1] != c[2]), 0, "grey has turned to a colour");
    // The cut volumes: grey of 204 dimmed by at most three tenths; darker and lighter on the left, darker in the mean.
    let (left, right) = (picture.part([0.1, 0.4], [0.2, 0.6]), picture.part([0.6, 0.9], [0.2, 0.6]));
    let solid = |c: [u8; 3]| c[0] < 206;
    assert!(count(&left, solid) > 8000 && count(&right, solid) > 8000, "the volumes are not seen");
    assert!(count(&left, |c| c[0] < 100) > 1000, "the occluded side is not dark");
    assert!(count(&right, |c| c[0] < 138) < 50, "a volume without occlusion is dark");

    // The same picture, bit by bit, after the folder has moved, from another folder, into a third.
    let elsewhere = scratch();
    let moved = elsewhere.path().join("a b'\u{e9}");
    let pictures = elsewhere.path().join("pictures").join("new");
    fs::rename(folder.path(), &moved).unwrap();
    fs::remove_file(moved.join("figure.png")).unwrap();
    draw("pvbatch", &[&moved.join("figure.py"), Path::new("pictures/new")], elsewhere.path());
    assert!(!moved.join("figure.png").exists(), "the picture goes where it is told");
    assert!(Picture::read(&pictures.join("figure.png")) == picture, "the moved folder gives another picture");

    // And by way of raw numbers, under ParaView's other interpreter, whose pictures may differ in a few pixels.
    with.write_raw(&moved.join("with.raw"));
    without.write_raw(&moved.join("without.raw"));
    let mut raw = figure;
    raw.source = Source::Raw;
    raw.panels[0].files = vec!["with.raw".into()];
    raw.panels[1].files = vec!["without.raw".into()];
    write_state(&moved, &raw);
    draw("pvpython", &[&moved.join("figure.py")], elsewhere.path());
    let by_raw = Picture::read(&moved.join("figure.png"));
    let different = by_raw.pixels.iter().zip(&picture.pixels).filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 2));
    let different = different.count();
    assert!(different < 400, "{different} pixels differ between .raw and .vti");
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn no_axis_is_mirrored() {
    let folder = scratch();
    let axes = axes();
    let check = |source: Source, file: &str| {
        let mut figure = figure(source, &[(file, "", &axes)]);
        figure.cut = Cut::None;
        figure.size = Some([480, 600]);
        write_state(folder.path(), &figure);
        draw("pvbatch", &[Path::new("figure.py")], folder.path());
        let picture = Picture::read(&folder.path().join("figure.png"));
        // From the upper right in front: x to the right, y up, z towards the viewer and so to the lower left.
        let volume = picture.part([0.0, 1.0], [0.0, 0.7]);
        let [red, green, blue] = [0, 1, 2].map(|channel| centre(&volume, channel));
        assert!(
            red[0] > green[0] + 0.05 && red[0] > blue[0] + 0.1,
            "x is not to the right: {red:?} {green:?} {blue:?}"
        );
        assert!(green[1] < red[1] - 0.05 && green[1] < blue[1] - 0.1, "y is not up: {red:?} {green:?} {blue:?}");
        assert!(blue[0] < green[0] - 0.05 && blue[1] > red[1], "z is not to the front: {red:?} {green:?} {blue:?}");
        // The slices xy, xz and zy: their first axis to the right, their second up.
        for (slice, (right, up)) in [(0, 1), (0, 2), (2, 1)].into_iter().enumerate() {
            let thirds = [slice as f64 / 3.0, (slice + 1) as f64 / 3.0];
            let part = picture.part(thirds, [0.7, 1.0]);
            let (r, u) = (centre(&part, right), centre(&part, up));
            assert!(r[0] > u[0] + 0.15 && u[1] < r[1] - 0.15, "slice {slice} of {file}: {r:?} {u:?}");
            let exact = |channel: usize| count(&part, |c| (0..3).all(|k| c[k] == if k == channel { 200 } else { 0 }));
            assert!(exact(right) > 100 && exact(up) > 100, "the colours of {file} are not shown as they are");
        }
        figure.style = Style::Surface;
        write_state(folder.path(), &figure);
        draw("pvbatch", &[Path::new("figure.py")], folder.path());
        let volume = Picture::read(&folder.path().join("figure.png")).part([0.0, 1.0], [0.0, 1.0]);
        let [red, green, blue] = [0, 1, 2].map(|channel| centre(&volume, channel));
        assert!(red[0] > green[0] && green[0] > blue[0], "x is not to the right: {red:?} {green:?} {blue:?}");
        assert!(green[1] < red[1] && red[1] < blue[1], "y is not up: {red:?} {green:?} {blue:?}");
    };
    axes.write_vti(&folder.path().join("axes.vti"));
    check(Source::Vti, "axes.vti");
    axes.write_raw(&folder.path().join("axes.raw"));
    check(Source::Raw, "axes.raw");
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn images_plane_cuts_and_empty_volumes() {
    let folder = scratch();
    // A 3D scene: one layer, dark below on the left.
    let grid = Grid { dimensions: [40, 30, 1], origin: [-0.975, -0.725, 0.0], spacing: [0.05, 0.05, 1.0] };
    let flat = Image::new(grid, |[i, j, _]| (j < 15).then_some([if i < 20 { 60 } else { 204 }; 3]));
    let empty = Image::new(cube(6), |_| None);
    let solid = Image::new(cube(8), |[_, _, k]| Some([if k == 3 { 77 } else { 204 }; 3]));
    for (name, image) in [("flat.vti", &flat), ("empty.vti", &empty), ("solid.vti", &solid)] {
        image.write_vti(&folder.path().join(name));
    }
    let panels = [("flat.vti", "", &flat), ("empty.vti", "", &empty), ("solid.vti", "", &solid)];
    let mut figure = figure(Source::Vti, &panels);
    figure.cut = Cut::Plane { axis: Axis::Z, at: -0.1 };
    figure.size = Some([1200, 500]);
    write_state(folder.path(), &figure);
    draw("pvbatch", &[Path::new("figure.py")], folder.path());
    let picture = Picture::read(&folder.path().join("figure.png"));

    let flat = picture.part([0.0, 1.0 / 3.0], [0.0, 1.0]);
    let [dark, light] = [60, 204].map(|grey| flat.iter().filter(move |p| p.1 == [grey; 3]));
    assert!(dark.clone().count() > 15_000 && light.clone().count() > 15_000, "the image is not seen");
    assert!(dark.clone().all(|p| p.0[0] < 0.52) && light.clone().all(|p| p.0[0] > 0.48), "left is not left");
    assert!(dark.chain(light).all(|p| p.0[1] > 0.45), "the lower half is not below");

    let empty = picture.part([1.0 / 3.0, 2.0 / 3.0], [0.0, 1.0]);
    assert!(count(&empty, |c| c == [255; 3]) > 180_000, "an empty volume is not white");
    assert!(count(&empty, |c| c != [255; 3]) > 500, "an empty volume has its outline");

    // The other look: an image as it is, nothing at all, and a solid that the image's border closes.
    let plain = picture;
    write_state(folder.path(), &Figure { style: Style::Surface, ..figure.clone() });
    draw("pvbatch", &[Path::new("figure.py")], folder.path());
    let picture = Picture::read(&folder.path().join("figure.png"));
    let flat = picture.part([0.0, 1.0 / 3.0], [0.0, 1.0]);
    for grey in [60, 204] {
        assert!(count(&flat, |c| c == [grey; 3]) > 15_000, "the image is not seen");
    }
    let empty = picture.part([1.0 / 3.0, 2.0 / 3.0], [0.0, 1.0]);
    assert!(count(&empty, |c| c == [255; 3]) > 180_000, "an empty volume is not white");
    let solid = picture.part([2.0 / 3.0, 1.0], [0.0, 1.0]);
    assert!(count(&solid, |c| (60..230).contains(&c[0])) > 20_000, "the solid is not seen");
    let picture = plain;

    // The plane takes layers 4 to 7 away, and lays bare layer 3, dimmed by its direction.
    let solid = picture.part([2.0 / 3.0, 1.0], [0.0, 0.7]);
    assert!(count(&solid, |c| c[0] > 50 && c[0] < 79) > 5000, "the layer behind the plane is not laid bare");
    let slices = picture.part([2.0 / 3.0, 7.0 / 9.0], [0.75, 0.88]);
    assert!(count(&slices, |c| c == [77; 3]) > 3000, "the slice is not the layer at the plane");
}

/// Two balls that touch, red and blue, on a floor that goes on beyond the image, and a rod one voxel thick.
fn still_life() -> Image {
    let grid = cube(40);
    Image::new(grid, |index| {
        let [x, y, z] = grid.point(index);
        let ball = |cx: f64| ((x - cx).powi(2) + y * y + z * z).sqrt() < 0.4;
        let rod = index[1] == 34 && index[2] == 20;
        match y {
            _ if ball(-0.4) => Some([200, 0, 0]),
            _ if ball(0.4) => Some([0, 0, 200]),
            _ if y < -0.6 || rod => Some([0, 200, 0]),
            _ => None,
        }
    })
}

fn surface(panels: &[(&str, &str, &Image)]) -> Figure {
    Figure { style: Style::Surface, cut: Cut::None, size: Some([900, 800]), ..figure(Source::Vti, panels) }
}

/// A pixel's hue where it has one: the channel that stands out.
fn hue(c: [u8; 3]) -> Option<usize> {
    (0..3).find(|&k| (0..3).all(|j| j == k || i32::from(c[k]) > 2 * i32::from(c[j]) + 30))
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn bodies_have_smooth_skins_in_their_own_colours() {
    let folder = scratch();
    let image = still_life();
    image.write_vti(&folder.path().join("a.vti"));
    let path = folder.path().join("figure.png");
    let draw_figure = |figure: &Figure| {
        write_state(folder.path(), figure);
        draw("pvbatch", &[Path::new("figure.py")], folder.path());
        Picture::read(&path)
    };
    let whole = draw_figure(&surface(&[("a.vti", "caption", &image)]));
    assert_eq!((whole.width, whole.height), (900, 800));
    let pixels = whole.part([0.0, 1.0], [0.0, 1.0]);
    for channel in 0..3 {
        let seen = count(&pixels, |c| hue(c) == Some(channel));
        assert!(seen > 8000, "channel {channel} is seen in {seen} pixels");
    }
    // No white rims: between red or blue inside and the white ground there are only the pixels of the edge itself.
    let rims = count(&pixels, |c| c.iter().filter(|&&v| (90..250).contains(&v)).count() == 3 && hue(c).is_none());
    assert!(rims < 16_000, "{rims} pale pixels: frame, text and edges are fewer");
    // The rod, one voxel thick, is there: green above the balls.
    let above = whole.part([0.1, 0.9], [0.05, 0.35]);
    assert!(count(&above, |c| hue(c) == Some(1)) > 1500, "what is one voxel thick is lost");
    // Smooth: light changes little from pixel to pixel on the ball, where boxes have steps.
    let red = |x: usize, y: usize| Some(whole.pixels[x + 900 * y]).filter(|&c| hue(c) == Some(0)).map(|c| c[0]);
    let (mut steps, mut places) = (0, 0);
    for (x, y) in (100..800).flat_map(|x| (100..700).map(move |y| (x, y))) {
        if let (Some(a), Some(b), Some(_), Some(_)) = (red(x, y), red(x + 1, y), red(x - 3, y), red(x + 4, y)) {
            places += 1;
            steps += usize::from(a.abs_diff(b) > 8);
        }
    }
    assert!(places > 8000 && steps * 100 < places, "{steps} steps in {places} places");

    // Cut by a plane through the balls' middles: caps in their colours, flat, and nothing in front.
    let mut cut = surface(&[("a.vti", "", &image)]);
    cut.cut = Cut::Plane { axis: Axis::Z, at: 0.0 };
    let opened = draw_figure(&cut);
    let inside = opened.part([0.0, 1.0], [0.0, 1.0]);
    let caps = |channel: usize| {
        let mut shades = std::collections::BTreeMap::<u8, usize>::new();
        let seen = inside.iter().filter(|p| hue(p.1) == Some(channel));
        seen.for_each(|p| *shades.entry(p.1[channel]).or_default() += 1);
        shades.values().copied().max().unwrap_or(0)
    };
    assert!(caps(0) > 8000 && caps(2) > 8000, "the caps are not flat: {} and {}", caps(0), caps(2));
    cut.cut = Cut::Octant { corner: None };
    assert!(draw_figure(&cut).pixels != opened.pixels, "an octant is not a plane");

    // By the colour map: what is a tenth open is dark, what is open is bright, and there is a bar with both.
    let mut mapped = surface(&[("a.vti", "", &image)]);
    (mapped.color_by, mapped.colorbar) = (ColorBy::AmbientOcclusion, true);
    let mapped = draw_figure(&mapped);
    let (middle, foot) = (mapped.part([0.0, 1.0], [0.1, 0.8]), mapped.part([0.2, 0.8], [0.86, 1.0]));
    let dark = |c: [u8; 3]| c.iter().all(|&v| v < 90);
    assert!(count(&middle, dark) > 8000, "what is occluded is not dark");
    assert!(count(&middle, |c| c[0] > 180 && c[1] > 180 && c[2] < 170) > 30_000, "what is open is not bright");
    let orange = |c: [u8; 3]| c[0] > 200 && (80..190).contains(&c[1]) && c[2] < 80;
    assert!(count(&foot, dark) > 100 && count(&foot, orange) > 100, "there is no colour bar");
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn wrong_files_are_told() {
    let folder = scratch();
    let image = ball(true);
    let raw = folder.path().join("a.raw");
    write_state(folder.path(), &figure(Source::Raw, &[("a.raw", "", &image)]));
    let complaint = || {
        let output = run("pvbatch", &[Path::new("figure.py")], folder.path());
        assert!(!folder.path().join("figure.png").exists());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let text = complaint();
    assert!(text.contains("a.raw is missing: it belongs beside this state"), "{text}");
    image.write_raw(&raw);
    let bytes = fs::read(&raw).unwrap();
    fs::write(&raw, &bytes[1..]).unwrap();
    let text = complaint();
    assert!(text.contains("a.raw has 95999 bytes, but 20 x 20 x 20 voxels of three float32 are 96000"), "{text}");

    Image::new(cube(6), |_| None).write_vti(&folder.path().join("a.vti"));
    write_state(folder.path(), &figure(Source::Vti, &[("a.vti", "", &image)]));
    let text = complaint();
    assert!(text.contains("a.vti has 6 x 6 x 6 voxels, but this state was written for 20 x 20 x 20"), "{text}");
}

/// A `.vtp` of lines, or of triangles, over points, in characters.
fn write_polydata(path: &Path, points: &[[f32; 3]], cells: &[Vec<usize>], arrays: &str) {
    let list = |numbers: &mut dyn Iterator<Item = String>| numbers.collect::<Vec<_>>().join(" ");
    let coordinates = list(&mut points.iter().flatten().map(|x| x.to_string()));
    let connectivity = list(&mut cells.iter().flatten().map(|i| i.to_string()));
    let offsets = list(&mut (1..=cells.len()).map(|k| (k * cells[0].len()).to_string()));
    let lines = cells[0].len() == 2;
    let (name, lines, polys) = if lines { ("Lines", cells.len(), 0) } else { ("Polys", 0, cells.len()) };
    let text = format!(
        r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"><PolyData>
<Piece NumberOfPoints="{}" NumberOfVerts="0" NumberOfLines="{lines}" NumberOfStrips="0" NumberOfPolys="{polys}">
{arrays}<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">{coordinates}</DataArray></Points>
<{name}><DataArray type="Int64" Name="connectivity" format="ascii">{connectivity}</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">{offsets}</DataArray></{name}>
</Piece></PolyData></VTKFile>"#,
        points.len()
    );
    fs::write(path, text).unwrap();
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn edges_are_tubes_beside_volumes_and_over_them() {
    let folder = scratch();
    let image = ball(false);
    image.write_vti(&folder.path().join("ball.vti"));
    // The middle one of three lines along x is hidden; the distance grows from left to right.
    let points: Vec<[f32; 3]> = (0..6).map(|k| [[-0.8, 0.8][k % 2], [-0.5, 0.0, 0.5][k / 2], 0.8]).collect();
    let cells: Vec<Vec<usize>> = (0..3).map(|k| vec![2 * k, 2 * k + 1]).collect();
    let arrays = r#"<PointData><DataArray type="Float32" Name="depth" format="ascii">1 3 1 3 1 3</DataArray></PointData>
<CellData><DataArray type="UInt8" Name="visible" format="ascii">1 0 1</DataArray></CellData>"#;
    write_polydata(&folder.path().join("edges.vtp"), &points, &cells, arrays);
    // A square of two objects, half of it occluded.
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let arrays = r#"<PointData><DataArray type="Float32" Name="ambient_occlusion" format="ascii">1 1 1 1</DataArray>
<DataArray type="UInt16" Name="object" format="ascii">1 1 1 1</DataArray></PointData>"#;
    write_polydata(&folder.path().join("slice.vtp"), &square, &[vec![0, 1, 2], vec![0, 2, 3]], arrays);

    let mut figure = figure(Source::Vti, &[("ball.vti", "", &image)]);
    let edges = Panel { kind: Kind::Edges, files: vec!["edges.vtp".into()], ..figure.panels[0].clone() };
    let slices = Panel { kind: Kind::Slices, files: vec!["slice.vtp".into()], grid: None, ..edges.clone() };
    figure.panels[0].edges = Some("edges.vtp".into());
    figure.panels.extend([edges, slices]);
    (figure.style, figure.cut, figure.size) = (Style::Surface, Cut::None, Some([1200, 400]));
    let mut draw_with = |hidden: Hidden, color_by: Option<&'static str>| {
        figure.tubes = Some(Tubes { color_by, hidden, radius: Some(0.03), skin: 0.3 });
        write_state(folder.path(), &figure);
        draw("pvbatch", &[Path::new("figure.py")], folder.path());
        Picture::read(&folder.path().join("figure.png"))
    };
    let panel = |picture: &Picture, k: usize| picture.part([k as f64 / 3.0, (k + 1) as f64 / 3.0], [0.1, 0.9]);
    let grey = |c: [u8; 3]| c[0].abs_diff(c[1]) < 8 && c[1].abs_diff(c[2]) < 8;
    let (dark, pale) = (|c: [u8; 3]| grey(c) && c[0] < 90, |c: [u8; 3]| grey(c) && (130..245).contains(&c[0]));
    // All alike in ink; then the hidden one thin and pale; then gone.
    let same = draw_with(Hidden::Same, None);
    let thin = draw_with(Hidden::Thin, None);
    let gone = draw_with(Hidden::LeaveOut, None);
    let [all, thinner, fewer] = [&same, &thin, &gone].map(|picture| count(&panel(picture, 1), dark));
    assert!(all > 1000 && fewer > 600, "{all} {fewer}");
    assert!((thinner as f64 / all as f64 - 2.0 / 3.0).abs() < 0.1 && thinner.abs_diff(fewer) < fewer / 10, "{thinner}");
    let [light, none] = [&thin, &gone].map(|picture| count(&panel(picture, 1), pale));
    assert!(light > none + 200, "{light} {none}");
    // Over the volume, whose skin lets them through.
    assert!(count(&panel(&same, 0), dark) > 600, "no tubes over the volume");
    let ball = count(&panel(&same, 0), |c| grey(c) && c[0] > 180 && c[0] < 252);
    assert!(ball > 8000, "the skin is not seen: {ball}");
    // By depth: dark blue on the left, pale blue on the right.
    figure.size = None; // as panels of all kinds need
    let by_depth = {
        figure.tubes = Some(Tubes { color_by: Some("depth"), hidden: Hidden::LeaveOut, radius: Some(0.03), skin: 0.3 });
        write_state(folder.path(), &figure);
        draw("pvbatch", &[Path::new("figure.py")], folder.path());
        Picture::read(&folder.path().join("figure.png"))
    };
    assert_eq!(by_depth.width, 3198);
    let blue: Vec<_> = panel(&by_depth, 1).into_iter().filter(|p| i32::from(p.1[2]) - i32::from(p.1[0]) > 30).collect();
    let place = |deep: bool| {
        let some: Vec<f64> = blue.iter().filter(|p| (p.1[0] < 40) == deep).map(|p| p.0[0]).collect();
        assert!(some.len() > 50, "{}", some.len());
        some.iter().sum::<f64>() / some.len() as f64
    };
    assert!(place(true) < place(false) - 0.1, "near is dark, on the left");
    // The slice: its tint, in the third panel.
    let tint = count(&panel(&same, 2), |c| c[2] > c[0] && c[2] > 120 && c[0] > 60);
    assert!(tint > 8000, "the slice is not seen: {tint}");
}

#[test]
#[ignore = "needs the Python environment: run tests/all"]
fn the_text_is_sound_python() {
    let folder = scratch();
    let image = ball(true);
    let caption = "it's \\ \"\u{3b1}\u{1f600}\" @SIZE@\n";
    let mut figure = figure(Source::Vti, &[("a.vti", caption, &image)]);
    figure.cut = Cut::Plane { axis: Axis::Y, at: 1.0 / 3.0 };
    figure.style = Style::Surface;
    check_text(&write_state(folder.path(), &figure), caption);
    figure.style = Style::Voxels;
    check_text(&write_state(folder.path(), &figure), caption);
}

/// Has Python read a state, and looks at its constants.
fn check_text(path: &Path, caption: &str) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("AO4D_PYTHON").map_or_else(|| here.join(".venv/bin/python"), PathBuf::from);
    let output = Command::new(&python)
        .arg(here.join("tests/python/check_state.py"))
        .arg(path)
        .output()
        .unwrap_or_else(|e| panic!("{} does not start: {e}; run tests/install", python.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let constants: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(constants["PANELS"][0]["caption"], caption);
    assert_eq!(constants["PANELS"][0]["dimensions"], serde_json::json!([20, 20, 20]));
    assert_eq!(constants["CUT"], serde_json::json!(["plane", 1, 1.0 / 3.0]));
    assert_eq!(constants["SIZE"], serde_json::json!([800, 500]));
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn an_animation_has_a_picture_a_frame_and_a_film_where_ffmpeg_is() {
    let folder = scratch();
    let grid = cube(20);
    // A red block that goes from the left to the right, and a green one that stays.
    let frames: Vec<Image> = [3usize, 8, 13]
        .map(|at| {
            Image::new(grid, |index| {
                let block = |at: usize| (at..at + 4).contains(&index[0]) && index[2].abs_diff(10) < 4;
                match index[1] {
                    12..16 if block(at) => Some([200, 0, 0]),
                    4..8 if block(8) => Some([0, 200, 0]),
                    _ => None,
                }
            })
        })
        .into();
    let mut list = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        frame.write_vti(&folder.path().join(format!("a_{i:04}.vti")));
        list.push((i as f64 / 8.0, format!("a_{i:04}.vti")));
    }
    let names = list.iter().map(|(time, name)| (*time, name.as_str()));
    ao4d::io::pvd::write(fs::File::create(folder.path().join("a.pvd")).unwrap(), names).unwrap();
    let film = Some(ao4d::io::paraview::Film { frames: 3, rate: 8.0, times: None });
    let figure = Figure { film, size: Some([301, 280]), ..surface(&[("a.pvd", "", &frames[0])]) };
    write_state(folder.path(), &figure);
    // A stand-in for ffmpeg, which notes what it is asked for; and none.
    let tools = folder.path().join("tools");
    fs::create_dir(&tools).unwrap();
    fs::write(tools.join("ffmpeg"), "#!/bin/sh\nfor last; do :; done\necho \"$*\" > \"$last\"\n").unwrap();
    let path = std::env::var("PATH").unwrap();
    let headless = Path::new(env!("CARGO_MANIFEST_DIR")).join("paraview/headless");
    assert!(Command::new("chmod").arg("+x").arg(tools.join("ffmpeg")).status().unwrap().success());
    let output = Command::new(&headless)
        .args(["timeout", "300", "pvbatch", "figure.py"])
        .env("PATH", format!("{}:{path}", tools.display()))
        .current_dir(folder.path())
        .output()
        .unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && !err.contains("ERR|") && !err.contains("Traceback"), "{out}\n{err}");
    let asked = fs::read_to_string(folder.path().join("figure.mp4")).unwrap_or_else(|e| panic!("{e}: {out}\n{err}"));
    assert!(asked.contains("-framerate 8.0 -i ") && asked.contains("figure_%04d.png -frames:v 3 "), "{asked}");
    let picture = |name: &str| Picture::read(&folder.path().join(name));
    let places: Vec<[[f64; 2]; 2]> = (0..3)
        .map(|i| {
            let picture = picture(&format!("figure_{i:04}.png"));
            assert_eq!((picture.width, picture.height), (301, 280));
            let whole = picture.part([0.0, 1.0], [0.0, 1.0]);
            [0, 1].map(|channel| centre(&whole, channel))
        })
        .collect();
    // Red moves to the right, by as much each time or nearly; green stays where it is.
    let red: Vec<f64> = places.iter().map(|place| place[0][0]).collect();
    assert!(red[1] - red[0] > 0.05 && red[2] - red[1] > 0.05, "{red:?}");
    assert!(places.iter().all(|place| (place[1][0] - places[0][1][0]).abs() < 0.01), "{places:?}");
    assert!(picture("figure.png") == picture("figure_0000.png"), "the picture is the first frame");
}

/// Slices that are played: each at its time, which stands below it, the empty ones too, all seen from the same place.
#[test]
#[ignore = "needs ParaView: run tests/all"]
fn a_sequence_of_slices_is_played() {
    let folder = scratch();
    let arrays = r#"<PointData><DataArray type="UInt16" Name="object" format="ascii">1 1 1 1</DataArray></PointData>"#;
    let names = ["s-0.vtp", "s-1.vtp", "s-2.vtp"];
    for (name, x) in [(names[1], 0.0), (names[2], 3.0)] {
        let square = [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 1.0, 1.0, 0.5], [x, 1.0, 0.5]];
        write_polydata(&folder.path().join(name), &square, &[vec![0, 1, 2], vec![0, 2, 3]], arrays);
    }
    let empty = r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"><PolyData>
<Piece NumberOfPoints="0" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii"></DataArray></Points></Piece></PolyData></VTKFile>"#;
    fs::write(folder.path().join(names[0]), empty).unwrap();
    let times = vec![-0.5, 0.25, 1.0];
    let list = fs::File::create(folder.path().join("s.pvd")).unwrap();
    ao4d::io::pvd::write(list, times.iter().copied().zip(names)).unwrap();
    let panel =
        Panel { kind: Kind::Slices, files: vec!["s.pvd".into()], caption: String::new(), grid: None, edges: None };
    let film = Some(ao4d::io::paraview::Film { frames: 3, rate: 8.0, times: Some(times) });
    let cut = Cut::Octant { corner: None };
    let figure = Figure { film, cut, panels: vec![panel], size: Some([600, 500]), ..surface(&[]) };
    write_state(folder.path(), &figure);
    draw("pvbatch", &[Path::new("figure.py")], folder.path());
    let blue = |c: [u8; 3]| c[2] > c[0] && c[2] > 120 && c[0] > 40;
    let frame = |k: usize| Picture::read(&folder.path().join(format!("figure_{k:04}.png")));
    let seen = |k: usize, from: f64, to: f64| count(&frame(k).part([from, to], [0.1, 0.85]), blue);
    assert_eq!((seen(0, 0.0, 1.0), seen(1, 0.6, 1.0), seen(2, 0.0, 0.4)), (0, 0, 0));
    let (left, right) = (seen(1, 0.0, 0.4), seen(2, 0.6, 1.0));
    assert!(left > 2000 && right > 2000, "{left} {right}");
    // Where it is, in black.
    let dark = |k: usize| count(&frame(k).part([0.3, 0.7], [0.88, 1.0]), |c| c[0] < 80 && c[2] < 80);
    assert!((0..3).all(|k| dark(k) > 40), "{:?}", [0, 1, 2].map(dark));
}
