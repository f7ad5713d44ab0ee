//! The hemisphere over a point, the occluders in it, and the sum over the facets of what they leave open.

use super::directions::{DirectionBox, DirectionTree};
use super::exposed::{Counter, LOOK, Spent, exposed};
use super::generators::{Generators, INVERTED_NORMAL, Signed, direction};
use super::integrals::{Directed, Fraction, Integral};
use super::plane::Plane;
use super::polygon::{Hole, Region};
use super::span::Span;
use super::trace::{SimplicialCone, Trace, facet_above_horizon, trace};
use crate::geometry::{Vector, Vector64, widen};
use crate::progress::{Cancelled, Progress, Silent};

/// How much work one point may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// The most convex pieces that the facets of the visible region may be cut into. A piece takes about a
    /// microsecond.
    pub cones: usize,
}

impl Default for Budget {
    /// Some ten seconds for a point.
    fn default() -> Self {
        Self { cones: 10_000_000 }
    }
}

/// The scene is too rich for exact occlusion within the budget.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the {occluders} simplices above the horizon of ({}) cut its view into more than {} cones; raise `max_cones`, \
     or use `method: sobol`",
    point.iter().map(f32::to_string).collect::<Vec<_>>().join(", "),
    budget.cones
)]
pub struct OverBudget {
    /// The point that was looked from.
    pub point: Vec<f32>,
    /// How many simplices reach above its horizon.
    pub occluders: usize,
    /// What was exceeded.
    pub budget: Budget,
}

/// Why there is no value.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::occlusion) enum Stopped {
    /// The work was cancelled.
    Cancelled,
    /// The view is too rich.
    OverBudget(OverBudget),
}

impl From<Cancelled> for Stopped {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// The fraction of the cosine-weighted hemisphere over a point that is open: 1 if nothing occludes it, 0 if all is
/// covered (method of the [module](super)). In a closed form; the error is of rounding only, below 1e-14 in all tests.
///
/// `normal` is taken as a direction and need not be of unit length. `incident` lists for each simplex that contains
/// the point its other D - 1 vertices (the first D - 1 entries; the last is not read), `others` the vertices of all
/// other simplices, in any order. `None` if the normal is zero, or anything is infinite or not a number.
pub fn visible_fraction<const D: usize>(
    point: &Vector<D>,
    normal: &Vector<D>,
    incident: impl IntoIterator<Item = [Vector<D>; D]>,
    others: impl IntoIterator<Item = [Vector<D>; D]>,
    budget: Budget,
) -> Option<Result<f64, OverBudget>> {
    let mut hemisphere = Hemisphere::new(point, normal)?;
    for vertices in incident {
        hemisphere.add_incident(&vertices[..D - 1])?;
    }
    for vertices in others {
        hemisphere.add(&vertices)?;
    }
    Some(hemisphere.visible_fraction(budget))
}

/// The hemisphere over a point, and the simplices that may occlude it.
#[derive(Clone, Debug)]
pub struct Hemisphere<const D: usize> {
    point: Vector<D>,
    normal: Vector<D>,
    generators: Generators<D>,
    cones: Vec<SimplicialCone<D>>,
}

/// A facet of a cone that nothing covers from the other side by being the same facet.
#[derive(Clone, Copy)]
struct OpenFacet<const D: usize> {
    span: [u32; D],
    /// On which side of its plane the cone is.
    side: i32,
    cone: u32,
}

impl<const D: usize> Hemisphere<D> {
    /// An empty hemisphere. `normal` need not be of unit length; it is used as given. `None` if it is zero or
    /// something is infinite or not a number.
    pub fn new(point: &Vector<D>, normal: &Vector<D>) -> Option<Self> {
        Self::approached(point, normal, normal)
    }

    /// The same over a point that is approached from another direction than the normal's: see [`Hemisphere::add_incident`].
    pub fn approached(point: &Vector<D>, normal: &Vector<D>, approach: &Vector<D>) -> Option<Self> {
        let sound = is_finite(point) && is_finite(normal) && is_finite(approach) && normal.iter().any(|&x| x != 0.0);
        sound.then(|| Self {
            point: *point,
            normal: *normal,
            generators: Generators::new(*point, *normal, *approach),
            cones: Vec::new(),
        })
    }

    /// Adds a simplex that does not have the point as a vertex. One wholly below the horizon, or in whose hyperplane
    /// the point lies, changes nothing. `None` if a coordinate is infinite or not a number.
    pub fn add(&mut self, vertices: &[Vector<D>; D]) -> Option<()> {
        vertices.iter().all(is_finite).then(|| {
            let cone = vertices.each_ref().map(|vertex| self.generators.edge_to(vertex));
            self.push(cone);
        })
    }

