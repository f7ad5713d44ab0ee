//! Which samples of a voxel see what: the voxel's centre alone, or N samples along each axis.
//!
//! Supersampling looks at a finer image of the same extent, N voxels of it for each one along each axis of the image. The
//! samples of a voxel that see the same simplex make a group, and stand where their mean is: what is interpolated over a
//! simplex is linear but for perspective, so the value at the mean place is the mean of the values.

use std::ops::Range;

use super::{Camera, NOTHING, Passages, Visibility};
use crate::geometry::Ray;
use crate::occlusion::Error;
use crate::progress::{Progress, Uncounted};
use crate::volume::Grid;

/// The most samples along an axis.
pub const MOST: usize = 8;

/// How voxels are sampled.
#[derive(Clone, Debug)]
pub(super) struct Sampling {
    /// Samples along each axis of the image.
    pub per_axis: [usize; 3],
    /// The voxels themselves.
    pub grid: Grid,
    /// The finer image whose voxels are the samples.
    pub fine: Grid,
    /// Where each sample of the voxel (0, 0, 0) is in the finer image.
    offsets: Vec<usize>,
    /// Where each is among the others, along each axis.
    places: Vec<[usize; 3]>,
    /// All of them as one group's `sums`.
    sums: [usize; 3],
    /// The samples of a voxel by their distance from its centre, nearest first.
    by_distance: Vec<usize>,
}

/// Samples of a voxel that see the same simplex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Group {
    pub simplex: u32,
    pub count: usize,
    /// The sums of their places among the voxel's samples.
    sums: [usize; 3],
}

impl Group {
    /// Adds a sample at this place among the voxel's to the group of what it sees.
    fn add(groups: &mut Vec<Self>, simplex: u32, place: [usize; 3]) -> usize {
        let group = groups.iter().position(|group| group.simplex == simplex).unwrap_or_else(|| {
            groups.push(Self { simplex, count: 0, sums: [0; 3] });
            groups.len() - 1
        });
        groups[group].count += 1;
        (0..3).for_each(|a| groups[group].sums[a] += place[a]);
        group
    }
}

impl Sampling {
    /// `samples` along each axis that the image of a scene of dimension D has.
    pub fn new<const D: usize>(camera: &Camera<D>, grid: &Grid, samples: usize) -> Self {
        let per_axis = std::array::from_fn(|a| if a < D - 1 { samples } else { 1 });
        let fine = camera.grid(std::array::from_fn(|a| grid.dimensions[a] * per_axis[a]));
        let [x, y, z] = per_axis;
        let places: Vec<[usize; 3]> = (0..x * y * z).map(|n| [n % x, n / x % y, n / x / y]).collect();
        let offsets = places.iter().map(|[x, y, z]| x + fine.dimensions[0] * (y + fine.dimensions[1] * z)).collect();
        let sums = std::array::from_fn(|a| places.iter().map(|place| place[a]).sum());
        let distance = |n: usize| -> usize {
            // Twice the distance from the middle is a whole number.
            places[n].iter().zip(per_axis).map(|(&i, count)| (2 * i + 1).abs_diff(count).pow(2)).sum()
        };
        let mut by_distance: Vec<usize> = (0..places.len()).collect();
        by_distance.sort_by_key(|&n| (distance(n), n));
        Self { per_axis, grid: *grid, fine, offsets, places, sums, by_distance }
    }

    /// Samples of a voxel.
    pub fn count(&self) -> usize {
        self.offsets.len()
    }

