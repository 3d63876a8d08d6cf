//! Variances of renders with other numbers of samples, as predicted from one proxy render, against the renders.
//!
//! Predictions neglect some correlations, `BIAS` bounds their effect. Without merging the predictions are upper bounds
//! only: in some rooms the measured variance is a fifth of the prediction; why has not been examined. The family-wise
//! error rate is 0.1 % (t tests over seeds, Sidak over rooms and numbers of samples).

use crate::support;

use caustique::choose::choose;
use caustique::math::{DVec3, Vec3};
use caustique::path_class::{ClassSet, Effect};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Candidate, Control, Counts, Levels, Proxy, Settings, render};
use caustique::scene::{Description, Scene, View};
use caustique::stop::Stop;
use std::ops::Range;
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, quad, sphere, square};
use support::stats::{Check, ERROR_RATE, mean_and_error, t_critical};

const SIZE: u32 = 16;
const ITERATIONS: u64 = 24;
const SEEDS: u64 = 12;
/// Largest relative difference between variances and predictions.
const BIAS: f64 = 0.2;
/// Relative difference that must be rejected.
const PLANTED: f64 = 0.5;
/// Numbers of light paths per pixel in sixteenths, of connections, and probabilities of merging.
const COUNTS: [(u32, u32, f32); 9] = [
    (0, 0, 0.0),
    (1, 0, 1.0),
    (1, 1, 0.0),
    (4, 0, 0.0),
    (16, 0, 1.0),
    (16, 1, 1.0),
    (16, 2, 0.0),
    (16, 1, 0.25),
    (64, 4, 1.0),
];

/// A room with a lamp and three balls of random materials.
fn random_room(room: u64) -> Scene {
    let stream = Stream::new(room, 0, Domain::Light, 0);
    let mut drawn = 0;
    let mut random = |low: f32, high: f32| {
        drawn += 1;
        low + (high - low) * stream.vertex(drawn).one(Purpose::LightChoice)
    };
    let mut description = Description::default();
    let walls = matte(random(0.3, 0.7), 0.0);
    add(&mut description, "room", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true), walls);
    let side = random(0.15, 0.5);
    let corner = Vec3::new(random(-0.9, 0.4), 1.98, random(-0.9, 0.4));
    add(&mut description, "lamp", quad(corner, Vec3::X * side, Vec3::Z * side), matte(0.0, 3.0 / (side * side)));
    for (name, x) in [("left", -0.6), ("middle", 0.0), ("right", 0.6)] {
        let material = match random(0.0, 3.0) {
            kind if kind < 1.0 => glass(1.5),
            kind if kind < 2.0 => mirror(),
            _ => matte(random(0.2, 0.8), 0.0),
        };
        let radius = random(0.15, 0.3);
        add(&mut description, name, sphere(Vec3::new(x, radius + 0.01, random(-0.5, 0.8)), radius, 48), material);
    }
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.6, 0.0), 50.0));
    build(description)
}

fn all_counts() -> Vec<Counts> {
    COUNTS.map(|(light_paths, connections, merging)| Counts { light_paths, connections, merging }).to_vec()
}

/// Settings for indirect light with a constant bandwidth.
fn settings(counts: Counts, seed: u64) -> Settings {
    let direct = ClassSet::of(Effect::Direct).and(ClassSet::of(Effect::Emission)).and(ClassSet::of(Effect::Glossy));
    Settings {
        seed,
        levels: Levels::new(1),
        alpha: 1.0,
        max_depth: 6,
        classes: direct.complement(),
        iterations: Some(ITERATIONS),
        ..Settings::for_candidate(Candidate::with_counts(counts, false))
    }
}

/// Mean over pixels of the variance of an iteration.
fn measured(scene: &Scene, counts: Counts, seed: u64) -> f64 {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let rendered = render(scene, &camera, &settings(counts, seed), |_, _| Control::Continue);
    let variances =
        rendered.pixels.iter().map(|pixel| pixel.variance_of_mean(0).element_sum() / 3.0 * ITERATIONS as f64);
    variances.sum::<f64>() / f64::from(SIZE * SIZE)
}

/// The predictions of a proxy render.
fn predicted(scene: &Scene, candidates: &[Counts], seed: u64) -> Vec<f64> {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let settings = settings(Counts::DEFAULT, seed);
    let proxy =
        Proxy { scene, camera: &camera, settings: &settings, render_width: 8 * SIZE, typical_iteration: 1, candidates };
    proxy.measure(None, 4 * ITERATIONS, &|| false).indirect_variances()
}

#[test]
fn variances_are_predicted_from_one_proxy_render() {
    check_predictions(0..1);
}

#[test]
#[ignore = "long"]
fn variances_are_predicted_in_other_rooms() {
    check_predictions(1..3);
}

