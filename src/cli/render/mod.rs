//! `caustique render`: a scene in, an EXR and perhaps a PNG out.

mod job;
pub mod memory;
mod options;
pub mod plan;
mod summary;
mod techniques;

pub use job::{Job, Method};
pub use options::RenderArgs;

use super::finish::Ready;
use super::progress::{Reporter, Waiting, duration, percent};
use super::scene::Loaded;
use super::signals::Interrupt;
use super::{output, say, scene};
use caustique::camera::Camera;
use caustique::error::Result;
use caustique::estimator::Pixel;
use caustique::film::cryptomatte::{Cryptomatte, PixelRanks, RANKS};
use caustique::film::{Layer, LayerSet, Selection, describe, output as film};
use caustique::finish;
use caustique::image::exr::{self, Attributes};
use caustique::render::auto::{Choice, choose};
use caustique::render::output::{Present, shape};
use caustique::render::{Clock, Control, Rendered, Settings, Told, cpu_seconds, peak_memory};
use caustique::scene::Scene;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use summary::Summary;

/// Kinds of cryptomattes.
const CRYPTOMATTES: [&str; 2] = ["CryptoObject", "CryptoMaterial"];

/// Renders: everything that can be wrong is found before the first light path.
pub fn run(args: &RenderArgs) -> Result<()> {
    let settings = args.settings()?;
    // What is in the scene is not known yet.
    let anything = Present { environment: true, volume: true, narrow_lobes: true };
    let selection = selection(args, &settings, anything)?;
    output::check(&args.output, "exr")?;
    args.picture.check()?;
    techniques::prepare(args)?;
    super::pool(args.threads)?.install(|| render(args, &settings, &selection))
}

fn render(args: &RenderArgs, settings: &Settings, selection: &Selection) -> Result<()> {
    let threads = rayon::current_num_threads();
    let Loaded { scene, removed } = scene::read(&args.job.scene, args.progress, threads)?;
    scene::tell(&args.job.scene, &scene.warnings)?;
    let camera = scene.camera(&args.job.view())?;
    plan::check_media(&args.job, &scene)?;
    plan::check_bandwidth(&args.job, &scene)?;
    let settings = &args.job.sized(settings.clone(), camera.size());
    let present = Present::of(&scene);
    self::selection(args, settings, present)?;
    // Before anything is tried, which takes time.
    memory::check((&scene, &camera), settings, channels(settings, present))?;
    let interrupt = Interrupt::listen()?;
    let choice = auto(args, (&scene, &camera), present, &interrupt)?;
    interrupt.before_the_first_iteration(&args.output)?;
    let settings = choice.as_ref().map_or(settings, |choice| &choice.settings);
    memory::check((&scene, &camera), settings, channels(settings, present))?;
    let mut plan = plan::plan(&plan::Wishes::of(&args.job, choice.as_ref()), &scene, &camera, &removed);
    let mut ready = ready(&args.job, settings.levels.count)?;
    let mut settings = settings.clone();
    if let (Some(ready), Some(time)) = (&mut ready, settings.time) {
        // The finish is part of the time that was asked for.
        let parts = film::names(&shape(&settings, 1, present));
        let wanted =
            parts.iter().filter_map(|name| finish::finished_part(name)).filter(|part| selection.wants(part)).count();
        settings.time = Some(time - ready.reserve(time, camera.size().0 as usize * camera.size().1 as usize, wanted)?);
    }
    let settings = &settings;
    let talk = args.progress.for_people();
    if let Some(choice) = choice.as_ref().filter(|_| talk) {
        say(&format!("method: {}", plan::why(choice)));
    }
    let mut reporter = Reporter::new(args.progress, settings);
    plan::tell(&args.job.scene.path, &plan.warnings);
    let mut rendered = caustique::render::render(&scene, &camera, settings, |progress, _| {
        reporter.report(progress);
        if interrupt.asked() { Control::Stop } else { Control::Continue }
    });
    reporter.finish();

    let mut header = rendered.account((!args.reproducible).then_some(threads));
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let wanted = |name: &str| selection.wants(name) || name.is_empty() || (ready.is_some() && finish::reads(name));
    let mut set = rendered.layers(present, wanted)?;
    let mut attributes = cryptomattes(&scene, &rendered, args, selection, &mut set)?;
    let summary = Summary::of(&rendered);
    let (size, pictures) = ((set.width, set.height), std::mem::take(&mut rendered.techniques));
    // The pixels are most of the memory, and all that is wanted of them is in the layers now.
    drop(rendered);
    let (mut refusal, mut finished) = (None, None);
    if let Some(ready) = &mut ready {
        let _waiting = Waiting::begin(args.progress, "finishing the picture");
        match ready.finish().apply(&mut set, |name| selection.wants(name)) {
            Ok(account) => finished = Some(account),
            Err(error) => refusal = Some(error),
        }
    }
    let finishing = clock.seconds();
    // A render that is still to be finished keeps what that reads.
    if refusal.is_none() {
        set = selection.apply(set)?;
    }

    // As `caustique plan` tells it.
    plan.warnings.splice(0..0, scene.warnings.iter().cloned());
    header.insert("plan".into(), json!(plan));
    let name = finished.as_ref().and(ready.as_ref()).map(Ready::name);
    let facts = finished.as_ref().zip(ready.as_ref()).map(|(account, ready)| ready.facts(account));
    complete(&mut header, args, &scene, facts, cpu_seconds() - cpu_start);
    attributes.insert(exr::ATTRIBUTE, &header)?;
    let written = write(args, &set, &attributes);
    let pictured = args.picture.write_png(&set);
    let debugged = techniques::write(args, size, &pictures);
    if talk {
        summary.tell();
        if let Some(name) = name {
            let told = finished.as_ref().and_then(|account| account.told).map(|told| told.half);
            // All quarters have the kernel's bias in common, whatever the levels tell of it.
            let note = if settings.method.has_bandwidths() { Told::Noise } else { settings.told() }.note();
            let error = told.map(|error| format!("; its quarters tell an error of {}{note}", percent(error)));
            say(&format!("finished with {name} in {}{}", duration(finishing), error.unwrap_or_default()));
        }
    }
    summary.tell_full();
    summary.tell_rejected(args);
    written?;
    pictured?;
    debugged?;
    if talk {
        Summary::tell_files(args, &set, pictures.len());
    }
    if let Some(error) = refusal {
        let output = args.output.display();
        return Err(error.hint(format!(
            "the unfinished render is in {output}: 'caustique combine {output} -o OUT.exr' finishes it"
        )));
    }
    summary.interrupted(args)
}

