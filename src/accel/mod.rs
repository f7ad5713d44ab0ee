//! Bounding volume hierarchies over the simplices of a mesh, and the two questions asked of them: which simplex does
//! a ray hit first, and does it hit any.

mod apart;
mod build;
mod bvh;
mod node;
mod overlap;
mod tracer;
mod wide;

pub use bvh::Bvh;
pub use node::Node;
pub use tracer::{Hit, Tracer};
pub use wide::{Leaf, Scale, TAG_BITS, WIDTH, WideBvh, WideNode};
