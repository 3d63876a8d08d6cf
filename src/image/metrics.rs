//! Error metrics of a picture against a reference.

use serde::Serialize;

use super::flip;
use super::window::{Windowed, check_sizes};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{LayerSet, Picture, Size, channel_mean};
use crate::memory;
use crate::stat::{TRIMMED_SHARE, floor};

/// The error of a picture A against a reference B of the same size, over all pixels that are finite in both.
///
/// Serialises as `compare --json` prints it. All sums are in `f64` and in the order of pixels.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Mean over pixels of [`relative_squared_error`], the papers' relMSE.
    pub relmse: f64,
    /// relMSE without the worst 0.5 % of the pixels (rounded down), [`TRIMMED_SHARE`].
    pub relmse_trimmed: f64,
    /// Mean over pixels and channels of the squared difference.
    pub mse: f64,
    /// Mean of A over mean of B, over pixels and channels; `null` for a black reference.
    pub mean_ratio: Option<f64>,
    /// Mean over pixels of HDR-FLIP, see [`flip::hdr`].
    pub flip: f64,
    /// The part of relMSE that changes from pixel to pixel: noise and displaced edges, see [`grain`].
    pub grain: f64,
    /// The constant that is added to the squared reference, see [`Floor`].
    pub floor: f64,
    /// Number of pixels with a channel that is not finite, in either picture.
    pub pixels_not_finite: u64,
    /// The errors of the pixels that show smooth glass or a mirror; `None` until [`Comparison::measure_inside`] finds some.
    pub inside: Option<Inside>,
    /// HDR-FLIP per pixel, rows from the top; 1 where a pixel is not finite.
    #[serde(skip)]
    pub flip_map: Vec<f32>,
    /// Relative squared error and grain per pixel; NaN where a pixel is not finite.
    #[serde(skip)]
    error_maps: [Vec<f64>; 2],
}

/// The errors of some of the pixels. Serialises as `compare --json` prints it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Inside {
    /// Number of these pixels that are finite in both pictures.
    pub pixels: u64,
    /// Mean relative squared error, see [`Comparison::relmse`].
    pub relmse: f64,
    /// Mean of HDR-FLIP, see [`Comparison::flip`].
    pub flip: f64,
    /// Mean of the grain, see [`Comparison::grain`].
    pub grain: f64,
}

impl Comparison {
    /// Measures the errors of the pixels for which `inside`, with one value per pixel, is true.
    pub fn measure_inside(&mut self, inside: &[bool]) {
        let [relative, grain] = &self.error_maps;
        let pixels: Vec<usize> =
            (0..inside.len().min(grain.len())).filter(|&i| inside[i] && !grain[i].is_nan()).collect();
        let mean = |value: &dyn Fn(usize) -> f64| pixels.iter().map(|&i| value(i)).sum::<f64>() / pixels.len() as f64;
        self.inside = (!pixels.is_empty()).then(|| Inside {
            pixels: pixels.len() as u64,
            relmse: mean(&|i| relative[i]),
            flip: mean(&|i| f64::from(self.flip_map[i])),
            grain: mean(&|i| grain[i]),
        });
    }
}

/// The constant that is added to the squared reference, to which errors are relative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Floor {
    /// 0.01, as the papers define relMSE.
    #[default]
    Papers,
    /// 0.01 times the squared mean radiance of the reference ([`floor::relative_to_mean`]), so that errors do not depend on the
    /// unit of radiance.
    Relative,
}

impl Floor {
    fn of(self, reference: &Picture, outside: usize) -> f64 {
        match self {
            Floor::Papers => floor::ABSOLUTE,
            Floor::Relative => reference.relative_floor_with(outside),
        }
    }
}

/// The metrics of a [`Comparison`] that treat every pixel alone, without FLIP and grain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Mean relative squared error, see [`Comparison::relmse`].
    pub relmse: f64,
    /// Mean relative squared error without the worst 0.5 % of the pixels, see [`Comparison::relmse_trimmed`].
    pub relmse_trimmed: f64,
    /// Mean squared error, see [`Comparison::mse`].
    pub mse: f64,
    /// Mean of the picture over mean of the reference, see [`Comparison::mean_ratio`].
    pub mean_ratio: Option<f64>,
}

/// The errors of `a` against the reference `b` over all pixels that are finite in both; `None` if there is no such
/// pixel.
pub fn errors(a: &Picture, b: &Picture) -> Option<Errors> {
    errors_of(a, b, &error_map(a, b, floor::ABSOLUTE), 0)
}

