//! First hits of a pixel's camera paths by instance, for cryptomattes and alpha.

use crate::transport::HOLE;
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

/// Number of instances for which a pixel stores hit counts without a heap allocation.
const INLINE_INSTANCES: usize = 4;

/// For one pixel, counts of camera paths by the instance that they hit first. They do not depend on the order of paths.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Coverage {
    /// Index of each instance and the number of camera paths that hit it first, in order of appearance.
    counts: SmallVec<[(u32, u32); INLINE_INSTANCES]>,
    /// Number of all camera paths, with or without a hit.
    paths: u32,
}

impl Coverage {
    /// Counts one camera path; `instance` is the index of the instance that it hits first, or [`HOLE`]; `None` if it hits
    /// nothing.
    #[inline]
    pub fn add(&mut self, instance: Option<u32>) {
        self.paths += 1;
        if let Some(instance) = instance {
            self.count(instance, 1);
        }
    }

    #[inline]
    fn count(&mut self, instance: u32, paths: u32) {
        match self.counts.iter_mut().find(|(known, _)| *known == instance) {
            Some((_, count)) => *count += paths,
            None => self.counts.push((instance, paths)),
        }
    }

    /// Adds the counts of other camera paths of the pixel.
    pub fn join(&mut self, other: &Coverage) {
        self.paths += other.paths;
        other.counts.iter().for_each(|&(instance, count)| self.count(instance, count));
    }

    /// Number of all camera paths counted, with or without a hit.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Fraction of camera paths that hit anything, 0 to 1; 0 before the first path.
    pub fn hit_fraction(&self) -> f32 {
        self.fraction_of(|instance| instance != HOLE)
    }

    /// Fraction of camera paths that end at a hole, 0 to 1.
    pub fn hole_fraction(&self) -> f32 {
        self.fraction_of(|instance| instance == HOLE)
    }

    fn fraction_of(&self, counts: impl Fn(u32) -> bool) -> f32 {
        self.fraction(self.counts.iter().filter(|(instance, _)| counts(*instance)).map(|(_, count)| count).sum())
    }

    /// Index of each instance and the fraction (0 to 1) of camera paths that hit it first, in descending order of
    /// fractions.
    pub fn fractions(&self) -> impl Iterator<Item = (u32, f32)> {
        let mut counts = self.counts.clone();
        counts.retain(|(instance, _)| *instance != HOLE);
        counts.sort_unstable_by_key(|&(instance, count)| (!count, instance));
        counts.into_iter().map(|(instance, count)| (instance, self.fraction(count)))
    }

    fn fraction(&self, count: u32) -> f32 {
        if self.paths == 0 { 0.0 } else { (f64::from(count) / f64::from(self.paths)) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_count_paths_by_instance_in_any_order_and_join() {
        let mut coverage = Coverage::default();
        assert_eq!(coverage.hit_fraction(), 0.0);
        let hits = [None, Some(7), Some(7), Some(0), Some(1), Some(2), Some(3), Some(4), Some(5), Some(0)];
        hits.iter().for_each(|&instance| coverage.add(instance));
        let shares: Vec<_> = coverage.fractions().collect();
        assert_eq!(shares, [(0, 0.2), (7, 0.2), (1, 0.1), (2, 0.1), (3, 0.1), (4, 0.1), (5, 0.1)]);
        assert_eq!(coverage.hit_fraction(), 0.9);
        let (mut early, mut late) = (Coverage::default(), Coverage::default());
        hits[..4].iter().for_each(|&instance| early.add(instance));
        hits[4..].iter().for_each(|&instance| late.add(instance));
        late.join(&early);
        assert_eq!(late.fractions().collect::<Vec<_>>(), shares);
        assert_eq!(late.hit_fraction(), 0.9);
        (0..10).for_each(|_| late.add(Some(HOLE)));
        assert_eq!((late.hit_fraction(), late.hole_fraction(), late.fractions().count()), (0.45, 0.5, 7));
    }
}
