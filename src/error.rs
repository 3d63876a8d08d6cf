//! Errors as data: what kind, where, what is wrong, and what to do about it.
//!
//! The library never prints and never exits; `main` turns an [`Error`] into two lines on stderr
//! (`place: cause`, then `hint: remedy`) and an exit code.

use std::fmt;
use std::path::Path;

/// Result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What sort of thing went wrong; decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The command line asks for something that cannot be (exit code 2).
    Usage,
    /// A scene file is malformed, or asks for what we cannot do.
    Scene,
    /// An image (EXR, PNG, HDR, texture) cannot be read or written.
    Image,
    /// A file or folder cannot be opened, read, written or renamed.
    Io,
    /// A shared library (Embree, ONNX Runtime, Open Image Denoise) is missing or refuses.
    Library,
    /// A network file is not what the combiner needs.
    Model,
    /// Stopped by the user (exit code 130); finished work has been written.
    Interrupted,
}

/// An error: `place` (a file, and the place in it), `cause`, and a `hint` that says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// What sort of thing went wrong.
    pub kind: ErrorKind,
    /// File and place in it, such as `pool.glb: mesh "water", primitive 0`; empty when there is none.
    pub place: String,
    /// The fault, in one clause without a full stop.
    pub cause: String,
    /// The remedy, in one clause; `None` when there is nothing to advise.
    pub hint: Option<String>,
}

impl Error {
    /// An error with a place and a cause.
    pub fn new(kind: ErrorKind, place: impl fmt::Display, cause: impl fmt::Display) -> Self {
        Error { kind, place: place.to_string(), cause: cause.to_string(), hint: None }
    }

    /// An error of the options of a call: `cause` names them as on the command line, `--max-depth`.
    pub fn usage(cause: impl fmt::Display) -> Self {
        Error::new(ErrorKind::Usage, "command line", cause)
    }

    /// The same error with advice.
    #[must_use]
    pub fn hint(mut self, hint: impl fmt::Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// An operating-system error at a path.
    pub fn io(path: &Path, cause: &std::io::Error) -> Self {
        Error::new(ErrorKind::Io, path.display(), cause)
    }

    /// The same error, its place preceded by `outer` (a file's name, say).
    #[must_use]
    pub fn within(mut self, outer: impl fmt::Display) -> Self {
        self.place = if self.place.is_empty() { outer.to_string() } else { format!("{outer}: {}", self.place) };
        self
    }

    /// Exit code of a process that fails with this error.
    pub fn exit_code(&self) -> u8 {
        match self.kind {
            ErrorKind::Usage => 2,
            ErrorKind::Interrupted => 130,
            _ => 1,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() { write!(f, "{}", self.cause) } else { write!(f, "{}: {}", self.place, self.cause) }
    }
}

impl std::error::Error for Error {}
