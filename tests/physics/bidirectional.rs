//! Compares the methods that weigh techniques of whole paths (MIS) with closed forms, and with each other tile by tile.
//!
//! Closed forms are t tests over independent seeds. Tiles are compared by Welch's t statistic over seeds. The
//! family-wise error rate is 0.1 % per scene (Sidak over methods and tiles), plus the stated bias of the kernel for
//! methods that merge. Every comparison must reject a tile that is brighter by a stated share. Bugs in the weights are
//! planted in `tests/physics/mis.rs`.

use crate::support;

use caustique::material::{Alpha, Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{Counts, InitialBandwidth, Levels, Method, Rendered, Settings, Shard};
use caustique::scene::description::{
    EnvironmentDescription, EnvironmentSource, Projection, PunctualKind, PunctualLight,
};
use caustique::scene::{Description, Scene};
use support::render;
use support::scenes::{
    add, build, cuboid, glass, glossy_balls, lit_room, look_at, matte, mirror, point_light, quad, sphere,
};
use support::stats::{Check, ERROR_RATE, t_critical};
use support::tiles::{SIZE, TILES, average};

/// The methods that use multiple importance sampling.
fn all() -> Vec<Method> {
    Method::ALL.iter().copied().filter(|method| method.has_techniques()).collect()
}

fn settings(iterations: u64, radius: f32, seed: u64) -> Settings {
    Settings {
        seed,
        initial_bandwidth: InitialBandwidth::Fixed(radius),
        levels: Levels::new(1),
        alpha: 0.75,
        iterations: Some(iterations),
        ..Settings::default()
    }
}

fn value(rendered: &Rendered, level: usize, index: usize) -> f64 {
    rendered.pixels[index].mean(level).element_sum() / 3.0
}

// ---------------------------------------------------------------- closed forms

/// Checks the means over an 8 x 8 picture for each method, with 12 seeds.
fn check_all(check: Check, what: &str, scene: &Scene, methods: &[Method], iterations: u64, radius: f32) {
    for &method in methods {
        let mean = |seed| {
            let rendered = render(scene, method, 8, &settings(iterations, radius, seed));
            (0..64).map(|i| value(&rendered, 0, i)).sum::<f64>() / 64.0
        };
        let values: Vec<f64> = (0..12).map(mean).collect();
        check.run(all().len(), &format!("{what}, {method:?}"), &values);
    }
}

fn floor(half: f32) -> caustique::geometry::Mesh {
    quad(Vec3::new(-half, 0.0, -half), Vec3::Z * (2.0 * half), Vec3::X * (2.0 * half))
}

/// Cosine over squared distance, for a light at height `y` above a point that is `x` and `z` away.
fn lambert(x: f64, y: f64, z: f64) -> f64 {
    y / (x * x + y * y + z * z).powf(1.5)
}

fn mean_over_square(half: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
    let at = |i: i32| (f64::from(i) + 0.5) / 50.0 * half - half;
    (0..10_000).map(|i| f(at(i % 100), at(i / 100))).sum::<f64>() / 10_000.0
}

fn sun(intensity: f32) -> PunctualLight {
    PunctualLight {
        name: "sun".into(),
        to_world: DAffine3::from_quat(glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2)),
        intensity: Rgb::splat(intensity),
        kind: PunctualKind::Sun { angle: 0.0 },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    }
}

/// A closed box whose walls emit e and reflect rho: radiance is e / (1 - rho) everywhere and in every direction.
fn furnace() -> (Scene, Check) {
    let (rho, e) = (0.5, 0.5);
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(rho, e));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    (build(description), Check { expected: f64::from(e / (1.0 - rho)), bias: 2e-3, detects: 0.03 })
}

/// Radiance in the furnace is found by all methods.
#[test]
fn furnace_box() {
    let (scene, check) = furnace();
    check_all(check, "furnace", &scene, &all(), 400, 0.1);
    check_all(check, "furnace", &scene, &[Method::Mlt], 100, 0.1);
}

