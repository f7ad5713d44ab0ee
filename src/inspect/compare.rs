//! How far two images, meshes or lists of numbers are apart: the regression comparison.
//!
//! Two numbers agree if `|a - b| <= atol + rtol |b|`, the rule of numpy's `allclose`, with b the reference. Equal
//! infinities agree, and so do two NaNs; a NaN or an infinity against anything else differs, and counts as
//! incomparable because no difference can be told. Integers are subtracted as integers, so that 64-bit ones do not
//! round. Whatever exists on one side only is a difference too, as is another grid or other cells. Field data is
//! compared only where a text of it is asked for by its name: it says how a file was made, not what it shows.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::{Serialize, Serializer};

use crate::io::vtk::{DataSet, Field, Image, UnstructuredGrid};
use crate::volume::{Array, Grid, Values, Volume};

/// What still counts as the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Absolute tolerance.
    pub atol: f64,
    /// Relative tolerance, times the reference's magnitude.
    pub rtol: f64,
    /// How many numbers of an array may differ all the same.
    pub max_different: usize,
    /// Only these arrays are compared; all of them if there are none. One that neither side has is a difference.
    pub arrays: Vec<String>,
    /// What holds instead for the arrays of these names.
    pub each: BTreeMap<String, Limits>,
    /// Files that are left out where folders are compared, by their paths or their names.
    pub ignore: Vec<glob::Pattern>,
}

/// What two numbers of an array, and how many of them, may be apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Absolute tolerance.
    pub atol: f64,
    /// Relative tolerance, times the reference's magnitude.
    pub rtol: f64,
    /// How many numbers of an array may differ all the same.
    pub max_different: usize,
}

impl Limits {
    pub(super) fn agree(&self, difference: f64, reference: f64) -> bool {
        difference <= self.atol + self.rtol * reference.abs()
    }
}

/// The outcome of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Whether the two count as the same.
    pub same: bool,
    /// What differs beside numbers: the grid, arrays on one side only, other types.
    pub differences: Vec<String>,
    /// The arrays that both sides have, in the first one's order.
    pub arrays: Vec<ArrayComparison>,
}

/// How far two arrays of one name are apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArrayComparison {
    /// The array's name.
    pub name: String,
    /// Numbers compared.
    pub count: usize,
    /// Numbers beyond tolerance.
    pub different: usize,
    /// Of these, the ones with a NaN or an infinity on one side.
    pub incomparable: usize,
    /// The largest difference between comparable numbers.
    pub largest: f64,
    /// The root of the mean square of all comparable differences.
    pub rms: f64,
    /// Where the first incomparable number is, or else the largest difference; none if there is no difference at all.
    pub at: Option<Place>,
    /// Whether no more numbers differ than may.
    pub same: bool,
}

/// A number in an array.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// The tuple's index: the point's or the cell's.
    pub index: usize,
    /// The voxel (i, j, k), in an image.
    pub voxel: Option<[usize; 3]>,
    /// The component.
    pub component: usize,
    /// The number on the first side, as text; in JSON as a number, if it is one.
    #[serde(serialize_with = "number_or_text")]
    pub a: String,
    /// The number on the second side, as text; in JSON as a number, if it is one.
    #[serde(serialize_with = "number_or_text")]
    pub b: String,
}

/// Infinities and NaNs, which JSON has no numbers for, stay texts.
fn number_or_text<S: Serializer>(text: &str, serializer: S) -> Result<S::Ok, S::Error> {
    match (text.parse::<i64>(), text.parse::<u64>(), text.parse::<f64>()) {
        (Ok(i), ..) => serializer.serialize_i64(i),
        (_, Ok(i), _) => serializer.serialize_u64(i),
        (.., Ok(x)) if x.is_finite() => serializer.serialize_f64(x),
        _ => serializer.serialize_str(text),
    }
}

