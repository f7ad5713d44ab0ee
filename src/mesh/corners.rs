//! Corners: a vertex where a surface creases is several shading points, one a side of the crease.
//!
//! One averaged normal where the faces of a box meet is right for none of them. So the simplices around a vertex fall
//! into groups: two of them that share a facet with the vertex on it, and whose normals differ by no more than the crease
//! angle, are in one group, and so is who is connected through such pairs (as VTK's `vtkPolyDataNormals` splits). Each
//! group has a normal of its own, the measure-weighted one. The first group keeps the vertex; for each other one a vertex
//! with the same coordinates is added behind all vertices of the object, so that those of the input keep their numbers.
//!
//! A sheet with two sides, each simplex listed in either order, is split between them whatever the angle.
//!
//! Intersection knows points by their coordinates and does not notice. Simplices of measure zero have no normal and
//! decide nothing: what they lie between counts as neighbours.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rayon::prelude::*;

use super::copies::Sides;
use super::facets::{Corners as Facets, facets_of};
use super::{Mesh, UnionFind, normals::unit};
use crate::geometry::{Dimension, Vector, Vector64, normal_of, widen};

/// Crease angle where nothing else is said, in degrees: the feature angle of VTK.
pub const DEFAULT_ANGLE: f64 = 30.0;

/// Normals whose cosine is below minus this point opposite ways.
const COSINE_OF_SIDES: f64 = 1.0 - 1e-6;

/// Where an object's vertices are split.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Crease {
    /// Nowhere: one normal a vertex.
    #[default]
    Never,
    /// Where neighbours' normals differ by more than this, in degrees.
    Above(f64),
    /// The same, with an angle that is chosen from the surface: [`rough_angle`].
    Rough,
}

/// One object after splitting.
pub(super) struct Corners<const D: usize> {
    /// For each added vertex the one, by its number in the mesh, that it has the coordinates of.
    pub sources: Vec<u32>,
    /// Unit normals: those of the object's vertices, then those of the added ones.
    pub normals: Vec<Vector<D>>,
    /// For each corner of a simplex that has another vertex now: simplex, place, and which of `sources`.
    pub moved: Vec<(u32, usize, u32)>,
}

/// A corner of a simplex, sorted by where it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Corner {
    identity: u32,
    simplex: u32,
    place: u8,
}

/// A vertex of the object that a group uses, and the group's normal.
struct Use<const D: usize> {
    vertex: u32,
    normal: Vector<D>,
    corners: Vec<(u32, usize)>,
}

/// Points whose corners are grouped before any is numbered.
const TOGETHER: usize = 1 << 14;

/// Splits the vertices of one object, whose simplices are oriented already: where neighbours' normals differ by more than this
/// angle, or, without one, between the sides of sheets only.
pub(super) fn split<const D: usize>(
    mesh: &Mesh<D>,
    vertices: Range<usize>,
    simplices: Range<usize>,
    degrees: Option<f64>,
    sides: &Sides,
) -> Corners<D> {
    let normals: Vec<Vector64<D>> = mesh.simplices[simplices.clone()].par_iter().map(|s| normal(mesh, s)).collect();
    let first = simplices.start;
    let flat = |s: u32| mesh.degenerate.binary_search(&s).is_ok();
    let corners = corners(mesh, simplices.clone());
    let stars: Vec<&[Corner]> = corners.chunk_by(|a, b| a.identity == b.identity).collect();
    // Coordinates are single precision: angles that are equal but for their rounding are equal.
    let cosine = degrees.map(|degrees| libm::cos(degrees.to_radians()) - 1e-6);
    let groups = |star: &&[Corner]| groups(mesh, star, cosine, &|s| normals[s as usize - first], &flat, sides);

    let mut found = Corners { sources: Vec::new(), normals: vec![Vector::zeros(); vertices.len()], moved: Vec::new() };
    let mut taken = vec![false; vertices.len()];
    let mut added = Vec::new();
    // Some at a time: the corners of all groups together take more memory than the mesh.
    for stars in stars.chunks(TOGETHER) {
        let uses: Vec<Vec<Use<D>>> = stars.par_iter().map(groups).collect();
        for used in uses.into_iter().flatten() {
            let own = used.vertex as usize - vertices.start;
            if !std::mem::replace(&mut taken[own], true) {
                found.normals[own] = used.normal;
                continue;
            }
            let number = found.sources.len() as u32;
            found.sources.push(used.vertex);
            added.push(used.normal);
            found.moved.extend(used.corners.into_iter().map(|(simplex, place)| (simplex, place, number)));
        }
    }
    found.normals.extend(added);
    found
}

