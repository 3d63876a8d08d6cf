//! FLIP: the difference that an observer sees when flipping between two pictures, 0 (equal) to 1.
//!
//! LDR-FLIP: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020 (below: FLIP 2020). HDR-FLIP, the largest LDR-FLIP over exposures: Andersson, Nilsson,
//! Shirley, Akenine-Moller, "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics 2021 (below:
//! HDR-FLIP 2021). The observer is the authors' standard one: a screen 0.7 m wide of 3840 pixels, 0.7 m away.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use crate::film::{Picture, Size};
use crate::math::{Rgb, luminance};

/// Pixels per degree of the visual field, for the standard observer.
const PIXELS_PER_DEGREE: f32 = 3840.0 * std::f32::consts::PI / 180.0;

/// Distance in pixels over which a pixel influences others; the widest filter has a radius of 10.
pub(super) const REACH: usize = 16;

/// Compressive exponent of colour differences, FLIP 2020 section 4.1.3.
const COLOUR_EXPONENT: f32 = 0.7;
/// The share of the largest colour difference that maps to `KNEE_TO`, FLIP 2020 section 4.1.3.
const KNEE_FROM: f32 = 0.4;
/// Share of the largest error, 0 to 1, that `KNEE_FROM` maps to.
const KNEE_TO: f32 = 0.95;
/// Width of the edge and point detectors in degrees, FLIP 2020 section 4.2.
const DETECTOR_WIDTH: f32 = 0.082;
/// Exponent of feature differences, FLIP 2020 section 4.2.
const FEATURE_EXPONENT: f32 = 0.5;

/// HDR-FLIP of `test` against `reference` per pixel, both scene-linear Rec. 709, finite and of one
/// size. Negative channels count as zero.
///
/// Exposures go from the one that brings the reference's brightest pixel to 0.85 of the display to the one that does so
/// with its median luminance (HDR-FLIP 2021 section 3.1), in steps of at most about one stop. Two cases the paper
/// leaves open: a median of zero is replaced by the median of the luminances above zero; a black reference gets one
/// exposure.
pub fn hdr(reference: &Picture, test: &Picture) -> Vec<f32> {
    hdr_within(reference, test, 0)
}

/// [`hdr`] of a window of two pictures, around which `outside` pixels are black in both, [`REACH`] of them at least on each
/// side that is not the border of the pictures.
pub(super) fn hdr_within(reference: &Picture, test: &Picture, outside: usize) -> Vec<f32> {
    let (first, last) = exposures(reference, outside);
    let count = (last - first).ceil().max(2.0) as usize;
    let step = (last - first) / (count - 1) as f32;
    let detector = Detector::new();
    let mut map = vec![0.0f32; reference.len()];
    for i in 0..count {
        let scale = (first + i as f32 * step).exp2();
        let tonemapped = |image: &Picture| image.map(|v| aces(0.6 * (v.max(0.0) * scale)));
        let ldr = detector.ldr(&tonemapped(reference), &tonemapped(test));
        map.par_iter_mut().zip(ldr).for_each(|(worst, value)| *worst = worst.max(value));
        if step == 0.0 {
            break;
        }
    }
    map
}

