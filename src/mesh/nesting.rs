//! How deep closed components are nested within each other.
//!
//! A ray from a corner of a component leaves each other component that holds it, and crosses its surface an odd number of
//! times. One ray a component tells of all others at once, through a hierarchy of boxes over all simplices; so ten thousand
//! specks in a large body cost ten thousand rays, not ten thousand times the body.

use rayon::prelude::*;

use crate::geometry::{Aabb, Cone, Vector};

/// How many simplices a leaf of the hierarchy has at most.
const LEAF: usize = 8;

/// Directions tried until none meets the rim of a simplex.
const DIRECTIONS: u32 = 31;

/// For each component, how many others hold it. A component is given by its simplices, as indices into `corners`, which holds
/// their points; others hold it only if their bounds do.
pub fn depths<const D: usize>(corners: &[[Vector<D>; D]], components: &[&[u32]]) -> Vec<usize> {
    if components.len() < 2 {
        return vec![0; components.len()];
    }
    let bounds: Vec<Aabb<D>> =
        (components.iter()).map(|component| Aabb::of(component.iter().flat_map(|&s| &corners[s as usize]))).collect();
    let mut owner = vec![u32::MAX; corners.len()];
    for (i, component) in components.iter().enumerate() {
        component.iter().for_each(|&s| owner[s as usize] = i as u32);
    }
    let mut simplices: Vec<u32> = (0..corners.len() as u32).filter(|&s| owner[s as usize] != u32::MAX).collect();
    let boxes = Boxes::new(corners, &mut simplices);
    let holders = |inner: usize| {
        // Whether the components met so far hold this one; none where a ray left it open.
        let mut known: Vec<(u32, Option<bool>)> = Vec::new();
        let starts = components[inner].iter().take(8).flat_map(|&s| corners[s as usize]);
        let rays = starts.flat_map(|p| (1..=DIRECTIONS).map(move |k| (p, direction::<D>(k))));
        for (attempt, (point, direction)) in rays.enumerate() {
            let mut met: Vec<(u32, Option<bool>)> = Vec::new();
            boxes.along(corners, &simplices, &point, &direction, |s| {
                let other = owner[s as usize];
                if other as usize != inner && bounds[other as usize].contains(&bounds[inner]) {
                    let crosses = Cone::of_simplex(&point, &corners[s as usize]).strictly_contains(&direction);
                    match met.iter_mut().find(|(component, _)| *component == other) {
                        Some((_, odd)) => *odd = odd.zip(crosses).map(|(odd, crosses)| odd ^ crosses),
                        None => met.push((other, crosses)),
                    }
                }
            });
            if attempt == 0 {
                known = met;
            } else {
                for (component, holds) in known.iter_mut().filter(|(_, holds)| holds.is_none()) {
                    *holds = met.iter().find(|(other, _)| other == component).map_or(Some(false), |(_, odd)| *odd);
                }
            }
            if known.iter().all(|(_, holds)| holds.is_some()) {
                break;
            }
        }
        known.iter().filter(|(_, holds)| *holds == Some(true)).count()
    };
    (0..components.len()).into_par_iter().map(holders).collect()
}

/// One of some directions along no axis and no diagonal.
pub(super) fn direction<const D: usize>(k: u32) -> Vector<D> {
    Vector::from_fn(|r, _| ((k * 37 + r as u32 * 101) % 64) as f32 - 31.37)
}

/// A binary tree of boxes over ranges of simplices, halved at the median of the longest side. The children of node i are
/// 2 i + 1 and 2 i + 2, and a node's range follows from its place.
struct Boxes<const D: usize>(Vec<Option<Aabb<D>>>);

impl<const D: usize> Boxes<D> {
    fn new(corners: &[[Vector<D>; D]], simplices: &mut [u32]) -> Self {
        let mut nodes = Vec::new();
        fill(&mut nodes, 0, corners, simplices);
        Self(nodes)
    }

