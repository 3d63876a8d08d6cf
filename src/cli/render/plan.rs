//! The plan of a render: from the options to what the library plans, and its warnings told.

use super::job::{BandwidthChoice, Indirect, Job, Method};
use crate::cli::progress::percent;
use crate::cli::say;
use caustique::camera::Camera;
use caustique::error::{Error, Kind, Result};
use caustique::estimator::bandwidth::LEAST_ASKED;
use caustique::plan::switch::Removed;
use caustique::plan::{Asked, Plan, Switches};
use caustique::render;
use caustique::render::auto::{Choice, Trial};
use caustique::scene::Scene;
use std::path::Path;

/// What decides what a plan says.
#[derive(Clone, Copy)]
pub struct Wishes<'a> {
    /// `--method`.
    pub method: Method,
    /// What auto has chosen.
    pub choice: Option<&'a Choice>,
    /// `--max-depth`.
    pub max_depth: Option<u32>,
    /// `--effects`.
    pub switches: Switches,
}

impl<'a> Wishes<'a> {
    /// Those of a render.
    pub fn of(args: &Job, choice: Option<&'a Choice>) -> Wishes<'a> {
        Wishes { method: args.method, choice, max_depth: args.max_depth, switches: args.scene.switches() }
    }
}

/// The plan of a render of a scene that was built without what is `removed`.
pub fn plan(wishes: &Wishes, scene: &Scene, camera: &Camera, removed: &Removed) -> Plan {
    let method = wishes.choice.map_or(wishes.method.chosen(), |choice| choice.way.method);
    let because = wishes.choice.map_or("asked for".into(), why);
    let (max_depth, switches) = (wishes.max_depth, wishes.switches);
    let search = wishes.choice.map_or(method.search(), |choice| choice.settings.search());
    let asked = Asked { method: method.name(), because: &because, search, max_depth, switches, removed };
    let mut plan = Plan::new(scene, camera, &asked);
    for weight in wishes.choice.iter().flat_map(|choice| &choice.weights) {
        let effect = &mut plan.effects[weight.effect as usize];
        if effect.present {
            (effect.energy, effect.error_if_off) = (weight.energy, weight.error_if_off);
            effect.seconds_per_iteration = weight.saved;
            let whole = wishes.choice.and_then(Choice::trial).map(|trial| trial.seconds_per_iteration);
            let simulated = effect.simulated;
            effect.time = weight.saved.filter(|_| simulated).zip(whole).map(|(saved, whole)| (saved / whole).min(1.0));
        }
    }
    plan
}

/// Why auto has chosen what it has.
pub fn why(choice: &Choice) -> String {
    let because = choice.because.map(|because| format!(", for {because}")).unwrap_or_default();
    let Some(trial) = choice.trial() else { return format!("auto: {}{because}", choice.way.name()) };
    let mut others: Vec<&Trial> = choice.trials.iter().filter(|other| other.way != trial.way).collect();
    others.sort_by(|a, b| a.squared_error.total_cmp(&b.squared_error));
    let error = |trial: &Trial| match trial.squared_error {
        squared if squared.is_infinite() => "nothing seen".into(),
        // Below what the pilot's own noise can tell.
        squared if squared == f64::MIN_POSITIVE => "too little to tell".into(),
        _ => percent(trial.error()),
    };
    let others: Vec<String> = others.iter().map(|other| format!("{} {}", other.way.name(), error(other))).collect();
    format!(
        "auto: {}, whose finished picture is expected to have an error of {} ({})",
        trial.way.name(),
        error(trial),
        others.join("; ")
    )
}

/// Whether the method can do without what media scatter, or finds it.
///
/// # Errors
/// Media scatter, and the method gathers photons on surfaces only, or photons of caustics alone.
pub fn check_media(job: &Job, scene: &Scene) -> Result<()> {
    let method = job.method.chosen();
    let (option, hint) = match method {
        _ if !scene.survey.scattering => return Ok(()),
        render::Method::Pm | render::Method::Bpm => {
            (format!("--method {}", method.name()), "choose --method sppm, cppm, vcm, bdpt or path")
        }
        _ if job.indirect == Some(Indirect::Paths) => ("--indirect paths".into(), "leave --indirect paths out"),
        _ => return Ok(()),
    };
    let cause = format!("{option} does not render media that scatter light");
    Err(Error::new(Kind::Usage, job.scene.path.display(), cause).hint(hint))
}

/// Whether photons can be found within the bandwidth that was asked for.
///
/// # Errors
/// It is smaller than positions in this scene can be told apart.
pub fn check_bandwidth(job: &Job, scene: &Scene) -> Result<()> {
    let least = f64::from(LEAST_ASKED * scene.lights.sky().radius);
    match job.initial_bandwidth {
        Some(BandwidthChoice::Length(asked)) if asked < least => {
            let cause = format!(
                "--initial-bandwidth {asked}: in a scene of radius {:.3} single precision does not tell such lengths \
                 apart",
                scene.lights.sky().radius
            );
            let error = Error::new(Kind::Usage, job.scene.path.display(), cause);
            Err(error.hint(format!("ask for {least:.1e} at least, or leave --initial-bandwidth out")))
        }
        _ => Ok(()),
    }
}

/// Prints what the plan warns of.
pub fn tell(scene: &Path, warnings: &[String]) {
    for warning in warnings {
        say(&format!("warning: {}: {warning}", scene.display()));
    }
}
