//! Progress on stderr: a bar on a terminal, lines in logs, JSON or Open Job Description for programs.

use super::{events, printable, say};
use caustique::pipeline::FINISHED_PICTURE;
pub use caustique::pipeline::plan::percent;
use caustique::render::{ExpectedError, Progress, Settings};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Form of the progress reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// A bar on a terminal, otherwise plain lines
    Auto,
    /// A line every few seconds
    Plain,
    /// Events as JSON objects, a line each: start, progress, warning, output, finish, error
    Json,
    /// Progress and status lines of Open Job Description, for render farms
    Openjd,
    /// Nothing but warnings and errors
    None,
}

impl Form {
    /// Whether people, not programs, read the reports. Programs get neither notes nor a summary.
    pub fn for_people(self) -> bool {
        matches!(self, Form::Auto | Form::Plain)
    }

    /// The form of reports for commands without `--progress`: no reports if the output is JSON.
    pub fn for_output(json: bool) -> Form {
        if json { Form::None } else { Form::Auto }
    }

    /// This form, with `Auto` replaced by `Plain` if stderr is no terminal.
    pub fn resolved(self) -> Form {
        if self == Form::Auto && !std::io::stderr().is_terminal() { Form::Plain } else { self }
    }

    /// Runs `work`, shows `what` on the terminal while it takes long, and returns the result.
    pub fn during<T>(self, what: &str, work: impl FnOnce() -> T) -> T {
        let _waiting = Waiting::begin(self, what);
        work()
    }
}

/// Seconds between two lines of plain progress reports.
pub const PLAIN_INTERVAL: f64 = 5.0;
/// Number of steps of the progress bar.
const BAR_STEPS: u64 = 1000;
/// Shortest wait that a spinner shows.
const MIN_SHOWN_WAIT: Duration = Duration::from_secs(1);
/// Time between two frames of a spinner.
const SPINNER_INTERVAL: Duration = Duration::from_millis(100);

