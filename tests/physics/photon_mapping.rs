//! Compares classical photon mapping with closed forms.
//!
//! Every check is a t test over independent seeds (each with its own map) at a family-wise error rate of 0.1 % for the
//! file, plus a stated bias: k nearest neighbours of low-discrepancy photons give up to 1 / 2k too little. Each check
//! must reject a slightly larger shift, which is smaller than the effect of a wrong number of light paths or of direct
//! light counted twice.

use crate::support;

use caustique::material::{Alpha, Material};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{
    Control, InitialBandwidth, Levels, Method, PHOTON_BYTES, Rendered, Settings, Shard, photons_per_path, render,
};
use caustique::scene::description::{PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use support::scenes::{add, build, cuboid, glass, look_at, matte, quad, square};
use support::stats::{mean_and_error, t_critical};

const TESTS: usize = 12;
const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 32;
const SIZE: u32 = 8;

fn settings(photons: u32, seed: u64) -> Settings {
    Settings {
        method: Method::Pm,
        seed,
        photons,
        initial_bandwidth: InitialBandwidth::Nearest(100),
        levels: Levels::new(1),
        iterations: Some(4),
        ..Settings::default()
    }
}

fn picture(scene: &Scene, settings: &Settings) -> Rendered {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let rendered = render(scene, &camera, settings, |_, _| Control::Continue);
    assert_eq!(rendered.rejected(), 0);
    rendered
}

fn mean(rendered: &Rendered) -> f64 {
    rendered.pixels.iter().map(|p| p.mean(0).x).sum::<f64>() / rendered.pixels.len() as f64
}

/// Checks the mean over seeds against `expected`. A relative shift by `detects` must be rejected.
fn check(what: &str, values: &[f64], expected: f64, bias: f64, detects: f64) {
    let (mean, error) = mean_and_error(values);
    println!("{what}: {mean:.6} +- {error:.6}, expected {expected:.6}");
    let critical = t_critical(ERROR_RATE, TESTS, values.len() as f64 - 1.0);
    let passes = |expected: f64| (mean - expected).abs() <= critical * error + bias * expected;
    assert!(passes(expected), "{what}: {mean} +- {error}, expected {expected}");
    for planted in [expected * (1.0 - detects), expected * (1.0 + detects)] {
        assert!(!passes(planted), "{what}: an error of {planted} is not detected ({mean} +- {error})");
    }
}

/// In a closed box whose walls emit e and reflect rho, radiance is e / (1 - rho) everywhere and in every direction. The
/// picture excludes the edges.
fn furnace(degrees: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.5, 0.5));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), degrees));
    build(description)
}

#[test]
fn furnace_box() {
    let scene = furnace(40.0);
    let values: Vec<f64> = (0..SEEDS).map(|seed| mean(&picture(&scene, &settings(200_000, seed)))).collect();
    check("furnace", &values, 1.0, 5e-3, 0.025);
}

/// A view of a tenth of a degree, which is narrower than the distance between photons, has all its light. Without
/// photons a quarter would be missing.
#[test]
fn a_magnified_view_has_its_photons() {
    let scene = furnace(0.1);
    for method in [Method::Sppm, Method::Appm, Method::Cppm] {
        let of = |seed| Settings { method, seed, photons: 1000, iterations: Some(16), ..Settings::default() };
        let own = of(0).levels.picture_level();
        let mean = |seed: u64| {
            let rendered = picture(&scene, &of(seed));
            rendered.pixels.iter().map(|pixel| pixel.mean(own).x).sum::<f64>() / rendered.pixels.len() as f64
        };
        let values: Vec<f64> = (0..SEEDS).map(mean).collect();
        check(method.name(), &values, 1.0, 5e-3, 0.2);
    }
}

/// In a closed box that reflects nine tenths, a light path ends at every tenth surface on average: it stores nine
/// photons, and none at the first surface. The forecast from a sample of light paths agrees (four standard errors of
/// 2048 geometric numbers, 6e-5), and so does a render.
#[test]
fn photons_are_forecast() {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.9, 0.5));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    for method in [Method::Sppm, Method::Pm] {
        let settings = Settings { method, iterations: Some(1), ..settings(20_000, 3) };
        let forecast = photons_per_path(&scene, &camera, &settings);
        assert!((forecast - 9.0).abs() < 4.0 * 9.5 / 2048f64.sqrt(), "{forecast}");
        let rendered = picture(&scene, &settings);
        let left = rendered.stats.photons as f64 / rendered.stats.light_paths as f64;
        assert!((left - 9.0).abs() < 4.0 * 9.5 / 20_000f64.sqrt(), "{left}");
    }
}

