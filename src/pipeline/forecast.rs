//! A forecast of what a target error will cost: a pilot renders a small picture of the same view, with the same work per
//! pixel, for some seconds. The decay of the pilot's error is extrapolated to the render.

use super::finished_error::estimates_until;
use crate::camera::Camera;
use crate::choose::pilot_settings;
use crate::error::Result;
use crate::film::Size;
use crate::finish::{Finish, Quality, reads, reads_for_error};
use crate::render::{Accuracy, Candidate, Cost, MIN_ITERATIONS_FOR_ERROR, RenderInput, Session, Settings, TimeSpent};
use crate::scene::View;
use serde::Serialize;

/// Largest number of pixels of the pilot, the small render from which a forecast follows.
const MAX_PIXELS: f64 = 240.0 * 160.0;
/// Smallest number of pixels of the pilot, the small render from which a forecast follows.
const MIN_PIXELS: f64 = 1024.0;
/// Core-seconds after which the pilot of a forecast ends, if it has enough iterations for an error estimate and the
/// forecast render is short.
const PILOT_CORE_SECONDS: f64 = 5.0;
/// Share of the forecast core-seconds that the pilot may take.
const PILOT_SHARE: f64 = 0.1;
/// Size of a picture whose finish loads the denoiser.
const SMALL: Size = Size { width: 16, height: 16 };
/// Largest number of iterations of the pilot of a forecast.
const MAX_ITERATIONS: u64 = 1 << 10;

/// The cost of rendering a picture until its finished form reaches a target error: choosing the method, rendering,
/// estimating the error and finishing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// The target, a relative error as in `--target-error`.
    pub error: f64,
    /// Number of iterations until the target is reached.
    pub iterations: u64,
    /// Interval that contains the iterations that a share [`crate::render::CONFIDENCE`] of all renders
    /// needs.
    pub iterations_interval: [u64; 2],
    /// Wall-clock seconds until the picture is finished.
    pub seconds: f64,
    /// Core-seconds until the picture is finished.
    pub core_seconds: f64,
    /// Number of iterations of the pilot (the small render that this follows from), and the relative error of its
    /// finished picture.
    pub pilot: (u64, f64),
}

/// Forecasts the cost of a target error by a pilot, a small render, which ends after 5 core-seconds or a tenth of the
/// forecast, the time `choice` for choosing a method included, and is then finished. `None` if the pilot finds no error, or if bias keeps the
/// error above the target.
///
/// # Errors
/// The denoiser fails.
pub fn forecast(
    View { scene, camera }: View<'_>,
    settings: &Settings,
    finish: &mut Finish,
    target: f64,
    choice: TimeSpent,
) -> Result<Option<Forecast>> {
    let pixels = |camera: &Camera| f64::from(camera.size().0) * f64::from(camera.size().1);
    let Settings { method, indirect, guided, counts, .. } = *settings;
    let candidate = Candidate { method, indirect, guided, counts };
    let iteration = Cost::count(scene, camera, settings, None).iteration_seconds(candidate, settings, pixels(camera));
    // Half of the pilot's work is for the iterations that an error estimate needs, the rest for more of them.
    let affordable = 0.5 * PILOT_CORE_SECONDS / MIN_ITERATIONS_FOR_ERROR as f64 * pixels(camera) / iteration;
    let pilot = camera.downscale((affordable.clamp(MIN_PIXELS, MAX_PIXELS) / pixels(camera)).sqrt().min(1.0));
    let share = pixels(&pilot) / pixels(camera);
    let stage = RenderInput::new(scene, &pilot, &pilot_settings(settings, share));
    let mut session = Session::new(&stage);
    // Loading the denoiser takes the same time for every size of the picture.
    let mut fixed = choice;
    fixed.measure(|| {
        finish.warm_up_guides(SMALL)?;
        finish.warm_up(SMALL, Quality::High)?;
        finish.warm_up(SMALL, Quality::Fast)
    })?;
    fixed.add(session.spent());
    let (start, none) = (session.spent(), TimeSpent::default());
    let mut pilot =
        ForecastPilot { session: &mut session, finish, fixed, start, share, target, estimate: none, finished: none };
    pilot.run()?;
    pilot.finish_picture()?;
    Ok(pilot.forecast())
}

