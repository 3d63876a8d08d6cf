//! White furnaces: under a sky of radiance 1, surfaces that reflect or transmit all light are invisible, for all lobes
//! and methods. Steep normal maps and textured coats, which have no closed form, look the same by all methods.
//!
//! Checks are t tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak over its checks).
//! Besides noise they allow for the error of energy tables (0.5 %, and 2 % for anisotropic roughness) and, where
//! photons are gathered, for kernels on a curved surface (3 %). Every check must reject a furnace that is off by 5 %
//! (photons: 20 %; 40 % for the few photons of `bpm`; 90 % for photons that frosted glass focuses on itself).

use crate::support;

use caustique::material::{Input, Material};
use caustique::math::{DVec3, Rgb, Vec2, Vec3, Vec4};
use caustique::render::{Control, InitialBandwidth, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use caustique::texture::{Texels, Texture, TextureRef, Wrap};
use support::scenes::{add, build, glass, look_at, matte, mirror, quad, sphere, square};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 16;
/// All methods except light tracing, which sees nothing in mirrors.
const METHODS: [Method; 9] = [
    Method::Path,
    Method::Bdpt,
    Method::Vcm,
    Method::Bpm,
    Method::Pm,
    Method::Ppm,
    Method::Sppm,
    Method::Appm,
    Method::Cppm,
];

fn white_sky() -> Description {
    let source = EnvironmentSource::Color(Rgb::ONE);
    Description {
        environment: Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 }),
        ..Description::default()
    }
}

/// Materials of all kinds that lose no energy.
fn white() -> Vec<(&'static str, Material)> {
    let shell = |roughness: f32| Material {
        roughness: roughness.into(),
        thin: true,
        transmission: 1.0.into(),
        ..matte(1.0, 0.0)
    };
    let plastic = |roughness: f32| Material { roughness: roughness.into(), specular: 1.0.into(), ..matte(1.0, 0.0) };
    let metal = |roughness: f32| Material { roughness: roughness.into(), metallic: 1.0.into(), ..matte(1.0, 0.0) };
    vec![
        ("matte", matte(1.0, 0.0)),
        ("rough matte", Material { diffuse_roughness: 1.0.into(), ..matte(1.0, 0.0) }),
        ("mirror", mirror()),
        ("rough metal", metal(0.6)),
        ("brushed metal", Material { anisotropy: 0.8, ..metal(0.5) }),
        ("smooth plastic", plastic(0.0)),
        ("plastic", plastic(0.4)),
        ("metal with a thin film", Material { iridescence: 1.0.into(), ..metal(0.4) }),
        ("soap bubble", Material { iridescence: 1.0.into(), iridescence_ior: 1.33, ior: 1.0, ..shell(0.0) }),
        ("clear glass", glass(1.5)),
        ("frosted glass", Material { roughness: 0.5.into(), ..glass(1.5) }),
        ("dispersing glass", Material { dispersion: 0.5, ..glass(1.6) }),
        ("film", shell(0.0)),
        ("frosted film", shell(0.6)),
        ("paper", Material { diffuse_transmission: 0.4.into(), double_sided: true, ..plastic(0.5) }),
        ("below a coat", Material { clearcoat: 1.0.into(), clearcoat_roughness: 0.2.into(), ..matte(1.0, 0.0) }),
        (
            "below sheen",
            Material { sheen_color: Rgb::splat(0.7).into(), sheen_roughness: 0.5.into(), ..matte(1.0, 0.0) },
        ),
        ("half of all", Material { metallic: 0.5.into(), transmission: 0.5.into(), ..plastic(0.4) }),
    ]
}

fn by_photons(method: Method) -> bool {
    method.gathers() || matches!(method, Method::Bpm | Method::Pm)
}

