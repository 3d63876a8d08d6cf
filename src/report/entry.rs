//! The runs that are compared, their curves, and the metric.

use crate::image::Errors;
use crate::peers::Peer;
use crate::render::{Settings, TimeSpent};
use serde::Serialize;
use serde_json::{Value, json};

/// A run that the report compares: a method of caustique with its settings, and a name.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name in the report.
    pub name: String,
    /// Options of `caustique render` that give the same run.
    pub options: String,
    /// Settings of the render; the seed comes from [`Rules::seeds`](super::equal_time::Rules::seeds).
    pub settings: Settings,
    /// Time that `auto` took to choose the settings; it counts as render time.
    pub decided: TimeSpent,
    /// Name of the finish, if the report also shows finished pictures.
    pub finish: Option<String>,
}

impl Entry {
    /// The settings that the entry's method uses, as a JSON object.
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

/// A curve of the report: one run with its pictures either raw or denoised.
#[derive(Clone, Debug)]
pub struct Line {
    /// Name in the report.
    pub name: String,
    /// Source of the pictures that the curve measures.
    pub source: PictureSource,
}

/// Source of the pictures of a curve: an entry of caustique or a peer, another renderer, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureSource {
    /// The estimate of an entry, not finished.
    Estimate(usize),
    /// The finished picture of an entry.
    Finished(usize),
    /// The picture of another renderer.
    Peer(usize),
    /// The picture of another renderer after Open Image Denoise.
    Denoised(usize),
}

impl PictureSource {
    /// Whether caustique renders the pictures. Their curves count iterations, the curves of other renderers samples per
    /// pixel.
    pub fn is_ours(self) -> bool {
        matches!(self, PictureSource::Estimate(_) | PictureSource::Finished(_))
    }

    /// Whether no denoiser has changed the picture.
    pub fn is_raw(self) -> bool {
        matches!(self, PictureSource::Estimate(_) | PictureSource::Peer(_))
    }
}

/// The curves of entries and of peers, the other renderers: each without a denoiser, then with one, where that is
/// compared.
pub fn lines(entries: &[Entry], peers: &[Peer], denoised: bool) -> Vec<Line> {
    let with_second = |name: &str, source: PictureSource, second: Option<(&str, PictureSource)>| {
        let second = second.map(|(suffix, source)| Line { name: format!("{name}{suffix}"), source });
        std::iter::once(Line { name: name.into(), source }).chain(second)
    };
    let ours = entries.iter().enumerate().flat_map(|(i, entry)| {
        let finished = entry.finish.as_ref().map(|_| (", finished", PictureSource::Finished(i)));
        with_second(&entry.name, PictureSource::Estimate(i), finished)
    });
    let theirs = peers.iter().enumerate().flat_map(|(i, peer)| {
        let denoised = denoised.then_some((" + OIDN", PictureSource::Denoised(i)));
        with_second(peer.name, PictureSource::Peer(i), denoised)
    });
    ours.chain(theirs).collect()
}

/// The error metric of curves, targets and fits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// Squared error over the squared reference plus 0.01
    #[default]
    #[cfg_attr(feature = "cli", value(name = "relmse"))]
    RelMse,
    /// relMSE without the worst 0.5 % of pixels, which fireflies dominate
    #[serde(rename = "relmse_trimmed")]
    #[cfg_attr(feature = "cli", value(name = "relmse-trimmed"))]
    RelMseTrimmed,
    /// Squared error
    Mse,
}

impl Metric {
    /// Name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Metric::RelMse => "relMSE",
            Metric::RelMseTrimmed => "relMSE, trimmed",
            Metric::Mse => "MSE",
        }
    }

    /// The error of a picture in this metric.
    pub fn of(self, errors: &Errors) -> f64 {
        match self {
            Metric::RelMse => errors.relmse,
            Metric::RelMseTrimmed => errors.relmse_trimmed,
            Metric::Mse => errors.mse,
        }
    }
}

/// Iteration counts at which pictures are measured: 1, 2, 3, ... in a geometric series, rounded.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementSeries {
    ratio: f64,
    next: u64,
}

impl MeasurementSeries {
    /// A series of iteration counts with a ratio above 1.
    pub fn new(ratio: f64) -> MeasurementSeries {
        MeasurementSeries { ratio, next: 1 }
    }

    /// Whether the iteration count is in the series; must be called after every iteration.
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
        let mut series = MeasurementSeries::new(std::f64::consts::SQRT_2);
        let reached: Vec<u64> = (1..=70).filter(|&n| series.reached(n)).collect();
        assert_eq!(reached, [1, 2, 3, 4, 6, 8, 11, 16, 23, 33, 47, 66]);
    }
}
