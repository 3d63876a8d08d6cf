//! How far bandwidths in media may grow where there are few photons.
//!
//! They hold as many neighbours up to a share of the picture's width, in three dimensions soon reached. Then fewer photons do not smooth more: they only add noise, `1 / (n p)` for
//! p light paths, where on surfaces as many neighbours are found in more area.

use crate::estimator::Pixel;

/// By pixel, the largest volume of kernels over that of the usual settings, and the noise of its photons as a weight: pixels at their bounds may have most of it.
pub(super) struct Room(Vec<(f64, f64)>);

impl Room {
    /// `None` where no photons are gathered in media. `widest` is the largest that each pixel's bandwidth may be, none there; `noise` that of its photons, right on average.
    pub fn of(pixels: &[Pixel], widest: &[f32], noise: &[f64]) -> Option<Room> {
        let room = |pixel: &Pixel, widest: f32| f64::from(widest / pixel.volume_bandwidth).powi(3).max(1.0);
        let of_pixel = |((pixel, &widest), &noise): ((&Pixel, &f32), &f64)| (room(pixel, widest), noise);
        let all: Vec<(f64, f64)> = pixels.iter().zip(widest).zip(noise).map(of_pixel).collect();
        (!all.is_empty()).then_some(Room(all))
    }

    /// Mean of something of the kernels' volume, if they could grow to so many times the usual.
    pub fn mean(&self, volume: f64, of: impl Fn(f64) -> f64) -> f64 {
        self.0.iter().map(|&(room, _)| of(volume.min(room))).sum::<f64>() / self.0.len() as f64
    }

    /// What noise becomes with so many times the usual photons, where kernels hold as many as before if they can: never less than if they all could, nor more than if none could.
    pub fn noise(&self, photons: f64) -> f64 {
        let (volume, usual) = (photons.recip(), self.0.iter().map(|(_, weight)| weight).sum::<f64>());
        let now = self.0.iter().map(|&(room, weight)| weight / volume.min(room)).sum::<f64>();
        let held = (now / (usual * photons)).clamp(f64::min(1.0, volume), f64::max(1.0, volume));
        if held.is_nan() { 1.0 } else { held }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise stays where kernels may grow, and grows where they may not; where there are more photons, kernels shrink.
    #[test]
    fn kernels_grow_as_far_as_they_may() {
        let all = |room: f64| Room(vec![(room, 2.0); 3]);
        assert_eq!([0.25, 0.125, 2.0].map(|photons| all(8.0).noise(photons)), [1.0; 3]);
        assert_eq!(all(1.0).noise(0.25), 4.0);
        assert_eq!(all(2.0).noise(0.25), 2.0);
        assert_eq!(Room(vec![(1.0, 3.0), (8.0, 1.0)]).noise(0.25), 3.25);
        assert_eq!(Room(vec![(2.0, 1.0), (8.0, 1.0)]).mean(4.0, |volume| volume), 3.0);
    }

    /// Estimates of noise may be below zero, and all of them nothing.
    #[test]
    fn noise_has_bounds() {
        assert_eq!(Room(vec![(1.0, 3.0), (8.0, -2.0)]).noise(0.25), 4.0);
        assert_eq!(Room(vec![(1.0, -1.0), (8.0, 2.0)]).noise(0.25), 1.0);
        assert_eq!(Room(vec![(1.0, 0.0)]).noise(0.25), 1.0);
    }
}
