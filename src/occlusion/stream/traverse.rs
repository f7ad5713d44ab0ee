//! The rays of a block through the hierarchy.
//!
//! They start as one set and descend together as long as they stay together: while at least [`FEW`] rays meet a node, each of
//! its boxes is tested against eight rays at a time, which gives the sets of rays that meet the children. Children
//! below the tangent hyperplane are left out, as no ray of the hemisphere goes there.
//!
//! Where fewer rays meet a node, a set would cost more in branches that the processor guesses wrong than it saves. Such
//! rays get the node on a stack of their own. In the end the rays go in step: in a round each takes a node from its stack
//! and is tested against its eight boxes at a time, without a branch, so that the processor works on several rays, and
//! waits for several cache lines, at once.
//!
//! The facet normals of a leaf's simplices are computed when the first ray meets it, and kept ([`Cones`]): then a ray
//! costs D dot products for eight simplices.

use super::cones::Cones;
use super::cones::dot;
use super::directions::{BLOCK, Rays};
use super::lanes::Lanes;
use crate::accel::{TAG_BITS, Tracer, WIDTH, WideBvh, WideNode};
use crate::geometry::{Ray, Vector};

/// Fewer rays than this go their own ways.
const FEW: u32 = 6;
/// Nodes that a ray may have when it parts from the others.
const PARTED: usize = 64;
/// More than what rounding makes of heights over the tangent hyperplane, in widths of the scene.
const HEIGHT_ROUNDING: f32 = 4e-6;
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
    /// Sets of rays, and the nodes they meet.
    sets: Vec<(u64, u32)>,
    /// The stacks of nodes of single rays, each with room for the children of all nodes on the way to a leaf, and where
    /// they end.
    stacks: Vec<u32>,
    ends: [u32; BLOCK],
    /// Room of one stack.
    room: usize,
    /// Pairs of a leaf and a ray, the leaf shifted by [`TAG_BITS`].
    pairs: Vec<u32>,
    kept: KeptLeaves<D>,
}

/// One shading point among the simplices of a mesh.
pub(super) struct Question<'t, const D: usize> {
    pub tracer: &'t Tracer<'t, D>,
    pub wide: &'t WideBvh<D>,
    pub position: Vector<D>,
    /// All rays go to this side, if it isn't zero.
    normal: Vector<D>,
    /// The position in the coordinates of the leaves.
    scaled: Vector<D>,
    /// Hits beyond it don't count.
    pub limit: f32,
    /// The simplex that rays don't hit.
    pub ignored: Option<u32>,
}

impl<'t, const D: usize> Question<'t, D> {
    pub fn new(
        tracer: &'t Tracer<'t, D>,
        position: Vector<D>,
        normal: Vector<D>,
        limit: f32,
        ignored: Option<u32>,
    ) -> Self {
        let wide = tracer.wide();
        Self { tracer, wide, position, normal, scaled: wide.scale.scaled(&position), limit, ignored }
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
        let (sets, stacks, pairs) = (Vec::new(), Vec::new(), Vec::new());
        Self { sets, stacks, ends: [0; BLOCK], room: 0, pairs, kept }
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
        // Each node leaves at most all but one of its children behind, and a push writes eight words.
        self.room = PARTED + (WIDTH - 1) * question.wide.depth + 2 * WIDTH;
        if self.stacks.len() < BLOCK * self.room {
            self.stacks.resize(BLOCK * self.room, 0);
        }
        for i in 0..BLOCK {
            self.ends[i] = (i * self.room) as u32;
        }
        let limit = (f64::from(question.limit) * question.wide.scale.factor * (1.0 + 1e-5)) as f32;
        let limit = L::splat(limit);
        let mut open = alive;
        self.together::<L>(question, rays, limit, &mut open);
        self.singly::<L>(question, rays, limit, &mut open);
        alive & !open
    }