/// The irradiance under a uniform sphere is that of a point light at its centre: pi L R^2 / d^2.
#[test]
#[ignore = "long"]
fn sphere_light_over_a_plane() {
    let (rho, radiance, radius, height) = (0.5, 4.0, 0.5, 1.0);
    let mut description = Description::default();
    add(&mut description, "plane", floor(3.0), matte(rho, 0.0));
    add(&mut description, "lamp", sphere(Vec3::Y * height, radius, 128), matte(0.0, radiance));
    description.cameras.push(look_at(DVec3::new(0.0, 0.4, 0.0), DVec3::ZERO, 60.0));
    let scene = build(description);
    let half = 0.4 * 30f64.to_radians().tan();
    let facing = f64::from(rho * radiance * radius * radius);
    let expected = mean_over_square(half, |x, z| facing * lambert(x, 1.0, z));
    // The polyhedron of 128 segments is smaller than the sphere by 1e-3, and kernels average the curvature of the
    // irradiance.
    let check = Check { expected, bias: 2.5e-3, detects: 0.1 };
    check_all(check, "sphere light", &scene, &all(), 1500, 0.06);
}

/// A point light over a plane and its mirror image, which a path tracer cannot find.
#[test]
fn point_light_beside_a_mirror() {
    let mut description = Description::default();
    let (rho, intensity) = (0.5, 2.0);
    add(&mut description, "plane", floor(4.0), matte(rho, 0.0));
    let wall = quad(Vec3::new(-1.0, 0.0, -4.0), Vec3::Y * 8.0, Vec3::Z * 8.0);
    add(&mut description, "mirror", wall, mirror());
    description.lights.push(point_light(DVec3::new(0.0, 1.0, 0.0), intensity));
    description.cameras.push(look_at(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, 60.0));
    let scene = build(description);
    let scale = f64::from(rho * intensity) / std::f64::consts::PI;
    let half = 0.5 * 30f64.to_radians().tan();
    let expected = mean_over_square(half, |x, z| scale * (lambert(x, 1.0, z) + lambert(x + 2.0, 1.0, z)));
    let check = Check { expected, bias: 2.5e-3, detects: 0.08 };
    check_all(check, "mirror", &scene, &[Method::Light, Method::Bdpt], 300, 0.05);
    check_all(check, "mirror", &scene, &[Method::Vcm], 500, 0.05);
    check_all(check, "mirror", &scene, &[Method::Bpm], 1000, 0.05);
}

/// The sun shines straight down through a glass slab on to a plane (a caustic), which is seen directly or through
/// another slab.
#[test]
#[ignore = "long"]
fn sun_through_a_slab_seen_directly_and_through_a_slab() {
    let (rho, e, n) = (0.5, 3.0, 1.5f64);
    for (through, what) in [(false, "caustic"), (true, "caustic behind glass")] {
        let mut description = Description::default();
        add(&mut description, "plane", floor(0.5), matte(rho, 0.0));
        add(&mut description, "slab", cuboid(Vec3::new(-0.5, 4.0, -0.5), Vec3::new(0.5, 4.1, 0.5), false), glass(1.5));
        description.lights.push(sun(e));
        if through {
            let pane = cuboid(Vec3::new(-0.5, 2.0, -0.5), Vec3::new(0.5, 2.01, 0.5), false);
            add(&mut description, "pane", pane, glass(1.5));
        }
        description.cameras.push(look_at(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 12.0));
        let scene = build(description);
        let f = ((n - 1.0) / (n + 1.0)).powi(2);
        let expected =
            f64::from(rho * e) / std::f64::consts::PI * ((1.0 - f) / (1.0 + f)).powi(if through { 3 } else { 1 });
        let check = Check { expected, bias: 6e-3, detects: 0.06 };
        let methods: &[Method] = if through {
            &[Method::Bpm, Method::Vcm]
        } else {
            &[Method::Light, Method::Bdpt, Method::Bpm, Method::Vcm]
        };
        check_all(check, what, &scene, methods, 2000, 0.1);
    }
}

