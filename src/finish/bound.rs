//! The bounded displacement: a denoiser may move a pixel by a multiple of its standard error.
//!
//! ```text
//! out = M + clip(D - M, -c s, c s)
//! ```
//!
//! `M` is the estimate and `D` the denoiser's picture. The spread `s` is the larger of the pixel's own standard error and
//! a high percentile of its neighbours' standard errors, because a pixel that no rare bright sample has hit yet
//! underestimates its own. `c` is 3 for many samples. The standard error of few samples is itself uncertain, so that `c`
//! is the quantile of Student's distribution that excludes as much as three standard deviations of a normal one: 3.3
//! for 32 samples, 9.2 for 4, and no bound for one. As `s` falls with the iterations, so does the displacement: for any
//! `D` the picture converges to the limit of `M` (`docs/theory.md`). The result is clamped between zero and the brightest
//! estimate around; clamped pixels are counted.

use super::Estimate;
use super::window::window;
use crate::film::{Picture, Size};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::erf::erf;
use std::f64::consts::FRAC_1_SQRT_2;
use wide::{CmpGt, f32x8};

/// Maximum displacement of a pixel from its estimate by the finish, in standard errors of many samples: `c` of the
/// finish.
pub const LIMIT: f32 = 3.0;

/// Maximum displacement in standard errors that are estimated from `samples` independent samples; infinite for one, and
/// [`LIMIT`] if the number is unknown.
pub fn limit(samples: Option<u64>) -> f32 {
    let freedom = samples.map(|samples| samples.saturating_sub(1) as f64);
    match freedom {
        None => LIMIT,
        Some(0.0) => f32::INFINITY,
        Some(freedom) => {
            let below = 0.5 * (1.0 + erf(f64::from(LIMIT) * FRAC_1_SQRT_2));
            StudentsT::new(0.0, 1.0, freedom).map_or(LIMIT, |student| student.inverse_cdf(below) as f32)
        }
    }
}

/// Pixels to each side of a pixel in the window whose standard errors and brightest estimate limit it.
pub const REACH: usize = 3;
/// Percentile of the standard errors in a window that a pixel's spread is at least, as a share of the window, 0 to 1.
const PERCENTILE: f32 = 0.8;

/// The spread of every pixel and channel, the standard error that limits its displacement: the larger of its own and
/// the percentile `PERCENTILE` of its neighbours'. Standard errors that are not finite count as infinite.
///
/// A neighbour counts only if its estimate is not above the pixel's by more than [`limit`] of the neighbour's standard
/// errors: beside a bright light the pixel's own samples show that it does not see the light. All samples of an exact
/// pixel are equal, so that neighbours whose estimate is as far below do not count either. Others do, because few samples
/// may all have taken the same way through glass.
pub fn spread(estimate: &Estimate) -> Picture {
    let Estimate { mean, deviation, samples, .. } = estimate;
    let (size, limit) = (mean.size(), limit(*samples));
    let planes: [Plane; 3] = std::array::from_fn(|c| Plane {
        size,
        limit,
        mean: mean.par_iter().map(|rgb| rgb[c]).collect(),
        error: deviation.par_iter().map(|rgb| known(rgb[c])).collect(),
    });
    let mut spread = vec![[0.0; 3]; size.pixels()];
    spread.par_chunks_mut(size.width.max(1)).enumerate().for_each(|(y, row)| {
        let inner = if (REACH..size.height.saturating_sub(REACH)).contains(&y) { REACH } else { size.width };
        let mut ranked = Vec::new();
        let mut x = 0;
        while x < size.width {
            let lanes = if x >= inner && x + LANES + REACH <= size.width { LANES } else { 1 };
            for (c, plane) in planes.iter().enumerate() {
                let index = y * size.width + x;
                if lanes == LANES {
                    let all = plane.inner_spreads(index).to_array();
                    row[x..].iter_mut().zip(all).for_each(|(rgb, spread)| rgb[c] = spread);
                } else {
                    let around = plane.percentile(index, &mut ranked, |above| above);
                    row[x][c] = plane.error[index].max(around);
                }
            }
            x += lanes;
        }
        for (index, spread) in (y * size.width..).zip(row) {
            if *spread != [0.0; 3] && estimate.is_exact(index) {
                // A medium and shadow catchers show light where alpha is 0.
                let is_lit = |other: usize| mean[other] != [0.0; 3] && estimate.has_alpha_0(other);
                let shows_nothing = mean[index] == [0.0; 3] && !window(size, index, REACH).any(is_lit);
                let mut around = |plane: &Plane| plane.percentile(index, &mut ranked, f32::abs);
                *spread = planes.each_ref().map(|plane| if shows_nothing { 0.0 } else { around(plane) });
            }
        }
    });
    Picture::new(size, spread)
}

