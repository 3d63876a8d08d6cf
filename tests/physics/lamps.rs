//! Lamps with Blender's features: pass-through lamps, lamps hidden from cameras, lamps that emit into a cone. Closed
//! forms, for all methods.
//!
//! Checks are t tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak over its checks).
//! Each must reject a picture that is off by the share it declares.

use crate::support;

use caustique::light::SpotEdge;
use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::{Control, InitialBandwidth, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use std::f64::consts::PI;
use support::scenes::{add, build, cuboid, glass, lit_room, look_at, matte, mirror, point_light, quad, sphere, square};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 12;
/// Every family of methods: camera paths, both subpaths, both with merging, photons, and light paths, few of which
/// reach a narrow view.
const METHODS: [Method; 5] = [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm, Method::Light];

fn white_sky() -> Option<EnvironmentDescription> {
    let source = EnvironmentSource::Color(Rgb::ONE);
    Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 })
}

/// Mean of the picture and its standard error.
fn seen(scene: &Scene, method: Method) -> (f64, f64) {
    let camera = scene.camera(&square(12)).expect("a camera");
    let settings = Settings {
        method,
        photons: 6000,
        iterations: Some(32),
        initial_bandwidth: InitialBandwidth::Fixed(0.03),
        ..Settings::default()
    };
    let mean = |seed| {
        let rendered = render(scene, &camera, &Settings { seed, ..settings.clone() }, |_, _| Control::Continue);
        let all = rendered.pixels.iter().map(|pixel| pixel.mean(0).element_sum() / 3.0);
        all.sum::<f64>() / rendered.pixels.len() as f64
    };
    mean_and_error(&(1..=SEEDS).map(mean).collect::<Vec<_>>())
}

/// Checks that all methods except light tracing give `expected` within `bias` (relative) and noise. An error of
/// `detects` (relative) must be rejected.
fn check(what: &str, scene: &Scene, expected: f64, bias: f64, detects: f64) {
    let methods = &METHODS[..4];
    let critical = t_critical(sidak(ERROR_RATE, methods.len()), 1, SEEDS as f64 - 1.0);
    for &method in methods {
        let (mean, error) = seen(scene, method);
        println!("{what}, {method:?}: {mean:.5} +- {error:.5}, {expected:.5}");
        let passes = |expected: f64| (mean - expected).abs() <= critical * error + bias * expected.abs();
        assert!(passes(expected), "{what}, {method:?}: {mean} +- {error}, expected {expected}");
        assert!(
            !passes((1.0 - detects) * expected),
            "{what}, {method:?}: an error of {detects} is not detected ({mean} +- {error})"
        );
    }
}

/// Checks that all methods agree with the first, within 1 % and noise. An error of a fifth must be rejected.
fn agree(what: &str, scene: &Scene, methods: &[Method]) {
    let found: Vec<(f64, f64)> = methods.iter().map(|&method| seen(scene, method)).collect();
    println!("{what}: {found:?}");
    let critical = t_critical(sidak(ERROR_RATE, methods.len() - 1), 1, SEEDS as f64 - 1.0);
    let (expected, own) = found[0];
    for &(mean, error) in &found[1..] {
        let passes = |expected: f64| (mean - expected).abs() <= critical * error.hypot(own) + 0.01 * expected.abs();
        assert!(passes(expected), "{what}: {found:?}");
        assert!(!passes(0.8 * expected), "{what}: an error of 0.2 is not detected {found:?}");
    }
}

/// A floor under a white sky, with a lamp of radiance 1 above it that emits towards it or away from it.
fn below_a_lamp(null_bsdf: bool, toward: bool) -> Scene {
    let mut description = Description { environment: white_sky(), ..Description::default() };
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), matte(0.5, 0.0));
    let corner = Vec3::new(-0.5, 0.5, -0.5);
    let lamp = if toward { quad(corner, Vec3::X, Vec3::Z) } else { quad(corner, Vec3::Z, Vec3::X) };
    add(&mut description, "lamp", lamp, Material { null_bsdf, ..matte(0.0, 1.0) });
    description.cameras.push(look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, 20.0));
    build(description)
}

/// A pass-through lamp blocks no light: the floor reflects half of a white sky and of the lamp's light.
#[test]
fn pass_through_lamps_block_no_light() {
    check("away", &below_a_lamp(true, false), 0.5, 3e-3, 0.1);
    let lamp = 0.5 / PI * below_a_square(0.5, 0.5);
    check("toward", &below_a_lamp(true, true), 0.5 + lamp, 3e-3, 0.1);
}

