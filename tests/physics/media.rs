//! Compares participating media with closed forms, and methods with each other.
//!
//! Closed forms are t tests over independent seeds, tiles Welch's t tests, at a family-wise error rate of 0.1 % per
//! test (Sidak over its checks), plus the stated bias of closed form or kernel. Every check must reject a planted error
//! of a stated size.

use crate::support;

use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec2, Vec3};
use caustique::medium::HenyeyGreenstein;
use caustique::photon::Kernel;
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{InitialBandwidth, Levels, Method, Settings};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use support::channels::{self, SIZE, agree};
use support::render;
use support::scenes::{add, build, cuboid, glass, look_at, matte, point_light, quad, sphere, square};
use support::stats::{Check, ERROR_RATE, chi_squared_p, sidak};

// ---------------------------------------------------------------- phase function

/// P-values of chi-squared tests of sampled cosines against the integrals of the density, for several asymmetries, and
/// the largest deviation of the mean cosine from g. `bent` plants a bug: cosines sampled for another asymmetry.
fn phase_tests(bent: f32) -> (f64, f64) {
    const CELLS: usize = 64;
    const DRAWS: u64 = 200_000;
    let (mut least, mut worst) = (1.0f64, 0.0f64);
    let wo = Vec3::new(0.3, -0.5, 0.8).normalize();
    for g in [-0.7f32, 0.0, 1e-4, 0.4, 0.9] {
        let phase = HenyeyGreenstein { g };
        let drawn = HenyeyGreenstein { g: g + bent };
        let mut counts = vec![0.0; CELLS];
        let mut mean = 0.0;
        for i in 0..DRAWS {
            let u = Stream::new(11, 0, Domain::Test, i).vertex(0).two(Purpose::Phase);
            let cos = f64::from(-wo.dot(drawn.sample(wo, u)));
            counts[(((cos + 1.0) * 0.5 * CELLS as f64) as usize).min(CELLS - 1)] += 1.0;
            mean += cos / DRAWS as f64;
        }
        // Simpson's rule over each cell.
        let density = |cos: f64| {
            let side = wo.cross(Vec3::X).normalize();
            let wi = -wo * cos as f32 + side * (1.0 - cos * cos).max(0.0).sqrt() as f32;
            f64::from(phase.pdf_w(wo, wi)) * std::f64::consts::TAU
        };
        let integral = |a: f64, b: f64| {
            let n = 64;
            let h = (b - a) / f64::from(n);
            let f = |i: i32| density(a + h * f64::from(i));
            (0..n).step_by(2).map(|i| f(i) + 4.0 * f(i + 1) + f(i + 2)).sum::<f64>() * h / 3.0
        };
        let edge = |i: usize| 2.0 * i as f64 / CELLS as f64 - 1.0;
        let expected: Vec<f64> = (0..CELLS).map(|i| integral(edge(i), edge(i + 1)) * DRAWS as f64).collect();
        let total = expected.iter().sum::<f64>() / DRAWS as f64;
        assert!((total - 1.0).abs() < 1e-3, "g {g}: the density integrates to {total}");
        least = least.min(chi_squared_p(&counts, &expected));
        // The variance of the cosine is at most 1.
        worst = worst.max((mean - f64::from(g)).abs() * (DRAWS as f64).sqrt());
    }
    (least, worst)
}

#[test]
fn phase_function_is_sampled_normalised_and_symmetric() {
    let (p, deviation) = phase_tests(0.0);
    assert!(p > sidak(ERROR_RATE, 5), "p {p}");
    assert!(deviation < 4.0, "mean cosine off by {deviation} standard errors");
    let (p, deviation) = phase_tests(0.02);
    assert!(p < sidak(ERROR_RATE, 5) && deviation > 4.0, "a bent phase function is not detected: {p}, {deviation}");
    let phase = HenyeyGreenstein { g: 0.6 };
    let (a, b) = (Vec3::new(0.6, 0.8, 0.0), phase.sample(Vec3::Y, Vec2::new(0.3, 0.4)));
    assert!((phase.pdf_w(a, b) - phase.pdf_w(b, a)).abs() < 1e-6);
    // Forward is the direction opposite to `wo`.
    assert!(phase.pdf_w(a, -a) > 10.0 * phase.pdf_w(a, a));
}