    /// Sets of rays, as long as they are large.
    #[inline(always)]
    fn together<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, limit: L, open: &mut u64) {
        let origin = question.wide.scale.centred(&question.position);
        self.sets.clear();
        self.sets.push((*open, 0));
        while let Some((set, index)) = self.sets.pop() {
            let mut set = set & *open;
            if set.count_ones() < FEW {
                set = self.part(set, index);
                if set == 0 {
                    continue;
                }
            }
            let node = &question.wide.nodes[(index >> TAG_BITS) as usize];
            let above = above(node, question, &origin, L::splat(0.0));
            let mut met = [0u64; WIDTH];
            for group in 0..BLOCK / WIDTH {
                let members = (set >> (group * WIDTH)) as u8;
                if members == 0 {
                    continue;
                }
                let mut rest = above;
                while rest != 0 {
                    let child = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    let (mut enter, mut exit) = (L::splat(0.0), limit);
                    for k in 0..D {
                        let [middle, half] = &node.boxes[k];
                        let inverse = L::load(row(&rays.inverse[k], group));
                        let offset = L::load(row(&rays.offset[k], group));
                        let absolute = L::load(row(&rays.absolute[k], group));
                        let middle = L::splat(middle[child]).mul_sub(inverse, offset);
                        let half = L::splat(half[child]);
                        enter = enter.max(absolute.negated_mul_add(half, middle));
                        exit = exit.min(absolute.mul_add(half, middle));
                    }
                    let mask = enter.less_or_equal(exit) & members;
                    met[child] |= u64::from(mask) << (group * WIDTH);
                }
            }
            for child in 0..WIDTH {
                let set = met[child];
                if set == 0 {
                    continue;
                }
                let index = node.children[child];
                if node.leaves >> child & 1 == 0 {
                    self.sets.push((set, index));
                } else if set.count_ones() < FEW {
                    let mut rest = set;
                    while rest != 0 {
                        self.pairs.push(index | rest.trailing_zeros());
                        rest &= rest - 1;
                    }
                } else {
                    self.test_set::<L>(question, rays, index >> TAG_BITS, set, open);
                }
            }
        }
    }

    /// Gives the node to each ray of a set, and returns those that have no room for it.
    #[inline(always)]
    fn part(&mut self, set: u64, index: u32) -> u64 {
        let mut full = 0;
        let mut rest = set;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let end = self.ends[i] as usize;
            if end < i * self.room + PARTED {
                self.stacks[end] = index;
                self.ends[i] += 1;
            } else {
                full |= 1 << i;
            }
        }
        full
    }

    /// Every ray with nodes left on its stack by itself.
    #[inline(always)]
    fn singly<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, limit: L, open: &mut u64) {
        let mut going = [0u8; BLOCK];
        let mut count = 0;
        for i in 0..BLOCK {
            going[count] = i as u8;
            count += usize::from(self.ends[i] as usize > i * self.room);
        }
        loop {
            self.test_pairs::<L>(question, rays, open);
            let before = count;
            (count, self.pairs) = (0, std::mem::take(&mut self.pairs));
            let mut pairs = 0;
            if self.pairs.len() < (BLOCK + 1) * WIDTH {
                self.pairs.resize((BLOCK + 1) * WIDTH, 0);
            }
            for k in 0..before {
                let ray = going[k];
                let i = ray as usize % BLOCK;
                if *open >> i & 1 == 0 {
                    continue;
                }
                let end = self.ends[i] as usize - 1;
                let node = &question.wide.nodes[(self.stacks[end] >> TAG_BITS) as usize];
                let (mut enter, mut exit) = (L::splat(0.0), limit);
                for k in 0..D {
                    let [middle, half] = &node.boxes[k];
                    let absolute = L::splat(rays.absolute[k][i]);
                    let middle = L::load(middle).mul_sub(L::splat(rays.inverse[k][i]), L::splat(rays.offset[k][i]));
                    let half = L::load(half);
                    enter = enter.max(absolute.negated_mul_add(half, middle));
                    exit = exit.min(absolute.mul_add(half, middle));
                }
                let met = enter.less_or_equal(exit);
                let end = end + compress::<L>(&node.children, 0, met & !node.leaves, &mut self.stacks, end);
                pairs += compress::<L>(&node.children, u32::from(ray), met & node.leaves, &mut self.pairs, pairs);
                self.ends[i] = end as u32;
                going[count] = ray;
                count += usize::from(end > i * self.room);
            }
            self.pairs.truncate(pairs);
            if before == 0 {
                return;
            }
        }
    }

    /// Where the cones of a leaf are kept.
    #[inline(always)]
    fn place<L: Lanes>(&mut self, question: &Question<D>, leaf: u32) -> usize {
        let kept = &mut self.kept;
        let (known, place) = kept.table[leaf as usize % TABLE];
        if known == leaf {
            return place as usize;
        }
        if kept.count == KEPT {
            kept.clear();
        }
        let place = kept.count;
        prepare::<L, D>(question, leaf, &mut kept.cones[place]);
        kept.table[leaf as usize % TABLE] = (leaf, place as u32);
        kept.leaves[place] = leaf;
        kept.count += 1;
        place
    }

    /// Tests a set of rays against a leaf, one simplex against eight rays at a time.
    #[inline(always)]
    fn test_set<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, leaf: u32, set: u64, open: &mut u64) {
        let place = self.place::<L>(question, leaf);
        let cones = &self.kept.cones[place];
        let live = cones.live::<L>();
        let unlimited = question.limit == f32::INFINITY;
        for group in 0..BLOCK / WIDTH {
            let mut members = ((set & *open) >> (group * WIDTH)) as u8;
            if members == 0 {
                continue;
            }
            let mut directions = [L::splat(0.0); D];
            for k in 0..D {
                directions[k] = L::load(row(&rays.direction[k], group));
            }
            let mut rest = live;
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let [mut inside, mut doubtful] = cones.judge_eight::<L>(lane, &directions);
                if !unlimited {
                    (inside, doubtful) = (0, inside | doubtful);
                }
                doubtful &= members & !inside;
                if doubtful != 0 {
                    let simplex = question.wide.leaves[leaf as usize].simplices[lane];
                    inside |= exactly(question, rays, simplex, doubtful, group);
                }
                *open &= !(u64::from(inside & members) << (group * WIDTH));
                members &= !inside;
            }
        }
    }

    /// Tests the pairs of leaves and rays, and closes the rays that hit.
    #[inline(always)]
    fn test_pairs<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, open: &mut u64) {
        let pairs = std::mem::take(&mut self.pairs);
        for some in pairs.chunks(BLOCK) {
            self.test_some::<L>(question, rays, some, open);
        }
        self.pairs = pairs;
        self.pairs.clear();
    }

    #[inline(always)]
    fn test_some<L: Lanes>(&mut self, question: &Question<D>, rays: &Rays<D>, pairs: &[u32], open: &mut u64) {
        let kept = &mut self.kept;
        if kept.count + BLOCK > KEPT {
            kept.clear();
        }
        // Where the cones of each pair's leaf are, or will be.
        let mut places = [0u32; BLOCK];
        let known = kept.count;
        for (place, &pair) in places.iter_mut().zip(pairs) {
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
        for (&place, &pair) in places.iter().zip(pairs) {
            let i = pair as usize % BLOCK;
            let cones = &kept.cones[place as usize];
            let direction = rays.splat::<L>(i);
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

/// Eight of 64.
#[inline(always)]
fn row(numbers: &[f32; BLOCK], group: usize) -> &[f32; WIDTH] {
    &numbers.as_chunks().0[group]
}

/// The boxes of a node that reach above the tangent hyperplane.
#[inline(always)]
fn above<L: Lanes, const D: usize>(node: &WideNode<D>, question: &Question<D>, origin: &Vector<D>, zero: L) -> u8 {
    let mut height = zero;
    for k in 0..D {
        let [middle, half] = &node.boxes[k];
        let normal = question.normal[k];
        height = L::load(middle).sub(L::splat(origin[k])).mul_add(L::splat(normal), height);
        height = L::load(half).mul_add(L::splat(normal.abs()), height);
    }
    node.used & L::splat(-HEIGHT_ROUNDING).less_or_equal(height)
}

/// Compresses into a longer array at a place.
#[inline(always)]
fn compress<L: Lanes>(words: &[u32; WIDTH], tag: u32, mask: u8, out: &mut [u32], place: usize) -> usize {
    let Some(out) = out.get_mut(place..).and_then(<[u32]>::first_chunk_mut) else {
        unreachable!("stacks have room for the depth of the tree, and pairs for a round");
    };
    L::compress(words, tag, mask, out)
}

#[cold]
fn exactly<const D: usize>(question: &Question<D>, rays: &Rays<D>, simplex: u32, doubtful: u8, group: usize) -> u8 {
    let hits = |n: &usize| question.tracer.hits(simplex, &question.ray(rays, group * WIDTH + n), question.limit);
    (0..WIDTH).filter(|n| doubtful >> n & 1 == 1).filter(hits).fold(0, |mask, n| mask | 1 << n)
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
    // What is surely below the tangent hyperplane is left out; its height is negative, as is, read as a number, the index of
    // an unused lane.
    let mut normal = [L::splat(0.0); D];
    for k in 0..D {
        normal[k] = L::splat(question.normal[k]);
    }
    let mut highest = L::splat(-1.0);
    for edge in &edges {
        highest = highest.max(dot(edge, &normal).add(L::splat(HEIGHT_ROUNDING)));
    }
    let unused = L::load(&leaf.simplices.map(f32::from_bits));
    let unused = highest.select(highest, unused);
    cones.set(&edges, unused);
    if let Some(lane) = question.ignored.and_then(|s| leaf.simplices.iter().position(|&t| t == s)) {
        cones.remove(lane);
    }
}
