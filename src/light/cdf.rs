//! Choosing an index with given probabilities.

/// A discrete distribution, inverted by a guide table \[Chen and Asau 1974\]: unlike an alias table it keeps the strata of its input.
#[derive(Clone, Debug)]
pub struct Cdf {
    /// `cumulative[i]` = probability of an index up to and including `i`; the last is exactly 1.
    cumulative: Vec<f32>,
    /// `guide[b]`: the first index whose cumulative probability is above `b / guide.len()`, where a search for a number in that bucket starts.
    guide: Vec<u32>,
    total: f64,
}

impl Cdf {
    /// From weights; negative and not finite ones count as zero. `None` if all are zero.
    pub fn new(weights: impl Iterator<Item = f64>) -> Option<Cdf> {
        let weights: Vec<f64> = weights.map(|w| if w.is_finite() && w > 0.0 { w } else { 0.0 }).collect();
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut sum = 0.0;
        let mut cumulative: Vec<f32> = weights
            .iter()
            .map(|w| {
                sum += w;
                (sum / total) as f32
            })
            .collect();
        let last = weights.iter().rposition(|&w| w > 0.0)?;
        for c in &mut cumulative[last..] {
            *c = 1.0;
        }
        let buckets = cumulative.len();
        let guide = (0..buckets)
            .map(|b| cumulative.partition_point(|&c| c <= b as f32 / buckets as f32).min(last) as u32)
            .collect();
        Some(Cdf { cumulative, guide, total })
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Probability of an index before `index`.
    #[inline]
    pub fn below(&self, index: usize) -> f32 {
        if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }

    /// Probability of `index`: that of sampling it, the difference of the rounded sums.
    #[inline]
    pub fn pdf(&self, index: usize) -> f32 {
        self.cumulative[index] - self.below(index)
    }

    /// Index, its probability (above zero), and `u` (in `[0, 1)`) stretched over the chosen interval for reuse.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32, f32) {
        let buckets = self.guide.len();
        let mut index = self.guide[((u * buckets as f32) as usize).min(buckets - 1)] as usize;
        // The bucket may have been rounded up.
        while index > 0 && self.cumulative[index - 1] > u {
            index -= 1;
        }
        while self.cumulative[index] <= u {
            index += 1;
        }
        let below = self.below(index);
        let pdf = self.cumulative[index] - below;
        (index, pdf, ((u - below) / pdf).clamp(0.0, 1.0f32.next_down()))
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
            let (index, pdf, rest) = cdf.sample(i as f32 / n as f32);
            assert_eq!(pdf, cdf.pdf(index));
            assert!((0.0..1.0).contains(&rest));
            count[index] += 1;
        }
        assert_eq!(count, [0, n / 8, 3 * n / 8, 0, 0, n / 2, 0]);
        assert!(Cdf::new([0.0, -1.0].into_iter()).is_none());
    }
}
