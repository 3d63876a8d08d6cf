//! Pictures stored on disk during a comparison, because they can take gigabytes.

use crate::error::{Error, Result};
use crate::film::{Picture, Size};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Pictures of one size in an unnamed temporary file, which disappears with the process.
pub struct PictureStore {
    folder: PathBuf,
    file: File,
    size: Size,
    count: u64,
}

impl PictureStore {
    /// Creates an empty store in a folder, for pictures of this size.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn new(folder: &Path, size: Size) -> Result<PictureStore> {
        let file = tempfile::tempfile_in(folder).map_err(|cause| Error::io(folder, &cause))?;
        Ok(PictureStore { folder: folder.into(), file, size, count: 0 })
    }

    /// Stores a picture; returns its number in the store, for [`get`](Self::get).
    ///
    /// # Errors
    /// The picture cannot be written, for example because the disk is full.
    pub fn push(&mut self, picture: &Picture) -> Result<u64> {
        let bytes: Vec<u8> = picture.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let number = self.count;
        self.count += 1;
        let written = self.seek(number).and_then(|()| self.file.write_all(&bytes));
        written.map_err(|cause| Error::io(&self.folder, &cause).hint("free space on the disk of the output folder"))?;
        Ok(number)
    }

    /// Reads the picture that [`push`](Self::push) has stored under `number`.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn get(&mut self, number: u64) -> Result<Picture> {
        let mut bytes = vec![0; self.size.pixels() * 12];
        let read = self.seek(number).and_then(|()| self.file.read_exact(&mut bytes));
        read.map_err(|cause| Error::io(&self.folder, &cause))?;
        let value = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let pixels = bytes.chunks_exact(12).map(|p| [value(&p[0..4]), value(&p[4..8]), value(&p[8..12])]);
        Ok(Picture::new(self.size, pixels.collect()))
    }

    fn seek(&mut self, number: u64) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(number * self.size.pixels() as u64 * 12)).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_in_any_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let size = Size { width: 2, height: 1 };
        let mut store = PictureStore::new(folder.path(), size).expect("a file");
        let pictures = [[[1.0, 2.0, 3.0], [4.0, 5.0, f32::INFINITY]], [[0.5; 3], [-1e-30; 3]]];
        let pictures = pictures.map(|pixels| Picture::new(size, pixels.to_vec()));
        let numbers: Vec<u64> = pictures.iter().map(|p| store.push(p).expect("it is written")).collect();
        for (number, picture) in numbers.iter().zip(&pictures).rev() {
            assert_eq!(store.get(*number).expect("it is there"), *picture);
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
