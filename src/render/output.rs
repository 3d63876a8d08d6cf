//! What a render leaves in its file: layers, and the account in the header.

use super::control::StopReason;
use super::method::Method;
use super::present::Present;
use super::result::Rendered;
use super::settings::Settings;
use crate::error::Result;
use crate::estimator::Pixel;
use crate::estimator::rule::{memoryless::radius2_factor, volume::radius_factor};
use crate::film::{LayerSet, output};
use crate::photon::ByKind;
use serde_json::{Map, Value, json};

/// What the layers of a render with these settings depend on after `iterations` of them.
pub fn shape(settings: &Settings, iterations: u64, present: Present) -> output::Shape {
    // Iterations count from 1; a shard renders every `count`-th.
    let last = settings.shard.index + iterations.saturating_sub(1) * settings.shard.count + 1;
    output::Shape {
        levels: settings.levels.count,
        compared: settings.compared_levels(),
        own: settings.levels.own(),
        kinds: settings.kinds(present),
        radius2_factor: radius2_factor(last, settings.alpha),
        environment: present.environment,
        classes: settings.classes,
        volume: present.volume,
        volume_radius_factor: (present.volume && settings.method.gathers())
            .then(|| radius_factor(last, settings.volume_alpha)),
    }
}

/// Layers of pixels; `radii` by kind of every pixel and level replace those that follow from the iteration, unless there are none.
pub(super) fn layers(
    size: (u32, u32),
    pixels: &[Pixel],
    radii: &ByKind<Vec<f32>>,
    shape: &output::Shape,
    wanted: impl Fn(&str) -> bool,
) -> Result<LayerSet> {
    let mut layers = output::layers(size, pixels, shape, wanted)?;
    for (kind, name) in output::radius_layers(shape.kinds) {
        let radii = &radii[kind as usize];
        for level in (0..shape.levels).filter(|_| !radii.is_empty()) {
            let name = format!("{name}{}", level + 1);
            let planes =
                layers.layers.iter_mut().filter(|layer| layer.name == name).flat_map(|layer| &mut layer.planes);
            for plane in planes {
                plane.values = radii.iter().skip(level).step_by(shape.levels).copied().collect();
            }
        }
    }
    Ok(layers)
}

impl Rendered {
    /// The layers that are `wanted` by name, cryptomattes excepted.
    ///
    /// # Errors
    /// None for a render of ours: its pixels are as many as its size says.
    pub fn layers(&self, present: Present, wanted: impl Fn(&str) -> bool) -> Result<LayerSet> {
        let shape = shape(&self.settings, self.iterations, present);
        layers((self.width, self.height), &self.pixels, &self.radii, &shape, wanted)
    }

    /// The header's object: what was done, how long it took and how well it came out. Callers add what only they know: arguments,
    /// warnings, the combiner, the peak of memory. `threads` is `None` for a reproducible file, which has no clocks, no memory and no threads in it.
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
        if self.settings.method == Method::Pm {
            put("map", json!({"photons": self.photons, "full": self.map_is_full()}));
        }
        put("levels", self.settings.levels.count.into());
        put("stopped", stop_name(self.stop).into());
        put("error", self.relative_error().into());
        put("error_of", json!(self.settings.told()));
        put("variance_known", (self.iterations >= 2).into());
        put("rejected", self.rejected().into());
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
