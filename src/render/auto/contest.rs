//! Candidates against each other: all for a few iterations, those that may still turn out best for as many more as the pilot may take.

use super::missing::Caustics;
use super::trial::{Plan, Running, Trial};
use crate::render::method::Method;

/// Iterations of a candidate: as many as its share of the pilot allows.
pub(super) const ITERATIONS: (u64, u64) = (6, 64);
/// Share of the pilot that may go to all candidates alike.
const FIRST: f64 = 0.25;
/// Those that are expected to leave so many times the squared error of the best after that are out: a few iterations tell it to a third or so.
const UNCLEAR: f64 = 2.0;
/// A candidate that finds less than this share of the caustics that photons find has not seen them all, and its noise is not known.
const FOUND: f64 = 0.7;
/// The same for one that sends photons, of the caustics that guided ones find: those of either kind are a few bright discs where they are rare.
const SENT: f64 = 0.25;

/// Lets candidates run for so many core-seconds at most and tells how they did. What is clear after the first iterations costs no more. Those are all there are once
/// `stop` holds.
pub(super) fn hold(running: &mut [Running<'_>], plan: &Plan, allowed: f64, stop: &dyn Fn() -> bool) -> Vec<Trial> {
    let share = FIRST * allowed / running.len() as f64;
    running.iter_mut().for_each(|running| running.advance(share, ITERATIONS, stop));
    let values = running[0].values();
    let trials = compare(running, plan, &values);
    let least = trials.iter().map(|trial| trial.expected).fold(f64::INFINITY, f64::min);
    let spent: f64 = running.iter().map(Running::spent).sum();
    let mut open: Vec<&mut Running<'_>> = running
        .iter_mut()
        .zip(&trials)
        .filter_map(|(running, trial)| (trial.expected < UNCLEAR * least).then_some(running))
        .collect();
    if open.len() < 2 {
        return trials;
    }
    let share = (allowed - spent).max(0.0) / open.len() as f64;
    open.iter_mut().for_each(|running| running.advance(share, ITERATIONS, stop));
    compare(running, plan, &values)
}

/// How those that are being tried have done so far.
fn compare(running: &[Running<'_>], plan: &Plan, values: &[f64]) -> Vec<Trial> {
    let mut trials: Vec<Trial> = running.iter().map(|running| running.trial(plan, values)).collect();
    let found: Vec<&Caustics> = running.iter().map(Running::found).collect();
    rule_out(&mut trials);
    add_missing(&mut trials, &found, (values, running[0].width()));
    trials
}

/// Adds what connections leave out of what merging finds: `found` has the caustics of each. `values` are what the pixels of the pilot's picture are worth, which is so wide.
fn add_missing(trials: &mut [Trial], found: &[&Caustics], (values, width): (&[f64], usize)) {
    let Some(merging) = trials.iter().position(|trial| trial.way.method == Method::Vcm) else { return };
    for (trial, own) in trials.iter_mut().zip(found) {
        if matches!(trial.way.method, Method::Path | Method::Bdpt) {
            trial.expected += own.missing(found[merging], values, width);
        }
    }
}

/// Rules out what has not seen the caustics that photons show.
fn rule_out(trials: &mut [Trial]) {
    let most = |guided: bool| {
        let gathers = |trial: &&Trial| trial.way.method.gathers() && trial.way.guided == guided;
        trials.iter().filter(gathers).map(|trial| trial.caustics).fold(0.0, f64::max)
    };
    let [unguided, guided] = [false, true].map(most);
    for trial in trials.iter_mut().filter(|trial| !trial.way.guided) {
        let least = if trial.way.method.has_bandwidths() { SENT * guided } else { FOUND * unguided.max(guided) };
        if trial.caustics < least {
            trial.expected = f64::INFINITY;
        }
    }
}
