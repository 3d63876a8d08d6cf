//! The errors of this crate.

use std::fmt;
use std::path::PathBuf;

use crate::library::LIBRARY_VARIABLE;
use crate::limits::{MAX_SIDE, MAX_THREADS};

/// A failure to find or use Open Image Denoise, or an invalid argument.
///
/// `Display` says what is wrong, [`Error::hint`] what to do about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The library was not found under any of its names.
    NotFound {
        /// File names or paths tried, in order, each with the reason it failed.
        tried: Vec<(PathBuf, String)>,
    },
    /// [`LIBRARY_VARIABLE`] names a file that does not exist.
    NoSuchFile(PathBuf),
    /// A library was found, but cannot be used.
    Unusable {
        /// Path of the library file.
        path: PathBuf,
        /// Reason why the library cannot be used.
        reason: String,
    },
    /// Open Image Denoise reported an error.
    Oidn {
        /// The operation that failed, such as "make a device".
        during: &'static str,
        /// The library's message.
        message: String,
    },
    /// More threads were asked for than [`MAX_THREADS`]; holds their number.
    TooManyThreads(usize),
    /// A picture has no pixels, or a side longer than [`MAX_SIDE`].
    BadSize {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The number of pixels of a picture is not width times height.
    BadLength {
        /// Name of the picture: `color`, `albedo` or `normal`.
        picture: &'static str,
        /// Number of pixels that were passed.
        pixels: usize,
        /// Expected width in pixels.
        width: usize,
        /// Expected height in pixels.
        height: usize,
    },
    /// Normals were passed without albedo, for which the library has no network.
    NormalWithoutAlbedo,
}

impl Error {
    /// Advice for the user, if there is any: one line without a full stop.
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
