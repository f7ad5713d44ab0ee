//! A quick look at an image without ParaView: three slices through its centre, as a PNG.
//!
//! From left to right the planes xy (at mid z), xz (at mid y) and zy (at mid x), with the first letter to the right
//! and the second up, so that xy and zy show the same heights. One scale holds for all of them, voxels keep their
//! shape, and small images are enlarged by whole factors without smoothing. A background voxel is white, as is the
//! margin; a grey line frames each slice. An image of one layer is drawn alone and without a frame.
//!
//! Slices are picked out of slabs as they come ([`Slices::add_slab`]), so the image itself need not be kept. Several
//! images, without and with occlusion say, are stacked in rows ([`write()`]).

use std::io::{Cursor, Write};

use super::Error;
use crate::volume::Grid;

/// A slice is enlarged to at least this many pixels along the longest side of the image.
const WANTED: f64 = 300.0;
/// No side of a slice has more pixels than this, however large the image is.
const MOST: f64 = 2048.0;
/// Pixels between slices and around them.
const MARGIN: usize = 14;
/// Colour of the frame around a slice.
const FRAME: [u8; 3] = [208, 208, 208];
/// Colour of the background.
const WHITE: [u8; 3] = [255; 3];

/// The axes to the right and up, and the one across, of each slice.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [2, 1, 0]];

/// Three slices through the middle of an image.
#[derive(Clone, Debug)]
pub struct Slices {
    grid: Grid,
    /// Colours of each slice, as many as it has: rows upwards, each from left to right.
    pixels: Vec<Vec<[u8; 3]>>,
}

/// A picture made of rows of pixels, the topmost first.
struct Canvas {
    width: usize,
    height: usize,
    /// Pixels of white around what it shows, already in width and height.
    margin: usize,
    rgb: Vec<u8>,
}

impl Slices {
    /// Empty slices, all background, through an image of this grid.
    pub fn new(grid: &Grid) -> Self {
        let planes = if grid.dimensions[2] == 1 { &PLANES[..1] } else { &PLANES[..] };
        let size = |&[right, up, _]: &[usize; 3]| grid.dimensions[right] * grid.dimensions[up];
        Self { grid: *grid, pixels: planes.iter().map(|p| vec![WHITE; size(p)]).collect() }
    }

    /// The index at which the slice across this axis lies.
    pub fn middle(&self, axis: usize) -> usize {
        self.grid.dimensions[axis] / 2
    }

    /// Takes what the slices need from layers of `[r, g, b, a]` voxels, as many as there are from `first_layer` on.
    /// Alpha 0 is background; between 0 and 255 the colour is mixed with white.
    ///
    /// # Errors
    /// If the voxels are no whole layers of the image.
    pub fn add_slab(&mut self, first_layer: usize, rgba: &[u8]) -> Result<(), Error> {
        let [w, h, d] = self.grid.dimensions;
        let layer = 4 * w * h;
        if layer == 0 || !rgba.len().is_multiple_of(layer) || first_layer + rgba.len() / layer > d {
            let found = format!("{} bytes from layer {first_layer} on", rgba.len());
            return Err(Error::Shape { array: "rgba".into(), found, expected: format!("up to {d} layers of {layer}") });
        }
        let middle = [0, 1, 2].map(|a| self.middle(a));
        for (voxels, k) in rgba.chunks_exact(layer).zip(first_layer..) {
            let color = |i: usize, j: usize| over_white(&voxels[4 * (i + w * j)..][..4]);
            for (slice, [right, up, across]) in self.pixels.iter_mut().zip(PLANES) {
                // The part of this layer that lies in the slice: all of it, a row, or a column.
                let range =
                    |axis: usize| if axis == across { middle[axis]..middle[axis] + 1 } else { 0..[w, h, 0][axis] };
                if across == 2 && k != middle[2] {
                    continue;
                }
                for j in range(1) {
                    for i in range(0) {
                        let index = [i, j, k];
                        slice[index[right] + self.grid.dimensions[right] * index[up]] = color(i, j);
                    }
                }
            }
        }
        Ok(())
    }

