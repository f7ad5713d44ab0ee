//! A set of rays against the eight boxes of a node.
//!
//! A few rays are tested one by one, each against all eight boxes at once. Of many rays eight at once are tested against one box after the other,
//! and boxes that all rays meet, as the origin is in them, or that none meets, as they are below the tangent hyperplane, need no
//! test at all. In scenes of some size that spares a third to a half of the tests.

use super::directions::Rays;
use super::lanes::Lanes;
use super::nets::BLOCK;
use super::query::Query;
use super::view::HEIGHT_ROUNDING;
use crate::accel::{WIDTH, WideNode};

/// At least so many rays are tested box by box.
const MANY: u32 = 40;
/// Ahead of the origin: no ray meets what ends there. Not even the nearest hit is nearer.
pub(super) const AHEAD: f32 = f32::from_bits(1);
/// What near and far sides of boxes are pulled apart by, in proportion, where axes are compared.
pub(super) const APART: f32 = 1.0 / (1 << 20) as f32;

/// Boxes by their middles less the origin, and half their widths.
struct Boxes<L, const D: usize> {
    middles: [L; D],
    halves: [L; D],
}

/// The rays of the set that meet each child of a node.
#[inline(always)]
pub(super) fn meet_set<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    limit: L,
    node: WideNode<D>,
    set: u64,
) -> [u64; WIDTH] {
    let mut boxes = Boxes { middles: [limit; D], halves: [limit; D] };
    for k in 0..D {
        boxes.middles[k] = L::load(node.middle(k)).sub(L::splat(query.scaled[k]));
        boxes.halves[k] = boxes.middles[k].abs().mul_add(L::splat(APART), L::load(node.half(k)));
    }
    if set.count_ones() < MANY { boxes.ray_by_ray(rays, limit, set) } else { boxes.box_by_box(query, rays, limit, set) }
}

impl<L: Lanes, const D: usize> Boxes<L, D> {
    #[inline(always)]
    fn ray_by_ray(&self, rays: &Rays<D>, limit: L, set: u64) -> [u64; WIDTH] {
        let mut words = [[0; WIDTH]; 2];
        for part in 0..2 {
            let mut marks = L::unmarked();
            let mut rest = (set >> (32 * part)) as u32;
            while rest != 0 {
                let i = 32 * part + rest.trailing_zeros() as usize;
                let bit = rest & rest.wrapping_neg();
                rest &= rest - 1;
                let (mut enter, mut exit) = (L::splat(AHEAD), limit);
                for k in 0..D {
                    let absolute = L::splat(rays.absolute[k][i]);
                    let middle = self.middles[k].mul(L::splat(rays.inverse[k][i]));
                    enter = enter.max(absolute.negated_mul_add(self.halves[k], middle));
                    exit = exit.min(absolute.mul_add(self.halves[k], middle));
                }
                marks = enter.mark(exit, bit, marks);
            }
            words[part] = L::words(marks);
        }
        let mut sets = [0; WIDTH];
        for child in 0..WIDTH {
            sets[child] = u64::from(words[0][child]) | u64::from(words[1][child]) << 32;
        }
        sets
    }

    #[inline(always)]
    fn box_by_box(&self, query: &Query<D>, rays: &Rays<D>, limit: L, set: u64) -> [u64; WIDTH] {
        let zero = L::splat(0.0);
        let (mut highest, mut size, mut nearest) = (zero, zero, L::splat(f32::NEG_INFINITY));
        let mut rows = [[[0.0; WIDTH]; 2]; D];
        for k in 0..D {
            let normal = L::splat(query.normal[k]);
            highest = normal.abs().mul_add(self.halves[k], normal.mul_add(self.middles[k], highest));
            let away = self.middles[k].abs();
            size = size.add(away.add(self.halves[k]));
            nearest = nearest.max(away.sub(self.halves[k]));
            self.middles[k].store(&mut rows[k][0]);
            self.halves[k].store(&mut rows[k][1]);
        }
        let around = nearest.negative();
        // Rays rise, and have come a way before they are there.
        let low = nearest.max(zero).mul_sub(L::splat(query.rise * (1.0 - 1e-5)), size.mul(L::splat(HEIGHT_ROUNDING)));
        let below = highest.less_or_equal(low);
        let unused = self.halves[0].negative();
        let mut sets = [0; WIDTH];
        for child in 0..WIDTH {
            sets[child] = if around >> child & 1 == 1 { set } else { 0 };
        }
        let mut open = !(around | below | unused);
        let mut groups = 0u32;
        for group in 0..BLOCK / WIDTH {
            groups |= u32::from(set >> (group * WIDTH) & 0xff != 0) << group;
        }
        while open != 0 {
            let child = open.trailing_zeros() as usize % WIDTH;
            open &= open - 1;
            let (mut middle, mut half) = ([zero; D], [zero; D]);
            for k in 0..D {
                (middle[k], half[k]) = (L::splat(rows[k][0][child]), L::splat(rows[k][1][child]));
            }
            let mut met = 0;
            let mut left = groups;
            while left != 0 {
                let group = left.trailing_zeros() as usize % WIDTH;
                left &= left - 1;
                let (mut enter, mut exit) = (L::splat(AHEAD), limit);
                for k in 0..D {
                    let absolute = L::load(&rays.absolute[k].as_chunks().0[group]);
                    let along = middle[k].mul(L::load(&rays.inverse[k].as_chunks().0[group]));
                    enter = enter.max(absolute.negated_mul_add(half[k], along));
                    exit = exit.min(absolute.mul_add(half[k], along));
                }
                met |= u64::from(enter.less_or_equal(exit)) << (WIDTH * group);
            }
            sets[child] = set & met;
        }
        sets
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::*;
    use crate::accel::Tracer;
    use crate::geometry::{Vector, Vector64};
    use crate::mesh::{MeshBuilder, Orientation, Surface};

    /// Numbers within [-1, 1) that look random.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1u32;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        }
    }

