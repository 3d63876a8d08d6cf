//! `caustique render`: a scene in, an EXR and perhaps a PNG out.

mod options;

pub use options::RenderArgs;

use super::combine::{DEFAULT_MODEL, Named};
use super::progress::{Reporter, count, duration, percent};
use super::signals::Interrupt;
use super::{output, scene};
use caustique::error::{Error, Kind, Result};
use caustique::estimator::Pixel;
use caustique::film::cryptomatte::{Cryptomatte, PixelRanks, RANKS};
use caustique::film::{Layer, LayerSet, Selection, output as film};
use caustique::image::exr::{self, Attributes};
use caustique::render::output::shape;
use caustique::render::{Clock, Control, Rendered, Settings, StopReason, cpu_seconds, peak_memory, sppm};
use caustique::scene::Scene;
use options::Method;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

/// Kinds of cryptomattes.
const CRYPTOMATTES: [&str; 2] = ["CryptoObject", "CryptoMaterial"];
/// Layers that the combiner reads.
const COMBINED_LAYERS: [&str; 5] = ["Level", "Variance", "albedo", "normal", "depth"];

/// Renders: everything that can be wrong is found before the first light path.
pub fn run(args: &RenderArgs) -> Result<()> {
    let settings = args.settings()?;
    let selection = selection(args, &settings)?;
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    super::pool(args.threads)?.install(|| render(args, &settings, &selection))
}

fn render(args: &RenderArgs, settings: &Settings, selection: &Selection) -> Result<()> {
    let threads = rayon::current_num_threads();
    let scene = scene::read(&args.scene, threads)?;
    scene::tell(&args.scene, &scene.warnings)?;
    let camera = scene.camera(&args.view())?;
    let mut network = network(args)?;
    let talk = args.progress.for_people();
    let interrupt = Interrupt::listen()?;
    if talk && args.method == Method::Auto {
        eprintln!("method: sppm, chosen by auto");
    }
    let mut reporter = Reporter::new(args.progress, settings);
    let rendered = sppm(&scene, &camera, settings, |progress, _| {
        reporter.report(progress);
        if interrupt.asked() { Control::Stop } else { Control::Continue }
    });
    reporter.finish();

    let mut header = rendered.account((!args.reproducible).then_some(threads));
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let combined_layer = |name: &str| COMBINED_LAYERS.iter().any(|stem| name.starts_with(stem));
    let wanted = |name: &str| selection.wants(name) || name.is_empty() || (network.is_some() && combined_layer(name));
    let environment = scene.lights.sky().environment.is_some();
    let mut set = rendered.layers(environment, wanted)?;
    let mut attributes = cryptomattes(&scene, &rendered, args, selection, &mut set)?;
    let summary = Summary::of(&rendered);
    // The pixels are most of the memory, and all that is wanted of them is in the layers now.
    drop(rendered);
    let combined = network.as_mut().map(|network| network.apply(&mut set)).transpose()?;
    let combining = clock.seconds();
    set = selection.apply(set)?;

    complete(&mut header, args, &scene, combined, cpu_seconds() - cpu_start);
    attributes.insert(exr::ATTRIBUTE, &header)?;
    exr::write(&args.output, &set, &attributes, args.picture.exr_options(args.exr_naming.into()))?;
    args.picture.write_png(&set)?;
    if talk {
        summary.tell(args, network.as_ref().map(|network| (network.name.as_str(), combining)), &set);
    }
    summary.tell_rejected(args);
    summary.interrupted(args)
}

/// Adds the cryptomattes of objects and materials that are asked for; returns their attributes.
fn cryptomattes(
    scene: &Scene,
    rendered: &Rendered,
    args: &RenderArgs,
    selection: &Selection,
    set: &mut LayerSet,
) -> Result<Attributes> {
    let mut attributes = Attributes::default();
    let instances = &scene.shapes.instances;
    let materials = scene.materials.list.iter().map(|material| material.name.clone());
    let objects = Cryptomatte::new(CRYPTOMATTES[0], scene.objects.iter().cloned());
    let materials = Cryptomatte::new(CRYPTOMATTES[1], materials);
    let kinds: [(Cryptomatte, &(dyn Fn(u32) -> u32 + Sync)); 2] = [
        (objects, &|instance| instances[instance as usize].object),
        (materials, &|instance| instances[instance as usize].material),
    ];
    for ((mattes, of_instance), kind) in kinds.into_iter().zip(CRYPTOMATTES) {
        if !cryptomatte_layers(kind).any(|name| selection.wants(&name)) {
            continue;
        }
        let ranks = |pixel: &Pixel| {
            let mut ranks = PixelRanks::default();
            for (instance, fraction) in pixel.coverage.fractions() {
                ranks.add(mattes.ids()[of_instance(instance) as usize], fraction);
            }
            ranks
        };
        let ranks: Vec<PixelRanks> = rendered.pixels.par_iter().map(ranks).collect();
        for layer in mattes.layers(&ranks, 1.0) {
            set.push(layer)?;
        }
        attributes.0.extend(mattes.attributes(args.exr_naming.into()));
    }
    Ok(attributes)
}

