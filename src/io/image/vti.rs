//! `.vti`, `.pvti` and legacy `.vtk`, VTK's images: one array of numbers, on the points or in the cells, and `TimeValue` from the field data.

use std::path::Path;

use super::axes::{Axis, Opened, Positions, Role};
use super::numbers::Held;
use super::{Request, room_for};
use crate::io::vtk::{self, DataSet, Wanted};
use crate::volume::Array;

/// Arrays that VTK adds of its own accord, to say which points count.
const VTKS_OWN: [&str; 3] = ["vtkValidPointMask", "vtkGhostType", "vtkGhostLevels"];

/// Bits of `vtkGhostType`.
const HIDDEN_POINT: u64 = 2;
const HIDDEN_CELL: u64 = 32;

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Opened, String> {
    room_for(length.saturating_mul(2), "this format is read as a whole")?;
    let image = match request.array.as_deref() {
        // What nobody asked for refuses nothing.
        Some(name) => {
            let image = read(path, Wanted::Named(&[&[name, "TimeValue"][..], &VTKS_OWN].concat()))?;
            let there = image.point_arrays.iter().chain(&image.cell_arrays).any(|array| array.name == name);
            if there { image } else { read(path, Wanted::Numbers)? }
        }
        None => read(path, Wanted::Numbers)?,
    };
    let (array, on_cells) = choose(&image, request.array.as_deref())?;
    let direction =
        |axis: usize| std::array::from_fn(|row| if row < 3 { image.direction[3 * row + axis] } else { 0.0 });
    let mut origin = [image.grid.origin[0], image.grid.origin[1], image.grid.origin[2], 0.0];
    let mut axes = Vec::new();
    for (i, role) in [Role::X, Role::Y, Role::Z].into_iter().enumerate() {
        let (points, step) = (image.grid.dimensions[i], image.grid.spacing[i]);
        let mut axis =
            Axis::new(role.name(), Some(role), if on_cells { (points - 1).max(1) } else { points }).spaced(step);
        let vector: [f64; 4] = direction(i);
        // Values of cells are those of their middles.
        if on_cells && points > 1 {
            (0..3).for_each(|k| origin[k] += vector[k] * step / 2.0);
        }
        axis.direction = Some(vector);
        axes.push(axis);
    }
    let count: usize = axes.iter().map(|axis| axis.size).product();
    if array.values.len() != count * array.components {
        return Err(format!("its array \"{}\" has {} values for {count} points", array.name, array.values.len()));
    }
    if array.components > 1 {
        axes.insert(0, Axis::new(&array.name, Some(Role::Channel), array.components));
    }
    let time = image.time();
    let mut axis = Axis::new("time", Some(Role::Time), 1);
    if let Some(time) = time {
        axis.positions = Positions::Listed(vec![time]);
    }
    axes.push(axis);
    let number = array.values.kind().vtk_name().to_lowercase();
    let mut values = array.values.to_f64();
    let absent = absent(if on_cells { &image.cell_arrays } else { &image.point_arrays }, on_cells, count);
    let missing = absent.iter().filter(|absent| **absent).count();
    values.chunks_mut(array.components).zip(absent).filter(|(_, absent)| *absent).for_each(|(v, _)| v.fill(f64::NAN));
    let mut opened = Opened::new("VTK image", axes, number, Box::new(Held::new(values)));
    (opened.origin, opened.has_times) = (origin, time.is_some());
    if missing > 0 {
        let what = if on_cells { "cells" } else { "points" };
        opened
            .notes
            .push(format!("{missing} of its {what} are marked as hidden or not valid; their values are no numbers"));
    }
    Ok(opened)
}

fn read(path: &Path, wanted: Wanted<'_>) -> Result<vtk::Image, String> {
    let data = vtk::read_wanted(path, wanted).map_err(|error| {
        // The error names the file, as whoever asked does.
        let text = error.to_string();
        text.strip_prefix(&format!("{}: ", path.display())).map_or(text.clone(), str::to_owned)
    })?;
    match data {
        DataSet::Image(image) => Ok(image),
        DataSet::Unstructured(_) => {
            Err("holds a mesh, not an image; resample it to an image (in ParaView: Resample To Image)".into())
        }
    }
}

/// Which points or cells have no value: those that are hidden, and those that lay outside of what was resampled.
fn absent(arrays: &[Array], on_cells: bool, count: usize) -> Vec<bool> {
    let mut absent = vec![false; count];
    for marks in arrays.iter().filter(|marks| marks.components == 1 && marks.values.len() == count) {
        let is_absent: fn(u64) -> bool = match (marks.name.as_str(), on_cells) {
            ("vtkGhostType", false) => |mark| mark & HIDDEN_POINT != 0,
            ("vtkGhostType", true) => |mark| mark & HIDDEN_CELL != 0,
            ("vtkValidPointMask", false) => |mark| mark == 0,
            _ => continue,
        };
        let marks = (0..count).map(|i| marks.values.get(i) as u64);
        absent.iter_mut().zip(marks).for_each(|(absent, mark)| *absent |= is_absent(mark));
    }
    absent
}

/// The array that is asked for, or the only one that there is; and whether it lies in the cells.
fn choose<'a>(image: &'a vtk::Image, name: Option<&str>) -> Result<(&'a Array, bool), String> {
    let all = || image.point_arrays.iter().map(|a| (a, false)).chain(image.cell_arrays.iter().map(|a| (a, true)));
    let known = || all().map(|(array, _)| array.name.clone()).collect::<Vec<_>>().join(", ");
    if let Some(name) = name {
        return all()
            .find(|(array, _)| array.name == name)
            .ok_or_else(|| format!("has no array \"{name}\"; there are {}", known()));
    }
    let meant: Vec<_> = all().filter(|(array, _)| !VTKS_OWN.contains(&array.name.as_str())).collect();
    let scalars: Vec<_> = meant.iter().filter(|(array, _)| array.components == 1).collect();
    match (meant.as_slice(), scalars.as_slice()) {
        (&[one], _) | (_, &[&one]) => Ok(one),
        ([], _) => Err("has no array of numbers".into()),
        (_, several) => {
            let count = several.len();
            Err(format!("has {count} arrays of one number a point; give array, one of {}", known()))
        }
    }
}
