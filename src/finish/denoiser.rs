//! What makes the denoised picture `D`: Intel Open Image Denoise where its library is found, else our own statistical
//! filter.

use super::Estimate;
use super::bound::spread;
use super::statistical;
use crate::error::{Error, ErrorKind, Result};
use crate::film::Picture;
use crate::installed;
use caustique_oidn as oidn;
use serde::{Deserialize, Serialize};

pub use oidn::Quality;

/// Bytes that Open Image Denoise works in, for a pixel of a picture that it takes in one piece.
const SCRATCH: u64 = 700;
/// The memory that it is given to work in (MiB): it takes a picture that needs more in tiles. Tiles leave other rounding,
/// so this does not depend on the machine.
const MEMORY_MIB: u32 = 1024;

/// Bytes that the denoiser works in, for a picture of `pixels` pixels.
pub fn scratch(pixels: u64) -> u64 {
    (SCRATCH * pixels).min(u64::from(MEMORY_MIB) << 20)
}

/// What makes the denoised picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum DenoiserChoice {
    /// Open Image Denoise where its library is found, else our own
    #[default]
    Auto,
    /// Intel Open Image Denoise
    Oidn,
    /// Our own: means over neighbours that noise cannot tell apart
    Own,
    /// No denoiser: the finish without one
    None,
}

/// A denoiser that is ready.
pub enum Denoiser {
    /// Open Image Denoise. The filter keeps its network between pictures of one size and kind.
    Oidn {
        /// The filter.
        filter: oidn::Filter,
        /// Version of the library.
        version: String,
    },
    /// [`statistical`].
    Own,
    /// The estimate as it is.
    None,
}

impl Denoiser {
    /// The one asked for, with as many threads as the current rayon pool has. With [`DenoiserChoice::Auto`] also why it
    /// is not Open Image Denoise.
    ///
    /// # Errors
    /// [`ErrorKind::Library`] where [`DenoiserChoice::Oidn`] cannot be had.
    pub fn open(choice: DenoiserChoice) -> Result<(Denoiser, Option<Error>)> {
        match choice {
            DenoiserChoice::None => Ok((Denoiser::None, None)),
            DenoiserChoice::Own => Ok((Denoiser::Own, None)),
            DenoiserChoice::Oidn => Ok((oidn()?, None)),
            DenoiserChoice::Auto => Ok(oidn().map_or_else(|error| (Denoiser::Own, Some(error)), |found| (found, None))),
        }
    }

    /// What the header says.
    pub fn name(&self) -> String {
        match self {
            Denoiser::Oidn { version, .. } => format!("Open Image Denoise {version}"),
            Denoiser::Own => "own".into(),
            Denoiser::None => "none".into(),
        }
    }

    /// The denoised picture of an estimate, row by row.
    ///
    /// # Errors
    /// [`ErrorKind::Library`] when Open Image Denoise fails.
    pub fn run(&mut self, estimate: &Estimate, quality: Quality) -> Result<Picture> {
        let Estimate { mean, albedo, normal, .. } = estimate;
        let (albedo, normal) = (albedo.as_ref(), normal.as_ref());
        match self {
            Denoiser::None => Ok(mean.clone()),
            Denoiser::Own => {
                let spread = spread(estimate);
                Ok(statistical::denoise(&statistical::Input { mean, spread: &spread, albedo, normal }))
            }
            Denoiser::Oidn { filter, .. } => {
                let size = mean.size();
                let finite = mean.map(|value| if value.is_finite() { value.max(0.0) } else { 0.0 });
                let mut input = oidn::Input::new(size.width, size.height, &finite);
                // Normals alone are no guide that it takes. Ours are averages over all eye paths: with `clean_aux` they
                // served as well as denoised ones, and without it left 1.2 times the error.
                input.albedo = albedo.map(|albedo| &**albedo);
                input.normal = normal.filter(|_| albedo.is_some()).map(|normal| &**normal);
                (input.hdr, input.clean_aux) = (true, albedo.is_some());
                (input.quality, input.max_memory_mib) = (quality, Some(MEMORY_MIB));
                let pixels = filter.denoise(&input);
                let pixels = pixels.map_err(|error| Error::new(ErrorKind::Library, "Open Image Denoise", error))?;
                Ok(Picture::new(size, pixels))
            }
        }
    }
}

/// Where `scripts/setup.sh` puts Open Image Denoise, in the project's folder.
const FOLDER: &str = ".deps/oidn";

/// Open Image Denoise, as the system or `scripts/setup.sh` has installed it (see [`installed`]).
///
/// # Errors
/// That of [`oidn::Library::load`].
pub fn library() -> std::result::Result<oidn::Library, oidn::Error> {
    oidn::Library::load(&installed::candidates(FOLDER))
}

/// Where that library comes from.
pub fn origin(library: &oidn::Library) -> &'static str {
    installed::origin(oidn::LIBRARY_VARIABLE, FOLDER, library.path())
}

fn oidn() -> Result<Denoiser> {
    let refuse = |error: oidn::Error| {
        let refusal = Error::new(ErrorKind::Library, "Open Image Denoise", &error);
        error.hint().into_iter().fold(refusal, Error::hint)
    };
    let library = library().map_err(refuse)?;
    let device = oidn::Device::new(&library, rayon::current_num_threads()).map_err(refuse)?;
    let filter = device.filter().map_err(refuse)?;
    Ok(Denoiser::Oidn { filter, version: library.version().to_string() })
}
