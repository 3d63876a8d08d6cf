//! Lamps behind glass, seen in sharp lobes: photons and camera paths share this light, and together carry all of it.

use crate::support;

use caustique::material::Material;
use caustique::math::{DVec3, Vec3};
use caustique::photon::Kind;
use caustique::render::{Control, InitialBandwidth, Levels, Method, RadiusRule, Settings, render};
use caustique::scene::{Description, Scene};
use caustique::transport::Indirect;
use support::scenes::{add, build, cuboid, glass, look_at, matte, quad, sphere, square};
use support::stats::{mean_and_error, t_critical};

const SIZE: u32 = 16;
const SEEDS: u64 = 16;
const ERROR_RATE: f64 = 1e-3;
/// Allowed relative bias: rays lost at edges, errors of energy tables, and photons missing beyond the walls.
const BIAS: f64 = 0.01;
/// A relative error that must be detected.
const DETECTS: f64 = 0.1;

/// A closed room whose walls emit 1/2 and reflect 1/2, so that radiance is 1 everywhere, also below a pane of glass
/// between floor and ceiling. The floor is white metal, sharp enough that camera paths continue, and seen from the
/// side, so that a forgotten cosine in the weights would show.
fn furnace(roughness: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "room", cuboid(Vec3::ZERO, Vec3::new(4.0, 2.0, 4.0), true), matte(0.5, 0.5));
    let metal =
        Material { base_color: [1.0; 4], metallic: 1.0.into(), roughness: roughness.into(), ..Material::default() };
    add(&mut description, "floor", cuboid(Vec3::new(0.02, 0.01, 0.02), Vec3::new(3.98, 0.02, 3.98), false), metal);
    add(&mut description, "pane", cuboid(Vec3::new(0.01, 0.2, 0.01), Vec3::new(3.99, 0.25, 3.99), false), glass(1.5));
    description.cameras.push(look_at(DVec3::new(2.0, 1.0, 2.8), DVec3::new(2.0, 0.0, 1.8), 12.0));
    build(description)
}

/// Mean radiance of the picture at the smallest bandwidth level, and the part of it that photons and such camera paths
/// share.
fn mean(scene: &Scene, settings: &Settings) -> (f64, f64) {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let rendered = render(scene, &camera, settings, |_, _| Control::Continue);
    assert_eq!(rendered.rejected(), 0);
    let pixels = rendered.pixels.len() as f64;
    let own = settings.levels.picture_level();
    let all: f64 = rendered.pixels.iter().map(|pixel| pixel.mean(own).x).sum();
    let shared: f64 = rendered.pixels.iter().map(|pixel| pixel.parts().indirect.x / f64::from(pixel.iterations)).sum();
    (all / pixels, shared / pixels)
}

#[test]
fn all_light_is_counted_once() {
    check_furnaces(&[(0.3, 0.2)]);
}

#[test]
#[ignore = "long"]
fn all_light_is_counted_once_at_other_bandwidths() {
    check_furnaces(&[(0.3, 0.02), (0.15, 0.3)]);
}

/// All light is found with any share of photons: with small bandwidths nearly no photons, with large ones nearly only
/// photons. Takes pairs of roughness and bandwidth.
fn check_furnaces(furnaces: &[(f32, f32)]) {
    for &(roughness, radius) in furnaces {
        let scene = furnace(roughness);
        for (method, indirect, levels) in [
            (Method::Sppm, Indirect::Photons, 1),
            (Method::Sppm, Indirect::Photons, 5),
            (Method::Sppm, Indirect::Paths, 1),
            (Method::Cppm, Indirect::Photons, 1),
        ] {
            let settings = |seed| Settings {
                method,
                seed,
                indirect,
                photons: 15_000,
                initial_bandwidth: InitialBandwidth::Fixed(radius),
                levels: Levels::new(levels),
                iterations: Some(3),
                ..Settings::default()
            };
            let (values, shared): (Vec<f64>, Vec<f64>) = (0..SEEDS).map(|seed| mean(&scene, &settings(seed))).unzip();
            let (mean, error) = mean_and_error(&values);
            let shared = mean_and_error(&shared).0;
            println!(
                "{roughness}, {radius}, {method:?}, {indirect:?}, {levels}: {mean:.5} +- {error:.5}, {shared:.3} of it by sharp lobes"
            );
            let critical = t_critical(ERROR_RATE, 4 * furnaces.len(), SEEDS as f64 - 1.0);
            let passes = |expected: f64| (mean - expected).abs() <= critical * error + BIAS * expected;
            assert!(passes(1.0), "{mean} +- {error}");
            assert!(
                !passes(1.0 - DETECTS) && !passes(1.0 + DETECTS),
                "{mean} +- {error} is too inaccurate for the test"
            );
        }
    }
}

