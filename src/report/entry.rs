//! What is compared, the curves that come of it, and the figure it is compared by.

use crate::image::Errors;
use crate::peers::Peer;
use crate::render::{Settings, TimeSpent};
use serde::Serialize;
use serde_json::{Value, json};

/// A method with its settings, and a name.
#[derive(Clone, Debug)]
pub struct Entry {
    /// What the report calls it.
    pub name: String,
    /// The options of `caustique render` that it stands for.
    pub options: String,
    /// Its settings; seeds are the race's.
    pub settings: Settings,
    /// Time that choosing the settings took, which counts as a render's own.
    pub decided: TimeSpent,
    /// What finishes its pictures, if they are finished.
    pub finish: Option<String>,
}

impl Entry {
    /// Its settings as data: those that say something to its method.
    pub fn object(&self) -> Value {
        let Settings { method, levels, photons, alpha, initial_bandwidth, max_depth, .. } = self.settings;
        let mut object = json!({
            "name": self.name,
            "options": self.options,
            "method": method.name(),
            "levels": levels.count,
            "max_depth": (max_depth < u32::MAX).then_some(max_depth),
        });
        if method.takes_photon_count() {
            object["photons"] = photons.into();
        }
        if method.has_bandwidths() {
            object["alpha"] = alpha.into();
            object["initial_bandwidth"] = format!("{initial_bandwidth:?}").into();
        }
        object
    }
}

/// A curve of the report.
#[derive(Clone, Debug)]
pub struct Line {
    /// What the report calls it.
    pub name: String,
    /// What its pictures are.
    pub of: Of,
}

/// What the pictures of a curve are; entries and guests by number, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The estimate of an entry, as the method leaves it.
    Estimate(usize),
    /// The picture that is finished from it.
    Finished(usize),
    /// Another renderer's picture.
    Guest(usize),
    /// The same, denoised.
    Denoised(usize),
}

impl Of {
    /// Whether it is ours: such curves know iterations, others samples per pixel.
    pub fn is_ours(self) -> bool {
        matches!(self, Of::Estimate(_) | Of::Finished(_))
    }

    /// Whether it is what a renderer makes, before any denoiser.
    pub fn is_raw(self) -> bool {
        matches!(self, Of::Estimate(_) | Of::Guest(_))
    }
}

/// The curves of entries and guests: each as it is, then as it is finished, where it is.
pub fn lines(entries: &[Entry], guests: &[Peer], denoised: bool) -> Vec<Line> {
    let two = |name: &str, of: Of, and: Option<(&str, Of)>| {
        let more = and.map(|(suffix, of)| Line { name: format!("{name}{suffix}"), of });
        std::iter::once(Line { name: name.into(), of }).chain(more)
    };
    let ours = entries.iter().enumerate().flat_map(|(i, entry)| {
        two(&entry.name, Of::Estimate(i), entry.finish.as_ref().map(|_| (", finished", Of::Finished(i))))
    });
    let theirs = guests
        .iter()
        .enumerate()
        .flat_map(|(i, guest)| two(guest.name, Of::Guest(i), denoised.then_some((" + OIDN", Of::Denoised(i)))));
    ours.chain(theirs).collect()
}

/// The figure that curves, targets and fits are about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// Squared error over the squared reference plus 0.01
    #[default]
    #[cfg_attr(feature = "cli", value(name = "relmse"))]
    RelMse,
    /// The same without the worst 0.5 % of pixels, which fireflies dominate
    #[serde(rename = "relmse_trimmed")]
    #[cfg_attr(feature = "cli", value(name = "relmse-trimmed"))]
    RelMseTrimmed,
    /// Squared error
    Mse,
}

impl Metric {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Metric::RelMse => "relMSE",
            Metric::RelMseTrimmed => "relMSE, trimmed",
            Metric::Mse => "MSE",
        }
    }

    /// Its value among the errors of a picture.
    pub fn of(self, errors: &Errors) -> f64 {
        match self {
            Metric::RelMse => errors.relmse,
            Metric::RelMseTrimmed => errors.relmse_trimmed,
            Metric::Mse => errors.mse,
        }
    }
}

/// Moments at which pictures are measured: iterations 1, 2, 3, ... in a geometric series.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    ratio: f64,
    next: u64,
}

impl Moments {
    /// A series with this ratio, above 1.
    pub fn new(ratio: f64) -> Moments {
        Moments { ratio, next: 1 }
    }

    /// Whether so many iterations are a moment; asked after each.
    pub fn reached(&mut self, iterations: u64) -> bool {
        if iterations < self.next {
            return false;
        }
        self.next = ((iterations as f64 * self.ratio).round() as u64).max(iterations + 1);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_a_geometric_series_without_repetition() {
        let mut moments = Moments::new(std::f64::consts::SQRT_2);
        let reached: Vec<u64> = (1..=70).filter(|&n| moments.reached(n)).collect();
        assert_eq!(reached, [1, 2, 3, 4, 6, 8, 11, 16, 23, 33, 47, 66]);
    }
}