/// Relative deviations over a uniform grid of sample points: of the mean of 1 - cos from 1 - g, of 1 - cos from the
/// inverse of the distribution (largest), and of the density at the sampled angles (largest).
fn forward_errors(g: f32, draw: impl Fn(&HenyeyGreenstein, Vec3, Vec2) -> Vec3) -> [f64; 3] {
    // A power of two, so that all numbers are exact.
    const STEPS: u32 = 1 << 22;
    let phase = HenyeyGreenstein { g };
    // Along an axis, so that the direction has no rounding error.
    let (wo, g) = (Vec3::NEG_Z, f64::from(g));
    let ahead = if g < 0.0 { DVec3::NEG_Z } else { DVec3::Z };
    let (mut mean, mut worst) = (0.0, [0.0f64; 2]);
    for i in 0..STEPS {
        let u = Vec2::new((f64::from(i) + 0.5) as f32 / STEPS as f32, 0.2);
        let wi = draw(&phase, wo, u);
        let h = 0.5 * (wi.as_dvec3().normalize() - ahead).length_squared();
        mean += h / f64::from(STEPS);
        if i % 64 == 0 {
            let a = g.abs();
            let spread2 = (1.0 - a).powi(2) + 2.0 * a * h;
            let density = (1.0 - a * a) / (4.0 * std::f64::consts::PI * spread2.powf(1.5));
            let u = f64::from(u.x);
            let s = (1.0 - a * a) / (1.0 + a - 2.0 * a * u);
            let inverse = (1.0 - a) * u * (s + 1.0 - a) / (1.0 + a - 2.0 * a * u);
            let found = [h / inverse, f64::from(phase.pdf_w(wo, wi)) / density];
            worst = std::array::from_fn(|k| worst[k].max((found[k] - 1.0).abs()));
        }
    }
    [mean / (1.0 - g.abs()) - 1.0, worst[0], worst[1]]
}

/// Phase functions keep their mean cosine up to the largest asymmetry. When cosines were sampled, in steps of 6e-8
/// while their median is 1 - 1.5 (1 - g)^2, most directions were exactly forward.
#[test]
fn sharp_phase_functions_keep_their_mean_cosine() {
    let by_cosine = |phase: &HenyeyGreenstein, wo: Vec3, u: Vec2| {
        let g = phase.g;
        let s = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
        let cos = ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // The frame around z.
        let (sin_phi, cos_phi) = (std::f32::consts::TAU * u.y).sin_cos();
        (Vec3::new(sin * cos_phi, sin * sin_phi, 0.0) - wo * cos).normalize()
    };
    for g in [0.0f32, 1e-4, 0.5, 0.99, 0.999, 0.9999, 0.99999, -0.3, -0.9999, -0.99999] {
        let [mean, angle, density] = forward_errors(g, HenyeyGreenstein::sample);
        println!("g {g}: mean off by {mean}, angles by {angle}, density by {density}");
        assert!(mean.abs() < 5e-4, "g {g}: the mean of 1 - cos is off by {mean}");
        assert!(angle < 1e-4, "g {g}: an angle is off by {angle}");
        assert!(density < 1e-5, "g {g}: the density is off by {density}");
    }
    let [_, angle, _] = forward_errors(0.99999, by_cosine);
    assert!(angle > 0.5, "a cosine's rounding is not detected");
}

// ---------------------------------------------------------------- scenes and renders

fn fog(sigma_a: impl Into<[f32; 3]>, sigma_s: impl Into<[f32; 3]>, g: f32) -> MediumParameters {
    MediumParameters { sigma_a: Rgb::from(sigma_a.into()), sigma_s: Rgb::from(sigma_s.into()), g }
}

/// Material of a mesh that only contains a medium: its surface is invisible.
fn holds(medium: MediumParameters) -> Material {
    Material { medium: Some(medium), ..glass(1.0) }
}

fn settings(iterations: u64, seed: u64) -> Settings {
    Settings { seed, levels: Levels::new(1), iterations: Some(iterations), ..Settings::default() }
}

