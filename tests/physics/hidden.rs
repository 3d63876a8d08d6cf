//! Solids that are hidden from the camera, with the camera or what it sees inside: closed forms by all methods.
//!
//! Checks are t tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak). Besides noise they
//! allow for the error of energy tables (0.5 %) and of kernels, where photons are gathered (3 %). Every check must reject
//! a picture that is off by 40 %: the boundary of glass changes radiance by 56 % or more, and the media do.

use crate::support;

use caustique::material::{Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{Control, InitialBandwidth, Levels, Method, Settings, render};
use caustique::scene::Description;
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use support::scenes::{add, build, cuboid, glass, look_at, matte, point_light, quad, sphere, square};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 16;
const METHODS: [Method; 10] = [
    Method::Path,
    Method::Bdpt,
    Method::Vcm,
    Method::Sppm,
    Method::Light,
    Method::Cppm,
    Method::Appm,
    Method::Bpm,
    Method::Pm,
    Method::Mlt,
];

/// A scene and the mean of its picture.
struct Case {
    what: &'static str,
    description: Description,
    expected: f64,
    /// Whether light tracing sees it: not a lamp itself.
    traced: bool,
}

/// Adds a solid that is hidden from the camera.
fn hide(description: &mut Description, mesh: caustique::geometry::Mesh, material: Material) {
    add(description, "hidden", mesh, material);
    description.instances.last_mut().expect("the instance was added").hidden_from_camera = true;
}

fn filled(ior: f32, sigma_a: f32, sigma_s: f32) -> Material {
    let medium = MediumParameters { sigma_a: Rgb::splat(sigma_a), sigma_s: Rgb::splat(sigma_s), g: 0.3 };
    Material { medium: Some(medium), ..glass(ior) }
}

fn block(half: f32) -> caustique::geometry::Mesh {
    cuboid(Vec3::splat(-half), Vec3::splat(half), false)
}

/// A white sky, a white ball, and a camera at the distance `eye` from it that sees the middle of the ball.
fn white(eye: f64) -> Description {
    let source = EnvironmentSource::Color(Rgb::ONE);
    let environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    let mut description = Description { environment, ..Description::default() };
    add(&mut description, "ball", sphere(Vec3::ZERO, 0.3, 32), matte(1.0, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, eye), DVec3::ZERO, 15.0 / eye as f32));
    description
}

/// Nothing absorbs light, so radiance over the squared index of refraction is 1 everywhere.
fn furnaces() -> Vec<Case> {
    let case = |what, eye: f64, build: &dyn Fn(&mut Description)| {
        let mut description = white(eye);
        build(&mut description);
        Case { what, description, expected: 1.0, traced: false }
    };
    let mut sky = white(2.0);
    sky.instances.clear();
    hide(&mut sky, block(3.0), glass(1.5));
    let mut dark = white(2.0);
    dark.instances.clear();
    hide(&mut dark, block(3.0), filled(1.0, 2.0, 0.0));
    vec![
        case("a ball in glass", 2.0, &|d| hide(d, sphere(Vec3::ZERO, 0.6, 48), glass(1.5))),
        case("a ball in wax", 2.0, &|d| hide(d, block(0.5), filled(1.3, 0.0, 2.0))),
        case("a ball in fog", 2.0, &|d| hide(d, block(0.5), filled(1.0, 0.0, 2.0))),
        case("a ball and the camera in glass", 1.0, &|d| hide(d, block(1.2), glass(1.5))),
        case("a ball and the camera in wax", 1.0, &|d| hide(d, block(1.2), filled(1.3, 0.0, 1.0))),
        case("the camera in glass", 2.0, &|d| {
            hide(d, cuboid(Vec3::new(-0.3, -0.3, 1.7), Vec3::new(0.3, 0.3, 2.3), false), glass(1.5));
        }),
        case("glass between the ball and the camera", 2.0, &|d| {
            hide(d, cuboid(Vec3::new(-0.5, -0.5, 0.7), Vec3::new(0.5, 0.5, 1.3), false), filled(1.5, 0.0, 2.0));
        }),
        case("a ball of plastic half in water", 2.0, &|d| {
            d.instances.clear();
            add(
                d,
                "plastic",
                sphere(Vec3::ZERO, 0.3, 32),
                Material { specular: 1.0.into(), roughness: 0.4.into(), ..matte(1.0, 0.0) },
            );
            hide(d, cuboid(Vec3::new(-0.6, -0.6, -0.6), Vec3::new(0.6, 0.0, 0.6), false), glass(1.33));
        }),
        Case { what: "the camera in glass under the sky", description: sky, expected: 1.0, traced: false },
        Case { what: "the camera in an absorbing block", description: dark, expected: 1.0, traced: false },
    ]
}

