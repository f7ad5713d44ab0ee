//! The files of a run: which numbers of a picture, a mesh or an occlusion go where.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::plan::{Computation, OcclusionSource, Plan, Samples, WritePlan};
use super::prepare::sidecar_path;
use super::spec;
use super::work::Stale;
use crate::geometry::{Dimension, widen};
use crate::io::vti::{self, ArraySpec, VtiWriter};
use crate::io::{self, AtomicFile, Error, png, raw::RawWriter, vtu};
use crate::mesh::Mesh;
use crate::occlusion::{self, Estimates, Sidecar};
use crate::render::{Aov as Channel, Camera, Renderer};
use crate::volume::{Array, Grid, Values};

/// Name and version, as files record it.
pub(super) const PROGRAM: &str = concat!("ao4d ", env!("CARGO_PKG_VERSION"));

/// A finished file: the write it belongs to, its kind, its path in the output folder, and its length.
pub(super) type Finished = (usize, &'static str, PathBuf, u64);

/// The open files of one picture.
pub(super) struct PictureFiles {
    out: PathBuf,
    channels: Vec<Channel>,
    vti: Vec<(usize, PathBuf, VtiWriter<AtomicFile>, Vec<usize>)>,
    raw: Vec<(usize, PathBuf, RawWriter<AtomicFile>, usize)>,
    png: Vec<(usize, PathBuf, AtomicFile)>,
    slices: Option<(png::Slices, usize)>,
}

impl PictureFiles {
    /// Opens those files of a render that have to be made.
    pub fn create(plan: &Plan, render: usize, stale: &Stale, grid: &Grid, mesh_hash: &str) -> Result<Self, Error> {
        let dimension = plan.scenes[plan.renders[render].scene].dimension;
        let mut channels = Vec::new();
        let mut place = |channel: Channel| {
            channels.iter().position(|&c| c == channel).unwrap_or_else(|| {
                channels.push(channel);
                channels.len() - 1
            })
        };
        let (mut vti, mut raw, mut png) = (Vec::new(), Vec::new(), Vec::new());
        let mut slices = None;
        for (i, write) in plan.writes.iter().enumerate().filter(|(_, w)| w.render == render) {
            if let Some(file) = write.vti.as_ref().filter(|_| stale.vti[i]) {
                let specs: Vec<ArraySpec> = write.arrays.iter().map(|&c| array_spec(c, dimension)).collect();
                let path = plan.out.join(file);
                let settings = vti_settings(plan, write, mesh_hash, path.parent());
                let out = AtomicFile::create(&path)?;
                let writer = VtiWriter::new(out, grid, &specs, &settings).map_err(AtomicFile::name_in(&path))?;
                vti.push((i, file.clone(), writer, write.arrays.iter().map(|&c| place(c)).collect()));
            }
            if let Some(file) = write.raw.as_ref().filter(|_| stale.raw[i]) {
                let out = AtomicFile::create(plan.out.join(file))?;
                raw.push((i, file.clone(), RawWriter::new(out, grid), place(Channel::Rgb)));
            }
            if let Some(file) = write.png.as_ref().filter(|_| stale.png[i]) {
                png.push((i, file.clone(), AtomicFile::create(plan.out.join(file))?));
                slices.get_or_insert_with(|| (png::Slices::new(grid), place(Channel::Rgba)));
            }
        }
        Ok(Self { out: plan.out.clone(), channels, vti, raw, png, slices })
    }

    /// What the files need of each slab, in this order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Writes some layers to all files.
    pub fn add_slab(&mut self, first: usize, slab: &[Array]) -> Result<(), Error> {
        let named = |file: &Path| AtomicFile::name_in(&self.out.join(file));
        for (_, file, writer, places) in &mut self.vti {
            for (array, &place) in places.iter().enumerate() {
                writer.write_slab(array, first, &slab[place].values).map_err(named(file))?;
            }
        }
        for (_, file, writer, place) in &mut self.raw {
            if let Values::F32(rgb) = &slab[*place].values {
                writer.write_slab(first, rgb).map_err(named(file))?;
            }
        }
        if let Some((slices, place)) = &mut self.slices
            && let Values::U8(rgba) = &slab[*place].values
        {
            slices.add_slab(first, rgba)?;
        }
        Ok(())
    }

    /// Completes the files and gives them their names.
    pub fn finish(self) -> Result<Vec<Finished>, Error> {
        let mut done = Vec::new();
        let named = |file: &Path| AtomicFile::name_in(&self.out.join(file));
        for (write, file, writer, _) in self.vti {
            let length = writer.finish().map_err(named(&file))?.commit()?;
            done.push((write, "vti", file, length));
        }
        for (write, file, writer, _) in self.raw {
            let length = writer.finish().map_err(named(&file))?.commit()?;
            done.push((write, "raw", file, length));
        }
        for (write, file, mut out) in self.png {
            if let Some((slices, _)) = &self.slices {
                png::write(&mut out, &[slices]).map_err(named(&file))?;
            }
            done.push((write, "png", file, out.commit()?));
        }
        Ok(done)
    }
}

fn array_spec(channel: Channel, dimension: Dimension) -> ArraySpec {
    let components = match dimension {
        Dimension::Three => channel.components::<3>(),
        Dimension::Four => channel.components::<4>(),
    };
    ArraySpec::new(channel.name(), channel.kind(), components)
}

/// What a `.vti` says about itself, and how; `scratch` is the folder for what has to be kept aside.
fn vti_settings(plan: &Plan, write: &WritePlan, mesh_hash: &str, scratch: Option<&Path>) -> vti::Settings {
    let render = &plan.renders[write.render];
    let scene = &plan.scenes[render.scene];
    let occlusion = render.occlusion.map(|o| match &plan.occlusions[o].source {
        OcclusionSource::Compute(computation) => json!(computation),
        OcclusionSource::Load(_) => json!("loaded"),
    });
    let settings = json!({
        "seed": plan.seed,
        "scene": { "dimension": scene.dimension, "mesh": mesh_hash },
        "occlusion": occlusion,
        "camera": render.camera,
        "dimensions": render.dimensions,
        "shading": render.shading,
    });
    vti::Settings {
        encoding: match write.encoding {
            spec::Encoding::Appended => vti::Encoding::Appended,
            spec::Encoding::Inline => vti::Encoding::Inline,
        },
        compression: match write.compression {
            spec::Compression::None => vti::Compression::None,
            spec::Compression::Zlib => vti::Compression::Zlib,
            spec::Compression::Lz4 => vti::Compression::Lz4,
        },
        field_data: vec![
            ("program".to_owned(), PROGRAM.to_owned()),
            ("pipeline".to_owned(), plan.name.clone()),
            ("settings".to_owned(), settings.to_string()),
        ],
        scratch: scratch.map(Path::to_owned),
        ..vti::Settings::default()
    }
}

/// What is known about values that were computed.
pub(super) fn sidecar(found: &Estimates, computation: &Computation, mesh_hash: &str) -> Sidecar {
    let Computation { method, samples, max_distance, seed, .. } = computation;
    let (most, target_error) = match *samples {
        Samples::Fixed(n) => (Some(n), None),
        Samples::Target { error, max_samples } => (Some(max_samples), Some(error)),
        Samples::Exact => (None, None),
    };
    let count = found.values.len();
    Sidecar {
        count,
        method: method.as_str().to_owned(),
        samples: most.and_then(|n| u32::try_from(n).ok()),
        target_error,
        mean_samples: most.map(|_| found.rays as f64 / count.max(1) as f64),
        seed: *seed,
        max_distance: max_distance.map_or(f32::INFINITY, |d| d as f32),
        error_estimate: found.error(),
        mesh: mesh_hash.to_owned(),
        program: PROGRAM.to_owned(),
    }
}

/// Writes an occlusion's values and what stands beside them. Returns the length of the values' file.
pub(super) fn write_occlusion(path: &Path, values: &[f32], sidecar: &Sidecar) -> Result<u64, Error> {
    // The values last: they are what others look for.
    write_whole(&sidecar_path(path), sidecar.to_yaml().as_bytes())?;
    write_whole(path, &occlusion::encode(values))
}

/// Writes a file in one piece.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<u64, Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(Error::from).map_err(AtomicFile::name_in(path))?;
    file.commit()
}