    /// Pixels along each axis: in proportion to the image, by a whole factor where voxels are cubes.
    fn scale(&self) -> [usize; 3] {
        let Grid { dimensions, spacing, .. } = self.grid;
        let finest = spacing.iter().copied().fold(f64::INFINITY, f64::min);
        // A layer alone has no thickness to show.
        let axes = if self.pixels.len() == 1 { 2 } else { 3 };
        let sizes: [f64; 3] = std::array::from_fn(|a| dimensions[a] as f64 * spacing[a] / finest);
        let longest = sizes[..axes].iter().copied().fold(1.0, f64::max);
        let factor = (WANTED / longest).ceil().max(1.0).min(MOST / longest);
        sizes.map(|n| (n * factor).round().clamp(1.0, MOST) as usize)
    }

    /// This image's row of slices.
    fn row(&self) -> Canvas {
        let scale = self.scale();
        let panel = |[right, up, _]: [usize; 3]| (scale[right], scale[up]);
        if self.pixels.len() == 1 {
            let (width, height) = panel(PLANES[0]);
            let mut canvas = Canvas::new(width, height);
            self.draw(0, &mut canvas, 0, 0);
            return canvas;
        }
        let width: usize = PLANES.iter().map(|&p| panel(p).0 + MARGIN).sum();
        let height = PLANES.iter().map(|&p| panel(p).1).max().unwrap_or(0);
        let mut canvas = Canvas::new(width + MARGIN, height + 2 * MARGIN);
        canvas.margin = MARGIN;
        let mut left = MARGIN;
        for (i, &plane) in PLANES.iter().enumerate() {
            let (w, h) = panel(plane);
            let top = MARGIN + (height - h) / 2;
            canvas.frame(left, top, w, h);
            self.draw(i, &mut canvas, left, top);
            left += w + MARGIN;
        }
        canvas
    }

    /// Draws one slice; its last row comes first, as up is upwards.
    fn draw(&self, slice: usize, canvas: &mut Canvas, left: usize, top: usize) {
        let ([right, up, _], scale) = (PLANES[slice], self.scale());
        let (w, h) = (self.grid.dimensions[right], self.grid.dimensions[up]);
        for y in 0..scale[up] {
            let row = h - 1 - nearest(y, h, scale[up]);
            for x in 0..scale[right] {
                canvas.set(left + x, top + y, self.pixels[slice][nearest(x, w, scale[right]) + w * row]);
            }
        }
    }
}

/// Writes images as rows of slices, the first on top.
///
/// # Errors
/// If there are none, or the sink fails.
pub fn write(sink: impl Write, rows: &[&Slices]) -> Result<(), Error> {
    write_told(sink, rows, None)
}

/// The same with a text, which any program shows that tells what is in a PNG, under this name.
///
/// # Errors
/// As [`write()`].
pub fn write_told(sink: impl Write, rows: &[&Slices], text: Option<(&str, &str)>) -> Result<(), Error> {
    let rows: Vec<Canvas> = rows.iter().map(|s| s.row()).collect();
    let width = rows.iter().map(|r| r.width).max().unwrap_or(0);
    // Between rows there is one margin, be it that of a row of framed slices, which brings its own, or another.
    let mut tops = Vec::new();
    let mut height = 0;
    for row in &rows {
        tops.push(if tops.is_empty() { 0 } else { height + MARGIN - row.margin });
        height = tops.last().unwrap_or(&0) + row.height - row.margin;
    }
    height += rows.last().map_or(0, |r| r.margin);
    let mut canvas = Canvas::new(width, height);
    for (row, top) in rows.iter().zip(tops) {
        for (y, line) in row.rgb.chunks_exact(3 * row.width).enumerate() {
            let start = 3 * width * (top + y);
            canvas.rgb[start..start + line.len()].copy_from_slice(line);
        }
    }
    encode(sink, width as u32, height as u32, &canvas.rgb, text)
}

