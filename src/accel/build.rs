//! Building a binary hierarchy: from the top, each set of boxes is split in two where that promises the least work.
//!
//! The centres of the boxes are sorted into bins along each axis, and the split between two bins that has the least
//! cost is taken (Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*, 2007). Boxes are moved, not
//! indices to them, so that every pass runs through memory in order. Large sets are binned by several threads, and large
//! halves built side by side; as bins are joined by operations whose order doesn't matter, and halves by place, not by
//! time, the tree is the same on any number of threads.

use rayon::prelude::*;

use super::lines::WIDTH;
use super::node::Node;
use crate::geometry::{Aabb, Vector};

/// Most bins along an axis; fewer boxes than this have as many bins as there are boxes.
const BINS: usize = 16;
/// Leaves hold at most this many boxes.
const LEAF: usize = 4;
/// Sets of more boxes than one of the leaves of eight that [`super::WideBvh`] makes, and of up to this many, are split by how many such leaves
/// the sides will fill: an eighth simplex costs a leaf nothing.
const COUNTED_BY_LEAVES: usize = 64;
/// What it costs to go through a node, in tests of what a leaf holds.
const NODE_COST: f32 = 1.0;
/// Below this depth splits halve the count.
const SAH_DEPTH: usize = 48;
/// No tree is deeper: halving what a `u32` can count takes 32 levels.
pub(super) const DEPTH: usize = SAH_DEPTH + 32;
/// Halves of at least this many boxes are built by several threads.
const PARALLEL: usize = 1 << 12;
/// Boxes that one thread puts into bins at a time, where several do.
const CHUNK: usize = 1 << 15;

/// A box, and whose it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item<const D: usize> {
    pub bounds: Aabb<D>,
    pub index: u32,
}

/// The boxes of a bin, or of one side of a split.
#[derive(Clone, Copy)]
struct Bin<const D: usize> {
    bounds: Aabb<D>,
    count: u32,
}

/// All bins of all axes.
type Bins<const D: usize> = [[Bin<D>; BINS]; D];

/// Where a split goes: along the axis, boxes whose centre is in this bin or one below go left.
#[derive(Clone, Copy)]
struct Split<const D: usize> {
    axis: usize,
    bin: usize,
    cost: f32,
    sides: [Aabb<D>; 2],
}

impl<const D: usize> Bin<D> {
    fn empty() -> Self {
        Self { bounds: Aabb::empty(), count: 0 }
    }

    #[inline(always)]
    fn join(&mut self, other: &Self) {
        grow(&mut self.bounds, &other.bounds);
        self.count += other.count;
    }

    /// Tests are made `together` at a time.
    #[inline(always)]
    fn cost(&self, together: u32) -> f32 {
        let tests = self.count.next_multiple_of(together);
        if tests == 0 { 0.0 } else { self.bounds.half_surface() * tests as f32 }
    }
}

/// As [`Aabb::union`], by plain comparisons, which are one instruction each; there are no NaNs to mind.
#[inline(always)]
fn grow<const D: usize>(all: &mut Aabb<D>, other: &Aabb<D>) {
    for k in 0..D {
        all.min[k] = if other.min[k] < all.min[k] { other.min[k] } else { all.min[k] };
        all.max[k] = if other.max[k] > all.max[k] { other.max[k] } else { all.max[k] };
    }
}

/// Orders the items by leaf, and returns the nodes over them, the root first; on all threads if `parallel`.
pub(super) fn tree<const D: usize>(items: &mut [Item<D>], parallel: bool) -> Vec<Node<D>> {
    if items.is_empty() {
        return Vec::new();
    }
    let bounds = around(items);
    subtree(items, bounds, 0, 0, if parallel { PARALLEL } else { usize::MAX })
}

fn around<const D: usize>(items: &[Item<D>]) -> Aabb<D> {
    let mut bounds = Aabb::empty();
    items.iter().for_each(|item| grow(&mut bounds, &item.bounds));
    bounds
}

/// The tree over items that begin at place `first` of all. Children are named by their place in the result.
fn subtree<const D: usize>(
    items: &mut [Item<D>],
    bounds: Aabb<D>,
    first: usize,
    depth: usize,
    parallel: usize,
) -> Vec<Node<D>> {
    let root = Node { bounds, first: first as u32, count: items.len() as u32 };
    if items.len() < parallel {
        let mut nodes = Vec::with_capacity(items.len());
        nodes.push(root);
        split_below(items, depth, &mut nodes, 0);
        return nodes;
    }
    let Some((middle, sides)) = divide(items, &bounds, depth, true) else { return vec![root] };
    let (left, right) = items.split_at_mut(middle);
    let (left, right) = rayon::join(
        || subtree(left, sides[0], first, depth + 1, parallel),
        || subtree(right, sides[1], first + middle, depth + 1, parallel),
    );
    // The two roots become neighbours behind this one; the rest of the left tree follows, then that of the right one.
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    nodes.push(Node { first: 1, count: 0, ..root });
    let moved = |node: &Node<D>, by: usize| match node.count {
        0 => Node { first: node.first + by as u32, ..*node },
        _ => *node,
    };
    let by = [2, left.len() + 1];
    nodes.push(moved(&left[0], by[0]));
    nodes.push(moved(&right[0], by[1]));
    nodes.extend(left[1..].iter().map(|node| moved(node, by[0])));
    nodes.extend(right[1..].iter().map(|node| moved(node, by[1])));
    nodes
}

