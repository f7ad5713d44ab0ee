//! The hierarchy as eight-wide nodes and leaves of eight simplices.
//!
//! It is made from the binary [`Bvh`]: subtrees of up to eight simplices become a leaf where that is the cheaper, and
//! every other node takes over grandchildren, the largest boxes first, until it has eight. Nodes and leaves ([`super::rows`]) lie
//! in one piece of memory, the children of a node side by side, so that a visit touches few cache lines, and one number tells
//! where a child is and what it is.
//!
//! Coordinates are scaled by a power of two that makes the scene about 1 wide, which loses nothing and keeps products of
//! them far from overflow. Beside something that lies a million sizes away, or is as large, products of the coordinates of small
//! things vanish. Then the scene is taken apart ([`super::apart`]): these nodes and leaves hold what lies together, in
//! coordinates of its own, and a binary tree holds the rest.

use rayon::prelude::*;

use super::lines::{Lines, Row, WIDTH};
use super::rows::{BOTTOM, KIND_BITS, LEAF, Leaf, NODE, Reference, WideNode, write_leaf, write_node};
use super::scale::Scale;
use super::{Bvh, apart};
use crate::geometry::{Aabb, Vector, widen};
use crate::mesh::Mesh;

/// If most boxes are narrower than this, in widths of the scene, it may be one that has to be taken apart.
const COARSE: f64 = 4.0 / (1 << 20) as f64;
/// Cost of testing the boxes of one binary node, in simplex blocks.
const BOX_COST: f32 = 0.4;

/// The wide hierarchy.
#[derive(Clone, Debug)]
pub struct WideBvh<const D: usize> {
    /// All nodes and leaves, the root first; empty if there are no simplices.
    lines: Lines,
    /// The simplices, leaf after leaf.
    pub order: Vec<u32>,
    /// The coordinates used.
    pub scale: Scale<D>,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
    /// How many nodes there are.
    pub nodes: usize,
    /// How many leaves there are.
    pub leaves: usize,
    /// Whether most boxes are fine beside the scene.
    fine: bool,
    /// What lies apart, and is in none of the nodes and leaves.
    pub far: Bvh<D>,
    /// Whether the coordinates are those of a part of the scene.
    of_part: bool,
}

/// What becomes of the nodes of the binary tree.
struct Plan {
    /// The range of [`Bvh::order`] below each node.
    ranges: Vec<(u32, u32)>,
    is_leaf: Vec<bool>,
}

impl Plan {
    /// Decides by the cost of the cheapest subtree, from the leaves up.
    fn new<const D: usize>(bvh: &Bvh<D>) -> Self {
        let count = bvh.nodes.len();
        let mut plan = Self { ranges: vec![(0, 0); count], is_leaf: vec![false; count] };
        let mut costs = vec![0.0f32; count];
        for (i, node) in bvh.nodes.iter().enumerate().rev() {
            let area = node.bounds.half_surface();
            if node.count > 0 {
                plan.ranges[i] = (node.first, node.first + node.count);
                plan.is_leaf[i] = true;
                costs[i] = area;
                continue;
            }
            let (left, right) = (node.first as usize, node.first as usize + 1);
            plan.ranges[i] = (plan.ranges[left].0, plan.ranges[right].1);
            let split = BOX_COST * area + costs[left] + costs[right];
            let fits = plan.ranges[i].1 - plan.ranges[i].0 <= WIDTH as u32;
            plan.is_leaf[i] = fits && area <= split;
            costs[i] = if plan.is_leaf[i] { area } else { split };
        }
        plan
    }
}

impl<const D: usize> WideBvh<D> {
    /// Makes it from the binary tree over simplices of the mesh; if `parallel` on all threads, which changes nothing else.
    pub fn new(bvh: &Bvh<D>, mesh: &Mesh<D>, parallel: bool) -> Self {
        let whole = Self::over(bvh, mesh, Scale::of(&mesh.vertices), parallel);
        if whole.fine {
            return whole;
        }
        let bounds = |simplex| Aabb::of(&mesh.corners(simplex));
        let Some((near, far)) = apart::parts(&bvh.order, bounds, COARSE) else { return whole };
        let near = Bvh::build(&near, bounds, parallel);
        let scale = Scale::around(&near.nodes[0].bounds);
        Self { far: Bvh::build(&far, bounds, parallel), of_part: true, ..Self::over(&near, mesh, scale, parallel) }
    }