/// The progress bar or spinner that is shown on the terminal; `None` if there is none.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Hides the progress bar on the terminal while `print` writes lines to stderr.
pub fn hide_bar_during(print: impl FnOnce()) {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match shown {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// A progress bar or spinner, shown on the terminal until it is dropped.
pub struct Bar(ProgressBar);

impl Bar {
    /// Shows the progress bar of [`Form::Auto`].
    pub fn new() -> Bar {
        Bar::show("{bar:24} {percent:>3} %  {msg}", Duration::ZERO)
    }

    fn show(template: &str, elapsed: Duration) -> Bar {
        let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr()).with_elapsed(elapsed);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        Bar(bar)
    }

    /// Sets the finished fraction, 0 to 1, and the message of the progress bar.
    pub fn set(&self, fraction: f64, message: String) {
        self.0.set_position((fraction * BAR_STEPS as f64) as u64);
        self.0.set_message(message);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = None;
        self.0.finish_and_clear();
    }
}

/// Shows work of unknown length until it is dropped: a spinner on a terminal, a line elsewhere, after
/// [`MIN_SHOWN_WAIT`].
pub struct Waiting {
    over: Option<Sender<()>>,
    teller: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins to show `what` as work of unknown length.
    pub fn begin(form: Form, what: &str) -> Waiting {
        let (over, end) = channel::<()>();
        let (form, what) = (form.resolved(), printable(what));
        let tell = move || {
            if end.recv_timeout(MIN_SHOWN_WAIT) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let spinner = (form == Form::Auto).then(|| Bar::show("{spinner} {msg}, {elapsed}", MIN_SHOWN_WAIT));
            match (&spinner, form) {
                (Some(Bar(spinner)), _) => {
                    spinner.set_message(what);
                    spinner.enable_steady_tick(SPINNER_INTERVAL);
                }
                (None, Form::Plain) => say(&what),
                (None, Form::Openjd) => say(&format!("openjd_status: {what}")),
                (None, _) => {}
            }
            // Nothing is sent: the channel ends with its sender when `Waiting` is dropped.
            let _ = end.recv();
        };
        Waiting { over: Some(over), teller: std::thread::Builder::new().spawn(tell).ok() }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.over = None;
        if let Some(teller) = self.teller.take() {
            let _ = teller.join();
        }
    }
}

/// The position of a frame among the frames that one command renders.
#[derive(Clone, Copy, Debug)]
pub struct FrameOfRun {
    /// Number of the frame in the animation.
    pub frame: u32,
    /// Number of frames that the command renders before this one.
    pub before: usize,
    /// Number of frames that the command renders.
    pub count: usize,
}

/// Prints the progress of one render.
pub struct Reporter {
    form: Form,
    turn: Option<FrameOfRun>,
    bar: Option<Bar>,
    first: Option<Waiting>,
    time: Option<f64>,
    next_line: f64,
}

/// The event `progress` of one iteration. Scripts rely on its keys.
#[derive(Serialize)]
struct Line {
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u32>,
    iteration: u64,
    iterations: Option<u64>,
    seconds: f64,
    remaining: Option<f64>,
    light_paths: u64,
    error: Option<f64>,
    error_of: &'static str,
    /// A smaller relative error, and the seconds until the render reaches it; `None` if they are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<ExpectedError>,
}

impl Reporter {
    /// Makes a reporter for a render with these settings. `turn` is `None` unless the command renders several frames.
    pub fn new(form: Form, settings: &Settings, turn: Option<FrameOfRun>) -> Reporter {
        let first = Some(Waiting::begin(form, "first iteration"));
        let form = form.resolved();
        Reporter { form, turn, bar: None, first, time: settings.time, next_line: 0.0 }
    }

    /// Prints the state of the render after an iteration, if a line or an update of the bar is due.
    pub fn report(&mut self, progress: &Progress) {
        self.first = None;
        match self.form {
            Form::Auto => {
                let fraction = self.fraction(progress);
                let sentence = self.sentence(progress);
                self.bar.get_or_insert_with(Bar::new).set(fraction, sentence);
            }
            Form::Plain => {
                let last = progress.iterations == Some(progress.iteration);
                if progress.seconds >= self.next_line || last {
                    self.next_line = progress.seconds + PLAIN_INTERVAL;
                    say(&self.sentence(progress));
                }
            }
            Form::Json => {
                let Progress {
                    iteration, iterations, seconds, remaining, light_paths, error_coverage, expected, ..
                } = *progress;
                let error = progress.finished.or(progress.error);
                let error_of = if progress.finished.is_some() { FINISHED_PICTURE } else { error_coverage.name() };
                let frame = self.turn.map(|turn| turn.frame);
                let line =
                    Line { frame, iteration, iterations, seconds, remaining, light_paths, error, error_of, expected };
                events::print("progress", line);
            }
            Form::Openjd => {
                say(&format!("openjd_progress: {:.1}", 100.0 * self.fraction(progress)));
                say(&format!("openjd_status: {}", self.sentence(progress)));
            }
            Form::None => {}
        }
    }

    /// Removes the progress bar from the terminal.
    pub fn finish(&mut self) {
        (self.first, self.bar) = (None, None);
    }

    /// The progress as text, with the frame if the command renders several.
    fn sentence(&self, progress: &Progress) -> String {
        let frame = self.turn.map(|turn| format!("frame {}, ", turn.frame)).unwrap_or_default();
        frame + &sentence(progress)
    }

    /// Finished fraction of all frames, 0 to 1. Of the current frame it is the larger of the fractions of iterations and of
    /// time.
    fn fraction(&self, progress: &Progress) -> f64 {
        let by_count = progress.iterations.map_or(0.0, |n| progress.iteration as f64 / n.max(1) as f64);
        let by_time = self.time.map_or(0.0, |t| progress.seconds / t);
        let this = by_count.max(by_time).clamp(0.0, 1.0);
        self.turn.map_or(this, |turn| (turn.before as f64 + this) / turn.count as f64)
    }
}

/// The state of a render for people: `iteration 12 of 64, 3.1 s, 13 s left, 387000 photons/s, error 3.1 %`.
fn sentence(progress: &Progress) -> String {
    let mut text = format!("iteration {}", progress.iteration);
    if let Some(n) = progress.iterations {
        text += &format!(" of {n}");
    }
    text += &format!(", {}", duration(progress.seconds));
    if let Some(remaining) = progress.remaining {
        text += &format!(", {} left", duration(remaining));
    }
    if progress.light_paths > 0 {
        text += &format!(", {} photons/s", count(progress.light_paths as f64 / progress.seconds.max(1e-9)));
    }
    match (progress.finished, progress.expected) {
        (Some(error), Some(ExpectedError { error: wanted, seconds })) => {
            text += &format!(", error {} now, {} in about {}", percent(error), percent(wanted), duration(seconds));
        }
        (Some(error), None) => text += &format!(", error {}", percent(error)),
        (None, _) => {
            let error =
                progress.error.map(|error| format!(", error {}{}", percent(error), progress.error_coverage.note()));
            text += &error.unwrap_or_default();
        }
    }
    text
}

/// Seconds for people: `3.1 s`, `4 min 10 s`, `2 h 5 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..=99 if seconds < 99.5 => format!("{seconds:.1} s"),
        0..=3599 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// A large number for people: `950`, `387 k`, `1.25 M`.
pub fn count(n: f64) -> String {
    match n {
        n if n < 1e4 => format!("{n:.0}"),
        n if n < 1e6 => format!("{:.0} k", n / 1e3),
        n if n < 1e9 => format!("{:.2} M", n / 1e6),
        n => format!("{:.2} G", n / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use caustique::render::ErrorCoverage;

    #[test]
    fn progress_is_printed_in_sentences() {
        let progress = Progress {
            iteration: 12,
            iterations: Some(64),
            seconds: 3.1,
            remaining: Some(250.0),
            light_paths: 1_200_000,
            photons: 1,
            error: Some(0.031),
            error_coverage: ErrorCoverage::All,
            finished: None,
            expected: None,
        };
        assert_eq!(sentence(&progress), "iteration 12 of 64, 3.1 s, 4 min 10 s left, 387 k photons/s, error 3.1 %");
        let noise = Progress { error_coverage: ErrorCoverage::Noise, remaining: None, iterations: None, ..progress };
        assert_eq!(sentence(&noise), "iteration 12, 3.1 s, 387 k photons/s, error 3.1 % (noise only)");
        let known =
            Progress { finished: Some(0.021), expected: Some(ExpectedError { error: 0.01, seconds: 40.0 }), ..noise };
        assert_eq!(sentence(&known), "iteration 12, 3.1 s, 387 k photons/s, error 2.1 % now, 1.0 % in about 40.0 s");
        assert_eq!(duration(7500.0), "2 h 5 min");
        assert_eq!(duration(99.7), "1 min 40 s");
        assert_eq!(count(9_999.0), "9999");
    }
}
