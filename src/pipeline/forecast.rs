//! A forecast of what a target error will cost: a pilot renders a small picture of the same view, with the same work per
//! pixel, for some seconds. The decay of the pilot's error is extrapolated to the render.

use crate::camera::Camera;
use crate::choose::pilot_settings;
use crate::error::Result;
use crate::finish::{Finish, reads_for_error};
use crate::render::{Accuracy, MIN_ITERATIONS_FOR_ERROR, RenderInput, Session, Settings, TimeSpent};
use crate::scene::View;
use serde::Serialize;

/// Largest number of pixels of the pilot, the small render from which a forecast follows.
const MAX_PIXELS: f64 = 240.0 * 160.0;
/// Seconds after which the pilot of a forecast ends, if it has enough iterations for an error estimate.
const PILOT_SECONDS: f64 = 5.0;
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

/// Forecasts the cost of a target error by a pilot, a small render. `None` if the pilot finds no error, or if bias
/// keeps the error above the target.
///
/// # Errors
/// The denoiser fails.
pub fn forecast(
    View { scene, camera }: View<'_>,
    settings: &Settings,
    finish: &mut Finish,
    target: f64,
) -> Result<Option<Forecast>> {
    let pixels = |camera: &Camera| f64::from(camera.size().0) * f64::from(camera.size().1);
    let pilot = camera.downscale((MAX_PIXELS / pixels(camera)).sqrt().min(1.0));
    let share = pixels(&pilot) / pixels(camera);
    let stage = RenderInput::new(scene, &pilot, &pilot_settings(settings, share));
    let mut session = Session::new(&stage);
    let start = session.spent();
    run_pilot(&mut session, finish)?;
    let done = session.iterations();
    let Some(accuracy) = Accuracy::fit(session.history()) else { return Ok(None) };
    let Some(iterations) = accuracy.iterations_to(target) else { return Ok(None) };
    let iterations = iterations.max(MIN_ITERATIONS_FOR_ERROR as f64);
    let TimeSpent { seconds, cpu_seconds } = session.spent();
    let of_render = |spent: f64, start: f64| start + (spent - start) / done as f64 / share * iterations;
    Ok(Some(Forecast {
        error: target,
        iterations: iterations.ceil() as u64,
        seconds: of_render(seconds, start.seconds),
        core_seconds: of_render(cpu_seconds, start.cpu_seconds),
        pilot: (done, accuracy.error(done)),
    }))
}

/// Renders the pilot's iterations, and estimates the error of its finished picture each time their number has doubled.
fn run_pilot(session: &mut Session<'_>, finish: &mut Finish) -> Result<()> {
    let mut next = MIN_ITERATIONS_FOR_ERROR;
    loop {
        session.step();
        let done = session.iterations();
        let over =
            done >= MAX_ITERATIONS || (done >= MIN_ITERATIONS_FOR_ERROR && session.spent().seconds >= PILOT_SECONDS);
        if done == next || over {
            next = 2 * done;
            let set = session.layers(reads_for_error)?;
            session.record_finished_error(finish.estimate_error(&set)?);
        }
        if over {
            return Ok(());
        }
    }
}
