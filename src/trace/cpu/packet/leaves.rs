//! Rays against the simplices of a leaf.
//!
//! A ray hits a simplex if the cone of the edges from its origin to the corners holds its direction w: if the facet values
//! det[.. w in place of an edge ..] all have the sign of the determinant. With p for the edge to corner 0 and e_c for what
//! leads from there to corner c, differences of columns leave only small vectors in all determinants but for one column.
//! So rounding is in proportion to the simplex, not to its distance, and little is left in doubt.
//!
//! A set of rays meets eight simplices whose facet normals are made once ([`hits_of_set`]); then a ray costs D dot products.
//! For a single ray the normals would be too much: [`super::single`] tests it without them. Both say which simplices are
//! hit for sure and which perhaps. What is in doubt for a single ray is tested as a set of one, whose bounds are narrower, and
//! what is in doubt then is left to the exact cone. Simplices with a corner at the vertex that rays start from hide nothing here
//! ([`super::star`]), nor do those that are to be ignored.

use super::cones::{dot, minor, minors, triple};
use super::directions::Rays;
use super::lanes::Lanes;
use super::query::Query;
use super::single::judge_one;
use super::view::{HEIGHT_ROUNDING, UNDERFLOW, View, columns};
use crate::accel::{Leaf, Reference, WIDTH};
use crate::geometry::Dimension;

/// Half-ulps of a facet value and of a determinant, relative to the product of the 1-norms of their columns. In three dimensions
/// a value takes at most 9 roundings on the way, in four 15, of up to three such products; and some to spare.
const SET_ROUNDING: [f32; 2] = [20.0, 48.0];
/// Which rays of a set hit a simplex of the leaf.
#[inline(always)]
pub(super) fn hits_of_set<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: Reference,
    set: u64,
) -> u64 {
    let leaf = Leaf::at(query.rows, leaf);
    let view = View::new(query, &leaf);
    let columns = columns::<L, D>(query, &leaf);
    // What all rays pass over.
    let mut normal = [L::splat(0.0); D];
    for k in 0..D {
        normal[k] = L::splat(query.normal[k]);
    }
    let height = dot(&columns[0], &normal);
    let mut highest = height;
    for edge in &columns[1..] {
        highest = highest.max(height.add(dot(edge, &normal)));
    }
    let mut aside = highest.less_or_equal(L::splat(view.low(query)));
    if view.distance == 0.0 && query.vertex.is_some() {
        let lanes = with_corner_at_origin(&columns) & !aside;
        if lanes != 0 {
            aside |= query.around_lanes(&leaf, lanes);
        }
    }
    if !query.ignored.is_empty() {
        aside |= query.ignored_lanes(&leaf);
    }
    if aside == u8::MAX {
        return 0;
    }
    let mut set = set;
    if view.distance == 0.0 && query.rise > 0.0 {
        let steepest = steepest::<L, D>(&view, &columns, &normal, aside);
        set &= rays.up_to_height::<L>(steepest / (1.0 + steepest * steepest).sqrt() * (1.0 + 2e-2) + 1e-4);
        if set == 0 {
            return 0;
        }
    }
    let [facet, flat] = view.bounds::<D>(Dimension::of::<D>().pick(SET_ROUNDING[0], SET_ROUNDING[1]));
    let (normals, determinant) = facet_normals(&columns);
    let unoriented = determinant.abs().less_or_equal(L::splat(flat)) & !aside;
    // What is added to facet values, so that those of what is surely outside are negative.
    let margin = if aside == 0 { L::splat(facet) } else { L::by_mask(aside, f32::NEG_INFINITY, facet) };
    let mut candidates = 0;
    let mut rest = set;
    while rest != 0 {
        let i = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let outside = any_negative::<L, D>(&normals, &rays.splat(i), margin);
        candidates |= u64::from(outside.negative() != u8::MAX) << i;
    }
    if unoriented != 0 {
        candidates = set;
    }
    let mut hits = 0;
    while candidates != 0 {
        let i = candidates.trailing_zeros() as usize;
        candidates &= candidates - 1;
        let [least, greatest] = extremes::<L, D>(&normals, &rays.splat(i));
        let inside = L::splat(facet);
        let surely = !least.less_or_equal(inside) & !unoriented & !aside;
        let turned = unoriented & greatest.less_or_equal(inside);
        let perhaps = (!least.less_or_equal(L::splat(-facet)) | turned) & !aside;
        let hit =
            (surely != 0 && query.limit == f32::INFINITY) || (perhaps != 0 && exactly(query, rays, &leaf, perhaps, i));
        hits |= u64::from(hit) << i;
    }
    hits
}

