//! The cone of a spot's light, and the part of a ray in the cone.

use crate::math::Vec3;

/// A cone of directions from a point, with a half angle of at most 90 degrees. It is convex, so at most one part of a
/// ray is in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    apex: Vec3,
    /// Unit vector of the axis, from the apex into the cone.
    axis: Vec3,
    /// Squared sine of the half angle.
    sin2: f32,
    /// Squared cosine of the half angle.
    cos2: f32,
}

impl Cone {
    /// A cone whose half angle is given as 1 minus its cosine; `None` for half angles above 90 degrees.
    #[inline]
    pub fn new(apex: Vec3, axis: Vec3, one_minus_cos: f32) -> Option<Cone> {
        let (sin2, cos2) = (one_minus_cos * (2.0 - one_minus_cos), (1.0 - one_minus_cos) * (1.0 - one_minus_cos));
        (one_minus_cos < 1.0).then_some(Cone { apex, axis, sin2, cos2 })
    }

    /// Splits a vector into its length along the axis and its component across the axis.
    #[inline]
    fn parts(&self, v: Vec3) -> (f32, Vec3) {
        let along = v.dot(self.axis);
        (along, v - self.axis * along)
    }

    fn contains(&self, p: Vec3) -> bool {
        let (height, off) = self.parts(p - self.apex);
        height >= 0.0 && self.cos2 * off.length_squared() <= self.sin2 * height * height
    }

    /// The range of distances at which a ray from `origin` along the unit `direction` is in the cone, clipped at
    /// `distance`, which may be infinite. `None` if the ray misses the cone.
    #[inline]
    pub fn within(&self, origin: Vec3, direction: Vec3, distance: f32) -> Option<[f32; 2]> {
        // The ray meets the double cone where sin^2 (f . axis)^2 = cos^2 |off|^2, with f = from + t direction and off
        // the component of f across the axis. The form with sines is exact for narrow cones.
        let from = origin - self.apex;
        let ((along, aside), (height, off)) = (self.parts(direction), self.parts(from));
        let a = self.sin2 * along * along - self.cos2 * aside.length_squared();
        let b = self.sin2 * along * height - self.cos2 * aside.dot(off);
        let c = self.sin2 * height * height - self.cos2 * off.length_squared();
        let root = (b * b - a * c).max(0.0).sqrt();
        // Roots without cancellation. For a ray parallel to the side, one root is infinite or NaN, and `meets`
        // discards it.
        let q = -(b + root.copysign(b));
        let (s, t) = (q / a, c / q);
        let meets = |t: f32| if t > 0.0 && t < distance { t } else { 0.0 };
        let (s, t) = (meets(s), meets(t));
        let borders = [0.0, s.min(t), s.max(t), distance];
        let mut within: Option<[f32; 2]> = None;
        for k in 0..3 {
            let (start, end) = (borders[k], borders[k + 1]);
            let middle = if end.is_finite() { 0.5 * (start + end) } else { 2.0 * start + from.length() };
            if end > start && self.contains(origin + direction * middle) {
                within = Some([within.map_or(start, |within| within[0]), end]);
            }
        }
        within
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec2, warp};
    use crate::random::{Domain, Purpose, Stream};

    /// For random cones and rays, exactly the points of the returned part are in the cone. Points at the side, within
    /// 0.001 in the cosine, are not tested.
    #[test]
    fn the_part_of_a_ray_is_in_the_cone() {
        let (mut inside, mut outside) = (0, 0);
        for i in 0..20_000 {
            let draws = |k| Stream::new(21, 0, Domain::Test, i).vertex(k);
            let direction = |k| warp::sphere_uniform(draws(k).two(Purpose::Direction));
            let u: Vec2 = draws(4).two(Purpose::Pixel);
            let cos = u.x.max(0.01);
            let cone = Cone::new(direction(0) * 2.0, direction(1), 1.0 - cos).expect("a cone");
            let (origin, along) = (direction(2) * 4.0 * u.y, direction(3));
            let distance = if i % 7 == 0 { f32::INFINITY } else { 6.0 };
            let part = cone.within(origin, along, distance);
            for k in 1..60 {
                let t = k as f32 * 0.1;
                let from = origin + along * t - cone.apex;
                let over = from.normalize().dot(cone.axis) - cos;
                if over.abs() > 1e-3 {
                    let held = part.is_some_and(|[start, end]| (start..=end).contains(&t));
                    assert_eq!(held, over > 0.0, "{cone:?} {origin} {along} {t}: {part:?}");
                    *(if held { &mut inside } else { &mut outside }) += 1;
                }
            }
        }
        assert!(inside > 50_000 && outside > 50_000, "{inside}, {outside}");
    }

    #[test]
    fn rays_along_the_axis_along_the_side_and_from_the_apex_have_exact_parts() {
        let cone = Cone::new(Vec3::ZERO, Vec3::Z, 1.0 - 0.5f32.sqrt()).expect("a cone");
        assert_eq!(cone.within(Vec3::Z * -1.0, Vec3::Z, 3.0), Some([1.0, 3.0]));
        assert_eq!(cone.within(Vec3::Z, -Vec3::Z, 3.0), Some([0.0, 1.0]));
        let side = Vec3::new(0.5f32.sqrt(), 0.0, 0.5f32.sqrt());
        let part = cone.within(Vec3::new(-1.0, 0.0, 0.5), side, f32::INFINITY).expect("a part");
        assert!((part[0] - 0.25 * 2f32.sqrt()).abs() < 1e-3 && part[1] == f32::INFINITY, "{part:?}");
        assert_eq!(cone.within(Vec3::ZERO, Vec3::Z, 2.0), Some([0.0, 2.0]));
        assert_eq!(cone.within(Vec3::new(0.0, 0.0, -1.0), Vec3::X, 2.0), None);
        assert!(Cone::new(Vec3::ZERO, Vec3::Z, 1.1).is_none());
    }
}
