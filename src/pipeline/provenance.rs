//! What files tell of how they were made: the pipeline as it was understood, as YAML that makes them again.
//!
//! It is the document with the command line's overrides applied, the defaults that took effect filled in, the program's
//! version, and the SHA-256 of every input. What only this computer knows stays out: where the pipeline's folder is, where
//! outputs went, threads and backend. So the same pipeline tells the same everywhere, and a pipeline that was read from a
//! file tells what the file told. Paths of inputs stand as they were written, relative to the pipeline's folder; where that
//! was is remembered by the output folder ([`Told::read`]), and goes into `folder` when the text is printed.

use std::path::{Path, PathBuf};

use super::spec::{InputSpec, PipelineSpec};
use super::yaml::{self, Value, fill, map, node};
use super::{Document, Error, Pipeline, cache};
use crate::inspect;
use crate::stages::key::sha256;
use crate::stages::write::PROGRAM;
use crate::stages::{Invalid, Keys};

/// The text that the files of a pipeline tell.
pub(super) fn text(pipeline: &Pipeline, keys: &Keys) -> String {
    let plan = &pipeline.plan;
    let mut stages = pipeline.document.root().get("stages").cloned().unwrap_or_else(|| node(Value::List(Vec::new())));
    if let Value::List(list) = &mut stages.value {
        // Twins are not written.
        let written = (0..plan.stages.len()).filter(|&index| !plan.is_twin(index));
        for (index, stage) in written.zip(list.iter_mut()) {
            // A stage is a mapping of its kind to its keys.
            if let Value::Map(entries) = &mut stage.value {
                entries.iter_mut().for_each(|entry| fill(&mut entry.value, &plan.written(index)));
            }
        }
    }
    let shown = |path: &Path| path.strip_prefix(&plan.folder).unwrap_or(path).to_string_lossy().into_owned();
    let mut inputs: Vec<(String, &str)> = keys.inputs().hashes().map(|(path, hash)| (shown(path), hash)).collect();
    inputs.sort();
    let input = |(file, hash): (String, &str)| {
        node(map([("file", Value::Text(file)), ("sha256", Value::Text(hash.to_owned()))]))
    };
    let inputs: Vec<_> = inputs.into_iter().map(input).collect();
    let mut entries = vec![
        ("program", Value::Text(PROGRAM.to_owned())),
        ("name", Value::Text(plan.name.clone())),
        ("seed", Value::Integer(plan.seed.into())),
    ];
    if !inputs.is_empty() {
        entries.push(("inputs", Value::List(inputs)));
    }
    entries.push(("stages", stages.value));
    yaml::emit(&node(map(entries)))
}

/// Refuses a pipeline some input of which is not what the pipeline says that it was.
pub(super) fn check(pipeline: &Pipeline) -> Result<(), Error> {
    let plan = &pipeline.plan;
    let read: Vec<PathBuf> = (0..plan.stages.len()).flat_map(|stage| plan.input_files(stage)).collect();
    for (i, InputSpec { file, sha256: told }) in pipeline.inputs.iter().enumerate() {
        let path = plan.folder.join(file);
        // What can't be read is refused by whoever reads it; what nobody reads matters to nobody.
        let Some(found) = sha256(&path).filter(|_| read.contains(&path)) else { continue };
        if !found.eq_ignore_ascii_case(told) {
            let message = format!(
                "{} changed since: its SHA-256 is {found}; put back the file that it was, or take this entry out to go \
                 on with what there is",
                path.display()
            );
            return Err(pipeline.document.refuse(Invalid::new(format!("inputs[{i}].sha256"), message)));
        }
    }
    Ok(())
}

/// The pipeline that a file tells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Told {
    /// The YAML, with `folder` where that is known and matters.
    pub text: String,
    /// What is no longer as it was, or can't be found, as messages.
    pub notes: Vec<String>,
}

