//! Sampling an index with given probabilities.

/// Number of steps of the unit interval; every probability of a [`Cdf`] is a multiple of one step. Uniform numbers of
/// 32 bits resolve 2^32 steps. Cumulative sums in f32 would resolve 2^24, too few for the weaker of a million lights.
const STEPS: u64 = 1 << 32;

/// A discrete distribution, inverted with a guide table \[Chen and Asau 1974\]. Unlike an alias table, the inversion is
/// monotonic, so it keeps the stratification of its input.
#[derive(Clone, Debug)]
pub struct Cdf {
    /// For each index, the step at which its interval of the unit interval ends (exclusive). An index with a positive
    /// weight has at least one step. Entries from `last` on are not used: their end is [`STEPS`], which does not fit.
    ends: Vec<u32>,
    /// The last index with a positive weight.
    last: usize,
    /// The guide table, with one bucket of steps per index: `guide[b]` is the first index whose interval ends after
    /// the start of bucket `b`. The search for a step in the bucket begins there.
    guide: Vec<u32>,
    total: f64,
}

impl Cdf {
    /// Builds the distribution from weights; negative and non-finite weights count as zero. `None` if all weights are
    /// zero, or if 2^32 or more are positive.
    pub fn new(weights: impl Iterator<Item = f64>) -> Option<Cdf> {
        let weights: Vec<f64> = weights.map(|w| if w.is_finite() && w > 0.0 { w } else { 0.0 }).collect();
        let total: f64 = weights.iter().sum();
        let mut left = weights.iter().filter(|&&w| w > 0.0).count() as u64;
        if !(total > 0.0 && total.is_finite()) || left >= STEPS {
            return None;
        }
        let last = weights.iter().rposition(|&w| w > 0.0)?;
        let (mut sum, mut end) = (0.0, 0u64);
        let ends: Vec<u32> = weights
            .iter()
            .map(|&weight| {
                if weight > 0.0 {
                    sum += weight;
                    left -= 1;
                    // Leaves one step for each positive weight that follows.
                    end = ((sum / total * STEPS as f64) as u64).clamp(end + 1, STEPS - left);
                }
                end.min(u64::from(u32::MAX)) as u32
            })
            .collect();
        let buckets = ends.len() as u64;
        let first = |bucket: u64| ends.partition_point(|&end| u64::from(end) <= bucket * STEPS / buckets).min(last);
        let guide = (0..buckets).map(|bucket| first(bucket) as u32).collect();
        Some(Cdf { ends, last, guide, total })
    }

    /// Sum of the weights that the distribution was built from.
    pub fn total(&self) -> f64 {
        self.total
    }

    #[inline]
    fn end(&self, index: usize) -> u64 {
        if index < self.last { u64::from(self.ends[index]) } else { STEPS }
    }

    #[inline]
    fn start(&self, index: usize) -> u64 {
        if index == 0 { 0 } else { self.end(index - 1) }
    }

    /// Sum of the probabilities of all indices before `index`.
    #[inline]
    pub fn below(&self, index: usize) -> f64 {
        self.start(index) as f64 / STEPS as f64
    }

    /// Probability with which [`Cdf::sample`] returns `index`.
    #[inline]
    pub fn pdf(&self, index: usize) -> f32 {
        (self.end(index) - self.start(index)) as f32 / STEPS as f32
    }

    /// Samples an index by the uniform number `u` in `[0, 1)`. Returns the index, its probability (above zero), and the
    /// position of `u` in the interval of the index, which is again uniform in `[0, 1)`.
    #[inline]
    pub fn sample(&self, u: f64) -> (usize, f32, f32) {
        let steps = u * STEPS as f64;
        let step = (steps as u64).min(STEPS - 1);
        let mut index = self.guide[(step * self.guide.len() as u64 / STEPS) as usize] as usize;
        while self.end(index) <= step {
            index += 1;
        }
        let start = self.start(index);
        let width = (self.end(index) - start) as f64;
        let rest = ((steps - start as f64) / width) as f32;
        (index, width as f32 / STEPS as f32, rest.clamp(0.0, 1.0f32.next_down()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampling_matches_the_probabilities() {
        let cdf = Cdf::new([0.0, 1.0, 3.0, 0.0, f64::NAN, 4.0, 0.0].into_iter()).unwrap();
        let n = 1 << 16;
        let mut count = [0; 7];
        for i in 0..n {
            let (index, pdf, rest) = cdf.sample(f64::from(i) / f64::from(n));
            assert_eq!(pdf, cdf.pdf(index));
            assert!((0.0..1.0).contains(&rest));
            count[index] += 1;
        }
        assert_eq!(count, [0, n / 8, 3 * n / 8, 0, 0, n / 2, 0]);
        assert!(Cdf::new([0.0, -1.0].into_iter()).is_none());
    }

    /// Every one of millions of weights has a positive probability: equal weights, and weights beside one that has 95 %
    /// of the total, which is the floor that `lights.rs` gives to lights. Cumulative sums in f32 left 11 % of a million
    /// such weights without any probability, and 53 % of four million.
    #[test]
    fn each_of_millions_of_weights_can_be_sampled() {
        for n in [1_000_000usize, 4_000_000] {
            for strongest in [1.0, 19.0 * n as f64] {
                let weight = |i: usize| if i == n / 3 { strongest } else { 1.0 };
                let cdf = Cdf::new((0..n).map(weight)).unwrap();
                let total: f64 = (0..n).map(|i| f64::from(cdf.pdf(i))).sum();
                assert!((total - 1.0).abs() < 1e-6, "{n}: {total}");
                let all = (n - 1) as f64 + strongest;
                for i in 0..n {
                    let (ideal, pdf) = (weight(i) / all, f64::from(cdf.pdf(i)));
                    assert!(pdf > 0.0 && (pdf - ideal).abs() < 1.01 / STEPS as f64 + 1e-6 * ideal, "{i} of {n}: {pdf}");
                    assert_eq!(cdf.sample(cdf.below(i)).0, i);
                }
            }
        }
    }
}
