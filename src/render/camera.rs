//! The camera: where voxel centres are, and which ray goes through them.
//!
//! The camera's frame is (right, up, over, back), after Hollasch, *Four-Space Visualization of 4D Objects*, 1991, with
//! signs chosen so that it is (x, y, z, w) for the default camera, which stands at (0, 0, 0, 1) and looks along -w. In
//! 3D there is no `over`. No axis of the image is mirrored: its x, y and z grow along right, up and over.
//!
//! The image lies at distance 1 before the eye. It covers y and z in +-tan(f/2), for a field of view f, and x in
//! +-W/H times that; for a parallel projection +-height/2. Voxel (i, j, k) is seen through its centre.

use thiserror::Error;

use crate::geometry::{Dimension, Ray, Vector, Vector64, cross, narrow, widen};
use crate::mesh::Viewpoint;
use crate::volume::Grid;

/// How rays spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// From the eye, within this full angle in degrees along y and z; between 0 and 180.
    Perspective {
        /// The angle.
        field_of_view: f64,
    },
    /// All in one direction, from the hyperplane through the eye.
    Parallel {
        /// Extent of the image along y and z, in the scene's units; above 0.
        height: f64,
    },
}

/// A camera as it is described.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View<const D: usize> {
    /// How rays spread.
    pub projection: Projection,
    /// Where it stands.
    pub eye: Vector64<D>,
    /// The point it looks at.
    pub target: Vector64<D>,
    /// What is up in the image, y; made orthogonal to the line of sight and to `over`.
    pub up: Vector64<D>,
    /// What the image's z runs along in 4D, made orthogonal to the line of sight; not used in 3D.
    pub over: Vector64<D>,
}

impl<const D: usize> Default for View<D> {
    fn default() -> Self {
        let axis = |i: usize| Vector64::from_fn(|r, _| if r == i { 1.0 } else { 0.0 });
        Self {
            projection: Projection::Perspective { field_of_view: 90.0 },
            eye: axis(D - 1),
            target: Vector64::zeros(),
            up: axis(1),
            over: axis(2),
        }
    }
}

/// Why a camera has no frame.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[allow(missing_docs)]
pub enum CameraError {
    #[error("the eye and the target are the same point")]
    NoDirection,
    #[error("`over` is parallel to the line of sight; choose one that isn't")]
    OverAlongView,
    #[error(
        "`up` lies in the plane of the line of sight and `over`, or along the line of sight; choose one that doesn't"
    )]
    UpAlongView,
}

/// A camera ready to make rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera<const D: usize> {
    projection: Projection,
    eye: Vector64<D>,
    right: Vector64<D>,
    up: Vector64<D>,
    over: Vector64<D>,
    back: Vector64<D>,
}

/// What the rays of an image have in common.
#[derive(Clone, Debug)]
pub(super) enum Rays<const D: usize> {
    /// They start here.
    From(Vector<D>),
    /// They go there.
    Along(Vector<D>),
}

/// All rays of an image: what they share, and what is affine in the voxel (i, j, k), namely their direction, not
/// normalised, or their origin. A ray's own direction and origin are that rounded to `f32`.
#[derive(Clone, Debug)]
pub(super) struct Lens<const D: usize> {
    /// What they share.
    pub rays: Rays<D>,
    /// The direction or origin of voxel (0, 0, 0).
    pub start: Vector64<D>,
    /// What is added for each step along x, y and z.
    pub steps: [Vector64<D>; 3],
    /// No component is larger anywhere in the image, nor any term of it.
    pub reach: Vector64<D>,
    /// Voxels along x.
    pub width: usize,
}

/// `v` without its parts along the unit vectors, at length 1; none if little more than rounding is left.
fn orthogonal<const D: usize>(v: &Vector64<D>, to: &[Vector64<D>]) -> Option<Vector64<D>> {
    let length = v.norm();
    let mut rest = v / length;
    // Twice is enough (Kahan and Parlett): the second pass removes what rounding left in the first.
    for _ in 0..2 {
        for u in to {
            rest -= u * u.dot(&rest);
        }
    }
    (length > 0.0 && rest.norm() > 1e-9).then(|| rest.normalize())
}

