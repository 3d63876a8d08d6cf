//! The chi-squared rule on its own: how often it rejects uniform photons, at how many of them and over how many looks, and what it costs.
//!
//! `cargo bench --bench cppm -- [SCENE.glb] [WIDTH] [ROUNDS]`; the last line is JSON for `scripts/figures`. With a scene named, only what the rule costs there.

use caustique::estimator::rule::CountingRule;
use caustique::estimator::rule::chi_squared::{ChiSquared, ChiSquaredSettings};
use caustique::math::{Frame, Vec2, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Control, Levels, Method, Settings, cpu_seconds, render};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{Scene, View};
use caustique::transport::Found;
use serde_json::{Value, json};
use statrs::distribution::{ChiSquared as Distribution, ContinuousCDF};

const TRIALS: u64 = 100_000;
/// Pixels and iterations of the look after look at uniform light.
const PIXELS: u64 = 4000;
const LOOKS: u64 = 1000;
/// Iterations of renders whose cost is measured.
const ITERATIONS: usize = 8;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let mut found = json!({});
    if arguments.is_empty() {
        found["size"] = json!(sizes());
        found["looks"] = looks();
    }
    found["cost"] = cost(&arguments);
    println!("{found}");
}

/// A photon at a uniform point of the unit disc.
fn uniform(frame: &Frame, stream: Stream) -> Found {
    let u: Vec2 = stream.vertex(0).two(Purpose::Pixel);
    let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
    let r = u.x.sqrt();
    Found::one(frame.t * (r * cos) + frame.b * (r * sin), u.x, 1.0)
}

/// Share of uniform samples that are rejected, by their number.
fn sizes() -> Vec<Value> {
    println!("uniform photons that are rejected, of {TRIALS} trials (the significance is 0.05)");
    let rule = ChiSquared::new(&ChiSquaredSettings::default());
    let frame = Frame::from_normal(Vec3::Z);
    let critical = Distribution::new(11.0).map_or(f64::NAN, |d| d.inverse_cdf(0.95));
    let bandwidth = [rule.begin(1.0, 10.0, 0)];
    let mut all = Vec::new();
    for photons in [3u64, 4, 5, 6, 8, 10, 12, 15, 20, 30, 60, 120, 1000] {
        let trials = if photons > 120 { TRIALS / 5 } else { TRIALS };
        let mut rejected = 0u64;
        for trial in 0..trials {
            let mut counts = [0u32; 12];
            for i in 0..photons {
                let found = uniform(&frame, Stream::new(11, trial, Domain::Test, i));
                rule.count(&bandwidth, &mut counts, &frame, &found);
            }
            rejected += u64::from(ChiSquared::statistic(&counts) > critical);
        }
        let size = rejected as f64 / trials as f64;
        let error = (size * (1.0 - size) / trials as f64).sqrt();
        println!("{photons:>6} photons: {size:.4} +- {error:.4}");
        all.push(json!([photons, size, error]));
    }
    all
}

/// What look after look does to pixels under uniform light, ten photons in each to begin with.
fn looks() -> Value {
    println!("{PIXELS} uniform pixels of 10 photons, looked at after every iteration");
    let rule = ChiSquared::new(&ChiSquaredSettings::default());
    let frame = Frame::from_normal(Vec3::Z);
    let mut first_rejection = Vec::new();
    let mut areas = Vec::new();
    for pixel in 0..PIXELS {
        let mut bandwidth = [rule.begin(1.0, 10.0, 0)];
        let mut counts = [0u32; 12];
        let mut rejected = None;
        for i in 1..=LOOKS {
            let mut counted = 0;
            // Ten photons an iteration in the first disc; those in the bandwidth are counted.
            for k in 0..10 {
                let found = uniform(&frame, Stream::new(12, i * 16 + k, Domain::Test, pixel));
                counted |= rule.count(&bandwidth, &mut counts, &frame, &found);
            }
            rule.update(i, &mut bandwidth, &mut counts, counted);
            if rejected.is_none() && bandwidth[0].radius2 < 1.0 {
                rejected = Some(i);
            }
        }
        first_rejection.push(rejected.unwrap_or(u64::MAX));
        areas.push(f64::from(bandwidth[0].radius2));
    }
    let share = |n: u64| first_rejection.iter().filter(|i| **i <= n).count() as f64 / PIXELS as f64;
    let mut all = Vec::new();
    for n in [1, 10, 100, LOOKS] {
        println!("{n:>6} iterations: rejected at least once {:.3}", share(n));
        all.push(json!([n, share(n)]));
    }
    let mean = areas.iter().sum::<f64>() / PIXELS as f64;
    areas.sort_by(f64::total_cmp);
    let at = |q: f64| areas[(q * (PIXELS - 1) as f64) as usize];
    println!("area left after {LOOKS}: mean {mean:.3}, deciles {:.3} {:.3} {:.3}", at(0.1), at(0.5), at(0.9));
    json!({"rejected": all, "area_mean": mean, "area_deciles": [at(0.1), at(0.5), at(0.9)]})
}

