//! Decoders of foreign data, run in a process of their own: they believe the sizes in a file, and an allocation that
//! fails ends its process.

use super::codec::{Compressed, Decoded};
use super::document::Document;
use super::fault;
use crate::error::{Error, Result};
use crate::{installed, memory};
use caustique_isolated::{Ending, Helper, Limits};
use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::Command;

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

/// Command of the program that runs decoders, where a process cannot be forked.
const COMMAND: &str = "decode";

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

/// Decodes all data in one process of its own, up to the first failure. `bytes`: the size of all decoded data. Fewer
/// results than data mean that the process has ended, for the reason in the last result.
///
/// # Errors
/// The process cannot be started.
pub(super) fn decode_each(bytes: u64, data: &[Compressed]) -> Result<Vec<Decoded>> {
    let count = data.len();
    let most = BASE_BYTES.saturating_add(bytes.saturating_mul(BYTES_PER_BYTE));
    let free = memory::available().map_or(u64::MAX, |available| available.bytes);
    let seconds = BASE_SECONDS + bytes / BYTES_PER_SECOND;
    let limits = Limits { bytes: most.min(free), seconds: u32::try_from(seconds).unwrap_or(u32::MAX) };
    // Nobody reads on if writing fails.
    let work = |writer: &mut dyn Write| drop(work(data, writer));
    let helper = || {
        let mut command = Command::new(installed::program()?);
        command.arg(COMMAND);
        Some(Helper { command, input: postcard::to_allocvec(data).ok()? })
    };
    let read = |reader: &mut dyn Read| {
        let mut all: Vec<Decoded> = Vec::new();
        while all.len() < count && all.last().is_none_or(std::result::Result::is_ok) {
            let Ok(decoded) = read(reader) else { break };
            all.push(decoded);
        }
        all
    };
    let (mut all, ending) = caustique_isolated::run(limits, work, helper, read)
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

/// Decodes data in a process of their own. `bytes`: the size of the decoded data.
///
/// # Errors
/// The process cannot be started.
pub(super) fn decode(bytes: u64, data: Compressed) -> Result<Decoded> {
    let all = decode_each(bytes, &[data])?;
    Ok(all.into_iter().next().unwrap_or_else(|| Err("the decoder failed".into())))
}

/// Decodes the data that another process of the program sends, and writes the results for it.
///
/// # Errors
/// The data are no such data, or nobody reads the results.
pub fn decode_for_program(mut input: impl Read, mut output: impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let data: Vec<Compressed> = postcard::from_bytes(&bytes).map_err(io::Error::other)?;
    work(&data, &mut output)
}

/// Decodes data up to the first failure, and writes the results.
fn work(data: &[Compressed], writer: &mut dyn Write) -> io::Result<()> {
    for data in data {
        let decoded = catch_unwind(AssertUnwindSafe(|| data.decode()));
        let decoded = decoded.unwrap_or_else(|_| Err("the decoder failed".into()));
        write(writer, &decoded)?;
        if decoded.is_err() {
            break;
        }
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    /// A program that decodes writes what a fork of this one writes, and takes nothing else than such data.
    #[test]
    fn data_are_decoded_for_another_process() {
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
        let [mesh, broken, basis, picture] =
            ["draco/sequential", "draco/sequential-cut", "ktx2/uastc", "webp/lossless"]
                .map(|name| fs::read(corpus.join(name)).expect("it can be read"));
        let mesh = Compressed::Draco(&mesh, vec![(0, 0)]);
        let data = [mesh, Compressed::WebP(&picture), Compressed::Basis(&basis, (8, 4)), Compressed::WebP(&broken)];
        let forked = decode_each(1 << 10, &data).expect("there is a process");
        let input = postcard::to_allocvec(data.as_slice()).expect("it has a form");
        let mut output = Vec::new();
        decode_for_program(input.as_slice(), &mut output).expect("it is sound");
        let mut rest = output.as_slice();
        let decoded: Vec<Decoded> = forked.iter().map(|_| read(&mut rest).expect("a result")).collect();
        assert_eq!((&decoded, rest.len()), (&forked, 0));
        assert_eq!(forked.iter().map(std::result::Result::is_ok).collect::<Vec<_>>(), [true, true, true, false]);
        for damaged in [&input[..input.len() - 1], b"\xff\xff\xff\xff\x0f", b"\x01\x07"] {
            assert!(decode_for_program(damaged, &mut Vec::new()).is_err(), "{damaged:?}");
        }
    }
}
