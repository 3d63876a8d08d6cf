//! How wide to gather and how many photons to send: what the levels of a pilot tell.
//!
//! With n iterations of p light paths, in bandwidths of f times the usual squared radius, the relative squared error is
//! `a / n + b / (n f p) + c f^e`: noise that no photon changes, noise of the photons, and squared bias. Levels differ in f alone, so their variances tell a
//! and b, and their differences c and e ([`super::bias`]).

use super::Free;
use super::bias::Bias;
use crate::estimator::InitialBandwidth;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::settings::Settings;

/// Bounds of what the usual settings are multiplied by: estimates are rough, and the combiner has learnt on the usual ones.
const NEIGHBOURS: (f64, f64) = (1.0, 4.0);
const PHOTONS: (f64, f64) = (1.0 / 16.0, 4.0);
/// And of the area that they are found in.
const AREA: (f64, f64) = (0.5, 16.0);

/// Steps in which either is searched.
const STEPS: u32 = 48;
/// What rounding may do to a step.
const ROUNDING: f64 = 1e-9;

fn steps((low, high): (f64, f64)) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |i| low * (high / low).powf(f64::from(i) / f64::from(STEPS)))
}

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

    /// The factors of least error for a given cost. `fixed` and `photons`: the parts a and b / p of the variance; `bias`: c and e, all for the usual
    /// settings after as many iterations; costs of an iteration: of its eye paths, and of its light paths.
    pub(super) fn new(fixed: f64, photons: f64, bias: Bias, eye_cost: f64, light_cost: f64) -> Balance {
        // Neighbours are area times light paths.
        let error = |balance: Balance, n: f64| {
            fixed / n + photons / (n * balance.neighbours) + bias.at(balance.neighbours / balance.photons)
        };
        let all =
            steps(PHOTONS).flat_map(|photons| steps(NEIGHBOURS).map(move |neighbours| Balance { neighbours, photons }));
        Balance::least(all, error, eye_cost, light_cost)
    }

    /// The number of light paths alone, by the error that is expected of some factors in so many iterations, over those of the usual settings: where bandwidths follow the
    /// photons' counts, and so the number of all photons sent, whatever the iterations that send them, or do not grow as they like.
    pub(super) fn expecting(error: impl Fn(Balance, f64) -> f64, eye_cost: f64, light_cost: f64) -> Balance {
        let all = steps(PHOTONS).map(|photons| Balance { photons, ..Balance::USUAL });
        Balance::least(all, error, eye_cost, light_cost)
    }

    /// Those of some, in areas within bounds, whose error is least in as many iterations as take as long as one of the usual settings.
    fn least(
        all: impl Iterator<Item = Balance>,
        error: impl Fn(Balance, f64) -> f64,
        eye_cost: f64,
        light_cost: f64,
    ) -> Balance {
        let error =
            |balance: Balance| error(balance, (eye_cost + light_cost) / (eye_cost + balance.photons * light_cost));
        let bounds = AREA.0 * (1.0 - ROUNDING)..AREA.1 * (1.0 + ROUNDING);
        let better = |best: (f64, Balance), balance: Balance| {
            let error = error(balance);
            if error < best.0 { (error, balance) } else { best }
        };
        let usual = (error(Balance::USUAL), Balance::USUAL);
        all.filter(|balance| bounds.contains(&(balance.neighbours / balance.photons))).fold(usual, better).1
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

    /// Many light paths where only their number counts, few where only iterations do, as far as areas may go; in between where the parts are equal:
    /// a (1 + q) + b (1 + q) / q is least where q^2 = b / a.
    #[test]
    fn counting_rules_ask_for_photons_in_all() {
        let of = |a: f64, b: f64| Balance::expecting(move |balance, n| a / n + b / (n * balance.photons), 1.0, 1.0);
        let close = |photons: f64, to: f64| assert!((photons / to - 1.0).abs() < 2.0 * ROUNDING, "{photons} for {to}");
        close(of(0.0, 1.0).photons, 1.0 / AREA.0);
        close(of(1.0, 0.0).photons, 1.0 / AREA.1);
        let between = of(4.0, 1.0);
        assert!((between.photons * 2.0 - 1.0).abs() < 0.05 && between.neighbours == 1.0, "{between:?}");
        assert_eq!(of(0.0, 0.0), Balance::USUAL);
    }

    /// Where one part rules, the factors go where it falls; where nothing can be had, they stay.
    #[test]
    fn factors_follow_what_rules_the_error() {
        let edges = |squared| Bias { squared, exponent: 0.5 };
        // Noise of photons, hardly any bias: as many neighbours as there may be.
        assert_eq!(Balance::new(1e-4, 1e-2, edges(1e-6), 1.0, 1.0).neighbours, NEIGHBOURS.1);
        // Bias: few.
        assert_eq!(Balance::new(1e-4, 1e-4, edges(1e-1), 1.0, 1.0).neighbours, NEIGHBOURS.0);
        // Light paths that change nothing.
        assert_eq!(Balance::new(1e-2, 1e-9, edges(1e-9), 1.0, 1.0).photons, PHOTONS.0);
        // They cost nothing beside the eye paths.
        assert_eq!(Balance::new(1e-3, 1e-2, edges(1e-3), 1.0, 1e-3).photons, PHOTONS.1);
        assert_eq!(Balance::new(0.0, 0.0, edges(0.0), 1.0, 1.0), Balance::USUAL);
        // In between: four times as many light paths cost nothing, and b / k + c sqrt(k / 4) is least where k^1.5 = 4 b / c, at k = 2.
        let between = Balance::new(1e-9, 1e-3, edges(2f64.sqrt() * 1e-3), 1.0, 1e-9);
        assert!(between.photons == PHOTONS.1 && (between.neighbours / 2.0 - 1.0).abs() < 0.05, "{between:?}");
        // Smooth light: b / k + c (k / 4)^2 is least where k^3 = 8 b / c.
        let smooth = Bias { squared: 1e-3, exponent: 2.0 };
        let between = Balance::new(1e-9, 1e-3, smooth, 1.0, 1e-9);
        assert!(between.photons == PHOTONS.1 && (between.neighbours / 2.0 - 1.0).abs() < 0.05, "{between:?}");
    }
}
