//! Infinite media without absorption, in which paths end only by Russian roulette.

use crate::support;

use caustique::material::MediumParameters;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::{Control, Levels, Method, Settings, photons_per_path, render};
use caustique::scene::{Description, Scene};
use support::channels::SIZE;
use support::scenes::{add, build, look_at, matte, point_light, quad, square};
use support::stats::Check;

/// A floor under a point light in an infinite medium; with `far`, an object is many mean free paths away.
fn foggy(far: bool) -> Scene {
    let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::ONE, g: 0.0 };
    let mut description = Description { medium: Some(medium), ..Description::default() };
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, 1.0), 2.0 * Vec3::X, -2.0 * Vec3::Z), matte(0.5, 0.0));
    if far {
        add(&mut description, "far", quad(Vec3::splat(300.0), 0.1 * Vec3::X, 0.1 * Vec3::Z), matte(0.5, 0.0));
    }
    description.lights.push(point_light(DVec3::new(0.5, 1.0, 0.0), 5.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 3.0), DVec3::ZERO, 50.0));
    build(description)
}

/// Light paths store some dozens of photons instead of thousands, and camera paths end as early.
#[test]
fn paths_far_from_all_objects_end() {
    let scene = foggy(false);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let photons = photons_per_path(&scene, &camera, &Settings { method: Method::Bpm, ..Settings::default() });
    let gathered = photons_per_path(&scene, &camera, &Settings::default());
    println!("photons of a path: {photons} on surfaces, {gathered} in all");
    assert!(gathered > 1.0 && gathered < 100.0, "{gathered}");
}

/// A far object makes the scene so wide that hardly any path leaves it, so there is no roulette, and the mean is the
/// same. Both renders have the same random numbers, so their noise is similar, too.
#[test]
fn roulette_does_not_change_the_mean() {
    let (near, far) = (foggy(false), foggy(true));
    let mean = |scene: &Scene, seed| {
        let camera = scene.camera(&square(SIZE)).expect("a camera");
        let (method, levels) = (Method::Path, Levels::new(1));
        let settings = Settings { method, levels, iterations: Some(32), max_depth: 40, seed, ..Settings::default() };
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        rendered.pixels.iter().map(|pixel| pixel.mean(0).x).sum::<f64>()
    };
    let ratios: Vec<f64> = (0..8).map(|seed| mean(&near, seed) / mean(&far, seed)).collect();
    assert!(ratios.iter().any(|ratio| *ratio != 1.0), "there was no roulette");
    Check { expected: 1.0, bias: 0.0, detects: 0.05 }.run(1, "open space", &ratios);
}
