//! What is added to squared values that errors are relative to, so that darkness does not count for ever.
//!
//! The papers' relMSE adds 0.01: a radiance of a tenth, squared, which is little in their pictures, whose mean is about
//! one. In one whose lamps are a hundredth as bright it is everything, and no error counts. An estimate of the error
//! must not depend on the unit of radiance: it adds 0.01 times the squared mean radiance, which is the same in pictures
//! like theirs.

/// The papers' own constant.
pub const ABSOLUTE: f64 = 0.01;

/// Share of the pixels that the mean leaves out, the brightest: lamps that are seen, and fireflies.
const BRIGHTEST: f64 = 0.01;

/// 0.01 times the squared mean of the values of a picture's pixels without the brightest; with them where the others
/// are black; the papers' constant where all are. Scaling the values by a power of two scales it exactly.
pub fn relative_to_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    let kept = values.len() - (values.len() as f64 * BRIGHTEST) as usize;
    if kept == 0 {
        return ABSOLUTE;
    }
    let mut sorted = values.clone();
    let most = *sorted.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    let mean = |most: f64| {
        let (sum, count) = values.iter().filter(|value| **value <= most).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        sum / count
    };
    let floor = |mean: f64| ABSOLUTE * mean * mean;
    [mean(most), mean(f64::INFINITY)].map(floor).into_iter().find(|floor| *floor > 0.0).unwrap_or(ABSOLUTE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_follows_the_picture() {
        let mut values: Vec<f64> = (0..200).map(|i| 0.5 + 0.005 * f64::from(i)).collect();
        // Two fireflies are the brightest hundredth.
        values[17] = 1e9;
        values[90] = 1e12;
        let floor = relative_to_mean(values.iter().copied());
        assert!((floor / (0.01 * 0.9975f64.powi(2)) - 1.0).abs() < 0.01, "{floor}");
        for power in [-10, 10] {
            let scale = 2f64.powi(power);
            assert_eq!(relative_to_mean(values.iter().map(|value| scale * value)), scale * scale * floor);
        }
        assert_eq!(relative_to_mean([0.0; 300]), ABSOLUTE);
        assert_eq!(relative_to_mean([]), ABSOLUTE);
        // Light in one pixel alone.
        let lit = relative_to_mean((0..300).map(|i| if i == 7 { 3.0 } else { 0.0 }));
        assert!((lit - 1e-6).abs() < 1e-12, "{lit}");
    }
}