/// Radiance of a lamp seen straight through an absorbing slab.
#[test]
fn lamp_seen_through_absorbing_glass() {
    let (n, sigma, depth, radiance) = (1.5, 2.0, 0.25, 5.0);
    let mut description = Description::default();
    let water = MediumParameters { sigma_a: Rgb::splat(sigma), sigma_s: Rgb::ZERO, g: 0.0 };
    let material = Material { medium: Some(water), ..glass(n) };
    let slab = cuboid(Vec3::new(-2.0, 1.0, -2.0), Vec3::new(2.0, 1.0 + depth, 2.0), false);
    add(&mut description, "slab", slab, material);
    add(&mut description, "lamp", floor(2.0), matte(0.0, radiance));
    description.cameras.push(look_at(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.1));
    let scene = build(description);
    let f = ((f64::from(n) - 1.0) / (f64::from(n) + 1.0)).powi(2);
    let a = f64::from(-sigma * depth).exp();
    let expected = f64::from(radiance) * (1.0 - f).powi(2) * a / (1.0 - f * f * a * a);
    let check = Check { expected, bias: 1e-4, detects: 0.03 };
    check_all(check, "absorbing slab", &scene, &all(), 50, 0.1);
}

// ---------------------------------------------------------------- agreement

/// A white diffuse sphere in clear glass under a uniform sky has the radiance of the sky. If a factor of eta^2 is wrong
/// on either side, light inside is off by 2.25.
#[test]
#[ignore = "long"]
fn white_sphere_in_glass_under_a_uniform_sky() {
    let mut description = Description::default();
    add(&mut description, "glass", sphere(Vec3::ZERO, 1.0, 128), glass(1.5));
    add(&mut description, "core", sphere(Vec3::ZERO, 0.5, 128), matte(1.0, 0.0));
    let source = EnvironmentSource::Color(Rgb::ONE);
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 12.0));
    let scene = build(description);
    let check = Check { expected: 1.0, bias: 5e-3, detects: 0.1 };
    check_all(check, "path and bdpt, sphere in glass", &scene, &[Method::Path, Method::Bdpt], 64, 0.05);
    check_all(check, "merging, sphere in glass", &scene, &[Method::Bpm, Method::Vcm], 1536, 0.05);
}

/// Twenty instead of ten seeds, with the same total number of paths: Student's t then allows two thirds of the
/// deviation.
const SEEDS: u64 = 20;

fn tiles(rendered: &Rendered, level: usize) -> Vec<f64> {
    support::tiles::tiles(|index| value(rendered, level, index))
}

/// [`support::tiles::disagreeing`] at the error rate of this file.
fn disagreeing(a: &[Vec<f64>], b: &[Vec<f64>], tests: usize, bias: f64) -> Vec<String> {
    support::tiles::disagreeing(a, b, t_critical(ERROR_RATE, tests, (a.len().min(b.len()) - 1) as f64), bias)
}

fn by(scene: &Scene, (method, iterations): (Method, u64), radius: f32, max_depth: u32) -> Vec<Vec<f64>> {
    // The one map of pm must be large for its bandwidths to be small.
    let photons = if method == Method::Pm { 400_000 } else { 10_000 };
    let settings = |seed| Settings { photons, max_depth, ..settings(iterations, radius, seed) };
    let seeds = if method == Method::Pm { SEEDS / 2 } else { SEEDS };
    (0..seeds).map(|seed| tiles(&render(scene, method, SIZE, &settings(seed)), 0)).collect()
}

/// Compares all `methods` with the first, tile by tile. A tile that is brighter by the share `planted` must be
/// rejected.
fn agree(what: &str, scene: &Scene, methods: &[(Method, u64)], radius: f32, bias: f64, planted: f64) {
    let reference = by(scene, methods[0], radius, u32::MAX);
    println!("{what}: {:?} {:.5}", methods[0].0, average(&reference));
    agree_with(what, scene, &reference, &methods[1..], (radius, u32::MAX), bias, planted);
}

