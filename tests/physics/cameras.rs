//! Orthographic cameras connected to light paths, crop windows, and very wide views.
//!
//! Tests of agreement compare the channels of tiles, or means, over independent seeds. See `support/channels.rs` and
//! `support/stats.rs` for error rates and planted errors.

use crate::support;

use caustique::camera::Filter;
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, Levels, Method, Rendered, Settings, render};
use caustique::scene::description::Projection;
use caustique::scene::{CameraRequest, Crop, Description, Scene};
use support::channels::{SIZE, agree, seeds};
use support::scenes::{add, build, glass, lit_room, look_at, matte, mirror, point_light, quad, sphere, square};
use support::stats::{Check, mean_and_error};

fn rendered(scene: &Scene, view: &CameraRequest, (method, iterations): (Method, u64), seed: u64) -> Rendered {
    let camera = scene.camera(view).expect("a camera");
    let levels = Levels::new(1);
    let settings = Settings { method, levels, iterations: Some(iterations), seed, ..Settings::default() };
    render(scene, &camera, &settings, |_, _| Control::Continue)
}

/// A floor, a mirror that lights it and a lamp, seen at an angle.
fn at_an_angle(projection: Projection, aperture_radius: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-1.5, 0.0, 1.5), 3.0 * Vec3::X, -3.0 * Vec3::Z), matte(0.7, 0.0));
    let upright = quad(Vec3::new(-1.0, 0.0, -1.0), 2.0 * Vec3::X, 1.2 * Vec3::Y);
    add(&mut description, "mirror", upright, mirror());
    add(&mut description, "ball", sphere(Vec3::new(0.3, 0.3, 0.4), 0.3, 32), matte(0.4, 0.0));
    let lamp = quad(Vec3::new(-0.4, 1.6, -0.2), 0.8 * Vec3::X, 0.8 * Vec3::Z);
    add(&mut description, "lamp", lamp, matte(0.0, 4.0));
    let mut camera = look_at(DVec3::new(1.0, 2.5, 3.0), DVec3::new(0.0, 0.2, 0.0), 40.0);
    camera.projection = projection;
    (camera.aperture_radius, camera.focus_distance) = (aperture_radius, 4.0);
    description.cameras.push(camera);
    build(description)
}

/// Light paths connected to an orthographic camera, with and without a lens, and to a panorama agree with paths from the camera, and
/// weights sum to one.
#[test]
fn light_paths_connect_to_all_projections() {
    let parallel = Projection::Orthographic { xmag: 1.2, ymag: 1.2 };
    let panorama = Projection::Equirectangular { longitude: [-1.0, 0.7], latitude: [-0.9, 0.6] };
    let fisheye = Projection::Fisheye { fov: 2.0, equal_area: false, half_size: [0.8, 0.8] };
    for (projection, aperture_radius) in [(parallel, 0.0), (parallel, 0.3), (panorama, 0.0), (fisheye, 0.0)] {
        let scene = at_an_angle(projection, aperture_radius);
        let by = |method, iterations, count| {
            seeds(method, count, |seed| rendered(&scene, &square(SIZE), (method, iterations), seed))
        };
        let reference = by(Method::Path, 64, 8);
        for method in [Method::Bdpt, Method::Vcm, Method::Mlt] {
            agree(
                &format!("{method:?}, {projection:?}, lens {aperture_radius}"),
                &by(method, 16, 8),
                &reference,
                0.01,
                0.3,
            );
        }
    }
}

