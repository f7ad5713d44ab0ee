//! A mesh from numpy's arrays, or from a pipeline's scene, with all that traces rays in it.

use ao4d::geometry::{Dimension, Vector64};
use ao4d::mesh::{Crease, MeshBuilder, Orientation, Surface, Viewpoint};
use ao4d::pipeline::{RunError, Settings};
use ao4d::session::Session;
use ao4d::stages::scene::AnyMesh;
use ao4d::volume::Values;
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyAny;

use crate::arrays::to_numpy;
use crate::watch::watched;
use crate::{PipelineError, pipeline, refused};

/// A mesh of either dimension.
pub enum Any {
    /// Triangles in R^3.
    Three(Session<3>),
    /// Tetrahedra in R^4.
    Four(Session<4>),
}

/// A mesh, ready for rays.
#[pyclass(frozen, module = "ao4d._native")]
pub struct Mesh(Any);

/// One object: name, vertices, simplices, colour, opacity, crease angle (below 0: never), and the eye that it faces.
type Object<'py> =
    (String, PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, u32>, [f32; 3], f32, f64, Option<Vec<f64>>);

impl Mesh {
    /// What it is.
    pub fn any(&self) -> &Any {
        &self.0
    }
}

#[pymethods]
impl Mesh {
    /// Builds a mesh of some dimension from objects.
    #[staticmethod]
    fn build(py: Python<'_>, dimension: usize, objects: Vec<Object<'_>>) -> PyResult<Self> {
        Ok(Self(match Dimension::new(dimension as u64) {
            Some(Dimension::Three) => Any::Three(from_objects(py, objects)?),
            Some(Dimension::Four) => Any::Four(from_objects(py, objects)?),
            None => {
                let message = format!("vertices: expected 3 or 4 coordinates each, found {dimension}");
                return Err(PipelineError::new_err(message));
            }
        }))
    }

    /// The first scene of a pipeline, and what is to be told of it.
    #[staticmethod]
    fn scene(
        py: Python<'_>,
        text: Option<&str>,
        path: &str,
        sets: Vec<String>,
        watch: Option<Py<PyAny>>,
    ) -> PyResult<(Self, Vec<String>)> {
        let pipeline = pipeline(text, path, &sets, None)?;
        let built = watched(py, &Settings::default(), watch, |progress| pipeline.prepare_watched(|_| true, progress))?;
        let mut prepared = built.map_err(RunError::from).map_err(refused)?;
        let mesh = match prepared.meshes.drain(..).flatten().next() {
            Some(AnyMesh::Three(mesh)) => Any::Three(Session::new(mesh)),
            Some(AnyMesh::Four(mesh)) => Any::Four(Session::new(mesh)),
            None => return Err(PipelineError::new_err(format!("{path}: has no scene"))),
        };
        Ok((Self(mesh), prepared.notes.into_iter().next().unwrap_or_default()))
    }

    /// The number of coordinates of a vertex.
    #[getter]
    fn dimension(&self) -> usize {
        match &self.0 {
            Any::Three(_) => 3,
            Any::Four(_) => 4,
        }
    }

    /// Vertices, their normals, simplices, and the number of the object that each vertex belongs to, from 1.
    #[expect(clippy::type_complexity, reason = "four arrays")]
    fn arrays<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        match &self.0 {
            Any::Three(session) => arrays(py, session),
            Any::Four(session) => arrays(py, session),
        }
    }

    /// Of each object its name, whether it is closed, and its opacity.
    fn objects(&self) -> Vec<(String, bool, f32)> {
        let objects = match &self.0 {
            Any::Three(session) => &session.mesh().objects,
            Any::Four(session) => &session.mesh().objects,
        };
        objects.iter().map(|object| (object.name.clone(), object.is_closed(), object.opacity)).collect()
    }
}

#[expect(clippy::type_complexity, reason = "four arrays")]
fn arrays<'py, const D: usize>(
    py: Python<'py>,
    session: &Session<D>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let mesh = session.mesh();
    let numbers = |points: &[ao4d::geometry::Vector<D>]| points.iter().flat_map(|p| p.iter().copied()).collect();
    let mut object = vec![0_u16; mesh.vertices.len()];
    for (number, range) in (1..).zip(mesh.objects.iter().map(|object| object.vertices.clone())) {
        object[range].fill(number);
    }
    let simplices = mesh.simplices.iter().flatten().copied().collect();
    Ok((
        to_numpy(py, Values::F32(numbers(&mesh.vertices)), D)?,
        to_numpy(py, Values::F32(numbers(&mesh.normals)), D)?,
        to_numpy(py, Values::U32(simplices), D)?,
        to_numpy(py, Values::U16(object), 1)?,
    ))
}

fn from_objects<const D: usize>(py: Python<'_>, objects: Vec<Object<'_>>) -> PyResult<Session<D>> {
    let mut builder = MeshBuilder::<D>::new();
    for (name, vertices, simplices, color, opacity, crease, eye) in objects {
        for (what, columns) in [("vertices", vertices.shape()[1]), ("simplices", simplices.shape()[1])] {
            if columns != D {
                let message =
                    format!("{name}: {what} have {columns} columns; expected {D}, as the first object's vertices have");
                return Err(PipelineError::new_err(message));
            }
        }
        let rows = vertices.as_slice()?.chunks_exact(D);
        let surface = Surface {
            vertices: rows.map(|row| Vector64::<D>::from_fn(|i, _| row[i])).collect(),
            simplices: simplices.as_slice()?.chunks_exact(D).map(|row| std::array::from_fn(|i| row[i])).collect(),
            normals: None,
        };
        let orientation = match eye {
            None => Orientation::Input,
            Some(eye) if eye.len() == D => {
                Orientation::Facing(Viewpoint::Eye(ao4d::geometry::Vector::<D>::from_fn(|i, _| eye[i] as f32)))
            }
            Some(eye) => {
                let message = format!("{name}: facing: expected {D} coordinates, found {}", eye.len());
                return Err(PipelineError::new_err(message));
            }
        };
        let crease = if crease < 0.0 { Crease::Never } else { Crease::Above(crease) };
        builder.add_creased(&name, color, &surface, orientation, crease).map_err(refused)?;
        builder.set_opacity(opacity);
    }
    Ok(py.detach(|| Session::new(builder.finish())))
}
