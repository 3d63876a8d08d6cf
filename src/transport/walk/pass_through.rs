//! Pass-through lights: lights that rays do not hit, as the area lights of Cycles and Blender.
//!
//! On each of its segments a camera path adds the light of the pass-through lights there, and continues to the surface
//! behind. Light paths start from them, and next-event estimation samples them, as any other light. Shadow rays and
//! light paths do not hit them. So all techniques sample the same paths with the same densities.
//!
//! Path tracing finds lights with shadow linking ([`crate::light::LightLinks`]) in the same way, with shadow rays that
//! only the objects block that block their light, as Cycles does. Segments from the camera see them as other lights.

use super::Segment;
use super::segment::{Destination, ShadowRay, Start, Visibility, shadow_ray, with_blockers};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::medium::FlightDensity;
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::scene::contact::ContactPoint;
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
/// transmittance up to it, and the densities of flight. Media attenuate its light; no collision is sampled. If
/// `linked`, lights with shadow linking are among them, at any distance; otherwise they are as other lights.
#[inline]
pub(in crate::transport) fn for_each_pass_through_light(
    scene: &Scene,
    start: &Start,
    reach: f32,
    from_medium: bool,
    linked: bool,
    mut each: impl FnMut(&Surface, f32, Rgb, FlightDensity),
) {
    if let Some(pass_through_lights) = &scene.pass_through_lights {
        let Start { origin, direction, token, .. } = *start;
        let linked = linked && scene.survey.shadow_links;
        let mut met = |hit: Hit| {
            let links = scene.lights.links();
            let is_linked = linked && !links.blockers_of(hit.instance).is_all();
            if !is_linked && (hit.t > reach || !scene.passes(hit.instance)) {
                return;
            }
            let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
            if is_linked {
                if let Some(Visibility { transmittance, flight }) =
                    linked_light(scene, start, from_medium, &surface, hit.t)
                {
                    each(&surface, hit.t, transmittance, flight);
                }
                return;
            }
            let visibility = follow(scene, *start, hit.t, None, from_medium);
            if visibility.transmittance != Rgb::ZERO {
                each(&surface, hit.t, visibility.transmittance, visibility.flight);
            }
        };
        pass_through_lights
            .each_hit(&Ray { origin, direction, tmax: if linked { f32::INFINITY } else { reach }, token }, &mut met);
    }
}

/// The shadow ray from the start of a segment to the point at the distance `t` on a light with shadow linking; `None`
/// if it is blocked.
#[cold]
fn linked_light(scene: &Scene, start: &Start, from_medium: bool, surface: &Surface, t: f32) -> Option<Visibility> {
    let light = scene.lights.surface_light(surface)?;
    // As next-event estimation, so that both techniques agree whether the point is visible.
    let target = surface.shadow_end(-start.direction, t);
    let to = target - start.origin;
    let tmax = to.length();
    let token = with_blockers(scene, start.token, light);
    let start = Start { direction: to / tmax, token, ..*start };
    let visibility = follow(scene, start, tmax, ContactPoint::on_light(scene, light, target), from_medium);
    (visibility.transmittance != Rgb::ZERO).then_some(visibility)
}

/// The shadow ray along a segment to a light at infinity; only the objects block it that block the light.
pub(in crate::transport) fn to_infinity(scene: &Scene, segment: &Segment<'_>, light: u32) -> Visibility {
    let token = with_blockers(scene, segment.start.token, light);
    follow(scene, Start { token, ..*segment.start }, f32::INFINITY, None, segment.from_medium)
}

/// Follows the shadow ray of a camera path's segment to a light at the distance `tmax`.
#[inline]
fn follow(scene: &Scene, start: Start, tmax: f32, reaching: Option<ContactPoint>, from_medium: bool) -> Visibility {
    let (in_medium, destination) = ([from_medium, false], Destination::Any);
    shadow_ray(scene, &ShadowRay { start, tmax, reaching, in_medium, destination, to_lens: false })
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

/// Which bulbs a ray sees.
pub(in crate::transport) struct BulbView {
    /// Distance up to which the ray sees bulbs.
    pub reach: f32,
    /// Whether the ray starts at a vertex in a medium.
    pub from_medium: bool,
    /// Whether the ray starts at the camera.
    pub camera: bool,
    /// Whether bulbs of lights with shadow linking are seen at any distance, through objects that do not block their
    /// light.
    pub linked: bool,
}

/// Calls `each` with every bulb on a ray: the radiance that arrives at the origin, a point in the bulb, and the index
/// of its light.
pub(in crate::transport) fn for_each_bulb(
    scene: &Scene,
    start: &Start,
    view: &BulbView,
    draws: Draws,
    mut each: impl FnMut(Rgb, Vec3, u32),
) {
    // Media attenuate the light of the bulb's points differently.
    let u = if scene.survey.media { draws.one(Purpose::Bulb) } else { 0.5 };
    let BulbView { from_medium, camera, .. } = *view;
    let is_linked = |light| view.linked && !scene.lights.blockers(light).is_all();
    let reach = |light| if is_linked(light) { f32::INFINITY } else { view.reach };
    scene.lights.for_each_bulb(start.origin, start.direction, reach, camera, u, |radiance, distance, emitter| {
        let token = if is_linked(emitter) { with_blockers(scene, start.token, emitter) } else { start.token };
        let seen = follow(scene, Start { token, ..*start }, distance, None, from_medium);
        let light = radiance * seen.transmittance;
        if light != Rgb::ZERO {
            each(light, start.origin + start.direction * distance, emitter);
        }
    });
}
