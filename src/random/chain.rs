//! Primary sample space: the uniform numbers that a path is made of, as the coordinates of a Markov chain \[Kelemen et
//! al. 2002, "A Simple and Robust Mutation Candidate for the Metropolis Light Transport Algorithm"\].
//!
//! A coordinate belongs to a decision (path, vertex, purpose), as a draw does, and comes into being when that decision
//! is first made. One that a proposal does not ask for stays what it was, and catches up with all small steps since
//! when it is asked for again: n Gaussian steps are one that is `sqrt(n)` as wide \[Pharr, Jakob, Humphreys 2016, 16.4\].
//!
//! A chain is the work of one thread at a time, and its draws are asked for from deep within walks that know of no
//! chain: while one is at work it lies with the thread ([`Chain::during`]).

use super::{GOLDEN, mix, square, unit};
use glam::Vec2;
use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Standard deviation of a small step.
const STEP: f32 = 0.01;
/// Probability of a large step, which forgets all coordinates \[Kelemen et al. 2002, 3\]. Low, for chains are short and
/// start anew in every iteration.
const LARGE: f32 = 0.1;

thread_local! {
    static AT_WORK: RefCell<Option<Chain>> = const { RefCell::new(None) };
}

/// Keys are hashes already.
#[derive(Default)]
struct Keys(u64);

impl Hasher for Keys {
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
    /// Step of the chain after which it had this value.
    step: u64,
}

/// A Markov chain in primary sample space.
#[derive(Default)]
pub struct Chain {
    key: u64,
    coordinates: HashMap<u64, Coordinate, BuildHasherDefault<Keys>>,
    /// Coordinates as they were before this proposal; `None`: there were none.
    before: Vec<(u64, Option<Coordinate>)>,
    /// Accepted steps, and the last of them that was large.
    steps: u64,
    large: u64,
    /// Proposals so far.
    proposals: u64,
    /// What is proposed.
    proposed: Option<Proposal>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Proposal {
    Large,
    Small,
}

/// A key of decisions that are the chain's own.
const OWN: u64 = 0x6d6c_745f_6f77_6e00;

impl Chain {
    /// Where all coordinates are the draws of a path that is no chain's; `key` tells chains apart.
    pub fn new(key: u64) -> Chain {
        Chain { key, ..Chain::default() }
    }

    /// Says what a coordinate is at the start.
    pub fn set(&mut self, id: u64, value: Vec2) {
        self.coordinates.insert(id, Coordinate { value, step: 0 });
    }

    fn hash(&self, id: u64, salt: u64) -> u64 {
        mix(mix(self.key ^ id).wrapping_add((self.proposals ^ salt << 56).wrapping_mul(GOLDEN)))
    }

    /// A uniform number for a decision of the chain itself, about this proposal.
    fn own(&self, what: u64) -> f32 {
        unit((self.hash(OWN ^ what, 3) >> 32) as u32)
    }

    /// Begins a proposal: what is drawn from now on is its.
    pub fn propose(&mut self) {
        self.proposals += 1;
        self.proposed = Some(if self.own(1) < LARGE { Proposal::Large } else { Proposal::Small });
    }

    /// Ends the proposal, which is taken with a probability; whether it was.
    pub fn decide(&mut self, acceptance: f32) -> bool {
        let taken = self.own(2) < acceptance;
        if taken {
            self.steps += 1;
            if self.proposed == Some(Proposal::Large) {
                self.large = self.steps;
            }
            self.before.clear();
        } else {
            for (id, coordinate) in self.before.drain(..).rev() {
                match coordinate {
                    Some(coordinate) => self.coordinates.insert(id, coordinate),
                    None => self.coordinates.remove(&id),
                };
            }
        }
        self.proposed = None;
        taken
    }

    /// Does `work`, whose draws from streams that are [chained](super::Stream::chained) are this chain's. It must not
    /// share its work with other threads.
    pub fn during<T>(&mut self, work: impl FnOnce() -> T) -> T {
        AT_WORK.set(Some(std::mem::take(self)));
        let done = work();
        if let Some(chain) = AT_WORK.take() {
            *self = chain;
        }
        done
    }

