//! Convex regions of directions within a plane through p: arcs of a circle in 3D, spherical polygons in 4D.
//!
//! A region is the list of its corners, anticlockwise as seen with the plane's normal in front: a closed ring for
//! D = 4, a chain from one end to the other for D = 3. Neighbours in the list are less than about 105 degrees apart,
//! longer edges having corners put on them, so that what is interpolated between two of them keeps its digits.
//!
//! Tolerances appear only where what they leave out is provably small: a corner within [`ON_LINE`] of a line counts
//! as lying on it, which moves a boundary by no more than that, so each cut misplaces an area below 2 pi `ON_LINE`.

use super::plane::Flat;
use crate::geometry::Dimension;

/// A distance (a sine) from a line below which a direction counts as lying on it: some roundings of unit vectors.
pub(super) const ON_LINE: f64 = 2e-15;

/// The cosine below which the angle between neighbouring corners counts as long.
const LONG: f64 = -0.25;

/// Whether the corners of a region are a ring: in 3D they are a chain, which has two ends.
#[inline(always)]
pub(super) const fn closes<const D: usize>() -> bool {
    match Dimension::of::<D>() {
        Dimension::Three => false,
        Dimension::Four => true,
    }
}

/// Whether the edge between two corners is so long that a corner is to be put on it.
#[inline]
pub(super) fn is_long(a: &Flat, b: &Flat) -> bool {
    a.dot(b) < LONG
}

/// How a region lies to another one that is to be taken out of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Relation {
    Apart,
    Within,
    Overlapping,
}

/// A convex region.
#[derive(Clone, Debug, Default)]
pub(super) struct Region<const D: usize> {
    corners: Vec<Flat>,
}

impl<const D: usize> Region<D> {
    /// The region with these corners, which turn anticlockwise.
    pub fn new(corners: Vec<Flat>) -> Self {
        let mut region = Self { corners };
        region.shorten_edges();
        region
    }

    /// The whole circle or sphere of directions, cut into its 2^(D-1) orthants.
    pub fn whole() -> impl Iterator<Item = Self> {
        let axis = |i: usize, sign: bool| {
            let mut axis = Flat::zeros();
            axis[i] = if sign { -1.0 } else { 1.0 };
            axis
        };
        (0..1usize << (D - 1)).map(move |orthant| {
            let mut corners: Vec<Flat> = (0..D - 1).map(|i| axis(i, orthant >> i & 1 == 1)).collect();
            if orthant.count_ones() % 2 == 1 {
                corners.swap(0, 1);
            }
            Self { corners }
        })
    }

