//! Tone mapping: exposure, tone curve, and sRGB encoding.

use glam::{Mat3, Vec3};

use super::filmic::filmic;
use crate::math::{Rgb, luminance};
pub use crate::scene::description::{Contrast, ToneMap};

/// How a picture is shown: exposure, tone curve and contrast.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look {
    /// Exposure in stops.
    pub exposure: f32,
    /// Tone curve.
    pub tonemap: ToneMap,
    /// Contrast of the tone curve, if that is AgX or Filmic.
    pub contrast: Contrast,
}

impl From<ToneMap> for Look {
    fn from(tonemap: ToneMap) -> Look {
        Look { tonemap, ..Look::default() }
    }
}

impl Look {
    /// Display value, sRGB-encoded, 0 to 1, of a scene-linear Rec. 709 colour. A NaN channel counts as 0; infinity is the
    /// brightest value.
    pub fn display(&self, colour: Rgb) -> Rgb {
        // f32::max and clamp would let NaN through; Vec3's max does not.
        let clean = colour.to_array().map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1e30) });
        let exposed = (Vec3::from_array(clean) * self.exposure.exp2()).min(Vec3::splat(1e30));
        let linear = match self.tonemap {
            ToneMap::Agx => agx(exposed, self.contrast),
            ToneMap::Filmic => return filmic(exposed, self.contrast),
            ToneMap::Neutral => neutral(exposed),
            ToneMap::Srgb => exposed,
        };
        linear.map(srgb_encode)
    }
}

/// sRGB's transfer function from linear to encoded values, clipped to 0 to 1 (IEC 61966-2-1).
pub fn srgb_encode(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    let v = encoded.clamp(0.0, 1.0);
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Khronos PBR Neutral tone mapper (Khronos Group 2024, ToneMapping/PBR_Neutral): linear Rec. 709 to linear Rec. 709.
/// The Fresnel reflection of 4 % is taken off, and colours whose largest channel exceeds 0.8 are compressed and
/// desaturated.
fn neutral(colour: Rgb) -> Rgb {
    const FRESNEL: f32 = 0.04;
    const START: f32 = 0.8 - FRESNEL;
    const DESATURATION: f32 = 0.15;
    let least = colour.min_element();
    let offset = if least < 2.0 * FRESNEL { least - least * least / (4.0 * FRESNEL) } else { FRESNEL };
    let colour = colour - Vec3::splat(offset);
    let peak = colour.max_element();
    if peak < START {
        return colour;
    }
    let room = 1.0 - START;
    let compressed = 1.0 - room * room / (peak + room - START);
    let grey = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    (colour * (compressed / peak)).lerp(Vec3::splat(compressed), grey)
}

/// AgX as Blender 4 shows it: linear Rec. 709 to linear Rec. 709.
///
/// In Rec. 2020, an inset moves the primaries towards white; a sigmoid maps log2 over 16.5 stops around middle grey 0.18;
/// the power of 2.4 is undone; three fifths of the hue shift of the curve is reverted; an outset restores colourfulness. After T. Sobotka (github.com/sobotka/AgX) and E. Chow (github.com/EaryChow/AgX_LUT_Gen,
/// whose "mix percent" is 40); matrices rounded as Filament has them. Colours outside
/// Rec. 709 are clipped, not compressed as Blender does.
fn agx(colour: Rgb, contrast: Contrast) -> Rgb {
    /// Matrix, by rows, from Rec. 709 to Rec. 2020 (ITU-R BT.2087).
    const TO_2020: [[f32; 3]; 3] = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0113], [0.0164, 0.0880, 0.8956]];
    const INSET: [[f32; 3]; 3] = [
        [0.856_627_15, 0.095_121_24, 0.048_251_61],
        [0.137_319, 0.761_242, 0.101_439_04],
        [0.111_898_21, 0.076_799_42, 0.811_302_37],
    ];
    const OUTSET: [[f32; 3]; 3] = [
        [1.127_100_6, -0.110_606_64, -0.016_493_94],
        [-0.141_329_76, 1.157_823_7, -0.016_493_94],
        [-0.141_329_76, -0.110_606_64, 1.251_936_4],
    ];
    /// Least log2 of linear radiance that the curve maps, log2(0.18) - 10; the greatest is log2(0.18) + 6.5.
    const MIN_EV: f32 = -12.473_93;
    const MAX_EV: f32 = 4.026_069;

    let rows = |m: &[[f32; 3]; 3]| Mat3::from_cols_array_2d(m).transpose();
    let to_2020 = rows(&TO_2020);
    let inset = with_contrast((rows(&INSET) * to_2020 * colour).max(Vec3::splat(1e-10)), contrast);
    let curved = inset.to_array().map(|v| sigmoid((v.log2() - MIN_EV) / (MAX_EV - MIN_EV)));
    let linear = curved.map(|v| v.powf(2.4));
    let (before, after) = (hue(inset.to_array()), hue(linear));
    // The shorter way around the circle.
    let turned = (after - before + 9.0).rem_euclid(6.0) - 3.0;
    let restored = with_hue(linear, before + 0.4 * turned);
    to_2020.inverse() * (rows(&OUTSET) * restored)
}

