//! One object of a scene: what it is, where it is, its colour.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::color::Color;
use super::cuboid::{BoxSpec, TesseractSpec};
use super::cut_cube::CutCubeSpec;
use super::extrude::ExtrudeSpec;
use super::hypersphere::SphereSpec;
use super::isosurface::IsosurfaceSpec;
use super::numbers::{AXES, only_in};
use super::polytope::PolytopeSpec;
use super::products::{CubinderSpec, DuocylinderSpec, DuoprismSpec, SpherinderSpec};
use super::simplices::SimplicesSpec;
use super::slab::SlabSpec;
use super::spin::SpinSpec;
use super::transform::{self, TransformStep};
use super::welding::Weld;
use super::{Error, file};
use crate::geometry::Dimension;
use crate::mesh::corners::DEFAULT_ANGLE;
use crate::mesh::rounding::turned_over;
use crate::mesh::{Crease, Gloss, Surface};
use crate::progress::{Progress, Silent};

/// An object: exactly one shape, and where to put it. The shapes' keys are those that [`ObjectSpec::shape`] lists.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectSpec {
    /// What to call it in messages and files.
    #[serde(default)]
    pub name: Option<String>,
    /// Shape: vertices and simplices listed here.
    #[serde(default)]
    pub simplices: Option<SimplicesSpec>,
    /// Shape: a surface from a file: `.vtu` of tetrahedra with a `position` array in 4D; `.stl`, `.obj`, `.ply`,
    /// `.msh`, `.vtk`, `.vtp`, `.vtu` in 3D.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Shape: a three-dimensional mesh swept along the fourth axis.
    #[serde(default)]
    pub extrude: Option<ExtrudeSpec>,
    /// Shape: a box from which smaller boxes are cut away.
    #[serde(default)]
    pub cut_cube: Option<CutCubeSpec>,
    /// Shape: an axis-parallel box.
    #[serde(default)]
    pub r#box: Option<BoxSpec>,
    /// Shape: the 4-cube around the origin.
    #[serde(default)]
    pub tesseract: Option<TesseractSpec>,
    /// Shape: a sphere of the scene's dimension: of tetrahedra in 4D, of triangles in 3D.
    #[serde(default)]
    pub hypersphere: Option<SphereSpec>,
    /// Shape: a sphere in 3D.
    #[serde(default)]
    pub sphere: Option<SphereSpec>,
    /// Shape: where a field, given by a formula or by a grid of values, passes a value.
    #[serde(default)]
    pub isosurface: Option<IsosurfaceSpec>,
    /// Shape: a three-dimensional mesh turned round in a plane with w.
    #[serde(default)]
    pub spin: Option<SpinSpec>,
    /// Shape: a regular polytope: 5-, 8-, 16-, 24-, 120- or 600-cell; in 3D a polyhedron.
    #[serde(default)]
    pub polytope: Option<PolytopeSpec>,
    /// Shape: the product of two regular polygons.
    #[serde(default)]
    pub duoprism: Option<DuoprismSpec>,
    /// Shape: the product of two discs.
    #[serde(default)]
    pub duocylinder: Option<DuocylinderSpec>,
    /// Shape: the product of a ball and an interval.
    #[serde(default)]
    pub spherinder: Option<SpherinderSpec>,
    /// Shape: the product of a disc and a rectangle.
    #[serde(default)]
    pub cubinder: Option<CubinderSpec>,
    /// What of it is kept: the part between two parallel hyperplanes, before it is placed. What was closed is closed again.
    #[serde(default)]
    pub slab: Option<SlabSpec>,
    /// Of a mesh from a file (`file`, `extrude`, `spin`): points no farther apart than this, in the file's units, are one. So
    /// close surfaces whose triangles meet but for rounding. If left out, points in one place are one where that matters.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub weld: Option<f64>,
    /// Steps that place the object, applied in this order.
    #[serde(default)]
    pub transform: Vec<TransformStep>,
    /// The colour; a light grey of 0.8 if left out.
    #[serde(default)]
    pub color: Color,
    /// The share of light that each of the object's surfaces keeps from passing, 0 to 1 (default 1, opaque). A ray through a
    /// body passes two surfaces, or more, so of a body of 0.3 about half is seen through.
    #[serde(default)]
    #[schemars(range(min = 0, max = 1))]
    pub opacity: Option<f64>,
    /// The share of lights that the object reflects in highlights, 0 to 1 (default what the render says).
    #[serde(default)]
    #[schemars(range(min = 0, max = 1))]
    pub specular: Option<f64>,
    /// The exponent of its highlights: the higher, the smaller they are (default what the render says).
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub shininess: Option<f64>,
    /// Which way the surface faces: `input` (default), open surfaces by the order of their vertices, closed ones outwards; or
    /// `eye`, where it is seen from by the first render of the scene, so that a closed surface around the eye is a room.
    #[serde(default)]
    pub orientation: Orientation,
    /// Where the surface creases: neighbours whose normals differ by more than this, in degrees, have a shading point each
    /// at the vertices between them. 30 if left out, or more for an isosurface that is rough all over; listed simplices
    /// keep their vertices. `off`: one normal a vertex.
    #[serde(default)]
    pub crease_angle: Option<CreaseAngle>,
}

