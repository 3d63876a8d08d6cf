//! `caustique converge`: compares methods by their accuracy against time.

mod files;
mod options;
mod peers;
mod progress;
mod reference;
mod runs;

pub use options::ConvergeArgs;

use super::render::print_plan_warnings;
use super::signals::Interrupt;
use super::{finish_options, say, scene};
use caustique::camera::Camera;
use caustique::error::{Error, ErrorKind, Result};
use caustique::finish::Finish;
use caustique::image::tonemap::Look;
use caustique::pipeline::check::check_settings;
use caustique::pipeline::choose::{Chosen, choose};
use caustique::pipeline::learn::Learnt;
use caustique::pipeline::plan::{self, PlanInput};
use caustique::pipeline::{Loaded, OpenFinish, memory};
use caustique::plan::switch::Removed;
use caustique::render::{Control, Settings, TimeSpent};
use caustique::report::crop::Window;
use caustique::report::entry::Entry;
use caustique::report::equal_time::{Participants, Rules, render_in_turns};
use caustique::report::inside::shows_glass_or_mirror;
use caustique::report::summary::{ReportOptions, Subject, find, summarize};
use caustique::scene::View;
use progress::Reporter;
use runs::Run;
use std::collections::HashSet;

/// Seconds of each run (a render by one method) if no option limits it.
const DEFAULT_TIME: f64 = 60.0;

/// Seconds that each run may take; `None`: only the iterations are limited.
fn time(args: &ConvergeArgs) -> Option<f64> {
    args.time.or(args.iterations.is_none().then_some(DEFAULT_TIME))
}

/// Compares methods, as `caustique converge`. Everything that can be wrong is found before the first light path.
pub fn run(args: &ConvergeArgs) -> Result<()> {
    let runs = runs::all(args)?;
    let more = targets_of(args, &runs)?;
    files::check(&args.output)?;
    super::pool(args.threads)?.install(|| converge(args, runs, more))
}

fn converge(args: &ConvergeArgs, runs: Vec<Run>, more: Vec<(usize, u64)>) -> Result<()> {
    let threads = rayon::current_num_threads();
    let Loaded { scene, removed, .. } = scene::read(&args.scene, args.progress, threads)?;
    let inputs = files::inputs(args, &scene);
    files::check_inputs(args, &inputs)?;
    scene::print_warnings(&args.scene, &scene.warnings)?;
    let camera = scene.camera(&args.camera_request())?;
    let shared = runs.first().map_or_else(Settings::default, |run| run.entry.settings.clone());
    let learnt = Learnt::new(View::new(&scene, &camera), &shared, &Interrupt::stop());
    let scene = scene.with_learnt(&learnt.light).unwrap_or(scene);
    let view = View::new(&scene, &camera);
    let windows = windows(args, &camera)?;
    for run in &runs {
        check_settings(&run.entry.settings, &run.args.scene.path, &scene).map_err(|mut error| {
            error.place = format!("--run \"{}\"", run.entry.name);
            error
        })?;
    }
    let interrupt = Interrupt::install()?;
    let runs = choose_all(args, runs, view, learnt.spent)?;
    interrupt.check_before_first_iteration(&args.output)?;
    let denoiser = |run: &Run| (!run.args.no_finish).then_some(run.args.finish.denoise);
    memory::check_all(view, runs.iter().map(|(run, _)| (&run.entry.settings, denoiser(run))))?;
    let seeds: Vec<u64> = (0..args.seeds).map(|i| args.seed.wrapping_add(i)).collect();
    let mut notes = Vec::new();
    let source = reference::source(args, view, &runs, &seeds, &mut notes)?;
    let (entries, mut finishes) = open_finishes(args, runs, view, &removed)?;
    let renders = peers::prepare(args, view, threads, &interrupt, &mut notes)?;
    let peers = renders.as_ref().map_or_else(Vec::new, |renders| renders.peers.clone());
    std::fs::create_dir_all(&args.output).map_err(|cause| Error::io(&args.output, &cause))?;

    let reference = reference::get(args, source, view, &interrupt, &mut notes, entries.len())?;
    let rules = Rules {
        time: time(args),
        iterations: args.iterations,
        ratio: args.moments,
        extra_moments: more.clone(),
        seeds,
    };
    let mut reporter = Reporter::new(args.progress);
    let participants = Participants { entries: &entries, finishes: &mut finishes, peers: renders };
    let mut outcome = render_in_turns(view, participants, &rules, &reference, &args.output, |step| {
        reporter.step(step);
        if interrupt.requested() { Control::Stop } else { Control::Continue }
    })?;
    reporter.finish();

    let subject = Subject {
        scene: args.scene.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        size: camera.size(),
        machine: machine(threads, &entries),
        inside: shows_glass_or_mirror(view),
        settings: settings(args, &rules),
        metric: args.error_metric,
        lines: outcome.lines.clone(),
        peers,
        entries,
        rules,
        reference,
    };
    let look = Look { exposure: args.exposure as f32, ..args.tonemap.into() };
    let wishes = ReportOptions { targets: args.targets.clone(), targets_of: more, windows, look, notes };
    let summary = summarize(&subject, &mut outcome, &wishes)?;
    files::write(args, &subject, &mut outcome, &summary, &inputs, threads)?;
    if let Some(error) = outcome.failures.pop() {
        return Err(error);
    }
    if outcome.interrupted {
        let cause = "interrupted; the report on what was done is written";
        return Err(Error::new(ErrorKind::Interrupted, args.output.display(), cause));
    }
    Ok(())
}

