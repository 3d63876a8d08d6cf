//! What ends an iteration before it is done. Its units of work ask; once one of them was told to end, the iteration is
//! given up as a whole, and what it has measured counts for nothing.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// No deadline.
const NEVER: u64 = u64::MAX;

/// Tells units of work to end. Clones share what they know.
#[derive(Clone, Debug)]
pub struct Stop {
    requested: Arc<AtomicBool>,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    begun: Instant,
    /// Nanoseconds after that.
    deadline: AtomicU64,
    aborted: AtomicBool,
}

impl Default for Stop {
    /// Nobody asks for an end.
    fn default() -> Stop {
        Stop::from_flag(Arc::default())
    }
}

impl Stop {
    /// One that tells to end as soon as `asked` is set.
    #[allow(clippy::disallowed_methods, reason = "a deadline decides when a render stops, and nothing else")]
    pub fn from_flag(requested: Arc<AtomicBool>) -> Stop {
        let (deadline, aborted) = (AtomicU64::new(NEVER), AtomicBool::new(false));
        Stop { requested, state: Arc::new(State { begun: Instant::now(), deadline, aborted }) }
    }

    /// Begins an iteration, which must end within so many seconds if there is a number.
    pub fn start_iteration(&self, seconds: Option<f64>) {
        let end = |seconds: f64| (self.nanoseconds() as f64 + 1e9 * seconds.max(0.0)) as u64;
        self.state.deadline.store(seconds.map_or(NEVER, end), Ordering::Relaxed);
        self.state.aborted.store(false, Ordering::Relaxed);
    }

    fn nanoseconds(&self) -> u64 {
        self.state.begun.elapsed().as_nanos() as u64
    }

    /// Whether an end was asked for, by whatever but the clock.
    pub fn requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// Asks whether a unit of work is to end. If so, its iteration is given up.
    pub fn should_abort(&self) -> bool {
        let late = || {
            let deadline = self.state.deadline.load(Ordering::Relaxed);
            deadline != NEVER && self.nanoseconds() >= deadline
        };
        let ends = self.aborted() || self.requested() || late();
        if ends {
            self.state.aborted.store(true, Ordering::Relaxed);
        }
        ends
    }

    /// Whether the iteration that was begun last is given up.
    pub fn aborted(&self) -> bool {
        self.state.aborted.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Units end from the moment on that an end is asked for or time is up, until another iteration begins.
    #[test]
    fn an_iteration_is_given_up_once_and_for_all() {
        let asked = Arc::new(AtomicBool::new(false));
        let stop = Stop::from_flag(Arc::clone(&asked));
        stop.start_iteration(None);
        assert!(!stop.should_abort() && !stop.aborted());
        asked.store(true, Ordering::Relaxed);
        assert!(!stop.aborted(), "all units were done before");
        assert!(stop.clone().should_abort() && stop.aborted());
        asked.store(false, Ordering::Relaxed);
        assert!(stop.should_abort());
        stop.start_iteration(Some(3600.0));
        assert!(!stop.should_abort());
        stop.start_iteration(Some(-1.0));
        assert!(stop.should_abort() && !stop.requested());
    }
}
