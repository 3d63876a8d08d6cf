//! Decoders of foreign data, run in a process of their own: they believe the sizes in a file, and an allocation that
//! fails ends its process.

use super::document::Document;
use super::fault;
use crate::error::{Error, Result};
use crate::memory;
use caustique_isolated::{Ending, Limits};
use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Bytes that a decoder may allocate besides its multiple of the decoded bytes: tables of fixed size.
const BASE_BYTES: u64 = 256 << 20;
/// Bytes that a decoder may allocate for each decoded byte.
const BYTES_PER_BYTE: u64 = 16;
/// Seconds that a decoder may take besides those for the decoded bytes.
const BASE_SECONDS: u64 = 10;
/// Decoded bytes for which a decoder may take another second, a hundredth of what the slowest one decodes.
const BYTES_PER_SECOND: u64 = 1 << 18;

/// Bytes of a decoded element that a compressed byte can at most stand for, as a bound on what a small file may
/// allocate: both codecs reach about a thousand for constant data.
const MAX_RATIO: u64 = 1 << 12;

/// What a decoder has made, or why it failed.
pub(super) type Decoded = std::result::Result<Vec<u8>, String>;

/// The error about compressed data that cannot be decoded.
pub(super) fn damaged(cause: impl std::fmt::Display) -> Error {
    fault("", format!("its data cannot be decoded: {cause}")).hint(
        "the file is damaged: export it again, or decompress it elsewhere with 'gltf-transform copy IN.glb OUT.glb'",
    )
}

/// Counts the memory of `bytes` decoded bytes, of `compressed` ones.
pub(super) fn count_bytes(document: &Document, bytes: u64, compressed: usize) -> Result<()> {
    if bytes > (compressed as u64).saturating_mul(MAX_RATIO) {
        return Err(damaged(format!("{compressed} bytes do not hold {bytes}")));
    }
    let error = document.count_bytes(bytes, "decompressed data");
    error.map_err(|e| e.hint("render fewer or simpler meshes, or with more memory"))
}

/// Runs `decode` for `0..count` in one process of its own, up to the first failure. `bytes`: the size of all decoded
/// data. Fewer results than `count` mean that the process has ended, for the reason in the last result.
///
/// # Errors
/// The process cannot be started.
pub(super) fn decode_each(bytes: u64, count: usize, decode: impl Fn(usize) -> Decoded) -> Result<Vec<Decoded>> {
    let most = BASE_BYTES.saturating_add(bytes.saturating_mul(BYTES_PER_BYTE));
    let free = memory::available().map_or(u64::MAX, |available| available.bytes);
    let seconds = BASE_SECONDS + bytes / BYTES_PER_SECOND;
    let limits = Limits { bytes: most.min(free), seconds: u32::try_from(seconds).unwrap_or(u32::MAX) };
    let work = |writer: &mut dyn Write| {
        for index in 0..count {
            let decoded = catch_unwind(AssertUnwindSafe(|| decode(index)));
            let decoded = decoded.unwrap_or_else(|_| Err("the decoder failed".into()));
            if write(writer, &decoded).is_err() || decoded.is_err() {
                return;
            }
        }
    };
    let read = |reader: &mut dyn Read| {
        let mut all: Vec<Decoded> = Vec::new();
        while all.len() < count && all.last().is_none_or(std::result::Result::is_ok) {
            let Ok(decoded) = read(reader) else { break };
            all.push(decoded);
        }
        all
    };
    let (mut all, ending) = caustique_isolated::run(limits, work, read)
        .map_err(|error| super::fault("", format!("no process for its decoder can be started: {error}")))?;
    if all.len() < count && all.last().is_none_or(std::result::Result::is_ok) {
        all.push(Err(match ending {
            Ending::OutOfTime => format!("the decoder takes more than {seconds} s"),
            Ending::Aborted => format!("the decoder asks for more than {} MiB", limits.bytes >> 20),
            Ending::Finished | Ending::Crashed => "the decoder failed".into(),
        }));
    }
    Ok(all)
}

/// Runs `decode` in a process of its own. `bytes`: the size of the decoded data.
///
/// # Errors
/// The process cannot be started.
pub(super) fn decode(bytes: u64, decode: impl Fn() -> Decoded) -> Result<Decoded> {
    let all = decode_each(bytes, 1, |_| decode())?;
    Ok(all.into_iter().next().unwrap_or_else(|| Err("the decoder failed".into())))
}

/// Writes a result: whether it is a success, its length, and its bytes.
fn write(writer: &mut dyn Write, decoded: &Decoded) -> io::Result<()> {
    let (sound, bytes) = match decoded {
        Ok(bytes) => (1, bytes.as_slice()),
        Err(cause) => (0, cause.as_bytes()),
    };
    writer.write_all(&[sound])?;
    writer.write_all(&(bytes.len() as u64).to_le_bytes())?;
    writer.write_all(bytes)
}

/// Reads a result of [`write()`].
fn read(reader: &mut dyn Read) -> io::Result<Decoded> {
    let (mut sound, mut length) = ([0], [0; 8]);
    reader.read_exact(&mut sound)?;
    reader.read_exact(&mut length)?;
    let (length, mut bytes) = (u64::from_le_bytes(length), Vec::new());
    if reader.take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(if sound == [1] { Ok(bytes) } else { Err(String::from_utf8_lossy(&bytes).into_owned()) })
}
