//! What becomes of the rays of a launch.

/// A bit for each ray, in words of 32, the first in the lowest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Bits(pub Vec<u32>);

impl Bits {
    /// Room for so many, none of them set.
    pub fn new(count: usize) -> Self {
        Self(vec![0; count.div_ceil(32)])
    }

    /// Those from `first` on, `count` of them, 1 to 64; the first is the lowest.
    pub fn from(&self, first: usize, count: usize) -> u64 {
        let word = |k: usize| u128::from(self.0.get(first / 32 + k).copied().unwrap_or(0)) << (32 * k);
        let bits = ((word(0) | word(1) | word(2)) >> (first % 32)) as u64;
        bits & (u64::MAX >> (64 - count))
    }

    /// Sets or clears one.
    pub fn set(&mut self, place: usize, value: bool) {
        let bit = 1 << (place % 32);
        let word = &mut self.0[place / 32];
        *word = if value { *word | bit } else { *word & !bit };
    }

    /// The places of those that are set, ascending.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        let words = self.0.iter().enumerate().filter(|(_, word)| **word != 0);
        words.flat_map(|(k, word)| (0..32).filter(move |bit| word >> bit & 1 == 1).map(move |bit| 32 * k + bit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_found() {
        let places: Vec<usize> = (0..150).filter(|n| n * n % 7 == 2).collect();
        let mut bits = Bits::new(150);
        (0..150).for_each(|place| bits.set(place, true));
        (0..150).filter(|place| !places.contains(place)).for_each(|place| bits.set(place, false));
        assert_eq!(bits.places().collect::<Vec<_>>(), places);
        for first in 0..150 {
            for count in 1..=(150 - first).min(64) {
                let expected: u64 = (0..count).filter(|k| places.contains(&(first + k))).map(|k| 1u64 << k).sum();
                assert_eq!(bits.from(first, count), expected, "{first} {count}");
            }
        }
    }
}
