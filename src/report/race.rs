//! The race: one iteration of the run that has used the least so far, and so on, so that a noisy machine hurts all
//! alike.
//!
//! Clocks decide the order and the end, never a picture: after so many iterations it is the one that `caustique render`
//! makes.

use super::entry::Entry;
use super::guests::{Guests, Turn};
use super::lane::Lane;
use super::outcome::Look;
use super::point::Point;
use super::reference::Reference;
use super::spool::Spool;
use crate::error::Result;
use crate::render::{Control, RenderInput, Session, Settings};
use crate::scene::View;
use std::collections::VecDeque;
use std::path::Path;

pub use super::lane::Rules;
pub use super::outcome::{Field, Outcome};

/// What is told after every step.
pub struct Step<'a> {
    /// The name of who made it.
    pub name: &'a str,
    /// Whether it is ours.
    pub is_ours: bool,
    /// Iterations it has done; samples per pixel of other renderers, 0 where no picture came of it.
    pub iterations: u64,
    /// Its seconds.
    pub seconds: f64,
    /// Share of the whole race that is done, 0 to 1.
    pub fraction: f64,
    /// The measurement, if this was a moment.
    pub point: Option<&'a Point>,
}

/// Races all that take part, with each seed in turn. Pictures of the first seed are kept in `folder` until the outcome
/// is dropped. `observe` is called after every step and may stop the race.
///
/// # Errors
/// The file system, before anything is rendered.
pub fn race(
    View { scene, camera }: View<'_>,
    mut field: Field<'_>,
    rules: &Rules,
    reference: &Reference,
    folder: &Path,
    mut observe: impl FnMut(&Step<'_>) -> Control,
) -> Result<Outcome> {
    let entries = field.entries;
    let mut outcome = Outcome::new(&field, Spool::new(folder, reference.picture.size())?);
    for (round, &seed) in rules.seeds.iter().enumerate() {
        let of_entry = |entry: &Entry| {
            let settings =
                Settings { seed, iterations: None, time: None, target_error: None, ..entry.settings.clone() };
            RenderInput::new(scene, camera, &settings)
        };
        let stages: Vec<RenderInput<'_>> = entries.iter().map(of_entry).collect();
        let sessions = stages.iter().zip(entries).map(|(stage, entry)| Session::with_time_spent(stage, entry.decided));
        let mut lanes: Vec<Lane<'_>> = sessions.map(|session| Lane::new(session, rules)).collect();
        let mut turns: VecDeque<Turn> = field.guests.iter().flat_map(Guests::turns).collect();
        let all = turns.len();
        let look = Look { seed, keep: round == 0, reference };
        let guests = outcome.guests.len() as f64;
        let share = |lanes: &[Lane<'_>], left: usize| {
            let ours = lanes.iter().map(|lane| lane.fraction(rules)).sum::<f64>();
            let theirs = guests * (1.0 - left as f64 / all.max(1) as f64);
            (round as f64 + (ours + theirs) / (lanes.len() as f64 + guests)) / rules.seeds.len() as f64
        };
        loop {
            let (name, iterations, seconds, measured, is_ours);
            if let Some(turn) = due(&turns, &lanes) {
                turns.pop_front();
                let guest = turn.guest;
                match outcome.host(turn, &mut field, &look) {
                    None => {
                        outcome.interrupted = true;
                        break;
                    }
                    Some(found) => measured = found,
                }
                name = field.guests.as_ref().map_or("", |guests| guests.peers[guest].name);
                (iterations, seconds) = outcome.last_of(measured);
                is_ours = false;
            } else if let Some(run) = next(&lanes, rules) {
                measured = outcome.step(run, &mut lanes[run], &mut field, rules, &look);
                name = &entries[run].name;
                (iterations, seconds) = (lanes[run].session.iterations(), lanes[run].session.spent().seconds);
                is_ours = true;
            } else {
                break;
            }
            let point = outcome.points.last().filter(|_| measured);
            let fraction = share(&lanes, turns.len());
            if observe(&Step { name, is_ours, iterations, seconds, fraction, point }) == Control::Stop {
                outcome.interrupted = true;
                break;
            }
        }
        outcome.end(lanes, &mut field, &look);
        if outcome.interrupted {
            break;
        }
    }
    Ok(outcome)
}

/// The guests' next turn, once all of ours that go on have rendered as long.
fn due(turns: &VecDeque<Turn>, lanes: &[Lane<'_>]) -> Option<Turn> {
    let far = |lane: &Lane<'_>| !lane.open || lane.session.spent().seconds >= turns[0].budget;
    turns.front().filter(|_| lanes.iter().all(far)).copied()
}

/// The run that has used the least; the first of equals.
fn next(lanes: &[Lane<'_>], rules: &Rules) -> Option<usize> {
    let open = (0..lanes.len()).filter(|&run| lanes[run].open);
    open.min_by(|&a, &b| lanes[a].used(rules).total_cmp(&lanes[b].used(rules)))
}
