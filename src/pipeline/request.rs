//! A render that the user asks for, validated as far as that is possible without reading the scene.

use super::finish::FinishRequest;
use super::load::SceneRequest;
use super::memory::MemoryLimit;
use crate::film::{Naming, Selection};
use crate::path_class::Switches;
use crate::render::{Candidate, Settings};
use crate::scene::CameraRequest;
use serde_json::Value;
use std::path::PathBuf;

/// Function that makes the settings of a candidate (a method that `auto` compares) for a picture of a width and height
/// in pixels; `None` if the options exclude the candidate.
pub type SettingsOf<'a> = Box<dyn Fn(Candidate, (u32, u32)) -> Option<Settings> + 'a>;

/// The method that the user asks for: one by name, or the choice of `auto`.
pub enum MethodRequest<'a> {
    /// The user names a method; the settings are those of this method.
    Named(Settings),
    /// `auto` chooses the method.
    Auto(AutoRequest<'a>),
}

/// The candidates of `auto` (methods with settings).
pub struct AutoRequest<'a> {
    /// Settings of the render if the options leave only one candidate, and for the checks before the pilot.
    pub fallback: Settings,
    /// Makes the settings of each candidate.
    pub settings_of: SettingsOf<'a>,
}

impl<'a> MethodRequest<'a> {
    /// The request with changed settings of every candidate of `auto`; a method that the user names keeps its settings.
    pub fn map_candidates(self, change: impl Fn(Settings) -> Settings + 'a) -> MethodRequest<'a> {
        match self {
            MethodRequest::Auto(auto) => {
                let settings_of = auto.settings_of;
                let settings_of = Box::new(move |candidate, size| settings_of(candidate, size).map(&change));
                MethodRequest::Auto(AutoRequest { settings_of, ..auto })
            }
            named => named,
        }
    }

    /// The request with changed settings of the named method, or of every candidate of `auto`.
    pub(super) fn map_settings(self, change: impl Fn(Settings) -> Settings + 'a) -> MethodRequest<'a> {
        match self {
            MethodRequest::Named(settings) => MethodRequest::Named(change(settings)),
            MethodRequest::Auto(auto) => {
                let (settings_of, fallback) = (auto.settings_of, change(auto.fallback));
                let settings_of = Box::new(move |candidate, size| settings_of(candidate, size).map(&change));
                MethodRequest::Auto(AutoRequest { fallback, settings_of })
            }
        }
    }

    /// Settings for the checks that precede the choice of a method.
    pub fn settings(&self) -> &Settings {
        match self {
            MethodRequest::Named(settings) => settings,
            MethodRequest::Auto(auto) => &auto.fallback,
        }
    }

    /// Value of `--method` that stands for the request.
    pub fn name(&self) -> &'static str {
        match self {
            MethodRequest::Named(settings) => settings.method.name(),
            MethodRequest::Auto(_) => "auto",
        }
    }
}

/// A picture and how its light is found: the part of a request that `plan` and `render` share.
pub struct PictureRequest<'a> {
    /// Camera of the scene, and size of the picture.
    pub camera: CameraRequest,
    /// The requested method with its settings.
    pub method: MethodRequest<'a>,
    /// Light paths per iteration; `None`: the method's default for the size of the picture.
    pub photons: Option<u32>,
    /// Longest light path in segments; `None`: no limit.
    pub max_depth: Option<u32>,
    /// Effects, such as dispersion, that the user has switched on or off.
    pub switches: Switches,
}

/// A render that the user asks for.
pub struct Request<'a> {
    /// The scene file and how it is read.
    pub scene: SceneRequest,
    /// The picture: camera, size and method.
    pub picture: PictureRequest<'a>,
    /// How the picture is finished; `None`: it stays the unfinished estimate.
    pub finish: Option<FinishRequest>,
    /// Layers to deliver in the EXR.
    pub layers: Selection,
    /// Style of channel names, which the cryptomatte attributes repeat.
    pub naming: Naming,
    /// Options as the user gave them, a JSON object for the header.
    pub arguments: Value,
    /// Whether the header leaves out clocks and the number of threads.
    pub reproducible: bool,
    /// Limit on the memory of photons, pixels and layers; `None`: the memory of the machine alone.
    pub memory: Option<MemoryLimit>,
    /// Where the checkpoint is saved during the render; `None`: nowhere.
    pub saving: Option<Saving>,
    /// Path of a checkpoint from which the render continues; `None`: it starts anew.
    pub resume: Option<PathBuf>,
}

impl Request<'_> {
    /// How a render with these settings is finished; `None`: the picture stays the unfinished estimate, or is a shard, which
    /// is finished after the merge.
    pub(super) fn finish_of(&self, settings: &Settings) -> Option<&FinishRequest> {
        self.finish.as_ref().filter(|_| !settings.is_shard())
    }
}

/// Where and how often the checkpoint of a render is saved.
#[derive(Clone, Debug)]
pub struct Saving {
    /// Path of the checkpoint.
    pub path: PathBuf,
    /// Seconds between two saves of the checkpoint.
    pub every: f64,
    /// Whether the checkpoint stays, with the last state, when the render is done, so that the render can be extended.
    pub keep: bool,
}