/// Compares two data sets read from files.
pub fn data_sets(a: &DataSet, b: &DataSet, tolerance: &Tolerance) -> Comparison {
    match (a, b) {
        (DataSet::Image(a), DataSet::Image(b)) => images(a, b, tolerance),
        (DataSet::Unstructured(a), DataSet::Unstructured(b)) => meshes(a, b, tolerance),
        (DataSet::Image(_), _) => of_other_kind("an image", "a mesh"),
        (DataSet::Unstructured(_), _) => of_other_kind("a mesh", "an image"),
    }
}

/// The comparison of two things that have nothing in common.
pub fn of_other_kind(a: &str, b: &str) -> Comparison {
    Comparison { differences: vec![format!("the first is {a}, the second {b}")], ..Comparison::default() }
}

/// Compares two images: grid, arrays on points and on cells.
pub fn images(a: &Image, b: &Image, tolerance: &Tolerance) -> Comparison {
    let mut comparison = Comparison::default();
    comparison.grids(&a.grid, &b.grid, tolerance);
    if a.direction != b.direction {
        comparison.differences.push(format!("direction {:?} and {:?}", a.direction, b.direction));
    }
    let grid = (a.grid.dimensions == b.grid.dimensions).then_some(&a.grid);
    comparison.lists("", &a.point_arrays, &b.point_arrays, grid, tolerance);
    comparison.lists("cell ", &a.cell_arrays, &b.cell_arrays, None, tolerance);
    comparison.texts(&a.field_data, &b.field_data, tolerance);
    comparison.finish(tolerance)
}

/// Compares two images in memory.
pub fn volumes(a: &Volume, b: &Volume, tolerance: &Tolerance) -> Comparison {
    images(&a.clone().into(), &b.clone().into(), tolerance)
}

/// Compares two meshes: points, cells, arrays on both.
pub fn meshes(a: &UnstructuredGrid, b: &UnstructuredGrid, tolerance: &Tolerance) -> Comparison {
    let mut comparison = Comparison::default();
    if a.points.len() != b.points.len() {
        comparison.differences.push(format!("{} and {} points", a.points.len(), b.points.len()));
    } else if tolerance.takes("points") {
        let points = |g: &UnstructuredGrid| Array::new("points", 3, g.points.as_flattened().to_vec());
        comparison.arrays.push(array(&points(a), &points(b), None, tolerance));
    }
    if a.types.len() != b.types.len() {
        comparison.differences.push(format!("{} and {} cells", a.types.len(), b.types.len()));
    } else if let Some(i) = a.cells().zip(b.cells()).position(|(a, b)| a != b) {
        comparison.differences.push(format!("other cells, the first at index {i}"));
    }
    comparison.lists("", &a.point_arrays, &b.point_arrays, None, tolerance);
    comparison.lists("cell ", &a.cell_arrays, &b.cell_arrays, None, tolerance);
    comparison.texts(&a.field_data, &b.field_data, tolerance);
    comparison.finish(tolerance)
}

/// Compares two lists of numbers, occlusion files say, under a name for messages.
pub fn lists(name: &str, a: &Values, b: &Values, tolerance: &Tolerance) -> Comparison {
    let list = |values: &Values| [Array::new(name, 1, values.clone())];
    let mut comparison = Comparison::default();
    comparison.lists("", &list(a), &list(b), None, tolerance);
    comparison.finish(tolerance)
}

/// The text of this name in the field data.
pub(super) fn text_of(fields: &[Field], name: &str) -> Option<String> {
    fields.iter().find(|field| matches!(field, Field::Text(own, _) if own == name)).map(Field::text)
}

impl Tolerance {
    /// Whether it is about this array and no other.
    pub(super) fn takes_all_of(&self, array: &str) -> bool {
        self.arrays.iter().all(|name| name == array)
    }

    /// What holds where nothing else is said.
    pub fn limits(&self) -> Limits {
        Limits { atol: self.atol, rtol: self.rtol, max_different: self.max_different }
    }

    /// What holds for an array.
    pub fn of(&self, array: &str) -> Limits {
        self.each.get(array).copied().unwrap_or_else(|| self.limits())
    }