fn agree_with(
    what: &str,
    scene: &Scene,
    reference: &[Vec<f64>],
    methods: &[(Method, u64)],
    (radius, max_depth): (f32, u32),
    bias: f64,
    planted: f64,
) {
    let tests = TILES * methods.len();
    for &method in methods {
        let images = by(scene, method, radius, max_depth);
        println!("{what}: {:?} {:.5}", method.0, average(&images));
        let bias = if method.0.has_bandwidths() || method.0 == Method::Pm { bias } else { 0.0 };
        let found = disagreeing(&images, reference, tests, bias);
        assert!(found.is_empty(), "{what}, {:?}: {found:#?}", method.0);
        let mut wrong = images;
        for seed in &mut wrong {
            seed[5] *= 1.0 + planted;
        }
        let noticed = !disagreeing(&wrong, reference, tests, bias).is_empty();
        assert!(noticed, "{what}, {:?}: a tile brighter by {planted} is not detected", method.0);
    }
}

/// Markov chains start at paths with their cut-outs: none of them starts in the dark.
#[test]
fn chains_behind_cut_outs() {
    let mut description = lit_room(matte(0.5, 0.0));
    let curtain =
        Material { alpha: Alpha::Blend, base_color: [0.2, 0.2, 0.2, 0.5], double_sided: true, ..matte(0.2, 0.0) };
    for (name, z) in [("near", 1.6), ("far", 0.8)] {
        let sheet = quad(Vec3::new(-1.0, 0.0, z), Vec3::X * 2.0, Vec3::Y * 2.0);
        add(&mut description, name, sheet, curtain.clone());
    }
    agree("cut-outs", &build(description), &[(Method::Bdpt, 12), (Method::Mlt, 12)], 0.04, 0.0, 0.15);
}

/// Plastic and rough metal in a room: wide and narrow layered lobes.
#[test]
#[ignore = "long"]
fn glossy_room() {
    let scene = build(glossy_balls());
    let methods = [Method::Path, Method::Light, Method::Bdpt, Method::Bpm, Method::Vcm, Method::Sppm, Method::Cppm];
    let mut methods = methods.map(|m| (m, 12)).to_vec();
    methods.extend([(Method::Pm, 16), (Method::Mlt, 6)]);
    agree("glossy room", &scene, &methods, 0.04, 0.02, 0.15);
}

/// Smooth and rough glass, and a lens in front of the camera. Without light tracing, which sees nothing behind smooth
/// glass.
#[test]
#[ignore = "long"]
fn glass_room() {
    let mut description = lit_room(matte(0.5, 0.0));
    add(&mut description, "smooth", sphere(Vec3::new(-0.45, 0.45, 0.0), 0.4, 128), glass(1.5));
    let rough = Material { roughness: 0.4.into(), ..glass(1.4) };
    add(&mut description, "rough", sphere(Vec3::new(0.45, 0.45, 0.3), 0.4, 64), rough);
    description.cameras[0].aperture_radius = 0.05;
    description.cameras[0].focus_distance = 2.5;
    let scene = build(description);
    let mut methods = [Method::Path, Method::Bdpt, Method::Bpm, Method::Vcm, Method::Sppm].map(|m| (m, 16)).to_vec();
    methods.extend([(Method::Pm, 16), (Method::Mlt, 8)]);
    agree("glass room", &scene, &methods, 0.04, 0.02, 0.2);
}

