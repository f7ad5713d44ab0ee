//! The hierarchy as devices want it: nodes of eight boxes, in a byte for each side of a box.
//!
//! A node tells eight boxes in 112 bytes, where a binary tree would take 7 nodes of 48 bytes, one after the other; and a ray
//! keeps what it has to come back to as one number and a bit for each child, so the stack is as short as the hierarchy is
//! deep (after Ylitie, Karras and Laine, *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*, HPG 2017). All
//! eight boxes are one vector of eight numbers, which a processor with AVX has registers for.
//!
//! A box is rounded outwards to steps of the node's own grid: what `side` makes of them, one exact product and one rounded
//! sum, holds what it should, with an ulp to spare on each side (`grown`). That is more than the sum's rounding, so the box of the
//! unrounded sides holds it too, and the device, which makes distances from them in another order, allows for its own rounding.

use super::layout::Node;
use crate::accel::{Bvh, Scale};
use crate::geometry::Aabb;

/// What boxes grow by on each side, in widths of the scene, beside the rounding of that: far more than what
/// `inverted` of the kernels moves a ray by, and so little that it only matters around 0.
const GROWTH: f32 = 1e-18;
/// Children of a node.
const WIDTH: usize = 8;
/// The most simplices of a leaf: all leaves of a node together have no more than a byte can tell.
const MOST: u32 = 4;

/// The nodes, the root first, and the simplices in their order.
#[derive(Debug, Default)]
pub(super) struct Wide {
    pub nodes: Vec<Node>,
    /// The simplices, the leaves of a node after each other.
    pub order: Vec<u32>,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
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
    /// Takes the binary tree's boxes, eight at a time, in scaled coordinates.
    pub fn new<const D: usize>(bvh: &Bvh<D>, scale: &Scale<D>) -> Self {
        let mut wide = Self { nodes: Vec::new(), order: Vec::with_capacity(bvh.order.len()), depth: 0 };
        if bvh.nodes.is_empty() {
            return wide;
        }
        let area = |below: &Below| bvh.nodes[below.node].bounds.half_surface();
        wide.nodes.push(Node::default());
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
            let boxes: Vec<Aabb<D>> =
                children.iter().map(|below| grown(&bvh.nodes[below.node].bounds, scale)).collect();
            let mut node = compressed(&boxes);
            node.children = wide.nodes.len() as u32;
            node.simplices = wide.order.len() as u32;
            for (lane, child) in children.iter().enumerate() {
                if child.is_leaf() {
                    let before = wide.order.len() as u32 - node.simplices;
                    node.leaves[lane] = (8 * before + child.count) as u8;
                    let range = child.first as usize..(child.first + child.count) as usize;
                    wide.order.extend_from_slice(&bvh.order[range]);
                } else {
                    open.push((*child, wide.nodes.len(), depth + 1));
                    wide.nodes.push(Node::default());
                    node.counts[0] += 1;
                }
            }
            wide.nodes[place] = node;
        }
        wide
    }
}

/// The box in scaled coordinates, a little larger.
fn grown<const D: usize>(bounds: &Aabb<D>, scale: &Scale<D>) -> Aabb<D> {
    Aabb {
        min: scale.scaled(&bounds.min).map(|x| x.next_down() - GROWTH),
        max: scale.scaled(&bounds.max).map(|x| x.next_up() + GROWTH),
    }
}

/// A side of a box, so many steps from the origin; rounded to nearest.
fn side(origin: f32, exponent: u8, steps: u8) -> f32 {
    origin + f32::from(steps) * f32::from_bits(u32::from(exponent) << 23)
}

/// A node with these boxes, each rounded outwards to the steps of a grid over all of them.
fn compressed<const D: usize>(boxes: &[Aabb<D>]) -> Node {
    let all = boxes.iter().fold(Aabb::empty(), |all, one| all.union(one));
    let mut node = Node { counts: [0, boxes.len() as u8, 0, 0], ..Node::default() };
    for axis in 0..D {
        let (origin, end) = (all.min[axis], all.max[axis]);
        // The smallest step with which a byte reaches the end.
        let reaches = |exponent: &u8| side(origin, *exponent, u8::MAX) >= end;
        let least = ((f64::from(end) - f64::from(origin)) / 255.0).log2().floor().clamp(-126.0, 126.0) as i32 + 127;
        let exponent = (least as u8..=254).find(reaches).unwrap_or(254);
        let step = f64::from(side(0.0, exponent, 1));
        let steps = |x: f32| ((f64::from(x) - f64::from(origin)) / step).clamp(0.0, 255.0);
        node.origin.0[axis] = origin;
        node.exponents[axis] = exponent;
        for (lane, one) in boxes.iter().enumerate() {
            let (mut low, mut high) = (steps(one.min[axis]).floor() as u8, steps(one.max[axis]).ceil() as u8);
            // The sum was rounded.
            while low > 0 && side(origin, exponent, low) > one.min[axis] {
                low -= 1;
            }
            while high < u8::MAX && side(origin, exponent, high) < one.max[axis] {
                high += 1;
            }
            (node.sides[axis][0][lane], node.sides[axis][1][lane]) = (low, high);
        }
    }
    node
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
            let [inner, filled, ..] = node.counts.map(usize::from);
            assert!(inner <= filled && (1..=8).contains(&filled));
            for lane in 0..filled {
                let at = |axis: usize, steps: u8| side(node.origin.0[axis], node.exponents[axis], steps);
                let mut above = above.clone();
                above.push(Aabb {
                    min: Vector::from_fn(|axis, _| at(axis, node.sides[axis][0][lane])),
                    max: Vector::from_fn(|axis, _| at(axis, node.sides[axis][1][lane])),
                });
                if lane < inner {
                    open.push((node.children as usize + lane, above));
                    continue;
                }
                let first = (node.simplices + u32::from(node.leaves[lane] >> 3)) as usize;
                let held = u32::from(node.leaves[lane] & 7);
                assert!((1..=MOST).contains(&held));
                for &item in &wide.order[first..first + held as usize] {
                    let one = grown(&boxes[item as usize], &scale);
                    assert!(above.iter().all(|b| b.contains(&one)), "{one:?} in {above:?}");
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
