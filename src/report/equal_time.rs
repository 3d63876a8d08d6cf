//! Renders all entries in turns on one machine and measures them.
//!
//! The next iteration always goes to the run that has used the least time, so that other load on the machine affects all
//! runs alike. Clocks decide the order and the end only: after n iterations a picture is that of `caustique render`.

use super::entry::Entry;
use super::entry_run::EntryRun;
use super::outcome::Round;
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

/// Progress of a comparison after one iteration of an entry or one render of a peer, another renderer.
pub struct Step<'a> {
    /// Name of the entry or peer that has just rendered.
    pub name: &'a str,
    /// Whether it is an entry, which caustique renders, and not a peer.
    pub is_ours: bool,
    /// Iterations done; for peers samples per pixel, 0 if the render gave no picture.
    pub iterations: u64,
    /// Wall-clock seconds that the run has taken.
    pub seconds: f64,
    /// Completed share of all runs with all seeds, 0 to 1.
    pub fraction: f64,
    /// The measurement of the picture's error, if one was made.
    pub point: Option<&'a Point>,
}

/// The runs with one seed, and the renders of peers, other renderers, that are still to come.
struct Queue<'a> {
    runs: Vec<EntryRun<'a>>,
    turns: VecDeque<PeerTurn>,
    all_turns: usize,
    peers: usize,
}

impl Queue<'_> {
    /// The next render of a peer, once every open run has rendered for the peer's time: all then meet the same load on
    /// the machine. `None` if none is due.
    fn due(&mut self) -> Option<PeerTurn> {
        let budget = self.turns.front()?.budget;
        let is_far = |run: &EntryRun<'_>| !run.open || run.session.spent().seconds >= budget;
        if self.runs.iter().all(is_far) { self.turns.pop_front() } else { None }
    }

    /// Index of the open run that has used the least time, the first of equals; `None` if no run is open.
    fn next(&self, rules: &Rules) -> Option<usize> {
        let open = (0..self.runs.len()).filter(|&run| self.runs[run].open);
        open.min_by(|&a, &b| self.runs[a].used(rules).total_cmp(&self.runs[b].used(rules)))
    }

    /// Completed share of the runs and renders of peers with this seed, 0 to 1.
    fn fraction(&self, rules: &Rules) -> f64 {
        let runs = self.runs.iter().map(|run| run.fraction(rules)).sum::<f64>();
        let peers = self.peers as f64 * (1.0 - self.turns.len() as f64 / self.all_turns.max(1) as f64);
        (runs + peers) / (self.runs.len() + self.peers) as f64
    }
}

/// Renders and measures all participants in turns, one seed after the other. Pictures of the first seed are stored in
/// `folder` until the outcome is dropped. `observe` is called after every step and can stop the comparison.
///
/// # Errors
/// The store of pictures cannot be created in `folder`.
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
    for (index, &seed) in rules.seeds.iter().enumerate() {
        let input = |entry: &Entry| {
            let settings =
                Settings { seed, iterations: None, time: None, target_error: None, ..entry.settings.clone() };
            RenderInput::new(scene, camera, &settings)
        };
        let inputs: Vec<RenderInput<'_>> = entries.iter().map(input).collect();
        let sessions = inputs.iter().zip(entries).map(|(input, entry)| Session::with_time_spent(input, entry.decided));
        let turns: VecDeque<PeerTurn> = participants.peers.iter().flat_map(PeerRenders::turns).collect();
        let mut queue = Queue {
            runs: sessions.map(|session| EntryRun::new(session, rules)).collect(),
            all_turns: turns.len(),
            turns,
            peers: outcome.peers.len(),
        };
        let round = Round { seed, keep_pictures: index == 0, reference };
        loop {
            let (name, iterations, seconds, measured, is_ours);
            if let Some(turn) = queue.due() {
                let Some(found) = outcome.render_peer(turn, &mut participants, &round) else {
                    outcome.interrupted = true;
                    break;
                };
                (measured, is_ours) = (found, false);
                name = participants.peers.as_ref().map_or("", |peers| peers.peers[turn.peer].name);
                (iterations, seconds) = outcome.last_point(measured);
            } else if let Some(run) = queue.next(rules) {
                (measured, is_ours) = (outcome.step(run, &mut queue.runs[run], &mut participants, rules, &round), true);
                name = &entries[run].name;
                let session = &queue.runs[run].session;
                (iterations, seconds) = (session.iterations(), session.spent().seconds);
            } else {
                break;
            }
            let point = outcome.points.last().filter(|_| measured);
            let fraction = (index as f64 + queue.fraction(rules)) / rules.seeds.len() as f64;
            if observe(&Step { name, is_ours, iterations, seconds, fraction, point }) == Control::Stop {
                outcome.interrupted = true;
                break;
            }
        }
        outcome.end_round(queue.runs, &mut participants, &round);
        if outcome.interrupted {
            break;
        }
    }
    Ok(outcome)
}
