//! What the library does: scenes, occlusion, pictures and files, each by its own claims (the table in `tests/README.md`).
//! One program, since each costs seconds to link.

#[path = "../support/fuzz.rs"]
mod fuzz;
#[path = "../support/on_rays.rs"]
mod on_rays;
#[path = "../support/mod.rs"]
mod support;

mod as_programmed;
mod as_published;
mod bodies;
mod bodies_files;
mod caps;
mod corners;
mod exact;
mod fuzz_readers;
mod fuzz_texts;
mod image_files;
mod keys;
mod mask;
mod meshes;
mod methods;
mod occlusion_exact_values;
mod packets;
mod scenes;
mod session;
mod table;
mod tracing;
mod visibility;
