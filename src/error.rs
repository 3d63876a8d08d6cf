//! Errors as data: what kind, where, what is wrong, and what to do about it.
//!
//! The library never prints and never exits; the command line turns an [`Error`] into two lines on stderr
//! (`place: cause`, then `hint: remedy`) and an exit code.

use std::fmt;
use std::path::Path;

/// Result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// The category of an error, which determines the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Options are invalid or contradict each other (exit code 2).
    Usage,
    /// A scene file is malformed, uses an unsupported feature, or needs too much memory.
    Scene,
    /// An image (EXR, PNG, HDR, texture) cannot be read or written.
    Image,
    /// A file or folder cannot be opened, read, written or renamed.
    Io,
    /// A shared library (Embree, ONNX Runtime, Open Image Denoise) is missing or unusable.
    Library,
    /// The file of a neural network is unusable.
    Model,
    /// Stopped by the user (exit code 130); finished work has been written.
    Interrupted,
}

/// An error with its category, its place, its cause, and a hint about the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// Category of the error, which determines the exit code.
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

    /// An error in the options. `cause` names them as on the command line, such as `--max-depth`.
    pub fn usage(cause: impl fmt::Display) -> Self {
        Error::new(ErrorKind::Usage, "command line", cause)
    }

    /// Sets the hint, the remedy in one clause.
    #[must_use]
    pub fn hint(mut self, hint: impl fmt::Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// An operating-system error at a path.
    pub fn io(path: &Path, cause: &std::io::Error) -> Self {
        Error::new(ErrorKind::Io, path.display(), cause)
    }

    /// Puts `outer`, such as the name of a file, in front of the place.
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