/// Display value, linear, 0 to 1, of a linear channel by a rational fit to ACES' reference rendering and output
/// transforms (Narkowicz 2015, "ACES Filmic Tone Mapping Curve").
fn aces(x: f32) -> f32 {
    // Larger squares would overflow; the curve exceeds 1 there.
    let x = x.min(1e6);
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

/// LDR-FLIP of `test` against `reference` per pixel, both display-linear Rec. 709 from 0 to 1.
pub fn ldr(reference: &Picture, test: &Picture) -> Vec<f32> {
    let clamped = |image: &Picture| image.map(|v| v.clamp(0.0, 1.0));
    Detector::new().ldr(&clamped(reference), &clamped(test))
}

/// First and last exposure in stops at which the pictures are compared, HDR-FLIP 2021 section 3.1.
fn exposures(reference: &Picture, outside: usize) -> (f32, f32) {
    let mut luminances: Vec<f32> =
        reference.iter().map(|rgb| luminance(Rgb::from_array(*rgb).max(Vec3::ZERO))).collect();
    luminances.sort_unstable_by(f32::total_cmp);
    let brightest = luminances.last().copied().unwrap_or(0.0);
    if brightest <= 0.0 {
        return (0.0, 0.0);
    }
    // The black pixels around the picture are the darkest.
    let middle = (luminances.len() + outside) / 2;
    let mut median = middle.checked_sub(outside).map_or(0.0, |middle| luminances[middle]);
    if median <= 0.0 {
        let positive = &luminances[luminances.partition_point(|&y| y <= 0.0)..];
        median = positive[positive.len() / 2];
    }
    // The x with aces(0.6 x) = 0.85: the positive root of a quadratic.
    let (a, b, c) = (0.36 * (2.51 - 0.85 * 2.43), 0.6 * (0.03 - 0.85 * 0.59), -0.85 * 0.14);
    let bright = (-b + f32::sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
    ((bright / brightest).log2(), (bright / median).log2())
}

/// The filters of FLIP's model of the observer, as lists of taps, odd in number.
struct Detector {
    /// Taps of the contrast sensitivity of the achromatic channel.
    achromatic: Vec<f32>,
    /// Taps of the contrast sensitivity of the red-green channel.
    red_green: Vec<f32>,
    /// Taps of the contrast sensitivity of the blue-yellow channel, a sum of two separable Gaussians.
    blue_yellow: [Vec<f32>; 2],
    /// Taps of the Gaussian, which smooths across edges and points.
    smooth: Vec<f32>,
    /// Taps of the first derivative of the Gaussian, which finds edges.
    edge: Vec<f32>,
    /// Taps of the second derivative of the Gaussian, which finds points.
    point: Vec<f32>,
    /// Largest colour difference, between green and blue, which maps to 1.
    largest: f32,
    /// Matrix from CIE XYZ to linear Rec. 709.
    from_xyz: Mat3,
}

impl Detector {
    fn new() -> Self {
        use std::f32::consts::PI;
        // FLIP 2020 table 1: a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees.
        let widest = 0.04f32;
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
        let gaussian = |a: f32, b: f32| -> Vec<f32> {
            let at = |i: i32| (i as f32 / PIXELS_PER_DEGREE).powi(2);
            (-radius..=radius).map(|i| (a * (PI / b).sqrt()).sqrt() * (-PI * PI * at(i) / b).exp()).collect()
        };
        let scaled = |values: Vec<f32>, by: f32| -> Vec<f32> { values.into_iter().map(|v| v * by).collect() };
        let normalised = |values: Vec<f32>| {
            let sum: f32 = values.iter().sum();
            scaled(values, 1.0 / sum)
        };
        // Two-dimensional weights are products of one-dimensional ones: together they sum to s1^2 + s2^2 = 1.
        let (wide, narrow) = (gaussian(34.1, 0.04), gaussian(13.5, 0.025));
        let total = f32::hypot(wide.iter().sum(), narrow.iter().sum());

        let deviation = 0.5 * DETECTOR_WIDTH * PIXELS_PER_DEGREE;
        let reach = (3.0 * deviation).ceil() as i32;
        let g = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        let taps = |f: &dyn Fn(f32) -> f32| -> Vec<f32> { (-reach..=reach).map(|i| f(i as f32)).collect() };
        // The positive weights of a derivative sum to 1, the negative ones to -1.
        let balanced = |values: Vec<f32>| -> Vec<f32> {
            let positive: f32 = values.iter().filter(|&&v| v > 0.0).sum();
            let negative: f32 = -values.iter().filter(|&&v| v < 0.0).sum::<f32>();
            values.into_iter().map(|v| if v > 0.0 { v / positive } else { v / negative }).collect()
        };
        Detector {
            achromatic: normalised(gaussian(1.0, 0.0047)),
            red_green: normalised(gaussian(1.0, 0.0053)),
            blue_yellow: [scaled(wide, 1.0 / total), scaled(narrow, 1.0 / total)],
            smooth: normalised(taps(&g)),
            edge: balanced(taps(&|x| -x * g(x))),
            point: balanced(taps(&|x| (x * x / (deviation * deviation) - 1.0) * g(x))),
            largest: colour_distance(hunt(lab(Vec3::Y)), hunt(lab(Vec3::Z))).powf(COLOUR_EXPONENT),
            from_xyz: TO_XYZ.inverse(),
        }
    }

    fn ldr(&self, reference: &Picture, test: &Picture) -> Vec<f32> {
        let (a, b) = (self.perceive(reference), self.perceive(test));
        let knee = KNEE_FROM * self.largest;
        let pixel = |i: usize| {
            let difference = colour_distance(a.colour[i], b.colour[i]).powf(COLOUR_EXPONENT);
            let colour = if difference < knee {
                difference * KNEE_TO / knee
            } else {
                KNEE_TO + (difference - knee) / (self.largest - knee) * (1.0 - KNEE_TO)
            };
            let feature = (a.edge[i] - b.edge[i]).abs().max((a.point[i] - b.point[i]).abs());
            let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
            colour.powf(1.0 - feature)
        };
        (0..reference.len()).into_par_iter().map(pixel).collect()
    }

    /// The display-linear `image` as an observer perceives it: colours after contrast sensitivity, edges and points.
    fn perceive(&self, image: &Picture) -> Percept {
        let Size { width, height } = image.size();
        let separable = |plane: &[f32], x: &[f32], y: &[f32]| vertical(&horizontal(plane, x, width), y, width, height);
        let opponent: Vec<Vec3> = image.par_iter().map(|rgb| ycxcz(Rgb::from_array(*rgb))).collect();
        let [y, cx, cz] = std::array::from_fn(|c| opponent.iter().map(|v| v[c]).collect::<Vec<f32>>());
        let fy = separable(&y, &self.achromatic, &self.achromatic);
        let fx = separable(&cx, &self.red_green, &self.red_green);
        let [wide, narrow] = [0, 1].map(|i| separable(&cz, &self.blue_yellow[i], &self.blue_yellow[i]));
        let colour = |i: usize| {
            let filtered = Vec3::new(fy[i], fx[i], wide[i] + narrow[i]);
            hunt(lab((self.from_xyz * xyz(filtered)).clamp(Vec3::ZERO, Vec3::ONE)))
        };
        let colour = (0..width * height).into_par_iter().map(colour).collect();

        let grey: Vec<f32> = y.iter().map(|y| (y + 16.0) / 116.0).collect();
        let magnitude = |filter: &[f32]| -> Vec<f32> {
            let x = separable(&grey, filter, &self.smooth);
            let y = separable(&grey, &self.smooth, filter);
            x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        Percept { colour, edge: magnitude(&self.edge), point: magnitude(&self.point) }
    }
}

/// A picture as the observer perceives it.
struct Percept {
    /// Hunt-adjusted CIELAB colour of every pixel.
    colour: Vec<Vec3>,
    /// Magnitude of edges at every pixel.
    edge: Vec<f32>,
    point: Vec<f32>,
}

/// Correlation of every row of `plane` with `taps`; border pixels are repeated outwards.
fn horizontal(plane: &[f32], taps: &[f32], width: usize) -> Vec<f32> {
    let radius = taps.len() / 2;
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, row)| {
        let mut padded = vec![row[0]; radius];
        padded.extend(row);
        padded.resize(width + 2 * radius, row[width - 1]);
        for (tap, shifted) in taps.iter().zip(padded.windows(width)) {
            out.iter_mut().zip(shifted).for_each(|(out, value)| *out += tap * value);
        }
    });
    out
}

/// Correlation of every column of `plane` with `taps`; border pixels are repeated outwards.
fn vertical(plane: &[f32], taps: &[f32], width: usize, height: usize) -> Vec<f32> {
    let radius = taps.len() / 2;
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (i, tap) in taps.iter().enumerate() {
            let from = (y + i).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut().zip(&plane[from..from + width]).for_each(|(out, value)| *out += tap * value);
        }
    });
    out
}