/// An angle in degrees, or `off`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected degrees from 0 to 180, or off")]
pub enum CreaseAngle {
    /// Degrees, from 0 to 180.
    Degrees(f64),
    /// No creases.
    Off(Off),
}

/// The word `off`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Off {
    /// It.
    Off,
}

/// Which way a surface faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Orientation {
    /// As the order of its vertices says if it is open, outwards if it is closed.
    #[default]
    Input,
    /// Towards the eye, from within too.
    Eye,
}

/// The one shape of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape<'a> {
    /// Vertices and simplices listed.
    Simplices(&'a SimplicesSpec),
    /// A surface from a file.
    File(&'a Path),
    /// A three-dimensional mesh swept along the fourth axis.
    Extrude(&'a ExtrudeSpec),
    /// A box from which smaller boxes are cut away.
    CutCube(&'a CutCubeSpec),
    /// An axis-parallel box.
    Box(&'a BoxSpec),
    /// The 4-cube around the origin.
    Tesseract(&'a TesseractSpec),
    /// A sphere of the scene's dimension.
    Hypersphere(&'a SphereSpec),
    /// A sphere in 3D.
    Sphere(&'a SphereSpec),
    /// Where a field passes a value.
    Isosurface(&'a IsosurfaceSpec),
    /// A three-dimensional mesh turned round in a plane with w.
    Spin(&'a SpinSpec),
    /// A regular polytope: 5-, 8-, 16-, 24-, 120- or 600-cell.
    Polytope(&'a PolytopeSpec),
    /// The product of two regular polygons.
    Duoprism(&'a DuoprismSpec),
    /// The product of two discs.
    Duocylinder(&'a DuocylinderSpec),
    /// The product of a ball and an interval.
    Spherinder(&'a SpherinderSpec),
    /// The product of a disc and a rectangle.
    Cubinder(&'a CubinderSpec),
}

impl Shape<'_> {
    /// Its key in the pipeline.
    pub fn key(&self) -> &'static str {
        match self {
            Shape::Simplices(_) => "simplices",
            Shape::File(_) => "file",
            Shape::Extrude(_) => "extrude",
            Shape::CutCube(_) => "cut_cube",
            Shape::Box(_) => "box",
            Shape::Tesseract(_) => "tesseract",
            Shape::Hypersphere(_) => "hypersphere",
            Shape::Sphere(_) => "sphere",
            Shape::Isosurface(_) => "isosurface",
            Shape::Spin(_) => "spin",
            Shape::Polytope(_) => "polytope",
            Shape::Duoprism(_) => "duoprism",
            Shape::Duocylinder(_) => "duocylinder",
            Shape::Spherinder(_) => "spherinder",
            Shape::Cubinder(_) => "cubinder",
        }
    }

    /// The files it is read from, those among them that only a header names; paths are relative to `folder`.
    pub fn input_files(&self, folder: &Path) -> Vec<PathBuf> {
        let of_mesh = |file: PathBuf| [crate::io::mesh::data_files(&file), vec![file]].concat();
        match self {
            Shape::File(path) => of_mesh(folder.join(path)),
            Shape::Extrude(spec) => of_mesh(folder.join(&spec.mesh)),
            Shape::Spin(spec) => of_mesh(folder.join(&spec.mesh)),
            Shape::Isosurface(spec) => spec.input_files(folder),
            _ => Vec::new(),
        }
    }

    /// Which simplices fill a solid within triangles, one flag a simplex; none if the shape fills no such solid. Those lie
    /// across the last axis, before the surface is placed.
    fn solid_simplices<const D: usize>(&self, surface: &Surface<D>) -> Vec<bool> {
        if !matches!(self, Shape::Extrude(spec) if spec.caps == Some(true)) {
            return Vec::new();
        }
        let last = |v: u32| surface.vertices[v as usize][D - 1];
        surface.simplices.iter().map(|simplex| simplex.iter().all(|&v| last(v) == last(simplex[0]))).collect()
    }

    /// The surface, before it is placed.
    fn build<const D: usize>(
        &self,
        folder: &Path,
        weld: Weld,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Surface<D>, Error> {
        match self {
            Shape::Simplices(spec) => spec.build(),
            Shape::File(path) => file::build(path, folder, weld, notes),
            Shape::Extrude(spec) => spec.build(folder, weld, notes, progress),
            Shape::CutCube(spec) => spec.build(),
            Shape::Box(spec) => spec.build(),
            Shape::Tesseract(spec) => spec.build(),
            Shape::Hypersphere(spec) => spec.build("hypersphere"),
            Shape::Sphere(spec) => {
                only_in::<D>(Dimension::Three, "sphere", "; take a hypersphere")?;
                spec.build("sphere")
            }
            Shape::Isosurface(spec) => spec.build(folder, notes, progress),
            Shape::Spin(spec) => spec.build(folder, weld, notes),
            Shape::Polytope(spec) => spec.build(),
            Shape::Duoprism(spec) => spec.build(),
            Shape::Duocylinder(spec) => spec.build(),
            Shape::Spherinder(spec) => spec.build(),
            Shape::Cubinder(spec) => spec.build(),
        }
    }
}

impl ObjectSpec {
    /// The object's shape; refused if there is none, or more than one.
    pub fn shape(&self) -> Result<Shape<'_>, Error> {
        let shapes = [
            self.simplices.as_ref().map(Shape::Simplices),
            self.file.as_deref().map(Shape::File),
            self.extrude.as_ref().map(Shape::Extrude),
            self.cut_cube.as_ref().map(Shape::CutCube),
            self.r#box.as_ref().map(Shape::Box),
            self.tesseract.as_ref().map(Shape::Tesseract),
            self.hypersphere.as_ref().map(Shape::Hypersphere),
            self.sphere.as_ref().map(Shape::Sphere),
            self.isosurface.as_ref().map(Shape::Isosurface),
            self.spin.as_ref().map(Shape::Spin),
            self.polytope.as_ref().map(Shape::Polytope),
            self.duoprism.as_ref().map(Shape::Duoprism),
            self.duocylinder.as_ref().map(Shape::Duocylinder),
            self.spherinder.as_ref().map(Shape::Spherinder),
            self.cubinder.as_ref().map(Shape::Cubinder),
        ];
        let mut given = shapes.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(shape), None) => Ok(shape),
            (Some(first), Some(second)) => Err(Error::invalid(
                second.key(),
                format!("the object is already a {}; an object has one shape, so make it two objects", first.key()),
            )),
            _ => Err(Error::invalid(
                "",
                "the object has no shape; give it one of simplices, file, extrude, cut_cube, box, tesseract, \
                 hypersphere, sphere, isosurface, spin, polytope, duoprism, duocylinder, spherinder, cubinder",
            )),
        }
    }
}

impl ObjectSpec {
    /// How much light each of its surfaces keeps from passing.
    pub fn surface_opacity(&self) -> Result<f32, Error> {
        match self.opacity {
            None => Ok(1.0),
            Some(opacity) if (0.0..=1.0).contains(&opacity) => Ok(opacity as f32),
            Some(opacity) => Err(Error::invalid("opacity", format!("expected a number from 0 to 1, found {opacity}"))),
        }
    }

    /// How it reflects lights, where that is not left to the picture.
    pub fn gloss(&self) -> Result<Gloss, Error> {
        let within = |key: &str, found: Option<f64>, least: f64, most: f64| match found {
            Some(x) if !(least..=most).contains(&x) => {
                Err(Error::invalid(key, format!("expected a number from {least} to {most}, found {x}")))
            }
            found => Ok(found),
        };
        let specular = within("specular", self.specular, 0.0, 1.0)?;
        Ok(Gloss { specular, shininess: within("shininess", self.shininess, 1.0, 1e6)? })
    }

    /// Where the object's vertices are split.
    pub fn crease(&self) -> Result<Crease, Error> {
        Ok(match (self.crease_angle, self.shape()?) {
            (Some(CreaseAngle::Off(Off::Off)), _) => Crease::Never,
            (Some(CreaseAngle::Degrees(degrees)), _) if (0.0..=180.0).contains(&degrees) => Crease::Above(degrees),
            (Some(CreaseAngle::Degrees(degrees)), _) => {
                let message = format!("expected degrees from 0 to 180, or off, found {degrees}");
                return Err(Error::invalid("crease_angle", message));
            }
            (None, Shape::Simplices(_)) => Crease::Never,
            (None, Shape::Isosurface(_)) => Crease::Rough,
            (None, _) => Crease::Above(DEFAULT_ANGLE),
        })
    }
}

/// The object's surface where the scene has it. Paths are relative to `folder`.
pub fn build_object<const D: usize>(spec: &ObjectSpec, folder: &Path) -> Result<Surface<D>, Error> {
    build_object_with_notes(spec, folder, &mut Vec::new())
}

/// The same; what is allowed but worth telling is added to `notes`, each beginning with the key it is about.
pub fn build_object_with_notes<const D: usize>(
    spec: &ObjectSpec,
    folder: &Path,
    notes: &mut Vec<String>,
) -> Result<Surface<D>, Error> {
    build_object_watched(spec, folder, notes, &Silent)
}

/// The same, stopped with [`Error::Cancelled`] soon after `progress` says so.
pub fn build_object_watched<const D: usize>(
    spec: &ObjectSpec,
    folder: &Path,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Surface<D>, Error> {
    let shape = spec.shape()?;
    spec.color.rgb()?;
    spec.surface_opacity()?;
    spec.gloss()?;
    let weld = Weld::new(spec.weld)?;
    if spec.weld.is_some() && !matches!(shape, Shape::File(_) | Shape::Extrude(_) | Shape::Spin(_)) {
        let message =
            format!("a {} has no points to weld; only meshes from files have: file, extrude, spin", shape.key());
        return Err(Error::invalid("weld", message));
    }
    let mut surface = shape.build::<D>(folder, weld, notes, progress)?;
    if let Some(slab) = &spec.slab {
        surface = slab.cut(surface, progress)?;
    }
    let solid = shape.solid_simplices(&surface);
    transform::apply("transform", &spec.transform, &mut surface)?;
    check_single_precision(&surface, if spec.transform.is_empty() { shape.key() } else { "transform" })?;
    if !solid.is_empty() {
        check_solid(&surface, &solid)?;
    }
    Ok(surface)
}

/// A surface that is in its place, moved on by further steps: as if these stood at the end of its object's `transform`.
///
/// # Errors
/// Whatever is wrong with a step, or if it leads beyond single precision.
pub fn moved<const D: usize>(surface: &Surface<D>, steps: &[TransformStep]) -> Result<Surface<D>, Error> {
    let mut moved = surface.clone();
    transform::apply("transform", steps, &mut moved)?;
    check_single_precision(&moved, "transform")?;
    Ok(moved)
}

/// Coordinates are rounded to single precision later and must survive that.
fn check_single_precision<const D: usize>(surface: &Surface<D>, key: &str) -> Result<(), Error> {
    let too_large = |x: &f64| !x.is_finite() || x.abs() > f64::from(f32::MAX);
    let Some((i, vertex)) = surface.vertices.iter().enumerate().find(|(_, vertex)| vertex.iter().any(too_large)) else {
        return Ok(());
    };
    let axis = vertex.iter().position(too_large).unwrap_or_default();
    let message = format!("vertex {i} has {} = {:e}, beyond single precision (3.4e38)", AXES[axis], vertex[axis]);
    Err(Error::invalid(key, message))
}

/// Refuses a filled solid whose tetrahedra fold over when rounded: it would shadow itself.
fn check_solid<const D: usize>(surface: &Surface<D>, solid: &[bool]) -> Result<(), Error> {
    let turned: Vec<u32> = turned_over(surface).into_iter().filter(|&s| solid[s as usize]).collect();
    let Some(&first) = turned.first() else { return Ok(()) };
    let at: Vec<String> =
        surface.vertices[surface.simplices[first as usize][0] as usize].iter().map(|x| format!("{x:.6}")).collect();
    let message = format!(
        "{} tetrahedra of the solid within fold over when rounded to single precision, the first near ({}): the mesh has \
         parts too thin for its size and place; simplify it there, or move it nearer to the origin",
        turned.len(),
        at.join(", ")
    );
    Err(Error::invalid("extrude.caps", message))
}