/// Core-seconds of an iteration with bandwidths that stay, with the rule and without; and with the rule's own.
fn cost(arguments: &[String]) -> Value {
    let path = arguments.first().map_or("scenes/interior.glb", String::as_str);
    let number = |i: usize, default: u32| arguments.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (width, rounds) = (number(1, 640), number(2, 12));
    let description = read(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::build(description, 0).unwrap_or_else(|e| panic!("{e}"));
    let view = View { camera: None, width: Some(width), height: None };
    let camera = scene.camera(&view).unwrap_or_else(|e| panic!("{e}"));
    let mut rows = Vec::new();
    for levels in [1, 5] {
        let never = ChiSquaredSettings { significance: 1e-300, ..ChiSquaredSettings::default() };
        let base = Settings { levels: Levels::new(levels), iterations: Some(ITERATIONS as u64), ..Settings::default() };
        let variants = [
            ("sppm, bandwidths stay", Settings { alpha: 1.0, ..base.clone() }),
            ("cppm, bandwidths stay", Settings { method: Method::Cppm, chi_squared: never, ..base.clone() }),
            ("sppm", base.clone()),
            ("cppm", Settings { method: Method::Cppm, ..base }),
        ];
        // Of every iteration the least of all rounds, the variants one after the other: what a noisy machine adds is not theirs.
        let mut least = [[f64::INFINITY; ITERATIONS]; 4];
        // With the rule over without it, iterations of renders that followed one another, in either order.
        let mut ratios = Vec::new();
        for round in 0..rounds {
            let mut taken = [[f64::NAN; ITERATIONS]; 4];
            for at in 0..variants.len() {
                // Pairs change places from round to round.
                let variant = at ^ (round & 1) as usize;
                let mut last = None;
                render(&scene, &camera, &variants[variant].1, |progress, _| {
                    let now = cpu_seconds();
                    if let Some(last) = last.replace(now) {
                        taken[variant][progress.iteration as usize - 1] = now - last;
                    }
                    Control::Continue
                });
            }
            // The first iteration has the pilot and whatever is made once.
            ratios.extend((1..ITERATIONS).map(|i| taken[1][i] / taken[0][i]));
            for (least, taken) in least.as_flattened_mut().iter_mut().zip(taken.as_flattened()) {
                *least = least.min(*taken);
            }
        }
        let best = least.map(|least| least[1..].iter().sum::<f64>() / (ITERATIONS - 1) as f64);
        println!("{path}, {:?}, {levels} level(s), core-seconds per iteration (least of {rounds})", camera.size());
        for (seconds, (name, _)) in best.iter().zip(&variants) {
            println!("{name:<24}{seconds:>8.3}");
        }
        ratios.sort_by(f64::total_cmp);
        let [low, rule, high] =
            [0.25, 0.5, 0.75].map(|q| (ratios[(q * (ratios.len() - 1) as f64).round() as usize] - 1.0) * 100.0);
        println!(
            "the rule: {rule:+.1} % (median of {} pairs; quartiles {low:+.1} and {high:+.1}; by the least {:+.1})",
            ratios.len(),
            (best[1] / best[0] - 1.0) * 100.0
        );
        let state = levels * (12 * 4 + 8);
        let pixel = size_of::<caustique::estimator::Pixel>();
        let share = state as f64 / pixel as f64 * 100.0;
        println!("memory: {state} bytes a pixel and kind of photons on top of {pixel}, {share:+.1} %");
        rows.push(json!({"levels": levels, "seconds": best, "rule_percent": rule, "state_bytes": state, "pixel_bytes": pixel}));
    }
    json!(rows)
}
