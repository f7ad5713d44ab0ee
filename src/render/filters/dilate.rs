//! Dilation: the empty voxels around bodies take over the bodies' values.
//!
//! A contour or a volume rendering interpolates between voxels. Where a body ends, it mixes the body's colour and
//! occlusion with whatever stands in the empty voxel beside it, and white or "open" there would make rims that nothing in
//! the scene has. So values bleed outwards, layer upon layer of voxels, by normalised convolution (Knutsson and Westin
//! 1993): a voxel next to some that have values takes their mean, weighted by opacity and by 1 / distance^2. Opacity
//! and coverage stay what they are, and tell what is real.

use rayon::prelude::*;

use super::ImageFilter;
use crate::geometry::Vector;
use crate::occlusion::Error;
use crate::progress::Progress;
use crate::render::gbuffer::{Columns, GBuffer};

/// The filter.
#[derive(Clone, Copy, Debug)]
pub struct Dilate {
    /// How many layers of empty voxels are filled.
    pub layers: usize,
}

/// A voxel's values on their way outwards.
#[derive(Clone, Copy, Debug)]
struct Value<const D: usize> {
    /// How much it counts: opacity, or 1 where it was filled; 0 where there is nothing yet.
    weight: f32,
    albedo: [f32; 3],
    /// Black where the picture is not lit.
    direct: [f32; 3],
    /// Black where all is opaque.
    behind: [f32; 3],
    occlusion: f32,
    /// Zero where the picture has none of these.
    direction: Vector<D>,
    hidden: [f32; 3],
}

impl<const D: usize> Value<D> {
    fn nothing() -> Self {
        let black = [0.0; 3];
        let direction = Vector::zeros();
        Self { weight: 0.0, albedo: black, direct: black, behind: black, occlusion: 0.0, direction, hidden: black }
    }
}

/// The empty voxels that have a neighbour, be it at a corner, that is not.
fn rim(filled: &[u8], [width, height, _]: [usize; 3]) -> Vec<usize> {
    // Whether a voxel or one beside it is filled, along x, then y, then z: each pass takes the last one's word.
    let layer = (width * height).max(1);
    let spread = |from: &[u8], stride: usize, run: usize| {
        let mut to = from.to_vec();
        to.par_chunks_mut(run).zip(from.par_chunks(run)).for_each(|(to, from)| {
            let beside = from.len().saturating_sub(stride);
            to[..beside].iter_mut().zip(&from[from.len() - beside..]).for_each(|(a, b)| *a |= b);
            let start = to.len() - beside;
            to[start..].iter_mut().zip(from).for_each(|(a, b)| *a |= b);
        });
        to
    };
    let rows = spread(filled, 1, width.max(1));
    let layers = spread(&rows, width, layer);
    let near = spread(&layers, layer, filled.len().max(1));
    let voxels = (0..filled.len()).into_par_iter().with_min_len(4096);
    voxels.filter(|&n| filled[n] == 0 && near[n] != 0).collect()
}

/// Takes some layers one step further: every voxel without a value that has a neighbour with one.
fn step<const D: usize>(values: &mut [Value<D>], filled: &mut [u8], dimensions: [usize; 3]) {
    let [width, height, _] = dimensions;
    let layers = values.len() / (width * height).max(1);
    let near = |i: usize, end: usize| i.saturating_sub(1)..=(i + 1).min(end - 1);
    let mean = |n: usize| {
        let (i, j, k) = (n % width, n / width % height, n / width / height);
        let (mut sum, mut total) = (Value::<D>::nothing(), 0.0f32);
        for (z, y) in near(k, layers).flat_map(|z| near(j, height).map(move |y| (z, y))) {
            for x in near(i, width) {
                let value = &values[x + width * (y + height * z)];
                if value.weight == 0.0 {
                    continue;
                }
                let distance = i.abs_diff(x) + j.abs_diff(y) + k.abs_diff(z);
                let weight = value.weight / distance as f32;
                total += weight;
                sum.occlusion += weight * value.occlusion;
                for c in 0..3 {
                    sum.albedo[c] += weight * value.albedo[c];
                    sum.direct[c] += weight * value.direct[c];
                    sum.behind[c] += weight * value.behind[c];
                    sum.hidden[c] += weight * value.hidden[c];
                }
                sum.direction += value.direction * weight;
            }
        }
        let [albedo, direct, behind, hidden] =
            [sum.albedo, sum.direct, sum.behind, sum.hidden].map(|sum| sum.map(|c| c / total));
        let (occlusion, direction) = (sum.occlusion / total, sum.direction / total);
        Value { weight: 1.0, albedo, direct, behind, occlusion, direction, hidden }
    };
    let found: Vec<(usize, Value<D>)> =
        rim(filled, dimensions).into_par_iter().with_min_len(256).map(|n| (n, mean(n))).collect();
    for (n, value) in found {
        (values[n], filled[n]) = (value, 1);
    }
}