    /// Whether a file of a folder, by its path below that, is left out.
    pub fn ignores(&self, file: &Path) -> bool {
        let name = file.file_name().map(Path::new);
        self.ignore.iter().any(|p| p.matches_path(file) || name.is_some_and(|name| p.matches_path(name)))
    }

    pub(super) fn takes(&self, array: &str) -> bool {
        self.arrays.is_empty() || self.arrays.iter().any(|name| name == array)
    }
}

impl Comparison {
    /// Grids must have the same dimensions; origin and spacing may differ as far as numbers may.
    fn grids(&mut self, a: &Grid, b: &Grid, tolerance: &Tolerance) {
        if a.dimensions != b.dimensions {
            self.differences.push(format!("dimensions {:?} and {:?}", a.dimensions, b.dimensions));
        }
        for (what, a, b) in [("origin", a.origin, b.origin), ("spacing", a.spacing, b.spacing)] {
            if a.iter().zip(&b).any(|(a, b)| !tolerance.limits().agree((a - b).abs(), *b)) {
                self.differences.push(format!("{what} {a:?} and {b:?}"));
            }
        }
    }

    /// Arrays are matched by name.
    fn lists(&mut self, kind: &str, a: &[Array], b: &[Array], grid: Option<&Grid>, tolerance: &Tolerance) {
        for x in a.iter().filter(|x| tolerance.takes(&x.name)) {
            let Some(y) = b.iter().find(|y| y.name == x.name) else {
                self.differences.push(format!("{kind}array `{}` is only in the first", x.name));
                continue;
            };
            if (x.values.kind(), x.components) != (y.values.kind(), y.components) {
                let kind_of = |a: &Array| format!("{} x {}", a.components, a.values.kind().vtk_name());
                self.differences.push(format!("{kind}array `{}` is {} and {}", x.name, kind_of(x), kind_of(y)));
            }
            if x.values.len() != y.values.len() {
                let (m, n) = (x.values.len(), y.values.len());
                self.differences.push(format!("{kind}array `{}` has {m} and {n} numbers", x.name));
            } else if x.components == y.components {
                self.arrays.push(array(x, y, grid, tolerance));
            }
        }
        for y in b.iter().filter(|y| tolerance.takes(&y.name) && !a.iter().any(|x| x.name == y.name)) {
            self.differences.push(format!("{kind}array `{}` is only in the second", y.name));
        }
    }

    /// Of one array.
    pub(super) fn of(array: ArrayComparison) -> Self {
        Self { same: array.same, differences: Vec::new(), arrays: vec![array] }
    }

    /// Texts of the field data that are asked for by name.
    fn texts(&mut self, a: &[Field], b: &[Field], tolerance: &Tolerance) {
        for name in &tolerance.arrays {
            let (x, y) = (text_of(a, name), text_of(b, name));
            match (&x, &y) {
                (None, None) => continue,
                (Some(_), None) => self.differences.push(format!("text array `{name}` is only in the first")),
                (None, Some(_)) => self.differences.push(format!("text array `{name}` is only in the second")),
                (Some(x), Some(y)) if x == y => self.arrays.push(ArrayComparison {
                    name: name.clone(),
                    count: x.len(),
                    different: 0,
                    incomparable: 0,
                    largest: 0.0,
                    rms: 0.0,
                    at: None,
                    same: true,
                }),
                (Some(x), Some(y)) => {
                    let line = x.lines().zip(y.lines()).take_while(|(x, y)| x == y).count() + 1;
                    self.differences.push(format!("text array `{name}`, from line {line} on"));
                }
            }
        }
    }

    fn finish(mut self, tolerance: &Tolerance) -> Self {
        for name in &tolerance.arrays {
            let known = self.arrays.iter().any(|a| a.name == *name)
                || self.differences.iter().any(|d| d.contains(&format!("array `{name}`")));
            if !known {
                self.differences.push(format!("neither has an array `{name}`"));
            }
        }
        self.same = self.differences.is_empty() && self.arrays.iter().all(|a| a.same);
        self
    }
}

