//! What a cone leaves in a plane through its apex: nothing, a facet of its own, or its cross-section.
//!
//! The corners come out anticlockwise without a look at coordinates: the orientation of the cross-section follows
//! from that of the cone and from the signs of its generators, all of which are exact. So a cross-section that fills
//! nearly half of the plane is not mistaken for its complement.

use super::generators::{Generators, Signed};
use super::plane::{Flat, Plane};
use super::polygon::{closes, is_long};

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
        if k.is_multiple_of(2) { self.orientation } else { -self.orientation }
    }

    /// The sign of the determinant of the generators, taken in the order given by their places.
    fn sign_of_order(&self, order: &[usize]) -> i32 {
        let inversions: usize = (0..order.len()).map(|i| order[..i].iter().filter(|&&j| j > order[i]).count()).sum();
        if inversions.is_multiple_of(2) { self.orientation } else { -self.orientation }
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
    // Each corner with the generators whose edge it is on.
    let number = |place: usize| cone.generators[place];
    let mut corners: Vec<Corner> = within.iter().map(|&i| (flat(i), number(i), number(i))).collect();
    let pairs: &[(usize, usize)] = match (above, below) {
        (&[a, c], &[b, d]) => &[(a, b), (a, d), (c, d), (c, b)],
        (&[a], _) => &std::array::from_fn::<_, D, _>(|i| (a, *below.get(i).unwrap_or(&a)))[..n_below],
        (_, &[b]) => &std::array::from_fn::<_, D, _>(|i| (*above.get(i).unwrap_or(&b), b))[..n_above],
        _ => &[],
    };
    corners.extend(pairs.iter().map(|&(a, b)| (crossing(a, b), number(a), number(b))));
    // With x the first of `order`, on side s, (x, corners...) turn s times as the generators in this order do.
    let mut order = Vec::with_capacity(D);
    match (above, below) {
        (&[a, c], &[b, d]) => order.extend([a, b, d, c]),
        (&[a], _) => order.extend([a].iter().chain(within).chain(below)),
        _ => order.extend(below.iter().chain(within).chain(above)),
    }
    if cone.sign_of_order(&order) * sides[order[0]].sign() < 0 {
        corners.reverse();
    }
    let corners = halve_long_edges(plane, plane, generators, &corners);
    match (n_above, n_below) {
        (_, 0) => Trace::Above(corners),
        (0, _) => Trace::Below(corners),
        _ => Trace::Across(corners),
    }
}

/// A corner with the two generators on whose edge it is, or one generator twice.
type Corner = (Flat, u32, u32);

/// Puts a corner on each long edge of a region. Where its ends are nearly opposite, their sum keeps digits only if it
/// starts from the generators; `cutting` is the plane that cuts their edges.
fn halve_long_edges<const D: usize>(
    plane: &Plane<D>,
    cutting: &Plane<D>,
    generators: &Generators<D>,
    corners: &[Corner],
) -> Vec<Flat> {
    let mut halved = Vec::with_capacity(corners.len() + 1);
    for (i, a) in corners.iter().enumerate() {
        halved.push(a.0);
        let next = (i + 1) % corners.len();
        let b = corners[next];
        if (closes::<D>() || next > 0) && is_long(&a.0, &b.0) {
            let sum = a.0 + b.0;
            halved.push(if sum.norm_squared() > 1e-2 {
                sum.normalize()
            } else {
                plane.chart().flatten(&cutting.between(generators, [(a.1, a.2), (b.1, b.2)]))
            });
        }
    }
    halved
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
            corners.push((plane.chart().flatten(generators.vector(a)), a, a));
        }
        let next = (i + 1) % facet.len();
        let b = facet[next];
        let side_b = generators.height(b);
        if (closes::<D>() || next > 0) && side.sign() * side_b.sign() < 0 {
            let crossing = horizon.crossing(generators, (a, side), (b, side_b));
            corners.push((plane.chart().flatten(&crossing), a, b));
        }
    }
    halve_long_edges(plane, horizon, generators, &corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vector, widen};
    use crate::occlusion::exact::polygon::Region;
    use crate::occlusion::exact::span::Span;

    /// All cones over D of a few points, in the horizon and in each other's facets' planes: the corners must turn
    /// anticlockwise, and lie in the cone.
    fn check<const D: usize>() {
        let points: Vec<Vector<D>> = (0..8)
            .map(|k| {
                Vector::from_fn(|r, _| {
                    ((k * 5 + r * r * 3 + k * r * 2) % 13) as f32 - if r % 2 == 0 { 5.5 } else { 6.0 }
                })
            })
            .collect();
        let normal = Vector::<D>::from_fn(|r, _| [0.3, -0.2, 0.9, 0.4][r]);
        let mut generators = Generators::new(Vector::zeros(), normal, normal);
        let ids: Vec<u32> = points.iter().map(|point| generators.edge_to(point)).collect();
        let mut cones = Vec::new();
        for subset in (0u32..1 << ids.len()).filter(|subset| subset.count_ones() == D as u32) {
            let mut chosen = ids.iter().copied().filter(|id| subset >> (id - 1) & 1 == 1);
            let numbers: [u32; D] = std::array::from_fn(|_| chosen.next().unwrap());
            let sign = crate::geometry::determinant_sign(&numbers.map(|id| generators.column(id)));
            if sign != 0 {
                cones.push(SimplicialCone { generators: numbers, orientation: sign });
            }
        }
        let mut planes = vec![Plane::horizon(&widen(&normal))];
        planes.extend(
            cones.iter().take(6).map(|cone| Plane::of_facet(&generators, Span::new(&generators, cone.facet(1)))),
        );
        let mut kinds = [0; 4];
        for plane in &planes {
            for cone in &cones {
                let found = trace(plane, &generators, cone, |id| plane.side(&generators, id));
                let (kind, corners) = match found {
                    Trace::None => (0, Vec::new()),
                    Trace::Across(corners) => (1, corners),
                    Trace::Above(corners) => (2, corners),
                    Trace::Below(corners) => (3, corners),
                };
                kinds[kind] += 1;
                if kind > 0 {
                    assert!(Region::<D>::new(corners.clone()).measure() > 0.0, "{cone:?}: {corners:?}");
                    assert!(!closes::<D>() || corners[0].dot(&corners[1].cross(&corners[2])) > -1e-15, "{corners:?}");
                }
            }
        }
        assert!(kinds.iter().all(|&count| count > 0), "{kinds:?}");
    }

    #[test]
    fn corners_turn_anticlockwise() {
        check::<3>();
        check::<4>();
    }
}
