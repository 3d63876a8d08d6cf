//! What the file of a shard holds behind its picture: the sums of its pixels, from which all shards together make the
//! picture that one machine would have made, to the last bit.
//!
//! Programs that read OpenEXR find a picture by its table of offsets and do not see what follows. Behind it come
//! [`records`]: a JSON object, what else is known, and the pixels in blocks, both as postcard packs them. The last
//! sixteen bytes are the length of all that (little endian) and a mark.

use super::checkpoint::{BLOCK, Head};
use super::facts::Facts;
use super::records::{self, Record};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::render::ShardResult;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// The last bytes of a file with such a tail.
pub const MARK: &[u8; 8] = b"caustqS4";
/// The length and the mark.
const END: i64 = 16;

/// What stands behind the picture.
pub struct Tail {
    /// What render it belongs to.
    pub head: Head,
    /// What is known of its scene.
    pub facts: Facts,
    /// What it is besides its pixels.
    pub part: ShardResult,
    /// Its pixels.
    pub pixels: Vec<PixelAccumulator>,
}

impl Tail {
    /// Writes it behind all that has been written.
    ///
    /// # Errors
    /// The file takes no more.
    pub fn write(&self, file: &mut (impl Write + Seek)) -> io::Result<()> {
        let start = file.stream_position()?;
        let head = serde_json::to_vec(&self.head)?;
        let rest = postcard::to_allocvec(&(&self.facts, &self.part)).map_err(io::Error::other)?;
        Record::new(&head).write(file)?;
        Record::new(&rest).write(file)?;
        records::write_blocks(file, &self.pixels, BLOCK)?;
        records::end(file)?;
        let length = file.stream_position()? - start + END as u64;
        file.write_all(&length.to_le_bytes())?;
        file.write_all(MARK)
    }
}

/// A tail that is open, its pixels not read yet.
pub struct Open {
    /// What render it belongs to.
    pub head: Head,
    /// What is known of its scene.
    pub facts: Facts,
    /// What it is besides its pixels.
    pub part: ShardResult,
    file: BufReader<File>,
}

impl Open {
    /// Finds the tail of a file; `None` where it has none.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or is of another version of the program.
    pub fn of(path: &Path) -> Result<Option<Open>> {
        let mut file = BufReader::new(File::open(path).map_err(|cause| Error::io(path, &cause))?);
        let Some(start) = find(&mut file).map_err(|cause| Error::io(path, &cause))? else { return Ok(None) };
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
        let (facts, part): (Facts, ShardResult) =
            postcard::from_bytes(&record().ok_or_else(damaged)?).map_err(|_| damaged())?;
        let arguments = head.arguments.is_object();
        if !(part.is_sound() && facts.are_sound(&part) && arguments) {
            return Err(damaged());
        }
        Ok(Some(Open { head, facts, part, file }))
    }

    /// Reads the pixels, block by block in their order.
    ///
    /// # Errors
    /// The file is damaged, or there are not as many as the picture has.
    pub fn pixels(&mut self, path: &Path, mut each: impl FnMut(Vec<PixelAccumulator>)) -> Result<()> {
        let (levels, groups) = (self.part.settings.levels.count, self.facts.shape.groups.len());
        let (width, height) = self.part.size;
        let (whole, mut count) = (width as usize * height as usize, 0);
        let read = records::read_blocks(&mut self.file, |block: Vec<PixelAccumulator>| {
            count += block.len();
            if count > whole || !block.iter().all(|pixel| pixel.holds(levels, groups)) {
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

/// Where the tail begins, if there is one.
fn find(file: &mut (impl Read + Seek)) -> io::Result<Option<SeekFrom>> {
    let length = file.seek(SeekFrom::End(0))?;
    if length < END as u64 {
        return Ok(None);
    }
    file.seek(SeekFrom::End(-END))?;
    let (mut tail, mut mark) = ([0; 8], [0; 8]);
    file.read_exact(&mut tail)?;
    file.read_exact(&mut mark)?;
    let start = length.checked_sub(u64::from_le_bytes(tail));
    Ok(start.filter(|_| mark == *MARK).map(SeekFrom::Start))
}
