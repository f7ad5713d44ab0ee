//! Ambient occlusion in screen space: from the depth and the normals of an image alone, without tracing a ray
//! (Mittring 2007; Bavoil, Sainz and Dimitrov 2008; Jimenez et al. 2016).
//!
//! A point looks along lines of the image that start at its voxel. Each is the image of half a slice, a half-plane through
//! the line of sight; what voxels on it show lies at some angle from the direction to the eye, and hides the sectors of the
//! slice between that and where it is thought to end, a `thickness` further from the eye (`sectors`). An image of a 4D
//! scene has two dimensions more than a line, one of a 3D scene one more; the weight of angles follows from that, and the
//! code is the same.
//!
//! Directional occlusion (Ritschel, Grosch and Seidel 2009) comes from the same looks: the sectors that are left open say where
//! the sky is seen (`bearings`), and each look that hides sectors which nothing hid before brings the light of what it sees, one
//! bounce. That light, and all columns of pictures, are made in `pass`.
//!
//! It sees what the image shows and nothing else: nothing outside of the image, nothing behind the first surface, and how
//! thick things are it has to guess. Every voxel may look at every other, so it needs the depth of the whole image at once,
//! 4 bytes a voxel; all else is made slab by slab.

mod bearings;
mod pass;
mod patterns;
mod sectors;

use rayon::prelude::*;

use self::bearings::Bearings;
pub(super) use self::pass::{COLUMNS, occlude, radiosity};
use self::patterns::{Cut, Patterns};
use self::sectors::{Hidden, Side, Slice};
use super::Camera;
use crate::geometry::{Frame, Vector, narrow, widen};
use crate::occlusion::open_vector;
use crate::volume::Grid;

/// What a point must rise above another's tangent plane to hide anything from it, as a sine: more than rounding does.
const LEAST_RISE: f32 = 1e-3;
/// How thick things are taken to be where nothing else is said, as a part of the extent of all that is seen. Found on two
/// scenes, where errors are least at 0.32 and 0.48 and hardly more between.
const THICK: f32 = 0.36;

/// The light that a side sends which the eye does not see, as a share of that of the side that it sees. Found on two scenes, on one
/// of which a half is best, on the other nine tenths.
const UNSEEN: f32 = 0.7;

/// How screen space is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenSpace {
    /// Slices through each point, at least 1.
    pub slices: usize,
    /// Looks along either side of a slice, at least 1.
    pub steps: usize,
    /// How far things go on behind what is seen of them.
    pub thickness: Thickness,
    /// Occluders further away than this don't count, in the scene's units.
    pub max_distance: f32,
}

/// How far things go on behind what is seen of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thickness {
    /// A part of the extent of all that is seen: of the mean side of the box around it.
    Auto,
    /// So far, in the scene's units; infinite means plain horizons.
    Given(f32),
}

impl Default for ScreenSpace {
    fn default() -> Self {
        Self { slices: 32, steps: 16, thickness: Thickness::Auto, max_distance: f32::INFINITY }
    }
}

/// An image whose voxels can be asked for the ambient occlusion at the points that they show.
///
/// Points are in the camera's frame (right, up, over, back), with the eye at the origin.
#[derive(Clone, Debug)]
pub struct DepthImage<const D: usize> {
    camera: Camera<D>,
    dimensions: [usize; 3],
    /// Where in the image the first voxel is, and the steps between voxels.
    origin: [f32; 3],
    spacing: [f32; 3],
    /// How far before the eye along the line of sight the point is that each voxel's centre sees; infinite if none.
    ahead: Vec<f32>,
    settings: ScreenSpace,
    thickness: f32,
    patterns: Patterns<D>,
    /// Only if directions are looked for.
    bearings: Option<Bearings<D>>,
    /// The light that leaves what each voxel's centre sees, if it is known, and the normal there in the camera's frame.
    light: Vec<([f32; 3], Vector<D>)>,
}

