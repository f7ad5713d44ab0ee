//! Spinning a three-dimensional mesh in a plane with w, as a lathe does: each point turns around, along a circle
//! through w whose radius is its coordinate along the axis that turns.
//!
//! That is the product of the mesh's surface with a circle (see [`super::product`]), its points moved afterwards. It is closed
//! if the surface is. A ball beside the axis becomes a spheritorus, a torus around it a ditorus, one whose hole it goes
//! through the product of three circles, as a tiger is; a half ball on the axis becomes a hypersphere. Points on the axis
//! stay where they are, and what is flat there afterwards is left out.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::extrude::solid;
use super::numbers::{AXES, check_count, finite, only_in};
use super::product::Chain;
use super::welding::Weld;
use crate::geometry::{Dimension, Vector64};
use crate::io::Input;
use crate::io::mesh::Cells;
use crate::mesh::Surface;
use crate::mesh::weld::weld;

/// A mesh from a file, turned all the way round in a plane with w.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpinSpec {
    /// The mesh: a closed surface of triangles, or a solid of tetrahedra, whose surface is taken. Relative to the
    /// pipeline's folder.
    pub mesh: PathBuf,
    /// The plane: `xw` (if left out), `yw` or `zw`.
    #[serde(default)]
    pub plane: Option<String>,
    /// Added to the coordinate that turns, before it does; nowhere may it be below 0 then.
    #[serde(default)]
    pub offset: f64,
    /// Steps of the turn, 3 at least.
    #[schemars(range(min = 3))]
    pub steps: u32,
}

impl SpinSpec {
    /// The surface of revolution. Refused in 3D.
    pub(super) fn build<const D: usize>(
        &self,
        folder: &Path,
        tolerance: Weld,
        notes: &mut Vec<String>,
    ) -> Result<Surface<D>, Error> {
        only_in::<D>(Dimension::Four, "spin", "")?;
        let axis = match self.plane.as_deref() {
            None | Some("xw") => 0,
            Some("yw") => 1,
            Some("zw") => 2,
            Some(other) => {
                return Err(Error::invalid("spin.plane", format!("\"{other}\" is none of xw, yw and zw")));
            }
        };
        let offset = finite("spin.offset", self.offset)?;
        if self.steps < 3 {
            return Err(Error::invalid("spin.steps", format!("{} steps; the least is 3", self.steps)));
        }
        let input = Input::new("spin.mesh", folder, &self.mesh);
        let mesh = input.read()?;
        let (points, triangles) = match mesh.cells {
            Cells::Triangles(triangles) => tolerance.apply(&mesh.points, triangles, notes)?,
            Cells::Tetrahedra(tetrahedra) => {
                let (points, tetrahedra) = tolerance.apply(&mesh.points, tetrahedra, notes)?;
                let walls = solid(&points, tetrahedra).map_err(|message| input.wrong(message))?.boundary();
                (points, walls.oriented())
            }
        };
        check_count("spin.steps", 3 * u128::from(self.steps) * triangles.len() as u128)?;
        if points.len() as u64 * u64::from(self.steps) > u64::from(u32::MAX) {
            return Err(Error::invalid("spin.steps", "too many: there would be more than 2^32 points"));
        }
        if let Some(point) = points.iter().find(|point| point[axis] + offset < 0.0) {
            let (name, value) = (AXES[axis], point[axis]);
            let message =
                format!("a point has {name} = {value}, beyond the axis; give an offset of {} or more", -value);
            return Err(Error::invalid("spin.offset", message));
        }
        let circle: Vec<[u32; 2]> = (0..self.steps).map(|i| [i, (i + 1) % self.steps]).collect();
        let turned = Chain::of(points.len() as u32, &triangles).times(&Chain::of(self.steps, &circle));
        let angles: Vec<(f64, f64)> = (0..self.steps)
            .map(|i| libm::sincos(std::f64::consts::TAU * f64::from(i) / f64::from(self.steps)))
            .collect();
        let places: Vec<Vector64<D>> = points
            .iter()
            .flat_map(|point| {
                angles.iter().map(move |(sine, cosine)| {
                    let radius = point[axis] + offset;
                    Vector64::from_fn(|row, _| match row {
                        3 => radius * sine,
                        _ if row == axis => radius * cosine,
                        _ => point[row],
                    })
                })
            })
            .collect();
        let (vertices, simplices) = weld(&places, turned.oriented::<D>());
        Ok(Surface { vertices, simplices, normals: None })
    }
}
