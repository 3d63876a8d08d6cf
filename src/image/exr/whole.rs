//! Checks that an EXR is whole: that no part of it is missing, cut off or overwritten by zeros.

use super::header;
use super::read::{Outcome, check_sections, invalid, open};
use crate::error::Result;
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::meta::{BlockDescription, MetaData};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Checks header, offset table, and place and size of every chunk of an EXR, and decodes its last chunk. Other pixels are
/// not read, so that this takes little time.
///
/// # Errors
/// The file cannot be opened, or is damaged.
pub fn check_whole(path: &Path) -> Result<()> {
    open(path, check)
}

fn check(mut file: BufReader<File>, length: u64) -> Outcome<()> {
    let meta = MetaData::read_from_buffered(&mut file, false)?;
    let several = meta.requirements.has_multiple_layers;
    let table = header::end(&mut file, meta.headers.len(), several)?;
    let chunks: u64 = meta.headers.iter().map(|header| header.chunk_count as u64).sum();
    let pixels = table.saturating_add(chunks.saturating_mul(8));
    if pixels > length {
        return Err(invalid("it ends inside its offset table"));
    }
    let mut last = 0;
    let mut next = table;
    for header in &meta.headers {
        // The part's number, the coordinates of the block, and the number of its bytes.
        let coordinates = if header.blocks == BlockDescription::ScanLines { 4 } else { 16 };
        let before_size = coordinates + if several { 4 } else { 0 };
        for _ in 0..header.chunk_count {
            file.seek(SeekFrom::Start(next))?;
            let offset = read_number::<8>(&mut file)?;
            next += 8;
            let start = offset.saturating_add(before_size + 4);
            if offset < pixels || start > length {
                return Err(invalid("a chunk is missing"));
            }
            file.seek(SeekFrom::Start(offset + before_size))?;
            let size = read_number::<4>(&mut file)?;
            if !header.deep && (size == 0 || start.saturating_add(size) > length) {
                return Err(invalid("a chunk is cut off"));
            }
            last = last.max(offset);
        }
    }
    if meta.headers.iter().any(|header| header.deep) {
        return Ok(());
    }
    file.seek(SeekFrom::Start(last))?;
    let chunk = Chunk::read(&mut file, &meta)?;
    check_sections(&chunk, &meta.headers)?;
    UncompressedBlock::decompress_chunk(chunk, &meta, false).map(drop)
}

/// Reads a little-endian number of `N` bytes.
fn read_number<const N: usize>(file: &mut impl Read) -> std::io::Result<u64> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes[..N])?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Layer, LayerSet};
    use crate::image::exr::{Attributes, Compression, Options, write};

    /// Every file that is cut off, and every one with a block of zeros where chunks or offsets are, is found out.
    #[test]
    fn damaged_files_are_found_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let mut set = LayerSet::new(16, 100);
        let noise = |i: u64| (crate::random::mix(i) % 1000) as f32;
        for (name, shift) in [("", 0), ("Noisy", 7000)] {
            set.push(Layer::interleaved(name, "RGB", (0..1600).map(|i| [noise(i + shift); 3]))).expect("it fits");
        }
        for (compression, multi_part) in
            [(Compression::Zip, false), (Compression::Zips, true), (Compression::Piz, false), (Compression::None, true)]
        {
            let options = Options { compression, multi_part, ..Options::default() };
            write(&path, &set, &Attributes::default(), options).expect("it can be written");
            check_whole(&path).expect("it is whole");
            let whole = std::fs::read(&path).expect("it can be read");
            // Numbers of the last chunk that are stored as they are may be zero; others end in a checksum.
            let undetected = match compression {
                Compression::Zip | Compression::Zips => 4,
                Compression::Piz | Compression::None => 4 * 16 * 6 * 4,
            };
            for i in 0..50 {
                let cut = crate::random::mix(i) as usize % whole.len();
                std::fs::write(&path, &whole[..cut]).expect("it can be written");
                assert!(check_whole(&path).is_err(), "cut at {cut} of {}", whole.len());
                let mut holed = whole.clone();
                holed[cut..].fill(0);
                std::fs::write(&path, &holed).expect("it can be written");
                let found = check_whole(&path).is_err() || cut > whole.len() - undetected;
                assert!(found, "{compression:?}: zeros from {cut} of {}", whole.len());
            }
            // Data behind the chunks is allowed: shards have it.
            std::fs::write(&path, [whole, vec![1; 100]].concat()).expect("it can be written");
            check_whole(&path).expect("it is whole");
        }
    }
}
