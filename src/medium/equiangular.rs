//! Equiangular sampling: distances on a ray in proportion to the angle that they take up as seen from a lamp, so that the inverse square of the
//! distance from it cancels \[Kulla and Fajardo 2012, "Importance sampling techniques for path tracing in participating media", section 4\].

use crate::math::Vec3;

/// Least distance of a lamp from a ray over that from its origin: where rounding would decide. A density that takes it to be further away is
/// as right, and only as even as that.
const LEAST_ASIDE: f32 = 1e-4;

/// A lamp at the distance D from the middle of a way of length L is near below this D / L. Of evenly drawn points the inverse square has a relative
/// variance of about L / (2 pi D) - 1: here 0.3, less than other noise.
const NEAR: f32 = 0.125;

/// A ray's way of some length, as a lamp sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equiangular {
    /// Where on the ray the lamp is nearest, maybe before its origin or beyond its end.
    along: f32,
    /// How far it is from there.
    aside: f32,
    /// Angle that the way takes up.
    angle: f32,
}

impl Equiangular {
    /// The next `distance` (maybe infinite) from `origin` along the unit `direction`, seen from `lamp`. `None` where that is no angle.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, distance: f32, lamp: Vec3) -> Option<Equiangular> {
        let to = lamp - origin;
        let along = to.dot(direction);
        let aside = (to - direction * along).length().max(LEAST_ASIDE * to.length());
        // Of the directions to both ends, sine over cosine: a difference of angles would lose the digits of small ones.
        let angle = aside.atan2(aside * aside / distance - along * (1.0 - along / distance));
        (aside > 0.0 && angle > 0.0).then_some(Equiangular { along, aside, angle })
    }

    /// Whether the lamp is so near that its inverse square varies far more than the light scattered over the next `length` would.
    #[inline]
    pub fn is_near(&self, length: f32) -> bool {
        self.aside < NEAR * length
    }

    /// The distance that `u` draws.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        let (sin, cos) = (u * self.angle).sin_cos();
        (self.aside * self.aside + self.along * self.along) * sin / (self.aside * cos + self.along * sin)
    }

    /// Density per length of drawing `distance`: equation (6) there.
    #[inline]
    pub fn pdf(&self, distance: f32) -> f32 {
        let from = distance - self.along;
        self.aside / (self.angle * (self.aside * self.aside + from * from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near and far lamps, beside the way, before and beyond it, ways without end: what is drawn is distributed as the density says, by its closed form
    /// at quantiles of u, and lies on the way.
    #[test]
    fn samples_follow_the_density() {
        for lamp in [Vec3::new(1.0, 0.5, 0.0), Vec3::new(-20.0, 0.01, 0.0), Vec3::new(300.0, 1.0, 2.0), Vec3::X * 0.3] {
            for distance in [1e-3f32, 2.0, 500.0, f32::INFINITY] {
                let seen = Equiangular::new(Vec3::ZERO, Vec3::X, distance, lamp).expect("an angle");
                let (d, a) = (f64::from(seen.aside), f64::from(seen.along));
                let below = |t: f64| (((t - a) / d).atan() - (-a / d).atan()) / f64::from(seen.angle);
                assert!((below(f64::from(distance)) - 1.0).abs() < 1e-4, "{lamp}, {distance}");
                for k in 1..200 {
                    let u = k as f32 / 200.0;
                    let t = seen.sample(u);
                    assert!(t > 0.0 && t <= distance * 1.0001, "{lamp}, {distance}: {t}");
                    assert!((below(f64::from(t)) - f64::from(u)).abs() < 1e-3, "{lamp}, {distance}: {t} for {u}");
                    let step = 1e-3 * (f64::from(t) - a).abs().max(d);
                    let slope = (below(f64::from(t) + step) - below(f64::from(t) - step)) / (2.0 * step);
                    assert!((f64::from(seen.pdf(t)) / slope - 1.0).abs() < 1e-3, "{lamp}, {distance}: {t}");
                }
            }
        }
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, 1.0, Vec3::ZERO).is_none());
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, 0.0, Vec3::ONE).is_none());
    }
}
