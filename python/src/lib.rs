//! The native half of the Python package `ao4d`: arrays in, arrays out, and the interpreter free while work is done.
//!
//! What users see is `ao4d/__init__.py`; this module is called by that alone. Settings come in as a pipeline's text, so that
//! keys, defaults and complaints are those of pipelines, and results without arrays go out as JSON.

mod arrays;
mod mesh;
mod watch;

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

use ao4d::inspect::compare::{self, Tolerance};
use ao4d::inspect::{self, Contents};
use ao4d::occlusion::Estimates;
use ao4d::pipeline::{Document, Pipeline, RunError, Settings};
use ao4d::stages::{StageError, memory};
use ao4d::volume::{Grid, Volume};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyAny;

use arrays::{Named, named, values_of};
use mesh::{Any, Mesh};
use watch::watched;

pyo3::create_exception!(ao4d, PipelineError, PyValueError, "A pipeline, a key or a file is wrong; nothing was run.");
pyo3::create_exception!(ao4d, WorkError, PyRuntimeError, "The work failed.");

/// An error with its causes, each after the one it caused.
fn text(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text += &format!(": {inner}");
        cause = inner.source();
    }
    text
}

/// A refusal, as Python knows it.
fn refused(error: impl std::error::Error) -> PyErr {
    PipelineError::new_err(text(&error))
}

fn failed(error: StageError) -> PyErr {
    match error {
        StageError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
        StageError::Invalid(error) => refused(error),
        error => WorkError::new_err(text(&error)),
    }
}

fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| WorkError::new_err(error.to_string()))
}

/// How work is done, as opposed to what is computed.
fn settings(threads: Option<usize>, backend: &str, force: bool) -> PyResult<Settings> {
    let backend = backend.parse().map_err(refused)?;
    let threads = match threads.map(|n| NonZeroUsize::new(n).filter(|n| n.get() <= 1024)) {
        Some(None) => return Err(PyValueError::new_err("threads: expected a whole number from 1 to 1024")),
        Some(threads) => threads,
        None => None,
    };
    Ok(Settings { backend, threads, force })
}

/// A pipeline from its text, or from the file at `path`, with overrides.
fn pipeline(text: Option<&str>, path: &str, sets: &[String], out: Option<PathBuf>) -> PyResult<Pipeline> {
    let document = match text {
        Some(text) => Document::parse(path, text),
        None => Document::read(path.as_ref()),
    };
    Pipeline::from_document(document.map_err(refused)?, sets, out).map_err(refused)
}

/// A pipeline's warnings, for Python to show.
fn warn(py: Python<'_>, pipeline: &Pipeline) -> PyResult<()> {
    let category = py.get_type::<pyo3::exceptions::PyUserWarning>();
    for warning in pipeline.warnings() {
        let message = std::ffi::CString::new(warning.to_string().replace('\0', " ")).unwrap_or_default();
        PyErr::warn(py, &category, &message, 2)?;
    }
    Ok(())
}

/// Values at vertices, their standard errors, and how many rays that took.
type Found<'py> = (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>, u64);
/// A picture: dimensions, origin, spacing, arrays, how far off it is (RMS, the largest, of how many voxels), and notes.
type Picture<'py> = ([usize; 3], [f64; 3], [f64; 3], Vec<Named<'py>>, Option<(f64, f64, usize)>, Vec<String>);

/// Ambient occlusion at the vertices of a mesh, as the pipeline's occlusion says.
#[pyfunction]
fn occlusion<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    text: &str,
    threads: Option<usize>,
    watch: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let plan = pipeline(Some(text), "arguments", &[], None)?;
    warn(py, &plan)?;
    let found = watched(py, &settings(threads, "cpu", false)?, watch, |progress| match mesh.any() {
        Any::Three(session) => memory::values(&plan.plan, session, progress),
        Any::Four(session) => memory::values(&plan.plan, session, progress),
    })?;
    let Estimates { values, errors, rays } = found.map_err(failed)?;
    Ok((PyArray1::from_vec(py, values), PyArray1::from_vec(py, errors), rays))
}

/// A picture of a mesh, as the pipeline's render says, shaded by these values or by those of the pipeline's occlusion.
#[pyfunction]
fn render<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    text: &str,
    values: Option<(PyReadonlyArray1<'py, f32>, PyReadonlyArray1<'py, f32>)>,
    threads: Option<usize>,
    watch: Option<Py<PyAny>>,
) -> PyResult<Picture<'py>> {
    let document = Document::parse("arguments", text).map_err(refused)?;
    let plan = match mesh.any() {
        Any::Three(session) => Pipeline::around(document, session.mesh()),
        Any::Four(session) => Pipeline::around(document, session.mesh()),
    };
    let plan = plan.map_err(refused)?;
    warn(py, &plan)?;
    let estimates = |(values, errors): (PyReadonlyArray1<'_, f32>, PyReadonlyArray1<'_, f32>)| -> PyResult<_> {
        Ok(Arc::new(Estimates { values: values.as_slice()?.to_vec(), errors: errors.as_slice()?.to_vec(), rays: 0 }))
    };
    let given = values.map(estimates).transpose()?;
    let seen = watched(py, &settings(threads, "cpu", false)?, watch, |progress| match mesh.any() {
        Any::Three(session) => memory::picture(&plan.plan, session.clone(), given, progress),
        Any::Four(session) => memory::picture(&plan.plan, session.clone(), given, progress),
    })?;
    let memory::Seen { volume, accuracy, notes } = seen.map_err(failed)?;
    let accuracy = accuracy.map(|a| (a.rms, a.largest, a.voxels));
    picture(py, volume, accuracy, notes)
}