fn encode(sink: impl Write, width: u32, height: u32, rgb: &[u8], text: Option<(&str, &str)>) -> Result<(), Error> {
    let mut encoder = ::png::Encoder::new(sink, width, height);
    encoder.set_color(::png::ColorType::Rgb);
    encoder.set_depth(::png::BitDepth::Eight);
    if let Some((name, text)) = text {
        encoder.add_itxt_chunk(name.to_owned(), text.to_owned())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(())
}

/// The text that a PNG has under this name, whatever made the file; none if there is none.
///
/// # Errors
/// If it is no PNG, or damaged.
pub fn text(bytes: &[u8], name: &str) -> Result<Option<String>, String> {
    let mut reader = ::png::Decoder::new(Cursor::new(bytes)).read_info().map_err(|e| e.to_string())?;
    // Texts may stand behind the picture, too.
    reader.finish().map_err(|e| e.to_string())?;
    let info = reader.info();
    if let Some(chunk) = info.utf8_text.iter().find(|chunk| chunk.keyword == name) {
        return chunk.get_text().map(Some).map_err(|e| e.to_string());
    }
    Ok(info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == name).map(|chunk| chunk.text.clone()))
}

/// Makes a PNG of ours again with another text under this name.
///
/// # Errors
/// If it is none of ours, or the sink fails.
pub fn retell(bytes: &[u8], sink: impl Write, text: (&str, &str)) -> Result<(), Error> {
    let damaged = |e: ::png::DecodingError| Error::Write(std::io::Error::new(std::io::ErrorKind::InvalidData, e));
    let mut reader = ::png::Decoder::new(Cursor::new(bytes)).read_info().map_err(damaged)?;
    let size = reader.output_buffer_size().unwrap_or_default();
    let mut pixels = vec![0; size];
    let frame = reader.next_frame(&mut pixels).map_err(damaged)?;
    encode(sink, frame.width, frame.height, &pixels, Some(text))
}

impl Canvas {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, margin: 0, rgb: vec![255; 3 * width * height] }
    }

    fn set(&mut self, x: usize, y: usize, color: [u8; 3]) {
        self.rgb[3 * (x + self.width * y)..][..3].copy_from_slice(&color);
    }

    /// A line around a rectangle, just outside it.
    fn frame(&mut self, left: usize, top: usize, width: usize, height: usize) {
        for x in left - 1..=left + width {
            self.set(x, top - 1, FRAME);
            self.set(x, top + height, FRAME);
        }
        for y in top - 1..=top + height {
            self.set(left - 1, y, FRAME);
            self.set(left + width, y, FRAME);
        }
    }
}

/// The voxel under the middle of a pixel.
fn nearest(pixel: usize, voxels: usize, pixels: usize) -> usize {
    ((2 * pixel + 1) * voxels / (2 * pixels)).min(voxels - 1)
}

