//! How light leaves a light: samples and their densities.

use crate::math::{Rgb, Vec3};

/// A light seen from a point.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// Where a shadow ray ends (already off the light's surface); `None` for light from infinity.
    pub target: Option<Vec3>,
    /// Radiance that arrives, or for a delta light irradiance on a surface that faces it.
    pub radiance: Rgb,
    /// Density per solid angle, the choice of the light included; for a delta light the probability of choosing it.
    pub pdf_w: f32,
    /// The light cannot be hit by a ray.
    pub delta: bool,
    /// Density per area of a surface that faces `wi` with which light paths emitted from this point of the light (from
    /// this direction, if it is at infinity) arrive, times the probability of choosing the light for emission over that
    /// of choosing it here.
    pub arrival_pdf_a: f32,
    /// Index of the light.
    pub light: u32,
}

/// Densities with which a light path starts, all that multiple importance sampling asks of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionDensity {
    /// Density of [`Lights::sample_direct`](super::Lights::sample_direct): of the point per area, or of the direction
    /// per solid angle for light from infinity; for a delta light the probability of choosing it. It differs from
    /// `start` by the choice of the light alone, which depends on the receiver.
    pub direct: f32,
    /// The same of [`Lights::sample_emission`](super::Lights::sample_emission).
    pub start: f32,
    /// Density of the rest of emission: of the direction per solid angle, or of the entry per area for light from
    /// infinity.
    pub onward: f32,
    /// Cosine at the light; 1 at infinity and for points.
    pub cos: f32,
    /// The light is at infinity.
    pub infinite: bool,
    /// The light cannot be hit by a ray.
    pub delta: bool,
}

impl EmissionDensity {
    /// Density of the ray that leaves the light, per area that faces it and per solid angle: the same all along the
    /// ray, and behind mirrors and clear glass in the same medium.
    #[inline]
    pub fn ray_density(&self) -> f32 {
        self.start * self.onward / self.cos
    }
}

/// The disc that a light path from infinity was drawn through. Its density counts that disc, whatever rounding says of
/// the start: on a scene's scale the rim of a small disc is not sharp, and a start that were taken for one from outside
/// would carry as much more as the scene's disc is larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EntryDisc {
    /// The scene's.
    Whole,
    /// A target's.
    Target(usize),
    /// One around a region, of this radius.
    Region(f32),
}

/// The start of a light path.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// Where the ray starts (already off the light's surface).
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Emitted flux over density (W): what this path carries if it is the only one.
    pub flux: Rgb,
    /// Index of the light.
    pub light: u32,
    /// The light cannot be hit by a ray.
    pub delta: bool,
    /// The light is at infinity.
    pub infinite: bool,
    /// Where it enters the scene, if it is at infinity.
    pub entry: EntryDisc,
    /// Densities of the start.
    pub density: EmissionDensity,
}

impl EmissionSample {
    /// The same start, drawn with the density `mixed` onward instead of its own, and its flux over that before; `None`
    /// where nothing is left of it.
    #[inline]
    pub fn reweighted(self, mixed: f32) -> Option<(EmissionSample, f32)> {
        let ratio = self.density.onward / mixed;
        (ratio > 0.0).then(|| (EmissionSample { flux: self.flux * ratio, ..self }, ratio))
    }
}
