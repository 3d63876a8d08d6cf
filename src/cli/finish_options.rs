//! Opening the finish that options ask for, and the look of the picture that it finishes.

use super::say;
use caustique::error::{Error, Result};
use caustique::image::exr::Attributes;
use caustique::options::FinishOptions;
use caustique::pipeline::{OpenFinish, finish};
use caustique::scene::description::PictureDefaults;

/// Exposure, tone curve and contrast of a render's scene, as its header has them.
pub fn look_of(attributes: &Attributes) -> PictureDefaults {
    let header = attributes.object().unwrap_or_default();
    let exposure = header["exposure"].as_f64().map(|exposure| exposure as f32);
    let tonemap = serde_json::from_value(header["tonemap"].clone()).ok();
    let contrast = serde_json::from_value(header["contrast"].clone()).ok();
    PictureDefaults { exposure, tonemap, contrast, ..PictureDefaults::default() }
}

/// Opens a finish (denoiser and network) for this number of bandwidth levels, and warns if the preferred denoiser is
/// missing.
///
/// # Errors
/// Errors of [`finish::open`].
pub fn open(options: &FinishOptions, levels: Option<usize>) -> Result<OpenFinish> {
    let opened = finish::open(&options.request(), levels)?;
    warn_missing_denoiser(opened.missing.as_ref());
    Ok(opened)
}

/// Warns that the built-in denoiser replaces a missing one.
pub fn warn_missing_denoiser(missing: Option<&Error>) {
    let Some(error) = missing else { return };
    say(&format!("warning: {error}: our own denoiser takes its place, whose pictures are grainier"));
    if let Some(hint) = &error.hint {
        say(&format!("hint: {hint}"));
    }
}
