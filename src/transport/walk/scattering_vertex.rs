//! Common interface of surface and medium vertices, for next-event estimation and connections.

use super::interior::Interior;
use super::lobe_layers::FirstScatter;
use super::roulette::survival;
use super::segment::{Destination, ShadowRay, Start, Visibility, shadow_ray, token, with_blockers};
use super::vertex::{MediumVertex, Vertex};
use crate::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use crate::light::{DirectSample, Emitter, Receiver, VolumeLight};
use crate::math::{Rgb, Vec2, Vec3};
use crate::medium::HenyeyGreenstein;
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::scene::contact::{self, ContactPoint};
use crate::spectrum::Wavelength;
use crate::trace::Ray;

/// The end of a shadow ray.
#[derive(Clone, Copy)]
pub struct ShadowTarget {
    /// Position; `None`: the ray leaves the scene.
    pub p: Option<Vec3>,
    /// Whether a vertex in a medium lies there.
    pub in_medium: bool,
    /// The point on its surface, if other surfaces touch it there.
    pub reaching: Option<ContactPoint>,
    /// The solids in which the ray must arrive.
    pub destination: Destination,
}

impl ShadowTarget {
    /// A point on no surface of its own.
    fn at(p: Option<Vec3>) -> ShadowTarget {
        ShadowTarget { p, in_medium: false, reaching: None, destination: Destination::Any }
    }
}

/// A vertex of a walk, on a surface or in a medium. In a medium the cosine is 1, and the phase function counts as a
/// broad lobe.
pub trait ScatterPoint {
    /// Whether the vertex is in a medium.
    const IN_MEDIUM: bool;
    /// World position.
    fn p(&self) -> Vec3;
    /// Throughput of the path before the vertex scatters.
    fn throughput(&self) -> Rgb;
    /// Number of path segments up to the vertex.
    fn depth(&self) -> u32;
    /// Random numbers for the decisions at the vertex.
    fn draws(&self) -> Draws;
    /// The wavelength of the path; `None` if it has not met dispersive glass.
    fn wavelength(&self) -> Option<&Wavelength>;
    /// The lobes of the vertex that are not delta.
    fn smooth(&self) -> LobeSet;
    /// Value of the lobes in `set` for light from `wi` times the cosine, and the density of sampling `wi`
    /// ([`crate::bsdf::Shading::evaluate_cos`]).
    fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32);
    /// How the vertex, if it is the first one seen from the camera, scatters light between its viewing direction and `wi`,
    /// of which the lobes in `set` scatter `value` ([`ScatterPoint::evaluate_cos`]).
    fn first_scatter(&self, wi: Vec3, transport: Transport, set: LobeSet, value: Rgb) -> FirstScatter;
    /// Density of sampling `wo` if light arrives from `wi` ([`crate::bsdf::Shading::reverse_pdf`]).
    fn reverse_pdf(&self, wi: Vec3, transport: Transport) -> f32;
    /// Samples a direction from the lobes in `set` ([`crate::bsdf::Shading::sample`]); `None` if there is none.
    fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;
    /// Absolute cosine between `w` and the geometric normal; 1 in a medium.
    fn cos(&self, w: Vec3) -> f32;
    /// Origin of a ray from this vertex towards `w`: off the surface by the bound on rounding errors.
    fn ray_origin(&self, w: Vec3) -> Vec3;
    /// The solids around the path on the side of `wo`, and on the other side of the surface.
    fn interiors(&self) -> [&Interior; 2];
    /// Whether `w` points to the other side of the surface than `wo`.
    fn crosses(&self, w: Vec3) -> bool;
    /// The vertex as a receiver of direct light, for the choice of a light.
    fn receiver(&self, scene: &Scene) -> Receiver;
    /// Whether back-face culling hides the surface from a camera along `wi`.
    fn is_culled(&self, _scene: &Scene, _wi: Vec3) -> bool {
        false
    }
    /// Probability that roulette lets the path continue by the lobes in `set`, see [`Vertex::survival`].
    fn survival(&self, set: LobeSet) -> f32 {
        self.survival_chosen(set, 1.0)
    }
    /// Probability that roulette lets the path continue by the lobes in `set`, chosen with the probability `chance`, see
    /// [`Vertex::survival_chosen`].
    fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32;
    /// MIS weight (0 to 1) of next-event estimation at the vertex, see [`MediumVertex::next_event`].
    #[inline]
    fn next_event_share(&self) -> f32 {
        1.0
    }

    /// The point of the vertex on its surface, if other surfaces touch it there.
    #[inline]
    fn touching(&self) -> Option<ContactPoint> {
        None
    }

    /// Traces a shadow ray along `wi` to `target` (`None`: out of the scene).
    #[inline]
    fn shadow_ray(&self, scene: &Scene, wi: Vec3, target: Option<Vec3>, token: u32) -> Visibility {
        self.shadow_ray_to(scene, wi, token, ShadowTarget::at(target))
    }

    /// Samples a light for next-event estimation.
    #[inline]
    fn sample_light(&self, scene: &Scene) -> Option<DirectSample> {
        let draws = self.draws();
        let (choice, point) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
        scene.lights.sample_direct(&scene.shapes, &scene.materials, &self.receiver(scene), choice, point)
    }

    /// Traces a shadow ray to a light of [`ScatterPoint::sample_light`].
    #[inline]
    fn shadow_ray_to_light(&self, scene: &Scene, light: &DirectSample) -> Visibility {
        let token = with_blockers(scene, token(scene, self.draws(), Purpose::ShadowAlpha), light.light);
        let reaching = light.target.and_then(|target| ContactPoint::on_light(scene, light.light, target));
        let destination = match scene.lights.emitters().get(light.light as usize) {
            Some(Emitter::Volume(VolumeLight { instance, .. })) if scene.survey.fire => Destination::Inside(*instance),
            _ => Destination::Any,
        };
        let target = ShadowTarget { reaching, destination, ..ShadowTarget::at(light.target) };
        self.shadow_ray_to(scene, light.wi, token, target)
    }

    /// Traces a shadow ray along `wi` to its target.
    #[inline]
    fn shadow_ray_to(&self, scene: &Scene, wi: Vec3, token: u32, target: ShadowTarget) -> Visibility {
        let ShadowTarget { p, in_medium, reaching, destination } = target;
        let origin = self.ray_origin(wi);
        let (direction, tmax) = match p {
            None => (wi, f32::INFINITY),
            Some(p) => {
                // Both ends are offset from their surfaces.
                let to = p - origin;
                let distance = to.length();
                (to / distance, distance)
            }
        };
        let leaving = self.touching();
        if leaving.is_none() && reaching.is_none() && scene.survey.shadow_rays_end_at_surfaces() {
            let blocked = scene.tracer.occluded(&Ray { origin, direction, tmax, token });
            return if blocked { Visibility::BLOCKED } else { Visibility::CLEAR };
        }
        let interior = *self.interiors()[usize::from(self.crosses(wi))];
        let start = Start { origin, direction, interior, leaving, token };
        let in_medium = [Self::IN_MEDIUM, in_medium];
        shadow_ray(scene, &ShadowRay { start, tmax, reaching, in_medium, destination, to_lens: true })
    }
}