    /// Of what is in the binary tree, in coordinates of this scale.
    fn over(bvh: &Bvh<D>, mesh: &Mesh<D>, scale: Scale<D>, parallel: bool) -> Self {
        let mut wide = Self {
            lines: Lines::default(),
            order: bvh.order.clone(),
            scale,
            depth: 0,
            nodes: 0,
            leaves: 0,
            fine: true,
            far: Bvh::default(),
            of_part: false,
        };
        if bvh.nodes.is_empty() {
            return wide;
        }
        let plan = Plan::new(bvh);
        let [node_lines, leaf_lines] = [WideNode::<D>::ROWS, Leaf::<D>::ROWS].map(|rows| rows / 2);
        // Each node but the root has at least two children.
        let most = plan.is_leaf.iter().filter(|&&is_leaf| is_leaf).count();
        wide.lines = Lines::with_room(most * (node_lines + leaf_lines) + node_lines);
        wide.lines.add(node_lines);
        let mut open = vec![(0usize, 0usize, 1usize)];
        let (mut leaves, mut sides) = (Vec::new(), Vec::new());
        while let Some((source, target, depth)) = open.pop() {
            (wide.depth, wide.nodes) = (wide.depth.max(depth), wide.nodes + 1);
            let children = Self::children(bvh, &plan, source);
            let mut references = [BOTTOM; WIDTH];
            for (lane, &child) in children.iter().enumerate() {
                let is_leaf = plan.is_leaf[child];
                let place = wide.lines.add(if is_leaf { leaf_lines } else { node_lines });
                if is_leaf {
                    leaves.push((place, plan.ranges[child]));
                    let bounds = &bvh.nodes[child].bounds;
                    sides.push((widen(&bounds.max) - widen(&bounds.min)).max() * wide.scale.factor);
                } else {
                    open.push((child, place, depth + 1));
                }
                references[lane] = (place as u32) << KIND_BITS | if is_leaf { LEAF } else { NODE };
            }
            let boxes = children.iter().map(|&child| &bvh.nodes[child].bounds);
            write_node(&mut wide.lines.rows_mut()[2 * target..2 * (target + node_lines)], boxes, &references, &scale);
        }
        wide.leaves = leaves.len();
        let middle = sides.len() / 2;
        wide.fine = *sides.select_nth_unstable_by(middle, f64::total_cmp).1 > COARSE;
        leaves.sort_unstable();
        let mut rest = wide.lines.rows_mut();
        let mut passed = 0;
        let mut places = Vec::with_capacity(leaves.len());
        for (place, range) in leaves {
            let (rows, behind) = rest.split_at_mut(2 * (place - passed)).1.split_at_mut(2 * leaf_lines);
            (rest, passed) = (behind, place + leaf_lines);
            places.push((rows, range));
        }
        let write = |(rows, range): (&mut [Row], (u32, u32))| write_leaf(rows, range, &bvh.order, mesh, &scale);
        if parallel {
            places.into_par_iter().with_min_len(256).for_each(write);
        } else {
            places.into_iter().for_each(write);
        }
        wide
    }

    /// Where a traversal starts, unless there are no simplices.
    pub fn root(&self) -> Option<Reference> {
        (self.lines.len() > 0).then_some(NODE)
    }

    /// All rows, among which [`WideNode::at`] and [`Leaf::at`] find what a reference refers to.
    pub fn rows(&self) -> &[Row] {
        self.lines.rows()
    }

    /// The memory of all nodes, and of all leaves with the list of simplices.
    pub fn bytes(&self) -> [usize; 2] {
        let row = size_of::<Row>();
        let leaves = self.leaves * Leaf::<D>::ROWS * row + self.order.len() * size_of::<u32>();
        [self.nodes * WideNode::<D>::ROWS * row, leaves]
    }

    /// Whether references reach everything, boxes are fine beside the scene, and the point is near enough to them and keeps its
    /// place when scaled. If not, ask the binary tree of all.
    pub fn serves(&self, point: &Vector<D>) -> bool {
        self.fine
            && self.lines.len() < 1 << (32 - KIND_BITS)
            && self.is_near(point)
            && point.iter().all(|&x| self.scale.keeps(x))
    }

    /// Whether everything is in the nodes and leaves, and references reach it: then points within the scene never need the binary
    /// tree, but for those that vanish when scaled.
    pub fn is_whole(&self) -> bool {
        self.fine && !self.of_part && self.lines.len() < 1 << (32 - KIND_BITS)
    }

    /// Calls `visit` for the simplices of leaves whose boxes are within `room` of the point on each axis. The tree must
    /// [serve](Self::serves) the point.
    pub fn around(&self, point: &Vector<D>, room: f32, mut visit: impl FnMut(u32)) {
        let point = self.scale.scaled(point);
        let room = (f64::from(room) * self.scale.factor) as f32;
        let mut open: Vec<Reference> = self.root().into_iter().collect();
        while let Some(reference) = open.pop() {
            if reference & LEAF != 0 {
                Leaf::<D>::at(self.rows(), reference).range().for_each(|place| visit(self.order[place]));
                continue;
            }
            let node = WideNode::<D>::at(self.rows(), reference);
            let mut near = [true; WIDTH];
            for axis in 0..D {
                let (middle, half) = (node.middle(axis), node.half(axis));
                for lane in 0..WIDTH {
                    // A little more than `room`, for the rounding. Places without a child have negative widths.
                    near[lane] &= (point[axis] - middle[lane]).abs() <= (half[lane] + room) * (1.0 + 1e-5);
                }
            }
            open.extend(node.children().iter().zip(near).filter(|(_, near)| *near).map(|(child, _)| *child));
        }
    }

    /// Whether these simplices, too, lie where the coordinates of the leaves are made for.
    pub fn holds(&self, simplices: &[u32], mesh: &Mesh<D>) -> bool {
        !self.of_part || simplices.iter().all(|&s| mesh.corners(s).iter().all(|v| self.is_near(v)))
    }

    fn is_near(&self, point: &Vector<D>) -> bool {
        self.scale.centred(point).amax() <= 1.0
    }

    /// The nodes of the binary tree that become the children of what `source` becomes: nodes first, of either kind the
    /// smallest box first.
    fn children(bvh: &Bvh<D>, plan: &Plan, source: usize) -> Vec<usize> {
        if plan.is_leaf[source] {
            return vec![source];
        }
        let area = |i: usize| bvh.nodes[i].bounds.half_surface();
        let mut children = vec![source];
        while children.len() < WIDTH {
            let inner = (0..children.len()).filter(|&k| !plan.is_leaf[children[k]]);
            let Some(largest) = inner.max_by(|&a, &b| area(children[a]).total_cmp(&area(children[b]))) else { break };
            let left = bvh.nodes[children[largest]].first as usize;
            children[largest] = left;
            children.push(left + 1);
        }
        children.sort_by(|&a, &b| plan.is_leaf[a].cmp(&plan.is_leaf[b]).then(area(a).total_cmp(&area(b))));
        children
    }
}