/// The relative squared error of each pixel that both pictures have; NaN where a pixel is not finite in both.
fn error_map(a: &Picture, b: &Picture, floor: f64) -> Vec<f64> {
    let finite = |i: usize| a[i].iter().chain(&b[i]).all(|v| v.is_finite());
    let error = |i: usize| if finite(i) { squared_error(a[i], b[i]) / weight(b[i], floor) } else { f64::NAN };
    (0..a.len().min(b.len())).map(error).collect()
}

/// The errors of pictures from their [`error_map`]. `outside`: number of pixels around both pictures that are black in
/// both.
fn errors_of(a: &Picture, b: &Picture, map: &[f64], outside: usize) -> Option<Errors> {
    let pixels: Vec<usize> = (0..map.len()).filter(|&i| !map[i].is_nan()).collect();
    let count = pixels.len() + outside;
    if count == 0 {
        return None;
    }
    let n = count as f64;
    let mut relative: Vec<f64> = pixels.iter().map(|&i| map[i]).collect();
    let relmse = relative.iter().sum::<f64>() / n;
    relative.sort_unstable_by(f64::total_cmp);
    let kept = count - (n * TRIMMED_SHARE) as usize;
    // The error of the black pixels is zero, the smallest.
    relative.truncate(kept.saturating_sub(outside));
    let relmse_trimmed = relative.iter().fold(0.0, |sum, error| sum + error) / kept as f64;
    let mse = pixels.iter().map(|&i| squared_error(a[i], b[i])).sum::<f64>() / n;
    let total = |image: &Picture| pixels.iter().flat_map(|&i| image[i]).map(f64::from).sum::<f64>();
    let (sum_a, sum_b) = (total(a), total(b));
    Some(Errors { relmse, relmse_trimmed, mse, mean_ratio: (sum_b != 0.0).then(|| sum_a / sum_b) })
}

/// Relative squared error of a pixel `x` against its reference `r`: mean over RGB of (x - r)^2, over (mean of r over
/// RGB)^2 + 0.01.
pub fn relative_squared_error(x: [f32; 3], r: [f32; 3]) -> f64 {
    squared_error(x, r) / weight(r, floor::ABSOLUTE)
}

/// The denominator of a pixel's relative squared error against its reference `r`: (mean of r over RGB)^2 plus the
/// floor.
fn weight(r: [f32; 3], floor: f64) -> f64 {
    channel_mean(r).powi(2) + floor
}

/// Squared error of a pixel `x` against its reference `r`: mean over RGB of (x - r)^2.
pub fn squared_error(x: [f32; 3], r: [f32; 3]) -> f64 {
    (0..3).map(|c| (f64::from(x[c]) - f64::from(r[c])).powi(2)).sum::<f64>() / 3.0
}

/// The part of the relMSE of `a` against `b` that is not smooth: noise and displaced edges.
///
/// From the error of each channel its mean over the 3 x 3 window (cut off at the border) is subtracted; the rest is
/// squared, weighted like relMSE, and averaged over pixels and channels. White noise keeps 8/9 of its relMSE, a constant
/// offset nothing. Pixels that are not finite in both pictures are left out, also of windows. `None` if no other pixel
/// exists, or if the sizes differ.
pub fn grain(a: &Picture, b: &Picture) -> Option<f64> {
    (a.size() == b.size()).then(|| mean_of_known(&grain_map(a, b, floor::ABSOLUTE), 0))?
}

/// The mean of the values that are not NaN, and of `zeros` others; `None` if there is no value.
fn mean_of_known(values: &[f64], zeros: usize) -> Option<f64> {
    let known = || values.iter().filter(|value| !value.is_nan());
    let count = known().count() + zeros;
    (count > 0).then(|| known().sum::<f64>() / count as f64)
}

/// The grain of each pixel of pictures of equal size, see [`grain`]; NaN where a pixel is not finite in both.
fn grain_map(a: &Picture, b: &Picture, floor: f64) -> Vec<f64> {
    let Size { width, height } = a.size();
    let finite = |i: usize| a[i].iter().chain(&b[i]).all(|v| v.is_finite());
    let error = |i: usize| -> Option<[f64; 3]> {
        finite(i).then(|| std::array::from_fn(|c| f64::from(a[i][c]) - f64::from(b[i][c])))
    };
    let errors: Vec<Option<[f64; 3]>> = (0..a.len()).map(error).collect();
    let mut found = vec![f64::NAN; a.len()];
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let Some(own) = errors[i] else { continue };
            let (mut around, mut count) = ([0.0; 3], 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for error in
                    errors[row * width + x.saturating_sub(1)..row * width + (x + 2).min(width)].iter().flatten()
                {
                    (0..3).for_each(|c| around[c] += error[c]);
                    count += 1.0;
                }
            }
            let square = (0..3).map(|c| (own[c] - around[c] / count).powi(2)).sum::<f64>() / 3.0;
            found[i] = square / weight(b[i], floor);
        }
    }
    found
}

