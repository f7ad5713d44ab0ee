//! A search structure over cones: which of them may meet a given one.
//!
//! Directions are points of the unit sphere, and each cone's are enclosed in an axis-aligned box: its generators'
//! unit vectors span a flat simplex, the cone's directions are that simplex blown up to the sphere, and no point of
//! it is blown up by more than 1 / m, where m bounds its distance from the origin from below. The boxes are held in a
//! binary tree that halves them at the median.

use crate::geometry::Vector64;

/// Boxes per leaf.
const LEAF: usize = 4;

/// Cones whose simplex comes closer to the origin than this get the whole sphere's box.
const WIDE: f64 = 0.15;

/// The enclosing box of the directions of a cone.
#[derive(Clone, Copy, Debug)]
pub(super) struct DirectionBox<const D: usize> {
    min: Vector64<D>,
    max: Vector64<D>,
}

impl<const D: usize> DirectionBox<D> {
    /// The box of the cone spanned by these unit vectors.
    pub fn of(units: &[Vector64<D>]) -> Self {
        let whole = Self { min: Vector64::from_element(-1.0), max: Vector64::from_element(1.0) };
        let centre: Vector64<D> = units.iter().sum();
        let length = centre.norm();
        let nearest = units.iter().map(|unit| centre.dot(unit) / length).fold(f64::INFINITY, f64::min);
        // Not a number where the generators cancel.
        if nearest.is_nan() || nearest <= WIDE {
            return whole;
        }
        let blow_up = (1.0 + 1e-12) / nearest;
        let (mut min, mut max) = (units[0], units[0]);
        for unit in units {
            min = min.inf(unit);
            max = max.sup(unit);
        }
        Self {
            min: min.map(|x| (x.min(x * blow_up) - 1e-12).max(-1.0)),
            max: max.map(|x| (x.max(x * blow_up) + 1e-12).min(1.0)),
        }
    }

    fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    #[inline]
    fn meets(&self, other: &Self) -> bool {
        (0..D).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }
}

#[derive(Clone, Debug)]
struct Node<const D: usize> {
    bounds: DirectionBox<D>,
    /// First item of a leaf, or the number of the second child; the first child comes right after its parent.
    start: u32,
    /// Number of items; 0 for an inner node.
    count: u32,
}

/// A tree over the boxes of cones.
#[derive(Clone, Debug)]
pub(super) struct DirectionTree<const D: usize> {
    nodes: Vec<Node<D>>,
    items: Vec<u32>,
    boxes: Vec<DirectionBox<D>>,
}

impl<const D: usize> DirectionTree<D> {
    /// A tree over these boxes.
    pub fn new(boxes: Vec<DirectionBox<D>>) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..boxes.len() as u32).collect(), boxes };
        if !tree.items.is_empty() {
            tree.build(0, tree.items.len());
        }
        tree
    }

    fn build(&mut self, from: usize, to: usize) {
        let bounds = self.items[from..to]
            .iter()
            .map(|&item| self.boxes[item as usize])
            .reduce(|a, b| a.union(&b))
            .expect("a node has items");
        let number = self.nodes.len();
        self.nodes.push(Node { bounds, start: from as u32, count: (to - from) as u32 });
        if to - from <= LEAF {
            return;
        }
        let doubled_centre = |item: u32, axis: usize| {
            let b = &self.boxes[item as usize];
            b.min[axis] + b.max[axis]
        };
        let spread = |axis: usize| {
            let centres = self.items[from..to].iter().map(|&item| doubled_centre(item, axis));
            let (least, most) =
                centres.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), c| (least.min(c), most.max(c)));
            most - least
        };
        let axis = (0..D).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
        let middle = (to - from) / 2;
        let mut items = self.items[from..to].to_vec();
        items.select_nth_unstable_by(middle, |&a, &b| {
            doubled_centre(a, axis).total_cmp(&doubled_centre(b, axis)).then(a.cmp(&b))
        });
        self.items[from..to].copy_from_slice(&items);
        self.build(from, from + middle);
        self.nodes[number].start = self.nodes.len() as u32;
        self.nodes[number].count = 0;
        self.build(from + middle, to);
    }

    /// Lists in ascending order the boxes that meet this one.
    pub fn meeting(&self, query: &DirectionBox<D>, found: &mut Vec<u32>) {
        found.clear();
        let mut stack = vec![0usize; usize::from(!self.nodes.is_empty())];
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number];
            if !node.bounds.meets(query) {
                continue;
            }
            if node.count == 0 {
                stack.extend([number + 1, node.start as usize]);
                continue;
            }
            let items = &self.items[node.start as usize..(node.start + node.count) as usize];
            found.extend(items.iter().copied().filter(|&item| self.boxes[item as usize].meets(query)));
        }
        found.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occlusion::exact::generators::direction;

    /// Numbers in [-1, 1) that look random (an LCG is enough to spread boxes).
    fn pseudorandom() -> impl FnMut() -> f64 {
        let mut state = 12345u64;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn check<const D: usize>() {
        let mut next = pseudorandom();
        let cones: Vec<[Vector64<D>; D]> = (0..300)
            .map(|k| {
                let centre = Vector64::<D>::from_fn(|_, _| next());
                let width = [0.05, 0.5, 3.0][k % 3];
                std::array::from_fn(|_| direction(&(centre + Vector64::<D>::from_fn(|_, _| width * next()))))
            })
            .collect();
        let boxes: Vec<_> = cones.iter().map(|units| DirectionBox::of(units)).collect();
        for (cone, b) in cones.iter().zip(&boxes) {
            for _ in 0..50 {
                let sum: Vector64<D> = cone.iter().map(|unit| unit * (next() + 1.0)).sum();
                let inside = direction(&sum);
                assert!((0..D).all(|i| b.min[i] <= inside[i] && inside[i] <= b.max[i]), "{b:?} holds {inside:?}");
            }
        }
        let tree = DirectionTree::new(boxes.clone());
        let mut found = Vec::new();
        let mut fewer = false;
        for query in &boxes {
            tree.meeting(query, &mut found);
            let expected: Vec<u32> = (0..300).filter(|&i| boxes[i as usize].meets(query)).collect();
            assert_eq!(found, expected);
            fewer |= expected.len() < 100;
        }
        assert!(fewer);
        DirectionTree::<D>::new(Vec::new()).meeting(&boxes[0], &mut found);
        assert!(found.is_empty());
    }

    #[test]
    fn finds_what_a_scan_finds() {
        check::<3>();
        check::<4>();
    }
}
