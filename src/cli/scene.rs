//! From a scene file and the options about it to a scene, and its warnings on stderr.

use super::progress::{Form, Waiting};
use super::say;
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::SceneOptions;
use caustique::pipeline::Loaded;
use caustique::pipeline::load::load;
use caustique::stop::Stop;

/// Reads and builds the scene as the options ask for it.
///
/// # Errors
/// See [`load`]; more than one frame.
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

/// Prints a line for each warning; with `--strict` they are an error that lists them all.
pub fn tell(args: &SceneOptions, warnings: &[String]) -> Result<()> {
    for warning in warnings {
        say(&format!("warning: {}: {warning}", args.path.display()));
    }
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    Err(forbidden(args, warnings.len()))
}

/// What `--strict` makes of so many warnings.
pub fn forbidden(args: &SceneOptions, warnings: usize) -> Error {
    let things = if warnings == 1 { "1 thing is" } else { &format!("{warnings} things are") };
    let cause = format!("{things} ignored or approximated, and --strict forbids it");
    Error::new(ErrorKind::Scene, args.path.display(), cause)
        .hint("mend what the warnings above name, or leave --strict out")
}