/// What an image says of a point that it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen<const D: usize> {
    /// Ambient occlusion, 1 is open.
    pub open: f32,
    /// The vector b, in the scene's own coordinates: the integral of the open directions, weighted as ambient occlusion weights
    /// them. Zero unless directions are looked for.
    pub vector: Vector<D>,
    /// The light of other surfaces, red, green and blue, where that of an open sky is 1; black unless the image knows it.
    pub bounced: [f32; 3],
}

impl<const D: usize> DepthImage<D> {
    /// An image of these distances from the eye, one a voxel, as the array `depth` has them; what is not above 0, or
    /// infinite, or no number means that the voxel shows nothing. The grid tells where in the camera's image voxels are.
    ///
    /// # Panics
    /// If there are not as many distances as voxels.
    pub fn new(camera: &Camera<D>, grid: &Grid, mut distances: Vec<f32>, settings: ScreenSpace) -> Self {
        assert_eq!(distances.len(), grid.len(), "a distance a voxel");
        let mut image = Self {
            camera: camera.clone(),
            dimensions: grid.dimensions,
            origin: grid.origin.map(|x| x as f32),
            spacing: grid.spacing.map(|x| x as f32),
            ahead: Vec::new(),
            settings,
            thickness: f32::INFINITY,
            patterns: Patterns::new(settings.slices.max(1)),
            bearings: None,
            light: Vec::new(),
        };
        distances.par_iter_mut().enumerate().with_min_len(4096).for_each(|(n, distance)| {
            let direction = image.along(grid.index(n)).norm();
            // Beyond 1e18 squares are infinite.
            let shown = *distance > 0.0 && *distance < 1e18;
            let parallel = image.camera.is_parallel();
            *distance = if !shown {
                f32::INFINITY
            } else if parallel {
                *distance
            } else {
                *distance / direction
            };
        });
        image.ahead = distances;
        image.thickness = match settings.thickness {
            Thickness::Auto => THICK * image.extent(),
            Thickness::Given(thickness) => thickness,
        };
        image
    }

    /// What things are taken to be thick.
    pub fn thickness(&self) -> f32 {
        self.thickness
    }

    /// Whether the `n`-th voxel shows anything.
    pub fn shows(&self, n: usize) -> bool {
        self.ahead[n] < f32::INFINITY
    }

    /// Looks for the vector b too.
    pub fn directed(mut self) -> Self {
        self.bearings.get_or_insert_with(Bearings::new);
        self
    }

    /// Looks for the light of other surfaces too, given the light that leaves what each voxel's centre sees, where that of an
    /// open sky is 1, and the surface's normal there, which faces the eye.
    ///
    /// # Panics
    /// If there are not as many numbers as voxels.
    pub fn lit(mut self, mut light: Vec<([f32; 3], Vector<D>)>) -> Self {
        assert_eq!(light.len(), self.ahead.len(), "a light a voxel");
        let camera = &self.camera;
        light.par_iter_mut().for_each(|(_, normal)| *normal = narrow(&camera.to_frame(&widen(normal))));
        self.light = light;
        self
    }

    /// What the image says of a point on the surface, which the voxel at `index` shows, with this unit normal, which faces the
    /// eye, both in the scene's own coordinates.
    pub fn seen(&self, point: &Vector<D>, normal: &Vector<D>, index: [usize; 3]) -> Seen<D> {
        let point = narrow(&self.camera.to_frame(&(widen(point) - self.camera.eye())));
        self.look_around(&point, &narrow(&self.camera.to_frame(&widen(normal))), index)
    }

    /// The same of the point that the voxel's centre sees; none if that is nothing. The normal need not have length 1, nor
    /// face the eye; none as well if it has no direction.
    pub fn seen_at(&self, normal: &Vector<D>, index: [usize; 3]) -> Option<Seen<D>> {
        let (point, _) = self.shown(index)?;
        let normal = narrow(&self.camera.to_frame(&widen(normal)));
        let length = normal.norm();
        let unit = normal / length;
        let usable = length > 0.0 && unit.iter().all(|x| x.is_finite());
        let towards = unit.dot(&self.to_eye(&point)) >= 0.0;
        usable.then(|| self.look_around(&point, &if towards { unit } else { -unit }, index))
    }

