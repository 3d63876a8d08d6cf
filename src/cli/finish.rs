//! Options of the finish that `render`, `combine` and `converge` have in common, and what they open.

use super::say;
use caustique::error::{Error, Result};
use caustique::finish::DenoiserChoice;
use caustique::pipeline::Ready;
use caustique::pipeline::finish::{Order, open};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// What makes the denoised picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Denoise {
    /// Open Image Denoise where its library is found, else our own
    #[default]
    Auto,
    /// Intel Open Image Denoise
    Oidn,
    /// Our own: means over neighbours that noise cannot tell apart
    Own,
    /// Nothing
    None,
}

impl From<Denoise> for DenoiserChoice {
    fn from(denoise: Denoise) -> Self {
        match denoise {
            Denoise::Auto => DenoiserChoice::Auto,
            Denoise::Oidn => DenoiserChoice::Oidn,
            Denoise::Own => DenoiserChoice::Own,
            Denoise::None => DenoiserChoice::None,
        }
    }
}

/// How the estimate becomes the picture.
#[derive(clap::Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Finish")]
pub struct FinishArgs {
    /// What makes the denoised picture: 'oidn' is Intel Open Image Denoise, 'own' needs no library, 'auto' takes oidn
    /// where it is found
    ///
    /// The estimate moves towards it as far as its own standard errors allow
    #[arg(long, value_enum, default_value_t = Denoise::Auto)]
    pub denoise: Denoise,
    /// Combine five bandwidth levels by equation (6) of the 2021 paper before that, with a network: 'compact' comes
    /// with the program; or an ONNX file
    #[arg(long, value_name = "compact|FILE.onnx", help_heading = "Expert")]
    pub model: Option<String>,
}

impl FinishArgs {
    /// What is asked of the pipeline.
    pub fn order(&self) -> Order {
        Order { denoiser: self.denoise.into(), model: self.model.clone() }
    }

    /// Opens it alone, see [`pipeline::finish::open`](open).
    ///
    /// # Errors
    /// A library that was asked for by name is missing, or the network takes other levels.
    pub fn open(&self, levels: Option<usize>) -> Result<Ready> {
        let ready = open(&self.order(), levels)?;
        tell_missing(ready.missing.as_ref());
        Ok(ready)
    }
}

/// Says that our own denoiser takes the place of one that is missing.
pub fn tell_missing(missing: Option<&Error>) {
    let Some(error) = missing else { return };
    say(&format!("warning: {error}: our own denoiser takes its place, whose pictures are grainier"));
    if let Some(hint) = &error.hint {
        say(&format!("hint: {hint}"));
    }
}