/// Puts the vertices that each object gets behind its own, and numbers everything anew.
pub(super) fn add<const D: usize>(mesh: &mut Mesh<D>, splits: Vec<Corners<D>>) {
    let total = mesh.vertices.len() + splits.iter().map(|split| split.sources.len()).sum::<usize>();
    if total == mesh.vertices.len() || total >= u32::MAX as usize {
        // Nothing to add, or more than numbers reach.
        mesh.normals = (splits.into_iter().zip(&mesh.objects))
            .flat_map(|(split, object)| split.normals.into_iter().take(object.vertices.len()))
            .collect();
        return;
    }
    let mut numbers = vec![0u32; mesh.vertices.len()];
    let (mut vertices, mut identity, mut normals) =
        (Vec::with_capacity(total), Vec::with_capacity(total), Vec::with_capacity(total));
    for (split, object) in splits.into_iter().zip(&mut mesh.objects) {
        let start = vertices.len();
        let sources = || object.vertices.clone().chain(split.sources.iter().map(|&v| v as usize));
        object.vertices.clone().zip(start as u32..).for_each(|(v, number)| numbers[v] = number);
        vertices.extend(sources().map(|v| mesh.vertices[v]));
        // The lowest vertex of a point is one of an object's own, and its number is known by now.
        identity.extend(sources().map(|v| numbers[mesh.identity[v] as usize]));
        normals.extend(split.normals);
        for simplex in &mut mesh.simplices[object.simplices.clone()] {
            *simplex = simplex.map(|v| numbers[v as usize]);
        }
        let behind = (start + object.vertices.len()) as u32;
        for (simplex, place, number) in split.moved {
            mesh.simplices[simplex as usize][place] = behind + number;
        }
        object.vertices = start..vertices.len();
    }
    (mesh.vertices, mesh.identity, mesh.normals) = (vertices, identity, normals);
}

fn normal<const D: usize>(mesh: &Mesh<D>, simplex: &[u32; D]) -> Vector64<D> {
    normal_of(&simplex.map(|v| widen(&mesh.vertices[v as usize])))
}

fn agree<const D: usize>(a: &Vector64<D>, b: &Vector64<D>, cosine: f64) -> bool {
    // Scaled first, so that squares neither overflow nor vanish.
    let (a, b) = (a / a.amax(), b / b.amax());
    a.dot(&b) >= cosine * a.norm() * b.norm()
}

