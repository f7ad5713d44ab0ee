//! A cube with cuts: a box minus smaller boxes, as in the thesis's two cubes with a cut along the fourth axis.
//!
//! The planes of all the boxes' sides make a rectilinear lattice, each cell of which is wholly kept or wholly cut away.
//! The surface is the set of cell facets between a kept cell and one that is not, each cut into (D-1)! simplices along
//! the paths from its lowest to its highest corner (Freudenthal's or Kuhn's triangulation). All facets are cut by the
//! same rule, so the surface is closed, faces outwards and has the exact coordinates that were given.
//!
//! Kept cells that touch along an edge only, or at a corner, give a surface that is still closed, but no manifold
//! there: four facets meet in one. Occlusion and pictures are right, but a vertex on that edge has one normal for both sides.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::lattice::{Lattice, divide};
use super::numbers::{AXES, MAX_SIMPLICES, OneOrEach, bounds, check_count, subdivisions};
use crate::geometry::Vector64;
use crate::mesh::Surface;
use crate::mesh::facets::sort_with_parity;

fn one() -> OneOrEach<u32> {
    OneOrEach::One(1)
}

/// A closed axis-parallel box from which smaller boxes are cut away.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CutCubeSpec {
    /// The lowest corner, one number an axis.
    pub min: Vec<f64>,
    /// The highest corner, one number an axis.
    pub max: Vec<f64>,
    /// What is cut away. A cut may reach beyond the cube: one that goes past both ends of w runs through it along w.
    pub cuts: Vec<CutSpec>,
    /// The least number of pieces along each edge of the whole cube, or a list with one number an axis; 1 if left out.
    /// What lies between two cuts is divided evenly, into as many pieces as its share of the edge demands.
    #[serde(default = "one")]
    pub subdivisions: OneOrEach<u32>,
}

/// An axis-parallel box that is cut away.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CutSpec {
    /// The lowest corner, one number an axis.
    pub from: Vec<f64>,
    /// The highest corner, one number an axis.
    pub to: Vec<f64>,
}

impl CutCubeSpec {
    /// The surface of what the cuts leave.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        let (min, max) = bounds::<D>("cut_cube", ("min", &self.min), ("max", &self.max))?;
        let pieces = subdivisions::<D>("cut_cube.subdivisions", &self.subdivisions)?;
        let mut cuts = Vec::with_capacity(self.cuts.len());
        for (i, cut) in self.cuts.iter().enumerate() {
            let (from, to) = bounds::<D>(&format!("cut_cube.cuts.{i}"), ("from", &cut.from), ("to", &cut.to))?;
            if let Some(axis) = (0..D).find(|&axis| from[axis] >= max[axis] || to[axis] <= min[axis]) {
                let name = AXES[axis];
                return Err(Error::invalid(
                    format!("cut_cube.cuts.{i}"),
                    format!(
                        "misses the cube: it spans {} to {} along {name}, the cube {} to {}",
                        from[axis], to[axis], min[axis], max[axis]
                    ),
                ));
            }
            cuts.push((from, to));
        }
        let lattice = lattice_of(&min, &max, &cuts, pieces)?;
        let simplices = facets_of_kept(&lattice, &cuts)?;
        if simplices.is_empty() {
            return Err(Error::invalid("cut_cube.cuts", "the cuts leave nothing of the cube"));
        }
        Ok(lattice.surface(simplices))
    }
}