/// Predictions agree with renders within `BIAS`, and predictions that are off by `PLANTED` are rejected.
fn check_predictions(rooms: Range<u64>) {
    let candidates = all_counts();
    let mut found = Vec::new();
    for room in rooms {
        let scene = random_room(room);
        let predictions: Vec<Vec<f64>> = (0..SEEDS).map(|seed| predicted(&scene, &candidates, 1000 + seed)).collect();
        for (k, counts) in candidates.iter().enumerate() {
            let mean = predictions.iter().map(|all| all[k]).sum::<f64>() / SEEDS as f64;
            let ratios: Vec<f64> = (0..SEEDS).map(|seed| measured(&scene, *counts, seed) / mean).collect();
            found.push((*counts, format!("room {room}, {counts:?}"), ratios));
        }
    }
    let critical = t_critical(ERROR_RATE, found.len(), SEEDS as f64 - 1.0);
    for (counts, what, ratios) in &found {
        if counts.merging > 0.0 {
            let check = Check { expected: 1.0 + 0.5 * BIAS, bias: 0.5 * BIAS, detects: PLANTED };
            check.run(found.len(), what, ratios);
        } else {
            let (mean, error) = mean_and_error(ratios);
            println!("{what}: {mean:.3} +- {error:.3}");
            assert!(mean - critical * error < 1.0 + BIAS, "{what}: {mean} +- {error}");
        }
    }
}

/// A proxy that is late, such as after a tenth of `--time`, keeps the two iterations that a variance needs at least.
#[test]
fn a_late_proxy_keeps_two_iterations() {
    let scene = random_room(0);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let settings = settings(Counts::DEFAULT, 1);
    let candidates = all_counts();
    let proxy = Proxy {
        scene: &scene,
        camera: &camera,
        settings: &settings,
        render_width: SIZE,
        typical_iteration: 1,
        candidates: &candidates,
    };
    let variances = |iterations, late: &dyn Fn() -> bool| proxy.measure(None, iterations, late).relative();
    assert_eq!(variances(50, &|| true), variances(2, &|| false));
    assert_ne!(variances(3, &|| false), variances(2, &|| false));
}

/// A matte room that a panel on the wall lights, with two boxes.
fn matte_room() -> Scene {
    let mut description = Description::default();
    let corners = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0)];
    add(&mut description, "room", cuboid(corners[0], corners[1], true), matte(0.7, 0.0));
    let panel = quad(Vec3::new(-0.6, 0.8, -0.98), Vec3::X * 1.2, Vec3::Y * 0.8);
    add(&mut description, "panel", panel, matte(0.0, 3.0));
    for (name, x) in [("left", -0.6), ("right", 0.3)] {
        let low = Vec3::new(x, 0.0, 0.1);
        add(&mut description, name, cuboid(low, low + Vec3::new(0.35, 0.6, 0.35), false), matte(0.5, 0.0));
    }
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.6, 0.0), 50.0));
    build(description)
}

/// Relative variance of an iteration, between renders with different seeds.
fn relative_variance(scene: &Scene, candidate: Candidate, size: u32) -> f64 {
    let camera = scene.camera(&square(size)).expect("a camera");
    let picture = |seed| -> Vec<f64> {
        let settings = Settings { seed, iterations: Some(64), ..Settings::for_candidate(candidate) };
        let level = settings.levels.picture_level();
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        rendered.pixels.iter().map(|pixel| pixel.mean(level).element_sum() / 3.0).collect()
    };
    let pictures: Vec<Vec<f64>> = (100..100 + SEEDS).map(picture).collect();
    let n = SEEDS as f64;
    let of_pixel = |index: usize| {
        let mean = pictures.iter().map(|picture| picture[index]).sum::<f64>() / n;
        let squares = pictures.iter().map(|picture| (picture[index] - mean).powi(2)).sum::<f64>();
        64.0 * squares / (n - 1.0) / (mean * mean)
    };
    let mut all: Vec<f64> = (0..pictures[0].len()).map(of_pixel).collect();
    all.sort_by(f64::total_cmp);
    all.truncate(all.len() - all.len() / 100);
    all.iter().sum::<f64>() / all.len() as f64
}

/// The errors that `auto` compares are those of renders, with the stratification over their iterations. A ratio that is
/// off by `PLANTED` is rejected.
#[test]
fn trials_measure_the_noise_of_renders() {
    const SIZE: u32 = 24;
    let scene = matte_room();
    let counts = [Counts::PATHS, Counts { merging: 0.0, ..Counts::DEFAULT }, Counts::DEFAULT];
    let [paths, connections, _] = counts.map(|counts| Candidate::with_counts(counts, false));
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let settings = |candidate: Candidate| {
        let settings = Settings { iterations: Some(20_000), ..Settings::for_candidate(candidate) };
        counts.contains(&candidate.counts).then_some(settings)
    };
    let choice = choose(View::new(&scene, &camera), settings, &Stop::default()).expect("a choice");
    let variance = |candidate| {
        let pilot = choice.pilots.iter().find(|pilot| pilot.candidate == candidate).expect("a pilot");
        pilot.squared_error / pilot.seconds_per_iteration
    };
    let compared = variance(paths) / variance(connections);
    let measured = relative_variance(&scene, paths, SIZE) / relative_variance(&scene, connections, SIZE);
    println!("compared {compared:.3}, measured {measured:.3}");
    // 3 degrees of freedom in each of 576 pixels: a standard error of about 7 %.
    let agrees = |ratio: f64| (ratio / measured).ln().abs() < 0.25;
    assert!(agrees(compared), "{compared} instead of {measured}");
    assert!(!agrees(compared * (1.0 + PLANTED)) && !agrees(compared / (1.0 + PLANTED)), "{compared} and {measured}");
}
