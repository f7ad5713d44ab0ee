//! What ray tracers get wrong: rays through shared facets, edges and vertices, slivers, far-off and tiny scenes, copies one
//! ulp apart. Each test counts what must not happen and demands that the count is zero; `cargo test --release --test
//! hard_cases -- --nocapture` prints the counts. In a debug build there are a hundred times fewer rays, unless AO4D_ALL_RAYS is set.
//!
//! Why a leak is a mistake, whatever the body's shape: every ray from a point around which a closed surface winds once
//! crosses it. Moving its vertices, by rounding or on purpose, can tear no hole as long as the surface is not pulled over
//! the point. So bodies here may be as distorted as they like, and the demand stays exact.

mod bodies;
mod leaks;
mod oddities;
mod pictures;
mod signs;

/// How many of something in a test: a hundredth in a debug build, unless all are asked for.
pub fn many(count: usize) -> usize {
    let all = !cfg!(debug_assertions) || std::env::var_os("AO4D_ALL_RAYS").is_some();
    if all { count } else { count / 100 + 1 }
}
