//! The light of the sky and of other surfaces, for pictures and meshes: what is found at the vertices for it.
//!
//! Directions are found for all vertices, once a scene and occlusion, and serve every sky; light from surface to surface
//! depends on the sky, so it is found for each picture.

use std::sync::Arc;

use super::lighting::{LightAsked, LightingPlan};
use super::occlusion::{OcclusionPlan, OcclusionSource};
use super::{Ref, Run, SceneRun, StageError, write};
use crate::geometry::{Vector, Vector64};
use crate::occlusion::{Directional, Estimator};
use crate::render::{Skylight, radiosity};
use crate::trace::ShadingPoint;

impl<const D: usize> SceneRun<D> {
    /// The occlusion of all vertices with directions.
    ///
    /// # Errors
    /// If it can't be found, or Ctrl-C was pressed.
    pub(super) fn directions(&mut self, of: Ref<OcclusionPlan>, run: &Run) -> Result<Arc<Directional<D>>, StageError> {
        if let Some(found) = self.directions.get(&of) {
            return Ok(Arc::clone(found));
        }
        let vertices = self.session.mesh().vertices.len() as u64;
        let _running = run.progress.stage(&format!("directions of {}", run.plan.id(of)), vertices);
        let found = Arc::new(self.session.directional(estimator(of, run), run.progress)?);
        self.directions.insert(of, Arc::clone(&found));
        Ok(found)
    }

    /// The vectors b at a mesh's vertices, for a file of it: of all, or of those that a piece of a run shows; elsewhere they
    /// are zero.
    ///
    /// # Errors
    /// As [`SceneRun::directions`].
    pub(super) fn directions_of_mesh(
        &mut self,
        of: Ref<OcclusionPlan>,
        run: &Run,
    ) -> Result<Vec<Vector<D>>, StageError> {
        let mesh = Arc::clone(self.session.mesh());
        let computed = matches!(run.plan[of].source, OcclusionSource::Compute(_));
        if let Some(joined) = run.joined.as_ref().filter(|_| computed) {
            let found = joined.values(of.nth(), mesh.vertices.len())?.vectors;
            return Ok(found.chunks_exact(D).map(Vector::from_column_slice).collect());
        }
        let Some(piece) = run.plan.piece else { return Ok(self.directions(of, run)?.vectors.clone()) };
        let own = piece.share(mesh.vertices.len());
        let simplices = mesh.simplices.iter().filter(|simplex| write::has_first(&own, simplex));
        let mut shown: Vec<usize> = simplices.flatten().map(|&v| v as usize).collect();
        shown.sort_unstable();
        shown.dedup();
        let mut all = vec![Vector::zeros(); mesh.vertices.len()];
        for (&v, found) in shown.iter().zip(self.vectors_at(of, shown.clone(), run)?) {
            all[v] = found;
        }
        Ok(all)
    }

    /// The vectors b at these vertices.
    ///
    /// # Errors
    /// As [`SceneRun::directions`].
    pub(super) fn vectors_at(
        &self,
        of: Ref<OcclusionPlan>,
        vertices: Vec<usize>,
        run: &Run,
    ) -> Result<Vec<Vector<D>>, StageError> {
        let _running = run.progress.stage(&format!("directions of {}", run.plan.id(of)), vertices.len() as u64);
        let points: Vec<ShadingPoint<D>> = vertices.into_iter().map(|v| ShadingPoint::Vertex(v as u32)).collect();
        let backend = self.session.backend();
        Ok(estimator(of, run).directional(&**backend, &points, None, run.progress)?.vectors)
    }

    /// The light that a picture with this occlusion needs; none if that of an even sky will do.
    ///
    /// # Errors
    /// As [`SceneRun::directions`].
    pub(super) fn skylight(
        &mut self,
        occlusion: Option<Ref<OcclusionPlan>>,
        asked: LightAsked,
        run: &Run,
    ) -> Result<Option<Arc<Skylight<D>>>, StageError> {
        if !asked.directions && !asked.bounce {
            return Ok(None);
        }
        let gradient = asked.lighting.map_or_else(Vector64::zeros, LightingPlan::gradient);
        let mut light = Skylight::new(gradient);
        let Some(of) = occlusion else {
            light.in_image = Some(asked.bounce);
            return Ok(Some(Arc::new(light)));
        };
        if asked.at_voxels && !asked.bounce {
            return Ok(Some(Arc::new(light)));
        }
        let found = self.directions(of, run)?;
        if asked.bounce {
            if asked.at_voxels {
                light.radiosity = Some(Arc::new(radiosity(self.session.mesh(), &found, &gradient)));
            } else {
                let vertices = self.session.mesh().vertices.len() as u64;
                let _running = run.progress.stage(&format!("bounce over {}", run.plan.id(of)), vertices);
                let (sent, bounced) = self.session.bounced(estimator(of, run), &found, &gradient, run.progress)?;
                (light.radiosity, light.bounced) = (Some(Arc::new(sent)), Some(Arc::new(bounced)));
            }
        }
        light.directions = (!asked.at_voxels).then_some(found);
        Ok(Some(Arc::new(light)))
    }
}

