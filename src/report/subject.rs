//! The compared runs and the options of their report.

use super::crop::Window;
use super::entry::{Entry, Line, Metric};
use super::equal_time::Rules;
use super::reference::Reference;
use crate::image::tonemap::Look;
use crate::peers::Peer;

/// The subject of a report: the compared runs and the conditions.
pub struct Subject {
    /// Name of the scene in the report.
    pub scene: String,
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    /// Entries of the comparison: methods of caustique with their settings.
    pub entries: Vec<Entry>,
    /// Other renderers that are compared.
    pub peers: Vec<Peer>,
    /// The curves of errors: entries and other renderers, raw and denoised.
    pub lines: Vec<Line>,
    /// Seeds, moments of measurement, and limits of the runs.
    pub rules: Rules,
    /// Error metric of curves, targets and fits.
    pub metric: Metric,
    /// The reference picture, against which errors are measured.
    pub reference: Reference,
    /// Whether each pixel shows smooth glass or a mirror, in the middle of the pixel.
    pub inside: Vec<bool>,
    /// Names and values of facts about the machine: processor, threads, versions.
    pub machine: Vec<(String, String)>,
    /// Names and values of options that hold for all runs.
    pub settings: Vec<(String, String)>,
}

/// Options of the report.
pub struct ReportOptions {
    /// Target errors, to which the report compares times; if there are none,
    /// [`default_targets`](super::target::default_targets).
    pub targets: Vec<f64>,
    /// Additional targets: the error of an entry's estimate after some iterations, as (index of the entry, iterations).
    pub targets_of: Vec<(usize, u64)>,
    /// Windows, rectangles of pixels, of the crops; if there are none, those in which the curves differ most.
    pub windows: Vec<Window>,
    /// Exposure and tone curve of the pictures.
    pub look: Look,
    /// Additional remarks for the page.
    pub notes: Vec<String>,
}