/// The lanes with a corner that seems to be where the origin is; all that have one are among them.
#[inline(always)]
fn with_corner_at_origin<L: Lanes, const D: usize>(columns: &[[L; D]; D]) -> u8 {
    let mut nearest = L::splat(f32::INFINITY);
    for corner in 0..D {
        let mut distance = L::splat(0.0);
        for k in 0..D {
            let way = if corner == 0 { columns[0][k] } else { columns[0][k].add(columns[corner][k]) };
            distance = distance.max(way.abs());
        }
        nearest = nearest.min(distance);
    }
    nearest.less_or_equal(L::splat(0.0))
}

/// How steep a way from the origin to simplices may be that aren't aside: its height over the tangent hyperplane to what it
/// goes along it. If all corners are to one side, along some tangent, no point between is steeper than the steepest of them.
/// That keeps most rays from the leaves around where they start.
#[inline(always)]
fn steepest<L: Lanes, const D: usize>(view: &View, columns: &[[L; D]; D], normal: &[L; D], aside: u8) -> f32 {
    let mut middle = columns[0];
    for edge in &columns[1..] {
        for k in 0..D {
            middle[k] = edge[k].mul_add(L::splat(1.0 / D as f32), middle[k]);
        }
    }
    let up = dot(&middle, normal);
    let mut tangent = middle;
    for k in 0..D {
        tangent[k] = up.negated_mul_add(normal[k], middle[k]);
    }
    let length = dot(&tangent, &tangent).square_root();
    // What is left of a middle straight above the origin is rounding, and no tangent.
    let firm = length.sub(L::splat(0.02 * (view.size + view.edge)));
    // Rounding of heights and of ways along the tangent is less than a fiftieth of the least way.
    let least = length.mul(L::splat(1e-3 * (view.size + view.edge))).add(L::splat(UNDERFLOW));
    let (first_height, first_way) = (dot(&columns[0], normal), dot(&columns[0], &tangent));
    let mut slope = firm.select(L::splat(f32::INFINITY), L::splat(0.0));
    for corner in 0..D {
        let (mut height, mut way) = (first_height, first_way);
        if corner > 0 {
            height = height.add(dot(&columns[corner], normal));
            way = way.add(dot(&columns[corner], &tangent));
        }
        let height = height.add(L::splat(HEIGHT_ROUNDING * (view.size + view.edge)));
        let its = height.mul(length).div(way.max(least));
        slope = slope.max(way.sub(least).select(L::splat(f32::INFINITY), its));
    }
    let mut slopes = [0.0; WIDTH];
    slope.store(&mut slopes);
    let mut steepest = 0.0;
    for lane in 0..WIDTH {
        steepest = if aside >> lane & 1 == 0 && slopes[lane] > steepest { slopes[lane] } else { steepest };
    }
    if steepest < 1e6 { steepest } else { 1e6 }
}

/// Its sign is set where some facet value of the direction is negative though the margin is added.
#[inline(always)]
fn any_negative<L: Lanes, const D: usize>(normals: &[[L; D]; D], direction: &[L; D], margin: L) -> L {
    let mut signs = margin;
    for (n, normal) in normals.iter().enumerate() {
        let mut value = margin;
        for k in 0..D {
            value = normal[k].mul_add(direction[k], value);
        }
        signs = if n == 0 { value } else { signs.or(value) };
    }
    signs
}

