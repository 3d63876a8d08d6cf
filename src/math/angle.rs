//! Sines, cosines and angles by polynomials, in turns (one turn is 2 pi).
//!
//! The functions of the standard library take up to five times as long, because they are exact to the last bit for all
//! arguments and are not inlined. Samples of directions need neither.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

/// Sine and cosine of an angle in radians of at most pi/4 \[polynomials of the Cephes library, `sinf.c`\]. The error of
/// either is below 1e-7.
#[inline]
pub fn sin_cos_octant(angle: f32) -> (f32, f32) {
    let z = angle * angle;
    let sin = z.mul_add(-1.951_529_6e-4, 8.332_161e-3).mul_add(z, -1.666_665_5e-1);
    let cos = z.mul_add(2.443_315_7e-5, -1.388_731_6e-3).mul_add(z, 4.166_664_6e-2);
    (sin.mul_add(z * angle, angle), (cos * z).mul_add(z, z.mul_add(-0.5, 1.0)))
}

/// Sine and cosine of an angle in turns, of at most 2^20. The error of either is below 1.2e-7.
#[inline]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let quarter = (4.0 * turns).round_ties_even();
    // The difference is exact.
    let (sin, cos) = sin_cos_octant((4.0 * turns - quarter) * FRAC_PI_2);
    let quarter = quarter as i32;
    let (sin, cos) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    (if quarter & 2 == 0 { sin } else { -sin }, if (quarter + 1) & 2 == 0 { cos } else { -cos })
}

/// The angle of the vector `(x, y)` to the x axis, in turns from -1/2 to 1/2; 0 for the zero vector \[polynomial:
/// Abramowitz and Stegun, 4.4.49\]. The error is below 5e-8 turns.
#[inline]
pub fn atan2_turns(y: f32, x: f32) -> f32 {
    let (a, b) = (y.abs(), x.abs());
    let t = a.min(b) / a.max(b).max(f32::MIN_POSITIVE);
    let z = t * t;
    let coefficients =
        [-0.016_165_737, 0.042_909_614, -0.075_289_64, 0.106_562_64, -0.142_089, 0.199_935_51, -0.333_331_45, 1.0];
    let ratio = coefficients.into_iter().fold(0.002_866_225_7f32, |sum, next| sum.mul_add(z, next));
    let octant = ratio * t * (0.5 * FRAC_1_PI);
    let quadrant = if a > b { 0.25 - octant } else { octant };
    let half = if x < 0.0 { 0.5 - quadrant } else { quadrant };
    if y < 0.0 { -half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_4, TAU};

    /// The largest of `error` over all multiples of 2^-22 from -1 to 1.
    fn largest(error: impl Fn(f32) -> f64) -> f64 {
        let steps = 1i32 << 22;
        (-steps..=steps).map(|i| error(i as f32 / steps as f32)).fold(0.0, f64::max)
    }

    fn apart((sin, cos): (f32, f32), angle: f64) -> f64 {
        (f64::from(sin) - angle.sin()).abs().max((f64::from(cos) - angle.cos()).abs())
    }

    #[test]
    fn sines_and_cosines_are_within_their_bounds() {
        let octant = |x: f32| {
            let angle = (f64::from(x) * FRAC_PI_4) as f32;
            apart(sin_cos_octant(angle), f64::from(angle))
        };
        assert!(largest(octant) < 1e-7, "{:e}", largest(octant));
        for scale in [2.0f32, 1024.0, (1u32 << 20) as f32] {
            let error = largest(|x| apart(sin_cos_turns(x * scale), f64::from(x * scale) * TAU));
            assert!(error < 1.2e-7, "{scale} {error:e}");
        }
    }

    #[test]
    fn angles_are_within_their_bound() {
        for length in [1e-30f32, 0.7, 3e30] {
            let error = |(y, x): (f32, f32)| {
                let exact = f64::from(y).atan2(f64::from(x)) / TAU;
                (f64::from(atan2_turns(y, x)) - exact).abs()
            };
            for side in [-length, length] {
                let largest = largest(|t| error((t * length, side)).max(error((side, t * length))));
                assert!(largest < 5e-8, "{length} {largest:e}");
            }
        }
        assert_eq!(atan2_turns(0.0, 0.0), 0.0);
        assert_eq!([atan2_turns(0.0, -1.0), atan2_turns(-1.0, 0.0)], [0.5, -0.25]);
    }
}
