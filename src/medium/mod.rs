//! Participating media: free-flight sampling, equiangular sampling, the phase function, and grids of density.

mod equiangular;
mod flight;
mod grid;
mod phase;

pub use equiangular::Equiangular;
pub use flight::{Collision, CollisionDistribution, FlightDensity, FlightOutcome};
pub use grid::{DensityGrid, EmissionGrid, Grid, GridFlight, GridRay, MediumGrids, Proxy};
pub use phase::HenyeyGreenstein;

use crate::math::Rgb;

/// Offset that is added to uniform numbers, which are multiples of 2^-24, so that no sampled distance is zero.
const HALF_STEP: f32 = 0.5 / 16_777_216.0;

/// The parameters of a homogeneous participating medium, or of a heterogeneous one where its density is 1.
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

    /// The medium with its coefficients multiplied by `density`.
    #[must_use]
    #[inline]
    pub fn scaled(&self, density: f32) -> MediumParameters {
        MediumParameters { sigma_a: self.sigma_a * density, sigma_s: self.sigma_s * density, g: self.g }
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
