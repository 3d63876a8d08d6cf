//! Pilots of all candidates, compared by the error of the finished picture that each makes of the same counted work.
//!
//! The first half of a candidate's iterations is finished as the render will be, and so are the two quarters in it.
//! The errors of half and quarters show how the error falls with the number of iterations, and are extrapolated to the
//! end of the render. All pictures are compared with the same estimates: the second halves of all candidates, whose
//! noise is independent of every picture's noise. The mean of `(F - J)^2`, with `F` a picture and `J` an estimate, is
//! the picture's squared error plus a variance that is the same for all pictures. So the error includes light that a
//! candidate samples too rarely to show noise, and the bias of photons.

use super::pilot_settings::{TRIMMED_PILOT_SHARE, relative_weight};
use crate::film::{Picture, channel_mean};
use crate::finish::cross_product::{PixelError, squared_errors};
use crate::finish::{Estimate, Finish, quarters, reads_for_error};
use crate::render::{Candidate, RenderInput, Session};
use rayon::prelude::*;

/// Smallest number of iterations of a pilot, one for each quarter of them.
pub(super) const MIN_ITERATIONS: u64 = 4;
/// Largest number of iterations of a pilot.
const MAX_ITERATIONS: u64 = 256;
/// Share of the work of all pilots that the first of two rounds divides equally among all candidates.
const FIRST_ROUND_SHARE: f64 = 0.4;
/// Ratio of a candidate's squared error to the smallest one above which the candidate is out after the first round.
const MAX_ERROR_RATIO: f64 = 2.0;
/// Number of standard errors by which a difference of errors must exceed 0 to be significant.
const SIGNIFICANCE: f64 = 2.0;

/// Result of a candidate's pilot, a short render in a small picture by one of the methods that `auto` compares.
#[derive(Clone, Copy, Debug)]
pub struct PilotResult {
    /// The candidate (method and settings) that the pilot has rendered with.
    pub candidate: Candidate,
    /// Expected squared relative error (relMSE) of the finished picture at the end of the render, trimmed of the worst
    /// pixels. Infinite if the pilot has seen no light.
    pub squared_error: f64,
    /// Core-seconds of an iteration of the whole picture, predicted from counted vertices.
    pub seconds_per_iteration: f64,
    /// Whether `auto` has chosen this candidate for the render.
    pub chosen: bool,
}

impl PilotResult {
    /// The expected relative error: the root of [`PilotResult::squared_error`].
    pub fn error(&self) -> f64 {
        self.squared_error.sqrt()
    }
}

/// Core-seconds that pilots and render may take, as predicted from counted vertices.
#[derive(Clone, Copy)]
pub(super) struct Budget {
    /// Core-seconds of all pilots together.
    pub pilots: f64,
    /// Core-seconds of the render.
    pub render: f64,
}

/// The pilot of a candidate, a short render in a small picture, between its iterations.
pub(super) struct PilotRun<'a> {
    candidate: Candidate,
    session: Session<'a>,
    /// Core-seconds of an iteration of the pilot, predicted from counted vertices.
    seconds_per_iteration: f64,
    /// Core-seconds of an iteration of the whole picture, predicted from counted vertices.
    render_seconds_per_iteration: f64,
    /// Predicted core-seconds of all iterations of the pilot so far.
    spent: f64,
}

/// Pictures of a pilot, from halves and quarters of its iterations.
struct PilotPictures {
    /// Picture finished from the first half of the iterations.
    half: Picture,
    /// Pictures finished from each quarter in the first half of the iterations.
    quarters: [Picture; 2],
    /// Pictures of the other two quarters of the iterations, unfinished: independent estimates.
    estimates: [Picture; 2],
    /// Relative variance of the estimates, trimmed of the worst pixels.
    noise: f64,
}

