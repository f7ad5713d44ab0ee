//! The closed form among the simplices of a mesh: what is to be seen from a shading point, and what it leaves open.
//!
//! The hierarchy serves as a sieve only. A box that lies wholly below the horizon holds simplices that hide nothing, so
//! these need not be looked at one by one; what is left is handed to the [`Hemisphere`], which decides by exact signs.

use super::exposed::LOOK;
use super::hemisphere::{Budget, Hemisphere, Stopped};
use crate::accel::{Bvh, Tracer};
use crate::geometry::{Aabb, Vector, Vector64};
use crate::mesh::approach;
use crate::progress::{Cancelled, Progress, Silent};
use crate::trace::ShadingPoint;

/// The value at a point, within [0, 1]. A vertex that belongs to no simplex has the value 1.
pub(in crate::occlusion) fn value<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    budget: Budget,
    progress: &dyn Progress,
) -> Result<f64, Stopped> {
    match view(tracer, point, usize::MAX, progress)? {
        // Rounding may leave it some 1e-15 outside.
        Some(hemisphere) => Ok(hemisphere.fraction(budget, progress)?.clamp(0.0, 1.0)),
        None => Ok(1.0),
    }
}

/// The value at a point, if at most `most` simplices rise above its horizon and their view stays within the budget.
pub(in crate::occlusion) fn value_if_simple<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    most: usize,
    budget: Budget,
    progress: &dyn Progress,
) -> Result<Option<f64>, Cancelled> {
    if point.normal(tracer.mesh()).amax() == 0.0 {
        return Ok(Some(1.0));
    }
    let Some(hemisphere) = view(tracer, point, most, progress)? else { return Ok(None) };
    match hemisphere.fraction(budget, progress) {
        Ok(value) => Ok(Some(value.clamp(0.0, 1.0))),
        Err(Stopped::OverBudget(_)) => Ok(None),
        Err(Stopped::Cancelled) => Err(Cancelled),
    }
}

/// The value at a point and the vector beside it, if at most `most` simplices rise above its horizon. A vertex that belongs
/// to no simplex has no direction: 1 and zero.
pub(in crate::occlusion) fn directed<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    most: usize,
    budget: Budget,
    progress: &dyn Progress,
) -> Result<Option<(f64, Vector64<D>)>, Stopped> {
    if point.normal(tracer.mesh()).amax() == 0.0 {
        return Ok(Some((1.0, Vector64::zeros())));
    }
    let Some(hemisphere) = view(tracer, point, most, progress)? else { return Ok(None) };
    let (fraction, vector) = hemisphere.directed_fraction(budget, progress)?;
    Ok(Some((fraction.clamp(0.0, 1.0), vector)))
}

impl<const D: usize> Hemisphere<D> {
    /// The hemisphere over a shading point with all that occludes it. None if there is no normal.
    pub fn over(tracer: &Tracer<D>, point: &ShadingPoint<D>) -> Option<Self> {
        view(tracer, point, usize::MAX, &Silent).ok().flatten()
    }
}

/// The hemisphere over a point with all that occludes it. None if more than `most` simplices do, or if there is no normal.
fn view<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    most: usize,
    progress: &dyn Progress,
) -> Result<Option<Hemisphere<D>>, Cancelled> {
    let mesh = tracer.mesh();
    let (position, normal) = (point.position(mesh), point.normal(mesh));
    let approach = match *point {
        ShadingPoint::Vertex(vertex) => {
            approach(mesh, tracer.incidence().around(mesh.identity[vertex as usize]), vertex)
        }
        ShadingPoint::Inside { .. } => normal,
    };
    let Some(mut hemisphere) = Hemisphere::approached(&position, &normal, &approach) else { return Ok(None) };
    // The coordinates of a mesh are finite, so nothing is refused below.
    let ignored = point.ignored(tracer);
    let own: &[u32] = match point {
        ShadingPoint::Vertex(vertex) => {
            let identity = mesh.identity[*vertex as usize];
            let around = tracer.incidence().around(identity);
            for &simplex in around {
                let mut others = [position; D];
                let corners = mesh.simplices[simplex as usize].into_iter();
                for (other, v) in others.iter_mut().zip(corners.filter(|&v| mesh.identity[v as usize] != identity)) {
                    *other = mesh.vertices[v as usize];
                }
                let _ = hemisphere.add_incident(&others[..D - 1]);
            }
            around
        }
        ShadingPoint::Inside { .. } => &ignored,
    };
    let (mut looked, mut cancelled) = (0usize, progress.cancelled());
    let all = above_horizon(tracer.bvh(), &position, &normal, |simplex| {
        if own.binary_search(&simplex).is_err() {
            let _ = hemisphere.add(&mesh.corners(simplex));
        }
        looked += 1;
        cancelled |= looked.is_multiple_of(LOOK) && progress.cancelled();
        hemisphere.occluders() <= most && !cancelled
    });
    if cancelled { Err(Cancelled) } else { Ok(all.then_some(hemisphere)) }
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
        let tracer = Tracer::new(mesh.clone());
        let at = |point| value(&tracer, &point, Budget::default(), &Silent).unwrap();
        let values: Vec<f64> = ShadingPoint::vertices(&mesh).into_iter().map(at).collect();
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
        let value = at(ShadingPoint::Inside { position: point, normal, simplex: 3, number: 0 });
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
    fn over_budget_is_told() {
        let tracer = Tracer::new(soup::<4>(14));
        let found = (0..14).map(|v| value(&tracer, &ShadingPoint::Vertex(v), Budget { cones: 20 }, &Silent));
        let told = found.filter_map(Result::err).next().unwrap();
        assert!(
            matches!(&told, Stopped::OverBudget(over) if over.budget.cones == 20 && over.occluders > 0),
            "{told:?}"
        );
    }
}
