//! Candidates against each other, each by the finished picture that it makes of the same counted work.
//!
//! The first half of a candidate's iterations is finished as the render will be, and so is each quarter of them: what
//! more iterations bring is told by both, and carried on to the end of the render as the power of their number that
//! they show. All pictures are judged alike, by the second halves of all candidates, whose noise no picture shares: the
//! mean of `(F - J)^2` is the picture's squared error and a variance that is the same for all. So what a candidate
//! finds too rarely to show noise is in its error, and the bias of photons is, too.

use super::pilot_settings::WORST;
use crate::film::{Picture, channel_mean};
use crate::finish::cross_product::{PixelError, squared_errors};
use crate::finish::{Estimate, Finish, quarters, reads_for_error};
use crate::render::{Candidate, RenderInput, Session};
use rayon::prelude::*;

/// Iterations of a candidate: one for each quarter, and as many as its share of the pilot allows.
pub(super) const ITERATIONS: (u64, u64) = (4, 256);
/// Share of the pilot that goes to all candidates alike.
const FIRST: f64 = 0.4;
/// Those whose picture has so many times the squared error of the best after that are out.
const UNCLEAR: f64 = 2.0;
/// Standard errors that a difference has to stand out by: before a candidate is out, and before the usual way is left
/// for a better one.
const TOLD: f64 = 2.0;

/// A candidate and how it did.
#[derive(Clone, Copy, Debug)]
pub struct PilotResult {
    /// The candidate.
    pub candidate: Candidate,
    /// relMSE without the worst pixels that the finished picture is expected to have; infinite where nothing was seen.
    pub squared_error: f64,
    /// Counted core-seconds of an iteration of the whole picture.
    pub seconds_per_iteration: f64,
    /// It is the one to take.
    pub chosen: bool,
}

/// A candidate being tried.
pub(super) struct CandidateRun<'a> {
    candidate: Candidate,
    session: Session<'a>,
    /// Counted core-seconds of an iteration of the small picture and of the whole one, and of all so far but for what
    /// comes before iterations.
    once: f64,
    whole: f64,
    spent: f64,
}

/// What a candidate's iterations show.
struct Shown {
    /// Finished from the first half.
    finished: Picture,
    /// Finished from either quarter of it.
    earlier: [Picture; 2],
    judges: [Picture; 2],
    /// Relative variance of the judges, without the worst pixels.
    noise: f64,
}

impl PilotResult {
    /// The relative error: the root of [`PilotResult::squared_error`].
    pub fn error(&self) -> f64 {
        self.squared_error.sqrt()
    }
}

impl<'a> CandidateRun<'a> {
    /// Nothing done yet but what comes before iterations, of which one costs so much in the small picture and the whole
    /// one.
    pub fn new(stage: &'a RenderInput<'a>, candidate: Candidate, [once, whole]: [f64; 2]) -> CandidateRun<'a> {
        CandidateRun { candidate, session: Session::new(stage), once, whole, spent: 0.0 }
    }

    /// Goes on until so many core-seconds are spent; no further than the least number of iterations once `stop` holds.
    fn advance(&mut self, seconds: f64, stop: &dyn Fn() -> bool) {
        let to = ((seconds / self.once) as u64).clamp(ITERATIONS.0, ITERATIONS.1);
        while self.session.iterations() < to && !(self.session.iterations() >= ITERATIONS.0 && stop()) {
            self.session.step();
            self.spent += self.once;
        }
    }

    /// `None` where a quarter of it is black, or it cannot be finished.
    fn show(&mut self, finish: &mut Finish) -> Option<Shown> {
        let set = self.session.layers(reads_for_error).ok()?;
        let quarters = quarters(&set)?;
        let estimate = Estimate::of(&set).ok()?;
        let finished = finish.picture(&estimate.first_half(&quarters)).ok()?;
        let [first, second, a, b] = quarters;
        let mut quarter = |mean| finish.picture(&estimate.from_partial(mean, 4.0)).ok();
        let earlier = [quarter(first)?, quarter(second)?];
        let noise = variance(&a, &b, &finished);
        Some(Shown { finished, earlier, judges: [a, b], noise })
    }
}

