//! A sphere that holds most of what a picture shows, and what lights it: in a wide scene, few of the paths that light
//! all of it would come there.
//!
//! What is around it lights it, too, the less the farther away, but there is more of that: light from ground at
//! distances d to 2 d counts for about as much as from d / 2 to d. So the rest of the paths goes through discs each
//! twice as wide as the one before, in equal shares. Without them, photons that come from just outside are few, and
//! glare.

use crate::math::Vec3;
use std::f32::consts::PI;

/// Share of the paths that go through the region itself.
const INNER: f32 = 0.5;

/// The region, and how the discs around it are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Its centre.
    pub center: Vec3,
    /// Its radius (m).
    pub radius: f32,
    /// Wider discs.
    pub(super) wider: u32,
}

impl Region {
    /// In a scene that light from infinity enters through a disc of radius `whole`.
    pub fn new(center: Vec3, radius: f32, whole: f32) -> Region {
        let doublings = (whole / radius).log2();
        // The last one is at most half of the whole, which has its own paths.
        let wider = if doublings.is_finite() { (doublings - 1.0).clamp(0.0, 64.0) as u32 } else { 0 };
        Region { center, radius, wider }
    }

    /// Share of the region's own disc.
    fn inner(&self) -> f32 {
        if self.wider == 0 { 1.0 } else { INNER }
    }

    /// Radius of a disc drawn by a uniform number.
    #[inline]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let inner = self.inner();
        if u < inner {
            return self.radius;
        }
        let wider = self.wider as f32;
        let disc = ((u - inner) / (1.0 - inner) * wider).floor().min(wider - 1.0);
        self.radius * (disc + 1.0).exp2()
    }

    /// Density per area, in the mixture of discs, at a squared distance from the centre, of a line that was `drawn`
    /// through the disc of that radius: it is within, whatever rounding says. 0 where it was drawn otherwise.
    #[inline]
    pub(super) fn density(&self, distance2: f32, drawn: f32) -> f32 {
        let drawn2 = drawn * drawn;
        let mut radius2 = self.radius * self.radius;
        let mut share = self.inner();
        let mut density = 0.0;
        for _ in 0..=self.wider {
            if distance2 < radius2 || (drawn2 > 0.0 && drawn2 <= radius2) {
                density += share / (PI * radius2);
            }
            share = (1.0 - INNER) / self.wider as f32;
            radius2 *= 4.0;
        }
        density
    }
}