/// A scene lit by a bright patch of the sky and a sun of finite size, with rough metal in the open.
#[test]
#[ignore = "long"]
fn under_the_sky() {
    let mut description = Description::default();
    add(&mut description, "floor", floor(1.5), matte(0.5, 0.0));
    let block = cuboid(Vec3::new(-0.6, 0.0, -0.6), Vec3::new(-0.1, 0.7, -0.1), false);
    add(&mut description, "block", block, matte(0.6, 0.0));
    // Narrow enough for aimed light paths.
    let metal = Material { metallic: 1.0.into(), roughness: 0.4.into(), ..Material::default() };
    add(&mut description, "ball", sphere(Vec3::new(0.4, 0.35, 0.1), 0.35, 64), metal);
    let (width, height) = (32, 16);
    let mut texels = vec![[0.3, 0.4, 0.6]; (width * height) as usize];
    for y in 2..6 {
        for x in 3..9 {
            texels[y * width as usize + x] = [6.0, 5.0, 4.0];
        }
    }
    let source = EnvironmentSource::Image { width, height, texels };
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 30.0, strength: 1.0 });
    description.lights.push(PunctualLight { kind: PunctualKind::Sun { angle: 0.2 }, ..sun(2.0) });
    description.cameras.push(look_at(DVec3::new(1.2, 1.4, 2.2), DVec3::new(0.0, 0.2, 0.0), 40.0));
    let scene = build(description);
    let methods = [
        (Method::Path, 16),
        (Method::Light, 192),
        (Method::Bdpt, 16),
        (Method::Bpm, 128),
        (Method::Vcm, 16),
        (Method::Sppm, 128),
        (Method::Pm, 64),
    ];
    agree("under the sky", &scene, &methods, 0.05, 0.03, 0.2);
}

/// An orthographic camera, and paths of at most four segments.
#[test]
fn short_paths_seen_in_parallel() {
    let mut description = lit_room(matte(0.6, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.2, 0.4, 0.0), 0.4, 64), mirror());
    description.cameras[0].projection = Projection::Orthographic { xmag: 0.9, ymag: 0.9 };
    let scene = build(description);
    let reference = by(&scene, (Method::Path, 20), 0.04, 4);
    let mut methods = [Method::Bdpt, Method::Bpm, Method::Vcm, Method::Sppm].map(|m| (m, 20)).to_vec();
    methods.push((Method::Pm, 16));
    agree_with("parallel", &scene, &reference, &methods, (0.04, 4), 0.02, 0.15);
}

/// Caustics of a point light seen in a mirror and through glass, which only photons find, compared with progressive
/// photon mapping. Counting photons twice would double most tiles.
#[test]
fn caustics_behind_glass() {
    let mut description = Description::default();
    let walls = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true);
    add(&mut description, "room", walls, matte(0.5, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(-0.4, 0.4, 0.0), 0.4, 128), glass(1.5));
    let pane = cuboid(Vec3::new(-1.2, 0.1, 1.5), Vec3::new(1.2, 1.9, 1.55), false);
    add(&mut description, "pane", pane, glass(1.5));
    let glossy = quad(Vec3::new(0.9, 0.1, -0.9), Vec3::Z * 1.8, Vec3::Y * 1.6);
    add(&mut description, "mirror", glossy, mirror());
    description.lights.push(point_light(DVec3::new(0.1, 1.6, 0.3), 3.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.7, 0.0), 50.0));
    let scene = build(description);
    let radius = 0.04;
    let by_sppm = |seed| {
        let settings = Settings { photons: 10_000, ..settings(5, radius, seed) };
        tiles(&render(&scene, Method::Sppm, SIZE, &settings), 0)
    };
    let reference: Vec<Vec<f64>> = (0..SEEDS).map(by_sppm).collect();
    println!("behind glass: sppm {:.5}", average(&reference));
    let methods = [(Method::Vcm, 20), (Method::Bpm, 20)];
    agree_with("behind glass", &scene, &reference, &methods, (radius, u32::MAX), 0.03, 0.3);
}