/// The standard error `error`, at least 0; infinity if it is not a finite number.
fn known(error: f32) -> f32 {
    if error.is_finite() { error.max(0.0) } else { f32::INFINITY }
}

/// Number of pixels that [`Plane::inner_spreads`] processes at once.
const LANES: usize = 8;
/// Side of a window that the border of the picture does not cut off.
const SIDE: usize = 2 * REACH + 1;

/// Index, in ascending order, of the percentile [`PERCENTILE`] of `count` standard errors.
const fn rank(count: usize) -> usize {
    (PERCENTILE * (count - 1) as f32 + 0.5) as usize
}

/// One channel of an estimate and of its known standard errors.
struct Plane {
    size: Size,
    limit: f32,
    mean: Vec<f32>,
    error: Vec<f32>,
}

impl Plane {
    /// The percentile of the standard errors around a pixel. Those count whose `distance`, a function of the difference
    /// of the estimates, is not beyond the limit. `ranked` is a buffer.
    fn percentile(&self, index: usize, ranked: &mut Vec<f32>, distance: fn(f32) -> f32) -> f32 {
        let error_of = |other: usize| {
            let apart = distance(self.mean[other] - self.mean[index]);
            if apart > self.limit * self.error[other] { 0.0 } else { self.error[other] }
        };
        ranked.clear();
        ranked.extend(window(self.size, index, REACH).map(error_of));
        let rank = rank(ranked.len());
        *ranked.select_nth_unstable_by(rank, f32::total_cmp).1
    }

    /// Spreads of the pixel `index` and of the pixels after it that are not exact and whose windows the border does not cut
    /// off.
    fn inner_spreads(&self, index: usize) -> f32x8 {
        let at = |plane: &[f32], index: usize| {
            f32x8::from(<[f32; LANES]>::try_from(&plane[index..][..LANES]).unwrap_or([0.0; LANES]))
        };
        let mean = at(&self.mean, index);
        // The largest errors, in descending order; the last of them is the percentile.
        let mut largest = [f32x8::ZERO; SIDE * SIDE - rank(SIDE * SIDE)];
        for y in 0..SIDE {
            for x in 0..SIDE {
                let other = index + y * self.size.width + x - REACH * self.size.width - REACH;
                let error = at(&self.error, other);
                let mut rest =
                    (at(&self.mean, other) - mean).cmp_gt(error * f32x8::splat(self.limit)).blend(f32x8::ZERO, error);
                for kept in &mut largest {
                    (*kept, rest) = (kept.fast_max(rest), kept.fast_min(rest));
                }
            }
        }
        at(&self.error, index).fast_max(largest[largest.len() - 1])
    }
}

/// The largest finite estimate in RGB within [`REACH`] pixels of every pixel, by channel; zero if there is none.
pub fn brightest(mean: &Picture) -> Picture {
    let (size, width) = (mean.size(), mean.size().width);
    let most = |a: &mut [[f32; 3]], b: &[[f32; 3]]| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = std::array::from_fn(|c| if b[c] > a[c] { b[c] } else { a[c] });
        }
    };
    let across = |row: &[[f32; 3]]| {
        let finite: Vec<[f32; 3]> =
            row.iter().map(|rgb| rgb.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 })).collect();
        let mut largest = finite.clone();
        for reach in (1..=REACH).take_while(|reach| *reach < width) {
            most(&mut largest, &finite[reach..]);
            most(&mut largest[reach..], &finite);
        }
        largest
    };
    let rows: Vec<Vec<[f32; 3]>> = mean.par_chunks(width.max(1)).map(across).collect();
    let mut largest = Picture::filled(size, [0.0; 3]);
    largest.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
        rows[y.saturating_sub(REACH)..rows.len().min(y + REACH + 1)].iter().for_each(|row| most(out, row));
    });
    largest
}

/// The noise that limits the displacement of a picture or of its parts: an estimate and its [`spread`].
#[derive(Clone, Copy)]
pub struct Noise<'a> {
    /// The estimate of the whole picture.
    pub estimate: &'a Estimate,
    /// Spread of every pixel and channel of `estimate`, from [`spread`].
    pub spread: &'a Picture,
    /// Maximum displacement in units of `spread`; infinite without a bound.
    pub limit: f32,
}

impl<'a> Noise<'a> {
    /// The noise of an estimate with this [`spread`], and with the [`limit`] that its number of samples sets.
    pub fn new(estimate: &'a Estimate, spread: &'a Picture) -> Noise<'a> {
        Noise { estimate, spread, limit: limit(estimate.samples) }
    }

    /// Whether the value of pixel `index` is known: all of its samples are equal, and nothing around it doubts them.
    pub fn is_certain(&self, index: usize) -> bool {
        self.spread[index] == [0.0; 3] && self.estimate.is_exact(index)
    }
}