/// Settings of a photon method that gathers photons in media.
fn photons(photons: u32, radius: f32, iterations: u64, seed: u64) -> Settings {
    let initial = InitialBandwidth::Fixed(radius);
    Settings { photons, initial_bandwidth: initial, levels: Levels::new(5), ..settings(iterations, seed) }
}

/// Mean over the picture of every channel, one per seed.
fn means(scene: &Scene, method: Method, size: u32, seeds: u64, of: impl Fn(u64) -> Settings) -> [Vec<f64>; 3] {
    let mut means: [Vec<f64>; 3] = Default::default();
    for seed in 0..seeds {
        let settings = of(seed);
        let rendered = render(scene, method, size, &settings);
        let own = rendered.settings.levels.picture_level();
        for (c, means) in means.iter_mut().enumerate() {
            let sum = rendered.pixels.iter().map(|p| p.mean(own)[c]).sum::<f64>();
            means.push(sum / rendered.pixels.len() as f64);
        }
    }
    means
}

/// A [`Check`] of every channel.
struct ByChannel {
    expected: [f64; 3],
    bias: f64,
    detects: f64,
}

impl ByChannel {
    fn run(&self, what: &str, values: &[Vec<f64>; 3]) {
        let ByChannel { expected, bias, detects } = *self;
        for (c, values) in values.iter().enumerate() {
            Check { expected: expected[c], bias, detects }.run(12, &format!("{what}, channel {c}"), values);
        }
    }
}

/// Methods that trace paths through media.
const WHOLE_PATHS: [Method; 3] = [Method::Path, Method::Bdpt, Method::Vcm];

// ---------------------------------------------------------------- closed forms

/// A lamp seen through fog that fills space, and through fog in a mesh: exp(-sigma d).
#[test]
fn beer_lambert() {
    let (sigma_a, sigma_s) = ([0.1, 0.5, 0.0], [0.2, 0.5, 0.3]);
    for inside in [false, true] {
        let mut description = Description::default();
        add(
            &mut description,
            "lamp",
            quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0),
            matte(0.0, 5.0),
        );
        let medium = fog(sigma_a, sigma_s, 0.3);
        let length = if inside { 1.5 } else { 4.0 };
        if inside {
            let slab = cuboid(Vec3::new(-8.0, 1.0, -8.0), Vec3::new(8.0, 2.5, 8.0), false);
            add(&mut description, "slab", slab, holds(medium));
        } else {
            description.medium = Some(medium);
        }
        description.cameras.push(look_at(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 1.0));
        let scene = build(description);
        let expected = std::array::from_fn(|c| 5.0 * (-f64::from(sigma_a[c] + sigma_s[c]) * length).exp());
        let check = ByChannel { expected, bias: 1e-4, detects: 0.1 };
        for method in WHOLE_PATHS.into_iter().chain([Method::Light]) {
            let one = |seed| Settings { max_depth: 1, ..settings(300, seed) };
            check.run(&format!("lamp behind fog, {method:?}"), &means(&scene, method, 4, 8, one));
        }
        let one = |seed| Settings { max_depth: 1, ..photons(0, 0.1, 4, seed) };
        let check = ByChannel { detects: 1e-3, ..check };
        check.run("lamp behind fog, sppm", &means(&scene, Method::Sppm, 4, 4, one));
    }
}

/// A medium without absorption is invisible under a uniform sky, for any phase function and any differences between
/// channels.
#[test]
fn furnace() {
    for (sigma_s, g) in [([1.5; 3], 0.0), ([2.5, 1.0, 0.4], 0.7)] {
        let mut description = Description::default();
        add(&mut description, "ball", sphere(Vec3::ZERO, 1.0, 32), holds(fog([0.0; 3], sigma_s, g)));
        add(&mut description, "glass", sphere(Vec3::new(0.2, 0.1, 0.0), 0.3, 32), glass(1.3));
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 36.0));
        let scene = build(description);
        for method in WHOLE_PATHS {
            let check = ByChannel { expected: [1.0; 3], bias: 1e-3, detects: 0.05 };
            check.run(&format!("furnace, g {g}, {method:?}"), &means(&scene, method, 8, 8, |seed| settings(150, seed)));
        }
    }
}

