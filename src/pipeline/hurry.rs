//! Whether a render has the time for one iteration, told before it begins: the same view in a smaller picture is rendered
//! once, with as much work for a pixel.

use crate::camera::Camera;
use crate::choose::{pilot_settings, window_cost_ratio};
use crate::render::{RenderInput, Session, Settings};
use crate::scene::View;

/// Pixels of the smaller picture, at most.
const PIXELS: f64 = 64.0 * 64.0;
/// Its share of the picture, at most.
const SHARE: f64 = 1.0 / 64.0;
/// Warned of are iterations that take this many times what there is, and at least a second: the estimate is rough.
const FACTOR: f64 = 1.25;
const LEAST_SECONDS: f64 = 1.0;

/// The warning, if an iteration takes more time than there is.
pub(super) fn warn(view: View<'_>, settings: &Settings) -> Option<String> {
    let time = settings.time?;
    let seconds = seconds(view, settings)?;
    let remedy = match settings.method.takes_photon_count() {
        true => "fewer --photons, a smaller --width or more --time",
        false => "a smaller --width or more --time",
    };
    (seconds > (FACTOR * time).max(LEAST_SECONDS)).then(|| {
        format!("one iteration takes about {seconds:.0} s, longer than the {time:.0} s there are to render: the picture comes late and has one iteration (ask for {remedy})")
    })
}

/// About how long an iteration takes. The smaller picture is no window: the light paths around one are counted.
fn seconds(View { scene, camera }: View<'_>, settings: &Settings) -> Option<f64> {
    let count = |(width, height): (u32, u32)| f64::from(width) * f64::from(height);
    let pixels = |camera: &Camera| count(camera.size());
    let walked = camera.sizes().map(count)[usize::from(settings.method.walks_whole_picture())];
    let pilot = camera.downscale((PIXELS.min(SHARE * walked) / pixels(camera)).sqrt());
    let share = pixels(&pilot) / pixels(camera);
    let factor = window_cost_ratio(scene, camera, settings);
    let settings = Settings { guided: false, ..pilot_settings(settings, share) };
    let stage = RenderInput::new(scene, &pilot, &settings);
    let mut session = Session::new(&stage);
    let before = session.spent().seconds;
    session.step_within(None).then(|| factor * (session.spent().seconds - before) / share)
}
