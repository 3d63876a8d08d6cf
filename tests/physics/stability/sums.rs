//! Sums over iterations: values and squares of pixels, and the largest number of terms.

use super::exact::Exact;
use caustique::estimator::PixelAccumulator;
use caustique::math::{DVec3, Rgb};
use caustique::random::{Domain, Purpose, Stream};
use caustique::stat::sum::{Grid, MAX_TERMS, Sum};
use caustique::stat::{Grids, Moments};
use caustique::transport::PixelSample;

const MILLION: u32 = 1_000_000;

/// Samples like those of a pixel: most are dim, and a few are a million times as bright.
fn sample(index: u32) -> f32 {
    let u = Stream::new(11, 1, Domain::Test, u64::from(index)).vertex(0).two(Purpose::Pixel);
    10f32.powf(6.0 * u.x.powi(8) - 3.0) * (0.5 + u.y)
}

/// Mean and variance of the mean of a million values, compared with sums of twice the digits. Each term loses less than
/// 2^-30 of the largest term, so a sum of N terms loses at most N times that, and likewise for squares. Here the error
/// is a hundredth of this bound, because rounding errors have both signs. Sums in f32 exceed the bound ten thousand
/// times.
#[test]
fn a_million_values_keep_their_digits() {
    let values: Vec<f32> = (0..MILLION).map(sample).collect();
    let largest = values.iter().fold(0.0f32, |most, value| most.max(*value));
    let grids = Grids::default().with_room_for(f64::from(largest));
    let (mut moments, mut plain) = (Moments::default(), 0.0f32);
    let (mut sum, mut squares) = (Exact::default(), Exact::default());
    for &value in &values {
        moments.add(Rgb::splat(value), grids.rounding());
        plain += value;
        let value = Exact::new(f64::from(value));
        (sum, squares) = (sum + value, squares + value * value);
    }
    let count = Exact::new(f64::from(MILLION));
    let mean = sum / count;
    let scatter = squares - sum * mean;
    let variance = scatter / (count * Exact::new(f64::from(MILLION - 1)));
    let found = [moments.mean(f64::from(MILLION)).x, moments.variance_of_mean(f64::from(MILLION)).x];
    let errors = [mean.error_of(found[0]), variance.error_of(found[1])];
    let in_f32 = mean.error_of(f64::from(plain) / f64::from(MILLION));
    let cut = 2f64.powi(-30);
    let bounds = [
        0.01 * cut * f64::from(largest) / mean.value(),
        0.01 * cut * f64::from(largest).powi(2) * f64::from(MILLION) / scatter.value(),
    ];
    println!("mean and variance off by {errors:?} (bounds {bounds:?}), the mean in f32 by {in_f32:.1e}");
    assert!(errors[0] < bounds[0] && errors[1] < bounds[1], "{errors:?}, {bounds:?}");
    assert!(in_f32 > 1e4 * bounds[0], "{in_f32:e}");
}

/// `MAX_TERMS` terms, each with all digits of its grid set, have the exact integer sum.
#[test]
fn the_largest_number_of_terms_loses_no_digit() {
    // A grid of whole numbers, and the finer grid of multiples of 2^-30.
    let rounding = Grid::default().with_room_for(1.0).rounding();
    for unit in [1.0, 2f64.powi(-30)] {
        let term = (2f64.powi(29) - 1.0) * unit;
        let (mut sum, mut plain) = (Sum::<f64>::default(), 0.0f32);
        for _ in 0..MAX_TERMS {
            sum.add(term, rounding);
            plain += term as f32;
        }
        let expected = MAX_TERMS as f64 * term;
        assert!(sum.value() == expected && f64::from(plain) != expected, "{} {plain} {expected}", sum.value());
    }
    // Two camera paths per iteration.
    assert!(u32::try_from(2 * MAX_TERMS).is_ok(), "pixels count in 32 bits");
}

/// For a pixel without light for a million iterations, one with light once, and one whose samples are all rejected,
/// means are zero or correct, variances and errors are finite, and counts are correct.
#[test]
fn pixels_without_light_have_finite_statistics() {
    let pixel = |measure: &dyn Fn(u32) -> PixelSample| {
        let mut pixel = PixelAccumulator::new(1, 0, [1.0; 2]);
        (1..=MILLION).for_each(|pass| pixel.add(u64::from(pass), &measure(pass), None));
        pixel
    };
    let light = |direct: Rgb| PixelSample { direct, ..PixelSample::default() };
    let never = pixel(&|_| PixelSample::default());
    assert_eq!((never.iterations, never.mean(0), never.variance_of_mean(0)), (MILLION, DVec3::ZERO, DVec3::ZERO));
    assert_eq!((never.depth(), never.albedo(), never.coverage.hit_fraction()), (None, DVec3::ZERO, 0.0));
    let once = pixel(&|pass| light(if pass == 77 { Rgb::splat(3e30) } else { Rgb::ZERO }));
    assert!((once.mean(0).x / 3e24 - 1.0).abs() < 1e-7);
    let n = f64::from(MILLION);
    let expected = f64::from(3e30f32).powi(2) * (1.0 - 1.0 / n) / (n * (n - 1.0));
    assert!((once.variance_of_mean(0).x / expected - 1.0).abs() < 1e-7);
    let broken = pixel(&|_| light(Rgb::NAN));
    assert_eq!((broken.iterations, broken.rejected.total(), broken.mean(0)), (0, MILLION, DVec3::ZERO));
    assert_eq!(broken.variance_of_mean(0), DVec3::INFINITY);
}
