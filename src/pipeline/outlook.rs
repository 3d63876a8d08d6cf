//! What an error will cost, told before rendering: a pilot in a small picture of the same view, with the same work for a
//! pixel, goes on for some seconds, is finished and judged as the render will be, and its decay is carried on.

use crate::camera::Camera;
use crate::choose::pilot_settings;
use crate::error::Result;
use crate::finish::{Finish, reads_for_error};
use crate::render::{Accuracy, MIN_ITERATIONS_FOR_ERROR, RenderInput, Session, Settings, TimeSpent};
use crate::scene::View;
use serde::Serialize;

/// Pixels of the pilot's picture.
const PIXELS: f64 = 240.0 * 160.0;
/// Seconds that the pilot goes on, if it has had the iterations by then that a picture is judged by.
const SECONDS: f64 = 5.0;
/// Iterations that are enough.
const ENOUGH: u64 = 1 << 10;

/// What a finished picture of some error will take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlook {
    /// The error, as `--target-error` takes it.
    pub error: f64,
    /// Iterations.
    pub iterations: u64,
    /// Seconds.
    pub seconds: f64,
    /// Core-seconds.
    pub core_seconds: f64,
    /// Iterations of the pilot, and the error that it had reached.
    pub pilot: (u64, f64),
}

/// What a render will take to an error; `None` where the pilot finds no error to carry on, or bias forbids that one.
///
/// # Errors
/// The denoiser fails.
pub fn outlook(
    View { scene, camera }: View<'_>,
    settings: &Settings,
    finish: &mut Finish,
    error: f64,
) -> Result<Option<Outlook>> {
    let pixels = |camera: &Camera| f64::from(camera.size().0) * f64::from(camera.size().1);
    let pilot = camera.downscale((PIXELS / pixels(camera)).sqrt().min(1.0));
    let share = pixels(&pilot) / pixels(camera);
    let stage = RenderInput::new(scene, &pilot, &pilot_settings(settings, share));
    let mut session = Session::new(&stage);
    let before = session.spent();
    let mut next = MIN_ITERATIONS_FOR_ERROR;
    loop {
        session.step();
        let (done, spent) = (session.iterations(), session.spent());
        let over = done >= ENOUGH || (done >= MIN_ITERATIONS_FOR_ERROR && spent.seconds >= SECONDS);
        if done == next || over {
            next = 2 * done;
            let set = session.layers(reads_for_error)?;
            session.record_finished_error(finish.estimate_error(&set)?);
        }
        if over {
            break;
        }
    }
    let Some(accuracy) = Accuracy::of(session.history()) else { return Ok(None) };
    let done = session.iterations();
    let reached = accuracy.error(done);
    let Some(iterations) = accuracy.iterations_to(error) else { return Ok(None) };
    let iterations = iterations.max(MIN_ITERATIONS_FOR_ERROR as f64);
    let TimeSpent { seconds, cpu_seconds } = session.spent();
    let of_render = |spent: f64, once: f64| once + (spent - once) / done as f64 / share * iterations;
    Ok(Some(Outlook {
        error,
        iterations: iterations.ceil() as u64,
        seconds: of_render(seconds, before.seconds),
        core_seconds: of_render(cpu_seconds, before.cpu_seconds),
        pilot: (done, reached),
    }))
}
