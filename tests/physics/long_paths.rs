//! Light that scatters very often: snow, milk, clouds, white rooms. Closed forms of furnaces.
//!
//! Checks are t tests over independent seeds at a family-wise error rate of 0.1 % for the file (Sidak over [`TESTS`]).
//! The comments state the results of the former Russian roulette, a survival of 0.95 at every bounce after the 64th. A
//! planted error of a stated size is rejected.

use crate::support;

use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::{Control, InitialBandwidth, Levels, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use support::scenes::{add, build, cuboid, glass, look_at, matte, quad, sphere, square};
use support::stats::{mean_and_error, t_critical};

const ERROR_RATE: f64 = 1e-3;
const TESTS: usize = 8;

/// Mean over the picture, one per seed.
fn means(scene: &Scene, settings: &Settings, size: u32, seeds: u64) -> Vec<f64> {
    let camera = scene.camera(&square(size)).expect("a camera");
    let mean = |seed| {
        let rendered = render(scene, &camera, &Settings { seed, ..settings.clone() }, |_, _| Control::Continue);
        assert_eq!(rendered.rejected(), 0);
        let own = rendered.settings.levels.picture_level();
        rendered.pixels.iter().map(|p| p.mean(own).x).sum::<f64>() / rendered.pixels.len() as f64
    };
    (0..seeds).map(mean).collect()
}

fn settings(method: Method, iterations: u64) -> Settings {
    Settings { method, levels: Levels::new(1), iterations: Some(iterations), ..Settings::default() }
}

/// Checks that the mean is `expected` within a relative `bias`, and that `expected` shifted by `detects` is rejected.
fn check(what: &str, values: &[f64], expected: f64, (bias, detects): (f64, f64)) {
    let (mean, error) = mean_and_error(values);
    let critical = t_critical(ERROR_RATE, TESTS, values.len() as f64 - 1.0);
    println!("{what}: {mean:.4} +- {error:.4}, expected {expected}");
    let passes = |expected: f64| (mean - expected).abs() <= critical * error + bias * expected;
    assert!(passes(expected), "{what}: {mean} +- {error}, expected {expected}");
    for shift in [1.0 - detects, 1.0 + detects] {
        assert!(!passes(expected * shift), "{what}: an error of {shift} is not detected ({mean} +- {error})");
    }
}

/// A closed box whose walls emit 1 and reflect rho: 1 / (1 - rho). The former roulette gave 233 instead of 1,000,
/// because its second moment `sum_n (rho^2 / 0.95)^n` is infinite.
#[test]
fn furnace_of_white_walls() {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.999, 1.0));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    check("white walls", &means(&scene, &settings(Method::Path, 8), 8, 16), 1000.0, (1e-3, 0.1));
}

/// A ball of a medium without absorption is invisible under a uniform sky, at any density: nearly all light returns
/// from within a few mean free paths. The former roulette gave 1.39 at an optical depth of 100 and 0.73 at 10^6.
#[test]
fn furnace_of_dense_media() {
    for (density, g, iterations) in [(100.0, 0.0, 16), (1e6, 0.0, 32), (100.0, 0.9, 16)] {
        let mut description = Description::default();
        let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(density), g };
        let holds = Material { medium: Some(medium), ..glass(1.0) };
        add(&mut description, "ball", sphere(Vec3::ZERO, 1.0, 32), holds);
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 30.0));
        let scene = build(description);
        let values = means(&scene, &settings(Method::Path, iterations), 8, 16);
        check(&format!("ball of density {density}, g {g}"), &values, 1.0, (1e-3, 0.25));
    }
}

/// A ball in a glass, in a scene a thousand times as wide, where light paths must be aimed at it. When nearly
/// all of them ended at their first scattering in the medium, photon methods gave 0.20, the light scattered once.
#[test]
fn milk_in_a_wide_scene_is_lit() {
    let mut description = Description::default();
    let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(20.0), g: 0.0 };
    add(&mut description, "ball", sphere(Vec3::ZERO, 1.0, 32), Material { medium: Some(medium), ..glass(1.0) });
    add(&mut description, "far", quad(Vec3::new(0.0, 0.0, -1000.0), Vec3::X, Vec3::Y), matte(0.5, 0.0));
    let source = EnvironmentSource::Color(Rgb::ONE);
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 30.0));
    let scene = build(description);
    // Photons carry all light except the direct light of the sky. It increases inwards over a mean free path, and so
    // does the bias of a kernel of that width.
    let initial = InitialBandwidth::Fixed(0.025);
    let by_photons = Settings { initial_bandwidth: initial, photons: 20_000, ..settings(Method::Sppm, 8) };
    check("milk in a wide scene", &means(&scene, &by_photons, 8, 12), 1.0, (0.04, 0.2));
}
