//! The light of the picture as a whole, which a denoiser within its bounds would lessen.
//!
//! A rare bright sample goes down as far as its own large standard error allows, while the pixels that have not met
//! one are held by their small ones. One such sample tells little. Many of them carry light together, and the picture
//! would be too dark without it. So the light that all pixels have lost is given back as far as it is significant
//! ([`significant`]): first where the denoiser wanted more than it was allowed, then in proportion to the light that is
//! there.

use super::Estimate;
use super::bound::{LIMIT, brightest};
use crate::film::Picture;
use rayon::prelude::*;

/// Light by channel.
type Light = [f64; 3];

/// Share of the light that may be lost: with so little of it more noise would come back than is worth it.
const TOLERATED: f64 = 0.04;

/// The part of the light that is lost of a `total` which neither its variance explains nor [`TOLERATED`] allows. One
/// bright sample is its own standard error, and nothing of it is left; of k equal ones `1 - 1 / k^2`.
fn significant(lost: f64, variance: f64, total: f64) -> f64 {
    let explained = (variance + (TOLERATED * total).powi(2)) / (lost * lost);
    if explained < 1.0 { lost * (1.0 - explained * explained) } else { 0.0 }
}

/// A denoised picture within its bounds, and what they follow from.
struct Balance<'a> {
    picture: &'a Picture,
    mean: &'a Picture,
    denoised: &'a Picture,
    estimate: &'a Estimate,
    /// The light that pixels are to get, all together; negative where they have too much.
    given: Light,
    /// [`LIMIT`] times the root mean square error of the pixels that show no more than noise: any pixel may have missed
    /// what they have met.
    missed: Light,
}

/// Gives back to `picture` what it has lost or gained against its estimate `mean`, of the whole picture or of a part;
/// `estimate` and `spread` have the errors of the whole. No pixel ends farther from its estimate than [`LIMIT`] times
/// its spread, or the root mean square error of pixels that show no more than noise.
pub fn give_back(
    picture: &mut Picture,
    (mean, denoised): (&Picture, &Picture),
    (estimate, spread): (&Estimate, &Picture),
) {
    let balance = Balance::of(picture, (mean, denoised), estimate);
    let wishes = balance.sum(|i, c| balance.wish(i, c));
    let light = balance.sum(|i, c| f64::from(picture[i][c]));
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    let given = balance.given;
    let granted: Light = std::array::from_fn(|c| given[c].abs().min(wishes[c]).copysign(given[c]));
    let changed = |i: usize| -> [f32; 3] {
        if !balance.counts(i) {
            return picture[i];
        }
        let brightest = brightest(mean, i);
        std::array::from_fn(|c| {
            let of_wish = ratio(granted[c], wishes[c]) * balance.wish(i, c);
            let value = f64::from(picture[i][c]);
            let of_light = ratio(given[c] - granted[c], light[c]) * value;
            let (own, missed) = (f64::from(mean[i][c]), balance.missed[c]);
            let most = (f64::from(LIMIT) * f64::from(spread[i][c])).max(missed);
            let value = (value + of_wish + of_light).clamp(own - most, own + most);
            value.min(f64::from(brightest[c]).max(missed)).max(0.0) as f32
        })
    };
    *picture = Picture::from_fn(picture.size(), changed);
}

/// Pixels that are summed together.
const CHUNK: usize = 4096;