/// Compares two arrays of equal length and equally many components; with a grid, places become voxels.
fn array(a: &Array, b: &Array, grid: Option<&Grid>, tolerance: &Tolerance) -> ArrayComparison {
    let limits = tolerance.of(&a.name);
    let mut differences = Differences::default();
    differences.add(&a.values, &b.values, &limits);
    differences.finish(&a.name, a.components, grid, &limits)
}

/// A number that differs: which, and both sides as text.
type At = Option<(usize, [String; 2])>;

/// How far two lists of numbers are apart, found block by block.
#[derive(Debug, Default)]
pub(super) struct Differences {
    count: usize,
    different: usize,
    incomparable: usize,
    largest: f64,
    squares: f64,
    first_incomparable: At,
    largest_at: At,
}

impl Differences {
    /// The next numbers of both.
    pub fn add(&mut self, a: &Values, b: &Values, limits: &Limits) {
        let (count, before) = (a.len().min(b.len()), self.count);
        self.count += count;
        let at = |i: usize| Some((before + i, [a.format(i), b.format(i)]));
        for i in 0..count {
            let (x, y) = (a.get(i), b.get(i));
            let difference = match (a.integer(i), b.integer(i)) {
                (Some(x), Some(y)) => (x - y).abs() as f64,
                _ if x == y || (x.is_nan() && y.is_nan()) => 0.0,
                _ if !x.is_finite() || !y.is_finite() => {
                    self.different += 1;
                    self.incomparable += 1;
                    self.first_incomparable = self.first_incomparable.take().or_else(|| at(i));
                    continue;
                }
                _ => (x - y).abs(),
            };
            if difference == 0.0 {
                continue;
            }
            self.different += usize::from(!limits.agree(difference, y));
            self.squares += difference * difference;
            if difference > self.largest {
                (self.largest, self.largest_at) = (difference, at(i));
            }
        }
    }

    /// What was found; with a grid, places become voxels.
    pub fn finish(self, name: &str, components: usize, grid: Option<&Grid>, limits: &Limits) -> ArrayComparison {
        let comparable = self.count - self.incomparable;
        let place = |(i, [a, b]): (usize, [String; 2])| {
            let (index, component) = (i / components.max(1), i % components.max(1));
            Place { index, voxel: grid.map(|g| g.index(index)), component, a, b }
        };
        ArrayComparison {
            name: name.into(),
            count: self.count,
            different: self.different,
            incomparable: self.incomparable,
            largest: self.largest,
            rms: if comparable == 0 { 0.0 } else { (self.squares / comparable as f64).sqrt() },
            at: self.first_incomparable.or(self.largest_at).map(place),
            same: self.different <= limits.max_different,
        }
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for difference in &self.differences {
            writeln!(f, "different: {difference}")?;
        }
        for array in &self.arrays {
            writeln!(f, "{array}")?;
        }
        f.write_str(if self.same { "same" } else { "different" })
    }
}

