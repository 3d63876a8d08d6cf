//! Current bandwidths by pixel, kind of photons and level.
//!
//! From each level to the next larger one, the kernel's size doubles: its area on surfaces, its volume in media
//! \[post-reconstruction 2021, 4.1\].

use super::PixelAccumulator;
use super::rule::{memoryless, volume};
use crate::photon::{ByKind, Kind};

/// Bandwidths of one iteration under the memoryless rules, where they depend only on the initial bandwidth and the
/// number of the iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    levels: usize,
    /// Squared bandwidth of the iteration over the initial squared bandwidth, on surfaces.
    surface2: f32,
    /// Bandwidth of the iteration over the initial bandwidth, in media.
    volume: f32,
}

impl Schedule {
    /// The schedule of iteration `i` (from 1) for `levels` bandwidth levels, with the reduction rates `alpha` on
    /// surfaces and `volume_alpha` in media, both in (0, 1].
    pub fn new(i: u64, levels: usize, alpha: f64, volume_alpha: f64) -> Schedule {
        let surface2 = memoryless::bandwidth2_factor(i, alpha) as f32;
        Schedule { levels, surface2, volume: volume::bandwidth_factor(i, volume_alpha) as f32 }
    }

    /// Number of bandwidth levels of a pixel.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Squared bandwidth on surfaces in this iteration over the initial squared bandwidth, for the largest level (and any
    /// other).
    #[inline]
    pub fn factor2(&self) -> f32 {
        self.surface2
    }

    /// Squared bandwidth on surfaces at bandwidth level `level` (from 0, the smallest) in this iteration;
    /// `initial` is the initial bandwidth of the largest level (scene units).
    #[inline]
    pub fn bandwidth2(&self, initial: f32, level: usize) -> f32 {
        initial * initial * self.surface2 * level_factor2(level, self.levels)
    }

    /// Bandwidth in media at bandwidth level `level` (from 0, the smallest) in this iteration; `initial` is the
    /// initial bandwidth of the largest level (scene units).
    #[inline]
    pub fn volume_bandwidth(&self, initial: f32, level: usize) -> f32 {
        initial * self.volume * volume::level_factor(level, self.levels)
    }
}

/// Squared bandwidth on surfaces of bandwidth level `level` (from 0, the smallest) of `levels`, over that of the largest
/// level.
#[inline]
pub fn level_factor2(level: usize, levels: usize) -> f32 {
    0.5f32.powi((levels - 1 - level) as i32)
}

/// Bandwidths of all pixels after an iteration.
#[derive(Clone, Debug)]
pub struct BandwidthState {
    schedule: Schedule,
    /// Squared bandwidths on surfaces (square scene units) of every pixel and level, by kind of photons; `None` unless the
    /// bandwidth rule counts photons.
    counted: Option<ByKind<Vec<f32>>>,
}

impl BandwidthState {
    /// Bandwidths that follow `schedule` everywhere: the rule counts no photons.
    pub fn memoryless(schedule: Schedule) -> BandwidthState {
        BandwidthState { schedule, counted: None }
    }

    /// Bandwidths on surfaces from `counted`, the squared bandwidths of a rule that counts photons; without it, and in
    /// media, they follow `schedule`.
    pub fn new(schedule: Schedule, counted: Option<ByKind<Vec<f32>>>) -> BandwidthState {
        BandwidthState { schedule, counted }
    }

    /// Squared bandwidth on surfaces for photons of `kind`, at bandwidth level `level` (from 0, the smallest) of
    /// the pixel with this index (square scene units).
    #[inline]
    pub fn bandwidth2(&self, index: usize, pixel: &PixelAccumulator, kind: Kind, level: usize) -> f32 {
        match &self.counted {
            Some(bandwidths2) => bandwidths2[kind as usize][index * self.schedule.levels + level],
            None => self.schedule.bandwidth2(pixel.bandwidths[kind as usize], level),
        }
    }

    /// Bandwidth in media at bandwidth level `level` (from 0, the smallest) of a pixel (scene units).
    #[inline]
    pub fn volume_bandwidth(&self, pixel: &PixelAccumulator, level: usize) -> f32 {
        self.schedule.volume_bandwidth(pixel.volume_bandwidth, level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_level_has_half_the_size_of_the_next_and_the_first_iteration_has_the_initial_bandwidth() {
        let first = Schedule::new(1, 5, 0.5, 0.5);
        assert_eq!((first.bandwidth2(3.0, 4), first.volume_bandwidth(3.0, 4)), (9.0, 3.0));
        let later = Schedule::new(100, 5, 0.5, 0.5);
        for level in 1..5 {
            assert_eq!(later.bandwidth2(3.0, level - 1), 0.5 * later.bandwidth2(3.0, level));
            let ratio = later.volume_bandwidth(3.0, level - 1) / later.volume_bandwidth(3.0, level);
            assert!((ratio.powi(3) - 0.5).abs() < 1e-6);
        }
        assert!(later.factor2() < first.factor2());
    }

    #[test]
    fn counted_bandwidths_replace_the_schedule_on_surfaces_only() {
        let schedule = Schedule::new(1, 2, 0.5, 0.5);
        let mut pixel = PixelAccumulator::new(2, 0, [1.0, 2.0]);
        pixel.volume_bandwidth = 5.0;
        let plain = BandwidthState::memoryless(schedule);
        assert_eq!([0, 1].map(|level| plain.bandwidth2(7, &pixel, Kind::Caustic, level)), [2.0, 4.0]);
        let counted = BandwidthState::new(schedule, Some([vec![], vec![1.0, 2.0, 3.0, 4.0]]));
        assert_eq!([0, 1].map(|level| counted.bandwidth2(1, &pixel, Kind::Caustic, level)), [3.0, 4.0]);
        assert_eq!(counted.volume_bandwidth(&pixel, 1), 5.0);
    }
}