/// Writes a scene's mesh as a camera sees it; returns the file's length and how many simplices had to be left out. A
/// 3D scene's mesh is written where it is.
pub(super) fn write_mesh<const D: usize>(
    path: &Path,
    mesh: &Mesh<D>,
    camera: &Camera<D>,
    found: Option<&Estimates>,
) -> Result<(u64, usize), Error> {
    let mut before = vec![true; mesh.vertices.len()];
    let mut points = vec![[0.0f32; 3]; mesh.vertices.len()];
    for (i, vertex) in mesh.vertices.iter().enumerate() {
        match Dimension::of::<D>() {
            Dimension::Three => points[i] = std::array::from_fn(|a| vertex[a]),
            Dimension::Four => {
                let (image, distance) = camera.project(vertex);
                let image = image.map(|x| x as f32);
                before[i] = distance > 0.0 && image.iter().all(|x| x.is_finite());
                points[i] = if before[i] { image } else { [0.0; 3] };
            }
        }
    }
    let shown: Vec<usize> =
        (0..mesh.simplices.len()).filter(|&s| mesh.simplices[s].iter().all(|&v| before[v as usize])).collect();
    let coordinates = |vectors: &[crate::geometry::Vector<D>]| -> Vec<f32> {
        vectors.iter().flat_map(|v| widen(v).iter().map(|&x| x as f32).collect::<Vec<_>>()).collect()
    };
    let mut object = vec![0u16; mesh.vertices.len()];
    for (i, o) in mesh.objects.iter().enumerate() {
        object[o.vertices.clone()].fill(i as u16 + 1);
    }
    let mut arrays = vec![
        Array::new("position", D, coordinates(&mesh.vertices)),
        Array::new("normal", D, coordinates(&mesh.normals)),
        Array::new("object", 1, object),
    ];
    if let Some(found) = found {
        arrays.push(Array::new("ambient_occlusion", 1, found.values.clone()));
        // Of loaded values nothing is known.
        if found.errors.len() == found.values.len() {
            arrays.push(Array::new("occlusion_error", 1, found.errors.clone()));
        }
    }
    let mut file = AtomicFile::create(path)?;
    match Dimension::of::<D>() {
        Dimension::Three => {
            let cells: Vec<[u32; 3]> = shown.iter().map(|&s| std::array::from_fn(|i| mesh.simplices[s][i])).collect();
            vtu::write(&mut file, &points, vtu::Cells::Triangles(&cells), &arrays, &[])
        }
        Dimension::Four => {
            let cells: Vec<[u32; 4]> = shown.iter().map(|&s| std::array::from_fn(|i| mesh.simplices[s][i])).collect();
            vtu::write(&mut file, &points, vtu::Cells::Tetrahedra(&cells), &arrays, &[])
        }
    }
    .map_err(AtomicFile::name_in(path))?;
    Ok((file.commit()?, mesh.simplices.len() - shown.len()))
}

/// Why a picture shows nothing.
pub(super) fn nothing_seen<const D: usize>(picture: &Renderer<D>, id: &str) -> String {
    let behind = |v: &u32| picture.camera.project(&picture.tracer().mesh().vertices[*v as usize]).1 <= 0.0;
    let why = if picture.tracer().mesh().simplices.iter().flatten().all(behind) {
        "the scene lies wholly behind the camera; turn the camera, or move it back"
    } else {
        "no voxel's centre sees any of the scene; look at its place and size, or use more voxels"
    };
    format!("render {id} shows background only: {why}")
}

/// The path of a file in the output folder, as a state in the same folder names it.
pub(super) fn beside(state: &Path, file: &Path) -> String {
    let up = state.parent().map_or(0, |p| p.components().count());
    let mut path = "../".repeat(up);
    let names: Vec<String> = file.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    path.push_str(&names.join("/"));
    path
}

/// Whether a file holds just these bytes already.
pub(super) fn holds(path: &Path, bytes: &[u8]) -> bool {
    std::fs::metadata(path).is_ok_and(|m| m.len() == bytes.len() as u64)
        && crate::input::read(path).is_ok_and(|found| found == bytes)
}

pub(super) use io::paraview;
