//! A forecast of what a target error will cost: a pilot renders a small picture of the same view, with the same work per
//! pixel, for some seconds. The decay of the pilot's error is extrapolated to the render.

use crate::camera::Camera;
use crate::choose::pilot_settings;
use crate::error::Result;
use crate::finish::{Finish, reads_for_error};
use crate::render::{Accuracy, Candidate, Cost, MIN_ITERATIONS_FOR_ERROR, RenderInput, Session, Settings, TimeSpent};
use crate::scene::View;
use serde::Serialize;

/// Largest number of pixels of the pilot, the small render from which a forecast follows.
const MAX_PIXELS: f64 = 240.0 * 160.0;
/// Smallest number of pixels of the pilot.
const MIN_PIXELS: f64 = 1024.0;
/// Core-seconds after which the pilot of a forecast ends, if it has enough iterations for an error estimate and the
/// forecast render is short.
const PILOT_CORE_SECONDS: f64 = 5.0;
/// Share of the forecast core-seconds that the pilot may take.
const PILOT_SHARE: f64 = 0.1;
/// Largest number of iterations of the pilot of a forecast.
const MAX_ITERATIONS: u64 = 1 << 10;

/// The cost of rendering a picture until its finished form reaches a target error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// The target, a relative error as in `--target-error`.
    pub error: f64,
    /// Number of iterations until the target is reached.
    pub iterations: u64,
    /// Wall-clock seconds until the target is reached.
    pub seconds: f64,
    /// Core-seconds until the target is reached.
    pub core_seconds: f64,
    /// Number of iterations of the pilot (the small render that this follows from), and the relative error of its
    /// finished picture.
    pub pilot: (u64, f64),
}

/// Forecasts the cost of a target error by a pilot, a small render, which takes at most 5 core-seconds or a tenth of the
/// forecast, `spent` core-seconds of the choice of a method included. `None` if the pilot finds no error, or if bias keeps
/// the error above the target.
///
/// # Errors
/// The denoiser fails.
pub fn forecast(
    View { scene, camera }: View<'_>,
    settings: &Settings,
    finish: &mut Finish,
    target: f64,
    spent: f64,
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
    let start = session.spent();
    let mut pilot = ForecastPilot { session: &mut session, finish, start, share, target, spent };
    pilot.run()?;
    let accuracy = Accuracy::fit(session.history());
    Ok(accuracy.and_then(|accuracy| forecast_by(&session, &accuracy, start, share, target)))
}

/// The forecast that follows from the pilot so far. `start`: the time that it took before its iterations; `share`: its
/// pixels over those of the render.
fn forecast_by(
    session: &Session<'_>,
    accuracy: &Accuracy,
    start: TimeSpent,
    share: f64,
    target: f64,
) -> Option<Forecast> {
    let done = session.iterations();
    let iterations = accuracy.iterations_to(target)?.max(MIN_ITERATIONS_FOR_ERROR as f64);
    let TimeSpent { seconds, cpu_seconds } = session.spent();
    let of_render = |spent: f64, start: f64| start + (spent - start) / done as f64 / share * iterations;
    Some(Forecast {
        error: target,
        iterations: iterations.ceil() as u64,
        seconds: of_render(seconds, start.seconds),
        core_seconds: of_render(cpu_seconds, start.cpu_seconds),
        pilot: (done, accuracy.error(done)),
    })
}

/// The pilot of a forecast.
struct ForecastPilot<'p, 'a> {
    session: &'p mut Session<'a>,
    finish: &'p mut Finish,
    /// Time that the session took before its iterations.
    start: TimeSpent,
    /// Pixels of the pilot over those of the render.
    share: f64,
    target: f64,
    /// Core-seconds that were spent before the pilot, to choose a method.
    spent: f64,
}

impl ForecastPilot<'_, '_> {
    /// Renders the pilot's iterations, and estimates the error of its finished picture each time their number has
    /// doubled.
    fn run(&mut self) -> Result<()> {
        let (mut next, mut allowed) = (MIN_ITERATIONS_FOR_ERROR, PILOT_CORE_SECONDS);
        let mut taken = TimeSpent { cpu_seconds: self.spent + self.start.cpu_seconds, ..TimeSpent::default() };
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
            taken.measure(|| self.record())?;
            let accuracy = Accuracy::fit(self.session.history());
            let forecast = accuracy.and_then(|of| forecast_by(self.session, &of, self.start, self.share, self.target));
            allowed = forecast.map_or(0.0, |forecast| PILOT_SHARE * forecast.core_seconds).max(PILOT_CORE_SECONDS);
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
}