/// A ball of metal in that room, smaller than the initial bandwidth: most photons in the kernel are on other sides of
/// the ball or beyond it.
fn ball() -> Scene {
    let mut description = Description::default();
    add(&mut description, "room", cuboid(Vec3::ZERO, Vec3::new(4.0, 2.0, 4.0), true), matte(0.5, 0.5));
    let metal = Material { base_color: [1.0; 4], metallic: 1.0.into(), roughness: 0.3.into(), ..Material::default() };
    add(&mut description, "ball", sphere(Vec3::new(2.0, 0.1, 2.0), BALL, 64), metal);
    add(&mut description, "pane", cuboid(Vec3::new(0.01, 0.2, 0.01), Vec3::new(3.99, 0.25, 3.99), false), glass(1.5));
    description.cameras.push(look_at(DVec3::new(2.0, 1.0, 2.8), DVec3::new(2.0, 0.1, 2.0), 4.0));
    build(description)
}

const BALL: f32 = 0.09;

/// Metal has no broad lobes, and yet its bandwidths follow the photons that it reflects: rules with photon statistics
/// reduce the missing light around a ball from iteration to iteration.
#[test]
fn bandwidths_shrink_on_metal() {
    let scene = ball();
    let first = 4.0 * BALL;
    for (method, radius_rule) in [
        (Method::Cppm, RadiusRule::Memoryless),
        (Method::Ppm, RadiusRule::Memoryless),
        (Method::Sppm, RadiusRule::Local),
    ] {
        let missing = |iterations| {
            let settings = Settings {
                method,
                radius_rule,
                photons: 10_000,
                initial_bandwidth: InitialBandwidth::Fixed(first),
                levels: Levels::new(1),
                iterations: Some(iterations),
                ..Settings::default()
            };
            let camera = scene.camera(&square(SIZE)).expect("a camera");
            let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
            let count = rendered.pixels.len();
            let radii = (0..count).map(|index| rendered.bandwidth2(index, Kind::Caustic, 0).sqrt());
            let radius = radii.sum::<f32>() / (count as f32 * first);
            let mean = rendered.pixels.iter().map(|pixel| pixel.mean(0).x).sum::<f64>() / count as f64;
            println!("{method:?}, {radius_rule:?}, {iterations}: {radius} of the first bandwidth, {mean:.3}");
            assert!(radius < 0.8, "{radius}");
            1.0 - mean
        };
        let (soon, later) = (missing(25), missing(100));
        assert!(soon < 0.2 && later < 0.75 * soon, "{soon} is missing, then {later}");
    }
}

/// A small lamp over metal with a small pane between them, which most light paths miss, so that the map is empty in
/// most iterations.
fn pane() -> Scene {
    let mut description = Description::default();
    let metal = Material { base_color: [1.0; 4], metallic: 1.0.into(), roughness: 0.35.into(), ..Material::default() };
    let lamp = quad(Vec3::new(-0.05, 3.0, -0.05), Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.0, 0.0, 0.1));
    add(&mut description, "lamp", lamp, matte(0.0, 100.0));
    add(&mut description, "metal", cuboid(Vec3::new(-0.3, -0.1, -0.3), Vec3::new(0.3, 0.0, 0.3), false), metal);
    add(&mut description, "pane", cuboid(Vec3::new(-0.2, 0.2, -0.2), Vec3::new(0.2, 0.25, 0.2), false), glass(1.5));
    description.cameras.push(look_at(DVec3::new(0.2, 2.0, 0.4), DVec3::ZERO, 4.0));
    build(description)
}

/// Camera paths leave photons their share even in iterations without photons: few light paths give the same mean as
/// many, and as paths alone.
#[test]
#[ignore = "long"]
fn empty_photon_maps_do_not_change_the_mean() {
    let scene = pane();
    let by = |method, photons| {
        let settings = |seed| Settings {
            method,
            seed,
            photons,
            initial_bandwidth: InitialBandwidth::Fixed(0.2),
            levels: Levels::new(1),
            iterations: Some(300),
            ..Settings::default()
        };
        let values: Vec<f64> = (0..SEEDS).map(|seed| mean(&scene, &settings(seed)).0).collect();
        mean_and_error(&values)
    };
    let (many, paths) = (by(Method::Sppm, 4_000), by(Method::Path, 100));
    let critical = t_critical(ERROR_RATE, 2, SEEDS as f64 - 1.0);
    for (name, (mean, error)) in [("paths", paths), ("few light paths", by(Method::Sppm, 100))] {
        println!("{name}: {mean:.5} +- {error:.5}, many light paths: {:.5} +- {:.5}", many.0, many.1);
        let passes = |expected: f64| (mean - expected).abs() <= critical * error.hypot(many.1) + BIAS * expected;
        assert!(passes(many.0), "{mean} +- {error}, {many:?}");
        assert!(
            !passes(many.0 * (1.0 - PLANTED)) && !passes(many.0 * (1.0 + PLANTED)),
            "{mean} +- {error} is too inaccurate for the test"
        );
    }
}

/// A relative error that the test must detect.
const PLANTED: f64 = 0.2;
