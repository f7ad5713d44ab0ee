//! The methods of occlusion against each other and against the truth, on the scenes of the pipelines and on random ones.

/// Tests that are generic in the dimension, each run in both.
macro_rules! in_3d_and_4d {
    ($($name:ident)*) => { $(
        mod $name {
            #[test] fn in_3d() { super::$name::<3>() }
            #[test] fn in_4d() { super::$name::<4>() }
        }
    )* };
}

mod errors;
mod exact;
mod light;
mod pipelines;
mod scenes;
