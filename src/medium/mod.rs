//! Homogeneous participating media: free-flight sampling, equiangular sampling, and the phase function.

mod equiangular;
mod flight;
mod phase;

pub use equiangular::Equiangular;
pub use flight::{Collision, CollisionDistribution, FlightDensity, FlightOutcome};
pub use phase::HenyeyGreenstein;

use crate::math::Rgb;

/// The parameters of a homogeneous participating medium.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct MediumParameters {
    /// Absorption coefficient (1/m).
    pub sigma_a: Rgb,
    /// Scattering coefficient (1/m).
    pub sigma_s: Rgb,
    /// Asymmetry of the Henyey-Greenstein phase function, in (-1, 1); positive values scatter forward.
    pub g: f32,
}

impl MediumParameters {
    /// Extinction coefficient (1/m): the sum of absorption and scattering.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }

    /// Whether the medium scatters light in any channel.
    #[inline]
    pub fn scatters(&self) -> bool {
        self.sigma_s.max_element() > 0.0
    }

    /// The phase function of the medium.
    #[inline]
    pub fn phase(&self) -> HenyeyGreenstein {
        HenyeyGreenstein { g: self.g }
    }

    /// Transmittance per channel (0 to 1) over `distance` (m), which may be infinite \[Beer-Lambert\].
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let through = |sigma: f32| if sigma > 0.0 { (-sigma * distance).exp() } else { 1.0 };
        let sigma = self.sigma_t();
        Rgb::new(through(sigma.x), through(sigma.y), through(sigma.z))
    }
}
