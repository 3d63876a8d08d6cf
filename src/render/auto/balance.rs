//! How wide to gather and how many photons to send: what the levels of a pilot tell.
//!
//! With n iterations of p light paths, in bandwidths of f times the usual squared radius, the relative squared error is
//! `a / n + b / (n f p) + c f`: noise that no photon changes, noise of the photons, and squared bias. Most bias is at edges, and the area that they blur grows
//! with the radius: the squared bias grows as the area of a kernel does, not as its square. Levels differ in f alone, so their variances tell a
//! and b, and their differences c.

use super::Free;
use crate::estimator::InitialBandwidth;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::settings::Settings;

/// Bounds of what the usual settings are multiplied by: estimates are rough, and the combiner has learnt on the usual ones.
const NEIGHBOURS: (f64, f64) = (0.5, 4.0);
const PHOTONS: (f64, f64) = (0.04, 4.0);

/// Factors of the usual settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Of the number of neighbours that set initial bandwidths.
    pub neighbours: f64,
    /// Of the number of light paths.
    pub photons: f64,
}

impl Balance {
    /// The usual settings.
    pub const USUAL: Balance = Balance { neighbours: 1.0, photons: 1.0 };

    /// The factors of least error for a given cost. `fixed` and `photons`: the parts a and b / p of the variance; `squared_bias`: c, all for the usual
    /// settings after as many iterations; costs of an iteration: of its eye paths, and of its light paths.
    pub fn new(fixed: f64, photons: f64, squared_bias: f64, eye_cost: f64, light_cost: f64) -> Balance {
        // For a given radius, q times as many light paths: (a + b / q) (eye + q light) is least at q^2 = (b eye) / (a light).
        let ratio = |a: f64, b: f64| if a > 0.0 && b > 0.0 { a / b } else { 1.0 };
        let q = (ratio(photons, fixed) * ratio(eye_cost, light_cost)).sqrt().clamp(PHOTONS.0, PHOTONS.1);
        // b / (q f) + c f is least at f^2 = b / (c q); q iterations' worth of photons more or less change n by `slower`.
        let slower = (eye_cost + q * light_cost) / (eye_cost + light_cost);
        let f = ratio(photons * slower / q, squared_bias).sqrt();
        // Within the radius that the usual number of neighbours sets, q times as many photons are found.
        let neighbours = (f * q).clamp(NEIGHBOURS.0, NEIGHBOURS.1);
        Balance { neighbours, photons: q }
    }

    /// Leaves alone what the user has asked for.
    pub(super) fn keep(&mut self, free: Free) {
        if !free.photons {
            self.photons = 1.0;
        }
        if !free.neighbours {
            self.neighbours = 1.0;
        }
    }

    /// Changes settings by the factors.
    pub fn apply(&self, settings: &mut Settings) {
        settings.photons = ((f64::from(settings.photons) * self.photons).round() as u32).max(1);
        if let InitialBandwidth::Nearest(k) = &mut settings.initial {
            *k = ((*k as f64 * self.neighbours).round() as usize).clamp(2, MAX_NEIGHBOURS);
        }
    }
}
