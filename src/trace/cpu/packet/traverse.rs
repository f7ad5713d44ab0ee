//! The rays of a block through the hierarchy.
//!
//! They start as one set and descend together as long as they stay together. While at least [`FEW`] rays meet a node, its eight
//! boxes, less the origin, stay in registers, and ray after ray is tested against all eight at once: three products for each
//! axis. Each box has a word, to which a ray that meets it adds its bit: that is the set of rays of that child.
//!
//! Where fewer rays meet a node, a set would cost more than it saves. Such rays get the node on a stack of their own. In the end
//! all rays that are left go in step. A step takes what is on top of a ray's stack. If it is a node, the children that
//! the ray meets are put in its place, leaves last. By what is on top afterwards the ray joins the list of those at a node
//! or the list of those at a leaf for the next round; a ray that is blocked, or has nothing left, joins neither. So a step
//! has no branch that a processor could guess wrong, and what the next round needs is fetched a whole round ahead.

use super::directions::{BLOCK, Rays};
use super::lanes::Lanes;
use super::leaves::{hits_of_one, hits_of_set};
use super::query::Query;
use crate::accel::{BOTTOM, LEAF, NODE, Reference, WIDTH, WideNode, place};

/// Fewer rays than this at a node go their own ways.
const FEW: u32 = 8;
/// Fewer rays than this at a leaf do.
const FEW_AT_LEAF: u32 = 3;
/// Nodes and leaves that a ray may have when it parts from the others.
const PARTED: usize = 64;
/// The bits of a reference that tell what it refers to.
const KIND: u32 = 3;
/// Ahead of the origin: no ray meets what ends there. Not even the nearest hit is nearer.
const AHEAD: f32 = f32::from_bits(1);
/// What near and far sides of boxes are pulled apart by, in proportion, where axes are compared.
const APART: f32 = 1.0 / (1 << 20) as f32;

/// Working memory of a thread.
#[derive(Debug)]
pub(super) struct Traversal<const D: usize> {
    /// Sets of rays, and what they meet.
    sets: Vec<(u64, Reference)>,
    /// The stacks of single rays, each with room for the children of all nodes on the way to a leaf, [`BOTTOM`] first; and
    /// where their tops are.
    stacks: Vec<Reference>,
    tops: [u32; BLOCK],
    /// Room of one stack.
    room: usize,
    /// Rays at a node, this round and next.
    at_node: [[u8; BLOCK + 1]; 2],
    /// Rays at a leaf, this round and next.
    at_leaf: [[u8; BLOCK + 1]; 2],
}

impl<const D: usize> Traversal<D> {
    pub fn new() -> Self {
        let lists = [[0; BLOCK + 1]; 2];
        Self { sets: Vec::new(), stacks: Vec::new(), tops: [0; BLOCK], room: 0, at_node: lists, at_leaf: lists }
    }

