//! The rays of a block through the hierarchy.
//!
//! They start as one set and descend together as long as they stay together: while at least [`FEW`] rays meet a node, its
//! boxes are tested against eight rays at a time, which gives the sets of rays that meet the children. Eight neighbouring
//! rays lie in a narrow cone, so most boxes are left out for all eight by one cheap test beforehand ([`Rays::cones`]), and
//! boxes below the tangent hyperplane for all rays, as no ray of the hemisphere goes there.
//!
//! Where fewer rays meet a node, a set would cost more in branches that the processor guesses wrong than it saves. Such
//! rays get the node on a stack of their own. In the end the rays go in step: in a round each takes a node from its stack
//! and is tested against its eight boxes at a time, without a branch, so that the processor works on several rays, and
//! waits for several cache lines, at once.

use super::cones::Cones;
use super::directions::{BLOCK, GROUPS, Rays};
use super::lanes::Lanes;
use super::leaves::{HEIGHT_ROUNDING, hits_of_one, hits_of_set};
use super::query::Query;
use crate::accel::{TAG_BITS, WIDTH, WideNode};

/// Fewer rays than this go their own ways.
const FEW: u32 = 6;
/// Nodes that a ray may have when it parts from the others.
const PARTED: usize = 64;

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
    cones: Cones<D>,
}

impl<const D: usize> Traversal<D> {
    pub fn new() -> Self {
        let (sets, stacks, pairs) = (Vec::new(), Vec::new(), Vec::new());
        Self { sets, stacks, ends: [0; BLOCK], room: 0, pairs, cones: Cones::new() }
    }

