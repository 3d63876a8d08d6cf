//! Primary sample space: a Markov chain whose state is the uniform numbers that determine a path \[Kelemen et al. 2002,
//! "A Simple and Robust Mutation Strategy for the Metropolis Light Transport Algorithm"\].
//!
//! Each decision (path, vertex, purpose) has its own coordinates, a point of the unit square, created when a path first
//! makes that decision. A proposal updates only the coordinates that its path reads. The next proposal that reads the
//! others applies all small steps in between at once: n Gaussian steps are one step of `sqrt(n)` times the standard
//! deviation \[Pharr, Jakob, Humphreys 2016, 16.4\].
//!
//! Path code reads random numbers through [`Stream`](super::Stream) and does not know about chains, so the active chain
//! is a thread-local variable ([`Chain::run`]).

use super::{GOLDEN, mix, square, unit};
use glam::Vec2;
use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Standard deviation of a small step, in the unit square of a coordinate pair.
const STEP: f32 = 0.01;
/// Probability of a large step, which redraws all coordinates \[Kelemen et al. 2002, 3\]. Low, because chains are short
/// and restart in every iteration.
const LARGE_STEP_PROBABILITY: f32 = 0.1;

thread_local! {
    static ACTIVE: RefCell<Option<Chain>> = const { RefCell::new(None) };
}