/// Whether an image has this axis: that of a 3D camera has no third, though its grid has one with a single layer.
fn has_image_axis<const D: usize>(axis: usize) -> bool {
    axis < D - 1
}

impl<const D: usize> Camera<D> {
    /// Finds the frame.
    ///
    /// # Errors
    /// If eye, target, up and over don't span one.
    pub fn new(view: &View<D>) -> Result<Self, CameraError> {
        let back = orthogonal(&(view.eye - view.target), &[]).ok_or(CameraError::NoDirection)?;
        let (over, up, right);
        match Dimension::of::<D>() {
            Dimension::Three => {
                over = Vector64::zeros();
                up = orthogonal(&view.up, &[back]).ok_or(CameraError::UpAlongView)?;
                right = cross(&[up, back]);
            }
            Dimension::Four => {
                over = orthogonal(&view.over, &[back]).ok_or(CameraError::OverAlongView)?;
                up = orthogonal(&view.up, &[back, over]).ok_or(CameraError::UpAlongView)?;
                right = cross(&[up, over, back]);
            }
        }
        // The eye is where rays start, so it is rounded like the geometry.
        Ok(Self { projection: view.projection, eye: widen(&narrow(&view.eye)), right, up, over, back })
    }

    /// Half the extent of the image along y and z.
    fn half_height(&self) -> f64 {
        match self.projection {
            // Exact for the default; elsewhere by a tangent that is the same on every platform.
            Projection::Perspective { field_of_view: 90.0 } => 1.0,
            Projection::Perspective { field_of_view } => libm::tan(field_of_view.to_radians() / 2.0),
            Projection::Parallel { height } => height / 2.0,
        }
    }

    /// The grid of voxel centres of an image of these dimensions. One of a 3D camera has one layer, at z = 0.
    pub fn grid(&self, dimensions: [usize; 3]) -> Grid {
        let half = self.half_height();
        let half_extent = [half * dimensions[0] as f64 / dimensions[1] as f64, half, half];
        let mut spacing: [f64; 3] = std::array::from_fn(|a| 2.0 * half_extent[a] / dimensions[a] as f64);
        let mut origin: [f64; 3] = std::array::from_fn(|a| -half_extent[a] + 0.5 * spacing[a]);
        if !has_image_axis::<D>(2) {
            (spacing[2], origin[2]) = (spacing[1], 0.0);
        }
        Grid { dimensions, origin, spacing }
    }

    /// The ray through a point of the image; its direction has length 1 up to rounding.
    #[inline]
    pub fn ray(&self, image: [f64; 3]) -> Ray<D> {
        let across = self.right * image[0] + self.up * image[1] + self.over * image[2];
        match self.projection {
            Projection::Perspective { .. } => Ray::new(narrow(&self.eye), narrow(&(across - self.back).normalize())),
            Projection::Parallel { .. } => Ray::new(narrow(&(self.eye + across)), narrow(&-self.back)),
        }
    }

    /// The ray through the centre of voxel (i, j, k).
    ///
    /// Centres are computed from both ends of the image, so that those of opposite voxels are exact opposites.
    #[inline]
    pub fn voxel_ray(&self, grid: &Grid, index: [usize; 3]) -> Ray<D> {
        self.ray(std::array::from_fn(|a| {
            if !has_image_axis::<D>(a) {
                return 0.0;
            }
            let steps = (2 * index[a] + 1) as f64 - grid.dimensions[a] as f64;
            0.5 * grid.spacing[a] * steps
        }))
    }

