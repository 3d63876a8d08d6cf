//! Options about the run of a render: what is saved, how much memory and how many threads it takes, which layers it
//! writes.

use crate::argument::{Elsewhere, Ranged, threads};
use crate::error::Result;
use crate::film::{Naming, Selection};
use crate::pipeline::Saving;
use crate::pipeline::memory::MemoryLimit;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Options about running a render (memory, threads, checkpoints), and about the contents of the EXR.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct RunOptions {
    /// Layers of the EXR: 'all', 'comp' for compositing, 'beauty', or names separated by commas
    ///
    /// 'comp' has the picture, its finished parts, depth, cryptomattes and the error, in half floats if these suffice; it is
    /// the default for files of Blender. 'lobes' in a list stands for diffuse, glossy and transmitted light, direct and
    /// indirect, and their colours
    #[arg(long, value_name = "all|comp|beauty|LIST", default_value = "all", help_heading = "Output")]
    #[arg(in_stages = true)]
    pub layers: String,
    /// Names of the EXR's channels: 'blender' writes the names of Blender's own renders
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save", in_stages = true)]
    pub exr_naming: Naming,
    /// Save the state of the render to this file every few minutes, and keep it at the end, so that --resume can
    /// continue or extend the render [default: beside the output, and removed at the end]
    #[arg(long, value_name = "FILE", help_heading = "Running", conflicts_with = "no_checkpoint")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two saves
    #[arg(long, value_name = "SECONDS|5m", default_value_t = 300.0, seconds = 0.0)]
    #[arg(help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    pub checkpoint_every: f64,
    /// Save no state
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "nothing is saved unless checkpoint is given")]
    pub no_checkpoint: bool,
    /// Start anew although there is the checkpoint of a render that was stopped, and replace it
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    pub overwrite: bool,
    /// Continue from a checkpoint: with the same options, and more --iterations or --time (both count from the start)
    #[arg(long, value_name = "FILE", help_heading = "Running")]
    #[serde(skip)]
    pub resume: Option<PathBuf>,
    /// Threads; 0 takes all cores. The picture does not depend on it
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    #[serde(skip)]
    pub threads: usize,
    /// Limit on the memory of photons, pixels and layers in MiB, without the scene itself [default: what the machine
    /// and its limits leave]
    ///
    /// If they need more, an iteration has fewer light paths (with pm: its map is smaller), and a warning says how
    /// many. What cannot fit is refused
    #[arg(long, value_name = "MIB", whole = 1..=u32::MAX, help_heading = "Running")]
    #[arg(hide_short_help = true)]
    pub memory: Option<u32>,
    /// Leave clocks and the thread count out of the EXR's header, so that equal renders are equal files
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(in_stages = true)]
    pub reproducible: bool,
}

impl RunOptions {
    /// The layers to deliver in the EXR, as `--layers` names them.
    ///
    /// # Errors
    /// No layer has such a name.
    pub fn selection(&self) -> Result<Selection> {
        Selection::parse(&self.layers)
    }

    /// The limit on memory of `--memory`; `None` if it is not given.
    pub fn memory_limit(&self) -> Option<MemoryLimit> {
        self.memory.map(|mib| MemoryLimit { bytes: u64::from(mib) << 20 })
    }

    /// Where and how often the checkpoint is saved: in the file of `--checkpoint`, or beside `output`. `None` if
    /// nothing is saved.
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