/// The surface of a body that lets light in and out diffusely, as wax and skin do, with this medium inside.
fn dense(medium: MediumParameters, specular: f32) -> Material {
    let medium = Some(medium);
    Material {
        diffuse_transmission: 1.0.into(),
        thin: false,
        medium,
        specular: specular.into(),
        roughness: 0.5.into(),
        ..matte(0.0, 0.0)
    }
}

/// Wax without absorption is invisible under a uniform sky, with and without facets on its surface.
#[test]
fn furnace_of_wax() {
    for (specular, g) in [(0.0, 0.0), (1.0, 0.5)] {
        let mut description = Description::default();
        add(&mut description, "wax", sphere(Vec3::ZERO, 1.0, 32), dense(fog([0.0; 3], [6.0, 3.0, 1.5], g), specular));
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 36.0));
        let scene = build(description);
        for method in WHOLE_PATHS {
            // Connections to light paths in dense media are noisy.
            let (detects, iterations) = if method == Method::Path { (0.05, 100) } else { (0.2, 150) };
            let check = ByChannel { expected: [1.0; 3], bias: 2e-3, detects };
            let means = means(&scene, method, 6, 8, |seed| settings(iterations, seed));
            check.run(&format!("wax, g {g}, {method:?}"), &means);
        }
    }
}

/// A thick block of wax under a uniform sky has the colour (1 - s) (1 - 0.139 s) / (1 + 1.17 s) of a half-space, with
/// s^2 = (1 - a) / (1 - g a) for the single-scattering albedo a \[van de Hulst 1980\], which is within 1 %.
#[test]
fn dense_bodies_have_the_colour_of_a_half_space() {
    for g in [0.0f32, 0.6] {
        let albedo = [0.99f32, 0.9, 0.75];
        let medium = fog(albedo.map(|a| 25.0 * (1.0 - a)), albedo.map(|a| 25.0 * a), g);
        let mut description = Description::default();
        add(&mut description, "wax", cuboid(Vec3::splat(-2.0), Vec3::splat(2.0), false), dense(medium, 0.0));
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.3, 0.2, 5.0), DVec3::new(0.0, 0.0, 2.0), 10.0));
        let scene = build(description);
        let expected = albedo.map(|a| {
            let s = f64::from((1.0 - a) / (1.0 - g * a)).sqrt();
            (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
        });
        let check = ByChannel { expected, bias: 0.005, detects: 0.08 };
        check.run(&format!("half-space, g {g}"), &means(&scene, Method::Path, 6, 8, |seed| settings(100, seed)));
    }
}

/// All methods find the same light in wax, which no light path and no camera path passes straight.
#[test]
fn subsurface_scattering_agrees() {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    let wax = fog([0.1, 0.3, 0.9], [6.0, 5.0, 4.0], 0.3);
    let block = cuboid(Vec3::new(-0.6, 0.02, -0.4), Vec3::new(0.3, 0.9, 0.3), false);
    add(
        &mut description,
        "wax",
        block,
        Material { base_color: [0.4; 4], diffuse_transmission: 0.8.into(), ..dense(wax, 1.0) },
    );
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.6, 0.0), 55.0));
    let scene = build(description);
    let path = seeds(&scene, Method::Path, 20, |seed| settings(7, seed));
    for method in [Method::Bdpt, Method::Vcm] {
        let other = seeds(&scene, method, 20, |seed| settings(3, seed));
        agree(&format!("wax, {method:?}"), &other, &path, 0.01, 0.2);
    }
    let sppm = seeds(&scene, Method::Sppm, 20, |seed| photons(10_000, 0.06, 5, seed));
    agree("wax, sppm", &sppm, &path, 0.03, 0.3);
}

