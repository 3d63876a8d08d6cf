//! Denoisers: Intel Open Image Denoise if its library is found, else our own statistical filter.

use super::Estimate;
use super::bound::spread;
use super::grey::keep_grey;
use super::statistical;
use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::installed;
use crate::stop::Stop;
use caustique_oidn as oidn;
use serde::{Deserialize, Serialize};

pub use oidn::Quality;

/// Bytes of scratch memory that Open Image Denoise needs per pixel of an untiled picture.
const SCRATCH_PER_PIXEL: u64 = 700;
/// Limit on the scratch memory of Open Image Denoise (MiB), which splits larger pictures into tiles. Tiles change the
/// rounding, so that the limit must not depend on the machine.
const MAX_MEMORY_MIB: u32 = 1024;

/// Bytes of the weights and buffers of Open Image Denoise.
const WEIGHTS_BYTES: u64 = 48 << 20;
/// Bytes per pixel that our own denoiser needs.
const OWN_PER_PIXEL: u64 = 48;

/// Bytes that a denoiser needs for a picture of `pixels` pixels, and keeps for the next one.
pub fn held(pixels: u64, choice: DenoiserChoice) -> u64 {
    match choice {
        DenoiserChoice::None => 0,
        DenoiserChoice::Own => OWN_PER_PIXEL * pixels,
        _ => WEIGHTS_BYTES + (SCRATCH_PER_PIXEL * pixels).min(u64::from(MAX_MEMORY_MIB) << 20),
    }
}

/// The user's choice of a denoiser.
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
    /// As auto, without the bound: the denoised picture itself, for drafts
    Full,
    /// No denoiser: the finish without one
    None,
}

/// A loaded denoiser of pictures.
pub enum Denoiser {
    /// Open Image Denoise. Its filter keeps its neural network between pictures of equal size and inputs.
    Oidn {
        /// The filter of pictures.
        filter: oidn::Filter,
        /// The filters of the guides, albedo and normal.
        guides: [oidn::Filter; 2],
        /// Version of Open Image Denoise, such as `2.3.0`.
        version: String,
    },
    /// The project's own denoiser, see [`statistical`].
    Own,
    /// No denoiser: the denoised picture is the estimate.
    None,
}

impl Denoiser {
    /// Loads the chosen denoiser with the number of threads of the current rayon pool. If [`DenoiserChoice::Auto`] falls
    /// back to our own, also returns why Open Image Denoise cannot be loaded.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: [`DenoiserChoice::Oidn`] is chosen and cannot be loaded.
    pub fn open(choice: DenoiserChoice) -> Result<(Denoiser, Option<Error>)> {
        match choice {
            DenoiserChoice::None => Ok((Denoiser::None, None)),
            DenoiserChoice::Own => Ok((Denoiser::Own, None)),
            DenoiserChoice::Oidn => Ok((load_oidn()?, None)),
            DenoiserChoice::Auto | DenoiserChoice::Full => {
                Ok(load_oidn().map_or_else(|error| (Denoiser::Own, Some(error)), |found| (found, None)))
            }
        }
    }

    /// The choice that gives this denoiser.
    pub fn choice(&self) -> DenoiserChoice {
        match self {
            Denoiser::Oidn { .. } => DenoiserChoice::Oidn,
            Denoiser::Own => DenoiserChoice::Own,
            Denoiser::None => DenoiserChoice::None,
        }
    }

    /// Name of the denoiser, with the version of Open Image Denoise, for the header of files.
    pub fn name(&self) -> String {
        match self {
            Denoiser::Oidn { version, .. } => format!("Open Image Denoise {version}"),
            Denoiser::Own => "own".into(),
            Denoiser::None => "none".into(),
        }
    }

