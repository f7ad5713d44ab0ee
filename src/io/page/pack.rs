//! A picture's voxels in few bytes: a coverage, a colour's number and a shade each, predicted and deflated.
//!
//! What a voxel shows is `colour = palette[number] * shade`. Where ambient occlusion is known, the shade is that, and the
//! colour what it darkens; in other pictures the shade is the brightest of red, green and blue. Coverage has 16 levels and
//! shades 64, which is half a level of what a screen shows in the dark, and less than the noise of ambient occlusion by rays.
//!
//! Each plane is predicted from voxels before it, and what is packed is the difference: of coverages and colours from the
//! voxel to the left, of shades from the mean of those to the left, below and behind. Where nothing is the prediction
//! stands, so it costs nothing. `page.js` does the same the other way round.

use std::collections::BTreeMap;
use std::io::Write;

use flate2::Compression;
use flate2::write::DeflateEncoder;

use crate::io::Error;
use crate::volume::Grid;

/// The brightest shade.
pub const SHADES: u8 = 63;
/// The fullest coverage.
const COVERS: f32 = 15.0;
/// Colours that are told apart, a channel.
const STEPS: u32 = 32;
/// Of darker voxels nobody can tell the colour.
const DARK: f32 = 0.25;

/// What is known of a picture's voxels, in the order of the grid.
#[derive(Debug)]
pub struct Voxels<'v> {
    /// Where they are.
    pub grid: Grid,
    /// Red, green, blue and alpha of each.
    pub rgba: &'v [u8],
    /// How much of each is covered, 0 to 1.
    pub coverage: &'v [f32],
    /// The ambient occlusion by which colours are darkened, if they are.
    pub occlusion: Option<&'v [f32]>,
}

impl Voxels<'_> {
    fn cover(&self, i: usize) -> u8 {
        (self.coverage[i].clamp(0.0, 1.0) * COVERS).round() as u8
    }

    /// The colour of a voxel and its shade.
    fn parts(&self, i: usize) -> ([f32; 3], f32) {
        let rgb = [0, 1, 2].map(|c| f32::from(self.rgba[4 * i + c]) / 255.0);
        let brightest = rgb.into_iter().fold(0.0, f32::max);
        let shade = self.occlusion.map_or(brightest, |occlusion| occlusion[i].clamp(0.0, 1.0));
        (rgb.map(|x| (x / shade.max(1e-6)).min(1.0)), shade)
    }
}

/// The colours of all frames of a series, 256 at most.
#[derive(Clone, Debug, Default)]
pub struct Palette {
    colours: Vec<[u8; 3]>,
    /// How often a colour is there, and the sum of what it was, by its steps.
    found: BTreeMap<[u32; 3], (u64, [f64; 3])>,
}

fn steps(colour: [f32; 3]) -> [u32; 3] {
    colour.map(|x| ((x * STEPS as f32) as u32).min(STEPS - 1))
}

impl Palette {
    /// Takes note of a frame's colours.
    pub fn look(&mut self, voxels: &Voxels) {
        for i in (0..voxels.grid.len()).filter(|&i| voxels.cover(i) == COVERS as u8) {
            let (colour, shade) = voxels.parts(i);
            if shade >= DARK {
                let (count, sum) = self.found.entry(steps(colour)).or_default();
                *count += 1;
                sum.iter_mut().zip(colour).for_each(|(sum, x)| *sum += f64::from(x));
            }
        }
    }

    /// Chooses the colours: the most frequent of those that were seen.
    pub fn choose(&mut self) {
        let mut all: Vec<_> = self.found.iter().collect();
        all.sort_by_key(|(steps, (count, _))| (std::cmp::Reverse(*count), **steps));
        let mean = |(count, sum): &(u64, [f64; 3])| sum.map(|x| (255.0 * x / *count as f64).round() as u8);
        self.colours = all.into_iter().take(256).map(|(_, found)| mean(found)).collect();
        if self.colours.is_empty() {
            self.colours.push([204; 3]);
        }
        self.found.clear();
    }

    /// The colours that were chosen.
    pub fn colours(&self) -> &[[u8; 3]] {
        &self.colours
    }