    /// Which of the rays `alive` hit something.
    #[inline(always)]
    pub fn blocked<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, alive: u64) -> u64 {
        if query.wide.nodes.is_empty() {
            return 0;
        }
        // Each node leaves at most all but one of its children behind, and a push writes eight words.
        self.room = PARTED + (WIDTH - 1) * query.wide.depth + 2 * WIDTH;
        if self.stacks.len() < BLOCK * self.room {
            self.stacks.resize(BLOCK * self.room, 0);
        }
        for i in 0..BLOCK {
            self.ends[i] = (i * self.room) as u32;
        }
        let limit = L::splat(query.box_limit());
        let mut open = alive;
        self.together::<L>(query, rays, limit, &mut open);
        self.singly::<L>(query, rays, limit, &mut open);
        alive & !open
    }

    /// Sets of rays, as long as they are large.
    #[inline(always)]
    fn together<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, limit: L, open: &mut u64) {
        self.sets.clear();
        self.pairs.clear();
        self.sets.push((*open, 0));
        while let Some((set, index)) = self.sets.pop() {
            let mut set = set & *open;
            if set.count_ones() < FEW {
                set = self.part(set, index);
                if set == 0 {
                    continue;
                }
            }
            let node = &query.wide.nodes[(index >> TAG_BITS) as usize];
            let (tests, count) = possible::<L, D>(query, rays, node, set);
            let mut met = [0u64; WIDTH];
            for &test in &tests[..count] {
                let (child, group) = (test as usize % WIDTH, test as usize / WIDTH % GROUPS);
                let (mut enter, mut exit) = (L::splat(0.0), limit);
                for k in 0..D {
                    let [middle, half] = &node.boxes[k];
                    let absolute = L::load(&rays.absolute[k].as_chunks().0[group]);
                    let inverse = L::load(&rays.inverse[k].as_chunks().0[group]);
                    let offset = L::load(&rays.offset[k].as_chunks().0[group]);
                    let middle = L::splat(middle[child]).mul_sub(inverse, offset);
                    let half = L::splat(half[child]);
                    enter = enter.max(absolute.negated_mul_add(half, middle));
                    exit = exit.min(absolute.mul_add(half, middle));
                }
                met[child] |= u64::from(enter.less_or_equal(exit)) << (group * WIDTH);
            }
            for child in 0..WIDTH {
                let set = met[child] & set & *open;
                if set == 0 {
                    continue;
                }
                let index = node.children[child];
                if node.leaves >> child & 1 == 0 {
                    self.sets.push((set, index));
                    L::fetch(&query.wide.nodes, index >> TAG_BITS);
                } else if set.count_ones() < FEW {
                    L::fetch(&query.wide.leaves, index >> TAG_BITS);
                    let mut rest = set;
                    while rest != 0 {
                        self.pairs.push(index | rest.trailing_zeros());
                        rest &= rest - 1;
                    }
                } else {
                    *open &= !hits_of_set::<L, D>(query, rays, index >> TAG_BITS, set, &mut self.cones);
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
    fn singly<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, limit: L, open: &mut u64) {
        let mut going = [0u8; BLOCK];
        let mut count = 0;
        for i in 0..BLOCK {
            going[count] = i as u8;
            count += usize::from(self.ends[i] as usize > i * self.room);
        }
        let mut waiting = self.pairs.len();
        if waiting < (BLOCK + 1) * WIDTH {
            self.pairs.resize((BLOCK + 1) * WIDTH, 0);
        }
        loop {
            for &pair in &self.pairs[..waiting] {
                let i = pair as usize % BLOCK;
                if *open >> i & 1 == 1 && hits_of_one::<L, D>(query, rays, pair >> TAG_BITS, i) {
                    *open &= !(1 << i);
                }
            }
            if count == 0 {
                return;
            }
            let before = count;
            (count, waiting) = (0, 0);
            for k in 0..before {
                let ray = going[k];
                let i = ray as usize % BLOCK;
                if *open >> i & 1 == 0 {
                    continue;
                }
                let end = self.ends[i] as usize - 1;
                let node = &query.wide.nodes[(self.stacks[end] >> TAG_BITS) as usize];
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
                waiting += compress::<L>(&node.children, u32::from(ray), met & node.leaves, &mut self.pairs, waiting);
                self.ends[i] = end as u32;
                going[count] = ray;
                count += usize::from(end > i * self.room);
                // The node for the next round; if there is none, any.
                L::fetch(&query.wide.nodes, self.stacks[end.saturating_sub(1)] >> TAG_BITS);
            }
            for &pair in &self.pairs[..waiting] {
                L::fetch(&query.wide.leaves, pair >> TAG_BITS);
            }
        }
    }
}

/// The boxes of a node that groups of rays of the set may meet, each as group * 8 + child, and how many.
#[inline(always)]
fn possible<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    node: &WideNode<D>,
    set: u64,
) -> ([u32; BLOCK + WIDTH], usize) {
    // The ball around each box: where it is, the square of its distance and of its radius; and how high the box reaches
    // above the tangent hyperplane.
    let zero = L::splat(0.0);
    let (mut height, mut distance, mut radius) = (zero, zero, zero);
    let mut away = [zero; D];
    for k in 0..D {
        let [middle, half] = &node.boxes[k];
        let (middle, half) = (L::load(middle).sub(L::splat(query.centred[k])), L::load(half));
        distance = middle.mul_add(middle, distance);
        radius = half.mul_add(half, radius);
        height = middle.mul_add(L::splat(query.normal[k]), height);
        height = half.mul_add(L::splat(query.normal[k].abs()), height);
        away[k] = middle;
    }
    let above = node.used & L::splat(-HEIGHT_ROUNDING).less_or_equal(height);
    // The cone of rays of half-angle a meets the ball, seen under the half-angle b, unless the angle between its axis and
    // the ball's middle m exceeds a + b: m . axis < |m| cos(a + b) = cos a sqrt(m^2 - r^2) - sin a r.
    // Less by more than the rounding of both squares, which their difference may bring out.
    let tangent = distance.mul(L::splat(1.0 - 4e-6)).sub(radius);
    let around = tangent.less_or_equal(L::splat(1e-6));
    let (tangent, radius) = (tangent.max(zero).square_root(), radius.square_root());
    let mut tests = [0; BLOCK + WIDTH];
    let mut count = 0;
    for group in 0..GROUPS {
        if set >> (group * WIDTH) & 0xff == 0 {
            continue;
        }
        let cone = &rays.cones[group];
        let mut along = L::splat(1e-5);
        for k in 0..D {
            along = away[k].mul_add(L::splat(cone.axis[k]), along);
        }
        along = radius.mul_add(L::splat(cone.sine), along);
        let meets = tangent.mul(L::splat(cone.cosine)).less_or_equal(along) | around;
        let tag = (group * WIDTH) as u32;
        count += compress::<L>(&[0, 1, 2, 3, 4, 5, 6, 7], tag, meets & above, &mut tests, count);
    }
    (tests, count)
}

/// Compresses into a longer array at a place.
#[inline(always)]
fn compress<L: Lanes>(words: &[u32; WIDTH], tag: u32, mask: u8, out: &mut [u32], place: usize) -> usize {
    let Some(out) = out.get_mut(place..).and_then(<[u32]>::first_chunk_mut) else {
        unreachable!("stacks have room for the depth of the tree, the others for eight children of each ray");
    };
    L::compress(words, tag, mask, out)
}
