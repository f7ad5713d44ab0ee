//! Solids to make products of: polygons, discs and balls, as chains of simplices and points.

use std::collections::HashMap;

use super::hypersphere::standard_facet;
use super::product::Chain;
use crate::geometry::Vector64;

/// A polygon or disc around the origin: `sides` sectors of `rings`^2 triangles. Ring k has `sides` k points, on the circle
/// or on the polygon of its size. A polygon with one ring needs no middle: it is a fan from its first corner.
pub fn disc(sides: u32, rings: u32, radius: f64, round: bool) -> (Chain, Vec<Vector64<2>>) {
    let angle = |step: u32, of: u32| libm::sincos(std::f64::consts::TAU * f64::from(step) / f64::from(of));
    let corner = |side: u32| {
        let (sine, cosine) = angle(side % sides, sides);
        Vector64::<2>::new(cosine, sine) * radius
    };
    if rings == 1 && !round {
        let fan: Vec<[u32; 3]> = (1..sides - 1).map(|i| [0, i, i + 1]).collect();
        return (Chain::of(sides, &fan), (0..sides).map(corner).collect());
    }
    // Ring k begins behind 1 + sides (1 + ... + k - 1) points.
    let index = |ring: u32, step: u32| match ring {
        0 => 0,
        _ => 1 + sides * (ring * (ring - 1) / 2) + step % (sides * ring),
    };
    let mut points = vec![Vector64::<2>::zeros()];
    let mut triangles = Vec::new();
    for ring in 1..=rings {
        for side in 0..sides {
            for step in 0..ring {
                let size = f64::from(ring) / f64::from(rings);
                points.push(if round {
                    let (sine, cosine) = angle(side * ring + step, sides * ring);
                    Vector64::<2>::new(cosine, sine) * (radius * size)
                } else {
                    let share = f64::from(step) / f64::from(ring);
                    (corner(side) + (corner(side + 1) - corner(side)) * share) * size
                });
                let (outer, inner) = (side * ring + step, side * (ring - 1) + step);
                triangles.push([index(ring - 1, inner), index(ring, outer), index(ring, outer + 1)]);
                if step + 1 < ring {
                    triangles.push([index(ring - 1, inner), index(ring, outer + 1), index(ring - 1, inner + 1)]);
                }
            }
        }
    }
    (Chain::of(points.len() as u32, &triangles), points)
}

/// A ball around the origin: the octahedron's solid of size `rings`, each octant `rings`^3 tetrahedra, rounded.
pub fn ball(rings: u32, radius: f64) -> (Chain, Vec<Vector64<3>>) {
    let pattern = standard_facet::<4>(rings as i32);
    let mut indices: HashMap<[i32; 3], u32> = HashMap::new();
    let mut points = Vec::new();
    let mut tetrahedra = Vec::new();
    for octant in 0..8 {
        for piece in &pattern {
            // The fourth coordinate is what is left to the surface.
            let mut tetrahedron = piece.map(|x| {
                let place: [i32; 3] = std::array::from_fn(|i| if octant >> i & 1 == 1 { -x[i] } else { x[i] });
                *indices.entry(place).or_insert_with(|| {
                    let at = Vector64::<3>::from(place.map(f64::from));
                    let ring = at.iter().map(|x| x.abs()).sum::<f64>();
                    let length = at.norm();
                    points.push(if length > 0.0 { at * (radius * ring / f64::from(rings) / length) } else { at });
                    (points.len() - 1) as u32
                })
            });
            let [a, b, c, d] = piece.map(|x| Vector64::<3>::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2])));
            let mirrored = (octant as u32).count_ones() % 2 == 1;
            if (crate::geometry::determinant(&[b - a, c - a, d - a]) < 0.0) != mirrored {
                tetrahedron.swap(2, 3);
            }
            tetrahedra.push(tetrahedron);
        }
    }
    (Chain::of(points.len() as u32, &tetrahedra), points)
}