impl<'a> PilotRun<'a> {
    /// Prepares a pilot. Both costs are core-seconds of an iteration, predicted from counted vertices: of the pilot,
    /// and of the whole picture.
    pub fn new(
        input: &'a RenderInput<'a>,
        candidate: Candidate,
        seconds_per_iteration: f64,
        render_seconds_per_iteration: f64,
    ) -> PilotRun<'a> {
        let session = Session::new(input);
        PilotRun { candidate, session, seconds_per_iteration, render_seconds_per_iteration, spent: 0.0 }
    }

    /// Iterates until the pilot has taken `seconds` core-seconds in all, as predicted. Once `stopped` returns true it
    /// ends after [`MIN_ITERATIONS`].
    fn advance(&mut self, seconds: f64, stopped: &dyn Fn() -> bool) {
        let to = ((seconds / self.seconds_per_iteration) as u64).clamp(MIN_ITERATIONS, MAX_ITERATIONS);
        while self.session.iterations() < to && !(self.session.iterations() >= MIN_ITERATIONS && stopped()) {
            self.session.step();
            self.spent += self.seconds_per_iteration;
        }
    }

    /// Makes the pictures of the iterations so far; `None` if a quarter is black or the finish fails.
    fn pictures(&self, finish: &mut Finish) -> Option<PilotPictures> {
        let set = self.session.layers(reads_for_error).ok()?;
        let quarters = quarters(&set)?;
        let estimate = Estimate::of(&set).ok()?;
        let half = finish.picture(&estimate.first_half(&quarters)).ok()?;
        let [first, second, a, b] = quarters;
        let mut quarter = |mean| finish.picture(&estimate.from_partial(mean, 4.0)).ok();
        let quarters = [quarter(first)?, quarter(second)?];
        let noise = relative_variance(&a, &b, &half);
        Some(PilotPictures { half, quarters, estimates: [a, b], noise })
    }
}

/// Mean squared difference of two pictures relative to the squares of `values`, trimmed of the pixels with the largest:
/// in some pictures one bright sample would be all of it.
fn relative_variance(a: &Picture, b: &Picture, values: &Picture) -> f64 {
    let floor = values.relative_floor();
    let squared_difference = |index: usize| -> f64 {
        let difference: f64 = (0..3).map(|c| f64::from(a[index][c] - b[index][c]).powi(2)).sum();
        difference / 3.0 * relative_weight(channel_mean(values[index]), floor)
    };
    let mut squares: Vec<f64> = (0..a.len()).into_par_iter().map(squared_difference).collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares.truncate(squares.len() - (squares.len() as f64 * TRIMMED_PILOT_SHARE) as usize);
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}

/// Estimates of the true picture that the finished pictures of all pilots are compared with.
struct CommonEstimates<'a> {
    /// Two independent means over the pilots of all candidates, weighted by inverse variance.
    estimates: [Picture; 2],
    /// Pixels that errors are relative to: the finished picture of the candidate with the least noise.
    values: &'a Picture,
}

/// Makes the estimates of the true picture from the pictures of all pilots; `None` if no pilot has pictures.
fn common_estimates(pictures: &[Option<PilotPictures>]) -> Option<CommonEstimates<'_>> {
    let all: Vec<&PilotPictures> = pictures.iter().flatten().collect();
    let values = &all.iter().min_by(|a, b| a.noise.total_cmp(&b.noise))?.half;
    let weights: Vec<f64> = all.iter().map(|pictures| 1.0 / pictures.noise.max(f64::MIN_POSITIVE)).collect();
    let total: f64 = weights.iter().sum();
    let mean = |k: usize| {
        Picture::from_fn(values.size(), |index| {
            std::array::from_fn(|c| {
                let weighted = all.iter().zip(&weights).map(|(one, w)| w * f64::from(one.estimates[k][index][c]));
                (weighted.sum::<f64>() / total) as f32
            })
        })
    };
    Some(CommonEstimates { estimates: [mean(0), mean(1)], values })
}

/// Expected squared errors of a candidate's pixels at the end of the render; `None` if its pilot has no pictures.
struct ExpectedErrors(Option<Vec<PixelError>>);

