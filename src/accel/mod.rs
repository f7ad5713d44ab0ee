//! Bounding volume hierarchies over the simplices of a mesh, and the questions asked of them: which simplex does a ray hit
//! first, does it hit any, and which surfaces does it pass on its way.

mod apart;
mod build;
mod bvh;
mod lines;
mod node;
mod overlap;
mod passages;
mod places;
mod rows;
mod scale;
mod tracer;
mod wide;

pub use bvh::Bvh;
pub use lines::{Row, WIDTH};
pub use node::Node;
pub use passages::{Candidate, Passage, Wanted};
pub use places::Places;
pub use rows::{BOTTOM, LEAF, Leaf, NODE, Reference, WideNode, place};
pub use scale::Scale;
pub use tracer::{Hit, Tracer};
pub use wide::WideBvh;
