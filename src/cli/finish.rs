//! `caustique finish`: finishes a rendered EXR. Also opens the finish of other commands.

use super::output::{self, PictureArgs};
use super::progress::{Form, duration};
use super::say;
use caustique::error::{Error, Result};
use caustique::film::{Naming, take_plain_names};
use caustique::image::exr;
use caustique::options::FinishOptions;
use caustique::options::number::threads;
use caustique::pipeline::{OpenFinish, finish, write_error_of_finish};
use caustique::render::Clock;
use caustique::scene::description::PictureDefaults;
use serde_json::json;
use std::path::PathBuf;

/// Finish a rendered EXR as 'caustique render' finishes its own
///
/// The file needs a picture and an estimate of its noise: the layers that 'caustique render' writes, or from another
/// renderer the beauty with a layer Variance (of the mean) or two independent halves, Half1 and Half2. The denoiser also
/// uses albedo and normal, under the names of Blender, Mitsuba, pbrt, LuxCore and Arnold. --model needs Level1, Level2,
/// ... and Variance1, ... The picture is replaced, all other layers stay.
#[derive(clap::Args)]
pub struct FinishArgs {
    /// EXR to finish
    input: PathBuf,
    /// EXR to write
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    finish: FinishOptions,
    #[command(flatten)]
    picture: PictureArgs,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
}

/// Finishes the picture of an EXR, as `caustique finish`.
pub fn run(args: &FinishArgs) -> Result<()> {
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    super::pool(args.threads)?.install(|| {
        let (opened, read) = rayon::join(|| open(&args.finish, None), || exr::read(&args.input));
        let (mut opened, (mut set, mut attributes)) = (opened?, read?);
        // Keep the naming style of the input, which its cryptomatte attributes also use.
        let blender = set.layers.iter().any(|layer| layer.name.starts_with("ViewLayer."));
        let naming = if blender { Naming::Blender } else { Naming::Plain };
        for name in take_plain_names(&mut set) {
            let input = args.input.display();
            say(&format!("warning: {input}: layer \"{name}\" cannot be written under this name and is left out"));
        }
        let clock = Clock::start();
        let finish = || opened.finish().apply(&mut set, |_| true);
        let account =
            Form::Auto.during("finishing the picture", finish).map_err(|error| error.within(args.input.display()))?;
        let mut object = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
        object["combined"] = opened.header(&account);
        if let Some(header) = object.as_object_mut() {
            write_error_of_finish(header, &account);
        }
        attributes.insert(exr::ATTRIBUTE, &object)?;
        exr::write(&args.output, &set, &attributes, args.picture.exr_options(naming))?;
        args.picture.write_png(&set, &PictureDefaults::default())?;
        say(&format!("finished with {} in {}", opened.name(), duration(clock.seconds())));
        Ok(())
    })
}

/// Opens a finish (denoiser and network) for this number of bandwidth levels, and warns if the preferred denoiser is
/// missing.
///
/// # Errors
/// Errors of [`finish::open`].
pub fn open(options: &FinishOptions, levels: Option<usize>) -> Result<OpenFinish> {
    let opened = finish::open(&options.request(), levels)?;
    warn_missing_denoiser(opened.missing.as_ref());
    Ok(opened)
}

/// Warns that the built-in denoiser replaces a missing one.
pub fn warn_missing_denoiser(missing: Option<&Error>) {
    let Some(error) = missing else { return };
    say(&format!("warning: {error}: our own denoiser takes its place, whose pictures are grainier"));
    if let Some(hint) = &error.hint {
        say(&format!("hint: {hint}"));
    }
}