impl fmt::Display for ArrayComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, count, different, incomparable, largest, rms, at, same } = self;
        write!(f, "{}: {name}: ", if *same { "same" } else { "different" })?;
        let Some(at) = at else { return write!(f, "{count} numbers, all equal") };
        write!(f, "{different} of {count} numbers differ, largest {largest:.3e}, rms {rms:.3e}")?;
        if *incomparable > 0 {
            write!(f, ", {incomparable} with NaN or infinity on one side")?;
        }
        write!(f, "; {} and {} at {}", at.a, at.b, at.index)?;
        if let Some([i, j, k]) = at.voxel {
            write!(f, " (voxel {i}, {j}, {k})")?;
        }
        if at.component > 0 { write!(f, ", component {}", at.component) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(values: Vec<f32>) -> Volume {
        let grid = Grid { dimensions: [2, 3, 1], origin: [0.0; 3], spacing: [1.0; 3] };
        Volume { grid, arrays: vec![Array::new("a", 1, values)], field_data: Vec::new() }
    }

    fn zeros_with(i: usize, x: f32) -> Volume {
        let mut values = vec![0.0; 6];
        values[i] = x;
        volume(values)
    }

    #[test]
    fn a_difference_is_found_and_placed() {
        let c = volumes(&zeros_with(3, 0.5), &zeros_with(0, 0.0), &Tolerance::default());
        assert!(!c.same);
        let a = &c.arrays[0];
        assert_eq!((a.different, a.largest, a.at.as_ref().unwrap().voxel), (1, 0.5, Some([1, 1, 0])));
        assert!((a.rms - 0.5 / 6f64.sqrt()).abs() < 1e-12);
        assert!(c.to_string().contains("0.5 and 0.0 at 3 (voxel 1, 1, 0)"), "{c}");
        for tolerance in
            [Tolerance { atol: 0.5, ..Default::default() }, Tolerance { max_different: 1, ..Default::default() }]
        {
            assert!(volumes(&zeros_with(3, 0.5), &zeros_with(0, 0.0), &tolerance).same);
        }
        // rtol goes by the second side: here that is zero, and there it is not.
        let relative = Tolerance { rtol: 1.0, ..Default::default() };
        assert!(!volumes(&zeros_with(3, 0.5), &zeros_with(0, 0.0), &relative).same);
        assert!(volumes(&zeros_with(0, 0.0), &zeros_with(3, 0.5), &relative).same);
    }

    #[test]
    fn nan_and_infinity() {
        let exact = Tolerance::default();
        let lenient = Tolerance { atol: 1e30, rtol: 1e30, ..Default::default() };
        assert!(volumes(&zeros_with(1, f32::NAN), &zeros_with(1, -f32::NAN), &exact).same);
        assert!(volumes(&zeros_with(1, f32::INFINITY), &zeros_with(1, f32::INFINITY), &exact).same);
        for (x, y) in [(f32::NAN, 0.0), (0.0, f32::INFINITY), (f32::INFINITY, f32::NEG_INFINITY)] {
            let c = volumes(&zeros_with(1, x), &zeros_with(1, y), &lenient);
            assert!(!c.same);
            assert_eq!((c.arrays[0].incomparable, c.arrays[0].at.as_ref().unwrap().index), (1, 1));
            assert!(c.arrays[0].rms.is_finite());
        }
    }

    #[test]
    fn what_is_missing_or_of_another_kind_is_a_difference() {
        let a = volume(vec![0.0; 6]);
        let mut b = a.clone();
        b.arrays.push(Array::new("b", 1, vec![0u8; 6]));
        let all = Tolerance::default();
        assert!(volumes(&b, &a, &all).to_string().contains("`b` is only in the first"));
        assert!(volumes(&a, &b, &all).to_string().contains("`b` is only in the second"));
        let only = |name: &str| Tolerance { arrays: vec![name.into()], ..Default::default() };
        assert!(volumes(&a, &b, &only("a")).same);
        assert!(!volumes(&a, &b, &only("b")).same);
        assert!(volumes(&a, &b, &only("c")).to_string().contains("neither has an array `c`"));
        let mut c = a.clone();
        c.arrays[0].values = vec![0.0f64; 6].into();
        assert!(volumes(&a, &c, &all).to_string().contains("1 x Float32 and 1 x Float64"));
        let mut d = a.clone();
        d.grid.spacing[1] = 1.25;
        assert!(volumes(&a, &d, &all).to_string().contains("spacing"));
        let mut e = a.clone();
        e.grid.dimensions = [3, 2, 1];
        assert!(!volumes(&a, &e, &all).same);
    }

    #[test]
    fn wide_integers_do_not_round() {
        let (a, b) = (Values::I64(vec![i64::MAX, i64::MIN]), Values::I64(vec![i64::MAX - 1, i64::MIN]));
        let c = lists("index", &a, &b, &Tolerance::default());
        assert_eq!((c.arrays[0].different, c.arrays[0].largest), (1, 1.0));
        assert!(!lists("index", &a, &Values::I64(vec![0]), &Tolerance::default()).same);
    }
}
