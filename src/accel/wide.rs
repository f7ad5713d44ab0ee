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
use super::node::Node;
use super::rows::{BOTTOM, KIND_BITS, LEAF, Leaf, NODE, Reference, WideNode, write_leaf, write_node};
use super::scale::Scale;
use super::{Bvh, apart};
use crate::geometry::{Aabb, Vector, widen};
use crate::mesh::Mesh;

/// If most boxes are narrower than this, in widths of the scene, it may be one that has to be taken apart.
const COARSE: f64 = 4.0 / (1 << 20) as f64;
/// More lines than references reach.
const MOST_LINES: usize = 1 << (32 - KIND_BITS);
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
    /// How many leaves there will be.
    leaves: usize,
    /// Whether most of their boxes are fine beside the scene.
    fine: bool,
}

impl Plan {
    /// Decides by the cost of the cheapest subtree, from the leaves up.
    fn new<const D: usize>(nodes: &[Node<D>], scale: &Scale<D>) -> Self {
        let count = nodes.len();
        let mut plan = Self { ranges: vec![(0, 0); count], is_leaf: vec![false; count], leaves: 0, fine: true };
        let mut costs = vec![0.0f32; count];
        for (i, node) in nodes.iter().enumerate().rev() {
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
        drop(costs);
        let mut sides: Vec<f32> = (plan.reached(nodes).iter().enumerate())
            .filter(|&(i, reached)| *reached && plan.is_leaf[i])
            .map(|(i, _)| ((widen(&nodes[i].bounds.max) - widen(&nodes[i].bounds.min)).max() * scale.factor) as f32)
            .collect();
        plan.leaves = sides.len();
        let middle = sides.len() / 2;
        plan.fine = sides.is_empty() || f64::from(*sides.select_nth_unstable_by(middle, f32::total_cmp).1) > COARSE;
        plan
    }

    /// Which nodes are above leaves, or become them.
    fn reached<const D: usize>(&self, nodes: &[Node<D>]) -> Vec<bool> {
        let mut reached = vec![false; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            reached[i] |= i == 0;
            if reached[i] && !self.is_leaf[i] {
                reached[node.first as usize..][..2].fill(true);
            }
        }
        reached
    }

    /// Leaves out the nodes below leaves, which are most, and gives back their memory.
    fn prune<const D: usize>(&mut self, nodes: &mut Vec<Node<D>>) {
        let reached = self.reached(nodes);
        // Children come after their parent, two and two.
        let mut places = vec![0u32; nodes.len()];
        let mut kept = 0;
        for i in (0..nodes.len()).filter(|&i| reached[i]) {
            places[i] = kept as u32;
            kept += 1;
        }
        for i in (0..nodes.len()).filter(|&i| reached[i]) {
            let to = places[i] as usize;
            nodes[to] = nodes[i];
            (self.ranges[to], self.is_leaf[to]) = (self.ranges[i], self.is_leaf[i]);
            if !self.is_leaf[to] {
                nodes[to].first = places[nodes[to].first as usize];
            }
        }
        nodes.truncate(kept);
        nodes.shrink_to_fit();
        self.ranges.truncate(kept);
        self.ranges.shrink_to_fit();
        self.is_leaf.truncate(kept);
        self.is_leaf.shrink_to_fit();
    }
}

impl<const D: usize> WideBvh<D> {
    /// Makes it from the binary tree over simplices of the mesh; if `parallel` on all threads, which changes nothing else.
    pub fn new(bvh: &Bvh<D>, mesh: &Mesh<D>, parallel: bool) -> Self {
        let scale = Scale::of(&mesh.vertices);
        let plan = Plan::new(&bvh.nodes, &scale);
        let bounds = |simplex| Aabb::of(&mesh.corners(simplex));
        let parts = if plan.fine { None } else { apart::parts(&bvh.order, bounds, COARSE) };
        let Some((near, far)) = parts else {
            return Self::over(&bvh.nodes, &plan, bvh.order.clone(), mesh, scale, parallel);
        };
        let near = Bvh::build(&near, bounds, parallel);
        let scale = Scale::around(&near.nodes[0].bounds);
        let plan = Plan::new(&near.nodes, &scale);
        let whole = Self::over(&near.nodes, &plan, near.order, mesh, scale, parallel);
        Self { far: Bvh::build(&far, bounds, parallel), of_part: true, ..whole }
    }

    /// The same from a tree that nobody else needs. It is given back if it is needed beside the new one; else most of it is gone before
    /// memory is asked for, so that the two are never there together.
    pub fn replacing(bvh: Bvh<D>, mesh: &Mesh<D>, parallel: bool) -> (Self, Option<Bvh<D>>) {
        let scale = Scale::of(&mesh.vertices);
        let mut plan = Plan::new(&bvh.nodes, &scale);
        if !plan.fine || Self::most_lines(&plan) >= MOST_LINES {
            return (Self::new(&bvh, mesh, parallel), Some(bvh));
        }
        let Bvh { mut nodes, order } = bvh;
        plan.prune(&mut nodes);
        (Self::over(&nodes, &plan, order, mesh, scale, parallel), None)
    }

    /// Lines that it takes at most: each node but the root has at least two children.
    fn most_lines(plan: &Plan) -> usize {
        let [node_lines, leaf_lines] = [WideNode::<D>::ROWS, Leaf::<D>::ROWS].map(|rows| rows / 2);
        plan.leaves * (node_lines + leaf_lines) + node_lines
    }

