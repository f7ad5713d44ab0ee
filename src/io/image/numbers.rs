//! The values of an image as a stream: read so many, pass over so many, always forwards.
//!
//! Values leave a stream x fastest, then y, z and time. A file that keeps them in this order is never held in memory; one
//! that keeps them in another is, whole, and only if there is room. [`Bytes`] makes numbers of bytes, [`Picked`] takes one
//! channel out of several, [`Held`] has them in memory, and [`arrange`] chooses among these.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::room_for;
use crate::volume::Kind;

/// Values that are made at a time where they are converted on the way.
const BLOCK: usize = 1 << 16;

/// A stream of values.
pub trait Numbers {
    /// Fills `out` with the next values.
    fn read(&mut self, out: &mut [f64]) -> Result<(), String>;

    /// Passes over so many values.
    fn skip(&mut self, count: u64) -> Result<(), String>;

    /// Asked before the first value is read: to give them with some axes in another order, of axes with these sizes, the fastest
    /// first. The answer is in which order all axes will come, or none if that can't be.
    fn reorder(&mut self, _sizes: &[usize], _order: &[usize]) -> Option<Vec<usize>> {
        None
    }
}

/// A stream of bytes that can be passed over.
pub(super) trait Stream: Read {
    fn pass(&mut self, count: u64) -> std::io::Result<()>;
}

impl Stream for BufReader<File> {
    fn pass(&mut self, count: u64) -> std::io::Result<()> {
        self.seek_relative(i64::try_from(count).map_err(std::io::Error::other)?)
    }
}

/// Bytes that can only be passed over by reading them.
struct Forwards<R>(R);

impl<R: Read> Read for Forwards<R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(bytes)
    }
}

impl<R: Read> Stream for Forwards<R> {
    fn pass(&mut self, count: u64) -> std::io::Result<()> {
        let passed = std::io::copy(&mut self.0.by_ref().take(count), &mut std::io::sink())?;
        if passed < count { Err(std::io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
    }
}

/// How the bytes of a file are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    None,
    Gzip,
}

/// The bytes of a file from an offset on, unpacked on the way.
pub(super) fn stream(path: &Path, offset: u64, packing: Packing) -> Result<Box<dyn Stream>, String> {
    let mut file = BufReader::with_capacity(1 << 18, crate::input::open(path).map_err(|e| e.to_string())?);
    file.seek(SeekFrom::Start(offset)).map_err(|e| e.to_string())?;
    Ok(match packing {
        Packing::Gzip => Box::new(Forwards(flate2::bufread::MultiGzDecoder::new(file))),
        Packing::None => Box::new(file),
    })
}

/// A file that is packed by gzip begins so.
pub(super) fn is_gzip(path: &Path) -> bool {
    let mut magic = [0; 2];
    crate::input::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == [0x1f, 0x8b]
}

/// What becomes of each number: a scale, a shift, and which ones are none.
#[derive(Clone, Debug)]
pub(super) struct Meaning {
    /// Each value times `scale`, plus `shift`.
    pub scale: f64,
    pub shift: f64,
    /// Stored numbers that stand for no value.
    pub missing: Vec<f64>,
    /// Stored numbers outside of these count as no value.
    pub valid: (f64, f64),
    /// The same, after scale and shift.
    pub valid_scaled: (f64, f64),
}

impl Default for Meaning {
    fn default() -> Self {
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        Self { scale: 1.0, shift: 0.0, missing: Vec::new(), valid: all, valid_scaled: all }
    }
}

impl Meaning {
    /// A scale and a shift only.
    pub fn linear(scale: f64, shift: f64) -> Self {
        Self { scale, shift, ..Self::default() }
    }

    pub fn apply(&self, values: &mut [f64]) {
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        if !self.missing.is_empty() || self.valid != all {
            for value in values.iter_mut() {
                if self.missing.contains(value) || *value < self.valid.0 || *value > self.valid.1 {
                    *value = f64::NAN;
                }
            }
        }
        if (self.scale, self.shift) != (1.0, 0.0) {
            values.iter_mut().for_each(|value| *value = *value * self.scale + self.shift);
        }
        if self.valid_scaled != all {
            for value in values.iter_mut() {
                if *value < self.valid_scaled.0 || *value > self.valid_scaled.1 {
                    *value = f64::NAN;
                }
            }
        }
    }
}

/// Numbers from a stream of bytes.
pub(super) struct Bytes {
    reader: Box<dyn Stream>,
    kind: Kind,
    little_endian: bool,
    meaning: Meaning,
    /// Values read so far, for messages.
    at: u64,
    buffer: Vec<u8>,
}

impl Bytes {
    pub fn new(reader: Box<dyn Stream>, kind: Kind, little_endian: bool, meaning: Meaning) -> Self {
        Self { reader, kind, little_endian, meaning, at: 0, buffer: Vec::new() }
    }

