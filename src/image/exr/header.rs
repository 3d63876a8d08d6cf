//! Sorts the attributes of a written header.
//!
//! The `exr` crate stores custom attributes in a `HashMap` and writes them in its order, which changes from run to run.
//! The size of a header does not depend on the order, so that the attributes can be sorted in place afterwards.

use std::io::{self, Read, Seek, SeekFrom, Write};

/// Bytes of the magic number and the version of an EXR, which precede the first attribute.
const PREAMBLE: u64 = 8;

/// Sorts the attributes in the headers of an EXR with this number of parts by name, as the OpenEXR library writes them.
///
/// # Errors
/// Errors of `file`, and `InvalidData` if the bytes are not a header.
pub(super) fn sort_attributes<F: Read + Write + Seek>(file: &mut F, parts: usize) -> io::Result<()> {
    file.seek(SeekFrom::Start(PREAMBLE))?;
    let mut sorted = Vec::new();
    {
        let mut reader = io::BufReader::new(&mut *file);
        for part in 0..parts {
            let mut attributes = Vec::new();
            while let Some(attribute) = read_attribute(&mut reader)? {
                attributes.push(attribute);
            }
            // The bytes begin with the name, whose terminating zero sorts before any letter: byte order is the order of
            // names.
            attributes.sort_unstable();
            sorted.extend((part > 0).then_some(0));
            sorted.extend(attributes.concat());
        }
    }
    file.seek(SeekFrom::Start(PREAMBLE))?;
    file.write_all(&sorted)
}

/// Position behind the headers of an EXR with this number of parts. `several`: whether it is a file of several parts, whose
/// headers end with another zero.
///
/// # Errors
/// Errors of `file`, and `InvalidData` if the bytes are not a header.
pub(super) fn end(file: &mut (impl Read + Seek), parts: usize, several: bool) -> io::Result<u64> {
    file.seek(SeekFrom::Start(PREAMBLE))?;
    for _ in 0..parts {
        while read_attribute(file)?.is_some() {}
    }
    Ok(file.stream_position()? + u64::from(several))
}

/// The bytes of one attribute of the header: name, zero, type, zero, size of the value (four bytes, little endian),
/// value. `None` at the end of the header.
fn read_attribute(reader: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    if read_text(reader, &mut bytes)? == 0 {
        return Ok(None);
    }
    read_text(reader, &mut bytes)?;
    let mut size = [0; 4];
    reader.read_exact(&mut size)?;
    bytes.extend(size);
    let size = u64::from(u32::from_le_bytes(size));
    if reader.take(size).read_to_end(&mut bytes)? as u64 != size {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Some(bytes))
}

/// Reads up to the next zero byte, inclusive; returns the number of bytes before it.
fn read_text(reader: &mut impl Read, bytes: &mut Vec<u8>) -> io::Result<usize> {
    for length in 0..=255 {
        let mut byte = [0];
        reader.read_exact(&mut byte)?;
        bytes.push(byte[0]);
        if byte[0] == 0 {
            return Ok(length);
        }
    }
    Err(io::Error::new(io::ErrorKind::InvalidData, "a name in the header has no end"))
}
