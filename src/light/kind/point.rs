//! Point lights.

use super::{Arrival, Light, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::{Cone, DirectSample, EmissionSample, Receiver, Sky};
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::{PI, TAU};

/// A point light, of no size, that shines equally in all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Position (m).
    pub p: Vec3,
    /// Radiant intensity (W/sr).
    pub intensity: Rgb,
}

impl Light for PointLight {
    fn name(&self) -> &'static str {
        "point"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn power(&self, _: &Sky) -> f64 {
        f64::from(luminance(self.intensity)) * (4.0 * std::f64::consts::PI)
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        0.0
    }

    fn bounds(&self) -> Option<Bounds> {
        Some(Bounds::of_point(self.p, Vec3::Z, PI, 0.5 * PI, luminance(self.intensity)))
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

    fn shines(&self, _: Vec3) -> bool {
        true
    }

    #[inline]
    fn point(&self, _: Vec2) -> Option<(Vec3, Option<Cone>)> {
        Some((self.p, None))
    }

    #[inline]
    fn sample(&self, _: &SceneParts, receiver: &Receiver, selected: Selected, _: Vec2) -> Option<DirectSample> {
        let to = self.p - receiver.p;
        let (distance2, wi) = (to.length_squared(), to.try_normalize()?);
        Some(selected.delta(wi, self.p, self.intensity / distance2, 0.5 / TAU / distance2))
    }

    #[inline]
    fn emit(&self, _: &SceneParts, _: bool, _: Vec2, direction: Vec2) -> Option<LightRay> {
        Some(LightRay::isotropic(self.p, self.intensity, warp::sphere_uniform(direction)))
    }

    #[inline]
    fn density(&self, _: Vec3) -> Option<(f32, f32)> {
        Some((0.5 / TAU, 1.0))
    }

    #[inline]
    fn redirected_flux(&self, emission: &EmissionSample, _: Vec3, _: f32, _: f32) -> Option<Rgb> {
        Some(emission.flux)
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, _: Vec3, _: bool) -> Option<Arrival> {
        None
    }
}
