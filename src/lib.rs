//! `ao4d` turns a YAML pipeline into pictures of four-dimensional scenes with ray-traced ambient occlusion.
//!
//! A scene is a set of tetrahedra in R^4 (or of triangles in R^3, through the same code); a picture of it is a volume of
//! voxels (or of pixels), which ParaView opens. Data flows one way:
//!
//! ```text
//! text -> pipeline -> io, scene -> mesh -> accel -> trace -> occlusion -> render -> io -> files
//! ```
//!
//! ```no_run
//! use ao4d::pipeline::{Pipeline, Settings, run};
//! use ao4d::progress::Silent;
//!
//! let pipeline = Pipeline::load("pipelines/two_tetrahedra.yaml".as_ref(), &[], None)?;
//! let report = run(&pipeline, &Settings::default(), &Silent)?;
//! println!("{report}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// The command line names the library as any program does.
extern crate self as ao4d;

pub mod accel;
pub mod cli;
pub mod geometry;
pub mod input;
pub mod inspect;
pub mod io;
pub mod mesh;
pub mod occlusion;
pub mod pipeline;
pub mod progress;
pub mod render;
pub mod scene;
pub mod session;
pub mod stages;
pub mod text;
pub mod trace;
pub mod volume;
