//! Bulbs of spots and of lights with a pattern: balls that camera paths see directly, and in mirrors and clear glass.
//! Rays pass through them.
//!
//! Light starts within the ball at points of a density that makes it look like a uniform disc from every side
//! ([`ball_point`]). A ray that crosses the whole ball therefore sees the radiance intensity / (pi radius^2). Where
//! other lobes scatter the camera path, next-event estimation and light paths find the same light, so that nothing is
//! counted twice.

use crate::math::{Vec2, Vec3, sin_cos_turns, sqr, warp};
use std::f32::consts::FRAC_1_PI;

/// The visible ball of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bulb {
    /// Whether only mirrors and glass show it, not the camera itself.
    pub hidden_from_camera: bool,
}

/// Samples a point of a ball by the uniform point `u`. From every side, the ball looks like a uniform disc.
#[inline]
pub fn ball_point(p: Vec3, radius: f32, u: Vec2) -> Vec3 {
    if radius == 0.0 {
        return p;
    }
    // The projection of a uniform point of the unit sphere in four dimensions to three; its projection to two is
    // uniform on the disc. The third number is made of the low bits of the first.
    let height = (1.0 - u.x).sqrt() * sin_cos_turns(0.5 * (4096.0 * u.x).fract()).1;
    p + warp::around_z(u.x.sqrt(), height, u.y) * radius
}

/// The share of the light of a ball along a line through it that the ray from `origin` along the unit `d`, of length
/// `reach`, crosses, and the distance to the point of the line up to which it has crossed the part `u` of this share.
/// `None` if it crosses none. For a uniform `u`, the points have the density of [`ball_point`] along the line.
pub(super) fn crossed_share(p: Vec3, radius: f32, origin: Vec3, d: Vec3, reach: f32, u: f32) -> Option<(f32, f32)> {
    let to = p - origin;
    let middle = to.dot(d);
    let half2 = sqr(radius) - (to - d * middle).length_squared();
    if half2.is_nan() || half2 <= 0.0 {
        return None;
    }
    let half = half2.sqrt();
    // The density of the ball's points along the line is 1 / (pi sqrt(half^2 - x^2)).
    let before = |x: f32| (x / half).clamp(-1.0, 1.0).asin() * FRAC_1_PI;
    let first = before(-middle);
    let share = before(reach - middle) - first;
    // Half a turn is the whole chord.
    let at = middle + half * sin_cos_turns(0.5 * (first + u * share)).0;
    (share > 0.0).then_some((share, at.clamp(0.0, reach)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// Shares of a ball's sampled points that lie before a plane across a random line are those of the formula, and the
    /// density across the line is uniform.
    #[test]
    fn sampled_points_have_the_density_of_the_formula() {
        const POINTS: u64 = 200_000;
        let (radius, d) = (2.0, Vec3::new(0.36, 0.48, 0.8));
        let side = Vec3::new(0.8, -0.6, 0.0);
        let (mut near, mut all) = ([0u32; 3], 0u32);
        let cuts = [-1.0f32, 0.3, 1.2];
        // Points whose line at the distance 0.9 to 1.1 from the axis is parallel to d.
        for i in 0..POINTS {
            let u = Stream::new(1, 0, Domain::Test, i).vertex(0).two(Purpose::Direction);
            let point = ball_point(Vec3::ZERO, radius, u);
            let along = point.dot(d);
            let across = (point - d * along).length();
            if (0.9..1.1).contains(&across) {
                all += 1;
                near.iter_mut().zip(cuts).for_each(|(count, cut)| *count += u32::from(along < cut));
            }
        }
        let expected = (1.1f32.powi(2) - 0.9f32.powi(2)) / 4.0 * POINTS as f32;
        assert!((all as f32 - expected).abs() < 5.0 * expected.sqrt(), "{all} {expected}");
        for (count, cut) in near.into_iter().zip(cuts) {
            let origin = side - d * 10.0;
            let (share, _) = crossed_share(Vec3::ZERO, radius, origin, d, 10.0 + cut, 0.5).expect("it is crossed");
            let (found, error) = (count as f32 / all as f32, (0.25 / all as f32).sqrt());
            assert!((found - share).abs() < 5.0 * error + 2e-3, "{cut}: {found} {share}");
            assert!((found - share - 0.05).abs() > 5.0 * error + 2e-3, "an error of 0.05 is not detected");
        }
        assert_eq!(crossed_share(Vec3::ZERO, radius, side * 3.0, d, 10.0, 0.5), None);
    }
}
