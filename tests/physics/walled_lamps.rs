//! Rooms with lamps behind walls, where renders learn which lights arrive. Methods are compared with closed forms (t tests
//! over seeds, family-wise error rate 0.1 %), and a density that ignores what was learnt must be rejected.

use crate::many_lights::{estimates, polygon};
use crate::support;
use crate::windows::{SIZE, camera, keeps_the_mean, lowers_the_noise, mean, render_plain, settings, values};

use caustique::light::{DirectSample, Receiver};
use caustique::math::{DVec3, Vec3};
use caustique::render::{Method, Settings, learn_light};
use caustique::scene::{Description, Scene, View};
use support::render;
use support::scenes::{add, build, cuboid, look_at, matte, quad};
use support::stats::{Check, mean_and_error, t_critical};

/// Albedo of the floor.
const ALBEDO: f32 = 0.8;
/// The neighbours' lamps are brighter than that of the room which the camera sees.
const OWN: f32 = 1.0;
const NEIGHBOURS: f32 = 20.0;
/// Corner and side of the lamp of the room at the origin, in x and z (m).
const LAMP: DVec3 = DVec3::new(0.6, 0.9, -0.1);
const SIDE: f64 = 0.2;

/// A row of rooms of 2 x 1 x 2 m with a lamp below each ceiling. The camera sees the floor of the middle one.
pub fn rooms(walls: f32) -> Description {
    let mut rooms = Description::default();
    let floor = quad(Vec3::new(-9.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 18.0);
    add(&mut rooms, "floor", floor, matte(ALBEDO, 0.0));
    let wall = |low: Vec3, high: Vec3| cuboid(low, high, false);
    add(&mut rooms, "ceiling", wall(Vec3::new(-9.0, 1.0, -1.0), Vec3::new(9.0, 1.1, 1.0)), matte(walls, 0.0));
    for z in [-1.1, 1.0] {
        add(&mut rooms, "long", wall(Vec3::new(-9.0, 0.0, z), Vec3::new(9.0, 1.0, z + 0.1)), matte(walls, 0.0));
    }
    for i in -4i8..=5 {
        let x = 2.0 * f32::from(i) - 1.0;
        add(
            &mut rooms,
            "short",
            wall(Vec3::new(x - 0.01, 0.0, -1.0), Vec3::new(x + 0.01, 1.0, 1.0)),
            matte(walls, 0.0),
        );
    }
    for i in -4i8..=4 {
        let corner = LAMP.as_vec3() + Vec3::X * 2.0 * f32::from(i);
        let lamp = quad(corner, Vec3::X * SIDE as f32, Vec3::Z * SIDE as f32);
        add(&mut rooms, "lamp", lamp, matte(0.0, if i == 0 { OWN } else { NEIGHBOURS }));
    }
    let yfov = 2.0 * (0.5f32 / 0.95).atan().to_degrees();
    rooms.cameras.push(look_at(DVec3::new(0.0, 0.95, 0.0), DVec3::ZERO, yfov));
    rooms
}

/// The room's lamp, counter-clockwise as seen from the floor.
fn lamp() -> [DVec3; 4] {
    [LAMP, LAMP + DVec3::X * SIDE, LAMP + DVec3::new(SIDE, 0.0, SIDE), LAMP + DVec3::Z * SIDE]
}

/// Light that the visible part of the floor reflects between black walls.
fn expected() -> f64 {
    let center = |i: i32| (f64::from(i) + 0.5) / 32.0 - 0.5;
    let points = (0..32).flat_map(|i| (0..32).map(move |j| DVec3::new(center(i), 0.0, center(j))));
    let irradiance = points.map(|p| polygon(p, &lamp())).sum::<f64>() / 1024.0;
    irradiance * f64::from(ALBEDO * OWN) / std::f64::consts::PI
}

/// The scene with what is learnt about its lamps.
pub fn learnt(scene: &Scene) -> Scene {
    let learnt = learn_light(View::new(scene, &camera(scene)), &settings(1, 0));
    scene.with_learnt(&learnt).expect("lamps behind walls are worth learning")
}

/// The floor of a room with black walls receives the form factor of its lamp, by all methods.
#[test]
fn the_floor_of_a_black_room() {
    let scene = build(rooms(0.0));
    learnt(&scene);
    let check = Check { expected: expected(), bias: 2e-3, detects: 0.05 };
    for method in [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm] {
        // Most light paths start in other rooms.
        let settings = |seed| Settings { photons: 1 << 14, ..settings(12, seed) };
        let means: Vec<f64> = (0..8).map(|seed| mean(&render(&scene, method, SIZE, &settings(seed)))).collect();
        check.run(4, &format!("{method:?}"), &means);
    }
}

/// The irradiance of a point is that of its own lamp, and `path` has at most 0.3 of the variance of direct light. With the
/// density of the sampling without a table, the irradiance would be wrong.
#[test]
fn lamps_behind_walls_are_rarely_sampled() {
    let plain = build(rooms(0.0));
    let scene = learnt(&plain);
    let (n, points) = (20_000, 4u8);
    let critical = t_critical(1e-4, usize::from(points), n as f64);
    for k in 0..points {
        let p = DVec3::new(0.2 * f64::from(k) - 0.3, 0.0, 0.1 * f64::from(k) - 0.2);
        let receiver = Receiver { n: Vec3::Y, ..Receiver::anywhere(p.as_vec3()) };
        let visible = |x: f32| f64::from(u8::from(x.abs() < 1.0));
        let own = |light: &DirectSample| light.target.map_or(0.0, |target| visible(target.x));
        let planted = |light: &DirectSample| {
            let ratio = |of: &Scene| f64::from(of.lights.next_event_ratio(&receiver, light.light, light.wi));
            own(light) * ratio(&scene) / ratio(&plain)
        };
        let expected = f64::from(OWN) * polygon(p, &lamp());
        let (mean, error) = mean_and_error(&estimates(&scene, &receiver, n, own));
        let (wrong, wrong_error) = mean_and_error(&estimates(&scene, &receiver, n, planted));
        println!("at {p}: {mean} +- {error}, expected {expected}, planted {wrong} +- {wrong_error}");
        assert!((mean - expected).abs() < critical * error, "at {p}: {mean} +- {error}, expected {expected}");
        assert!((wrong - expected).abs() > critical * wrong_error, "at {p}: another density is not detected");
    }
    lowers_the_noise(&plain);
}

/// In rooms with grey walls, rendering with what was learnt gives the picture without.
#[test]
fn what_is_learnt_changes_the_noise_alone() {
    let grey = build(rooms(0.6));
    learnt(&grey);
    keeps_the_mean(&grey, 6, 0.2);
}

/// One lamp leaves nothing to choose, and lamps that all arrive nothing to learn: the picture keeps its bytes.
#[test]
fn open_rooms_keep_their_bytes() {
    for lamps in [1u8, 3] {
        let mut description = Description::default();
        add(
            &mut description,
            "floor",
            quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0),
            matte(0.5, 0.0),
        );
        for i in 0..lamps {
            let lamp = quad(Vec3::new(f32::from(i), 1.0, 0.0), Vec3::X * 0.2, Vec3::Z * 0.2);
            add(&mut description, "lamp", lamp, matte(0.0, 1.0));
        }
        description.cameras.push(look_at(DVec3::new(0.0, 0.9, 0.0), DVec3::ZERO, 60.0));
        let scene = build(description);
        let settings = Settings { method: Method::Path, ..settings(2, 0) };
        assert!(values(&render(&scene, Method::Path, SIZE, &settings)) == values(&render_plain(&scene, &settings)));
    }
}
