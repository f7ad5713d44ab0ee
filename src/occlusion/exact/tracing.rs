//! The closed form among the simplices of a mesh: at a vertex, at a visible point, at all vertices on all cores.
//!
//! The hierarchy serves as a sieve only. A box that lies wholly below the horizon holds simplices that hide nothing, so
//! these need not be looked at one by one; what is left is handed to the [`Hemisphere`], which decides by exact signs.

use rayon::prelude::*;

use super::{Budget, Hemisphere};
use crate::accel::{Bvh, Tracer};
use crate::geometry::{Aabb, Vector};
use crate::mesh::{Incidence, approach};
use crate::occlusion::Error;
use crate::progress::Progress;

/// The value at a vertex as [`at_vertex`] gives it, if at most `most` simplices rise above its horizon and their view
/// stays within the budget.
pub fn at_vertex_if_simple<const D: usize>(
    tracer: &Tracer<D>,
    incidence: &Incidence,
    vertex: u32,
    most: usize,
    budget: Budget,
) -> Option<f64> {
    if tracer.mesh().normals[vertex as usize].amax() == 0.0 {
        return Some(1.0);
    }
    let view = view_of_vertex(tracer, incidence, vertex, most)?;
    Some(view.visible_fraction(budget).ok()?.clamp(0.0, 1.0))
}

/// The same for [`at_point`].
pub fn at_point_if_simple<const D: usize>(
    tracer: &Tracer<D>,
    position: &Vector<D>,
    normal: &Vector<D>,
    ignored: u32,
    most: usize,
    budget: Budget,
) -> Option<f64> {
    let view = view_of_point(tracer, position, normal, ignored, most)?;
    Some(view.visible_fraction(budget).ok()?.clamp(0.0, 1.0))
}

/// The value at a vertex, within [0, 1]. A vertex that belongs to no simplex has the value 1.
///
/// # Errors
/// [`Error::OverBudget`] if the view from there is too rich.
pub fn at_vertex<const D: usize>(
    tracer: &Tracer<D>,
    incidence: &Incidence,
    vertex: u32,
    budget: Budget,
) -> Result<f64, Error> {
    let view = view_of_vertex(tracer, incidence, vertex, usize::MAX);
    view.map_or(Ok(1.0), |hemisphere| value(&hemisphere, budget, || format!("vertex {vertex}")))
}

/// The value at a point inside the simplex `ignored`, on the side that its normal points to, within [0, 1]. `place`
/// names the point if it is over budget.
///
/// # Errors
/// [`Error::OverBudget`] if the view from there is too rich.
pub fn at_point<const D: usize>(
    tracer: &Tracer<D>,
    position: &Vector<D>,
    normal: &Vector<D>,
    ignored: u32,
    budget: Budget,
    place: impl FnOnce() -> String,
) -> Result<f64, Error> {
    let view = view_of_point(tracer, position, normal, ignored, usize::MAX);
    view.map_or(Ok(1.0), |hemisphere| value(&hemisphere, budget, place))
}

/// The value at every vertex of the mesh, in vertex order: the same on any number of threads.
///
/// # Errors
/// [`Error::OverBudget`] with the lowest such vertex of those that were tried, or [`Error::Cancelled`].
pub fn at_vertices<const D: usize>(
    tracer: &Tracer<D>,
    budget: Budget,
    progress: &dyn Progress,
) -> Result<Vec<f64>, Error> {
    at_wanted(tracer, budget, None, progress)
}

/// [`at_vertices`] at those that are wanted, and 1 elsewhere.
pub(in super::super) fn at_wanted<const D: usize>(
    tracer: &Tracer<D>,
    budget: Budget,
    wanted: Option<&[bool]>,
    progress: &dyn Progress,
) -> Result<Vec<f64>, Error> {
    tracer.prepare();
    let incidence = Incidence::new(tracer.mesh());
    let vertices = 0..tracer.mesh().vertices.len() as u32;
    let found = vertices.into_par_iter().with_max_len(1).map(|vertex| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        if wanted.is_some_and(|wanted| !wanted[vertex as usize]) {
            return Ok(1.0);
        }
        let value = at_vertex(tracer, &incidence, vertex, budget);
        progress.advance(1);
        value
    });
    found.collect()
}

fn value<const D: usize>(
    hemisphere: &Hemisphere<D>,
    budget: Budget,
    place: impl FnOnce() -> String,
) -> Result<f64, Error> {
    match hemisphere.visible_fraction(budget) {
        // Rounding may leave it some 1e-15 outside.
        Ok(value) => Ok(value.clamp(0.0, 1.0)),
        Err(source) => Err(Error::OverBudget { place: place(), source }),
    }
}

/// The hemisphere over a vertex with all that occludes it. None if more than `most` simplices do, or if there is no normal.
fn view_of_vertex<const D: usize>(
    tracer: &Tracer<D>,
    incidence: &Incidence,
    vertex: u32,
    most: usize,
) -> Option<Hemisphere<D>> {
    let mesh = tracer.mesh();
    let (position, normal) = (&mesh.vertices[vertex as usize], &mesh.normals[vertex as usize]);
    let identity = mesh.identity[vertex as usize];
    let around = incidence.around(identity);
    let mut hemisphere = Hemisphere::approached(position, normal, &approach(mesh, around, vertex))?;
    for &simplex in around {
        let mut others = [*position; D];
        let corners = mesh.simplices[simplex as usize].into_iter();
        for (other, v) in others.iter_mut().zip(corners.filter(|&v| mesh.identity[v as usize] != identity)) {
            *other = mesh.vertices[v as usize];
        }
        // The coordinates of a mesh are finite, so nothing is refused.
        let _ = hemisphere.add_incident(&others[..D - 1]);
    }
    let few = above_horizon(tracer.bvh(), position, normal, |simplex| {
        if around.binary_search(&simplex).is_err() {
            let _ = hemisphere.add(&mesh.corners(simplex));
        }
        hemisphere.occluders() <= most
    });
    few.then_some(hemisphere)
}

