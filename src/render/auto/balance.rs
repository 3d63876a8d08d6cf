//! How wide to gather and how many photons to send: what the levels of a pilot tell.
//!
//! With n iterations of p light paths, in bandwidths of f times the usual squared radius, the relative squared error is
//! `a / n + b / (n f p) + c sqrt(f)`: noise that no photon changes, noise of the photons, and squared bias. Most bias is at edges, which a kernel blurs
//! by as much whatever its radius, in an area that grows with the radius. Levels differ in f alone, so their variances tell a and b, and their differences
//! c ([`EDGES`]).

use super::Free;
use crate::estimator::InitialBandwidth;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::settings::Settings;

/// Squared bias over the squared difference between a level and the next larger one, summed across a straight edge. A box kernel at u radii from it takes
/// `f(u) = (acos u - u sqrt(1 - u^2)) / pi` from the other side: the integral of f(u)^2 over that of `(f(u / sqrt 2) - f(u))^2`, for u from 0 to where these end.
pub(super) const EDGES: f64 = 9.367;

/// Bounds of what the usual settings are multiplied by: estimates are rough, and the combiner has learnt on the usual ones.
const NEIGHBOURS: (f64, f64) = (1.0, 4.0);
const PHOTONS: (f64, f64) = (0.25, 4.0);
/// And of the area that they are found in.
const AREA: (f64, f64) = (0.5, 4.0);

/// Steps in which either is searched.
const STEPS: u32 = 48;

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
        // For the cost of one iteration of the usual settings; neighbours are area times light paths.
        let error = |neighbours: f64, q: f64| {
            let n = (eye_cost + light_cost) / (eye_cost + q * light_cost);
            fixed / n + photons / (n * neighbours) + squared_bias * (neighbours / q).sqrt()
        };
        let steps = |(low, high): (f64, f64)| {
            (0..=STEPS).map(move |i| low * (high / low).powf(f64::from(i) / f64::from(STEPS)))
        };
        let all = steps(PHOTONS).flat_map(|q| steps(NEIGHBOURS).map(move |neighbours| (neighbours, q)));
        let all = all.filter(|(neighbours, q)| (AREA.0..=AREA.1).contains(&(neighbours / q)));
        let usual = (error(1.0, 1.0), Balance::USUAL);
        let better = |best: (f64, Balance), (neighbours, photons): (f64, f64)| {
            let error = error(neighbours, photons);
            if error < best.0 { (error, Balance { neighbours, photons }) } else { best }
        };
        all.fold(usual, better).1
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_the_integrals() {
        let share = |u: f64| if u < 1.0 { (u.acos() - u * (1.0 - u * u).sqrt()) / std::f64::consts::PI } else { 0.0 };
        let steps = (0..200_000).map(|i| (f64::from(i) + 0.5) * 1e-5);
        let (bias, difference) = steps.fold((0.0, 0.0), |(bias, difference), u| {
            let (own, larger) = (share(u), share(u / 2f64.sqrt()));
            (bias + own * own, difference + (larger - own).powi(2))
        });
        assert!((bias / difference / EDGES - 1.0).abs() < 1e-3, "{}", bias / difference);
    }

    /// Where one part rules, the factors go where it falls; where nothing can be had, they stay.
    #[test]
    fn factors_follow_what_rules_the_error() {
        // Noise of photons, hardly any bias: as many neighbours as there may be.
        assert_eq!(Balance::new(1e-4, 1e-2, 1e-6, 1.0, 1.0).neighbours, NEIGHBOURS.1);
        // Bias: few.
        assert_eq!(Balance::new(1e-4, 1e-4, 1e-1, 1.0, 1.0).neighbours, NEIGHBOURS.0);
        // Light paths that change nothing.
        assert_eq!(Balance::new(1e-2, 1e-9, 1e-9, 1.0, 1.0).photons, PHOTONS.0);
        // They cost nothing beside the eye paths.
        assert_eq!(Balance::new(1e-3, 1e-2, 1e-3, 1.0, 1e-3).photons, PHOTONS.1);
        assert_eq!(Balance::new(0.0, 0.0, 0.0, 1.0, 1.0), Balance::USUAL);
        // In between: four times as many light paths cost nothing, and b / k + c sqrt(k / 4) is least where k^1.5 = 4 b / c, at k = 2.
        let between = Balance::new(1e-9, 1e-3, 2f64.sqrt() * 1e-3, 1.0, 1e-9);
        assert!(between.photons == PHOTONS.1 && (between.neighbours / 2.0 - 1.0).abs() < 0.05, "{between:?}");
    }
}
