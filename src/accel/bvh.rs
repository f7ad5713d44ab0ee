//! A binary bounding volume hierarchy over boxes in R^D, built by the binned surface area heuristic.
//!
//! The cost of a split is (measure of the left box x its count + the same on the right), where the measure of a box in
//! R^D is the sum over the axes of the product of its other edges ([`Aabb::half_surface`]). Nodes lie in one array;
//! the two children of a node are neighbours, so one index names both.

use crate::geometry::{Aabb, Ray};

/// Bins a split chooses between, per axis.
const BINS: usize = 16;
/// Leaves hold at most this many boxes, unless they all have the same centre.
const LEAF: usize = 4;
/// Below this depth splits halve the count, which bounds the depth by this plus 32.
const SAH_DEPTH: usize = 48;
/// Deep enough for any traversal.
const STACK: usize = SAH_DEPTH + 33;

/// A node: a box, and either a range of boxes (a leaf) or a pair of children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<const D: usize> {
    /// Holds everything below.
    pub bounds: Aabb<D>,
    /// The first item of a leaf in [`Bvh::order`], or the left one of two neighbouring children.
    pub first: u32,
    /// The number of items of a leaf; 0 for an inner node.
    pub count: u32,
}

/// A hierarchy over boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh<const D: usize> {
    /// The root first; empty if there are no boxes.
    pub nodes: Vec<Node<D>>,
    /// The items, leaf after leaf, as indices into what it was built over.
    pub order: Vec<u32>,
}

/// Where a split would go.
struct Split {
    axis: usize,
    bin: usize,
    cost: f32,
}

impl<const D: usize> Bvh<D> {
    /// Builds it over the items whose boxes these are.
    pub fn build(items: Vec<u32>, bounds: &[Aabb<D>]) -> Self {
        let mut bvh = Self { nodes: Vec::new(), order: items };
        if bvh.order.is_empty() {
            return bvh;
        }
        bvh.nodes.reserve(bvh.order.len());
        let all = bvh.order.iter().fold(Aabb::empty(), |b, &i| b.union(&bounds[i as usize]));
        let count = bvh.order.len();
        bvh.nodes.push(Node { bounds: all, first: 0, count: count as u32 });
        bvh.split(0, 0, bounds);
        bvh.nodes.shrink_to_fit();
        debug_assert_eq!(bvh.validate(bounds), Ok(()));
        bvh
    }

    fn split(&mut self, node: usize, depth: usize, bounds: &[Aabb<D>]) {
        let (first, count) = (self.nodes[node].first as usize, self.nodes[node].count as usize);
        if count <= 1 {
            return;
        }
        let items = &mut self.order[first..first + count];
        let centres = items.iter().fold(Aabb::empty(), |b, &i| b.with(&bounds[i as usize].doubled_centre()));
        let leaf_cost = self.nodes[node].bounds.half_surface() * count as f32;
        let middle = match best_split(items, bounds, &centres).filter(|_| depth < SAH_DEPTH) {
            Some(split) if count > LEAF || split.cost < leaf_cost => {
                let bin = |i: u32| bin_of(&bounds[i as usize], &centres, split.axis);
                partition(items, |&i| bin(i) <= split.bin)
            }
            Some(_) => return,
            None if count <= LEAF => return,
            // All centres coincide, or the tree is too deep: halve by index.
            None => count / 2,
        };
        let boxes = [&items[..middle], &items[middle..]]
            .map(|half| half.iter().fold(Aabb::empty(), |b, &i| b.union(&bounds[i as usize])));
        let left = self.nodes.len();
        self.nodes.push(Node { bounds: boxes[0], first: first as u32, count: middle as u32 });
        self.nodes.push(Node { bounds: boxes[1], first: (first + middle) as u32, count: (count - middle) as u32 });
        (self.nodes[node].first, self.nodes[node].count) = (left as u32, 0);
        self.split(left, depth + 1, bounds);
        self.split(left + 1, depth + 1, bounds);
    }

    /// Calls `hit` for items whose boxes the ray may meet within `[0, limit]` until one returns true.
    #[inline]
    pub fn any(&self, ray: &Ray<D>, limit: f32, mut hit: impl FnMut(u32) -> bool) -> bool {
        let mut stack = [0u32; STACK];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            if node.bounds.enter(ray, limit).is_none() {
                continue;
            }
            if node.count > 0 {
                let first = node.first as usize;
                if self.order[first..first + node.count as usize].iter().any(|&i| hit(i)) {
                    return true;
                }
            } else {
                stack[depth] = node.first + 1;
                stack[depth + 1] = node.first;
                depth += 2;
            }
        }
        false
    }

    /// Calls `visit` for items whose boxes the ray may meet, roughly near to far; it returns the distance beyond which
    /// nothing is wanted any more.
    #[inline]
    pub fn nearest(&self, ray: &Ray<D>, mut limit: f32, mut visit: impl FnMut(u32, f32) -> f32) {
        let mut stack = [(0u32, 0.0f32); STACK];
        let mut depth = 0;
        if let Some(enter) = self.nodes.first().and_then(|root| root.bounds.enter(ray, limit)) {
            stack[0] = (0, enter);
            depth = 1;
        }
        while depth > 0 {
            depth -= 1;
            let (index, enter) = stack[depth];
            if enter > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                let first = node.first as usize;
                for &item in &self.order[first..first + node.count as usize] {
                    limit = visit(item, limit);
                }
                continue;
            }
            let children = [node.first, node.first + 1].map(|c| (c, self.nodes[c as usize].bounds.enter(ray, limit)));
            let near = usize::from(matches!((children[0].1, children[1].1), (Some(a), Some(b)) if b < a));
            for k in [1 - near, near] {
                if let (child, Some(enter)) = children[k] {
                    stack[depth] = (child, enter);
                    depth += 1;
                }
            }
        }
    }

    /// Checks that every item is in exactly one leaf, every box within its parent's, and every node reached once.
    pub fn validate(&self, bounds: &[Aabb<D>]) -> Result<(), String> {
        let mut seen = vec![false; self.order.len()];
        let mut reached = 0;
        let mut open: Vec<usize> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = open.pop() {
            reached += 1;
            let node = &self.nodes[index];
            if node.count == 0 {
                for child in [node.first as usize, node.first as usize + 1] {
                    if child <= index || child >= self.nodes.len() {
                        return Err(format!("node {index} has the child {child} of {}", self.nodes.len()));
                    }
                    if !node.bounds.contains(&self.nodes[child].bounds) {
                        return Err(format!("node {child} reaches out of its parent {index}"));
                    }
                    open.push(child);
                }
            }
            for place in node.first as usize..node.first as usize + node.count as usize {
                if std::mem::replace(&mut seen[place], true) {
                    return Err(format!("place {place} is in two leaves"));
                }
                if !node.bounds.contains(&bounds[self.order[place] as usize]) {
                    return Err(format!("item {} reaches out of its leaf {index}", self.order[place]));
                }
            }
        }
        if reached != self.nodes.len() {
            return Err(format!("{reached} of {} nodes are reached", self.nodes.len()));
        }
        seen.iter().position(|s| !s).map_or(Ok(()), |place| Err(format!("place {place} is in no leaf")))
    }
}

