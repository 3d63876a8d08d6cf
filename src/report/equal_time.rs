//! The race: one iteration of the run that has used the least so far, and so on, so that a noisy machine hurts all
//! alike.
//!
//! Clocks decide the order and the end, never a picture: after so many iterations it is the one that `caustique render`
//! makes.

use super::entry::Entry;
use super::entry_run::EntryRun;
use super::outcome::Look;
use super::peer_renders::{PeerRenders, PeerTurn};
use super::picture_store::PictureStore;
use super::point::Point;
use super::reference::Reference;
use crate::error::Result;
use crate::render::{Control, RenderInput, Session, Settings};
use crate::scene::View;
use std::collections::VecDeque;
use std::path::Path;

pub use super::entry_run::Rules;
pub use super::outcome::{Outcome, Participants};

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
pub fn render_in_turns(
    View { scene, camera }: View<'_>,
    mut participants: Participants<'_>,
    rules: &Rules,
    reference: &Reference,
    folder: &Path,
    mut observe: impl FnMut(&Step<'_>) -> Control,
) -> Result<Outcome> {
    let entries = participants.entries;
    let mut outcome = Outcome::new(&participants, PictureStore::new(folder, reference.picture.size())?);
    for (round, &seed) in rules.seeds.iter().enumerate() {
        let of_entry = |entry: &Entry| {
            let settings =
                Settings { seed, iterations: None, time: None, target_error: None, ..entry.settings.clone() };
            RenderInput::new(scene, camera, &settings)
        };
        let stages: Vec<RenderInput<'_>> = entries.iter().map(of_entry).collect();
        let sessions = stages.iter().zip(entries).map(|(stage, entry)| Session::with_time_spent(stage, entry.decided));
        let mut entry_runs: Vec<EntryRun<'_>> = sessions.map(|session| EntryRun::new(session, rules)).collect();
        let mut turns: VecDeque<PeerTurn> = participants.peers.iter().flat_map(PeerRenders::turns).collect();
        let all = turns.len();
        let look = Look { seed, keep: round == 0, reference };
        let peers = outcome.peers.len() as f64;
        let share = |entry_runs: &[EntryRun<'_>], left: usize| {
            let ours = entry_runs.iter().map(|entry_run| entry_run.fraction(rules)).sum::<f64>();
            let theirs = peers * (1.0 - left as f64 / all.max(1) as f64);
            (round as f64 + (ours + theirs) / (entry_runs.len() as f64 + peers)) / rules.seeds.len() as f64
        };
        loop {
            let (name, iterations, seconds, measured, is_ours);
            if let Some(turn) = due(&turns, &entry_runs) {
                turns.pop_front();
                let peer = turn.peer;
                match outcome.host(turn, &mut participants, &look) {
                    None => {
                        outcome.interrupted = true;
                        break;
                    }
                    Some(found) => measured = found,
                }
                name = participants.peers.as_ref().map_or("", |peers| peers.peers[peer].name);
                (iterations, seconds) = outcome.last_of(measured);
                is_ours = false;
            } else if let Some(run) = next(&entry_runs, rules) {
                measured = outcome.step(run, &mut entry_runs[run], &mut participants, rules, &look);
                name = &entries[run].name;
                (iterations, seconds) = (entry_runs[run].session.iterations(), entry_runs[run].session.spent().seconds);
                is_ours = true;
            } else {
                break;
            }
            let point = outcome.points.last().filter(|_| measured);
            let fraction = share(&entry_runs, turns.len());
            if observe(&Step { name, is_ours, iterations, seconds, fraction, point }) == Control::Stop {
                outcome.interrupted = true;
                break;
            }
        }
        outcome.end(entry_runs, &mut participants, &look);
        if outcome.interrupted {
            break;
        }
    }
    Ok(outcome)
}

/// The peers' next turn, once all of ours that go on have rendered as long.
fn due(turns: &VecDeque<PeerTurn>, entry_runs: &[EntryRun<'_>]) -> Option<PeerTurn> {
    let far = |entry_run: &EntryRun<'_>| !entry_run.open || entry_run.session.spent().seconds >= turns[0].budget;
    turns.front().filter(|_| entry_runs.iter().all(far)).copied()
}

/// The run that has used the least; the first of equals.
fn next(entry_runs: &[EntryRun<'_>], rules: &Rules) -> Option<usize> {
    let open = (0..entry_runs.len()).filter(|&run| entry_runs[run].open);
    open.min_by(|&a, &b| entry_runs[a].used(rules).total_cmp(&entry_runs[b].used(rules)))
}
