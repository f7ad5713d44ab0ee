//! From YAML to work: what a user wrote is read, checked and resolved before anything runs.
//!
//! Two types stand for the two halves. [`spec`] is the pipeline as written: keys and values, nothing looked up.
//! [`plan`] is the pipeline as understood: every stage knows by index what it works on, every default is filled in,
//! every range checked, every file named once. The way from one to the other refuses whatever can be refused without
//! running, with file, line and the nearest right word, so that `ao4d check` and `ao4d run` refuse the same things.
//!
//! ```text
//! text --yaml--> tree --overrides--> tree --serde--> spec --plan--> Plan
//!                  \________________ lines _________________/
//! ```

mod cut;
mod document;
mod error;
mod object;
mod one_or_many;
pub mod overrides;
pub mod spec;
mod suggest;
mod yaml;

pub use cut::{Axis, Cut, Plane};
pub use document::Document;
pub use error::{Error, Invalid, Place, Refusal};
