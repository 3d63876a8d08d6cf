//! The cost of an iteration, and of levels and the second camera path: core-seconds per phase of interleaved variants.
//!
//! `cargo bench --bench iteration -- SCENE.glb [WIDTH] [ROUNDS]`; the last line is JSON for `scripts/lab`.

use caustique::camera::Camera;
use caustique::combine::{Combiner, LevelStack, Model, Runtime};
use caustique::estimator::InitialBandwidth;
use caustique::render::output::layer_shape;
use caustique::render::{Control, Levels, Settings, cpu_seconds, peak_memory, render};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{CameraRequest, Scene};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let path = arguments.first().map_or("scenes/interior.glb", String::as_str);
    let number = |i: usize, default: u32| arguments.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (width, rounds) = (number(1, 1280), number(2, 3));
    let description = read(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::build(description, 0).unwrap_or_else(|e| panic!("{e}"));
    let view = CameraRequest { width: Some(width), ..CameraRequest::default() };
    let camera = scene.camera(&view).unwrap_or_else(|e| panic!("{e}"));
    let variants = [
        ("five levels, two eye paths", Levels { count: 5, two_paths: true }, 20),
        ("one level, two eye paths", Levels { count: 1, two_paths: true }, 10),
        ("one level, one eye path", Levels { count: 1, two_paths: false }, 10),
    ];
    let mut phases = [[0.0f64; 3]; 3];
    let mut seconds = [0.0f64; 3];
    for round in 0..rounds {
        for (v, (_, levels, k)) in variants.iter().enumerate() {
            let settings = Settings {
                seed: u64::from(round),
                iterations: Some(2),
                levels: *levels,
                initial_bandwidth: InitialBandwidth::Nearest(*k),
                ..Settings::default()
            };
            let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
            let n = f64::from(rounds) * 2.0;
            let p = rendered.stats.phases;
            for (sum, x) in phases[v].iter_mut().zip([p.light, p.map, p.eye]) {
                *sum += x / n;
            }
            seconds[v] += p.pilot / f64::from(rounds);
        }
    }
    println!("{path}, {:?}, 100000 light paths, core-seconds per iteration ({rounds} rounds)", camera.size());
    println!("{:<30}{:>8}{:>8}{:>8}{:>8}{:>10}", "", "light", "map", "eye", "all", "pilot");
    let all = |v: usize| phases[v].iter().sum::<f64>();
    for (v, (name, ..)) in variants.iter().enumerate() {
        let [light, map, eye] = phases[v];
        println!("{name:<30}{light:>8.3}{map:>8.3}{eye:>8.3}{:>8.3}{:>10.3}", all(v), seconds[v]);
    }
    let combiner = combine(&scene, &camera);
    println!("layers and combiner, once{:>47.3}", combiner);
    println!("five levels over one, both with two eye paths: {:+.1} %", (all(0) / all(1) - 1.0) * 100.0);
    println!("five levels over one on one eye path: {:+.1} %", (all(0) / all(2) - 1.0) * 100.0);
    // Relative cost of levels and combiner in a whole render, with one pilot and one run of the combiner.
    let whole = |v: usize, iterations: f64, once: f64| seconds[v] + once + iterations * all(v);
    for iterations in [16.0, 64.0, 256.0, 1024.0] {
        let (ours, plain) = (whole(0, iterations, combiner), whole(2, iterations, 0.0));
        println!(
            "{iterations:>6} iterations: {ours:.0} core-seconds with five levels and combiner, {plain:.0} with one level and one path: {:+.1} %",
            (ours / plain - 1.0) * 100.0
        );
    }
    println!("peak memory {:.2} GiB", peak_memory() as f64 / f64::from(1 << 30));
    let [light, map, eye] = phases[0];
    println!(
        "{{\"light\": {light:.3}, \"map\": {map:.3}, \"eye\": {eye:.3}, \"all\": {:.3}, \"pilot\": {:.3}, \"one_level_two_paths\": {:.3}, \"one_level_one_path\": {:.3}, \"combiner\": {combiner:.3}, \"peak_gib\": {:.3}}}",
        all(0),
        seconds[0],
        all(1),
        all(2),
        peak_memory() as f64 / f64::from(1 << 30)
    );
}

/// Core-seconds of the combiner with all its inputs, after a render of two iterations.
fn combine(scene: &Scene, camera: &Camera) -> f64 {
    let settings = Settings { iterations: Some(2), ..Settings::default() };
    let rendered = render(scene, camera, &settings, |_, _| Control::Continue);
    let runtime = Runtime::find().unwrap_or_else(|e| panic!("{e}"));
    let model = Model::open("compact").unwrap_or_else(|e| panic!("{e}"));
    let mut combiner = Combiner::new(&model, &runtime).unwrap_or_else(|e| panic!("{e}"));
    let start = cpu_seconds();
    let set = rendered.layers(&layer_shape(&settings, scene), |_| true).unwrap_or_else(|e| panic!("{e}"));
    drop(rendered);
    let stack = LevelStack::of(&set).unwrap_or_else(|e| panic!("{e}"));
    let combined = combiner.run(&stack).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(combined.len(), set.pixels());
    cpu_seconds() - start
}
