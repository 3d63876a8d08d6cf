//! `--frames`: renders frames one after the other.

use super::options::RenderArgs;
use super::{files, pass_over};
use crate::cli::claim::{self, Claim, Claimed};
use crate::cli::finish_frames::FrameFinish;
use crate::cli::progress::FrameOfRun;
use crate::cli::signals::Interrupt;
use crate::cli::{output, say};
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::{FrameSeed, Frames, is_pattern, path_of_frame};
use caustique::pipeline::checkpoint;
use caustique::pipeline::merge::is_shard;
use caustique::scene::{blend, gltf, usd};
use std::path::PathBuf;

/// Renders the frames in order. Ends at the first frame that fails, as Blender does; the frames before it are written.
pub fn run(args: &RenderArgs, frames: Frames) -> Result<()> {
    // Report errors of the options here, without the number of a frame.
    args.picture_request()?;
    check(args, frames)?;
    check_temporal(args)?;
    let frames = if nothing_moves(args, frames) { first_alone(args, frames) } else { frames };
    let outputs = files::outputs_of_frames(args, frames)?;
    let count = frames.iter().len();
    for (before, frame) in frames.iter().enumerate() {
        let mut one = args.at(frame);
        let done = || args.skip_existing && left(&one).is_none() && is_there(&one);
        if done() {
            pass_over(&one, Some(frame), "is there");
            files::remove_leftovers(&one);
            claim::remove_dead(&one.output);
            continue;
        }
        // Held until the frame is written.
        let _claim = match args.skip_existing.then(|| Claim::claim(&one.output)).transpose()? {
            Some(Claimed::Elsewhere(owner)) => {
                pass_over(&one, Some(frame), &format!("is rendered by {owner}"));
                continue;
            }
            Some(Claimed::Here(claim)) => Some(claim),
            None => None,
        };
        // Another machine may have written the frame before this one got the claim.
        if done() {
            pass_over(&one, Some(frame), "is there");
            continue;
        }
        let left = left(&one);
        if Interrupt::has_come() {
            let cause = format!("interrupted before frame {frame}; the frames before it are written");
            return Err(Error::new(ErrorKind::Interrupted, args.output.display(), cause)
                .hint("the same command with --skip-existing goes on"));
        }
        if args.progress.for_people() {
            let is_damaged = args.skip_existing && std::fs::metadata(&one.output).is_ok_and(|data| data.len() > 0);
            let again = if is_damaged && left.is_none() { ", which is damaged and is rendered again" } else { "" };
            say(&format!("frame {frame} ({} of {count}): {}{again}", before + 1, one.output.display()));
        }
        // If there are several frames, some may have no checkpoint.
        one.run.resume = left.clone().or(one.run.resume.filter(|path| count == 1 || path.exists()));
        super::render_one(&one, &outputs, Some(FrameOfRun { frame, before, count })).map_err(|error| {
            let of_left = left.filter(|left| error.place == left.display().to_string());
            let error = match of_left {
                Some(left) => error.hint(format!("give the same options, or remove {}", left.display())),
                None => error,
            };
            error.within(format!("frame {frame}"))
        })?;
    }
    if !args.temporal {
        return Ok(());
    }
    let finish = FrameFinish {
        input: &args.output,
        output: &args.output,
        frames: Some(frames),
        finish: &args.options.finish,
        picture: &args.picture,
        skip_existing: args.skip_existing,
        of_render: true,
        progress: args.progress,
    };
    finish.run()
}

/// Whether all of several frames show the same. The temporal finish averages frames, so it takes all of them.
fn nothing_moves(args: &RenderArgs, frames: Frames) -> bool {
    let scene = &args.options.scene;
    let is_converted = usd::is_stage(&scene.path) || blend::is_blend(&scene.path);
    let is_one_file = !is_pattern(&scene.path) && !is_converted;
    frames.single().is_none() && !args.temporal && is_one_file && gltf::is_still(&scene.path, &scene.request().options)
}

/// The first of the frames, and a warning that the others are not rendered.
fn first_alone(args: &RenderArgs, frames: Frames) -> Frames {
    let first = frames.iter().next().unwrap_or_default();
    let scene = args.options.scene.path.display();
    say(&format!("warning: {scene}: nothing moves, so its frames are all the same: only frame {first} is rendered"));
    Frames::one(first)
}

/// The checkpoint that a stopped run has left of a picture, from which `--skip-existing` goes on.
pub(super) fn left(args: &RenderArgs) -> Option<PathBuf> {
    let left = args.saving().map(|saving| saving.path);
    left.filter(|path| args.skip_existing && !args.run.overwrite && checkpoint::is_unfinished(path))
}

/// Whether the output of the frame is there and whole: a copy may have been cut off, and an empty file is a placeholder.
pub(super) fn is_there(args: &RenderArgs) -> bool {
    let has_sums = || args.options.settings.shard.is_none() || is_shard(&args.output).is_ok_and(|is_shard| is_shard);
    output::is_whole(&args.output) && has_sums()
}

/// Checks that the frames have different file names.
fn check(args: &RenderArgs, frames: Frames) -> Result<()> {
    if frames.single().is_some() {
        return Ok(());
    }
    for (option, path) in args.files() {
        if path_of_frame(path, 0).is_none() {
            let cause = format!("{option} {}: all frames have the same name", path.display());
            let error = Error::usage(cause);
            return Err(error.hint("put '####' where the frame's number belongs, such as out.####.exr"));
        }
    }
    Ok(())
}

/// Checks that the frames can be finished with their neighbours, if the user asks for it.
fn check_temporal(args: &RenderArgs) -> Result<()> {
    let (cause, remedy) = match &args.options {
        _ if !args.temporal => return Ok(()),
        options if options.frame_seed == FrameSeed::Same => (
            "--temporal: frames of one seed have equal noise, which their average keeps",
            "leave --frame-seed same out",
        ),
        options if options.settings.shard.is_some() => (
            "--temporal: a shard is not finished",
            "render with --layers all,Motion,Quarter, merge the shards of each frame, and finish the merged frames with \
             'caustique finish'",
        ),
        _ => return Ok(()),
    };
    Err(Error::usage(cause).hint(remedy))
}

/// Checks that no file name has a placeholder for a frame's number.
///
/// # Errors
/// A file name has one.
pub fn refuse_patterns(args: &RenderArgs) -> Result<()> {
    let scene = Some(("the scene", &args.options.scene.path)).filter(|(_, path)| !path.exists());
    match args.files().chain(scene).find(|(_, path)| is_pattern(path)) {
        None => Ok(()),
        Some((option, path)) => {
            let cause = format!("{option} {}: its name has a place for a frame's number", path.display());
            let error = Error::usage(cause);
            Err(error.hint("give --frames, such as --frames 1-100, or another name"))
        }
    }
}
