//! `caustique combine`: finishes a stored picture.

use super::finish::FinishArgs;
use super::output::{self, PictureArgs};
use super::progress::{Form, duration};
use super::say;
use caustique::error::Result;
use caustique::film::{self, Layer, LayerSet, Naming, Plane};
use caustique::image::exr;
use caustique::pipeline::tell_stored;
use caustique::render::Clock;
use caustique::scene::description::Picture;
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
    finish: FinishArgs,
    #[command(flatten)]
    picture: PictureArgs,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = super::number::threads, help_heading = "Running")]
    threads: usize,
}

/// Names as Blender gives them back to ours. Layers with names that we cannot write are left out and returned.
pub fn take_plain_names(set: &mut LayerSet) -> Vec<String> {
    let known = ["", "Z", "P", "albedo", "normal", "depth"];
    for layer in &mut set.layers {
        if let Some(plain) = known.iter().find(|plain| Naming::Blender.layer(plain) == layer.name) {
            layer.name = (*plain).into();
            turn_back(layer);
        } else if let Some(pass) = layer.name.strip_prefix("ViewLayer.") {
            layer.name = pass.into();
        }
    }
    let fits = |layer: &Layer| {
        let empty = |plane: &Plane| Plane { component: plane.component.clone(), sample: plane.sample, values: vec![] };
        let planes = layer.planes.iter().map(empty).collect();
        let alone = LayerSet { width: 0, height: 0, layers: vec![Layer { name: layer.name.clone(), planes }] };
        film::check(&alone, Naming::Plain).is_ok()
    };
    let (kept, left): (Vec<Layer>, Vec<Layer>) = std::mem::take(&mut set.layers).into_iter().partition(fits);
    set.layers = kept;
    left.into_iter().map(|layer| layer.name).collect()
}

/// Positions and normals from Blender's axes to ours: (x, y, z) there is (x, z, -y) here.
fn turn_back(layer: &mut Layer) {
    if !matches!(layer.name.as_str(), "P" | "normal") {
        return;
    }
    for plane in &mut layer.planes {
        match plane.component.as_str() {
            "Y" => {
                plane.component = "Z".into();
                plane.values.iter_mut().for_each(|value| *value = -*value);
            }
            "Z" => plane.component = "Y".into(),
            _ => {}
        }
    }
    layer.planes.sort_by(|a, b| a.component.cmp(&b.component));
}

/// Finishes a file.
pub fn run(args: &CombineArgs) -> Result<()> {
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    super::pool(args.threads)?.install(|| {
        let mut ready = args.finish.open(None)?;
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
        let mut account =
            Form::Auto.during("finishing the picture", finish).map_err(|error| error.within(args.input.display()))?;
        let mut object = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
        object["combined"] = ready.facts(&account);
        if let Some(header) = object.as_object_mut() {
            tell_stored(header, &mut set, &mut account)?;
        }
        attributes.insert(exr::ATTRIBUTE, &object)?;
        exr::write(&args.output, &set, &attributes, args.picture.exr_options(naming))?;
        args.picture.write_png(&set, &Picture::default())?;
        say(&format!("finished with {} in {}", ready.name(), duration(clock.seconds())));
        Ok(())
    })
}
