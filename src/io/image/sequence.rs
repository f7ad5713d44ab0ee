//! Files that follow each other in time, as one image.
//!
//! All of them are opened before the first value is read: their grids must agree, in sizes, places and directions, and their
//! times, where they have any, must go on from file to file. Then they are read one after the other.

use super::axes::{Axis, Frame, Image, Positions};
use super::numbers::Numbers;
use super::{Error, Input, Request, arranged, units};

pub(super) fn open(inputs: Vec<Input>, request: &Request) -> Result<Image, Error> {
    let first = &inputs[0];
    let mut image = arranged(first, request)?;
    let frames = image.points()[3];
    let mut times: Vec<f64> = Vec::new();
    let mut have_times = image.has_times;
    let mut extend = |axis: &Axis| times.extend((0..axis.size).map(|i| axis.positions.at(i)));
    extend(&image.axes[3]);
    for input in &inputs[1..] {
        let other = arranged(input, request)?;
        agree(&image, &other, !request.count_times).map_err(|what| {
            input.wrong(format!(
                "{what}, unlike the first file, {}; files of a sequence share one grid",
                first.path.display()
            ))
        })?;
        have_times &= other.has_times;
        extend(&other.axes[3]);
    }
    let count = frames * inputs.len();
    let step = if frames > 1 { image.axes[3].positions.step() } else { 1.0 };
    let counted = Positions::Even { start: image.axes[3].positions.at(0), step };
    let listed = Positions::Listed(times);
    image.axes[3].positions = match have_times && !request.count_times {
        true if !listed.is_monotonic() => {
            let times: Vec<f64> = (0..count.min(5)).map(|i| listed.at(i)).collect();
            return Err(first.wrong(format!(
                "begins a sequence whose times don't go on from file to file: {times:?}{}; order the files by their \
                 times, or count them by giving spacing",
                if count > 5 { " ..." } else { "" }
            )));
        }
        true => listed,
        false => counted,
    };
    image.axes[3].size = count;
    image.has_times = have_times;
    let each = image.points()[..3].iter().product::<usize>() as u64 * frames as u64;
    let first = std::mem::replace(&mut image.values, Box::new(super::numbers::Held::new(Vec::new())));
    let request = request.clone();
    let reopen = move |input: &Input| arranged(input, &request).map(|image| image.values).map_err(|e| e.to_string());
    image.values = Box::new(Sequence::new(inputs, each, first, Box::new(reopen)));
    Ok(image)
}

/// What of a grid differs from the first.
fn agree(first: &Image, other: &Image, in_time: bool) -> Result<(), String> {
    if first.points() != other.points() {
        return Err(format!("has {:?} points, not {:?}", other.points(), first.points()));
    }
    let mut size = 0f64;
    for (axis, (a, b)) in first.axes[..3].iter().zip(&other.axes).enumerate() {
        let (ends, others) = ([0, a.size - 1].map(|i| a.positions.at(i)), [0, b.size - 1].map(|i| b.positions.at(i)));
        if let (Some(unit), Some(others)) = (&a.unit, &b.unit)
            && !units::same(unit, others)
        {
            return Err(format!("is in {others} along {}, not in {unit}", ["x", "y", "z"][axis]));
        }
        let length = (ends[1] - ends[0]).abs().max(a.positions.step().abs());
        size = size.max(length);
        // Places are often written with few digits.
        if ends.iter().zip(others).any(|(x, y)| (x - y).abs() > 1e-5 * length) {
            let name = ["x", "y", "z"][axis];
            return Err(format!(
                "lies from {} to {} along {name}, not from {} to {}",
                others[0], others[1], ends[0], ends[1]
            ));
        }
    }
    if let (Some(unit), Some(others)) = (&first.axes[3].unit, &other.axes[3].unit)
        && in_time
        && unit != others
    {
        return Err(format!("has its times in {others}, not in {unit} (spacing counts the files instead)"));
    }
    let near = |a: &[f64], b: &[f64], size: f64| a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 1e-5 * size);
    match (&first.frame, &other.frame) {
        (None, None) => Ok(()),
        (Some(Frame { directions: a, origin: p }), Some(Frame { directions: b, origin: q })) => {
            if !near(a.as_flattened(), b.as_flattened(), 1.0) {
                return Err(format!("has the directions {b:?}, not {a:?}"));
            }
            if !near(&p[..3], &q[..3], size) {
                return Err(format!("begins at {:?}, not at {:?}", &q[..3], &p[..3]));
            }
            Ok(())
        }
        _ => Err("has axes of other directions".into()),
    }
}

/// What opens a file again when its turn comes.
type Reopen = Box<dyn Fn(&Input) -> Result<Box<dyn Numbers>, String>>;

/// Files one after the other.
pub(super) struct Sequence {
    rest: std::vec::IntoIter<Input>,
    reopen: Reopen,
    /// Values of each.
    each: u64,
    current: Option<Input>,
    now: Box<dyn Numbers>,
    /// Values left of the current one.
    left: u64,
}

impl Sequence {
    /// Of these files with so many values each; the first is opened already.
    pub fn new(inputs: Vec<Input>, each: u64, first: Box<dyn Numbers>, reopen: Reopen) -> Self {
        let mut rest = inputs.into_iter();
        let current = rest.next();
        Self { rest, reopen, each, current, now: first, left: each }
    }

    /// Makes sure that something is left of the current file.
    fn go_on(&mut self) -> Result<(), String> {
        if self.left == 0 {
            let input = self.rest.next().ok_or("has no more values")?;
            (self.now, self.left) = ((self.reopen)(&input)?, self.each);
            self.current = Some(input);
        }
        Ok(())
    }

    fn named(&self, message: String) -> String {
        self.current.as_ref().map_or(message.clone(), |input| format!("{}: {message}", input.path.display()))
    }
}

impl Numbers for Sequence {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        let mut done = 0;
        while done < out.len() {
            self.go_on()?;
            let now = (out.len() - done).min(usize::try_from(self.left).unwrap_or(usize::MAX));
            self.now.read(&mut out[done..done + now]).map_err(|message| self.named(message))?;
            done += now;
            self.left -= now as u64;
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        let mut count = count;
        while count > 0 {
            self.go_on()?;
            let now = count.min(self.left);
            self.now.skip(now).map_err(|message| self.named(message))?;
            count -= now;
            self.left -= now;
        }
        Ok(())
    }
}