/// The white point of the colour spaces, D65, in CIE XYZ.
const WHITE: Vec3 = Vec3::new(0.950_428_55, 1.0, 1.088_900_4);

/// Matrix from linear Rec. 709 to CIE XYZ, from the chromaticities of the primaries.
const TO_XYZ: Mat3 = Mat3::from_cols_array(&[
    10_135_552.0 / 24_577_794.0,
    2_613_072.0 / 12_288_897.0,
    1_425_312.0 / 73_733_382.0,
    8_788_810.0 / 24_577_794.0,
    8_788_810.0 / 12_288_897.0,
    8_788_810.0 / 73_733_382.0,
    4_435_075.0 / 24_577_794.0,
    887_015.0 / 12_288_897.0,
    70_074_185.0 / 73_733_382.0,
]);

/// Converts linear Rec. 709 to YCxCz, a linear opponent space (FLIP 2020 section 4.1.1).
fn ycxcz(rgb: Rgb) -> Vec3 {
    let v = TO_XYZ * rgb / WHITE;
    Vec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

/// Converts YCxCz to CIE XYZ.
fn xyz(c: Vec3) -> Vec3 {
    let y = (c.x + 16.0) / 116.0;
    Vec3::new(y + c.y / 500.0, y, y - c.z / 200.0) * WHITE
}

/// Converts linear Rec. 709 to CIELAB (CIE 15).
fn lab(rgb: Rgb) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = (TO_XYZ * rgb / WHITE).to_array().map(f);
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// CIELAB with chroma scaled by lightness, because colours look paler in the dark: Hunt's effect, FLIP 2020 section
/// 4.1.2.
fn hunt(lab: Vec3) -> Vec3 {
    Vec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

/// Distance of two CIELAB colours: city-block in lightness, Euclidean in the other two channels (HyAB, FLIP 2020
/// section 4.1.2).
fn colour_distance(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + (d.y * d.y + d.z * d.z).sqrt()
}