impl<'a> Balance<'a> {
    fn of(picture: &'a Picture, (mean, denoised): (&'a Picture, &'a Picture), estimate: &'a Estimate) -> Balance<'a> {
        let [given, missed] = [[0.0; 3]; 2];
        let balance = Balance { picture, mean, denoised, estimate, given, missed };
        let lost = balance.sum(|i, c| f64::from(mean[i][c]) - f64::from(picture[i][c]));
        let total = balance.sum(|i, c| f64::from(mean[i][c]));
        let variance = balance.sum(|i, c| balance.error(i, c).powi(2));
        let is_noise = |i: usize, c: usize| f64::from(mean[i][c]) <= f64::from(LIMIT) * balance.error(i, c);
        let of_noise = balance.sum(|i, c| if is_noise(i, c) { balance.error(i, c).powi(2) } else { 0.0 });
        let [pixels, ..] = balance.sum(|_, _| 1.0);
        let given = std::array::from_fn(|c| significant(lost[c], variance[c], total[c]));
        let missed = of_noise.map(|square| f64::from(LIMIT) * (square / pixels.max(1.0)).sqrt());
        Balance { given, missed, ..balance }
    }

    fn error(&self, i: usize, c: usize) -> f64 {
        f64::from(self.estimate.deviation[i][c])
    }

    /// Whether all that is known of a pixel is a number, and noise.
    fn counts(&self, i: usize) -> bool {
        let finite = |plane: &Picture| plane[i].iter().all(|value| value.is_finite());
        finite(self.mean) && finite(self.denoised) && finite(&self.estimate.deviation) && !self.estimate.is_exact(i)
    }

    /// Sums over the pixels that count, by chunks that do not depend on the number of threads.
    fn sum(&self, of: impl Fn(usize, usize) -> f64 + Sync) -> Light {
        let pixels = self.picture.len();
        let chunk = |start: usize| {
            let counted = (start..(start + CHUNK).min(pixels)).filter(|i| self.counts(*i));
            counted.fold([0.0; 3], |sum, i| std::array::from_fn(|c| sum[c] + of(i, c)))
        };
        let parts: Vec<Light> = (0..pixels).into_par_iter().step_by(CHUNK).map(chunk).collect();
        parts.iter().fold([0.0; 3], |sum, part| std::array::from_fn(|c| sum[c] + part[c]))
    }

    /// How much nearer to the denoised picture the pixel may come: by the share of it that may be other light than it
    /// has met.
    fn wish(&self, i: usize, c: usize) -> f64 {
        let (value, error) = (f64::from(self.mean[i][c]), f64::from(LIMIT) * self.error(i, c));
        let doubt = if value > error { error / value } else { 1.0 };
        let apart = (f64::from(self.denoised[i][c]) - f64::from(self.picture[i][c])) * self.given[c].signum();
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

    /// Pixels of [`SAMPLES`] samples, of which each shows `1 / rate` with the probability `rate` and nothing otherwise,
    /// on top of a light of a tenth with hardly any noise.
    fn rare(rate: f32, seed: u64, unit: f32) -> Estimate {
        let pixel = |index: usize| {
            let draws = |sample| Stream::new(seed, sample, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            let hits = (0..u64::from(SAMPLES)).filter(|sample| draws(*sample) < rate).count() as f32;
            let of_one = 1.0 / (rate * SAMPLES as f32);
            [[unit * (0.1 + hits * of_one); 3], [unit * (0.01 + hits.sqrt() * of_one); 3]]
        };
        let [mean, deviation] = [0, 1].map(|which| Picture::from_fn(SIZE, |index| pixel(index)[which]));
        Estimate { mean, deviation, albedo: None, normal: None, alpha: None }
    }

    fn mean(picture: &Picture) -> f32 {
        picture.iter().map(|rgb| rgb[1]).sum::<f32>() / picture.len() as f32
    }

    /// The picture within its bounds alone, and with the light given back, by a denoiser that returns a constant.
    fn finished(estimate: &Estimate, constant: f32) -> [Picture; 2] {
        let (denoised, spread) = (Picture::filled(SIZE, [constant; 3]), spread(estimate));
        let (within, _) = displace(&estimate.mean, &denoised, &spread);
        let mut whole = within.clone();
        give_back(&mut whole, (&estimate.mean, &denoised), (estimate, &spread));
        [within, whole]
    }

    /// Samples that one pixel in thirty meets carry ten times the light of all others. By the bounds alone nearly all
    /// of it would go, whether the denoiser knows of it (1.1) or not (0.1). Of k such samples 1 / k^2 may be lost: of
    /// the 64 that are expected next to nothing.
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

    /// A single bright sample is no evidence, and what has no noise is not touched.
    #[test]
    fn one_bright_sample_is_let_go() {
        let mut estimate = rare(1e-9, 1, 1.0);
        (estimate.mean[777], estimate.deviation[777]) = ([1000.0; 3], [1000.0; 3]);
        let exact = |index: usize| index.is_multiple_of(5);
        (0..SIZE.pixels()).filter(|i| exact(*i)).for_each(|i| estimate.deviation[i] = [0.0; 3]);
        let [within, whole] = finished(&estimate, 0.1);
        let brightest = whole.iter().map(|rgb| rgb[0]).fold(0.0, f32::max);
        assert!(mean(&whole) < 1.02 * mean(&within) && brightest < 0.2, "{brightest}");
        assert!((0..SIZE.pixels()).filter(|i| exact(*i)).all(|i| whole[i] == estimate.mean[i]));
    }

    /// A picture in another unit is the same picture, to the last bit for a power of two.
    #[test]
    fn the_unit_of_light_is_free() {
        let rate = 1.0 / 30.0 / SAMPLES as f32;
        let [_, one] = finished(&rare(rate, 5, 1.0), 0.5);
        for exponent in [-60, -7, 40] {
            let unit = 2f32.powi(exponent);
            let [_, other] = finished(&rare(rate, 5, unit), 0.5 * unit);
            assert!(one.iter().flatten().zip(other.iter().flatten()).all(|(one, other)| one * unit == *other));
        }
    }

    /// With standard errors that fall the picture tends to its estimate, whatever the denoiser.
    #[test]
    fn it_is_consistent() {
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
