//! Colours of heat maps.

use glam::Vec3;

use crate::math::Rgb;

/// Colour scale of errors from 0 to 1: every sixteenth colour, and the last, of matplotlib's magma (S. van der Walt, N.
/// Smith; CC0), sRGB-encoded.
const MAGMA: [[f32; 3]; 17] = [
    [0.001, 0.000, 0.014],
    [0.040, 0.031, 0.134],
    [0.113, 0.065, 0.277],
    [0.212, 0.062, 0.419],
    [0.317, 0.072, 0.485],
    [0.415, 0.110, 0.505],
    [0.513, 0.148, 0.508],
    [0.614, 0.182, 0.499],
    [0.716, 0.215, 0.475],
    [0.817, 0.256, 0.436],
    [0.904, 0.320, 0.388],
    [0.961, 0.418, 0.360],
    [0.987, 0.536, 0.382],
    [0.996, 0.654, 0.446],
    [0.997, 0.770, 0.535],
    [0.992, 0.884, 0.640],
    [0.987, 0.991, 0.750],
];

/// Colour of an error on a heat map, sRGB-encoded, from 0 (black) over red to 1 (pale yellow); lightness increases with
/// the error. NaN has the colour of 1.
pub fn magma(error: f32) -> Rgb {
    let position = if error.is_nan() { 16.0 } else { error.clamp(0.0, 1.0) * 16.0 };
    let index = (position as usize).min(15);
    let [low, high] = [MAGMA[index], MAGMA[index + 1]].map(Vec3::from_array);
    low.lerp(high, position - index as f32)
}
