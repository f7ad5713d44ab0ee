//! Sums over groups of rays of equal size. Groups grow as rays come in, so the number of rays need not be known before:
//! when there are 16, every two neighbours become one.

use std::iter::Sum;
use std::ops::Add;

/// Groups there are at least, once as many rays are known.
pub(super) const LEAST: usize = 8;

/// What rays bring, by group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Groups<T> {
    /// The sum of each finished group.
    sums: [T; 2 * LEAST],
    finished: usize,
    /// Rays a group.
    size: u32,
    /// Rays of the unfinished group, and their sum.
    begun: u32,
    open: T,
}

impl<T: Copy + Default + Add<Output = T> + Sum> Groups<T> {
    /// No rays yet.
    pub fn new() -> Self {
        Self { sums: [T::default(); 2 * LEAST], finished: 0, size: 1, begun: 0, open: T::default() }
    }

    /// The sums of as many groups as there are at least, of this size.
    pub fn of(size: u32, sums: [T; LEAST]) -> Self {
        let mut groups = Self { size, finished: LEAST, ..Self::new() };
        groups.sums[..LEAST].copy_from_slice(&sums);
        groups
    }

    /// The next rays, no more than there is [`room`](Self::room) for, and their sum.
    #[inline]
    pub fn add(&mut self, rays: u32, sum: T) {
        self.begun += rays;
        self.open = self.open + sum;
        if self.begun < self.size {
            return;
        }
        self.sums[self.finished] = self.open;
        self.finished += 1;
        (self.begun, self.open) = (0, T::default());
        if self.finished == self.sums.len() {
            for i in 0..LEAST {
                self.sums[i] = self.sums[2 * i] + self.sums[2 * i + 1];
            }
            self.finished = LEAST;
            self.size *= 2;
        }
    }

    /// How many rays the unfinished group lacks.
    pub fn room(&self) -> u32 {
        self.size - self.begun
    }

    /// Rays a group.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// The sums of the finished groups.
    pub fn finished(&self) -> &[T] {
        &self.sums[..self.finished]
    }

    /// Rays so far.
    pub fn rays(&self) -> u32 {
        self.finished as u32 * self.size + self.begun
    }

    /// The sum of all of them.
    pub fn sum(&self) -> T {
        self.finished().iter().copied().sum::<T>() + self.open
    }
}