/// The normal on the side from which light can reach `wo`; zero if both sides can, or if sharp lobes may scatter
/// grazing light.
#[inline]
pub fn lit_side(shading: &Shading<'_>, ng: Vec3, wo: Vec3) -> Vec3 {
    if shading.bsdf.transmits() || shading.bsdf.lobes().intersects(LobeSet::SHARP) {
        Vec3::ZERO
    } else if ng.dot(wo) < 0.0 {
        -ng
    } else {
        ng
    }
}

impl ScatterPoint for Vertex<'_, '_> {
    const IN_MEDIUM: bool = false;

    #[inline]
    fn is_culled(&self, scene: &Scene, wi: Vec3) -> bool {
        scene.culls(self.surface, -wi) && contact::visible_on_culled(scene, self.surface, -wi, 0).is_none()
    }

    #[inline]
    fn receiver(&self, scene: &Scene) -> Receiver {
        let links = scene.linkings(self.surface.instance);
        Receiver { n: lit_side(self.shading, self.surface.ng, self.wo), links, ..Receiver::anywhere(self.surface.p) }
    }

    #[inline]
    fn p(&self) -> Vec3 {
        self.surface.p
    }

    #[inline]
    fn throughput(&self) -> Rgb {
        self.throughput
    }

    #[inline]
    fn depth(&self) -> u32 {
        self.depth
    }

    #[inline]
    fn draws(&self) -> Draws {
        self.draws
    }

    #[inline]
    fn wavelength(&self) -> Option<&Wavelength> {
        self.wavelength.as_ref()
    }

    #[inline]
    fn smooth(&self) -> LobeSet {
        self.shading.bsdf.lobes() & LobeSet::SMOOTH
    }