/// The whole floor is under water, so that all light passes the surface twice. The lamp is so large that a path tracer,
/// which must hit it, is the reference.
#[test]
fn under_water() {
    let mut description = Description::default();
    let walls = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0), true);
    add(&mut description, "walls", walls, matte(0.0, 0.0));
    let bottom = quad(Vec3::new(-0.9, 0.05, -0.9), Vec3::Z * 1.8, Vec3::X * 1.8);
    add(&mut description, "bottom", bottom, matte(0.7, 0.0));
    add(&mut description, "stone", sphere(Vec3::new(0.2, 0.2, 0.1), 0.2, 64), matte(0.5, 0.0));
    let water = cuboid(Vec3::new(-0.95, 0.02, -0.95), Vec3::new(0.95, 0.6, 0.95), false);
    add(&mut description, "water", water, glass(1.33));
    let lamp = quad(Vec3::new(-0.9, 1.9, -0.9), Vec3::X * 1.8, Vec3::Z * 1.8);
    add(&mut description, "lamp", lamp, matte(0.0, 2.0));
    description.cameras.push(look_at(DVec3::new(0.3, 1.6, 0.8), DVec3::new(0.05, 0.1, 0.0), 40.0));
    let scene = build(description);
    let radius = 0.04;
    let reference = by(&scene, (Method::Path, 30), radius, u32::MAX);
    println!("under water: path {:.5}", average(&reference));
    let methods = [(Method::Vcm, 12), (Method::Bpm, 18), (Method::Sppm, 10), (Method::Cppm, 10)];
    agree_with("under water", &scene, &reference, &methods, (radius, u32::MAX), 0.03, 0.2);
}

/// Classical photon mapping agrees, too, with a map so large that its bandwidths are small.
#[test]
fn one_large_photon_map() {
    let scene = small_room();
    let reference = by(&scene, (Method::Path, 16), 0.1, u32::MAX);
    let settings = |seed| Settings { photons: 400_000, ..settings(16, 0.1, seed) };
    let images: Vec<Vec<f64>> =
        (0..SEEDS / 2).map(|seed| tiles(&render(&scene, Method::Pm, SIZE, &settings(seed)), 0)).collect();
    println!("one map: {:.5}, paths {:.5}", average(&images), average(&reference));
    let found = disagreeing(&images, &reference, TILES, 0.03);
    assert!(found.is_empty(), "{found:#?}");
}

// ---------------------------------------------------------------- numbers of samples

/// Light paths per pixel in sixteenths, connections, probability of merging: the ends of all ranges, and shared light
/// paths.
const COUNTS: [(u32, u32, f32); 7] =
    [(1, 0, 0.1), (1, 4, 1.0), (3, 1, 0.0), (4, 0, 1.0), (16, 4, 0.5), (32, 0, 0.0), (64, 2, 0.25)];

fn with_counts((light_paths, connections, merging): (u32, u32, f32), settings: Settings) -> Settings {
    let counts = Counts { light_paths, connections, merging };
    Settings { method: Method::Vcm, counts, ..settings }.without_unused_techniques()
}

/// In a closed box whose walls emit and reflect, radiance is known; any numbers of samples find it.
#[test]
fn furnace_box_with_any_numbers_of_samples() {
    let (scene, check) = furnace();
    for counts in COUNTS {
        let mean = |seed| {
            let settings = with_counts(counts, settings(100, 0.1, seed));
            let rendered = render(&scene, settings.method, 8, &settings);
            (0..64).map(|i| value(&rendered, 0, i)).sum::<f64>() / 64.0
        };
        let values: Vec<f64> = (0..12).map(mean).collect();
        check.run(COUNTS.len(), &format!("furnace, {counts:?}"), &values);
    }
}

