//! What a render leaves in its file: layers, and the account in the header.

use super::history::StopReason;
use super::result::Rendered;
use crate::error::Result;
use crate::film::{LayerSet, output};
use crate::render::pass::PhotonCounts;
use crate::render::settings::Settings;
use crate::scene::{Scene, Survey};
use serde_json::{Map, Value, json};

/// Which layers a render of a scene with these settings has.
pub fn shape(settings: &Settings, scene: &Scene) -> output::Shape {
    shape_of(settings, &scene.survey, &scene.lights.groups().names)
}

/// The same of any scene with such a survey and groups of lights.
pub fn shape_of(settings: &Settings, survey: &Survey, groups: &[String]) -> output::Shape {
    output::Shape {
        levels: settings.levels.count,
        compared: settings.compared_levels(),
        own: settings.levels.own(),
        kinds: settings.kinds(survey),
        environment: survey.environment,
        classes: settings.classes,
        volume: survey.scattering,
        volume_photons: survey.scattering && settings.method.gathers(),
        groups: if settings.method.has_techniques() { groups.to_vec() } else { Vec::new() },
    }
}

impl Rendered {
    /// The layers that are `wanted` by name, cryptomattes excepted.
    ///
    /// # Errors
    /// None for a render of ours: its pixels are as many as its size says.
    pub fn layers(&self, shape: &output::Shape, wanted: impl Fn(&str) -> bool) -> Result<LayerSet> {
        output::layers((self.width, self.height), &self.pixels, &self.bandwidths, shape, wanted)
    }

    /// The header's object: what was done, how long it took and how well it came out. Callers add what only they know:
    /// arguments, warnings, the combiner, the peak of memory. `threads` is `None` for a reproducible file, which has no
    /// clocks, no memory and no threads in it.
    pub fn account(&self, threads: Option<usize>) -> Map<String, Value> {
        let shard = self.settings.shard;
        let mut account = Map::new();
        let mut put = |key: &str, value: Value| account.insert(key.into(), value);
        put("version", env!("CARGO_PKG_VERSION").into());
        put("method", self.settings.method.name().into());
        put("seed", self.settings.seed.into());
        put("iterations", self.iterations.into());
        put("light_paths", self.light_paths.into());
        put("shard", json!({"index": shard.index, "count": shard.count}));
        if self.settings.method.has_one_map() {
            put("map", json!({"photons": self.photons, "full": self.map_is_full()}));
        }
        put("levels", self.settings.levels.count.into());
        put("stopped", stop_name(self.stop).into());
        put("error", self.relative_error().into());
        put("error_of", json!(self.settings.error_coverage()));
        put("variance_known", (self.iterations >= 2).into());
        let rejections = self.rejections();
        put("rejected", rejections.rejected().into());
        put("rejected_by", rejections.header().into());
        let history = self.history.iter().map(|moment| {
            let mut entry = json!({
                "iterations": moment.iterations, "light_paths": moment.light_paths,
                "error": moment.estimate.map(|estimate| estimate.root()),
                "variance": moment.estimate.map(|estimate| estimate.variance),
            });
            if threads.is_some() {
                entry["seconds"] = moment.seconds.into();
                entry["cpu_seconds"] = moment.cpu_seconds.into();
            }
            entry
        });
        put("history", history.collect());
        if self.settings.method.has_bandwidths() {
            let unseen = self.unseen();
            let of_kind = |kind: usize| {
                let PhotonCounts { stored, gathered } = self.photon_record.counts;
                json!({"stored": stored[kind], "gathered": gathered[kind]})
            };
            let photons = json!({"indirect": of_kind(0), "caustic": of_kind(1), "error": unseen.squared.sqrt()});
            put("unseen", photons);
        }
        if let Some(threads) = threads {
            put("seconds", self.seconds.into());
            put("phases", json!(self.phases));
            put("threads", threads.into());
        }
        account
    }
}

/// Why a render stopped, in a word.
pub fn stop_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Iterations => "iterations",
        StopReason::Time => "time",
        StopReason::Error => "error",
        StopReason::Interrupted => "interrupted",
    }
}
