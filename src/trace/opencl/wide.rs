//! The hierarchy as devices want it: nodes of eight boxes.
//!
//! A node tells eight boxes where a binary tree would take seven nodes, one after the other; and a ray
//! keeps what it has to come back to as one number and a bit for each child, so the stack is as short as the hierarchy is
//! deep (after Ylitie, Karras and Laine, *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*, HPG 2017). All
//! eight boxes are one vector of eight numbers, which a processor with AVX has registers for. Their sides are plain numbers: in a byte each
//! they took less memory, but turning bytes into numbers was what GPUs spent most of their time on.
//!
//! Sides are told from the middle of the scene, which is about 1 wide, and boxes are larger than what they hold by [`GROWTH`] on each
//! side. That is more than the rounding of the distances that a device makes of them, so it need not allow for it.

use super::layout::{Float4, Node, float4};
use crate::accel::{Bvh, Scale};
use crate::geometry::{Aabb, Vector, narrow, widen};

/// What boxes grow by on each side, in widths of the scene: 16 u, where u is half an ulp of 1.
///
/// Devices take (s - p) / (w l) for the distance of a side s from an origin p, in ways of length l, both at most 1/2 from the middle m:
/// as s r + (m - p) r, where
/// r is 1 / w / l. Its rounding is less than if the side were moved by 12.5 u: 10 u |s - p| are those of both divisions, at most 2.5 ulps each as
/// OpenCL has it, 2 u |m - p| and u |s| those of the difference and the products, and u |s - p| that of the sum. Where a
/// component of w is next to nothing, `inverted` of the kernels moves the ray by much less.
const GROWTH: f64 = 1.0 / (1 << 20) as f64;
/// Children of a node.
const WIDTH: usize = 8;
/// The most simplices of a leaf: all leaves of a node together have no more than a byte can tell.
const MOST: u32 = 4;

/// The nodes, the root first, and the simplices in their order.
#[derive(Debug, Default)]
pub(super) struct Wide {
    pub nodes: Vec<Node>,
    /// Of each node [`sides`] vectors: on each axis where its eight boxes begin, and where they end.
    pub sides: Vec<Float4>,
    /// What sides are told from, in scaled coordinates.
    pub middle: Float4,
    /// The simplices, the leaves of a node after each other.
    pub order: Vec<u32>,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
}

/// How many vectors tell the boxes of a node.
pub(super) const fn sides<const D: usize>() -> usize {
    4 * D
}

/// What is below a node of the binary tree, or a part of a leaf of it.
#[derive(Clone, Copy)]
struct Below {
    node: usize,
    /// The part of the order; of no simplices if it is all below an inner node.
    first: u32,
    count: u32,
}

impl Below {
    fn of<const D: usize>(bvh: &Bvh<D>, node: usize) -> Self {
        let (first, count) = (bvh.nodes[node].first, bvh.nodes[node].count);
        Self { node, first, count }
    }

    /// Its two halves, unless it is to be a leaf.
    fn split<const D: usize>(self, bvh: &Bvh<D>) -> Option<[Self; 2]> {
        if self.count == 0 {
            let left = self.first as usize;
            return Some([left, left + 1].map(|child| Self::of(bvh, child)));
        }
        let half = self.count / 2;
        (self.count > MOST).then(|| {
            [Self { count: half, ..self }, Self { first: self.first + half, count: self.count - half, ..self }]
        })
    }

    fn is_leaf(self) -> bool {
        (1..=MOST).contains(&self.count)
    }
}

