//! The plan of a render: the effects that the scene calls for and why, and the techniques that simulate them.
//!
//! `presence` lists the effects of a scene, `search` the effects that a method finds, [`Search::owner`] the technique
//! that carries the light of a path class, and [`switch`] removes effects that the user switches off. The plan does not
//! trace light paths; a pilot render measures the shares and costs in [`EffectPlan`].

pub(crate) mod names;
mod presence;
mod search;
pub mod switch;

pub use presence::Presence;
pub use search::{Owner, Search};

use crate::camera::Camera;
use crate::path_class::{Effect, Switches};
use crate::scene::Scene;
use serde::Serialize;
use switch::Removed;

/// An effect in a plan: whether it is in the scene, whether the render simulates it, and its share of light and cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectPlan {
    /// The effect of light transport, such as *caustic*.
    #[serde(rename = "name")]
    pub effect: Effect,
    /// Whether the scene calls for the effect: some material, light or the like needs it.
    pub present: bool,
    /// Whether the render simulates the effect.
    pub simulated: bool,
    /// Names of the materials, lights and so on that call for the effect; empty if none does.
    pub because: Vec<String>,
    /// The techniques that carry the light of the effect, in words; `None` if it is not simulated.
    pub by: Option<&'static str>,
    /// Share of the picture's light that the effect brings, 0 to 1; `None` if no pilot (a small test render) has
    /// measured it.
    pub energy: Option<f64>,
    /// Core-seconds per iteration that a render would save without the effect; `None` if no pilot (a small test render)
    /// has counted them.
    pub seconds_per_iteration: Option<f64>,
    /// Share of an iteration's core-seconds that a render would save without the effect, 0 to 1; `None` as
    /// `seconds_per_iteration`.
    pub time: Option<f64>,
    /// Relative error (the root of relMSE) that a picture has without the effect; `None` if no pilot has measured it.
    pub error_if_off: Option<f64>,
}

/// The plan of a render: the effects that it simulates or leaves out, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Path of the scene file, as text.
    pub scene: String,
    /// Name of the rendering method.
    pub method: String,
    /// Why the method was chosen, in words.
    pub because: String,
    /// One entry for each effect, in the order of [`Effect::ALL`].
    pub effects: Vec<EffectPlan>,
    /// Upper bound on the relative error (the root of relMSE) of the picture that is due to effects left out: 0 if all
    /// effects are simulated. `None` if some are left out, whose light has no bound ([`EffectPlan::error_if_off`] is a
    /// measurement).
    pub left_out_at_most: Option<f64>,
    /// Missing effects and likely mistakes in the scene, each with a remedy. Warnings from reading and building the
    /// scene are in [`Scene::warnings`].
    pub warnings: Vec<String>,
    /// Explanation to print if the whole picture turns out black; empty if a warning of the scene already explains it.
    #[serde(skip)]
    pub reason_if_black: String,
}

/// The render for which a plan is made, except its scene and camera.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// Name of the rendering method.
    pub method: &'a str,
    /// Why the method was chosen, in words.
    pub because: &'a str,
    /// Combination of techniques by which the method finds light.
    pub search: Search,
    /// Maximum length of a light path in segments; `None` is no limit.
    pub max_depth: Option<u32>,
    /// Effects that the user switches off or expects.
    pub switches: Switches,
    /// Effects that were removed from the scene because of `switches`, with what called for them.
    pub removed: &'a Removed,
}

impl Plan {
    /// Plans a render of a scene seen by a camera.
    pub fn new(scene: &Scene, camera: &Camera, request: &PlanRequest) -> Plan {
        let presence = Presence::of(scene, camera);
        let finds = |effect| request.search.finds(effect, &scene.survey);
        let plan = |effect: Effect| {
            let removed = request.removed.because(effect);
            let mut because = if removed.is_empty() { presence.because(effect) } else { removed }.to_vec();
            let present = !because.is_empty();
            let deep = request.max_depth.is_none_or(|most| most >= min_depth(effect, scene));
            let simulated = present && deep && finds(effect) && !request.switches.off.has(effect);
            let limit = request.search.limit(effect, scene).filter(|_| simulated);
            because.extend(limit.map(String::from));
            EffectPlan {
                effect,
                present,
                simulated,
                because,
                by: simulated.then(|| request.search.carrier(effect, scene)),
                energy: None,
                seconds_per_iteration: None,
                time: None,
                error_if_off: None,
            }
        };
        let effects: Vec<EffectPlan> = Effect::ALL.into_iter().map(plan).collect();
        let complete = request.max_depth.is_none() && effects.iter().all(|effect| effect.simulated || !effect.present);
        let mut warnings = Vec::new();
        for EffectPlan { effect, because, present, .. } in &effects {
            let (name, off) = (effect.name(), request.switches.off.has(*effect));
            if off && *present {
                warnings.push(format!("--effects -{name}: left out, though called for by {}", because.join("; ")));
            } else if *present && !finds(*effect) && request.max_depth.is_none() {
                warnings.push(format!("--method {} does not find all light of the effect '{name}'", request.method));
            } else if request.switches.on.has(*effect) && !present {
                warnings.push(format!("--effects +{name}: nothing in the scene calls for it"));
            }
        }
        warnings.extend(request.max_depth.map(|most| depth_warning(most, &effects, scene)));
        Plan {
            reason_if_black: String::new(),
            scene: scene.source.display().to_string(),
            method: request.method.into(),
            because: request.because.into(),
            effects,
            left_out_at_most: complete.then_some(0.0),
            warnings,
        }
    }

    /// The plan's entry for an effect.
    pub fn effect(&self, effect: Effect) -> &EffectPlan {
        &self.effects[effect as usize]
    }
}

/// The warning that names the effects which a depth limit of `most` segments leaves out.
fn depth_warning(most: u32, effects: &[EffectPlan], scene: &Scene) -> String {
    let cut = effects.iter().filter(|plan| plan.present).map(|plan| (plan.effect, min_depth(plan.effect, scene)));
    let (names, needed): (Vec<&str>, Vec<u32>) =
        cut.filter(|(_, needed)| *needed > most).map(|(effect, needed)| (effect.name(), needed)).unzip();
    match needed.iter().min() {
        None => format!("--max-depth {most}: light of longer paths is left out"),
        Some(needed) => {
            format!("--max-depth {most}: left out are {}, whose paths have {needed} segments or more", names.join(", "))
        }
    }
}

/// Number of segments of the shortest path, from the light to the camera, that shows an effect.
fn min_depth(effect: Effect, scene: &Scene) -> u32 {
    match effect {
        Effect::Direct | Effect::Glossy => 2,
        Effect::Indirect | Effect::Caustic => 3,
        Effect::Sds => 4,
        Effect::Volume if scene.survey.scattering => 2,
        _ => 1,
    }
}
