//! Cramer's rule by Laplace's expansion (Djami 2021, 2.1.2 and 4.3), in the precision of the numbers given.

use nalgebra::RealField;

use super::Deviations;
use crate::geometry::{Dimension, Ray, Vector, Vector64, widen};

/// A point or vector of either precision.
type Point<T, const D: usize> = nalgebra::SVector<T, D>;

/// Whether a ray hits a simplex at t > 0 by Cramer's rule in `f32`, and in `f64`: to compare with exact signs.
pub fn plain_cramer<const D: usize>(corners: &[Vector<D>; D], ray: &Ray<D>) -> [bool; 2] {
    let single = cramer(corners, &ray.origin, &ray.direction, Deviations::PUBLISHED);
    let wide: [Vector64<D>; D] = corners.map(|c| widen(&c));
    let double = cramer(&wide, &widen(&ray.origin), &widen(&ray.direction), Deviations::PUBLISHED);
    [
        single.0 > 0.0 && single.1.iter().all(|&l| l >= 0.0), // NaN, of a flat simplex, is no hit
        double.0 > 0.0 && double.1.iter().all(|&l| l >= 0.0),
    ]
}

/// The distance and the barycentric coordinates where a line meets the hyperplane of a simplex.
pub(super) fn cramer<T: RealField + Copy, const D: usize>(
    corners: &[Point<T, D>; D],
    origin: &Point<T, D>,
    direction: &Point<T, D>,
    deviations: Deviations,
) -> (T, [T; D]) {
    let a = corners[0];
    let mut columns: [Point<T, D>; D] = std::array::from_fn(|i| if i == 0 { -direction } else { corners[i] - a });
    let mut right = origin - a;
    if deviations.printed_equations {
        columns[0] = *direction;
        match Dimension::of::<D>() {
            // The thesis prints them for 4D only.
            Dimension::Three => {}
            Dimension::Four => {
                columns[3] = corners[3].map(|x| x - a[0]);
                right[1] = origin[1] - a[0];
            }
        }
    }
    let denominator = laplace(&columns, deviations.contracted);
    let solution: [T; D] = std::array::from_fn(|i| {
        let column = std::mem::replace(&mut columns[i], right);
        let numerator = laplace(&columns, deviations.contracted);
        columns[i] = column;
        numerator / denominator
    });
    let mut weights = solution;
    weights[0] = solution[1..].iter().fold(T::one(), |rest, &l| rest - l);
    (solution[0], weights)
}

/// A determinant by Laplace's expansion along the first row, and so on down to 2 x 2.
pub(super) fn laplace<T: RealField + Copy, const D: usize>(columns: &[Point<T, D>; D], contracted: bool) -> T {
    let all = [0, 1, 2, 3];
    minor(columns, 0, &all[..D], contracted)
}

fn minor<T: RealField + Copy, const D: usize>(
    columns: &[Point<T, D>; D],
    row: usize,
    kept: &[usize],
    contracted: bool,
) -> T {
    // a - b c, rounded once or twice.
    let subtract = |a: T, b: T, c: T| if contracted { (-b).mul_add(c, a) } else { a - b * c };
    if let &[i, j] = kept {
        let (first, second) = (&columns[i], &columns[j]);
        let product = second[row] * first[row + 1];
        return if contracted {
            first[row].mul_add(second[row + 1], -product)
        } else {
            first[row] * second[row + 1] - product
        };
    }
    let mut sum = T::zero();
    for (k, &column) in kept.iter().enumerate() {
        let mut rest = [0; 3];
        let others = kept.iter().filter(|&&c| c != column);
        rest.iter_mut().zip(others).for_each(|(place, &c)| *place = c);
        let value = minor(columns, row + 1, &rest[..kept.len() - 1], contracted);
        let entry = columns[column][row];
        sum = match k {
            0 => entry * value,
            _ if k % 2 == 1 => subtract(sum, entry, value),
            _ => subtract(sum, -entry, value),
        };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::determinant;
    use crate::trace::{Sampler, Sequence};

    fn determinants<const D: usize>() {
        let mut sequence = Sequence::new(Sampler::Random, 3, 4);
        for contracted in [false, true] {
            for _ in 0..100 {
                let columns: [Vector<D>; D] = std::array::from_fn(|_| {
                    let p = sequence.next_point::<4>();
                    Vector::from_fn(|i, _| p[i])
                });
                let wide = columns.map(|c| widen(&c));
                let expected = determinant(&wide);
                assert!((f64::from(laplace(&columns, contracted)) - expected).abs() < 1e-5);
                assert!((laplace(&wide, contracted) - expected).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn laplace_gives_determinants() {
        determinants::<3>();
        determinants::<4>();
    }

    #[test]
    fn cramer_finds_the_crossing() {
        let corners: [Vector<4>; 4] = std::array::from_fn(|i| Vector::from_fn(|r, _| if r == i { 2.0 } else { 0.0 }));
        let ray = Ray::new(Vector::zeros(), Vector::from([0.25, 0.25, 0.5, 0.5]));
        let (t, weights) = cramer(&corners, &ray.origin, &ray.direction, Deviations::PUBLISHED);
        assert!((t - 4.0 / 3.0).abs() < 1e-6, "{t}");
        let expected = [1.0 / 6.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0];
        assert!(weights.iter().zip(expected).all(|(w, e): (&f32, f32)| (w - e).abs() < 1e-6), "{weights:?}");
        assert_eq!(plain_cramer(&corners, &ray), [true, true]);
        assert_eq!(plain_cramer(&corners, &Ray::new(ray.origin, -ray.direction)), [false, false]);
    }

    #[test]
    fn as_printed_t_counts_backwards() {
        // In 3D that is the whole slip of Eq. 2.7; the point is the same.
        let corners: [Vector<3>; 3] = std::array::from_fn(|i| Vector::from_fn(|r, _| if r == i { 2.0 } else { 0.0 }));
        let ray = Ray::new(Vector::zeros(), Vector::from([0.25, 0.25, 0.5]));
        let printed = Deviations { printed_equations: true, ..Deviations::PUBLISHED };
        let (t, weights) = cramer(&corners, &ray.origin, &ray.direction, Deviations::PUBLISHED);
        let (backwards, same) = cramer(&corners, &ray.origin, &ray.direction, printed);
        assert_eq!((t, backwards), (2.0, -2.0));
        assert_eq!((weights, same[1..].to_vec()), ([0.25, 0.25, 0.5], vec![0.25, 0.5]));
    }
}
