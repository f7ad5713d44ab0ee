//! Disks that are too small, too little memory, folders that can't be written to.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{FILES, Folder, contents, names};

#[test]
fn what_cannot_fit_is_told_before_anything_is_computed() {
    let folder = Folder::new();
    let began = Instant::now();
    // 14 bytes a voxel in one file, which tells objects apart for the figure, and 12 in another; and the other picture's 12.
    let large = ["--set", "image.dimensions=[4000, 4000, 65535]", "--set", "ao.samples=16777216"];
    let bytes = 4000 * 4000 * 65_535 * 26 + 7 * 6 * 5 * 12u64;
    let told = format!("out/small: {bytes} bytes are to be written, and the disk has ");
    folder.fails(&large, 3, &[&told, "elsewhere"]);
    // One layer: the simplex that a sample sees; simplex, albedo, occlusion and coverage of each voxel; rgba,
    // opacity, ambient occlusion and rgb of the files.
    let deep = ["--set", "image.dimensions=[65535, 65535, 1]", "--set", "ao.samples=16777216"];
    let bytes = 65_535u64 * 65_535 * (4 + (4 + 12 + 4 + 4) + (4 + 4 + 4 + 12));
    let told = format!("render image: one layer of its picture takes {bytes} bytes of memory, and ");
    folder.fails(&deep, 3, &[&told]);
    // All layers that there may be, of which nobody can say before how many there are.
    let layers = ["--set", "image.dimensions=[65535, 65535, 1]", "--set", "image.layers=1000"];
    folder.fails(&layers, 3, &["render image: one layer of its picture takes ", "or layers"]);
    folder.fails(&["--set", "image.layers=0"], 2, &["layers", "expected 1 to 1000, found 0"]);
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
}

#[cfg(unix)]
#[test]
fn folders_that_cannot_be_written_to() {
    let folder = Folder::new();
    std::fs::write(folder.path("file"), "").unwrap();
    // Told before 16 million rays a vertex are traced.
    for (out, place) in [("file", "file"), ("file/inside", "file/inside")] {
        folder.fails(&["--out", out, "--set", "ao.samples=16777216"], 3, &[place, "cannot make the folder"]);
    }
    assert_eq!(names(folder.0.path()), ["file", "p.yaml"]);
    // A folder where a file should be.
    std::fs::create_dir_all(folder.path("taken/image.vti")).unwrap();
    folder.fails(&["--out", "taken"], 2, &["image.vti", "is a folder"]);
    assert!(!names(&folder.path("taken")).iter().any(|name| name.ends_with(".partial")));
}

/// A disk of a few kilobytes, where one can be had.
#[cfg(target_os = "linux")]
struct TinyDisk(PathBuf);

#[cfg(target_os = "linux")]
impl TinyDisk {
    fn mount(at: PathBuf, kilobytes: u32) -> Option<Self> {
        std::fs::create_dir(&at).unwrap();
        let size = format!("size={kilobytes}k");
        let mut mount = Command::new("mount");
        let mounted = mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&at).stderr(Stdio::null()).status();
        mounted.is_ok_and(|status| status.success()).then_some(Self(at))
    }
}

#[cfg(target_os = "linux")]
impl Drop for TinyDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Needs the right to mount; without it, `/dev/full` tells the same story of the files' writer in its own tests.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up() {
    let folder = Folder::new();
    let mut whole = Vec::new();
    folder.runs(&["--out", "reference"]);
    let reference = contents(&folder.path("reference"));
    // The compressed file is not counted beforehand, so the disk itself has to refuse, at one place or another.
    for kilobytes in (4..128).step_by(8) {
        let Some(disk) = TinyDisk::mount(folder.path(&format!("disk{kilobytes}")), kilobytes) else {
            assert!(std::env::var_os("CI").is_none(), "continuous integration has to mount a small disk, and can't");
            eprintln!("this user can't mount; nothing tested");
            return;
        };
        let out = disk.0.join("out");
        let output = folder.run(&["--out", out.to_str().unwrap()]);
        let told = String::from_utf8(output.stderr).unwrap();
        let found = if out.exists() { contents(&out) } else { BTreeMap::new() };
        whole.push(found.len());
        for (name, bytes) in &found {
            assert!(!name.ends_with(".partial"), "{kilobytes} kB: {name} is left");
            assert!(*bytes == reference[name], "{kilobytes} kB: {name} is not whole");
        }
        if found.len() < FILES.len() {
            assert_eq!(output.status.code(), Some(3), "{kilobytes} kB: {told}");
            assert_eq!(told.matches("error: ").count(), 1, "{told}");
            assert!(told.contains("free some") && told.contains(&*out.to_string_lossy()), "{told}");
        }
    }
    assert!(whole[0] < FILES.len() && whole.last() == Some(&FILES.len()), "{whole:?}");
    assert!(whole.windows(2).all(|pair| pair[0] <= pair[1]), "{whole:?}");
}

