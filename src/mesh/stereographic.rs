//! The stereographic projection: of a hypersphere to R^3, or of a sphere to a plane.
//!
//! A point is first led to the unit sphere around a centre, along its own ray, then from the pole of that sphere to the
//! hyperplane through the centre across the pole's axis. Circles on the sphere become circles, or lines where they go through
//! the pole, and angles stay what they are. What lies at the pole itself comes to infinity.
//!
//! A straight edge comes to an arc of a great circle, whose image is an arc of a circle: [`Stereographic::arc`] divides it.

use super::section::Hyperplane;
use crate::geometry::Vector64;

/// What is nearer to the pole than this, as a sine of the angle seen from the centre, is at infinity: its image would be
/// beyond 200 radii.
const NEAR: f64 = 0.01;
/// By how many radians, on the sphere and in the image, a piece of an arc may turn.
const TURN: f64 = 0.06;
/// How often an arc is halved at most.
const HALVINGS: u32 = 16;

/// A projection: a centre and a pole.
#[derive(Clone, Debug, PartialEq)]
pub struct Stereographic<const D: usize> {
    center: Vector64<D>,
    pole: Vector64<D>,
    /// Where the images are.
    plane: Hyperplane<D>,
}

/// Why something has no image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoImage {
    /// It goes through the pole.
    Pole,
    /// It goes through the centre.
    Center,
}

impl<const D: usize> Stereographic<D> {
    /// The projection of the sphere around a centre from the pole in this direction, of any length but zero; none if
    /// it is that, or not finite. Images have the coordinates of [`Hyperplane::coordinates`], in radii.
    pub fn new(center: Vector64<D>, pole: Vector64<D>) -> Option<Self> {
        let plane = Hyperplane::new(pole, 0.0)?;
        let largest = pole.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        center.iter().all(|x| x.is_finite()).then_some(())?;
        Some(Self { center, pole: (pole / largest).normalize(), plane })
    }

    /// Where a point's ray meets the unit sphere; zero at the centre.
    fn on_sphere(&self, point: &Vector64<D>) -> Vector64<D> {
        (point - self.center).try_normalize(0.0).unwrap_or_else(Vector64::zeros)
    }

    /// The image of a point.
    pub fn image(&self, point: &Vector64<D>) -> [f64; 3] {
        let on_sphere = self.on_sphere(point);
        let scale = 1.0 / (1.0 - on_sphere.dot(&self.pole));
        self.plane.coordinates(&on_sphere).map(|x| x * scale + 0.0)
    }

    /// A point with this image, as far from the centre as another.
    pub fn preimage(&self, image: [f64; 3], like: &Vector64<D>) -> Vector64<D> {
        let square: f64 = image.iter().map(|x| x * x).sum();
        let across = self.plane.point(image);
        let on_sphere = (across * 2.0 + self.pole * (square - 1.0)) / (square + 1.0);
        self.center + on_sphere * (like - self.center).norm()
    }

