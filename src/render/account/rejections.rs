//! Counts of samples, photons and light paths that were rejected because they were not finite.

use crate::estimator::PixelAccumulator;
use crate::transport::Cause;
use serde_json::{Map, Value, json};

/// Share of rejected samples among all samples above which the picture may be wrong.
const MAX_REJECTED_SHARE: f64 = 1e-6;

/// Counts of samples, photons and light paths that were rejected because they were not finite.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rejections {
    /// Number of samples of all pixels, rejected ones included.
    samples: u64,
    /// Number of rejected samples by cause, in the order of [`Cause::ALL`].
    by_cause: [u64; Cause::ALL.len()],
    /// Number of photons that were rejected, and so are not in their map, and of light paths that ended early.
    light: u64,
    /// Number of camera paths whose albedo, normal or depth was rejected.
    features: u64,
}

impl Rejections {
    /// Adds up the counts of `pixels`. `light` is the number of rejected photons and light paths.
    pub fn count(pixels: &[PixelAccumulator], light: u64) -> Rejections {
        let mut all = Rejections { light, ..Rejections::default() };
        for pixel in pixels {
            let by_cause = pixel.rejected.by_cause().map(u64::from);
            all.samples += u64::from(pixel.iterations) + by_cause.iter().sum::<u64>();
            all.features += u64::from(pixel.features_rejected());
            all.by_cause.iter_mut().zip(by_cause).for_each(|(sum, count)| *sum += count);
        }
        all
    }

    /// Number of rejected samples of all pixels, by any cause.
    pub fn rejected(&self) -> u64 {
        self.by_cause.iter().sum()
    }

    /// Names and counts of the key `rejected_by` in the EXR's header: samples by cause, light paths and features.
    fn counts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let samples = Cause::ALL.into_iter().map(Cause::name).zip(self.by_cause);
        samples.chain([("light_paths", self.light), ("features", self.features)])
    }

    /// The value of the key `rejected_by` in the EXR's header: counts by cause.
    pub fn header(&self) -> Map<String, Value> {
        self.counts().map(|(name, count)| (name.to_owned(), json!(count))).collect()
    }

    /// A sentence for users about rejected samples; `None` if nothing was rejected.
    pub fn sentence(&self) -> Option<String> {
        let counts: Vec<String> = self
            .counts()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{} {count}", name.replace('_', " ")))
            .collect();
        let (rejected, samples) = (self.rejected(), self.samples);
        (!counts.is_empty()).then(|| {
            format!(
                "{rejected} of {samples} samples were not finite and are left out ({}); the layer Rejected shows where",
                counts.join(", ")
            )
        })
    }

    /// Whether the share of rejected samples and light paths is so large that the picture may be wrong. Rejected
    /// albedos, normals and depths do not count.
    pub fn are_too_many(&self) -> bool {
        (self.rejected() + self.light) as f64 > MAX_REJECTED_SHARE * self.samples as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use crate::transport::PixelSample;

    #[test]
    fn more_than_one_rejected_sample_in_a_million_is_too_many() {
        let pixel = |broken: u64| {
            let mut pixel = PixelAccumulator::new(1, 0, [1.0; 2]);
            for pass in 1..=1000 {
                let mut sample = PixelSample { direct: Rgb::ONE, ..PixelSample::default() };
                if pass <= broken {
                    sample.reject(Cause::Connection);
                }
                pixel.add(pass, &sample, None);
            }
            pixel
        };
        let mut pixels = vec![pixel(0); 1000];
        assert_eq!(Rejections::count(&pixels, 0).sentence(), None);
        pixels[7] = pixel(1);
        let one = Rejections::count(&pixels, 0);
        assert!(!one.are_too_many() && Rejections::count(&pixels, 1).are_too_many());
        pixels[8] = pixel(1);
        let two = Rejections::count(&pixels, 0);
        assert!(two.are_too_many());
        assert_eq!((two.rejected(), two.header()["connection"].as_u64()), (2, Some(2)));
        let sentence =
            "2 of 1000000 samples were not finite and are left out (connection 2); the layer Rejected shows where";
        assert_eq!(two.sentence().as_deref(), Some(sentence));
    }
}