/// The groups of the corners at one point, each vertex that a group uses apart, the group of the lowest simplex first; of a
/// sheet with two sides, the groups by their normals.
fn groups<const D: usize>(
    mesh: &Mesh<D>,
    star: &[Corner],
    cosine: Option<f64>,
    normal: &impl Fn(u32) -> Vector64<D>,
    flat: &impl Fn(u32) -> bool,
    sides: &Sides,
) -> Vec<Use<D>> {
    let mut sets = UnionFind::new(star.len());
    let two_sided = star.iter().any(|c| sides.is_two_sided(c.simplex));
    for pair in neighbours(mesh, star, flat, sides) {
        let simplices = pair.map(|i| star[i as usize].simplex);
        let [a, b] = simplices.map(normal);
        let sides = || is_opposed(&a, &b) || are_sides(mesh, simplices);
        if cosine.is_none_or(|cosine| agree(&a, &b, cosine)) && !(two_sided && sides()) {
            sets.join(pair[0], pair[1]);
        }
    }
    if cosine.is_none() && !two_sided {
        (1..star.len() as u32).for_each(|i| sets.join(0, i));
    }
    for (i, corner) in star.iter().enumerate() {
        let place = |leader: u32| star.binary_search_by_key(&leader, |c| c.simplex).ok();
        if let Some(leader) = sides.leader(corner.simplex).and_then(place) {
            sets.join(i as u32, leader as u32);
        }
    }
    let mut members: Vec<(u32, usize)> = (0..star.len()).map(|i| (sets.root(i as u32), i)).collect();
    members.sort_unstable();
    let mut groups: Vec<(Vector<D>, Vec<Corner>)> = Vec::new();
    let mut at_rest = Vec::new();
    for group in members.chunk_by(|a, b| a.0 == b.0) {
        let corners = || group.iter().map(|&(_, i)| star[i]).filter(|c| !flat(c.simplex));
        let counted = corners().filter(|c| sides.leader(c.simplex).is_none());
        let sum = counted.fold(Vector64::<D>::zeros(), |sum, c| sum + normal(c.simplex));
        let Some(leader) = corners().next() else {
            at_rest.extend(group.iter().map(|&(_, i)| star[i]));
            continue;
        };
        // A closed fan folded onto itself has none of its own.
        let leading = normal(leader.simplex);
        let sum = if sum.amax() > 1e-12 * leading.amax() { sum } else { leading };
        groups.push((unit(&sum), corners().collect()));
    }
    if two_sided {
        // Not in the order of the simplices, so that it doesn't matter which side is listed first.
        let place = |normal: &Vector<D>| normal.map(|x| -x);
        groups.sort_by(|a, b| place(&a.0).partial_cmp(&place(&b.0)).unwrap_or(std::cmp::Ordering::Equal));
    }
    let mut found: Vec<Use<D>> = Vec::new();
    for (normal, corners) in groups {
        let mut slots: HashMap<u32, usize> = HashMap::new();
        for c in corners {
            let vertex = mesh.simplices[c.simplex as usize][usize::from(c.place)];
            let slot = *slots.entry(vertex).or_insert_with(|| {
                found.push(Use { vertex, normal, corners: Vec::new() });
                found.len() - 1
            });
            found[slot].corners.push((c.simplex, usize::from(c.place)));
        }
    }
    // A vertex of simplices of measure zero alone has the normal of the point's first group.
    let normal = found.first().map_or_else(Vector::zeros, |u| u.normal);
    let mut used: HashSet<u32> =
        if at_rest.is_empty() { HashSet::new() } else { found.iter().map(|u| u.vertex).collect() };
    for c in at_rest {
        let vertex = mesh.simplices[c.simplex as usize][usize::from(c.place)];
        if used.insert(vertex) {
            found.push(Use { vertex, normal, corners: Vec::new() });
        }
    }
    found
}

/// Whether two normals point opposite ways.
fn is_opposed<const D: usize>(a: &Vector64<D>, b: &Vector64<D>) -> bool {
    a.amax() > 0.0 && b.amax() > 0.0 && agree(a, &-b, COSINE_OF_SIDES)
}

/// All corners of some simplices, those at one point together.
fn corners<const D: usize>(mesh: &Mesh<D>, simplices: Range<usize>) -> Vec<Corner> {
    let mut corners: Vec<Corner> = simplices
        .flat_map(|s| {
            (0..D).map(move |place| {
                let identity = mesh.identity[mesh.simplices[s][place] as usize];
                Corner { identity, simplex: s as u32, place: place as u8 }
            })
        })
        .collect();
    corners.par_sort_unstable();
    corners
}

/// Whether two neighbours are on different sides of a sheet: one lies on the other, or they run the same way along the facet
/// that they share.
fn are_sides<const D: usize>(mesh: &Mesh<D>, simplices: [u32; 2]) -> bool {
    let [a, b] = simplices.map(|s| mesh.places_of(s));
    if a.iter().all(|v| b.contains(v)) {
        return true;
    }
    let shared = |(facet, turned): (Facets, bool)| facets_of(&b).find(|other| other.0 == facet).map(|b| b.1 == turned);
    facets_of(&a).find_map(shared).unwrap_or(false)
}