/// A closed box whose walls emit e and reflect rho, full of fog without absorption: e / (1 - rho) everywhere.
#[test]
fn furnace_box_full_of_fog() {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.5, 0.5));
    add(&mut description, "glass", sphere(Vec3::new(0.2, 0.1, 0.6), 0.2, 32), glass(1.3));
    description.medium = Some(fog([0.0; 3], [1.5, 0.5, 1.0], 0.5));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 100.0));
    let scene = build(description);
    for method in WHOLE_PATHS {
        let check = ByChannel { expected: [1.0; 3], bias: 2e-3, detects: 0.08 };
        check.run(&format!("foggy furnace, {method:?}"), &means(&scene, method, 8, 8, |seed| settings(100, seed)));
    }
    for method in [Method::Sppm, Method::Cppm] {
        // Kernels at walls miss photons beyond the edges.
        let check = ByChannel { expected: [1.0; 3], bias: 0.015, detects: 0.12 };
        let means = means(&scene, method, 24, 8, |seed| photons(20_000, 0.06, 8, seed));
        check.run(&format!("foggy furnace, {method:?}"), &means);
    }
}

/// Light that a medium without absorption scatters to the camera where radiance is 1: the mean of `1 - exp(-sigma t)`
/// over a picture, from inside of a box of half width `half`.
fn single_scattered_share(scene: &Scene, size: u32, sigma: f32, half: f32) -> f64 {
    let camera = scene.camera(&square(size)).expect("a camera");
    let n = size * 8;
    let taken = |i: u32| {
        let film = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / 8.0;
        let ray = camera.ray(film, Vec2::ZERO);
        let t = (Vec3::splat(half) * ray.direction.signum() - ray.origin) / ray.direction;
        1.0 - f64::from(-sigma * t.min_element()).exp()
    };
    (0..n * n).map(taken).sum::<f64>() / f64::from(n * n)
}

/// Kernels a third as wide as the box of fog, bounded by walls or by a mesh of the medium: the part of a kernel beyond
/// the boundary is compensated. Divided by the volume of the whole ball, the means were 0.865 instead of 0.899, and
/// 0.495 instead of 0.536.
#[test]
#[ignore = "long"]
fn kernels_at_boundaries_are_compensated() {
    let sigma = [1.5, 0.5, 1.0];
    for mesh in [false, true] {
        let mut description = Description::default();
        add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.9, 0.1));
        let medium = fog([0.0; 3], sigma, 0.5);
        let half = if mesh { 0.9 } else { 1.0 };
        if mesh {
            let block = cuboid(Vec3::splat(-half), Vec3::splat(half), false);
            add(&mut description, "block", block, holds(medium));
        } else {
            description.medium = Some(medium);
        }
        description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 100.0));
        let scene = build(description);
        let expected = sigma.map(|sigma| single_scattered_share(&scene, 12, sigma, half));
        let check = ByChannel { expected, bias: 0.02, detects: 0.09 };
        for kernel in [Kernel::Box, Kernel::Gaussian] {
            let mut values: [Vec<f64>; 3] = Default::default();
            for seed in 0..8 {
                let one = Settings { kernel, levels: Levels::new(1), ..photons(10_000, 0.6, 6, seed) };
                let rendered = render(&scene, Method::Sppm, 12, &one);
                let of = |c: usize| rendered.pixels.iter().map(move |p| p.parts().volume[c] / f64::from(p.iterations));
                for (c, values) in values.iter_mut().enumerate() {
                    values.push(of(c).sum::<f64>() / rendered.pixels.len() as f64);
                }
            }
            check.run(&format!("wide kernels {kernel:?}, in a mesh: {mesh}"), &values);
        }
    }
}

/// Single scattering of a point light in an infinite medium, by Simpson's rule on the airlight integral `sigma_s int
/// p(cos) I exp(-sigma_t (t + d(t))) / d(t)^2 dt`, as a mean over a square picture of half width `slope` at distance 1.
fn airlight(medium: &MediumParameters, light: DVec3, intensity: f64, slope: f64) -> [f64; 3] {
    let n = 24;
    let g = f64::from(medium.g);
    let at = |i: i32| slope * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
    let mut sums = [0.0; 3];
    for i in 0..n * n {
        let d = DVec3::new(at(i % n), at(i / n), -1.0).normalize();
        for (c, sum) in sums.iter_mut().enumerate() {
            let sigma_t = f64::from(medium.sigma_t()[c]);
            let f = |t: f64| {
                let to = light - d * t;
                let cos = to.normalize().dot(d);
                let phase = (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cos).powf(1.5) / (4.0 * std::f64::consts::PI);
                phase * (-sigma_t * (t + to.length())).exp() / to.length_squared()
            };
            let (steps, h) = (2000, 12.0 / 2000.0);
            let simpson: f64 = (0..steps)
                .step_by(2)
                .map(|k| f(f64::from(k) * h) + 4.0 * f(f64::from(k + 1) * h) + f(f64::from(k + 2) * h))
                .sum();
            *sum += intensity * f64::from(medium.sigma_s[c]) * simpson * h / 3.0 / f64::from(n * n);
        }
    }
    sums
}

