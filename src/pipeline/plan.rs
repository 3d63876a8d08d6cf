//! The plan of a render, with what a pilot has measured.

use crate::choose::{Choice, PilotResult};
use crate::plan::switch::Removed;
use crate::plan::{self, Plan, Switches};
use crate::render::Method;
use crate::scene::View;

/// What decides what a plan says.
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    /// What auto has chosen.
    pub choice: Option<&'a Choice>,
    /// Longest light path in segments.
    pub max_depth: Option<u32>,
    /// Effects that are switched.
    pub switches: Switches,
}

/// The plan of a render by a method, of a scene that was built without what is `removed`.
pub fn plan(asked: &Asked<'_>, method: Method, View { scene, camera }: View<'_>, removed: &Removed) -> Plan {
    let Asked { choice, max_depth, switches } = *asked;
    let method = choice.map_or(method, |choice| choice.candidate.method);
    let because = choice.map_or("asked for".into(), why);
    let search = choice.map_or(method.search(), |choice| choice.settings.search());
    let told = plan::PlanRequest { method: method.name(), because: &because, search, max_depth, switches, removed };
    let mut plan = Plan::new(scene, camera, &told);
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

/// Why auto has chosen what it has.
pub fn why(choice: &Choice) -> String {
    let because = choice.reason.map(|because| format!(", for {because}")).unwrap_or_default();
    let Some(trial) = choice.chosen_pilot() else { return format!("auto: {}{because}", choice.candidate.name()) };
    let mut others: Vec<&PilotResult> =
        choice.pilots.iter().filter(|other| other.candidate != trial.candidate).collect();
    others.sort_by(|a, b| a.squared_error.total_cmp(&b.squared_error));
    let error = |trial: &PilotResult| match trial.squared_error {
        squared if squared.is_infinite() => "nothing seen".into(),
        // Below what the pilot's own noise can tell.
        squared if squared == f64::MIN_POSITIVE => "too little to tell".into(),
        _ => percent(trial.error()),
    };
    let others: Vec<String> =
        others.iter().map(|other| format!("{} {}", other.candidate.name(), error(other))).collect();
    format!(
        "auto: {}, whose finished picture is expected to have an error of {} ({})",
        trial.candidate.name(),
        error(trial),
        others.join("; ")
    )
}

/// A share for people: two digits, `%` included.
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