    /// How far inside a box a ray comes in front of its origin, or by how much it misses it; in steps of its length.
    fn depth<const D: usize>(middle: [f32; D], half: [f32; D], direction: [f32; D]) -> f64 {
        let (mut enter, mut exit) = (0.0f64, f64::INFINITY);
        for k in 0..D {
            let [middle, half, direction] = [middle[k], half[k], direction[k]].map(f64::from);
            enter = enter.max((middle - half * direction.signum()) / direction);
            exit = exit.min((middle + half * direction.signum()) / direction);
        }
        exit - enter
    }

    fn check<const D: usize>() {
        let mut number = numbers();
        // Any mesh: boxes are asked without it.
        let surface = Surface::<D> {
            vertices: (0..D).map(|i| Vector64::from_fn(|k, _| f64::from(u8::from(i == k)))).collect(),
            simplices: vec![std::array::from_fn(|i| i as u32)],
            normals: None,
        };
        let mut builder = MeshBuilder::new();
        builder.add("one", [0.8; 3], &surface, Orientation::Input).unwrap();
        let tracer = Tracer::new(builder.finish());
        let (mut met, mut missed, mut below) = (0, 0, 0);
        for round in 0..200 {
            let normal = Vector::<D>::from_fn(|_, _| number()).normalize();
            let query = Query::new(&tracer, Vector::zeros(), (normal, 9e-4), f32::INFINITY, &[], None);
            let mut directions = Vec::new();
            while directions.len() < BLOCK {
                let direction = Vector::<D>::from_fn(|_, _| number()).normalize();
                let rise = direction.dot(&normal);
                directions.push(if rise < 0.0 { -direction } else { direction });
                if rise.abs() < 1e-3 {
                    directions.pop();
                }
            }
            let mut rays = Rays::<D>::new();
            rays.set(&directions, &normal);
            rays.complete();
            // The last place is of no box.
            let (mut middle, mut half) = ([[0.0; D]; WIDTH], [[-1e30; D]; WIDTH]);
            for lane in 0..WIDTH - 1 {
                middle[lane] = std::array::from_fn(|_| number());
                half[lane] = std::array::from_fn(|_| 0.5 * number().abs());
            }
            if round % 3 == 0 {
                half[0] = std::array::from_fn(|k| middle[0][k].abs() + 0.1);
            }
            let row = |of: &[[f32; D]; WIDTH], k: usize| Portable::load(&std::array::from_fn(|lane| of[lane][k]));
            let boxes = Boxes::<Portable, D> {
                middles: std::array::from_fn(|k| row(&middle, k)),
                halves: std::array::from_fn(|k| row(&half, k)),
            };
            let set = if round % 2 == 0 { u64::MAX } else { 0x5a5a_0ff0_8001_7ffe };
            let limit = Portable::splat(f32::INFINITY);
            let [one, other] = [boxes.ray_by_ray(&rays, limit, set), boxes.box_by_box(&query, &rays, limit, set)];
            for (lane, (one, other)) in one.into_iter().zip(other).enumerate() {
                assert_eq!((one & !set, other & !set), (0, 0));
                assert!(lane < WIDTH - 1 || one | other == 0, "a place without a box");
                for i in (0..BLOCK).filter(|i| lane < WIDTH - 1 && set >> i & 1 == 1) {
                    let depth = depth(middle[lane], half[lane], directions[i].into());
                    let said = [one, other].map(|set| set >> i & 1 == 1);
                    if depth.abs() > 1e-4 {
                        assert_eq!(said, [depth > 0.0; 2], "{depth}");
                        (met, missed) = (met + u32::from(depth > 0.0), missed + u32::from(depth < 0.0));
                    }
                }
                below += u32::from(other == 0);
            }
        }
        assert!(met > 3000 && missed > 20_000 && below > 300, "{met} {missed} {below}");
    }

    #[test]
    fn both_ways_meet_the_boxes_that_rays_meet() {
        check::<3>();
        check::<4>();
    }
}
