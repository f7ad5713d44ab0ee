//! What a cone leaves in a plane through its apex: nothing, a facet of its own, or its cross-section.
//!
//! The corners come out anticlockwise without a look at coordinates: the orientation of the cross-section follows
//! from that of the cone and from the signs of its generators, all of which are exact. So a cross-section that fills
//! nearly half of the plane is not mistaken for its complement.

use super::generators::{Generators, Signed};
use super::plane::{Flat, Plane};

/// A simplicial cone with its apex at p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SimplicialCone<const D: usize> {
    /// The numbers of its generators, ascending.
    pub generators: [u32; D],
    /// The sign of their determinant, never zero.
    pub orientation: i32,
}

impl<const D: usize> SimplicialCone<D> {
    /// The generators of facet k, ascending, and `u32::MAX` in the last place.
    pub fn facet(&self, k: usize) -> [u32; D] {
        std::array::from_fn(|i| if i == D - 1 { u32::MAX } else { self.generators[if i < k { i } else { i + 1 }] })
    }

    /// The side of facet k's plane on which the cone lies: the sign of det[g_k, the others].
    pub fn side_of_facet(&self, k: usize) -> i32 {
        if k % 2 == 0 { self.orientation } else { -self.orientation }
    }

    /// The sign of the determinant of the generators, taken in the order given by their places.
    fn sign_of_order(&self, order: &[usize]) -> i32 {
        let inversions: usize = (0..order.len()).map(|i| order[..i].iter().filter(|&&j| j > order[i]).count()).sum();
        if inversions % 2 == 0 { self.orientation } else { -self.orientation }
    }
}

/// The part of a plane that a cone covers.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Trace {
    /// The cone lies on one side, and touches the plane in less than a facet.
    None,
    /// The cone crosses the plane: both sides are covered there.
    Across(Vec<Flat>),
    /// The cone lies on the side the normal points to, with a facet in the plane.
    Above(Vec<Flat>),
    /// The cone lies on the other side, with a facet in the plane.
    Below(Vec<Flat>),
}

/// The trace of a cone in a plane, with its corners anticlockwise. `side` tells the side of a generator.
pub(super) fn trace<const D: usize>(
    plane: &Plane<D>,
    generators: &Generators<D>,
    cone: &SimplicialCone<D>,
    mut side: impl FnMut(u32) -> Signed,
) -> Trace {
    let sides: [Signed; D] = std::array::from_fn(|i| side(cone.generators[i]));
    let places = |sign: i32| {
        let mut found = [0usize; D];
        let mut count = 0;
        for i in (0..D).filter(|&i| sides[i].sign() == sign) {
            found[count] = i;
            count += 1;
        }
        (found, count)
    };
    let ((above, n_above), (within, n_within), (below, n_below)) = (places(1), places(0), places(-1));
    let (above, within, below) = (&above[..n_above], &within[..n_within], &below[..n_below]);
    if n_above + n_below == 0 || (n_above == 0 || n_below == 0) && n_within < D - 1 {
        return Trace::None;
    }
    let flat = |place: usize| plane.chart().flatten(generators.vector(cone.generators[place]));
    let numbered = |place: usize| (cone.generators[place], sides[place]);
    let crossing = |a, b| plane.chart().flatten(&plane.crossing(generators, numbered(a), numbered(b)));
    // The generators in `order` turn as (x, corners...) do, x being the first of them; and x is before the plane's
    // normal or behind it.
    let mut corners: Vec<Flat> = within.iter().map(|&i| flat(i)).collect();
    let mut order = Vec::with_capacity(D);
    match (n_above, n_below) {
        (2, 2) => {
            let (a, b) = (above, below);
            corners.extend([(a[0], b[0]), (a[0], b[1]), (a[1], b[1]), (a[1], b[0])].map(|(a, b)| crossing(a, b)));
            order.extend([a[0], b[0], b[1], a[1]]);
        }
        (1, _) => {
            corners.extend(below.iter().map(|&b| crossing(above[0], b)));
            order.push(above[0]);
            order.extend(within.iter().chain(below));
        }
        _ => {
            corners.extend(above.iter().map(|&a| crossing(a, below[0])));
            order.push(below[0]);
            order.extend(within.iter().chain(above));
        }
    }
    let first_side = sides[order[0]].sign();
    if cone.sign_of_order(&order) * first_side < 0 {
        corners.reverse();
    }
    match (n_above, n_below) {
        (_, 0) => Trace::Above(corners),
        (0, _) => Trace::Below(corners),
        _ => Trace::Across(corners),
    }
}

/// The corners of the part of a facet that lies above the horizon, anticlockwise; fewer than D - 1 if there is none.
pub(super) fn facet_above_horizon<const D: usize>(
    plane: &Plane<D>,
    horizon: &Plane<D>,
    generators: &Generators<D>,
    facet: &[u32],
) -> Vec<Flat> {
    let mut corners = Vec::with_capacity(D);
    for (i, &a) in facet.iter().enumerate() {
        let side = generators.height(a);
        if side.sign() >= 0 {
            corners.push(plane.chart().flatten(generators.vector(a)));
        }
        let next = (i + 1) % facet.len();
        let b = facet[next];
        let side_b = generators.height(b);
        if (D > 3 || next > 0) && side.sign() * side_b.sign() < 0 {
            corners.push(plane.chart().flatten(&horizon.crossing(generators, (a, side), (b, side_b))));
        }
    }
    corners
}
