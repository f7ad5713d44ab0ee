//! The deepest point of a polyhedron: the one whose least height over the planes of all faces, measured inwards, is largest.
//! Where that height is above 0 the point sees the whole boundary, and the polyhedron is cut into tetrahedra by joining
//! each triangle of the boundary to it.
//!
//! Maximising r with n_i . x + r <= d_i is a linear programme of four unknowns. The dual simplex method goes from one set of
//! four planes to the next, each time taking in the plane that the point breaks most; r only falls on the way, so a
//! polyhedron without such a point is given up early.

use nalgebra::{SMatrix, SVector};

use crate::geometry::Vector64;

/// The points x with n . x = d, n of length 1 pointing outwards.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    pub normal: Vector64<3>,
    pub offset: f64,
}

/// A point, how far it is inside all planes at least, and the directions of the planes that keep it from being deeper.
pub struct Deepest {
    pub point: Vector64<3>,
    pub depth: f64,
    pub limits: [Vector64<3>; 4],
}

/// Most steps. A dozen is the rule.
const MOST_STEPS: usize = 1000;

/// Heights that count as equal, in a body of size 1.
const EQUAL: f64 = 1e-13;

/// The deepest point within these planes and within a ball, if it is at least this deep.
pub fn deepest(planes: &[Plane], center: &Vector64<3>, radius: f64, least: f64) -> Option<Deepest> {
    // A regular tetrahedron around the ball to begin with: its directions add up to zero.
    let s = 1.0 / 3f64.sqrt();
    let around = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let mut basis =
        around.map(|n| Vector64::from(n) * s).map(|n| Plane { normal: n, offset: n.dot(center) + 2.0 * radius });
    let mut weights = SVector::<f64, 4>::repeat(0.25);
    for _ in 0..MOST_STEPS {
        let rows = SMatrix::<f64, 4, 4>::from_fn(|r, c| if c < 3 { basis[r].normal[c] } else { 1.0 });
        let inverse = rows.try_inverse()?;
        let at = inverse * SVector::<f64, 4>::from_fn(|r, _| basis[r].offset);
        let (point, depth) = (Vector64::from([at[0], at[1], at[2]]), at[3]);
        if depth < least {
            return None;
        }
        let broken = |plane: &Plane| plane.normal.dot(&point) + depth - plane.offset;
        let worst = planes.iter().max_by(|a, b| broken(a).total_cmp(&broken(b)));
        let entering = match worst {
            Some(plane) if broken(plane) > EQUAL => *plane,
            _ => return Some(Deepest { point, depth, limits: basis.map(|plane| plane.normal) }),
        };
        let column = SVector::<f64, 4>::from([entering.normal[0], entering.normal[1], entering.normal[2], 1.0]);
        let shares = inverse.transpose() * column;
        let ratio = |i: usize| if shares[i] > 1e-12 { weights[i] / shares[i] } else { f64::INFINITY };
        let leaving = (0..4).min_by(|&i, &j| ratio(i).total_cmp(&ratio(j)))?;
        let step = ratio(leaving);
        if !step.is_finite() {
            return None;
        }
        weights -= shares * step;
        weights[leaving] = step;
        basis[leaving] = entering;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_middle_of_a_box_and_gives_up_on_nothing() {
        let mut planes: Vec<Plane> = Vec::new();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let normal = Vector64::from_fn(|r, _| if r == axis { sign } else { 0.0 });
                planes.push(Plane { normal, offset: if sign > 0.0 { 3.0 } else { -1.0 } });
            }
        }
        let found = deepest(&planes, &Vector64::repeat(2.0), 2.0, 0.0).unwrap();
        assert!((found.depth - 1.0).abs() < 1e-12 && (found.point - Vector64::repeat(2.0)).norm() < 1e-12);
        planes[0].offset = -3.5;
        assert!(deepest(&planes, &Vector64::repeat(2.0), 2.0, 0.0).is_none());
    }
}