#[inline]
fn bin_of<const D: usize>(item: &Aabb<D>, centres: &Aabb<D>, axis: usize) -> usize {
    let extent = centres.max[axis] - centres.min[axis];
    let place = (item.doubled_centre()[axis] - centres.min[axis]) / extent;
    ((place * BINS as f32) as usize).min(BINS - 1)
}

/// The cheapest of all splits between bins, over all axes; none if all centres coincide.
fn best_split<const D: usize>(items: &[u32], bounds: &[Aabb<D>], centres: &Aabb<D>) -> Option<Split> {
    let mut best: Option<Split> = None;
    for axis in 0..D {
        let extent = centres.max[axis] - centres.min[axis];
        if !(extent > 0.0 && extent.is_finite()) {
            continue;
        }
        let mut bins = [(Aabb::<D>::empty(), 0usize); BINS];
        for &i in items {
            let bin = &mut bins[bin_of(&bounds[i as usize], centres, axis)];
            bin.0 = bin.0.union(&bounds[i as usize]);
            bin.1 += 1;
        }
        let cost = |side: &(Aabb<D>, usize)| if side.1 == 0 { 0.0 } else { side.0.half_surface() * side.1 as f32 };
        let join = |a: (Aabb<D>, usize), b: &(Aabb<D>, usize)| (a.0.union(&b.0), a.1 + b.1);
        let mut right_costs = [0.0; BINS];
        let mut right = (Aabb::empty(), 0);
        for bin in (1..BINS).rev() {
            right = join(right, &bins[bin]);
            right_costs[bin] = cost(&right);
        }
        let mut left = (Aabb::empty(), 0);
        for bin in 0..BINS - 1 {
            left = join(left, &bins[bin]);
            let cost = cost(&left) + right_costs[bin + 1];
            if left.1 > 0 && left.1 < items.len() && best.as_ref().is_none_or(|b| cost < b.cost) {
                best = Some(Split { axis, bin, cost });
            }
        }
    }
    best
}

/// Brings what satisfies the condition to the front, in order, and returns how many do.
fn partition(items: &mut [u32], condition: impl Fn(&u32) -> bool) -> usize {
    let (mut front, back): (Vec<u32>, Vec<u32>) = items.iter().partition(|i| condition(i));
    let middle = front.len();
    front.extend(back);
    items.copy_from_slice(&front);
    middle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;

    fn check<const D: usize>() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        for count in [0usize, 1, 2, 5, 100, 1000] {
            let boxes: Vec<Aabb<D>> = (0..count)
                .map(|i| {
                    let corner = Vector::from_fn(|_, _| if i % 7 == 0 { 0.25 } else { random() });
                    let size = Vector::<D>::from_fn(|_, _| random().abs() * 0.1);
                    Aabb { min: corner, max: corner + size }
                })
                .collect();
            let bvh = Bvh::build((0..count as u32).collect(), &boxes);
            assert_eq!(bvh.validate(&boxes), Ok(()));
            for _ in 0..50 {
                let ray = Ray::new(Vector::from_fn(|_, _| 2.0 * random()), Vector::from_fn(|_, _| random()));
                let expected: Vec<u32> =
                    (0..count as u32).filter(|&i| boxes[i as usize].enter(&ray, 3.0).is_some()).collect();
                let mut met = Vec::new();
                bvh.any(&ray, 3.0, |i| {
                    met.push(i);
                    false
                });
                assert!(expected.iter().all(|i| met.contains(i)));
                let mut near = Vec::new();
                bvh.nearest(&ray, 3.0, |i, limit| {
                    near.push(i);
                    limit
                });
                assert!(expected.iter().all(|i| near.contains(i)));
            }
        }
    }

    #[test]
    fn every_box_that_a_ray_meets_is_visited() {
        check::<3>();
        check::<4>();
    }

    #[test]
    fn coincident_boxes_make_a_shallow_tree() {
        let one = Aabb::<4>::of(&[Vector::from_element(1.0)]);
        let boxes = vec![one; 5000];
        let bvh = Bvh::build((0..5000).collect(), &boxes);
        assert_eq!(bvh.validate(&boxes), Ok(()));
    }
}
