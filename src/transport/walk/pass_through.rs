//! Pass-through lights: lights that rays do not hit, as the area lights of Cycles and Blender.
//!
//! On each of its segments a camera path adds the light of the pass-through lights there, and continues to the surface
//! behind. Light paths start from them, and next-event estimation samples them, as any other light. Shadow rays and
//! light paths do not hit them. So all techniques sample the same paths with the same densities.

use super::segment::{Destination, ShadowRay, Start, shadow_ray};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::medium::FlightDensity;
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::trace::{Hit, Ray};

/// A segment of a camera path crosses a pass-through light, which emits but does not block rays.
pub struct PassThroughHit {
    /// Point where the segment crosses the light.
    pub surface: Surface,
    /// Unit direction back along the path.
    pub wo: Vec3,
    /// Throughput of the path up to the light.
    pub throughput: Rgb,
    /// Number of path segments up to the light.
    pub depth: u32,
    /// Distance from the last vertex to the light (scene units).
    pub distance: f32,
    /// Probability densities of flight through media from the last vertex to the light.
    pub flight: FlightDensity,
}

/// Calls `each` with every pass-through light on a ray up to the distance `reach`: its surface, distance, the
/// transmittance up to it, and the densities of flight. Media attenuate its light; no collision is sampled.
#[inline]
pub(in crate::transport) fn for_each_pass_through_light(
    scene: &Scene,
    start: &Start,
    reach: f32,
    from_medium: bool,
    mut each: impl FnMut(&Surface, f32, Rgb, FlightDensity),
) {
    if let Some(pass_through_lights) = &scene.pass_through_lights {
        let Start { origin, direction, token, .. } = *start;
        let mut met = |hit: Hit| {
            let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
            let between = ShadowRay {
                start: *start,
                tmax: hit.t,
                reaching: None,
                in_medium: [from_medium, false],
                destination: Destination::Any,
                to_lens: false,
            };
            let visibility = shadow_ray(scene, &between);
            if visibility.transmittance != Rgb::ZERO {
                each(&surface, hit.t, visibility.transmittance, visibility.flight);
            }
        };
        pass_through_lights.each_hit(&Ray { origin, direction, tmax: reach, token }, &mut met);
    }
}

/// A segment of a camera path crosses the bulb of a light ([`crate::light::Bulb`]).
pub struct BulbHit {
    /// Light that reaches the camera from the bulb.
    pub light: Rgb,
    /// Index of the light that the bulb belongs to.
    pub emitter: u32,
    /// Number of path segments up to the bulb.
    pub depth: u32,
    /// A point in the bulb, on the segment.
    pub at: Vec3,
}

/// Calls `each` with every bulb on a ray up to the distance `reach`: the radiance that arrives at the origin, a point in
/// the bulb, and the index of its light. The ray starts in a medium, or at the camera.
pub(in crate::transport) fn for_each_bulb(
    scene: &Scene,
    start: &Start,
    reach: f32,
    from_medium: bool,
    camera: bool,
    draws: Draws,
    mut each: impl FnMut(Rgb, Vec3, u32),
) {
    // Media attenuate the light of the bulb's points differently.
    let u = if scene.survey.media { draws.one(Purpose::Bulb) } else { 0.5 };
    scene.lights.for_each_bulb(start.origin, start.direction, reach, camera, u, |radiance, distance, emitter| {
        let between = ShadowRay {
            start: *start,
            tmax: distance,
            reaching: None,
            in_medium: [from_medium, false],
            destination: Destination::Any,
            to_lens: false,
        };
        let light = radiance * shadow_ray(scene, &between).transmittance;
        if light != Rgb::ZERO {
            each(light, start.origin + start.direction * distance, emitter);
        }
    });
}
