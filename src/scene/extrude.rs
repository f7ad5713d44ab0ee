//! Sweeping a three-dimensional mesh along the fourth axis.
//!
//! A point p of the mesh moves from p + `from` * direction to p + `to` * direction, in layers. A triangle sweeps a wall, a
//! prism of three tetrahedra a layer. A tetrahedral mesh is a solid S, and the boundary of what it sweeps is
//!
//! ```text
//! d(S x I) = dS x I - S x dI
//! ```
//!
//! (see [`super::product`]): walls over its boundary triangles, and the solid itself as the two caps. With t tetrahedra,
//! f boundary triangles and m layers that makes 2 t + 3 m f tetrahedra. The surface of a closed triangle mesh sweeps walls
//! only, which are open at both ends, unless caps are asked for: then its inside is cut into tetrahedra ([`super::fill`]).
//!
//! A motion moves, turns and scales the mesh from layer to layer: the surface is then that of a moving body in spacetime.
//!
//! Points with identical coordinates are one. Tetrahedra of a file may have either orientation; triangles are taken as
//! they are, so that walls face outwards if the triangles do.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::fill::{Faces, Unfilled, fill};
use super::lattice::compact;
use super::numbers::{check_count, finite, only_in, point};
use super::product::Chain;
use super::transform::{self, TransformStep};
use super::welding::Weld;
use crate::geometry::{Dimension, Vector64, determinant};
use crate::io::Input;
use crate::io::mesh::Cells;
use crate::mesh::Surface;
use crate::progress::Progress;

/// A mesh from a file, swept along the fourth axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExtrudeSpec {
    /// The mesh: triangles (`.stl`, `.obj`, `.ply`, `.msh`, `.vtk`, `.vtu`) or tetrahedra (`.vtu`, `.vtk`,
    /// `.msh`). Relative to the pipeline's folder.
    pub mesh: PathBuf,
    /// Where the sweep begins along the direction.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Whether to close both ends. Tetrahedra are closed if this is left out. The inside of a closed surface of triangles
    /// is cut into tetrahedra if this is `true`, which divides the triangles as well; else they sweep walls only.
    #[serde(default)]
    pub caps: Option<bool>,
    /// Layers of prisms between both ends; 1 if left out.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub layers: u32,
    /// What the mesh is swept along; `[0, 0, 0, 1]`, the fourth axis, if left out. The last number must not be 0.
    #[serde(default)]
    pub direction: Option<Vec<f64>>,
    /// What the mesh does on its way, little by little from where it is to all of it at the end: steps as in
    /// `transform`, in three dimensions, with factors above 0. Give enough `layers`.
    #[serde(default)]
    pub motion: Vec<TransformStep>,
}

fn one() -> u32 {
    1
}