/// The same over a point inside a simplex.
fn view_of_point<const D: usize>(
    tracer: &Tracer<D>,
    position: &Vector<D>,
    normal: &Vector<D>,
    ignored: u32,
    most: usize,
) -> Option<Hemisphere<D>> {
    let mut hemisphere = Hemisphere::new(position, normal)?;
    let few = above_horizon(tracer.bvh(), position, normal, |simplex| {
        if simplex != ignored {
            let _ = hemisphere.add(&tracer.mesh().corners(simplex));
        }
        hemisphere.occluders() <= most
    });
    few.then_some(hemisphere)
}

/// Calls `visit` for the items whose boxes may reach above the horizon, as long as it returns true; returns whether it
/// always did.
fn above_horizon<const D: usize>(
    bvh: &Bvh<D>,
    position: &Vector<D>,
    normal: &Vector<D>,
    mut visit: impl FnMut(u32) -> bool,
) -> bool {
    let mut open: Vec<u32> = if bvh.nodes.is_empty() { vec![] } else { vec![0] };
    while let Some(index) = open.pop() {
        let node = &bvh.nodes[index as usize];
        if !reaches_above(&node.bounds, position, normal) {
            continue;
        }
        if node.count == 0 {
            open.extend([node.first + 1, node.first]);
        } else {
            let first = node.first as usize;
            if !bvh.order[first..first + node.count as usize].iter().all(|&item| visit(item)) {
                return false;
            }
        }
    }
    true
}

/// Whether some corner of a box may lie above the hyperplane through `position`: n . (x - p) > 0, but for rounding.
fn reaches_above<const D: usize>(bounds: &Aabb<D>, position: &Vector<D>, normal: &Vector<D>) -> bool {
    let (mut highest, mut size) = (0.0, 0.0);
    for k in 0..D {
        let corner = if normal[k] > 0.0 { bounds.max[k] } else { bounds.min[k] };
        let term = (f64::from(corner) - f64::from(position[k])) * f64::from(normal[k]);
        highest += term;
        size += term.abs();
    }
    highest > -8.0 * f64::EPSILON * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, MeshBuilder, Orientation, Surface};
    use crate::occlusion::exact::visible_fraction;
    use crate::progress::Silent;

    /// Simplices all over the place; many meet in a vertex.
    fn soup<const D: usize>(count: usize) -> Mesh<D> {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        let vertices: Vec<_> = (0..count).map(|_| crate::geometry::Vector64::from_fn(|_, _| next())).collect();
        let simplices =
            (0..count as u32).map(|s| std::array::from_fn(|i| (s + i as u32 * (1 + s % 3)) % count as u32)).collect();
        let mut builder = MeshBuilder::<D>::new();
        builder.add("soup", [0.5; 3], &Surface { vertices, simplices, normals: None }, Orientation::Input).unwrap();
        builder.finish()
    }

    fn sieve_changes_nothing<const D: usize>() {
        let mesh = soup::<D>(14);
        let tracer = Tracer::new(&mesh);
        let values = at_vertices(&tracer, Budget::default(), &Silent).unwrap();
        assert!(values.iter().any(|&a| a < 0.9), "{values:?}");
        for (v, value) in values.iter().enumerate() {
            let vertex = mesh.vertices[v];
            let (mut incident, mut others) = (Vec::new(), Vec::new());
            for s in 0..mesh.simplices.len() as u32 {
                let mut corners = mesh.corners(s);
                match corners.iter().position(|c| *c == vertex) {
                    Some(at) => {
                        corners.swap(at, D - 1);
                        incident.push(corners);
                    }
                    None => others.push(corners),
                }
            }
            let all = visible_fraction(&vertex, &mesh.normals[v], incident, others, Budget::default());
            let all = all.unwrap().unwrap();
            assert!((value - all).abs() < 1e-13, "{D} {v}: {value} {all}");
        }
        let point = (0..D).fold(Vector::zeros(), |p, i| p + mesh.corners(3)[i] / D as f32);
        let normal = Vector::from_element(1.0);
        let value = at_point(&tracer, &point, &normal, 3, Budget::default(), String::new).unwrap();
        let others = (0..mesh.simplices.len() as u32).filter(|&s| s != 3).map(|s| mesh.corners(s));
        let all = visible_fraction(&point, &normal, [], others, Budget::default()).unwrap().unwrap();
        assert!((value - all).abs() < 1e-13, "{D}: {value} {all}");
    }

    #[test]
    fn the_hierarchy_changes_nothing() {
        sieve_changes_nothing::<3>();
        sieve_changes_nothing::<4>();
    }

    #[test]
    fn over_budget_names_vertex_occluders_and_remedy() {
        let mesh = soup::<4>(14);
        let error = at_vertices(&Tracer::new(&mesh), Budget { cones: 20 }, &Silent).unwrap_err().to_string();
        assert!(error.starts_with("vertex ") && error.contains("method: sobol"), "{error}");
        assert!(error.contains(" simplices above the horizon") && error.contains("more than 20 cones"), "{error}");
    }

    #[test]
    fn cancelling_is_heard() {
        struct Impatient;
        impl Progress for Impatient {
            fn begin(&self, _: &str, _: u64) {}
            fn advance(&self, _: u64) {}
            fn end(&self) {}
            fn cancelled(&self) -> bool {
                true
            }
        }
        let mesh = soup::<3>(14);
        assert_eq!(at_vertices(&Tracer::new(&mesh), Budget::default(), &Impatient), Err(Error::Cancelled));
    }
}
