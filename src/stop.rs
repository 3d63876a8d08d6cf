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
    asked: Arc<AtomicBool>,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    begun: Instant,
    /// Nanoseconds after that.
    deadline: AtomicU64,
    given_up: AtomicBool,
}

impl Default for Stop {
    /// Nobody asks for an end.
    fn default() -> Stop {
        Stop::by(Arc::default())
    }
}

impl Stop {
    /// One that tells to end as soon as `asked` is set.
    #[allow(clippy::disallowed_methods, reason = "a deadline decides when a render stops, and nothing else")]
    pub fn by(asked: Arc<AtomicBool>) -> Stop {
        let (deadline, given_up) = (AtomicU64::new(NEVER), AtomicBool::new(false));
        Stop { asked, state: Arc::new(State { begun: Instant::now(), deadline, given_up }) }
    }

    /// Begins an iteration, which must end within so many seconds if there is a number.
    pub fn begin(&self, seconds: Option<f64>) {
        let end = |seconds: f64| (self.nanoseconds() as f64 + 1e9 * seconds.max(0.0)) as u64;
        self.state.deadline.store(seconds.map_or(NEVER, end), Ordering::Relaxed);
        self.state.given_up.store(false, Ordering::Relaxed);
    }

    fn nanoseconds(&self) -> u64 {
        self.state.begun.elapsed().as_nanos() as u64
    }

    /// Whether an end was asked for, by whatever but the clock.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Asks whether a unit of work is to end. If so, its iteration is given up.
    pub fn gives_up(&self) -> bool {
        let late = || {
            let deadline = self.state.deadline.load(Ordering::Relaxed);
            deadline != NEVER && self.nanoseconds() >= deadline
        };
        let ends = self.gave_up() || self.asked() || late();
        if ends {
            self.state.given_up.store(true, Ordering::Relaxed);
        }
        ends
    }

    /// Whether the iteration that was begun last is given up.
    pub fn gave_up(&self) -> bool {
        self.state.given_up.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Units end from the moment on that an end is asked for or time is up, until another iteration begins.
    #[test]
    fn an_iteration_is_given_up_once_and_for_all() {
        let asked = Arc::new(AtomicBool::new(false));
        let stop = Stop::by(Arc::clone(&asked));
        stop.begin(None);
        assert!(!stop.gives_up() && !stop.gave_up());
        asked.store(true, Ordering::Relaxed);
        assert!(!stop.gave_up(), "all units were done before");
        assert!(stop.clone().gives_up() && stop.gave_up());
        asked.store(false, Ordering::Relaxed);
        assert!(stop.gives_up());
        stop.begin(Some(3600.0));
        assert!(!stop.gives_up());
        stop.begin(Some(-1.0));
        assert!(stop.gives_up() && !stop.asked());
    }
}
