//! Ends an iteration early, by a stop request or a deadline. Its units of work poll [`Stop::should_abort`]. Once a poll
//! returns true, the whole iteration is aborted and its results are discarded.
//!
//! The first iteration is the exception, because a picture needs one: its deadline cuts long paths instead. Walks poll
//! [`Stop::should_end_path`] every few vertices.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// Value of [`State::deadline`] without a deadline.
const NO_DEADLINE: u64 = u64::MAX;

/// A stop request and a deadline that units of work poll. Clones share the state.
#[derive(Clone, Debug)]
pub struct Stop {
    requested: Arc<AtomicBool>,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    created: Instant,
    /// Nanoseconds after `created`, or [`NO_DEADLINE`].
    deadline: AtomicU64,
    /// Whether the deadline cuts long paths, and does not abort the iteration.
    deadline_cuts: AtomicBool,
    aborted: AtomicBool,
    has_cut: AtomicBool,
}

impl Default for Stop {
    /// A stop that nobody has requested, without a deadline.
    fn default() -> Stop {
        Stop::from_flag(Arc::default())
    }
}

impl Stop {
    /// A stop that is requested by setting `requested` to true, also from another thread.
    #[allow(clippy::disallowed_methods, reason = "a deadline decides when a render stops, and nothing else")]
    pub fn from_flag(requested: Arc<AtomicBool>) -> Stop {
        let (created, deadline) = (Instant::now(), AtomicU64::new(NO_DEADLINE));
        let [deadline_cuts, aborted, has_cut] = [const { AtomicBool::new(false) }; 3];
        Stop { requested, state: Arc::new(State { created, deadline, deadline_cuts, aborted, has_cut }) }
    }

    /// Starts an iteration that is not aborted, with a deadline `seconds` from now; without a deadline if `None`.
    pub fn start_iteration(&self, seconds: Option<f64>) {
        self.start(seconds, false);
    }

    /// Starts an iteration whose long paths are cut after `seconds`; never if `None`.
    pub fn start_first_iteration(&self, seconds: Option<f64>) {
        self.start(seconds, true);
    }

    fn start(&self, seconds: Option<f64>, cuts: bool) {
        let end = |seconds: f64| (self.nanoseconds() as f64 + 1e9 * seconds.max(0.0)) as u64;
        self.state.deadline.store(seconds.map_or(NO_DEADLINE, end), Ordering::Relaxed);
        self.state.deadline_cuts.store(cuts, Ordering::Relaxed);
        self.state.aborted.store(false, Ordering::Relaxed);
    }

    /// Forgets that paths have been cut, before the pilot of a render.
    pub fn forget_cuts(&self) {
        self.state.has_cut.store(false, Ordering::Relaxed);
    }

    fn nanoseconds(&self) -> u64 {
        self.state.created.elapsed().as_nanos() as u64
    }

    /// Whether the user has requested a stop. The deadline does not count.
    pub fn requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// Whether a unit of work must end, because of a request, the deadline or an earlier abort. If so, the iteration
    /// becomes aborted.
    pub fn should_abort(&self) -> bool {
        let late = || !self.state.deadline_cuts.load(Ordering::Relaxed) && self.is_late();
        let ends = self.aborted() || self.requested() || late();
        if ends {
            self.state.aborted.store(true, Ordering::Relaxed);
        }
        ends
    }

    /// Whether a path must end where it is, because of an abort or a deadline that cuts paths.
    pub fn should_end_path(&self) -> bool {
        if self.has_cut_paths() || self.should_abort() {
            return true;
        }
        let cuts = self.state.deadline_cuts.load(Ordering::Relaxed) && self.is_late();
        if cuts {
            self.state.has_cut.store(true, Ordering::Relaxed);
        }
        cuts
    }

    /// Whether a deadline has cut paths of the render.
    pub fn has_cut_paths(&self) -> bool {
        self.state.has_cut.load(Ordering::Relaxed)
    }

    fn is_late(&self) -> bool {
        let deadline = self.state.deadline.load(Ordering::Relaxed);
        deadline != NO_DEADLINE && self.nanoseconds() >= deadline
    }

    /// Whether the iteration that was started last is aborted: a unit of its work had to end early.
    pub fn aborted(&self) -> bool {
        self.state.aborted.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An aborted iteration stays aborted until the next iteration starts.
    #[test]
    fn an_aborted_iteration_stays_aborted() {
        let requested = Arc::new(AtomicBool::new(false));
        let stop = Stop::from_flag(Arc::clone(&requested));
        stop.start_iteration(None);
        assert!(!stop.should_abort() && !stop.aborted());
        requested.store(true, Ordering::Relaxed);
        assert!(!stop.aborted(), "no unit has polled since the request");
        assert!(stop.clone().should_abort() && stop.aborted());
        requested.store(false, Ordering::Relaxed);
        assert!(stop.should_abort());
        stop.start_iteration(Some(3600.0));
        assert!(!stop.should_abort());
        stop.start_iteration(Some(-1.0));
        assert!(stop.should_abort() && !stop.requested());
    }

    /// The deadline of a first iteration ends its paths, and a request still aborts it.
    #[test]
    fn the_deadline_of_the_first_iteration_cuts_paths() {
        let requested = Arc::new(AtomicBool::new(false));
        let stop = Stop::from_flag(Arc::clone(&requested));
        stop.start_first_iteration(Some(3600.0));
        assert!(!stop.should_end_path() && !stop.has_cut_paths());
        stop.start_first_iteration(Some(-1.0));
        assert!(!stop.should_abort() && !stop.has_cut_paths(), "no path was long");
        assert!(stop.should_end_path() && stop.has_cut_paths() && !stop.aborted());
        stop.start_iteration(None);
        assert!(stop.has_cut_paths(), "the picture still lacks the ends of its paths");
        requested.store(true, Ordering::Relaxed);
        assert!(stop.should_abort() && stop.aborted());
        stop.forget_cuts();
        assert!(!stop.has_cut_paths());
    }
}
