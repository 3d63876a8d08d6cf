//! Samples of lights for next-event estimation and for light paths, with their densities.

use crate::math::{Rgb, Vec3};

/// A sample of a light from a receiver, for next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// End of the shadow ray, offset from the light's surface; `None` for light from infinity.
    pub target: Option<Vec3>,
    /// Radiance that arrives; for a delta light, irradiance on a surface that faces the light.
    pub radiance: Rgb,
    /// Density per solid angle, which includes the selection of the light; for a delta light, the probability of
    /// selecting it.
    pub pdf_w: f32,
    /// Whether no ray can hit the light.
    pub delta: bool,
    /// Density per area, on a surface that faces `wi`, with which light paths from this point of the light (from this
    /// direction, for a light at infinity) arrive, times the probability of selecting the light for emission over the
    /// probability of selecting it here.
    pub arrival_pdf_a: f32,
    /// Index of the light.
    pub light: u32,
}

/// Densities with which a light path starts, as the MIS weights need them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionDensity {
    /// Density of the light's point (per area; per solid angle of the direction, for light from infinity) in
    /// [`Lights::sample_direct`](super::Lights::sample_direct). For a delta light, the probability of selecting it.
    /// `direct` and `start` differ by the selection of the light, which depends on the receiver.
    pub direct: f32,
    /// Density of the light's point in [`Lights::sample_emission`](super::Lights::sample_emission), in the units of
    /// `direct`.
    pub start: f32,
    /// Density of the rest of the emission: of the direction per solid angle, or of the entry point per area for light
    /// from infinity.
    pub onward: f32,
    /// Cosine at the light; 1 at infinity and for points.
    pub cos: f32,
    /// Whether the light is at infinity.
    pub infinite: bool,
    /// Whether no ray can hit the light.
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

/// The disc that the start of a light path from infinity was sampled on. Its density always counts this disc. A test of
/// the position would be wrong at the rim of a small disc, because of rounding, and would select the density of the
/// scene's larger disc, which gives the path too much flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EntryDisc {
    /// The disc of the whole scene.
    Whole,
    /// The disc of a caustic target, by its index.
    Target(usize),
    /// A disc of this radius around the region of interest.
    Region(f32),
}

/// The start of a light path.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// Origin of the ray, offset from the light's surface.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Emitted flux over density (W): the flux of the path if it is the only one.
    pub flux: Rgb,
    /// Index of the light.
    pub light: u32,
    /// Whether no ray can hit the light.
    pub delta: bool,
    /// Whether the light is at infinity.
    pub infinite: bool,
    /// The disc on which light from infinity enters the scene.
    pub entry: EntryDisc,
    /// Densities of the start.
    pub density: EmissionDensity,
}

impl EmissionSample {
    /// Replaces the density `onward` by `mixed`, the density of the mixture that the start was sampled from. Returns
    /// the start, and its flux over the flux before; `None` if the flux is zero.
    #[inline]
    pub fn reweighted(self, mixed: f32) -> Option<(EmissionSample, f32)> {
        let ratio = self.density.onward / mixed;
        (ratio > 0.0).then(|| (EmissionSample { flux: self.flux * ratio, ..self }, ratio))
    }
}
