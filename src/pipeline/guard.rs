//! What a pipeline's files may take the place of: nothing but files of their own names, in its own output folder.
//!
//! Names are held below the output folder when they are resolved. Here is what only the disk can tell: that an output would
//! replace an input, that a folder of its name is in the way, or that a link leads out of the output folder.

use std::path::{Path, PathBuf};

use super::{Error, Pipeline};
use crate::stages::Invalid;

/// Refuses a pipeline whose files can't be put where they are named, or had better not be.
pub(super) fn check(pipeline: &Pipeline) -> Result<(), Error> {
    let plan = &pipeline.plan;
    let mut inputs = vec![(PathBuf::from(pipeline.document.file()), "the pipeline itself".to_owned())];
    inputs.extend(pipeline.document.included().iter().map(|file| (file.clone(), "an included file".to_owned())));
    for (index, stage) in plan.stages.iter().enumerate() {
        inputs.extend(plan.input_files(index).into_iter().map(|file| (file, format!("an input of {}", stage.path))));
    }
    let inputs: Vec<_> = inputs.iter().flat_map(|(file, what)| places(file).map(move |place| (place, what))).collect();
    let out = plan.out.display();
    for (index, stage) in plan.stages.iter().enumerate() {
        for file in plan.all_files_of(index) {
            let name = file.display();
            let path = plan.out.join(&file);
            let refuse = |message: String| Err(pipeline.document.refuse(Invalid::new(&stage.path, message)));
            if path.is_dir() {
                return refuse(format!(
                    "\"{name}\" is a folder in {out}; give the file another name, or move the folder"
                ));
            }
            let inner = file.ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty());
            if let Some(link) = inner.into_iter().find(|folder| plan.out.join(folder).is_symlink()) {
                return refuse(format!(
                    "\"{name}\" would be written through the link \"{}\" in {out}, and files stay below the output folder; \
                     make it a folder, or write elsewhere with --out",
                    link.display()
                ));
            }
            let Some(place) = place(&path) else { continue };
            if let Some((_, what)) = inputs.iter().find(|(input, _)| *input == place) {
                return refuse(format!(
                    "\"{name}\" in {out} would replace {what}; give it another name, or write elsewhere with --out"
                ));
            }
        }
    }
    Ok(())
}

/// Where a name is in the end: its folder without links, and itself. None if there is no such folder.
fn place(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(folder.canonicalize().ok()?.join(path.file_name()?))
}

/// The names that lead to an input: its own, and that of the file behind it if it is a link.
fn places(path: &Path) -> impl Iterator<Item = PathBuf> {
    place(path).into_iter().chain(path.canonicalize().ok())
}
