//! Every light path is in one class, every class has one owner, and an effect that is switched off is missing from the
//! picture and nothing else is: tested on random paths and in pictures.

use crate::support;

mod owners;
mod switches;

use caustique::material::Material;
use caustique::math::{DVec3, Vec3};
use caustique::scene::{Description, Scene};
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere};

/// A room with plastic, rough metal, glass and a mirror, and a lamp that paths can hit; with `point`, also a point
/// light.
fn room(point: bool) -> Scene {
    let mut room = Description::default();
    add(&mut room, "room", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true), matte(0.5, 0.0));
    add(&mut room, "lamp", quad(Vec3::new(-0.4, 1.9, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8), matte(0.0, 8.0));
    add(&mut room, "glass", sphere(Vec3::new(-0.5, 0.4, 0.2), 0.3, 48), glass(1.5));
    let metal = Material {
        base_color: [0.9, 0.7, 0.4, 1.0],
        metallic: 1.0.into(),
        roughness: 0.35.into(),
        ..Material::default()
    };
    add(&mut room, "metal", sphere(Vec3::new(0.5, 0.35, 0.4), 0.3, 48), metal);
    let plastic = Material {
        base_color: [0.2, 0.4, 0.6, 1.0],
        metallic: 0.0.into(),
        roughness: 0.3.into(),
        ..Material::default()
    };
    add(&mut room, "plastic", sphere(Vec3::new(0.05, 0.3, -0.4), 0.3, 48), plastic.clone());
    let polished = Material { roughness: 0.0.into(), ..plastic };
    add(&mut room, "polished", sphere(Vec3::new(0.0, 0.2, 0.9), 0.2, 48), polished);
    let glazing = quad(Vec3::new(-0.9, 0.3, -0.95), Vec3::X * 0.9, Vec3::Y * 0.9);
    add(&mut room, "mirror", glazing, mirror());
    if point {
        room.lights.push(point_light(DVec3::new(-0.8, 1.5, 0.8), 2.0));
    }
    room.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.6, 0.0), 55.0));
    build(room)
}
