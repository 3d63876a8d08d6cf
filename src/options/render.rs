//! Options that `caustique render`, `caustique plan` and Python's `render` have in common.

// Help texts have defaults in brackets, which are not links.
#![allow(rustdoc::broken_intra_doc_links)]

use super::finish::FinishOptions;
use super::frames::Frames;
use super::scene::SceneOptions;
use super::values::{CropChoice, FrameSeed, filter};
use crate::argument::{Elsewhere, Ranged};
use crate::camera::Filter;
use crate::error::Result;
use crate::finish::{DenoiserChoice, Finish};
use crate::pipeline::PictureRequest;
use crate::render::SettingsRequest;
use crate::scene::{CameraRequest, MAX_SIZE, Orbit};
use serde::Serialize;

/// A picture of a scene, the method, and when to stop.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct RenderOptions {
    /// The method, its settings, and when to stop.
    #[command(flatten)]
    #[serde(flatten)]
    pub settings: SettingsRequest,
    /// Noise of the frames: 'vary' gives frame N the seed S + N, so that the remaining noise changes; 'same' gives all
    /// frames the seed S, so that it stays in place
    #[arg(long, value_enum, default_value_t, help_heading = "Method")]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "a Scene is one frame")]
    pub frame_seed: FrameSeed,

    /// Width and height of the picture.
    #[command(flatten)]
    #[serde(flatten)]
    pub size: SizeOptions,
    /// Render only a window of the picture: left edge, top edge, width and height, in pixels, or in fractions such as
    /// 0.25,0,0.5,1 [default: the scene's, else the whole picture]
    #[arg(long, value_name = "X,Y,W,H", help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    pub crop: Option<CropChoice>,
    /// Pixel filter and its width in pixels, as in Blender: 'box' [1], 'gaussian' [1.5] or 'blackman-harris' [1.5]
    /// [default: box 1]
    #[arg(long, num_args = 1..=2, action = clap::ArgAction::Set, value_names = ["box|gaussian|blackman-harris", "WIDTH"])]
    #[arg(help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(in_stages = true)]
    pub filter: Option<Vec<String>>,
    /// Name of the camera [default: the scene's first]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    pub camera: Option<String>,
    /// View of the whole scene instead of a camera: azimuth and elevation in degrees around the middle of the scene, 0,0
    /// from the front (+Z), 90,0 from the right (+X); distance in metres, or in per cent of the distance that frames the
    /// scene [default: 30,20 if the scene has no camera]
    #[arg(long, value_name = "AZIMUTH,ELEVATION[,DISTANCE]", allow_hyphen_values = true, conflicts_with = "camera")]
    #[arg(help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    pub orbit: Option<Orbit>,

    /// The scene and how it is read.
    #[command(flatten)]
    #[serde(flatten)]
    pub scene: SceneOptions,

    /// Do not finish the picture: it stays the method's own estimate, at one bandwidth
    #[arg(long, alias = "no-combine", conflicts_with_all = ["model", "denoise"], help_heading = "Finish")]
    #[serde(rename = "no-combine")]
    #[arg(in_python = "finish")]
    pub no_finish: bool,
    /// How the estimate becomes the picture.
    #[command(flatten)]
    #[serde(flatten)]
    pub finish: FinishOptions,
}

/// The size of the picture.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct SizeOptions {
    /// Width in pixels; alone it keeps the camera's aspect ratio [default: the scene's, else 1280]
    #[arg(long, value_name = "W", whole = 1..=MAX_SIZE, help_heading = "Picture")]
    pub width: Option<u32>,
    /// Height in pixels; alone it keeps the camera's aspect ratio
    #[arg(long, value_name = "H", whole = 1..=MAX_SIZE, help_heading = "Picture")]
    pub height: Option<u32>,
}

impl RenderOptions {
    /// The requested camera, size, window and pixel filter.
    ///
    /// # Errors
    /// The filter is invalid.
    pub fn camera_request(&self) -> Result<CameraRequest> {
        let crop = self.crop.as_ref().map(|choice| choice.crop);
        let filter = self.filter.as_deref().map_or(Ok(Filter::default()), filter)?;
        Ok(CameraRequest {
            camera: self.camera.clone(),
            own: None,
            orbit: self.orbit,
            width: self.size.width,
            height: self.size.height,
            crop,
            filter,
        })
    }

    /// The picture and its settings as the pipeline, which renders it, wants them.
    ///
    /// # Errors
    /// Options contradict each other.
    pub fn picture_request(&self) -> Result<PictureRequest> {
        let settings = self.settings_request();
        settings.resolve()?;
        Ok(PictureRequest { camera: self.camera_request()?, settings })
    }

    /// The method and its settings, with what other options say about them.
    pub fn settings_request(&self) -> SettingsRequest {
        SettingsRequest {
            seed: self.frame_seed(),
            network: self.finish.purpose(),
            switches: self.scene.switches(),
            ..self.settings.clone()
        }
    }

    /// The denoiser of the picture; none with `--no-finish`.
    fn denoiser(&self) -> DenoiserChoice {
        if self.no_finish { DenoiserChoice::None } else { self.finish.denoise }
    }

    /// The finish of a pilot (a small render) that predicts the error of the render: the denoiser of the render,
    /// without a network.
    ///
    /// # Errors
    /// The user chose a denoiser whose library is missing.
    pub fn forecast_finish(&self) -> Result<Finish> {
        Ok(Finish::open(self.denoiser(), None)?.0)
    }

    /// The seed of the frame that is rendered, which depends on its number with `--frame-seed vary`.
    fn frame_seed(&self) -> u64 {
        let frame = self.scene.frames.and_then(Frames::single);
        match (self.frame_seed, frame) {
            (FrameSeed::Vary, Some(frame)) => self.settings.seed.wrapping_add(frame.into()),
            _ => self.settings.seed,
        }
    }
}
