//! Closed forms: what the estimators must give, known without rendering.
//!
//! Every check is a t test over independent seeds at a family-wise error rate of 0.1 % for the file (Sidak over
//! [`TESTS`] checks), plus the stated bias of the closed form itself. Each check is also shown to have power: it
//! rejects the same expectation shifted by [`Check::detects`], which is smaller than what the bugs it guards against
//! would do (a Fresnel factor forgotten, an eta squared in the wrong direction, direct light counted twice, a photon
//! left out).

use crate::support;

use caustique::estimator::InitialBandwidth;
use caustique::light::Emitter;
use caustique::material::{Alpha, Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::random::{Domain, Stream};
use caustique::render::{Control, Levels, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use caustique::transport::path_radiance;
use support::scenes::{
    add, build, camera_paths, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square,
};
use support::stats::Check;

/// Checks in this file that share the error rate.
const TESTS: usize = 40;

/// Means over a `size x size` picture, one render a seed; one list per level, the smallest bandwidth first.
fn by_photons(scene: &Scene, settings: &Settings, size: u32, seeds: u64) -> [Vec<f64>; 5] {
    let camera = scene.camera(&square(size)).expect("a camera");
    let mut means: [Vec<f64>; 5] = Default::default();
    for seed in 0..seeds {
        let settings = Settings { seed, ..settings.clone() };
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        assert_eq!(rendered.rejected(), 0);
        for (level, means) in means.iter_mut().enumerate() {
            let sum = rendered.pixels.iter().map(|p| p.mean(level).x).sum::<f64>();
            means.push(sum / rendered.pixels.len() as f64);
        }
    }
    means
}

/// The same by path tracing with `paths` paths per pixel.
fn by_paths(scene: &Scene, size: u32, paths: u64, seeds: u64) -> Vec<f64> {
    let camera = scene.camera(&square(size)).expect("a camera");
    let camera_paths = camera_paths(scene, &camera);
    (0..seeds)
        .map(|seed| {
            let mut sum = 0.0;
            for index in 0..u64::from(size * size) {
                for pass in 0..paths {
                    let stream = Stream::new(seed, pass, Domain::CameraIndependent, index);
                    let pixel = ((index % u64::from(size)) as u32, (index / u64::from(size)) as u32);
                    sum += f64::from(path_radiance(&camera_paths, pixel, stream).x);
                }
            }
            sum / (f64::from(size * size) * paths as f64)
        })
        .collect()
}

fn settings(iterations: u64, photons: u32, radius: f32) -> Settings {
    Settings {
        iterations: Some(iterations),
        photons,
        initial_bandwidth: InitialBandwidth::Fixed(radius),
        levels: Levels::decorrelated(5),
        ..Settings::default()
    }
}

fn sun(intensity: f32) -> PunctualLight {
    PunctualLight {
        name: "sun".into(),
        // Shines along -Z of its node: straight down.
        to_world: DAffine3::from_quat(glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2)),
        intensity: Rgb::splat(intensity),
        kind: PunctualKind::Sun { angle: 0.0 },
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
    }
}

fn floor(half: f32) -> caustique::geometry::Mesh {
    quad(Vec3::new(-half, 0.0, -half), Vec3::Z * (2.0 * half), Vec3::X * (2.0 * half))
}

fn uniform_environment(radiance: f32) -> Option<EnvironmentDescription> {
    let source = EnvironmentSource::Color(Rgb::splat(radiance));
    Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 })
}

/// Fresnel reflectance of ior n at normal incidence, and transmittance of a slab of it with all its inner reflections.
fn slab(n: f64) -> f64 {
    let f = ((n - 1.0) / (n + 1.0)).powi(2);
    (1.0 - f) / (1.0 + f)
}

/// A closed box whose walls give radiance e and reflect rho: everywhere and in every direction there is e / (1 - rho).
#[test]
fn furnace_box() {
    let (rho, e) = (0.5, 0.5);
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(rho, e));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    // The picture stays clear of the edges, where a kernel loses what lies on the other wall.
    let check = Check { expected: f64::from(e / (1.0 - rho)), bias: 1e-3, detects: 0.02 };
    let levels = by_photons(&scene, &settings(4, 20_000, 0.2), 8, 40);
    check.run(TESTS, "furnace, level 1", &levels[0]);
    check.run(TESTS, "furnace, level 4", &levels[3]);
    check.run(TESTS, "furnace, paths", &by_paths(&scene, 8, 64, 40));
}

