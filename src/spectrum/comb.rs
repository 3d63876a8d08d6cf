//! The wavelengths of one pass.

use super::Hue;
use crate::random::mix;

/// One wavelength in each band, at the same place in all of them. Whatever paths of a pass meet, if they are of one band, they are of one wavelength.
///
/// From pass to pass the place moves to and fro with the square root of the number of passes: over a render it is everywhere alike, and its
/// steps shrink, so that photons may even be left to the next pass, as bandwidths that shrink allow. Over all seeds it is uniform in every pass.
#[derive(Clone, Copy, Debug)]
pub struct Comb {
    offset: f32,
}

impl Comb {
    /// Of pass `pass` of a render with `seed`.
    pub fn new(seed: u64, pass: u64) -> Comb {
        let start = (mix(seed ^ 0x51ed_270b_8f7c_2a35) >> 11) as f64 * (2.0 / (1u64 << 53) as f64);
        let at = ((pass as f64).sqrt() + start) % 2.0;
        Comb { offset: (if at < 1.0 { at } else { 2.0 - at }) as f32 }
    }

    /// The hue of its band.
    #[inline]
    pub fn nearest(self, hue: Hue) -> Hue {
        Hue::within(hue.band().0, self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::BANDS;

    /// Offsets are uniform over seeds in every pass, and over the passes of a render; steps shrink.
    #[test]
    fn offsets_are_uniform_and_slow_down() {
        // Kolmogorov's distance of 4000 uniform numbers exceeds 2.2 / sqrt(4000) with probability 1e-4.
        let distance = |mut offsets: Vec<f32>| {
            offsets.sort_by(f32::total_cmp);
            let n = offsets.len() as f32;
            offsets.iter().enumerate().map(|(i, x)| (x - i as f32 / n).abs()).fold(0.0, f32::max)
        };
        for pass in [0, 1, 7] {
            assert!(distance((0..4000).map(|seed| Comb::new(seed, pass).offset).collect()) < 0.035, "pass {pass}");
        }
        assert!(distance((1..4000).map(|pass| Comb::new(3, pass).offset).collect()) < 0.02);
        for pass in 1..4000u64 {
            let step = (Comb::new(3, pass).offset - Comb::new(3, pass + 1).offset).abs();
            assert!(f64::from(step) < 0.51 / (pass as f64).sqrt(), "{pass}: {step}");
        }
    }

    /// The hues of a pass are one to a band, and stay in their band.
    #[test]
    fn hues_keep_their_band() {
        for (seed, i) in (0..1000).map(|i| (i % 7, i)) {
            let hue = Hue::new(i as f32 / 1000.0);
            let near = Comb::new(seed, 5).nearest(hue);
            assert_eq!(near.wavelength().band, hue.wavelength().band, "{near:?}");
            assert!((near.0 - hue.0).abs() <= 1.0 / f32::from(BANDS) + 1e-6);
            assert_eq!(near, Comb::new(seed, 5).nearest(near));
        }
    }
}
