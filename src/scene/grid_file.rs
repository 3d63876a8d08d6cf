//! Reading grids of values from `.vol` files, the format of Mitsuba's grid volumes. All numbers are little-endian:
//!
//! | bytes | content |
//! | --- | --- |
//! | 3 | `VOL` |
//! | 1 | version: 3 |
//! | 4 | encoding of the values: 1 (f32), 2 (f16) or 3 (u8, which stands for 0 to 1) |
//! | 12 | number of cells along x, y and z |
//! | 4 | number of channels: 1 or 3 |
//! | 24 | lower corner x, y, z and upper corner x, y, z of the box (f32, m) |
//! | rest | values: channel by channel of a cell, x fastest, then y, then z |

use crate::error::{Error, ErrorKind, Result};
use crate::git_lfs;
use crate::math::Vec3;
use crate::medium::Grid;
use crate::memory;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Maximum number of values of a grid: 1 GiB.
const MAX_VALUES: u64 = 1 << 28;
/// Number of bytes before the values.
const HEADER_BYTES: u64 = 48;
/// Version of the format.
const VERSION: u8 = 3;

/// Reads a grid. Values that are negative or not finite are clamped, with a warning.
///
/// # Errors
/// The file cannot be opened, is in another format, is damaged, or is too large.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Grid> {
    let io = |e: std::io::Error| Error::io(path, &e).hint("check the path of the grid");
    let meta = std::fs::metadata(path).map_err(io)?;
    // Reading a device or a pipe may never end.
    if !meta.is_file() {
        return Err(io(std::io::Error::other("it is not a regular file")));
    }
    let mut file = File::open(path).map_err(io)?;
    let mut header = Vec::new();
    file.by_ref().take(HEADER_BYTES).read_to_end(&mut header).map_err(io)?;
    git_lfs::check(&header, path.display())?;
    let failed = |cause: String| {
        Error::new(ErrorKind::Scene, path.display(), cause).hint("write the grid as a .vol file, version 3, of Mitsuba")
    };
    let header = Header::parse(&header).map_err(failed)?;
    let bytes = header.bytes();
    if meta.len() < HEADER_BYTES + bytes {
        let (has, needs) = (meta.len(), HEADER_BYTES + bytes);
        return Err(failed(format!("the file is cut off: it has {has} bytes, its header asks for {needs}")));
    }
    memory::require(bytes + header.values() * size_of::<f32>() as u64, "its values").map_err(|e| failed(e.cause))?;
    let mut data = Vec::new();
    file.take(bytes).read_to_end(&mut data).map_err(io)?;
    let mut values = header.decode(&data);
    let clamped = clamp(&mut values);
    if clamped > 0 {
        warnings.push(format!("{}: {clamped} values are negative or not finite and are clamped", path.display()));
    }
    Grid::new(header.size, header.channels, header.bounds, values)
        .ok_or_else(|| failed("its box has no volume, or values are missing".into()))
}

/// Replaces values that are negative or not finite. Returns the number of values that changed.
fn clamp(values: &mut [f32]) -> usize {
    let mut count = 0;
    for value in values {
        // `max` turns NaN into 0.
        let clamped = if *value == f32::INFINITY { f32::MAX.sqrt() } else { value.max(0.0) };
        count += usize::from(clamped.to_bits() != value.to_bits() && clamped != *value);
        *value = clamped;
    }
    count
}

/// How the values of a file are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    F32,
    F16,
    U8,
}

/// The header of a file. The numbers of cells and channels are within their limits.
#[derive(Debug, PartialEq)]
struct Header {
    encoding: Encoding,
    size: [u32; 3],
    channels: usize,
    bounds: [Vec3; 2],
}