    /// Pairs of neighbouring corners, in order.
    pub fn edges(&self) -> impl Iterator<Item = (Flat, Flat)> + '_ {
        let count = self.corners.len() - usize::from(!closes::<D>());
        (0..count).map(|i| (self.corners[i], self.corners[(i + 1) % self.corners.len()]))
    }

    /// Whether there are too few corners to enclose anything.
    pub fn is_flat(&self) -> bool {
        self.corners.len() < D - 1
    }

    /// Whether this is nearly half of all directions, in 4D.
    pub fn is_nearly_half(&self) -> bool {
        closes::<D>() && self.corners.len() > 3 && self.measure() > 1.5 * std::f64::consts::PI
    }

    fn shorten_edges(&mut self) {
        if self.is_flat() || self.edges().all(|(a, b)| !is_long(&a, &b)) {
            return;
        }
        let edges: Vec<_> = self.edges().collect();
        let last = *self.corners.last().expect("a region that is not flat has corners");
        self.corners.clear();
        for (a, b) in edges {
            self.corners.push(a);
            if is_long(&a, &b) {
                self.corners.push((a + b).normalize());
            }
        }
        if !closes::<D>() {
            self.corners.push(last);
        }
    }

    /// The solid angle: of an arc its angle, of a polygon the sum of a fan of triangles (Van Oosterom, Strackee 1983).
    pub fn measure(&self) -> f64 {
        if self.is_flat() {
            return 0.0;
        }
        if !closes::<D>() {
            return self.edges().map(|(a, b)| a.cross(&b).norm().atan2(a.dot(&b))).sum();
        }
        let a = self.fan_centre();
        self.edges()
            .map(|(b, c)| {
                // The corners turn anticlockwise: below zero is rounding, and would turn half a sphere into minus it.
                let volume = a.dot(&b.cross(&c));
                let volume = if volume > 0.0 { volume } else { 0.0 };
                2.0 * volume.atan2(1.0 + a.dot(&b) + b.dot(&c) + c.dot(&a))
            })
            .sum()
    }

    /// A point of the boundary that is not opposite to any corner, to fan triangles from: the first corner if it will
    /// do, else the best of the corners and the middles of the edges.
    fn fan_centre(&self) -> Flat {
        let nearness = |centre: &Flat| self.corners.iter().map(|c| c.dot(centre)).fold(1.0, f64::min);
        let first = self.corners[0];
        if nearness(&first) > -0.9 {
            return first;
        }
        let candidates = self.edges().flat_map(|(a, b)| [a, (a + b).normalize()]);
        candidates.max_by(|a, b| nearness(a).total_cmp(&nearness(b))).unwrap_or(first)
    }

    /// Vectors towards the inside of each bounding line, not of unit length: `v . x >= 0` for all x of the region.
    fn inward(&self) -> impl Iterator<Item = Flat> + '_ {
        let ends = if closes::<D>() { 0 } else { 2 };
        let up = Flat::new(0.0, 0.0, 1.0);
        let arc = (0..ends).map(move |end| {
            if end == 0 { up.cross(&self.corners[0]) } else { -up.cross(&self.corners[self.corners.len() - 1]) }
        });
        arc.chain(self.edges().filter(|_| closes::<D>()).map(|(a, b)| a.cross(&b)))
    }

    /// Splits the region by the line `line . x = 0`, `line` of unit length: what is behind it, and what is before it.
    /// A side on which no corner lies clear of the line is `None`.
    pub fn split(&self, line: &Flat) -> (Option<Self>, Option<Self>) {
        let distances: Vec<f64> = self
            .corners
            .iter()
            .map(|c| line.dot(c))
            .map(|distance| if distance.abs() <= ON_LINE { 0.0 } else { distance })
            .collect();
        let (any_behind, any_before) = (distances.iter().any(|&d| d < 0.0), distances.iter().any(|&d| d > 0.0));
        if !any_behind {
            return (None, any_before.then(|| self.clone()));
        }
        if !any_before {
            return (Some(self.clone()), None);
        }
        let count = self.corners.len();
        let (mut behind, mut before) = (Vec::with_capacity(count + 2), Vec::with_capacity(count + 2));
        for i in 0..count {
            let (corner, distance) = (self.corners[i], distances[i]);
            if distance <= 0.0 {
                behind.push(corner);
            }
            if distance >= 0.0 {
                before.push(corner);
            }
            let next = (i + 1) % count;
            if (closes::<D>() || next > 0) && distance * distances[next] < 0.0 {
                let crossing = (corner * distances[next].abs() + self.corners[next] * distance.abs()).normalize();
                behind.push(crossing);
                before.push(crossing);
            }
        }
        (Some(Self::cut(behind, &-line)), Some(Self::cut(before, line)))
    }

    /// A region that was cut off: the edge along the cut may be long.
    fn cut(corners: Vec<Flat>, inward: &Flat) -> Self {
        let region = Self { corners };
        let Some(at) = region.edges().position(|(a, b)| is_long(&a, &b)) else { return region };
        let mut corners = region.corners;
        let (a, b) = (corners[at], corners[(at + 1) % corners.len()]);
        corners.insert(at + 1, inward.cross(&(a - b)).normalize());
        Self { corners }
    }

    /// The line that parts the two corners farthest from each other, halfway between them.
    pub fn bisector(&self) -> Option<Flat> {
        let mut widest = (0.0, Flat::zeros());
        for (i, a) in self.corners.iter().enumerate() {
            for b in &self.corners[..i] {
                let chord = (a - b).norm_squared();
                if chord > widest.0 {
                    widest = (chord, a - b);
                }
            }
        }
        (widest.0 > 1e-12).then(|| widest.1.normalize())
    }
}

/// A convex region that is to be taken out of others: a region with its bounding lines.
#[derive(Clone, Debug)]
pub(super) struct Hole<const D: usize> {
    region: Region<D>,
    lines: Vec<Flat>,
    measure: f64,
}

impl<const D: usize> Hole<D> {
    /// The hole with these corners, which turn anticlockwise; `None` if it has no area to speak of.
    ///
    /// Three corners nearly on a line would give their short edges directions at random, by which the hole could lose
    /// much more than it gains from them: the middle one is left out, at the cost of a triangle of area below 1e-15.
    pub fn new(mut corners: Vec<Flat>) -> Option<Self> {
        if closes::<D>() {
            let mut at = 0;
            while at < corners.len() && corners.len() > 2 {
                let count = corners.len();
                let (a, b, c) = (corners[(at + count - 1) % count], corners[at], corners[(at + 1) % count]);
                if a.dot(&b.cross(&c)).abs() < 1e-15 && a.dot(&c) > 0.0 && b.dot(&(a + c)) > 0.0 {
                    corners.remove(at);
                    at = at.saturating_sub(1);
                } else {
                    at += 1;
                }
            }
        }
        let region = Region::new(corners);
        if region.is_flat() {
            return None;
        }
        let measure = region.measure();
        let lines: Vec<Flat> = region.inward().map(|line| line.normalize()).collect();
        (measure > 1e-16 && lines.iter().all(|line| line.iter().all(|x| x.is_finite()))).then_some(Self {
            region,
            lines,
            measure,
        })
    }

