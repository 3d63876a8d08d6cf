//! A shadow ray that ends on a triangle is not blocked by it, for any positions of its two ends.

use crate::support;

use caustique::geometry::{Mesh, offset_origin, shadow_end};
use caustique::light::Receiver;
use caustique::math::{DAffine3, DVec3, Vec2, Vec3};
use caustique::random::mix;
use caustique::scene::{Description, Scene};
use caustique::trace::Ray;
use glam::DQuat;
use support::scenes::{add_at, build, matte};

/// Uniform numbers in [0, 1), a fixed sequence.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(1);
        (mix(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A random number between two powers of ten.
    fn power(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * self.next())
    }

    fn direction(&mut self) -> DVec3 {
        let (z, turn) = (2.0 * self.next() - 1.0, std::f64::consts::TAU * self.next());
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * turn.cos(), r * turn.sin(), z)
    }
}

/// A triangle of random size and position, often around the origin, that emits from its front.
fn lone_light(uniform: &mut Uniform) -> (Scene, f64) {
    let size = uniform.power(-3.0, 3.0);
    let place = if uniform.next() < 0.3 { DVec3::ZERO } else { uniform.direction() * uniform.power(-2.0, 3.0) };
    let corners: Vec<Vec3> = (0..3).map(|_| (uniform.direction() * uniform.next().sqrt()).as_vec3()).collect();
    let mesh = Mesh { name: "light".into(), positions: corners, triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let turn = DQuat::from_axis_angle(uniform.direction(), 3.0 * uniform.next());
    let mut description = Description::default();
    let to_world = DAffine3::from_scale_rotation_translation(DVec3::splat(size), turn, place);
    add_at(&mut description, "light", mesh, matte(0.5, 1.0), to_world);
    (build(description), size)
}

/// Counts the shadow rays that the light at their end blocks: with the ends of light sampling, with the ends of
/// connections, and with an error bound that does not depend on the length of the ray.
fn blocked(scenes: u64, receivers: u64) -> ([u64; 3], u64) {
    let mut uniform = Uniform(17);
    let (mut blocked, mut all) = ([0; 3], 0);
    for _ in 0..scenes {
        let (scene, size) = lone_light(&mut uniform);
        let Some(middle) = scene.shapes.surface(0, 0, [0.3, 0.3]) else { continue };
        for _ in 0..receivers {
            let from = middle.p + (uniform.direction() * size * uniform.power(-2.0, 4.0)).as_vec3();
            let receiver = Receiver::anywhere(from);
            let u = Vec2::new(uniform.next() as f32, uniform.next() as f32);
            let Some(sample) = scene.lights.sample_direct(&scene.shapes, &scene.materials, &receiver, 0.5, u) else {
                continue;
            };
            let to = middle.p - from;
            let (back, distance) = (-to.normalize(), to.length());
            let ends = [
                sample.target.expect("a triangle has a place"),
                shadow_end(middle.p, middle.ng, back, middle.error, distance),
                offset_origin(middle.p, middle.ng, back, middle.error),
            ];
            all += 1;
            for (count, end) in blocked.iter_mut().zip(ends) {
                let to = end - from;
                let (direction, tmax) = (to / to.length(), to.length());
                *count += u64::from(scene.tracer.occluded(&Ray { origin: from, direction, tmax, token: 0 }));
            }
        }
    }
    (blocked, all)
}

#[test]
fn no_triangle_blocks_the_shadow_rays_that_end_on_it() {
    let ([sampled, connected, by_place_alone], all) = blocked(300, 200);
    println!("{sampled}, {connected}, {by_place_alone} of {all}");
    assert!(all > 20_000);
    assert_eq!((sampled, connected), (0, 0), "blocked of {all}");
    // The test detects lights that block themselves.
    assert!(by_place_alone > all / 50, "{by_place_alone} of {all}");
}
