//! Conservation of the picture's total light, which the bounded displacement would reduce.
//!
//! A pixel with a rare bright sample has a large standard error and is darkened far; the pixels around it have small
//! standard errors and are brightened little. A single sample is no evidence. Many of them carry real light, and the
//! picture would be too dark without it. So the significant part ([`significant`]) of the light that all pixels have lost
//! together is given back: first where the bound has kept pixels from the denoiser's picture, then in proportion to the
//! light of each pixel.

use super::Estimate;
use super::bound::{Clamped, LIMIT, Noise, brightest, displace};
use crate::film::Picture;
use rayon::prelude::*;

/// Light of a whole picture: the sum over its pixels, for each channel.
type Light = [f64; 3];

/// Share of a picture's total light that the finish may lose: giving back less would add more noise than it is worth.
const TOLERATED_LOSS: f64 = 0.04;
/// Standard errors of the total light that are taken for noise. Light that is given back for noise brightens all surfaces,
/// also those whose brightness is known well.
const NOISE: f64 = 2.0;

/// The part of the `lost` light of a picture with `total` light that neither the `variance` of that total explains nor
/// [`TOLERATED_LOSS`] allows. Bright samples equal their standard errors, so that four equal ones are not significant; of k
/// more, `1 - 16 / k^2` is.
fn significant(lost: f64, variance: f64, total: f64) -> f64 {
    let explained = (NOISE.powi(2) * variance + (TOLERATED_LOSS * total).powi(2)) / (lost * lost);
    if explained < 1.0 { lost * (1.0 - explained * explained) } else { 0.0 }
}

/// A picture after the bounded displacement, and the light that the displacement has lost.
struct Balance<'a> {
    picture: &'a Picture,
    mean: &'a Picture,
    denoised: &'a Picture,
    estimate: &'a Estimate,
    /// Whether each pixel takes part in the balance: its values are finite, and it is not certain.
    counts: Vec<bool>,
    /// Light to give back to all pixels together; negative if they have gained.
    owed: Light,
    /// [`LIMIT`] times the root mean square error of the pixels whose value is below their noise: light that any pixel may
    /// have missed.
    missed: Light,
}

/// Moves the estimate `mean` of the whole picture or of a part towards `denoised` within the bound ([`displace`]), and gives
/// back the light that this loses, if there is a bound. `noise` belongs to the whole picture. Also counts the pixels that
/// the bound has clamped.
pub fn bounded(mean: &Picture, denoised: &Picture, noise: Noise<'_>) -> (Picture, Clamped) {
    let brightest = brightest(mean);
    let (mut picture, clamped) = displace(mean, denoised, noise, &brightest);
    if noise.limit.is_finite() {
        give_back(&mut picture, mean, denoised, noise, &brightest);
    }
    (picture, clamped)
}

/// Gives back the significant light that `picture` has lost, or takes away what it has gained, against its estimate `mean`.
/// `brightest` are the [`brightest`] estimates of `mean`. A pixel stays within the limit of `noise`, or within the
/// light that any pixel may have missed, of its estimate.
fn give_back(picture: &mut Picture, mean: &Picture, denoised: &Picture, noise: Noise<'_>, brightest: &Picture) {
    let Noise { spread, limit, .. } = noise;
    let balance = Balance::new(picture, mean, denoised, noise);
    let shortfall = balance.sum(|i, c| balance.shortfall(i, c));
    let light = balance.sum(|i, c| f64::from(picture[i][c]));
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    let owed = balance.owed;
    let first: Light = std::array::from_fn(|c| owed[c].abs().min(shortfall[c]).copysign(owed[c]));
    let changed = |i: usize| -> [f32; 3] {
        if !balance.counts[i] {
            return picture[i];
        }
        let brightest = brightest[i];
        std::array::from_fn(|c| {
            let by_shortfall = ratio(first[c], shortfall[c]) * balance.shortfall(i, c);
            let value = f64::from(picture[i][c]);
            let by_light = ratio(owed[c] - first[c], light[c]) * value;
            let (own, missed) = (f64::from(mean[i][c]), balance.missed[c]);
            let most = (f64::from(limit) * f64::from(spread[i][c])).max(missed);
            let value = (value + by_shortfall + by_light).clamp(own - most, own + most);
            value.min(f64::from(brightest[c]).max(missed)).max(0.0) as f32
        })
    };
    *picture = Picture::from_fn(picture.size(), changed);
}

