//! The bounded displacement: a denoiser may move a pixel by a multiple of its standard error.
//!
//! ```text
//! out = M + clip(D - M, -c s, c s)
//! ```
//!
//! `M` is the estimate and `D` the denoiser's picture. The spread `s` is the larger of the pixel's own standard error and
//! a high percentile of its neighbours' standard errors, because a pixel that no rare bright sample has hit yet
//! underestimates its own. As `s` falls with the iterations, so does the displacement: for any `D` the picture converges
//! to the limit of `M` (`docs/theory.md`). The result is clamped between zero and the brightest estimate around; clamped
//! pixels are counted.

use super::Estimate;
use super::window::window;
use crate::film::Picture;
use rayon::prelude::*;

/// Maximum displacement of a pixel from its estimate by the finish, in standard errors: `c` of the finish.
pub const LIMIT: f32 = 3.0;
/// Pixels to each side of a pixel in the window whose standard errors and brightest estimate limit it.
pub const REACH: usize = 3;
/// Percentile of the standard errors in a window that a pixel's spread is at least, as a share of the window, 0 to 1.
const PERCENTILE: f32 = 0.8;

/// The spread of every pixel and channel, the standard error that limits its displacement: the larger of its own and
/// the percentile `PERCENTILE` of its neighbours'. Standard errors that are not finite count as infinite. The spread of
/// an exact pixel is zero.
///
/// A neighbour counts only if its estimate is not above the pixel's by more than [`LIMIT`] of the neighbour's standard
/// errors: beside a bright light the pixel's own samples show that it does not see the light.
pub fn spread(estimate: &Estimate) -> Picture {
    let Estimate { mean, deviation, .. } = estimate;
    let known = |value: f32| if value.is_finite() { value.max(0.0) } else { f32::INFINITY };
    let of_pixel = |ranked: &mut Vec<f32>, index: usize| {
        if estimate.is_exact(index) {
            return [0.0; 3];
        }
        std::array::from_fn(|c| {
            let error_of = |other: usize| {
                let error = known(deviation[other][c]);
                let apart = mean[other][c] - mean[index][c];
                if apart > LIMIT * error { 0.0 } else { error }
            };
            ranked.clear();
            ranked.extend(window(mean.size(), index, REACH).map(error_of));
            let rank = (PERCENTILE * (ranked.len() - 1) as f32).round() as usize;
            let (_, around, _) = ranked.select_nth_unstable_by(rank, f32::total_cmp);
            known(deviation[index][c]).max(*around)
        })
    };
    Picture::new(mean.size(), (0..mean.len()).into_par_iter().map_init(Vec::new, of_pixel).collect())
}

/// The largest finite estimate in RGB within [`REACH`] pixels of pixel `index`, by channel; zero if there is none.
pub fn brightest(mean: &Picture, index: usize) -> [f32; 3] {
    window(mean.size(), index, REACH).fold([0.0; 3], |most, other| {
        std::array::from_fn(|c| if mean[other][c].is_finite() { most[c].max(mean[other][c]) } else { most[c] })
    })
}

/// The noise that limits the displacement of a picture or of its parts: an estimate and its [`spread`].
#[derive(Clone, Copy)]
pub struct Noise<'a> {
    /// The estimate of the whole picture.
    pub estimate: &'a Estimate,
    /// Spread of every pixel and channel of `estimate`, from [`spread`].
    pub spread: &'a Picture,
}

/// Numbers of pixels that the finish has clamped in any channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clamped {
    /// Pixels clamped to zero: equation (6) subtracts bandwidth levels from each other, and denoisers overshoot.
    pub below_zero: u64,
    /// Pixels clamped to the brightest estimate around them.
    pub too_bright: u64,
}