/// Hasher for map keys that are hashes already; it returns them unchanged.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.0 = mix(self.0 ^ u64::from(*byte)));
    }

    fn write_u64(&mut self, key: u64) {
        self.0 = key;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[derive(Clone, Copy)]
struct Coordinate {
    value: Vec2,
    /// Number of accepted steps of the chain up to which `value` is current; later ones are applied when it is read.
    step: u64,
}

/// A Markov chain in primary sample space, whose state is the random numbers of a path.
#[derive(Default)]
pub struct Chain {
    key: u64,
    coordinates: HashMap<u64, Coordinate, BuildHasherDefault<KeyHasher>>,
    /// Values before the current proposal of the coordinates that it has changed, by id, to restore them if it is
    /// rejected. `None`: the proposal has created the coordinate.
    replaced: Vec<(u64, Option<Coordinate>)>,
    /// Number of accepted steps.
    steps: u64,
    /// Value of `steps` after the last accepted large step.
    last_large_step: u64,
    /// Number of proposals so far.
    proposals: u64,
    /// The current proposal; `None` if there is none to accept or reject.
    proposed: Option<Proposal>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Proposal {
    Large,
    Small,
}

/// Key that separates the random numbers for steps and acceptance from all others.
const STEP_KEY: u64 = 0x6d6c_745f_6f77_6e00;

impl Chain {
    /// A chain that starts at the ordinary random numbers of its first path. Chains of different `key` are independent.
    pub fn new(key: u64) -> Chain {
        Chain { key, ..Chain::default() }
    }

    /// Sets the initial value of coordinate pair `id` (see [`Draws::id`](super::Draws::id)), a point of the unit
    /// square.
    pub fn set_initial(&mut self, id: u64, value: Vec2) {
        self.coordinates.insert(id, Coordinate { value, step: 0 });
    }

    fn hash(&self, id: u64, salt: u64) -> u64 {
        mix(mix(self.key ^ id).wrapping_add((self.proposals ^ salt << 56).wrapping_mul(GOLDEN)))
    }

    /// A uniform number in [0, 1) for decision number `decision` about the current proposal.
    fn step_draw(&self, decision: u64) -> f32 {
        unit((self.hash(STEP_KEY ^ decision, 3) >> 32) as u32)
    }

    /// Begins a proposal: coordinates that are read from now on are mutated.
    pub fn propose(&mut self) {
        self.proposals += 1;
        let large = self.step_draw(1) < LARGE_STEP_PROBABILITY;
        self.proposed = Some(if large { Proposal::Large } else { Proposal::Small });
    }

    /// Accepts the current proposal with the probability `acceptance`, else restores the state before it. Returns
    /// whether it was accepted.
    pub fn accept_or_reject(&mut self, acceptance: f32) -> bool {
        let accepted = self.step_draw(2) < acceptance;
        if accepted {
            self.steps += 1;
            if self.proposed == Some(Proposal::Large) {
                self.last_large_step = self.steps;
            }
            self.replaced.clear();
        } else {
            for (id, coordinate) in self.replaced.drain(..).rev() {
                match coordinate {
                    Some(coordinate) => self.coordinates.insert(id, coordinate),
                    None => self.coordinates.remove(&id),
                };
            }
        }
        self.proposed = None;
        accepted
    }

    /// Runs `trace`, which reads this chain wherever it draws from a [chained](super::Stream::chained) stream. `trace`
    /// must stay on this thread.
    pub fn run<T>(&mut self, trace: impl FnOnce() -> T) -> T {
        ACTIVE.set(Some(std::mem::take(self)));
        let result = trace();
        if let Some(chain) = ACTIVE.take() {
            *self = chain;
        }
        result
    }

    /// The coordinates of decision `id` in the active chain, a point of the unit square. `first` is their value in the
    /// chain's initial state, and the result without an active chain.
    pub(super) fn draw_active(id: u64, first: Vec2) -> Vec2 {
        ACTIVE.with_borrow_mut(|chain| chain.as_mut().map_or(first, |chain| chain.draw(id, first)))
    }

    fn draw(&mut self, id: u64, first: Vec2) -> Vec2 {
        let known = self.coordinates.get(&id).copied();
        let next = self.steps + u64::from(self.proposed.is_some());
        if let Some(known) = known
            && known.step == next
        {
            return known.value;
        }
        // The accepted state. If the last large step did not read this coordinate, its value there is a hash of the
        // step, so it does not matter when it is read.
        let at_large_step = || square(mix(mix(self.key ^ id) ^ mix(self.last_large_step)));
        let mut now = match known {
            Some(known) if known.step >= self.last_large_step => known,
            _ if self.last_large_step == 0 => Coordinate { value: first, step: 0 },
            _ => Coordinate { value: at_large_step(), step: self.last_large_step },
        };
        now.value = match self.proposed {
            Some(Proposal::Large) => square(self.hash(id, 1)),
            _ => apply_small_steps(now.value, (next - now.step) as f32, self.hash(id, 2)),
        };
        now.step = next;
        if self.proposed.is_some() {
            self.replaced.push((id, known));
        }
        self.coordinates.insert(id, now);
        now.value
    }
}

/// The point `at` after `steps` small steps, wrapped around the unit square.
fn apply_small_steps(at: Vec2, steps: f32, bits: u64) -> Vec2 {
    if steps == 0.0 {
        return at;
    }
    // Box-Muller transform: two independent normal numbers.
    let u = square(bits);
    let r = (-2.0 * (1.0 - u.x).ln()).sqrt() * STEP * steps.sqrt();
    let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
    let wrapped = at + Vec2::new(r * cos, r * sin);
    (wrapped - wrapped.floor()).min(Vec2::splat(1.0 - f32::EPSILON))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Streams};

    /// A chain that accepts every proposal visits 16 cells of the unit square equally often, within 5 sigma. This also
    /// holds for a coordinate that only every seventh path reads.
    #[test]
    fn a_chain_that_accepts_every_proposal_is_uniform() {
        let stream = Streams::new(1, 1, Domain::Test).path(0).chained();
        let (often, rarely) = (stream.vertex(1), stream.vertex(2));
        let mut chain = Chain::new(7);
        let mut counts = [[0u32; 16]; 2];
        let n = 160_000;
        for i in 0..n {
            chain.propose();
            let cell = |u: Vec2| (u.x * 4.0) as usize * 4 + (u.y * 4.0) as usize;
            let (a, b) = chain.run(|| {
                let b = (i % 7 == 0).then(|| rarely.two(Purpose::Direction));
                (often.two(Purpose::Direction), b)
            });
            counts[0][cell(a)] += 1;
            if let Some(b) = b {
                counts[1][cell(b)] += 1;
            }
            assert!(chain.accept_or_reject(1.0));
        }
        for (counts, n) in counts.iter().zip([n as f64, n as f64 / 7.0]) {
            // Large steps make the chain independent every few steps: samples count as n / 7.
            let expected = n / 16.0;
            let sigma = (expected * 7.0).sqrt();
            assert!(counts.iter().all(|c| (f64::from(*c) - expected).abs() < 5.0 * sigma), "{counts:?}");
        }
    }

    /// A rejected proposal changes nothing, and reading a coordinate twice gives the same value.
    #[test]
    fn rejected_proposals_leave_the_state_unchanged() {
        let stream = Streams::new(1, 1, Domain::Test).path(0);
        let (draws, plain) = (stream.chained().vertex(1), stream.vertex(1));
        let mut chain = Chain::new(7);
        let first = chain.run(|| draws.two(Purpose::Direction));
        assert_eq!(first, plain.two(Purpose::Direction));
        let mut moved = 0;
        for _ in 0..100 {
            chain.propose();
            moved += u32::from(chain.run(|| draws.two(Purpose::Direction)) != first);
            assert!(!chain.accept_or_reject(0.0));
            assert_eq!(chain.run(|| draws.two(Purpose::Direction)), first);
        }
        assert_eq!(moved, 100);
    }
}
