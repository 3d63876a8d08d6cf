//! The RGB colours of wavelengths.
//!
//! They are the CIE 1931 standard observer \[multi-lobe fits of Wyman, Sloan, Shirley 2013, "Simple Analytic
//! Approximations to the CIE XYZ Color Matching Functions"\] in linear Rec. 709. Most wavelengths are outside the
//! gamut: some channel is negative. Negative values are set to zero, and the three curves are scaled to the same
//! integral. So a flat spectrum, the spectrum of white lights in an RGB scene, stays white. Photon fluxes stay
//! positive, which Russian roulette and photon statistics need. Only saturation outside the gamut is lost. Wavelengths
//! are drawn in proportion to the mean of the three curves, so no channel of a weight exceeds 3.

use crate::math::Rgb;
use std::sync::LazyLock;

/// Shortest and longest wavelength (nm) that paths take. Outside, the fits of the observer's curves are below 0.2 % of
/// their peaks.
pub const RANGE: (f64, f64) = (390.0, 720.0);

/// Number of steps of the table of wavelengths over uniform numbers.
const STEPS: usize = 256;
/// Number of steps of the numerical integrals over wavelengths.
const INTEGRATION_STEPS: usize = 3300;

/// A Gaussian of a wavelength, of this height, with different widths below and above its peak (nm).
fn lobe(nm: f64, height: f64, peak: f64, below: f64, above: f64) -> f64 {
    let t = (nm - peak) / if nm < peak { below } else { above };
    height * (-0.5 * t * t).exp()
}

/// The standard observer's X, Y, Z at a wavelength (nm) \[(4), table 1\].
fn xyz(nm: f64) -> [f64; 3] {
    [
        lobe(nm, 1.056, 599.8, 37.9, 31.0) + lobe(nm, 0.362, 442.0, 16.0, 26.7) + lobe(nm, -0.065, 501.1, 20.4, 26.2),
        lobe(nm, 0.821, 568.8, 46.9, 40.5) + lobe(nm, 0.286, 530.9, 16.3, 31.1),
        lobe(nm, 1.217, 437.0, 11.8, 36.0) + lobe(nm, 0.681, 459.0, 26.0, 13.8),
    ]
}

/// Linear Rec. 709 colour of a wavelength (nm) with negative channels set to zero, in arbitrary units.
fn rgb(nm: f64) -> [f64; 3] {
    let [x, y, z] = xyz(nm);
    [
        3.240_454 * x - 1.537_139 * y - 0.498_531 * z,
        -0.969_266 * x + 1.876_011 * y + 0.041_556 * z,
        0.055_643 * x - 0.204_026 * y + 1.057_225 * z,
    ]
    .map(|channel| channel.max(0.0))
}

