//! The chi-squared rule in isolation: how often it rejects uniform photons, by the number of photons and of tests, and
//! its cost.
//!
//! `cargo bench --bench cppm -- [SCENE.glb...] [width=W] [iterations=N]`. The last line is JSON for `scripts/lab`. If
//! scenes are given, only the cost of the rule in these scenes is measured.

use caustique::camera::Camera;
use caustique::estimator::rule::CountingRule;
use caustique::estimator::rule::chi_squared::{ChiSquared, ChiSquaredSettings, Tally};
use caustique::math::{Frame, Vec2, Vec3};
use caustique::photon::ThinningKey;
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Levels, Method, RenderInput, Session, Settings};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{CameraRequest, Scene};
use caustique::transport::FoundPhotons;
use serde_json::{Value, json};
use statrs::distribution::{ChiSquared as Distribution, ContinuousCDF};

const TRIALS: u64 = 100_000;
/// Scenes in which the cost is measured.
const SCENES: [&str; 6] = [
    "scenes/interior.glb",
    "scenes/blocks.glb",
    "scenes/cornell.glb",
    "scenes/gems.glb",
    "scenes/pool.glb",
    "scenes/torus.glb",
];
/// Number of pixels, and of iterations, for repeated tests of uniform light.
const PIXELS: u64 = 4000;
const LOOKS: u64 = 1000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let mut found = json!({});
    let mut scenes: Vec<&str> = arguments.iter().map(String::as_str).filter(|a| !a.contains('=')).collect();
    if scenes.is_empty() {
        found["size"] = json!(sizes());
        found["looks"] = looks();
        scenes = SCENES.into();
    }
    let number = |name: &str| arguments.iter().find_map(|a| a.strip_prefix(name)?.parse().ok());
    let (width, iterations) = (number("width=").unwrap_or(640), number("iterations=").unwrap_or(40));
    found["cost"] = scenes.into_iter().flat_map(|path| cost(path, width, iterations as usize)).collect();
    println!("{found}");
}

/// A photon at a uniform point of the unit disc.
fn uniform(frame: &Frame, stream: Stream) -> FoundPhotons {
    let u: Vec2 = stream.vertex(0).two(Purpose::Pixel);
    let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
    let r = u.x.sqrt();
    FoundPhotons::one(frame.t * (r * cos) + frame.b * (r * sin), u.x, 1.0, ThinningKey::default())
}

/// Share of uniform samples that are rejected, by their number.
fn sizes() -> Vec<Value> {
    println!("uniform photons that are rejected, of {TRIALS} trials (the significance is 0.05)");
    // A rule whose disc never shrinks.
    let rule = ChiSquared::new(&ChiSquaredSettings { significance: 1e-300, ..ChiSquaredSettings::default() });
    let frame = Frame::from_normal(Vec3::Z);
    let critical = Distribution::new(11.0).map_or(f64::NAN, |d| d.inverse_cdf(0.95));
    let mut bandwidth = [rule.initial(1.0, 10.0, 0)];
    let mut all = Vec::new();
    for photons in [3u64, 4, 5, 6, 8, 10, 12, 15, 20, 30, 60, 120, 1000] {
        let trials = if photons > 120 { TRIALS / 5 } else { TRIALS };
        let mut rejected = 0u64;
        for trial in 0..trials {
            let (mut counts, mut tally) = ([0u32; 12], Tally::default());
            for i in 0..photons {
                let found = uniform(&frame, Stream::new(11, trial, Domain::Test, i));
                rule.count(&bandwidth, &mut counts, &mut tally, &frame, &found);
            }
            rule.update(1, &mut bandwidth, &mut counts, &mut tally);
            rejected += u64::from(ChiSquared::statistic(&counts) > critical);
        }
        let size = rejected as f64 / trials as f64;
        let error = (size * (1.0 - size) / trials as f64).sqrt();
        println!("{photons:>6} photons: {size:.4} +- {error:.4}");
        all.push(json!([photons, size, error]));
    }
    all
}