/// A quarter of a gigabyte of memory, and files that are larger: told of block by block, or refused with what they need.
#[cfg(target_os = "linux")]
#[test]
fn files_larger_than_the_memory() {
    let folder = Folder::new();
    for name in ["a.raw", "b.f32", "c.stl", "d.vti", "e.ply"] {
        // Zeros that take no room on the disk.
        std::fs::File::create(folder.path(name)).unwrap().set_len(300_000_000).unwrap();
    }
    let ao4d = |arguments: &str| {
        let script = format!("ulimit -v 262144; exec '{}' {arguments}", env!("CARGO_BIN_EXE_ao4d"));
        let output = Command::new("sh").args(["-c", &script]).current_dir(folder.0.path()).output().unwrap();
        let told = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
        (output.status.code(), told)
    };
    let (code, told) = ao4d("info a.raw");
    assert!(code == Some(0) && told.contains("25000000") && told.contains("0 to 0, mean 0"), "{told}");
    let (code, told) = ao4d("compare b.f32 b.f32");
    assert!(code == Some(0) && told.contains("75000000 numbers, all equal"), "{told}");
    // A file may ask for more than it is long: here 40 arrays of 16 MB that are one and the same few bytes.
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    for _ in 0..16 {
        std::io::Write::write_all(&mut packed, &[0; 1 << 20]).unwrap();
    }
    let packed = packed.finish().unwrap();
    let arrays: String =
        (0..40).map(|i| format!("<DataArray type='UInt8' Name='a{i}' format='appended' offset='0'/>")).collect();
    let head = format!(
        "<VTKFile type='ImageData' version='1.0' byte_order='LittleEndian' header_type='UInt64' \
         compressor='vtkZLibDataCompressor'><ImageData WholeExtent='0 255 0 255 0 255'><Piece><PointData>{arrays}</PointData>\
         </Piece></ImageData><AppendedData encoding='raw'>_"
    );
    let sizes = [1, 1 << 24, 0, packed.len() as u64].map(u64::to_le_bytes).concat();
    std::fs::write(folder.path("f.vti"), [head.as_bytes(), &sizes, &packed, b"</AppendedData></VTKFile>"].concat())
        .unwrap();
    let (code, told) = ao4d("info f.vti");
    assert_eq!(code, Some(2), "{told}");
    assert!(told.contains("takes 16777216 bytes, and there is room for "), "{told}");
    // Points of a byte a coordinate.
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 500000\nproperty uchar x\nproperty uchar y\nproperty uchar z\n\
                element face 0\nproperty list uchar int vertex_indices\nend_header\n";
    std::fs::write(folder.path("g.ply"), [head.as_bytes(), &[7; 1_500_000]].concat()).unwrap();
    let (code, told) = ao4d("info g.ply");
    assert!(code == Some(0) && told.contains("a mesh of 500000 points"), "{told}");
    for arguments in ["info c.stl", "info d.vti", "info e.ply", "compare c.stl c.stl"] {
        let (code, told) = ao4d(arguments);
        assert_eq!(code, Some(2), "{arguments}: {told}");
        assert!(told.contains("needs about 900000000 bytes of memory, and "), "{arguments}: {told}");
    }
    // As an input of a run it is looked at block by block, too: what changes within it makes new files.
    let pipeline = "name: large
stages:
  - scene: {dimension: 3, objects: [{isosurface: {field: {image: {file: a.raw, dimensions: [1000, 1000, 300], type: uint8, crop: {from: [0, 0, 0], to: [4, 4, 4]}}}, isovalue: 1}}]}
  - render: {occlusion: none, dimensions: [4, 4]}
  - write: {vti: a.vti}
";
    std::fs::write(folder.path("large.yaml"), pipeline).unwrap();
    for (place, made) in [(None, true), (None, false), (Some(200_000_000), true), (None, false)] {
        if let Some(place) = place {
            let file = std::fs::File::options().write(true).open(folder.path("a.raw")).unwrap();
            std::os::unix::fs::FileExt::write_all_at(&file, &[1], place).unwrap();
        }
        let (code, told) = ao4d("run -q --threads 1 large.yaml");
        assert!(code == Some(0) && told.contains("a.vti") && told.contains("unchanged") != made, "{place:?}: {told}");
    }
}
