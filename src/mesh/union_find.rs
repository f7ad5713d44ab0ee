//! Sets that grow together: which things are connected, when all that is known is pairs.
//!
//! A forest in which each tree is a set and its root, the lowest member, stands for it. Looking for a root halves the
//! way for whoever comes after, so that paths stay short.

/// Disjoint sets of 0, 1, ..., n - 1.
#[derive(Clone, Debug)]
pub struct UnionFind {
    parents: Vec<u32>,
    sets: usize,
}

impl UnionFind {
    /// Each of the n is a set of its own.
    pub fn new(n: usize) -> Self {
        Self { parents: (0..n as u32).collect(), sets: n }
    }

    /// The lowest member of the set that holds `i`.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.parents[i as usize] != i {
            self.parents[i as usize] = self.parents[self.parents[i as usize] as usize];
            i = self.parents[i as usize];
        }
        i
    }

    /// Makes one set of those that hold `a` and `b`.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parents[a.max(b) as usize] = a.min(b);
            self.sets -= 1;
        }
    }

    /// How many sets there are.
    pub fn sets(&self) -> usize {
        self.sets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_member_stands_for_a_set() {
        let mut sets = UnionFind::new(6);
        for (a, b) in [(5, 3), (3, 4), (1, 2), (4, 5)] {
            sets.join(a, b);
        }
        assert_eq!(sets.sets(), 3);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|i| sets.root(i)), [0, 1, 1, 3, 3, 3]);
    }
}
