//! What a render has left out because it was not finite, and when that is too much.

use crate::estimator::PixelAccumulator;
use crate::transport::Cause;
use serde_json::{Map, Value, json};

/// Share of the samples above which a picture may be wrong for want of them.
const ALLOWED: f64 = 1e-6;

/// Counts of what was left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rejections {
    /// Samples of pixels that were looked at, rejected ones included.
    samples: u64,
    /// Rejected samples, in the order of [`Cause::ALL`].
    by_cause: [u64; Cause::ALL.len()],
    /// Photons that were left out of their map, and light paths that ended.
    light: u64,
    /// Eye paths whose albedo, normal or depth was left out.
    features: u64,
}

impl Rejections {
    /// Those of pixels, and of the light paths that served them.
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

    /// Samples that were rejected.
    pub fn rejected(&self) -> u64 {
        self.by_cause.iter().sum()
    }

    /// What was left out, by the names of the header's `rejected_by`.
    fn counts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let samples = Cause::ALL.into_iter().map(Cause::name).zip(self.by_cause);
        samples.chain([("light_paths", self.light), ("features", self.features)])
    }

    /// For the header.
    pub fn header(&self) -> Map<String, Value> {
        self.counts().map(|(name, count)| (name.to_owned(), json!(count))).collect()
    }

    /// For people; `None` where nothing was left out.
    pub fn sentence(&self) -> Option<String> {
        let there: Vec<String> = self
            .counts()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{} {count}", name.replace('_', " ")))
            .collect();
        let (rejected, samples) = (self.rejected(), self.samples);
        (!there.is_empty()).then(|| {
            format!(
                "{rejected} of {samples} samples were not finite and are left out ({}); the layer Rejected shows where",
                there.join(", ")
            )
        })
    }

    /// Whether so much is missing that the picture may be wrong: light paths count as samples do, features do not.
    pub fn are_too_many(&self) -> bool {
        (self.rejected() + self.light) as f64 > ALLOWED * self.samples as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use crate::transport::PixelSample;

    /// One sample of a million is none too many, two are.
    #[test]
    fn more_than_one_in_a_million_is_many() {
        let pixel = |broken: u64| {
            let mut pixel = PixelAccumulator::new(1, 0, [1.0; 2]);
            for pass in 1..=1000 {
                let mut measure = PixelSample { direct: Rgb::ONE, ..PixelSample::default() };
                if pass <= broken {
                    measure.reject(Cause::Connection);
                }
                pixel.add(pass, &measure, None);
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
        let said =
            "2 of 1000000 samples were not finite and are left out (connection 2); the layer Rejected shows where";
        assert_eq!(two.sentence().as_deref(), Some(said));
    }
}