/// Pixels that one thread sums.
const CHUNK: usize = 4096;

impl<'a> Balance<'a> {
    fn new(picture: &'a Picture, mean: &'a Picture, denoised: &'a Picture, noise: Noise<'a>) -> Balance<'a> {
        let estimate = noise.estimate;
        let finite = |plane: &Picture, i: usize| plane[i].iter().all(|value| value.is_finite());
        let all_finite = |i: usize| finite(mean, i) && finite(denoised, i) && finite(&estimate.deviation, i);
        let counts = (0..mean.len()).into_par_iter().map(|i| all_finite(i) && !noise.is_certain(i)).collect();
        let [owed, missed] = [[0.0; 3]; 2];
        let balance = Balance { picture, mean, denoised, estimate, counts, owed, missed };
        let lost = balance.sum(|i, c| f64::from(mean[i][c]) - f64::from(picture[i][c]));
        let total = balance.sum(|i, c| f64::from(mean[i][c]));
        let variance = balance.sum(|i, c| balance.error(i, c).powi(2));
        let is_noise = |i: usize, c: usize| f64::from(mean[i][c]) <= f64::from(LIMIT) * balance.error(i, c);
        let of_noise = balance.sum(|i, c| if is_noise(i, c) { balance.error(i, c).powi(2) } else { 0.0 });
        let [pixels, ..] = balance.sum(|_, _| 1.0);
        let owed = std::array::from_fn(|c| significant(lost[c], variance[c], total[c]));
        let missed = of_noise.map(|square| f64::from(LIMIT) * (square / pixels.max(1.0)).sqrt());
        Balance { owed, missed, ..balance }
    }

    fn error(&self, i: usize, c: usize) -> f64 {
        f64::from(self.estimate.deviation[i][c])
    }

    /// Sum, by channel, of a function of (pixel, channel) over the pixels that take part, in chunks that do not depend
    /// on the number of threads.
    fn sum(&self, of: impl Fn(usize, usize) -> f64 + Sync) -> Light {
        let pixels = self.picture.len();
        let chunk = |start: usize| {
            let counted = (start..(start + CHUNK).min(pixels)).filter(|i| self.counts[*i]);
            counted.fold([0.0; 3], |sum, i| std::array::from_fn(|c| sum[c] + of(i, c)))
        };
        let parts: Vec<Light> = (0..pixels).into_par_iter().step_by(CHUNK).map(chunk).collect();
        parts.iter().fold([0.0; 3], |sum, part| std::array::from_fn(|c| sum[c] + part[c]))
    }

    /// Distance in channel `c` that the bound has kept pixel `i` from the denoised picture, at most [`Self::missed`],
    /// times the share of its value that its noise explains.
    fn shortfall(&self, i: usize, c: usize) -> f64 {
        let (value, error) = (f64::from(self.mean[i][c]), f64::from(LIMIT) * self.error(i, c));
        let doubt = if value > error { error / value } else { 1.0 };
        let apart = (f64::from(self.denoised[i][c]) - f64::from(self.picture[i][c])) * self.owed[c].signum();
        doubt * apart.clamp(0.0, self.missed[c])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::finish::bound::{displace, spread};
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 48, height: 40 };
    const SAMPLES: u32 = 64;

    /// Pixels of [`SAMPLES`] samples. Each sample is `1 / rate` with the probability `rate` and zero otherwise, on top of
    /// light of 0.1 with little noise.
    fn rare(rate: f32, seed: u64, unit: f32) -> Estimate {
        let pixel = |index: usize| {
            let draws = |sample| Stream::new(seed, sample, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            let hits = (0..u64::from(SAMPLES)).filter(|sample| draws(*sample) < rate).count() as f32;
            let of_one = 1.0 / (rate * SAMPLES as f32);
            [[unit * (0.1 + hits * of_one); 3], [unit * (0.01 + hits.sqrt() * of_one); 3]]
        };
        let [mean, deviation] = [0, 1].map(|which| Picture::from_fn(SIZE, |index| pixel(index)[which]));
        Estimate::unguided(mean, deviation)
    }

    fn mean(picture: &Picture) -> f32 {
        picture.iter().map(|rgb| rgb[1]).sum::<f32>() / picture.len() as f32
    }

    /// The picture after the bounded displacement towards `constant`, and after its light has been given back.
    fn finished(estimate: &Estimate, constant: f32) -> [Picture; 2] {
        let (denoised, spread) = (Picture::filled(SIZE, [constant; 3]), spread(estimate));
        let (within, _) =
            displace(&estimate.mean, &denoised, Noise::new(estimate, &spread), &brightest(&estimate.mean));
        let (whole, _) = bounded(&estimate.mean, &denoised, Noise::new(estimate, &spread));
        [within, whole]
    }

    /// Samples in one pixel of thirty carry ten times the light of all others. The displacement alone removes nearly all of
    /// it, whether the denoiser keeps it (1.1) or not (0.1). Of k such samples 1 / k^2 may be lost; 64 are expected.
    #[test]
    fn rare_light_stays_in_the_picture() {
        let rate = 1.0 / 30.0 / SAMPLES as f32;
        for (seed, constant) in [(1, 1.1), (2, 0.1), (3, 0.6), (4, 2.0)] {
            let estimate = rare(rate, seed, 1.0);
            let [within, whole] = finished(&estimate, constant).map(|picture| mean(&picture) / mean(&estimate.mean));
            assert!(within < 0.5, "{constant}: {within} of the light within the bounds");
            assert!((whole - 1.0).abs() < 0.01, "{constant}: {whole} of the light");
        }
    }

    /// Up to four bright samples are no evidence, and certain pixels do not change.
    #[test]
    fn few_bright_samples_are_removed() {
        for count in [1, 4] {
            let mut estimate = rare(1e-9, 1, 1.0);
            for bright in [777, 203, 1104, 1511].into_iter().take(count) {
                (estimate.mean[bright], estimate.deviation[bright]) = ([1000.0; 3], [1000.0; 3]);
            }
            let lamp = |index: usize| index.is_multiple_of(5);
            for index in (0..SIZE.pixels()).filter(|index| lamp(*index)) {
                (estimate.mean[index], estimate.deviation[index]) = ([7.0; 3], [0.0; 3]);
            }
            let [within, whole] = finished(&estimate, 0.1);
            let others = |index: &usize| !lamp(*index);
            let brightest = (0..SIZE.pixels()).filter(others).map(|i| whole[i][0]).fold(0.0, f32::max);
            assert!(mean(&whole) < 1.02 * mean(&within) && brightest < 0.2, "{count}: {brightest}");
            assert!((0..SIZE.pixels()).filter(|i| lamp(*i)).all(|i| whole[i] == estimate.mean[i]));
        }
    }

    /// Scaling the light by a power of two scales the result exactly.
    #[test]
    fn the_unit_of_light_does_not_matter() {
        let rate = 1.0 / 30.0 / SAMPLES as f32;
        let [_, one] = finished(&rare(rate, 5, 1.0), 0.5);
        for exponent in [-60, -7, 40] {
            let unit = 2f32.powi(exponent);
            let [_, other] = finished(&rare(rate, 5, unit), 0.5 * unit);
            assert!(one.iter().flatten().zip(other.iter().flatten()).all(|(one, other)| one * unit == *other));
        }
    }

    /// As the standard errors fall, the picture converges to its estimate with any denoiser.
    #[test]
    fn giving_back_is_consistent() {
        let apart = |n: f32| {
            let estimate = rare(0.5, 6, 1.0);
            let deviation = estimate.deviation.map(|error| error / n.sqrt());
            let estimate = Estimate { deviation, ..estimate };
            let [_, whole] = finished(&estimate, 7.0);
            whole.iter().zip(&estimate.mean).map(|(out, mean)| (out[0] - mean[0]).powi(2)).fold(0.0, f32::max)
        };
        assert!(apart(1e5) < 1e-3 * apart(1.0), "{} {}", apart(1e5), apart(1.0));
    }
}
