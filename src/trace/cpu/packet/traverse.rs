//! The rays of a block through the hierarchy.
//!
//! They start as one set and descend together as long as they stay together: while at least [`FEW`] rays meet a node, or
//! [`FEW_AT_LEAF`] a leaf, it is asked for all of them at once ([`super::boxes`], [`super::leaves`]).
//!
//! Where fewer rays meet a node, a set would cost more than it saves. Such rays get the node on a stack of their own, and go on from
//! there when no set is left. A step takes what is on top of a ray's stack. If it is a node, the children that
//! the ray meets are put in its place, leaves last. By what is on top afterwards the ray joins the queue of those at a node
//! or the queue of those at a leaf; a ray that is blocked, or has nothing left, joins neither. So a step
//! has no branch that a processor could guess wrong, and what a ray needs next is fetched while the others in its queue have their turn.

use super::boxes::{AHEAD, APART, meet_set};
use super::directions::Rays;
use super::lanes::Lanes;
use super::leaves::{hits_of_one, hits_of_set};
use super::nets::BLOCK;
use super::query::Query;
use super::tally::Tally;
use crate::accel::{BOTTOM, LEAF, NODE, Reference, WIDTH, WideNode, place};

/// Fewer rays than this at a node go their own ways.
const FEW: u32 = 8;
/// Fewer rays than this at a leaf do.
const FEW_AT_LEAF: u32 = 3;
/// Nodes and leaves where rays part from the others, before they are followed from there.
const PARTED: usize = 128;
/// The bits of a reference that tell what it refers to.
const KIND: u32 = 3;
/// Rays that get a node or leaf at once.
const AT_ONCE: usize = 4;

/// Working memory of a thread.
#[derive(Debug)]
pub(super) struct Traversal<const D: usize> {
    /// Sets of many rays, and what they meet.
    sets: Vec<(u64, Reference)>,
    /// Sets of few.
    parted: Vec<(u64, Reference)>,
    /// The stacks of single rays, each with room for where it parts from others and for the children of all nodes on the way to a leaf,
    /// [`BOTTOM`] first; and where their tops are. The last one is of no ray.
    stacks: Vec<Reference>,
    tops: [u32; BLOCK + 1],
    bottoms: [u32; BLOCK + 1],
}

/// Rays that wait, first come, first served. None is in it twice.
struct Queue {
    rays: [u8; BLOCK],
    first: usize,
    end: usize,
}

impl Queue {
    #[inline(always)]
    fn new() -> Self {
        Self { rays: [0; BLOCK], first: 0, end: 0 }
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.first == self.end
    }

    /// Adds a ray, or doesn't, without a branch.
    #[inline(always)]
    fn add(&mut self, ray: usize, really: bool) {
        self.rays[self.end % BLOCK] = ray as u8;
        self.end += usize::from(really);
    }

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.is_empty() {
            return None;
        }
        let ray = self.rays[self.first % BLOCK] as usize % BLOCK;
        self.first += 1;
        Some(ray)
    }
}

impl<const D: usize> Traversal<D> {
    pub fn new() -> Self {
        Self {
            sets: Vec::new(),
            parted: vec![(0, BOTTOM); PARTED + WIDTH],
            stacks: Vec::new(),
            tops: [0; BLOCK + 1],
            bottoms: [0; BLOCK + 1],
        }
    }

    /// Which of the rays `alive` hit something.
    #[inline(always)]
    pub fn blocked<L: Lanes, T: Tally>(&mut self, query: &Query<D>, rays: &Rays<D>, alive: u64, tally: &mut T) -> u64 {
        tally.rays(alive.count_ones());
        let Some(root) = query.wide.root() else { return 0 };
        self.make_room(query.wide.depth);
        let limit = L::splat(query.box_limit());
        let mut open = alive;
        self.sets[0] = (alive, root);
        let mut sets = 1;
        while sets > 0 {
            let mut parted = 0;
            while sets > 0 && parted < PARTED {
                sets -= 1;
                let (set, reference) = self.sets[sets];
                let set = set & open;
                if set == 0 {
                    continue;
                }
                if reference & KIND == LEAF {
                    tally.set_at_leaf(set.count_ones());
                    open &= !hits_of_set::<L, D>(query, rays, reference, set);
                    continue;
                }
                let node = WideNode::<D>::at(query.rows, reference);
                tally.set_at_node(set.count_ones());
                let met = meet_set(query, rays, limit, node, set);
                let [Some(many), Some(few)] = [(&mut self.sets, sets), (&mut self.parted, parted)]
                    .map(|(list, end)| list[end..].first_chunk_mut::<WIDTH>())
                else {
                    unreachable!()
                };
                let (mut more, mut fewer) = (0, 0);
                // No branch depends on how many rays meet a child: nothing would foretell it.
                for (&child, set) in node.children().iter().zip(met) {
                    let count = set.count_ones();
                    let least = if child & KIND == LEAF { FEW_AT_LEAF } else { FEW };
                    (many[more % WIDTH], few[fewer % WIDTH]) = ((set, child), (set, child));
                    more += usize::from(count >= least);
                    fewer += usize::from(count > 0) & usize::from(count < least);
                    L::fetch::<D>(query.rows, place(if count > 0 { child } else { root }));
                }
                (sets, parted) = (sets + more, parted + fewer);
            }
            self.follow::<L, T>(query, rays, limit, parted, &mut open, tally);
        }
        alive & !open
    }

