//! The lines of a wireframe: edges as a camera sees them, or as arcs of the stereographic projection.
//!
//! Straight lines of R^D are straight in a camera's image, so an edge is a line there between the images of its ends.
//!
//! Which parts of it are hidden is asked as a depth image tells it, but at the edge's own points, one in the middle of each
//! piece about a voxel long: the ray of the image through that point sees something before it, or not. Along an edge the ray
//! hits the simplices at it, at the same distance but for rounding, so only what is nearer by [`NEARER`] hides it.

use std::collections::HashMap;
use std::path::Path;

use crate::geometry::{Cone, Dimension, Ray, Vector, Vector64, narrow, widen};
use crate::io::{self, AtomicFile, PIPELINE, vtp};
use crate::mesh::Mesh;
use crate::mesh::edges::Edge;
use crate::mesh::stereographic::{NoImage, Stereographic};
use crate::progress::Progress;
use crate::render::{Camera, Projection};
use crate::trace::{self, NOTHING, RayBackend};
use crate::volume::Array;

/// What hides an edge is nearer by this share of the way to it.
const NEARER: f64 = 1e-4;
/// The most pieces of an edge that are looked at; longer ones reach far beyond the image.
const PIECES: f64 = 1000.0;
/// Rays that are traced at once.
const BATCH: usize = 1 << 16;

/// Edges as they are shown.
pub(super) struct Lines<const D: usize> {
    /// Where each point is in space, and in the image.
    points: Vec<(Vector<D>, [f32; 3])>,
    /// How far each is from the eye; none without an eye.
    depth: Vec<f32>,
    /// The object of each.
    object: Vec<u16>,
    /// Two points each.
    pub lines: Vec<[u32; 2]>,
    /// Whether each line is seen, where that was asked.
    visible: Option<Vec<u8>>,
}

impl<const D: usize> Lines<D> {
    fn empty() -> Self {
        Self { points: Vec::new(), depth: Vec::new(), object: Vec::new(), lines: Vec::new(), visible: None }
    }

    /// Projects the edges, without what is nearer to the eye than `near`.
    pub fn seen(mesh: &Mesh<D>, camera: &Camera<D>, near: f64, edges: &[Edge]) -> Self {
        let mut made = Self::empty();
        let mut numbers: HashMap<u32, Option<u32>> = HashMap::new();
        for edge in edges {
            let [a, b] = edge.ends.map(|v| mesh.vertices[v as usize]);
            let distances = [a, b].map(|point| camera.project(&point).1);
            if distances.iter().all(|&distance| distance < near) {
                continue;
            }
            let cut = || {
                let share = (near - distances[0]) / (distances[1] - distances[0]);
                narrow(&(widen(&a) + (widen(&b) - widen(&a)) * share))
            };
            let mut ends = [None; 2];
            for (end, (vertex, distance)) in ends.iter_mut().zip(edge.ends.into_iter().zip(distances)) {
                *end = if distance < near {
                    made.add_seen(camera, cut(), edge.object)
                } else {
                    let point = mesh.vertices[vertex as usize];
                    *numbers.entry(vertex).or_insert_with(|| made.add_seen(camera, point, edge.object))
                };
            }
            if let [Some(a), Some(b)] = ends {
                made.lines.push([a, b]);
            }
        }
        made
    }

    /// Projects the edges stereographically, each in as many lines as make it round.
    ///
    /// # Errors
    /// If one has no image: why, and the object.
    pub fn projected(mesh: &Mesh<D>, map: &Stereographic<D>, edges: &[Edge]) -> Result<Self, (NoImage, u32)> {
        let mut made = Self::empty();
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        for edge in edges {
            let [from, to] = edge.ends.map(|v| widen(&mesh.vertices[v as usize]));
            let shares = map.arc(&from, &to).map_err(|why| (why, edge.object))?;
            let mut before = None;
            for (i, share) in shares.iter().enumerate() {
                let mut add = |point: Vector64<D>| {
                    let image = map.image(&point).map(|x| x as f32);
                    made.add(narrow(&point), image, edge.object)
                };
                let number = match i {
                    0 => *numbers.entry(edge.ends[0]).or_insert_with(|| add(from)),
                    i if i + 1 == shares.len() => *numbers.entry(edge.ends[1]).or_insert_with(|| add(to)),
                    _ => add(from + (to - from) * *share),
                };
                made.lines.extend(before.map(|before| [before, number]));
                before = Some(number);
            }
        }
        Ok(made)
    }

    fn add(&mut self, point: Vector<D>, image: [f32; 3], object: u32) -> u32 {
        self.points.push((point, image));
        self.object.push(object as u16 + 1);
        self.points.len() as u32 - 1
    }

    /// Adds a point, if it has an image.
    fn add_seen(&mut self, camera: &Camera<D>, point: Vector<D>, object: u32) -> Option<u32> {
        let (image, distance) = camera.project(&point);
        let seen = image.map(|x| x as f32 + 0.0);
        if !seen.iter().all(|x| x.is_finite()) {
            return None;
        }
        self.depth.push((distance * slant(camera, image)) as f32);
        Some(self.add(point, seen, object))
    }

