//! Progressive photon mapping with every rule and kernel, compared with closed forms and with path tracing.
//!
//! T tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak), plus stated biases of kernels.
//! Each test must reject a planted bug.

use crate::support;

use caustique::estimator::rule::chi_squared::ChiSquaredSettings;
use caustique::estimator::rule::memoryless::bandwidth2_factor;
use caustique::math::{DVec3, Vec3};
use caustique::photon::{Kernel, Kind};
use caustique::random::{Domain, QUARTERS, quarter};
use caustique::render::{Control, InitialBandwidth, Levels, Method, RadiusRule, Rendered, Settings, render};
use caustique::scene::description::PunctualLight;
use caustique::scene::{Description, Scene};
use caustique::transport::{EqualFlux, InitialMedia, LightPaths, Photons};
use support::field::{self, Field, PixelField};
use support::scenes::{add, build, cuboid, glass, look_at, matte, point_light, quad, sphere, square};
use support::stats::{mean_and_error, t_critical};
use support::tiles::{SIZE, TILES, average, disagreeing, tiles};

const ERROR_RATE: f64 = 1e-3;

/// Every rule and kernel.
fn variants() -> Vec<(&'static str, Settings)> {
    let base = |method| Settings { method, levels: Levels::new(1), ..Settings::default() };
    let kernel = |method, kernel| Settings { kernel, ..base(method) };
    let plus = ChiSquaredSettings { plus: true, ..ChiSquaredSettings::default() };
    vec![
        ("sppm", base(Method::Sppm)),
        ("sppm, epanechnikov", kernel(Method::Sppm, Kernel::Epanechnikov)),
        ("sppm, gaussian", kernel(Method::Sppm, Kernel::Gaussian)),
        ("sppm, local", Settings { radius_rule: RadiusRule::Local, ..base(Method::Sppm) }),
        ("ppm", base(Method::Ppm)),
        ("appm", base(Method::Appm)),
        ("appm, epanechnikov", kernel(Method::Appm, Kernel::Epanechnikov)),
        ("cppm", base(Method::Cppm)),
        ("cppm+", Settings { chi_squared: plus, ..base(Method::Cppm) }),
    ]
}

fn picture(scene: &Scene, size: u32, settings: &Settings) -> Rendered {
    let camera = scene.camera(&square(size)).expect("a camera");
    let rendered = render(scene, &camera, settings, |_, _| Control::Continue);
    assert_eq!(rendered.rejected(), 0);
    rendered
}

/// A red lamp is a hundred thousand times as strong as a blue one, so one light path in a hundred thousand starts at
/// the blue lamp. The sample that sets the flux of photons has no blue photon, and yet blue light is correct. Walls
/// that reflect half of the light store, after the first bounce, as much flux as the lamp emits: 4 pi I, from about
/// forty light paths of equal flux (four standard errors of their number, 6e-5).
#[test]
fn lights_too_rare_for_the_sample_keep_their_channel() {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.5, 0.0));
    let lamp = |x: f64, intensity: Vec3| PunctualLight { intensity, ..point_light(DVec3::new(x, 0.0, 0.0), 1.0) };
    description.lights.push(lamp(-0.5, Vec3::new(1e5, 0.0, 0.0)));
    description.lights.push(lamp(0.5, Vec3::new(0.0, 0.0, 1.0)));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    let initial_media = InitialMedia::new(&scene, Vec3::ZERO);
    let blue = EqualFlux::new(&scene, &initial_media, 2).expect("there is a blue lamp");
    let starts = 1 << 22;
    let pass = LightPaths::new(3, 1, Domain::Light, starts, u32::MAX);
    let (mut photons, mut arena) = (Photons::default(), bumpalo::Bump::new());
    for index in 0..starts {
        blue.light_path(&scene, &mut arena, &initial_media, &pass, index, &mut photons);
    }
    let flux = photons.surface.iter().flatten().map(|photon| f64::from(photon.flux.z)).sum::<f64>();
    let expected = 4.0 * std::f64::consts::PI;
    assert!((flux / expected - 1.0).abs() < 4.0 / 40f64.sqrt(), "{flux}, not {expected}");
    assert!(photons.surface.iter().flatten().all(|photon| photon.flux.x == 0.0));
}

