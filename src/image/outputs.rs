//! The files that a run writes. None may be a file that the run reads, or another file that it writes.

use super::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::files::{self, Identities, Key};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The files that a run writes: pictures, their temporary files, checkpoints and claims.
#[derive(Default)]
pub struct Outputs {
    paths: Vec<PathBuf>,
    /// Index into `paths` of the file with a key.
    by_key: HashMap<Key, usize>,
}

impl Outputs {
    /// Collects the files that a run writes, existing or not.
    ///
    /// # Errors
    /// Two of them are the same file.
    pub fn new(paths: impl IntoIterator<Item = PathBuf>) -> Result<Outputs> {
        let mut outputs = Outputs::default();
        for path in paths {
            let index = outputs.paths.len();
            for key in files::identities(&path).keys {
                if let Some(other) = outputs.by_key.insert(key, index).filter(|other| *other != index) {
                    let cause = format!("is the same file as the output {}", outputs.paths[other].display());
                    let error = Error::new(ErrorKind::Usage, path.display(), cause);
                    return Err(error.hint("give each output a name of its own"));
                }
            }
            outputs.paths.push(path);
        }
        Ok(outputs)
    }

    /// Checks that all outputs are regular files, or missing.
    ///
    /// # Errors
    /// One is a pipe or a device.
    pub fn check_regular(&self) -> Result<()> {
        match self.paths.iter().find(|path| path.exists() && !path.is_file()) {
            None => Ok(()),
            Some(path) => {
                Err(Error::new(ErrorKind::Usage, path.display(), "is not a regular file").hint("name another output"))
            }
        }
    }

    /// Checks that no output replaces a file that the run reads, under whatever name.
    ///
    /// # Errors
    /// An output is an input, or an input has the name of an output's temporary file.
    pub fn check<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
        for input in inputs {
            let Identities { keys, .. } = files::identities(input);
            let same = keys.iter().find_map(|key| self.by_key.get(key)).and_then(|index| self.paths.get(*index));
            let temporary = || self.paths.iter().find(|path| atomic::is_temporary(input, path));
            if let Some(output) = same.or_else(temporary) {
                let cause = format!("{} is an input, which is not overwritten", input.display());
                return Err(Error::new(ErrorKind::Usage, output.display(), cause).hint("name another output"));
            }
        }
        Ok(())
    }
}