    /// Adds a simplex that contains the point, given its D - 1 other vertices. It occludes the directions w for which
    /// n + s w, or d + s w if the point is approached from d, meets it for some s > 0: none on a convex surface, some in a concave fold. `None` if a coordinate is
    /// infinite or not a number.
    pub fn add_incident(&mut self, others: &[Vector<D>]) -> Option<()> {
        (others.len() == D - 1 && others.iter().all(is_finite)).then(|| {
            let mut cone = [INVERTED_NORMAL; D];
            for (id, vertex) in cone[1..].iter_mut().zip(others) {
                *id = self.generators.edge_to(vertex);
            }
            self.push(cone);
        })
    }

    /// How many simplices reach above the horizon.
    pub fn occluders(&self) -> usize {
        self.cones.len()
    }

    fn push(&mut self, mut cone: [u32; D]) {
        if cone.iter().all(|&id| self.generators.height(id).sign() <= 0) {
            return;
        }
        cone.sort_unstable();
        if cone.windows(2).any(|pair| pair[0] == pair[1]) {
            return;
        }
        // The first generator's side of the facet that the others span is the sign of all their determinant.
        let opposite: [u32; D] = std::array::from_fn(|i| if i + 1 < D { cone[i + 1] } else { u32::MAX });
        let orientation = Span::new(&self.generators, opposite).side(&self.generators, cone[0]).sign();
        if orientation != 0 {
            self.cones.push(SimplicialCone { generators: cone, orientation });
        }
    }

    /// The fraction of the cosine-weighted hemisphere that the simplices added so far leave open.
    pub fn visible_fraction(&self, budget: Budget) -> Result<f64, OverBudget> {
        let mut fraction = Fraction::default();
        // Nobody cancels, so it is the budget if there is no value.
        self.sum(&mut fraction, &mut Counter::new(budget.cones, &Silent)).map_err(|_| self.exceeded(budget))?;
        Ok(fraction.finish::<D>())
    }

    /// [`Hemisphere::visible_fraction`] A, and beside it the vector b of the open directions weighted as A weights them:
    /// b = c_D * integral of V w (w . n) dw, where A = c_D * integral of V (w . n) dw. Where all is open b is 2/3 of the
    /// unit normal in 3D, 3 pi/16 of it in 4D. Of a sky of light 1 + g . w the point gets A + g . b.
    ///
    /// # Errors
    /// If the budget is too small.
    pub fn directed(&self, budget: Budget) -> Result<(f64, Vector64<D>), OverBudget> {
        let mut directed = Directed::new(&direction(&widen(&self.normal)));
        self.sum(&mut directed, &mut Counter::new(budget.cones, &Silent)).map_err(|_| self.exceeded(budget))?;
        Ok(directed.finish())
    }

    /// [`Hemisphere::visible_fraction`], that stops as soon as `progress` wishes.
    pub(in crate::occlusion) fn fraction(&self, budget: Budget, progress: &dyn Progress) -> Result<f64, Stopped> {
        let mut fraction = Fraction::default();
        let summed = self.sum(&mut fraction, &mut Counter::new(budget.cones, progress));
        summed.map_err(|spent| self.stopped(spent, budget))?;
        Ok(fraction.finish::<D>())
    }

    /// [`Hemisphere::directed`], that stops as soon as `progress` wishes.
    pub(in crate::occlusion) fn directed_fraction(
        &self,
        budget: Budget,
        progress: &dyn Progress,
    ) -> Result<(f64, Vector64<D>), Stopped> {
        let mut directed = Directed::new(&direction(&widen(&self.normal)));
        let summed = self.sum(&mut directed, &mut Counter::new(budget.cones, progress));
        summed.map_err(|spent| self.stopped(spent, budget))?;
        Ok(directed.finish())
    }

    fn stopped(&self, spent: Spent, budget: Budget) -> Stopped {
        match spent {
            Spent::Cancelled => Stopped::Cancelled,
            Spent::Budget => Stopped::OverBudget(self.exceeded(budget)),
        }
    }

    fn exceeded(&self, budget: Budget) -> OverBudget {
        OverBudget { point: self.point.iter().copied().collect(), occluders: self.cones.len(), budget }
    }

