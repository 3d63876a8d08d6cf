//! Points of large triangles near the origin: their coordinates look exact, but the triangle is not.
//!
//! A diffuse plane under parallel light has the radiance reflectance / pi times irradiance times cosine everywhere,
//! without noise. Darker pixels are shaded by the plane itself.

use crate::support;

use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{Control, Levels, Method, Settings, render};
use caustique::scene::Description;
use caustique::scene::description::{PunctualKind, PunctualLight};
use glam::DQuat;
use std::f64::consts::PI;
use support::scenes::{add, build, look_at, matte, quad, square};

/// Smallest and largest pixel over the expected value, for a plane with this orientation that extends `half` to each
/// side, seen from a little above a point beside the origin.
fn extremes(half: f32, method: Method, turn: DQuat) -> (f64, f64) {
    let mut description = Description::default();
    let along = |v: DVec3| (turn * v).as_vec3() * (2.0 * half);
    let (a, b) = (along(DVec3::Z), along(DVec3::X));
    add(&mut description, "plane", quad(-0.5 * (a + b), a, b), matte(0.5, 0.0));
    let normal = turn * DVec3::Y;
    // At an angle, so that cosines matter, but well above the horizon.
    let light = (normal + turn * DVec3::new(0.3, 0.0, 0.2)).normalize();
    description.lights.push(PunctualLight {
        name: "sun".into(),
        to_world: DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Z, light)),
        intensity: Rgb::splat(3.0),
        kind: PunctualKind::Sun { angle: 0.0 },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    });
    let at = turn * DVec3::new(0.013, 0.0, -0.007);
    description.cameras.push(look_at(at + normal * 0.4 + turn * DVec3::new(0.1, 0.0, 0.05), at, 50.0));
    let scene = build(description);
    let camera = scene.camera(&square(16)).expect("a camera");
    let settings =
        Settings { method, levels: Levels::new(1), iterations: Some(4), photons: 100, ..Settings::default() };
    let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
    let expected = 0.5 / PI * 3.0 * normal.dot(light);
    let values = rendered.pixels.iter().map(|pixel| pixel.mean(0).x / expected);
    values.fold((f64::INFINITY, 0.0), |(least, largest), value| (least.min(value), largest.max(value)))
}

#[test]
fn a_large_tilted_plane_does_not_shade_itself() {
    for half in [1.0, 10.0, 1000.0] {
        for (i, angle) in [0.0, 0.4, 0.9, 1.3, 2.2].into_iter().enumerate() {
            let turn = DQuat::from_rotation_x(angle) * DQuat::from_rotation_z(0.7 * angle + 0.1 * i as f64);
            for method in [Method::Path, Method::Sppm] {
                let (least, largest) = extremes(half, method, turn);
                assert!(
                    least > 0.999 && largest < 1.001,
                    "{half} m, turned by {angle}, {method:?}: from {least} to {largest} of what it should be"
                );
            }
        }
    }
}

/// A small square in the sun just above a wide floor casts its whole shadow: rays start off the floor by the error of
/// its height, not by that of its corners.
#[test]
fn a_small_shadow_on_a_wide_floor_is_whole() {
    for half in [1.0, 100.0, 1e4] {
        let mut description = Description::default();
        let floor =
            quad(DVec3::new(-half, 0.0, -half).as_vec3(), Vec3::Z * 2.0 * half as f32, Vec3::X * 2.0 * half as f32);
        add(&mut description, "floor", floor, matte(0.5, 0.0));
        let shade = quad(Vec3::new(-0.02, 1e-3, -0.02), Vec3::Z * 0.04, Vec3::X * 0.04);
        add(&mut description, "shade", shade, matte(0.0, 0.0));
        description.lights.push(PunctualLight {
            name: "sun".into(),
            to_world: DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Z, DVec3::new(0.3, 1.0, 0.0).normalize())),
            intensity: Rgb::splat(3.0),
            kind: PunctualKind::Sun { angle: 0.0 },
            pattern: None,
            pass_through: false,
            bulb: false,
            radius: 0.0,
            hidden_from_camera: false,
            light_group: None,
            links: None,
        });
        // From below the square, where all of the visible floor is in its shadow.
        description.cameras.push(look_at(DVec3::new(0.0, 5e-4, 0.03), DVec3::new(0.0, 0.0, 0.005), 0.5));
        let scene = build(description);
        let camera = scene.camera(&square(8)).expect("a camera");
        for method in [Method::Path, Method::Bdpt, Method::Sppm] {
            let settings = Settings { method, iterations: Some(2), photons: 100, ..Settings::default() };
            let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
            let lit = rendered.pixels.iter().filter(|pixel| pixel.mean(0).x > 0.0).count();
            assert_eq!(lit, 0, "{half} m, {method:?}: pixels of the shadow that are lit");
        }
    }
}