/// Compares the pictures (see [`LayerSet::beauty`]) of two files, with the papers' floor; `b` is the reference.
///
/// # Errors
/// The sizes differ, a file has no picture, or no pixel is finite in both.
pub fn compare(a: &LayerSet, b: &LayerSet) -> Result<Comparison> {
    compare_with_floor(a, b, Floor::Papers)
}

/// Compares the pictures of two files as [`compare`] does, with a chosen floor of relative errors.
///
/// # Errors
/// As [`compare`].
pub fn compare_with_floor(a: &LayerSet, b: &LayerSet, floor: Floor) -> Result<Comparison> {
    check_sizes(a.size(), b.size())?;
    check_memory(a.size())?;
    compare_pictures(&a.beauty()?, &b.beauty()?, floor, 0)
}

/// Compares two pictures as [`compare_with_floor`] does, within the windows of their files. Pixels outside both windows
/// cost neither time nor memory. Returns the comparison, and both pictures in the window that contains both, which is
/// also the window of the FLIP map.
///
/// # Errors
/// As [`compare`].
pub fn compare_windows(a: &Windowed, b: &Windowed, floor: Floor) -> Result<(Comparison, [Windowed; 2])> {
    check_sizes(a.whole, b.whole)?;
    let joined = Windowed::join(a, b, flip::REACH)?;
    let [one, other] = &joined;
    check_memory(one.set.size())?;
    let comparison = compare_pictures(&one.set.beauty()?, &other.set.beauty()?, floor, one.outside())?;
    Ok((comparison, joined))
}

fn check_memory(Size { width, height }: Size) -> Result<()> {
    let bytes = (width as u64).saturating_mul(height as u64).saturating_mul(COMPARED_PIXEL_BYTES);
    if bytes < memory::MIN_CHECKED_BYTES {
        return Ok(());
    }
    let needed = memory::require(bytes, format_args!("comparing {width} x {height} pixels"));
    needed.map_err(|e| e.hint("compare smaller pictures, or with more memory"))
}

/// Bytes of memory per pixel while two pictures are compared, besides the layers of the files: two pictures, two
/// exposed copies of them, the buffers of FLIP, and maps of errors.
const COMPARED_PIXEL_BYTES: u64 = 216;

/// Compares the scene-linear picture `a` with the reference `b`, see [`compare`]. `outside`: number of pixels around both
/// that are black in both.
///
/// # Errors
/// The sizes differ, or no pixel is finite in both.
pub fn compare_pictures(a: &Picture, b: &Picture, floor: Floor, outside: usize) -> Result<Comparison> {
    check_sizes(a.size(), b.size())?;
    let finite = |i: usize| a[i].iter().chain(&b[i]).all(|v| v.is_finite());
    let pixels: Vec<usize> = (0..a.len()).filter(|&i| finite(i)).collect();
    let floor = floor.of(b, outside);
    let (errors, grains) = (error_map(a, b, floor), grain_map(a, b, floor));
    let (Some(Errors { relmse, relmse_trimmed, mse, mean_ratio }), Some(grain)) =
        (errors_of(a, b, &errors, outside), mean_of_known(&grains, outside))
    else {
        return Err(Error::new(ErrorKind::Image, "", "the pictures have no pixel with finite values in common"));
    };

    // FLIP filters over neighbours, so that missing pixels need a value: black in both pictures is no difference.
    let filled = |image: &Picture| Picture::from_fn(image.size(), |i| if finite(i) { image[i] } else { [0.0; 3] });
    let mut flip_map = flip::hdr_within(&filled(b), &filled(a), outside);
    let flip = pixels.iter().map(|&i| f64::from(flip_map[i])).sum::<f64>() / (pixels.len() + outside) as f64;
    (0..a.len()).filter(|&i| !finite(i)).for_each(|i| flip_map[i] = 1.0);
    Ok(Comparison {
        relmse,
        relmse_trimmed,
        mse,
        mean_ratio,
        flip,
        grain,
        floor,
        pixels_not_finite: (a.len() - pixels.len()) as u64,
        inside: None,
        flip_map,
        error_maps: [errors, grains],
    })
}
