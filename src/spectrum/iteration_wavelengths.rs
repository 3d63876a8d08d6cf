//! The wavelengths of one pass.

use super::WavelengthSample;
use crate::random::mix;

/// One wavelength in each band, at the same place in all of them. Whatever paths of a pass meet, if they are of one
/// band, they are of one wavelength. Over all seeds the place is uniform in every pass.
#[derive(Clone, Copy, Debug)]
pub struct IterationWavelengths {
    offset: f32,
}

impl IterationWavelengths {
    /// Of pass `pass` of a render with `seed`: places of successive passes fill the bands evenly, by the golden ratio.
    pub fn new(seed: u64, pass: u64) -> IterationWavelengths {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        IterationWavelengths { offset: ((pass as f64 * GOLDEN + start(seed)) % 1.0) as f32 }
    }

    /// For passes whose paths meet photons of the pass before: places move to and fro with the square root of the
    /// number of passes. Over a render they are everywhere, and their steps shrink as bandwidths do, and with them the
    /// difference of wavelengths that meet.
    pub fn drifting(seed: u64, pass: u64) -> IterationWavelengths {
        let at = ((pass as f64).sqrt() + 2.0 * start(seed)) % 2.0;
        IterationWavelengths { offset: (if at < 1.0 { at } else { 2.0 - at }) as f32 }
    }

    /// The wavelength of its band.
    #[inline]
    pub fn nearest(self, wavelength: WavelengthSample) -> WavelengthSample {
        WavelengthSample::within(wavelength.band().0, self.offset)
    }
}

/// Where the passes of a render begin, uniform in `[0, 1)`.
fn start(seed: u64) -> f64 {
    (mix(seed ^ 0x51ed_270b_8f7c_2a35) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::BANDS;

    /// Places are uniform over seeds in every pass, and over the passes of a render; slow ones take steps that shrink.
    #[test]
    fn places_are_uniform() {
        // Kolmogorov's distance of 4000 uniform numbers exceeds 2.2 / sqrt(4000) with probability 1e-4.
        let distance = |mut offsets: Vec<f32>| {
            offsets.sort_by(f32::total_cmp);
            let n = offsets.len() as f32;
            offsets.iter().enumerate().map(|(i, x)| (x - i as f32 / n).abs()).fold(0.0, f32::max)
        };
        for wavelengths in [IterationWavelengths::new, IterationWavelengths::drifting] {
            for pass in [0, 1, 7] {
                assert!(
                    distance((0..4000).map(|seed| wavelengths(seed, pass).offset).collect()) < 0.035,
                    "pass {pass}"
                );
            }
            assert!(distance((1..4000).map(|pass| wavelengths(3, pass).offset).collect()) < 0.02);
        }
        assert!(distance((1..40).map(|pass| IterationWavelengths::new(3, pass).offset).collect()) < 0.08);
        for pass in 1..4000u64 {
            let step = (IterationWavelengths::drifting(3, pass).offset
                - IterationWavelengths::drifting(3, pass + 1).offset)
                .abs();
            assert!(f64::from(step) < 0.51 / (pass as f64).sqrt(), "{pass}: {step}");
        }
    }

    /// The hues of a pass are one to a band, and stay in their band.
    #[test]
    fn hues_keep_their_band() {
        for (seed, i) in (0..1000).map(|i| (i % 7, i)) {
            let wavelength = WavelengthSample::new(i as f32 / 1000.0);
            let near = IterationWavelengths::new(seed, 5).nearest(wavelength);
            assert_eq!(near.wavelength().band, wavelength.wavelength().band, "{near:?}");
            assert!((near.0 - wavelength.0).abs() <= 1.0 / f32::from(BANDS) + 1e-6);
            assert_eq!(near, IterationWavelengths::new(seed, 5).nearest(near));
        }
    }
}
