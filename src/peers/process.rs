//! Runs a program that can exceed a time limit or be stopped by the user.

use crate::render::Clock;
use crate::system::Group;
use std::fs::File;
use std::io::{Read, Seek};
use std::process::{Command, ExitStatus};
use std::time::Duration;

/// A callback that returns true when the program must stop; called repeatedly while the program runs.
pub type Stop<'a> = &'a dyn Fn() -> bool;

/// Time between two polls of the program's state.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// How a child program has ended.
pub(super) enum End {
    /// It has exited by itself; holds the status, standard output and standard error.
    Exit(ExitStatus, [String; 2]),
    /// It was killed after it exceeded its time limit.
    TooLong,
    /// It was killed because [`Stop`] returned true.
    Stopped,
}

/// Runs a program for at most `limit` seconds. It has its own process group, so that Ctrl-C in a terminal reaches only
/// caustique, which then stops the program.
///
/// # Errors
/// The program cannot be started.
pub(super) fn run(mut command: Command, limit: f64, stop: Stop<'_>) -> std::io::Result<End> {
    // Files, because pipes that are not read fill up.
    let mut outputs: [File; 2] = [tempfile::tempfile()?, tempfile::tempfile()?];
    command.stdin(std::process::Stdio::null()).stdout(outputs[0].try_clone()?).stderr(outputs[1].try_clone()?);
    let mut child = Group::start(&mut command)?;
    let clock = Clock::start();
    loop {
        if let Some(status) = child.try_wait()? {
            let mut texts = [const { String::new() }; 2];
            for (file, text) in outputs.iter_mut().zip(&mut texts) {
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
        std::thread::sleep(POLL_INTERVAL);
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

    /// Whether the process with the number `id` exists and is not a zombie.
    fn is_alive(id: &str) -> bool {
        let state = std::fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
        state.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with('Z'))
    }

    #[test]
    fn output_and_exit_status_are_returned() {
        let script = "head -c 300000 /dev/zero | tr '\\0' x; echo fault >&2; exit 3";
        let End::Exit(status, [out, err]) = run(shell(script), 60.0, &|| false).expect("it starts") else {
            panic!("it ends by itself")
        };
        assert_eq!((status.code(), out.len(), err.as_str()), (Some(3), 300_000, "fault\n"));
        assert!(run(Command::new("/nowhere/at/all"), 60.0, &|| false).is_err());
    }

    /// Children of the program are killed with it.
    #[test]
    fn programs_are_killed_with_their_children_after_the_limit_or_a_stop() {
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
            while is_alive(&id) && clock.seconds() < 60.0 {
                std::thread::sleep(POLL_INTERVAL);
            }
            assert!(!is_alive(&id), "{id} still runs");
            std::fs::remove_file(&noted).expect("it is there");
        }
    }
}
