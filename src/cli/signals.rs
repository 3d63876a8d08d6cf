//! Ctrl-C, SIGTERM and SIGHUP (the terminal is gone): the first asks for an end, the second
//! ends the program at once. Ctrl-C is answered, by a thread of its own: a handler may not print.

use super::say;
use caustique::error::{Error, ErrorKind, Result};
use caustique::stop::Stop;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Whether an end was asked for.
#[derive(Clone, Debug)]
pub struct Interrupt(Arc<AtomicBool>);

/// The one that listens.
static LISTENING: OnceLock<Interrupt> = OnceLock::new();

impl Interrupt {
    /// Listens from now on, once for all frames of a run.
    pub fn listen() -> Result<Interrupt> {
        if let Some(interrupt) = LISTENING.get() {
            return Ok(interrupt.clone());
        }
        let failed = |error| Error::new(ErrorKind::Io, "signals", error);
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            // In this order: a signal ends the program if one came before it, and only then is noted itself.
            signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&asked))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&asked)))
                .map_err(failed)?;
        }
        let mut pressed = Signals::new([SIGINT]).map_err(failed)?;
        let answer = move || {
            if pressed.forever().next().is_some() {
                say("stopping; press again to stop now");
            }
        };
        std::thread::Builder::new().spawn(answer).map_err(failed)?;
        Ok(LISTENING.get_or_init(|| Interrupt(asked)).clone())
    }

    /// Whether a signal has come since somebody listens.
    pub fn came() -> bool {
        LISTENING.get().is_some_and(Interrupt::asked)
    }

    /// Ends a run that was interrupted while it decided how to render.
    ///
    /// # Errors
    /// A signal came.
    pub fn before_the_first_iteration(&self, output: &Path) -> Result<()> {
        if !self.asked() {
            return Ok(());
        }
        let cause = "interrupted before the first iteration; nothing is written";
        Err(Error::new(ErrorKind::Interrupted, output.display(), cause))
    }

    /// What tells a render to end, once somebody listens.
    pub fn stop() -> Stop {
        LISTENING.get().map(|interrupt| Stop::from_flag(Arc::clone(&interrupt.0))).unwrap_or_default()
    }

    /// Whether a signal came.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Makes a file that grows past `ulimit -f` an error of whoever writes it; by itself that signal ends the program.
///
/// # Errors
/// The system takes no handler.
pub fn survive_large_files() -> Result<()> {
    let noted = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(SIGXFSZ, noted).map(drop).map_err(|error| Error::new(ErrorKind::Io, "signals", error))
}
