//! The wavelengths of one iteration.

use super::WavelengthSample;
use crate::random::mix;

/// The wavelengths that the paths of one iteration of a render may take: one in each of the bands of the spectrum, at
/// an equal offset. So two paths of one band have one wavelength when they are connected. Over all seeds the offset is
/// uniform in every iteration.
#[derive(Clone, Copy, Debug)]
pub struct IterationWavelengths {
    /// Position of the wavelengths within their bands, in `[0, 1)`.
    offset: f32,
}

impl IterationWavelengths {
    /// The wavelengths of an iteration of a render with `seed`. Offsets within the bands advance by the golden ratio
    /// per iteration, so they fill the bands evenly.
    pub fn new(seed: u64, iteration: u64) -> IterationWavelengths {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        IterationWavelengths { offset: ((iteration as f64 * GOLDEN + first_offset(seed)) % 1.0) as f32 }
    }

    /// The wavelengths of an iteration whose camera paths merge photons of the iteration before. The offset within the
    /// bands moves back and forth with the square root of the iteration number, so consecutive iterations have similar
    /// wavelengths. It covers the whole band in the long run, and its steps shrink as bandwidths do.
    pub fn drifting(seed: u64, iteration: u64) -> IterationWavelengths {
        let at = ((iteration as f64).sqrt() + 2.0 * first_offset(seed)) % 2.0;
        IterationWavelengths { offset: (if at < 1.0 { at } else { 2.0 - at }) as f32 }
    }

    /// The iteration's only wavelength in the band that contains `wavelength`.
    #[inline]
    pub fn nearest(self, wavelength: WavelengthSample) -> WavelengthSample {
        WavelengthSample::within(wavelength.band().0, self.offset)
    }
}

/// Offset within the bands in iteration 0 of a render with `seed`, uniform in `[0, 1)` over seeds.
fn first_offset(seed: u64) -> f64 {
    (mix(seed ^ 0x51ed_270b_8f7c_2a35) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::BANDS;

    /// Offsets are uniform over seeds in every iteration, and over the iterations of a render. The steps of drifting
    /// offsets shrink.
    #[test]
    fn offsets_are_uniform() {
        // Kolmogorov's distance of 4000 uniform numbers exceeds 2.2 / sqrt(4000) with probability 1e-4.
        let distance = |mut offsets: Vec<f32>| {
            offsets.sort_by(f32::total_cmp);
            let n = offsets.len() as f32;
            offsets.iter().enumerate().map(|(i, x)| (x - i as f32 / n).abs()).fold(0.0, f32::max)
        };
        for wavelengths in [IterationWavelengths::new, IterationWavelengths::drifting] {
            for iteration in [0, 1, 7] {
                assert!(
                    distance((0..4000).map(|seed| wavelengths(seed, iteration).offset).collect()) < 0.035,
                    "iteration {iteration}"
                );
            }
            assert!(distance((1..4000).map(|iteration| wavelengths(3, iteration).offset).collect()) < 0.02);
        }
        assert!(distance((1..40).map(|iteration| IterationWavelengths::new(3, iteration).offset).collect()) < 0.08);
        for iteration in 1..4000u64 {
            let step = (IterationWavelengths::drifting(3, iteration).offset
                - IterationWavelengths::drifting(3, iteration + 1).offset)
                .abs();
            assert!(f64::from(step) < 0.51 / (iteration as f64).sqrt(), "{iteration}: {step}");
        }
    }

    /// An iteration has one wavelength per band, and `nearest` keeps the band.
    #[test]
    fn the_nearest_wavelength_is_in_the_same_band() {
        for (seed, i) in (0..1000).map(|i| (i % 7, i)) {
            let wavelength = WavelengthSample::new(i as f32 / 1000.0);
            let near = IterationWavelengths::new(seed, 5).nearest(wavelength);
            assert_eq!(near.wavelength().band, wavelength.wavelength().band, "{near:?}");
            assert!((near.0 - wavelength.0).abs() <= 1.0 / f32::from(BANDS) + 1e-6);
            assert_eq!(near, IterationWavelengths::new(seed, 5).nearest(near));
        }
    }
}