/// The least and the greatest of the facet values of a direction.
#[inline(always)]
fn extremes<L: Lanes, const D: usize>(normals: &[[L; D]; D], direction: &[L; D]) -> [L; 2] {
    let first = dot(&normals[0], direction);
    let (mut least, mut greatest) = (first, first);
    for normal in &normals[1..] {
        let value = dot(normal, direction);
        least = least.min(value);
        greatest = greatest.max(value);
    }
    [least, greatest]
}

/// For each corner the normal of the facet opposite, turned to the inside; and the determinant.
#[inline(always)]
fn facet_normals<L: Lanes, const D: usize>(columns: &[[L; D]; D]) -> ([[L; D]; D], L) {
    let p = &columns[0];
    // The simplex's own normal, and those of the facets that corner 0 is a corner of.
    let mut normals = *columns;
    let mut own = *p;
    match Dimension::of::<D>() {
        Dimension::Three => {
            let (a, b) = (&columns[1], &columns[2]);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                own[k] = minor(a[i], a[j], b[i], b[j]);
                normals[1][k] = minor(b[i], b[j], p[i], p[j]);
                normals[2][k] = minor(p[i], p[j], a[i], a[j]);
            }
        }
        Dimension::Four => {
            let (last, first) = (minors(&columns[2], &columns[3]), minors(&columns[1], p));
            own = cross(&columns[1], &last, false);
            normals[1] = cross(p, &last, true);
            normals[2] = cross(&columns[3], &first, true);
            normals[3] = cross(&columns[2], &first, false);
        }
    }
    let determinant = dot(p, &own);
    // The facet opposite corner 0 is what the others leave of the simplex's own normal.
    for k in 0..D {
        let mut rest = own[k];
        for normal in &mut normals[1..] {
            rest = rest.sub(normal[k]);
            normal[k] = normal[k].turned_by(determinant);
        }
        normals[0][k] = rest.turned_by(determinant);
    }
    (normals, determinant)
}

/// In four dimensions the vector n with n . x = det[x, a, b, c], or its negative, given the minors of b and c.
#[inline(always)]
fn cross<L: Lanes, const D: usize>(a: &[L; D], [xy, xz, xw, yz, yw, zw]: &[L; 6], negative: bool) -> [L; D] {
    let zero = L::splat(0.0);
    let all = [
        triple([a[1], a[2], a[3]], [*zw, *yw, *yz]),
        triple([a[0], a[2], a[3]], [*zw, *xw, *xz]),
        triple([a[0], a[1], a[3]], [*yw, *xw, *xy]),
        triple([a[0], a[1], a[2]], [*yz, *xz, *xy]),
    ];
    let mut signed = *a;
    for k in 0..4 {
        signed[k] = if (k % 2 == 1) == negative { all[k] } else { zero.sub(all[k]) };
    }
    signed
}

/// Whether a ray hits a simplex of the leaf; or, as the second, whether that is in doubt, and [`hits_of_set`] has to tell.
#[inline(always)]
pub(super) fn hits_of_one<L: Lanes, const D: usize>(
    query: &Query<D>,
    rays: &Rays<D>,
    leaf: Reference,
    i: usize,
) -> [bool; 2] {
    let leaf = Leaf::at(query.rows, leaf);
    let [mut surely, perhaps] = judge_one::<L, D>(query, rays, &leaf, i);
    if !query.ignored.is_empty() && perhaps != 0 {
        surely &= !query.ignored_lanes(&leaf);
    }
    let surely = surely != 0 && query.limit == f32::INFINITY;
    [surely, perhaps != 0 && !surely]
}

#[cold]
fn exactly<const D: usize>(query: &Query<D>, rays: &Rays<D>, leaf: &Leaf<D>, lanes: u8, i: usize) -> bool {
    let ray = query.ray(rays, i);
    (query.wide.order[leaf.range()].iter().enumerate())
        .filter(|(lane, _)| lanes >> lane & 1 == 1)
        .any(|(_, &simplex)| query.tracer.hits(simplex, &ray, query.limit))
}
