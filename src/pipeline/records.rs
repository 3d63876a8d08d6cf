//! Records: compressed blocks of bytes with a hash that reveals damage.
//!
//! A record holds the length of its compressed bytes (four bytes, little endian), their BLAKE3 hash, and the bytes in the
//! format of LZ4, which begin with their uncompressed length (four bytes). A record of length zero ends the file, so that
//! a truncated file is recognised.

use rayon::prelude::*;
use std::io::{self, Read, Write};

/// Most bytes of a record (a part of a file), compressed or not: limits the memory that a damaged file can demand.
const MAX_BYTES: usize = 1 << 30;
/// Largest ratio of bytes to compressed bytes that LZ4 reaches.
const MAX_RATIO: usize = 256;

/// A record: a separately compressed part of a file.
pub struct Record {
    hash: blake3::Hash,
    packed: Vec<u8>,
}

impl Record {
    /// Compresses bytes to a record of a file.
    pub fn new(bytes: &[u8]) -> Record {
        let packed = lz4_flex::compress_prepend_size(bytes);
        Record { hash: blake3::hash(&packed), packed }
    }

    /// Writes the record to a file.
    ///
    /// # Errors
    /// The file cannot be written, or the record is too large.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let length = u32::try_from(self.packed.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
        out.write_all(&length.to_le_bytes())?;
        out.write_all(self.hash.as_bytes())?;
        out.write_all(&self.packed)
    }

    /// Reads the next record without checking it; `None` at the end of the file.
    ///
    /// # Errors
    /// The file cannot be read, or is truncated.
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

    /// Checks the record and decompresses its bytes.
    ///
    /// # Errors
    /// The record is damaged.
    pub fn unpack(&self) -> io::Result<Vec<u8>> {
        let damaged = || io::Error::from(io::ErrorKind::InvalidData);
        let (length, _) = self.packed.split_first_chunk().ok_or_else(damaged)?;
        let length = u32::from_le_bytes(*length) as usize;
        if blake3::hash(&self.packed) != self.hash
            || length > MAX_BYTES.min(self.packed.len().saturating_mul(MAX_RATIO))
        {
            return Err(damaged());
        }
        lz4_flex::decompress_size_prepended(&self.packed).map_err(|_| damaged())
    }
}

/// Writes the record that ends a file.
///
/// # Errors
/// The file cannot be written.
pub fn write_end(out: &mut impl Write) -> io::Result<()> {
    out.write_all(&[0; 4])
}

/// Writes values as records of `block` values each, compressed by all threads.
///
/// # Errors
/// The file cannot be written.
pub fn write_blocks<T: serde::Serialize + Sync>(out: &mut impl Write, values: &[T], block: usize) -> io::Result<()> {
    for batch in values.chunks(block * records_per_batch()) {
        let records: Vec<Record> = batch
            .par_chunks(block)
            .map(|block| postcard::to_allocvec(block).map(|bytes| Record::new(&bytes)).map_err(io::Error::other))
            .collect::<io::Result<_>>()?;
        records.iter().try_for_each(|record| record.write(out))?;
    }
    Ok(())
}

/// Reads the records of [`write_blocks`] up to the end of the file, decompressed by all threads. `each` receives the
/// blocks in order.
///
/// # Errors
/// The file cannot be read or is damaged; errors of `each`.
pub fn read_blocks<T: serde::de::DeserializeOwned + Send>(
    file: &mut impl Read,
    mut each: impl FnMut(Vec<T>) -> io::Result<()>,
) -> io::Result<()> {
    let mut ended = false;
    while !ended {
        let mut records = Vec::new();
        while records.len() < records_per_batch() && !ended {
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

/// Number of records in memory at a time while a file is written or read.
fn records_per_batch() -> usize {
    2 * rayon::current_num_threads()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(values: &[u64]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_blocks(&mut bytes, values, 10).expect("memory");
        write_end(&mut bytes).expect("memory");
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
    fn records_are_read_as_written_and_reveal_damage_and_truncation() {
        let values: Vec<u64> = (0..95).map(|i: u64| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        let bytes = file(&values);
        assert_eq!(read(&bytes).expect("whole"), values);
        assert_eq!(read(&file(&[])).expect("empty"), Vec::<u64>::new());
        for at in 0..bytes.len() {
            assert!(read(&bytes[..at]).is_err(), "cut off at {at}");
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            assert!(read(&damaged).is_err(), "damaged at {at}");
        }
    }
}