fn picture<'py>(
    py: Python<'py>,
    volume: Volume,
    accuracy: Option<(f64, f64, usize)>,
    notes: Vec<String>,
) -> PyResult<Picture<'py>> {
    let Volume { grid, arrays, .. } = volume;
    let arrays = arrays.into_iter().map(|array| named(py, array)).collect::<PyResult<_>>()?;
    Ok((grid.dimensions, grid.origin, grid.spacing, arrays, accuracy, notes))
}

/// An image that is in a file.
#[pyfunction]
fn read_image<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Picture<'py>> {
    match py.detach(|| Contents::read(&path)).map_err(refused)? {
        Contents::Image(image) => {
            let volume = Volume { grid: image.grid, arrays: image.point_arrays, field_data: Vec::new() };
            picture(py, volume, None, Vec::new())
        }
        other => {
            let message = format!("{}: expected an image, found {}", path.display(), other.kind());
            Err(PipelineError::new_err(message))
        }
    }
}

/// Runs a pipeline; its report as JSON.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is an argument of the Python function")]
fn run(
    py: Python<'_>,
    text: Option<&str>,
    path: &str,
    sets: Vec<String>,
    out: Option<PathBuf>,
    threads: Option<usize>,
    backend: &str,
    force: bool,
    watch: Option<Py<PyAny>>,
) -> PyResult<String> {
    let pipeline = pipeline(text, path, &sets, out)?;
    warn(py, &pipeline)?;
    let settings = settings(threads, backend, force)?;
    match watched(py, &settings, watch, |progress| ao4d::pipeline::run(&pipeline, &settings, progress))? {
        Ok(report) => json(&report),
        Err(RunError::Refused(error)) => Err(refused(error)),
        Err(RunError::Cancelled(_)) => Err(PyKeyboardInterrupt::new_err(())),
        Err(error) => Err(WorkError::new_err(self::text(&error))),
    }
}

/// Everything short of running a pipeline; its plan as JSON.
#[pyfunction]
fn check(py: Python<'_>, text: Option<&str>, path: &str, sets: Vec<String>) -> PyResult<String> {
    let pipeline = pipeline(text, path, &sets, None)?;
    warn(py, &pipeline)?;
    let settings = Settings::default();
    let prepared = watched(py, &settings, None, |progress| pipeline.prepare_watched(|_| true, progress))?;
    json(&pipeline.plan.describe(&prepared.map_err(refused)?.counts()))
}

fn tolerance((atol, rtol, max_different): (f64, f64, usize), arrays: Vec<String>) -> PyResult<Tolerance> {
    if [atol, rtol].iter().all(|x| x.is_finite() && *x >= 0.0) {
        return Ok(Tolerance { atol, rtol, max_different, arrays, ..Tolerance::default() });
    }
    Err(PyValueError::new_err("atol, rtol: expected numbers, 0 or above"))
}

/// How far two files are apart, as JSON.
#[pyfunction]
fn compare_files(
    py: Python<'_>,
    a: PathBuf,
    b: PathBuf,
    tolerances: (f64, f64, usize),
    arrays: Vec<String>,
) -> PyResult<String> {
    let tolerance = tolerance(tolerances, arrays)?;
    json(&py.detach(|| inspect::compare(&a, &b, &tolerance)).map_err(refused)?)
}

/// Images by their dimensions and arrays, each with its name.
type Given<'py> = ([usize; 3], [f64; 3], [f64; 3], Vec<(String, Bound<'py, PyAny>)>);

/// How far two images are apart, as JSON.
#[pyfunction]
fn compare_images(
    py: Python<'_>,
    a: Given<'_>,
    b: Given<'_>,
    tolerances: (f64, f64, usize),
    arrays: Vec<String>,
) -> PyResult<String> {
    let tolerance = tolerance(tolerances, arrays)?;
    let volume = |(dimensions, origin, spacing, arrays): Given<'_>| -> PyResult<Volume> {
        let grid = Grid { dimensions, origin, spacing };
        let arrays = arrays.iter().map(|(name, array)| values_of(name, array)).collect::<PyResult<_>>()?;
        Ok(Volume { grid, arrays, field_data: Vec::new() })
    };
    let (a, b) = (volume(a)?, volume(b)?);
    json(&py.detach(|| compare::volumes(&a, &b, &tolerance)))
}

/// What a file holds, as JSON.
#[pyfunction]
fn info(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    json(&py.detach(|| inspect::Info::read_array(&path, None)).map_err(refused)?)
}

/// The JSON Schema of pipelines.
#[pyfunction]
fn schema() -> PyResult<String> {
    json(&ao4d::pipeline::schema())
}

/// The command line; returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| ao4d::cli::main(arguments))
}

/// The native module.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PipelineError", module.py().get_type::<PipelineError>())?;
    module.add("WorkError", module.py().get_type::<WorkError>())?;
    module.add_class::<Mesh>()?;
    module.add_function(wrap_pyfunction!(occlusion, module)?)?;
    module.add_function(wrap_pyfunction!(render, module)?)?;
    module.add_function(wrap_pyfunction!(read_image, module)?)?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(check, module)?)?;
    module.add_function(wrap_pyfunction!(compare_files, module)?)?;
    module.add_function(wrap_pyfunction!(compare_images, module)?)?;
    module.add_function(wrap_pyfunction!(info, module)?)?;
    module.add_function(wrap_pyfunction!(schema, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    Ok(())
}