#[test]
fn single_scattering_of_a_point_light() {
    let medium = fog([0.1, 0.3, 0.6], [0.6, 0.8, 0.2], 0.4);
    let mut description = Description { medium: Some(medium), ..Description::default() };
    // A square far behind the camera, because a scene must have a size.
    add(&mut description, "mark", quad(Vec3::new(-1.0, -1.0, 6.0), Vec3::X * 2.0, Vec3::Y * 2.0), matte(0.0, 0.0));
    let light = DVec3::new(0.5, 0.3, -2.0);
    description.lights.push(point_light(light, 7.0));
    description.cameras.push(look_at(DVec3::ZERO, -DVec3::Z, 20.0));
    let scene = build(description);
    let expected = airlight(&medium, light, 7.0, 10f64.to_radians().tan());
    // Without light tracing, whose variance is not bounded near the camera.
    for method in WHOLE_PATHS {
        let check = ByChannel { expected, bias: 2e-3, detects: 0.06 };
        let one = |seed| Settings { max_depth: 2, ..settings(400, seed) };
        check.run(&format!("airlight, {method:?}"), &means(&scene, method, 8, 8, one));
    }
    // Only next-event estimation: light scattered twice is carried by photons.
    let one = |seed| Settings { max_depth: 2, ..photons(100, 0.1, 400, seed) };
    let check = ByChannel { expected, bias: 2e-3, detects: 0.06 };
    check.run("airlight, sppm", &means(&scene, Method::Sppm, 8, 8, one));
}

/// Air close to a lamp, where the inverse square would dominate the noise of transmittance sampling. The lamp is near
/// enough for equiangular sampling on one side of the picture and too far on the other.
#[test]
fn air_close_to_a_point_light() {
    let medium = fog([0.05, 0.1, 0.15], [0.1, 0.1, 0.05], 0.3);
    let mut description = Description { medium: Some(medium), ..Description::default() };
    add(&mut description, "mark", quad(Vec3::new(-1.0, -1.0, 6.0), Vec3::X * 2.0, Vec3::Y * 2.0), matte(0.0, 0.0));
    let light = DVec3::new(0.5, 0.1, -2.0);
    description.lights.push(point_light(light, 7.0));
    description.cameras.push(look_at(DVec3::ZERO, -DVec3::Z, 20.0));
    let scene = build(description);
    let expected = airlight(&medium, light, 7.0, 10f64.to_radians().tan());
    let one = |seed| Settings { max_depth: 2, ..photons(100, 0.1, 400, seed) };
    let check = ByChannel { expected, bias: 2e-3, detects: 0.03 };
    check.run("air close to a light", &means(&scene, Method::Sppm, 8, 8, one));
}

// ---------------------------------------------------------------- agreement

/// Renders one picture per seed.
fn seeds(scene: &Scene, method: Method, seeds: u64, of: impl Fn(u64) -> Settings) -> Vec<Vec<f64>> {
    channels::seeds(method, seeds, |seed| render(scene, method, SIZE, &of(seed)))
}

/// A lamp shines past a board into fog.
fn god_rays() -> Scene {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
    add(&mut description, "lamp", lamp, matte(0.0, 10.0));
    let board = quad(Vec3::new(-0.9, 1.4, -0.8), Vec3::Z * 1.2, Vec3::X * 0.9);
    add(&mut description, "board", board, matte(0.3, 0.0));
    description.medium = Some(fog([0.05; 3], [0.5; 3], 0.5));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.9, 0.0), 55.0));
    build(description)
}

