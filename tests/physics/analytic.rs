//! Compares renders with closed forms.
//!
//! Every check is a t test over independent seeds, at a family-wise error rate of 0.1 % for the file (Sidak over
//! [`TESTS`] checks), plus the stated bias of the closed form. Each check must also reject the expectation shifted by
//! [`Check::detects`]. This shift is smaller than the effect of the bugs that the check guards against (a missing
//! Fresnel factor, an eta squared in the wrong direction, direct light counted twice, a missing photon).

use crate::support;

use caustique::light::Light;
use caustique::material::{Alpha, Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::random::{Domain, Stream};
use caustique::render::{Control, InitialBandwidth, Levels, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use caustique::transport::path_radiance;
use support::scenes::{
    add, build, camera_paths, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square,
};
use support::stats::Check;

/// Number of checks in this file, which share the error rate.
const TESTS: usize = 40;

/// Means over a `size x size` picture, one render per seed, and one list per bandwidth level, the smallest bandwidth
/// first.
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

/// Means over a `size x size` picture by path tracing with `paths` paths per pixel, one per seed.
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
        // Emits along -Z of its node: straight down.
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

fn floor(half: f32) -> caustique::geometry::Mesh {
    quad(Vec3::new(-half, 0.0, -half), Vec3::Z * (2.0 * half), Vec3::X * (2.0 * half))
}

fn uniform_environment(radiance: f32) -> Option<EnvironmentDescription> {
    let source = EnvironmentSource::Color(Rgb::splat(radiance));
    Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 })
}

/// Transmittance at normal incidence of a slab of index n with all its internal reflections.
fn slab(n: f64) -> f64 {
    let f = ((n - 1.0) / (n + 1.0)).powi(2);
    (1.0 - f) / (1.0 + f)
}

/// In a closed box whose walls emit e and reflect rho, radiance is e / (1 - rho) everywhere and in every direction.
#[test]
fn furnace_box() {
    let (rho, e) = (0.5, 0.5);
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(rho, e));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    // The picture excludes the edges, where kernels miss photons on the other wall.
    let check = Check { expected: f64::from(e / (1.0 - rho)), bias: 1e-3, detects: 0.02 };
    let levels = by_photons(&scene, &settings(4, 20_000, 0.2), 8, 40);
    check.run(TESTS, "furnace, level 1", &levels[0]);
    check.run(TESTS, "furnace, level 4", &levels[3]);
    check.run(TESTS, "furnace, paths", &by_paths(&scene, 8, 64, 40));
}

/// The irradiance under a point light is I cos / d^2. A diffuse plane reflects rho / pi of it.
#[test]
fn point_light_over_a_plane() {
    let (rho, intensity, height) = (0.6, 3.0, 2.0);
    let mut description = Description::default();
    add(&mut description, "plane", floor(50.0), matte(rho, 0.0));
    description.lights.push(point_light(DVec3::new(0.0, height, 0.0), intensity));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, 0.5));
    let scene = build(description);
    let expected = f64::from(rho) / std::f64::consts::PI * f64::from(intensity) / (height * height);
    // The camera sees 9 mm around the point below the light. The closed form varies by 2e-5 there.
    let check = Check { expected, bias: 1e-4, detects: 1e-3 };
    check.run(TESTS, "point light, photons", &by_photons(&scene, &settings(4, 100, 0.05), 4, 4)[0]);
    check.run(TESTS, "point light, paths", &by_paths(&scene, 4, 4, 4));
}

/// The irradiance under a uniform sphere is that of a point light at its centre: pi L R^2 / d^2, by all techniques of
/// direct light.
#[test]
fn sphere_light_over_a_plane() {
    let (rho, radiance, radius, height) = (0.5, 4.0, 0.5, 1.0);
    let mut description = Description::default();
    add(&mut description, "plane", floor(10.0), matte(rho, 0.0));
    add(&mut description, "lamp", sphere(Vec3::Y * height, radius, 256), matte(0.0, radiance));
    description.cameras.push(look_at(DVec3::new(0.9, 0.4, 0.0), DVec3::ZERO, 0.5));
    let scene = build(description);
    let expected = f64::from(rho * radiance * (radius / height).powi(2));
    // The polyhedron of 256 segments is smaller than the sphere by 3e-4.
    let check = Check { expected, bias: 1e-3, detects: 0.015 };
    check.run(TESTS, "sphere light, photons", &by_photons(&scene, &settings(150, 0, 0.05), 8, 40)[0]);
    check.run(TESTS, "sphere light, paths", &by_paths(&scene, 8, 150, 40));
}

