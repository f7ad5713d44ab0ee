//! `.vti`: VTK image data, with the arrays that are asked for, and what they were made from.

use std::ops::Range;
use std::path::Path;

use serde_json::json;

use super::{
    Compression, Content, Encoding, Image, LeftOut, Opening, OutputFormat, PROGRAM, Retell, VoxelFile, WritePlan,
    copy_over,
};
use crate::geometry::Dimension;
use crate::io::vti::{self, ArraySpec, VtiWriter};
use crate::io::{AtomicFile, Error, PIPELINE, parts, vtk};
use crate::render::{Accuracy, Aov};
use crate::stages::Plan;
use crate::stages::occlusion::OcclusionSource;
use crate::stages::render::RenderPlan;
use crate::stages::screen_space::WORD;
use crate::volume::{Array, Grid};

pub(super) struct Vti;

impl OutputFormat for Vti {
    const CONTENT: Content = Content::Voxels;
    const LEFT_OUT: &'static [LeftOut] = &[];
    const TELLS_PIPELINE: bool = true;

    fn arrays(write: &WritePlan) -> Vec<Aov> {
        write.arrays.clone()
    }

    fn voxel_bytes(write: &WritePlan, image: Image) -> u64 {
        write.arrays.iter().map(|&aov| image.bytes(aov)).sum()
    }

    /// How far compression gets is not known before, so compressed files count as nothing, and are refused by the
    /// disk itself if it comes to that.
    fn disk_bytes(write: &WritePlan, image: Image) -> u64 {
        let arrays = Self::voxel_bytes(write, image);
        match (write.compression, write.encoding) {
            (Compression::None, Encoding::Appended) => arrays,
            // Four bytes of text for three, and the arrays themselves, which are kept aside until all are whole.
            (Compression::None, Encoding::Inline) => arrays + (4 * arrays).div_ceil(3),
            _ => 0,
        }
    }

    /// How far off a picture is, is known only when all of it is there.
    fn open_part(opening: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        let Opening { path, plan, write, render, grid, first_layer, mesh_hash, told } = opening;
        let settings = settings(plan, write, render, mesh_hash, told, path.parent());
        let settings = vti::Settings { first_layer, numbers: Vec::new(), ..settings };
        open_file(path, grid, &specs(&write.arrays, Image::of(plan, render)), &settings)
    }

    fn read_part(path: &Path, write: &WritePlan, image: Image, voxels: usize) -> Result<Vec<Array>, Error> {
        read_arrays(path, &specs(&write.arrays, image), voxels)
    }

    fn write_list(
        path: &Path,
        write: &WritePlan,
        image: Image,
        grid: &Grid,
        parts: &[(Range<usize>, String)],
    ) -> Result<u64, Error> {
        let mut file = AtomicFile::create(path)?;
        let parts = parts.iter().map(|(layers, file)| (layers.clone(), file.as_str()));
        parts::image(&mut file, grid, &specs(&write.arrays, image), parts).map_err(AtomicFile::name_in(path))?;
        file.commit()
    }

    const LISTED: bool = true;

    const RETELL: Option<Retell> = Some(|path, write, text| {
        copy_over(path, |source, out| vti::retell(source, out, encoding(write), (PIPELINE, text)))
    });

    fn open(
        Opening { path, plan, write, render, grid, first_layer, mesh_hash, told }: Opening,
    ) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        let image = Image::of(plan, render);
        let settings = settings(plan, write, render, mesh_hash, told, path.parent());
        let settings = vti::Settings { first_layer, ..settings };
        open_file(path, grid, &specs(&write.arrays, image), &settings)
    }
}

/// Opens a file for these arrays.
fn open_file(
    path: &Path,
    grid: &Grid,
    specs: &[ArraySpec],
    settings: &vti::Settings,
) -> Result<Option<Box<dyn VoxelFile>>, Error> {
    let out = AtomicFile::create(path)?;
    let writer = VtiWriter::new(out, grid, specs, settings).map_err(AtomicFile::name_in(path))?;
    Ok(Some(Box::new(File { path: path.to_owned(), writer })))
}

/// A `.vti` of nothing but colours, packed: the part of a file that has no parts in its own format.
pub(super) fn open_colours(path: &Path, grid: &Grid, first_layer: usize) -> Result<Option<Box<dyn VoxelFile>>, Error> {
    let (compression, scratch) = (vti::Compression::Lz4, path.parent().map(Path::to_owned));
    let settings = vti::Settings { compression, scratch, first_layer, ..vti::Settings::default() };
    open_file(path, grid, &colours(), &settings)
}

/// Reads such a part.
pub(super) fn read_colours(path: &Path, voxels: usize) -> Result<Vec<Array>, Error> {
    read_arrays(path, &colours(), voxels)
}

fn colours() -> Vec<ArraySpec> {
    vec![ArraySpec::new(Aov::Rgba.name(), Aov::Rgba.kind(), 4)]
}

/// Reads just these arrays of so many voxels.
fn read_arrays(path: &Path, specs: &[ArraySpec], voxels: usize) -> Result<Vec<Array>, Error> {
    let failed = |cause: String| Error::File {
        path: path.to_owned(),
        action: "be used as a part",
        cause: std::io::Error::other(cause),
    };
    let mut found = vtk::read_volume(path).map_err(|error| failed(error.to_string()))?.arrays;
    let array = |spec: &ArraySpec| {
        let at = found.iter().position(|array| {
            let alike = array.components == spec.components.len() && array.values.kind() == spec.kind;
            array.name == spec.name && alike && array.tuples() == voxels
        });
        at.map(|at| found.swap_remove(at)).ok_or_else(|| failed(format!("it lacks `{}` of {voxels} voxels", spec.name)))
    };
    specs.iter().map(array).collect()
}

