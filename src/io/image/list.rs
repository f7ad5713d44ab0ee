//! A list of files over time (`.pvd`, `.vti.series`) as one image: the axes of its files, and time behind them.
//!
//! As with files that are named one by one, all are opened before the first value is read, and their grids must agree.

use std::path::Path;

use super::axes::{Axis, Opened, Positions, Role};
use super::sequence::Sequence;
use super::{Request, stored};
use crate::io::{Input, InputError, series};

pub(super) fn open(path: &Path, _: u64, request: &Request) -> Result<Opened, String> {
    let steps = series::read(path)?;
    let mut inputs = Vec::new();
    for step in &steps {
        let [file] = step.files.as_slice() else {
            return Err(format!(
                "has {} files at time {}; join them to one image (in ParaView: Resample To Image)",
                step.files.len(),
                step.time.unwrap_or(0.0)
            ));
        };
        if series::is_list(file) {
            return Err(format!("names another list, {}; name that one", file.display()));
        }
        inputs.push(Input::new("", Path::new(""), file));
    }
    let reopen = {
        let request = request.clone();
        move |input: &Input| stored(input, &request).map_err(said)
    };
    let mut image = reopen(&inputs[0])?;
    let mut times = taken_time(&mut image, &inputs[0])?.map(|first| vec![first]);
    for input in &inputs[1..] {
        let mut other = reopen(input)?;
        let time = taken_time(&mut other, input)?;
        let (first, here) = (inputs[0].path.display(), input.path.display());
        agree(&image, &other).map_err(|what| format!("{here} {what}, unlike the first file, {first}"))?;
        match (&mut times, time) {
            (Some(times), Some(time)) => times.push(time),
            _ => times = None,
        }
    }
    // What the list says counts more than what its files do.
    let listed: Option<Vec<f64>> = steps.iter().map(|step| step.time).collect();
    let mut axis = Axis::new("time", Some(Role::Time), inputs.len());
    image.has_times = listed.is_some() || times.is_some();
    if let Some(times) = listed.or(times) {
        axis.positions = Positions::Listed(times);
        if !axis.positions.is_monotonic() {
            return Err("gives no times, and those in its files don't go on from one to the next".into());
        }
    }
    let each = image.axes.iter().map(|axis| axis.size as u64).product();
    image.axes.push(axis);
    let again = move |input: &Input| reopen(input).map(|opened| opened.values);
    image.values = Box::new(Sequence::new(inputs, each, image.values, Box::new(again)));
    image.format = match image.format {
        "VTK image" => "VTK images over time",
        _ => "files over time",
    };
    Ok(image)
}

/// What is wrong with a file of the list, with its name.
fn said(error: InputError) -> String {
    match error {
        InputError::Content { path, message, .. } => format!("{}: {message}", path.display()),
        InputError::Unreadable { path, source, .. } => format!("can't read {}: {source}", path.display()),
        InputError::Invalid { message, .. } => message,
    }
}

/// Takes the axis of time away, which must be of one step, and gives where it was, if the file says so.
fn taken_time(image: &mut Opened, input: &Input) -> Result<Option<f64>, String> {
    let Some(place) = image.axes.iter().position(|axis| axis.role == Some(Role::Time)) else { return Ok(None) };
    let axis = image.axes.remove(place);
    if axis.size != 1 {
        return Err(format!("{} has {} steps of time of its own", input.path.display(), axis.size));
    }
    Ok(Some(axis.positions.at(0)).filter(|_| image.has_times))
}

/// What of a grid differs from the first.
fn agree(first: &Opened, other: &Opened) -> Result<(), String> {
    let sizes = |image: &Opened| image.axes.iter().map(|axis| axis.size).collect::<Vec<_>>();
    if sizes(first) != sizes(other) {
        return Err(format!("has {:?} points, not {:?}", sizes(other), sizes(first)));
    }
    let near = |x: f64, y: f64, length: f64| (x - y).abs() <= 1e-5 * length;
    let mut size = 0f64;
    for (a, b) in first.axes.iter().zip(&other.axes) {
        let (ends, others) = ([0, a.size - 1].map(|i| a.positions.at(i)), [0, b.size - 1].map(|i| b.positions.at(i)));
        let length = (ends[1] - ends[0]).abs().max(a.positions.step().abs());
        size = size.max(length);
        if ends.iter().zip(others).any(|(&x, y)| !near(x, y, length)) {
            return Err(format!(
                "lies from {} to {} along {}, not from {} to {}",
                others[0], others[1], a.name, ends[0], ends[1]
            ));
        }
        let [from, to] = [a, b].map(|axis| axis.direction.unwrap_or_default());
        if from.iter().zip(to).any(|(&x, y)| !near(x, y, 1.0)) {
            return Err(format!("runs along {to:?}, not along {from:?}"));
        }
    }
    if first.origin.iter().zip(other.origin).any(|(&x, y)| !near(x, y, size)) {
        return Err(format!("begins at {:?}, not at {:?}", other.origin, first.origin));
    }
    Ok(())
}
