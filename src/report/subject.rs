//! The compared runs and the options of their report.

use super::crop::{Look, Window};
use super::entry::{Entry, Line, Metric};
use super::equal_time::Rules;
use super::reference::Reference;
use crate::peers::Peer;

/// The subject of a report: the compared runs and the conditions.
pub struct Subject {
    /// Name of the scene in the report.
    pub scene: String,
    /// Width and height of the picture.
    pub size: (u32, u32),
    /// Entries of caustique.
    pub entries: Vec<Entry>,
    /// Other renderers.
    pub peers: Vec<Peer>,
    /// The curves.
    pub lines: Vec<Line>,
    /// Seeds, moments and end of the runs.
    pub rules: Rules,
    /// Metric of curves, targets and fits.
    pub metric: Metric,
    /// The reference.
    pub reference: Reference,
    /// Names and values of facts about the machine: processor, threads, versions.
    pub machine: Vec<(String, String)>,
    /// Names and values of options that hold for all runs.
    pub settings: Vec<(String, String)>,
}

/// Options of the report.
pub struct ReportOptions {
    /// Target errors; if there are none, [`default_targets`](super::target::default_targets).
    pub targets: Vec<f64>,
    /// Additional targets: the error of an entry's estimate after some iterations, as (index of the entry, iterations).
    pub targets_of: Vec<(usize, u64)>,
    /// Windows of the crops; if there are none, those in which the curves differ most.
    pub windows: Vec<Window>,
    /// Exposure and tone curve.
    pub look: Look,
    /// Additional remarks.
    pub notes: Vec<String>,
}
