//! A scene taken apart where it is too wide for its own coordinates: what lies together, and what is far away or far larger.
//!
//! A floor that reaches a million sizes to all sides, or one object that far away, makes the scene so wide that single precision
//! can't tell its small parts from each other. Around the median of all places a box is made smaller until most of what it
//! holds is large enough beside it. Whatever isn't wholly in the box lies apart; that must be less than half of all.

use crate::geometry::{Aabb, Vector64, widen};

/// What the box is divided by from try to try.
const SHRINK: f64 = 4.0;
/// How often: beyond this there is no single precision.
const TRIES: usize = 64;

/// The simplices that lie together and those that lie apart, of which there may be none, if there are such parts; in the order in which they are given.
/// Most of the former have sides of more than `coarse` widths of what holds them all.
pub(super) fn parts<const D: usize>(
    simplices: &[u32],
    bounds: impl Fn(u32) -> Aabb<D>,
    coarse: f64,
) -> Option<(Vec<u32>, Vec<u32>)> {
    let boxes: Vec<[Vector64<D>; 2]> = simplices
        .iter()
        .map(|&simplex| {
            let bounds = bounds(simplex);
            [widen(&bounds.min), widen(&bounds.max)]
        })
        .collect();
    let half = boxes.len() / 2;
    let median = |mut values: Vec<f64>| {
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let middle: Vector64<D> =
        Vector64::from_fn(|k, _| median(boxes.iter().map(|[low, high]| 0.5 * (low[k] + high[k])).collect()));
    let reaches: Vec<f64> = boxes.iter().map(|[low, high]| (low - middle).amax().max((high - middle).amax())).collect();
    let mut reach = reaches.iter().copied().fold(0.0, f64::max);
    for _ in 0..TRIES {
        let sides: Vec<f64> = boxes
            .iter()
            .zip(&reaches)
            .filter(|(_, its)| **its <= reach)
            .map(|([low, high], _)| (high - low).max())
            .collect();
        if sides.len() <= half {
            return None;
        }
        if median(sides) > coarse * 2.0 * reach {
            let near = |(_, its): &(u32, f64)| *its <= reach;
            let (near, far): (Vec<_>, Vec<_>) = simplices.iter().copied().zip(reaches).partition(near);
            let indices = |part: Vec<(u32, f64)>| part.into_iter().map(|(simplex, _)| simplex).collect();
            return Some((indices(near), indices(far)));
        }
        reach /= SHRINK;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;

    /// Small boxes along a line, and others.
    fn taken(others: &[(f32, f32)]) -> Option<(Vec<u32>, Vec<u32>)> {
        let mut boxes: Vec<(f32, f32)> = (0..100).map(|i| (i as f32, 0.5)).collect();
        boxes.splice(50..50, others.iter().copied());
        let bounds = |i: u32| {
            let (place, half) = boxes[i as usize];
            Aabb::<4> { min: Vector::from_element(place - half), max: Vector::from_element(place + half) }
        };
        parts(&(0..boxes.len() as u32).collect::<Vec<_>>(), bounds, 4e-6)
    }

    #[test]
    fn what_lies_together_is_found() {
        for other in [(1e6, 0.5), (-1e12, 1.0), (0.0, 1e7), (3e30, 1e30)] {
            let (near, far) = taken(&[other]).unwrap();
            assert_eq!((near.len(), far), (100, vec![50]), "{other:?}");
        }
        let (near, far) = taken(&[(1e9, 0.5), (5.0, 1e20)]).unwrap();
        assert_eq!((near.len(), far), (100, vec![50, 51]));
        // All lie together, where only vertices without a simplex are far away.
        assert_eq!(taken(&[]).map(|(near, far)| (near.len(), far.len())), Some((100, 0)));
        // As many far away as near.
        let many: Vec<(f32, f32)> = (0..100).map(|i| (1e9 + 1e3 * i as f32, 0.5)).collect();
        assert_eq!(taken(&many), None);
    }

    #[test]
    fn boxes_without_extent_lie_nowhere() {
        let point = |i: u32| Aabb::<3>::of(&[Vector::from_element(if i == 7 { 1e9 } else { 1.0 })]);
        assert_eq!(parts(&(0..20).collect::<Vec<_>>(), point, 4e-6), None);
    }
}