    /// All rays of an image at once, as functions of the voxel.
    pub(super) fn lens(&self, grid: &Grid) -> Lens<D> {
        let half: [f64; 3] = std::array::from_fn(|a| {
            let extent = grid.spacing[a] * (grid.dimensions[a] - 1) as f64;
            if has_image_axis::<D>(a) { 0.5 * extent } else { 0.0 }
        });
        let axes = [self.right, self.up, self.over];
        let (rays, base) = match self.projection {
            Projection::Perspective { .. } => (Rays::From(narrow(&self.eye)), -self.back),
            Projection::Parallel { .. } => {
                let ray = Ray::new(narrow(&self.eye), narrow(&-self.back));
                (Rays::Along(ray.direction), self.eye)
            }
        };
        let start = (0..3).fold(base, |sum, a| sum - axes[a] * half[a]);
        let reach = (0..3).fold(base.map(f64::abs), |sum, a| sum + axes[a].map(f64::abs) * half[a]);
        // What becomes zero because it is small beside the rest, or beside every f32, is told as well.
        let small = 1e-20 * reach.sum() + 1e-37;
        Lens {
            rays,
            start,
            steps: std::array::from_fn(|a| axes[a] * grid.spacing[a] * f64::from(has_image_axis::<D>(a))),
            reach: reach.add_scalar(small),
            width: grid.dimensions[0],
        }
    }

    /// Where a point of the scene is seen in the image, and how far before the eye it lies along the line of sight.
    /// The image point means nothing where that distance isn't above zero.
    pub fn project(&self, point: &Vector<D>) -> ([f64; 3], f64) {
        let offset = widen(point) - self.eye;
        let distance = -self.back.dot(&offset);
        let scale = match self.projection {
            Projection::Perspective { .. } => 1.0 / distance,
            Projection::Parallel { .. } => 1.0,
        };
        ([&self.right, &self.up, &self.over].map(|axis| axis.dot(&offset) * scale), distance)
    }

    /// How rays spread.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Where it stands.
    pub(super) fn eye(&self) -> &Vector64<D> {
        &self.eye
    }

    /// A direction by its parts along the axes of the camera's frame: right, up, over (in 4D), back.
    pub(super) fn to_frame(&self, direction: &Vector64<D>) -> Vector64<D> {
        let axes = self.axes();
        Vector64::from_fn(|r, _| axes[r].dot(direction))
    }

    /// The axes of the camera's frame: right, up, over (in 4D), back.
    pub fn axes(&self) -> [Vector64<D>; D] {
        let all = match Dimension::of::<D>() {
            Dimension::Three => [self.right, self.up, self.back, self.back],
            Dimension::Four => [self.right, self.up, self.over, self.back],
        };
        std::array::from_fn(|axis| all[axis])
    }

    /// The direction that has these parts along the axes of the camera's frame.
    pub(super) fn out_of_frame(&self, parts: &Vector<D>) -> Vector<D> {
        let axes = self.axes();
        narrow(&(0..D).fold(Vector64::zeros(), |sum, r| sum + axes[r] * f64::from(parts[r])))
    }

    /// Whether rays are parallel.
    pub(super) fn is_parallel(&self) -> bool {
        matches!(self.projection, Projection::Parallel { .. })
    }

    /// How far a point is from the eye, by the sum over the axes.
    pub(super) fn offset(&self, point: &Vector<D>) -> f64 {
        (widen(point) - self.eye).iter().map(|x| x.abs()).sum()
    }