    /// What the samples of some layers of voxels see.
    ///
    /// # Errors
    /// Those of [`Visibility::first_hits`].
    pub fn first_hits<const D: usize>(
        &self,
        visibility: &Visibility<D>,
        layers: &Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, Error> {
        let z = self.per_axis[2];
        Ok(visibility.first_hits(layers.start * z..layers.end * z, progress)?)
    }

    /// All that the samples of some layers of voxels pass.
    ///
    /// # Errors
    /// Those of [`Visibility::passages`].
    pub fn passages<const D: usize>(
        &self,
        visibility: &Visibility<D>,
        layers: &Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Passages, Error> {
        let z = self.per_axis[2];
        Ok(visibility.passages(layers.start * z..layers.end * z, usize::MAX, &Uncounted(progress))?)
    }

    /// Where the samples of voxel (i, j) of the `layer`-th layer are among those of these layers, with their numbers.
    pub fn of_voxel(&self, [i, j, layer]: [usize; 3]) -> impl Iterator<Item = (usize, usize)> + '_ {
        let ([x, y, z], [width, height, _]) = (self.per_axis, self.fine.dimensions);
        let first = i * x + width * (j * y + height * layer * z);
        self.offsets.iter().enumerate().map(move |(n, offset)| (n, first + offset))
    }

    /// Adds sample `n` of a voxel to the group of what it sees; returns which that is.
    pub fn add_to(&self, groups: &mut Vec<Group>, simplex: u32, n: usize) -> usize {
        Group::add(groups, simplex, self.places[n])
    }

    /// What the samples of voxel (i, j) of the `layer`-th layer see, of what [`Sampling::first_hits`] found: the groups
    /// of those that see something, in the order of their first samples; and the sample nearest to the centre that does,
    /// with its simplex.
    pub fn groups(&self, found: &[u32], [i, j, layer]: [usize; 3], groups: &mut Vec<Group>) -> Option<(usize, u32)> {
        groups.clear();
        let ([x, y, z], [width, height, _]) = (self.per_axis, self.fine.dimensions);
        let samples = &found[i * x + width * (j * y + height * layer * z)..];
        let first = samples[0];
        if self.offsets.iter().all(|&offset| samples[offset] == first) {
            // As of most voxels.
            let group = Group { simplex: first, count: self.count(), sums: self.sums };
            groups.extend((first != NOTHING).then_some(group));
            return groups.first().map(|group| (self.by_distance[0], group.simplex));
        }
        for (&place, &offset) in self.places.iter().zip(&self.offsets) {
            let simplex = samples[offset];
            if simplex == NOTHING {
                continue;
            }
            Group::add(groups, simplex, place);
        }
        self.by_distance.iter().map(|&n| (n, samples[self.offsets[n]])).find(|&(_, simplex)| simplex != NOTHING)
    }

    /// The samples of voxel (i, j) of the `layer`-th layer that see this simplex.
    pub fn of_simplex<'f>(
        &'f self,
        found: &'f [u32],
        [i, j, layer]: [usize; 3],
        simplex: u32,
    ) -> impl Iterator<Item = usize> + 'f {
        let ([x, y, z], [width, height, _]) = (self.per_axis, self.fine.dimensions);
        let samples = &found[i * x + width * (j * y + height * layer * z)..];
        (0..self.offsets.len()).filter(move |&n| samples[self.offsets[n]] == simplex)
    }

    /// The ray of a sample of a voxel (i, j, k) of the image.
    pub fn ray<const D: usize>(&self, camera: &Camera<D>, index: [usize; 3], n: usize) -> Ray<D> {
        let place = self.places[n];
        let middle = (0..3).all(|a| 2 * place[a] + 1 == self.per_axis[a]);
        if middle {
            return camera.voxel_ray(&self.grid, index);
        }
        camera.voxel_ray(&self.fine, std::array::from_fn(|a| index[a] * self.per_axis[a] + place[a]))
    }

    /// The ray to where the mean of a group's samples is.
    pub fn mean_ray<const D: usize>(&self, camera: &Camera<D>, index: [usize; 3], group: &Group) -> Ray<D> {
        let centred = (0..3).all(|a| 2 * group.sums[a] + group.count == self.per_axis[a] * group.count);
        if centred {
            return camera.voxel_ray(&self.grid, index);
        }
        let steps: [f64; 3] = std::array::from_fn(|a| {
            let mean = group.sums[a] as f64 / group.count as f64;
            2.0 * ((index[a] * self.per_axis[a]) as f64 + mean) + 1.0 - self.fine.dimensions[a] as f64
        });
        camera.ray(std::array::from_fn(|a| if a < D - 1 { 0.5 * self.fine.spacing[a] * steps[a] } else { 0.0 }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::View;

    fn samplings<const D: usize>(samples: usize) -> (Camera<D>, Sampling) {
        let camera = Camera::<D>::new(&View::default()).unwrap();
        let grid = camera.grid([4, 3, if D == 4 { 2 } else { 1 }]);
        let sampling = Sampling::new(&camera, &grid, samples);
        (camera, sampling)
    }

    #[test]
    fn samples_fill_the_image() {
        let (_, three) = samplings::<3>(3);
        assert_eq!((three.count(), three.fine.dimensions), (9, [12, 9, 1]));
        let (_, four) = samplings::<4>(2);
        assert_eq!((four.count(), four.fine.dimensions), (8, [8, 6, 4]));
        // Of an odd number one is at the centre, and comes first.
        assert_eq!(three.by_distance[0], 4);
    }

    #[test]
    fn groups_hold_what_sees_the_same_and_stand_at_its_mean() {
        let (camera, sampling) = samplings::<4>(2);
        let mut found = vec![NOTHING; sampling.fine.len()];
        let fine = |i: usize, j: usize, k: usize| i + 8 * (j + 6 * k);
        // Of voxel (1, 2, 0): both samples at the low end of y and z see simplex 7, one across sees simplex 5.
        (found[fine(2, 4, 0)], found[fine(3, 4, 0)], found[fine(3, 5, 1)]) = (7, 7, 5);
        let mut groups = Vec::new();
        let nearest = sampling.groups(&found, [1, 2, 0], &mut groups).unwrap();
        assert_eq!(groups.iter().map(|g| (g.simplex, g.count)).collect::<Vec<_>>(), [(7, 2), (5, 1)]);
        assert_eq!(nearest, (0, 7));
        // Between the two samples, which are a quarter of a voxel off the centre along y and z.
        let ray = sampling.mean_ray(&camera, [1, 2, 0], &groups[0]);
        let centre = sampling.grid.point([1, 2, 0]);
        let quarter = sampling.grid.spacing.map(|s| s / 4.0);
        let expected = camera.ray([centre[0], centre[1] - quarter[1], centre[2] - quarter[2]]);
        assert!((ray.direction - expected.direction).amax() < 1e-6);
        assert_eq!(sampling.groups(&found, [0, 0, 0], &mut groups), None);
        assert!(groups.is_empty());
    }
}
