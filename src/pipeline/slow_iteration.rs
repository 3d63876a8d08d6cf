//! Warnings before and after a render whose time limit is too short for one iteration.

use super::request::Saving;
use crate::camera::Camera;
use crate::choose::{pilot_settings, window_cost_ratio};
use crate::error::Error;
use crate::render::{RenderInput, Session, Settings};
use crate::scene::View;
use crate::transport::CUT_INTERVAL;

/// Largest number of pixels of the picture by which an iteration is timed.
const MAX_PIXELS: f64 = 64.0 * 64.0;
/// Largest size of that picture, as a share of the render's pixels.
const MAX_SHARE: f64 = 1.0 / 64.0;
/// Ratio of the estimated time of an iteration to the time limit above which a warning is given: the estimate is rough.
const WARNING_RATIO: f64 = 1.25;
/// Share of the time limit after which the timed iteration is abandoned.
const MAX_TIMED_SHARE: f64 = 0.1;
/// Shortest estimated iteration that a warning is given for (seconds).
const MIN_SECONDS: f64 = 1.0;

/// Returns a warning if one iteration is likely to take longer than the render may; `None` otherwise.
pub(super) fn warning(view: View<'_>, settings: &Settings) -> Option<String> {
    let time = settings.time?;
    let seconds = estimate_seconds(view, settings, time)?;
    let remedy = remedy(settings);
    (seconds > (WARNING_RATIO * time).max(MIN_SECONDS)).then(|| {
        format!("one iteration takes about {seconds:.0} s, longer than the {time:.0} s there are to render: the picture comes late and has one iteration (ask for {remedy})")
    })
}

/// Options that shorten an iteration.
fn remedy(settings: &Settings) -> &'static str {
    match settings.method {
        method if method.takes_photon_count() => "fewer --photons, a smaller --width, --max-depth 64 or more --time",
        method if method.takes_counts() => "fewer --light-paths, a smaller --width, --max-depth 64 or more --time",
        _ => "a smaller --width, --max-depth 64 or more --time",
    }
}

/// Returns a warning if the time limit has cut paths of the first iteration; `None` otherwise. `saving`: the checkpoint
/// that the user asks for.
pub(super) fn warning_of_cut(settings: &Settings, saving: Option<&Saving>) -> Option<String> {
    let checkpoint = if saving.is_some_and(|saving| saving.keep) { "; no checkpoint is saved" } else { "" };
    settings.stop.has_cut_paths().then(|| {
        format!(
            "{}: the picture lacks the light of longer paths and is too dark{checkpoint} (ask for {})",
            cause_of_cut(settings),
            remedy(settings)
        )
    })
}

/// The error of a shard whose paths the time limit has cut.
pub(super) fn error(settings: &Settings) -> Error {
    let cause = format!("{}, so there is no part of the picture", cause_of_cut(settings));
    Error::usage(cause).hint(format!("use {}", remedy(settings)))
}

fn cause_of_cut(settings: &Settings) -> String {
    let name = settings.method.name();
    format!("--time ended in the first iteration of --method {name}, and paths were cut after {CUT_INTERVAL} segments")
}

/// Seconds that an iteration takes, estimated by one iteration of a smaller picture with equal work per pixel. The
/// smaller picture shows the whole film; a factor accounts for light paths outside the film.
fn estimate_seconds(View { scene, camera }: View<'_>, settings: &Settings, time: f64) -> Option<f64> {
    let count = |(width, height): (u32, u32)| f64::from(width) * f64::from(height);
    let pixels = |camera: &Camera| count(camera.size());
    let walked = camera.sizes().map(count)[usize::from(settings.method.walks_whole_picture())];
    let pilot = camera.downscale((MAX_PIXELS.min(MAX_SHARE * walked) / pixels(camera)).sqrt());
    let share = pixels(&pilot) / pixels(camera);
    let factor = window_cost_ratio(scene, camera, settings);
    let settings = Settings { guided: false, ..pilot_settings(settings, share) };
    let stage = RenderInput::new(scene, &pilot, &settings);
    let mut session = Session::new(&stage);
    let before = session.spent().seconds;
    // An abandoned iteration takes longer than it was given.
    session.step_within(Some(MAX_TIMED_SHARE * time));
    (!settings.stop.requested()).then(|| factor * (session.spent().seconds - before) / share)
}
