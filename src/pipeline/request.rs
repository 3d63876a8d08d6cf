//! A render that the user asks for, validated as far as that is possible without reading the scene.

use super::finish::FinishRequest;
use super::load::SceneRequest;
use super::memory::MemoryLimit;
use crate::film::{Naming, Selection};
use crate::render::{Settings, SettingsRequest};
use crate::scene::CameraRequest;
use serde_json::Value;
use std::path::PathBuf;

/// A picture and how its light is found: the part of a request that `plan` and `render` share.
pub struct PictureRequest {
    /// Camera of the scene, and size of the picture.
    pub camera: CameraRequest,
    /// The method and its settings.
    pub settings: SettingsRequest,
}

/// A render that the user asks for.
pub struct Request {
    /// The scene file and how it is read.
    pub scene: SceneRequest,
    /// The picture: camera, size and method.
    pub picture: PictureRequest,
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

impl Request {
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