/// Pairs of places in the star whose simplices share a facet that holds the point; those of measure zero are left out,
/// and the facets that they connect count as one. So are those that others stand for.
fn neighbours<const D: usize>(
    mesh: &Mesh<D>,
    star: &[Corner],
    flat: &impl Fn(u32) -> bool,
    sides: &Sides,
) -> Vec<[u32; 2]> {
    let point = star[0].identity;
    // What is left of a facet without the point: one vertex in 3D, two in 4D.
    let mut facets: Vec<([u32; 2], u32)> = Vec::with_capacity(star.len() * (D - 1));
    for (i, corner) in star.iter().enumerate().filter(|(_, corner)| sides.leader(corner.simplex).is_none()) {
        let mut others = [u32::MAX; 3];
        let simplex = mesh.simplices[corner.simplex as usize].map(|v| mesh.identity[v as usize]);
        let rest = simplex.into_iter().filter(|&v| v != point);
        others.iter_mut().zip(rest).for_each(|(slot, v)| *slot = v);
        match Dimension::of::<D>() {
            Dimension::Three => facets.extend([0, 1].map(|k| ([others[k], u32::MAX], i as u32))),
            Dimension::Four => facets.extend(
                [(0, 1), (0, 2), (1, 2)].map(|(j, k)| ([others[j].min(others[k]), others[j].max(others[k])], i as u32)),
            ),
        }
    }
    facets.sort_unstable();
    facets.dedup();
    let mut classes = UnionFind::new(facets.len());
    let mut seen: Vec<Option<u32>> = vec![None; star.len()];
    for f in 0..facets.len() {
        if f > 0 && facets[f].0 == facets[f - 1].0 {
            classes.join(f as u32 - 1, f as u32);
        }
        let simplex = facets[f].1 as usize;
        if flat(star[simplex].simplex) {
            match seen[simplex] {
                Some(other) => classes.join(other, f as u32),
                None => seen[simplex] = Some(f as u32),
            }
        }
    }
    let mut by_class: Vec<(u32, u32)> = (0..facets.len())
        .filter(|&f| !flat(star[facets[f].1 as usize].simplex))
        .map(|f| (classes.root(f as u32), facets[f].1))
        .collect();
    by_class.sort_unstable();
    let mut pairs = Vec::new();
    for class in by_class.chunk_by(|a, b| a.0 == b.0) {
        for (k, a) in class.iter().enumerate() {
            pairs.extend(class[..k].iter().map(|b| [b.1, a.1]));
        }
    }
    pairs
}

/// The crease angle for a surface that may be rough all over, as isosurfaces of measured images are: [`DEFAULT_ANGLE`],
/// or, where a tenth of all neighbours differ by more than that, twice the angle that a tenth differ by; 80 at most, so
/// that right angles stay creases.
///
/// Creases lie along edges, so on a mesh of any fineness they are few: what a tenth of all facets exceed is roughness.
pub fn rough_angle<const D: usize>(mesh: &Mesh<D>, simplices: Range<usize>) -> f64 {
    let mut angles = facet_angles(mesh, simplices);
    if angles.is_empty() {
        return DEFAULT_ANGLE;
    }
    let place = angles.len() * 9 / 10;
    let (_, angle, _) = angles.select_nth_unstable_by(place, f64::total_cmp);
    if *angle > DEFAULT_ANGLE { (2.0 * *angle).min(80.0) } else { DEFAULT_ANGLE }
}

/// The angles between the normals of neighbours, in degrees, one a facet that two simplices share.
pub fn facet_angles<const D: usize>(mesh: &Mesh<D>, simplices: Range<usize>) -> Vec<f64> {
    let welded: Vec<[u32; D]> =
        mesh.simplices[simplices.clone()].iter().map(|s| s.map(|v| mesh.identity[v as usize])).collect();
    let normals: Vec<Vector64<D>> =
        mesh.simplices[simplices].par_iter().map(|s| widen(&unit(&normal(mesh, s)))).collect();
    (super::facets::sorted_facets(&welded).chunk_by(|a, b| a.corners == b.corners))
        .filter_map(|shared| match shared {
            [a, b] => Some((normals[a.simplex as usize], normals[b.simplex as usize])),
            _ => None,
        })
        .filter(|(a, b)| a.amax() > 0.0 && b.amax() > 0.0)
        .map(|(a, b)| libm::acos(a.dot(&b).clamp(-1.0, 1.0)).to_degrees())
        .collect()
}