    /// For a hierarchy of this depth.
    fn make_room(&mut self, depth: usize) {
        // Each node leaves at most all but one of its children behind, and a push writes eight words.
        let room = PARTED + WIDTH + (WIDTH - 1) * depth + 2 * WIDTH;
        if self.bottoms[1] as usize != room {
            self.bottoms = std::array::from_fn(|i| (i * room) as u32);
            self.stacks.resize((BLOCK + 1) * room, BOTTOM);
            (0..=BLOCK).for_each(|i| self.stacks[i * room] = BOTTOM);
            self.sets.resize((WIDTH - 1) * depth + 2 * WIDTH, (0, BOTTOM));
        }
    }

    /// Follows the open rays of the first `parted` sets of few, each by itself.
    #[inline(always)]
    fn follow<L: Lanes, T: Tally>(
        &mut self,
        query: &Query<D>,
        rays: &Rays<D>,
        limit: L,
        parted: usize,
        open: &mut u64,
        tally: &mut T,
    ) {
        self.tops = self.bottoms;
        let mut all = 0;
        for &(set, reference) in &self.parted[..parted] {
            let mut set = set & *open;
            all |= set;
            while set != 0 {
                // Most sets are done in one go; if they have fewer rays, the stack of no ray gets the rest.
                for _ in 0..AT_ONCE {
                    let i = set.trailing_zeros() as usize % (2 * BLOCK);
                    set &= set.wrapping_sub(1);
                    let top = self.tops[i] as usize + 1;
                    self.stacks[top] = reference;
                    self.tops[i] = top as u32;
                }
                self.tops[BLOCK] = self.bottoms[BLOCK];
            }
        }
        self.singly::<L, T>(query, rays, limit, all, open, tally);
    }

    /// The rays of a set, each through what is on its stack.
    #[inline(always)]
    fn singly<L: Lanes, T: Tally>(
        &mut self,
        query: &Query<D>,
        rays: &Rays<D>,
        limit: L,
        mut set: u64,
        open: &mut u64,
        tally: &mut T,
    ) {
        let (stacks, tops) = (&mut self.stacks[..], &mut self.tops);
        let (mut at_node, mut at_leaf) = (Queue::new(), Queue::new());
        while set != 0 {
            let i = set.trailing_zeros() as usize;
            set &= set - 1;
            let kind = stacks[tops[i] as usize] & KIND;
            at_node.add(i, kind == NODE);
            at_leaf.add(i, kind == LEAF);
        }
        let mut still_open = *open;
        let mut origin = [limit; D];
        for k in 0..D {
            origin[k] = L::splat(query.scaled[k]);
        }
        while !(at_node.is_empty() && at_leaf.is_empty()) {
            while let Some(i) = at_node.next() {
                tally.ray_at_node();
                let top = tops[i] as usize;
                let node = WideNode::<D>::at(query.rows, stacks[top]);
                let (mut enter, mut exit) = (L::splat(AHEAD), limit);
                for k in 0..D {
                    let absolute = L::splat(rays.absolute[k][i]);
                    let middle = L::load(node.middle(k)).sub(origin[k]).mul(L::splat(rays.inverse[k][i]));
                    let half = L::load(node.half(k));
                    enter = enter.max(absolute.negated_mul_add(half, middle));
                    exit = exit.min(absolute.mul_add(half, middle));
                }
                let met = enter.less_or_equal(exit.mul(L::splat(1.0 + APART)));
                let Some(end) = stacks.get_mut(top..).and_then(<[u32]>::first_chunk_mut) else { unreachable!() };
                L::compress(node.children(), met, end);
                let top = top + met.count_ones() as usize - 1;
                tops[i] = top as u32;
                let reference = stacks[top];
                at_node.add(i, reference & KIND == NODE);
                at_leaf.add(i, reference & KIND == LEAF);
                L::fetch::<D>(query.rows, place(reference));
            }
            while let Some(i) = at_leaf.next() {
                let top = tops[i] as usize;
                tally.ray_at_leaf();
                let [mut hit, doubtful] = hits_of_one::<L, D>(query, rays, stacks[top], i);
                if doubtful {
                    tally.ray_in_doubt();
                    hit = hits_of_set::<L, D>(query, rays, stacks[top], 1 << i) != 0;
                }
                let top = top - 1;
                tops[i] = top as u32;
                let reference = stacks[top];
                still_open &= !(u64::from(hit) << i);
                at_node.add(i, !hit & (reference & KIND == NODE));
                at_leaf.add(i, !hit & (reference & KIND == LEAF));
                L::fetch::<D>(query.rows, place(reference));
            }
        }
        *open = still_open;
    }
}
