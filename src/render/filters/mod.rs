//! Image filters: what looks at the neighbours of a voxel, layer upon layer.
//!
//! A filter says which columns of the G-buffer it reads and how many layers it looks at on either side (its halo), and
//! gets just those, however thick the slabs are that an image is made in. `Chain` keeps the layers that a filter may
//! still look at, so that none is made twice; what a filter makes of a layer depends on that layer and its halo alone, so
//! the image is the same bytes for slabs of any thickness.
//!
//! A new filter is one file here, and one line in [`Renderer::filters`](super::Renderer).

pub mod denoise;
mod dilate;

use std::fmt;
use std::ops::Range;

pub use denoise::denoise;
pub use dilate::Dilate;

use super::gbuffer::{Columns, GBuffer};
use crate::occlusion::Error;
use crate::progress::Progress;

/// Makes voxels better by what their neighbours show.
pub trait ImageFilter<const D: usize>: fmt::Debug + Send + Sync {
    /// The columns it reads or changes.
    fn columns(&self) -> Columns;

    /// How many layers it looks at before and after each.
    fn halo(&self) -> usize;

    /// Makes some layers: `out` holds them as they are in `input`, which has their halo too, as far as the image goes.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so.
    fn apply(&self, input: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error>;
}

/// An image's layers on their way through filters, from the first to the last.
pub(super) struct Chain<'f, const D: usize> {
    dimensions: [usize; 3],
    filters: &'f [Box<dyn ImageFilter<D>>],
    /// What each filter may still look at.
    windows: Vec<GBuffer<D>>,
    /// How many layers have been made: before all filters, after the first, and so on.
    made: Vec<usize>,
}

/// Makes layers without filters.
pub(super) type Source<'s, const D: usize> = dyn FnMut(Range<usize>) -> Result<GBuffer<D>, Error> + 's;

impl<'f, const D: usize> Chain<'f, D> {
    /// A chain that has made nothing yet, of an image whose layers come with these columns; its first layer is to be `first`.
    pub fn new(dimensions: [usize; 3], first: usize, columns: Columns, filters: &'f [Box<dyn ImageFilter<D>>]) -> Self {
        // What comes before a filter begins earlier, by what the filter looks back at.
        let mut made = vec![first; filters.len() + 1];
        for (stage, filter) in filters.iter().enumerate().rev() {
            made[stage] = made[stage + 1].saturating_sub(filter.halo());
        }
        let windows =
            made[..filters.len()].iter().map(|&first| GBuffer::new(dimensions, first..first, columns)).collect();
        Self { dimensions, filters, windows, made }
    }

    /// The layers up to `end` that have not been made yet, filtered.
    ///
    /// # Errors
    /// Those of the source and of the filters.
    pub fn next(&mut self, end: usize, source: &mut Source<D>, progress: &dyn Progress) -> Result<GBuffer<D>, Error> {
        self.make(self.filters.len(), end, source, progress)
    }

    /// The layers up to `end` as the first `stage` filters leave them.
    fn make(
        &mut self,
        stage: usize,
        end: usize,
        source: &mut Source<D>,
        progress: &dyn Progress,
    ) -> Result<GBuffer<D>, Error> {
        let layers = self.made[stage]..end;
        self.made[stage] = end;
        let Some(before) = stage.checked_sub(1) else { return source(layers) };
        let filter = &self.filters[before];
        let reach = (end + filter.halo()).min(self.dimensions[2]);
        if self.made[before] < reach {
            let more = self.make(before, reach, source, progress)?;
            self.windows[before].append(more);
        }
        let window = &mut self.windows[before];
        let mut out = window.copy_of(layers);
        filter.apply(window, &mut out, progress)?;
        window.forget_before(end.saturating_sub(filter.halo()));
        Ok(out)
    }
}

/// How many layers are made before and after those that are wanted, for the filters to look at.
pub fn reach<const D: usize>(filters: &[Box<dyn ImageFilter<D>>]) -> usize {
    filters.iter().map(|filter| filter.halo()).sum()
}

/// Layers that the filters hold beside those of a slab.
pub(super) fn halo<const D: usize>(filters: &[Box<dyn ImageFilter<D>>]) -> usize {
    2 * reach(filters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    /// The mean of depth over some layers on either side.
    #[derive(Debug)]
    struct Mean(usize);

    impl ImageFilter<4> for Mean {
        fn columns(&self) -> Columns {
            Columns::DEPTH
        }

        fn halo(&self) -> usize {
            self.0
        }

        fn apply(&self, input: &GBuffer<4>, out: &mut GBuffer<4>, _: &dyn Progress) -> Result<(), Error> {
            for k in out.layers() {
                let near =
                    k.saturating_sub(self.0).max(input.layers().start)..(k + self.0 + 1).min(input.dimensions()[2]);
                let values: Vec<f32> =
                    near.clone().flat_map(|l| input.depth[input.range(&(l..l + 1))].to_vec()).collect();
                assert!(k < self.0 || near.start + self.0 == k, "the halo before the layer is missing");
                let range = out.range(&(k..k + 1));
                out.depth[range].fill(values.iter().sum::<f32>() / values.len() as f32);
            }
            Ok(())
        }
    }

    #[test]
    fn slabs_and_parts_of_any_thickness_give_the_same_and_make_each_layer_once() {
        let dimensions = [2, 1, 11];
        let filters: Vec<Box<dyn ImageFilter<4>>> = vec![Box::new(Mean(2)), Box::new(Mean(0)), Box::new(Mean(3))];
        let image = |range: Range<usize>, thickness: usize| {
            let mut asked = Vec::new();
            let mut chain = Chain::new(dimensions, range.start, Columns::DEPTH, &filters);
            let mut depth = Vec::new();
            for first in range.clone().step_by(thickness) {
                let mut source = |layers: Range<usize>| {
                    asked.extend(layers.clone());
                    let mut buffer = GBuffer::new(dimensions, layers.clone(), Columns::DEPTH);
                    layers.for_each(|k| {
                        let range = buffer.range(&(k..k + 1));
                        buffer.depth[range].fill((k * k) as f32);
                    });
                    Ok(buffer)
                };
                depth.extend(chain.next(range.end.min(first + thickness), &mut source, &Silent).unwrap().depth);
            }
            let needed = range.start.saturating_sub(5)..11.min(range.end + 5);
            assert_eq!(asked, needed.collect::<Vec<_>>(), "each layer once, and no more than are looked at");
            depth
        };
        let whole = image(0..11, 11);
        assert_eq!(whole.len(), 22);
        for thickness in [1, 2, 3, 7] {
            assert_eq!(image(0..11, thickness), whole, "{thickness}");
            for first in 0..11 {
                for end in first + 1..12 {
                    assert_eq!(
                        image(first..end, thickness),
                        whole[2 * first..2 * end],
                        "{first}..{end} by {thickness}"
                    );
                }
            }
        }
    }
}
