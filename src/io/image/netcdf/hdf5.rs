//! NetCDF-4, which is HDF5 with conventions: dimensions are data sets of the class DIMENSION_SCALE, and each variable refers to
//! its own by DIMENSION_LIST. HDF5 without these is read too; its dimensions then have no names.
//!
//! The `hdf5-reader` crate decodes chunks, filters and the trees that find them. Values are read in slabs, so memory is that of
//! a slab and of the crate's cache of chunks. The file is read by ranges, not mapped, so one that is cut off meanwhile is an
//! error. Links and data in other files are not followed.

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use hdf5_reader::datatype_api::H5Type;
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::storage::FileStorage;
use hdf5_reader::{Attribute, ByteOrder, Dataset, Datatype, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};

use super::super::MOST_FROM_GZIP;
use super::super::numbers::{Meaning, Numbers};
use super::Container;
use super::header::{Content, Dimension, Header, Variable};
use crate::volume::{Kind, available_memory};

/// How an HDF5 file begins.
const MAGIC: [u8; 8] = *b"\x89HDF\r\n\x1a\n";
/// Groups inside each other.
const DEEPEST: usize = 16;
/// Data sets of a file.
const MOST: usize = 10_000;
/// Values that are read at once.
const SLAB: usize = 1 << 20;
/// Bytes that may come out of nothing, where values were never written.
const UNWRITTEN: u64 = 1 << 30;

/// What NetCDF calls a dimension that has no coordinates, at the beginning of the attribute NAME.
const NO_VARIABLE: &str = "This is a netCDF dimension but not a netCDF variable";
/// What it puts in front of a variable that has the name of a dimension and isn't its coordinates.
const NOT_COORDINATES: &str = "_nc4_non_coord_";

/// Whether a file is of HDF5.
pub(super) fn begins(path: &Path) -> bool {
    let mut begin = [0; 8];
    crate::input::open(path).and_then(|mut file| file.read_exact(&mut begin)).is_ok() && begin == MAGIC
}

/// A file with the data sets behind its variables.
pub(super) struct Hdf5 {
    header: Header,
    /// One a variable.
    sets: Vec<Dataset>,
    length: u64,
}

impl Hdf5 {
    pub fn open(path: &Path, length: u64) -> Result<Self, String> {
        let free = usize::try_from(available_memory().unwrap_or(1 << 32)).unwrap_or(usize::MAX);
        let options = OpenOptions::default()
            .with_chunk_cache_bytes((free / 8).min(1 << 28))
            .with_max_chunk_bytes(free / 4)
            .with_max_read_bytes(free / 4);
        let file = crate::input::open(path).map_err(|e| e.to_string())?;
        let storage = FileStorage::from_file(file).map_err(told)?;
        let file = Hdf5File::from_storage_with_options(Arc::new(storage), options).map_err(told)?;
        let mut sets = Vec::new();
        collect(&file.root_group().map_err(told)?, "", 0, &mut sets)?;
        let offset_size = file.superblock().offset_size;
        let (header, sets) = lists(sets, offset_size)?;
        Ok(Self { header, sets, length })
    }
}

/// What the crate says.
fn told(error: Error) -> String {
    match error.to_string() {
        filter if filter.starts_with("unsupported filter") => {
            format!(
                "unsupported: it is packed by a filter of its own ({filter}); convert it: h5repack -f GZIP=4 IN OUT"
            )
        }
        error => format!("its HDF5 can't be read: {error}"),
    }
}

/// All data sets, with their paths.
fn collect(group: &Group, before: &str, depth: usize, sets: &mut Vec<(String, Dataset)>) -> Result<(), String> {
    let (groups, own) = group.members().map_err(told)?;
    sets.extend(own.into_iter().map(|set| (format!("{before}{}", leaf(set.name())), set)));
    if depth == DEEPEST || sets.len() > MOST {
        return Err(format!("has groups more than {DEEPEST} deep, or more than {MOST} data sets"));
    }
    groups.iter().try_for_each(|g| collect(g, &format!("{before}{}/", leaf(g.name())), depth + 1, sets))
}