    /// The denoised picture of an estimate; the estimate itself with [`Denoiser::None`].
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: Open Image Denoise fails. [`ErrorKind::Interrupted`]: `stop` was requested meanwhile, which
    /// only Open Image Denoise heeds.
    pub fn run(&mut self, estimate: &Estimate, quality: Quality, stop: Option<&Stop>) -> Result<Picture> {
        let Estimate { mean, albedo, normal, clean_guides, .. } = estimate;
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
                // Open Image Denoise takes normals only together with albedo.
                input.albedo = albedo.map(|albedo| &**albedo);
                input.normal = normal.filter(|_| albedo.is_some()).map(|normal| &**normal);
                (input.hdr, input.clean_aux, input.quality) = (true, *clean_guides, quality);
                let mut denoised = run_filter(filter, size, input, stop)?;
                keep_grey(&mut denoised, mean);
                Ok(denoised)
            }
        }
    }

    /// Removes the noise of the guides, which come from one branch of each camera path at glass, and from one point of the
    /// lens. The denoiser takes its guides for clean, and would keep their noise as if it were detail of the picture.
    /// Only Open Image Denoise needs this; its lowest quality is as good here as its best.
    ///
    /// # Errors
    /// As for [`Denoiser::run`].
    pub fn clean_guides(&mut self, estimate: &mut Estimate, stop: Option<&Stop>) -> Result<()> {
        let Denoiser::Oidn { guides: [of_albedo, of_normal], .. } = self else { return Ok(()) };
        let each = [
            (of_albedo, &mut estimate.albedo, oidn::Content::Albedo),
            (of_normal, &mut estimate.normal, oidn::Content::Normal),
        ];
        for (filter, guide, content) in each {
            if let Some(guide) = guide {
                let size = guide.size();
                let finite = guide.map(|value| if value.is_finite() { value } else { 0.0 });
                let input = oidn::Input::new(size.width, size.height, &finite);
                *guide = run_filter(filter, size, oidn::Input { content, quality: Quality::Fast, ..input }, stop)?;
            }
        }
        estimate.clean_guides = true;
        Ok(())
    }
}

/// Runs a filter of Open Image Denoise within its limit of memory.
fn run_filter(filter: &mut oidn::Filter, size: Size, input: oidn::Input<'_>, stop: Option<&Stop>) -> Result<Picture> {
    let input = oidn::Input { max_memory_mib: Some(MAX_MEMORY_MIB), ..input };
    let pixels = match stop {
        Some(stop) => filter.denoise_while(&input, &|| !stop.requested()),
        None => filter.denoise(&input).map(Some),
    };
    let pixels = pixels.map_err(|error| Error::new(ErrorKind::Library, "Open Image Denoise", error))?;
    let interrupted = || Error::new(ErrorKind::Interrupted, "", "interrupted while it was denoised");
    Ok(Picture::new(size, pixels.ok_or_else(interrupted)?))
}

/// Folder within the project into which `scripts/setup.sh` installs Open Image Denoise.
const FOLDER: &str = ".deps/oidn";

/// Loads Open Image Denoise: of the package that holds this code, of the system, or as installed by `scripts/setup.sh`
/// (see [`installed`]).
///
/// # Errors
/// As [`oidn::Library::load`].
pub fn library() -> std::result::Result<oidn::Library, oidn::Error> {
    oidn::Library::load(&installed::folders(FOLDER))
}

/// Where Open Image Denoise was found, in words (see [`installed::origin`]).
pub fn origin(library: &oidn::Library) -> &'static str {
    installed::origin(oidn::LIBRARY_VARIABLE, FOLDER, library.path())
}

fn load_oidn() -> Result<Denoiser> {
    let refuse = |error: oidn::Error| {
        let refusal = Error::new(ErrorKind::Library, "Open Image Denoise", &error);
        error.hint().into_iter().fold(refusal, Error::hint)
    };
    let library = library().map_err(refuse)?;
    let device = oidn::Device::new(&library, rayon::current_num_threads()).map_err(refuse)?;
    let filter = || device.filter().map_err(refuse);
    Ok(Denoiser::Oidn { filter: filter()?, guides: [filter()?, filter()?], version: library.version().to_string() })
}
