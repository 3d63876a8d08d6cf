//! Samples of lights for next-event estimation and for light paths, with their densities.

use crate::math::{DVec2, Rgb, Vec2, Vec3};

/// A sampled point or direction of a light, as seen from a receiver (a point that receives light), for next-event
/// estimation.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit direction from the receiver towards the light.
    pub wi: Vec3,
    /// End of the shadow ray, offset from the light's surface; `None` for light from infinity.
    pub target: Option<Vec3>,
    /// Radiance that arrives at the receiver (W/m2/sr); for a delta light, irradiance on a surface that faces the light
    /// (W/m2).
    pub radiance: Rgb,
    /// Density per solid angle at the receiver with which this direction is sampled, including the selection of the
    /// light; for a delta light, the probability of selecting it.
    pub pdf_w: f32,
    /// Whether the light is a delta light: no ray can hit it.
    pub delta: bool,
    /// The part of [`Lights::arrival_pdf_a`](super::Lights::arrival_pdf_a) that is known from sampling: all of it, except
    /// for light from infinity the density of the point of entry into the scene.
    pub arrival_factor: f32,
    /// Index of the sampled light in [`Lights::emitters`](super::Lights::emitters).
    pub light: u32,
}

/// Random points of the unit square for the start of a light path.
#[derive(Clone, Copy)]
pub struct EmissionDraws {
    /// Choice of the light, and of the target that it is aimed at.
    pub choice: DVec2,
    pub point: Vec2,
    pub direction: Vec2,
}

/// Densities with which a light path starts at a point of a light in a direction, as the MIS weights need them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionDensity {
    /// Density of the light's point (per area; per solid angle of the direction, for light from infinity) in
    /// [`Lights::sample_direct`](super::Lights::sample_direct). For a delta light, the probability of selecting it.
    /// `direct` and `start` differ by the selection of the light, which depends on the receiver.
    pub direct: f32,
    /// Density of the light's point when [`Lights::sample_emission`](super::Lights::sample_emission) starts a light
    /// path there, in the units of `direct`.
    pub start: f32,
    /// Density of the second part of the start: of the emitted direction per solid angle, or of the point of entry into
    /// the scene per area for light from infinity.
    pub onward: f32,
    /// Cosine of the emitted direction to the normal at the light; 1 at infinity and for points.
    pub cos: f32,
    /// Whether the light is at infinity.
    pub infinite: bool,
    /// Whether the light is a delta light: no ray can hit it.
    pub delta: bool,
}

impl EmissionDensity {
    /// Density of the emitted ray, per solid angle and per area perpendicular to it. It is constant along the ray, and
    /// across mirrors and clear glass if the medium at both ends is the same.
    #[inline]
    pub fn ray_density(&self) -> f32 {
        self.start * self.onward / self.cos
    }
}

/// The disc on which the start of a light path from infinity was sampled. Its density always counts this disc. A test
/// of the position would be wrong at the rim of a small disc, because of rounding, and would select the density of the
/// scene's larger disc, which gives the path too much flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EntryDisc {
    /// The disc of the whole scene, with the radius of its bounding sphere.
    Whole,
    /// The disc of a caustic target (the bounding sphere of an object that can make caustics), by the target's index.
    Target(usize),
    /// A disc of this radius (m) around the region of interest, the sphere around most visible surfaces.
    Region(f32),
}

/// The sampled start of a light path: a ray that leaves a light, its flux and its densities.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// Origin of the ray, offset from the light's surface.
    pub origin: Vec3,
    /// Unit direction in which the light leaves.
    pub direction: Vec3,
    /// Emitted flux over the density of the start (W): the flux that the path carries if it is the only one.
    pub flux: Rgb,
    /// Index of the light in [`Lights::emitters`](super::Lights::emitters).
    pub light: u32,
    /// Whether the light is a delta light: no ray can hit it.
    pub delta: bool,
    /// Whether the light is at infinity.
    pub infinite: bool,
    /// The disc on which a path from infinity enters the scene; not used for other lights.
    pub entry: EntryDisc,
    /// Densities with which this start is sampled, for MIS.
    pub density: EmissionDensity,
}

impl EmissionSample {
    /// Replaces the density `onward` by `mixed`, the density in the mixture of discs that the start was sampled from.
    /// Returns the start with its new flux, and this flux over the flux before; `None` if the flux is zero.
    #[inline]
    pub fn reweighted(self, mixed: f32) -> Option<(EmissionSample, f32)> {
        let ratio = self.density.onward / mixed;
        (ratio > 0.0).then(|| (EmissionSample { flux: self.flux * ratio, ..self }, ratio))
    }
}
