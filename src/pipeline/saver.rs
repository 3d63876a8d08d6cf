//! When a render is saved.

use super::Watch;
use super::checkpoint::{self, Head, Saving};
use crate::error::{Error, ErrorKind, Result};
use crate::render::{Clock, Session, StopReason, TimeSpent};
use std::path::PathBuf;

/// Saves a render every so often.
pub(super) struct Saver<'a> {
    saving: &'a Saving,
    head: Head,
    clock: Clock,
    /// When it is due (seconds).
    next: f64,
    /// It has failed, and said so.
    failed: bool,
    /// The file is ours.
    written: bool,
}

impl<'a> Saver<'a> {
    /// `written`: the file is there already, for the render goes on from it.
    pub fn new(saving: &'a Saving, head: Head, written: bool) -> Saver<'a> {
        Saver { saving, head, clock: Clock::start(), next: saving.every, failed: false, written }
    }

    /// Saves the state if that is due; its time is the render's.
    pub fn save_if_due(&mut self, session: &mut Session<'_>, watch: &mut dyn Watch) {
        if self.clock.seconds() < self.next {
            return;
        }
        let mut spent = TimeSpent::default();
        spent.measure(|| self.save(session, watch));
        session.add_time(spent);
        self.next = self.clock.seconds() + self.saving.every;
    }

    /// After the last iteration: saves what was interrupted or is to be kept. Returns the file of a render that is
    /// done, which is no longer needed once the picture is written.
    pub fn finish(mut self, session: &Session<'_>, stop: StopReason, watch: &mut dyn Watch) -> Option<PathBuf> {
        self.head.finished = stop != StopReason::Interrupted;
        if self.saving.keep || !self.head.finished {
            self.save(session, watch);
            return None;
        }
        self.written.then(|| self.saving.path.clone())
    }

    fn save(&mut self, session: &Session<'_>, watch: &mut dyn Watch) {
        match self.write(session) {
            Ok(()) => (self.written, self.failed) = (true, false),
            // Said once as long as it lasts.
            Err(error) if !std::mem::replace(&mut self.failed, true) => watch.unsaved(&error),
            Err(_) => {}
        }
    }

    fn write(&self, session: &Session<'_>) -> Result<()> {
        let path = &self.saving.path;
        let state = session.state().map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
        checkpoint::write(path, &self.head, state)
    }
}