    /// Where the ray through a voxel's centre goes, with length 1 along the line of sight; in a parallel projection where it
    /// starts.
    fn along(&self, index: [usize; 3]) -> Vector<D> {
        let across = |a: usize| self.origin[a] + index[a] as f32 * self.spacing[a];
        let ahead = if self.camera.is_parallel() { 0.0 } else { -1.0 };
        Vector::from_fn(|r, _| if r < D - 1 { across(r) } else { ahead })
    }

    /// The point that a voxel's centre sees, and the voxel's number.
    #[inline]
    fn shown(&self, index: [usize; 3]) -> Option<(Vector<D>, usize)> {
        let [width, height, _] = self.dimensions;
        let number = index[0] + width * (index[1] + height * index[2]);
        let ahead = self.ahead[number];
        if ahead == f32::INFINITY {
            return None;
        }
        let mut point = self.along(index);
        if self.camera.is_parallel() {
            point[D - 1] = -ahead;
        } else {
            point *= ahead;
        }
        Some((point, number))
    }

    /// The direction from a point to the eye.
    fn to_eye(&self, point: &Vector<D>) -> Vector<D> {
        if self.camera.is_parallel() { Vector::from_fn(|r, _| f32::from(r == D - 1)) } else { -point / point.norm() }
    }

    /// The side of the cube that is as large as the box around all that is seen.
    fn extent(&self) -> f32 {
        let [width, height, _] = self.dimensions;
        let empty = || (Vector::<D>::repeat(f32::INFINITY), Vector::<D>::repeat(f32::NEG_INFINITY));
        let grow = |(low, high): (Vector<D>, Vector<D>), n: usize| match self.shown([
            n % width,
            n / width % height,
            n / width / height,
        ]) {
            Some((point, _)) => (low.inf(&point), high.sup(&point)),
            None => (low, high),
        };
        let join = |a: (Vector<D>, Vector<D>), b: (Vector<D>, Vector<D>)| (a.0.inf(&b.0), a.1.sup(&b.1));
        let all = (0..self.ahead.len()).into_par_iter().with_min_len(4096);
        let (low, high) = all.fold(empty, grow).reduce(empty, join);
        let volume: f64 = (high - low).iter().map(|&side| f64::from(side.max(0.0))).product();
        libm::pow(volume, 1.0 / D as f64) as f32
    }

    /// What is seen from a point with this normal, both in the camera's frame.
    fn look_around(&self, point: &Vector<D>, normal: &Vector<D>, index: [usize; 3]) -> Seen<D> {
        let to_eye = self.to_eye(point);
        let frame = Frame::new(&to_eye);
        let towards = normal.dot(&to_eye);
        let (mut open, mut all) = (0.0, 0.0);
        let (mut vector, mut bounced) = (Vector::<D>::zeros(), [0.0; 3]);
        for cut in self.patterns.of(index) {
            let across = frame.to_world(&cut.across);
            let Some(slice) = Slice::<D>::new(towards, normal.dot(&across)) else { continue };
            let look = Look { point, normal, to_eye: &to_eye, slice: &slice, cut };
            let mut found = Found::default();
            let (start, step, reach) = self.line(point, &across);
            for side in [Side::Ahead, Side::Behind] {
                let step = if side == Side::Ahead { step } else { step.map(|x| -x) };
                self.look(&look, side, start, step, reach, &mut found);
            }
            open += slice.weight * found.hidden.open();
            all += slice.weight;
            if let Some(bearings) = &self.bearings {
                let [along, beside] = bearings.open(&slice, found.hidden);
                vector += (to_eye * along + across * beside) * slice.weight;
            }
            (0..3).for_each(|c| bounced[c] += slice.weight * found.light[c]);
        }
        if all > 0.0 {
            let vector =
                self.bearings.as_ref().map_or_else(Vector::zeros, |_| self.camera.out_of_frame(&(vector / all)));
            return Seen { open: (open / all).clamp(0.0, 1.0), vector, bounced: bounced.map(|c| c / all) };
        }
        let everywhere = || self.camera.out_of_frame(&narrow(&open_vector(&widen(normal))));
        let vector = self.bearings.as_ref().map_or_else(Vector::zeros, |_| everywhere());
        Seen { open: 1.0, vector, bounced: [0.0; 3] }
    }