/// Any numbers of samples give the picture of path tracing, tile by tile. A tile brighter by a fifth is rejected.
#[test]
#[ignore = "long"]
fn any_numbers_of_samples_agree_with_path_tracing() {
    let scene = small_room();
    let reference = by(&scene, (Method::Path, 24), 0.06, u32::MAX);
    let images = |counts: (u32, u32, f32)| -> Vec<Vec<f64>> {
        let of_seed = |seed| {
            let settings = with_counts(counts, settings(24, 0.06, seed));
            tiles(&render(&scene, settings.method, SIZE, &settings), 0)
        };
        (0..SEEDS).map(of_seed).collect()
    };
    let tests = TILES * COUNTS.len();
    for counts in COUNTS {
        let mut images = images(counts);
        println!("{counts:?}: {:.5}, paths {:.5}", average(&images), average(&reference));
        let found = disagreeing(&images, &reference, tests, 0.02);
        assert!(found.is_empty(), "{counts:?}: {found:#?}");
        images.iter_mut().for_each(|seed| seed[5] *= 1.2);
        assert!(!disagreeing(&images, &reference, tests, 0.02).is_empty(), "{counts:?}: a bright tile is not detected");
    }
}

/// Without light paths vcm is path tracing, and without merging bdpt, to the last bit.
#[test]
fn techniques_without_samples_leave_the_other_methods() {
    let scene = small_room();
    let settings = settings(3, 0.06, 5);
    let pixels = |settings: &Settings| -> Vec<[f64; 3]> {
        let rendered = render(&scene, settings.method, 24, settings);
        rendered.pixels.iter().map(|pixel| pixel.mean(0).to_array()).collect()
    };
    for (counts, method) in [((0, 0, 0.0), Method::Path), ((16, 1, 0.0), Method::Bdpt)] {
        let reduced = with_counts(counts, settings.clone());
        assert_eq!(reduced.method, method);
        assert!(pixels(&reduced) == pixels(&Settings { method, ..settings.clone() }), "{counts:?}");
    }
}

/// Shards, threads and windows of renders that share light paths among pixels give the bits of the whole.
#[test]
fn shared_light_paths_do_not_depend_on_threads_and_shards() {
    let scene = small_room();
    for counts in COUNTS {
        let base = with_counts(counts, settings(4, 0.08, 7));
        let all = |rendered: &Rendered| -> Vec<[f64; 3]> {
            rendered.pixels.iter().map(|pixel| pixel.mean(0).to_array()).collect()
        };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            all(&pool.install(|| render(&scene, base.method, 40, &base)))
        };
        let whole = with(1);
        assert!(whole == with(3), "{counts:?}: threads change the picture");
        let shard = |index| {
            let settings = Settings { shard: Shard { index, count: 2 }, ..base.clone() };
            render(&scene, base.method, 40, &settings)
        };
        let mut joined = shard(1);
        for (pixel, other) in joined.pixels.iter_mut().zip(shard(0).pixels) {
            pixel.join(other);
        }
        assert!(whole == all(&joined), "{counts:?}: shards make another picture");
    }
}

// ---------------------------------------------------------------- levels, shards, threads

fn small_room() -> Scene {
    let mut description = lit_room(matte(0.6, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.2, 0.4, 0.0), 0.4, 64), glass(1.5));
    build(description)
}

/// All five levels of one set of light paths agree with path tracing.
#[test]
fn levels_agree() {
    let scene = small_room();
    let reference = by(&scene, (Method::Path, 16), 0.1, u32::MAX);
    let renders: Vec<Rendered> = (0..SEEDS)
        .map(|seed| render(&scene, Method::Vcm, SIZE, &Settings { levels: Levels::new(5), ..settings(10, 0.08, seed) }))
        .collect();
    for level in 0..5 {
        let images: Vec<Vec<f64>> = renders.iter().map(|r| tiles(r, level)).collect();
        println!("level {}: {:.5}, paths {:.5}", level + 1, average(&images), average(&reference));
        let found = disagreeing(&images, &reference, 5 * TILES, 0.02);
        assert!(found.is_empty(), "level {}: {found:#?}", level + 1);
    }
}

