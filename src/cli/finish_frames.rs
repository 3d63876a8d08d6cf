//! The temporal finish of an animation: `caustique finish` with a pattern, and the end of `caustique render --temporal`.

use super::claim::{self, Claim, Claimed};
use super::finish_options::{look_of, open};
use super::output::{self, PictureArgs};
use super::progress::{Form, duration};
use super::say;
use super::signals::Interrupt;
use caustique::error::{Error, ErrorKind, Result};
use caustique::image::{Outputs, exr};
use caustique::options::{FinishOptions, Frames, files_of_frames, no_frames, path_of_frame};
use caustique::pipeline::OpenFinish;
use caustique::pipeline::temporal::FrameFiles;
use caustique::render::Clock;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The files of an animation, and how they are finished.
pub struct FrameFinish<'a> {
    /// Name of the files to read, with a place for the frame's number.
    pub input: &'a Path,
    /// Name of the files to write, with a place for the frame's number.
    pub output: &'a Path,
    /// Frames to finish; `None`: all that exist.
    pub frames: Option<Frames>,
    pub finish: &'a FinishOptions,
    pub picture: &'a PictureArgs,
    /// Whether finished frames, and frames that another process finishes, are skipped.
    pub skip_existing: bool,
    /// Whether the files are those of a render that may still run on other machines: the output replaces the input, and
    /// frames whose neighbours are still to be rendered wait.
    pub of_render: bool,
    pub progress: Form,
}

impl FrameFinish<'_> {
    /// Finishes the frames in order.
    ///
    /// # Errors
    /// A file is missing, cannot be read or written, or lacks layers.
    pub fn run(&self) -> Result<()> {
        let paths = files_of_frames(self.input).map_err(|cause| Error::io(self.input, &cause))?;
        let numbers = self.numbers(&paths)?;
        self.check_outputs(&paths, &numbers)?;
        let mut files = FrameFiles::new(paths.clone());
        let mut opened = None;
        for (before, &frame) in numbers.iter().enumerate() {
            let output = path_of_frame(self.output, frame).unwrap_or_else(|| self.output.to_owned());
            let _claim = match self.claim(frame, &output, &files, &paths)? {
                Ok(claim) => claim,
                Err(why) => {
                    self.report(&format!("frame {frame}: {} {why}", output.display()));
                    continue;
                }
            };
            if Interrupt::has_come() {
                let cause = format!("interrupted before frame {frame} is finished; the frames before it are written");
                return Err(Error::new(ErrorKind::Interrupted, self.output.display(), cause)
                    .hint("the same command with --skip-existing goes on"));
            }
            if opened.is_none() {
                opened = Some(open(self.finish, None)?);
            }
            let Some(opened) = &mut opened else { continue };
            let clock = Clock::start();
            self.finish_frame(frame, &output, &mut files, opened)?;
            self.report(&format!(
                "frame {frame} ({} of {}): {}: finished with its neighbours by {} in {}",
                before + 1,
                numbers.len(),
                output.display(),
                opened.name(),
                duration(clock.seconds())
            ));
        }
        Ok(())
    }

    /// Checks that no frame replaces the file of a frame that is read, unless it is the frame itself at the end of a render.
    fn check_outputs(&self, paths: &BTreeMap<u32, PathBuf>, numbers: &[u32]) -> Result<()> {
        if self.of_render {
            return Ok(());
        }
        let of_frame = |frame: &u32| {
            let output = path_of_frame(self.output, *frame).unwrap_or_else(|| self.output.to_owned());
            let claim = self.skip_existing.then(|| claim::file(&output));
            let png = self.picture.png.as_ref().and_then(|png| path_of_frame(png, *frame));
            [Some(output), claim, png].into_iter().flatten()
        };
        let outputs = Outputs::new(numbers.iter().flat_map(of_frame))?;
        outputs.check(paths.values().map(PathBuf::as_path).chain(output::model_file(self.finish)))
    }

    /// Claims a frame if other processes may finish it too. The inner error is the reason for which it is skipped.
    fn claim(
        &self,
        frame: u32,
        output: &Path,
        files: &FrameFiles,
        paths: &BTreeMap<u32, PathBuf>,
    ) -> Result<std::result::Result<Option<Claim>, String>> {
        if let Some(missing) = self.awaited(frame, paths) {
            return Ok(Err(format!("waits for frame {missing}: the machine that renders it finishes both")));
        }
        let done = || self.is_done(files, frame, output);
        if !self.skip_existing {
            return Ok(Ok(None));
        }
        if done() {
            return Ok(Err("is finished".into()));
        }
        Ok(match Claim::claim(output)? {
            Claimed::Elsewhere(owner) => Err(format!("is finished by {owner}")),
            // Another machine may have finished the frame before this one got the claim.
            Claimed::Here(_) if done() => Err("is finished".into()),
            Claimed::Here(claim) => Ok(Some(claim)),
        })
    }

    /// Finishes a frame and writes its files.
    fn finish_frame(&self, frame: u32, output: &Path, files: &mut FrameFiles, opened: &mut OpenFinish) -> Result<()> {
        let finished = files.finish(frame, opened, self.of_render)?;
        finished.remarks.iter().for_each(|remark| say(&format!("warning: {remark}")));
        exr::write(output, &finished.set, &finished.attributes, self.picture.exr_options(finished.naming))?;
        let png = self.picture.png.as_ref().and_then(|png| path_of_frame(png, frame));
        let picture = PictureArgs { png, ..self.picture.clone() };
        picture.write_png(&finished.set, &look_of(&finished.attributes))
    }

    /// Numbers of the frames to finish.
    ///
    /// # Errors
    /// There are no files, or the user has asked for a frame that has none.
    fn numbers(&self, paths: &BTreeMap<u32, PathBuf>) -> Result<Vec<u32>> {
        let Some(frames) = self.frames else {
            return if paths.is_empty() { Err(no_frames(self.input)) } else { Ok(paths.keys().copied().collect()) };
        };
        let (there, missing): (Vec<u32>, Vec<u32>) = frames.iter().partition(|frame| paths.contains_key(frame));
        match missing.first() {
            Some(frame) if !self.of_render => {
                let path = path_of_frame(self.input, *frame).unwrap_or_else(|| self.input.to_owned());
                let error = Error::new(ErrorKind::Io, path.display(), "there is no such frame");
                Err(error.hint("render it, or name other frames with --frames"))
            }
            _ => Ok(there),
        }
    }

    /// The nearest frame in the window of a frame that the render has still to make; `None` if there is none.
    fn awaited(&self, frame: u32, paths: &BTreeMap<u32, PathBuf>) -> Option<u32> {
        let frames = self.frames.filter(|_| self.of_render)?;
        let near = |other: &u32| other.abs_diff(frame) <= caustique::finish::temporal::REACH as u32;
        frames
            .iter()
            .filter(|other| near(other) && !paths.contains_key(other))
            .min_by_key(|other| other.abs_diff(frame))
    }

    /// Whether a frame needs no finish any more.
    fn is_done(&self, files: &FrameFiles, frame: u32, path: &Path) -> bool {
        if self.of_render {
            return files.is_finished(frame);
        }
        output::is_whole(path)
    }

    fn report(&self, text: &str) {
        if self.progress.for_people() {
            say(text);
        }
    }
}