    fn told(&self, error: &std::io::Error) -> String {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                format!("is cut off: its values end after the first {} or soon behind", self.at)
            }
            _ => format!("can't be read beyond its first {} values: {error}", self.at),
        }
    }
}

impl Numbers for Bytes {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        for block in out.chunks_mut(BLOCK) {
            self.buffer.resize(block.len() * self.kind.size(), 0);
            self.reader.read_exact(&mut self.buffer).map_err(|e| self.told(&e))?;
            block.copy_from_slice(&self.kind.decode(&self.buffer, self.little_endian).to_f64());
            self.meaning.apply(block);
            self.at += block.len() as u64;
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        self.reader.pass(count.saturating_mul(self.kind.size() as u64)).map_err(|e| self.told(&e))?;
        self.at += count;
        Ok(())
    }
}

/// Numbers written as words of text.
pub(super) struct Words<R> {
    reader: R,
    at: u64,
}

impl<R: BufRead> Words<R> {
    pub fn new(reader: R) -> Self {
        Self { reader, at: 0 }
    }

    fn word(&mut self) -> Result<f64, String> {
        let mut word = Vec::new();
        loop {
            let bytes = self.reader.fill_buf().map_err(|e| e.to_string())?;
            let Some(&byte) = bytes.first() else { break };
            self.reader.consume(1);
            let separator = byte.is_ascii_whitespace() || byte == b',';
            match (separator, word.is_empty()) {
                (true, true) => {}
                (true, false) => break,
                _ if word.len() > 64 => break,
                _ => word.push(byte),
            }
        }
        let text = String::from_utf8_lossy(&word);
        if text.is_empty() {
            return Err(format!("is cut off: there are {} values", self.at));
        }
        let value = text.parse().map_err(|_| format!("value {} is \"{text}\", which is no number", self.at))?;
        self.at += 1;
        Ok(value)
    }
}

impl<R: BufRead> Numbers for Words<R> {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        out.iter_mut().try_for_each(|slot| {
            *slot = self.word()?;
            Ok(())
        })
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        (0..count).try_for_each(|_| self.word().map(|_| ()))
    }
}

/// One channel out of several.
struct Picked {
    from: Box<dyn Numbers>,
    /// Values of one channel that stand together.
    run: usize,
    channels: usize,
    channel: usize,
    /// Values already taken of the current run.
    at: usize,
}

impl Picked {
    /// As many whole runs as make sense to read at once.
    fn several(&mut self, out: &mut [f64]) -> Result<(), String> {
        let width = self.run * self.channels;
        let mut block = vec![0.0; width * (out.len() / self.run)];
        self.from.read(&mut block)?;
        let picked = block.chunks_exact(width).map(|all| &all[self.channel * self.run..][..self.run]);
        out.chunks_exact_mut(self.run).zip(picked).for_each(|(slots, values)| slots.copy_from_slice(values));
        Ok(())
    }
}

impl Numbers for Picked {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        let (before, after) = (self.channel * self.run, (self.channels - 1 - self.channel) * self.run);
        let mut done = 0;
        while done < out.len() {
            let left = &mut out[done..];
            if self.at == 0 && self.run < BLOCK && left.len() >= self.run {
                let runs = (left.len() / self.run).min(BLOCK / (self.run * self.channels) + 1);
                self.several(&mut left[..runs * self.run])?;
                done += runs * self.run;
                continue;
            }
            if self.at == 0 {
                self.from.skip(before as u64)?;
            }
            let now = left.len().min(self.run - self.at);
            self.from.read(&mut left[..now])?;
            self.at += now;
            done += now;
            if self.at == self.run {
                self.from.skip(after as u64)?;
                self.at = 0;
            }
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        let (run, all) = (self.run as u64, (self.run * self.channels) as u64);
        // From the beginning of the current run on, in values of the channel; then in values of all.
        let place = |values: u64| {
            values / run * all + if values.is_multiple_of(run) { 0 } else { self.channel as u64 * run + values % run }
        };
        let (here, there) = (self.at as u64, self.at as u64 + count);
        self.at = (there % run) as usize;
        let passed = place(there) - place(here);
        self.from.skip(passed)
    }
}

/// Values in memory.
pub(super) struct Held {
    values: Vec<f64>,
    next: usize,
}

impl Held {
    pub fn new(values: Vec<f64>) -> Self {
        Self { values, next: 0 }
    }
}

impl Numbers for Held {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        let values = self.values.get(self.next..self.next + out.len()).ok_or("has no more values")?;
        out.copy_from_slice(values);
        self.next += out.len();
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        self.next = self.next.saturating_add(usize::try_from(count).unwrap_or(usize::MAX));
        Ok(())
    }
}