/// Excess of one candidate's mean squared error over that of another, with its noise.
struct Difference {
    mean: f64,
    /// Standard error of `mean` from the noise of the common estimates.
    noise: f64,
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

impl ExpectedErrors {
    /// Extrapolates errors from the half of the pilot's iterations to `factor` times that number, by the power law through
    /// the mean errors of `half` and `quarters`. The result is linear in both, so that its noise includes the noise of
    /// the exponent, which grows with the logarithm of `factor`.
    fn extrapolate(half: &[PixelError], quarters: [&[PixelError]; 2], factor: f64) -> ExpectedErrors {
        let mean_error = |pixels: &[PixelError]| mean(pixels.iter().map(|pixel| pixel.squared));
        let (h, q) = (mean_error(half), 0.5 * (mean_error(quarters[0]) + mean_error(quarters[1])));
        let factor = factor.max(1.0);
        // Twice the iterations halve the squared error at best (noise) and keep it at worst (missing light).
        let (half_weight, quarter_weight) = match h {
            _ if h <= 0.5 * q => (0.0, 0.5 / factor),
            _ if h >= q => (1.0, 0.0),
            _ => {
                let (doublings, scale) = (factor.log2(), factor.powf(-(q / h).log2()));
                (scale * (1.0 + doublings), -scale * doublings * h / q)
            }
        };
        let pixel = |((half, a), b): ((&PixelError, &PixelError), &PixelError)| {
            let combine = |half: f64, a: f64, b: f64| half_weight * half + quarter_weight * 0.5 * (a + b);
            PixelError {
                squared: combine(half.squared, a.squared, b.squared),
                noise: std::array::from_fn(|c| combine(half.noise[c], a.noise[c], b.noise[c])),
            }
        };
        ExpectedErrors(Some(half.iter().zip(quarters[0]).zip(quarters[1]).map(pixel).collect()))
    }

    /// Mean squared error over pixels; infinite if the pilot has no pictures.
    fn mean_squared(&self) -> f64 {
        let error = |pixels: &Vec<PixelError>| mean(pixels.iter().map(|pixel| pixel.squared)).max(f64::MIN_POSITIVE);
        self.0.as_ref().map_or(f64::INFINITY, error)
    }

    /// The excess of this candidate's error over another one's. Both are errors against the same estimates.
    fn excess_over(&self, other: &ExpectedErrors) -> Difference {
        let (Some(pixels), Some(others)) = (&self.0, &other.0) else {
            let mean = if self.0.is_none() { f64::INFINITY } else { f64::NEG_INFINITY };
            return Difference { mean, noise: 0.0 };
        };
        let pairs = || pixels.iter().zip(others);
        let noise = |(a, b): (&PixelError, &PixelError)| (0..3).map(|c| (a.noise[c] - b.noise[c]).powi(2)).sum::<f64>();
        let count = pixels.len().max(1) as f64;
        Difference {
            mean: mean(pairs().map(|(a, b)| a.squared - b.squared)),
            noise: (mean(pairs().map(noise)) / count).sqrt(),
        }
    }

    /// Whether this candidate remains for the second round: more iterations may show that it is as good as the best
    /// one.
    fn is_open(&self, best: &ExpectedErrors) -> bool {
        let excess = self.excess_over(best);
        excess.mean < ((MAX_ERROR_RATIO - 1.0) * best.mean_squared()).max(SIGNIFICANCE * excess.noise)
    }

