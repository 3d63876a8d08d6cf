//! `caustique combine`: the learned combiner on layers in memory and in files.

use super::output::{self, PictureArgs};
use super::progress::duration;
use super::say;
use caustique::combine::{Combiner, LevelStack, Model, Runtime};
use caustique::error::Result;
use caustique::film::{self, Layer, LayerSet, Naming, Plane, Role};
use caustique::image::exr;
use caustique::render::Clock;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Name of the network that comes with the program.
pub const DEFAULT_MODEL: &str = "compact";

/// Run the learned combiner on a rendered EXR
///
/// The file needs the layers Level1, Level2, ..., their Variance1, ..., albedo, normal and depth, as 'caustique render' writes them;
/// names as Blender gives them will do. All layers are kept, the picture itself is replaced.
#[derive(clap::Args)]
pub struct CombineArgs {
    /// EXR with bandwidth levels
    input: PathBuf,
    /// EXR to write
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
    /// Network: 'compact' comes with the program; or an ONNX file
    #[arg(long, value_name = "compact|paper|FILE.onnx", default_value = DEFAULT_MODEL)]
    model: String,
    #[command(flatten)]
    picture: PictureArgs,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = super::number::threads)]
    threads: usize,
}

/// A network, and how `--model` called it.
pub struct Named {
    /// What `--model` said.
    pub name: String,
    combiner: Combiner,
}

impl Named {
    /// Finds ONNX Runtime and loads the network; the current rayon pool says how many threads it gets.
    pub fn open(name: &str) -> Result<Named> {
        let model = Model::open(name)?;
        Ok(Named { name: name.into(), combiner: Combiner::new(&model, &Runtime::find()?)? })
    }

    /// The network alone.
    pub fn into_combiner(self) -> Combiner {
        self.combiner
    }

    /// Levels that it takes.
    pub fn levels(&self) -> usize {
        self.combiner.facts().levels
    }

    /// Combines the levels of `set` and makes the result its beauty; alpha stays. Returns what the header says about it.
    pub fn apply(&mut self, set: &mut LayerSet) -> Result<Value> {
        let combined = self.combiner.run(&LevelStack::of(set)?)?;
        let alpha = set.find(Role::Beauty).and_then(|beauty| beauty.plane("A")).map(|plane| plane.values.clone());
        set.layers.retain(|layer| layer.name != "Combined");
        let layer = match alpha {
            Some(alpha) => {
                let pixels = combined.into_iter().zip(alpha).map(|([r, g, b], a)| [r, g, b, a]);
                Layer::interleaved("", "RGBA", pixels)
            }
            None => Layer::interleaved("", "RGB", combined),
        };
        set.push(layer)?;
        Ok(json!({"model": self.name, "levels": self.levels(), "training": self.combiner.facts().training}))
    }
}

/// Names as Blender gives them back to ours. Layers with names that we cannot write are left out and returned.
fn take_plain_names(set: &mut LayerSet) -> Vec<String> {
    let known = ["", "Z", "P", "albedo", "normal", "depth"];
    for layer in &mut set.layers {
        if let Some(plain) = known.iter().find(|plain| Naming::Blender.layer(plain) == layer.name) {
            layer.name = (*plain).into();
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

/// Combines a file.
pub fn run(args: &CombineArgs) -> Result<()> {
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    super::pool(args.threads)?.install(|| {
        let mut network = Named::open(&args.model)?;
        let (mut set, mut attributes) = exr::read(&args.input)?;
        // Names in the style of the input: cryptomatte attributes hold them too.
        let blender = set.layers.iter().any(|layer| layer.name.starts_with("ViewLayer."));
        let naming = if blender { Naming::Blender } else { Naming::Plain };
        for name in take_plain_names(&mut set) {
            let input = args.input.display();
            say(&format!("warning: {input}: layer \"{name}\" cannot be written under this name and is left out"));
        }
        let clock = Clock::start();
        let facts = network.apply(&mut set).map_err(|error| error.within(args.input.display()))?;
        let mut object = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
        object["combined"] = facts;
        attributes.insert(exr::ATTRIBUTE, &object)?;
        exr::write(&args.output, &set, &attributes, args.picture.exr_options(naming))?;
        args.picture.write_png(&set)?;
        say(&format!("combined {} levels with {} in {}", network.levels(), network.name, duration(clock.seconds())));
        Ok(())
    })
}
