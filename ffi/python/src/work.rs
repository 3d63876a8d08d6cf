//! Runs work without the interpreter's lock, while the calling thread serves Python.
//!
//! The work runs in a separate thread pool. The calling thread waits with the lock released. It checks for signals
//! (Ctrl-C), which Python delivers only to its main thread, and runs callbacks at the request of the work, so that a callback
//! runs in the thread that made the call.

use crate::error::{SceneWarning, in_python, raised, usage};
use caustique::error::{Error, ErrorKind, Result};
use caustique::stop::Stop;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::ffi::CString;
use std::num::NonZero;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

/// Time between two checks for signals, such as Ctrl-C, while work runs.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(100);

/// A task that work on other threads leaves to the calling Python thread. Returns whether the work continues.
type Task = Box<dyn FnOnce(Python<'_>) -> PyResult<bool> + Send>;

/// The connection of the work on other threads to the Python thread that has called it.
pub struct Caller {
    tasks: Sender<(Task, Sender<()>)>,
    stopped: Arc<AtomicBool>,
}

impl Caller {
    /// Runs a task in the calling Python thread and waits for its end.
    pub fn run(&self, task: impl FnOnce(Python<'_>) -> PyResult<bool> + Send + 'static) {
        let (done, answered) = channel();
        if self.tasks.send((Box::new(task), done)).is_ok() {
            // If the calling thread is gone, nothing is left to wait for.
            let _ = answered.recv();
        }
    }

    /// The flag that stops the work.
    pub fn stop(&self) -> Stop {
        Stop::from_flag(Arc::clone(&self.stopped))
    }

    /// Whether the work must stop: after a signal, or a callback that returned False or raised.
    pub fn stops(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Issues texts as Python warnings, in the calling thread. If the user turns warnings into errors, they stop the
    /// work.
    pub fn warn(&self, texts: &[String]) {
        let texts = texts.to_vec();
        if !texts.is_empty() {
            self.run(move |py| warn(py, &texts).map(|()| true));
        }
    }
}

/// Issues texts as Python warnings.
pub fn warn(py: Python<'_>, texts: &[String]) -> PyResult<()> {
    let category = py.get_type::<SceneWarning>();
    texts.iter().try_for_each(|text| {
        let text = CString::new(in_python(text).replace('\0', " ")).unwrap_or_default();
        PyErr::warn(py, &category, &text, 1)
    })
}

/// The result of work, and the Python exception that was raised meanwhile.
pub struct Done<T> {
    /// Result of the work.
    pub result: Result<T>,
    /// The Python exception of a signal or a callback; `None` if there was none.
    pub raised: Option<PyErr>,
}

impl<T> Done<T> {
    /// The result, for work that has no partial result when it is stopped; the exception if there was one.
    pub fn whole(self) -> PyResult<T> {
        match self.raised {
            Some(error) => Err(error),
            None => self.result.map_err(raised),
        }
    }
}

/// Largest number of threads on machines with few cores.
const MAX_THREADS: usize = 64;
/// Largest number of threads per core on machines with many cores.
const MAX_THREADS_PER_CORE: usize = 4;

/// Runs a job with `threads` threads, while the calling Python thread checks for signals; 0 takes all cores.
///
/// # Errors
/// There are far fewer cores, or the system starts no threads.
pub fn work<T: Send>(
    py: Python<'_>,
    threads: usize,
    job: impl FnOnce(&Caller) -> Result<T> + Send,
) -> PyResult<Done<T>> {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let most = MAX_THREADS.max(MAX_THREADS_PER_CORE * cores);
    if threads > most {
        let hint = format!("at most {most}, because there are {cores} cores; 0 takes all of them");
        return Err(usage(format!("threads={threads} is out of range"), hint));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|cause| raised(Error::new(ErrorKind::Io, "threads", cause).hint("ask for fewer threads")))?;
    let stopped = Arc::new(AtomicBool::new(false));
    Ok(py.detach(|| {
        thread::scope(|scope| {
            let (sender, tasks) = channel::<(Task, Sender<()>)>();
            let caller = Caller { tasks: sender, stopped: Arc::clone(&stopped) };
            let worker = scope.spawn(move || pool.install(|| job(&caller)));
            let mut first = None;
            loop {
                let (task, done) = match tasks.recv_timeout(SIGNAL_INTERVAL) {
                    Ok((task, done)) => (Some(task), Some(done)),
                    Err(RecvTimeoutError::Timeout) => (None, None),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                // After an exception, call no Python code until the work has ended.
                if first.is_none() {
                    let answer = Python::attach(|py| {
                        py.check_signals()?;
                        task.map_or(Ok(true), |task| task(py))
                    });
                    if !matches!(answer, Ok(true)) {
                        stopped.store(true, Ordering::Relaxed);
                    }
                    first = answer.err();
                }
                if let Some(done) = done {
                    // The work waits for this answer.
                    let _ = done.send(());
                }
            }
            match worker.join() {
                Ok(result) => Done { result, raised: first },
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }))
}
