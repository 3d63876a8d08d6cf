//! Options about the run of a render: what is saved, how much memory and how many threads it takes, which layers it writes.

use super::number::{Ranged, threads};
use crate::film::Naming;
use crate::pipeline::Saving;
use crate::pipeline::memory::Cap;
use serde::Serialize;
use std::ops::Bound::{Excluded, Unbounded};
use std::path::{Path, PathBuf};

/// How a render runs and what its file holds.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct RunOptions {
    /// Layers of the EXR: 'all', 'comp' (the picture, its parts, albedo, normal, depth, cryptomattes; half floats where
    /// they serve), 'beauty', or names separated by commas
    #[arg(long, value_name = "all|comp|beauty|LIST", default_value = "all", help_heading = "Output")]
    pub layers: String,
    /// Names of the EXR's channels: 'blender' writes those that Blender's own renders have
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
    pub exr_naming: Naming,
    /// Save the state of the render every few minutes, so that --resume can go on; kept at the end, to extend the render
    /// [default: beside the output, and removed at the end]
    #[arg(long, value_name = "FILE", help_heading = "Running", conflicts_with = "no_checkpoint")]
    #[serde(skip)]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two saves
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, between = (Excluded(0.0), Unbounded))]
    #[arg(help_heading = "Running")]
    #[serde(skip)]
    pub checkpoint_every: f64,
    /// Save nothing
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub no_checkpoint: bool,
    /// Start anew although the checkpoint of a render that was stopped is there, and replace it
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub overwrite: bool,
    /// Go on from a checkpoint: the same options, and more --iterations or --time (both count from the start)
    #[arg(long, value_name = "FILE", help_heading = "Running")]
    #[serde(skip)]
    pub resume: Option<PathBuf>,
    /// Threads; 0 takes all cores. The picture does not depend on it
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    #[serde(skip)]
    pub threads: usize,
    /// The most that photons, pixels and layers may take, in MiB, beside the scene itself. Where they need more, the light
    /// paths of an iteration become fewer (with pm: the room of its map), and a warning says how many; what cannot fit is
    /// refused [default: what the machine and its limits leave, and nothing becomes fewer]
    #[arg(long, value_name = "MIB", whole = 1..=u32::MAX, help_heading = "Running")]
    pub memory: Option<u32>,
    /// Leave clocks and the thread count out of the EXR's header, so that equal renders are equal files
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub reproducible: bool,
}

impl RunOptions {
    /// The limit of `--memory`, if it is given.
    pub fn cap(&self) -> Option<Cap> {
        self.memory.map(|mib| Cap { bytes: u64::from(mib) << 20 })
    }

    /// Where and how often the checkpoint is saved: in the file of `--checkpoint`, or beside `output`. `None` if nothing
    /// is saved.
    pub fn saving(&self, output: Option<&Path>) -> Option<Saving> {
        let beside = |output: &Path| {
            let mut name = output.file_name().filter(|_| output.extension().is_some())?.to_owned();
            name.push(".checkpoint");
            Some(output.with_file_name(name))
        };
        let path = (!self.no_checkpoint).then(|| self.checkpoint.clone().or_else(|| beside(output?))).flatten()?;
        Some(Saving { path, every: self.checkpoint_every, keep: self.checkpoint.is_some() })
    }
}
