//! Reads the EXR of a render to finish it.

use crate::error::Result;
use crate::film::{LayerSet, Naming, current_name, plain_name, take_plain_names};
use crate::image::exr::{self, Attributes};
use std::path::Path;

/// The EXR of a render of this or another program.
pub struct RenderedFile {
    /// All layers, under plain names.
    pub set: LayerSet,
    /// Attributes of the EXR header, such as the JSON object `caustique`.
    pub attributes: Attributes,
    /// Names of the file's channels, which its cryptomatte attributes also use.
    pub naming: Naming,
    /// Remarks for the user, such as on layers that are left out.
    pub remarks: Vec<String>,
}

impl RenderedFile {
    /// Reads a file. Layers whose names cannot be written are left out, with a remark.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read(path: &Path) -> Result<RenderedFile> {
        Ok(RenderedFile::of(path, exr::read(path)?))
    }

    /// The header of a file: its layers lack their values. Reads no pixels.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read_header(path: &Path) -> Result<RenderedFile> {
        Ok(RenderedFile::of(path, exr::read_header(path)?))
    }

    /// A file with the layers alone whose plain names `wanted` accepts.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read_layers(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<RenderedFile> {
        Ok(RenderedFile::of(path, exr::read_layers(path, |name| wanted(&current_name(plain_name(name))))?))
    }

    fn of(path: &Path, (mut set, attributes): (LayerSet, Attributes)) -> RenderedFile {
        let naming = Naming::of(&set);
        let remark = |name: String| {
            format!("{}: layer \"{name}\" cannot be written under this name and is left out", path.display())
        };
        let remarks = take_plain_names(&mut set).into_iter().map(remark).collect();
        RenderedFile { set, attributes, naming, remarks }
    }
}