/// An ordinary lamp blocks most of the sky.
#[test]
fn ordinary_lamps_block_light() {
    let (mean, error) = seen(&below_a_lamp(false, false), Method::Path);
    assert!(mean + 4.0 * error < 0.4, "{mean} +- {error}");
}

/// Seen from the front, the radiance of a pass-through lamp adds to that of the sky behind it. From behind it is
/// invisible.
#[test]
fn pass_through_lamps_add_to_the_light_behind_them() {
    for (z, expected) in [(1.0, 3.0), (-1.0, 1.0)] {
        let mut description = Description { environment: white_sky(), ..Description::default() };
        let lamp = quad(Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y);
        add(&mut description, "lamp", lamp, Material { null_bsdf: true, ..matte(0.0, 2.0) });
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, z), DVec3::ZERO, 20.0));
        let scene = build(description);
        for method in METHODS {
            let (mean, _) = seen(&scene, method);
            assert!((mean - expected).abs() < 1e-5, "{method:?}: {mean}, {expected}");
        }
    }
}

/// In a room with fog, a mirror, glass and a pass-through lamp, all methods that support fog agree.
#[test]
fn all_methods_agree_on_pass_through_lamps() {
    let mut description = lit_room(matte(0.5, 0.0));
    description.materials[1].null_bsdf = true;
    description.materials[1].double_sided = true;
    for p in &mut std::sync::Arc::make_mut(&mut description.meshes[1]).positions {
        p.y -= 0.8;
    }
    add(&mut description, "mirror", sphere(Vec3::new(-0.5, 0.4, 0.2), 0.3, 48), mirror());
    add(&mut description, "glass", sphere(Vec3::new(0.5, 0.4, 0.2), 0.3, 48), glass(1.5));
    for fog in [false, true] {
        description.medium = fog.then(|| MediumParameters {
            sigma_a: Rgb::splat(0.05),
            sigma_s: Rgb::splat(0.2),
            ..MediumParameters::default()
        });
        let scene = build(description.clone());
        let methods = if fog { &METHODS[..3] } else { &METHODS[..4] };
        agree(if fog { "fog" } else { "air" }, &scene, methods);
    }
}

/// Irradiance below the centre of a square of radiance 1 and half side `a` at height `h`.
fn below_a_square(a: f64, h: f64) -> f64 {
    let x = a / h;
    let root = (1.0 + x * x).sqrt();
    4.0 * x / root * (x / root).atan()
}

/// A camera looks straight down at a floor through the lamp that lights it.
#[test]
fn cameras_look_through_lamps_that_are_hidden_from_them() {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::Z, Vec3::X);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.0, 2.0) });
    description.cameras.push(look_at(DVec3::new(0.0, 2.0, 0.0), DVec3::ZERO, 3.0));
    let bright = seen(&build(description.clone()), Method::Path).0;
    assert!((bright - 2.0).abs() < 1e-6, "not hidden, the lamp itself is seen: {bright}");
    description.instances[1].hidden_from_camera = true;
    // The corners of the view are darker by 0.4 %.
    check("through", &build(description), 0.5 / PI * 2.0 * below_a_square(0.5, 1.0), 6e-3, 0.05);
}

/// In a room with a hidden lamp and a hidden white box, both visible in reflections, all methods agree: objects hidden
/// from cameras send light to everything except directly to the camera.
#[test]
fn objects_hidden_from_cameras_send_light_to_everything_else() {
    let mut description = lit_room(matte(0.5, 0.0));
    add(&mut description, "box", cuboid(Vec3::new(-0.5, 0.3, 0.4), Vec3::new(0.5, 1.2, 1.0), false), matte(0.9, 0.0));
    let shown = seen(&build(description.clone()), Method::Path);
    description.instances[1].hidden_from_camera = true;
    description.instances[2].hidden_from_camera = true;
    let scene = build(description);
    let hidden = seen(&scene, Method::Path);
    println!("shown {shown:?}, hidden {hidden:?}");
    assert!((shown.0 - hidden.0).abs() > 8.0 * shown.1.hypot(hidden.1), "the box changes the picture");
    agree("hidden", &scene, &METHODS);
}

