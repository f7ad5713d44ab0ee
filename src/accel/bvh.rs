//! A binary bounding volume hierarchy over boxes in R^D, built by the binned surface area heuristic.
//!
//! The cost of a split is (measure of the left box x its count + the same on the right), where the measure of a box in
//! R^D is the sum over the axes of the product of its other edges ([`Aabb::half_surface`]). Nodes lie in one array;
//! the two children of a node are neighbours, so one index names both. How it is built is in [`super::build`].

use rayon::prelude::*;

use super::build;
use super::node::Node;
use crate::geometry::{Aabb, Ray};

/// Deep enough for any traversal.
const STACK: usize = build::DEPTH + 1;

/// A hierarchy over boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh<const D: usize> {
    /// The root first; empty if there are no boxes.
    pub nodes: Vec<Node<D>>,
    /// The items, leaf after leaf, as indices into what it was built over.
    pub order: Vec<u32>,
}

impl<const D: usize> Bvh<D> {
    /// Builds it over the items, whose boxes `bounds` tells; if `parallel` on all threads, which changes nothing else.
    pub fn build(items: &[u32], bounds: impl Fn(u32) -> Aabb<D> + Sync, parallel: bool) -> Self {
        let item = |&index: &u32| build::Item { bounds: bounds(index), index };
        let mut items: Vec<build::Item<D>> =
            if parallel { items.par_iter().map(item).collect() } else { items.iter().map(item).collect() };
        let nodes = build::tree(&mut items, parallel);
        let bvh = Self { nodes, order: items.iter().map(|item| item.index).collect() };
        debug_assert_eq!(bvh.validate(bounds), Ok(()));
        bvh
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

    /// Calls `visit` for items in leaves whose boxes, and all boxes above them, `accepts` holds for.
    pub fn within(&self, accepts: impl Fn(&Aabb<D>) -> bool, mut visit: impl FnMut(u32)) {
        let mut stack = [0u32; STACK];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            if !accepts(&node.bounds) {
                continue;
            }
            if node.count > 0 {
                let first = node.first as usize;
                self.order[first..first + node.count as usize].iter().for_each(|&i| visit(i));
            } else {
                stack[depth] = node.first + 1;
                stack[depth + 1] = node.first;
                depth += 2;
            }
        }
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
    pub fn validate(&self, bounds: impl Fn(u32) -> Aabb<D>) -> Result<(), String> {
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
                if !node.bounds.contains(&bounds(self.order[place])) {
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
            let items: Vec<u32> = (0..count as u32).collect();
            let bvh = Bvh::build(&items, |i| boxes[i as usize], false);
            assert_eq!(bvh.validate(|i| boxes[i as usize]), Ok(()));
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
        let bvh = Bvh::build(&(0..5000).collect::<Vec<u32>>(), |i| boxes[i as usize], true);
        assert_eq!(bvh.validate(|i| boxes[i as usize]), Ok(()));
    }

    fn threads<const D: usize>() {
        // More boxes than one thread bins at a time, many of them in one place.
        let boxes: Vec<Aabb<D>> = (0..100_000u32)
            .map(|i| {
                let corner =
                    Vector::<D>::from_fn(|r, _| (i.wrapping_mul(2_654_435_761 + 97 * r as u32) >> (8 + i % 3)) as f32);
                Aabb { min: corner, max: corner.add_scalar((i % 1000) as f32) }
            })
            .collect();
        let items: Vec<u32> = (0..100_000).filter(|i| i % 10 != 3).collect();
        let one = Bvh::build(&items, |i| boxes[i as usize], false);
        assert_eq!(one.validate(|i| boxes[i as usize]), Ok(()));
        assert!(one.nodes.len() > 20_000);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let many = pool.install(|| Bvh::build(&items, |i| boxes[i as usize], true));
            assert!(many == one, "{threads} threads");
        }
    }

    #[test]
    fn any_number_of_threads_builds_the_same() {
        threads::<3>();
        threads::<4>();
    }
}