impl Header {
    fn parse(bytes: &[u8]) -> std::result::Result<Header, String> {
        let Some(([magic @ .., version], numbers)) = bytes.split_first_chunk::<4>() else {
            return Err("it is no .vol file".into());
        };
        if magic != b"VOL" || *version != VERSION {
            return Err(format!("it is no .vol file of version {VERSION}"));
        }
        let (words, _) = numbers.as_chunks::<4>();
        let Ok([encoding, x, y, z, channels, corners @ ..]) = <[[u8; 4]; 11]>::try_from(words) else {
            return Err("the file ends inside its header".into());
        };
        let encoding = match u32::from_le_bytes(encoding) {
            1 => Encoding::F32,
            2 => Encoding::F16,
            3 => Encoding::U8,
            other => return Err(format!("encoding {other} is unknown: it must be 1 (f32), 2 (f16) or 3 (u8)")),
        };
        let size = [x, y, z].map(u32::from_le_bytes);
        let channels = u32::from_le_bytes(channels);
        if !matches!(channels, 1 | 3) {
            return Err(format!("it has {channels} channels: there must be 1 or 3"));
        }
        let count = size.iter().try_fold(u64::from(channels), |count, &n| count.checked_mul(u64::from(n)));
        if !matches!(count, Some(1..=MAX_VALUES)) {
            let [x, y, z] = size;
            return Err(format!("{x} x {y} x {z} cells of {channels} channels are none or too many"));
        }
        let [ax, ay, az, bx, by, bz] = corners.map(f32::from_le_bytes);
        let (low, high) = (Vec3::new(ax, ay, az), Vec3::new(bx, by, bz));
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err("the lower corner of its box is not below the upper one".into());
        }
        Ok(Header { encoding, size, channels: channels as usize, bounds: [low, high] })
    }

    /// Number of values, at most [`MAX_VALUES`].
    fn values(&self) -> u64 {
        self.size.iter().map(|&n| u64::from(n)).product::<u64>() * self.channels as u64
    }

    /// Number of bytes of the values.
    fn bytes(&self) -> u64 {
        let width = match self.encoding {
            Encoding::F32 => 4,
            Encoding::F16 => 2,
            Encoding::U8 => 1,
        };
        self.values() * width
    }

    fn decode(&self, data: &[u8]) -> Vec<f32> {
        match self.encoding {
            Encoding::F32 => data.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            Encoding::F16 => data.as_chunks::<2>().0.iter().map(|bytes| half(u16::from_le_bytes(*bytes))).collect(),
            Encoding::U8 => data.iter().map(|&byte| f32::from(byte) / 255.0).collect(),
        }
    }
}

/// A half-precision number as a float.
fn half(bits: u16) -> f32 {
    exr::prelude::f16::from_bits(bits).to_f32()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::mix;

    /// The bytes of a file with `size` cells of one channel.
    fn file(encoding: u32, size: [u32; 3], channels: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        for word in [encoding].into_iter().chain(size).chain([channels]) {
            bytes.extend(word.to_le_bytes());
        }
        for corner in [-1.0f32, 0.0, 2.0, 1.0, 3.0, 4.0] {
            bytes.extend(corner.to_le_bytes());
        }
        bytes.extend(data);
        bytes
    }

    fn parse(bytes: &[u8]) -> Result<(Grid, Vec<String>)> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("grid.vol");
        std::fs::write(&path, bytes).expect("it is written");
        let mut warnings = Vec::new();
        read(&path, &mut warnings).map(|grid| (grid, warnings))
    }

    #[test]
    fn all_encodings_are_read() {
        let floats: Vec<u8> = [0.5f32, 2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let halves: Vec<u8> = [0x3800u16, 0x4000].iter().flat_map(|x| x.to_le_bytes()).collect();
        let (grid, warnings) = parse(&file(1, [2, 1, 1], 1, &floats)).expect("it is valid");
        assert_eq!((grid.size(), grid.bounds()[1], warnings.len()), ([2, 1, 1], Vec3::new(1.0, 3.0, 4.0), 0));
        assert_eq!(grid.color_at(Vec3::splat(0.5)).x, 0.5);
        assert_eq!(parse(&file(2, [2, 1, 1], 1, &halves)).expect("it is valid").0, grid);
        let (bytes, _) = parse(&file(3, [1, 1, 1], 3, &[0, 51, 255])).expect("it is valid");
        assert!((bytes.color_at(Vec3::ZERO) - crate::math::Rgb::new(0.0, 0.2, 1.0)).abs().max_element() < 1e-6);
    }

    #[test]
    fn bad_values_are_clamped_with_a_warning() {
        let data: Vec<u8> = [f32::NAN, -1.0, f32::INFINITY, 1.0, -0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let (grid, warnings) = parse(&file(1, [5, 1, 1], 1, &data)).expect("it is valid");
        assert!(warnings[0].contains("3 values"), "{warnings:?}");
        assert_eq!(grid.color_at(Vec3::splat(0.5)).x, 0.0);
        assert!(grid.color_at(Vec3::new(2.5, 0.5, 0.5)).x.is_finite());
    }

    /// Files with changed, missing or huge numbers give an error or a grid, and never a panic.
    #[test]
    fn damaged_files_are_rejected() {
        let good = file(1, [2, 2, 2], 1, &[0; 32]);
        for end in 0..good.len() {
            assert!(parse(&good[..end]).is_err(), "cut at {end}");
        }
        for size in [[0, 1, 1], [u32::MAX; 3], [1 << 20, 1 << 20, 1], [3, 2, 2]] {
            assert!(parse(&file(1, size, 1, &[0; 32])).is_err(), "{size:?}");
        }
        assert!(parse(&file(4, [2, 2, 2], 1, &[0; 32])).is_err());
        assert!(parse(&file(1, [2, 2, 2], 2, &[0; 64])).is_err());
        for i in 0..300u64 {
            let mut bytes = good.clone();
            for change in 0..3 {
                let at = mix(i * 3 + change) as usize % bytes.len();
                bytes[at] = mix(!(i * 3 + change)) as u8;
            }
            drop(parse(&bytes));
        }
    }
}