/// What finds directions.
fn estimator(of: Ref<OcclusionPlan>, run: &Run) -> Estimator {
    let max_distance = run.loaded.get(&of).map_or(f32::INFINITY, |loaded| loaded.sidecar.max_distance);
    run.plan[of].directional(run.plan.seed, max_distance)
}

#[cfg(test)]
mod tests {
    use crate::pipeline::{Document, Pipeline};

    /// What is said of a pipeline with these stages behind a scene.
    fn told(stages: &str) -> Result<(), String> {
        let text = format!("name: p\nstages:\n  - scene: {{id: s, objects: []}}\n{stages}");
        let document = Document::parse("p.yaml", &text).unwrap();
        let told = Pipeline::from_document(document, &[], None).map(|_| ()).map_err(|e| e.to_string());
        told.map_err(|message| message.split_once(": ").unwrap().1.to_owned())
    }

    #[test]
    fn light_that_nobody_can_find_is_refused() {
        let published = "  - occlusion: {method: as_published}\n";
        let sobol = "  - occlusion: {}\n";
        for (stages, expected) in [
            (
                "  - render: {dimensions: [1, 1, 1], bounce: 1}\n".to_owned(),
                "stages[1].render.bounce: needs an occlusion, which tells how much light reaches a surface",
            ),
            (
                format!("{published}  - render: {{dimensions: [1, 1, 1], sky: {{gradient: [0, 1, 0, 0]}}}}\n"),
                "stages[2].render.sky: `as_published` tells how much of the sky is hidden, not where it is open; take `method: \
                 sobol`",
            ),
            (
                format!("{published}  - render: {{dimensions: [1, 1, 1], bounce: 1}}\n"),
                "stages[2].render.bounce: `as_published` tells how much of the sky is hidden, not where it is open; take \
                 `method: sobol`",
            ),
            (
                format!(
                    "{published}  - render: {{dimensions: [1, 1, 1]}}\n  - write: {{vti: a.vti, arrays: [bent_normal]}}\n"
                ),
                "stages[3].write.arrays[0]: `as_published` tells how much of the sky is hidden, not where it is open; take \
                 `method: sobol`",
            ),
            (
                format!(
                    "{sobol}  - render: {{id: r, dimensions: [1, 1, 1]}}\n  - write: {{vti: a.vti, arrays: [rgba, bounce]}}\n"
                ),
                "stages[3].write.arrays[1]: render `r` follows no light from surface to surface; give it `bounce: 1`",
            ),
        ] {
            assert_eq!(told(&stages).unwrap_err(), expected);
        }
        let glass =
            "  - scene: {objects: [{box: {min: [0, 0, 0, 0], max: [1, 1, 1, 1]}, opacity: 0.5}]}\n  - occlusion: {}\n";
        for (key, value) in [("bounce", "1"), ("sky", "{gradient: [0, 1, 0, 0]}")] {
            assert_eq!(
                told(&format!("{glass}  - render: {{dimensions: [1, 1, 1], {key}: {value}}}\n")).unwrap_err(),
                format!(
                    "stages[3].render.{key}: object 1 lets light through, and where the sky is open is found among opaque \
                     objects only; leave out `opacity` there"
                )
            );
        }
        for stages in [
            "  - render: {dimensions: [1, 1, 1], sky: {gradient: [0, 1, 0, 0]}}\n  - write: {vti: a.vti, arrays: [bent_normal, light]}\n",
            "  - render: {occlusion: screen_space, dimensions: [1, 1, 1], sky: {gradient: [0, 1, 0, 0]}, bounce: 1}\n  - write: {vti: a.vti, arrays: [bent_normal, bounce]}\n",
            "  - occlusion: {}\n  - render: {dimensions: [1, 1, 1], bounce: 0}\n  - write: {vti: a.vti, arrays: [irradiance]}\n",
        ] {
            assert_eq!(told(stages), Ok(()));
        }
    }
}
