//! The fourth step: the plan of a render, with the figures that the pilots have estimated.

use super::check::check_picture;
use super::choose::{Chosen, choose};
use super::layers;
use super::learn::Learnt;
use super::load::Loaded;
use super::memory::MemoryCheck;
use super::request::{PictureRequest, Request};
use crate::advice;
use crate::camera::Camera;
use crate::choose::{Choice, PilotResult};
use crate::error::Result;
use crate::film::Selection;
use crate::finish::DenoiserChoice;
use crate::path_class::Switches;
use crate::plan::switch::Removed;
use crate::plan::{self, Plan};
use crate::render::output::layer_shape;
use crate::render::{Settings, SettingsRequest};
use crate::scene::{Scene, View};
use crate::stop::Stop;
use std::path::Path;

/// Method and switches of a render, the input of its plan besides the scene.
#[derive(Clone, Copy)]
pub struct PlanInput<'a> {
    /// The settings with the method, and how they were chosen.
    pub chosen: &'a Chosen,
    /// Longest light path in segments; `None`: no limit.
    pub max_depth: Option<u32>,
    /// Effects, such as dispersion, that the user has switched on or off.
    pub switches: Switches,
}

/// Plans which effects a render simulates, for a scene that was built without the effects in `removed`.
pub fn plan(PlanInput { chosen, max_depth, switches }: PlanInput<'_>, view: View<'_>, removed: &Removed) -> Plan {
    let choice = chosen.choice.as_ref();
    let method = chosen.settings.method;
    let because = choice.map_or("asked for".into(), reason);
    let search = choice.map_or(method.search(), |choice| choice.settings.search());
    let request = plan::PlanRequest { method: method.name(), because: &because, search, max_depth, switches, removed };
    let mut plan = Plan::new(view.scene, view.camera, &request);
    advice::add(&mut plan, view.scene, view.camera, &request);
    for weight in choice.iter().flat_map(|choice| &choice.weights) {
        let effect = &mut plan.effects[weight.effect as usize];
        if effect.present {
            (effect.energy, effect.error_if_off) = (weight.energy, weight.error_if_off);
            effect.seconds_per_iteration = weight.saved;
            let whole = choice.map(|choice| choice.seconds_per_iteration);
            let simulated = effect.simulated;
            effect.time = weight.saved.filter(|_| simulated).zip(whole).map(|(saved, whole)| (saved / whole).min(1.0));
        }
    }
    plan
}

/// A picture with its method and its plan (effects and warnings), not rendered.
pub struct PlannedPicture {
    /// The camera, with the size of the picture.
    pub camera: Camera,
    /// The settings of the picture, and how they were chosen.
    pub chosen: Chosen,
    /// The plan (effects and warnings), with the warnings of the scene in front.
    pub plan: Plan,
    /// The scene with what was learnt about its light; `None` if nothing was.
    learnt: Option<Scene>,
}

impl PlannedPicture {
    /// The picture's view of the scene that was loaded.
    pub fn view<'a>(&'a self, loaded: &'a Loaded) -> View<'a> {
        View::new(self.learnt.as_ref().unwrap_or(&loaded.scene), &self.camera)
    }
}

/// Checks, chooses and plans a picture as a render does, without rendering it. `path`: where the scene was read from.
///
/// # Errors
/// Errors of [`check_picture`].
pub fn plan_picture(picture: &PictureRequest, path: &Path, loaded: &Loaded, stop: &Stop) -> Result<PlannedPicture> {
    let Loaded { scene, removed, .. } = loaded;
    let checked = check_picture(picture, path, scene)?;
    let learning = Learnt::new(View::new(scene, &checked.camera), &checked.settings, stop);
    let learnt = scene.with_learnt(&learning.light);
    let view = View::new(learnt.as_ref().unwrap_or(scene), &checked.camera);
    let finish = Some(DenoiserChoice::default());
    let memory = MemoryCheck { view, method: "auto", layers: &Selection::All, finish, limit: None };
    let chosen = choose(&picture.settings, checked.settings, view, memory.admits(), stop);
    let chosen = Chosen { learning: learning.spent, ..chosen };
    let SettingsRequest { max_depth, switches, .. } = picture.settings;
    let mut plan = plan(PlanInput { chosen: &chosen, max_depth, switches }, view, removed);
    plan.warnings.splice(0..0, scene.warnings.iter().cloned());
    Ok(PlannedPicture { camera: checked.camera, chosen, plan, learnt })
}

