//! What the tests that damage their input at random have in common: a generator, the damage, and how long to look.
//!
//! The damage is drawn from a seed, so that what is found can be found again. Each test looks for three seconds;
//! `AO4D_FUZZ_SECONDS=600` looks longer, `AO4D_FUZZ_SEED=7` elsewhere, and `-- --nocapture` prints the counts.

use std::time::Duration;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a whole number"))
}

/// How long a test looks.
pub fn time() -> Duration {
    Duration::from_secs(number("AO4D_FUZZ_SECONDS").unwrap_or(3))
}

/// Where it begins.
pub fn random() -> Random {
    Random(number("AO4D_FUZZ_SEED").unwrap_or(1))
}

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    /// The next number.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`, or 0.
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.next() % n as u64) as usize }
    }
}

/// What hides in a header where damage hurts most.
const NASTY: [&[u8]; 12] = [
    b"-1",
    b"0",
    b"4294967295",
    b"18446744073709551615",
    b"1e999",
    b"nan",
    &[0xff; 4],
    &[0xff; 8],
    &[0, 0, 0, 0x80],
    &[0; 8],
    b"\n\n",
    b" ",
];

/// The bytes with one to four places damaged.
pub fn damage(original: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        match random.below(7) {
            0 => bytes.truncate(at),
            1 if at < bytes.len() => bytes[at] = random.next() as u8,
            2 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            3 => {
                let nasty = NASTY[random.below(NASTY.len())];
                let end = if random.below(2) == 0 { at } else { (at + nasty.len()).min(bytes.len()) };
                bytes.splice(at..end, nasty.iter().copied());
            }
            4 => {
                // A piece of the file elsewhere, or again.
                let piece = bytes[at..(at + random.below(40)).min(bytes.len())].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => drop(bytes.drain(at..(at + random.below(20)).min(bytes.len()))),
            _ => {
                // A number in a text becomes another.
                if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                    bytes[at + digit] = b"0123456789-."[random.below(12)];
                }
            }
        }
    }
    bytes
}