    /// Whether this candidate's excess of error is significant against the noise of the estimates and against its
    /// spread over pixels, so that a few blotches alone do not decide.
    fn is_clearly_worse(&self, than: &ExpectedErrors) -> bool {
        let (Some(pixels), Some(others)) = (&self.0, &than.0) else { return self.0.is_none() };
        let excess = self.excess_over(than);
        let square = |(a, b): (&PixelError, &PixelError)| (a.squared - b.squared).powi(2);
        let spread = (mean(pixels.iter().zip(others).map(square)) / pixels.len().max(1) as f64).sqrt();
        excess.mean > (SIGNIFICANCE * excess.noise).max(spread)
    }
}

/// Runs the pilots within their budget and predicts the error of each candidate at the end of the render. Candidates
/// that are clearly worse after the first round get no second one. Once `stopped` returns true, the remaining pilots
/// end after [`MIN_ITERATIONS`].
pub(super) fn run_pilots(
    runs: &mut [PilotRun<'_>],
    finish: &mut Finish,
    budget: Budget,
    stopped: &dyn Fn() -> bool,
) -> Vec<PilotResult> {
    let share = FIRST_ROUND_SHARE * budget.pilots / runs.len() as f64;
    runs.iter_mut().for_each(|run| run.advance(share, stopped));
    let mut errors = expected_errors(runs, finish, budget.render);
    let best = index_of_least(&errors, &vec![true; runs.len()]);
    let open: Vec<bool> = errors.iter().map(|error| error.is_open(&errors[best])).collect();
    if open.iter().filter(|open| **open).count() > 1 {
        run_second_round(runs, &open, budget.pilots, stopped);
        let second = expected_errors(runs, finish, budget.render);
        // Candidates that are out keep the result of the first round: they have had fewer iterations.
        let rounds = errors.into_iter().zip(second).zip(&open);
        errors = rounds.map(|((first, second), open)| if *open { second } else { first }).collect();
    }
    let chosen = choose(runs, &errors, &open);
    let result = |(index, (run, error)): (usize, (&PilotRun<'_>, &ExpectedErrors))| PilotResult {
        candidate: run.candidate,
        squared_error: error.mean_squared(),
        seconds_per_iteration: run.render_seconds_per_iteration,
        chosen: index == chosen,
    };
    runs.iter().zip(&errors).enumerate().map(result).collect()
}

/// Divides what the first round has left of `budget` (core-seconds) equally among the candidates that are still `open`.
fn run_second_round(runs: &mut [PilotRun<'_>], open: &[bool], budget: f64, stopped: &dyn Fn() -> bool) {
    let count = open.iter().filter(|open| **open).count();
    let closed: f64 = runs.iter().zip(open).map(|(run, open)| if *open { 0.0 } else { run.spent }).sum();
    let share = (budget - closed) / count as f64;
    let remaining = runs.iter_mut().zip(open).filter(|(_, open)| **open);
    remaining.for_each(|(run, _)| run.advance(share, stopped));
}

/// Index of the candidate with the smallest error among those that are `open`.
fn index_of_least(errors: &[ExpectedErrors], open: &[bool]) -> usize {
    let open = (0..errors.len()).filter(|&k| open[k]);
    open.min_by(|&a, &b| errors[a].mean_squared().total_cmp(&errors[b].mean_squared())).unwrap_or(0)
}

/// Index of the default candidate, unless it is clearly worse than the one with the smallest error, whose index it is
/// then.
fn choose(runs: &[PilotRun<'_>], errors: &[ExpectedErrors], open: &[bool]) -> usize {
    let best = index_of_least(errors, open);
    let default = runs.iter().position(|run| run.candidate == Candidate::DEFAULT);
    default.filter(|&default| open[default] && !errors[default].is_clearly_worse(&errors[best])).unwrap_or(best)
}

/// Expected errors of all candidates after a render that takes `budget` core-seconds.
fn expected_errors(runs: &[PilotRun<'_>], finish: &mut Finish, budget: f64) -> Vec<ExpectedErrors> {
    let pictures: Vec<Option<PilotPictures>> = runs.iter().map(|run| run.pictures(finish)).collect();
    let common = common_estimates(&pictures);
    let expected = |run: &PilotRun<'_>, pictures: &Option<PilotPictures>| -> Option<ExpectedErrors> {
        let (pictures, CommonEstimates { estimates: [a, b], values }) = (pictures.as_ref()?, common.as_ref()?);
        let errors = |picture: &Picture| squared_errors(picture, [a, b], values);
        let [first, second] = pictures.quarters.each_ref().map(errors);
        // Iterations of the render relative to those of the half. A pilot may have cost more than its share, because it
        // has at least MIN_ITERATIONS.
        let factor = budget / run.render_seconds_per_iteration / (0.5 * run.session.iterations() as f64);
        Some(ExpectedErrors::extrapolate(&errors(&pictures.half), [&first, &second], factor))
    };
    runs.iter().zip(&pictures).map(|(run, one)| expected(run, one).unwrap_or(ExpectedErrors(None))).collect()
}