    /// Of what is in the binary tree, in coordinates of this scale.
    fn over(nodes: &[Node<D>], plan: &Plan, order: Vec<u32>, mesh: &Mesh<D>, scale: Scale<D>, parallel: bool) -> Self {
        let mut wide = Self {
            lines: Lines::default(),
            order,
            scale,
            depth: 0,
            nodes: 0,
            leaves: plan.leaves,
            fine: plan.fine,
            far: Bvh::default(),
            of_part: false,
        };
        if nodes.is_empty() {
            return wide;
        }
        let [node_lines, leaf_lines] = [WideNode::<D>::ROWS, Leaf::<D>::ROWS].map(|rows| rows / 2);
        wide.lines = Lines::with_room(Self::most_lines(plan));
        wide.lines.add(node_lines);
        let mut open = vec![(0usize, 0usize, 1usize)];
        let mut leaves = Vec::with_capacity(plan.leaves);
        while let Some((source, target, depth)) = open.pop() {
            (wide.depth, wide.nodes) = (wide.depth.max(depth), wide.nodes + 1);
            let children = Self::children(nodes, plan, source);
            let mut references = [BOTTOM; WIDTH];
            for (lane, &child) in children.iter().enumerate() {
                let is_leaf = plan.is_leaf[child];
                let place = wide.lines.add(if is_leaf { leaf_lines } else { node_lines });
                if is_leaf {
                    leaves.push((place, plan.ranges[child]));
                } else {
                    open.push((child, place, depth + 1));
                }
                references[lane] = (place as u32) << KIND_BITS | if is_leaf { LEAF } else { NODE };
            }
            let boxes = children.iter().map(|&child| &nodes[child].bounds);
            write_node(&mut wide.lines.rows_mut()[2 * target..2 * (target + node_lines)], boxes, &references, &scale);
        }
        leaves.sort_unstable();
        let mut rest = wide.lines.rows_mut();
        let mut passed = 0;
        let mut places = Vec::with_capacity(leaves.len());
        for (place, range) in leaves {
            let (rows, behind) = rest.split_at_mut(2 * (place - passed)).1.split_at_mut(2 * leaf_lines);
            (rest, passed) = (behind, place + leaf_lines);
            places.push((rows, range));
        }
        let write = |(rows, range): (&mut [Row], (u32, u32))| write_leaf(rows, range, &wide.order, mesh, &scale);
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
        self.fine && self.lines.len() < MOST_LINES && self.is_near(point) && point.iter().all(|&x| self.scale.keeps(x))
    }

    /// Whether everything is in the nodes and leaves, and references reach it: then points within the scene never need the binary
    /// tree, but for those that vanish when scaled.
    pub fn is_whole(&self) -> bool {
        self.fine && !self.of_part && self.lines.len() < MOST_LINES
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
    fn children(nodes: &[Node<D>], plan: &Plan, source: usize) -> Vec<usize> {
        if plan.is_leaf[source] {
            return vec![source];
        }
        let area = |i: usize| nodes[i].bounds.half_surface();
        let mut children = vec![source];
        while children.len() < WIDTH {
            let inner = (0..children.len()).filter(|&k| !plan.is_leaf[children[k]]);
            let Some(largest) = inner.max_by(|&a, &b| area(children[a]).total_cmp(&area(children[b]))) else { break };
            let left = nodes[children[largest]].first as usize;
            children[largest] = left;
            children.push(left + 1);
        }
        children.sort_by(|&a, &b| plan.is_leaf[a].cmp(&plan.is_leaf[b]).then(area(a).total_cmp(&area(b))));
        children
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector64;
    use crate::mesh::{MeshBuilder, Orientation, Surface};

    /// Simplices all over the place, or clusters of them far apart.
    fn mesh<const D: usize>(count: u32, clusters: &[f64]) -> Mesh<D> {
        let mut builder = MeshBuilder::new();
        let mut state = 7u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        for (n, &place) in clusters.iter().enumerate() {
            let mut surface = Surface::<D> { vertices: vec![], simplices: vec![], normals: None };
            for _ in 0..count {
                let corner = Vector64::<D>::from_fn(|_, _| place + number());
                let first = surface.vertices.len() as u32;
                surface.vertices.extend((0..D).map(|_| corner.map(|x| x + 0.1 * number())));
                surface.simplices.push(std::array::from_fn(|i| first + i as u32));
            }
            builder.add(&format!("{n}"), [0.8; 3], &surface, Orientation::Input).unwrap();
        }
        builder.finish()
    }

    fn check<const D: usize>() {
        for (mesh, is_whole) in [
            (mesh::<D>(0, &[0.0]), true),
            (mesh(1, &[0.0]), true),
            (mesh(3000, &[0.0]), true),
            (mesh(300, &[0.0, 1e9]), false),
        ] {
            let all: Vec<u32> = (0..mesh.simplices.len() as u32).collect();
            let bvh = Bvh::build(&all, |s| Aabb::of(&mesh.corners(s)), false);
            let beside = WideBvh::new(&bvh, &mesh, false);
            let (instead, needed) = WideBvh::replacing(bvh, &mesh, true);
            assert_eq!((instead.is_whole(), needed.is_none()), (is_whole, is_whole));
            let content = |wide: &WideBvh<D>| {
                let bits: Vec<u32> = wide.rows().iter().flat_map(|row| row.0.map(f32::to_bits)).collect();
                (bits, wide.order.clone(), [wide.depth, wide.nodes, wide.leaves, wide.far.order.len()])
            };
            assert_eq!(content(&instead), content(&beside));
        }
    }

    #[test]
    fn the_tree_that_is_replaced_makes_the_same() {
        check::<3>();
        check::<4>();
    }
}
