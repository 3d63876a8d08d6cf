//! Running a program that may take too long, or be asked to stop.

use crate::render::Clock;
use rustix::process::{Pid, Signal, kill_process_group};
use std::fs::File;
use std::io::{Read, Seek};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::time::Duration;

/// Whether to stop.
pub type Stop<'a> = &'a dyn Fn() -> bool;

/// How long to sleep between looks.
const EVERY: Duration = Duration::from_millis(20);

/// How a program ended.
pub(super) enum End {
    /// By itself, with what it wrote on its standard output and error.
    Exit(ExitStatus, [String; 2]),
    /// It was killed, for it took longer than it may.
    TooLong,
    /// It was killed, for somebody asked.
    Stopped,
}

/// Kills what is left of a program, and of what that has started, when it goes.
struct Group(Child);

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(group) = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw) {
            // Nothing to tell if all have ended.
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.0.wait();
    }
}

/// Runs a program, for so many seconds at most. It is in a process group of its own: a terminal's Ctrl-C reaches this
/// program alone, which ends the other.
///
/// # Errors
/// It cannot be started.
pub(super) fn run(mut command: Command, limit: f64, stop: Stop<'_>) -> std::io::Result<End> {
    // Files, because pipes that nobody reads fill up.
    let mut said: [File; 2] = [tempfile::tempfile()?, tempfile::tempfile()?];
    command.stdin(std::process::Stdio::null()).stdout(said[0].try_clone()?).stderr(said[1].try_clone()?);
    let mut child = Group(command.process_group(0).spawn()?);
    let clock = Clock::start();
    loop {
        if let Some(status) = child.0.try_wait()? {
            let mut texts = [const { String::new() }; 2];
            for (file, text) in said.iter_mut().zip(&mut texts) {
                let mut bytes = Vec::new();
                file.rewind()?;
                file.read_to_end(&mut bytes)?;
                *text = String::from_utf8_lossy(&bytes).into_owned();
            }
            return Ok(End::Exit(status, texts));
        }
        if stop() {
            return Ok(End::Stopped);
        }
        if clock.seconds() > limit {
            return Ok(End::TooLong);
        }
        std::thread::sleep(EVERY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    /// Whether a process is there and no zombie.
    fn lives(id: &str) -> bool {
        let state = std::fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
        state.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with('Z'))
    }

    #[test]
    fn what_a_program_says_comes_back() {
        let script = "head -c 300000 /dev/zero | tr '\\0' x; echo fault >&2; exit 3";
        let End::Exit(status, [out, err]) = run(shell(script), 60.0, &|| false).expect("it starts") else {
            panic!("it ends by itself")
        };
        assert_eq!((status.code(), out.len(), err.as_str()), (Some(3), 300_000, "fault\n"));
        assert!(run(Command::new("/nowhere/at/all"), 60.0, &|| false).is_err());
    }

    /// Also what the program has started ends with it.
    #[test]
    fn who_takes_too_long_or_is_asked_to_stop_is_killed_with_its_children() {
        let folder = tempfile::tempdir().expect("a folder");
        for (limit, stops) in [(0.5, false), (600.0, true)] {
            let noted = folder.path().join("pid");
            let script = format!("sleep 600 & echo $! > {}; wait", noted.display());
            let there = || std::fs::read_to_string(&noted).ok().filter(|id| id.ends_with('\n'));
            let clock = Clock::start();
            let end = run(shell(&script), limit, &|| stops && there().is_some()).expect("it starts");
            assert!(matches!((stops, end), (true, End::Stopped) | (false, End::TooLong)));
            assert!(clock.seconds() < 60.0);
            let id = there().expect("it was started");
            while lives(&id) && clock.seconds() < 60.0 {
                std::thread::sleep(EVERY);
            }
            assert!(!lives(&id), "{id} goes on");
            std::fs::remove_file(&noted).expect("it is there");
        }
    }
}
