//! The plan of a render: which effects the scene calls for, because of what, which are simulated and how, and what
//! looks like a mistake.
//!
//! [`PathClass`] is the class of a light path, and [`Search::owner`] says who brings its light. `presence` says what
//! the scene calls for, `search` what a method finds of it, [`switch`] leaves out what the user does without,
//! `diagnosis` says why something may be missing that was hoped for. None of it traces a path: what effects weigh and
//! cost is measured by a pilot, which fills the figures of [`EffectPlan`].

mod class;
mod diagnosis;
mod effect;
mod names;
mod presence;
mod search;
pub mod switch;

pub use class::{CameraSuffix, ClassSet, Event, LightPrefix, Part, PathClass, classes_in};
pub use effect::{Effect, EffectSet, Switches};
pub use presence::Presence;
pub use search::{Owner, Search};

use crate::camera::Camera;
use crate::scene::Scene;
use serde::Serialize;
use switch::Removed;

/// One effect of a plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectPlan {
    /// Which one.
    #[serde(rename = "name")]
    pub effect: Effect,
    /// The scene calls for it.
    pub present: bool,
    /// It is simulated.
    pub simulated: bool,
    /// What calls for it, by name.
    pub because: Vec<String>,
    /// What brings it into the picture, where it is simulated.
    pub by: Option<&'static str>,
    /// Its share of the picture's light, 0 to 1; `None` where nothing has measured it.
    pub energy: Option<f64>,
    /// Core-seconds that an iteration without it would save, where that is counted.
    pub seconds_per_iteration: Option<f64>,
    /// The same over what an iteration takes, 0 to 1.
    pub time: Option<f64>,
    /// Relative error (the root of relMSE) of the picture without it.
    pub error_if_off: Option<f64>,
}

/// What a render does and leaves, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// The scene's file.
    pub scene: String,
    /// How light is found.
    pub method: String,
    /// Why that way.
    pub because: String,
    /// All effects, in their order.
    pub effects: Vec<EffectPlan>,
    /// Bound on the relative error (the root of relMSE) by light that the scene calls for and is left out: none where
    /// some is, for nothing bounds that ([`EffectPlan::error_if_off`] tells what a pilot has seen of it).
    pub left_out_at_most: Option<f64>,
    /// What is missing from the picture and what may be a mistake in the scene, each with a remedy. What reading the
    /// scene has found is in [`Scene::warnings`].
    pub warnings: Vec<String>,
    /// Why the picture is black, should it be; empty where that is told already.
    #[serde(skip)]
    pub reason_if_black: String,
}

/// What a plan is made for.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// The method's name.
    pub method: &'a str,
    /// Why it was chosen.
    pub because: &'a str,
    /// How it looks for light.
    pub search: Search,
    /// Longest light path in segments.
    pub max_depth: Option<u32>,
    /// Effects asked for by name.
    pub switches: Switches,
    /// What the scene was built without, because of them.
    pub removed: &'a Removed,
}

impl Plan {
    /// Plans a render of a scene seen by a camera.
    pub fn new(scene: &Scene, camera: &Camera, asked: &PlanRequest) -> Plan {
        let presence = Presence::of(scene, camera);
        let finds = |effect| asked.search.finds(effect, &scene.survey);
        let plan = |effect: Effect| {
            let removed = asked.removed.because(effect);
            let because = if removed.is_empty() { presence.because(effect) } else { removed }.to_vec();
            let present = !because.is_empty();
            let deep = asked.max_depth.is_none_or(|most| most >= shortest(effect, scene));
            let simulated = present && deep && finds(effect) && !asked.switches.off.has(effect);
            EffectPlan {
                effect,
                present,
                simulated,
                because,
                by: simulated.then(|| asked.search.carrier(effect, scene)),
                energy: None,
                seconds_per_iteration: None,
                time: None,
                error_if_off: None,
            }
        };
        let effects: Vec<EffectPlan> = Effect::ALL.into_iter().map(plan).collect();
        let complete = asked.max_depth.is_none() && effects.iter().all(|effect| effect.simulated || !effect.present);
        let mut warnings = Vec::new();
        for EffectPlan { effect, because, present, .. } in &effects {
            let (name, off) = (effect.name(), asked.switches.off.has(*effect));
            if off && *present {
                warnings.push(format!("--effects -{name}: left out, though called for by {}", because.join("; ")));
            } else if *present && !finds(*effect) && asked.max_depth.is_none() {
                warnings.push(format!("--method {} does not find all light of the effect '{name}'", asked.method));
            } else if asked.switches.on.has(*effect) && !present {
                warnings.push(format!("--effects +{name}: nothing in the scene calls for it"));
            }
        }
        warnings.extend(asked.max_depth.map(|most| depth_warning(most, &effects, scene)));
        warnings.extend(diagnosis::warnings(scene, camera, asked));
        let reason_if_black = diagnosis::black::reason(scene, camera, &effects, asked, !warnings.is_empty());
        Plan {
            reason_if_black,
            scene: scene.source.display().to_string(),
            method: asked.method.into(),
            because: asked.because.into(),
            effects,
            left_out_at_most: complete.then_some(0.0),
            warnings,
        }
    }

    /// One of the effects.
    pub fn effect(&self, effect: Effect) -> &EffectPlan {
        &self.effects[effect as usize]
    }
}

/// What a limit of depth leaves out.
fn depth_warning(most: u32, effects: &[EffectPlan], scene: &Scene) -> String {
    let cut = effects.iter().filter(|plan| plan.present).map(|plan| (plan.effect, shortest(plan.effect, scene)));
    let (names, needed): (Vec<&str>, Vec<u32>) =
        cut.filter(|(_, needed)| *needed > most).map(|(effect, needed)| (effect.name(), needed)).unzip();
    match needed.iter().min() {
        None => format!("--max-depth {most}: light of longer paths is left out"),
        Some(needed) => {
            format!("--max-depth {most}: left out are {}, whose paths have {needed} segments or more", names.join(", "))
        }
    }
}

/// Segments of the shortest path that shows an effect; a depth limit cuts longer ones.
fn shortest(effect: Effect, scene: &Scene) -> u32 {
    match effect {
        Effect::Direct | Effect::Glossy => 2,
        Effect::Indirect | Effect::Caustic => 3,
        Effect::Sds => 4,
        Effect::Volume if scene.survey.scattering => 2,
        _ => 1,
    }
}
