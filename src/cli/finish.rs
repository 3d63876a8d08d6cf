//! `caustique finish`: finishes a rendered EXR, or the frames of an animation.

use super::finish_frames::FrameFinish;
use super::finish_options::{look_of, open};
use super::output::{self, PictureArgs};
use super::progress::{Form, duration};
use super::say;
use caustique::argument::threads;
use caustique::error::{Error, Result};
use caustique::image::{Outputs, exr};
use caustique::options::{FinishOptions, Frames, path_of_frame};
use caustique::pipeline::{RenderedFile, header_to_finish, write_finish};
use caustique::render::Clock;
use std::path::PathBuf;

/// Finish a rendered EXR as 'caustique render' finishes its own
///
/// The file needs a picture and an estimate of its noise: the layers that 'caustique render' writes, or from another
/// renderer the beauty with a layer Variance (of the mean) or two independent halves, Half1 and Half2. The denoiser also
/// uses albedo and normal, under the names of Blender, Mitsuba, pbrt, LuxCore and Arnold. --model needs Level1, Level2,
/// ... and Variance1, ... The picture is replaced, all other layers stay.
///
/// With '####' in the names of both files, the frames of an animation are finished with up to two neighbours on each
/// side, and flicker less. The files need the layer Motion; those of 'caustique render --temporal' have all that is
/// useful.
#[derive(clap::Args)]
pub struct FinishArgs {
    /// EXR to finish; '####' in its name stands for the number of a frame
    input: PathBuf,
    /// EXR to write, with '####' in its name if the input has it
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    finish: FinishOptions,
    #[command(flatten)]
    picture: PictureArgs,
    /// Finish these frames only; the frames around them still count [default: all frames that exist]
    #[arg(long, value_name = "A-B[,STEP]", help_heading = "Running")]
    frames: Option<Frames>,
    /// Skip frames whose output exists, so that a run can continue and several machines can share one
    #[arg(long, help_heading = "Running")]
    skip_existing: bool,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
}

/// Finishes the picture of an EXR, as `caustique finish`.
pub fn run(args: &FinishArgs) -> Result<()> {
    if path_of_frame(&args.input, 0).is_some() && !args.input.exists() {
        return run_frames(args);
    }
    if args.frames.is_some() || args.skip_existing {
        let error = Error::usage("--frames and --skip-existing concern the frames of an animation");
        return Err(error.hint("leave them out, or put '####' where the frame's number belongs, such as shot.####.exr"));
    }
    if path_of_frame(&args.output, 0).is_some() {
        let error = Error::usage("--output has a place for a frame's number, and the input is one file");
        return Err(error.hint("name one file, or put '####' in the name of the input too"));
    }
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    let outputs = Outputs::new(std::iter::once(&args.output).chain(&args.picture.png).cloned())?;
    outputs.check(std::iter::once(args.input.as_path()).chain(output::model_file(&args.finish)))?;
    super::pool(args.threads)?.install(|| {
        let (opened, file) = rayon::join(|| open(&args.finish, None), || RenderedFile::read(&args.input));
        let (mut opened, RenderedFile { mut set, mut attributes, naming, remarks }) = (opened?, file?);
        remarks.iter().for_each(|remark| say(&format!("warning: {remark}")));
        let clock = Clock::start();
        let mut object = header_to_finish(&attributes, &mut set);
        let finish = || opened.finish().apply(&mut set, |_| true);
        let account =
            Form::Auto.during("finishing the picture", finish).map_err(|error| error.within(args.input.display()))?;
        write_finish(&mut object, &opened, &account);
        attributes.insert(exr::ATTRIBUTE, &object)?;
        exr::write(&args.output, &set, &attributes, args.picture.exr_options(naming))?;
        args.picture.write_png(&set, &look_of(&attributes))?;
        say(&format!("finished with {} in {}", opened.name(), duration(clock.seconds())));
        Ok(())
    })
}

/// Finishes the frames of an animation.
fn run_frames(args: &FinishArgs) -> Result<()> {
    for (option, path) in [("--output", Some(&args.output)), ("--png", args.picture.png.as_ref())] {
        let Some(path) = path.filter(|path| path_of_frame(path, 0).is_none()) else { continue };
        let error = Error::usage(format!("{option} {}: all frames have the same name", path.display()));
        return Err(error.hint("put '####' where the frame's number belongs, such as out.####.exr"));
    }
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    let frames = FrameFinish {
        input: &args.input,
        output: &args.output,
        frames: args.frames,
        finish: &args.finish,
        picture: &args.picture,
        skip_existing: args.skip_existing,
        of_render: false,
        progress: Form::Auto,
    };
    super::pool(args.threads)?.install(|| frames.run())
}