    /// What surfaces face if they are to face the eye.
    pub fn viewpoint(&self) -> Viewpoint<D> {
        match self.projection {
            Projection::Perspective { .. } => Viewpoint::Eye(narrow(&self.eye)),
            Projection::Parallel { .. } => {
                Viewpoint::Parallel { direction: narrow(&self.back), middle: narrow(&self.eye) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis<const D: usize>(i: usize) -> Vector64<D> {
        Vector64::from_fn(|r, _| if r == i { 1.0 } else { 0.0 })
    }

    fn frames<const D: usize>() {
        let camera = Camera::<D>::new(&View::default()).unwrap();
        assert_eq!(camera.back, axis::<D>(D - 1));
        assert_eq!((camera.right, camera.up), (axis::<D>(0), axis::<D>(1)));
        let over = [axis::<D>(2), Vector64::zeros()];
        assert_eq!(camera.over, over[Dimension::of::<D>().pick(1, 0)]);
        // Any camera's frame is orthonormal and turns as the default one does.
        let view = View {
            eye: Vector64::from_fn(|r, _| [3.0, -1.0, 2.0, 0.5][r]),
            target: Vector64::from_fn(|r, _| [0.1, 0.2, -0.3, 0.4][r]),
            ..View::default()
        };
        let camera = Camera::<D>::new(&view).unwrap();
        let mut frame = [camera.right, camera.up, camera.over, camera.back];
        if D == 3 {
            frame[2] = camera.back;
        }
        for (i, a) in frame[..D].iter().enumerate() {
            for (j, b) in frame[..D].iter().enumerate() {
                assert!((a.dot(b) - f64::from(i == j)).abs() < 1e-14);
            }
        }
        let frame: [Vector64<D>; D] = std::array::from_fn(|i| frame[i]);
        assert!((crate::geometry::determinant(&frame) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        frames::<3>();
        frames::<4>();
    }

    fn projections<const D: usize>(projection: Projection) {
        let view = View {
            projection,
            eye: Vector64::from_fn(|r, _| [0.5, -0.25, 0.125, 2.0][r]),
            target: Vector64::from_fn(|r, _| [0.0, 0.5, -1.0, -1.0][r]),
            ..View::default()
        };
        let camera = Camera::<D>::new(&view).unwrap();
        let grid = camera.grid([6, 4, if D == 4 { 5 } else { 1 }]);
        for k in 0..grid.dimensions[2] {
            for (i, j) in [(0, 0), (5, 3), (2, 1), (3, 0)] {
                let ray = camera.voxel_ray(&grid, [i, j, k]);
                assert!((ray.direction.norm() - 1.0).abs() < 1e-6);
                let (image, distance) = camera.project(&narrow(&ray.at(2.5)));
                assert!(distance > 0.0);
                let centre = grid.point([i, j, k]);
                assert!((0..D - 1).all(|a| (image[a] - centre[a]).abs() < 1e-5), "{image:?} {centre:?}");
            }
        }
    }

    #[test]
    fn what_a_ray_passes_is_projected_to_its_voxel() {
        for projection in [Projection::Perspective { field_of_view: 50.0 }, Projection::Parallel { height: 3.0 }] {
            projections::<3>(projection);
            projections::<4>(projection);
        }
    }

    #[test]
    fn default_image_is_the_hyperplane_w_0() {
        let camera = Camera::<4>::new(&View::default()).unwrap();
        let grid = camera.grid([100, 50, 2]);
        assert_eq!(grid.spacing, [0.04, 0.04, 1.0]);
        assert_eq!(grid.origin, [-1.98, -0.98, -0.5]);
        let (image, distance) = camera.project(&Vector::from([0.5, -0.25, 0.75, 0.0]));
        assert_eq!((image, distance), ([0.5, -0.25, 0.75], 1.0));
        let (image, _) = camera.project(&Vector::from([0.5, -0.25, 0.75, -1.0]));
        assert_eq!(image, [0.25, -0.125, 0.375]);
    }

    #[test]
    fn degenerate_cameras_are_refused() {
        let view = View::<4>::default();
        assert_eq!(Camera::new(&View { target: view.eye, ..view }), Err(CameraError::NoDirection));
        assert_eq!(Camera::new(&View { over: axis(3) * -2.0, ..view }), Err(CameraError::OverAlongView));
        assert_eq!(Camera::new(&View { up: axis(2) + axis(3), ..view }), Err(CameraError::UpAlongView));
        assert_eq!(Camera::new(&View { up: Vector64::zeros(), ..view }), Err(CameraError::UpAlongView));
    }
}
