//! The G-buffer: what the voxels of some layers show, one column a quantity.
//!
//! A voxel shows at most one surface point: what the ray through its centre hits first, or, where voxels are
//! supersampled and the centre sees nothing, the sample nearest to the centre that sees something. Its simplex,
//! position, normals and object are those of that point; coverage, depth, albedo, direct light and occlusion are means over
//! the samples of the voxel that see something.
//!
//! Only columns that some output or filter asks for are held; the others are empty. The list below is the only place
//! that names them: a new quantity is one row here, and a line where it is computed.

use std::ops::Range;

use bitflags::bitflags;

use super::NOTHING;
use crate::geometry::Vector;

macro_rules! columns {
    ($($(#[doc = $doc:literal])+ $field:ident $flag:ident: $type:ty = $background:expr;)+) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms)]
        enum Number { $($flag),+ }

        bitflags! {
            /// A set of columns.
            #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
            pub struct Columns: u32 {
                $($(#[doc = $doc])+ const $flag = 1 << Number::$flag as u32;)+
            }
        }

        impl Columns {
            /// Bytes that these columns take, a voxel.
            pub fn bytes<const D: usize>(self) -> usize {
                [$((Self::$flag, size_of::<$type>())),+]
                    .into_iter()
                    .filter(|(flag, _)| self.contains(*flag))
                    .map(|(_, bytes)| bytes)
                    .sum()
            }
        }

        /// What the voxels of some layers show. A column that was not asked for is empty.
        #[derive(Clone, Debug, PartialEq)]
        pub struct GBuffer<const D: usize> {
            dimensions: [usize; 3],
            layers: Range<usize>,
            columns: Columns,
            $($(#[doc = $doc])+ pub $field: Vec<$type>,)+
        }

        /// One row of voxels of a G-buffer, to be filled. A column that was not asked for is empty.
        #[allow(dead_code, reason = "some columns are filled otherwise")]
        pub(super) struct RowMut<'g, const D: usize> {
            $(pub $field: &'g mut [$type],)+
        }

        impl<const D: usize> GBuffer<D> {
            /// Some layers of an image of these dimensions, whose voxels see nothing yet.
            pub fn new(dimensions: [usize; 3], layers: Range<usize>, columns: Columns) -> Self {
                let len = dimensions[0] * dimensions[1] * layers.len();
                $(let $field = vec![$background; if columns.contains(Columns::$flag) { len } else { 0 }];)+
                Self { dimensions, layers, columns, $($field),+ }
            }

            /// Adds the layers that follow.
            ///
            /// # Panics
            /// If `next` begins elsewhere, or has other columns.
            pub fn append(&mut self, mut next: Self) {
                assert_eq!((self.layers.end, self.columns), (next.layers.start, next.columns));
                self.layers.end = next.layers.end;
                $(self.$field.append(&mut next.$field);)+
            }

            /// A copy of some of its layers.
            pub fn copy_of(&self, layers: Range<usize>) -> Self {
                let range = self.range(&layers);
                $(let $field = if self.$field.is_empty() { Vec::new() } else { self.$field[range.clone()].to_vec() };)+
                Self { dimensions: self.dimensions, layers, columns: self.columns, $($field),+ }
            }

            /// Forgets the layers before this one.
            pub fn forget_before(&mut self, layer: usize) {
                let layer = layer.clamp(self.layers.start, self.layers.end);
                let gone = self.range(&(self.layers.start..layer)).end;
                $(if !self.$field.is_empty() { self.$field.drain(..gone); })+
                self.layers.start = layer;
            }

            /// Its rows, in order.
            pub(super) fn rows_mut(&mut self) -> Vec<RowMut<'_, D>> {
                let (width, rows) = (self.dimensions[0], self.dimensions[1] * self.layers.len());
                $(let mut $field = self.$field.chunks_mut(width);)+
                (0..rows).map(|_| RowMut { $($field: $field.next().unwrap_or_default()),+ }).collect()
            }
        }
    };
}

columns! {
    /// The simplex, or [`NOTHING`].
    simplex SIMPLEX: u32 = NOTHING;
    /// Barycentric coordinates of the point in the order of the simplex's corners; zero where nothing is.
    barycentric BARYCENTRIC: [f32; D] = [0.0; D];
    /// The point in R^D; the origin where nothing is.
    position POSITION: Vector<D> = Vector::zeros();
    /// Distance from the eye, in the scene's units; infinite where nothing is.
    depth DEPTH: f32 = f32::INFINITY;
    /// The simplex's unit normal, on the side that is seen; zero where nothing is.
    normal NORMAL: Vector<D> = Vector::zeros();
    /// The unit normal interpolated between the simplex's vertices, on the side that is seen; zero where nothing is.
    shading_normal SHADING_NORMAL: Vector<D> = Vector::zeros();
    /// The object's number from 1; 0 where nothing is.
    object OBJECT: u16 = 0;
    /// What of open ambient light the voxel sends to the eye: the object's colour, or, where lights are, linear light. Where
    /// a voxel shows several, their mean weighted by occlusion, so that this times occlusion is the mean of the products.
    /// White where nothing is.
    albedo ALBEDO: [f32; 3] = [1.0; 3];
    /// What else it sends to the eye, linear RGB: the light of lights, and of depth cues. Only lit pictures have it; black
    /// where nothing is.
    direct DIRECT: [f32; 3] = [0.0; 3];
    /// What objects behind send through the first, as shown or, where lights are, as linear light. Only scenes with objects that let
    /// light through have it, and there albedo and direct are what the first surface keeps; black where nothing is.
    behind BEHIND: [f32; 3] = [0.0; 3];
    /// The share of the light from behind all that is seen which passes it; 0 where nothing is.
    through THROUGH: f32 = 0.0;
    /// Ambient occlusion, 1 is open; 1 where nothing is.
    occlusion OCCLUSION: f32 = 1.0;
    /// Ambient occlusion interpolated between the simplex's vertices, where the occlusion itself is found otherwise; 1
    /// where nothing is.
    interpolated INTERPOLATED: f32 = 1.0;
    /// The occlusion that the surroundings of a voxel suggest; 1 where nothing is.
    fitted FITTED: f32 = 1.0;
    /// The variance of what such suggestions leave out; 0 where nothing is.
    misfit MISFIT: f32 = 0.0;
    /// The standard error of the occlusion; 0 where nothing is.
    error ERROR: f32 = 0.0;
    /// The mean open direction: the vector b over the occlusion; zero where nothing is, or nothing is open.
    direction DIRECTION: Vector<D> = Vector::zeros();
    /// The mean light of what hides the sky, red, green and blue: the bounce over one less the occlusion; black where nothing is, or
    /// all is open.
    hidden HIDDEN: [f32; 3] = [0.0; 3];
    /// The standard error of the bounce; 0 where nothing is.
    bounce_error BOUNCE_ERROR: f32 = 0.0;
    /// The light that arrives from the sky and from other surfaces, where an open surface under a sky of 1 has 1; 1 where
    /// nothing is.
    irradiance IRRADIANCE: [f32; 3] = [1.0; 3];
    /// The part of the voxel that sees something, 0 to 1.
    coverage COVERAGE: f32 = 0.0;
    /// How many surfaces the ray through the voxel's centre passes, 65,535 at most; 0 where nothing is.
    passages PASSAGES: u16 = 0;
}

impl<const D: usize> GBuffer<D> {
    /// Which layers of the image these are.
    pub fn layers(&self) -> Range<usize> {
        self.layers.clone()
    }

    /// Voxels of the whole image along each axis.
    pub fn dimensions(&self) -> [usize; 3] {
        self.dimensions
    }

    /// Voxels of a layer.
    pub fn layer_len(&self) -> usize {
        self.dimensions[0] * self.dimensions[1]
    }

    /// Which columns it has.
    pub fn columns(&self) -> Columns {
        self.columns
    }

    /// The part of what is behind a voxel that it hides: its coverage, less what light passes.
    pub fn opacity(&self, voxel: usize) -> f32 {
        self.coverage[voxel] * (1.0 - self.through.get(voxel).copied().unwrap_or_default())
    }

    /// How many voxels there are.
    pub fn len(&self) -> usize {
        self.layer_len() * self.layers.len()
    }

    /// Whether there are no voxels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The places of some layers' voxels in the columns.
    ///
    /// # Panics
    /// If it doesn't have those layers.
    pub fn range(&self, layers: &Range<usize>) -> Range<usize> {
        assert!(self.layers.start <= layers.start && layers.end <= self.layers.end, "{layers:?} of {:?}", self.layers);
        (layers.start - self.layers.start) * self.layer_len()..(layers.end - self.layers.start) * self.layer_len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_nobody_asked_for_take_no_memory() {
        let columns = Columns::SIMPLEX | Columns::NORMAL;
        let buffer = GBuffer::<4>::new([3, 2, 7], 2..5, columns);
        assert_eq!((buffer.simplex.len(), buffer.normal.len(), buffer.len()), (18, 18, 18));
        assert!(buffer.position.is_empty() && buffer.occlusion.is_empty() && buffer.coverage.is_empty());
        assert_eq!(columns.bytes::<4>(), 4 + 16);
        assert_eq!(columns.bytes::<3>(), 4 + 12);
    }

    #[test]
    fn layers_are_added_copied_and_forgotten() {
        let columns = Columns::SIMPLEX | Columns::DEPTH;
        let layer = |k: usize| {
            let mut buffer = GBuffer::<3>::new([2, 1, 9], k..k + 1, columns);
            buffer.simplex.fill(k as u32);
            buffer
        };
        let mut buffer = layer(3);
        (4..8).for_each(|k| buffer.append(layer(k)));
        assert_eq!(buffer.simplex, [3, 3, 4, 4, 5, 5, 6, 6, 7, 7]);
        assert_eq!(buffer.copy_of(4..6).simplex, [4, 4, 5, 5]);
        buffer.forget_before(6);
        assert_eq!((buffer.layers(), buffer.simplex.as_slice()), (6..8, &[6, 6, 7, 7][..]));
        buffer.forget_before(2);
        assert_eq!(buffer.layers(), 6..8);
        assert_eq!(buffer.depth.len(), 4);
        buffer.append(layer(8));
        assert_eq!(buffer.rows_mut().len(), 3);
    }
}
