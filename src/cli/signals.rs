//! Ctrl-C, SIGTERM and SIGHUP (the terminal is closed): the first signal requests a stop, the second ends the program at
//! once. A thread answers Ctrl-C with a message, because signal handlers may not print.

use super::say;
use caustique::error::{Error, ErrorKind, Result};
use caustique::stop::Stop;
use caustique::system;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// The flag that the first signal to stop (such as Ctrl-C) sets.
#[derive(Clone, Debug)]
pub struct Interrupt(Arc<AtomicBool>);

/// How another program stops a render, in place of signals.
pub struct Control {
    /// Ends the iterations, also within one.
    pub stop: Stop,
    /// Whether nobody wants the picture any more.
    pub abandons: Box<dyn Fn() -> bool>,
}

/// The flag that the first signal sets, once the handlers are installed.
static INSTALLED: OnceLock<Interrupt> = OnceLock::new();

impl Interrupt {
    /// Installs the handlers of signals, once for all frames that the command renders.
    pub fn install() -> Result<Interrupt> {
        if let Some(interrupt) = INSTALLED.get() {
            return Ok(interrupt.clone());
        }
        let flag = Arc::new(AtomicBool::new(false));
        system::on_interrupt(&flag, || say("stopping; press again to stop now")).map_err(failed)?;
        Ok(INSTALLED.get_or_init(|| Interrupt(flag)).clone())
    }

    /// Whether a signal has come since the handlers were installed.
    pub fn has_come() -> bool {
        INSTALLED.get().is_some_and(Interrupt::requested)
    }

    /// Ends a run that was interrupted before its first iteration.
    ///
    /// # Errors
    /// A signal has come.
    pub fn check_before_first_iteration(&self, output: &Path) -> Result<()> {
        if !self.requested() {
            return Ok(());
        }
        let cause = "interrupted before the first iteration; nothing is written";
        Err(Error::new(ErrorKind::Interrupted, output.display(), cause))
    }

    /// The flag by which a render learns that a signal has come.
    pub fn stop() -> Stop {
        INSTALLED.get().map(|interrupt| Stop::from_flag(Arc::clone(&interrupt.0))).unwrap_or_default()
    }

    /// Whether a signal has come.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The error about a handler that cannot be installed.
pub fn failed(cause: std::io::Error) -> Error {
    Error::new(ErrorKind::Io, "signals", cause)
}