    /// Calls `visit` with each simplex whose box the ray may meet.
    fn along(
        &self,
        corners: &[[Vector<D>; D]],
        simplices: &[u32],
        point: &Vector<D>,
        direction: &Vector<D>,
        mut visit: impl FnMut(u32),
    ) {
        let mut open = vec![(0, 0, simplices.len())];
        while let Some((node, from, to)) = open.pop() {
            let Some(Some(bounds)) = self.0.get(node) else { continue };
            if !may_meet(bounds, point, direction) {
                continue;
            }
            if to - from <= LEAF {
                let meets = |s: &&u32| may_meet(&Aabb::of(&corners[**s as usize]), point, direction);
                simplices[from..to].iter().filter(meets).for_each(|&s| visit(s));
            } else {
                let middle = from + (to - from) / 2;
                open.push((2 * node + 1, from, middle));
                open.push((2 * node + 2, middle, to));
            }
        }
    }
}

fn fill<const D: usize>(
    nodes: &mut Vec<Option<Aabb<D>>>,
    node: usize,
    corners: &[[Vector<D>; D]],
    simplices: &mut [u32],
) {
    if simplices.is_empty() {
        return;
    }
    let bounds = Aabb::of(simplices.iter().flat_map(|&s| &corners[s as usize]));
    if nodes.len() <= node {
        nodes.resize(node + 1, None);
    }
    if simplices.len() > LEAF {
        let sides: Vector<D> = bounds.max - bounds.min;
        let axis = sides.imax();
        let key = |s: u32| corners[s as usize].iter().map(|corner| f64::from(corner[axis])).sum::<f64>();
        let middle = simplices.len() / 2;
        simplices.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let (low, high) = simplices.split_at_mut(middle);
        fill(nodes, 2 * node + 1, corners, low);
        fill(nodes, 2 * node + 2, corners, high);
    }
    nodes[node] = Some(bounds);
}

/// Whether a ray may meet a box: yes wherever rounding leaves it open.
fn may_meet<const D: usize>(bounds: &Aabb<D>, point: &Vector<D>, direction: &Vector<D>) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..D {
        let [low, high, from] = [bounds.min[axis], bounds.max[axis], point[axis]].map(f64::from);
        // More than the rounding of the quotients below.
        let room = 1e-12 * (low.abs().max(high.abs()) + from.abs());
        let inverse = 1.0 / f64::from(direction[axis]);
        let ends = [(low - room - from) * inverse, (high + room - from) * inverse];
        near = near.max(ends[0].min(ends[1]) * (1.0 - 1e-12));
        far = far.min(ends[0].max(ends[1]) * (1.0 + 1e-12));
    }
    near <= far
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The boundary of the cross-polytope of this radius around a point.
    fn ball<const D: usize>(center: [f32; D], radius: f32) -> Vec<[Vector<D>; D]> {
        let corner =
            |axis: usize, sign: f32| Vector::from_fn(|r, _| center[r] + if r == axis { sign * radius } else { 0.0 });
        (0..1u32 << D)
            .map(|signs| std::array::from_fn(|axis| corner(axis, if signs >> axis & 1 == 1 { 1.0 } else { -1.0 })))
            .collect()
    }

    fn check<const D: usize>() {
        // Rings of shells, many specks within the outer gap and in the core, and as many outside; all on one grid, so that
        // rays along it would meet corners.
        let mut balls = vec![([0.0; D], 10.0), ([0.0; D], 5.0), ([0.0; D], 2.0)];
        let mut expected = vec![0, 1, 2];
        for i in 0..200u32 {
            let mut center = [0.0; D];
            let (axis, place) = (i as usize % D, [0.5, 6.5, 12.0, 1.0][i as usize % 4]);
            center[axis] = place + (i / 8) as f32 / 256.0;
            balls.push((center, 1.0 / 1024.0));
            expected.push([3, 1, 0, 3][i as usize % 4]);
        }
        let mut corners = Vec::new();
        let mut components = Vec::new();
        for (center, radius) in balls {
            let first = corners.len() as u32;
            corners.extend(ball(center, radius));
            components.push((first..corners.len() as u32).collect::<Vec<_>>());
        }
        let components: Vec<&[u32]> = components.iter().map(|c| &c[..]).collect();
        assert_eq!(depths(&corners, &components), expected);
    }

    #[test]
    fn shells_and_specks() {
        check::<3>();
        check::<4>();
    }
}
