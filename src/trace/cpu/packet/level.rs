//! The instructions that the packet tracer is compiled for, and which of them this processor has.
//!
//! The features of a level are listed once, in a macro that hands them to another: to the one that asks the processor
//! for every one of them, and to the one that compiles the engine with them. So the engine never runs an instruction
//! that nobody asked for.

/// Hands the features of [`Level::Avx2`] to a macro.
#[cfg(target_arch = "x86_64")]
macro_rules! with_avx2 {
    ($then:ident) => {
        $then! { "avx2" "fma" "bmi1" "bmi2" "lzcnt" "popcnt" }
    };
}

/// Hands the features of [`Level::Avx512`] to a macro.
#[cfg(target_arch = "x86_64")]
macro_rules! with_avx512 {
    ($then:ident) => {
        $then! { "avx2" "fma" "bmi1" "bmi2" "lzcnt" "popcnt" "avx512f" "avx512vl" "avx512bw" "avx512dq" }
    };
}

#[cfg(target_arch = "x86_64")]
pub(super) use {with_avx2, with_avx512};

/// Whether the processor has all of these.
#[cfg(target_arch = "x86_64")]
macro_rules! detected {
    ($($feature:tt)+) => { true $(&& is_x86_feature_detected!($feature))+ };
}

/// The instructions that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What the compiler makes of plain loops: any processor.
    Portable,
    /// AVX2 with fused multiplication and addition: x86-64 since 2013.
    Avx2,
    /// The masks of AVX-512, on registers of 256 bits.
    Avx512,
}

impl Level {
    /// What this processor offers, slowest first.
    pub fn available() -> Vec<Self> {
        let mut levels = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if with_avx2!(detected) {
                levels.push(Self::Avx2);
            }
            if with_avx512!(detected) {
                levels.push(Self::Avx512);
            }
        }
        levels
    }

    /// The fastest level of this processor.
    pub fn best() -> Self {
        Self::available().into_iter().max().unwrap_or(Self::Portable)
    }
}