/// The planes of all sides, and those between them that the subdivision asks for.
fn lattice_of<const D: usize>(
    min: &Vector64<D>,
    max: &Vector64<D>,
    cuts: &[(Vector64<D>, Vector64<D>)],
    pieces: [u32; D],
) -> Result<Lattice<D>, Error> {
    let mut planes: [Vec<f64>; D] = std::array::from_fn(|_| Vec::new());
    let mut points: u128 = 1;
    for axis in 0..D {
        let (low, high) = (min[axis], max[axis]);
        let mut sides: Vec<f64> = cuts.iter().flat_map(|(from, to)| [from[axis], to[axis]]).collect();
        sides.retain(|&side| low < side && side < high);
        sides.extend([low, high]);
        sides.sort_unstable_by(f64::total_cmp);
        sides.dedup();
        let count = |pair: &[f64]| {
            // Rounded up, but 0.1 of 1 in 10 pieces is 1 piece, whatever the last bit says.
            let share = (pair[1] - pair[0]) / (high - low) * f64::from(pieces[axis]);
            (share - 1e-9).ceil().max(1.0) as u32
        };
        // Before anything of that size is made.
        points *= sides.windows(2).map(|pair| u128::from(count(pair))).sum::<u128>() + 1;
        if points > u128::from(MAX_SIMPLICES) {
            let message = format!("too many pieces: a lattice of {points} points or more; the most is {MAX_SIMPLICES}");
            return Err(Error::invalid("cut_cube.subdivisions", message));
        }
        for pair in sides.windows(2) {
            planes[axis].extend(divide(pair[0], pair[1], count(pair)));
        }
        planes[axis].push(high);
    }
    Ok(Lattice { planes })
}

fn facets_of_kept<const D: usize>(
    lattice: &Lattice<D>,
    cuts: &[(Vector64<D>, Vector64<D>)],
) -> Result<Vec<[u32; D]>, Error> {
    let cells: [usize; D] = std::array::from_fn(|axis| lattice.planes[axis].len() - 1);
    let cut_away = |cell: &[usize; D]| {
        cuts.iter().any(|(from, to)| {
            (0..D).all(|axis| {
                let planes = &lattice.planes[axis];
                from[axis] <= planes[cell[axis]] && planes[cell[axis] + 1] <= to[axis]
            })
        })
    };
    let total: usize = cells.iter().product();
    let cell_at = |index: usize| {
        let mut rest = index;
        let mut cell = [0; D];
        for axis in (0..D).rev() {
            cell[axis] = rest % cells[axis];
            rest /= cells[axis];
        }
        cell
    };
    let kept: Vec<bool> = (0..total).map(|index| !cut_away(&cell_at(index))).collect();
    let strides: [usize; D] = std::array::from_fn(|axis| cells[axis + 1..].iter().product());
    let paths: [Vec<([usize; D], bool)>; D] = std::array::from_fn(paths);

    let mut simplices: Vec<[u32; D]> = Vec::new();
    for index in (0..total).filter(|&index| kept[index]) {
        let cell = cell_at(index);
        for axis in 0..D {
            for upper in [false, true] {
                let at_end = cell[axis] == if upper { cells[axis] - 1 } else { 0 };
                let neighbour = if upper { index + strides[axis] } else { index.wrapping_sub(strides[axis]) };
                if !at_end && kept[neighbour] {
                    continue;
                }
                for (steps, odd) in &paths[axis] {
                    let mut place = cell;
                    place[axis] += usize::from(upper);
                    let mut simplex = [lattice.index(&place); D];
                    for (slot, &step) in simplex[1..].iter_mut().zip(&steps[1..]) {
                        place[step] += 1;
                        *slot = lattice.index(&place);
                    }
                    // With an even (axis, steps) the normal is along +axis.
                    if *odd == upper {
                        simplex.swap(D - 2, D - 1);
                    }
                    simplices.push(simplex);
                }
            }
        }
        check_count("cut_cube.subdivisions", simplices.len() as u128)?;
    }
    Ok(simplices)
}

/// All orders of the other axes behind this one, and whether (axis, others...) is an odd permutation.
fn paths<const D: usize>(axis: usize) -> Vec<([usize; D], bool)> {
    let mut found = Vec::new();
    for code in 0..D.pow(D as u32) {
        let mut rest = code;
        let order: [usize; D] = std::array::from_fn(|_| {
            let digit = rest % D;
            rest /= D;
            digit
        });
        let mut sorted = order;
        let odd = sort_with_parity(&mut sorted);
        if order[0] == axis && sorted == std::array::from_fn(|i| i) {
            found.push((order, odd));
        }
    }
    found
}