/// The weighted pictures of all techniques sum to the picture of the method, in a room with a lamp that can be hit.
#[test]
fn techniques_share_the_picture() {
    let mut description = lit_room(matte(0.6, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.2, 0.4, 0.0), 0.4, 64), mirror());
    let scene = build(description);
    let cases = [
        (Method::Path, 1, &["hit_s0_t2", "hit_s0_t3", "hit_s0_t7up", "nextevent_s1_t2"][..]),
        (Method::Light, 1, &["hit_s0_t2", "camera_s2_t1", "camera_s7up_t1"]),
        (Method::Bdpt, 1, &["hit_s0_t3", "nextevent_s1_t2", "camera_s2_t1", "connect_s2_t2", "connect_s7up_t7up"]),
        (Method::Bpm, 1, &["hit_s0_t2", "merge_s2_t2", "merge_s3_t2"]),
        (Method::Vcm, 1, &["hit_s0_t3", "nextevent_s1_t3", "connect_s3_t2", "merge_s3_t3"]),
        (Method::Vcm, 5, &["hit_s0_t3", "nextevent_s1_t3", "connect_s3_t2", "merge_s3_t3"]),
    ];
    for (method, levels, expected) in cases {
        let settings = Settings { levels: Levels::decorrelated(levels), techniques: true, ..settings(5, 0.08, 3) };
        let rendered = render(&scene, method, 40, &settings);
        let plain = render(&scene, method, 40, &Settings { techniques: false, ..settings.clone() });
        let own = settings.levels.picture_level();
        assert!(plain.techniques.is_empty());
        let names: Vec<String> = rendered.techniques.iter().map(|picture| picture.name()).collect();
        assert!(expected.iter().all(|name| names.iter().any(|n| n == name)), "{method:?}: {names:?}");
        let (mut sums, mut alone) = (vec![0.0; 1600], 0.0);
        for picture in &rendered.techniques {
            for (i, (weighted, unweighted)) in picture.weighted.iter().zip(&picture.unweighted).enumerate() {
                assert!(weighted[0] <= 1.00001 * unweighted[0], "{method:?}, {}, pixel {i}", picture.name());
                sums[i] += f64::from(weighted[0]);
                alone += f64::from(unweighted[0]);
            }
        }
        for (i, sum) in sums.iter().enumerate() {
            let image = rendered.pixels[i].mean(own);
            assert!(image == plain.pixels[i].mean(own), "watching changes {method:?}");
            assert!(
                (sum - image.x).abs() <= 1e-5 * image.x.max(1e-3),
                "{method:?}, {levels}, pixel {i}: {sum} {image}"
            );
        }
        // With splats left out, the weights would show: the techniques overlap.
        let share = sums.iter().sum::<f64>() / alone;
        assert_eq!(share < 0.9, !matches!(method, Method::Light), "{method:?}: {share}");
    }
}

/// A picture that does not fill its tiles has the same bits with one thread and with three, and shards join to the bits
/// of the whole.
#[test]
fn threads_and_shards_change_nothing() {
    let scene = small_room();
    let all = |rendered: &Rendered| -> Vec<[f64; 3]> {
        let levels = 0..rendered.settings.levels.count;
        rendered.pixels.iter().flat_map(|p| levels.clone().map(|level| p.mean(level).to_array())).collect()
    };
    let base = Settings { levels: Levels::decorrelated(5), ..settings(6, 0.08, 7) };
    for method in [Method::Bdpt, Method::Bpm, Method::Vcm, Method::Cppm] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            all(&pool.install(|| render(&scene, method, 40, &base)))
        };
        let whole = with(1);
        assert!(whole == with(3), "{method:?}: threads change the picture");
        // The iterations of cppm depend on each other, so it has no shards.
        if method == Method::Cppm {
            continue;
        }
        for count in [2, 3] {
            let shard = |index| render(&scene, method, 40, &Settings { shard: Shard { index, count }, ..base.clone() });
            let mut joined = shard(count - 1);
            for index in 0..count - 1 {
                for (pixel, other) in joined.pixels.iter_mut().zip(shard(index).pixels) {
                    pixel.join(other);
                }
            }
            assert!(whole == all(&joined), "{method:?}: {count} shards make another picture");
        }
    }
}