/// Wavelengths (nm) and weights at equal steps of the cumulative distribution of wavelengths.
struct Table {
    nm: [f32; STEPS + 1],
    weight: [Rgb; STEPS + 1],
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let step = (RANGE.1 - RANGE.0) / INTEGRATION_STEPS as f64;
    let at = |i: usize| RANGE.0 + step * i as f64;
    let curves: Vec<[f64; 3]> = (0..=INTEGRATION_STEPS).map(|i| rgb(at(i))).collect();
    // The trapezoidal rule is exact for the table, which is interpolated linearly.
    let integral = |of: &dyn Fn(usize) -> f64, n: usize| (0..n).map(|i| 0.5 * (of(i) + of(i + 1))).sum::<f64>();
    let sums: [f64; 3] = std::array::from_fn(|c| integral(&|i| curves[i][c], INTEGRATION_STEPS) * step);
    let curves: Vec<[f64; 3]> = curves.iter().map(|rgb| std::array::from_fn(|c| rgb[c] / sums[c])).collect();
    let density = |i: usize| curves[i].iter().sum::<f64>() / 3.0;
    let mut cumulative = vec![0.0];
    for i in 0..INTEGRATION_STEPS {
        cumulative.push(cumulative[i] + 0.5 * step * (density(i) + density(i + 1)));
    }
    let total = cumulative[INTEGRATION_STEPS];
    let (mut nm, mut weight) = ([0.0; STEPS + 1], [[0.0f64; 3]; STEPS + 1]);
    for (k, (nm, weight)) in nm.iter_mut().zip(&mut weight).enumerate() {
        let target = total * k as f64 / STEPS as f64;
        let after = cumulative.partition_point(|&c| c < target).clamp(1, INTEGRATION_STEPS);
        let (low, high) = (cumulative[after - 1], cumulative[after]);
        let t = if high > low { ((target - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
        *nm = (at(after - 1) + t * step) as f32;
        *weight = std::array::from_fn(|c| {
            let curve = curves[after - 1][c] * (1.0 - t) + curves[after][c] * t;
            curve / (density(after - 1) * (1.0 - t) + density(after) * t)
        });
    }
    // The coarse steps change the means a little. Dividing by them makes the mean of the table exactly white.
    let means: [f64; 3] = std::array::from_fn(|c| integral(&|k| weight[k][c], STEPS) / STEPS as f64);
    let weight = weight.map(|w| Rgb::from_array(std::array::from_fn(|c| (w[c] / means[c]) as f32)));
    Table { nm, weight }
});

/// The wavelength (nm) that the uniform number `u` in `[0, 1]` draws, and its colour over its density. The mean of the
/// colours over `u` is exactly white.
#[inline]
pub fn sample(u: f32) -> (f32, Rgb) {
    let table = &*TABLE;
    let x = u * STEPS as f32;
    let k = (x as usize).min(STEPS - 1);
    let t = x - k as f32;
    (table.nm[k] + (table.nm[k + 1] - table.nm[k]) * t, table.weight[k] + (table.weight[k + 1] - table.weight[k]) * t)
}

/// Step (nm) and number of steps of the table of interference.
const PATH_STEP: f32 = 4.0;
const PATH_STEPS: usize = 5000;

static INTERFERENCE: LazyLock<Vec<Rgb>> = LazyLock::new(|| {
    let table = &*TABLE;
    let at = |path: f32| {
        let term = |k: usize| {
            let share = if k == 0 || k == STEPS { 0.5 } else { 1.0 } / STEPS as f32;
            table.weight[k] * (share * (std::f32::consts::TAU * path / table.nm[k]).cos())
        };
        (0..=STEPS).map(term).sum::<Rgb>()
    };
    (0..=PATH_STEPS).map(|i| at(PATH_STEP * i as f32)).collect()
});

/// Interference of two beams of white light with this difference of their optical paths (nm): the mean, over the
/// wavelengths of each channel, of the cosine of the phase difference. 1 without a difference, and 0 above 20 µm.
#[inline]
pub fn interference(path: f32) -> Rgb {
    let x = path * (1.0 / PATH_STEP);
    let k = x as usize;
    let (Some(low), Some(high)) = (INTERFERENCE.get(k), INTERFERENCE.get(k + 1)) else { return Rgb::ZERO };
    *low + (*high - *low) * (x - k as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fits have the peak of Y and, within 1 %, the integrals of the CIE's tables (106.857 nm for Y).
    #[test]
    fn the_observer_is_the_standard_one() {
        let n = 4700;
        for (c, integral) in [106.87, 106.86, 106.89].into_iter().enumerate() {
            let sum: f64 = (0..n).map(|i| xyz(360.0 + 0.1 * f64::from(i))[c]).sum::<f64>() * 0.1;
            assert!((sum / integral - 1.0).abs() < 0.01, "{c}: {sum}");
        }
        let peak = (0..n).map(|i| 360.0 + 0.1 * f64::from(i)).max_by(|a, b| xyz(*a)[1].total_cmp(&xyz(*b)[1]));
        assert!(peak.is_some_and(|nm| (nm - 555.0).abs() < 5.0), "{peak:?}");
    }
}