/// A point light beside an infinite mirror, over a plane, lights the plane like two lights.
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
    // Below the light the irradiance is I / 1; from the image at x = -2 the distance is sqrt(5) and the cosine 1 /
    // sqrt(5).
    let irradiance = f64::from(intensity) * (1.0 + 5f64.powf(-1.5));
    let expected = f64::from(rho) / std::f64::consts::PI * irradiance;
    let check = Check { expected, bias: 2e-3, detects: 0.01 };
    check.run(TESTS, "mirror", &by_photons(&scene, &settings(4, 100_000, 0.1), 4, 24)[4]);
}

/// The sun shines straight down through a glass slab on to a plane (a caustic), which is seen directly or through
/// another slab (specular-diffuse-specular).
#[test]
fn sun_through_a_slab_seen_directly_and_through_a_slab() {
    let (rho, e, n) = (0.5, 3.0, 1.5);
    for (through, what) in [(false, "caustic"), (true, "caustic behind glass")] {
        let mut description = Description::default();
        add(&mut description, "plane", floor(0.5), matte(rho, 0.0));
        // High above, so that little of the light that the plane reflects comes back from the slab (1e-3).
        add(&mut description, "slab", cuboid(Vec3::new(-0.5, 4.0, -0.5), Vec3::new(0.5, 4.1, 0.5), false), glass(n));
        description.lights.push(sun(e));
        if through {
            let pane = cuboid(Vec3::new(-0.5, 2.0, -0.5), Vec3::new(0.5, 2.01, 0.5), false);
            add(&mut description, "pane", pane, Material { name: String::new(), ..glass(n) });
        }
        description.cameras.push(look_at(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 0.5));
        let scene = build(description);
        let (slabs, transmitted) = (if through { 3 } else { 1 }, slab(f64::from(n)));
        // Slab and pane reflect each other's light, on the path of the sun and on the camera path, because the camera
        // is between them.
        let between = if through { 1.0 - (1.0 - transmitted).powi(2) } else { 1.0 };
        let expected = f64::from(rho * e) / std::f64::consts::PI * transmitted.powi(slabs) / between.powi(2);
        // Ignoring a slab would change the result by 8 %.
        let check = Check { expected, bias: 4e-3, detects: if through { 0.06 } else { 0.03 } };
        check.run(TESTS, what, &by_photons(&scene, &settings(4, 30_000, 0.25), 8, 20)[4]);
    }
}

/// Radiance of a lamp seen through an absorbing slab: the transmittance of the slab, with absorption at every crossing.
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
    check.run(TESTS, "absorbing slab, photons", &by_photons(&scene, &settings(200, 0, 0.1), 8, 24)[0]);
    check.run(TESTS, "absorbing slab, paths", &by_paths(&scene, 8, 200, 24));
}

/// A white diffuse sphere in clear glass under a uniform sky has the radiance of the sky. Photons cross the interface
/// with the adjoint BSDF, camera paths with 1/eta^2. If either factor is wrong, light inside is off by eta^2 = 2.25.
#[test]
fn white_sphere_in_glass_under_a_uniform_sky() {
    let mut description = Description::default();
    add(&mut description, "glass", sphere(Vec3::ZERO, 1.0, 128), glass(1.5));
    add(&mut description, "core", sphere(Vec3::ZERO, 0.5, 128), matte(1.0, 0.0));
    description.environment = uniform_environment(1.0);
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 12.0));
    let scene = build(description);
    // The error by curvature: the area of the kernel disc differs from that of the sphere by r^2 / (4 R^2) = 2.5e-3.
    let check = Check { expected: 1.0, bias: 5e-3, detects: 0.03 };
    check.run(TESTS, "sphere in glass, photons", &by_photons(&scene, &settings(2, 100_000, 0.05), 8, 24)[4]);
    check.run(TESTS, "sphere in glass, paths", &by_paths(&scene, 8, 64, 24));
}

/// A black sheet of alpha 0.5 halves direct light, and a clear box of matched index has no effect. Neither counts as a
/// bounce: the light stays direct light and counts once.
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
        assert!(scene.lights.emitters().iter().all(Light::is_delta));
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

/// The two camera paths of a pixel share only photons. Without photons, the errors of levels 1 and 2 in a soft shadow
/// are uncorrelated over 64 seeds, and those of levels 2 and 3, which share a path, are correlated.
#[test]
fn the_two_camera_paths_are_independent() {
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
    // Deviations of each pixel from its mean over seeds, then one correlation over all of them.
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
