//! Progress on stderr: a bar on a terminal, lines for logs, JSON and Open Job Description for programs.

use super::{printable, say};
use caustique::pipeline::FINISHED_PICTURE;
pub use caustique::pipeline::plan::percent;
use caustique::render::{Progress, Settings};
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
    /// A JSON object per iteration, a line each
    Json,
    /// Progress and status lines of Open Job Description, for render farms
    Openjd,
    /// Nothing but warnings and errors
    None,
}

impl Form {
    /// Whether people read it: programs get neither notes nor a summary.
    pub fn for_people(self) -> bool {
        matches!(self, Form::Auto | Form::Plain)
    }

    /// The form for commands without `--progress`: where JSON is asked for, nobody looks on.
    pub fn beside(json: bool) -> Form {
        if json { Form::None } else { Form::Auto }
    }

    /// Where `auto` shows no bar, its lines.
    pub fn settled(self) -> Form {
        if self == Form::Auto && !std::io::stderr().is_terminal() { Form::Plain } else { self }
    }

    /// Does something that may take long, and says what it is where it does.
    pub fn during<T>(self, what: &str, work: impl FnOnce() -> T) -> T {
        let _waiting = Waiting::begin(self, what);
        work()
    }
}

/// Seconds between plain lines.
pub const PLAIN_EVERY: f64 = 5.0;
/// Steps of the bar.
const STEPS: u64 = 1000;
/// A wait as long as this is explained.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two pictures of a spinner.
const TICK: Duration = Duration::from_millis(100);

/// The bar or spinner that is on the terminal.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Prints lines to stderr without tearing a bar that is there.
pub fn beside_the_bar(print: impl FnOnce()) {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match shown {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// A bar or spinner on the terminal until it is dropped.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar for [`Form::Auto`] on a terminal.
    pub fn new() -> Bar {
        Bar::show("{bar:24} {percent:>3} %  {msg}", Duration::ZERO)
    }

    fn show(template: &str, elapsed: Duration) -> Bar {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr()).with_elapsed(elapsed);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        Bar(bar)
    }

    /// Shows how much is done, 0 to 1, and a message.
    pub fn set(&self, fraction: f64, message: String) {
        self.0.set_position((fraction * STEPS as f64) as u64);
        self.0.set_message(message);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = None;
        self.0.finish_and_clear();
    }
}

/// Something that goes on without a measure of how far it is: a spinner on a terminal, a line elsewhere, once it has
/// taken as long as [`PATIENCE`].
pub struct Waiting {
    over: Option<Sender<()>>,
    teller: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins to wait for `what`.
    pub fn begin(form: Form, what: &str) -> Waiting {
        let (over, end) = channel::<()>();
        let (form, what) = (form.settled(), printable(what));
        let tell = move || {
            if end.recv_timeout(PATIENCE) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let spinner = (form == Form::Auto).then(|| Bar::show("{spinner} {msg}, {elapsed}", PATIENCE));
            match (&spinner, form) {
                (Some(Bar(spinner)), _) => {
                    spinner.set_message(what);
                    spinner.enable_steady_tick(TICK);
                }
                (None, Form::Plain) => say(&what),
                (None, Form::Openjd) => say(&format!("openjd_status: {what}")),
                (None, _) => {}
            }
            // Nothing is ever sent: the wait is over when the sender is gone.
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

/// A frame among those of a run.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Its number in the animation.
    pub frame: u32,
    /// How many of the run come before it.
    pub before: usize,
    /// How many frames the run has.
    pub count: usize,
}

/// Reports on one render.
pub struct Reporter {
    form: Form,
    turn: Option<Turn>,
    bar: Option<Bar>,
    first: Option<Waiting>,
    time: Option<f64>,
    next_line: f64,
}

/// `--progress json`: the keys that scripts rely on.
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
    /// An error to come, and in how many seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<Expected>,
}

/// An error to come.
#[derive(Serialize)]
struct Expected {
    error: f64,
    seconds: f64,
}

impl Reporter {
    /// A reporter for a render with these settings.
    pub fn new(form: Form, settings: &Settings, turn: Option<Turn>) -> Reporter {
        let first = Some(Waiting::begin(form, "first iteration"));
        let form = form.settled();
        Reporter { form, turn, bar: None, first, time: settings.time, next_line: 0.0 }
    }

    /// Reports the state after an iteration.
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
                    self.next_line = progress.seconds + PLAIN_EVERY;
                    say(&self.sentence(progress));
                }
            }
            Form::Json => {
                let Progress { iteration, iterations, seconds, remaining, light_paths, error_coverage, .. } = *progress;
                let error = progress.finished.or(progress.error);
                let error_of = if progress.finished.is_some() { FINISHED_PICTURE } else { error_coverage.name() };
                let expected = progress.expected.map(|(error, seconds)| Expected { error, seconds });
                let frame = self.turn.map(|turn| turn.frame);
                let line =
                    Line { frame, iteration, iterations, seconds, remaining, light_paths, error, error_of, expected };
                if let Ok(line) = serde_json::to_string(&line) {
                    say(&line);
                }
            }
            Form::Openjd => {
                say(&format!("openjd_progress: {:.1}", 100.0 * self.fraction(progress)));
                say(&format!("openjd_status: {}", self.sentence(progress)));
            }
            Form::None => {}
        }
    }

    /// Takes the bar off the terminal.
    pub fn finish(&mut self) {
        (self.first, self.bar) = (None, None);
    }

    /// What a line says, after the frame if there is one.
    fn sentence(&self, progress: &Progress) -> String {
        let frame = self.turn.map(|turn| format!("frame {}, ", turn.frame)).unwrap_or_default();
        frame + &sentence(progress)
    }

    /// How much is done of all frames, 0 to 1; of this one by whichever limit is nearer.
    fn fraction(&self, progress: &Progress) -> f64 {
        let by_count = progress.iterations.map_or(0.0, |n| progress.iteration as f64 / n.max(1) as f64);
        let by_time = self.time.map_or(0.0, |t| progress.seconds / t);
        let this = by_count.max(by_time).clamp(0.0, 1.0);
        self.turn.map_or(this, |turn| (turn.before as f64 + this) / turn.count as f64)
    }
}

/// `iteration 12 of 64, 3.1 s, 13 s left, 387000 photons/s, error 3.1 %`.
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
        (Some(error), Some((wanted, seconds))) => {
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
    fn sentences_are_for_people() {
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
        let known = Progress { finished: Some(0.021), expected: Some((0.01, 40.0)), ..noise };
        assert_eq!(sentence(&known), "iteration 12, 3.1 s, 387 k photons/s, error 2.1 % now, 1.0 % in about 40.0 s");
        assert_eq!(duration(7500.0), "2 h 5 min");
        assert_eq!(duration(99.7), "1 min 40 s");
        assert_eq!(count(9_999.0), "9999");
    }
}