    /// The line in the image along which a slice lies: the point's own place in voxels, the step to the next voxel, and how
    /// many steps may matter.
    fn line(&self, point: &Vector<D>, across: &Vector<D>) -> ([f32; 3], [f32; 3], f32) {
        let before = -point[D - 1];
        let (mut start, mut step, mut square) = ([0.0; 3], [0.0; 3], 0.0);
        for a in 0..D - 1 {
            let (place, change) = if self.camera.is_parallel() {
                (point[a], across[a])
            } else {
                (point[a] / before, (across[a] * before + point[a] * across[D - 1]) / (before * before))
            };
            start[a] = (place - self.origin[a]) / self.spacing[a];
            step[a] = change / self.spacing[a];
            square += step[a] * step[a];
        }
        // Voxels a unit of length at the point; what is nearer to the eye moves faster.
        let rate = square.sqrt();
        let nearest = if self.camera.is_parallel() { 1.0 } else { 1.0 - self.settings.max_distance / before };
        let reach = if nearest > 0.0 { rate * self.settings.max_distance / nearest } else { f32::INFINITY };
        (start, step.map(|x| x / rate), reach)
    }

    /// Looks along one side of a slice.
    #[inline]
    fn look(&self, look: &Look<D>, side: Side, start: [f32; 3], step: [f32; 3], reach: f32, found: &mut Found) {
        let furthest = self.furthest(start, step).min(reach);
        // A line without a direction, as that of a point at the eye.
        if furthest.is_nan() || furthest < 1.0 {
            return;
        }
        let jitter = look.cut.jitter[usize::from(side == Side::Behind)];
        let most = self.settings.max_distance * self.settings.max_distance;
        for n in 0..self.settings.steps {
            // Denser where it is near.
            let part = (n as f32 + jitter) / self.settings.steps as f32;
            let at = 1.0 + (furthest - 1.0) * part * part;
            let index = std::array::from_fn(|a| ((start[a] + step[a] * at + 0.5) as usize).min(self.dimensions[a] - 1));
            let Some((seen, number)) = self.shown(index) else { continue };
            let offset = seen - look.point;
            let (square, rise) = (offset.norm_squared(), offset.dot(look.normal));
            if rise <= LEAST_RISE * square.sqrt() || square > most {
                continue;
            }
            let cosine = |offset: &Vector<D>| offset.dot(look.to_eye) / offset.norm();
            let front = look.slice.share(side, cosine(&offset));
            let end = if self.thickness == f32::INFINITY {
                -1.0
            } else {
                cosine(&(offset - self.to_eye(&seen) * self.thickness))
            };
            let new = found.hidden.hide(front, look.slice.share(side, end), look.cut.dither);
            if let (Some((light, normal)), true) = (self.light.get(number), new > 0.0) {
                let share = if normal.dot(&offset) < 0.0 { new } else { UNSEEN * new };
                (0..3).for_each(|c| found.light[c] += share * light[c]);
            }
        }
    }

    /// How many steps lead to the last voxel of the image.
    fn furthest(&self, start: [f32; 3], step: [f32; 3]) -> f32 {
        let mut furthest = f32::INFINITY;
        for a in 0..D - 1 {
            let end = self.dimensions[a] as f32 - 0.5;
            if step[a] > 1e-6 {
                furthest = furthest.min((end - start[a]) / step[a]);
            } else if step[a] < -1e-6 {
                furthest = furthest.min((-0.5 - start[a]) / step[a]);
            }
        }
        if furthest.is_finite() { furthest } else { f32::NAN }
    }
}

/// What was found in a slice.
#[derive(Default)]
struct Found {
    hidden: Hidden,
    /// The light of what hides it, by its share of the slice's weight.
    light: [f32; 3],
}

/// What a slice looks from.
struct Look<'l, const D: usize> {
    point: &'l Vector<D>,
    normal: &'l Vector<D>,
    to_eye: &'l Vector<D>,
    slice: &'l Slice<D>,
    cut: &'l Cut<D>,
}

#[cfg(test)]
mod tests;
