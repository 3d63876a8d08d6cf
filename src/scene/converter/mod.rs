//! Runs a converter: embedded scripts in Python, which turn a scene file of another program into a .glb.

pub mod answer;

use super::description::Description;
use super::gltf::{self, FrameTime, MovingFile, Pose, ReadOptions};
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::memory;
use crate::stop::Stop;
use crate::system;
use crate::temporary;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// Default time limit of a conversion, in seconds.
const DEFAULT_MAX_SECONDS: u32 = 3600;
/// Time between two checks whether a converter has ended, or whether the user has asked to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(10);
/// Number of checks from the end of a converter's standard input, which ends it, until it is killed.
const MAX_POLLS_AFTER_END: u32 = 300;

/// The time limit of a conversion, in seconds: that of the environment variable of this name, or the default.
///
/// # Errors
/// The variable is no number of seconds.
pub(super) fn max_seconds(variable: &str) -> Result<u32> {
    let Some(value) = std::env::var_os(variable) else { return Ok(DEFAULT_MAX_SECONDS) };
    // poll(2) takes milliseconds in 31 bits.
    let seconds =
        value.to_str().and_then(|value| value.parse().ok()).filter(|seconds| (1..=2_000_000).contains(seconds));
    seconds.ok_or_else(|| {
        let error = Error::new(ErrorKind::Usage, variable, format!("{} is no number of seconds", value.display()));
        error.hint("give a whole number from 1 to 2000000, or none")
    })
}

/// Free memory that a converter may take, in bytes; 0 if it is unknown.
pub(super) fn memory_limit() -> u64 {
    memory::available().map_or(0, |available| available.bytes)
}

/// Rejects options that choose among the parts of a glTF file, and `remedy` says what to do instead.
pub(super) fn check_choices(path: &Path, options: &ReadOptions, kind: &str, remedy: &str) -> Result<()> {
    let ReadOptions { scene, animation, variant, pose, .. } = options;
    let given = [
        ("scene", scene.is_some()),
        ("animation", animation.is_some()),
        ("variant", variant.is_some()),
        ("pose rest", *pose == Pose::Rest),
    ];
    let Some((option, _)) = given.into_iter().find(|(_, given)| *given) else { return Ok(()) };
    let error = Error::new(ErrorKind::Usage, path.display(), format!("--{option} is for glTF files, not for {kind}"));
    Err(error.hint(remedy))
}

/// The scripts of a converter in a temporary folder, which is removed on drop.
pub(super) struct Converter<'p> {
    scene: &'p Path,
    /// The folder of the scripts in the repository, for messages.
    scripts: &'static str,
    folder: tempfile::TempDir,
}

impl<'p> Converter<'p> {
    /// Writes the scripts, given by their names and contents, to a folder whose name begins with `prefix`.
    ///
    /// # Errors
    /// The scene file cannot be read, or the folder cannot be written.
    pub fn new(
        scene: &'p Path,
        prefix: &str,
        scripts: &'static str,
        sources: &[(&str, &str)],
    ) -> Result<Converter<'p>> {
        files::open(scene)
            .map_err(|e| Error::io(scene, &e).hint("check the path of the scene file and your right to read it"))?;
        let folder = temporary::create_folder(prefix)?;
        for (name, source) in sources {
            let path = folder.path().join(name);
            std::fs::write(&path, source).map_err(|cause| Error::io(&path, &cause))?;
        }
        Ok(Converter { scene, scripts, folder })
    }

    /// The path of a file in the converter's folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the command, whose errors of starting end with `hint`, and returns what it printed. It must end when its
    /// standard input closes, and is killed otherwise.
    ///
    /// # Errors
    /// The command does not run or fails, or `stop` ends it.
    pub fn run(&self, mut command: Command, hint: &str, stop: &Stop) -> Result<Vec<u8>> {
        let program = PathBuf::from(command.get_program());
        let [out, log] = ["stdout", "stderr"].map(|name| self.path(name));
        let create = |path: &Path| File::create(path).map_err(|cause| Error::io(path, &cause));
        // In its own process group, so that Ctrl-C reaches only this program. Files take any length of output, and a
        // process that the converter leaves behind cannot keep them from ending, as it could pipes.
        system::shield_from_interrupts(&mut command).stdin(Stdio::piped()).stdout(create(&out)?).stderr(create(&log)?);
        let status = command
            .spawn()
            .and_then(|child| wait_or_stop(child, stop))
            .map_err(|cause| Error::new(ErrorKind::Library, program.display(), cause).hint(hint))?;
        let read = |path: &Path| std::fs::read(path).map_err(|cause| Error::io(path, &cause));
        if status.success() {
            return read(&out);
        }
        if stop.requested() {
            let cause = "interrupted while the scene was read";
            return Err(Error::new(ErrorKind::Interrupted, self.scene.display(), cause));
        }
        Err(answer::failure(&read(&log)?, self.scene, self.scripts))
    }

    /// Reads the .glb that the converter has written for the frame of `options`, and `printed`, the files that it named.
    ///
    /// # Errors
    /// Those of [`gltf::read`].
    pub fn read(self, glb: &Path, printed: &[u8], options: &ReadOptions) -> Result<(Description, Option<MovingFile>)> {
        // The converter has applied the frame, and has copied the files that the scene names beside the .glb.
        let frame = options.frame.map(|frame| FrameTime { of_sequence: true, ..frame });
        let read = MovingFile::open(glb, &ReadOptions { frame, allow_outside: false, ..options.clone() });
        let (mut description, moving) = read.map_err(|mut error| {
            error.place = error.place.replace(&glb.display().to_string(), &self.scene.display().to_string());
            error
        })?;
        description.source = self.scene.to_owned();
        description.files = answer::files(printed, self.scene)?;
        // The converted file contains the textures and other files of the scene.
        description.converted = Some(gltf::hash(glb, false)?);
        // Other moments of the scene read files in the folder again.
        Ok((description, moving.map(|moving| moving.in_folder(self.folder))))
    }
}

/// Waits for the end of a converter. When `stop` is requested, closes its standard input, and kills it if it goes on.
fn wait_or_stop(mut child: Child, stop: &Stop) -> std::io::Result<ExitStatus> {
    let mut stdin = child.stdin.take();
    let mut polls_after_end = 0;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if stop.requested() {
            drop(stdin.take());
            polls_after_end += 1;
        }
        if polls_after_end > MAX_POLLS_AFTER_END {
            child.kill()?;
            return child.wait();
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}