impl ExtrudeSpec {
    /// The walls, and caps if the mesh is of tetrahedra. Refused in 3D.
    pub(super) fn build<const D: usize>(
        &self,
        folder: &Path,
        weld: Weld,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Surface<D>, Error> {
        only_in::<D>(Dimension::Four, "extrude", "; take file")?;
        let (from, to) = (finite("extrude.from", self.from)?, finite("extrude.to", self.to)?);
        if from == to {
            return Err(Error::invalid("extrude.to", format!("{to} is also where the sweep begins; give another")));
        }
        if self.layers == 0 {
            return Err(Error::invalid("extrude.layers", "0 layers; the least is 1"));
        }
        let direction = match &self.direction {
            Some(direction) => point::<D>("extrude.direction", direction)?,
            None => Vector64::from_fn(|row, _| f64::from(row == D - 1)),
        };
        if direction[D - 1] == 0.0 {
            let message = "the last number is 0: the mesh would be swept within its own space, not out of it";
            return Err(Error::invalid("extrude.direction", message));
        }
        self.check_motion()?;
        let input = Input::new("extrude.mesh", folder, &self.mesh);
        let mesh = input.read()?;
        let swept = match mesh.cells {
            Cells::Triangles(triangles) => {
                let (points, triangles) = weld.apply(&mesh.points, triangles, notes)?;
                let interval = Chain::interval(self.layers);
                if self.caps == Some(true) {
                    let ((points, tetrahedra), overlap) =
                        fill(&points, &triangles, Faces::Anew, progress).map_err(|unfilled| match unfilled {
                            Unfilled::Cancelled => Error::Cancelled,
                            Unfilled::Refused(message) => input.wrong(message).into(),
                        })?;
                    notes.extend(overlap.map(|overlap| input.wrong(overlap).to_string()));
                    let solid = Chain::of(points.len() as u32, &tetrahedra);
                    self.check_size(points.len(), solid.len(), solid.boundary().len())?;
                    Swept { points, chain: solid.boundary_of_product(&interval) }
                } else {
                    self.check_size(points.len(), 0, triangles.len())?;
                    let triangles = Chain::of(points.len() as u32, &triangles);
                    Swept { points, chain: triangles.times(&interval) }
                }
            }
            Cells::Tetrahedra(tetrahedra) => {
                let (points, tetrahedra) = weld.apply(&mesh.points, tetrahedra, notes)?;
                let solid = solid(&points, tetrahedra).map_err(|message| input.wrong(message))?;
                let boundary = solid.boundary();
                self.check_size(points.len(), solid.len(), boundary.len())?;
                let interval = Chain::interval(self.layers);
                let chain = match self.caps {
                    Some(false) => boundary.times(&interval),
                    _ => solid.boundary_of_product(&interval),
                };
                Swept { points, chain }
            }
        };
        // Swept against the direction in which w grows, the product has the other handedness.
        let inside_out = (to < from) != (direction[D - 1] < 0.0);
        let layers = self.moved(&swept.points)?;
        Ok(swept.place(&layers, from, to, &direction, inside_out))
    }

    /// Refuses what would turn the mesh inside out on its way, and what can't be in three dimensions.
    fn check_motion(&self) -> Result<(), Error> {
        for (i, step) in self.motion.iter().enumerate() {
            let key = format!("extrude.motion.{i}.scale");
            let factors = step.scale.as_ref().map(|factors| factors.each::<3>(&key)).transpose()?.unwrap_or([1.0; 3]);
            if let Some(factor) = factors.iter().find(|factor| **factor <= 0.0) {
                let message = format!("{factor} is not above 0: the mesh would shrink to nothing on its way");
                return Err(Error::invalid(key, message));
            }
        }
        transform::apply::<3>("extrude.motion", &self.motion, &mut Surface::default())
    }

    /// The points in each layer.
    fn moved(&self, points: &[Vector64<3>]) -> Result<Vec<Vec<Vector64<3>>>, Error> {
        (0..=self.layers)
            .map(|layer| {
                let share = f64::from(layer) / f64::from(self.layers);
                let steps: Vec<TransformStep> = self.motion.iter().map(|step| step.part(share)).collect();
                let mut surface = Surface { vertices: points.to_vec(), ..Surface::default() };
                transform::apply("extrude.motion", &steps, &mut surface).map(|()| surface.vertices)
            })
            .collect()
    }

    fn check_size(&self, points: usize, tetrahedra: usize, walls: usize) -> Result<(), Error> {
        let layers = u128::from(self.layers);
        check_count("extrude.layers", 2 * tetrahedra as u128 + 3 * layers * walls as u128)?;
        if points as u128 * (layers + 1) > u128::from(u32::MAX) {
            return Err(Error::invalid("extrude.layers", "too many: there would be more than 2^32 points"));
        }
        Ok(())
    }
}

/// Tetrahedra over pairs (point, layer).
struct Swept {
    points: Vec<Vector64<3>>,
    chain: Chain,
}

impl Swept {
    fn place<const D: usize>(
        self,
        layers: &[Vec<Vector64<3>>],
        from: f64,
        to: f64,
        direction: &Vector64<D>,
        inside_out: bool,
    ) -> Surface<D> {
        // `oriented` is given 4 vertices a simplex, which is D here.
        let tetrahedra = self.chain.oriented::<D>();
        let (used, mut simplices) = compact(tetrahedra);
        if inside_out {
            simplices.iter_mut().for_each(|simplex| simplex.swap(D - 2, D - 1));
        }
        let last = layers.len() - 1;
        let place = |pair: u32| {
            let (point, layer) = (pair as usize / layers.len(), pair as usize % layers.len());
            let share = layer as f64 / last as f64;
            // Both ends are exact.
            let along = if layer == last { to } else { from + (to - from) * share };
            let point = layers[layer][point];
            Vector64::from_fn(|row, _| if row < 3 { point[row] } else { 0.0 } + direction[row] * along)
        };
        Surface { vertices: used.into_iter().map(place).collect(), simplices, normals: None }
    }
}

/// The solid, every tetrahedron oriented positively, with a boundary that makes sense.
pub(super) fn solid(points: &[Vector64<3>], mut tetrahedra: Vec<[u32; 4]>) -> Result<Chain, String> {
    for (i, tetrahedron) in tetrahedra.iter_mut().enumerate() {
        let [a, b, c, d] = tetrahedron.map(|i| points[i as usize]);
        let volume = determinant(&[b - a, c - a, d - a]);
        if volume == 0.0 {
            return Err(format!("tetrahedron {i} is flat: it has no volume, and so no orientation; leave it out"));
        }
        if volume < 0.0 {
            tetrahedron.swap(2, 3);
        }
    }
    let mut facets: Vec<([u32; 3], usize)> = Vec::with_capacity(4 * tetrahedra.len());
    for (i, tetrahedron) in tetrahedra.iter().enumerate() {
        for left_out in 0..4 {
            let mut facet: [u32; 3] = std::array::from_fn(|k| tetrahedron[k + usize::from(k >= left_out)]);
            facet.sort_unstable();
            facets.push((facet, i));
        }
    }
    facets.sort_unstable();
    if let Some(shared) = facets.chunk_by(|a, b| a.0 == b.0).find(|shared| shared.len() > 2) {
        let which: Vec<String> = shared.iter().map(|(_, i)| i.to_string()).collect();
        return Err(format!("tetrahedra {} all share one triangle, so some of them overlap", which.join(", ")));
    }
    let solid = Chain::of(points.len() as u32, &tetrahedra);
    // Of two tetrahedra on the same side of the triangle they share, the boundary keeps the triangle twice.
    let boundary = solid.boundary();
    let mut walls: Vec<[u32; 3]> = boundary.oriented::<3>();
    walls.iter_mut().for_each(|wall| wall.sort_unstable());
    walls.sort_unstable();
    if let Some(twice) = walls.windows(2).find(|pair| pair[0] == pair[1]) {
        let which: Vec<String> =
            facets.iter().filter(|(facet, _)| *facet == twice[0]).map(|(_, i)| i.to_string()).collect();
        return Err(format!("tetrahedra {} lie on the same side of the triangle they share", which.join(" and ")));
    }
    Ok(solid)
}
