//! Layers and header of the file that a render writes.

use super::history::{HistoryEntry, StopReason};
use super::rendered::Rendered;
use crate::error::Result;
use crate::film::{LayerSet, output};
use crate::photon::Kind;
use crate::render::pass::PhotonCounts;
use crate::render::settings::Settings;
use crate::scene::{Scene, Survey};
use serde_json::{Map, Value, json};

/// Layers that a render of a scene has with these settings.
pub fn layer_shape(settings: &Settings, scene: &Scene) -> output::Shape {
    let shape = layer_shape_of(settings, &scene.survey, &scene.lights.groups().names);
    if !scene.survey.catchers {
        return shape;
    }
    let instances = scene.shapes.instances.iter().zip(0..);
    output::Shape { catchers: instances.filter(|(of, _)| of.shadow_catcher).map(|(_, index)| index).collect(), ..shape }
}

/// Layers of a render with these settings, for a scene with the features in `survey` and light groups of these names.
pub fn layer_shape_of(settings: &Settings, survey: &Survey, groups: &[String]) -> output::Shape {
    output::Shape {
        levels: settings.levels.count,
        compared: settings.compared_levels(),
        own: settings.levels.picture_level(),
        merges: settings.merges_one_level(),
        kinds: settings.bandwidth_kinds(survey),
        environment: survey.environment,
        classes: settings.classes,
        volume: survey.scattering,
        volume_photons: survey.scattering && settings.method.gathers(),
        lobes: settings.lobes,
        catchers: Vec::new(),
        groups: if settings.method.has_techniques() { groups.to_vec() } else { Vec::new() },
    }
}

impl Rendered {
    /// Makes the layers of the render's EXR whose names are `wanted`, without cryptomattes.
    ///
    /// # Errors
    /// None for renders: the number of pixels fits the size of the picture.
    pub fn layers(&self, shape: &output::Shape, wanted: impl Fn(&str) -> bool) -> Result<LayerSet> {
        output::layers((self.width, self.height), &self.pixels, &self.bandwidths, shape, wanted)
    }

    /// JSON object of the EXR's header: settings, counts, time and estimated error of the render. The pipeline adds
    /// arguments, warnings, the finish and the peak of memory. `threads` is `None` for a reproducible file, whose
    /// header has no clocks, memory or threads.
    pub fn header(&self, threads: Option<usize>) -> Map<String, Value> {
        let Rendered { settings, stats, .. } = self;
        let mut header = Map::new();
        let mut put = |key: &str, value: Value| header.insert(key.into(), value);
        put("version", env!("CARGO_PKG_VERSION").into());
        put("method", settings.method.name().into());
        put("seed", settings.seed.into());
        put("iterations", stats.iterations.into());
        put("light_paths", stats.light_paths.into());
        put("shard", json!({"index": settings.shard.index, "count": settings.shard.count}));
        if settings.method.has_one_map() {
            put("map", json!({"photons": stats.photons, "full": self.map_is_full()}));
        }
        put("levels", settings.levels.count.into());
        put("stopped", stop_name(self.stop).into());
        put("error", self.error.relative().into());
        put("error_of", json!(settings.error_coverage()));
        put("variance_known", (stats.iterations >= 2).into());
        let rejections = self.rejections();
        put("rejected", rejections.rejected().into());
        put("rejected_by", rejections.header().into());
        put("history", stats.history.iter().map(|entry| history_header(entry, threads.is_some())).collect());
        if settings.method.has_bandwidths() {
            put("unseen", self.unseen_header());
        }
        if let Some(threads) = threads {
            put("seconds", stats.time.seconds.into());
            put("phases", json!(stats.phases));
            put("threads", threads.into());
        }
        header
    }

    /// Value of the header's key `unseen`: the numbers of photons that were stored and gathered, by kind of photon, and the
    /// relative error due to light that too few photons have carried.
    fn unseen_header(&self) -> Value {
        let PhotonCounts { stored, gathered } = self.stats.photon_record.counts;
        let counts = |kind: Kind| json!({"stored": stored[kind as usize], "gathered": gathered[kind as usize]});
        json!({
            "indirect": counts(Kind::Indirect),
            "caustic": counts(Kind::Caustic),
            "error": self.error.unseen.squared.sqrt(),
        })
    }
}

fn history_header(entry: &HistoryEntry, with_clocks: bool) -> Value {
    let mut value = json!({
        "iterations": entry.iterations, "light_paths": entry.light_paths,
        "error": entry.estimate.map(|estimate| estimate.root()),
        "variance": entry.estimate.map(|estimate| estimate.variance),
    });
    if with_clocks {
        value["seconds"] = entry.seconds.into();
        value["cpu_seconds"] = entry.cpu_seconds.into();
    }
    value
}

/// Name of a reason to stop in the key `stopped` of the EXR's header.
pub fn stop_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Iterations => "iterations",
        StopReason::Time => "time",
        StopReason::Error => "error",
        StopReason::Interrupted => "interrupted",
    }
}