/// The pilot of a forecast.
struct ForecastPilot<'p, 'a> {
    session: &'p mut Session<'a>,
    finish: &'p mut Finish,
    /// Time that does not depend on the size of the picture: the choice of a method, the start of the session, and
    /// loading the denoiser.
    fixed: TimeSpent,
    /// Time that the session took before its iterations.
    start: TimeSpent,
    /// Pixels of the pilot over those of the render.
    share: f64,
    target: f64,
    /// Time of the pilot's last error estimate.
    estimate: TimeSpent,
    /// Time to make the pilot's layers and finish its picture; zero before that.
    finished: TimeSpent,
}

impl ForecastPilot<'_, '_> {
    /// Renders the pilot's iterations, and estimates the error of its finished picture each time their number has
    /// doubled.
    fn run(&mut self) -> Result<()> {
        let (mut next, mut allowed) = (MIN_ITERATIONS_FOR_ERROR, PILOT_CORE_SECONDS);
        let mut taken = self.fixed;
        loop {
            taken.measure(|| self.session.step());
            let done = self.session.iterations();
            let is_over = |taken: TimeSpent, allowed: f64| {
                done >= MAX_ITERATIONS || (done >= MIN_ITERATIONS_FOR_ERROR && taken.cpu_seconds >= allowed)
            };
            if done != next && !is_over(taken, allowed) {
                continue;
            }
            next = 2 * done;
            let mut estimate = TimeSpent::default();
            estimate.measure(|| self.record())?;
            taken.add(estimate);
            self.estimate = estimate;
            allowed = self.forecast().map_or(0.0, |of| PILOT_SHARE * of.core_seconds).max(PILOT_CORE_SECONDS);
            if is_over(taken, allowed) {
                return Ok(());
            }
        }
    }

    /// Estimates the error of the finished picture.
    fn record(&mut self) -> Result<()> {
        let set = self.session.layers(reads_for_error)?;
        let error = self.finish.estimate_error(&set)?;
        self.session.record_finished_error(error);
        Ok(())
    }

    /// Finishes the pilot's picture with its parts, to learn how long that takes.
    fn finish_picture(&mut self) -> Result<()> {
        let mut finished = TimeSpent::default();
        finished.measure(|| {
            let mut set = self.session.layers(|name| name.is_empty() || reads(name))?;
            self.finish.apply(&mut set, |_| true).map(|_| ())
        })?;
        self.finished = finished;
        Ok(())
    }

    /// The forecast that follows from the pilot so far.
    fn forecast(&self) -> Option<Forecast> {
        let done = self.session.iterations();
        let accuracy = Accuracy::fit(self.session.history())?;
        let least = MIN_ITERATIONS_FOR_ERROR as f64;
        let (iterations, factor) = (accuracy.iterations_to(self.target)?.max(least), accuracy.iterations_factor());
        let (spent, estimates) = (self.session.spent(), estimates_until(iterations));
        let total = |of: fn(&TimeSpent) -> f64| {
            let iteration = (of(&spent) - of(&self.start)) / done as f64;
            let scaled = iteration * iterations + of(&self.estimate) * estimates + of(&self.finished);
            of(&self.fixed) + scaled / self.share
        };
        Some(Forecast {
            error: self.target,
            iterations: iterations.ceil() as u64,
            iterations_interval: [(iterations / factor).max(least), iterations * factor].map(|n| n.ceil() as u64),
            seconds: total(|time| time.seconds),
            core_seconds: total(|time| time.cpu_seconds),
            pilot: (done, accuracy.error(done)),
        })
    }
}