/// Values whose axes are brought into another order, all in memory from the first one on.
struct Turned {
    from: Option<Box<dyn Numbers>>,
    /// Of the axes that have several points: sizes and strides, in the order that is wanted.
    axes: Vec<(usize, usize)>,
    held: Held,
}

impl Turned {
    fn held(&mut self) -> Result<&mut Held, String> {
        if let Some(mut from) = self.from.take() {
            let count: usize = self.axes.iter().map(|(size, _)| size).product();
            let why = "its axes are kept in another order than x, y, z, time, so that it is read as a whole";
            room_for((2 * size_of::<f64>() as u64).saturating_mul(count as u64), why)?;
            let mut stored = vec![0.0; count];
            from.read(&mut stored)?;
            let mut index = vec![0usize; self.axes.len()];
            let mut place = 0;
            let mut turned = Vec::with_capacity(count);
            for _ in 0..count {
                turned.push(stored[place]);
                for (k, &(size, stride)) in self.axes.iter().enumerate() {
                    index[k] += 1;
                    place += stride;
                    if index[k] < size {
                        break;
                    }
                    place -= stride * size;
                    index[k] = 0;
                }
            }
            self.held = Held::new(turned);
        }
        Ok(&mut self.held)
    }
}

impl Numbers for Turned {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        self.held()?.read(out)
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        self.held()?.skip(count)
    }
}

/// Brings values into the order x, y, z, time. `sizes` are those of the file's axes, the fastest first, `order` says which
/// of these is x, y, z and time, as far as there are any, and `channel` which axis is fixed, and at what.
pub(super) fn arrange(
    mut values: Box<dyn Numbers>,
    sizes: &[usize],
    order: &[usize],
    channel: Option<(usize, usize)>,
) -> Box<dyn Numbers> {
    // Axes of one point are in order wherever they are.
    let mut order: Vec<usize> = order.iter().copied().filter(|&axis| sizes[axis] > 1).collect();
    let mut sizes = sizes.to_vec();
    let mut channel = channel.filter(|&(axis, _)| sizes[axis] > 1);
    if !order.is_sorted()
        && let Some(now) = values.reorder(&sizes, &order)
    {
        let place = |axis: usize| now.iter().position(|&a| a == axis).unwrap_or(axis);
        order.iter_mut().for_each(|axis| *axis = place(*axis));
        channel = channel.map(|(axis, index)| (place(axis), index));
        sizes = now.iter().map(|&axis| sizes[axis]).collect();
    }
    if let Some((axis, index)) = channel {
        let run = sizes[..axis].iter().product();
        values = Box::new(Picked { from: values, run, channels: sizes[axis], channel: index, at: 0 });
        sizes[axis] = 1;
    }
    if order.is_sorted() {
        return values;
    }
    let axes = order.iter().map(|&axis| (sizes[axis], sizes[..axis].iter().product())).collect();
    Box::new(Turned { from: Some(values), axes, held: Held::new(Vec::new()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_and_channel_gives_the_same_values() {
        // Value = 1000 c + x + 10 y + 100 z, stored with each axis at each place.
        let (sizes, weights) = ([3, 4, 2, 5], [1.0, 10.0, 100.0, 1000.0]);
        let expected: Vec<f64> =
            (0..24).map(|i| 2000.0 + (i % 3) as f64 + (i / 3 % 4) as f64 * 10.0 + (i / 12) as f64 * 100.0).collect();
        for code in 0..256 {
            let axes: Vec<usize> = (0..4).map(|k| code >> (2 * k) & 3).collect();
            if (0..4).any(|axis| !axes.contains(&axis)) {
                continue;
            }
            let stored: Vec<usize> = axes.iter().map(|&axis| sizes[axis]).collect();
            let values = (0..120usize).map(|i| {
                let mut rest = i;
                axes.iter()
                    .map(|&axis| {
                        let at = rest % sizes[axis];
                        rest /= sizes[axis];
                        at as f64 * weights[axis]
                    })
                    .sum()
            });
            let at = |axis: usize| axes.iter().position(|&a| a == axis).unwrap();
            let order = [at(0), at(1), at(2)];
            for (skip, read) in [(0, 24), (5, 19), (13, 4)] {
                let held = Box::new(Held::new(values.clone().collect()));
                let mut arranged = arrange(held, &stored, &order, Some((at(3), 2)));
                arranged.skip(skip).unwrap();
                let mut found = vec![0.0; read];
                let (first, second) = found.split_at_mut(read / 2);
                arranged.read(first).unwrap();
                arranged.read(second).unwrap();
                assert_eq!(found, expected[skip as usize..][..read], "{axes:?} {skip}");
            }
        }
    }
}
