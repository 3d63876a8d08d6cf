//! Options that the kind of scene file sets unless the command line gives them: the render settings of a USD stage, and
//! layers for compositing from a file of Blender.

use super::{Cli, Command, usage};
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::{SceneOptions, path_of_frame};
use caustique::scene::folder::Folder;
use caustique::scene::{blend, usd};
use clap::FromArgMatches;
use std::ffi::OsString;
use std::path::Path;

/// Prefix of the argument that names the output of a USD RenderProduct; nothing follows if the product has no name.
const OUTPUT_PREFIX: &str = "--output=";

/// Parses the command line, `words`, again with the options of its scene file in front, so that those of the command line take
/// precedence. `plan` takes only the options that it has.
///
/// # Errors
/// The stage cannot be read, or its options do not exist or contradict the command line.
pub fn add_stage_options(command: Command, mut words: Vec<OsString>, line: &mut clap::Command) -> Result<Command> {
    let (scene, known) = match &command {
        Command::Render(args) => (&args.options.scene, None),
        Command::Plan(args) => (args.scene(), line.find_subcommand("plan")),
        _ => return Ok(command),
    };
    let path = first_file(scene);
    let is_stage = usd::is_stage(&path.path) && path.path.is_file();
    let options = match is_stage {
        true => usd::arguments(&path.path, path.allow_outside)?,
        // Artists composite, and seldom need the layers of the estimate.
        false if blend::is_blend(&path.path) => vec!["--layers=comp".into()],
        false => return Ok(command),
    };
    let named = |word: &String| word.starts_with(OUTPUT_PREFIX);
    let (products, mut said): (Vec<String>, Vec<String>) = options.into_iter().partition(named);
    said.retain(|word| {
        let name = word.trim_start_matches("--").split('=').next();
        known.is_none_or(|known| known.get_arguments().any(|argument| has_name(argument, name)))
    });
    if is_stage && matches!(&command, Command::Render(args) if !args.has_output()) {
        let product = output(&path, products)?;
        product.iter().try_for_each(|word| check_output(scene, word.trim_start_matches(OUTPUT_PREFIX).as_ref()))?;
        said.extend(product);
    }
    if said.is_empty() {
        return Ok(command);
    }
    let at = words.len().min(2);
    words.splice(at..at, said.into_iter().map(OsString::from));
    let name = words.get(1).cloned().unwrap_or_default();
    let parsed = line.try_get_matches_from_mut(words).and_then(|matches| Cli::from_arg_matches(&matches));
    match parsed {
        Ok(cli) => Ok(cli.command),
        Err(error) => match usage::explain(&error, line.find_subcommand(name)) {
            Some(error) => Err(error.within(format!("{}: RenderSettings", path.path.display()))),
            None => Ok(command),
        },
    }
}

/// Whether an option has this name, or had it formerly.
fn has_name(argument: &clap::Arg, name: Option<&str>) -> bool {
    let aliases = argument.get_all_aliases().unwrap_or_default();
    argument.get_long() == name || name.is_some_and(|name| aliases.contains(&name))
}

/// The argument that names the output, by the RenderProduct of the USD stage; `None` if it has no name.
///
/// # Errors
/// The stage has several products.
fn output(scene: &SceneOptions, mut products: Vec<String>) -> Result<Option<String>> {
    if products.len() < 2 {
        return Ok(products.pop().filter(|word| word != OUTPUT_PREFIX));
    }
    let names: Vec<&str> = products.iter().map(|word| word.trim_start_matches(OUTPUT_PREFIX)).collect();
    let cause = format!("RenderSettings has several products, and a render writes one: {}", names.join(", "));
    let hint = "-o OUT.exr renders the first; for each of the others make RenderSettings with that product alone";
    Err(Error::new(ErrorKind::Usage, scene.path.display(), cause).hint(hint))
}

/// Checks that the output that a USD stage names is in the stage's folder, for every frame.
///
/// # Errors
/// It is outside, and the user does not allow this.
fn check_output(scene: &SceneOptions, output: &Path) -> Result<()> {
    let numbers = scene.frames.into_iter().flat_map(|frames| frames.iter());
    let names = numbers.filter_map(|frame| path_of_frame(output, frame)).chain([output.to_owned()]);
    for name in names {
        let path = std::path::absolute(&name).map_err(|cause| Error::io(&name, &cause))?;
        if Folder::of(&scene.path, scene.allow_outside).file(&path).is_err() {
            let cause = format!("its RenderProduct names the output {}, which is outside its folder", name.display());
            let error = Error::new(ErrorKind::Usage, scene.path.display(), cause);
            return Err(error.hint("name the output with -o, or allow such outputs with --allow-outside"));
        }
    }
    Ok(())
}

/// The scene's options, with the path of a sequence of files replaced by that of its first frame's file.
fn first_file(scene: &SceneOptions) -> SceneOptions {
    let first = scene.frames.and_then(|frames| frames.iter().next());
    first.map_or_else(|| scene.clone(), |frame| scene.at(frame))
}