fn leaf(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The dimensions and variables that the data sets are, and the data set of each variable.
fn lists(sets: Vec<(String, Dataset)>, offset_size: u8) -> Result<(Header, Vec<Dataset>), String> {
    let mut header = Header { version: 4, records: None, dimensions: Vec::new(), variables: Vec::new() };
    let (mut by_address, mut by_number) = (HashMap::new(), HashMap::new());
    let attributes: Vec<Vec<Attribute>> = sets.iter().map(|(_, set)| set.attributes()).collect();
    let find = |list: &[Attribute], name: &str| list.iter().position(|a| a.name == name);
    let text = |list: &[Attribute], name: &str| find(list, name).and_then(|i| list[i].read_string().ok());
    for ((path, set), list) in sets.iter().zip(&attributes) {
        if text(list, "CLASS").is_some_and(|class| class.trim_end_matches('\0') == "DIMENSION_SCALE") {
            let dimension = header.dimensions.len();
            header.dimensions.push(Dimension { name: path.clone(), size: set.shape().first().copied().unwrap_or(1) });
            by_address.insert(set.address(), dimension);
            if let Some(number) = find(list, "_Netcdf4Dimid").and_then(|i| list[i].read_as_f64().ok()) {
                by_number.insert(number as i64, dimension);
            }
        }
    }
    let mut own = Vec::new();
    for ((path, set), list) in sets.into_iter().zip(attributes) {
        let scale = by_address.get(&set.address()).copied();
        if scale.is_some() && text(&list, "NAME").is_some_and(|name| name.starts_with(NO_VARIABLE)) {
            continue;
        }
        let rank = set.shape().len();
        let mut dimensions = of_list(&set, &list, offset_size, &by_address)
            .or_else(|| scale.filter(|_| rank == 1).map(|dimension| vec![dimension]))
            .or_else(|| {
                let numbers = list[find(&list, "_Netcdf4Coordinates")?].read_1d::<i32>().ok()?;
                numbers.iter().map(|&n| by_number.get(&i64::from(n)).copied()).collect()
            })
            .filter(|dimensions| dimensions.len() == rank);
        let known = dimensions.get_or_insert_with(|| {
            let first = header.dimensions.len();
            let anonymous = set.shape().iter().enumerate();
            header.dimensions.extend(anonymous.map(|(i, &size)| Dimension { name: format!("dimension {i}"), size }));
            (first..first + rank).collect()
        });
        // A dimension that grows has grown as far as any of its variables; the others lack what they are shorter.
        for (&d, &size) in known.iter().zip(set.shape()) {
            header.dimensions[d].size = header.dimensions[d].size.max(size);
        }
        let name = match path.rsplit_once('/') {
            Some((group, name)) => format!("{group}/{}", name.strip_prefix(NOT_COORDINATES).unwrap_or(name)),
            None => path.strip_prefix(NOT_COORDINATES).unwrap_or(&path).to_owned(),
        };
        let kind = kind(set.dtype()).map(|(kind, _)| kind);
        let attributes = list.iter().filter_map(|a| Some((a.name.clone(), content(a)?))).collect();
        header.variables.push(Variable { name, dimensions: std::mem::take(known), attributes, kind, begin: 0 });
        own.push(set);
    }
    Ok((header, own))
}

/// The dimensions that DIMENSION_LIST refers to, if all of them are known.
fn of_list(
    set: &Dataset,
    attributes: &[Attribute],
    offset_size: u8,
    by_address: &HashMap<u64, usize>,
) -> Option<Vec<usize>> {
    let list = attributes.iter().find(|a| a.name == "DIMENSION_LIST")?;
    let width = usize::from(offset_size);
    let references = list.raw_data.chunks_exact(set.vlen_reference_size());
    let dimension = |reference: &[u8]| {
        let bytes = set.resolve_vlen_reference_bytes(reference, width).ok()?;
        let address = bytes.get(..width)?.iter().rev().fold(0u64, |n, &byte| n << 8 | u64::from(byte));
        by_address.get(&address).copied()
    };
    references.map(dimension).collect()
}

/// The type of numbers, and whether the lowest byte comes first; none for what is no number of the types known here.
fn kind(datatype: &Datatype) -> Option<(Kind, bool)> {
    let (kind, order) = match datatype {
        Datatype::FixedPoint { size, signed, byte_order } => {
            let kind = match (size, signed) {
                (1, true) => Kind::I8,
                (1, false) => Kind::U8,
                (2, true) => Kind::I16,
                (2, false) => Kind::U16,
                (4, true) => Kind::I32,
                (4, false) => Kind::U32,
                (8, true) => Kind::I64,
                (8, false) => Kind::U64,
                _ => return None,
            };
            (kind, byte_order)
        }
        Datatype::FloatingPoint { size: 4, byte_order } => (Kind::F32, byte_order),
        Datatype::FloatingPoint { size: 8, byte_order } => (Kind::F64, byte_order),
        _ => return None,
    };
    Some((kind, *order == ByteOrder::LittleEndian))
}

fn content(attribute: &Attribute) -> Option<Content> {
    match kind(&attribute.datatype) {
        Some((kind, little_endian)) => Some(Content::Numbers(kind.decode(&attribute.raw_data, little_endian))),
        None => match attribute.read_strings() {
            Ok(texts) if texts.len() > 1 => Some(Content::Text(texts.join(" "))),
            _ => attribute.read_string().ok().map(Content::Text),
        },
    }
}

impl Container for Hdf5 {
    fn format(&self) -> &'static str {
        let named = self.header.dimensions.iter().any(|dimension| !dimension.name.starts_with("dimension "));
        if named { "NetCDF-4 (HDF5)" } else { "HDF5" }
    }

    fn header(&self) -> &Header {
        &self.header
    }

    fn size(&self, dimension: usize) -> usize {
        usize::try_from(self.header.dimensions[dimension].size).unwrap_or(usize::MAX)
    }

    fn numbers(&self, variable: &Variable, kind: Kind, meaning: Meaning) -> Result<Box<dyn Numbers>, String> {
        let place = self.header.variables.iter().position(|v| std::ptr::eq(v, variable));
        let mut set = self.sets.get(place.unwrap_or(usize::MAX)).ok_or("has no such variable")?.clone();
        let shape: Vec<u64> = variable.dimensions.iter().map(|&d| self.header.dimensions[d].size).collect();
        let bytes = shape.iter().try_fold(kind.size() as u64, |product, &n| product.checked_mul(n));
        let most = self.length.saturating_mul(MOST_FROM_GZIP).saturating_add(UNWRITTEN);
        if bytes.is_none_or(|bytes| bytes > most) {
            let (name, length) = (&variable.name, self.length);
            return Err(format!("declares {shape:?} values of \"{name}\", more than its {length} bytes can hold"));
        }
        if set.shape() != shape {
            set = set.with_padded_shape(&shape).map_err(told)?;
        }
        let stored = variable.kind.ok_or("has no numbers")?;
        Ok(Box::new(Slabs { set, shape, stored, kind, meaning, next: 0, held: Vec::new(), from: 0 }))
    }
}

