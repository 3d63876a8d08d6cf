//! Renders that stop at an estimated error, and other stop conditions.

use crate::support;

use caustique::film::{Layer, LayerSet};
use caustique::image::{Floor, metrics};
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, Levels, Method, RenderInput, Rendered, Session, Settings, StopReason, render};
use caustique::scene::{Description, Scene};
use caustique::stop::Stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use support::scenes::{add, build, cuboid, glass, look_at, matte, point_light, quad, sphere, square};

const SIZE: u32 = 16;

fn rendered(scene: &Scene, settings: &Settings) -> Rendered {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    render(scene, &camera, settings, |_, _| Control::Continue)
}

/// A floor under a point lamp and an emissive panel, both `scale` times as bright.
fn lit(scale: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-2.0, 0.0, 2.0), 4.0 * Vec3::X, -4.0 * Vec3::Z), matte(0.5, 0.0));
    let wall = quad(Vec3::new(-2.0, 0.0, -2.0), 4.0 * Vec3::X, 3.0 * Vec3::Y);
    add(&mut description, "wall", wall, matte(0.7, 0.0));
    let panel = quad(Vec3::new(-0.5, 1.9, -0.5), Vec3::X, Vec3::Z);
    add(&mut description, "panel", panel, matte(0.0, 2.0 * scale));
    description.lights.push(point_light(DVec3::new(1.0, 1.5, 0.5), 3.0 * scale));
    description.cameras.push(look_at(DVec3::new(0.2, 1.4, 4.5), DVec3::new(0.0, 0.6, 0.0), 50.0));
    build(description)
}

/// With lamps a thousandth or a thousand times as bright, all methods have the same error after the same number of
/// iterations.
#[test]
fn errors_do_not_depend_on_the_unit_of_radiance() {
    let scenes = [1.0, 1.0 / 1024.0, 1024.0].map(lit);
    for method in [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm, Method::Cppm] {
        let settings =
            Settings { method, photons: 3000, iterations: Some(400), target_error: Some(0.12), ..Settings::default() };
        let all = scenes.each_ref().map(|scene| rendered(scene, &settings));
        let error = |rendered: &Rendered| rendered.error.relative().expect("light is seen");
        let own = error(&all[0]);
        assert_eq!(all[0].stop, StopReason::Error, "{method:?}: {own}");
        for (other, of) in all[1..].iter().zip(["dark", "bright"]) {
            assert_eq!(
                (other.stop, other.stats.iterations),
                (StopReason::Error, all[0].stats.iterations),
                "{method:?} {of}"
            );
            assert!((error(other) / own - 1.0).abs() < 1e-6, "{method:?} {of}: {} {own}", error(other));
        }
        println!("{method:?}: {} iterations, {own}", all[0].stats.iterations);
    }
}

/// No camera path finds a point lamp in a glass ball: the picture stays black, and its error is unknown.
#[test]
fn a_black_picture_is_not_finished() {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-2.0, 0.0, 2.0), 4.0 * Vec3::X, -4.0 * Vec3::Z), matte(0.5, 0.0));
    add(&mut description, "bulb", sphere(Vec3::Y, 0.2, 16), glass(1.5));
    description.lights.push(point_light(DVec3::Y, 5.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 3.0), DVec3::ZERO, 50.0));
    let scene = build(description);
    let settings =
        Settings { method: Method::Path, iterations: Some(40), target_error: Some(0.9), ..Settings::default() };
    let dark = rendered(&scene, &settings);
    assert!(dark.pixels.iter().all(|pixel| pixel.mean(0) == DVec3::ZERO));
    assert_eq!((dark.stop, dark.stats.iterations, dark.error.relative()), (StopReason::Iterations, 40, None));
    // Photons find the light.
    let seen = rendered(&scene, &Settings { method: Method::Sppm, photons: 3000, ..settings });
    assert!(seen.error.relative().is_some());
    assert_eq!(seen.stop, StopReason::Error);
}

