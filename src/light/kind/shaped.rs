//! Points and spots with a distribution of their own over directions.

use super::{Arrival, Light, LightPlacement, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::bulb::ball_point;
use crate::light::profile::polar_angle;
use crate::light::{Bulb, Cone, DirectSample, Distribution, EmissionSample, Pattern, Receiver, Sky};
use crate::math::{Frame, Rgb, Vec2, Vec3, luminance};
use std::f32::consts::PI;
use std::sync::Arc;

/// A point or a spot whose intensity has a distribution of its own over directions, such as a photometric profile. It
/// shines from a point, or from a ball that no ray can hit.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapedLight {
    /// Position of the point, or of the ball's centre (m).
    pub p: Vec3,
    /// Radius of the ball that emits (m); 0 makes the light a mathematical point.
    pub radius: f32,
    /// Frame of the distribution; its normal is the axis, pointing in the direction of the emitted light.
    pub frame: Frame,
    /// Radiant intensity in a direction of relative intensity 1 (W/sr).
    pub intensity: Rgb,
    /// Relative intensity by direction.
    pub distribution: Arc<Distribution>,
    /// The ball, if camera paths see it.
    pub bulb: Option<Bulb>,
}

impl ShapedLight {
    /// A light of this distribution, whose frame has the axis and the x axis of the placement.
    pub fn new(light: &LightPlacement, distribution: Arc<Distribution>) -> ShapedLight {
        let LightPlacement { p, radius, intensity, bulb, .. } = *light;
        let frame = Frame::from_normal_tangent(light.axis, light.right);
        ShapedLight { p, radius, frame, intensity, distribution, bulb }
    }

    /// Samples a point of the ball by the uniform point `u`. From every side, the ball looks like a uniform disc.
    #[inline]
    fn origin(&self, u: Vec2) -> Vec3 {
        ball_point(self.p, self.radius, u)
    }

    /// Radiant intensity along a unit direction (W/sr).
    #[inline]
    fn intensity_along(&self, d: Vec3) -> Rgb {
        self.intensity * self.distribution.relative(self.frame.to_local(d))
    }

    /// Density per solid angle with which light paths leave along a unit direction.
    #[inline]
    fn pdf_w(&self, d: Vec3) -> f32 {
        self.distribution.pdf_w(self.frame.to_local(d))
    }
}

impl Light for ShapedLight {
    fn name(&self) -> &'static str {
        match (&**self.distribution.pattern(), self.distribution.cone()) {
            (Pattern::Profile(_), None) => "point with a profile",
            (Pattern::Profile(_), Some(_)) => "spot with a profile",
            (Pattern::Picture(_), _) => "spot with a picture",
        }
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn power(&self, _: &Sky) -> f64 {
        f64::from(luminance(self.intensity * self.distribution.flux()))
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        0.0
    }

    fn bounds(&self) -> Option<Bounds> {
        let reach = polar_angle(self.distribution.reach());
        // The bound of wide lights must not depend on rounding at the back of the axis.
        let (axis, spread) = if reach < 3.0 { (self.frame.n, 0.0) } else { (Vec3::Z, PI) };
        let brightest = luminance(self.intensity) * self.distribution.peak();
        let bounds = Bounds::of_point(self.p, axis, spread, reach.min(3.0), brightest);
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
        self.distribution.relative(self.frame.to_local(d)) != Rgb::ZERO
    }

    #[inline]
    fn point(&self, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        let at = self.origin(u);
        Some((at, Cone::new(at, self.frame.n, self.distribution.reach())))
    }

    // Not inlined, like `emit`, so that the common lights stay fast.
    #[inline(never)]
    fn sample(&self, _: &SceneParts, receiver: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        let at = self.origin(u);
        let to = at - receiver.p;
        let (wi, distance2) = (to.try_normalize()?, to.length_squared());
        let radiance = self.intensity_along(-wi) / distance2;
        (radiance != Rgb::ZERO).then(|| selected.delta(wi, at, radiance, self.pdf_w(-wi) / distance2))
    }

    #[inline(never)]
    fn emit(&self, _: &SceneParts, _: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let (local, onward) = self.distribution.sample(direction)?;
        let flux = self.intensity * self.distribution.relative(local) / onward;
        let (origin, direction) = (self.origin(point), self.frame.to_world(local));
        Some(LightRay { origin, direction, flux, start: 1.0, onward, cos: 1.0 })
    }

    #[inline]
    fn density(&self, d: Vec3) -> Option<(f32, f32)> {
        let density = self.pdf_w(d);
        (density > 0.0).then_some((density, 1.0))
    }

    #[inline]
    fn redirected_flux(&self, emission: &EmissionSample, d: Vec3, onward: f32, _: f32) -> Option<Rgb> {
        let flux = self.intensity_along(d) / (onward * emission.density.start);
        (flux != Rgb::ZERO).then_some(flux)
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, _: Vec3, _: bool) -> Option<Arrival> {
        None
    }

    fn bulb(&self) -> Option<Bulb> {
        self.bulb
    }

    fn bulb_along(&self, d: Vec3) -> Option<((Vec3, f32), Rgb)> {
        Some(((self.p, self.radius), self.intensity_along(d)))
    }
}
