//! Options of the finish, which `render`, `combine` and `converge` have in common.

use crate::finish::DenoiserChoice;
use crate::pipeline::finish::Order;
use serde::Serialize;

/// How the estimate becomes the picture.
#[derive(clap::Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Finish")]
pub struct FinishOptions {
    /// What makes the denoised picture: 'oidn' is Intel Open Image Denoise, 'own' needs no library, 'auto' takes oidn
    /// where it is found
    ///
    /// The estimate moves towards it as far as its own standard errors allow
    #[arg(long, value_enum, default_value_t)]
    pub denoise: DenoiserChoice,
    /// Combine five bandwidth levels by equation (6) of the 2021 paper before that, with a network: 'compact' comes
    /// with the program; or an ONNX file
    #[arg(long, value_name = "compact|FILE.onnx", help_heading = "Expert")]
    pub model: Option<String>,
}

impl FinishOptions {
    /// The options as the pipeline takes them.
    pub fn order(&self) -> Order {
        Order { denoiser: self.denoise, model: self.model.clone() }
    }
}