impl Told {
    /// Reads it from a `.vti`, `.vtu`, `.png` or `.f32` that a run left.
    ///
    /// # Errors
    /// If the file can't be read, or tells of no pipeline.
    pub fn read(path: &Path) -> Result<Self, inspect::Error> {
        let text = inspect::pipeline(path)?;
        let refused = |message: String| inspect::Error::Pipeline { path: path.into(), message };
        let document = Document::parse("its pipeline", &text).map_err(|e| refused(e.to_string()))?;
        let spec: PipelineSpec = document.decode().map_err(|e| refused(e.to_string()))?;
        let inputs = spec.inputs.unwrap_or_default();
        let mut told = Self { text, notes: Vec::new() };
        if inputs.iter().all(|input| input.file.is_absolute()) {
            told.look(&inputs, Path::new(""));
        } else if let Some(folder) = cache::folder_of(path) {
            let line = yaml::emit(&node(map([("folder", Value::Text(folder.to_string_lossy().into_owned()))])));
            told.text.insert_str(0, &line);
            told.look(&inputs, &folder);
        } else {
            let note = "the paths of inputs are relative to the folder that the pipeline was in, and the file doesn't \
                        lie where it was written any more; put the text into that folder, or give it by `folder`";
            told.notes.push(note.to_owned());
        }
        Ok(told)
    }

    /// Tells of inputs that changed.
    fn look(&mut self, inputs: &[InputSpec], folder: &Path) {
        for input in inputs {
            let path = folder.join(&input.file);
            match sha256(&path) {
                None => self.notes.push(format!("the input {} can't be read", path.display())),
                Some(found) if !found.eq_ignore_ascii_case(&input.sha256) => {
                    self.notes.push(format!("the input {} changed since; its SHA-256 is {found}", path.display()));
                }
                Some(_) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension() {
                None => shipped(&path, found),
                Some(ending) if ending == "yaml" => found.push(path),
                Some(_) => {}
            }
        }
    }

    /// Every key that takes effect by a default, in some place.
    const DEFAULTS: &str = "name: p
stages:
  - scene:
      objects:
        - {name: \"# it\", tesseract: {size: 0.5}, color: \"#00ff80\"}
        - {isosurface: {field: {tiger: {major: [0.55, 0.55], minor: 0.24}}, grid: {cells: 4}}}
        - {hypersphere: {radius: 0.1, subdivisions: 1}, crease_angle: off, transform: [{scale: [1, 2, 3, 4]}, {rotate: {plane: xw, degrees: 20}}]}
  - occlusion: {}
  - occlusion: {id: e, method: exact}
  - occlusion: {id: t, target_error: 0.01}
  - occlusion: {id: a, method: as_published, seed: 18446744073709551615}
  - render: {dimensions: [4, 4, 4]}
  - render: {id: v, occlusion: t, dimensions: [4, 4, 4], shading: voxel, camera: {projection: parallel}}
  - render: {id: few, occlusion: t, input: t, dimensions: [4, 4, 4], shading: auto}
  - render: {id: flat, occlusion: a, dimensions: [4, 4, 4], shading: flat}
  - render: {id: none, occlusion: none, dimensions: [4, 4, 4]}
  - render: {id: space, occlusion: screen_space, dimensions: [4, 4, 4]}
  - write: {vti: a.vti}
  - write: {input: few, png: a.png}
  - mesh: {vtu: mesh.vtu}
";

    #[test]
    fn what_a_file_tells_is_understood_as_the_pipeline_was() {
        let mut all = Vec::new();
        shipped(&Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines"), &mut all);
        assert!(all.len() > 15);
        let read = all.iter().map(|path| (Document::read(path).unwrap(), path.parent().unwrap().join("again.yaml")));
        let defaults = Document::parse("p.yaml", &DEFAULTS.replace("id: none", "id: plain")).unwrap();
        for (document, again) in read.chain([(defaults, PathBuf::from("again.yaml"))]) {
            let file = document.file().to_owned();
            let pipeline =
                Pipeline::from_document(document, &["seed=7".to_owned()], None).unwrap_or_else(|e| panic!("{e}"));
            let told = text(&pipeline, &Keys::new(&pipeline.plan));
            let document = Document::parse(again.to_str().unwrap(), &told).unwrap();
            let again = Pipeline::from_document(document, &[], None).unwrap_or_else(|e| panic!("{file}: {e}\n{told}"));
            for stage in 0..pipeline.plan.stages.len() {
                assert_eq!(again.plan.fields(stage), pipeline.plan.fields(stage), "{file}, stage {stage}\n{told}");
            }
            let warnings = |p: &Pipeline| p.plan.warnings.iter().map(ToString::to_string).collect::<Vec<_>>();
            assert_eq!(warnings(&again), warnings(&pipeline), "{file}");
            assert_eq!(text(&again, &Keys::new(&again.plan)), told, "{file}");
            check(&again).unwrap();
        }
    }
}
