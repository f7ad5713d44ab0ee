//! Rays against the simplices of a leaf.
//!
//! A set of rays meets one simplex after another, eight rays at a time, with facet normals computed once; a single ray meets
//! eight simplices at a time. Both leave what rounding could decide to the exact cone.

use super::cones::{Cones, dot, judge_once};
use super::directions::{BLOCK, Rays};
use super::lanes::Lanes;
use super::query::Query;
use crate::accel::{Leaf, WIDTH};

/// More than what rounding makes of heights over the tangent hyperplane, in widths of the scene.
pub(super) const HEIGHT_ROUNDING: f32 = 4e-6;

/// The edges from the origin to the corners of the simplices.
#[inline(always)]
fn edges<L: Lanes, const D: usize>(query: &Query<D>, leaf: &Leaf<D>) -> [[L; D]; D] {
    let mut edges = [[L::splat(0.0); D]; D];
    for (edge, corner) in edges.iter_mut().zip(&leaf.corners) {
        for k in 0..D {
            edge[k] = L::load(&corner[k]).sub(L::splat(query.scaled[k]));
        }
    }
    edges
}

/// The lanes of a leaf that rays don't hit.
#[inline(always)]
fn ignored<const D: usize>(query: &Query<D>, leaf: &Leaf<D>) -> impl Iterator<Item = usize> {
    query.ignored.iter().filter_map(|s| leaf.simplices.iter().position(|t| t == s))
}

/// The simplices of a leaf as cones seen from the origin, without those that no ray can hit.
#[inline(always)]
fn prepare<L: Lanes, const D: usize>(query: &Query<D>, leaf: &Leaf<D>, cones: &mut Cones<D>) {
    let edges = edges::<L, D>(query, leaf);
    let mut normal = [L::splat(0.0); D];
    for k in 0..D {
        normal[k] = L::splat(query.normal[k]);
    }
    // What is surely below the tangent hyperplane is left out; its height is negative, as is, read as a number, the index of
    // an unused lane.
    let mut highest = L::splat(-1.0);
    for edge in &edges {
        highest = highest.max(dot(edge, &normal).add(L::splat(HEIGHT_ROUNDING)));
    }
    let unused = L::load(&leaf.simplices.map(f32::from_bits));
    cones.set(&edges, highest.select(highest, unused));
    for lane in ignored(query, leaf) {
        cones.remove(lane);
    }
}

/// Which rays of a set hit a simplex of the leaf. `cones` is working memory.
#[inline(always)]
pub(super) fn hits_of_set<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: u32,
    set: u64,
    cones: &mut Cones<D>,
) -> u64 {
    let leaf = &query.wide.leaves[leaf as usize];
    prepare::<L, D>(query, leaf, cones);
    let live = cones.live::<L>();
    let unlimited = query.limit == f32::INFINITY;
    let mut hits = 0;
    for group in 0..BLOCK / WIDTH {
        let mut members = (set >> (group * WIDTH)) as u8;
        if members == 0 {
            continue;
        }
        let directions = rays.directions::<L>(group);
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
                inside |= exactly_those(query, rays, leaf.simplices[lane], doubtful, group);
            }
            hits |= u64::from(inside & members) << (group * WIDTH);
            members &= !inside;
        }
    }
    hits
}

/// Whether a ray hits a simplex of the leaf.
#[inline(always)]
pub(super) fn hits_of_one<L: Lanes, const D: usize>(query: &Query<D>, rays: &Rays<D>, leaf: u32, i: usize) -> bool {
    let leaf = &query.wide.leaves[leaf as usize];
    let mut size = leaf.reach;
    for k in 0..D {
        size += (leaf.middle[k] - query.scaled[k]).abs();
    }
    let edges = edges::<L, D>(query, leaf);
    let verdict = judge_once(&edges, &rays.splat::<L>(i), size * (1.0 + 1e-5));
    if verdict.inside | verdict.doubtful == 0 {
        return false;
    }
    let mut live = !L::load(&leaf.simplices.map(f32::from_bits)).negative();
    for edge in &edges {
        let mut length = edge[0].abs();
        for component in &edge[1..] {
            length = length.add(component.abs());
        }
        live &= !length.less_or_equal(L::splat(0.0));
    }
    for lane in ignored(query, leaf) {
        live &= !(1 << lane);
    }
    let surely = verdict.inside & live != 0 && query.limit == f32::INFINITY;
    surely || exactly_one(query, rays, &leaf.simplices, (verdict.inside | verdict.doubtful) & live, i)
}

#[cold]
fn exactly_one<const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    simplices: &[u32; WIDTH],
    candidates: u8,
    i: usize,
) -> bool {
    let ray = query.ray(rays, i);
    (0..WIDTH)
        .filter(|lane| candidates >> lane & 1 == 1)
        .any(|lane| query.tracer.hits(simplices[lane], &ray, query.limit))
}

#[cold]
fn exactly_those<const D: usize>(query: &Query<D>, rays: &Rays<D>, simplex: u32, doubtful: u8, group: usize) -> u8 {
    let hits = |n: &usize| query.tracer.hits(simplex, &query.ray(rays, group * WIDTH + n), query.limit);
    (0..WIDTH).filter(|n| doubtful >> n & 1 == 1).filter(hits).fold(0, |mask, n| mask | 1 << n)
}
