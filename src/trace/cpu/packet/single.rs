//! One ray against the eight simplices of a leaf.
//!
//! The facet values of [`super::leaves`] are found here without the facets' normals. In three dimensions they are products with
//! c = p x w, as Moeller and Trumbore have it (*Fast, Minimum Storage Ray/Triangle Intersection*, 1997). In four the simplex is
//! projected along the ray onto the axes but the one that the ray mostly follows: there the corners of a tetrahedron
//! surround the origin or not. The coordinate that was left out then tells front from back.

use super::cones::{dot, minor};
use super::directions::Rays;
use super::lanes::Lanes;
use super::query::Query;
use super::view::{View, columns};
use crate::accel::Leaf;
use crate::geometry::Dimension;

/// Half-ulps of a value, as for sets. In four dimensions the projection adds its own, 23 on the way in all, and the products of the
/// projected columns may be six times those of their 1-norms.
const ONE_ROUNDING: [f32; 2] = [40.0, 512.0];

/// The simplices that the ray hits for sure, and those that it may hit.
#[inline(always)]
pub(super) fn judge_one<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: &Leaf<D>,
    i: usize,
) -> [u8; 2] {
    let view = if D == 3 { View::rough(leaf) } else { View::new(query, leaf) };
    match Dimension::of::<D>() {
        Dimension::Three => in_three::<L, D>(query, rays, leaf, view.bounds::<D>(ONE_ROUNDING[0]), i),
        Dimension::Four => in_four::<L, D>(query, rays, leaf, view.bounds::<D>(ONE_ROUNDING[1]), i),
    }
}

#[inline(always)]
fn in_three<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: &Leaf<D>,
    bounds: [f32; 2],
    i: usize,
) -> [u8; 2] {
    let direction = rays.splat::<L>(i);
    let columns = columns::<L, D>(query, leaf);
    let (p, a, b) = (&columns[0], &columns[1], &columns[2]);
    let (mut c, mut normal) = (*p, *p);
    for k in 0..3 {
        let (m, n) = ((k + 1) % 3, (k + 2) % 3);
        c[k] = minor(p[m], p[n], direction[m], direction[n]);
        normal[k] = minor(a[m], a[n], b[m], b[n]);
    }
    let determinant = dot(p, &normal);
    let along = dot(&direction, &normal).turned_by(determinant);
    let first = dot(&c, b).turned_by(determinant);
    let second = dot(&c, a).turned_by(L::splat(0.0).sub(determinant));
    let last = along.sub(first).sub(second);
    let least = first.min(second).min(last);
    let greatest = first.max(second).max(last);
    judged([least, greatest], determinant, bounds)
}

#[inline(always)]
fn in_four<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: &Leaf<D>,
    [facet, flat]: [f32; 2],
    i: usize,
) -> [u8; 2] {
    let zero = L::splat(0.0);
    let main = rays.main_axis(i) % D;
    // The coordinates along the main axis, and the projected ones.
    let mut along = [zero; 4];
    along[0] = L::load(leaf.edge_row(0, main)).sub(L::splat(query.scaled[main]));
    for c in 1..4 {
        along[c] = L::load(leaf.edge_row(c, main));
    }
    let mut projected = [[zero; 3]; 4];
    for w in 0..3 {
        let k = w + usize::from(w >= main);
        let slope = L::splat(rays.direction[k % D][i] * rays.inverse[main][i]);
        for c in 0..4 {
            let mut x = L::load(leaf.edge_row(c, k));
            if c == 0 {
                x = x.sub(L::splat(query.scaled[k]));
            }
            projected[c][w] = slope.negated_mul_add(along[c], x);
        }
    }
    let [p, a, b, c] = &projected;
    let (mut b_c, mut a_p) = (*p, *p);
    for k in 0..3 {
        let (m, n) = ((k + 1) % 3, (k + 2) % 3);
        b_c[k] = minor(b[m], b[n], c[m], c[n]);
        a_p[k] = minor(a[m], a[n], p[m], p[n]);
    }
    let whole = dot(a, &b_c);
    let mut parts = [zero.sub(dot(p, &b_c)), zero.sub(dot(c, &a_p)), dot(b, &a_p)];
    let mut determinant = along[0].mul(whole);
    for c in 0..3 {
        determinant = along[c + 1].mul_add(parts[c], determinant);
    }
    let mut last = whole.turned_by(whole);
    for part in &mut parts {
        *part = part.turned_by(whole);
        last = last.sub(*part);
    }
    let least = parts[0].min(parts[1]).min(parts[2].min(last));
    let greatest = parts[0].max(parts[1]).max(parts[2].max(last));
    let front = determinant.turned_by(whole).turned_by(L::splat(rays.direction[main][i]));
    // Four such products, each of a value and a column, take 25 roundings.
    let flat = 2.0 * flat;
    let behind = front.less_or_equal(L::splat(-flat));
    let [surely, perhaps] = judged([least, greatest], determinant, [facet, flat]);
    [surely & !behind, perhaps & !behind]
}

/// From the least and the greatest facet value and the determinant, which orients them, with bounds on their rounding.
#[inline(always)]
fn judged<L: Lanes>([least, greatest]: [L; 2], determinant: L, [facet, flat]: [f32; 2]) -> [u8; 2] {
    let unoriented = determinant.abs().less_or_equal(L::splat(flat));
    let inside = !least.less_or_equal(L::splat(facet)) & !unoriented;
    let turned = unoriented & greatest.less_or_equal(L::splat(facet));
    [inside, !least.less_or_equal(L::splat(-facet)) | turned]
}
