//! The largest errors of a picture, which few pixels of a pilot tell of: a power law through those above a quantile.
//!
//! If a sample's square exceeds x with probability `(x / c)^(-1/h)`, so does the squared error of the mean of n samples where x is large, n times as often and
//! at `1/n^2` of the size: quantiles fall as `n^(h - 2)`. Where h is at most one the squares have a mean, and what is asked for falls as `1/n`.

/// Share of the pixels that the law is fitted to, and least number of them.
const FITTED: (f64, usize) = (0.05, 5);
/// Largest h that is believed: pilots of a few iterations, whose variances are themselves rough, show larger ones than longer pilots of the same view do.
const STEEPEST: f64 = 1.25;

/// A power law: the share q of the pixels has errors of at least `error * (share / q)^h`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tail {
    share: f64,
    error: f64,
    h: f64,
}

impl Tail {
    /// The law through the largest of some errors, which it puts last. Its exponent is the mean of their logarithms over the least of them \[Hill 1975\].
    pub fn of(errors: &mut [f64]) -> Tail {
        const NONE: Tail = Tail { share: 1.0, error: 0.0, h: 0.0 };
        let count = ((errors.len() as f64 * FITTED.0) as usize).max(FITTED.1);
        let Some(at) = errors.len().checked_sub(count + 1) else { return NONE };
        let (_, &mut error, largest) = errors.select_nth_unstable_by(at, f64::total_cmp);
        if error.is_nan() || error <= 0.0 {
            return NONE;
        }
        let h = largest.iter().map(|e| (e / error).ln()).sum::<f64>() / count as f64;
        Tail { share: count as f64 / errors.len() as f64, error, h: h.clamp(0.0, STEEPEST) }
    }

    /// What pixels between the quantiles `1 - most` and `1 - least` add to the mean.
    pub fn sum(&self, least: f64, most: f64) -> f64 {
        let power = 1.0 - self.h;
        let integral =
            if power.abs() < 1e-6 { (most / least).ln() } else { (most.powf(power) - least.powf(power)) / power };
        self.error * self.share.powf(self.h) * integral
    }

    /// What becomes of such a sum after `n` times as many samples.
    pub fn after(&self, n: f64) -> f64 {
        n.powf(self.h.max(1.0) - 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    const PIXELS: u64 = 40_000;

    /// Squared errors of means of `n` samples of either sign whose squares have a power law.
    fn errors(h: f64, n: u64) -> Vec<f64> {
        let sample = |pixel, i| {
            let u = Stream::new(3, i, Domain::Test, pixel).vertex(0).two(Purpose::Pixel);
            (f64::from(u.y) - 0.5).signum() * (1.0 - f64::from(u.x)).max(1e-9).powf(-0.5 * h)
        };
        (0..PIXELS).map(|pixel| ((0..n).map(|i| sample(pixel, i)).sum::<f64>() / n as f64).powi(2)).collect()
    }

    /// Mean over all pixels of those between two quantiles.
    fn between(errors: &[f64], least: f64, most: f64) -> f64 {
        let mut sorted = errors.to_vec();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let at = |share: f64| (share * sorted.len() as f64) as usize;
        sorted[at(least)..at(most)].iter().sum::<f64>() / sorted.len() as f64
    }

    /// Exponents within five standard errors (h / sqrt(k), k the number fitted), sums within a tenth.
    #[test]
    fn laws_are_found() {
        for h in [0.3, 0.8, 1.2] {
            let mut errors = errors(h, 1);
            let tail = Tail::of(&mut errors);
            assert!((tail.h - h).abs() < 5.0 * h / (FITTED.0 * PIXELS as f64).sqrt(), "{h}: {tail:?}");
            let (told, found) = (tail.sum(0.001, 0.01), between(&errors, 0.001, 0.01));
            assert!((told / found - 1.0).abs() < 0.1, "{h}: {told} for {found}");
        }
    }

    /// With sixteen times as many samples, heavy tails fall less than others: within a quarter of what is said. Had they fallen as 1/n, they would be at 0.0625.
    #[test]
    fn heavy_tails_fall_slowly() {
        let ratio = |h: f64| between(&errors(h, 256), 0.001, 0.01) / between(&errors(h, 16), 0.001, 0.01);
        for h in [0.3, 1.4] {
            let tail = Tail { share: 0.05, error: 1.0, h };
            let (told, found) = (tail.after(16.0), ratio(h));
            println!("{h}: {told} for {found}");
            assert!((told / found).ln().abs() < 0.25, "{h}: {told} for {found}");
        }
        assert!(ratio(1.4) > 2.0 / 16.0);
    }

    #[test]
    fn a_few_pixels_or_none_have_no_tail() {
        for errors in [&mut [][..], &mut [1.0; 5], &mut [0.0; 100]] {
            assert_eq!(Tail::of(errors).sum(0.001, 0.01), 0.0);
        }
    }
}
