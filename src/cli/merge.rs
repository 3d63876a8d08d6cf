//! `caustique merge`: merges the shards of one render to its picture, or renders of different seeds to their mean.

use super::finish_options::warn_missing_denoiser;
use super::output::{self, PictureArgs};
use super::progress::Form;
use super::render::{Summary, print_finish, print_picture, warn_unseen};
use super::say;
use caustique::error::Result;
use caustique::film::{LayerSet, Naming, Selection};
use caustique::finish::DenoiserChoice;
use caustique::image::Outputs;
use caustique::image::exr::{self, Attributes};
use caustique::pipeline::merge::{MergeEvent, MergeRequest, Shards, is_shard};
use caustique::pipeline::seeds::Seeds;
use caustique::pipeline::{FinishRequest, RenderedFile, finish, write_finish};
use caustique::scene::description::PictureDefaults;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Merge the shards of a render, or renders of different seeds
///
/// Shards by --shard I/N give the picture that one machine would have rendered, to the last bit of every channel: layers,
/// variances, errors and cryptomattes. Their order does not matter. The picture is finished once, as the render would
/// have been. Whole renders that differ only in their --seed give their mean, weighted by iterations.
#[derive(clap::Args)]
pub struct MergeArgs {
    /// Shards of one render, or renders of different seeds
    #[arg(required = true, value_name = "EXR")]
    inputs: Vec<PathBuf>,
    /// EXR to write
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: PathBuf,
    /// Merge the shards although some are missing: the picture so far
    #[arg(long)]
    partial: bool,
    /// Do not finish the picture [default: as for the shards]
    #[arg(long, alias = "no-combine", conflicts_with_all = ["model", "denoise"], help_heading = "Finish")]
    no_finish: bool,
    /// Denoiser: 'auto', 'oidn', 'own' or 'none' [default: as for the shards]
    #[arg(long, value_enum, help_heading = "Finish")]
    denoise: Option<DenoiserChoice>,
    /// Network that combines bandwidth levels, or improves the denoised picture [default: as for the shards]
    #[arg(long, value_name = "compact|FILE.onnx", help_heading = "Expert")]
    model: Option<String>,
    /// Layers: 'all', 'comp', 'beauty' or names separated by commas [default: as for the shards]
    #[arg(long, value_name = "LIST", help_heading = "Output")]
    layers: Option<String>,
    /// Names of channels [default: as for the shards]
    #[arg(long, value_enum, help_heading = "Output")]
    exr_naming: Option<Naming>,
    #[command(flatten)]
    picture: PictureArgs,
    /// Leave clocks, threads and the names of shards out of the header, so that equal shards give equal files
    #[arg(long, help_heading = "Running")]
    reproducible: bool,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = caustique::argument::threads, help_heading = "Running")]
    threads: usize,
}

/// Merges the files: shards to the picture of their render, or else renders to their mean.
pub fn run(args: &MergeArgs) -> Result<()> {
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    let outputs = Outputs::new(std::iter::once(&args.output).chain(&args.picture.png).cloned())?;
    outputs.check(args.inputs.iter().map(PathBuf::as_path).chain(args.model.as_deref().map(Path::new)))?;
    let shards = args.inputs.iter().map(|path| is_shard(path)).collect::<Result<Vec<bool>>>()?;
    super::pool(args.threads)?.install(|| if shards.contains(&true) { merge_shards(args) } else { average_seeds(args) })
}

/// The value of an option in `arguments`, the options in an EXR's header; `None` if it is missing or not of the
/// expected type.
fn given<T: DeserializeOwned>(arguments: &Value, name: &str) -> Option<T> {
    arguments.get(name).and_then(|value| serde_json::from_value(value.clone()).ok())
}