/// Numbers of pixels that the finish has clamped in any channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clamped {
    /// Pixels clamped to zero: equation (6) subtracts bandwidth levels from each other, and denoisers overshoot.
    pub below_zero: u64,
    /// Pixels clamped to the brightest estimate around them.
    pub too_bright: u64,
}

/// Moves every pixel of the estimate `mean` towards `denoised` within the limit of `noise`, clamped between zero and, if
/// there is a limit, `brightest`, the [`brightest`] estimates of `mean`. Also counts the clamped pixels. Certain pixels stay.
///
/// Values of `denoised` that are not finite are ignored; they replace values of `mean` that are not finite.
pub fn displace(mean: &Picture, denoised: &Picture, noise: Noise<'_>, brightest: &Picture) -> (Picture, Clamped) {
    let Noise { spread, limit, .. } = noise;
    let displaced = |index: usize, c: usize| {
        let (m, d) = (mean[index][c], denoised[index][c]);
        match (m.is_finite(), d.is_finite()) {
            (true, true) if limit.is_infinite() => {
                if noise.is_certain(index) {
                    m
                } else {
                    d
                }
            }
            (true, true) => {
                let most = limit * spread[index][c];
                m + (d - m).clamp(-most, most)
            }
            (true, false) => m,
            (false, true) => d,
            (false, false) => 0.0,
        }
    };
    let of_pixel = |index: usize| {
        let brightest = if limit.is_infinite() { [f32::MAX; 3] } else { brightest[index] };
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
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 40, height: 30 };

    fn noise(seed: u64, index: usize) -> f32 {
        Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel)
    }

    fn plane(of: impl Fn(usize) -> f32 + Sync + Send) -> Picture {
        Picture::from_fn(SIZE, |index| [of(index), 2.0 * of(index), 0.5 * of(index)])
    }

    fn estimate(mean: &Picture, deviation: Picture) -> Estimate {
        Estimate::unguided(mean.clone(), deviation)
    }

    fn bounded(mean: &Picture, denoised: &Picture, spread: &Picture) -> Picture {
        displace(mean, denoised, Noise::new(&estimate(mean, spread.clone()), spread), &brightest(mean)).0
    }

    /// Spreads and brightest estimates are those of each window alone, in pictures with and without windows that the
    /// border does not cut off, and with values that are not finite.
    #[test]
    fn windows_agree_with_their_definition() {
        for (width, height) in [(40, 30), (15, 9), (14, 40), (6, 5), (1, 1)] {
            let size = Size { width, height };
            let value = |seed: u64, i: usize, c: usize| {
                let u = noise(seed, 3 * i + c);
                [f32::NAN, f32::INFINITY, -1.0, 0.0].get((64.0 * u) as usize).copied().unwrap_or(u)
            };
            let picture = |seed| Picture::from_fn(size, |i| std::array::from_fn(|c| value(seed, i, c)));
            let estimate = estimate(&picture(7), picture(8).map(|error| 0.2 * error));
            let (spread, brightest) = (spread(&estimate), brightest(&estimate.mean));
            for (i, c) in (0..size.pixels()).flat_map(|i| [(i, 0), (i, 1), (i, 2)]) {
                let (mean, error) = (|i: usize| estimate.mean[i][c], |i: usize| known(estimate.deviation[i][c]));
                let apart = |other: usize| match estimate.is_exact(i) {
                    true => (mean(other) - mean(i)).abs(),
                    false => mean(other) - mean(i),
                };
                let reached = |other: usize| if apart(other) > LIMIT * error(other) { 0.0 } else { error(other) };
                let mut errors: Vec<f32> = window(size, i, REACH).map(reached).collect();
                errors.sort_by(f32::total_cmp);
                let around = errors[(PERCENTILE * (errors.len() - 1) as f32).round() as usize];
                let own = if estimate.is_exact(i) { 0.0 } else { error(i) };
                assert_eq!(spread[i][c], own.max(around), "{size:?} {i}");
                let finite = window(size, i, REACH).map(mean).filter(|mean| mean.is_finite());
                assert_eq!(brightest[i][c], finite.fold(0.0, f32::max), "{size:?} {i}");
            }
        }
    }

    /// Few samples that all took the same way through glass leave no dot among noisy pixels. A lamp beside a noisy floor
    /// keeps its value.
    #[test]
    fn equal_samples_are_certain_only_where_nothing_around_doubts_them() {
        let dot = 15 * SIZE.width + 20;
        for (value, certain) in [(0.9, false), (5.0, true)] {
            let mean = plane(|index| if index == dot { value } else { 1.0 + 0.2 * (noise(3, index) - 0.5) });
            let noisy = estimate(&mean, plane(|index| if index == dot { 0.0 } else { 0.05 }));
            let noisy = Estimate { samples: Some(8), ..noisy };
            assert!(noisy.is_exact(dot));
            let spread = spread(&noisy);
            let noise = Noise::new(&noisy, &spread);
            for noise in [noise, Noise { limit: f32::INFINITY, ..noise }] {
                let (out, _) = displace(&mean, &plane(|_| 1.0), noise, &brightest(&mean));
                assert_eq!(out[dot][0], if certain { value } else { 1.0 }, "{}", noise.limit);
            }
        }
    }

    /// Student's quantiles that exclude 0.27 %, from tables.
    #[test]
    fn few_samples_widen_the_bound() {
        for (samples, expected) in [(2, 235.8), (3, 19.21), (4, 9.219), (8, 4.530), (32, 3.261), (1_000_000, 3.0)] {
            assert!((limit(Some(samples)) / expected - 1.0).abs() < 1e-3, "{samples}: {}", limit(Some(samples)));
        }
        assert_eq!((limit(None), limit(Some(1)), limit(Some(0))), (LIMIT, f32::INFINITY, f32::INFINITY));
    }

    /// Two samples that both missed the light are no reason to keep a black pixel; a thousand are. Without any known
    /// noise the picture is the denoised one, even where all around is black.
    #[test]
    fn unknown_noise_keeps_no_dot() {
        let dot = 15 * SIZE.width + 20;
        let mean = plane(|index| if index == dot { 0.0 } else { 1.0 + 0.2 * (noise(3, index) - 0.5) });
        let error = plane(|index| if index == dot { 0.0 } else { 0.01 });
        let finished = |samples| {
            let estimate = Estimate { samples: Some(samples), ..estimate(&mean, error.clone()) };
            let spread = spread(&estimate);
            displace(&mean, &plane(|_| 1.0), Noise::new(&estimate, &spread), &brightest(&mean)).0[dot][0]
        };
        assert!(finished(2) > 0.9 && finished(1000) < 0.1, "{} {}", finished(2), finished(1000));
        let black = estimate(&plane(|_| 0.0), plane(|_| f32::INFINITY));
        let black = Estimate { samples: Some(1), ..black };
        let spread = spread(&black);
        let out = displace(&black.mean, &plane(|_| 0.5), Noise::new(&black, &spread), &brightest(&black.mean)).0;
        assert_eq!(out[dot][0], 0.5);
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
        let loose = plane(|_| 1e6);
        let noisy = estimate(&mean, loose.clone());
        let count = |value: f32| displace(&mean, &plane(|_| value), Noise::new(&noisy, &loose), &brightest(&mean)).1;
        let pixels = SIZE.pixels() as u64;
        assert_eq!(count(-1e6), Clamped { below_zero: pixels, too_bright: 0 });
        assert_eq!(count(1e6), Clamped { below_zero: 0, too_bright: pixels });
        assert_eq!(count(0.9), Clamped::default());
    }

    /// Equation (6) can make negative estimates. They are clamped also without a denoiser.
    #[test]
    fn negative_estimates_are_clamped() {
        let mean = plane(|index| if index % 7 == 0 { -0.25 } else { 1.0 });
        let none = plane(|_| 0.0);
        let exact = estimate(&mean, none.clone());
        let (out, clamped) = displace(&mean, &mean, Noise::new(&exact, &none), &brightest(&mean));
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
    /// have missed it, and so do black pixels of alpha zero among others that show the light of a medium.
    #[test]
    fn empty_pixels_have_no_spread_and_black_surfaces_have_one() {
        let covered = |index: usize| index % SIZE.width < 20;
        let foggy = |index: usize| index % SIZE.width >= 30;
        let mean = plane(|index| if index % 2 == 0 && (covered(index) || foggy(index)) { 1.0 } else { 0.0 });
        let alpha = (0..SIZE.pixels()).map(|index| f32::from(u8::from(covered(index)))).collect();
        let noisy = Estimate { alpha: Some(alpha), ..estimate(&mean, mean.clone()) };
        let spread = spread(&noisy);
        let inside = |index: usize| match index % SIZE.width {
            0..20 => index % SIZE.width + REACH < 20,
            20..30 => index % SIZE.width + REACH < 30,
            x => x >= 30 + REACH,
        };
        for (index, spread) in spread.iter().enumerate().filter(|(index, _)| inside(*index)) {
            let has_light = covered(index) || foggy(index);
            assert!(if has_light { spread[0] == 1.0 } else { *spread == [0.0; 3] }, "pixel {index}: {spread:?}");
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
