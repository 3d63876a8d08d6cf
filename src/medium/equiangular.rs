//! Equiangular sampling: distances on a ray in proportion to the angle that they take up as seen from a lamp, so that
//! the inverse square of the distance from it cancels \[Kulla and Fajardo 2012, "Importance sampling techniques for
//! path tracing in participating media", section 4\].

use crate::math::Vec3;

/// Least distance of a lamp from a ray over that from its origin: where rounding would decide. A density that takes it
/// to be further away is as right, and only as even as that.
const LEAST_ASIDE: f32 = 1e-4;

/// A lamp at the distance D from the middle of a way of length L is near below this D / L. Of evenly drawn points the
/// inverse square has a relative variance of about L / (2 pi D) - 1: here 0.3, less than other noise.
const NEAR: f32 = 0.125;

/// Light on less than this of the way is worth points of its own, wherever it comes from.
const SHORT: f32 = 0.5;

/// A part of a ray's way, as a lamp sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equiangular {
    /// Where on the ray it starts and ends.
    part: [f32; 2],
    /// Where on the ray the lamp is nearest, maybe before the start or beyond the end; from the start.
    along: f32,
    /// How far it is from there.
    aside: f32,
    /// Angle that the part takes up.
    angle: f32,
}

impl Equiangular {
    /// The part of the ray from `origin` along the unit `direction` between two distances, the latter maybe infinite,
    /// seen from `lamp`. `None` where that is no angle.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, part: [f32; 2], lamp: Vec3) -> Option<Equiangular> {
        let to = lamp - (origin + direction * part[0]);
        let distance = part[1] - part[0];
        let along = to.dot(direction);
        let aside = (to - direction * along).length().max(LEAST_ASIDE * to.length());
        // Of the directions to both ends, sine over cosine: a difference of angles would lose the digits of small ones.
        let angle = aside.atan2(aside * aside / distance - along * (1.0 - along / distance));
        (aside > 0.0 && angle > 0.0).then_some(Equiangular { part, along, aside, angle })
    }

    /// Whether the lamp is so near that its inverse square varies far more than the light scattered over the next
    /// `length` would.
    #[inline]
    pub fn is_near(&self, length: f32) -> bool {
        self.aside < NEAR * length
    }

    /// Whether it is so short that points on all of the next `length` would seldom be on it.
    #[inline]
    pub fn is_short(&self, length: f32) -> bool {
        self.part[1] - self.part[0] < SHORT * length
    }

    /// The distance that `u` draws.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        let (sin, cos) = (u * self.angle).sin_cos();
        let from = (self.aside * self.aside + self.along * self.along) * sin / (self.aside * cos + self.along * sin);
        (self.part[0] + from).min(self.part[1])
    }

    /// Density per length of drawing `distance`: equation (6) there.
    #[inline]
    pub fn pdf(&self, distance: f32) -> f32 {
        let [start, end] = self.part;
        if !(start..=end).contains(&distance) {
            return 0.0;
        }
        let from = distance - start - self.along;
        self.aside / (self.angle * (self.aside * self.aside + from * from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of a ray is the whole of another, which starts where the part does; outside of it nothing is drawn.
    #[test]
    fn parts_are_rays_of_their_own() {
        let (lamp, part) = (Vec3::new(3.0, 0.5, 1.0), [2.0, 7.0]);
        let seen = Equiangular::new(Vec3::ZERO, Vec3::X, part, lamp).expect("an angle");
        let other = Equiangular::new(Vec3::X * 2.0, Vec3::X, [0.0, 5.0], lamp).expect("an angle");
        for k in 0..=100 {
            let (u, t) = (k as f32 / 100.0, k as f32 / 10.0);
            assert!((seen.sample(u) - 2.0 - other.sample(u)).abs() < 1e-5);
            let inside = (part[0]..=part[1]).contains(&t);
            assert!((seen.pdf(t) - if inside { other.pdf(t - 2.0) } else { 0.0 }).abs() < 1e-6, "{t}");
        }
        assert!(seen.is_short(10.1) && !seen.is_short(9.9));
    }

    /// Near and far lamps, beside the way, before and beyond it, ways without end: what is drawn is distributed as the
    /// density says, by its closed form at quantiles of u, and lies on the way.
    #[test]
    fn samples_follow_the_density() {
        for lamp in [Vec3::new(1.0, 0.5, 0.0), Vec3::new(-20.0, 0.01, 0.0), Vec3::new(300.0, 1.0, 2.0), Vec3::X * 0.3] {
            for distance in [1e-3f32, 2.0, 500.0, f32::INFINITY] {
                let seen = Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, distance], lamp).expect("an angle");
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
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, 1.0], Vec3::ZERO).is_none());
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, 0.0], Vec3::ONE).is_none());
    }
}
