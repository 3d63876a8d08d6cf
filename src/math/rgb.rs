//! Colour: scene-linear Rec. 709.

use glam::Vec3;

/// Scene-linear Rec. 709 colour; the quantity (radiance, flux, reflectance) is the user's.
pub type Rgb = Vec3;

/// Relative luminance of scene-linear Rec. 709 (ITU-R BT.709).
#[inline]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

/// Whether there is any light: false for black, and for NaN.
#[inline]
pub fn is_lit(c: Rgb) -> bool {
    c.max_element() > 0.0
}
