//! The commands that wait: a thread reads standard input, so that a command can end the picture that renders.

use super::command::{self, Command, Kind};
use super::outbox;
use caustique::error::{Error, ErrorKind, Result};
use caustique::stop::Stop;
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{BufRead, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Longest line of a command, in bytes.
const MAX_LINE_BYTES: u64 = 1 << 20;
/// Largest number of commands that wait.
const MAX_WAITING: usize = 1024;

/// The commands that wait, and the one that is under way.
pub struct Inbox {
    state: Mutex<State>,
    arrived: Condvar,
    /// Set to end what is under way.
    stop: Arc<AtomicBool>,
    /// Whether the program is to end.
    closed: AtomicBool,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Command>,
    /// Whether any further command ends the one under way, which sends pictures.
    yields: bool,
}

impl Inbox {
    /// Starts to read commands.
    ///
    /// # Errors
    /// The system has no thread.
    pub fn open() -> Result<Arc<Inbox>> {
        let (state, closed) = (Mutex::default(), AtomicBool::new(false));
        let inbox = Arc::new(Inbox { state, arrived: Condvar::new(), stop: Arc::default(), closed });
        let reader = Arc::clone(&inbox);
        let started = std::thread::Builder::new().name("commands".into()).spawn(move || reader.read());
        started.map_err(|cause| Error::new(ErrorKind::Io, "threads", cause))?;
        Ok(inbox)
    }

    /// The flag that ends what is under way.
    pub fn stop(&self) -> Stop {
        Stop::from_flag(Arc::clone(&self.stop))
    }

    /// Whether the program is to end, so that nobody wants a picture any more.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    /// Waits for the next command, which is under way from then on. `None` if the program is to end.
    pub fn next(&self) -> Option<Command> {
        let mut state = self.lock();
        state.yields = false;
        loop {
            if self.is_closed() {
                return None;
            }
            if let Some(command) = state.waiting.pop_front() {
                state.yields = matches!(command.kind, Kind::View(_));
                // Whatever waits behind a picture replaces it.
                self.stop.store(state.yields && !state.waiting.is_empty(), Ordering::Relaxed);
                return Some(command);
            }
            state = self.arrived.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads lines until standard input ends or a command ends the program.
    fn read(&self) {
        let mut input = std::io::stdin().lock();
        let mut line = Vec::new();
        loop {
            line.clear();
            match input.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
                Ok(0) | Err(_) => return self.close(),
                Ok(_) => {}
            }
            if line.len() as u64 == MAX_LINE_BYTES && !line.ends_with(b"\n") {
                let error = fault(format!("its line is longer than {MAX_LINE_BYTES} bytes"));
                outbox::error(&Value::Null, &error.hint("send meshes and pictures as files"));
                if !skip_line(&mut input) {
                    return self.close();
                }
                continue;
            }
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            match command::parse(&line) {
                Ok(Command { kind: Kind::Quit, .. }) => return self.close(),
                Ok(command) => self.take(command),
                Err((id, error)) => outbox::error(&id, &error),
            }
        }
    }

    /// Adds a command to those that wait, and ends the picture under way.
    fn take(&self, command: Command) {
        let mut state = self.lock();
        if let Kind::Stop = command.kind {
            let (pictures, others) = state
                .waiting
                .drain(..)
                .partition(|command| matches!(command.kind, Kind::View(_) | Kind::Render { .. }));
            state.waiting = others;
            self.stop.store(true, Ordering::Relaxed);
            let pictures: VecDeque<Command> = pictures;
            pictures.iter().for_each(|command| outbox::stopped(&command.id, 0));
        } else if state.waiting.len() == MAX_WAITING {
            let error = fault(format!("{MAX_WAITING} commands wait already"));
            return outbox::error(&command.id, &error.hint("wait for the answers to earlier commands"));
        } else {
            if state.yields {
                self.stop.store(true, Ordering::Relaxed);
            }
            state.waiting.push_back(command);
        }
        self.arrived.notify_one();
    }

    fn close(&self) {
        // The lock, so that `next` does not begin to wait meanwhile.
        let _state = self.lock();
        self.closed.store(true, Ordering::Relaxed);
        self.stop.store(true, Ordering::Relaxed);
        self.arrived.notify_one();
    }
}

fn fault(cause: String) -> Error {
    Error::new(ErrorKind::Usage, "command", cause)
}

/// Skips the rest of a line. Returns false if the input ends.
fn skip_line(input: &mut impl BufRead) -> bool {
    let mut rest = Vec::new();
    loop {
        rest.clear();
        match input.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut rest) {
            Ok(0) | Err(_) => return false,
            Ok(_) if rest.ends_with(b"\n") => return true,
            Ok(_) => {}
        }
    }
}
