//! Compressed arrays: blocks of equal length before compression, each compressed by itself.
//!
//! In front stand numbers of 32 or 64 bits: how many blocks, their length before compression, the length of the last
//! one (0 if it is full too), then each block's compressed length. An array whose length is a multiple of the block
//! length has no last partial block.

use std::io::Read;

/// How blocks are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

/// Most an LZ4 block can grow: a byte of length stands for at most 255 bytes.
const LZ4_MOST: u64 = 255;
/// Memory that one LZMA block may ask for, in KiB: the dictionary of the highest level and room to spare.
const LZMA_MEMORY: u32 = 160 << 10;

/// How many bytes the blocks say they hold; 0 where they say nothing that makes sense.
pub(super) fn declared(stream: &[u8], header: impl Fn(&[u8]) -> u64, header_size: usize) -> u64 {
    let number = |i: usize| stream.get(i * header_size..(i + 1) * header_size).map(&header);
    number(0).zip(number(1)).and_then(|(count, full)| count.checked_mul(full)).unwrap_or(0)
}

/// The bytes of an array out of its compressed blocks; `expected` is how many there must be, where that is known.
///
/// Returns what is wrong in words. Memory grows only as blocks yield bytes, whatever lengths the header claims.
pub(super) fn decompress(
    stream: &[u8],
    header: impl Fn(&[u8]) -> u64,
    header_size: usize,
    compressor: Compressor,
    expected: Option<u64>,
) -> Result<Vec<u8>, String> {
    let number = |i: u64| -> Result<u64, String> {
        let at = usize::try_from(i).ok().and_then(|i| i.checked_mul(header_size)).filter(|&at| at <= stream.len());
        let bytes = at.and_then(|at| stream[at..].get(..header_size));
        bytes.map(&header).ok_or_else(|| "the list of its blocks is cut short".into())
    };
    let count = number(0)?;
    if count == 0 {
        return match expected {
            Some(n) if n > 0 => Err(format!("it has no blocks where {n} bytes are declared")),
            _ => Ok(Vec::new()),
        };
    }
    let (full, last) = (number(1)?, number(2)?);
    let last = if last == 0 { full } else { last };
    let start =
        count.checked_add(3).and_then(|n| n.checked_mul(header_size as u64)).filter(|&n| n <= stream.len() as u64);
    let mut rest = start.map(|n| &stream[n as usize..]).ok_or("the list of its blocks is cut short")?;
    let total = (count - 1).checked_mul(full).and_then(|n| n.checked_add(last)).filter(|_| last <= full);
    let total = total.ok_or_else(|| format!("block lengths {full} and {last} make no sense"))?;
    if expected.is_some_and(|n| n != total) {
        return Err(format!("its blocks hold {total} bytes where {} are declared", expected.unwrap_or(0)));
    }
    let mut bytes = Vec::new();
    for i in 0..count {
        let packed = number(3 + i)?;
        if packed > rest.len() as u64 {
            return Err(format!("block {i} needs {packed} bytes, and {} are left", rest.len()));
        }
        let (block, behind) = rest.split_at(packed as usize);
        rest = behind;
        let length = if i + 1 == count { last } else { full };
        let before = bytes.len() as u64;
        unpack(block, length, compressor, &mut bytes).map_err(|e| format!("block {i}: {e}"))?;
        let found = bytes.len() as u64 - before;
        if found != length {
            return Err(format!("block {i} holds {found} bytes where {length} are declared"));
        }
    }
    Ok(bytes)
}

/// Appends what a block holds, and no more than one byte beyond `length`.
fn unpack(block: &[u8], length: u64, compressor: Compressor, bytes: &mut Vec<u8>) -> Result<(), String> {
    let limit = length.saturating_add(1);
    match compressor {
        Compressor::Zlib => {
            flate2::read::ZlibDecoder::new(block).take(limit).read_to_end(bytes).map_err(|e| e.to_string())?;
        }
        Compressor::Lzma => {
            let reader = lzma_rust2::XzReader::new_mem_limit(block, false, LZMA_MEMORY);
            reader.take(limit).read_to_end(bytes).map_err(|e| e.to_string())?;
        }
        Compressor::Lz4 => {
            if length > LZ4_MOST * block.len() as u64 + 64 {
                return Err(format!("{} compressed bytes cannot hold {length}", block.len()));
            }
            let before = bytes.len();
            bytes.resize(before + length as usize, 0);
            let found = lz4_flex::block::decompress_into(block, &mut bytes[before..]).map_err(|e| e.to_string())?;
            bytes.truncate(before + found);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zlib(blocks: &[&[u8]], full: u64, last: u64) -> Vec<u8> {
        let packed: Vec<Vec<u8>> = blocks
            .iter()
            .map(|b| {
                let mut out = Vec::new();
                flate2::read::ZlibEncoder::new(*b, flate2::Compression::new(5)).read_to_end(&mut out).unwrap();
                out
            })
            .collect();
        let mut stream: Vec<u8> = [blocks.len() as u64, full, last]
            .into_iter()
            .chain(packed.iter().map(|p| p.len() as u64))
            .flat_map(u64::to_le_bytes)
            .collect();
        packed.iter().for_each(|p| stream.extend(p));
        stream
    }

    fn read(stream: &[u8], expected: Option<u64>) -> Result<Vec<u8>, String> {
        let header = |b: &[u8]| u64::from_le_bytes(b.try_into().unwrap());
        decompress(stream, header, 8, Compressor::Zlib, expected)
    }

    #[test]
    fn a_full_last_block_is_not_lost() {
        let stream = zlib(&[&[1; 8], &[2; 8]], 8, 0);
        assert_eq!(read(&stream, Some(16)).unwrap(), [[1u8; 8], [2; 8]].concat());
        assert!(read(&stream, Some(17)).unwrap_err().contains("16 bytes where 17"));
        assert_eq!(read(&zlib(&[&[1; 8], &[2; 3]], 8, 3), None).unwrap().len(), 11);
        assert!(read(&zlib(&[&[1; 8], &[2; 3]], 8, 2), None).unwrap_err().contains("block 1 holds 3"));
    }

    #[test]
    fn claims_beyond_the_file_are_refused() {
        let mut stream = zlib(&[&[1; 8]], 8, 0);
        for (at, value) in [(0, u64::MAX), (0, 1 << 60), (1, u64::MAX), (2, 9), (3, u64::MAX), (3, 1000)] {
            let kept = stream.clone();
            stream[8 * at..8 * at + 8].copy_from_slice(&value.to_le_bytes());
            assert!(read(&stream, None).is_err(), "{value} at {at}");
            stream = kept;
        }
        for n in 0..stream.len() {
            assert!(read(&stream[..n], None).is_err(), "{n} bytes");
        }
    }
}