/// Names of the layers of one kind of cryptomatte.
fn cryptomatte_layers(kind: &str) -> impl Iterator<Item = String> {
    (0..RANKS / 2).map(move |index| format!("{kind}{index:02}"))
}

/// `--layers`, checked against what this render will have.
fn selection(args: &RenderArgs, settings: &Settings) -> Result<Selection> {
    let selection = Selection::parse(&args.layers)?;
    let mut names = film::names(&shape(settings, 1, false));
    names.extend(CRYPTOMATTES.into_iter().flat_map(cryptomatte_layers));
    let layers = names.into_iter().map(|name| Layer { name, planes: vec![] }).collect();
    selection.apply(LayerSet { width: 0, height: 0, layers })?;
    Ok(selection)
}

/// The combiner, if it is to run.
fn network(args: &RenderArgs) -> Result<Option<Named>> {
    // A single level leaves nothing to combine.
    if args.no_combine || (args.levels == 1 && args.model.is_none()) {
        return Ok(None);
    }
    let network = Named::open(args.model.as_deref().unwrap_or(DEFAULT_MODEL)).map_err(|mut error| {
        if error.kind == Kind::Library {
            let advice = "or add --no-combine to do without the combiner";
            error.hint = Some(error.hint.map_or(advice.into(), |hint| format!("{hint}; {advice}")));
        }
        error
    })?;
    if network.levels() == args.levels {
        return Ok(Some(network));
    }
    let cause = format!("the network {} combines {} levels, not {}", network.name, network.levels(), args.levels);
    let error = Error::new(Kind::Usage, "command line", cause);
    Err(error.hint(format!("add --no-combine, or render with --levels {}", network.levels())))
}

/// What the header says besides the render's own account.
fn complete(
    header: &mut Map<String, Value>,
    args: &RenderArgs,
    scene: &Scene,
    combined: Option<Value>,
    core_seconds: f64,
) {
    let mut put = |key: &str, value: Value| header.insert(key.into(), value);
    put("arguments", json!(args));
    put("warnings", json!(scene.warnings));
    // The combined picture has no error estimate of its own yet: that of the uncombined one bounds it in practice.
    put("error_of", "Noisy".into());
    put("combined", combined.unwrap_or(Value::Null));
    if !args.reproducible
        && let Some(Value::Object(phases)) = header.get_mut("phases")
    {
        phases.insert("layers_and_combiner".into(), core_seconds.into());
        header.insert("peak_memory".into(), peak_memory().into());
    }
}

/// What is left to say when the pixels are gone.
struct Summary {
    iterations: u64,
    light_paths: u64,
    seconds: f64,
    phases: String,
    error: Option<f64>,
    rejected: u64,
    stop: StopReason,
}

impl Summary {
    fn of(rendered: &Rendered) -> Summary {
        let p = rendered.phases;
        Summary {
            iterations: rendered.iterations,
            light_paths: rendered.light_paths,
            seconds: rendered.seconds,
            phases: format!(
                "core-seconds: pilot {:.1}, light {:.1}, map {:.1}, eye {:.1}",
                p.pilot, p.light, p.map, p.eye
            ),
            error: rendered.relative_error(),
            rejected: rendered.rejected(),
            stop: rendered.stop,
        }
    }

    fn tell(&self, args: &RenderArgs, combined: Option<(&str, f64)>, set: &LayerSet) {
        let rate = count(self.light_paths as f64 / self.seconds.max(1e-9));
        eprintln!(
            "{} iterations in {} ({}), {} light paths, {rate} a second",
            self.iterations,
            duration(self.seconds),
            self.phases,
            count(self.light_paths as f64)
        );
        if let Some(error) = self.error {
            eprintln!("estimated relative error before combining {}", percent(error));
        }
        if let Some((name, seconds)) = combined {
            eprintln!("combined with {name} in {}", duration(seconds));
        }
        eprintln!("peak memory {:.2} GiB", peak_memory() as f64 / f64::from(1 << 30));
        let channels: usize = set.layers.iter().map(|layer| layer.planes.len()).sum();
        eprintln!("{}: {} x {}, {channels} channels", args.output.display(), set.width, set.height);
        if let Some(png) = &args.picture.png {
            eprintln!("{}", png.display());
        }
    }

    fn tell_rejected(&self, args: &RenderArgs) {
        if self.rejected > 0 {
            let (name, n) = (args.output.display(), self.rejected);
            eprintln!("warning: {name}: {n} samples were not finite and are left out; the layer Rejected shows where");
        }
    }

    fn interrupted(&self, args: &RenderArgs) -> Result<()> {
        if self.stop != StopReason::Interrupted {
            return Ok(());
        }
        let cause = format!("interrupted after {} iterations, which are written", self.iterations);
        Err(Error::new(Kind::Interrupted, args.output.display(), cause))
    }
}
