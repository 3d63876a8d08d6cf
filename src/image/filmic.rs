//! Blender's view transform Filmic with its looks, in closed form: scene-linear Rec. 709 to display values.
//!
//! T. Sobotka's Filmic encodes the logarithm of light, desaturates what is brighter than six stops above middle grey by a
//! table of 33^3 colours, and maps 16.5 stops to the display. The curves are those of T. Lottes ("Advanced Techniques and
//! Optimization of HDR Color Pipelines", GDC 2016) with the parameters in the names of Blender's files; the table follows
//! a power law. Both were found from the values of Blender's OpenColorIO configuration, which they meet within 0.1 / 255.

use crate::math::Rgb;
use crate::scene::description::Contrast;
use glam::Vec3;

/// Scene-linear value of middle grey, which is shown as a half.
const MIDDLE_GREY: f32 = 0.18;
/// Stops of the darkest encoded light from middle grey.
const DARKEST: f32 = -10.0;
/// Stops of white from middle grey.
const WHITE: f32 = 6.5;
/// Stops of the brightest encoded light from middle grey.
const BRIGHTEST: f32 = 15.0;
/// Stops from middle grey above which colours lose saturation.
const DESATURATED_ABOVE: f32 = 6.0;
/// Cells of the table of desaturated colours along each channel.
const CELLS: f32 = 32.0;

/// Display value, 0 to 1, of a scene-linear Rec. 709 colour without negative channels.
pub(super) fn filmic(colour: Rgb, contrast: Contrast) -> Rgb {
    let stops = (colour / MIDDLE_GREY).map(f32::log2).clamp(Vec3::splat(DARKEST), Vec3::splat(BRIGHTEST));
    let curve = Curve::new(contrast);
    let shown = desaturate(stops).map(|v| curve.at(v));
    let medium = Curve::new(Contrast::Medium);
    // Looks act on encoded light: Blender inverts the medium curve after the look's and desaturates a second time.
    if contrast == Contrast::Medium || shown.max_element() <= medium.at(cell_start(DESATURATED_ABOVE)) {
        return shown;
    }
    desaturate(shown.map(|v| medium.inverse(v))).map(|v| medium.at(v))
}

/// A curve of Lottes: display value `x^a / (b x^(a d) + c)` of light `x` relative to middle grey.
struct Curve {
    /// Exponent a, the contrast.
    contrast: f32,
    /// Exponent a d.
    shoulder: f32,
    /// Factor b, which maps middle grey to 0.5 and white to 1; c = 2 - b.
    scale: f32,
    /// Value of the darkest light before it is moved to 0.
    black: f32,
}

impl Curve {
    fn new(contrast: Contrast) -> Curve {
        let (contrast, shoulder) = match contrast {
            Contrast::VeryHigh => (1.2, 1.0),
            Contrast::High => (0.99, 1.0075),
            Contrast::MediumHigh => (0.85, 1.011),
            Contrast::Medium => (0.7, 1.03),
            Contrast::MediumLow => (0.6, 1.04),
            Contrast::Low => (0.48, 1.09),
            Contrast::VeryLow => (0.35, 1.3),
        };
        let shoulder = contrast * shoulder;
        let scale = ((WHITE * contrast).exp2() - 2.0) / ((WHITE * shoulder).exp2() - 1.0);
        let curve = Curve { contrast, shoulder, scale, black: 0.0 };
        Curve { black: curve.raw(DARKEST), ..curve }
    }

    fn raw(&self, stops: f32) -> f32 {
        (self.contrast * stops).exp2() / (self.scale * (self.shoulder * stops).exp2() + 2.0 - self.scale)
    }

    /// Display value of light in stops from middle grey; the part below middle grey is stretched to reach 0.
    fn at(&self, stops: f32) -> f32 {
        let raw = self.raw(stops.clamp(DARKEST, WHITE));
        if raw < 0.5 { 0.5 * (raw - self.black) / (0.5 - self.black) } else { raw.min(1.0) }
    }

    /// Light in stops from middle grey that has a display value.
    fn inverse(&self, value: f32) -> f32 {
        let (mut low, mut high) = (DARKEST, WHITE);
        for _ in 0..22 {
            let middle = 0.5 * (low + high);
            if self.at(middle) < value { low = middle } else { high = middle }
        }
        high
    }
}

/// Stops at which the cell of the table begins that holds `stops`.
fn cell_start(stops: f32) -> f32 {
    let size = (BRIGHTEST - DARKEST) / CELLS;
    DARKEST + size * ((stops - DARKEST) / size).floor()
}

/// A colour in stops from middle grey, desaturated by tetrahedral interpolation in Blender's table.
fn desaturate(stops: Rgb) -> Rgb {
    if stops.max_element() <= cell_start(DESATURATED_ABOVE) {
        return stops;
    }
    let size = (BRIGHTEST - DARKEST) / CELLS;
    let place = (stops - DARKEST) / size;
    let low = place.floor().min(Vec3::splat(CELLS - 1.0));
    let share = place - low;
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| share[b].total_cmp(&share[a]));
    // From the low corner of the cell along the edges of the tetrahedron to the high one.
    let mut corner = low * size + DARKEST;
    let mut value = table(corner);
    let mut sum = value;
    for axis in order {
        corner[axis] += size;
        let next = table(corner);
        sum += share[axis] * (next - value);
        value = next;
    }
    sum
}

/// An entry of Blender's table: the light is mixed with grey of its largest channel, the more the brighter that is.
fn table(stops: Rgb) -> Rgb {
    let light = stops.map(f32::exp2);
    let largest = light.max_element();
    let (first, last) = (DESATURATED_ABOVE.exp2(), BRIGHTEST.exp2());
    let grey = ((largest - first).max(0.0) / (last - first)).powf(1.1);
    (light + (largest - light) * grey).map(f32::log2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_inverted() {
        for contrast in [Contrast::VeryLow, Contrast::Medium, Contrast::VeryHigh] {
            let curve = Curve::new(contrast);
            assert_eq!((curve.at(-20.0), curve.at(0.0), curve.at(20.0)), (0.0, 0.5, 1.0), "{contrast:?}");
            for i in -90..=60 {
                let stops = i as f32 / 10.0;
                assert!((curve.inverse(curve.at(stops)) - stops).abs() < 1e-3, "{contrast:?} at {stops}");
            }
        }
    }
}
