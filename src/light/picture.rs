//! Pictures that spots throw: a slide (gobo) in front of a point.

use crate::math::{Rgb, Vec2, Vec3, luminance};

/// A picture on the plane at distance 1 from a light, perpendicular to its axis and centred on it. It filters the light
/// that passes through it; beside it there is none. Interpolated linearly between the centres of texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    /// Transmittance, linear; top row first.
    texels: Vec<[f32; 3]>,
    /// Half the width and half the height of the picture on the plane.
    half: Vec2,
}

impl Picture {
    /// A picture whose width subtends the angle `view` (radians, below pi) at the light. `None` if it is empty or black,
    /// if a texel is negative or not finite, or if their number is wrong.
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>, view: f32) -> Option<Picture> {
        let valid = texels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0);
        let lit = texels.iter().any(|texel| luminance(Rgb::from_array(*texel)) > 0.0);
        let tan = (0.5 * view).tan();
        let fits = width > 0 && height > 0 && texels.len() == width * height && tan > 0.0 && tan.is_finite();
        let half = Vec2::new(tan, tan * height as f32 / width as f32);
        (valid && lit && fits).then_some(Picture { width, height, texels, half })
    }

    /// Numbers of texels down and across.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    /// Half the height and half the width on the plane at distance 1.
    pub(super) fn half_size(&self) -> [f32; 2] {
        [self.half.y, self.half.x]
    }

    /// Coordinates on the picture of a unit direction in the frame of the light: -1 to 1 from the top to the bottom, and
    /// from the left to the right as seen from behind the light. `None` for directions beside the picture.
    #[inline]
    pub(super) fn coordinates(&self, d: Vec3) -> Option<Vec2> {
        if d.z <= 0.0 {
            return None;
        }
        // The y axis of the frame points down: the frame is right-handed and its z axis points ahead.
        let at = Vec2::new(d.y, d.x) / (d.z * Vec2::new(self.half.y, self.half.x));
        (at.abs().max_element() <= 1.0).then_some(at)
    }

    /// The unit direction through a point of the picture.
    #[inline]
    pub(super) fn direction(&self, at: Vec2) -> Vec3 {
        Vec3::new(at.y * self.half.x, at.x * self.half.y, 1.0).normalize()
    }

    /// Solid angle per area of the coordinates.
    #[inline]
    pub(super) fn solid_angle(&self, at: Vec2) -> f32 {
        let r2 = (at * Vec2::new(self.half.y, self.half.x)).length_squared();
        self.half.x * self.half.y / ((1.0 + r2) * (1.0 + r2).sqrt())
    }

    /// Transmittance at a point of the picture.
    #[inline]
    pub(super) fn at(&self, at: Vec2) -> Rgb {
        let cell = |x: f32, n: usize| {
            let x = ((0.5 + 0.5 * x) * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let i = (x as usize).min(n - 1);
            (i, (i + 1).min(n - 1), x - i as f32)
        };
        let ((top, bottom, y), (left, right, x)) = (cell(at.x, self.height), cell(at.y, self.width));
        let texel = |row: usize, column: usize| Rgb::from_array(self.texels[row * self.width + column]);
        let row = |row: usize| texel(row, left).lerp(texel(row, right), x);
        row(top).lerp(row(bottom), y)
    }
}