/// In a closed box whose walls emit e and reflect rho, radiance is e / (1 - rho) everywhere: a uniform field of photons
/// without bias at any bandwidth. The picture excludes the edges.
#[test]
fn a_uniform_field_has_no_bias_at_any_bandwidth() {
    let (rho, e) = (0.5, 0.5);
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(rho, e));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    let expected = f64::from(e / (1.0 - rho));
    let variants = variants();
    let radii = [0.3, 0.1, 0.04];
    for (name, settings) in &variants {
        for radius in radii {
            let mean = |seed| {
                let initial = InitialBandwidth::Fixed(radius);
                let settings = Settings {
                    seed,
                    initial_bandwidth: initial,
                    photons: 6000,
                    iterations: Some(3),
                    ..settings.clone()
                };
                let rendered = picture(&scene, 8, &settings);
                rendered.pixels.iter().map(|p| p.mean(0).x).sum::<f64>() / 64.0
            };
            let values: Vec<f64> = (0..20).map(mean).collect();
            let (mean, error) = mean_and_error(&values);
            println!("{name}, radius {radius}: {mean:.5} +- {error:.5}, expected {expected}");
            let critical = t_critical(ERROR_RATE, variants.len() * radii.len(), 19.0);
            let passes = |expected: f64| (mean - expected).abs() < critical * error + 1e-3;
            assert!(passes(expected), "{name}, radius {radius}: {mean} +- {error}");
            assert!(!passes(1.08 * expected) && !passes(0.92 * expected), "{name}, radius {radius}: no power");
        }
    }
}

/// In a room with a glass ball under a lamp that paths can hit, all variants agree with path tracing, tile by tile.
#[test]
#[ignore = "long"]
fn all_agree_with_path_tracing() {
    let mut description = Description::default();
    let walls = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true);
    add(&mut description, "room", walls, matte(0.6, 0.0));
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    add(&mut description, "ball", sphere(Vec3::new(0.2, 0.4, 0.0), 0.4, 64), glass(1.5));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.9, 0.0), 50.0));
    let scene = build(description);
    let by = |settings: &Settings, iterations: u64, photons: u32| -> Vec<Vec<f64>> {
        let initial = InitialBandwidth::Fixed(0.05);
        (0..8)
            .map(|seed| {
                let iterations = Some(iterations);
                let rendered = picture(
                    &scene,
                    SIZE,
                    &Settings { seed, iterations, photons, initial_bandwidth: initial, ..settings.clone() },
                );
                tiles(|index| rendered.pixels[index].mean(0).element_sum() / 3.0)
            })
            .collect()
    };
    let paths = by(&Settings { method: Method::Path, levels: Levels::new(1), ..Settings::default() }, 160, 0);
    println!("path {:.5}", average(&paths));
    let variants = variants();
    let critical = t_critical(ERROR_RATE, TILES * variants.len(), 7.0);
    for (name, settings) in &variants {
        let images = by(settings, 32, 10_000);
        println!("{name} {:.5}", average(&images));
        let found = disagreeing(&images, &paths, critical, 0.03);
        assert!(found.is_empty(), "{name}: {found:#?}");
        let mut wrong = images;
        for seed in &mut wrong {
            seed[5] *= 1.25;
        }
        assert!(!disagreeing(&wrong, &paths, critical, 0.03).is_empty(), "{name}: a brighter tile is not detected");
    }
}