impl<const D: usize> ImageFilter<D> for Dilate {
    fn columns(&self) -> Columns {
        Columns::ALBEDO | Columns::OCCLUSION | Columns::COVERAGE
    }

    fn halo(&self) -> usize {
        self.layers
    }

    fn apply(&self, input: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error> {
        // Where the window ends and the image goes on, the outermost layer of each step misses neighbours; what that
        // spoils moves inwards by a layer a step, and so stays within the halo.
        let value = |i: usize| {
            let (weight, albedo, occlusion) = (input.opacity(i), input.albedo[i], input.occlusion[i]);
            let [direct, behind, hidden] =
                [&input.direct, &input.behind, &input.hidden].map(|column| column.get(i).copied().unwrap_or_default());
            let direction = input.direction.get(i).copied().unwrap_or_else(Vector::zeros);
            Value { weight, albedo, direct, behind, occlusion, direction, hidden }
        };
        let mut values: Vec<Value<D>> = (0..input.len()).into_par_iter().with_min_len(4096).map(value).collect();
        let mut filled: Vec<u8> = values.iter().map(|value| u8::from(value.weight > 0.0)).collect();
        for _ in 0..self.layers {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            step(&mut values, &mut filled, input.dimensions());
        }
        let range = input.range(&out.layers());
        for (i, value) in values[range].iter().enumerate() {
            if out.coverage[i] == 0.0 && value.weight > 0.0 {
                (out.albedo[i], out.occlusion[i]) = (value.albedo, value.occlusion);
                if let Some(direct) = out.direct.get_mut(i) {
                    *direct = value.direct;
                }
                if let Some(behind) = out.behind.get_mut(i) {
                    *behind = value.behind;
                }
                if let Some(direction) = out.direction.get_mut(i) {
                    *direction = value.direction;
                }
                if let Some(hidden) = out.hidden.get_mut(i) {
                    *hidden = value.hidden;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::render::filters::Chain;

    const COLUMNS: Columns = Columns::SIMPLEX.union(Columns::ALBEDO).union(Columns::OCCLUSION).union(Columns::COVERAGE);

    /// One voxel in the middle shows something dark and red.
    fn one_voxel(thickness: usize) -> GBuffer<4> {
        let dimensions = [9, 9, 9];
        let filters: Vec<Box<dyn ImageFilter<4>>> = vec![Box::new(Dilate { layers: 3 })];
        let mut chain = Chain::new(dimensions, 0, COLUMNS, &filters);
        let mut whole = GBuffer::new(dimensions, 0..0, COLUMNS);
        for first in (0..9).step_by(thickness) {
            let mut source = |layers: std::ops::Range<usize>| {
                let mut buffer = GBuffer::new(dimensions, layers.clone(), COLUMNS);
                if layers.contains(&4) {
                    let middle = buffer.range(&(4..5)).start + 4 + 9 * 4;
                    (buffer.simplex[middle], buffer.coverage[middle]) = (0, 0.5);
                    (buffer.albedo[middle], buffer.occlusion[middle]) = ([1.0, 0.0, 0.0], 0.25);
                }
                Ok(buffer)
            };
            whole.append(chain.next(9.min(first + thickness), &mut source, &Silent).unwrap());
        }
        whole
    }

    #[test]
    fn values_bleed_three_layers_and_opacity_does_not() {
        let buffer = one_voxel(9);
        for n in 0..buffer.len() {
            let [i, j, k] = [n % 9, n / 9 % 9, n / 81];
            let far = [i, j, k].into_iter().map(|c| c.abs_diff(4)).max().unwrap();
            let expected = if far <= 3 { ([1.0, 0.0, 0.0], 0.25) } else { ([1.0; 3], 1.0) };
            assert_eq!((buffer.albedo[n], buffer.occlusion[n]), expected, "{i} {j} {k}");
            assert_eq!(buffer.coverage[n], if far == 0 { 0.5 } else { 0.0 });
        }
        for thickness in [1, 2, 7] {
            assert_eq!(one_voxel(thickness), buffer, "{thickness}");
        }
    }
}