#[test]
#[ignore = "long"]
fn god_rays_agree() {
    let scene = god_rays();
    let path = seeds(&scene, Method::Path, 20, |seed| settings(45, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 20, |seed| settings(12, seed));
    agree("god rays, bdpt", &bdpt, &path, 2e-3, 0.12);
    let vcm = seeds(&scene, Method::Vcm, 20, |seed| settings(12, seed));
    agree("god rays, vcm", &vcm, &path, 0.01, 0.12);
    for method in [Method::Sppm, Method::Cppm] {
        let by_photons = seeds(&scene, method, 20, |seed| photons(10_000, 0.08, 6, seed));
        agree(&format!("god rays, {method:?}"), &by_photons, &bdpt, 0.03, 0.3);
    }
}

/// A ball of clear glass in fog under a lamp: light through the ball illuminates the fog behind it.
#[test]
fn a_glass_ball_in_fog_agrees() {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.3, 0.0));
    let lamp = quad(Vec3::new(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
    add(&mut description, "lamp", lamp, matte(0.0, 10.0));
    add(&mut description, "ball", sphere(Vec3::new(0.0, 1.3, 0.0), 0.35, 64), glass(1.5));
    description.medium = Some(fog([0.1, 0.05, 0.0], [0.6, 0.8, 1.0], 0.3));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.9, 0.0), 55.0));
    let scene = build(description);
    let path = seeds(&scene, Method::Path, 20, |seed| settings(36, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 20, |seed| settings(9, seed));
    agree("ball in fog, bdpt", &bdpt, &path, 2e-3, 0.2);
    let sppm = seeds(&scene, Method::Sppm, 20, |seed| photons(10_000, 0.08, 6, seed));
    agree("ball in fog, sppm", &sppm, &bdpt, 0.03, 0.3);
}

/// A coloured medium that scatters and absorbs, in a block of rough glass and in a mesh with an invisible surface.
#[test]
fn coloured_media_in_meshes_agree() {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    let jade = fog([1.5, 0.2, 0.8], [2.0, 6.0, 3.0], 0.4);
    let smoke = fog([0.2, 0.6, 1.0], [1.5, 1.0, 0.5], -0.2);
    let block = cuboid(Vec3::new(-0.8, 0.02, -0.5), Vec3::new(-0.1, 0.9, 0.2), false);
    add(&mut description, "jade", block, Material { medium: Some(jade), roughness: 0.5.into(), ..glass(1.4) });
    add(&mut description, "smoke", sphere(Vec3::new(0.45, 0.6, 0.2), 0.45, 48), holds(smoke));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.7, 0.0), 55.0));
    let scene = build(description);
    let path = seeds(&scene, Method::Path, 20, |seed| settings(7, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 20, |seed| settings(3, seed));
    agree("coloured media, bdpt", &bdpt, &path, 2e-3, 0.15);
    let sppm = seeds(&scene, Method::Sppm, 20, |seed| photons(10_000, 0.06, 5, seed));
    agree("coloured media, sppm", &sppm, &bdpt, 0.03, 0.3);
}

/// The caustic of a point light in fog, which no camera path can hit: light tracing and photons must agree.
#[test]
fn a_volumetric_caustic_agrees() {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    add(&mut description, "floor", floor, matte(0.4, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.0, 1.2, 0.0), 0.4, 96), glass(1.5));
    description.lights.push(point_light(DVec3::new(0.3, 2.4, 0.1), 6.0));
    description.medium = Some(fog([0.02; 3], [0.4, 0.3, 0.2], 0.2));
    // The ball is above the picture, because no connection finds the light that it shows.
    description.cameras.push(look_at(DVec3::new(0.0, 0.8, 2.6), DVec3::new(0.0, 0.15, 0.0), 25.0));
    let scene = build(description);
    let light = seeds(&scene, Method::Light, 20, |seed| settings(14, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 20, |seed| settings(17, seed));
    let sppm = seeds(&scene, Method::Sppm, 20, |seed| photons(8_000, 0.12, 4, seed));
    agree("volumetric caustic, bdpt", &bdpt, &light, 5e-3, 0.25);
    agree("volumetric caustic, sppm", &sppm, &bdpt, 0.04, 0.3);
}
