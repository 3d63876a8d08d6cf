//! Work without the interpreter's lock, and what the calling thread does in Python meanwhile.
//!
//! A thread pool of its own works. The calling thread waits with the lock released: it looks for signals (Ctrl-C),
//! which Python shows to its main thread alone, and calls back where the work asks for it, so that a callback runs in
//! the thread that its author expects.

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

/// Between two looks for signals.
const LOOK: Duration = Duration::from_millis(100);

/// What is done in Python; whether the work is to go on.
type Request = Box<dyn FnOnce(Python<'_>) -> PyResult<bool> + Send>;

/// The calling thread as the work sees it.
pub struct Caller {
    requests: Sender<(Request, Sender<()>)>,
    stopped: Arc<AtomicBool>,
}

impl Caller {
    /// Has something done in Python, and waits for it.
    pub fn ask(&self, request: impl FnOnce(Python<'_>) -> PyResult<bool> + Send + 'static) {
        let (done, answered) = channel();
        if self.requests.send((Box::new(request), done)).is_ok() {
            // An answer that does not come is no other than one that does.
            let _ = answered.recv();
        }
    }

    /// What tells the work to end.
    pub fn stop(&self) -> Stop {
        Stop::from_flag(Arc::clone(&self.stopped))
    }

    /// Whether an end was asked for: by a signal, by a callback that said False, or by one that raised.
    pub fn stops(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Issues warnings; where the user has made errors of them they end the work.
    pub fn warn(&self, texts: &[String]) {
        let texts = texts.to_vec();
        if !texts.is_empty() {
            self.ask(move |py| warn(py, &texts).map(|()| true));
        }
    }
}

/// Issues warnings.
pub fn warn(py: Python<'_>, texts: &[String]) -> PyResult<()> {
    let category = py.get_type::<SceneWarning>();
    texts.iter().try_for_each(|text| {
        let text = CString::new(in_python(text).replace('\0', " ")).unwrap_or_default();
        PyErr::warn(py, &category, &text, 1)
    })
}

/// What work has come to, and what was raised in Python meanwhile.
pub struct Done<T> {
    /// The result.
    pub result: Result<T>,
    /// A signal's exception, or that of a callback.
    pub raised: Option<PyErr>,
}

impl<T> Done<T> {
    /// The result alone, of work that leaves nothing when it is stopped.
    pub fn whole(self) -> PyResult<T> {
        match self.raised {
            Some(error) => Err(error),
            None => self.result.map_err(raised),
        }
    }
}

/// Threads that can be asked for on any machine; on large ones `THREADS_PER_CORE` for each core.
const THREADS: usize = 64;
const THREADS_PER_CORE: usize = 4;

/// Does a job with so many threads; 0 takes all cores.
///
/// # Errors
/// There are far fewer cores, or the system refuses.
pub fn work<T: Send>(
    py: Python<'_>,
    threads: usize,
    job: impl FnOnce(&Caller) -> Result<T> + Send,
) -> PyResult<Done<T>> {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let most = THREADS.max(THREADS_PER_CORE * cores);
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
            let (requests, asked) = channel::<(Request, Sender<()>)>();
            let caller = Caller { requests, stopped: Arc::clone(&stopped) };
            let worker = scope.spawn(move || pool.install(|| job(&caller)));
            let mut first = None;
            loop {
                let (request, done) = match asked.recv_timeout(LOOK) {
                    Ok((request, done)) => (Some(request), Some(done)),
                    Err(RecvTimeoutError::Timeout) => (None, None),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                // After an exception Python is left alone until the work has ended.
                if first.is_none() {
                    let answer = Python::attach(|py| {
                        py.check_signals()?;
                        request.map_or(Ok(true), |request| request(py))
                    });
                    if !matches!(answer, Ok(true)) {
                        stopped.store(true, Ordering::Relaxed);
                    }
                    first = answer.err();
                }
                if let Some(done) = done {
                    // The work waits for it.
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