/// A picture without noise ends after two iterations per quarter, and so does the black picture of a scene without
/// lights.
#[test]
fn renders_have_a_minimum_number_of_iterations() {
    for emission in [1.0, 0.0] {
        let mut description = Description::default();
        add(&mut description, "box", cuboid(Vec3::splat(-1.0), Vec3::ONE, true), matte(0.0, emission));
        description.cameras.push(look_at(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.0, 0.0, 1.0), 40.0));
        let settings = Settings {
            method: Method::Path,
            levels: Levels::new(1),
            iterations: Some(40),
            target_error: Some(0.01),
            ..Settings::default()
        };
        let rendered = rendered(&build(description), &settings);
        assert_eq!((rendered.stop, rendered.stats.iterations), (StopReason::Error, 8), "{emission}");
    }
}

/// A picture that is off by a tenth everywhere has the error 0.01 / 1.01 with the floor of the reference's mean, for
/// any unit of radiance. The relMSE of the papers depends on the unit.
#[test]
fn comparisons_above_a_relative_floor() {
    let layers = |value: f32| {
        let mut set = LayerSet::new(20, 10);
        set.layers.push(Layer::interleaved("", "RGB", vec![[value; 3]; 200]));
        set
    };
    for scale in [1.0f32 / 1024.0, 1.0, 1024.0] {
        let (a, b) = (layers(1.125 * scale), layers(scale));
        let relative = metrics::compare_with_floor(&a, &b, Floor::Relative).expect("sizes agree");
        assert!((relative.relmse - 0.015625 / 1.01).abs() < 1e-12, "{relative:?}");
        let papers = metrics::compare_with_floor(&a, &b, Floor::Papers).expect("sizes agree");
        let square = f64::from(scale).powi(2);
        assert!((papers.relmse - 0.015625 * square / (square + 0.01)).abs() < 1e-9 * papers.relmse, "{papers:?}");
    }
}

/// An aborted iteration of any method has no effect: the render continues from the finished iterations, to the bits of
/// an undisturbed render.
#[test]
fn iterations_are_aborted_as_a_whole() {
    let scene = lit(1.0);
    let camera = scene.camera(&square(48)).expect("a camera");
    let mut aborted = 0;
    for &method in Method::ALL {
        let levels = if method.has_levels() { Levels::decorrelated(3) } else { Levels::new(1) };
        let photons = 3000;
        let settings = Settings { method, levels, photons, iterations: Some(3), ..Settings::default() };
        let stage = RenderInput::new(&scene, &camera, &settings);
        let undisturbed = rendered_by(&stage, |_| {});
        let disturbed = rendered_by(&stage, |session| {
            let mut seconds = 2e-4;
            while !session.step_within(Some(seconds)) {
                (aborted, seconds) = (aborted + 1, 2.0 * seconds);
                assert_eq!(session.iterations(), 1, "{method:?}");
            }
        });
        assert_eq!(disturbed.stats.iterations, 3);
        for (a, b) in undisturbed.pixels.iter().zip(&disturbed.pixels) {
            assert_eq!(format!("{a:?}"), format!("{b:?}"), "{method:?}");
        }
    }
    assert!(aborted > 11, "hardly an iteration was given up: {aborted}");
}

/// Renders three iterations and calls `between` after the first.
fn rendered_by<'a>(stage: &'a RenderInput<'a>, between: impl FnOnce(&mut Session<'a>)) -> Rendered {
    let mut session = Session::new(stage);
    session.step();
    between(&mut session);
    while !session.is_finished() {
        session.step();
    }
    session.finish(StopReason::Iterations)
}

/// The deadline does not end the first iteration, but a stop request does.
#[test]
fn only_a_request_ends_the_first_iteration() {
    let scene = lit(1.0);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let asked = Arc::new(AtomicBool::new(false));
    let settings = Settings {
        method: Method::Bdpt,
        time: Some(1e-9),
        stop: Stop::from_flag(asked.clone()),
        ..Settings::default()
    };
    let ends = |expected: (u64, StopReason)| {
        let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
        assert_eq!((rendered.stats.iterations, rendered.stop), expected);
    };
    ends((1, StopReason::Time));
    asked.store(true, Ordering::Relaxed);
    ends((0, StopReason::Interrupted));
}
