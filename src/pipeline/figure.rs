//! A plan's ParaView figure as the state that shows it.

use super::build::camera;
use super::files::{PROGRAM, beside, holds, paraview, write_whole};
use super::plan::{FigurePlan, Plan};
use super::spec::Reader;
use super::{Axis, Cut, RunError};
use crate::geometry::Dimension;
use crate::volume::Grid;

/// Writes the state, if it isn't there already or with `force`. Returns its length, and whether it was left alone.
pub(super) fn write(plan: &Plan, figure: &FigurePlan, force: bool) -> Result<(u64, bool), RunError> {
    let with = figure.writes.iter().filter(|&&w| plan.renders[plan.writes[w].render].occlusion.is_some()).count();
    let mixed = figure.writes.len() == 2 && with == 1;
    let mut panels = Vec::with_capacity(figure.writes.len());
    for &write in &figure.writes {
        let write = &plan.writes[write];
        let render = &plan.renders[write.render];
        let grid: Grid = match plan.scenes[render.scene].dimension {
            Dimension::Three => camera::<3>(&render.camera)?.grid(render.dimensions),
            Dimension::Four => camera::<4>(&render.camera)?.grid(render.dimensions),
        };
        let file = match figure.reader {
            Reader::Vti => &write.vti,
            Reader::Raw => &write.raw,
        };
        let caption = match (figure.writes.len(), render.occlusion) {
            (1, _) => String::new(),
            (2, Some(_)) if mixed => "with ambient occlusion".to_owned(),
            (2, None) if mixed => "without ambient occlusion".to_owned(),
            _ => render.id.replace(['-', '_'], " "),
        };
        panels.push(paraview::Panel {
            file: beside(&figure.state, file.as_deref().unwrap_or("".as_ref())),
            caption,
            grid,
        });
    }
    let state = paraview::state(&paraview::Figure {
        title: plan.name.clone(),
        program: PROGRAM.to_owned(),
        panels,
        source: match figure.reader {
            Reader::Vti => paraview::Source::Vti,
            Reader::Raw => paraview::Source::Raw,
        },
        cut: match figure.cut {
            Cut::None => paraview::Cut::None,
            Cut::Octant => paraview::Cut::Octant { corner: None },
            Cut::Plane(plane) => paraview::Cut::Plane {
                axis: match plane.plane {
                    Axis::X => paraview::Axis::X,
                    Axis::Y => paraview::Axis::Y,
                    Axis::Z => paraview::Axis::Z,
                },
                at: plane.at,
            },
        },
        screenshot: figure.screenshot.as_ref().map(|s| beside(&figure.state, s)),
        size: figure.size,
    });
    let path = plan.out.join(&figure.state);
    let cached = !force && holds(&path, state.as_bytes());
    if !cached {
        write_whole(&path, state.as_bytes())?;
    }
    Ok((state.len() as u64, cached))
}
