//! The deepest point of a polyhedron: the one whose least height over the planes of all faces, measured inwards, is largest.
//! Where that height is above 0 the point sees the whole boundary, and the polyhedron is cut into tetrahedra by joining
//! each triangle of the boundary to it.
//!
//! Maximising r with n_i . x + r <= d_i is a linear programme of four unknowns. The dual simplex method goes from one set of
//! four planes to the next, each time taking in the plane that the point breaks most; r only falls on the way, so a
//! polyhedron without such a point is given up early.
//!
//! Of a prism many points are the deepest, and of a flat face in many triangles, rounded, many planes are as good as one. There the
//! method may walk in circles. It is then begun again with a tilt: a little of a direction is added to r, so that one point is the best.

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
const MOST_STEPS: usize = 200;

/// How much of a direction is added to what is made as large as can be, from try to try: more than rounding to single precision
/// turns planes by.
const TILTS: [f64; 3] = [0.0, 1e-5, 1e-3];
/// The direction, which is that of nothing in particular.
const TILTED: [f64; 3] = [0.48, -0.79, 0.38];

/// Heights that count as equal, in a body of size 1.
const EQUAL: f64 = 1e-13;

/// The deepest point within these planes and within a ball, if it is at least this deep.
pub fn deepest(planes: &[Plane], center: &Vector64<3>, radius: f64, least: f64) -> Option<Deepest> {
    let found = TILTS.into_iter().find_map(|tilt| tilted(planes, center, radius, least, tilt));
    found.flatten().filter(|deepest| deepest.depth >= least)
}

/// The point within these planes where depth and tilt together are largest; nothing if no point is as deep as `least`, and none if the
/// method goes round in circles.
#[expect(clippy::option_option, reason = "either there is no such point, or it isn't known")]
fn tilted(planes: &[Plane], center: &Vector64<3>, radius: f64, least: f64, tilt: f64) -> Option<Option<Deepest>> {
    // A regular tetrahedron around the ball to begin with: its directions add up to zero.
    let s = 1.0 / 3f64.sqrt();
    let around = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let mut basis =
        around.map(|n| Vector64::from(n) * s).map(|n| Plane { normal: n, offset: n.dot(center) + 2.0 * radius });
    let tilted = Vector64::from(TILTED) * tilt;
    let mut weights = SVector::<f64, 4>::from_fn(|i, _| 0.25 + 0.75 * basis[i].normal.dot(&tilted));
    // A point may become deeper yet by what it gives up of the tilt.
    let hopeless = least - 8.0 * radius * tilt;
    for _ in 0..MOST_STEPS {
        let rows = SMatrix::<f64, 4, 4>::from_fn(|r, c| if c < 3 { basis[r].normal[c] } else { 1.0 });
        let inverse = rows.try_inverse()?;
        let at = inverse * SVector::<f64, 4>::from_fn(|r, _| basis[r].offset);
        let (point, depth) = (Vector64::from([at[0], at[1], at[2]]), at[3]);
        if depth < hopeless {
            return Some(None);
        }
        let broken = |plane: &Plane| plane.normal.dot(&point) + depth - plane.offset;
        let worst = planes.iter().max_by(|a, b| broken(a).total_cmp(&broken(b)));
        let entering = match worst {
            Some(plane) if broken(plane) > EQUAL => *plane,
            _ => return Some(Some(Deepest { point, depth, limits: basis.map(|plane| plane.normal) })),
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
    fn planes_that_rounding_makes_many_lead_in_no_circles() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        for trial in 0..400 {
            let noise = [0.0, 1e-16, 1e-8, 1e-7, 1e-6][trial % 5];
            let (sides, copies, half) = (3 + trial % 37, 1 + trial % 29, [0.1, 0.3, 0.9][trial % 3]);
            let mut normals: Vec<(Vector64<3>, f64)> = Vec::new();
            for side in 0..sides {
                let (sine, cosine) = libm::sincos(std::f64::consts::TAU * side as f64 / sides as f64);
                normals.push((Vector64::from([cosine, sine, 0.0]), 1.0));
            }
            normals.extend([1.0, -1.0].map(|sign| (Vector64::from([0.0, 0.0, sign]), half)));
            let (s, c) = libm::sincos(random());
            let mut planes: Vec<Plane> = Vec::new();
            for (n, offset) in normals.iter().flat_map(|plane| std::iter::repeat_n(plane, copies)) {
                let turned = Vector64::from([c * n.x - s * n.z, n.y, s * n.x + c * n.z]);
                let normal = (turned + Vector64::from_fn(|_, _| noise * random())).normalize();
                planes.push(Plane { normal, offset: offset + noise * random() });
            }
            let found = deepest(&planes, &Vector64::zeros(), 2.5, 1e-6).unwrap_or_else(|| panic!("{trial}"));
            assert!((found.depth - half).abs() < 1e-2, "{trial}: {} of {half}", found.depth);
            let height = |plane: &Plane| plane.offset - plane.normal.dot(&found.point);
            assert!(planes.iter().all(|plane| height(plane) >= found.depth - 1e-9), "{trial}");
        }
    }

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
