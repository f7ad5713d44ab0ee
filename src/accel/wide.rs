//! The hierarchy as eight-wide nodes and leaves of eight simplices, laid out for SIMD.
//!
//! It is made from the binary [`Bvh`]: subtrees of up to eight simplices become a leaf where that is the cheaper, and
//! every other node takes over grandchildren, the largest boxes first, until it has eight. The children of a node lie
//! side by side, and the simplices of a leaf have their corners as rows of eight lanes, so that a visit touches few
//! cache lines.
//!
//! Coordinates are scaled by a power of two that makes the scene about 1 wide, which loses nothing and keeps products of
//! them far from overflow. Boxes are also moved to the scene's middle, where rounding is relative to its size, and
//! grown by [`GROWTH`], more than all rounding of the box test together: a ray that meets a simplex is never told to
//! miss a box around it, however the test is evaluated.
//!
//! Beside something that lies a million sizes away, or is as large, such boxes would hold little but what is beside them. Then
//! the scene is taken apart ([`super::apart`]): these nodes and leaves hold what lies together, in coordinates of its own,
//! and a binary tree holds the rest.

use rayon::prelude::*;

use super::{Bvh, apart};
use crate::geometry::{Aabb, Vector, Vector64, widen};
use crate::mesh::Mesh;

/// Children of a node, and simplices of a leaf.
pub const WIDTH: usize = 8;
/// What boxes grow by on each side, in widths of the scene. All rounding of a box, of its place, of the origin and in the box
/// test is less: ten times numbers below 3/2 relative to 2^-24.
const GROWTH: f64 = 1.0 / (1 << 20) as f64;
/// Boxes of fewer growths than this hold mostly what is beside them.
const COARSE: f64 = 4.0;
/// Cost of testing the boxes of one binary node, in simplex blocks.
const BOX_COST: f32 = 0.4;
/// Bits of a child reference that are left to its user.
pub const TAG_BITS: u32 = 6;

/// Eight boxes and where their contents are. Unused places have boxes that no ray meets.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct WideNode<const D: usize> {
    /// For each axis the middles of the boxes, then half their widths.
    pub boxes: [[[f32; WIDTH]; 2]; D],
    /// Indices of nodes or of leaves, shifted left by [`TAG_BITS`]. Larger boxes come last.
    pub children: [u32; WIDTH],
    /// Which of the children are leaves, lane 0 lowest.
    pub leaves: u8,
    /// Which places are used.
    pub used: u8,
}

/// Up to eight simplices.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub struct Leaf<const D: usize> {
    /// For each corner and axis the scaled coordinates.
    pub corners: [[[f32; WIDTH]; D]; D],
    /// Which simplices of the mesh these are; [`Leaf::UNUSED`] where there are fewer.
    pub simplices: [u32; WIDTH],
    /// The middle of the corners, scaled, and a bound on the 1-norm of what leads from there to a corner.
    pub middle: [f32; D],
    /// See `middle`.
    pub reach: f32,
}

impl<const D: usize> Leaf<D> {
    /// Marks a lane without a simplex.
    pub const UNUSED: u32 = u32::MAX;
}

/// Where the coordinates of the nodes and leaves come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale<const D: usize> {
    /// The middle of the scene.
    pub centre: Vector64<D>,
    /// A power of two.
    pub factor: f64,
}

impl<const D: usize> Scale<D> {
    /// Of the scene with these vertices.
    pub fn of(vertices: &[Vector<D>]) -> Self {
        Self::around(&Aabb::of(vertices))
    }

    /// Of what lies within the box.
    pub fn around(bounds: &Aabb<D>) -> Self {
        if bounds.is_empty() {
            return Self { centre: Vector64::zeros(), factor: 1.0 };
        }
        let (min, max) = (widen(&bounds.min), widen(&bounds.max));
        let extent = (max - min).max();
        // A scene without extent has no simplices; any factor does.
        let exponent = if extent > 0.0 { -extent.log2().ceil() } else { 0.0 };
        Self { centre: (min + max) * 0.5, factor: exponent.exp2() }
    }

    /// The scaled coordinates: exact, unless they vanish beside the scene.
    pub fn scaled(&self, point: &Vector<D>) -> Vector<D> {
        point.map(|x| (f64::from(x) * self.factor) as f32)
    }

    /// Scaled and moved to the middle: rounded, and within 1/2 (and that rounding) for the vertices of the scene.
    pub fn centred(&self, point: &Vector<D>) -> Vector<D> {
        ((widen(point) - self.centre) * self.factor).map(|x| x as f32)
    }
}