/// The effect of repeated tests on pixels under uniform light, with ten photons each at the start.
fn looks() -> Value {
    println!("{PIXELS} uniform pixels of 10 photons, looked at after every iteration");
    let rule = ChiSquared::new(&ChiSquaredSettings::default());
    let frame = Frame::from_normal(Vec3::Z);
    let mut first_rejection = Vec::new();
    let mut areas = Vec::new();
    for pixel in 0..PIXELS {
        let mut bandwidth = [rule.initial(1.0, 10.0, 0)];
        let mut counts = [0u32; 12];
        let mut rejected = None;
        for i in 1..=LOOKS {
            let mut tally = Tally::default();
            // Ten photons per iteration in the initial disc, of which those within the bandwidth are counted.
            for k in 0..10 {
                let found = uniform(&frame, Stream::new(12, i * 16 + k, Domain::Test, pixel));
                rule.count(&bandwidth, &mut counts, &mut tally, &frame, &found);
            }
            rule.update(i, &mut bandwidth, &mut counts, &mut tally);
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

/// Core-seconds of an iteration with fixed bandwidths, with and without the rule, and with the bandwidths of the rule.
fn cost(path: &str, width: u32, iterations: usize) -> Vec<Value> {
    let description = read(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::build(description, 0).unwrap_or_else(|e| panic!("{e}"));
    let view = CameraRequest { width: Some(width), ..CameraRequest::default() };
    let camera = scene.camera(&view).unwrap_or_else(|e| panic!("{e}"));
    let mut rows = Vec::new();
    for levels in [1, 5] {
        let never = ChiSquaredSettings { significance: 1e-300, ..ChiSquaredSettings::default() };
        let base = Settings { levels: Levels::new(levels), ..Settings::default() };
        let stay = Settings { alpha: 1.0, ..base.clone() };
        let rule = Settings { method: Method::Cppm, chi_squared: never, ..base.clone() };
        let kept = Steps::of(&scene, &camera, [&stay, &rule], iterations);
        // Fewer iterations, because only a median is needed.
        let few = iterations.div_ceil(4);
        let own = Steps::of(&scene, &camera, [&base, &Settings { method: Method::Cppm, ..base.clone() }], few);
        println!(
            "{path}, {:?}, {levels} level(s), core-seconds per iteration (medians of {iterations}, of {few} with bandwidths of their own)",
            camera.size()
        );
        let seconds = [kept.seconds(0), kept.seconds(1), own.seconds(0), own.seconds(1)];
        for (seconds, name) in seconds.iter().zip(["sppm, bandwidths stay", "cppm, bandwidths stay", "sppm", "cppm"]) {
            println!("{name:<24}{seconds:>8.3}");
        }
        let [rule, low, high] = kept.difference_percent();
        println!(
            "the rule: {rule:+.1} % (median of the differences of {iterations} pairs; 95 % interval {low:+.1} to {high:+.1})"
        );
        let state = levels * (12 * 4 + 8);
        let pixel = size_of::<caustique::estimator::PixelAccumulator>();
        let share = state as f64 / pixel as f64 * 100.0;
        println!("memory: {state} bytes a pixel and kind of photons on top of {pixel}, {share:+.1} %");
        rows.push(json!({"scene": path, "levels": levels, "seconds": seconds, "rule_percent": rule, "rule_percent_95": [low, high], "state_bytes": state, "pixel_bytes": pixel}));
    }
    rows
}

/// Core-seconds of every iteration of two alternating renders with the same photons and camera paths.
struct Steps {
    /// Whole iterations.
    all: [Vec<f64>; 2],
    /// Their camera passes.
    eye: [Vec<f64>; 2],
}

impl Steps {
    /// Measures both renders. In each iteration the order alternates.
    fn of(scene: &Scene, camera: &Camera, settings: [&Settings; 2], iterations: usize) -> Steps {
        let stages = settings.map(|settings| RenderInput::new(scene, camera, settings));
        let mut sessions = stages.each_ref().map(Session::new);
        let mut steps = Steps { all: [vec![], vec![]], eye: [vec![], vec![]] };
        // The first iteration includes one-time work.
        for i in 0..=iterations {
            for turn in 0..2 {
                let which = (i + turn) % 2;
                let session = &mut sessions[which];
                let (spent, phases) = (session.spent(), session.phases());
                session.step();
                if i > 0 {
                    steps.all[which].push(session.spent().cpu_seconds - spent.cpu_seconds);
                    steps.eye[which].push(session.phases().eye - phases.eye);
                }
            }
        }
        steps
    }

    /// Median core-seconds of an iteration.
    fn seconds(&self, which: usize) -> f64 {
        sorted(self.all[which].iter().copied())[self.all[which].len() / 2]
    }

    /// The cost that the second render adds to an iteration of the first (percent), with a 95 % interval by order
    /// statistics: the median of the paired differences of the camera passes, because the remaining work is equal.
    fn difference_percent(&self) -> [f64; 3] {
        let differences = sorted(self.eye[0].iter().zip(&self.eye[1]).map(|(first, second)| second - first));
        let middle = differences.len() as f64 / 2.0;
        let away = 0.98 * (differences.len() as f64).sqrt();
        [middle, middle - away, middle + away]
            .map(|at| differences[(at as usize).min(differences.len() - 1)] / self.seconds(0) * 100.0)
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}
