//! Progress of a comparison on stderr.

use crate::cli::progress::{Bar, Form, PLAIN_INTERVAL, Waiting, duration};
use crate::cli::say;
use caustique::render::Clock;
use caustique::report::equal_time::Step;
use caustique::report::number::short;
use serde_json::json;

/// Prints the progress of the reference and of the runs.
pub struct Reporter {
    form: Form,
    bar: Option<Bar>,
    first: Option<Waiting>,
    clock: Clock,
    next_line: f64,
}

impl Reporter {
    /// Makes a reporter that prints in the form of `--progress`.
    pub fn new(form: Form) -> Reporter {
        let first = Some(Waiting::begin(form, "first iteration"));
        Reporter { form: form.resolved(), bar: None, first, clock: Clock::start(), next_line: 0.0 }
    }

    /// Prints the progress of rendering the reference. `fraction`: the finished share, 0 to 1.
    pub fn reference(&mut self, iterations: u64, seconds: f64, fraction: f64) {
        let sentence = format!("reference: {iterations} iterations of each half, {}", duration(seconds));
        let line = json!({"reference": true, "iteration": iterations, "seconds": seconds, "fraction": fraction});
        self.tell(fraction, &sentence, &line.to_string());
    }

    /// Prints the progress after a step of a run, a render by one of the compared methods.
    pub fn step(&mut self, step: &Step<'_>) {
        let name = step.name;
        let relmse = step.point.map(|point| point.errors.relmse);
        let count = match (step.is_ours, step.iterations) {
            (true, n) => format!("iteration {n}"),
            (false, 0) => "no picture".into(),
            (false, n) => format!("{n} samples a pixel"),
        };
        let mut sentence = format!("{name}: {count}, {}", duration(step.seconds));
        sentence += &relmse.map_or(String::new(), |relmse| format!(", relMSE {}", short(relmse)));
        let line = json!({
            "run": name, "iteration": step.iterations, "seconds": step.seconds, "fraction": step.fraction, "relmse": relmse,
        });
        self.tell(step.fraction, &sentence, &line.to_string());
    }

    fn tell(&mut self, fraction: f64, sentence: &str, line: &str) {
        self.first = None;
        match self.form {
            Form::Auto => self.bar.get_or_insert_with(Bar::new).set(fraction, sentence.to_string()),
            Form::Plain => {
                let now = self.clock.seconds();
                if now >= self.next_line {
                    self.next_line = now + PLAIN_INTERVAL;
                    say(&format!("{:.0} %, {sentence}", 100.0 * fraction));
                }
            }
            Form::Json => say(line),
            Form::Openjd => {
                say(&format!("openjd_progress: {:.1}", 100.0 * fraction));
                say(&format!("openjd_status: {sentence}"));
            }
            Form::None => {}
        }
    }

    /// Removes the progress bar from the terminal.
    pub fn finish(&mut self) {
        (self.first, self.bar) = (None, None);
    }
}