/// A screen with back-face culling is invisible for a camera behind it, like an object hidden from cameras, and visible
/// from the front. All methods agree that it shades the room in both cases.
#[test]
fn cameras_look_through_back_faces_that_are_culled() {
    let room = |culled: bool, hidden: bool, front: bool| {
        let mut description = lit_room(matte(0.5, 0.0));
        let (a, b) = (Vec3::X, Vec3::Y * 0.9);
        let screen = quad(Vec3::new(-0.5, 0.3, 0.8), if front { a } else { b }, if front { b } else { a });
        add(&mut description, "screen", screen, Material { culled, ..matte(0.9, 0.0) });
        description.instances[2].hidden_from_camera = hidden;
        build(description)
    };
    // The random numbers are equal, so only rounding differs.
    let alike = |a: &Scene, b: &Scene| {
        let [a, b] = [a, b].map(|scene| seen(scene, Method::Path).0);
        (a - b).abs() < 2e-3 * b
    };
    assert!(alike(&room(true, false, true), &room(false, false, true)));
    let culled = room(true, false, false);
    assert!(alike(&culled, &room(false, true, false)));
    assert!(!alike(&culled, &room(false, false, false)));
    agree("culled", &culled, &METHODS);
}

/// A sky and the disc of a sun light a floor, and both are invisible for cameras.
#[test]
fn cameras_see_no_hidden_light_from_infinity() {
    let mut description = Description { environment: white_sky(), ..Description::default() };
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), matte(0.5, 0.0));
    description.lights.push(PunctualLight {
        name: "sun".into(),
        to_world: caustique::math::DAffine3::from_quat(glam::DQuat::from_rotation_x(-PI / 2.0)),
        intensity: Rgb::ONE,
        kind: PunctualKind::Sun { angle: 0.2 },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: true,
        light_group: None,
        links: None,
    });
    description.environment_hidden_from_camera = true;
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, 10.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 2.0, 0.0), 10.0));
    // A sun of half angle x lights a floor that faces it with its irradiance.
    check("floor", &build(description.clone()), 0.5 + 0.5 / PI, 4e-3, 0.05);
    description.cameras.remove(0);
    let upward = build(description);
    for method in METHODS {
        assert_eq!(seen(&upward, method).0, 0.0, "{method:?}");
    }
}

/// Below a small lamp that emits into a cone of half angle h, the irradiance is larger than below a Lambertian lamp, by
/// tan h / (tan h - h) on the axis.
#[test]
fn spreads_keep_the_flux() {
    let (half, near) = (30f64.to_radians(), 0.3);
    // The view has the size of the lamp.
    let side = (2.0 * near * 4f64.to_radians().tan()) as f32;
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.5 * side, 1.0, -0.5 * side), Vec3::X * side, Vec3::Z * side);
    add(&mut description, "lamp", lamp, Material { spread: half as f32, ..matte(0.0, 1000.0) });
    description.cameras.push(look_at(DVec3::new(0.0, near, 0.0), DVec3::ZERO, 8.0));
    let on_axis = 0.5 / PI * 1000.0 * f64::from(side).powi(2) * half.tan() / (half.tan() - half);
    // Two points of a square have a mean distance of 0.5214 of its side, and the radiance falls with the tangent.
    let expected = on_axis * (1.0 - 0.5214 * f64::from(side) / half.tan());
    check("spread", &build(description), expected, 6e-3, 0.05);
}

/// All methods agree if a lamp with a narrow cone is seen in a mirror and through glass.
#[test]
fn all_methods_agree_on_spreads() {
    let mut description = lit_room(matte(0.5, 0.0));
    description.materials[1].spread = 0.5;
    add(&mut description, "mirror", sphere(Vec3::new(-0.4, 0.5, 0.0), 0.3, 48), mirror());
    add(&mut description, "glass", sphere(Vec3::new(0.3, 0.5, 0.0), 0.3, 48), glass(1.5));
    agree("spread", &build(description), &[Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm]);
}

/// A sun at the zenith, whose disc has this angular diameter (radians), of irradiance 1.
fn zenith_sun(angle: f32) -> PunctualLight {
    PunctualLight {
        to_world: caustique::math::DAffine3::from_quat(glam::DQuat::from_rotation_x(-PI / 2.0)),
        kind: PunctualKind::Sun { angle },
        ..point_light(DVec3::ZERO, 1.0)
    }
}