impl Wide {
    /// Takes the binary tree's boxes, eight at a time.
    pub fn new<const D: usize>(bvh: &Bvh<D>, scale: &Scale<D>) -> Self {
        let middle: Vector<D> = narrow(&(scale.centre * scale.factor));
        let mut wide = Self { middle: float4(&middle), ..Self::default() };
        if bvh.nodes.is_empty() {
            return wide;
        }
        let area = |below: &Below| bvh.nodes[below.node].bounds.half_surface();
        wide.add::<D>();
        let mut open = vec![(Below::of(bvh, 0), 0usize, 1usize)];
        while let Some((below, place, depth)) = open.pop() {
            wide.depth = wide.depth.max(depth);
            let mut children = vec![below];
            while children.len() < WIDTH {
                let splits = (0..children.len()).filter(|&k| !children[k].is_leaf());
                let Some(largest) = splits.max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b]))) else {
                    break;
                };
                let Some([left, right]) = children[largest].split(bvh) else { break };
                children[largest] = left;
                children.push(right);
            }
            // Large boxes are more likely to block a ray.
            children.sort_by(|a, b| a.is_leaf().cmp(&b.is_leaf()).then(area(b).total_cmp(&area(a))));
            let inner = children.iter().take_while(|child| !child.is_leaf()).count();
            let (first, simplices) = (wide.nodes.len(), wide.order.len());
            let mut leaves = [0; WIDTH];
            for (lane, child) in children.iter().enumerate() {
                wide.set_box(place, lane, &bvh.nodes[child.node].bounds, scale, &middle);
                if child.is_leaf() {
                    leaves[lane] = (8 * (wide.order.len() - simplices)) as u8 + child.count as u8;
                    let range = child.first as usize..(child.first + child.count) as usize;
                    wide.order.extend_from_slice(&bvh.order[range]);
                } else {
                    open.push((*child, wide.nodes.len(), depth + 1));
                    wide.add::<D>();
                }
            }
            wide.nodes[place] =
                Node { children: first as u32, simplices: simplices as u32, leaves, inner: inner as u32, padding: 0 };
        }
        wide
    }

    /// A node with eight boxes that no ray meets.
    fn add<const D: usize>(&mut self) {
        self.nodes.push(Node::default());
        for _ in 0..D {
            self.sides.extend([f32::MAX, f32::MAX, -f32::MAX, -f32::MAX].map(|side| Float4([side; 4])));
        }
    }

    fn set_box<const D: usize>(
        &mut self,
        place: usize,
        lane: usize,
        bounds: &Aabb<D>,
        scale: &Scale<D>,
        middle: &Vector<D>,
    ) {
        let [min, max] = [&bounds.min, &bounds.max].map(|corner| widen(corner) * scale.factor - widen(middle));
        let sides = &mut self.sides[sides::<D>() * place..][..sides::<D>()];
        for axis in 0..D {
            // Both are rounded, by far less than they are grown.
            sides[4 * axis + lane / 4].0[lane % 4] = (min[axis] - GROWTH) as f32;
            sides[4 * axis + 2 + lane / 4].0[lane % 4] = (max[axis] + GROWTH) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;

    fn check<const D: usize>(count: u32, factor: f32, offset: f32) {
        let mut state = 7u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let boxes: Vec<Aabb<D>> = (0..count)
            .map(|i| {
                // Many in one place, some flat.
                let min = Vector::<D>::from_fn(|_, _| if i % 3 == 0 { 0.5 } else { random() });
                let size = Vector::<D>::from_fn(|axis, _| if axis == 0 { 0.0 } else { 0.1 * random() });
                let place = |x: f32| x * factor + offset;
                Aabb { min: min.map(place), max: (min + size).map(place) }
            })
            .collect();
        let corners: Vec<Vector<D>> = boxes.iter().flat_map(|b| [b.min, b.max]).collect();
        let scale = Scale::of(&corners);
        let bvh = Bvh::build(&(0..count).collect::<Vec<u32>>(), |i| boxes[i as usize], false);
        let wide = Wide::new(&bvh, &scale);
        let mut order = wide.order.clone();
        order.sort_unstable();
        assert_eq!(order, (0..count).collect::<Vec<u32>>());
        // Every leaf's boxes are within those of all nodes above it.
        let mut reached = 0;
        let mut deepest = 0;
        let whole = Aabb { min: Vector::from_element(f32::MIN), max: Vector::from_element(f32::MAX) };
        let mut open: Vec<(usize, Vec<Aabb<D>>)> = if count > 0 { vec![(0, vec![whole])] } else { vec![] };
        while let Some((place, above)) = open.pop() {
            let node = &wide.nodes[place];
            reached += 1;
            deepest = deepest.max(above.len());
            let sides = &wide.sides[sides::<D>() * place..][..sides::<D>()];
            let inner = node.inner as usize;
            for lane in 0..8 {
                let at = |vector: usize| sides[vector + lane / 4].0[lane % 4];
                let one = Aabb {
                    min: Vector::from_fn(|axis, _| at(4 * axis)),
                    max: Vector::from_fn(|axis, _| at(4 * axis + 2)),
                };
                if lane >= inner && node.leaves[lane] == 0 {
                    assert!(one == Aabb { min: Vector::from_element(f32::MAX), max: Vector::from_element(-f32::MAX) });
                    continue;
                }
                let mut above = above.clone();
                above.push(one);
                if lane < inner {
                    open.push((node.children as usize + lane, above));
                    continue;
                }
                let first = (node.simplices + u32::from(node.leaves[lane] >> 3)) as usize;
                let held = u32::from(node.leaves[lane] & 7);
                assert!((1..=MOST).contains(&held));
                for &item in &wide.order[first..first + held as usize] {
                    let one = &boxes[item as usize];
                    let centred = |corner: &Vector<D>, growth: f64| {
                        let side = |axis, _| f64::from(corner[axis]) * scale.factor - f64::from(wide.middle.0[axis]);
                        Vector::<D>::from_fn(|axis, i| (side(axis, i) + growth) as f32)
                    };
                    let growth = 0.9 * GROWTH;
                    let grown = Aabb { min: centred(&one.min, -growth), max: centred(&one.max, growth) };
                    assert!(above.iter().all(|b| b.contains(&grown)), "{grown:?} in {above:?}");
                }
            }
        }
        assert_eq!((reached, deepest), (wide.nodes.len(), wide.depth));
    }

    #[test]
    fn every_box_holds_what_is_below_it() {
        for count in [0, 1, 4, 5, 9, 1000] {
            for (factor, offset) in [(1.0, 0.0), (1e-20, 0.0), (1e20, 0.0), (1.0, 1e5), (1.0, -3.0)] {
                check::<3>(count, factor, offset);
                check::<4>(count, factor, offset);
            }
        }
    }
}
