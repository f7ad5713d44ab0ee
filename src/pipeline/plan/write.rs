//! Files of images and figures: what is written, what it needs from its render, and what nobody writes.

use super::range::check_length;
use super::resolve::Resolver;
use super::{FigurePlan, Plan, StageRef, WritePlan};
use crate::pipeline::Cut;
use crate::pipeline::error::Invalid;
use crate::pipeline::spec::{Channel, ColorBy, ParaviewSpec, Reader, Style, WriteSpec};

pub(super) fn write(resolver: &mut Resolver, path: &str, id: String, spec: &WriteSpec) -> Result<WritePlan, Invalid> {
    let render = match &spec.input {
        Some(name) => StageRef::render(resolver.lookup(&format!("{path}.input"), name, &["render"])?),
        None => resolver.nearest(StageRef::render),
    };
    let Some(render) = render else {
        return Err(Invalid::new(path, "there is no earlier `render` to write; put one first"));
    };
    let mut claim = |key: &str, name: &Option<String>, extension: &str| match name {
        Some(name) => resolver.outputs.claim(&format!("{path}.{key}"), name, Some(extension)).map(Some),
        None => Ok(None),
    };
    let (vti, raw) = (claim("vti", &spec.vti, "vti")?, claim("raw", &spec.raw, "raw")?);
    let (vtu, png) = (claim("vtu", &spec.vtu, "vtu")?, claim("png", &spec.png, "png")?);
    if [&vti, &raw, &vtu, &png].into_iter().all(Option::is_none) {
        return Err(Invalid::new(path, "names no file; give at least one of vti, raw, vtu, png"));
    }
    let arrays = match &spec.arrays {
        None => vec![Channel::Rgba, Channel::AmbientOcclusion, Channel::Opacity],
        Some(arrays) => arrays.clone(),
    };
    if arrays.is_empty() {
        return Err(Invalid::new(format!("{path}.arrays"), "the list is empty; name at least one array"));
    }
    for (i, array) in arrays.iter().enumerate() {
        if arrays[..i].contains(array) {
            return Err(Invalid::new(format!("{path}.arrays[{i}]"), format!("`{}` stands twice", array.name())));
        }
    }
    if vti.is_none() {
        let given = [
            ("arrays", spec.arrays.is_some()),
            ("encoding", spec.encoding.is_some()),
            ("compression", spec.compression.is_some()),
        ];
        for (key, _) in given.into_iter().filter(|(_, given)| *given) {
            resolver.warn(format!("{path}.{key}"), "has no effect without `vti`");
        }
    }
    let mut needed = resolver.plan.renders[render].arrays.clone();
    needed.extend(arrays.iter().filter(|_| vti.is_some()));
    needed.extend(raw.iter().map(|_| Channel::Rgb));
    needed.extend(png.iter().map(|_| Channel::Rgba));
    needed.sort_unstable();
    needed.dedup();
    resolver.plan.renders[render].arrays = needed;
    let (encoding, compression) = (spec.encoding.unwrap_or_default(), spec.compression.unwrap_or_default());
    let arrays_given = spec.arrays.is_some();
    Ok(WritePlan { id, path: path.to_owned(), render, vti, raw, vtu, png, arrays, arrays_given, encoding, compression })
}

