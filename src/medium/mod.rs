//! Homogeneous participating media: how far light flies in them, and where it goes when they scatter it.

mod equiangular;
mod flight;
mod phase;

pub use equiangular::Equiangular;
pub use flight::{Collision, CollisionDistribution, FlightDensity, FlightOutcome};
pub use phase::HenyeyGreenstein;

use crate::math::Rgb;

/// A homogeneous medium (1/m).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct MediumParameters {
    /// Absorption coefficient.
    pub sigma_a: Rgb,
    /// Scattering coefficient.
    pub sigma_s: Rgb,
    /// Henyey-Greenstein asymmetry, in (-1, 1).
    pub g: f32,
}

impl MediumParameters {
    /// Extinction coefficient: what absorption and scattering together take from a ray.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }

    /// Whether it scatters any light.
    #[inline]
    pub fn scatters(&self) -> bool {
        self.sigma_s.max_element() > 0.0
    }

    /// Where it scatters light to.
    #[inline]
    pub fn phase(&self) -> HenyeyGreenstein {
        HenyeyGreenstein { g: self.g }
    }

    /// Share of light that is left after `distance` \[Beer-Lambert\]; an infinite way through anything leaves nothing.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let through = |sigma: f32| if sigma > 0.0 { (-sigma * distance).exp() } else { 1.0 };
        let sigma = self.sigma_t();
        Rgb::new(through(sigma.x), through(sigma.y), through(sigma.z))
    }
}
