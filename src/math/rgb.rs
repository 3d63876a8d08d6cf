//! Colour: scene-linear Rec. 709.

use glam::Vec3;

/// Red, green and blue of a radiance, a flux, a reflectance or another quantity, in scene-linear Rec. 709.
pub type Rgb = Vec3;

/// Relative luminance of a scene-linear Rec. 709 colour (ITU-R BT.709).
#[inline]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

/// Whether any channel of a colour is above zero. False for black, and if all channels are NaN.
#[inline]
pub fn is_lit(c: Rgb) -> bool {
    c.max_element() > 0.0
}
