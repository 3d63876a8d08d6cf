//! Which instances a pixel's eye paths hit first, and how often: what cryptomattes and alpha are made of.

use serde::{Deserialize, Serialize};

/// Instances kept per pixel: three cryptomatte layers of two ranks.
pub const RANKS: usize = 6;

/// Counts of first hits by instance. The first [`RANKS`] instances that show up are kept by name; later ones count as
/// hits only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coverage {
    /// Instances; entry `i` means something where `counts[i] > 0`.
    instances: [u32; RANKS],
    /// Paths that hit them first.
    counts: [u32; RANKS],
    /// Paths that hit anything.
    hits: u32,
    /// All paths.
    paths: u32,
}

impl Coverage {
    /// Counts one eye path that hit `instance` first, or nothing.
    #[inline]
    pub fn add(&mut self, instance: Option<u32>) {
        self.paths += 1;
        let Some(instance) = instance else { return };
        self.hits += 1;
        for i in 0..RANKS {
            if self.counts[i] == 0 || self.instances[i] == instance {
                self.instances[i] = instance;
                self.counts[i] += 1;
                return;
            }
        }
    }

    /// Fraction of paths that hit anything, 0 to 1; 0 before the first path.
    pub fn hit_fraction(&self) -> f32 {
        self.fraction(self.hits)
    }

    /// Instances and the fractions of paths that hit them first, in order of appearance.
    pub fn fractions(&self) -> impl Iterator<Item = (u32, f32)> {
        let shares = self.instances.iter().zip(&self.counts).filter(|&(_, &count)| count > 0);
        shares.map(|(&instance, &count)| (instance, self.fraction(count)))
    }

    fn fraction(&self, count: u32) -> f32 {
        if self.paths == 0 { 0.0 } else { (f64::from(count) / f64::from(self.paths)) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_count_paths_and_a_seventh_instance_is_a_hit_without_a_name() {
        let mut coverage = Coverage::default();
        assert_eq!(coverage.hit_fraction(), 0.0);
        for instance in [None, Some(7), Some(7), Some(0), Some(1), Some(2), Some(3), Some(4), Some(5), Some(0)] {
            coverage.add(instance);
        }
        let shares: Vec<_> = coverage.fractions().collect();
        assert_eq!(shares, [(7, 0.2), (0, 0.2), (1, 0.1), (2, 0.1), (3, 0.1), (4, 0.1)]);
        assert_eq!(coverage.hit_fraction(), 0.9);
    }
}