/// After 128 iterations, the bias of the memoryless rule is the mean of the closed form over its bandwidths. Its
/// variance is the sum of the variances of the iterations over the squared number of iterations \[Knaus and Zwicker
/// 2011, 3\], if iterations are independent. Quarters are independent although camera paths use sequences, so they give
/// the variance. A bandwidth that never shrinks keeps its bias.
#[test]
fn errors_are_the_sums_over_bandwidths() {
    let scene = Field::Square.scene();
    let camera = scene.camera(&field::view(1)).expect("a camera");
    let (radius, photons, n, seeds) = (0.2, 1000, 128, 14);
    let fields: Vec<PixelField> =
        (0..128).map(|k| PixelField::new(Field::Square, (k % 8, k / 8), 1, radius, photons)).collect();
    for alpha in [2.0 / 3.0, 1.0] {
        let moments = |i: u64, field: &PixelField| field.moments(radius * radius * bandwidth2_factor(i, alpha));
        let means: Vec<f64> =
            fields.iter().map(|field| (1..=n).map(|i| moments(i, field).mean / n as f64).sum()).collect();
        let first: Vec<f64> = fields.iter().map(|f| f.moments(radius * radius).mean - f.truth).collect();
        // The share of the first bandwidth's bias that `estimates` have.
        let share = |estimates: &[f64]| {
            let along = |(k, estimate): (usize, &f64)| first[k] * (estimate - fields[k].truth);
            estimates.iter().enumerate().map(along).sum::<f64>() / first.iter().map(|b| b * b).sum::<f64>()
        };
        let (mut shares, mut ratios, mut poisson) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 0..seeds {
            let settings = Settings { alpha, iterations: Some(n), ..Field::Square.settings(radius, photons, seed) };
            // Squared deviations of single iterations from their expectation, in all and as a Poisson process would
            // have them.
            let (mut sums, mut squares, mut expected) = ([0.0; 128], [0.0; 128], 0.0);
            // Deviations of the sums over quarters.
            let mut quarters = [[0.0; QUARTERS as usize]; 128];
            let rendered = render(&scene, &camera, &settings, |progress, pixels| {
                for (k, pixel) in pixels.iter().enumerate() {
                    let sum = field::photons_of(pixel) * progress.iteration as f64;
                    let moments = moments(progress.iteration, &fields[k]);
                    let deviation = sum - sums[k] - moments.mean;
                    squares[k] += deviation.powi(2);
                    quarters[k][quarter(progress.iteration) as usize] += deviation;
                    expected += moments.variance;
                    sums[k] = sum;
                }
                Control::Continue
            });
            let estimates: Vec<f64> = rendered.pixels.iter().map(field::photons_of).collect();
            shares.push(share(&estimates));
            let squared = |k: usize| (estimates[k] - means[k]).powi(2) * (n * n) as f64;
            let of_quarters = |k: usize| quarters[k].iter().map(|d| d * d).sum::<f64>();
            ratios.push((0..128).map(|k| squared(k) / of_quarters(k) / 128.0).sum());
            poisson.push(squares.iter().sum::<f64>() / expected);
        }
        let expected = share(&means);
        let [share, ratio, poisson] = [&shares, &ratios, &poisson].map(|values| mean_and_error(values));
        println!("alpha {alpha}: {share:.3?} of the first bandwidth's bias, expected {expected:.3}");
        println!("variance over the sum of quarters' {ratio:.3?}, iterations' over Poisson's {poisson:.3?}");
        let critical = t_critical(ERROR_RATE, 4, seeds as f64 - 1.0);
        assert!((share.0 - expected).abs() < critical * share.1, "bias {share:?}, {expected}");
        assert!((ratio.0 - 1.0).abs() < critical * ratio.1, "variance {ratio:?}");
        // Low-discrepancy emission makes photons more regular than a Poisson process, never less.
        assert!(poisson.0 < 1.0 + critical * poisson.1 && poisson.0 > 0.25, "{poisson:?}");
        let other = share.0 - if alpha == 1.0 { 0.312 } else { 1.0 };
        assert!(other.abs() > critical * share.1, "a bandwidth that does not shrink is not detected");
        // The bug: photons that all iterations share.
        assert!((2.0 * ratio.0 - 1.0).abs() > critical * 2.0 * ratio.1, "twice the variance is not detected");
    }
}