    /// Which of the rays `alive` hit something.
    #[inline(always)]
    pub fn blocked<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, alive: u64) -> u64 {
        let Some(root) = query.wide.root() else { return 0 };
        // Each node leaves at most all but one of its children behind, and a push writes eight words.
        let room = PARTED + (WIDTH - 1) * query.wide.depth + 2 * WIDTH;
        if self.room != room {
            self.room = room;
            self.stacks.resize(BLOCK * room, BOTTOM);
            (0..BLOCK).for_each(|i| self.stacks[i * room] = BOTTOM);
            self.sets.resize((WIDTH - 1) * query.wide.depth + 2, (0, BOTTOM));
        }
        for i in 0..BLOCK {
            self.tops[i] = (i * room) as u32;
        }
        let limit = L::splat(query.box_limit());
        let mut open = alive;
        self.together::<L>(query, rays, limit, root, &mut open);
        self.singly::<L>(query, rays, limit, &mut open);
        alive & !open
    }

    /// Sets of rays, as long as they are large.
    #[inline(always)]
    fn together<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, limit: L, root: Reference, open: &mut u64) {
        self.sets[0] = (*open, root);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (set, reference) = self.sets[count];
            let mut set = set & *open;
            let few = if reference & KIND == LEAF { FEW_AT_LEAF } else { FEW };
            if set.count_ones() < few {
                set = self.part(set, reference);
                if set == 0 {
                    continue;
                }
            }
            if reference & KIND == LEAF {
                *open &= !hits_of_set::<L, D>(query, rays, reference, set);
                continue;
            }
            let (mut met, [low, high]) = meet_set::<L, D>(query, rays, limit, reference, set);
            let children = WideNode::<D>::at(query.rows, reference).children();
            while met != 0 {
                let child = met.trailing_zeros() as usize % WIDTH;
                met &= met - 1;
                self.sets[count] = (u64::from(low[child]) | u64::from(high[child]) << 32, children[child]);
                count += 1;
                L::fetch::<D>(query.rows, place(children[child]));
            }
        }
    }

    /// Gives a node or leaf to each ray of a set, and returns those that have no room for it.
    #[inline(always)]
    fn part(&mut self, set: u64, reference: Reference) -> u64 {
        let mut full = 0;
        let mut rest = set;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let top = self.tops[i] as usize + 1;
            if top < i * self.room + PARTED {
                self.stacks[top] = reference;
                self.tops[i] = top as u32;
            } else {
                full |= 1 << i;
            }
        }
        full
    }

    /// Every ray with something left on its stack by itself.
    #[inline(always)]
    fn singly<L: Lanes>(&mut self, query: &Query<D>, rays: &Rays<D>, limit: L, open: &mut u64) {
        let Self { stacks, tops, at_node, at_leaf, .. } = self;
        let (mut now, mut nodes, mut leaves) = (0, 0, 0);
        let mut rest = *open;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let kind = stacks[tops[i] as usize] & KIND;
            (at_node[0][nodes], at_leaf[0][leaves]) = (i as u8, i as u8);
            nodes += usize::from(kind == NODE);
            leaves += usize::from(kind == LEAF);
        }
        let mut origin = [limit; D];
        for k in 0..D {
            origin[k] = L::splat(query.scaled[k]);
        }
        while nodes + leaves > 0 {
            let next = 1 - now;
            let (mut next_nodes, mut next_leaves) = (0, 0);
            for n in 0..nodes {
                let ray = at_node[now][n];
                let i = ray as usize % BLOCK;
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
                (at_node[next][next_nodes], at_leaf[next][next_leaves]) = (ray, ray);
                next_nodes += usize::from(reference & KIND == NODE);
                next_leaves += usize::from(reference & KIND == LEAF);
                L::fetch::<D>(query.rows, place(reference));
            }
            for n in 0..leaves {
                let ray = at_leaf[now][n];
                let i = ray as usize % BLOCK;
                let top = tops[i] as usize;
                let [mut hit, doubtful] = hits_of_one::<L, D>(query, rays, stacks[top], i);
                if doubtful {
                    hit = hits_of_set::<L, D>(query, rays, stacks[top], 1 << i) != 0;
                }
                let top = top - 1;
                tops[i] = top as u32;
                let reference = stacks[top];
                *open &= !(u64::from(hit) << i);
                (at_node[next][next_nodes], at_leaf[next][next_leaves]) = (ray, ray);
                next_nodes += usize::from(!hit & (reference & KIND == NODE));
                next_leaves += usize::from(!hit & (reference & KIND == LEAF));
                L::fetch::<D>(query.rows, place(reference));
            }
            (nodes, leaves, now) = (next_nodes, next_leaves, next);
        }
    }
}

/// Which children of a node rays of a set meet; and for each child those rays, the first 32 and the others.
#[inline(always)]
fn meet_set<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    limit: L,
    node: Reference,
    set: u64,
) -> (u8, [[u32; WIDTH]; 2]) {
    let node = WideNode::<D>::at(query.rows, node);
    let (mut middles, mut halves) = ([limit; D], [limit; D]);
    for k in 0..D {
        middles[k] = L::load(node.middle(k)).sub(L::splat(query.scaled[k]));
        halves[k] = middles[k].abs().mul_add(L::splat(APART), L::load(node.half(k)));
    }
    let mut all = [L::unmarked(); 2];
    for part in 0..2 {
        let mut marks = L::unmarked();
        let mut rest = (set >> (32 * part)) as u32;
        while rest != 0 {
            let i = 32 * part + rest.trailing_zeros() as usize;
            let bit = rest & rest.wrapping_neg();
            rest &= rest - 1;
            let (mut enter, mut exit) = (L::splat(AHEAD), limit);
            for k in 0..D {
                let absolute = L::splat(rays.absolute[k][i]);
                let middle = middles[k].mul(L::splat(rays.inverse[k][i]));
                enter = enter.max(absolute.negated_mul_add(halves[k], middle));
                exit = exit.min(absolute.mul_add(halves[k], middle));
            }
            marks = enter.mark(exit, bit, marks);
        }
        all[part] = marks;
    }
    (L::any_marked(all), all.map(L::words))
}
