//! The constant that relative squared errors add to the denominator, so that dark pixels do not dominate.
//!
//! The relMSE of most papers adds 0.01, the square of a radiance of 0.1. That is little in their pictures, whose mean
//! is about 1. In a picture with a mean of 0.01 the constant would hide all errors. An error estimate must not depend
//! on the unit of radiance, so it adds 0.01 times the squared mean radiance, which is the same number if the mean is 1.

/// The constant that papers add to the squared reference in the denominator of relMSE.
pub const ABSOLUTE: f64 = 0.01;

/// Share of the pixels that the mean of pixel values leaves out, the brightest ones: visible lights and fireflies.
const BRIGHTEST_SHARE: f64 = 0.01;

/// 0.01 times the squared mean of the pixel `values`, without the brightest 1 %. If all others are black, the mean
/// includes them; if every pixel is black, the result is [`ABSOLUTE`]. Scaling the values by a power of two scales the
/// result exactly.
pub fn relative_to_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    let kept = values.len() - (values.len() as f64 * BRIGHTEST_SHARE) as usize;
    if kept == 0 {
        return ABSOLUTE;
    }
    let mut sorted = values.clone();
    let brightest_kept = *sorted.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    let mean_up_to = |max: f64| {
        let (sum, count) = values.iter().filter(|value| **value <= max).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        sum / count
    };
    let floors = [brightest_kept, f64::INFINITY].map(mean_up_to).map(|mean| ABSOLUTE * mean * mean);
    floors.into_iter().find(|floor| *floor > 0.0).unwrap_or(ABSOLUTE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_scales_with_the_picture_and_ignores_fireflies() {
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
        // Only one pixel is lit.
        let lit = relative_to_mean((0..300).map(|i| if i == 7 { 3.0 } else { 0.0 }));
        assert!((lit - 1e-6).abs() < 1e-12, "{lit}");
    }
}