/// Means of pictures, one per seed.
fn means(scene: &Scene, method: Method) -> Vec<f64> {
    let camera = scene.camera(&square(12)).expect("a camera");
    let by_photons = by_photons(method);
    let settings = Settings {
        method,
        photons: 6000,
        iterations: Some(if by_photons { 10 } else { 8 }),
        initial_bandwidth: InitialBandwidth::Fixed(0.15),
        ..Settings::default()
    };
    let mean = |seed| {
        let rendered = render(scene, &camera, &Settings { seed, ..settings.clone() }, |_, _| Control::Continue);
        let all = rendered.pixels.iter().map(|pixel| pixel.mean(0).element_sum() / 3.0);
        all.sum::<f64>() / rendered.pixels.len() as f64
    };
    (1..=SEEDS).map(mean).collect()
}

#[test]
#[ignore = "long"]
fn white_objects_are_invisible_under_a_white_sky() {
    let materials = white();
    let critical = t_critical(sidak(ERROR_RATE, materials.len() * METHODS.len()), 1, SEEDS as f64 - 1.0);
    let mut faults = Vec::new();
    for (what, material) in materials {
        let mut description = white_sky();
        add(&mut description, what, sphere(Vec3::ZERO, 1.0, 64), material);
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 16.0));
        let scene = build(description);
        for method in METHODS {
            let (mean, error) = mean_and_error(&means(&scene, method));
            let (mut bias, mut detects): (f64, f64) = if by_photons(method) { (0.03, 0.2) } else { (5e-3, 0.05) };
            match (what, method) {
                ("brushed metal", _) => {
                    bias += 0.015;
                    detects += 0.05;
                }
                ("frosted glass" | "frosted film", _) if by_photons(method) => detects = 0.9,
                // Few photons land where the narrow lobe of the metal reflects them to the camera.
                ("metal with a thin film", Method::Bpm) => detects = 0.9,
                _ => {}
            }
            if method == Method::Bpm {
                detects = detects.max(0.4);
            }
            println!("{what}, {method:?}: {mean:.5} +- {error:.5}");
            let passes = |expected: f64| (mean - expected).abs() < critical * error + bias;
            if !passes(1.0) {
                faults.push(format!("{what}, {method:?}: {mean} +- {error}"));
            }
            if passes(1.0 - detects) || passes(1.0 + detects) {
                faults.push(format!("{what}, {method:?}: an error of {detects} is not detected ({mean} +- {error})"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A floor whose textures vary the roughness of its diffuse reflection, and the colour and index of its coat, beside a
/// wall of the same material.
#[test]
fn textured_coats_look_the_same_by_all_methods() {
    let mut description = white_sky();
    let texels = [[0.0, 0.9, 0.5, 1.0], [1.0, 0.3, 0.9, 1.0], [0.5, 1.0, 0.2, 1.0], [0.2, 0.5, 1.0, 1.0]].to_vec();
    let wrap = [Wrap::Repeat; 2];
    let texels = Texels::Floats(texels);
    description.textures = vec![Texture { name: "spots".into(), width: 2, height: 2, texels, wrap, linear: true }];
    let spots = TextureRef { texture: 0, set: 0, transform: [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]] };
    let material = Material {
        diffuse_roughness: Input { factor: 1.0, texture: Some(spots) },
        clearcoat: 0.8.into(),
        clearcoat_roughness: 0.6.into(),
        clearcoat_ior: Input { factor: 1.8, texture: Some(spots) },
        clearcoat_color: Input { factor: Rgb::ONE, texture: Some(spots) },
        ..matte(0.8, 0.0)
    };
    let mut floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    floor.uvs[0] = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
    add(&mut description, "floor", floor.clone(), material.clone());
    let mut wall = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 1.0);
    wall.uvs = floor.uvs;
    add(&mut description, "wall", wall, material);
    description.cameras.push(look_at(DVec3::new(0.0, 0.35, 1.6), DVec3::new(0.0, 0.1, 0.0), 40.0));
    same_by_all_methods(&build(description));
}

/// A floor with a steep normal map seen at an angle, so that many normals face away from the camera. All methods agree
/// on a mean of 0.71, which was 0.61 when those normals were black.
#[test]
fn steep_normal_maps_look_the_same_by_all_methods() {
    let mut description = white_sky();
    // Texels of normals that tilt by 60 degrees to four sides.
    let texel = |lean: Vec2| [0.5 + 0.43 * lean.x, 0.5 + 0.43 * lean.y, 0.75, 1.0];
    let texels = Texels::Floats([Vec2::X, Vec2::Y, -Vec2::X, -Vec2::Y].map(texel).to_vec());
    let wrap = [Wrap::Repeat; 2];
    description.textures = vec![Texture { name: "bumps".into(), width: 2, height: 2, texels, wrap, linear: true }];
    let bumps = TextureRef { texture: 0, set: 0, transform: [[16.0, 0.0, 0.0], [0.0, 16.0, 0.0]] };
    let mut floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    floor.uvs[0] = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
    floor.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
    add(&mut description, "floor", floor, Material { normal_texture: Some((bumps, 1.0)), ..matte(0.8, 0.0) });
    // A wall that receives light from the floor.
    add(&mut description, "wall", quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 1.0), matte(0.8, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.35, 1.6), DVec3::new(0.0, 0.1, 0.0), 40.0));
    same_by_all_methods(&build(description));
}