/// Splits a leaf, which stands at `place` of the nodes, as far as that pays.
fn split_below<const D: usize>(items: &mut [Item<D>], depth: usize, nodes: &mut Vec<Node<D>>, place: usize) {
    let Node { bounds, first, .. } = nodes[place];
    let Some((middle, sides)) = divide(items, &bounds, depth, false) else { return };
    let (left, right) = items.split_at_mut(middle);
    let children = nodes.len();
    nodes.push(Node { bounds: sides[0], first, count: left.len() as u32 });
    nodes.push(Node { bounds: sides[1], first: first + left.len() as u32, count: right.len() as u32 });
    (nodes[place].first, nodes[place].count) = (children as u32, 0);
    split_below(left, depth + 1, nodes, children);
    split_below(right, depth + 1, nodes, children + 1);
}

/// Moves what goes left to the front; returns how many that are, and both sides' boxes. None if the items should stay
/// a leaf.
fn divide<const D: usize>(
    items: &mut [Item<D>],
    bounds: &Aabb<D>,
    depth: usize,
    parallel: bool,
) -> Option<(usize, [Aabb<D>; 2])> {
    if items.len() <= 1 {
        return None;
    }
    let parallel = parallel && items.len() > CHUNK;
    let centres = if parallel {
        items.par_chunks(CHUNK).map(centres).reduce(Aabb::empty, |mut a, b| {
            grow(&mut a, &b);
            a
        })
    } else {
        centres(items)
    };
    let binning = Binning::new(&centres, items.len());
    let bins = if parallel {
        items.par_chunks(CHUNK).map(|chunk| binning.bins(chunk)).reduce_with(|mut a, b| {
            a.as_flattened_mut().iter_mut().zip(b.as_flattened()).for_each(|(a, b)| a.join(b));
            a
        })?
    } else {
        binning.bins(items)
    };
    match binning.best_split(&bins, items.len()).filter(|_| depth < SAH_DEPTH) {
        Some(split) if items.len() > LEAF || split.cost < bounds.half_surface() * (items.len() as f32 - NODE_COST) => {
            let middle = partition(items, |item| binning.bin(item, split.axis) <= split.bin);
            Some((middle, split.sides))
        }
        // All centres coincide, or the tree is too deep: halve by place.
        None if items.len() > LEAF => {
            let (left, right) = items.split_at(items.len() / 2);
            Some((left.len(), [around(left), around(right)]))
        }
        _ => None,
    }
}

/// The box around the centres, doubled.
fn centres<const D: usize>(items: &[Item<D>]) -> Aabb<D> {
    let mut all = Aabb::empty();
    for item in items {
        let centre = item.bounds.doubled_centre();
        grow(&mut all, &Aabb { min: centre, max: centre });
    }
    all
}

/// How centres become bins.
struct Binning<const D: usize> {
    low: Vector<D>,
    factor: Vector<D>,
    count: usize,
}

impl<const D: usize> Binning<D> {
    fn new(centres: &Aabb<D>, items: usize) -> Self {
        let count = BINS.min(items.next_power_of_two());
        // An axis that all centres coincide on has a factor of zero, and with that one bin.
        let factor = Vector::from_fn(|k, _| {
            let extent = centres.max[k] - centres.min[k];
            let factor = count as f32 / extent;
            if extent > 0.0 && factor.is_finite() { factor } else { 0.0 }
        });
        Self { low: centres.min, factor, count }
    }

    #[inline(always)]
    fn bin(&self, item: &Item<D>, axis: usize) -> usize {
        let place = (item.bounds.min[axis] + item.bounds.max[axis] - self.low[axis]) * self.factor[axis];
        (place as usize).min(self.count - 1)
    }

    fn bins(&self, items: &[Item<D>]) -> Bins<D> {
        let mut bins = [[Bin::empty(); BINS]; D];
        for item in items {
            for (axis, bins) in bins.iter_mut().enumerate() {
                let bin = &mut bins[self.bin(item, axis) % BINS];
                grow(&mut bin.bounds, &item.bounds);
                bin.count += 1;
            }
        }
        bins
    }

    /// The cheapest of all splits between bins, over all axes; none if all centres coincide.
    fn best_split(&self, bins: &Bins<D>, items: usize) -> Option<Split<D>> {
        let mut best: Option<Split<D>> = None;
        let is_counted_by_leaves = items > WIDTH && items <= COUNTED_BY_LEAVES;
        let together = if is_counted_by_leaves { WIDTH as u32 } else { 1 };
        for (axis, bins) in bins.iter().enumerate().filter(|(axis, _)| self.factor[*axis] > 0.0) {
            let mut rights = [Bin::empty(); BINS];
            let mut right = Bin::empty();
            for bin in (1..self.count).rev() {
                right.join(&bins[bin]);
                rights[bin] = right;
            }
            let mut left = Bin::empty();
            for bin in 0..self.count - 1 {
                left.join(&bins[bin]);
                let cost = left.cost(together) + rights[bin + 1].cost(together);
                if left.count > 0 && (left.count as usize) < items && best.is_none_or(|b| cost < b.cost) {
                    best = Some(Split { axis, bin, cost, sides: [left.bounds, rights[bin + 1].bounds] });
                }
            }
        }
        best
    }
}

/// Brings what satisfies the condition to the front, and returns how many do.
fn partition<const D: usize>(items: &mut [Item<D>], condition: impl Fn(&Item<D>) -> bool) -> usize {
    let mut front = 0;
    for place in 0..items.len() {
        if condition(&items[place]) {
            items.swap(front, place);
            front += 1;
        }
    }
    front
}