/// Relative squared difference of two pictures, without the worst pixels.
fn variance(a: &Picture, b: &Picture, values: &Picture) -> f64 {
    let floor = values.relative_floor();
    let square = |index: usize| -> f64 {
        let apart: f64 = (0..3).map(|c| f64::from(a[index][c] - b[index][c]).powi(2)).sum();
        apart / 3.0 * super::pilot_settings::scale(channel_mean(values[index]), floor)
    };
    without_worst((0..a.len()).into_par_iter().map(square).collect())
}

/// The mean without the largest: one bright sample is all that some have.
fn without_worst(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.truncate(values.len() - (values.len() as f64 * WORST) as usize);
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The judges, means of all candidates' by what their noise is, and the candidate whose finished picture says what
/// pixels are worth.
fn judges(shown: &[Option<Shown>]) -> Option<([Picture; 2], &Shown)> {
    let all: Vec<&Shown> = shown.iter().flatten().collect();
    let least = *all.iter().min_by(|a, b| a.noise.total_cmp(&b.noise))?;
    let weights: Vec<f64> = all.iter().map(|shown| 1.0 / shown.noise.max(f64::MIN_POSITIVE)).collect();
    let total: f64 = weights.iter().sum();
    let mean = |judge: usize| {
        Picture::from_fn(least.finished.size(), |index| {
            std::array::from_fn(|c| {
                let parts = all.iter().zip(&weights).map(|(shown, w)| w * f64::from(shown.judges[judge][index][c]));
                (parts.sum::<f64>() / total) as f32
            })
        })
    };
    Some(([mean(0), mean(1)], least))
}

/// What a candidate is expected to leave, by pixel; `None` where nothing was seen.
struct Expected(Option<Vec<PixelError>>);

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

impl Expected {
    /// Carries what was told of a candidate's half, and of either quarter of it, on to `more` times the half's
    /// iterations, as the power of their number that the mean errors show. It is linear in both, so that the power's
    /// own noise, which grows with the logarithm of `more`, is in what it is told to be worth.
    fn carried(half: &[PixelError], quarters: [&[PixelError]; 2], more: f64) -> Expected {
        let of = |pixels: &[PixelError]| mean(pixels.iter().map(|pixel| pixel.squared));
        let (h, q) = (of(half), 0.5 * (of(quarters[0]) + of(quarters[1])));
        let more = more.max(1.0);
        // Twice the iterations leave half of the squared error at best, and all of it at worst, where it is what is
        // missing.
        let (of_half, of_quarter) = match h {
            _ if h <= 0.5 * q => (0.0, 0.5 / more),
            _ if h >= q => (1.0, 0.0),
            _ => {
                let (doublings, scale) = (more.log2(), more.powf(-(q / h).log2()));
                (scale * (1.0 + doublings), -scale * doublings * h / q)
            }
        };
        let pixel = |((half, a), b): ((&PixelError, &PixelError), &PixelError)| {
            let carried = |half: f64, a: f64, b: f64| of_half * half + of_quarter * 0.5 * (a + b);
            PixelError {
                squared: carried(half.squared, a.squared, b.squared),
                noise: std::array::from_fn(|c| carried(half.noise[c], a.noise[c], b.noise[c])),
            }
        };
        Expected(Some(half.iter().zip(quarters[0]).zip(quarters[1]).map(pixel).collect()))
    }

    fn squared_error(&self) -> f64 {
        let error = |pixels: &Vec<PixelError>| mean(pixels.iter().map(|pixel| pixel.squared)).max(f64::MIN_POSITIVE);
        self.0.as_ref().map_or(f64::INFINITY, error)
    }

    /// How much more it leaves than another, and the standard error that the judges' noise gives that: both were judged
    /// by the same.
    fn more_than(&self, other: &Expected) -> (f64, f64) {
        let (Some(pixels), Some(others)) = (&self.0, &other.0) else {
            return (if self.0.is_none() { f64::INFINITY } else { f64::NEG_INFINITY }, 0.0);
        };
        let apart = pixels.iter().zip(others).map(|(a, b)| a.squared - b.squared);
        let pull = |(a, b): (&PixelError, &PixelError)| (0..3).map(|c| (a.noise[c] - b.noise[c]).powi(2)).sum::<f64>();
        let count = pixels.len().max(1) as f64;
        (mean(apart), (mean(pixels.iter().zip(others).map(pull)) / count).sqrt())
    }

    /// It may still turn out no worse than the best.
    fn is_open(&self, best: &Expected) -> bool {
        let (more, noise) = self.more_than(best);
        more < ((UNCLEAR - 1.0) * best.squared_error()).max(TOLD * noise)
    }

    /// By the judges' noise, and not by a few pixels alone, in which chance has put a splotch.
    fn is_clearly_worse(&self, than: &Expected) -> bool {
        let (Some(pixels), Some(others)) = (&self.0, &than.0) else { return self.0.is_none() };
        let (more, noise) = self.more_than(than);
        let square = |(a, b): (&PixelError, &PixelError)| (a.squared - b.squared).powi(2);
        let spread = (mean(pixels.iter().zip(others).map(square)) / pixels.len().max(1) as f64).sqrt();
        more > (TOLD * noise).max(spread)
    }
}

/// Lets candidates run for so many core-seconds at most and tells what they are expected to leave after the render's
/// `budget`. What is clear after the first share costs no more. Those are all there are once `stop` holds.
pub(super) fn hold(
    candidates: &mut [CandidateRun<'_>],
    finish: &mut Finish,
    (allowed, budget): (f64, f64),
    stop: &dyn Fn() -> bool,
) -> Vec<PilotResult> {
    let all = candidates.len();
    let least = |left: &[Expected], open: &[bool]| {
        let open = (0..all).filter(|&k| open[k]);
        open.min_by(|&a, &b| left[a].squared_error().total_cmp(&left[b].squared_error())).unwrap_or(0)
    };
    let share = FIRST * allowed / all as f64;
    candidates.iter_mut().for_each(|candidate| candidate.advance(share, stop));
    let mut left = compare(candidates, finish, budget);
    let best = least(&left, &vec![true; all]);
    let open: Vec<bool> = left.iter().map(|one| one.is_open(&left[best])).collect();
    let count = open.iter().filter(|open| **open).count();
    if count > 1 {
        let spent = |(candidate, open): (&CandidateRun<'_>, &bool)| if *open { 0.0 } else { candidate.spent };
        let closed: f64 = candidates.iter().zip(&open).map(spent).sum();
        let share = (allowed - closed) / count as f64;
        let again = candidates.iter_mut().zip(&open).filter(|(_, open)| **open);
        again.for_each(|(candidate, _)| candidate.advance(share, stop));
        let second = compare(candidates, finish, budget);
        // Those that are out stay out: they have had less.
        let both = left.into_iter().zip(second).zip(&open);
        left = both.map(|((first, second), open)| if *open { second } else { first }).collect();
    }
    let best = least(&left, &open);
    let usual = candidates.iter().position(|candidate| candidate.candidate == Candidate::DEFAULT);
    let usual = usual.filter(|&usual| open[usual] && !left[usual].is_clearly_worse(&left[best]));
    let chosen = usual.unwrap_or(best);
    let trial = |(index, (candidate, left)): (usize, (&CandidateRun<'_>, &Expected))| {
        let CandidateRun { candidate, whole, .. } = *candidate;
        let squared_error = left.squared_error();
        PilotResult { candidate, squared_error, seconds_per_iteration: whole, chosen: index == chosen }
    };
    candidates.iter().zip(&left).enumerate().map(trial).collect()
}

/// What all are expected to leave after `budget` core-seconds.
fn compare(candidates: &mut [CandidateRun<'_>], finish: &mut Finish, budget: f64) -> Vec<Expected> {
    let shown: Vec<Option<Shown>> = candidates.iter_mut().map(|candidate| candidate.show(finish)).collect();
    let judged = judges(&shown);
    let left = |candidate: &CandidateRun<'_>, shown: &Option<Shown>| -> Option<Expected> {
        let (shown, ([a, b], worth)) = (shown.as_ref()?, judged.as_ref()?);
        let of = |picture: &Picture| squared_errors(picture, [a, b], &worth.finished);
        let earlier = shown.earlier.each_ref().map(|picture| of(picture));
        // In the render's iterations over those of the half; the least number of iterations may have cost more than the
        // share.
        let more = budget / candidate.whole / (0.5 * candidate.session.iterations() as f64);
        Some(Expected::carried(&of(&shown.finished), [&earlier[0], &earlier[1]], more))
    };
    candidates.iter().zip(&shown).map(|(c, shown)| left(c, shown).unwrap_or(Expected(None))).collect()
}