/// The values of a data set, slab by slab.
struct Slabs {
    set: Dataset,
    /// The slowest first.
    shape: Vec<u64>,
    /// The type of the numbers in the file, and the one they are taken for.
    stored: Kind,
    kind: Kind,
    meaning: Meaning,
    /// The value that is next.
    next: u64,
    /// The slab at hand, and the number of its first value.
    held: Vec<f64>,
    from: u64,
}

impl Slabs {
    /// Reads the slab that begins with the next value: along one axis as far as makes sense, all of those behind it, and one
    /// place along each before it.
    fn fetch(&mut self) -> Result<(), String> {
        let mut run = 1u64;
        let mut axis = self.shape.len();
        // The outermost axis behind which all fits, and where the next value is at the beginning of all that.
        while axis > 0 && run.saturating_mul(self.shape[axis - 1]) <= SLAB as u64 && self.next.is_multiple_of(run) {
            let whole = run * self.shape[axis - 1];
            if !self.next.is_multiple_of(whole) {
                break;
            }
            axis -= 1;
            run = whole;
        }
        let mut selections = Vec::with_capacity(self.shape.len());
        let mut rest = self.next;
        for (i, &size) in self.shape.iter().enumerate().rev() {
            let at = rest % size;
            rest /= size;
            let (start, end) = match () {
                () if i >= axis => (0, size),
                () if i + 1 == axis => (at, size.min(at + (SLAB as u64 / run).max(1))),
                () => (at, at + 1),
            };
            selections.push(SliceInfoElem::Slice { start, end, step: 1 });
        }
        selections.reverse();
        let selection = SliceInfo { selections };
        let set = &self.set;
        let mut values = match self.stored {
            Kind::I8 => slab::<i8>(set, &selection, |x| as_unsigned(x.into(), self.kind, Kind::U8, 256.0)),
            Kind::I16 => slab::<i16>(set, &selection, |x| as_unsigned(x.into(), self.kind, Kind::U16, 65536.0)),
            Kind::I32 => slab::<i32>(set, &selection, |x| as_unsigned(x.into(), self.kind, Kind::U32, 4294967296.0)),
            Kind::I64 => slab::<i64>(set, &selection, |x| match self.kind {
                Kind::U64 => x as u64 as f64,
                _ => x as f64,
            }),
            Kind::U8 => slab::<u8>(set, &selection, |x| match self.kind {
                Kind::I8 => f64::from(x as i8),
                _ => x.into(),
            }),
            Kind::U16 => slab::<u16>(set, &selection, f64::from),
            Kind::U32 => slab::<u32>(set, &selection, f64::from),
            Kind::U64 => slab::<u64>(set, &selection, |x| x as f64),
            Kind::F32 => slab::<f32>(set, &selection, f64::from),
            Kind::F64 => slab::<f64>(set, &selection, |x| x),
        }?;
        self.meaning.apply(&mut values);
        (self.held, self.from) = (values, self.next);
        Ok(())
    }
}

/// A signed number as the unsigned one of the same bits, where that is meant.
fn as_unsigned(x: f64, meant: Kind, unsigned: Kind, modulus: f64) -> f64 {
    if meant == unsigned && x < 0.0 { x + modulus } else { x }
}

fn slab<T: H5Type + Copy>(set: &Dataset, selection: &SliceInfo, value: impl Fn(T) -> f64) -> Result<Vec<f64>, String> {
    Ok(set.read_slice::<T>(selection).map_err(told)?.iter().map(|&x| value(x)).collect())
}

impl Numbers for Slabs {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        let mut done = 0;
        while done < out.len() {
            let held = self.next.checked_sub(self.from).and_then(|at| self.held.get(usize::try_from(at).ok()?..));
            let Some(held) = held.filter(|held| !held.is_empty()) else {
                self.fetch()?;
                if self.held.is_empty() {
                    return Err("has no more values".into());
                }
                continue;
            };
            let now = held.len().min(out.len() - done);
            out[done..done + now].copy_from_slice(&held[..now]);
            done += now;
            self.next += now as u64;
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        self.next = self.next.saturating_add(count);
        Ok(())
    }
}
