//! What can be said about an array in a line: its type, and for each component the smallest, largest and mean number.
//!
//! Infinities and NaNs are counted and left out of the rest, since one of them would hide all that is there besides:
//! the depth of a picture is infinite wherever nothing is seen.

use std::fmt;

use serde::Serialize;

use crate::volume::{Array, Kind};

/// An array, summarised.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArraySummary {
    /// Its name.
    pub name: String,
    /// The type of its numbers.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// Numbers a tuple.
    pub components: usize,
    /// How many tuples there are.
    pub tuples: usize,
    /// Of each component.
    pub ranges: Vec<Range>,
    /// How many numbers there are in each of equal parts of the range; of images' arrays of one number a tuple only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub histogram: Vec<u64>,
}

/// Bars of a histogram.
pub(super) const BARS: usize = 16;

/// The bar that a finite number belongs to.
pub(super) fn bar(value: f64, low: f64, high: f64) -> usize {
    (((value - low) / (high - low) * BARS as f64).max(0.0) as usize).min(BARS - 1)
}

/// What the numbers of one component are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Range {
    /// The smallest finite number, if there is one.
    pub min: Option<f64>,
    /// The largest finite number, if there is one.
    pub max: Option<f64>,
    /// The mean of all finite numbers, if there are any.
    pub mean: Option<f64>,
    /// How many are infinite.
    pub infinite: usize,
    /// How many are no numbers.
    pub nan: usize,
}

impl Range {
    /// Of these numbers.
    pub fn of(numbers: impl Iterator<Item = f64>) -> Self {
        let mut tally = Tally::default();
        numbers.for_each(|x| tally.add(x));
        tally.range()
    }
}

/// A range in the making.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    range: Range,
    sum: f64,
    count: usize,
}

impl Tally {
    /// One more number.
    pub fn add(&mut self, x: f64) {
        let range = &mut self.range;
        if x.is_nan() {
            range.nan += 1;
        } else if x.is_infinite() {
            range.infinite += 1;
        } else {
            range.min = Some(range.min.map_or(x, |m: f64| m.min(x)));
            range.max = Some(range.max.map_or(x, |m: f64| m.max(x)));
            self.sum += x;
            self.count += 1;
        }
    }

    /// Of all numbers so far.
    pub fn range(mut self) -> Range {
        self.range.mean = (self.count > 0).then(|| self.sum / self.count as f64);
        self.range
    }
}

impl ArraySummary {
    /// Of this array.
    pub fn of(array: &Array) -> Self {
        let (components, count) = (array.components.max(1), array.values.len());
        let component = |c: usize| Range::of((c..count).step_by(components).map(|i| array.values.get(i)));
        Self {
            name: array.name.clone(),
            kind: array.values.kind(),
            components,
            tuples: array.tuples(),
            ranges: (0..components).map(component).collect(),
            histogram: Vec::new(),
        }
    }

    /// The same with a histogram, where a tuple is one number.
    pub fn with_histogram(array: &Array) -> Self {
        let mut summary = Self::of(array);
        if let ([Range { min: Some(low), max: Some(high), .. }], 1) = (summary.ranges.as_slice(), array.components) {
            let mut histogram = vec![0u64; BARS];
            let values = (0..array.values.len()).map(|i| array.values.get(i));
            values.filter(|x| x.is_finite()).for_each(|x| histogram[bar(x, *low, *high)] += 1);
            summary.histogram = histogram;
        }
        summary
    }

    /// The histogram in words.
    pub(super) fn histogram_line(&self) -> Option<String> {
        (!self.histogram.is_empty()).then(|| histogram_line(&self.histogram))
    }
}

/// How many values there are in each part of their range.
pub(super) fn histogram_line(bars: &[u64]) -> String {
    let counts: Vec<String> = bars.iter().map(u64::to_string).collect();
    format!("in {BARS} equal parts of this range: {}", counts.join(" "))
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.min, self.max, self.mean) {
            (Some(min), Some(max), Some(mean)) => write!(f, "{} to {}, mean {}", Short(min), Short(max), Short(mean))?,
            _ if self.infinite + self.nan == 0 => f.write_str("empty")?,
            _ => f.write_str("nothing finite")?,
        }
        for (count, what) in [(self.infinite, "infinite"), (self.nan, "NaN")] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for ArraySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} x {}: ", self.name, self.components, self.kind.vtk_name())?;
        for (i, range) in self.ranges.iter().enumerate() {
            write!(f, "{}{range}", if i > 0 { "; " } else { "" })?;
        }
        Ok(())
    }
}

/// A number in six digits at most; whole ones and round ones in fewer.
pub(super) struct Short(pub f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let x = self.0;
        let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
        if x == 0.0 || (1e-4..1e9).contains(&x.abs()) { write!(f, "{rounded}") } else { write!(f, "{rounded:e}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_counted_and_left_out() {
        let (inf, nan) = (f32::INFINITY, f32::NAN);
        let array = Array::new("a", 2, vec![1.0f32, inf, 3.0, -inf, nan, nan]);
        let summary = ArraySummary::of(&array);
        assert_eq!(summary.tuples, 3);
        assert_eq!(summary.ranges[0], Range { min: Some(1.0), max: Some(3.0), mean: Some(2.0), infinite: 0, nan: 1 });
        assert_eq!(summary.ranges[1], Range { infinite: 2, nan: 1, ..Range::default() });
        assert_eq!(summary.to_string(), "a, 2 x Float32: 1 to 3, mean 2, 1 NaN; nothing finite, 2 infinite, 1 NaN");
    }

    #[test]
    fn numbers_are_short() {
        for (x, text) in [(0.1f32 as f64, "0.1"), (255.0, "255"), (-1.0 / 3.0, "-0.333333"), (1e-7, "1e-7"), (0.0, "0")]
        {
            assert_eq!(Short(x).to_string(), text);
        }
    }
}