pub(super) fn figure(
    resolver: &mut Resolver,
    path: &str,
    id: String,
    spec: &ParaviewSpec,
) -> Result<FigurePlan, Invalid> {
    let reader = spec.reader.unwrap_or_default();
    let key = if reader == Reader::Vti { "vti" } else { "raw" };
    let has_file = |w: usize| {
        let write = &resolver.plan.writes[w];
        if reader == Reader::Vti { write.vti.is_some() } else { write.raw.is_some() }
    };
    let mut writes = Vec::new();
    match &spec.input {
        None => {
            let nearest = resolver.nearest(|s| StageRef::write(s).filter(|&w| has_file(w)));
            let message = format!("there is no earlier `write` with `{key}` to show; put one first");
            writes.push(nearest.ok_or_else(|| Invalid::new(path, message))?);
        }
        Some(ids) => {
            for (name, index) in ids.iter() {
                let at = format!("{path}.input{index}");
                let write = match resolver.lookup(&at, name, &["render", "write"])? {
                    StageRef::Render(render) => {
                        let of_render = |w: &usize| resolver.plan.writes[*w].render == render && has_file(*w);
                        resolver.nearest(|s| StageRef::write(s).filter(of_render))
                    }
                    stage => StageRef::write(stage).filter(|&w| has_file(w)),
                };
                let message = format!("`{name}` has no `{key}` file written before this stage");
                writes.push(write.ok_or_else(|| Invalid::new(at, message))?);
            }
            if writes.is_empty() {
                return Err(Invalid::new(format!("{path}.input"), "the list is empty; name at least one image"));
            }
        }
    }
    if reader == Reader::Vti {
        for &w in &writes {
            let write = &resolver.plan.writes[w];
            if !write.arrays.contains(&Channel::Rgba) || !write.arrays.contains(&Channel::Opacity) {
                let message =
                    format!("shows `{}`, whose arrays lack rgba or opacity; add them to its `arrays`", write.id);
                return Err(Invalid::new(path, message));
            }
        }
    }
    let (style, color_by) = (spec.style.unwrap_or_default(), spec.color_by.unwrap_or_default());
    if color_by == ColorBy::AmbientOcclusion {
        check_occlusion(resolver, path, reader, &writes)?;
    }
    if style == Style::Surface && reader == Reader::Vti {
        writes.iter().for_each(|&w| add_object(resolver, w));
    }
    let colorbar = spec.colorbar.unwrap_or(color_by == ColorBy::AmbientOcclusion);
    let state = resolver.outputs.claim(&format!("{path}.state"), &spec.state, Some("py"))?;
    let screenshot = match &spec.screenshot {
        Some(name) => Some(resolver.outputs.claim(&format!("{path}.screenshot"), name, Some("png"))?),
        None => None,
    };
    let size = match spec.size.as_deref() {
        None => None,
        Some(&[width, height]) => {
            for (i, n) in [width, height].into_iter().enumerate() {
                if !(16..=16_384).contains(&n) {
                    let message = format!("expected 16 to 16384 pixels, found {n}");
                    return Err(Invalid::new(format!("{path}.size[{i}]"), message));
                }
            }
            Some([width as u32, height as u32])
        }
        Some(other) => {
            return Err(Invalid::new(format!("{path}.size"), format!("expected [WIDTH, HEIGHT], found {other:?}")));
        }
    };
    let cut = spec.cut.unwrap_or_default();
    if let Cut::Plane(plane) = cut {
        check_length(&format!("{path}.cut.at"), plane.at)?;
    }
    let path = path.to_owned();
    Ok(FigurePlan { id, path, writes, state, screenshot, reader, cut, size, style, color_by, colorbar })
}

/// A figure can colour by ambient occlusion only what its files hold.
fn check_occlusion(resolver: &Resolver, path: &str, reader: Reader, writes: &[usize]) -> Result<(), Invalid> {
    let key = format!("{path}.color_by");
    if reader == Reader::Raw {
        let message = "`.raw` files hold colours alone, no ambient occlusion; take `reader: vti`, or `color_by: rgba`";
        return Err(Invalid::new(key, message));
    }
    for &w in writes {
        let write = &resolver.plan.writes[w];
        if !write.arrays.contains(&Channel::AmbientOcclusion) {
            let message = format!("`{}` has no ambient_occlusion; add it to its `arrays`", write.id);
            return Err(Invalid::new(key, message));
        }
    }
    Ok(())
}

/// Of several objects each gets a skin of its own, so the file has to tell which voxel is whose, unless it was said what
/// it holds.
fn add_object(resolver: &mut Resolver, write: usize) {
    let plan = &mut resolver.plan;
    let write = &mut plan.writes[write];
    let render = &mut plan.renders[write.render];
    let volume = render.dimensions[2] > 1;
    let several = plan.scenes[render.scene].objects.len() > 1;
    if volume && several && !write.arrays_given && !write.arrays.contains(&Channel::Object) {
        write.arrays.push(Channel::Object);
        if !render.arrays.contains(&Channel::Object) {
            render.arrays.push(Channel::Object);
            render.arrays.sort_unstable();
        }
    }
}

/// What can be said only when all stages are known.
pub(super) fn finish(plan: &mut Plan) {
    for (i, render) in plan.renders.iter().enumerate() {
        if !plan.writes.iter().any(|write| write.render == i) {
            plan.warnings.push(Invalid::new(&render.path, "no `write` stage writes this image"));
        }
    }
    for (i, occlusion) in plan.occlusions.iter().enumerate() {
        if occlusion.file.is_none() && !plan.renders.iter().any(|render| render.occlusion == Some(i)) {
            plan.warnings.push(Invalid::new(&occlusion.path, "no render uses this occlusion and no `file` keeps it"));
        }
    }
}
