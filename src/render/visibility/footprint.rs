//! One simplex in the image: which voxels of a row it covers, and how near it is there.
//!
//! Whether a voxel's ray hits a simplex is decided by signs of determinants ([`Cone`]), and seen from a camera these are
//! *affine* functions of the voxel's place, as is what tells near from far:
//!
//! - in perspective all rays have one origin, so the facet determinants are N_m . w with fixed normals N_m, and w =
//!   across - back is affine in (i, j, k); the inverse distance (sum of N_m) . w / det[e] is as well;
//! - in parallel projection all rays have one direction w, and origins p that are affine in (i, j, k). The facet
//!   determinants det[v_j - p ..., w] are affine in p, as differences of columns show, and so is det[v_j - p], which with
//!   the constant n . w gives the distance.
//!
//! So along a row each facet is a number that grows or shrinks steadily, and the voxels inside are those between the
//! largest lower and the smallest upper bound. Rays are rounded to `f32`, which makes them stray from the affine function
//! by a small multiple of 2^-24; with that and all rounding as a bound, a row has an *outer* range, beyond which nothing
//! is covered, and an *inner* one, in which all is. The few voxels between are decided by the ray test itself. Distances
//! have bounds too, and where two simplices' overlap, they are compared as for a ray.

use crate::geometry::{Cone, Vector, Vector64, cross, widen};

use super::super::camera::{Lens, Rays};

/// What rounding to `f32` may do to a coordinate, relative to it, twice: the second half is for rounding in `f64`, some
/// thousand times less even after all that is done here.
const ROUNDED: f64 = 1.0 / (1 << 23) as f64;
/// Rounding in `f64` of sums of some products, relative to the largest terms.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// An affine function of a voxel's place, and how far it may be off.
#[derive(Clone, Copy, Debug)]
struct Affine {
    start: f64,
    steps: [f64; 3],
    bound: f64,
}

impl Affine {
    /// `constant + normal . (place of the lens)`.
    fn new<const D: usize>(constant: f64, normal: &Vector64<D>, lens: &Lens<D>, bound: f64) -> Self {
        Self { start: constant + normal.dot(&lens.start), steps: lens.steps.map(|step| normal.dot(&step)), bound }
    }

    fn scaled(self, factor: f64) -> Self {
        Self { start: self.start * factor, steps: self.steps.map(|s| s * factor), bound: self.bound * factor.abs() }
    }

    fn at_row(&self, j: usize, k: usize) -> f64 {
        self.start + self.steps[1] * j as f64 + self.steps[2] * k as f64
    }
}

/// Where a facet cuts rows.
#[derive(Clone, Copy, Debug)]
enum Cut {
    /// Covered voxels are at and beyond this place of the row, up to the uncertainty.
    From(Place),
    /// Covered voxels are at and before this place.
    To(Place),
    /// The function hardly changes along a row: it is inside or outside as a whole.
    Whole,
}

/// A place on rows, affine in (j, k), with its uncertainty.
#[derive(Clone, Copy, Debug)]
struct Place {
    start: f64,
    steps: [f64; 2],
    slack: f64,
}

/// One simplex as the image has it.
#[derive(Clone, Debug)]
pub(super) struct Footprint {
    facets: [Affine; 5],
    cuts: [Cut; 5],
    count: usize,
    /// Larger is nearer.
    nearness: Affine,
    /// How far it may be off besides, relative to itself.
    relative: f64,
    /// Whether the inner range means anything.
    certain: bool,
}

/// Voxels of a row: those beyond `outer` are not covered, those in `inner` are, the others may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub outer: (usize, usize),
    pub inner: (usize, usize),
}

/// How near a simplex is along a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearness {
    start: f64,
    step: f64,
    bound: f64,
    relative: f64,
}

impl Nearness {
    /// Bounds on it at a voxel of the row, rounded apart.
    #[inline(always)]
    pub fn at(&self, i: usize) -> (f32, f32) {
        let value = self.start + self.step * i as f64;
        let slack = self.bound + self.relative * value.abs();
        ((value - slack) as f32, (value + slack) as f32)
    }
}

/// Sum of the products of absolute components.
fn reach<const D: usize>(normal: &Vector64<D>, lengths: &Vector64<D>) -> f64 {
    (0..D).map(|a| normal[a].abs() * lengths[a]).sum()
}

