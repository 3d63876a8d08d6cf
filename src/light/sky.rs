//! The surroundings of a scene.

use super::Environment;
use super::environment::EnvironmentSample;
use super::learnt_sky::LearntSky;
use super::receiver::Receiver;
use crate::math::{Frame, Rgb, Vec2, Vec3, warp};
use std::f32::consts::PI;
use std::sync::Arc;

/// The bounding sphere of the scene, and the environment around it.
#[derive(Clone)]
pub struct Sky {
    /// Centre of the scene's bounding sphere (m).
    pub center: Vec3,
    /// Radius of the scene's bounding sphere (m).
    pub radius: f32,
    /// The light from all directions around the scene; `None` if the scene has no environment.
    pub environment: Option<Environment>,
    /// The environment that camera rays see instead of `environment`; `None` if they see `environment`.
    pub background: Option<Environment>,
    /// Whether camera rays do not see the environment, although it lights the scene.
    pub hidden_from_camera: bool,
    /// Where the light of the environment arrives, learnt for a render; `None` if that is not known.
    pub learnt: Option<Arc<LearntSky>>,
}

impl Sky {
    /// Whether light comes from the environment, or cameras see some there. A black one only makes pictures opaque.
    pub fn shines(&self) -> bool {
        let black = |of: &Environment| matches!(of, Environment::Uniform(color) if *color == Rgb::ZERO);
        [&self.environment, &self.background].into_iter().flatten().any(|of| !black(of))
    }

    /// Area of the disc through which light from one direction enters the scene's bounding sphere (m2).
    pub(super) fn disc_area(&self) -> f64 {
        std::f64::consts::PI * f64::from(self.radius) * f64::from(self.radius)
    }

    /// Samples a direction towards the environment for a receiver by the uniform point `u`, and returns it with its density.
    /// The sample itself holds the density of [`Environment::sample`].
    #[inline]
    pub(super) fn sample_at(&self, at: &Receiver, u: Vec2) -> Option<(EnvironmentSample, f32)> {
        match (&self.learnt, &self.environment) {
            (Some(learnt), _) => learnt.sample(at, u),
            (None, environment) => environment.as_ref()?.sample_with_density_at(at.n, u),
        }
    }

    /// Light from the unit direction `d`, the density with which [`Sky::sample_at`] samples it for a receiver, and the
    /// density of [`Environment::sample`].
    #[inline]
    pub(super) fn arriving(&self, at: &Receiver, d: Vec3) -> Option<(Rgb, f32, f32)> {
        if let Some(learnt) = &self.learnt {
            return Some(learnt.arriving(at, d));
        }
        let environment = self.environment.as_ref()?;
        let (radiance, pdf_w) = environment.radiance_and_pdf_w(d);
        Some((radiance, environment.pdf_w_at(at.n, d, pdf_w), pdf_w))
    }

    /// Density per area (1/m2) of the points that [`Sky::sample_disc`] samples.
    #[inline]
    pub(super) fn disc_pdf_a(&self) -> f32 {
        1.0 / (PI * self.radius * self.radius)
    }

    /// Samples a point of the disc perpendicular to `d`, as wide as the scene's bounding sphere, through which light of
    /// direction `d` enters the scene. Returns it with its density per area.
    pub(super) fn sample_disc(&self, u: Vec2, d: Vec3) -> (Vec3, f32) {
        let frame = Frame::from_normal(d);
        let q = warp::disc_concentric(u) * self.radius;
        (self.center + frame.t * q.x + frame.b * q.y - d * self.radius, self.disc_pdf_a())
    }
}
