//! Trials: short renders of the best candidates, whose noise is measured between quarters of their iterations.

use super::pilot_settings::{TRIMMED_PILOT_SHARE, mean, median_around, relative_weight};
use crate::camera::Camera;
use crate::estimator::QUARTERS;
use crate::render::{RenderInput, Session, Settings};
use crate::scene::Scene;
use crate::stat::floor;

/// Smallest and largest number of iterations of a quarter of a trial.
const QUARTER_ITERATIONS: [u64; 2] = [2, 16];

/// A short render in a small picture.
pub(super) struct Trial<'a> {
    pub scene: &'a Scene,
    pub camera: &'a Camera,
    pub settings: Settings,
    pub iterations: u64,
}

/// The number of iterations of a trial that has time for `affordable` ones, in equal quarters; `None` if that is too few.
pub(super) fn iterations(affordable: f64) -> Option<u64> {
    let [least, most] = QUARTER_ITERATIONS;
    let quarter = ((affordable / QUARTERS as f64) as u64).min(most);
    (quarter >= least).then_some(quarter * QUARTERS as u64)
}

/// Value of a pixel after a trial, and its variance.
struct Measured {
    value: f64,
    variance: f64,
}

impl Trial<'_> {
    /// Renders the trial; `None` if it is too `late` before the end, or the user stops it.
    fn run(&self, late: &dyn Fn() -> bool) -> Option<Vec<Measured>> {
        let input = RenderInput::new(self.scene, self.camera, &self.settings);
        let mut session = Session::new(&input);
        for _ in 0..self.iterations {
            session.step();
            if late() || self.settings.stop.requested() {
                return None;
            }
        }
        let level = self.settings.levels.picture_level();
        let measured = session.pixels().iter().map(|pixel| Measured {
            value: mean(pixel.mean(level)),
            variance: pixel.variance_by_quarters().map_or(0.0, mean),
        });
        Some(measured.collect())
    }
}

/// Relative variance of an iteration of each trial, which includes the stratification over the iterations: the mean over
/// the pixels, without those with the largest variance. `None` if it is too `late` before the end, or the user stops a trial.
pub(super) fn relative_variances<'t>(
    trials: impl Iterator<Item = &'t Trial<'t>> + Clone,
    late: &dyn Fn() -> bool,
) -> Option<Vec<f64>> {
    let measured: Vec<Vec<Measured>> = trials.clone().map(|trial| trial.run(late)).collect::<Option<_>>()?;
    // All trials show the same picture.
    let count = measured.len() as f64;
    let values: Vec<f64> =
        (0..measured[0].len()).map(|index| measured.iter().map(|of| of[index].value).sum::<f64>() / count).collect();
    let values = median_around(trials.clone().next()?.camera.size(), |index| values[index]);
    let floor = floor::relative_to_mean(values.iter().copied());
    let relative = |(trial, measured): (&Trial<'_>, &Vec<Measured>)| {
        let of_pixel = |(of, value): (&Measured, &f64)| of.variance * relative_weight(*value, floor);
        let mut all: Vec<f64> = measured.iter().zip(&values).map(of_pixel).collect();
        all.sort_unstable_by(f64::total_cmp);
        all.truncate(all.len() - (all.len() as f64 * TRIMMED_PILOT_SHARE) as usize);
        trial.iterations as f64 * all.iter().sum::<f64>() / all.len() as f64
    };
    Some(trials.zip(&measured).map(relative).collect())
}
