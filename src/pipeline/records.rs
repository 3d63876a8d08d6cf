//! A file of records: bytes that say whether they are whole.
//!
//! A record is its length packed (four bytes, little endian), the BLAKE3 hash of what is packed, and the bytes packed by
//! LZ4, whose first four are their length unpacked. A record of no bytes ends the file, so that one that was cut off is
//! known.

use rayon::prelude::*;
use std::io::{self, Read, Write};

/// Most bytes of a record, packed or not: no file can ask for more memory than it has bytes for.
const MOST: usize = 1 << 30;
/// LZ4 packs no better.
const RATIO: usize = 256;

/// A record ready to be written.
pub struct Record {
    hash: blake3::Hash,
    packed: Vec<u8>,
}

impl Record {
    /// Packs some bytes.
    pub fn new(bytes: &[u8]) -> Record {
        let packed = lz4_flex::compress_prepend_size(bytes);
        Record { hash: blake3::hash(&packed), packed }
    }

    /// Writes it.
    ///
    /// # Errors
    /// The file takes no more, or the record is too large.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let length = u32::try_from(self.packed.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
        out.write_all(&length.to_le_bytes())?;
        out.write_all(self.hash.as_bytes())?;
        out.write_all(&self.packed)
    }

    /// Reads the next one; `None` at the end. It is not looked into.
    ///
    /// # Errors
    /// The file cannot be read, ends too early or is damaged.
    pub fn read(file: &mut impl Read) -> io::Result<Option<Record>> {
        let mut length = [0; 4];
        file.read_exact(&mut length)?;
        let length = u32::from_le_bytes(length) as usize;
        if length == 0 {
            return Ok(None);
        }
        let mut hash = [0; blake3::OUT_LEN];
        file.read_exact(&mut hash)?;
        let mut packed = Vec::new();
        file.take(length as u64).read_to_end(&mut packed)?;
        if packed.len() < length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(Some(Record { hash: hash.into(), packed }))
    }

    /// Its bytes.
    ///
    /// # Errors
    /// It is damaged.
    pub fn unpack(&self) -> io::Result<Vec<u8>> {
        let damaged = || io::Error::from(io::ErrorKind::InvalidData);
        let (length, _) = self.packed.split_first_chunk().ok_or_else(damaged)?;
        let length = u32::from_le_bytes(*length) as usize;
        if blake3::hash(&self.packed) != self.hash || length > MOST.min(self.packed.len().saturating_mul(RATIO)) {
            return Err(damaged());
        }
        lz4_flex::decompress_size_prepended(&self.packed).map_err(|_| damaged())
    }
}

/// The record that ends a file.
///
/// # Errors
/// The file takes no more.
pub fn end(out: &mut impl Write) -> io::Result<()> {
    out.write_all(&[0; 4])
}

/// Writes things in blocks of so many, each a record, packed by all threads.
///
/// # Errors
/// The file takes no more.
pub fn write_blocks<T: serde::Serialize + Sync>(out: &mut impl Write, things: &[T], block: usize) -> io::Result<()> {
    for batch in things.chunks(block * batch()) {
        let records: Vec<Record> = batch
            .par_chunks(block)
            .map(|block| postcard::to_allocvec(block).map(|bytes| Record::new(&bytes)).map_err(io::Error::other))
            .collect::<io::Result<_>>()?;
        records.iter().try_for_each(|record| record.write(out))?;
    }
    Ok(())
}

/// Reads such blocks up to the end of the file, unpacked by all threads; `each` gets them in order.
///
/// # Errors
/// The file cannot be read or is damaged, and those of `each`.
pub fn read_blocks<T: serde::de::DeserializeOwned + Send>(
    file: &mut impl Read,
    mut each: impl FnMut(Vec<T>) -> io::Result<()>,
) -> io::Result<()> {
    let mut ended = false;
    while !ended {
        let mut records = Vec::new();
        while records.len() < batch() && !ended {
            match Record::read(file)? {
                Some(record) => records.push(record),
                None => ended = true,
            }
        }
        let unpack = |record: &Record| -> io::Result<Vec<T>> {
            postcard::from_bytes(&record.unpack()?).map_err(|_| io::ErrorKind::InvalidData.into())
        };
        let blocks: Vec<Vec<T>> = records.par_iter().map(unpack).collect::<io::Result<_>>()?;
        blocks.into_iter().try_for_each(&mut each)?;
    }
    Ok(())
}

/// Blocks in memory at once.
fn batch() -> usize {
    2 * rayon::current_num_threads()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(things: &[u64]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_blocks(&mut bytes, things, 10).expect("memory");
        end(&mut bytes).expect("memory");
        bytes
    }

    fn read(mut bytes: &[u8]) -> io::Result<Vec<u64>> {
        let mut all = Vec::new();
        read_blocks(&mut bytes, |block: Vec<u64>| {
            all.extend(block);
            Ok(())
        })?;
        Ok(all)
    }

    #[test]
    fn what_is_written_is_read_again_and_every_bit_and_every_byte_is_missed() {
        let things: Vec<u64> = (0..95).map(|i: u64| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        let bytes = file(&things);
        assert_eq!(read(&bytes).expect("whole"), things);
        assert_eq!(read(&file(&[])).expect("empty"), Vec::<u64>::new());
        for at in 0..bytes.len() {
            assert!(read(&bytes[..at]).is_err(), "cut off at {at}");
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            assert!(read(&damaged).is_err(), "damaged at {at}");
        }
    }
}