fn norm1<const D: usize>(v: &Vector64<D>) -> f64 {
    v.iter().map(|x| x.abs()).sum()
}

/// Nearness of no meaning: all comparisons are done exactly.
const UNKNOWN: Affine = Affine { start: 0.0, steps: [0.0; 3], bound: f64::INFINITY };

impl Footprint {
    /// The footprints of a simplex: one; two, of which each may be empty, where rounding hides which side is seen; none if
    /// nothing of it can be seen.
    pub fn new<const D: usize>(corners: &[Vector<D>; D], lens: &Lens<D>) -> [Option<Self>; 2] {
        match &lens.rays {
            Rays::From(eye) => [Self::perspective(corners, eye, lens), None],
            Rays::Along(direction) => Self::parallel(corners, direction, lens),
        }
    }

    fn perspective<const D: usize>(corners: &[Vector<D>; D], eye: &Vector<D>, lens: &Lens<D>) -> Option<Self> {
        let cone = Cone::of_simplex(eye, corners);
        if cone.orientation() == 0 {
            return None;
        }
        let sign = f64::from(cone.orientation());
        let length = norm1(&lens.reach);
        let mut facets = [UNKNOWN; 5];
        let (mut sum, mut sum_bound) = (Vector64::zeros(), 0.0);
        for (m, facet) in facets.iter_mut().enumerate().take(D) {
            let (normal, rounding) = cone.facet(m);
            let normal = normal * sign;
            let bound = ROUNDED * reach(&normal, &lens.reach) + rounding * 2.0 * length;
            *facet = Affine::new(0.0, &normal, lens, bound);
            sum += normal;
            sum_bound += bound;
        }
        let (determinant, rounding) = cone.determinant();
        let size = determinant.abs();
        let (nearness, relative) = if size > 2.0 * rounding {
            (Affine::new(0.0, &sum, lens, sum_bound).scaled(1.0 / size), 2.0 * rounding / size)
        } else {
            (UNKNOWN, 0.0)
        };
        Some(Self::cut(facets, D, nearness, relative, true, lens))
    }

    fn parallel<const D: usize>(corners: &[Vector<D>; D], along: &Vector<D>, lens: &Lens<D>) -> [Option<Self>; 2] {
        let points = corners.map(|c| widen(&c));
        let along = widen(along);
        // det[.. point - p ..] = normal . (point - p), where the other columns are these and this one is the first or the
        // second.
        let affine = |point: &Vector64<D>, columns: &[Vector64<D>], first: usize| {
            let normal = cross(columns) * if first == 0 { 1.0 } else { -1.0 };
            let rounding = ROUNDING * columns.iter().map(norm1).product::<f64>();
            let far = point.map(f64::abs) + lens.reach;
            let bound =
                ROUNDED * reach(&normal, &lens.reach) + ROUNDING * reach(&normal, &far) + rounding * norm1(&far);
            (Affine::new(normal.dot(point), &-normal, lens, bound), normal, rounding)
        };
        let mut facets = [UNKNOWN; 5];
        let mut columns = [Vector64::<D>::zeros(); 4];
        for m in 0..D {
            let first = usize::from(m == 0);
            for (n, j) in (0..D).filter(|&j| j != first).enumerate() {
                columns[n] = if j == m { along } else { points[j] - points[first] };
            }
            facets[m] = affine(&points[first], &columns[..D - 1], first).0;
        }
        for j in 1..D {
            columns[j - 1] = points[j] - points[0];
        }
        let (behind, normal, rounding) = affine(&points[0], &columns[..D - 1], 0);
        facets[D] = behind;
        // The sum of the facet determinants, which has the sign of each of them inside.
        let slope = normal.dot(&along);
        let rounding = rounding * norm1(&along) + ROUNDING * reach(&normal, &along.map(f64::abs));
        let footprint = |sign: f64, certain: bool| {
            let (nearness, relative) =
                if certain { (behind.scaled(-1.0 / slope), 2.0 * rounding / slope.abs()) } else { (UNKNOWN, 0.0) };
            Some(Self::cut(facets.map(|f| f.scaled(sign)), D + 1, nearness, relative, certain, lens))
        };
        if slope.abs() > 2.0 * rounding {
            [footprint(slope.signum(), true), None]
        } else {
            [footprint(1.0, false), footprint(-1.0, false)]
        }
    }

