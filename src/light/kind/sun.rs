//! Suns.

use super::{Arrival, Light, LightPlacement, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::{Cone, DirectSample, EmissionSample, Receiver, Sky};
use crate::math::{Frame, Rgb, Vec2, Vec3, luminance, one_minus_cos, warp};
use std::f32::consts::PI;

/// Light from a small cone of directions at infinity.
#[derive(Clone, Debug, PartialEq)]
pub struct SunLight {
    /// Frame whose normal points from the scene towards the sun.
    pub frame: Frame,
    /// Irradiance on a surface that faces the sun (W/m2).
    pub irradiance: Rgb,
    /// 1 minus the cosine of the half angle of the sun's disc; 0 is exactly parallel light.
    pub one_minus_cos: f32,
    /// Whether camera rays do not see the sun's disc, although it lights the scene.
    pub hidden_from_camera: bool,
}

impl SunLight {
    pub(super) fn new(light: &LightPlacement, one_minus_cos: f32) -> SunLight {
        let LightPlacement { axis, intensity: irradiance, hidden_from_camera, .. } = *light;
        SunLight { frame: Frame::from_normal(-axis), irradiance, one_minus_cos, hidden_from_camera }
    }

    /// Radiance (W/m2/sr) of a sun of finite size.
    #[inline]
    fn radiance(&self) -> Rgb {
        // E = integral of L cos over the cone = L pi sin^2, and sin^2 = h (2 - h) with h = 1 - cos.
        self.irradiance / (PI * self.one_minus_cos * (2.0 - self.one_minus_cos))
    }
}

impl Light for SunLight {
    fn name(&self) -> &'static str {
        "sun"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn power(&self, sky: &Sky) -> f64 {
        f64::from(luminance(self.irradiance)) * sky.disc_area()
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        luminance(self.irradiance)
    }

    fn bounds(&self) -> Option<Bounds> {
        None
    }

    #[inline]
    fn is_delta(&self) -> bool {
        self.one_minus_cos == 0.0
    }

    #[inline]
    fn is_infinite(&self) -> bool {
        true
    }

    fn any_point(&self, _: &Shapes) -> Option<Vec3> {
        None
    }

    fn shines(&self, d: Vec3) -> bool {
        one_minus_cos(-d, self.frame.n) <= self.one_minus_cos
    }

    #[inline]
    fn point(&self, _: Vec2) -> Option<(Vec3, Option<Cone>)> {
        None
    }

    #[inline]
    fn sample(&self, _: &SceneParts, _: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        if self.is_delta() {
            return Some(selected.infinite(self.frame.n, self.irradiance, 1.0, true));
        }
        let wi = self.frame.to_world(warp::cone_uniform(u, self.one_minus_cos));
        Some(selected.infinite(wi, self.radiance(), warp::cone_uniform_pdf_w(self.one_minus_cos), false))
    }

    #[inline]
    fn emit(&self, scene: &SceneParts, _: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let wi = self.frame.to_world(warp::cone_uniform(direction, self.one_minus_cos));
        // A facing surface receives the irradiance E from the whole cone; a path from one direction carries
        // L / pdf = E / mean cosine.
        let flux = self.irradiance * (2.0 / (2.0 - self.one_minus_cos));
        let start = if self.is_delta() { 1.0 } else { warp::cone_uniform_pdf_w(self.one_minus_cos) };
        let (origin, onward) = scene.sky.sample_disc(point, -wi);
        Some(LightRay { origin, direction: -wi, flux: flux / onward, start, onward, cos: 1.0 })
    }

    #[inline]
    fn density(&self, _: Vec3) -> Option<(f32, f32)> {
        None
    }

    #[inline]
    fn redirected_flux(&self, _: &EmissionSample, _: Vec3, _: f32, _: f32) -> Option<Rgb> {
        None
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, d: Vec3, camera: bool) -> Option<Arrival> {
        let size = self.one_minus_cos;
        let seen = one_minus_cos(d, self.frame.n) < size && !(camera && self.hidden_from_camera);
        let pdf_w = warp::cone_uniform_pdf_w(size);
        seen.then(|| Arrival { radiance: self.radiance(), direct: pdf_w, start: pdf_w })
    }
}