/// Irradiance under a point light: I cos / d^2, of which a diffuse plane sends back rho / pi.
#[test]
fn point_light_over_a_plane() {
    let (rho, intensity, height) = (0.6, 3.0, 2.0);
    let mut description = Description::default();
    add(&mut description, "plane", floor(50.0), matte(rho, 0.0));
    description.lights.push(point_light(DVec3::new(0.0, height, 0.0), intensity));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, 0.5));
    let scene = build(description);
    let expected = f64::from(rho) / std::f64::consts::PI * f64::from(intensity) / (height * height);
    // The camera sees 9 mm around the foot: the closed form varies by 2e-5 there.
    let check = Check { expected, bias: 1e-4, detects: 1e-3 };
    check.run(TESTS, "point light, photons", &by_photons(&scene, &settings(4, 100, 0.05), 4, 4)[0]);
    check.run(TESTS, "point light, paths", &by_paths(&scene, 4, 4, 4));
}

/// Irradiance under a uniform sphere is that of a point at its centre: pi L R^2 / d^2, for every strategy of direct
/// light.
#[test]
fn sphere_light_over_a_plane() {
    let (rho, radiance, radius, height) = (0.5, 4.0, 0.5, 1.0);
    let mut description = Description::default();
    add(&mut description, "plane", floor(10.0), matte(rho, 0.0));
    add(&mut description, "lamp", sphere(Vec3::Y * height, radius, 256), matte(0.0, radiance));
    description.cameras.push(look_at(DVec3::new(0.9, 0.4, 0.0), DVec3::ZERO, 0.5));
    let scene = build(description);
    let expected = f64::from(rho * radiance * (radius / height).powi(2));
    // 256 segments: the inscribed polyhedron is smaller by 3e-4.
    let check = Check { expected, bias: 1e-3, detects: 0.015 };
    check.run(TESTS, "sphere light, photons", &by_photons(&scene, &settings(500, 0, 0.05), 8, 40)[0]);
    check.run(TESTS, "sphere light, paths", &by_paths(&scene, 8, 500, 40));
}

/// A light under a mirror is two lights: a point light beside an infinite mirror, over a plane.
#[test]
fn point_light_beside_a_mirror() {
    let mut description = Description::default();
    let (rho, intensity) = (0.5, 2.0);
    add(&mut description, "plane", floor(40.0), matte(rho, 0.0));
    // A wall at x = -1 that faces +X.
    let wall = quad(Vec3::new(-1.0, 0.0, -40.0), Vec3::Y * 80.0, Vec3::Z * 80.0);
    add(&mut description, "mirror", wall, mirror());
    description.lights.push(point_light(DVec3::new(0.0, 1.0, 0.0), intensity));
    description.cameras.push(look_at(DVec3::new(0.3, 0.5, 0.0), DVec3::ZERO, 1.0));
    let scene = build(description);
    // The foot of the light: I / 1, and from the image at x = -2: distance sqrt(5), cosine 1 / sqrt(5).
    let irradiance = f64::from(intensity) * (1.0 + 5f64.powf(-1.5));
    let expected = f64::from(rho) / std::f64::consts::PI * irradiance;
    let check = Check { expected, bias: 2e-3, detects: 0.01 };
    check.run(TESTS, "mirror", &by_photons(&scene, &settings(4, 100_000, 0.1), 4, 24)[4]);
}

