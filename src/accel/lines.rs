//! Memory for what rays visit: rows of eight numbers, in whole cache lines, in pages as large as the system has.
//!
//! A ray jumps through the hierarchy of a large mesh as it likes, and for each jump the processor looks up where the page is.
//! With pages of two megabytes instead of four kilobytes it finds most of them in its own table: a million triangles are
//! traced up to a third faster. Where a system has no such pages, or gives none, all is the same but for that.

use bytemuck::{Pod, Zeroable};
use memmap2::MmapMut;

/// Children of a node, and simplices of a leaf.
pub const WIDTH: usize = 8;

/// Eight numbers, one for each child of a node or each simplex of a leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Row(pub [f32; WIDTH]);

/// A cache line.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Line([Row; 2]);

/// Less memory than this is not worth large pages.
const LARGE: usize = 4 << 20;

/// Lines, all zero at first.
#[derive(Debug)]
pub(super) struct Lines {
    memory: Memory,
    count: usize,
}

#[derive(Debug)]
enum Memory {
    Pages(MmapMut),
    Plain(Vec<Line>),
}

impl Lines {
    /// None yet, but room for so many. The system gives memory only to those that are used.
    pub fn with_room(most: usize) -> Self {
        let bytes = most * size_of::<Line>();
        let memory = match MmapMut::map_anon(bytes) {
            Ok(map) if bytes >= LARGE => {
                #[cfg(target_os = "linux")]
                // It is only a wish.
                let _ = map.advise(memmap2::Advice::HugePage);
                Memory::Pages(map)
            }
            _ => Memory::Plain(Vec::with_capacity(most)),
        };
        Self { memory, count: 0 }
    }

    pub fn len(&self) -> usize {
        self.count
    }

    /// Adds lines, for which there must be room, and returns where they begin.
    pub fn add(&mut self, count: usize) -> usize {
        let place = self.count;
        self.count += count;
        if let Memory::Plain(lines) = &mut self.memory {
            lines.resize(self.count, Line::zeroed());
        }
        place
    }

    /// All lines as rows.
    #[inline]
    pub fn rows(&self) -> &[Row] {
        match &self.memory {
            Memory::Pages(map) => bytemuck::cast_slice(&map[..self.count * size_of::<Line>()]),
            Memory::Plain(lines) => bytemuck::cast_slice(lines),
        }
    }

    /// All lines as rows.
    pub fn rows_mut(&mut self) -> &mut [Row] {
        match &mut self.memory {
            Memory::Pages(map) => bytemuck::cast_slice_mut(&mut map[..self.count * size_of::<Line>()]),
            Memory::Plain(lines) => bytemuck::cast_slice_mut(lines),
        }
    }
}

impl Default for Lines {
    fn default() -> Self {
        Self { memory: Memory::Plain(Vec::new()), count: 0 }
    }
}

impl Clone for Lines {
    fn clone(&self) -> Self {
        let mut lines = Self::with_room(self.count);
        lines.add(self.count);
        lines.rows_mut().copy_from_slice(self.rows());
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_zero_kept_and_copied_in_either_memory() {
        for most in [10, 3 * LARGE / size_of::<Line>()] {
            let mut lines = Lines::with_room(most);
            assert_eq!([lines.add(3), lines.add(most - 3), lines.len()], [0, 3, most]);
            assert!(lines.rows().iter().all(|row| row.0 == [0.0; WIDTH]));
            assert_eq!((lines.rows().len(), lines.rows().as_ptr().addr() % 64), (2 * most, 0));
            lines.rows_mut()[2 * most - 1].0[7] = 5.0;
            let copy = lines.clone();
            lines.rows_mut()[2 * most - 1].0[7] = 6.0;
            assert_eq!(copy.rows()[2 * most - 1].0[7], 5.0);
        }
    }
}
