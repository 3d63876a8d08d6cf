//! Triangles seen from a point, and uniform sampling of the directions to them.

use super::{Vec2, Vec3, atan2_turns, one_minus_cos, sin_cos_turns};
use std::f32::consts::TAU;

/// The directions from a point to a triangle: a triangle on the unit sphere.
#[derive(Clone, Copy, Debug)]
pub struct SphericalTriangle {
    corners: [Vec3; 3],
    solid_angle: f32,
}

impl SphericalTriangle {
    /// The directions to a triangle with corners at these offsets from the point. `six_volume` is their triple product,
    /// six times the volume between the point and the triangle, which callers know with less rounding. `None` at a corner.
    #[inline]
    pub fn new(offsets: [Vec3; 3], six_volume: f32) -> Option<SphericalTriangle> {
        let lengths = offsets.map(Vec3::length);
        let product: f32 = lengths.iter().product();
        if product == 0.0 {
            return None;
        }
        let corners: [Vec3; 3] = std::array::from_fn(|i| offsets[i] / lengths[i]);
        let [a, b, c] = corners;
        // tan(solid angle / 2) [Van Oosterom and Strackee 1983].
        let half = TAU * atan2_turns(six_volume.abs() / product, 1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        Some(SphericalTriangle { corners, solid_angle: 2.0 * half })
    }

    /// Solid angle of the triangle (sr).
    #[inline]
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle
    }

    /// A unit direction to the triangle, with uniform density per solid angle.
    ///
    /// As by Arvo (1995), `u.x` chooses a point D on the side AC, so that the triangle ABD has the share `u.x` of the solid
    /// angle, and `u.y` chooses a point of the arc BD. D follows from the solid angle s of ABD without angles: with
    /// D = A cos t + T sin t, where T is the unit tangent at A, tan(s / 2) is
    /// \|A (B x T)\| sin t / ((1 + A B) (1 + cos t) + (B T) sin t), which is linear in tan(t / 2).
    #[inline]
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let [a, b, c] = self.corners;
        let tangent = (c - a * a.dot(c)).normalize_or_zero();
        let (sin, cos) = sin_cos_turns(0.5 / TAU * u.x * self.solid_angle);
        let numerator = sin * (1.0 + a.dot(b));
        let denominator = cos * a.cross(b).dot(tangent).abs() - sin * b.dot(tangent);
        let scale = (numerator * numerator + denominator * denominator).max(f32::MIN_POSITIVE).recip();
        let cos_t = (denominator * denominator - numerator * numerator) * scale;
        let d = a * cos_t + tangent * (2.0 * numerator * denominator * scale);
        let cos = 1.0 - u.y * one_minus_cos(b, d);
        b * cos + (d - b * b.dot(d)).normalize_or_zero() * (1.0 - cos * cos).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of the directions in each part of a triangle is that of the part's solid angle.
    #[test]
    fn directions_are_uniform_and_solid_angles_known() {
        // An octant of the sphere, a thin triangle, one seen at a grazing angle, and one that nearly fills a half space.
        let octant = [Vec3::X, Vec3::Y, Vec3::Z];
        let thin = [Vec3::new(1.0, 0.0, 1.0), Vec3::new(-1.0, 0.05, 1.0), Vec3::new(-1.0, -0.05, 1.0)];
        let grazing = [Vec3::new(0.5, 0.01, 0.0), Vec3::new(2.0, 0.01, 1.0), Vec3::new(2.0, 0.01, -1.0)];
        let wide = [Vec3::new(100.0, 0.0, 0.5), Vec3::new(-80.0, 90.0, 0.5), Vec3::new(-70.0, -90.0, 0.5)];
        let of = |corners: [Vec3; 3]| {
            let [a, b, c] = corners;
            SphericalTriangle::new(corners, a.dot(b.cross(c))).expect("a triangle")
        };
        assert!((of(octant).solid_angle() - 0.5 * std::f32::consts::PI).abs() < 1e-6);
        for corners in [octant, thin, grazing, wide] {
            let whole = of(corners);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a);
            let n = 256;
            let mut inside = [0u32; 3];
            let parts: [[Vec3; 3]; 3] = {
                let middle = 0.2 * a + 0.3 * b + 0.5 * c;
                [[middle, b, c], [a, middle, c], [a, b, middle]]
            };
            for i in 0..n * n {
                let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
                let d = whole.sample(u);
                assert!((d.length() - 1.0).abs() < 1e-4, "{d}");
                let p = d * (normal.dot(a) / normal.dot(d));
                let side = |x: Vec3, y: Vec3| normal.dot((y - x).cross(p - x)) > 0.0;
                for (part, count) in parts.iter().zip(&mut inside) {
                    let [x, y, z] = *part;
                    *count += u32::from(side(x, y) && side(y, z) && side(z, x));
                }
            }
            let total: f32 = parts.iter().map(|&part| of(part).solid_angle()).sum();
            assert!((total / whole.solid_angle() - 1.0).abs() < 1e-3, "{total}, {whole:?}");
            for (part, count) in parts.into_iter().zip(inside) {
                let (share, expected) = (count as f32 / (n * n) as f32, of(part).solid_angle() / whole.solid_angle());
                assert!((share - expected).abs() < 0.01, "{corners:?}: {share} and {expected}");
            }
        }
    }
}