/// The disc of a sun has its radiance E / (pi sin^2) in a mirror. Through a slab of glass it is dimmer by 2 n / (n^2 + 1),
/// with all reflections between the faces.
#[test]
fn discs_of_suns_are_seen_in_mirrors_and_through_glass() {
    let radiance = 1.0 / (PI * 0.1f64.sin().powi(2));
    let mut description = Description::default();
    description.lights.push(zenith_sun(0.2));
    let below = |y: f64| look_at(DVec3::new(0.0, y, 0.0), DVec3::new(0.0, y - 1.0, 0.0), 4.0);
    let mut reflected = description.clone();
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add(&mut reflected, "mirror", floor, mirror());
    reflected.cameras.push(below(1.0));
    check("mirror", &build(reflected), radiance, 1e-4, 0.02);
    add(&mut description, "slab", cuboid(Vec3::new(-3.0, 1.0, -3.0), Vec3::new(3.0, 1.2, 3.0), false), glass(1.5));
    description.cameras.push(look_at(DVec3::ZERO, DVec3::Y, 4.0));
    check("glass", &build(description), radiance * 2.0 * 1.5 / (1.5f64.powi(2) + 1.0), 1e-3, 0.02);
}

/// A point light with a radius above a floor under a white sky.
fn bulb(pass_through: bool) -> Description {
    let mut description = Description { environment: white_sky(), ..Description::default() };
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    description.lights.push(PunctualLight { radius: 0.4, pass_through, ..point_light(DVec3::new(0.0, 0.6, 0.0), 1.0) });
    description
}

/// A bulb that rays pass through blocks no light of the sky, lights the floor with I / h^2, and is seen directly and in a
/// mirror with its own radiance and that of the sky behind. An ordinary bulb blocks most of the sky.
#[test]
fn pass_through_bulbs_block_no_light() {
    // An icosahedron's intensity varies with the direction.
    let (own, bias) = (1.0 / (PI * 0.4f64.powi(2)), 0.02);
    let from = |mut description: Description, eye: DVec3, to: DVec3| {
        description.cameras.push(look_at(eye, to, 3.0));
        build(description)
    };
    let floor = DVec3::new(0.0, 0.1, 0.0);
    check("floor", &from(bulb(true), floor, DVec3::ZERO), 0.5 + 0.5 / PI / 0.36, 5e-3, 0.05);
    let (mean, error) = seen(&from(bulb(false), floor, DVec3::ZERO), Method::Path);
    assert!(mean + 4.0 * error < 0.8 * (0.5 + 0.5 / PI / 0.36), "{mean} +- {error}");
    check("direct", &from(bulb(true), DVec3::new(0.0, 0.6, 2.0), DVec3::new(0.0, 0.6, 0.0)), own + 1.0, bias, 0.1);
    let mut mirrored = bulb(true);
    mirrored.materials[0] = Material { name: "floor".into(), ..mirror() };
    let toward = from(mirrored, DVec3::new(0.0, 0.6, 1.6), DVec3::new(0.0, 0.0, 0.8));
    check("mirror", &toward, own + 1.0, bias, 0.1);
}

/// A spot with a bulb, which shines straight down on a floor, under a white sky.
fn spot(bulb: bool, hidden_from_camera: bool) -> Description {
    let mut description = Description { environment: white_sky(), ..Description::default() };
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    description.lights.push(PunctualLight {
        to_world: caustique::math::DAffine3::from_translation(DVec3::new(0.0, 0.6, 0.0))
            * caustique::math::DAffine3::from_quat(glam::DQuat::from_rotation_x(-PI / 2.0)),
        kind: PunctualKind::Spot { inner: 1.2, outer: 1.5, edge: SpotEdge::Smooth },
        radius: 0.1,
        bulb,
        hidden_from_camera,
        ..point_light(DVec3::ZERO, 1.0)
    });
    description
}

