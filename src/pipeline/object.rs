//! An object as a pipeline writes it.

use schemars::JsonSchema;
use serde::Deserialize;

/// An object of a scene: one shape, and how it looks.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectSpec {
    /// What the object is called in messages and files.
    pub name: Option<String>,
    /// Vertices and cells written out.
    pub simplices: Option<SimplicesSpec>,
}

/// Simplices written out.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimplicesSpec {
    /// The points: as many numbers each as the scene has dimensions.
    pub vertices: Vec<Vec<f64>>,
    /// Which vertices, counted from 0, each simplex joins: as many as the scene has dimensions.
    pub cells: Vec<Vec<u32>>,
}
