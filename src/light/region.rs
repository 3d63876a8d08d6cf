//! The region of interest: a sphere around most of the visible surfaces. In a wide scene, few unaimed light paths would
//! reach it.
//!
//! Surfaces around the region light it indirectly. Ground at distances d to 2 d contributes about as much as ground at
//! distances d / 2 to d. So the other paths go through discs of doubling radius, in equal shares. Without these discs,
//! the few photons from just outside the region would be too bright.

use crate::math::Vec3;
use std::f32::consts::PI;

/// Share of the light paths to the region of interest that go through its own disc, if there are wider discs around it.
const INNER_SHARE: f32 = 0.5;

/// The region of interest (a sphere around most visible surfaces), with the number of discs around it through which
/// light paths from infinity enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Centre of the region's sphere (m).
    pub center: Vec3,
    /// Radius of the region's sphere (m).
    pub radius: f32,
    /// Number of discs around the region's own disc, each twice as wide as the one before.
    pub(super) wider: u32,
}

impl Region {
    /// The region of interest with this sphere, in a scene that light from infinity enters through a disc of radius
    /// `whole` (m).
    pub fn new(center: Vec3, radius: f32, whole: f32) -> Region {
        let doublings = (whole / radius).log2();
        // The widest disc has at most half the radius of the scene's disc, which has paths of its own.
        let wider = if doublings.is_finite() { (doublings - 1.0).clamp(0.0, 64.0) as u32 } else { 0 };
        Region { center, radius, wider }
    }

    /// Probability that a light path to the region goes through its own disc, not a wider one.
    fn inner_share(&self) -> f32 {
        if self.wider == 0 { 1.0 } else { INNER_SHARE }
    }

    /// Samples the radius (m) of the disc that a light path goes through, by a uniform number in `[0, 1)`.
    #[inline]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let inner = self.inner_share();
        if u < inner {
            return self.radius;
        }
        let wider = self.wider as f32;
        let disc = ((u - inner) / (1.0 - inner) * wider).floor().min(wider - 1.0);
        self.radius * (disc + 1.0).exp2()
    }

    /// Density per area (1/m2), in the mixture of the region's discs, of a line at this squared distance from the
    /// region's centre. `drawn` is the radius of the disc on which the line was sampled, so that rounding at its rim
    /// does not matter; 0 for lines that were not sampled.
    #[inline]
    pub(super) fn density(&self, distance2: f32, drawn: f32) -> f32 {
        let drawn2 = drawn * drawn;
        let mut radius2 = self.radius * self.radius;
        let mut share = self.inner_share();
        let mut density = 0.0;
        for _ in 0..=self.wider {
            if distance2 < radius2 || (drawn2 > 0.0 && drawn2 <= radius2) {
                density += share / (PI * radius2);
            }
            share = (1.0 - INNER_SHARE) / self.wider as f32;
            radius2 *= 4.0;
        }
        density
    }
}
