//! Closed forms: what the estimators must give, known without rendering.

mod support;

use caustique::estimator::InitialBandwidth;
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, Levels, Settings, sppm};
use caustique::scene::Description;
use support::scenes::{add, build, cuboid, look_at, matte, point_light, quad, square};
use support::stats::{t_critical, t_statistic};

/// Means over the picture of level `level` from independent renders, one a seed.
fn means(description: &Description, settings: &Settings, size: u32, level: usize, seeds: u64) -> Vec<f64> {
    let scene = build(description.clone());
    let camera = scene.camera(&square(size)).expect("a camera");
    (0..seeds)
        .map(|seed| {
            let settings = Settings { seed, ..settings.clone() };
            let rendered = sppm(&scene, &camera, &settings, |_, _| Control::Continue);
            assert_eq!(rendered.rejected(), 0);
            rendered.pixels.iter().map(|p| p.levels[level].mean.x).sum::<f64>() / rendered.pixels.len() as f64
        })
        .collect()
}

fn settings(iterations: u64, photons: u32, radius: f32) -> Settings {
    Settings {
        iterations: Some(iterations),
        photons,
        initial: InitialBandwidth::Fixed(radius),
        levels: Levels::new(5),
        ..Settings::default()
    }
}

/// A closed box whose walls give radiance e and reflect rho: everywhere and in every direction there is e / (1 - rho).
#[test]
fn furnace_box() {
    let (rho, e) = (0.7, 0.5);
    let mut description = Description::default();
    add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(rho, e));
    description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::ZERO, 70.0));
    let expected = f64::from(e / (1.0 - rho));
    for level in [0, 3] {
        // The kernel reaches around the box's edges and loses what lies on the other wall: stay small.
        let means = means(&description, &settings(24, 20_000, 0.02), 8, level, 12);
        let t = t_statistic(&means, expected);
        // Family-wise error rate 0.1 % over the two levels.
        assert!(t.abs() < t_critical(1e-3, 2, 11.0), "level {level}: t = {t}, means {means:?}, expected {expected}");
    }
}

/// Irradiance under a point light: I cos / d^2, a diffuse plane sends back rho / pi of it.
#[test]
fn point_light_over_a_plane() {
    let (rho, intensity, height) = (0.6f64, 3.0f64, 2.0f64);
    let mut description = Description::default();
    let plane = quad(Vec3::new(-50.0, 0.0, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0);
    add(&mut description, "plane", plane, matte(rho as f32, 0.0));
    description.lights.push(point_light(DVec3::new(0.0, height, 0.0), intensity as f32));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, 0.5));
    let means = means(&description, &settings(4, 100, 0.05), 4, 0, 4);
    let expected = rho / std::f64::consts::PI * intensity / (height * height);
    // The camera sees 9 mm around the foot: the closed form varies by 2e-5 there.
    assert!(means.iter().all(|m| (m / expected - 1.0).abs() < 1e-4), "{means:?} {expected}");
}