/// The settings of a render, which fit into memory, and its plan (effects and warnings).
pub(super) struct Planned {
    /// The settings, which may have fewer light paths than requested.
    pub settings: Settings,
    /// The plan (effects and warnings), without the warnings of the scene.
    pub plan: Plan,
}

/// Fits the settings of a render into memory and plans its effects.
///
/// # Errors
/// The render does not fit.
pub(super) fn plan_render(request: &Request, chosen: &Chosen, view: View<'_>, removed: &Removed) -> Result<Planned> {
    let (method, finishes) = (chosen.settings.method.name(), request.finish.is_some());
    let finish = request.finish.as_ref().map(|finish| finish.denoiser);
    let memory = MemoryCheck { view, method, layers: &request.layers, finish, limit: request.memory };
    let (settings, less_memory) = memory.fit(chosen.settings.clone())?;
    let SettingsRequest { max_depth, switches, .. } = request.picture.settings;
    let mut plan = plan(PlanInput { chosen, max_depth, switches }, view, removed);
    let shape = layer_shape(&settings, view.scene);
    let black = layers::black(&request.layers, &shape, finishes);
    plan.warnings.extend(less_memory);
    plan.warnings.extend(warn_ungrouped_lights(view.scene, &settings));
    plan.warnings.extend(black.iter().map(|name| format!("layer \"{name}\" is black: the render has no such light")));
    Ok(Planned { settings, plan })
}

/// Returns a warning if the scene has light groups and the method does not separate the light of groups; `None`
/// otherwise.
fn warn_ungrouped_lights(scene: &Scene, settings: &Settings) -> Option<String> {
    let groups = scene.lights.groups().names.len();
    let lost = groups > 0 && layer_shape(settings, scene).groups.is_empty();
    let name = settings.method.name();
    lost.then(|| format!("its {groups} light groups have no layers: --method {name} does not tell lights apart (auto, path, light, bdpt, bpm and vcm do)"))
}

/// The reason for the choice of `auto`, as a sentence for people.
pub fn reason(choice: &Choice) -> String {
    let because = choice.reason.map(|because| format!(", for {because}")).unwrap_or_default();
    let Some(trial) = choice.chosen_pilot() else { return format!("auto: {}{because}", choice.candidate.name()) };
    let mut others: Vec<&PilotResult> =
        choice.pilots.iter().filter(|other| other.candidate != trial.candidate).collect();
    others.sort_by(|a, b| a.squared_error.total_cmp(&b.squared_error));
    let error = |trial: &PilotResult| match trial.squared_error {
        squared if squared.is_infinite() => "light is missing".into(),
        // Smaller than the noise of the pilot resolves.
        squared if squared == f64::MIN_POSITIVE => "too little to tell".into(),
        _ => percent(trial.error()),
    };
    let others: Vec<String> =
        others.iter().map(|other| format!("{} {}", other.candidate.name(), error(other))).collect();
    format!(
        "auto: {}, whose noise before the finish is expected to be {} ({})",
        trial.candidate.name(),
        error(trial),
        others.join("; ")
    )
}

/// A share as a percentage with two significant digits, such as `3.1 %`.
pub fn percent(x: f64) -> String {
    let p = 100.0 * x;
    if p >= 10.0 {
        format!("{p:.0} %")
    } else if p >= 1.0 {
        format!("{p:.1} %")
    } else {
        format!("{p:.2} %")
    }
}