    fn sum(&self, integral: &mut impl Integral<D>, counter: &mut Counter) -> Result<(), Spent> {
        let horizon = Plane::horizon(&widen(&self.normal));
        let units: Vec<_> = (0..self.generators.len() as u32).map(|id| direction(self.generators.vector(id))).collect();
        let bounds = |ids: &[u32]| {
            let mut corners = [units[0]; D];
            for (corner, &id) in corners.iter_mut().zip(ids) {
                *corner = units[id as usize];
            }
            DirectionBox::of(&corners[..ids.len()])
        };
        let tree = DirectionTree::new(self.cones.iter().map(|cone| bounds(&cone.generators)).collect());

        self.open_horizon(&horizon, integral, counter)?;
        let mut near = Vec::new();
        let mut sides = Sides::new(self.generators.len());
        for facet in self.open_facets() {
            let span = &facet.span[..D - 1];
            let plane = Plane::of_facet(&self.generators, Span::new(&self.generators, facet.span));
            let corners = facet_above_horizon(&plane, &horizon, &self.generators, span);
            let region = Region::<D>::new(corners);
            tree.meeting(&bounds(span), &mut near);
            sides.forget();
            counter.look(near.len() + 1)?;
            let mut holes = Vec::with_capacity(near.len());
            for &other in near.iter().filter(|&&other| other != facet.cone) {
                let cone = &self.cones[other as usize];
                let side = |id| sides.recall(id, || plane.side(&self.generators, id));
                let hole = match trace(&plane, &self.generators, cone, side) {
                    Trace::None => None,
                    Trace::Across(corners) => Some(corners),
                    Trace::Above(corners) => (facet.side < 0 || other < facet.cone).then_some(corners),
                    Trace::Below(corners) => (facet.side > 0 || other < facet.cone).then_some(corners),
                };
                holes.extend(hole.and_then(Hole::new));
            }
            let outwards = -f64::from(facet.side) * plane.unit_normal();
            integral.begin(&plane, outwards.dot(horizon.unit_normal()));
            exposed(region, &mut holes, counter, |piece| integral.add(piece))?;
        }
        Ok(())
    }

    /// What of the horizon is open from above.
    fn open_horizon(
        &self,
        horizon: &Plane<D>,
        integral: &mut impl Integral<D>,
        counter: &mut Counter,
    ) -> Result<(), Spent> {
        let mut holes: Vec<Hole<D>> = Vec::new();
        for cones in self.cones.chunks(LOOK) {
            counter.look(cones.len())?;
            holes.extend(cones.iter().filter_map(|cone| {
                match trace(horizon, &self.generators, cone, |id| self.generators.height(id)) {
                    Trace::Across(corners) | Trace::Above(corners) => Hole::new(corners),
                    Trace::None | Trace::Below(_) => None,
                }
            }));
        }
        for orthant in Region::whole() {
            integral.begin(horizon, 1.0);
            exposed(orthant, &mut holes, counter, |piece| integral.add(piece))?;
        }
        Ok(())
    }

    /// The facets above the horizon that belong to cones on one side only, once each, for the first of these cones.
    fn open_facets(&self) -> Vec<OpenFacet<D>> {
        let mut facets = Vec::with_capacity(D * self.cones.len());
        for (number, cone) in self.cones.iter().enumerate() {
            for k in 0..D {
                let span = cone.facet(k);
                if span[..D - 1].iter().any(|&id| self.generators.height(id).sign() > 0) {
                    facets.push(OpenFacet { span, side: cone.side_of_facet(k), cone: number as u32 });
                }
            }
        }
        facets.sort_unstable_by_key(|facet| (facet.span, facet.cone));
        let mut open = Vec::new();
        for same in facets.chunk_by(|a, b| a.span == b.span) {
            let first = &same[0];
            if same.iter().all(|facet| facet.side == first.side) {
                open.push(*first);
            }
        }
        open
    }
}

fn is_finite<const D: usize>(vector: &Vector<D>) -> bool {
    vector.iter().all(|x| x.is_finite())
}

/// The sides of the generators with respect to the plane at hand, each computed at most once.
struct Sides {
    known: Vec<(u32, Signed)>,
    round: u32,
}

impl Sides {
    fn new(generators: usize) -> Self {
        Self { known: vec![(0, Signed::default()); generators], round: 0 }
    }

    fn forget(&mut self) {
        self.round += 1;
    }

    #[inline]
    fn recall(&mut self, id: u32, compute: impl FnOnce() -> Signed) -> Signed {
        let entry = &mut self.known[id as usize];
        if entry.0 != self.round {
            *entry = (self.round, compute());
        }
        entry.1
    }
}
