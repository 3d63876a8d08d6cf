//! A loaded scene that is edited: its description is kept, and the scene is built again from it after an edit.

use super::load::{self, Loaded, SceneRequest};
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::math::DAffine3;
use crate::scene::Description;
use crate::stop::Stop;
use std::path::{Path, PathBuf};

/// An edit of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Places the object or light of this name by a transform from its own space to world space.
    Place(String, DAffine3),
    /// Removes the objects and lights of this name.
    Remove(String),
    /// Adds the objects and lights of a scene file, in place of those that have the same names.
    Replace(PathBuf),
}

/// Checks that a scene file is a regular file: who waits for the answer to a command must not wait for a pipe.
///
/// # Errors
/// It cannot be opened, or is a pipe or a device.
pub fn check_file(path: &Path) -> Result<()> {
    files::open(path).map(drop).map_err(|cause| Error::io(path, &cause).hint("name a scene file"))
}

/// A scene that has been loaded and can be edited.
pub struct EditableScene {
    request: SceneRequest,
    /// The description of the file with all edits, without the changes that the request asks for.
    description: Description,
    loaded: Loaded,
    /// Whether the scene differs from its file.
    is_edited: bool,
}

impl EditableScene {
    /// Reads and builds a scene. Embree builds with `threads` threads.
    ///
    /// # Errors
    /// Errors of [`load::load`].
    pub fn load(request: SceneRequest, threads: usize, stop: &Stop) -> Result<EditableScene> {
        let (description, file) = load::read(&request, threads, stop)?;
        let hash = load::hash(&request, &description)?;
        let loaded = Loaded { file, hash, ..load::build(description.clone(), &request, threads)? };
        Ok(EditableScene { request, description, loaded, is_edited: false })
    }

    /// The scene, ready to be rendered.
    pub fn loaded(&self) -> &Loaded {
        &self.loaded
    }

    /// How the scene was read.
    pub fn request(&self) -> &SceneRequest {
        &self.request
    }

    /// Whether the scene differs from its file.
    pub fn is_edited(&self) -> bool {
        self.is_edited
    }

    /// Applies edits in their order, and builds the scene again. After an error the scene is unchanged. Returns warnings
    /// about the files of the edits.
    ///
    /// # Errors
    /// An edit does not fit the scene, its file cannot be read, or something in the scene moves while the shutter is
    /// open.
    pub fn edit(&mut self, edits: &[Edit], threads: usize, stop: &Stop) -> Result<Vec<String>> {
        if self.description.blur().is_some() {
            let cause = "scenes with motion blur are not edited";
            let error = Error::new(ErrorKind::Usage, self.request.path.display(), cause);
            return Err(error.hint("load the scene again, or load it with --shutter 0"));
        }
        let mut description = self.description.clone();
        let mut warnings = Vec::new();
        for edit in edits {
            match edit {
                Edit::Place(name, to_world) => description.place(name, *to_world)?,
                Edit::Remove(name) => description.remove(name)?,
                Edit::Replace(path) => {
                    check_file(path)?;
                    let (mut part, _) = load::read_file(path, &self.request.options, stop)?;
                    warnings.append(&mut part.warnings);
                    description.replace_by(part);
                }
            }
        }
        let loaded = load::build(description.clone(), &self.request, threads)?;
        (self.description, self.loaded, self.is_edited) = (description, loaded, true);
        Ok(warnings)
    }
}
