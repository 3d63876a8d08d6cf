//! Options of the finish, which `render`, `finish`, `merge` and `converge` have in common.

use crate::argument::Elsewhere;
use crate::combine::{Model, Purpose};
use crate::finish::DenoiserChoice;
use crate::pipeline::FinishRequest;
use serde::Serialize;

/// How the estimate becomes the picture.
#[derive(clap::Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Finish")]
pub struct FinishOptions {
    /// Denoiser: 'oidn' is Intel Open Image Denoise, 'own' needs no library, 'auto' takes oidn if it is found
    ///
    /// The estimate moves towards the denoised picture as far as its own standard errors allow
    #[arg(long, value_enum, default_value_t)]
    pub denoise: DenoiserChoice,
    /// Network: 'compact' comes with the program and combines five bandwidth levels before denoising, by equation (6)
    /// of the 2021 paper; an ONNX file does so too, or improves the denoised picture of one level
    #[arg(long, value_name = "compact|FILE.onnx", help_heading = "Expert")]
    #[arg(in_stages = false)]
    pub model: Option<String>,
}

impl FinishOptions {
    /// The purpose of the network; `None` without one. A file that cannot be read counts as one for levels, and is an
    /// error when the finish is opened.
    pub fn purpose(&self) -> Option<Purpose> {
        let of = |name: &str| Model::open(name).map_or(Purpose::Levels, |model| model.purpose());
        self.model.as_deref().map(of)
    }

    /// The request for the pipeline.
    pub fn request(&self) -> FinishRequest {
        FinishRequest { denoiser: self.denoise, model: self.model.clone() }
    }
}
