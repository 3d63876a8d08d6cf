//! Spots: cones of light with a soft edge.

use super::{Arrival, Light, LightPlacement, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::bulb::ball_point;
use crate::light::spot::{spot_falloff, spot_solid_angle};
use crate::light::{Bulb, Cone, DirectSample, EmissionSample, Receiver, Sky, SpotCone, SpotEdge};
use crate::math::{Frame, Rgb, Vec2, Vec3, luminance, one_minus_cos, warp};

/// A light that shines into a cone with a soft edge, from a point, or uniformly from a disc across the axis of the cone.
/// No ray can hit the disc.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotLight {
    /// Position of the point, or of the disc's centre (m).
    pub p: Vec3,
    /// Radius of the disc that emits (m); 0 makes the spot a mathematical point.
    pub radius: f32,
    /// Frame whose normal is the spot's axis, pointing in the direction of the emitted light.
    pub frame: Frame,
    /// Radiant intensity on the axis (W/sr).
    pub intensity: Rgb,
    /// 1 minus the cosine of the half angle of the cone of full intensity. For narrow cones, the cosine itself would lose
    /// its digits.
    pub inner: f32,
    /// 1 minus the cosine of the half angle beyond which the intensity is zero; greater than `inner`.
    pub outer: f32,
    /// Falloff of the intensity between `inner` and `outer`.
    pub edge: SpotEdge,
    /// The ball that emits in place of the disc, if camera paths see it.
    pub bulb: Option<Bulb>,
}

impl SpotLight {
    pub(super) fn new(light: &LightPlacement, SpotCone { inner, outer, edge }: SpotCone) -> SpotLight {
        let LightPlacement { p, radius, intensity, bulb, .. } = *light;
        SpotLight { p, radius, frame: Frame::from_normal(light.axis), intensity, inner, outer, edge, bulb }
    }

    /// Samples a point uniformly on the disc or on the bulb.
    #[inline]
    fn origin(&self, u: Vec2) -> Vec3 {
        if self.radius == 0.0 {
            return self.p;
        }
        if self.bulb.is_some() {
            return ball_point(self.p, self.radius, u);
        }
        let on = warp::disc_concentric(u) * self.radius;
        self.p + self.frame.t * on.x + self.frame.b * on.y
    }

    /// Intensity along the unit direction `d`, relative to the intensity on the axis.
    #[inline]
    fn falloff(&self, d: Vec3) -> f32 {
        spot_falloff(one_minus_cos(d, self.frame.n), self.inner, self.outer, self.edge)
    }

    #[inline]
    fn solid_angle(&self) -> f32 {
        spot_solid_angle(self.inner, self.outer, self.edge)
    }
}

impl Light for SpotLight {
    fn name(&self) -> &'static str {
        "spot"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn power(&self, _: &Sky) -> f64 {
        f64::from(luminance(self.intensity)) * f64::from(self.solid_angle())
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        0.0
    }

    fn bounds(&self) -> Option<Bounds> {
        // 1 - cos(x) = 2 sin^2(x / 2).
        let reach = 2.0 * (0.5 * self.outer).clamp(0.0, 1.0).sqrt().asin();
        let bounds = Bounds::of_point(self.p, self.frame.n, 0.0, reach, luminance(self.intensity));
        Some(bounds.with_box([self.p - self.radius, self.p + self.radius]))
    }

    #[inline]
    fn is_delta(&self) -> bool {
        true
    }

    #[inline]
    fn is_infinite(&self) -> bool {
        false
    }

    fn any_point(&self, _: &Shapes) -> Option<Vec3> {
        Some(self.p)
    }

    fn shines(&self, d: Vec3) -> bool {
        one_minus_cos(d, self.frame.n) < self.outer
    }

    #[inline]
    fn point(&self, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        let at = self.origin(u);
        Some((at, Cone::new(at, self.frame.n, self.outer)))
    }

    #[inline]
    fn sample(&self, _: &SceneParts, receiver: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        let at = self.origin(u);
        let to = at - receiver.p;
        let (distance2, wi) = (to.length_squared(), to.try_normalize()?);
        let falloff = self.falloff(-wi);
        if falloff == 0.0 {
            return None;
        }
        let arrival_factor = falloff / (self.solid_angle() * distance2);
        Some(selected.delta(wi, at, self.intensity * (falloff / distance2), arrival_factor))
    }

    #[inline(always)]
    fn emit(&self, _: &SceneParts, _: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        // The full cone and the penumbra are selected by their flux. In the penumbra, the integral of the falloff is
        // inverted, so every path carries the same flux.
        let SpotLight { inner, outer, edge, .. } = *self;
        let penumbra = (outer - inner) * edge.mean();
        let x = direction.x * (inner + penumbra);
        let h = if x < inner { x } else { outer - (outer - inner) * edge.ramp((x - inner) / penumbra) };
        let sin = (h * (2.0 - h)).max(0.0).sqrt();
        let filled = self.solid_angle();
        let onward = spot_falloff(h, inner, outer, edge) / filled;
        let direction = self.frame.to_world(warp::around_z(sin, 1.0 - h, direction.y));
        let (origin, flux) = (self.origin(point), self.intensity * filled);
        Some(LightRay { origin, direction, flux, start: 1.0, onward, cos: 1.0 })
    }

    #[inline]
    fn density(&self, d: Vec3) -> Option<(f32, f32)> {
        let falloff = self.falloff(d);
        (falloff > 0.0).then(|| (falloff / self.solid_angle(), 1.0))
    }

    #[inline]
    fn redirected_flux(&self, emission: &EmissionSample, _: Vec3, _: f32, _: f32) -> Option<Rgb> {
        Some(emission.flux)
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, _: Vec3, _: bool) -> Option<Arrival> {
        None
    }

    fn bulb(&self) -> Option<Bulb> {
        self.bulb
    }

    fn bulb_along(&self, d: Vec3) -> Option<((Vec3, f32), Rgb)> {
        Some(((self.p, self.radius), self.intensity * self.falloff(d)))
    }
}