    /// The coordinates of a decision, uniform on the unit square; `first` is what they are where the chain starts.
    pub(super) fn draw_here(id: u64, first: Vec2) -> Vec2 {
        AT_WORK.with_borrow_mut(|chain| chain.as_mut().map_or(first, |chain| chain.draw(id, first)))
    }

    fn draw(&mut self, id: u64, first: Vec2) -> Vec2 {
        let known = self.coordinates.get(&id).copied();
        let next = self.steps + u64::from(self.proposed.is_some());
        if let Some(known) = known
            && known.step == next
        {
            return known.value;
        }
        // Of the accepted state: a coordinate that the last large step has not been asked for is what that would have
        // drawn, at whatever time it is asked for.
        let at_large = || square(mix(mix(self.key ^ id) ^ mix(self.large)));
        let mut now = match known {
            Some(known) if known.step >= self.large => known,
            _ if self.large == 0 => Coordinate { value: first, step: 0 },
            _ => Coordinate { value: at_large(), step: self.large },
        };
        now.value = match self.proposed {
            Some(Proposal::Large) => square(self.hash(id, 1)),
            _ => stepped(now.value, (next - now.step) as f32, self.hash(id, 2)),
        };
        now.step = next;
        if self.proposed.is_some() {
            self.before.push((id, known));
        }
        self.coordinates.insert(id, now);
        now.value
    }
}

/// After so many small steps; what leaves the unit square comes back at the other side.
fn stepped(at: Vec2, steps: f32, bits: u64) -> Vec2 {
    if steps == 0.0 {
        return at;
    }
    // Box and Muller: two independent normal numbers.
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

    /// A chain whose proposals are all taken visits the unit square evenly, and each axis: squared deviations of counts
    /// in 16 cells from their mean, and a coordinate that is asked for rarely. A planted fault, reflecting off no
    /// border, would leave the cells.
    #[test]
    fn a_chain_is_uniform_where_all_is_accepted() {
        let stream = Streams::new(1, 1, Domain::Test).path(0).chained();
        let (often, rarely) = (stream.vertex(1), stream.vertex(2));
        let mut chain = Chain::new(7);
        let mut counts = [[0u32; 16]; 2];
        let n = 160_000;
        for i in 0..n {
            chain.propose();
            let cell = |u: Vec2| (u.x * 4.0) as usize * 4 + (u.y * 4.0) as usize;
            let (a, b) = chain.during(|| {
                let b = (i % 7 == 0).then(|| rarely.two(Purpose::Direction));
                (often.two(Purpose::Direction), b)
            });
            counts[0][cell(a)] += 1;
            if let Some(b) = b {
                counts[1][cell(b)] += 1;
            }
            assert!(chain.decide(1.0));
        }
        for (counts, n) in counts.iter().zip([n as f64, n as f64 / 7.0]) {
            // Large steps make the chain independent every few steps: samples count as n / 7.
            let expected = n / 16.0;
            let sigma = (expected * 7.0).sqrt();
            assert!(counts.iter().all(|c| (f64::from(*c) - expected).abs() < 5.0 * sigma), "{counts:?}");
        }
    }

    /// What was rejected leaves no trace, and a state is the same however often it is asked for.
    #[test]
    fn rejected_proposals_leave_the_state() {
        let stream = Streams::new(1, 1, Domain::Test).path(0);
        let (draws, plain) = (stream.chained().vertex(1), stream.vertex(1));
        let mut chain = Chain::new(7);
        let first = chain.during(|| draws.two(Purpose::Direction));
        assert_eq!(first, plain.two(Purpose::Direction));
        let mut moved = 0;
        for _ in 0..100 {
            chain.propose();
            moved += u32::from(chain.during(|| draws.two(Purpose::Direction)) != first);
            assert!(!chain.decide(0.0));
            assert_eq!(chain.during(|| draws.two(Purpose::Direction)), first);
        }
        assert_eq!(moved, 100);
    }
}
