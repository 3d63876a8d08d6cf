//! Shadow catchers: alpha is the share of light that other objects take away, and colour is the light of other objects.
//!
//! Checks are t tests over independent seeds at an error rate of 0.1 %; an error of 0.05 in alpha must be rejected.

use crate::support;

use caustique::material::Material;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::pipeline::check::check_settings;
use caustique::render::output::layer_shape;
use caustique::render::{Control, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use std::path::Path;
use support::scenes::{add, build, cuboid, look_at, matte, mirror, quad, square};
use support::stats::{mean_and_error, t_critical};

const SEEDS: u64 = 8;

/// Means over the picture of red, green, blue and alpha, one for each seed.
fn pictures(scene: &Scene) -> [Vec<f64>; 4] {
    let camera = scene.camera(&square(8)).expect("a camera");
    let mut means: [Vec<f64>; 4] = Default::default();
    for seed in 1..=SEEDS {
        let settings = Settings { method: Method::Path, seed, iterations: Some(64), ..Settings::default() };
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        let layers = rendered.layers(&layer_shape(&rendered.settings, scene), |name| name.is_empty()).expect("a layer");
        let beauty = layers.get("").expect("the picture");
        for (mean, component) in means.iter_mut().zip(["R", "G", "B", "A"]) {
            let values = &beauty.plane(component).expect("it is there").values;
            mean.push(values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64);
        }
    }
    means
}

fn check_alpha(what: &str, scene: &Scene, expected: f64) {
    let (mean, error) = mean_and_error(&pictures(scene)[3]);
    println!("{what}: {mean} +- {error}, {expected}");
    let critical = t_critical(1e-3, 1, SEEDS as f64 - 1.0);
    let passes = |expected: f64| (mean - expected).abs() <= critical * error + 2e-3;
    assert!(passes(expected), "{what}: {mean} +- {error} is not {expected}");
    assert!(!passes(expected + 0.05), "{what}: an error of 0.05 is not detected ({mean} +- {error})");
}

/// A floor that catches shadows below a square lamp. The camera sees the middle of the floor.
fn stage() -> Description {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), matte(0.5, 0.0));
    description.instances[0].shadow_catcher = true;
    add(&mut description, "lamp", quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z), matte(0.0, 5.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.3, 1.2), DVec3::ZERO, 0.5));
    description
}

/// Adds an opaque sheet just below one half of the lamp.
fn cover(description: &mut Description, catcher: bool) {
    let sheet = cuboid(Vec3::new(-2.0, 0.98, -2.0), Vec3::new(0.0, 0.99, 2.0), false);
    add(description, "sheet", sheet, matte(0.0, 0.0));
    description.instances.last_mut().expect("the sheet").shadow_catcher = catcher;
}

/// Nothing covers the lamp: the catcher is not seen. An object that covers half of it takes half of the light. A catcher
/// that covers half of it is in the photograph as well. The catcher itself has no colour.
#[test]
fn alpha_is_the_share_of_light_that_other_objects_take() {
    let mut description = stage();
    check_alpha("open", &build(description.clone()), 0.0);
    let mut by_catcher = description.clone();
    cover(&mut by_catcher, true);
    check_alpha("covered by a catcher", &build(by_catcher), 0.0);
    cover(&mut description, false);
    let covered = build(description.clone());
    check_alpha("half covered", &covered, 0.5);
    let colors = &pictures(&covered)[..3];
    assert!(colors.iter().flatten().all(|value| *value == 0.0), "{colors:?}");
    // Under a sky as well: a sheet that covers half of it.
    description.instances.truncate(1);
    description.environment =
        Some(EnvironmentDescription { source: EnvironmentSource::Color(Rgb::ONE), rotation_deg: 0.0, strength: 1.0 });
    // A wall as high as a thousand times its distance hides one half of the sky.
    let wall = cuboid(Vec3::new(-1.0, -1000.0, -1000.0), Vec3::new(-0.02, 1000.0, 1000.0), false);
    add(&mut description, "wall", wall, matte(0.0, 0.0));
    description.cameras[0] = look_at(DVec3::new(0.6, 0.3, 0.0), DVec3::ZERO, 0.2);
    check_alpha("a wall under the sky", &build(description), 0.5);
}

/// A red wall beside a catcher brings red light to it, and a mirror shows the catcher as any other object.
#[test]
fn catchers_show_the_light_of_other_objects() {
    let mut description = stage();
    let red = Material { base_color: [0.8, 0.0, 0.0, 1.0], ..matte(1.0, 0.0) };
    add(&mut description, "wall", cuboid(Vec3::new(-0.3, 0.0, -0.5), Vec3::new(-0.2, 0.4, 0.5), false), red);
    let [red, green, ..] = pictures(&build(description)).map(|means| mean_and_error(&means).0);
    assert!(red > 0.01 && green == 0.0, "{red} {green}");
    let mut description = stage();
    let glass = quad(Vec3::new(-0.5, 0.0, -0.2), Vec3::X, Vec3::Y * 0.9);
    add(&mut description, "mirror", glass, mirror());
    description.cameras[0] = look_at(DVec3::new(0.0, 0.6, 1.2), DVec3::new(0.0, 0.3, -0.2), 2.0);
    let [red, _, _, alpha] = pictures(&build(description)).map(|means| mean_and_error(&means).0);
    assert!(red > 0.05 && alpha == 1.0, "{red} {alpha}");
}

/// Methods that cannot render catchers refuse them, and name the one that can.
#[test]
fn other_methods_refuse_catchers() {
    let scene = build(stage());
    for method in [Method::Sppm, Method::Vcm, Method::Bdpt, Method::Mlt] {
        let settings = Settings { method, ..Settings::default() };
        let error = check_settings(&settings, Path::new("stage.glb"), &scene).expect_err("it is refused");
        assert!(error.cause.contains("does not render shadow catchers"), "{error}");
        assert_eq!(error.hint.as_deref(), Some("choose --method path"));
    }
    assert!(check_settings(&Settings { method: Method::Path, ..Settings::default() }, Path::new(""), &scene).is_ok());
}