/// Where only merging finds light, the bias of VCM after eight iterations is the mean of the closed form over its
/// bandwidths. A planted first iteration without photons, which loses an eighth of the light, is detected.
#[test]
fn merging_alone_has_the_bias_of_its_bandwidths() {
    let scene = Field::Point.scene();
    let camera = scene.camera(&field::view(4)).expect("a camera");
    let (radius, n, seeds) = (0.2, 8, 12);
    let (width, height) = camera.size();
    let places = (0..width * height).map(|k| (k % width, k / width));
    let fields: Vec<PixelField> =
        places.map(|place| PixelField::new(Field::Point, place, 4, radius, width * height)).collect();
    let alpha = Method::Vcm.default_alpha();
    let expected = |field: &PixelField| {
        let mean = |i| field.moments(radius * radius * bandwidth2_factor(i, alpha)).mean;
        (1..=n).map(mean).sum::<f64>() / n as f64
    };
    let all: f64 = fields.iter().map(expected).sum();
    let bias = all / fields.iter().map(|field| field.truth).sum::<f64>() - 1.0;
    let ratios: Vec<f64> = (0..seeds)
        .map(|seed| {
            let settings = Settings {
                method: Method::Vcm,
                alpha,
                iterations: Some(n),
                ..Field::Point.settings(radius, width * height, seed)
            };
            let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
            rendered.pixels.iter().map(field::photons_of).sum::<f64>() / all
        })
        .collect();
    let (ratio, error) = mean_and_error(&ratios);
    let critical = t_critical(ERROR_RATE, 1, seeds as f64 - 1.0);
    println!("{ratio:.5} +- {error:.5} of what is expected, which has a bias of {bias:.4}");
    assert!((ratio - 1.0).abs() < critical * error, "{ratio} +- {error}");
    assert!((ratio * (1.0 - 1.0 / n as f64) - 1.0).abs() > critical * error, "an empty iteration is not detected");
}

/// The curves of the first talk of the course: in a uniform field, the squared radius at fixed points falls as the
/// product of `(N + alpha M) / (N + M)`, the photon count grows accordingly, and the error falls. 5 % covers the spread
/// of counts over 64 points.
#[test]
fn measurement_points_follow_the_talks_curves() {
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.5, 0.5));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
    let scene = build(description);
    let (radius, alpha) = (0.15f32, 2.0 / 3.0);
    let at = |n: u64| {
        let settings = Settings {
            method: Method::Ppm,
            levels: Levels::new(1),
            initial_bandwidth: InitialBandwidth::Fixed(radius),
            photons: 4000,
            iterations: Some(n),
            ..Settings::default()
        };
        let rendered = picture(&scene, 8, &settings);
        let bandwidth2 =
            (0..64).map(|index| f64::from(rendered.bandwidth2(index, Kind::Indirect, 0))).sum::<f64>() / 64.0;
        let error = rendered.pixels.iter().map(|p| (p.mean(0).x - 1.0).powi(2)).sum::<f64>() / 64.0;
        (bandwidth2 / f64::from(radius * radius), error.sqrt())
    };
    let (mut last_radius2, mut last_error) = (1.0, f64::INFINITY);
    for n in [1, 8, 64, 512] {
        let (bandwidth2, error) = at(n);
        // The first iteration keeps the share alpha of its photons and of its area. Later ones follow the memoryless
        // product.
        let expected = alpha * bandwidth2_factor(n, alpha);
        println!("{n} iterations: squared radius {bandwidth2:.4}, expected {expected:.4}, error {error:.4}");
        assert!((bandwidth2 / expected - 1.0).abs() < 0.05, "{n} iterations: {bandwidth2}, {expected}");
        assert!((bandwidth2 / bandwidth2_factor(n, alpha) - 1.0).abs() > 0.05, "the memoryless rule is not detected");
        assert!(bandwidth2 < last_radius2 && error < last_error);
        (last_radius2, last_error) = (bandwidth2, error);
    }
}