/// A caustic of a point light, which no camera path finds, is as bright for an orthographic camera as for a perspective
/// camera so far away that its rays are nearly parallel.
#[test]
fn caustics_are_as_bright_from_far_away() {
    let scene = |parallel: bool| {
        let mut description = Description::default();
        add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, 1.0), 2.0 * Vec3::X, -2.0 * Vec3::Z), matte(0.8, 0.0));
        add(&mut description, "ball", sphere(Vec3::new(0.0, 0.8, 0.0), 0.4, 48), glass(1.5));
        description.lights.push(point_light(DVec3::new(0.4, 3.0, 0.0), 20.0));
        let distance = if parallel { 4.0 } else { 60.0 };
        let target = DVec3::new(0.0, 0.0, 0.55);
        let eye = target + distance * DVec3::new(0.0, 0.8, 0.6);
        let mut camera = look_at(eye, target, 2.0 * (0.5f32 / 60.0).atan().to_degrees());
        if parallel {
            camera.projection = Projection::Orthographic { xmag: 0.5, ymag: 0.5 };
        }
        description.cameras.push(camera);
        build(description)
    };
    let caustic = |scene: &Scene, method, seed| {
        let rendered = rendered(scene, &square(16), (method, 128), seed);
        let light = rendered.pixels.iter().map(|pixel| (pixel.parts().caustic / f64::from(pixel.iterations)).x);
        light.sum::<f64>() / rendered.pixels.len() as f64
    };
    let (far, parallel) = (scene(false), scene(true));
    let from_far: Vec<f64> = (0..8).map(|seed| caustic(&far, Method::Light, seed)).collect();
    let (expected, error) = mean_and_error(&from_far);
    assert!(expected > 0.01 && error < 0.03 * expected, "{expected} +- {error}");
    for method in [Method::Light, Method::Bdpt] {
        let values: Vec<f64> = (10..18).map(|seed| caustic(&parallel, method, seed)).collect();
        Check { expected, bias: 0.05, detects: 0.35 }.run(2, &format!("{method:?}"), &values);
    }
}

/// The pixels of a crop window are those of the whole picture, to the bit, for methods without photons, any position
/// and any filter.
#[test]
fn crop_windows_have_the_pixels_of_the_whole_picture() {
    let mut description = lit_room(matte(0.6, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.2, 0.4, 0.0), 0.4, 32), glass(1.5));
    description.cameras[0].aperture_radius = 0.02;
    let scene = build(description);
    for filter in [Filter::Box(1.0), Filter::Gaussian(2.0)] {
        let whole = CameraRequest { width: Some(37), height: Some(29), filter, ..CameraRequest::default() };
        for method in [Method::Path, Method::Bdpt, Method::Light] {
            let all = rendered(&scene, &whole, (method, 3), 5);
            for [x, y, width, height] in [[16, 16, 16, 13], [5, 3, 23, 19], [36, 0, 1, 29]] {
                let view = CameraRequest { crop: Some(Crop::Pixels([x, y, width, height])), ..whole.clone() };
                let window = rendered(&scene, &view, (method, 3), 5);
                let bits = |pixel: &caustique::estimator::PixelAccumulator| {
                    let values = [pixel.mean(0), pixel.variance_of_mean(0), pixel.albedo(), pixel.parts().indirect];
                    values.map(|value| value.to_array().map(f64::to_bits))
                };
                for (index, pixel) in (0..).zip(&window.pixels) {
                    let at = (y + index / width) * 37 + x + index % width;
                    assert_eq!(bits(pixel), bits(&all.pixels[at as usize]), "{method:?}, {filter:?}, pixel {index}");
                }
            }
        }
    }
}

/// In a view of nearly 180 degrees, bandwidths follow the footprint of a pixel, not the width of the film, which is 229
/// times its distance.
#[test]
fn wide_views_keep_their_light() {
    let mut description = lit_room(matte(0.5, 0.0));
    description.cameras[0].projection = Projection::Perspective { yfov: 179f32.to_radians(), aspect: Some(1.0) };
    let scene = build(description);
    assert!(scene.camera(&square(32)).expect("a camera").span().0 <= std::f32::consts::PI);
    let mean = |method, iterations, seed| {
        let rendered = rendered(&scene, &square(32), (method, iterations), seed);
        rendered.pixels.iter().map(|pixel| pixel.mean(0).x).sum::<f64>() / rendered.pixels.len() as f64
    };
    let by_paths: Vec<f64> = (0..6).map(|seed| mean(Method::Path, 32, seed)).collect();
    let (expected, error) = mean_and_error(&by_paths);
    assert!(error < 0.01 * expected, "{expected} +- {error}");
    let values: Vec<f64> = (10..16).map(|seed| mean(Method::Vcm, 8, seed)).collect();
    Check { expected, bias: 0.03, detects: 0.12 }.run(1, "vcm, 179 degrees", &values);
}