/// A colour in front of white.
fn over_white(rgba: &[u8]) -> [u8; 3] {
    let alpha = u32::from(rgba[3]);
    std::array::from_fn(|c| ((u32::from(rgba[c]) * alpha + 255 * (255 - alpha) + 127) / 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The picture's size and its pixels, the topmost row first.
    fn draw(rows: &[&Slices]) -> (usize, usize, Vec<[u8; 3]>) {
        let mut bytes = Vec::new();
        write(&mut bytes, rows).unwrap();
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let pixels = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        (info.width as usize, info.height as usize, pixels)
    }

    /// Voxel (i, j, k) has colour (i, j, k), times ten.
    fn slices(dimensions: [usize; 3], spacing: [f64; 3], slab: usize) -> Slices {
        let grid = Grid { dimensions, origin: [0.0; 3], spacing };
        let [w, h, d] = dimensions;
        let mut slices = Slices::new(&grid);
        for first in (0..d).step_by(slab) {
            let layers = first..d.min(first + slab);
            let voxel = |n: usize| [n % w, n / w % h, n / w / h].map(|x| (10 * x) as u8);
            let rgba: Vec<u8> =
                (layers.start * w * h..layers.end * w * h).flat_map(|n| voxel(n).into_iter().chain([255])).collect();
            slices.add_slab(first, &rgba).unwrap();
        }
        slices
    }

    #[test]
    fn axes_point_right_and_up() {
        let image = slices([4, 5, 6], [1.0; 3], 6);
        assert_eq!(draw(&[&image, &image]).1, 2 * 300 + 3 * MARGIN);
        for slab in [1, 2, 7] {
            let (width, height, pixels) = draw(&[&slices([4, 5, 6], [1.0; 3], slab)]);
            // 6 voxels to 300 pixels: 50 each.
            assert_eq!((width, height), (200 + 200 + 300 + 4 * MARGIN, 300 + 2 * MARGIN));
            let at = |x: usize, y: usize| pixels[x + width * y];
            let (xy, xz, zy) = (MARGIN, 2 * MARGIN + 200, 3 * MARGIN + 400);
            let short = MARGIN + 25;
            // Lower left, lower right, upper left of each slice.
            assert_eq!(at(xy, short + 249), [0, 0, 30]);
            assert_eq!(at(xy + 199, short + 249), [30, 0, 30]);
            assert_eq!(at(xy, short), [0, 40, 30]);
            assert_eq!(at(xz, MARGIN + 299), [0, 20, 0]);
            assert_eq!(at(xz + 199, MARGIN + 299), [30, 20, 0]);
            assert_eq!(at(xz, MARGIN), [0, 20, 50]);
            assert_eq!(at(zy, short + 249), [20, 0, 0]);
            assert_eq!(at(zy + 299, short + 249), [20, 0, 50]);
            assert_eq!(at(zy, short), [20, 40, 0]);
            assert_eq!((at(xy - 1, short), at(0, 0)), (FRAME, WHITE));
        }
    }

    #[test]
    fn voxels_keep_their_shape() {
        let (width, height, _) = draw(&[&slices([10, 10, 5], [1.0, 2.0, 0.5], 5)]);
        // Sizes 10, 20 and 2.5: the finest voxel edge takes 8 pixels, as 20 / 0.5 of them must fill 300.
        assert_eq!((width, height), (160 + 160 + 40 + 4 * MARGIN, 320 + 2 * MARGIN));
        let (width, height, _) = draw(&[&slices([9000, 2, 2], [1e-9, 1.0, 1.0], 2)]);
        assert!(width <= 3 * 2048 + 4 * MARGIN && height <= 2048 + 2 * MARGIN);
    }

    #[test]
    fn one_layer_is_the_image_itself() {
        let image = slices([300, 200, 1], [0.01, 0.01, 5.0], 1);
        let (width, height, pixels) = draw(&[&image]);
        assert_eq!((width, height), (300, 200));
        assert_eq!(pixels[0], [0, (199 * 10 % 256) as u8, 0]);
        assert_eq!(draw(&[&image, &image]).1, 400 + MARGIN);
    }

    #[test]
    fn background_is_white() {
        assert_eq!(over_white(&[10, 20, 30, 0]), WHITE);
        assert_eq!(over_white(&[10, 20, 30, 255]), [10, 20, 30]);
        assert_eq!(over_white(&[0, 0, 0, 128]), [127; 3]);
        let mut slices = Slices::new(&Grid { dimensions: [2, 2, 2], origin: [0.0; 3], spacing: [1.0; 3] });
        assert!(slices.add_slab(0, &[0; 15]).is_err());
        assert!(slices.add_slab(2, &[0; 16]).is_err());
        assert!(slices.add_slab(0, &[0; 32]).is_ok());
    }
}