    /// The bounding lines, each given by the unit vector towards the inside.
    pub fn lines(&self) -> &[Flat] {
        &self.lines
    }

    /// The solid angle.
    pub fn measure(&self) -> f64 {
        self.measure
    }

    /// How a region lies to this hole.
    pub fn relation(&self, region: &Region<D>) -> Relation {
        let mut within = true;
        for line in &self.lines {
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for corner in &region.corners {
                let distance = line.dot(corner);
                least = least.min(distance);
                most = most.max(distance);
            }
            if most <= ON_LINE {
                return Relation::Apart;
            }
            within &= least >= -ON_LINE;
        }
        if within {
            return Relation::Within;
        }
        // The region's own lines may be inexact where its edges are short; the margin makes up for it.
        let parted = |line: Flat| self.region.corners.iter().all(|corner| line.dot(corner) < -ON_LINE);
        if region.inward().any(parted) { Relation::Apart } else { Relation::Overlapping }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn sphere<const D: usize>() -> f64 {
        Dimension::of::<D>().horizon_measure()
    }

    fn orthants<const D: usize>() {
        let line = Flat::new(0.48, 0.6, Dimension::of::<D>().pick(0.0, 0.64)).normalize();
        let (mut whole, mut behind, mut before) = (0.0, 0.0, 0.0);
        for orthant in Region::<D>::whole() {
            assert!((orthant.measure() - sphere::<D>() / f64::from(1 << (D - 1))).abs() < 1e-15);
            whole += orthant.measure();
            let (back, front) = orthant.split(&line);
            behind += back.map_or(0.0, |region| region.measure());
            before += front.map_or(0.0, |region| region.measure());
        }
        assert!((whole - sphere::<D>()).abs() < 1e-14);
        assert!((behind - whole / 2.0).abs() < 1e-14 && (before - whole / 2.0).abs() < 1e-14);
    }

    #[test]
    fn orthants_make_the_sphere_and_any_line_halves_it() {
        orthants::<3>();
        orthants::<4>();
    }

    #[test]
    fn half_of_all_directions_has_its_measure() {
        // Three corners on a circle, not quite: the region may be all that is inside it.
        for height in [0.0, 1e-17, 1e-9] {
            let corner = |angle: f64| Flat::new(angle.cos(), angle.sin(), height).normalize();
            let half = Region::<4>::new([0.0, 2.1, 4.2].map(corner).to_vec());
            assert!((half.measure() - 2.0 * PI).abs() < 1e-7 && half.is_nearly_half());
            let (behind, before) = half.split(&Flat::x());
            let sum = behind.unwrap().measure() + before.unwrap().measure();
            assert!((sum - half.measure()).abs() < 1e-14);
        }
    }

    #[test]
    fn relations_of_regions_and_holes() {
        let triangle = |scale: f64, x: f64| {
            let corners = [(1.0, 0.0), (-0.5, 0.8), (-0.5, -0.8)];
            corners.map(|(a, b)| Flat::new(scale * a + x, scale * b, 1.0).normalize()).to_vec()
        };
        let hole = Hole::<4>::new(triangle(0.5, 0.0)).unwrap();
        assert_eq!(hole.relation(&Region::new(triangle(0.2, 0.0))), Relation::Within);
        assert_eq!(hole.relation(&Region::new(triangle(0.5, 0.0))), Relation::Within);
        assert_eq!(hole.relation(&Region::new(triangle(0.5, 0.1))), Relation::Overlapping);
        assert_eq!(hole.relation(&Region::new(triangle(2.0, 0.0))), Relation::Overlapping);
        assert_eq!(hole.relation(&Region::new(triangle(0.1, 2.0))), Relation::Apart);
        assert_eq!(hole.lines().len(), 3);
        // A fourth corner in the middle of an edge, up to rounding, is no corner.
        let mut corners = triangle(0.5, 0.0);
        corners.insert(1, (corners[0] + corners[1]).normalize());
        assert_eq!(Hole::<4>::new(corners).unwrap().lines().len(), 3);
        assert!(Hole::<4>::new(vec![Flat::x(), Flat::x(), Flat::y()]).is_none());
    }
}
