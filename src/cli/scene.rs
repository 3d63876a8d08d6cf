//! Reads a scene by its options, and prints its warnings.

use super::progress::{Form, Waiting};
use super::say;
use super::warnings::lines;
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::SceneOptions;
use caustique::pipeline::Loaded;
use caustique::pipeline::load::load;
use caustique::stop::Stop;

/// Reads and builds a scene, and shows that while it takes long.
///
/// # Errors
/// Errors of [`load`]; the options name several frames.
pub fn read(args: &SceneOptions, form: Form, threads: usize) -> Result<Loaded> {
    let args = match args.frames {
        None => args,
        Some(frames) => match frames.single() {
            Some(frame) => &args.at(frame),
            None => {
                let error = Error::usage("--frames: this command looks at one frame");
                return Err(error.hint(format!("give one, such as --frames {}", frames.iter().next().unwrap_or(1))));
            }
        },
    };
    let _waiting = Waiting::begin(form, &format!("reading {}", args.path.display()));
    load(&args.request(), threads, &Stop::default())
}

/// Prints a line for each warning about the scene.
///
/// # Errors
/// `--strict` is set and there are warnings.
pub fn print_warnings(args: &SceneOptions, warnings: &[String]) -> Result<()> {
    for warning in lines(warnings, args.verbose) {
        say(&format!("warning: {}: {warning}", args.path.display()));
    }
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    Err(strict_error(args, warnings.len()))
}

/// The error that `--strict` makes of this number of warnings.
pub fn strict_error(args: &SceneOptions, warnings: usize) -> Error {
    let things = if warnings == 1 { "1 thing is" } else { &format!("{warnings} things are") };
    let cause = format!("{things} ignored or approximated, and --strict forbids it");
    Error::new(ErrorKind::Scene, args.path.display(), cause)
        .hint("fix what the warnings above name, or leave --strict out")
}