/// A sun of irradiance 1 that shines down on a floor of reflectance 0.5, and a camera above it at the height `eye`.
fn sunny(eye: f64) -> Description {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, -Vec3::Z * 2.0), matte(0.5, 0.0));
    description.lights.push(PunctualLight {
        kind: PunctualKind::Sun { angle: 0.0 },
        to_world: DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        ..point_light(DVec3::ZERO, 1.0)
    });
    description.cameras.push(look_at(DVec3::new(0.0, eye, 0.001), DVec3::ZERO, 20.0 / eye as f32));
    description
}

/// Light crosses a layer of an absorbing block of depth 1 on its way to the floor, and none on its way to the camera.
fn absorbing() -> Vec<Case> {
    let expected = 0.5 / std::f64::consts::PI * (-0.8f64).exp();
    let case = |what, eye, low: f32, high: f32| {
        let mut description = sunny(eye);
        hide(
            &mut description,
            cuboid(Vec3::new(-2.0, low, -2.0), Vec3::new(2.0, high, 2.0), false),
            filled(1.0, 0.8, 0.0),
        );
        Case { what, description, expected, traced: true }
    };
    let mut lamp = Description::default();
    add(&mut lamp, "lamp", quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0), matte(0.0, 1.0));
    hide(&mut lamp, block(2.0), filled(1.5, 0.8, 0.0));
    lamp.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 15.0));
    // The back of a culled wall, and a lamp that rays pass through behind it.
    let mut wall = Description::default();
    let face = |z: f32, a: Vec3, b: Vec3| quad(Vec3::new(-1.0, -1.0, z), a * 2.0, b * 2.0);
    let panel = Material { null_bsdf: true, ..matte(0.0, 1.0) };
    add(&mut wall, "panel", face(0.0, Vec3::X, Vec3::Y), panel);
    add(&mut wall, "wall", face(1.0, Vec3::Y, Vec3::X), Material { culled: true, ..matte(0.5, 0.0) });
    wall.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 15.0));
    vec![
        case("a floor below a block", 3.0, 0.5, 1.5),
        case("a floor below a block with the camera", 1.0, 0.5, 1.5),
        case("a floor under a block", 3.0, 0.0, 1.0),
        case("a floor in a block", 3.0, -0.5, 1.0),
        case("a floor in a block with the camera", 0.7, -0.5, 1.0),
        Case { what: "a lamp in absorbing glass", description: lamp, expected: 1.0 / 2.25, traced: false },
        Case { what: "a lamp behind a culled wall", description: wall, expected: 1.0, traced: false },
    ]
}

#[test]
fn hidden_solids_do_not_absorb_camera_rays() {
    check(absorbing(), &METHODS, 700);
}

#[test]
fn hidden_solids_do_not_bend_or_scatter_camera_rays() {
    check(furnaces(), &METHODS[..4], 5000);
}

fn check(cases: Vec<Case>, methods: &[Method], photons: u32) {
    let critical = t_critical(sidak(ERROR_RATE, cases.len() * methods.len()), 1, SEEDS as f64 - 1.0);
    let mut faults = Vec::new();
    for Case { what, description, expected, traced } in cases {
        let scene = build(description);
        let camera = scene.camera(&square(4)).expect("a camera");
        for method in methods.iter().copied().filter(|method| traced || *method != Method::Light) {
            let settings = Settings {
                method,
                photons,
                // These two have as many light paths as pixels.
                iterations: Some(if matches!(method, Method::Light | Method::Bpm) { 500 } else { 4 }),
                levels: Levels::new(1),
                initial_bandwidth: InitialBandwidth::Fixed(0.1),
                alpha: method.default_alpha(),
                ..Settings::default()
            };
            let mean = |seed| {
                let rendered =
                    render(&scene, &camera, &Settings { seed, ..settings.clone() }, |_, _| Control::Continue);
                rendered.pixels.iter().map(|pixel| pixel.mean(0).y).sum::<f64>() / rendered.pixels.len() as f64
            };
            let (mean, error) = mean_and_error(&(1..=SEEDS).map(mean).collect::<Vec<f64>>());
            let (mean, error) = (mean / expected, error / expected);
            let bias = if method.gathers() || matches!(method, Method::Bpm | Method::Pm) { 0.03 } else { 5e-3 };
            println!("{what}, {method:?}: {mean:.5} +- {error:.5}");
            let passes = |expected: f64| (mean - expected).abs() < critical * error + bias;
            if !passes(1.0) || passes(1.4) || passes(0.6) {
                faults.push(format!("{what}, {method:?}: {mean:.5} +- {error:.5}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
