//! Compares the error that a render reports with the true error of its pictures, and tests how both shrink.

use super::picture::{Shot, renders};
use super::world::World;
use caustique::render::Rendered;
use caustique::stat::floor;

/// Number of pictures over which errors are averaged.
const SEEDS: u64 = 12;
/// Allowed factor between the mean error that 12 renders report and their true error. The mean of 12 squared errors
/// over 576 pixels is known within a few per cent if no rare path dominates.
pub const REPORTED_WITHIN: f64 = 1.6;
/// Four times the iterations must halve the error within this factor.
pub const HALVED_WITHIN: f64 = 1.3;

/// Errors of pictures: square roots of the relMSE.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// True error, from the differences to the mean of all pictures.
    pub actual: f64,
    pub reported: f64,
}

/// Errors of pictures of a scene, and of pictures with four times the iterations.
///
/// # Errors
/// The renderer refuses the scene.
pub fn errors(world: &World, shot: &Shot) -> Result<[Errors; 2], String> {
    let of = |effort: f64| renders(world, &Shot { effort, ..shot.clone() }, 0..SEEDS).map(|rendered| of(&rendered));
    Ok([of(1.0)?, of(4.0)?])
}

fn of(rendered: &[Rendered]) -> Errors {
    let own = rendered[0].settings.levels.picture_level();
    let n = rendered.len() as f64;
    let pixels = rendered[0].pixels.len();
    let values: Vec<Vec<glam::DVec3>> =
        rendered.iter().map(|one| one.pixels.iter().map(|pixel| pixel.mean(own)).collect()).collect();
    let mean: Vec<glam::DVec3> =
        (0..pixels).map(|at| values.iter().map(|picture| picture[at]).sum::<glam::DVec3>() / n).collect();
    let gray = |value: &glam::DVec3| value.element_sum() / 3.0;
    let floor = floor::relative_to_mean(mean.iter().map(gray));
    let squared: f64 = values
        .iter()
        .flat_map(|picture| picture.iter().zip(&mean))
        .map(|(value, mean)| (*value - *mean).length_squared() / (3.0 * (gray(mean).powi(2) + floor)))
        .sum();
    // The mean includes each of the n pictures, hence n - 1.
    let actual = (squared / (pixels as f64 * (n - 1.0))).sqrt();
    let reported =
        rendered.iter().filter_map(|rendered| rendered.error.relative()).map(|error| error * error).sum::<f64>() / n;
    Errors { actual, reported: reported.sqrt() }
}

/// Whether errors are as reported and shrink as expected.
pub fn as_reported([first, more]: &[Errors; 2]) -> bool {
    let within = |ratio: f64, factor: f64| ratio < factor && ratio > 1.0 / factor;
    [first, more].iter().all(|errors| within(errors.reported / errors.actual, REPORTED_WITHIN))
        && within(2.0 * more.actual / first.actual, HALVED_WITHIN)
}