/// A colour in AgX's primaries after a look of Blender: the logarithm is stretched about middle grey, and then its
/// saturation changes.
fn with_contrast(colour: Rgb, contrast: Contrast) -> Rgb {
    const MIDDLE_GREY: f32 = 0.18;
    let (contrast, saturation) = match contrast {
        Contrast::VeryHigh => (1.57, 0.9),
        Contrast::High => (1.4, 0.95),
        Contrast::MediumHigh => (1.2, 1.0),
        Contrast::Medium => return colour,
        Contrast::MediumLow => (0.9, 1.05),
        Contrast::Low => (0.8, 1.1),
        Contrast::VeryLow => (0.7, 1.15),
    };
    let stops = (colour / MIDDLE_GREY).map(f32::log2) * contrast;
    let graded = Vec3::splat(luminance(stops)).lerp(stops, saturation);
    // Within what the sigmoid distinguishes, so that no power overflows.
    MIDDLE_GREY * graded.clamp(Vec3::splat(-20.0), Vec3::splat(20.0)).map(f32::exp2)
}

/// Hue of the hexagonal model (HSV) in sixths of a turn, red 0, green 2, blue 4; of grey, 0.
fn hue([r, g, b]: [f32; 3]) -> f32 {
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = high - low;
    if chroma <= 0.0 {
        0.0
    } else if high == r {
        (g - b) / chroma
    } else if high == g {
        2.0 + (b - r) / chroma
    } else {
        4.0 + (r - g) / chroma
    }
}

/// The colour with another hue and the same largest and smallest channel.
fn with_hue([r, g, b]: [f32; 3], hue: f32) -> Rgb {
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    // A channel is high within a sixth of a turn of its own hue, low beyond a third, and linear between.
    let channel = |own: f32| {
        let away = ((hue - own + 9.0).rem_euclid(6.0) - 3.0).abs();
        low + (high - low) * (2.0 - away).clamp(0.0, 1.0)
    };
    Vec3::new(channel(0.0), channel(2.0), channel(4.0))
}

/// AgX's default contrast: two power curves that meet in the pivot with slope 2.4 and reach 0 and 1 at the ends
/// (Sobotka, AgX `equation_full_curve`: x pivot 10 / 16.5, y pivot 0.18^(1/2.4), powers of toe and shoulder 1.5).
fn sigmoid(x: f32) -> f32 {
    const SLOPE: f32 = 2.4;
    const POWER: f32 = 1.5;
    let pivot = 10.0 / 16.5;
    let middle = 0.18f32.powf(1.0 / 2.4);
    let x = x.clamp(0.0, 1.0);
    // Extent of the curve on this side of the pivot: the scale makes it reach 0 or 1 exactly.
    let (extent_x, extent_y) = if x < pivot { (pivot, middle) } else { (1.0 - pivot, 1.0 - middle) };
    let scale =
        ((SLOPE * extent_x).powf(-POWER) * ((SLOPE * extent_x / extent_y).powf(POWER) - 1.0)).powf(-1.0 / POWER);
    let t = SLOPE * (x - pivot).abs() / scale;
    let step = scale * t / (1.0 + t.powf(POWER)).powf(1.0 / POWER);
    if x < pivot { middle - step } else { middle + step }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agx_curve_passes_its_anchors() {
        assert!(sigmoid(0.0).abs() < 1e-4);
        assert!((sigmoid(1.0) - 1.0).abs() < 1e-4);
        let pivot = 10.0 / 16.5;
        assert!((sigmoid(pivot) - 0.18f32.powf(1.0 / 2.4)).abs() < 1e-6);
        let slope = (sigmoid(pivot + 1e-3) - sigmoid(pivot - 1e-3)) / 2e-3;
        assert!((slope - 2.4).abs() < 0.02, "{slope}");
        let mut last = -1.0;
        for i in 0..=1000 {
            let y = sigmoid(i as f32 / 1000.0);
            assert!(y > last);
            last = y;
        }
    }

    #[test]
    fn hues_round_trip() {
        for i in 0..60 {
            let angle = i as f32 / 10.0;
            let colour = with_hue([0.2, 0.9, 0.5], angle);
            assert!((hue(colour.to_array()).rem_euclid(6.0) - angle).abs() < 1e-5, "{angle}: {colour}");
            assert_eq!((colour.max_element(), colour.min_element()), (0.9, 0.2));
        }
    }

    #[test]
    fn srgb_round_trips() {
        for i in 0..=255 {
            let v = i as f32 / 255.0;
            assert!((srgb_encode(srgb_decode(v)) - v).abs() < 1e-6);
        }
    }
}