    fn nearest(&self, colour: [f32; 3]) -> u8 {
        let apart = |found: &[u8; 3]| {
            let squares = found.iter().zip(colour).map(|(&x, y)| (f32::from(x) / 255.0 - y).powi(2));
            squares.sum::<f32>()
        };
        let best = self.colours.iter().enumerate().min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b)));
        best.map_or(0, |(i, _)| i as u8)
    }

    /// A frame's voxels, packed.
    ///
    /// # Errors
    /// If packing fails.
    pub fn pack(&self, voxels: &Voxels) -> Result<Vec<u8>, Error> {
        let [w, h, d] = voxels.grid.dimensions;
        let (n, layer) = (w * h * d, w * h);
        let mut packed = vec![0u8; 3 * n];
        let (mut covers, mut colours, mut shades) = (vec![0u8; n], vec![0u8; n], vec![0u8; n]);
        let mut known = BTreeMap::new();
        let mut i = 0;
        for k in 0..d {
            for j in 0..h {
                for x in 0..w {
                    let left = if x > 0 {
                        Some(i - 1)
                    } else if j > 0 {
                        Some(i - w)
                    } else {
                        (k > 0).then(|| i - layer)
                    };
                    let before = |plane: &[u8]| left.map_or(0, |left| plane[left]);
                    let around = [(x > 0).then(|| i - 1), (j > 0).then(|| i - w), (k > 0).then(|| i - layer)];
                    let around: Vec<u32> = around.into_iter().flatten().map(|at| u32::from(shades[at])).collect();
                    let expected = if around.is_empty() { 0 } else { around.iter().sum::<u32>() / around.len() as u32 };
                    covers[i] = voxels.cover(i);
                    (colours[i], shades[i]) = (before(&colours), expected as u8);
                    if covers[i] > 0 {
                        let (colour, shade) = voxels.parts(i);
                        shades[i] = (shade * f32::from(SHADES)).round() as u8;
                        // In the dark that of the voxel before will do.
                        if shade >= DARK || left.is_none_or(|left| covers[left] == 0) {
                            colours[i] = *known.entry(steps(colour)).or_insert_with(|| self.nearest(colour));
                        }
                    }
                    packed[i] = covers[i].wrapping_sub(before(&covers));
                    packed[n + i] = colours[i].wrapping_sub(before(&colours));
                    packed[2 * n + i] = shades[i].wrapping_sub(expected as u8);
                    i += 1;
                }
            }
        }
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&packed)?;
        Ok(encoder.finish()?)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    /// What the page's program makes of packed voxels: coverage, colour and shade of each.
    fn unpacked(bytes: &[u8], [w, h, d]: [usize; 3]) -> [Vec<u8>; 3] {
        let mut all = Vec::new();
        flate2::read::DeflateDecoder::new(bytes).read_to_end(&mut all).unwrap();
        let n = w * h * d;
        let mut planes = [0, 1, 2].map(|p| all[p * n..(p + 1) * n].to_vec());
        for i in 0..n {
            let (x, j, k) = (i % w, i / w % h, i / (w * h));
            let near = [(x > 0, 1), (j > 0, w), (k > 0, w * h)];
            let near: Vec<usize> = near.into_iter().filter(|(there, _)| *there).map(|(_, by)| i - by).collect();
            if let Some(&left) = near.first() {
                planes[0][i] = planes[0][i].wrapping_add(planes[0][left]);
                planes[1][i] = planes[1][i].wrapping_add(planes[1][left]);
                let mean = near.iter().map(|&at| u32::from(planes[2][at])).sum::<u32>() / near.len() as u32;
                planes[2][i] = planes[2][i].wrapping_add(mean as u8);
            }
        }
        planes
    }

    #[test]
    fn voxels_come_back_to_half_a_step() {
        let dimensions = [9, 7, 5];
        let grid = Grid { dimensions, origin: [0.0; 3], spacing: [1.0; 3] };
        let n = grid.len();
        let objects = [[1.0, 0.5, 0.25], [0.8, 0.8, 0.8], [0.0, 0.25, 1.0f32]];
        let occlusion: Vec<f32> = (0..n).map(|i| (i * 37 % 101) as f32 / 100.0).collect();
        let coverage: Vec<f32> = (0..n).map(|i| [0.0, 1.0, 1.0, 0.4][i / 3 % 4]).collect();
        let colour = |i: usize| objects[i / 20 % 3].map(|x| x * occlusion[i]);
        let rgba: Vec<u8> = (0..n)
            .flat_map(|i| {
                let [r, g, b] = colour(i).map(|x| (255.0 * x).round() as u8);
                [r, g, b, (255.0 * coverage[i]).round() as u8]
            })
            .collect();
        for known in [true, false] {
            let occlusion = known.then_some(&occlusion[..]);
            let voxels = Voxels { grid, rgba: &rgba, coverage: &coverage, occlusion };
            let mut palette = Palette::default();
            palette.look(&voxels);
            palette.choose();
            let packed = palette.pack(&voxels).unwrap();
            assert_eq!(packed, palette.pack(&voxels).unwrap());
            let [covers, colours, shades] = unpacked(&packed, dimensions);
            for i in (0..n).filter(|&i| coverage[i] > 0.0) {
                assert!((f32::from(covers[i]) / COVERS - coverage[i]).abs() <= 0.5 / COVERS + 1e-6);
                let tint = palette.colours()[usize::from(colours[i])];
                let shown = tint.map(|x| f32::from(x) / 255.0 * f32::from(shades[i]) / f32::from(SHADES));
                let off = shown.iter().zip(colour(i)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                let most = if voxels.parts(i).1 < DARK { DARK } else { 0.04 };
                assert!(off <= most, "{i}: {shown:?} {:?}", colour(i));
            }
            assert!(covers.iter().zip(&coverage).all(|(&c, &x)| (c == 0) == (x == 0.0)));
        }
    }

    #[test]
    fn an_empty_picture_takes_next_to_nothing() {
        let grid = Grid { dimensions: [64, 64, 64], origin: [0.0; 3], spacing: [1.0; 3] };
        let (rgba, coverage) = (vec![255; 4 * grid.len()], vec![0.0; grid.len()]);
        let voxels = Voxels { grid, rgba: &rgba, coverage: &coverage, occlusion: None };
        let mut palette = Palette::default();
        palette.look(&voxels);
        palette.choose();
        assert!(palette.pack(&voxels).unwrap().len() < 2000);
    }
}