/// Index and number of iterations of each run of `--target-of`, whose errors at these iterations are targets.
fn targets_of(args: &ConvergeArgs, runs: &[Run]) -> Result<Vec<(usize, u64)>> {
    let entries: Vec<Entry> = runs.iter().map(|run| run.entry.clone()).collect();
    let place = |target: &options::TargetOf| {
        let usage = |cause: String| Error::new(ErrorKind::Usage, "--target-of", cause);
        let names: Vec<String> = entries.iter().map(|entry| format!("\"{}\"", entry.name)).collect();
        let run = find(&entries, &target.run).ok_or_else(|| {
            usage(format!("there is no run \"{}\"", target.run)).hint(format!("there are {}", names.join(", ")))
        })?;
        match args.iterations.filter(|n| *n < target.iterations) {
            Some(n) => Err(usage(format!("{} iterations are more than the {n} of --iterations", target.iterations))
                .hint(format!("use --iterations {} or a smaller number here", target.iterations))),
            None => Ok((run, target.iterations)),
        }
    };
    args.target_of.iter().map(place).collect()
}

/// The windows of `--crop`, after a check that they lie within the picture.
fn windows(args: &ConvergeArgs, camera: &Camera) -> Result<Vec<Window>> {
    let (width, height) = camera.size();
    let windows: Vec<Window> = args.crop.iter().map(|crop| crop.0).collect();
    if let Some(w) = windows.iter().find(|w| !w.fits((width, height).into())) {
        let shown = format!("{},{},{},{}", w.x, w.y, w.width, w.height);
        let error = Error::new(ErrorKind::Usage, "--crop", format!("{shown} is not within the picture"));
        return Err(error.hint(format!("it has {width} x {height} pixels")));
    }
    Ok(windows)
}

/// Settles the light paths of all runs, and the method of the runs by `auto`, with the limits of a run. Prints the
/// choices. `learning`: time that all of them have spent before.
fn choose_all(args: &ConvergeArgs, runs: Vec<Run>, view: View<'_>, learning: TimeSpent) -> Result<Vec<(Run, Chosen)>> {
    let choose_one = |mut run: Run| {
        let settings = run.entry.settings.clone().with_light_paths(run.request.photons, view.camera.whole()[0]);
        let chosen = {
            let work = || choose(&run.request, settings, view, |_| true, &Interrupt::stop());
            Chosen { learning, ..args.progress.during("choosing a method", work) }
        };
        if let Some(choice) = &chosen.choice {
            say(&format!("run \"{}\": {}", run.entry.name, plan::reason(choice)));
        }
        run.entry.decided = chosen.spent();
        run.entry.settings = Settings { iterations: None, time: None, ..chosen.settings.clone() };
        Ok((run, chosen))
    };
    runs.into_iter().map(choose_one).collect()
}