/// Moves every pixel of the estimate `mean` towards `denoised` by at most [`LIMIT`] times `spread`, clamped between
/// zero and [`brightest`]. Also counts the clamped pixels.
///
/// Values of `denoised` that are not finite are ignored; they replace values of `mean` that are not finite.
pub fn displace(mean: &Picture, denoised: &Picture, spread: &Picture) -> (Picture, Clamped) {
    let displaced = |index: usize, c: usize| {
        let (m, d) = (mean[index][c], denoised[index][c]);
        match (m.is_finite(), d.is_finite()) {
            (true, true) => {
                let most = LIMIT * spread[index][c];
                m + (d - m).clamp(-most, most)
            }
            (true, false) => m,
            (false, true) => d,
            (false, false) => 0.0,
        }
    };
    let of_pixel = |index: usize| {
        let brightest = brightest(mean, index);
        let free: [f32; 3] = std::array::from_fn(|c| displaced(index, c));
        let clamped = [(0..3).any(|c| free[c] < 0.0), (0..3).any(|c| free[c] > brightest[c])];
        (std::array::from_fn(|c| free[c].min(brightest[c]).max(0.0)), clamped)
    };
    let (pixels, clamped): (Vec<[f32; 3]>, Vec<[bool; 2]>) = (0..mean.len()).into_par_iter().map(of_pixel).unzip();
    let [below_zero, too_bright] = [0, 1].map(|k: usize| clamped.iter().filter(|clamped| clamped[k]).count() as u64);
    (Picture::new(mean.size(), pixels), Clamped { below_zero, too_bright })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 40, height: 30 };

    fn noise(seed: u64, index: usize) -> f32 {
        Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel)
    }

    fn plane(of: impl Fn(usize) -> f32 + Sync + Send) -> Picture {
        Picture::from_fn(SIZE, |index| [of(index), 2.0 * of(index), 0.5 * of(index)])
    }

    fn estimate(mean: &Picture, deviation: Picture) -> Estimate {
        Estimate { mean: mean.clone(), deviation, albedo: None, normal: None, alpha: None }
    }

    fn bounded(mean: &Picture, denoised: &Picture, spread: &Picture) -> Picture {
        displace(mean, denoised, spread).0
    }

    /// A denoiser that returns nonsense moves no pixel by more than the bound, and its NaN and infinities are ignored.
    #[test]
    fn nonsense_is_bounded() {
        let mean = plane(|index| 1.0 + 0.1 * noise(1, index));
        let deviation = plane(|index| 0.01 + 0.01 * noise(2, index));
        let spread = spread(&estimate(&mean, deviation));
        for nonsense in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e30, 1e30, 0.0] {
            let out = bounded(&mean, &plane(|_| nonsense), &spread);
            for (index, out) in out.iter().enumerate() {
                for c in 0..3 {
                    let (moved, most) = ((out[c] - mean[index][c]).abs(), LIMIT * spread[index][c]);
                    assert!(moved <= most * 1.0001, "{nonsense}: moved by {moved}, allowed {most}");
                    assert!(nonsense.is_finite() || out[c] == mean[index][c]);
                }
            }
        }
    }

    /// The consistency of `docs/theory.md`: with standard errors that fall as 1/sqrt(n) and a fixed wrong denoiser, the
    /// squared error falls with a slope of -1 in n over two decades. Without the bound it would not fall at all.
    #[test]
    fn the_error_falls_as_fast_as_the_estimates_with_any_denoiser() {
        let wrong = plane(|index| 7.0 * noise(5, index));
        let error = |n: f32| {
            let deviation = plane(|_| n.sqrt().recip());
            // Uniform noise with that standard deviation.
            let mean = plane(|index| 3.0 + (12f32 / n).sqrt() * (noise(n as u64, index) - 0.5));
            let out = bounded(&mean, &wrong, &spread(&estimate(&mean, deviation)));
            out.iter().map(|out| f64::from((out[0] - 3.0).powi(2))).sum::<f64>() / SIZE.pixels() as f64
        };
        let slope = (error(1e5).ln() - error(1e3).ln()) / 100f64.ln();
        assert!((slope + 1.0).abs() < 0.05, "{slope}");
    }

    /// A firefly, whose standard error equals its value, is removed; neighbours with small standard errors stay.
    #[test]
    fn a_firefly_is_removed_and_its_neighbours_stay() {
        let at = 15 * SIZE.width + 20;
        let mean = plane(|index| if index == at { 100.0 } else { 1.0 });
        let deviation = plane(|index| if index == at { 100.0 } else { 0.1 });
        let smeared = plane(|_| 5.0);
        let out = bounded(&mean, &smeared, &spread(&estimate(&mean, deviation)));
        assert_eq!(out[at][0], 5.0);
        assert!(out.iter().enumerate().all(|(index, out)| index == at || out[0] < 1.31));
        // No pixel is brighter than the brightest estimate around it.
        let far = bounded(&mean, &plane(|_| 1e6), &plane(|_| 1e6));
        assert!(far.iter().all(|out| out[0] <= 100.0) && far[0][0] == 1.0);
        let dark = bounded(&mean, &plane(|_| -1e6), &plane(|_| 1e6));
        assert!(dark.iter().flatten().all(|value| *value == 0.0));
        let count = |value: f32| displace(&mean, &plane(|_| value), &plane(|_| 1e6)).1;
        let pixels = SIZE.pixels() as u64;
        assert_eq!(count(-1e6), Clamped { below_zero: pixels, too_bright: 0 });
        assert_eq!(count(1e6), Clamped { below_zero: 0, too_bright: pixels });
        assert_eq!(count(0.9), Clamped::default());
    }

    /// Equation (6) can make negative estimates. They are clamped also without a denoiser.
    #[test]
    fn negative_estimates_are_clamped() {
        let mean = plane(|index| if index % 7 == 0 { -0.25 } else { 1.0 });
        let (out, clamped) = displace(&mean, &mean, &plane(|_| 0.0));
        assert!(out.iter().flatten().all(|value| *value >= 0.0));
        assert_eq!(clamped.below_zero, (SIZE.pixels() as u64).div_ceil(7));
    }

    #[test]
    fn pictures_of_any_size_work() {
        for (width, height) in [(0, 0), (1, 1), (1, 50), (50, 1), (3, 2)] {
            let size = Size { width, height };
            let values = Picture::filled(size, [1.0; 3]);
            let estimate = estimate(&values, values.clone());
            assert_eq!(bounded(&values, &values, &spread(&estimate)), values);
        }
    }

    /// Beside a light of radiance 1e6 a wall without noise stays unchanged, and a wall with little noise stays within its
    /// own bound.
    #[test]
    fn a_bright_light_leaves_no_halo() {
        let lit = |index: usize| index % SIZE.width < 10;
        for error in [0.0, 0.01] {
            let mean = plane(|index| if lit(index) { 1e6 } else { 0.2 });
            let deviation = plane(|index| if lit(index) { 1e5 } else { error });
            let spread = spread(&estimate(&mean, deviation));
            let out = bounded(&mean, &plane(|_| 1.5), &spread);
            let wall = out.iter().enumerate().filter(|(index, _)| !lit(*index));
            assert!(wall.map(|(_, out)| out[0]).all(|value| (value - 0.2).abs() <= LIMIT * error * 1.0001));
        }
    }

    /// The spread is zero where alpha is zero; a black surface takes the spread of its neighbours, whose rare light may
    /// have missed it.
    #[test]
    fn empty_pixels_have_no_spread_and_black_surfaces_have_one() {
        let covered = |index: usize| index % SIZE.width < 20;
        let mean = plane(|index| if index % 2 == 0 && covered(index) { 1.0 } else { 0.0 });
        let alpha = (0..SIZE.pixels()).map(|index| f32::from(u8::from(covered(index)))).collect();
        let noisy = Estimate { alpha: Some(alpha), ..estimate(&mean, mean.clone()) };
        let spread = spread(&noisy);
        let inside = |index: usize| index % SIZE.width + REACH < 20;
        for (index, spread) in spread.iter().enumerate().filter(|(index, _)| inside(*index) || !covered(*index)) {
            assert!(if covered(index) { spread[0] == 1.0 } else { *spread == [0.0; 3] }, "pixel {index}: {spread:?}");
        }
    }

    #[test]
    fn only_estimates_that_are_not_finite_are_replaced() {
        let size = Size { width: 2, height: 1 };
        let picture = |pixels: [f32; 2]| Picture::new(size, pixels.map(|value| [value; 3]).to_vec());
        let out = bounded(&picture([f32::NAN, 4.0]), &picture([3.0; 2]), &picture([f32::INFINITY, 0.0]));
        assert_eq!(out, picture([3.0, 4.0]));
    }
}