/// The sun straight down through a glass slab on to a plane (a caustic), seen directly and through another slab
/// (specular-diffuse-specular).
#[test]
fn sun_through_a_slab_seen_directly_and_through_a_slab() {
    let (rho, e, n) = (0.5, 3.0, 1.5);
    for (through, what) in [(false, "caustic"), (true, "caustic behind glass")] {
        let mut description = Description::default();
        add(&mut description, "plane", floor(0.5), matte(rho, 0.0));
        // High above, so that what the plane sends back into the slab returns too thinly to matter (1e-3).
        add(&mut description, "slab", cuboid(Vec3::new(-0.5, 4.0, -0.5), Vec3::new(0.5, 4.1, 0.5), false), glass(n));
        description.lights.push(sun(e));
        if through {
            let pane = cuboid(Vec3::new(-0.5, 2.0, -0.5), Vec3::new(0.5, 2.01, 0.5), false);
            add(&mut description, "pane", pane, Material { name: String::new(), ..glass(n) });
        }
        description.cameras.push(look_at(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 0.5));
        let scene = build(description);
        let (slabs, transmitted) = (if through { 3 } else { 1 }, slab(f64::from(n)));
        // Slab and pane reflect into each other what the other sends back, on the sun's way and on the eye's, whose
        // camera is between them.
        let between = if through { 1.0 - (1.0 - transmitted).powi(2) } else { 1.0 };
        let expected = f64::from(rho * e) / std::f64::consts::PI * transmitted.powi(slabs) / between.powi(2);
        // A slab forgotten would be 8 %.
        let check = Check { expected, bias: 4e-3, detects: if through { 0.06 } else { 0.03 } };
        check.run(TESTS, what, &by_photons(&scene, &settings(4, 100_000, 0.25), 16, 20)[4]);
    }
}

/// Radiance of a lamp seen straight through a slab that absorbs: slab transmittance with sigma d on every crossing.
#[test]
fn lamp_seen_through_absorbing_glass() {
    let (n, sigma, depth, radiance) = (1.5, 2.0, 0.25, 5.0);
    let mut description = Description::default();
    let water = MediumParameters { sigma_a: Rgb::splat(sigma), sigma_s: Rgb::ZERO, g: 0.0 };
    let material = Material { medium: Some(water), ..glass(n) };
    add(
        &mut description,
        "slab",
        cuboid(Vec3::new(-2.0, 1.0, -2.0), Vec3::new(2.0, 1.0 + depth, 2.0), false),
        material,
    );
    add(&mut description, "lamp", floor(2.0), matte(0.0, radiance));
    description.cameras.push(look_at(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.1));
    let scene = build(description);
    let f = ((f64::from(n) - 1.0) / (f64::from(n) + 1.0)).powi(2);
    let a = f64::from(-sigma * depth).exp();
    let expected = f64::from(radiance) * (1.0 - f).powi(2) * a / (1.0 - f * f * a * a);
    let check = Check { expected, bias: 1e-4, detects: 0.015 };
    check.run(TESTS, "absorbing slab, photons", &by_photons(&scene, &settings(1000, 0, 0.1), 8, 24)[0]);
    check.run(TESTS, "absorbing slab, paths", &by_paths(&scene, 8, 1000, 24));
}

/// A white matte sphere inside clear glass under a uniform sky: radiance is the sky's everywhere. Photons cross the
/// interface with the adjoint, eye paths with 1/eta^2: with either factor wrong, light inside is off by eta^2 = 2.25.
#[test]
fn white_sphere_in_glass_under_a_uniform_sky() {
    let mut description = Description::default();
    add(&mut description, "glass", sphere(Vec3::ZERO, 1.0, 128), glass(1.5));
    add(&mut description, "core", sphere(Vec3::ZERO, 0.5, 128), matte(1.0, 0.0));
    description.environment = uniform_environment(1.0);
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 12.0));
    let scene = build(description);
    // Curvature: the disc's area against the sphere's within the kernel is r^2 / (4 R^2) = 2.5e-3.
    let check = Check { expected: 1.0, bias: 5e-3, detects: 0.03 };
    check.run(TESTS, "sphere in glass, photons", &by_photons(&scene, &settings(2, 100_000, 0.05), 8, 24)[4]);
    check.run(TESTS, "sphere in glass, paths", &by_paths(&scene, 8, 64, 24));
}