/// Opens the finishes (denoiser and network) of the runs, and prints the warnings of their plans, each once.
fn open_finishes(
    args: &ConvergeArgs,
    runs: Vec<(Run, Chosen)>,
    view: View<'_>,
    removed: &Removed,
) -> Result<(Vec<Entry>, Vec<Option<Finish>>)> {
    let mut printed = HashSet::new();
    let mut entries = Vec::new();
    let mut finishes = Vec::new();
    for (Run { mut entry, args: options, .. }, chosen) in runs {
        let (max_depth, switches) = (args.max_depth, args.scene.switches());
        let plan = plan::plan(PlanInput { chosen: &chosen, max_depth, switches }, view, removed);
        let new: Vec<String> = plan.warnings.into_iter().filter(|warning| printed.insert(warning.clone())).collect();
        print_plan_warnings(&args.scene, &new);
        let place = format!("--run \"{}\"", entry.name);
        let levels = entry.settings.levels.count;
        let opened = (!options.no_finish).then(|| finish_options::open(&options.finish, Some(levels))).transpose();
        let opened = opened.map_err(|mut error| {
            if error.kind == ErrorKind::Usage {
                error.place = place;
            }
            error
        })?;
        entry.finish = opened.as_ref().map(OpenFinish::name);
        let missing = opened.as_ref().and_then(|finish| finish.missing.as_ref()).map(ToString::to_string);
        if let Some(missing) = missing.filter(|missing| printed.insert(missing.clone())) {
            say(&format!("warning: {missing}; pictures are finished by our own denoiser"));
        }
        entries.push(entry);
        finishes.push(opened.map(OpenFinish::into_finish));
    }
    Ok((entries, finishes))
}

/// Names and values of the options of all runs, for the report.
fn settings(args: &ConvergeArgs, rules: &Rules) -> Vec<(String, String)> {
    let mut settings = vec![("scene".to_string(), args.scene.path.display().to_string())];
    let mut put = |name: &str, value: Option<String>| settings.extend(value.map(|value| (name.to_string(), value)));
    put("camera", args.camera.clone());
    put("longest path", args.max_depth.map(|n| format!("{n} segments")));
    put("environment", args.scene.env.as_ref().map(|env| format!("{env:?}")));
    put("seconds of each run", rules.time.map(|time| time.to_string()));
    put("iterations of each run", rules.iterations.map(|n| n.to_string()));
    let seeds: Vec<String> = rules.seeds.iter().map(u64::to_string).collect();
    put("seeds", Some(seeds.join(", ")));
    put("other renderers", (!args.with.is_empty()).then(|| "budgets that double up to the seconds of each run".into()));
    put("moments", Some(format!("iterations growing by {:.3}", rules.ratio)));
    settings
}

/// Names and values of facts about the machine and the libraries, for the report.
fn machine(threads: usize, entries: &[Entry]) -> Vec<(String, String)> {
    let embree = caustique::trace::library().ok().map(|library| library.version().to_string());
    let finished = entries.iter().any(|entry| entry.finish.is_some());
    let denoiser = if finished { caustique::finish::denoiser::library().ok() } else { None };
    let known = [
        ("processor", caustique::system::processor_name()),
        ("threads", Some(threads.to_string())),
        ("system", Some(format!("{} {}", std::env::consts::OS, std::env::consts::ARCH))),
        ("caustique", Some(env!("CARGO_PKG_VERSION").into())),
        ("Embree", embree),
        ("Open Image Denoise", denoiser.map(|library| library.version().to_string())),
    ];
    known.into_iter().filter_map(|(name, value)| Some((name.to_string(), value?))).collect()
}
