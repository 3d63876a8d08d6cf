//! Colour: scene-linear Rec. 709.

use glam::Vec3;

/// Scene-linear Rec. 709 values of a radiance, a flux, a reflectance or another quantity.
pub type Rgb = Vec3;

/// Relative luminance of scene-linear Rec. 709 (ITU-R BT.709).
#[inline]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

/// Whether any channel is above zero. False for black, and if all channels are NaN.
#[inline]
pub fn is_lit(c: Rgb) -> bool {
    c.max_element() > 0.0
}