    #[inline]
    fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        self.shading.evaluate_cos(wi, transport, set)
    }

    fn first_scatter(&self, wi: Vec3, transport: Transport, set: LobeSet, value: Rgb) -> FirstScatter {
        FirstScatter::Surface(self.shading.lobe_shares(wi, transport, set, value))
    }

    #[inline]
    fn reverse_pdf(&self, wi: Vec3, transport: Transport) -> f32 {
        self.shading.reverse_pdf(wi, transport, LobeSet::ALL)
    }

    #[inline]
    fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.shading.sample(transport, set, u_lobe, u)
    }

    #[inline]
    fn cos(&self, w: Vec3) -> f32 {
        w.dot(self.surface.ng).abs()
    }

    #[inline]
    fn ray_origin(&self, w: Vec3) -> Vec3 {
        self.surface.ray_origin(w)
    }

    #[inline]
    fn touching(&self) -> Option<ContactPoint> {
        ContactPoint::touching(self.surface)
    }

    #[inline]
    fn interiors(&self) -> [&Interior; 2] {
        [&self.interior, &self.interior_behind]
    }

    #[inline]
    fn crosses(&self, w: Vec3) -> bool {
        w.dot(self.surface.ng) * self.wo.dot(self.surface.ng) < 0.0
    }

    #[inline]
    fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32 {
        Vertex::survival_chosen(self, set, chance)
    }
}

/// Samples a direction from a phase function; the weight is 1.
#[inline]
pub(in crate::transport) fn phase_sample(phase: &HenyeyGreenstein, wo: Vec3, u: Vec2) -> BsdfSample {
    let wi = phase.sample(wo, u);
    BsdfSample { wi, weight: Rgb::ONE, pdf_w: phase.pdf_w(wo, wi), lobe: LobeSet::BROAD, transmitted: false }
}

impl ScatterPoint for MediumVertex {
    const IN_MEDIUM: bool = true;

    #[inline]
    fn receiver(&self, scene: &Scene) -> Receiver {
        let links = self.arrival.interior.linkings(scene);
        Receiver { in_medium: true, links, ..Receiver::anywhere(self.arrival.p) }
    }

    #[inline]
    fn p(&self) -> Vec3 {
        self.arrival.p
    }

    #[inline]
    fn throughput(&self) -> Rgb {
        self.throughput
    }

    #[inline]
    fn depth(&self) -> u32 {
        self.depth
    }

    #[inline]
    fn draws(&self) -> Draws {
        self.draws
    }

    #[inline]
    fn wavelength(&self) -> Option<&Wavelength> {
        self.wavelength.as_ref()
    }

    #[inline]
    fn smooth(&self) -> LobeSet {
        LobeSet::BROAD
    }

    #[inline]
    fn evaluate_cos(&self, wi: Vec3, _: Transport, set: LobeSet) -> (Rgb, f32) {
        if !set.intersects(LobeSet::BROAD) {
            return (Rgb::ZERO, 0.0);
        }
        let f = self.phase().pdf_w(self.wo, wi);
        (Rgb::splat(f), f)
    }

    fn first_scatter(&self, _: Vec3, _: Transport, _: LobeSet, _: Rgb) -> FirstScatter {
        FirstScatter::Medium
    }

    #[inline]
    fn reverse_pdf(&self, wi: Vec3, _: Transport) -> f32 {
        self.phase().pdf_w(self.wo, wi)
    }

    #[inline]
    fn sample(&self, _: Transport, _: LobeSet, _: f32, u: Vec2) -> Option<BsdfSample> {
        Some(phase_sample(&self.phase(), self.wo, u))
    }

    #[inline]
    fn cos(&self, _: Vec3) -> f32 {
        1.0
    }

    #[inline]
    fn ray_origin(&self, _: Vec3) -> Vec3 {
        self.arrival.p
    }

    #[inline]
    fn interiors(&self) -> [&Interior; 2] {
        [&self.arrival.interior; 2]
    }

    #[inline]
    fn crosses(&self, _: Vec3) -> bool {
        false
    }

    #[inline]
    fn next_event_share(&self) -> f32 {
        self.next_event
    }

    #[inline]
    fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32 {
        let weight = self.throughput.max_element() * self.survival_scale / chance;
        let expected = if set.intersects(LobeSet::BROAD) { weight } else { 0.0 };
        survival(expected, self.depth, || false)
    }
}
