//! Whole pictures out of the parts that the pieces of a run have made, by the same writers that make them at once.

use std::path::{Path, PathBuf};

use super::{Content, Image, Opening, WritePlan};
use crate::io::Error;
use crate::render::{Accuracy, Audit};
use crate::stages::piece::{Joined, Record, Slab, record_of};
use crate::stages::render::RenderPlan;
use crate::stages::{Ref, Run, StageError};
use crate::volume::{Array, Grid};

/// What came of a picture that was joined.
#[derive(Default)]
pub(in crate::stages) struct JoinedPicture {
    /// Its files, with their lengths.
    pub files: Vec<(PathBuf, u64)>,
    /// How many of its voxels see something.
    pub seen: u64,
    /// How many of those see a surface from behind.
    pub behind: u64,
    /// How far off it is.
    pub accuracy: Option<Accuracy>,
}

/// Makes those files of a render that have to be made; `audit` has yet to be told what to look at, and `look` does so.
pub(in crate::stages) fn join<const D: usize>(
    me: Ref<RenderPlan>,
    joined: &Joined,
    run: &Run,
    (grid, mesh_hash): (&Grid, &str),
    audit: Option<Audit<D>>,
    look: impl Fn(Audit<D>) -> Result<Option<Accuracy>, StageError>,
) -> Result<JoinedPicture, StageError> {
    let (plan, told, render) = (run.plan, run.told, &run.plan[me]);
    let parts = joined.picture(render.dimensions[2], me.nth());
    let mut made = JoinedPicture::default();
    let writes: Vec<&WritePlan> = plan.all::<WritePlan>().map(|(_, write)| write).filter(|w| w.render == me).collect();
    for write in writes {
        let image = Image::of(plan, render);
        for file in write.stale(Content::Voxels, &|file| run.is_stale(file)) {
            let path = plan.out.join(&file.path);
            let opening = Opening { path: &path, plan, write, render, grid, first_layer: 0, mesh_hash, told };
            let Some(mut open) = file.format.open(opening)? else { continue };
            let (mut asked, mut seen, mut behind) = (audit.clone(), 0, 0);
            for (piece, slab) in &parts {
                if run.progress.cancelled() {
                    return Err(crate::occlusion::Cancelled.into());
                }
                let part = joined.path(*piece, &file.format.part(&file.path));
                let record = read_record(&part, slab)?;
                (seen, behind) = (seen + record.seen, behind + record.behind);
                if let Some(asked) = &mut asked {
                    record.checked.iter().filter_map(|bits| bits.checked()).for_each(|checked| asked.insert(checked));
                }
                let voxels = grid.layer_len() * slab.layers().len();
                let arrays = file.format.read_part(&part, write, image, voxels)?;
                let own: Vec<Array> =
                    arrays.into_iter().map(|array| first_voxels(array, grid, slab.own.len())).collect();
                open.add_slab(slab.own.start, &own.iter().collect::<Vec<_>>())?;
                run.progress.advance(slab.own.len() as u64);
            }
            // All files of a picture show the same.
            if made.accuracy.is_none() && asked.as_ref().is_some_and(|asked| asked.candidates().next().is_some()) {
                made.accuracy = asked.map(&look).transpose()?.flatten();
            }
            if let Some(accuracy) = &made.accuracy {
                open.tell(accuracy);
            }
            (made.seen, made.behind) = (seen, behind);
            made.files.push((file.path.clone(), open.finish()?));
        }
    }
    Ok(made)
}

/// What is known of a part, which must have the layers that it should have.
fn read_record(part: &Path, slab: &Slab) -> Result<Record, Error> {
    let path = record_of(part);
    let record = Record::read(&path)?;
    if record.layers != [slab.own.start, slab.own.end] {
        let cause = std::io::Error::other(format!("it has the layers {:?}, not {:?}", record.layers, slab.own));
        return Err(Error::File { path, action: "be used as a part", cause });
    }
    Ok(record)
}

/// The first layers of an array, without the one that is the next part's too.
fn first_voxels(array: Array, grid: &Grid, layers: usize) -> Array {
    let numbers = grid.layer_len() * layers * array.components;
    if array.values.len() == numbers {
        return array;
    }
    let mut values = array.values.kind().zeros(numbers);
    let fits = values.place(0, &array.values, 0, numbers);
    debug_assert!(fits, "a part has at least its own layers");
    Array { values, ..array.clone_head() }
}
