//! Opens the finish that options ask for, and says which denoiser is missing.

use super::say;
use caustique::error::{Error, Result};
use caustique::options::FinishOptions;
use caustique::pipeline::Ready;

/// Opens a finish, see [`caustique::pipeline::finish::open`].
///
/// # Errors
/// A library that was asked for by name is missing, or the network takes other levels.
pub fn open(options: &FinishOptions, levels: Option<usize>) -> Result<Ready> {
    let ready = caustique::pipeline::finish::open(&options.order(), levels)?;
    tell_missing(ready.missing.as_ref());
    Ok(ready)
}

/// Says that our own denoiser takes the place of one that is missing.
pub fn tell_missing(missing: Option<&Error>) {
    let Some(error) = missing else { return };
    say(&format!("warning: {error}: our own denoiser takes its place, whose pictures are grainier"));
    if let Some(hint) = &error.hint {
        say(&format!("hint: {hint}"));
    }
}
