//! Orthonormal frames.

use glam::Vec3;

/// Two unit vectors that complete the unit vector `n` to a right-handed orthonormal basis, without branches on the data
/// \[Duff et al. 2017, "Building an Orthonormal Basis, Revisited"\].
#[inline]
pub fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// A right-handed orthonormal frame in world space; `n` is its z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The frame's x axis in world space, a unit vector.
    pub t: Vec3,
    /// The frame's y axis in world space, a unit vector.
    pub b: Vec3,
    /// The frame's z axis in world space, a unit vector.
    pub n: Vec3,
}

impl Frame {
    /// A frame around the unit normal `n`.
    #[inline]
    pub fn from_normal(n: Vec3) -> Frame {
        let (t, b) = orthonormal_basis(n);
        Frame { t, b, n }
    }

    /// A frame around the unit normal `n` whose x axis is `tangent` projected into the plane of `n` and normalized. A
    /// tangent that is zero, not finite or parallel to `n` is ignored.
    #[inline]
    pub fn from_normal_tangent(n: Vec3, tangent: Vec3) -> Frame {
        let t = tangent - n * n.dot(tangent);
        let length2 = t.length_squared();
        if length2 > 1e-12 && length2.is_finite() {
            let t = t / length2.sqrt();
            Frame { t, b: n.cross(t), n }
        } else {
            Frame::from_normal(n)
        }
    }

    /// Transforms a vector from world space to the frame.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.t), v.dot(self.b), v.dot(self.n))
    }

    /// Transforms a vector from the frame to world space.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.t * v.x + self.b * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for i in 0..1000 {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 1000.0;
            let phi = i as f32 * 2.399_963;
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize();
            for frame in
                [Frame::from_normal(n), Frame::from_normal_tangent(n, Vec3::X), Frame::from_normal_tangent(n, n)]
            {
                assert!((frame.t.cross(frame.b) - frame.n).length() < 1e-5);
                assert!((frame.t.length() - 1.0).abs() < 1e-5 && (frame.b.length() - 1.0).abs() < 1e-5);
                let v = Vec3::new(0.3, -0.4, 0.5);
                assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-5);
            }
        }
        assert_eq!(Frame::from_normal(Vec3::NEG_Z).t.z.abs(), 0.0);
    }
}
