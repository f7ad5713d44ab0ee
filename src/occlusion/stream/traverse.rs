//! The rays of a block through the hierarchy.
//!
//! The unit of work is a *pair*: a node and a ray that meets its box, in one word. Pairs are taken from a stack a few at a
//! time; each tests one ray against the eight boxes of a node and pushes those that are met, without a branch, so that
//! the processor works on several pairs, and waits for several cache lines, at once. What is met of leaves goes to a
//! queue. When that is full, the facet normals of its leaves are computed, once for all rays of the shading point
//! ([`Cones`]), and every pair costs D dot products for eight simplices.
//!
//! Measured against sets of rays that descend together, pairs repeat the loading of a node for each ray; but most
//! visits are of few rays, where the cost of a set is that of guessing branches wrong.

use super::cones::Cones;
use super::directions::{BLOCK, Rays};
use super::lanes::Lanes;
use crate::accel::{TAG_BITS, Tracer, WIDTH, WideBvh};
use crate::geometry::{Ray, Vector};

/// Pairs taken from the stack at a time.
const CHUNK: usize = 8;
/// Leaf pairs that are waited for.
const QUEUE: usize = 48;
/// Leaves whose normals are kept.
const KEPT: usize = 256;
/// Places of the table that finds them; a power of two.
const TABLE: usize = 1024;

/// Leaves as seen from the origin, so far.
#[derive(Debug)]
struct KeptLeaves<const D: usize> {
    cones: Vec<Cones<D>>,
    leaves: Vec<u32>,
    count: usize,
    /// For each hash of a leaf the leaf and where its cones are.
    table: Vec<(u32, u32)>,
}

impl<const D: usize> KeptLeaves<D> {
    fn clear(&mut self) {
        for &leaf in &self.leaves[..self.count] {
            self.table[leaf as usize % TABLE] = (u32::MAX, 0);
        }
        self.count = 0;
    }
}

/// Working memory of a thread.
#[derive(Debug)]
pub(super) struct Traversal<const D: usize> {
    stack: Vec<u32>,
    kept: KeptLeaves<D>,
}

/// One shading point among the simplices of a mesh.
pub(super) struct Question<'t, const D: usize> {
    pub tracer: &'t Tracer<'t, D>,
    pub wide: &'t WideBvh<D>,
    pub position: Vector<D>,
    /// The position in the coordinates of the leaves.
    scaled: Vector<D>,
    /// Hits beyond it don't count.
    pub limit: f32,
    /// The simplex that rays don't hit.
    pub ignored: Option<u32>,
}

impl<'t, const D: usize> Question<'t, D> {
    pub fn new(tracer: &'t Tracer<'t, D>, position: Vector<D>, limit: f32, ignored: Option<u32>) -> Self {
        let wide = tracer.wide();
        Self { tracer, wide, position, scaled: wide.scale.scaled(&position), limit, ignored }
    }

    pub fn ray(&self, rays: &Rays<D>, i: usize) -> Ray<D> {
        Ray::new(self.position, Vector::from_fn(|k, _| rays.direction[k][i]))
    }
}

impl<const D: usize> Traversal<D> {
    pub fn new() -> Self {
        let kept = KeptLeaves {
            cones: vec![Cones::new(); KEPT],
            leaves: vec![0; KEPT],
            count: 0,
            table: vec![(u32::MAX, 0); TABLE],
        };
        Self { stack: vec![0; 4096], kept }
    }

    /// Forgets what was kept of another origin.
    pub fn move_origin(&mut self) {
        self.kept.clear();
    }

