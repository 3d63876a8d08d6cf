//! `caustique combine`: finishes a stored picture.

use super::output::{self, PictureArgs};
use super::progress::{Form, duration};
use super::{finish, say};
use caustique::error::Result;
use caustique::film::{Naming, take_plain_names};
use caustique::image::exr;
use caustique::options::FinishOptions;
use caustique::options::number::threads;
use caustique::pipeline::tell_stored;
use caustique::render::Clock;
use caustique::scene::description::PictureDefaults;
use serde_json::json;
use std::path::PathBuf;

/// Finish a rendered EXR as 'caustique render' finishes its own
///
/// The file needs a picture and what tells its noise: the layers that 'caustique render' writes, or from another
/// renderer the beauty with a layer Variance (of the mean) or two independent halves, Half1 and Half2. Albedo and
/// normal guide the denoiser, by the names that Blender, Mitsuba, pbrt, LuxCore and Arnold give them. With --model it
/// needs Level1, Level2, ... and Variance1, ... All layers are kept, the picture itself is replaced.
#[derive(clap::Args)]
pub struct CombineArgs {
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

/// Finishes a file.
pub fn run(args: &CombineArgs) -> Result<()> {
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    super::pool(args.threads)?.install(|| {
        let mut ready = finish::open(&args.finish, None)?;
        let (mut set, mut attributes) = exr::read(&args.input)?;
        // Names in the style of the input: cryptomatte attributes hold them too.
        let blender = set.layers.iter().any(|layer| layer.name.starts_with("ViewLayer."));
        let naming = if blender { Naming::Blender } else { Naming::Plain };
        for name in take_plain_names(&mut set) {
            let input = args.input.display();
            say(&format!("warning: {input}: layer \"{name}\" cannot be written under this name and is left out"));
        }
        let clock = Clock::start();
        let finish = || ready.finish().apply(&mut set, |_| true);
        let account =
            Form::Auto.during("finishing the picture", finish).map_err(|error| error.within(args.input.display()))?;
        let mut object = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
        object["combined"] = ready.facts(&account);
        if let Some(header) = object.as_object_mut() {
            tell_stored(header, &account);
        }
        attributes.insert(exr::ATTRIBUTE, &object)?;
        exr::write(&args.output, &set, &attributes, args.picture.exr_options(naming))?;
        args.picture.write_png(&set, &PictureDefaults::default())?;
        say(&format!("finished with {} in {}", ready.name(), duration(clock.seconds())));
        Ok(())
    })
}
