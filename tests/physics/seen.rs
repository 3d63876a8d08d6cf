//! Holdouts, and backgrounds that cameras see instead of the environment, by all methods.

use crate::support;

use caustique::estimator::Coverage;
use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::{Control, Levels, Method, Rendered, Settings, render};
use caustique::scene::Description;
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, quad, sphere, square};

const SIZE: u32 = 12;

fn uniform(color: Rgb) -> Option<EnvironmentDescription> {
    let source = EnvironmentSource::Color(color);
    Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 })
}

/// A white floor and a mirror behind it under a white sky. The camera, which looks over the floor at the mirror, sees a
/// blue sky. A ball hangs before the mirror.
fn outdoors(holdout: bool) -> Description {
    let (environment, background) = (uniform(Rgb::ONE), uniform(Rgb::new(0.0, 0.0, 3.0)));
    let mut description = Description { environment, background, ..Description::default() };
    add(&mut description, "floor", quad(Vec3::new(-4.0, 0.0, 2.0), Vec3::X * 8.0, Vec3::Z * -4.0), matte(0.5, 0.0));
    add(&mut description, "mirror", quad(Vec3::new(-1.0, 0.2, -2.0), Vec3::X * 2.0, Vec3::Y * 1.0), mirror());
    add(&mut description, "ball", sphere(Vec3::new(0.0, 0.7, -0.5), 0.4, 24), matte(0.5, 0.0));
    description.instances.last_mut().expect("the instance was added").holdout = holdout;
    description.cameras.push(look_at(DVec3::new(0.0, 0.9, 3.0), DVec3::new(0.0, 0.8, 0.0), 50.0));
    description
}

fn picture(description: Description, method: Method) -> Rendered {
    let scene = build(description);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let settings = Settings { method, levels: Levels::new(1), iterations: Some(16), ..Settings::default() };
    render(&scene, &camera, &settings, |_, _| Control::Continue)
}

#[test]
fn cameras_see_the_background_and_mirrors_the_environment_by_all_methods() {
    // Rows from the top: the sky, then the mirror, which reflects the sky above the camera.
    let [sky, mirrored] = [(1, 1), (6, 5)].map(|(x, y)| y * SIZE as usize + x);
    for method in Method::ALL.iter().copied().filter(|&method| method != Method::Light) {
        let mut open = outdoors(false);
        open.instances.pop();
        let pixels = picture(open, method).pixels;
        assert_eq!(pixels[sky].mean(0), DVec3::new(0.0, 0.0, 3.0), "{method:?}");
        let reflected = pixels[mirrored].mean(0);
        assert!(reflected.x > 0.0 && (reflected.z - reflected.x).abs() < 1e-3 * reflected.x, "{method:?}: {reflected}");
        let floor: DVec3 = pixels[(SIZE * SIZE - SIZE) as usize..].iter().map(|pixel| pixel.mean(0)).sum();
        assert!((floor.z / floor.x - 1.0).abs() < 1e-3 && floor.x > 0.0, "the background lights the floor: {method:?}");
    }
}

/// A holdout is black without coverage where the camera sees it, and mirrors and other surfaces see it as any other
/// object.
#[test]
fn holdouts_are_black_and_light_others_by_all_methods() {
    let middle = (6 * SIZE + 6) as usize;
    let around = [5, 6].map(|y| [5, 6].map(|x| (y * SIZE + x) as usize)).concat();
    for &method in Method::ALL {
        let [plain, holdout] = [false, true].map(|holdout| picture(outdoors(holdout), method).pixels);
        assert_eq!(holdout[middle].mean(0), DVec3::ZERO, "{method:?}");
        if matches!(method, Method::Mlt | Method::Light) {
            continue;
        }
        assert!(around.iter().any(|&pixel| plain[pixel].mean(0).x > 0.0), "{method:?}");
        let covered = [&plain, &holdout].map(|pixels| pixels[middle].coverage.hit_fraction());
        assert_eq!(covered, [1.0, 0.0], "{method:?}");
        let holes = [&plain, &holdout].map(|pixels| pixels[middle].coverage.hole_fraction());
        assert_eq!(holes, [0.0, 1.0], "{method:?}");
        let row = 11 * SIZE as usize;
        let [a, b] = [&plain, &holdout].map(|of| of[row..].iter().map(|pixel| pixel.mean(0).x).sum::<f64>());
        assert!((a / b - 1.0).abs() < 0.05, "{method:?}: the floor is {a} and {b}");
    }
}

/// Smoke before a holdout covers pixels with the probability that it stops a ray, by all methods.
#[test]
fn smoke_covers_before_holdouts() {
    let mut description = Description { environment: uniform(Rgb::ONE), ..Description::default() };
    let behind = quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0);
    add(&mut description, "holdout", behind, matte(0.0, 0.0));
    description.instances.last_mut().expect("the instance was added").holdout = true;
    let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(0.7), g: 0.0 };
    let smoke = Material { medium: Some(medium), ..glass(1.0) };
    add(&mut description, "smoke", cuboid(Vec3::new(-2.0, -2.0, 1.0), Vec3::new(2.0, 2.0, 2.0), false), smoke);
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, 8.0));
    let opacity = 1.0 - (-0.7f32).exp();
    for method in Method::ALL.iter().copied().filter(|method| !matches!(method, Method::Mlt | Method::Light)) {
        let pixels = picture(description.clone(), method).pixels;
        let mean = |of: fn(&Coverage) -> f32| {
            pixels.iter().map(|pixel| of(&pixel.coverage)).sum::<f32>() / pixels.len() as f32
        };
        let (hit, hole) = (mean(Coverage::hit_fraction), mean(Coverage::hole_fraction));
        // Five standard errors of a coin thrown 2,304 times.
        assert!((hit - opacity).abs() < 0.052 && (hit + hole - 1.0).abs() < 1e-3, "{method:?}: {hit}, {hole}");
    }
}
