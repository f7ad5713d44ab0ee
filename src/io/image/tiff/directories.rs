//! The directories of a TIFF, one a page: how many there are, and where each says how its numbers are to be shown.
//!
//! Grey may be stored with white at 0, or by numbers in a table of colours. Here the numbers stored are wanted, whatever they look
//! like, so [`Grey`] lets the decoder read that they are plain grey.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The tag that says how numbers are to be shown.
const PHOTOMETRIC: u64 = 262;

/// How numbers are to be shown: with white at 0, by a table, or as a mask.
const SHOWN: [u64; 3] = [0, 3, 4];

/// What the directories say.
pub(super) struct Directories {
    pub count: usize,
    /// The byte order of everything.
    pub little_endian: bool,
    /// Where two bytes are to be read as 1.
    patches: Vec<u64>,
    /// Whether the first page has a table of colours.
    pub has_table: bool,
    /// Whether the first page shows 0 as white.
    pub white_is_zero: bool,
}

impl Directories {
    pub fn read(path: &Path) -> Result<Self, String> {
        let cut = |e: std::io::Error| format!("is cut off, or no TIFF file: {e}");
        let mut file = BufReader::new(crate::input::open(path).map_err(|e| e.to_string())?);
        let mut start = [0; 8];
        file.read_exact(&mut start).map_err(cut)?;
        let little_endian = match &start[..2] {
            b"II" => true,
            b"MM" => false,
            _ => return Err("is no TIFF file: it begins neither with II nor with MM".into()),
        };
        let mut reader = Fields { file, little_endian };
        let number = |bytes: &[u8]| whole(bytes, little_endian);
        let (big, mut next) = match number(&start[2..4]) {
            42 => (false, number(&start[4..])),
            43 => (true, reader.number(8).map_err(cut)?),
            _ => return Err("is no TIFF file: its third byte is neither 42 nor 43".into()),
        };
        let (count_size, entry_size, value) = if big { (8, 20, 12) } else { (2, 12, 8) };
        let mut found = Self { count: 0, little_endian, patches: Vec::new(), has_table: false, white_is_zero: false };
        let mut seen = HashSet::new();
        while next != 0 {
            let wrong = |e: std::io::Error| format!("is cut off, or damaged: page {}: {e}", found.count);
            if !seen.insert(next) {
                return Err("is damaged: its pages go round in a ring".into());
            }
            reader.file.seek(SeekFrom::Start(next)).map_err(wrong)?;
            let entries = reader.number(count_size).map_err(wrong)?;
            if entries > 1 << 16 {
                return Err(format!("is damaged: page {} has {entries} entries", found.count));
            }
            let first = next + count_size as u64;
            let mut entry = [0; 20];
            for i in 0..entries {
                reader.file.read_exact(&mut entry[..entry_size]).map_err(wrong)?;
                if number(&entry[..2]) == PHOTOMETRIC {
                    let shown = number(&entry[value..value + 2]);
                    if SHOWN.contains(&shown) {
                        found.patches.push(first + i * entry_size as u64 + value as u64);
                    }
                    found.has_table |= found.count == 0 && shown == 3;
                    found.white_is_zero |= found.count == 0 && shown == 0;
                }
            }
            next = reader.number(if big { 8 } else { 4 }).map_err(wrong)?;
            found.count += 1;
        }
        found.patches.sort_unstable();
        Ok(found)
    }
}

struct Fields {
    file: BufReader<File>,
    little_endian: bool,
}

impl Fields {
    fn number(&mut self, bytes: usize) -> std::io::Result<u64> {
        let mut buffer = [0; 8];
        self.file.read_exact(&mut buffer[..bytes])?;
        Ok(whole(&buffer[..bytes], self.little_endian))
    }
}

fn whole(bytes: &[u8], little_endian: bool) -> u64 {
    let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
    if little_endian { bytes.iter().rev().fold(0, add) } else { bytes.iter().fold(0, add) }
}

/// A file as it would be if all its pages were plain grey.
pub(super) struct Grey {
    file: BufReader<File>,
    at: u64,
    little_endian: bool,
    patches: Vec<u64>,
}

impl Grey {
    pub fn open(path: &Path, directories: &Directories) -> Result<Self, String> {
        let file = BufReader::with_capacity(1 << 16, crate::input::open(path).map_err(|e| e.to_string())?);
        Ok(Self { file, at: 0, little_endian: directories.little_endian, patches: directories.patches.clone() })
    }
}

impl Read for Grey {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.read(bytes)?;
        let end = self.at + count as u64;
        let first = self.patches.partition_point(|&patch| patch + 2 <= self.at);
        for &patch in self.patches[first..].iter().take_while(|&&patch| patch < end) {
            for (k, byte) in [u8::from(self.little_endian), u8::from(!self.little_endian)].into_iter().enumerate() {
                let place = patch + k as u64;
                if (self.at..end).contains(&place) {
                    bytes[(place - self.at) as usize] = byte;
                }
            }
        }
        self.at = end;
        Ok(count)
    }
}

impl Seek for Grey {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        // Within what is buffered where possible: a decoder seeks before every read.
        if let SeekFrom::Start(place) = to {
            self.file.seek_relative(place as i64 - self.at as i64)?;
            self.at = place;
        } else {
            self.at = self.file.seek(to)?;
        }
        Ok(self.at)
    }
}