/// The wide hierarchy.
#[derive(Clone, Debug)]
pub struct WideBvh<const D: usize> {
    /// The root first; empty if there are no simplices.
    pub nodes: Vec<WideNode<D>>,
    /// The simplices.
    pub leaves: Vec<Leaf<D>>,
    /// The coordinates used.
    pub scale: Scale<D>,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
    /// The number of simplices of the mesh.
    total: usize,
    /// Whether most boxes are larger than what they grow by.
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
        let Some((near, far)) = apart::parts(&bvh.order, bounds, COARSE * GROWTH) else { return whole };
        let near = Bvh::build(&near, bounds, parallel);
        let scale = Scale::around(&near.nodes[0].bounds);
        Self { far: Bvh::build(&far, bounds, parallel), of_part: true, ..Self::over(&near, mesh, scale, parallel) }
    }

    /// Of what is in the binary tree, in coordinates of this scale.
    fn over(bvh: &Bvh<D>, mesh: &Mesh<D>, scale: Scale<D>, parallel: bool) -> Self {
        let mut wide = Self {
            nodes: Vec::new(),
            leaves: Vec::new(),
            scale,
            depth: 0,
            total: mesh.simplices.len(),
            fine: true,
            far: Bvh::default(),
            of_part: false,
        };
        if bvh.nodes.is_empty() {
            return wide;
        }
        let plan = Plan::new(bvh);
        wide.nodes.push(WideNode::empty());
        let mut open = vec![(0usize, 0usize, 1usize)];
        let (mut leaves, mut sides) = (Vec::new(), Vec::new());
        while let Some((source, target, depth)) = open.pop() {
            wide.depth = wide.depth.max(depth);
            let children = Self::children(bvh, &plan, source);
            for (lane, &child) in children.iter().enumerate() {
                let index = if plan.is_leaf[child] {
                    leaves.push(plan.ranges[child]);
                    let bounds = &bvh.nodes[child].bounds;
                    sides.push((widen(&bounds.max) - widen(&bounds.min)).max() * wide.scale.factor);
                    wide.nodes[target].leaves |= 1 << lane;
                    (leaves.len() - 1) as u32
                } else {
                    open.push((child, wide.nodes.len(), depth + 1));
                    wide.nodes.push(WideNode::empty());
                    (wide.nodes.len() - 1) as u32
                };
                wide.nodes[target].set(lane, &bvh.nodes[child].bounds, index << TAG_BITS, &wide.scale);
            }
        }
        wide.nodes.shrink_to_fit();
        let middle = sides.len() / 2;
        wide.fine = *sides.select_nth_unstable_by(middle, f64::total_cmp).1 > COARSE * GROWTH;
        let leaf = |(first, end): (u32, u32)| Leaf::new(&bvh.order[first as usize..end as usize], mesh, &wide.scale);
        wide.leaves = if parallel {
            leaves.into_par_iter().with_min_len(256).map(leaf).collect()
        } else {
            leaves.into_iter().map(leaf).collect()
        };
        wide
    }

    /// Whether there are few enough nodes and leaves for references to them, boxes that hold little but what is in them, and
    /// the point is near enough to them for box tests. If not, ask the binary tree of all, whose boxes don't grow.
    pub fn serves(&self, point: &Vector<D>) -> bool {
        self.fine
            && self.nodes.len().max(self.leaves.len()) < 1 << (32 - TAG_BITS)
            && self.total < 1 << 31
            && self.is_near(point)
    }

    /// Whether these simplices, too, lie where the coordinates of the leaves are made for.
    pub fn holds(&self, simplices: &[u32], mesh: &Mesh<D>) -> bool {
        !self.of_part || simplices.iter().all(|&s| mesh.corners(s).iter().all(|v| self.is_near(v)))
    }

    fn is_near(&self, point: &Vector<D>) -> bool {
        self.scale.centred(point).amax() <= 1.0
    }

    /// The nodes of the binary tree that become the children of what `source` becomes, smallest box first.
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
        children.sort_by(|&a, &b| area(a).total_cmp(&area(b)));
        children
    }
}

impl<const D: usize> WideNode<D> {
    fn empty() -> Self {
        // Of negative width: the near plane is never before the far one.
        Self { boxes: [[[0.0; WIDTH], [-1e30; WIDTH]]; D], children: [0; WIDTH], leaves: 0, used: 0 }
    }

    fn set(&mut self, lane: usize, bounds: &Aabb<D>, child: u32, scale: &Scale<D>) {
        for axis in 0..D {
            let place = |x: f32| (f64::from(x) - scale.centre[axis]) * scale.factor;
            let (low, high) = (place(bounds.min[axis]), place(bounds.max[axis]));
            self.boxes[axis][0][lane] = (0.5 * (low + high)) as f32;
            self.boxes[axis][1][lane] = (0.5 * (high - low) + GROWTH) as f32;
        }
        self.children[lane] = child;
        self.used |= 1 << lane;
    }
}

impl<const D: usize> Leaf<D> {
    fn new(simplices: &[u32], mesh: &Mesh<D>, scale: &Scale<D>) -> Self {
        let bounds =
            Aabb::of(simplices.iter().flat_map(|&s| mesh.simplices[s as usize]).map(|v| &mesh.vertices[v as usize]));
        let (low, high) = (scale.scaled(&bounds.min), scale.scaled(&bounds.max));
        let middle: [f32; D] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let reach = (0..D).map(|k| (middle[k] - low[k]).max(high[k] - middle[k])).sum::<f32>() * (1.0 + 1e-5);
        let mut leaf = Self { corners: [[[0.0; WIDTH]; D]; D], simplices: [Self::UNUSED; WIDTH], middle, reach };
        for lane in 0..WIDTH {
            // Unused lanes repeat the last simplex, so that their numbers are harmless.
            let simplex = simplices[lane.min(simplices.len() - 1)];
            if lane < simplices.len() {
                leaf.simplices[lane] = simplex;
            }
            for (corner, vertex) in mesh.corners(simplex).iter().enumerate() {
                let scaled = scale.scaled(vertex);
                (0..D).for_each(|axis| leaf.corners[corner][axis][lane] = scaled[axis]);
            }
        }
        leaf
    }
}