    /// Which of the rays `alive` hit something.
    #[inline(always)]
    pub fn blocked<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, alive: u64) -> u64 {
        if question.wide.nodes.is_empty() {
            return 0;
        }
        let limit = (f64::from(question.limit) * question.wide.scale.factor * (1.0 + 1e-5)) as f32;
        let limit = L::splat(limit);
        let mut open = alive;
        let mut depth = 0;
        for i in 0..BLOCK as u32 {
            self.stack[depth] = i;
            depth += (alive >> i & 1) as usize;
        }
        let mut queue = [0u32; QUEUE + CHUNK * WIDTH];
        let mut queued = 0;
        loop {
            while depth > 0 && queued < QUEUE {
                let taken = depth.min(CHUNK);
                depth -= taken;
                if self.stack.len() < depth + (CHUNK + 1) * WIDTH {
                    self.stack.resize(2 * self.stack.len() + (CHUNK + 1) * WIDTH, 0);
                }
                let mut pairs = [0; CHUNK];
                pairs[..taken].copy_from_slice(&self.stack[depth..depth + taken]);
                for &pair in &pairs[..taken] {
                    let i = pair as usize % BLOCK;
                    let node = &question.wide.nodes[(pair >> TAG_BITS) as usize];
                    let (mut enter, mut exit) = (L::splat(0.0), limit);
                    for k in 0..D {
                        let (inverse, offset) = (rays.inverse[k][i], rays.offset[k][i]);
                        let near = (inverse.to_bits() >> 31) as usize;
                        let (inverse, offset) = (L::splat(inverse), L::splat(offset));
                        enter = enter.max(L::load(&node.planes[k][near]).mul_sub(inverse, offset));
                        exit = exit.min(L::load(&node.planes[k][near ^ 1]).mul_sub(inverse, offset));
                    }
                    let met = enter.less_or_equal(exit) & (open >> i & 1).wrapping_neg() as u8;
                    let tag = i as u32;
                    depth += compress::<L>(&node.children, tag, met & !node.leaves, &mut self.stack, depth);
                    queued += compress::<L>(&node.children, tag, met & node.leaves, &mut queue, queued);
                }
            }
            if queued == 0 {
                return alive & !open;
            }
            self.test::<L>(question, rays, &queue[..queued], &mut open);
            queued = 0;
        }
    }

    /// Tests the pairs of leaves and rays, and closes the rays that hit.
    #[inline(always)]
    fn test<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, queue: &[u32], open: &mut u64) {
        let kept = &mut self.kept;
        if kept.count + queue.len() > KEPT {
            kept.clear();
        }
        // Where the cones of each pair's leaf are, or will be.
        let mut places = [0u32; QUEUE + CHUNK * WIDTH];
        let known = kept.count;
        for (place, pair) in places.iter_mut().zip(queue) {
            let leaf = pair >> TAG_BITS;
            let entry = &mut kept.table[leaf as usize % TABLE];
            let new = entry.0 != leaf;
            *place = if new { kept.count as u32 } else { entry.1 };
            *entry = (leaf, *place);
            kept.leaves[kept.count] = leaf;
            kept.count += usize::from(new);
        }
        for k in known..kept.count {
            prepare::<L, D>(question, kept.leaves[k], &mut kept.cones[k]);
        }
        for (&place, &pair) in places.iter().zip(queue) {
            let i = pair as usize % BLOCK;
            let cones = &kept.cones[place as usize];
            let direction = std::array::from_fn(|k| L::splat(rays.direction[k][i]));
            let candidates = cones.candidates::<L>(&direction);
            if candidates != 0 && *open >> i & 1 == 1 {
                let verdict = cones.judge::<L>(candidates, &direction);
                let surely = verdict.inside != 0 && question.limit == f32::INFINITY;
                let simplices = &question.wide.leaves[(pair >> TAG_BITS) as usize].simplices;
                if surely || hits_one_of(question, &question.ray(rays, i), simplices, candidates) {
                    *open &= !(1 << i);
                }
            }
        }
    }
}

/// Compresses into a longer array at a place.
#[inline(always)]
fn compress<L: Lanes>(words: &[u32; WIDTH], tag: u32, mask: u8, out: &mut [u32], place: usize) -> usize {
    match out.get_mut(place..).and_then(|rest| rest.first_chunk_mut()) {
        Some(out) => L::compress(words, tag, mask, out),
        None => unreachable!("the stack and the queue have room for a chunk"),
    }
}

#[cold]
fn hits_one_of<const D: usize>(question: &Question<D>, ray: &Ray<D>, simplices: &[u32; WIDTH], candidates: u8) -> bool {
    (0..WIDTH)
        .filter(|lane| candidates >> lane & 1 == 1)
        .any(|lane| question.tracer.hits(simplices[lane], ray, question.limit))
}

/// The cones of a leaf's simplices as seen from the origin.
#[inline(always)]
fn prepare<L: Lanes, const D: usize>(question: &Question<D>, leaf: u32, cones: &mut Cones<D>) {
    let leaf = &question.wide.leaves[leaf as usize];
    let mut edges = [[L::splat(0.0); D]; D];
    for (edge, corner) in edges.iter_mut().zip(&leaf.corners) {
        for k in 0..D {
            edge[k] = L::load(&corner[k]).sub(L::splat(question.scaled[k]));
        }
    }
    // Only the index of an unused lane has the highest bit set.
    let unused = L::load(&leaf.simplices.map(f32::from_bits));
    cones.set(&edges, unused);
    if let Some(lane) = question.ignored.and_then(|s| leaf.simplices.iter().position(|&t| t == s)) {
        cones.remove(lane);
    }
}
