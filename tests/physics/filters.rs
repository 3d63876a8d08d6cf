//! Pixel filters: camera paths and light paths are weighted by the same function.
//!
//! A strip of a plane is lit, with a straight edge along the columns of the picture. The mean of a column is the share
//! of the filter on the lit side. T tests over columns at a family-wise error rate of 0.1 % (Sidak). A box filter in
//! place of another filter must be rejected.

use crate::support;

use caustique::camera::Filter;
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{Control, Levels, Method, Settings, render};
use caustique::scene::description::{PunctualKind, PunctualLight};
use caustique::scene::{CameraRequest, Description, Scene};
use glam::DQuat;
use std::f64::consts::PI;
use support::scenes::{add, build, look_at, matte, quad, square};
use support::stats::{ERROR_RATE, mean_and_error, t_critical};

const SIDE: u32 = 16;
const SEEDS: u64 = 10;

/// The plane is seen from above. A pixel is `WIDTH / SIDE` wide, and the lit part begins at `EDGE` pixels from the
/// left.
const WIDTH: f32 = 2.0;
const EDGE: f32 = 7.3;

fn strip() -> Scene {
    let mut description = Description::default();
    let left = (EDGE / SIDE as f32 - 0.5) * WIDTH;
    // The right of the camera is -x.
    let lit = quad(Vec3::new(-left - 4.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 4.0);
    add(&mut description, "strip", lit, matte(0.5, 0.0));
    description.lights.push(PunctualLight {
        name: "sun".into(),
        to_world: DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::NEG_Y)),
        intensity: Rgb::splat(PI as f32 / 0.5),
        kind: PunctualKind::Sun { angle: 0.0 },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    });
    let fov = 2.0 * (f64::from(WIDTH) / 2.0 / 10.0).atan().to_degrees();
    description.cameras.push(look_at(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO, fov as f32));
    build(description)
}

/// Means of the columns, one list per seed.
fn columns(scene: &Scene, method: Method, filter: Filter) -> Vec<Vec<f64>> {
    let camera = scene.camera(&CameraRequest { filter, ..square(SIDE) }).expect("a camera");
    (0..SEEDS)
        .map(|seed| {
            let settings =
                Settings { method, seed, levels: Levels::new(1), iterations: Some(64), ..Settings::default() };
            let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
            let of = |x: u32| (0..SIDE).map(move |y| (y * SIDE + x) as usize);
            let value = |index: usize| rendered.pixels[index].mean(0).x;
            (0..SIDE).map(|x| of(x).map(value).sum::<f64>() / f64::from(SIDE)).collect()
        })
        .collect()
}

/// Share of the filter of column `x` on the lit side.
fn expected(filter: Filter, x: u32) -> f64 {
    let radius = filter.radius();
    let steps = 4000;
    let step = 2.0 * radius / steps as f32;
    let at = |i: usize| -radius + (i as f32 + 0.5) * step;
    let lit = |d: &f32| x as f32 + 0.5 + d > EDGE;
    (0..steps).map(at).filter(lit).map(|d| f64::from(filter.density(d) * step)).sum()
}

/// The columns whose mean is not the share of the filter.
fn wrong(found: &[Vec<f64>], filter: Filter) -> Vec<String> {
    let critical = t_critical(ERROR_RATE, SIDE as usize, SEEDS as f64 - 1.0);
    let fault = |x: u32| {
        let (mean, error) = mean_and_error(&found.iter().map(|columns| columns[x as usize]).collect::<Vec<_>>());
        let expected = expected(filter, x);
        ((mean - expected).abs() > critical * error + 2e-3)
            .then(|| format!("column {x}: {mean:.4} +- {error:.4}, {expected:.4}"))
    };
    (0..SIDE).filter_map(fault).collect()
}

#[test]
fn camera_paths_and_light_paths_are_weighted_by_the_filter() {
    let scene = strip();
    for filter in [Filter::Box(1.0), Filter::Box(3.0), Filter::Gaussian(3.0), Filter::BlackmanHarris(3.0)] {
        for method in [Method::Path, Method::Light, Method::Bdpt] {
            let found = columns(&scene, method, filter);
            let faults = wrong(&found, filter);
            assert!(faults.is_empty(), "{filter:?}, {method:?}: {faults:#?}");
            let other = if filter == Filter::Box(1.0) { Filter::Box(3.0) } else { Filter::Box(1.0) };
            assert!(!wrong(&found, other).is_empty(), "{filter:?}, {method:?}: {other:?} is not detected");
        }
    }
}
