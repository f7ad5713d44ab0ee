//! `.raw`: colours alone, as little-endian `f32` triples r, g, b, with x fastest, then y, then z, and no header.
//!
//! The format of the thesis (Djami, *Ambient Occlusion in 4D*, 2021, 4.6.4). Whoever opens one must know its
//! dimensions; ParaView's ImageReader takes it as 3 scalar components of type float in little-endian byte order.

use std::io::Write;

use super::Error;
use crate::volume::Grid;

/// Bytes of a point.
const POINT: usize = 12;
/// Numbers turned into bytes at a time.
const BATCH: usize = 3 << 12;

/// A `.raw` file in the making.
pub struct RawWriter<W: Write> {
    sink: W,
    layer: usize,
    left: usize,
    depth: usize,
    bytes: Vec<u8>,
}

/// Bytes that a file for this grid takes.
pub fn size(grid: &Grid) -> Option<u64> {
    (grid.checked_len()? as u64).checked_mul(POINT as u64)
}

impl<W: Write> RawWriter<W> {
    /// Starts a file.
    pub fn new(sink: W, grid: &Grid) -> Self {
        let depth = grid.dimensions[2];
        Self { sink, layer: 3 * grid.layer_len(), left: depth, depth, bytes: Vec::new() }
    }

    /// Writes the next layers: as many as `rgb` holds, from `first_layer` on.
    ///
    /// # Errors
    /// If these are not the layers that come next, or the sink fails.
    pub fn write_slab(&mut self, first_layer: usize, rgb: &[f32]) -> Result<(), Error> {
        let shape = |found, expected| Err(Error::Shape { array: "rgb".into(), found, expected });
        let layers = rgb.len() / self.layer.max(1);
        if layers * self.layer != rgb.len() || layers > self.left {
            return shape(format!("{} numbers", rgb.len()), format!("1 to {} times {}", self.left, self.layer));
        }
        if first_layer != self.depth - self.left {
            return shape(format!("layer {first_layer}"), format!("layer {}", self.depth - self.left));
        }
        for batch in rgb.chunks(BATCH) {
            self.bytes.resize(size_of_val(batch), 0);
            for (place, x) in self.bytes.chunks_exact_mut(size_of::<f32>()).zip(batch) {
                place.copy_from_slice(&x.to_le_bytes());
            }
            self.sink.write_all(&self.bytes)?;
        }
        self.left -= layers;
        Ok(())
    }

    /// Completes the file and gives the sink back.
    ///
    /// # Errors
    /// If layers are missing, or the sink fails.
    pub fn finish(mut self) -> Result<W, Error> {
        if self.left > 0 {
            let found = format!("{} layers", self.depth - self.left);
            return Err(Error::Shape { array: "rgb".into(), found, expected: self.depth.to_string() });
        }
        self.sink.flush()?;
        Ok(self.sink)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_in_order_give_the_thesis_layout() {
        let grid = Grid { dimensions: [2, 1, 3], origin: [0.0; 3], spacing: [1.0; 3] };
        let rgb: Vec<f32> = (0..18).map(|i| i as f32).collect();
        let mut writer = RawWriter::new(Vec::new(), &grid);
        writer.write_slab(0, &rgb[..6]).unwrap();
        assert!(writer.write_slab(0, &rgb[..6]).is_err());
        assert!(writer.write_slab(1, &rgb[..7]).is_err());
        writer.write_slab(1, &rgb[6..]).unwrap();
        assert!(writer.write_slab(3, &rgb[..6]).is_err());
        let bytes = writer.finish().unwrap();
        assert_eq!(bytes.len() as u64, size(&grid).unwrap());
        assert!(bytes.chunks(4).zip(&rgb).all(|(b, x)| b == x.to_le_bytes()));
        assert!(RawWriter::new(Vec::new(), &grid).finish().is_err());
    }
}