impl MergeArgs {
    /// The finish (denoiser and network) that these options ask for, else that of the shards' options; `None`: no
    /// finish.
    fn finish(&self, arguments: &Value) -> Option<FinishRequest> {
        let denoise = self.denoise.or_else(|| given(arguments, "denoise")).unwrap_or_default();
        let model = self.model.clone().or_else(|| given(arguments, "model"));
        let here = self.denoise.is_some() || self.model.is_some();
        let none = self.no_finish || (!here && given(arguments, "no-combine") == Some(true));
        (!none).then_some(FinishRequest { denoiser: denoise, model })
    }

    fn naming(&self, arguments: &Value) -> Naming {
        self.exr_naming.or_else(|| given(arguments, "exr-naming")).unwrap_or(Naming::Plain)
    }

    /// Writes the merged picture as EXR, and as PNG if the user wants one.
    fn write(&self, set: &LayerSet, attributes: &Attributes, naming: Naming, made_for: &PictureDefaults) -> Result<()> {
        exr::write(&self.output, set, attributes, self.picture.exr_options(naming))?;
        self.picture.write_png(set, made_for)?;
        print_picture(&self.output, set);
        Ok(())
    }
}

/// Merges shards (parts of a render's iterations) to the picture of their render.
fn merge_shards(args: &MergeArgs) -> Result<()> {
    let shards = Shards::open(&args.inputs, args.partial)?;
    let arguments = shards.arguments();
    let naming = args.naming(&arguments);
    let layers: String = args.layers.clone().or_else(|| given(&arguments, "layers")).unwrap_or_else(|| "all".into());
    let request = MergeRequest {
        finish: args.finish(&arguments),
        layers: Selection::parse(&layers)?,
        naming,
        reproducible: args.reproducible,
    };
    let made_for = shards.facts().map(|facts| facts.made_for).unwrap_or_default();
    shards.warnings().iter().for_each(|warning| say(&format!("warning: {warning}")));
    let mut summary = None;
    let delivery = Form::Auto.during("merging", || {
        shards.merge(&request, |event| {
            if let MergeEvent::Finishing { rendered, missing } = event {
                warn_missing_denoiser(missing);
                summary = Some(Summary::of(rendered));
            }
        })
    })?;
    if let Some(summary) = summary {
        summary.print();
        if let Some(name) = &delivery.finished_by {
            print_finish(name, &delivery, summary.coverage_of_finished());
        }
        summary.print_rejected(&args.output, true);
        warn_unseen(&args.output, &delivery);
    }
    args.write(&delivery.set, &delivery.attributes, naming, &made_for)?;
    let output = args.output.display();
    delivery.finish_error.map_or(Ok(()), |error| {
        Err(error.hint(format!("the unfinished picture is in {output}: 'caustique finish' finishes it")))
    })
}

/// Merges renders of different seeds to their mean.
fn average_seeds(args: &MergeArgs) -> Result<()> {
    let mut seeds = Seeds::default();
    let mut read_as = Naming::Plain;
    for path in &args.inputs {
        let RenderedFile { set, attributes, naming, remarks } = RenderedFile::read(path)?;
        remarks.iter().for_each(|remark| say(&format!("warning: {remark}")));
        if naming == Naming::Blender {
            read_as = Naming::Blender;
        }
        seeds.add(path, set, attributes)?;
    }
    let naming = args.exr_naming.unwrap_or(read_as);
    let (mut set, mut attributes) = seeds.mean()?;
    let mut header = attributes.object().unwrap_or_default();
    let arguments = header["arguments"].clone();
    if let Some(request) = args.finish(&arguments) {
        let mut opened = finish::open(&request, None)?;
        warn_missing_denoiser(opened.missing.as_ref());
        let account = opened.finish().apply(&mut set, |_| true)?;
        write_finish(&mut header, &opened, &account);
    }
    if let Some(layers) = &args.layers {
        set = Selection::parse(layers)?.apply(set)?;
    }
    attributes.insert(exr::ATTRIBUTE, &header)?;
    args.write(&set, &attributes, naming, &PictureDefaults::default())
}