/// A black sheet of alpha 0.5 halves direct light; an index-matched clear box does nothing to it. Neither is a bounce:
/// all of it stays direct light, counted once.
#[test]
fn cut_outs_and_matched_boundaries_are_no_bounces() {
    let (rho, intensity) = (0.5, 2.0);
    for (factor, what) in [(0.5, "alpha 0.5"), (1.0, "index-matched")] {
        let mut description = Description::default();
        add(&mut description, "plane", floor(5.0), matte(rho, 0.0));
        if factor == 0.5 {
            let sheet = quad(Vec3::new(-5.0, 1.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0);
            add(
                &mut description,
                "sheet",
                sheet,
                Material { alpha: Alpha::Blend, base_color: [0.0, 0.0, 0.0, 0.5], ..matte(0.0, 0.0) },
            );
        } else {
            add(
                &mut description,
                "box",
                cuboid(Vec3::new(-3.0, 0.9, -3.0), Vec3::new(3.0, 1.1, 3.0), false),
                glass(1.0),
            );
        }
        description.lights.push(point_light(DVec3::new(0.0, 2.0, 0.0), intensity));
        description.cameras.push(look_at(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, 0.5));
        let scene = build(description);
        assert!(scene.lights.emitters().iter().all(Emitter::is_delta));
        let expected = f64::from(rho * intensity) / std::f64::consts::PI / 4.0 * factor;
        let check = Check { expected, bias: 1e-4, detects: 0.03 };
        let settings = settings(100, 1000, 0.05);
        check.run(TESTS, what, &by_photons(&scene, &settings, 8, 24)[0]);
        let camera = scene.camera(&square(4)).expect("a camera");
        let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
        for pixel in &rendered.pixels {
            assert_eq!((pixel.parts().caustic.x, pixel.parts().indirect.x), (0.0, 0.0), "{what}");
        }
    }
}

/// The two eye paths of a pixel share nothing but photons: without any, the errors of level 1 and level 2 under a soft
/// shadow are uncorrelated over 64 seeds, and those of levels 2 and 3, which share a path, are not.
#[test]
fn the_two_eye_paths_are_independent() {
    let mut description = Description::default();
    add(&mut description, "plane", floor(5.0), matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.5, 2.0, -0.5), Vec3::X, Vec3::Z);
    add(&mut description, "lamp", lamp, matte(0.0, 10.0));
    let blind = quad(Vec3::new(0.0, 1.0, -2.0), Vec3::X * 2.0, Vec3::Z * 4.0);
    add(&mut description, "blind", blind, matte(0.0, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.8, 0.5), DVec3::ZERO, 40.0));
    let scene = build(description);
    let camera = scene.camera(&square(8)).expect("a camera");
    let seeds = 64u64;
    let mut values = vec![[0.0; 3]; 64 * seeds as usize];
    for seed in 0..seeds {
        let settings = Settings { seed, ..settings(2, 0, 0.05) };
        let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
        for (i, pixel) in rendered.pixels.iter().enumerate() {
            values[i * seeds as usize + seed as usize] = std::array::from_fn(|k| pixel.mean(k).x);
        }
    }
    // Per-pixel deviations from the mean over seeds, then one correlation over all of them.
    let (mut sums, mut count) = ([[0.0f64; 3]; 3], 0.0);
    for pixel in values.chunks(seeds as usize) {
        let means: [f64; 3] = std::array::from_fn(|k| pixel.iter().map(|v| v[k]).sum::<f64>() / seeds as f64);
        for v in pixel {
            for (a, row) in sums.iter_mut().enumerate() {
                for (b, sum) in row.iter_mut().enumerate() {
                    *sum += (v[a] - means[a]) * (v[b] - means[b]);
                }
            }
            count += 1.0;
        }
    }
    let correlation = |a: usize, b: usize| sums[a][b] / (sums[a][a] * sums[b][b]).sqrt();
    let sigma = 1.0 / f64::sqrt(count * (1.0 - 1.0 / seeds as f64));
    println!("levels 1, 2: {:.4}; levels 2, 3: {:.4}; sigma {sigma:.4}", correlation(0, 1), correlation(1, 2));
    assert!(correlation(0, 1).abs() < 3.0 * sigma, "{} against {sigma}", correlation(0, 1));
    assert!(correlation(1, 2) > 0.99);
}