/// The bulb of a spot blocks no light. It is seen from within its cone with the radiance I / (pi r^2), directly, in a
/// mirror and through a slab of glass, and not from behind. Hidden from cameras, only the mirror shows it; without the
/// key, nothing does. Its light on the floor counts once.
#[test]
fn bulbs_of_spots_are_seen_and_count_once() {
    let own = 1.0 / (PI * 0.1f64.powi(2));
    let from = |mut description: Description, eye: DVec3, to: DVec3| {
        description.cameras.push(look_at(eye, to, 0.5));
        build(description)
    };
    let (above, below) = (DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.0, 0.05, 0.0));
    let lamp = DVec3::new(0.0, 0.6, 0.0);
    for invisible in [spot(true, true), spot(false, false)] {
        assert!((seen(&from(invisible, below, lamp), Method::Path).0 - 1.0).abs() < 1e-4);
    }
    let mirrored = |hidden: bool| {
        let mut description = spot(true, hidden);
        description.materials[0] = Material { name: "floor".into(), ..mirror() };
        from(description, DVec3::new(0.6, 0.6, 0.0), DVec3::new(0.3, 0.0, 0.0))
    };
    assert!((seen(&mirrored(false), Method::Path).0 - own - 1.0).abs() < 1e-3 * own);
    check("mirror, hidden", &mirrored(true), own + 1.0, 1e-3, 0.02);
    // The floor below reflects I / h^2 / pi and the sky; the back of the bulb is dark.
    check("floor", &from(spot(true, false), above, DVec3::ZERO), 0.5 + 0.5 / PI / 0.36, 0.03, 0.1);
    let mut behind_glass = spot(true, false);
    behind_glass.environment = None;
    let slab = cuboid(Vec3::new(-0.9, 0.2, -0.9), Vec3::new(0.9, 0.3, 0.9), false);
    add(&mut behind_glass, "slab", slab, glass(1.5));
    behind_glass.materials[0] = Material { name: "floor".into(), ..matte(0.0, 0.0) };
    let through = from(behind_glass, below, lamp);
    // All reflections between the faces leave the share 2 n / (n^2 + 1).
    check("glass", &through, own * 3.0 / 3.25, 2e-3, 0.02);
}

/// Fog attenuates the light of a bulb from each of its points: a line of sight through the middle meets points of density
/// `1 / (pi sqrt(r^2 - x^2))`, so the light of the middle is multiplied by the Bessel function I0(sigma r). Half of the
/// bulb, in front of a black wall through its middle, sends half of I0 + L0 [modified Struve function].
#[test]
fn fog_attenuates_all_of_a_bulb() {
    const SIGMA: f64 = 15.0;
    let (bessel, struve) = (1.646_723_2, 1.216_162_5);
    let at_middle = (-SIGMA * 0.55).exp() / (PI * 0.1f64.powi(2));
    for (wall, expected) in [(false, at_middle * bessel), (true, at_middle * 0.5 * (bessel + struve))] {
        let mut description = spot(true, false);
        description.environment = None;
        description.medium = Some(MediumParameters { sigma_a: Rgb::splat(SIGMA as f32), sigma_s: Rgb::ZERO, g: 0.0 });
        if wall {
            let wall = quad(Vec3::new(-1.0, 0.6, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0);
            add(&mut description, "wall", wall, matte(0.0, 0.0));
        }
        description.cameras.push(look_at(DVec3::new(0.0, 0.05, 0.0), DVec3::new(0.0, 0.6, 0.0), 0.1));
        check(if wall { "half a bulb in fog" } else { "bulb in fog" }, &build(description), expected, 2e-3, 0.1);
    }
}

/// All methods agree on a room that only the bulb of a spot lights, seen in a varnished floor.
#[test]
fn all_methods_agree_on_bulbs_of_spots() {
    let mut description = lit_room(matte(0.5, 0.0));
    description.materials[1].emission = Rgb::ZERO;
    description.materials[1].null_bsdf = true;
    description.materials[0] =
        Material { name: "room".into(), clearcoat: 1.0.into(), clearcoat_roughness: 0.0.into(), ..matte(0.5, 0.0) };
    description.lights.push(PunctualLight {
        to_world: caustique::math::DAffine3::from_translation(DVec3::new(0.2, 1.6, 0.2))
            * caustique::math::DAffine3::from_quat(glam::DQuat::from_rotation_x(-PI / 2.0)),
        kind: PunctualKind::Spot { inner: 0.8, outer: 1.3, edge: SpotEdge::Smooth },
        radius: 0.15,
        bulb: true,
        ..point_light(DVec3::ZERO, 3.0)
    });
    agree("bulb", &build(description), &[Method::Bdpt, Method::Vcm, Method::Sppm]);
}
