//! Saves the checkpoints of a render, on time and at the end.

use super::checkpoint::{self, Head};
use super::observer::{Event, Observer};
use super::request::Saving;
use crate::error::{Error, ErrorKind, Result};
use crate::render::{Clock, Session, StopReason, TimeSpent};
use std::path::PathBuf;

/// Saves the checkpoints of one render at intervals.
pub(super) struct Saver<'a> {
    saving: &'a Saving,
    head: Head,
    clock: Clock,
    /// Time of the render at which the next checkpoint is due (seconds).
    next: f64,
    /// Whether the last save of the checkpoint failed, which has been reported.
    failed: bool,
    /// Whether the file at the checkpoint's path is one of this render.
    written: bool,
}

impl<'a> Saver<'a> {
    /// Makes the saver of a render. `written`: whether the render continues from the checkpoint at this path.
    pub fn new(saving: &'a Saving, head: Head, written: bool) -> Saver<'a> {
        Saver { saving, head, clock: Clock::start(), next: saving.every, failed: false, written }
    }

    /// Saves a checkpoint if one is due. The time of the save counts as time of the render.
    pub fn save_if_due(&mut self, session: &mut Session<'_>, observer: &mut dyn Observer) {
        if self.clock.seconds() < self.next {
            return;
        }
        let mut spent = TimeSpent::default();
        spent.measure(|| self.save(session, observer));
        session.add_time(spent);
        self.next = self.clock.seconds() + self.saving.every;
    }

    /// After the last iteration: saves the state of an interrupted render, or of one whose checkpoint the user keeps.
    /// Returns the checkpoint that is no longer needed once the picture is written.
    pub fn save_at_end(
        mut self,
        session: &Session<'_>,
        stop: StopReason,
        observer: &mut dyn Observer,
    ) -> Option<PathBuf> {
        self.head.finished = stop != StopReason::Interrupted;
        if self.saving.keep || !self.head.finished {
            self.save(session, observer);
            return None;
        }
        self.written.then(|| self.saving.path.clone())
    }

    /// Saves a checkpoint. A failure is reported once until a save succeeds again.
    fn save(&mut self, session: &Session<'_>, observer: &mut dyn Observer) {
        match self.write(session) {
            Ok(()) => (self.written, self.failed) = (true, false),
            Err(error) if !std::mem::replace(&mut self.failed, true) => observer.event(Event::SaveFailed(&error)),
            Err(_) => {}
        }
    }

    fn write(&self, session: &Session<'_>) -> Result<()> {
        let path = &self.saving.path;
        let state = session.state().map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
        checkpoint::write(path, &self.head, state)
    }
}
