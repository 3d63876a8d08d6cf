//! The third step: the method. `auto` compares candidates.

use super::check::follows_camera_paths;
use super::layers;
use super::memory::MemoryCheck;
use super::observer::{Event, Observer, Phase, during};
use super::request::Request;
use crate::choose::{self, Choice};
use crate::error::{Error, ErrorKind, Result};
use crate::render::output::layer_shape;
use crate::render::{Candidate, Settings, SettingsRequest, TimeSpent};
use crate::scene::View;
use crate::stop::Stop;

/// The settings of a render, and how its method was chosen.
pub struct Chosen {
    /// The settings of the render.
    pub settings: Settings,
    /// The candidate (method and settings) that `auto` has chosen, in this run or before the checkpoint; `None` if it
    /// has compared none.
    pub candidate: Option<Candidate>,
    /// The comparison of candidates by `auto` in this run. `None` if the user names the method, or the options leave
    /// nothing to compare.
    pub choice: Option<Choice>,
    /// Time to learn where light of the environment arrives, before the comparison.
    pub learning: TimeSpent,
}

impl Chosen {
    /// Wraps settings that were not chosen among candidates.
    pub fn named(settings: Settings) -> Chosen {
        Chosen { settings, candidate: None, choice: None, learning: TimeSpent::default() }
    }

    /// Time that was spent in this run before the render, to learn and to compare candidates.
    pub fn spent(&self) -> TimeSpent {
        let mut spent = self.choice.as_ref().map(|choice| choice.spent).unwrap_or_default();
        spent.add(self.learning);
        spent
    }
}

/// Settles the method: the one that the user names, or the candidate (method and settings) that `auto` finds best.
/// `checked`: the settings if nothing is compared. `accepts` rejects candidates by their settings. If `stop` is requested,
/// the comparison ends as soon as it can, and its result is not to be used.
pub fn choose(
    request: &SettingsRequest,
    checked: Settings,
    view: View<'_>,
    accepts: impl Fn(&Settings) -> bool,
    stop: &Stop,
) -> Chosen {
    if request.method.0.is_some() {
        return Chosen::named(checked);
    }
    let settings_of = |candidate| {
        let settings = request.for_candidate(candidate, view.camera.whole()[0]);
        settings.filter(|settings| accepts(settings) && follows_camera_paths(settings, view.scene))
    };
    match choose::choose(view, settings_of, stop) {
        Some(choice) => {
            let (settings, candidate) = (choice.settings.clone(), Some(choice.candidate));
            Chosen { candidate, choice: Some(choice), ..Chosen::named(settings) }
        }
        None => Chosen::named(checked),
    }
}

/// Settles the method of a render, among candidates whose pictures have the layers of the request.
///
/// # Errors
/// The user has stopped the render.
pub(super) fn choose_for_render(
    request: &Request,
    checked: Settings,
    view: View<'_>,
    observer: &mut dyn Observer,
) -> Result<Chosen> {
    let (layers, finishes) = (&request.layers, request.finish.is_some());
    let finish = request.finish.as_ref().map(|finish| finish.denoiser);
    let memory = MemoryCheck { view, method: "auto", layers, finish, limit: request.memory };
    let fits = memory.admits();
    let accepts =
        |of: &Settings| fits(of) && layers::check(layers, &layer_shape(of, view.scene), finishes, true).is_ok();
    let settings = &request.picture.settings;
    let chosen = if settings.method.0.is_none() {
        let stop = observer.stop();
        during(Phase::Choosing, observer, |_| choose(settings, checked, view, accepts, &stop))
    } else {
        Chosen::named(checked)
    };
    observer.event(Event::Chosen(chosen.choice.as_ref()));
    refuse_stop(observer)?;
    Ok(chosen)
}

/// The settings of a render that continues from a checkpoint, whose candidate `auto` has chosen before.
pub(super) fn chosen_before(
    request: &SettingsRequest,
    candidate: Option<Candidate>,
    checked: Settings,
    view: View<'_>,
) -> Chosen {
    let candidate_of_auto = candidate.filter(|_| request.method.0.is_none());
    let settings = candidate_of_auto.and_then(|of| request.for_candidate(of, view.camera.whole()[0]));
    Chosen { candidate, ..Chosen::named(settings.unwrap_or(checked)) }
}

/// Fails if the user has stopped the render before its first iteration.
pub(super) fn refuse_stop(observer: &dyn Observer) -> Result<()> {
    match observer.stop().requested() {
        true => Err(Error::new(ErrorKind::Interrupted, "", "interrupted before the first iteration")),
        false => Ok(()),
    }
}