/// Coarse balls whose smooth shading leans up to 40 degrees away from their faces lose no light: alone under a white sky
/// they are invisible, and above a floor they look the same by all methods.
#[test]
fn coarse_smooth_objects_have_no_dark_rims() {
    let rough = |material| Material { roughness: 0.4.into(), ..material };
    let balls = [glass(1.5), rough(glass(1.5)), mirror(), rough(mirror())];
    let mut description = white_sky();
    for (k, material) in balls.into_iter().enumerate() {
        let center = Vec3::new((k % 2) as f32 - 0.5, 0.5, (k / 2) as f32 - 0.5);
        add(&mut description, "ball", sphere(center, 0.4, 4), material);
    }
    description.cameras.push(look_at(DVec3::new(0.0, 1.2, 4.0), DVec3::new(0.0, 0.4, 0.0), 30.0));
    let alone = build(description.clone());
    let (mean, error) = mean_and_error(&means(&alone, Method::Path));
    let critical = t_critical(ERROR_RATE, 1, SEEDS as f64 - 1.0);
    println!("alone: {mean:.5} +- {error:.5}");
    let passes = |expected: f64| (mean - expected).abs() < critical * error + 2e-3;
    assert!(passes(1.0) && !passes(0.98), "{mean} +- {error}");
    let floor = quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    add(&mut description, "floor", floor, matte(0.8, 0.0));
    same_by_all_methods(&build(description));
}

/// Checks that all methods agree on the mean of a scene.
fn same_by_all_methods(scene: &Scene) {
    let methods = [Method::Path, Method::Light, Method::Bdpt, Method::Vcm, Method::Sppm];
    let found: Vec<(Method, f64, f64)> = methods
        .map(|method| {
            let (mean, error) = mean_and_error(&means(scene, method));
            println!("{method:?}: {mean:.5} +- {error:.5}");
            (method, mean, error)
        })
        .to_vec();
    let (_, expected, own) = found[0];
    let critical = t_critical(sidak(ERROR_RATE, methods.len() - 1), 1, SEEDS as f64 - 1.0);
    for &(method, mean, error) in &found[1..] {
        let (bias, detects) = if matches!(method, Method::Bdpt | Method::Vcm) { (2e-3, 0.05) } else { (0.02, 0.2) };
        let passes = |expected: f64| (mean - expected).abs() < critical * error.hypot(own) + bias * expected;
        assert!(passes(expected), "{method:?}: {mean} +- {error}, {expected}");
        assert!(!passes((1.0 - detects) * expected), "{method:?}: an error of {detects} is not detected");
    }
}
