//! Exact ambient occlusion: against values known by other means, on scenes made to break it, and its speed.

/// Tests that are generic in the dimension, each run in both.
macro_rules! in_3d_and_4d {
    ($($name:ident)*) => { $(
        mod $name {
            #[test] fn in_3d() { super::$name::<3>() }
            #[test] fn in_4d() { super::$name::<4>() }
        }
    )* };
}

mod directed;
mod oracles;
mod robustness;
mod scenes;
mod time;