/// What a file with these arrays holds.
fn specs(aovs: &[Aov], image: Image) -> Vec<ArraySpec> {
    aovs.iter().flat_map(|&aov| array_specs(aov, image)).collect()
}

struct File {
    path: std::path::PathBuf,
    writer: VtiWriter<AtomicFile>,
}

impl VoxelFile for File {
    fn add_slab(&mut self, first: usize, slab: &[&Array]) -> Result<(), Error> {
        let writer = &mut self.writer;
        let mut arrays = slab.iter().enumerate();
        let written = arrays.try_for_each(|(array, values)| writer.write_slab(array, first, &values.values));
        written.map_err(AtomicFile::name_in(&self.path))
    }

    fn tell(&mut self, accuracy: &Accuracy) {
        for (name, number) in numbers(accuracy) {
            self.writer.set_number(name, number);
        }
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        self.writer.finish().map_err(AtomicFile::name_in(&self.path))?.commit()
    }
}

fn array_specs(aov: Aov, image: Image) -> impl Iterator<Item = ArraySpec> {
    let components = match image.dimension {
        Dimension::Three => aov.components::<3>(),
        Dimension::Four => aov.components::<4>(),
    };
    aov.names(image.layers).into_iter().map(move |name| ArraySpec::new(&name, aov.kind(), components))
}

/// How far off the occlusion is, as files say it: the root mean square, the most that some voxel was off, and how many
/// voxels were looked at.
fn numbers(accuracy: &Accuracy) -> [(&'static str, f64); 3] {
    let Accuracy { rms, largest, voxels } = *accuracy;
    [("occlusion_rms_error", rms), ("occlusion_largest_error", largest), ("occlusion_voxels_checked", voxels as f64)]
}

/// Puts another text of the pipeline into a file whose arrays are appended.
pub(in crate::stages) fn retell(path: &Path, text: &str) -> Result<u64, Error> {
    copy_over(path, |source, out| vti::retell(source, out, vti::Encoding::Appended, (PIPELINE, text)))
}

/// Takes a whole file that a piece of a run made, with this text of the pipeline; returns its length.
pub(in crate::stages) fn take(part: &Path, path: &Path, encoding: Encoding, text: &str) -> Result<u64, Error> {
    let failed = |cause| Error::File { path: part.to_owned(), action: "be read", cause };
    let source = std::io::BufReader::with_capacity(1 << 18, crate::input::open(part).map_err(failed)?);
    let mut file = AtomicFile::create(path)?;
    vti::retell(source, &mut file, encoding_of(encoding), (PIPELINE, text)).map_err(AtomicFile::name_in(path))?;
    file.commit()
}

fn encoding(write: &WritePlan) -> vti::Encoding {
    encoding_of(write.encoding)
}

fn encoding_of(encoding: Encoding) -> vti::Encoding {
    match encoding {
        Encoding::Appended => vti::Encoding::Appended,
        Encoding::Inline => vti::Encoding::Inline,
    }
}

/// What a `.vti` says about itself, and how; `scratch` is the folder for what has to be kept aside.
fn settings(
    plan: &Plan,
    write: &WritePlan,
    render: &RenderPlan,
    mesh_hash: &str,
    told: &str,
    scratch: Option<&Path>,
) -> vti::Settings {
    let scene = &plan[render.scene];
    let occlusion = render.occlusion.map(|o| match &plan[o].source {
        OcclusionSource::Compute(computation) => computation.told(),
        OcclusionSource::Load(_) => json!("loaded"),
    });
    let occlusion = occlusion.or_else(|| render.screen_space.as_ref().map(|space| json!({ WORD: space.written() })));
    let mut settings = json!({
        "seed": plan.seed,
        "scene": { "dimension": scene.dimension, "mesh": mesh_hash },
        "occlusion": occlusion,
        "camera": render.camera,
        "dimensions": render.dimensions,
        "shading": render.screen_space.is_none().then_some(render.shading),
        "denoise": render.denoise,
        "tolerance": render.tolerance,
        "supersample": render.supersample,
        "dilate": render.dilate,
    });
    if render.layers > 0 {
        settings["layers"] = render.layers.into();
    }
    vti::Settings {
        encoding: encoding(write),
        compression: match write.compression {
            Compression::None => vti::Compression::None,
            Compression::Zlib => vti::Compression::Zlib,
            Compression::Lz4 => vti::Compression::Lz4,
        },
        field_data: vec![
            ("program".to_owned(), PROGRAM.to_owned()),
            (PIPELINE.to_owned(), told.to_owned()),
            ("settings".to_owned(), settings.to_string()),
        ],
        // Known when the picture is there; 0 of 0 voxels if it shows nothing.
        numbers: match render.audit(plan) {
            Some(_) => numbers(&Accuracy::default()).map(|(name, number)| (name.to_owned(), number)).into(),
            None => Vec::new(),
        },
        scratch: scratch.map(Path::to_owned),
        ..vti::Settings::default()
    }
}
