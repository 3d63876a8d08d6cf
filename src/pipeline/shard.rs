//! The pixel sums that the EXR of a shard holds behind its picture. The sums of all shards together give the picture that
//! one machine would have rendered, to the last bit.
//!
//! Programs that read OpenEXR find a picture by its table of offsets and ignore the bytes that follow. Behind the picture
//! come [`records`]: the [`Head`] as JSON, then [`SceneFacts`] and [`ShardResult`], then the pixels in blocks, in the format of
//! postcard. The last sixteen bytes are the length of all this (little endian) and [`MARK`].

use super::checkpoint::{Head, PIXELS_PER_RECORD};
use super::facts::SceneFacts;
use super::records::{self, Record};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::files;
use crate::render::ShardResult;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// The last bytes of the file of a shard (a part of a render's iterations).
pub const MARK: &[u8; 8] = b"caustqS5";
/// Bytes of the length and the mark at the end of a shard's file.
const END_BYTES: i64 = 16;

/// The pixel sums of a shard (a part of a render's iterations), and all that a merge needs besides.
pub struct ShardSums {
    /// The identity of the render: its scene, options and decisions.
    pub head: Head,
    /// Facts of the scene that layers and header need.
    pub facts: SceneFacts,
    /// Settings, size and counts of the shard.
    pub part: ShardResult,
    /// The pixel sums, row by row from the top.
    pub pixels: Vec<PixelAccumulator>,
}

impl ShardSums {
    /// Writes the pixel sums to a shard's file, behind its picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, file: &mut (impl Write + Seek)) -> io::Result<()> {
        let start = file.stream_position()?;
        let head = serde_json::to_vec(&self.head)?;
        let rest = postcard::to_allocvec(&(&self.facts, &self.part)).map_err(io::Error::other)?;
        Record::new(&head).write(file)?;
        Record::new(&rest).write(file)?;
        records::write_blocks(file, &self.pixels, PIXELS_PER_RECORD)?;
        records::write_end(file)?;
        let length = file.stream_position()? - start + END_BYTES as u64;
        file.write_all(&length.to_le_bytes())?;
        file.write_all(MARK)
    }
}

/// The open file of a shard, whose pixel sums have not been read yet.
pub struct ShardFile {
    /// The identity of the render: its scene, options and decisions.
    pub head: Head,
    /// Facts of the scene that layers and header need.
    pub facts: SceneFacts,
    /// Settings, size and counts of the shard.
    pub part: ShardResult,
    file: BufReader<File>,
}

impl ShardFile {
    /// Opens the file of a shard; `None` if the file is no shard.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or was written by another version of the program.
    pub fn open(path: &Path) -> Result<Option<ShardFile>> {
        let mut file = BufReader::new(files::open(path).map_err(|cause| Error::io(path, &cause))?);
        let Some(start) = find_records(&mut file).map_err(|cause| Error::io(path, &cause))? else { return Ok(None) };
        file.seek(start).map_err(|cause| Error::io(path, &cause))?;
        let mut record = || Record::read(&mut file).ok().flatten().and_then(|record| record.unpack().ok());
        let damaged = || damaged(path);
        let head: Head = serde_json::from_slice(&record().ok_or_else(damaged)?).map_err(|_| damaged())?;
        if head.version != env!("CARGO_PKG_VERSION") {
            let cause = format!("is of version {} of caustique; this is {}", head.version, env!("CARGO_PKG_VERSION"));
            return Err(
                Error::new(ErrorKind::Usage, path.display(), cause).hint("merge it with the version that made it")
            );
        }
        let (facts, part): (SceneFacts, ShardResult) =
            postcard::from_bytes(&record().ok_or_else(damaged)?).map_err(|_| damaged())?;
        let arguments = head.arguments.is_object();
        if !(part.is_sound() && facts.are_sound(&part) && arguments) {
            return Err(damaged());
        }
        Ok(Some(ShardFile { head, facts, part, file }))
    }

    /// Reads the pixel sums in blocks, row by row from the top.
    ///
    /// # Errors
    /// The file is damaged, or the number of its pixels is not that of its picture.
    pub fn pixels(&mut self, path: &Path, mut each: impl FnMut(Vec<PixelAccumulator>)) -> Result<()> {
        let (levels, shape) = (self.part.settings.levels.count, &self.facts.shape);
        let merges = self.part.settings.merges_one_level();
        let (groups, lobes) = (shape.groups.len(), shape.lobes);
        let (width, height) = self.part.size;
        let (whole, mut count) = (width as usize * height as usize, 0);
        let read = records::read_blocks(&mut self.file, |block: Vec<PixelAccumulator>| {
            count += block.len();
            if count > whole || !block.iter().all(|pixel| pixel.holds(levels, merges, groups, lobes)) {
                return Err(io::ErrorKind::InvalidData.into());
            }
            each(block);
            Ok(())
        });
        if read.is_err() || count != whole { Err(damaged(path)) } else { Ok(()) }
    }
}

fn damaged(path: &Path) -> Error {
    Error::new(ErrorKind::Io, path.display(), "the sums behind its picture are damaged").hint("render this shard again")
}

/// Position of the first record of pixel sums in a file; `None` if the file is no shard.
fn find_records(file: &mut (impl Read + Seek)) -> io::Result<Option<SeekFrom>> {
    let length = file.seek(SeekFrom::End(0))?;
    if length < END_BYTES as u64 {
        return Ok(None);
    }
    file.seek(SeekFrom::End(-END_BYTES))?;
    let (mut tail, mut mark) = ([0; 8], [0; 8]);
    file.read_exact(&mut tail)?;
    file.read_exact(&mut mark)?;
    let start = length.checked_sub(u64::from_le_bytes(tail));
    Ok(start.filter(|_| mark == *MARK).map(SeekFrom::Start))
}