    /// Cuts the lines where what is seen of them begins and ends, to a piece of about this length in the image, and tells
    /// which are seen; with `leave_out` only those stay.
    ///
    /// # Errors
    /// If `progress` says to stop, or a device fails.
    pub fn look(
        &mut self,
        backend: &dyn RayBackend<D>,
        camera: &Camera<D>,
        piece: f64,
        leave_out: bool,
        progress: &dyn Progress,
    ) -> Result<(), trace::Error> {
        let mesh = backend.tracer().mesh();
        let (lines, mut kept, mut visible) = (std::mem::take(&mut self.lines), Vec::new(), Vec::new());
        let mut rest = &lines[..];
        while !rest.is_empty() {
            // As many lines as fill a batch of rays.
            let (mut rays, mut asked) = (Vec::new(), Vec::new());
            while let Some((line, others)) = rest.split_first().filter(|_| rays.len() < BATCH) {
                rest = others;
                let way = Way::new(camera, line.map(|i| self.points[i as usize].0));
                let pieces = way.pieces(piece);
                for k in 0..pieces {
                    let (image, depth) = way.at((k as f64 + 0.5) / pieces as f64);
                    rays.push((camera.ray(image), depth));
                }
                asked.push((*line, way, pieces));
            }
            let only: Vec<Ray<D>> = rays.iter().map(|(ray, _)| *ray).collect();
            let hits = backend.first_hits(&only, None, progress)?;
            let mut seen = rays.iter().zip(&hits).map(|((ray, depth), &hit)| {
                let before = || Cone::of_simplex(&ray.origin, &mesh.corners(hit)).crossing(&ray.direction).t;
                hit == NOTHING || before() >= depth * (1.0 - NEARER)
            });
            for ([from, to], way, pieces) in asked {
                let seen: Vec<bool> = seen.by_ref().take(pieces).collect();
                let object = u32::from(self.object[from as usize]) - 1;
                let (mut start, mut first) = (from, 0);
                for k in 1..=pieces {
                    if k < pieces && seen[k] == seen[first] {
                        continue;
                    }
                    let end = match k {
                        k if k == pieces => Some(to),
                        k => self.add_seen(camera, way.point(k as f64 / pieces as f64), object),
                    };
                    let Some(end) = end else { continue };
                    if seen[first] || !leave_out {
                        kept.push([start, end]);
                        visible.push(u8::from(seen[first]));
                    }
                    (start, first) = (end, k);
                }
            }
        }
        (self.lines, self.visible) = (kept, Some(visible));
        Ok(())
    }

    /// How many lines are hidden.
    pub fn hidden(&self) -> usize {
        self.visible.iter().flatten().filter(|&&visible| visible == 0).count()
    }

    /// Writes them; returns the file's length.
    pub fn write(&self, path: &Path, told: &str) -> Result<u64, io::Error> {
        let image: Vec<[f32; 3]> = self.points.iter().map(|point| point.1).collect();
        let position: Vec<f32> = self.points.iter().flat_map(|point| point.0.iter().copied()).collect();
        let mut arrays = vec![Array::new("position", D, position)];
        if self.depth.len() == self.points.len() {
            arrays.push(Array::new("depth", 1, self.depth.clone()));
        }
        arrays.push(Array::new("object", 1, self.object.clone()));
        if Dimension::of::<D>() == Dimension::Four {
            let w: Vec<f32> = self.points.iter().map(|point| point.0[D - 1]).collect();
            arrays.push(Array::new("w", 1, w));
        }
        let visible: Vec<Array> = self.visible.iter().map(|seen| Array::new("visible", 1, seen.clone())).collect();
        let mut file = AtomicFile::create(path)?;
        let texts = [(PIPELINE, told)];
        vtp::write(&mut file, &image, vtp::Cells::Lines(&self.lines), &arrays, &visible, &texts)
            .map_err(AtomicFile::name_in(path))?;
        file.commit()
    }
}

/// How much longer the way to a point is along its own ray than along the line of sight.
fn slant<const D: usize>(camera: &Camera<D>, image: [f64; 3]) -> f64 {
    match camera.projection() {
        Projection::Perspective { .. } => (1.0 + image.iter().map(|x| x * x).sum::<f64>()).sqrt(),
        Projection::Parallel { .. } => 1.0,
    }
}

/// The way along an edge, by shares of its image.
struct Way<'a, const D: usize> {
    camera: &'a Camera<D>,
    ends: [Vector<D>; 2],
    images: [[f64; 3]; 2],
    distances: [f64; 2],
}

impl<'a, const D: usize> Way<'a, D> {
    fn new(camera: &'a Camera<D>, ends: [Vector<D>; 2]) -> Self {
        let [(a, from), (b, to)] = ends.each_ref().map(|end| camera.project(end));
        Self { camera, ends, images: [a, b], distances: [from, to] }
    }

    /// How many pieces of about this length in the image it has.
    fn pieces(&self, piece: f64) -> usize {
        let [a, b] = self.images;
        let length = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        // What is no number has one piece.
        (length / piece).ceil().clamp(1.0, PIECES).max(1.0) as usize
    }

    /// How far along the edge itself a share of its image is: what is far is foreshortened.
    fn share(&self, share: f64) -> f64 {
        match self.camera.projection() {
            Projection::Perspective { .. } => {
                let (near, far) = (share * self.distances[0], (1.0 - share) * self.distances[1]);
                near / (near + far)
            }
            Projection::Parallel { .. } => share,
        }
    }

    /// The image of a point, and how far it is from the eye along its ray.
    fn at(&self, share: f64) -> ([f64; 3], f64) {
        let image = std::array::from_fn(|i| self.images[0][i] + (self.images[1][i] - self.images[0][i]) * share);
        let along = self.share(share);
        let distance = self.distances[0] + (self.distances[1] - self.distances[0]) * along;
        (image, distance * slant(self.camera, image))
    }

    /// The point itself.
    fn point(&self, share: f64) -> Vector<D> {
        let [a, b] = self.ends.each_ref().map(widen);
        narrow(&(a + (b - a) * self.share(share)))
    }
}
