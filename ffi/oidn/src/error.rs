//! What can go wrong, as data.

use std::fmt;
use std::path::PathBuf;

use crate::library::LIBRARY_VARIABLE;
use crate::limits::{MAX_SIDE, MAX_THREADS};

/// A failure to find Open Image Denoise, to use it, or to accept what it was given.
///
/// `Display` says what is wrong; [`Error::hint`] what to do about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// No library was found under any of the names it goes by: each name with the loader's reason.
    NotFound {
        /// File names or paths tried, in order, each with the reason it failed.
        tried: Vec<(PathBuf, String)>,
    },
    /// [`LIBRARY_VARIABLE`] names what is no file.
    NoSuchFile(PathBuf),
    /// A library was found and cannot be used.
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Open Image Denoise reported an error of its own.
    Oidn {
        /// What was being done.
        during: &'static str,
        /// The library's words.
        message: String,
    },
    /// More threads than [`MAX_THREADS`].
    TooManyThreads(usize),
    /// A picture without pixels, or with a side longer than [`MAX_SIDE`].
    BadSize {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A picture whose pixels are not as many as its size says.
    BadLength {
        /// `color`, `albedo` or `normal`.
        picture: &'static str,
        /// How many pixels it has.
        pixels: usize,
        /// Pixels in a row that it should have.
        width: usize,
        /// Rows that it should have.
        height: usize,
    },
    /// Normals without albedo: no network was trained for that.
    NormalWithoutAlbedo,
}

impl Error {
    /// What the user can do about it, where that is known: one line, without a trailing full stop.
    pub fn hint(&self) -> Option<String> {
        match self {
            Error::NotFound { .. } | Error::NoSuchFile(_) | Error::Unusable { .. } => {
                Some(format!("run scripts/setup.sh, or set {LIBRARY_VARIABLE} to libOpenImageDenoise.so"))
            }
            Error::NormalWithoutAlbedo => Some("give albedo, too, or leave normals out".into()),
            _ => None,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::NotFound { tried } => {
                write!(f, "Open Image Denoise was not found")?;
                for (i, (path, reason)) in tried.iter().enumerate() {
                    write!(f, "{} {}: {reason}", if i == 0 { "; tried" } else { ";" }, path.display())?;
                }
                Ok(())
            }
            Error::NoSuchFile(path) => write!(f, "{LIBRARY_VARIABLE}={}: no such file", path.display()),
            Error::Unusable { path, reason } => write!(f, "{}: {reason}", path.display()),
            Error::Oidn { during, message } => write!(f, "Open Image Denoise failed to {during}: {message}"),
            Error::TooManyThreads(threads) => write!(f, "{threads} threads are more than {MAX_THREADS}"),
            Error::BadSize { width, height } => {
                write!(f, "a picture of {width} x {height} pixels cannot be denoised: sides from 1 to {MAX_SIDE} can")
            }
            Error::BadLength { picture, pixels, width, height } => {
                write!(f, "{picture}: {pixels} pixels are not {width} x {height}")
            }
            Error::NormalWithoutAlbedo => write!(f, "normals guide only together with albedo"),
        }
    }
}

impl std::error::Error for Error {}