    /// Whether an edge or a triangle with these ends has an image.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, corners: &[Vector64<D>]) -> Result<(), NoImage> {
        let corners: Vec<Vector64<D>> = corners.iter().map(|corner| self.on_sphere(corner)).collect();
        if corners.iter().any(|corner| corner.norm_squared() == 0.0) {
            return Err(NoImage::Center);
        }
        // Around the centre the corners go once about.
        let angle = |a: &Vector64<D>, b: &Vector64<D>| 2.0 * libm::atan2((a - b).norm(), (a + b).norm());
        let around: f64 = (0..corners.len()).map(|i| angle(&corners[i], &corners[(i + 1) % corners.len()])).sum();
        if around > std::f64::consts::TAU - 1e-3 {
            return Err(NoImage::Center);
        }
        if self.away(&corners) < NEAR { Err(NoImage::Pole) } else { Ok(()) }
    }

    /// The sine of the angle between the pole and the cone of these vectors; 1 where it is a right angle or more.
    fn away(&self, corners: &[Vector64<D>]) -> f64 {
        // The pole's projection to their span, by Gram and Schmidt; it lies in the cone if all shares are positive.
        let gram = |i: usize, j: usize| corners[i].dot(&corners[j]);
        let right = |i: usize| corners[i].dot(&self.pole);
        let shares = match corners.len() {
            0 => return 1.0,
            1 => [right(0), 1.0, 1.0],
            2 => {
                let det = gram(0, 0) * gram(1, 1) - gram(0, 1) * gram(0, 1);
                let share = |i: usize, j: usize| (right(i) * gram(j, j) - right(j) * gram(0, 1)) / det;
                [share(0, 1), share(1, 0), 1.0]
            }
            _ => {
                let matrix = nalgebra::Matrix3::from_fn(gram);
                match matrix.lu().solve(&nalgebra::Vector3::from_fn(|i, _| right(i))) {
                    Some(found) => found.into(),
                    None => [f64::NAN; 3],
                }
            }
        };
        if shares.iter().all(|share| *share > 0.0) {
            let foot = corners.iter().zip(shares).fold(Vector64::zeros(), |sum, (corner, share)| sum + corner * share);
            return (self.pole - foot).norm();
        }
        let without = |left_out: usize| {
            let rest: Vec<Vector64<D>> = (0..corners.len()).filter(|&i| i != left_out).map(|i| corners[i]).collect();
            self.away(&rest)
        };
        (0..corners.len()).map(without).fold(1.0, f64::min)
    }

    /// Where to divide a straight edge, as shares of the way, both ends included: so that the pieces of its image look
    /// round.
    ///
    /// # Errors
    /// If it goes through the pole or the centre.
    pub fn arc(&self, from: &Vector64<D>, to: &Vector64<D>) -> Result<Vec<f64>, NoImage> {
        self.check(&[*from, *to])?;
        let mut shares = vec![0.0];
        let place = |share: f64| from + (to - from) * share;
        let mut open = vec![(0.0, 1.0, 0)];
        while let Some((start, end, halvings)) = open.pop() {
            let middle = 0.5 * (start + end);
            let [a, m, b] = [start, middle, end].map(|share| self.on_sphere(&place(share)));
            let [p, q, r] = [start, middle, end].map(|share| nalgebra::Vector3::from(self.image(&place(share))));
            // The turn of an arc whose chord is c and whose middle is s beside it is 4 atan(2 s / c).
            let chord = r - p;
            let beside = (q - p) - chord * ((q - p).dot(&chord) / chord.norm_squared());
            let turn = 4.0 * libm::atan2(2.0 * beside.norm(), chord.norm());
            let long = (a - m).norm() + (m - b).norm() > TURN;
            if halvings < HALVINGS && (long || turn > TURN) {
                open.push((middle, end, halvings + 1));
                open.push((start, middle, halvings + 1));
            } else {
                shares.push(end);
            }
        }
        Ok(shares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn projection() -> Stereographic<4> {
        Stereographic::new([0.5, 0.0, -1.0, 2.0].into(), [1.0, -2.0, 0.5, 3.0].into()).unwrap()
    }

    #[test]
    fn images_are_where_the_line_from_the_pole_leads() {
        let map = projection();
        for p in [[1.0, 0.0, 0.0, 0.0], [-3.0, 4.0, 5.0, 2.5], [0.5, 0.0, 0.0, 1.0]] {
            let (p, image) = (Vector64::from(p), map.image(&p.into()));
            let (foot, on_sphere) = (map.plane.point(image), map.on_sphere(&p));
            // Pole, point and image lie on one line, and the image in the hyperplane of the equator.
            let (one, other) = (on_sphere - map.pole, foot - map.pole);
            assert!((one.norm() * other.norm() - one.dot(&other)).abs() < 1e-12 && foot.dot(&map.pole).abs() < 1e-12);
            assert!((map.preimage(image, &p) - p).norm() < 1e-12);
        }
        assert_eq!(Stereographic::<4>::new(Vector64::zeros(), Vector64::zeros()), None);
        // On the sphere the default is (x, y, z) / (1 - w).
        let map = Stereographic::<4>::new(Vector64::zeros(), [0.0, 0.0, 0.0, 2.0].into()).unwrap();
        let image = map.image(&[0.0, 0.6, 0.0, 0.8].into());
        assert!((image[1] - 3.0).abs() < 1e-14 && image[0] == 0.0 && image[2] == 0.0);
    }

    #[test]
    fn edges_become_arcs_of_circles() {
        let map = projection();
        let [from, to] = [[2.0, 1.0, -1.0, 2.0], [-1.0, 0.5, 0.0, 1.0]].map(Vector64::from);
        let shares = map.arc(&from, &to).unwrap();
        assert!(shares.len() > 20 && shares.windows(2).all(|pair| pair[0] < pair[1]));
        let points: Vec<nalgebra::Vector3<f64>> =
            shares.iter().map(|share| map.image(&(from + (to - from) * *share)).into()).collect();
        // The circle through three of them has them all.
        let [a, b, c] = [0, points.len() / 2, points.len() - 1].map(|i| points[i]);
        let (u, v) = (b - a, c - a);
        let normal = u.cross(&v);
        let center = a
            + (u.norm_squared() * v.cross(&normal) + v.norm_squared() * normal.cross(&u))
                / (2.0 * normal.norm_squared());
        let radius = (a - center).norm();
        for p in &points {
            assert!(((p - center).norm() - radius).abs() < 1e-9 * radius && (p - a).dot(&normal).abs() < 1e-9);
        }
    }

    #[test]
    fn what_has_no_image_is_told() {
        let map = Stereographic::<4>::new(Vector64::zeros(), [0.0, 0.0, 0.0, 1.0].into()).unwrap();
        let corner = |p: [f64; 4]| Vector64::from(p);
        let [a, b, c] = [[1.0, 0.0, 0.0, 1.0], [-1.0, 1.0, 0.0, 1.0], [-1.0, -1.0, 0.0, 1.0]].map(corner);
        assert_eq!(map.check(&[a, b, c]), Err(NoImage::Pole), "around the pole");
        assert_eq!(map.check(&[a, b, corner([0.0, 1.0, 0.0, 1.0])]), Ok(()), "beside it");
        assert_eq!(map.check(&[a, a - corner([2.0, 0.0, 0.0, 0.0])]), Err(NoImage::Pole), "past it");
        assert_eq!(map.check(&[corner([0.0, 0.0, 0.0, 3.0])]), Err(NoImage::Pole));
        assert_eq!(map.check(&[corner([0.1, 0.0, 0.0, -3.0]), corner([0.0, 0.1, 0.0, -3.0])]), Ok(()));
        assert_eq!(map.check(&[a, -a]), Err(NoImage::Center));
        assert_eq!(map.check(&[Vector64::zeros(), a]), Err(NoImage::Center));
        let flat = |p: [f64; 4]| corner([p[0], p[1], p[2], 0.0]);
        assert_eq!(map.check(&[flat(a.into()), flat(b.into()), flat(c.into())]), Err(NoImage::Center));
        assert_eq!(map.arc(&a, &(a - corner([2.0, 0.0, 0.0, 0.0]))), Err(NoImage::Pole));
    }
}
