//! The environment as a light.

use super::{Arrival, Light, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::environment::EnvironmentSample;
use crate::light::{Cone, DirectSample, EmissionSample, Receiver, Sky};
use crate::math::{Rgb, Vec2, Vec3, luminance};
use std::f32::consts::PI;

/// The environment (image or uniform colour) at infinity, stored in [`Sky`].
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentLight;

impl Light for EnvironmentLight {
    fn name(&self) -> &'static str {
        "environment"
    }

    fn owner(&self) -> Owner {
        Owner::Environment
    }

    fn power(&self, sky: &Sky) -> f64 {
        let mean = sky.environment.as_ref().map_or(0.0, |environment| f64::from(luminance(environment.mean())));
        mean * (4.0 * std::f64::consts::PI) * sky.disc_area()
    }

    fn irradiance(&self, sky: &Sky) -> f32 {
        sky.environment.as_ref().map_or(0.0, |environment| luminance(environment.mean()) * PI)
    }

    fn bounds(&self) -> Option<Bounds> {
        None
    }

    #[inline]
    fn is_delta(&self) -> bool {
        false
    }

    #[inline]
    fn is_infinite(&self) -> bool {
        true
    }

    fn any_point(&self, _: &Shapes) -> Option<Vec3> {
        None
    }

    fn shines(&self, _: Vec3) -> bool {
        true
    }

    #[inline]
    fn point(&self, _: Vec2) -> Option<(Vec3, Option<Cone>)> {
        None
    }

    #[inline]
    fn sample(&self, scene: &SceneParts, at: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        let (EnvironmentSample { wi, pdf_w: start, radiance }, direct) = scene.sky.sample_at(at, u)?;
        let mut sample = selected.infinite(wi, radiance, direct, false);
        sample.arrival_factor = start / direct;
        (sample.pdf_w > 0.0).then_some(sample)
    }

    #[inline]
    fn emit(&self, scene: &SceneParts, _: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let EnvironmentSample { wi, pdf_w: start, radiance } = scene.sky.environment.as_ref()?.sample(direction)?;
        let (origin, onward) = scene.sky.sample_disc(point, -wi);
        Some(LightRay { origin, direction: -wi, flux: radiance / (start * onward), start, onward, cos: 1.0 })
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
    fn arriving(&self, sky: &Sky, at: &Receiver, d: Vec3, camera: bool) -> Option<Arrival> {
        if camera && sky.hidden_from_camera {
            return None;
        }
        if let Some(background) = sky.background.as_ref().filter(|_| camera) {
            // No other technique finds the light that a camera sees directly.
            let (radiance, _) = background.radiance_and_pdf_w(d);
            return Some(Arrival { radiance, direct: 1.0, start: 1.0 });
        }
        let (radiance, direct, start) = sky.arriving(at, d)?;
        Some(Arrival { radiance, direct, start })
    }
}
