//! What glows without a body: lamps that light passes as if they were not there, as area lamps of Cycles and Blender.
//!
//! Camera paths alone ask for them, on each of their segments: what they emit is added, and the path goes on to what is
//! behind. Light paths start from them and next-event estimation samples them as any other lamp; shadow rays and light
//! paths do not meet them. So all strategies see the same paths, with the same densities.

use super::segment::{Between, Start, shadow_ray};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::medium::FlightDensity;
use crate::scene::Scene;
use crate::trace::{Hit, Ray};

/// A lamp without a body on a segment of a camera path.
pub struct PassThroughHit {
    /// Where it is met.
    pub surface: Surface,
    /// Unit direction back along the path.
    pub wo: Vec3,
    /// Weight of the path up to here.
    pub throughput: Rgb,
    /// Number of segments up to here.
    pub depth: u32,
    /// Length of the segment up to here.
    pub distance: f32,
    /// Densities of the flight up to here.
    pub flight: FlightDensity,
}

/// Calls `each` with every lamp without a body that a ray meets within `reach`, how far it is, what is left of its
/// light and the densities of flight. Whether a medium scatters a walk on the way is not drawn: light comes attenuated.
#[inline]
pub(super) fn for_each_pass_through_light(
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
            let between = Between { start: *start, tmax: hit.t, reaching: None, in_medium: [from_medium, false] };
            let way = shadow_ray(scene, &between);
            if way.left != Rgb::ZERO {
                each(&surface, hit.t, way.left, way.flight);
            }
        };
        pass_through_lights.each_hit(&Ray { origin, direction, tmax: reach, token }, &mut met);
    }
}
