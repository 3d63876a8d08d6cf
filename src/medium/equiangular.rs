//! Equiangular sampling: points on a ray whose density is proportional to the angle that they subtend at a light, which
//! cancels the inverse squared distance from the light \[Kulla and Fajardo 2012, "Importance sampling techniques for
//! path tracing in participating media", section 4\].

use super::HALF_STEP;
use crate::math::Vec3;

/// Lower bound on the distance of a light from the ray, relative to its distance from the start of the segment. Below
/// it rounding errors dominate. The bound does not bias: sampling stays consistent, with a slightly worse density.
const MIN_RELATIVE_OFFSET: f32 = 1e-4;

/// A light at the distance D from the ray is near a segment of length L if D / L is below this. With uniform distances,
/// the inverse square has a relative variance of about L / (2 pi D) - 1, here 0.3, which is below other noise.
const NEAR_RATIO: f32 = 0.125;

/// A segment that is shorter than this share of the scattering length is worth its own samples.
const SHORT_RATIO: f32 = 0.5;

/// Equiangular sampling of a segment of a ray with respect to a point of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equiangular {
    /// Distances (m) from the ray's origin to the start and the end of the segment.
    segment: [f32; 2],
    /// Signed distance (m) along the ray from the start of the segment to the ray's point that is nearest to the light.
    along: f32,
    /// Distance of the light from the line of the ray (m).
    offset: f32,
    /// Angle that the segment subtends at the light (rad).
    angle: f32,
}

impl Equiangular {
    /// Sampling of the segment of a ray from `origin` along the unit `direction` between the two distances in
    /// `segment`, of which the second may be infinite. `None` if the segment subtends no angle at `light`.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, segment: [f32; 2], light: Vec3) -> Option<Equiangular> {
        let to = light - (origin + direction * segment[0]);
        let distance = segment[1] - segment[0];
        let along = to.dot(direction);
        let offset = (to - direction * along).length().max(MIN_RELATIVE_OFFSET * to.length());
        // The angle between the directions to both ends, from its sine and cosine: a difference of two angles would
        // lose the digits of small ones.
        let angle = offset.atan2(offset * offset / distance - along * (1.0 - along / distance));
        (offset > 0.0 && angle > 0.0).then_some(Equiangular { segment, along, offset, angle })
    }

    /// Whether the light is so near to the segment that its inverse squared distance varies far more than the light
    /// scattered over the distance `length` (m).
    #[inline]
    pub fn is_near(&self, length: f32) -> bool {
        self.offset < NEAR_RATIO * length
    }

    /// Whether the segment is so short that samples of the whole distance `length` (m) would rarely be on it.
    #[inline]
    pub fn is_short(&self, length: f32) -> bool {
        self.segment[1] - self.segment[0] < SHORT_RATIO * length
    }

    /// Samples a distance (m) from the ray's origin to a point of the segment, by the uniform number `u`.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        let (sin, cos) = (u * self.angle).sin_cos();
        let from = (self.offset * self.offset + self.along * self.along) * sin / (self.offset * cos + self.along * sin);
        (self.segment[0] + from).min(self.segment[1])
    }

    /// [`Equiangular::sample`] without the distance of the start of the segment, where rounding may give a point outside.
    #[inline]
    pub fn sample_inside(&self, u: f32) -> f32 {
        self.sample(u + HALF_STEP)
    }

    /// Density per length (1/m) with which [`Equiangular::sample`] draws `distance` \[equation (6)\].
    #[inline]
    pub fn pdf(&self, distance: f32) -> f32 {
        let [start, end] = self.segment;
        if !(start..=end).contains(&distance) {
            return 0.0;
        }
        let from = distance - start - self.along;
        self.offset / (self.angle * (self.offset * self.offset + from * from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sampling of a segment that starts at distance 2 agrees with sampling of a ray that starts there. The density is
    /// zero outside of the segment.
    #[test]
    fn a_segment_is_sampled_like_a_ray_that_starts_there() {
        let (light, segment) = (Vec3::new(3.0, 0.5, 1.0), [2.0, 7.0]);
        let sampling = Equiangular::new(Vec3::ZERO, Vec3::X, segment, light).expect("an angle");
        let other = Equiangular::new(Vec3::X * 2.0, Vec3::X, [0.0, 5.0], light).expect("an angle");
        for k in 0..=100 {
            let (u, t) = (k as f32 / 100.0, k as f32 / 10.0);
            assert!((sampling.sample(u) - 2.0 - other.sample(u)).abs() < 1e-5);
            let inside = (segment[0]..=segment[1]).contains(&t);
            assert!((sampling.pdf(t) - if inside { other.pdf(t - 2.0) } else { 0.0 }).abs() < 1e-6, "{t}");
        }
        assert!(sampling.is_short(10.1) && !sampling.is_short(9.9));
    }

    /// Samples are on the segment, and at quantiles of `u` they agree with the closed form of the cumulative
    /// distribution, whose slope is the density. For near and far lights, beside, before and beyond the segment, and
    /// for infinite segments.
    #[test]
    fn samples_follow_the_density() {
        for light in [Vec3::new(1.0, 0.5, 0.0), Vec3::new(-20.0, 0.01, 0.0), Vec3::new(300.0, 1.0, 2.0), Vec3::X * 0.3]
        {
            for distance in [1e-3f32, 2.0, 500.0, f32::INFINITY] {
                let sampling = Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, distance], light).expect("an angle");
                let (d, a) = (f64::from(sampling.offset), f64::from(sampling.along));
                let below = |t: f64| (((t - a) / d).atan() - (-a / d).atan()) / f64::from(sampling.angle);
                assert!((below(f64::from(distance)) - 1.0).abs() < 1e-4, "{light}, {distance}");
                for k in 1..200 {
                    let u = k as f32 / 200.0;
                    let t = sampling.sample(u);
                    assert!(t > 0.0 && t <= distance * 1.0001, "{light}, {distance}: {t}");
                    assert!((below(f64::from(t)) - f64::from(u)).abs() < 1e-3, "{light}, {distance}: {t} for {u}");
                    let step = 1e-3 * (f64::from(t) - a).abs().max(d);
                    let slope = (below(f64::from(t) + step) - below(f64::from(t) - step)) / (2.0 * step);
                    assert!((f64::from(sampling.pdf(t)) / slope - 1.0).abs() < 1e-3, "{light}, {distance}: {t}");
                }
            }
        }
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, 1.0], Vec3::ZERO).is_none());
        assert!(Equiangular::new(Vec3::ZERO, Vec3::X, [0.0, 0.0], Vec3::ONE).is_none());
    }
}