/// What auto chooses, where it is to: among ways whose pictures have the layers asked for.
fn auto(
    args: &RenderArgs,
    (scene, camera): (&Scene, &Camera),
    present: Present,
    interrupt: &Interrupt,
) -> Result<Option<Choice>> {
    if args.job.method != Method::Auto {
        return Ok(None);
    }
    let _waiting = Waiting::begin(args.progress, "choosing a method");
    let layers = |settings: &Settings| selection(args, settings, present).is_ok();
    let make = |way| args.allowed(way, camera.size()).filter(layers);
    Ok(choose((scene, camera), &mut args.job.pilot_finish()?, make, || interrupt.asked()))
}

/// Writes the EXR; where that fails, to the system's folder for temporary files, so that the render is not lost.
///
/// # Errors
/// The EXR could not be written where it was asked for; the hint says where it is instead.
fn write(args: &RenderArgs, set: &LayerSet, attributes: &Attributes) -> Result<()> {
    let options = args.picture.exr_options(args.exr_naming.into());
    let Err(error) = exr::write(&args.output, set, attributes, options) else { return Ok(()) };
    let name = args.output.file_name().unwrap_or("render.exr".as_ref());
    // A folder of its own: a file of that name may be there.
    let Ok(folder) = tempfile::Builder::new().prefix("caustique-").tempdir() else { return Err(error) };
    let rescued = folder.path().join(name);
    if exr::write(&rescued, set, attributes, options).is_err() {
        return Err(error);
    }
    let _ = folder.keep();
    Err(error.hint(format!("the render is in {}", rescued.display())))
}

/// Channels that a render with these settings can have.
fn channels(settings: &Settings, present: Present) -> usize {
    let names = layer_names(settings, present, true);
    names.iter().filter_map(|name| describe(name)).map(|layer| layer.components.len()).sum()
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

/// Names of the layers that a render with these settings can have, finished or not.
fn layer_names(settings: &Settings, present: Present, finished: bool) -> Vec<String> {
    let mut names = film::names(&shape(settings, 1, present));
    if finished {
        names.extend(names.iter().filter_map(|name| finish::finished_part(name)).collect::<Vec<_>>());
    }
    names.extend(CRYPTOMATTES.into_iter().flat_map(cryptomatte_layers));
    names
}

/// `--layers`, checked against what this render will have.
fn selection(args: &RenderArgs, settings: &Settings, present: Present) -> Result<Selection> {
    let selection = Selection::parse(&args.layers)?;
    let names = layer_names(settings, present, !args.job.no_combine);
    let layers = names.into_iter().map(|name| Layer { name, planes: vec![] }).collect();
    selection.apply(LayerSet { width: 0, height: 0, layers })?;
    Ok(selection)
}

/// The finish, if there is to be one.
pub fn ready(args: &Job, levels: usize) -> Result<Option<Ready>> {
    if args.no_combine { Ok(None) } else { args.finish.open(Some(levels)).map(Some) }
}

/// What the header says besides the render's own account.
fn complete(
    header: &mut Map<String, Value>,
    args: &RenderArgs,
    scene: &Scene,
    finished: Option<Value>,
    core_seconds: f64,
) {
    let mut put = |key: &str, value: Value| header.insert(key.into(), value);
    put("arguments", json!(args));
    put("warnings", json!(scene.warnings));
    // That of the finished picture is in `combined`.
    put("error_of", "Noisy".into());
    put("combined", finished.unwrap_or(Value::Null));
    if !args.reproducible
        && let Some(Value::Object(phases)) = header.get_mut("phases")
    {
        phases.insert("layers_and_finish".into(), core_seconds.into());
        header.insert("peak_memory".into(), peak_memory().into());
    }
}
