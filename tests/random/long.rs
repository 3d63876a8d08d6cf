//! Checks random scenes of new seeds for hours. Failing scenes are saved and reduced. A run continues from the last
//! one.

#![allow(clippy::disallowed_methods, reason = "hours are what clocks are for")]

#[path = "../support/mod.rs"]
mod support;

mod forms;
mod generate;
mod picture;
mod plan;
mod random;
mod relation;
mod shapes;
mod shrink;
mod usd;
mod world;
mod write;

use caustique::render::Method;
use clap::Parser;
use forms::FORMS;
use generate::generate;
use picture::Shot;
use relation::{Broken, Relation, check};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fs, io};
use world::World;

/// Renders random scenes and checks them, seed after seed.
#[derive(Parser)]
struct Options {
    /// Hours to run.
    #[arg(long, default_value_t = 4.0)]
    hours: f64,
    /// The first seed, if the folder has no state.
    #[arg(long, default_value_t = 2000)]
    seed: u64,
    /// Folder of the state and of failing scenes.
    #[arg(long, default_value = "out/random")]
    output: PathBuf,
    /// Checks of each scene with the four most used methods.
    #[arg(long, default_value_t = 4)]
    checks: usize,
    /// Checks a saved scene again (`scene.json` of a failure), and nothing else.
    #[arg(long)]
    replay: Option<PathBuf>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// State that a run saves for the next one.
#[derive(Default, Serialize, Deserialize)]
struct State {
    next_seed: u64,
    scenes: u64,
    checks: u64,
    failures: Vec<String>,
    seconds: f64,
}

/// A failing scene and its failure.
#[derive(Serialize, Deserialize)]
struct Failure {
    broken: Broken,
    world: World,
}

fn main() -> io::Result<()> {
    let options = Options::parse();
    if let Some(path) = &options.replay {
        return replay(path);
    }
    fs::create_dir_all(&options.output)?;
    let path = options.output.join("state.json");
    let mut state = match fs::read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes)?,
        Err(_) => State { next_seed: options.seed, ..State::default() },
    };
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs_f64(3600.0 * options.hours) {
        let before = Instant::now();
        scene(&options, &mut state)?;
        state.seconds += before.elapsed().as_secs_f64();
        state.next_seed += 1;
        state.scenes += 1;
        // Written and renamed, so that a killed run leaves the state of the last complete scene.
        let part = path.with_extension("part");
        fs::write(&part, serde_json::to_vec_pretty(&state)?)?;
        fs::rename(&part, &path)?;
    }
    println!("{} scenes, {} checks, {} failures", state.scenes, state.checks, state.failures.len());
    Ok(())
}

/// Checks the scene of the next seed.
fn scene(options: &Options, state: &mut State) -> io::Result<()> {
    let seed = state.next_seed;
    let world = generate(seed);
    for (relation, shot) in plan::checks(&world, options.checks) {
        state.checks += 1;
        if let Some(broken) = check(&world, relation, &shot) {
            println!("seed {seed}: {broken}");
            state.failures.push(save(&options.output, &world, broken)?.display().to_string());
        }
    }
    let reduced = usd::reduced(&world);
    let cameras = reduced.cameras();
    let shot = Shot::new(Method::Path, cameras[seed as usize % cameras.len()]);
    state.checks += 1;
    if let Some(broken) = check(&reduced, Relation::Usd, &shot) {
        println!("seed {seed}: {broken}");
        state.failures.push(save(&options.output, &reduced, broken)?.display().to_string());
    }
    let form = FORMS[seed as usize % FORMS.len()];
    let known = form.known(seed);
    for method in form.methods() {
        state.checks += 1;
        let found = match forms::check(form, &known, method) {
            Ok(None) => continue,
            Ok(Some(differences)) => differences.iter().take(4).map(|d| format!("\n    {d}")).collect(),
            Err(error) => error,
        };
        let text = format!("{form:?}, seed {seed}, {}: {found}", method.name());
        println!("{text}");
        let folder = options.output.join(format!("{seed}-{form:?}-{}", method.name()));
        fs::create_dir_all(&folder)?;
        fs::write(folder.join("scene.glb"), write::glb(&known.world))?;
        fs::write(folder.join("figures.txt"), format!("{text}\nexpected: {:?}\n", known.expected))?;
        state.failures.push(folder.display().to_string());
    }
    Ok(())
}

/// Saves a failing scene, and the smallest one that still fails.
fn save(output: &Path, world: &World, broken: Broken) -> io::Result<PathBuf> {
    let name = format!("{}-{:?}-{}", world.seed, broken.relation, broken.method.name());
    let folder = output.join(name.replace(['(', ')'], "-"));
    fs::create_dir_all(&folder)?;
    let shot = Shot::new(broken.method, &broken.camera);
    write_failure(&folder, "scene", world, &broken)?;
    let fails = |world: &World| {
        world.cameras().contains(&broken.camera.as_str()) && check(world, broken.relation, &shot).is_some()
    };
    let smallest = shrink::shrink(world.clone(), fails);
    if let Some(broken) = check(&smallest, broken.relation, &shot) {
        println!("    smallest: {} things, {broken}", smallest.things.len());
        write_failure(&folder, "smallest", &smallest, &broken)?;
    }
    Ok(folder)
}

fn write_failure(folder: &Path, name: &str, world: &World, broken: &Broken) -> io::Result<()> {
    let failure = Failure { broken: broken.clone(), world: world.clone() };
    fs::write(folder.join(format!("{name}.json")), serde_json::to_vec(&failure)?)?;
    fs::write(folder.join(format!("{name}.glb")), write::glb(world))?;
    fs::write(folder.join(format!("{name}.txt")), format!("{broken}\n"))?;
    let shot = Shot::new(broken.method, &broken.camera);
    let other = broken.relation.other(world, &shot).map_or_else(Vec::new, |other| other.worlds);
    for (index, other) in other.iter().enumerate() {
        fs::write(folder.join(format!("{name}-other-{index}.glb")), write::glb(other))?;
    }
    Ok(())
}

fn replay(path: &Path) -> io::Result<()> {
    let Failure { broken, world } = serde_json::from_slice(&fs::read(path)?)?;
    let shot = Shot::new(broken.method, &broken.camera);
    match check(&world, broken.relation, &shot) {
        Some(broken) => println!("it fails: {broken}"),
        None => println!("it holds: {:?} by {}", broken.relation, broken.method.name()),
    }
    Ok(())
}