/// If memory limits the number of photons, flux is divided by the number of traced light paths.
#[test]
fn a_full_map_is_not_darker() {
    let scene = furnace(40.0);
    let most = 30_000;
    let mut values = vec![];
    for seed in 0..SEEDS {
        let all = Settings { photon_memory: most * PHOTON_BYTES, ..settings(200_000, seed) };
        let rendered = picture(&scene, &all);
        assert!(
            rendered.map_is_full() && rendered.stats.light_paths < 100_000,
            "{} light paths",
            rendered.stats.light_paths
        );
        // The path that did not fit had a few photons.
        assert!((most - 100..=most).contains(&rendered.stats.photons), "{} photons", rendered.stats.photons);
        values.push(mean(&rendered));
    }
    check("full", &values, 1.0, 5e-3, 0.03);
}

/// The sun shines straight down through a glass slab on to a plane: a uniform caustic. Returns the scene, and the mean of
/// its picture.
fn sun_through_slab(alpha: f32) -> (Scene, f64) {
    let (rho, e, n) = (0.5f32, 3.0f32, 1.5f64);
    let mut description = Description::default();
    let floor = quad(Vec3::new(-0.5, 0.0, -0.5), Vec3::Z, Vec3::X);
    let kind = if alpha < 1.0 { Alpha::Blend } else { Alpha::Opaque };
    add(
        &mut description,
        "plane",
        floor,
        Material { alpha: kind, base_color: [rho, rho, rho, alpha], ..matte(rho, 0.0) },
    );
    // High above, so that little of the light that the plane reflects comes back from the slab (1e-3).
    add(&mut description, "slab", cuboid(Vec3::new(-0.5, 4.0, -0.5), Vec3::new(0.5, 4.1, 0.5), false), glass(n as f32));
    description.lights.push(PunctualLight {
        name: "sun".into(),
        to_world: DAffine3::from_quat(glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2)),
        intensity: Rgb::splat(e),
        kind: PunctualKind::Sun { angle: 0.0 },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    });
    description.cameras.push(look_at(DVec3::new(0.0, 2.0, 0.0), DVec3::ZERO, 14.0));
    let scene = build(description);
    let reflectance = ((n - 1.0) / (n + 1.0)).powi(2);
    let slab = (1.0 - reflectance) / (1.0 + reflectance);
    (scene, f64::from(rho * alpha * e) / std::f64::consts::PI * slab)
}

#[test]
fn caustics_through_a_slab() {
    let (scene, expected) = sun_through_slab(1.0);
    let values: Vec<f64> = (0..SEEDS).map(|seed| mean(&picture(&scene, &settings(200_000, seed)))).collect();
    check("caustic", &values, expected, 6e-3, 0.02);
}

/// A light path and a camera path that meet at a sheet have both hit it, with a probability of alpha each. Light counts
/// alpha once.
#[test]
fn caustics_on_a_sheet_count_its_alpha_once() {
    let (scene, expected) = sun_through_slab(0.4);
    for method in [Method::Pm, Method::Sppm, Method::Cppm, Method::Bpm, Method::Vcm] {
        let of = |seed| Settings { method, iterations: Some(32), ..settings(5000, seed) };
        let values: Vec<f64> = (0..SEEDS).map(|seed| mean(&picture(&scene, &of(seed)))).collect();
        check(method.name(), &values, expected, 1e-2, 0.5);
    }
}

/// All iterations and shards use the same map, for any number of threads.
#[test]
fn threads_and_shards_change_nothing() {
    let scene = furnace(40.0);
    let base = Settings { photon_memory: 20_000 * PHOTON_BYTES, ..settings(50_000, 3) };
    let all = |settings: &Settings, threads: usize| -> Vec<DVec3> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| picture(&scene, settings)).pixels.iter().map(|p| p.mean(0)).collect()
    };
    let whole = all(&base, 1);
    assert!(whole == all(&base, 3), "threads change the picture");
    let shard = |index| all(&Settings { shard: Shard { index, count: 2 }, ..base.clone() }, 2);
    for ((a, b), whole) in shard(0).iter().zip(&shard(1)).zip(&whole) {
        assert!(((*a + *b) * 0.5 - *whole).abs().max_element() <= 1e-6 * whole.max_element(), "{a} {b} {whole}");
    }
}
