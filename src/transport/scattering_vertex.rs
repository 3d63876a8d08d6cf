//! Where a path scatters: on a surface or in a medium. What is connected to, lit or measured need not know which.

use super::interior::Interior;
use super::roulette::survival;
use super::segment::{Between, ShadowRay, Start, shadow_ray};
use super::vertex::{MediumVertex, Vertex};
use crate::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use crate::light::{DirectSample, Receiver};
use crate::math::{Rgb, Vec2, Vec3};
use crate::medium::HenyeyGreenstein;
use crate::random::Draws;
use crate::scene::Scene;
use crate::scene::contact::{self, ContactPoint};
use crate::spectrum::Wavelength;

/// A vertex of a walk, on a surface or in a medium. The cosine of a medium is 1, and its phase function a lobe that is
/// broad.
pub trait ScatterPoint {
    /// Whether it is in a medium.
    const IN_MEDIUM: bool;
    /// World position.
    fn p(&self) -> Vec3;
    /// Weight of the path before it scatters.
    fn throughput(&self) -> Rgb;
    /// Number of segments up to here.
    fn depth(&self) -> u32;
    /// Random numbers of the vertex.
    fn draws(&self) -> Draws;
    /// The wavelength the path has taken.
    fn wavelength(&self) -> Option<&Wavelength>;
    /// Its lobes that are not delta.
    fn smooth(&self) -> LobeSet;
    /// Scattering from `wi` times its cosine, and the density of drawing `wi` ([`crate::bsdf::Shading::evaluate_cos`]).
    fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32);
    /// Density of the way back ([`crate::bsdf::Shading::reverse_pdf`]).
    fn reverse_pdf(&self, wi: Vec3, transport: Transport) -> f32;
    /// Draws an onward direction ([`crate::bsdf::Shading::sample`]).
    fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;
    /// Geometric cosine of a direction.
    fn cos(&self, w: Vec3) -> f32;
    /// Where a ray towards `w` starts.
    fn ray_origin(&self, w: Vec3) -> Vec3;
    /// The solids on the side of `wo`, and behind.
    fn interiors(&self) -> [&Interior; 2];
    /// Whether `w` is on the other side than `wo`.
    fn crosses(&self, w: Vec3) -> bool;
    /// As what receives light straight from lights.
    fn receiver(&self) -> Receiver;
    /// Whether a camera that lies along `wi` looks through it.
    fn is_culled(&self, _scene: &Scene, _wi: Vec3) -> bool {
        false
    }
    /// See [`Vertex::survival`].
    fn survival(&self, set: LobeSet) -> f32;
    /// See [`MediumVertex::next_event`].
    #[inline]
    fn next_event_share(&self) -> f32 {
        1.0
    }

    /// The surface it is on, if others lie on that.
    #[inline]
    fn touching(&self) -> Option<ContactPoint> {
        None
    }

    /// What is left of light on the way along `wi` to `target` (`None`: out of the scene).
    #[inline]
    fn shadow_ray(&self, scene: &Scene, wi: Vec3, target: Option<Vec3>, token: u32) -> ShadowRay {
        self.shadow_ray_to(scene, wi, target, token, false, None)
    }

    /// [`ScatterPoint::shadow_ray`] to a light.
    #[inline]
    fn shadow_ray_to_light(&self, scene: &Scene, light: &DirectSample, token: u32) -> ShadowRay {
        let reaching = light.target.and_then(|target| ContactPoint::on_light(scene, light.light, target));
        self.shadow_ray_to(scene, light.wi, light.target, token, false, reaching)
    }

    /// The same to a vertex of a medium or not, or to one on a surface that others lie on.
    #[inline]
    fn shadow_ray_to(
        &self,
        scene: &Scene,
        wi: Vec3,
        target: Option<Vec3>,
        token: u32,
        to_medium: bool,
        reaching: Option<ContactPoint>,
    ) -> ShadowRay {
        let origin = self.ray_origin(wi);
        let (direction, tmax) = match target {
            None => (wi, f32::INFINITY),
            Some(target) => {
                // Both ends are off their surfaces already.
                let to = target - origin;
                let distance = to.length();
                (to / distance, distance)
            }
        };
        let interior = *self.interiors()[usize::from(self.crosses(wi))];
        let start = Start { origin, direction, interior, leaving: self.touching(), token };
        shadow_ray(scene, &Between { start, tmax, reaching, in_medium: [Self::IN_MEDIUM, to_medium] })
    }
}

/// The normal on the side that a surface seen from `wo` is lit from; zero if it is from both, or if the surface may
/// send most of what it gets along itself to the eye.
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
    fn receiver(&self) -> Receiver {
        Receiver { n: lit_side(self.shading, self.surface.ng, self.wo), ..Receiver::anywhere(self.surface.p) }
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
    fn survival(&self, set: LobeSet) -> f32 {
        Vertex::survival(self, set)
    }
}

/// A direction drawn from a phase function, whose weight is 1.
#[inline]
pub(super) fn phase_sample(phase: &HenyeyGreenstein, wo: Vec3, u: Vec2) -> BsdfSample {
    let wi = phase.sample(wo, u);
    BsdfSample { wi, weight: Rgb::ONE, pdf_w: phase.pdf_w(wo, wi), lobe: LobeSet::BROAD, transmitted: false }
}

impl ScatterPoint for MediumVertex {
    const IN_MEDIUM: bool = true;

    #[inline]
    fn receiver(&self) -> Receiver {
        Receiver { p: self.arrival.p, n: Vec3::ZERO, in_medium: true }
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
    fn survival(&self, set: LobeSet) -> f32 {
        let expected =
            if set.intersects(LobeSet::BROAD) { self.throughput.max_element() * self.survival_scale } else { 0.0 };
        survival(expected, self.depth, || false)
    }
}