    fn cut<const D: usize>(
        facets: [Affine; 5],
        count: usize,
        nearness: Affine,
        relative: f64,
        certain: bool,
        lens: &Lens<D>,
    ) -> Self {
        let mut cuts = [Cut::Whole; 5];
        for (cut, f) in cuts.iter_mut().zip(&facets).take(count) {
            let slope = f.steps[0];
            // Less change along a whole row than the bound has to spare.
            if slope.abs() * lens.width as f64 <= f.bound * (1.0 / 16.0) || !(1.0 / slope).is_finite() {
                continue;
            }
            let scale = -1.0 / slope;
            let place = Place {
                start: f.start * scale,
                steps: [f.steps[1] * scale, f.steps[2] * scale],
                slack: f.bound * scale.abs(),
            };
            *cut = if slope > 0.0 { Cut::From(place) } else { Cut::To(place) };
        }
        // What rounding to f32 takes, also below the smallest of its normal numbers.
        let relative = relative + ROUNDED;
        let nearness = Affine { bound: nearness.bound + 1e-44, ..nearness };
        Self { facets, cuts, count, nearness, relative, certain }
    }

    /// Rows of a layer that the simplex may cover, of these rows, whatever the place along them.
    pub fn rows(&self, k: usize, rows: (usize, usize), width: usize) -> (usize, usize) {
        let (mut low, mut high) = (rows.0 as f64, rows.1 as f64 - 1.0);
        for f in &self.facets[..self.count] {
            let best = f.start + f.steps[2] * k as f64 + f.bound + (f.steps[0] * (width - 1) as f64).max(0.0);
            let slope = f.steps[1];
            let place = -best / slope;
            if slope > 0.0 {
                low = low.max(place);
            } else if slope < 0.0 {
                high = high.min(place);
            } else if best < 0.0 {
                return (0, 0);
            }
        }
        // One more on each side, for the rounding of the places.
        ((low as usize).saturating_sub(1).max(rows.0), (high.max(-2.0) as isize + 2).clamp(0, rows.1 as isize) as usize)
    }

    /// The voxels of a row, of those within this range, that the simplex covers.
    #[inline]
    pub fn span(&self, j: usize, k: usize, within: (usize, usize)) -> Span {
        let nothing = Span { outer: (0, 0), inner: (0, 0) };
        let (first, last) = (within.0 as f64, within.1 as f64 - 1.0);
        let (mut outer, mut inner) = ((first, last), (first, last));
        let (row, layer) = (j as f64, k as f64);
        for (cut, facet) in self.cuts[..self.count].iter().zip(&self.facets) {
            match cut {
                Cut::From(p) => {
                    let place = p.start + p.steps[0] * row + p.steps[1] * layer;
                    outer.0 = outer.0.max(place - p.slack);
                    inner.0 = inner.0.max(place + p.slack);
                }
                Cut::To(p) => {
                    let place = p.start + p.steps[0] * row + p.steps[1] * layer;
                    outer.1 = outer.1.min(place + p.slack);
                    inner.1 = inner.1.min(place - p.slack);
                }
                Cut::Whole => {
                    let value = facet.at_row(j, k);
                    if value < -facet.bound {
                        return nothing;
                    }
                    if value <= facet.bound {
                        inner.1 = -1.0;
                    }
                }
            }
        }
        if outer.0 > outer.1 {
            return nothing;
        }
        let outer = voxels(outer);
        let inner = if self.certain && inner.0 <= inner.1 { voxels(inner) } else { (outer.0, outer.0) };
        Span { outer, inner: if inner.0 < inner.1 { inner } else { (outer.0, outer.0) } }
    }

    /// How near it is along a row.
    #[inline]
    pub fn nearness(&self, j: usize, k: usize) -> Nearness {
        let Affine { steps, bound, .. } = self.nearness;
        Nearness { start: self.nearness.at_row(j, k), step: steps[0], bound, relative: self.relative }
    }
}

/// The whole numbers of a range whose ends are not below zero, as a range without its end.
#[inline(always)]
fn voxels((low, high): (f64, f64)) -> (usize, usize) {
    let floor = low as u32;
    let first = floor + u32::from(f64::from(floor) < low);
    let end = if high < 0.0 { 0 } else { high as u32 + 1 };
    (first as usize, end.max(first) as usize)
}
