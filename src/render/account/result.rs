//! What a render leaves behind.

use super::error_estimate::ErrorEstimate;
use super::history::{History, StopReason};
use super::rejections::Rejections;
use super::unseen::{PhotonRecord, Unseen};
use crate::estimator::{BandwidthState, PixelAccumulator, SquaredError};
use crate::math::DVec3;
use crate::photon::Kind;
use crate::render::clock::Phases;
use crate::render::pass::TechniquePicture;
use crate::render::pass::sample_bytes;
use crate::render::settings::Settings;
use crate::stat::floor;

/// The state of all pixels and the account of a render.
pub struct Rendered {
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: Vec<PixelAccumulator>,
    /// A picture per technique, if [`Settings::techniques`] and the method has several.
    pub techniques: Vec<TechniquePicture>,
    /// Bandwidths of the last iteration.
    pub bandwidths: BandwidthState,
    /// The settings it was made with.
    pub settings: Settings,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Photons of the last map.
    pub photons: u64,
    /// Photons and light paths that were not finite.
    pub light_rejected: u64,
    /// Photons stored and gathered.
    pub photon_record: PhotonRecord,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Core-seconds per phase.
    pub phases: Phases,
    /// Error against time.
    pub history: Vec<History>,
    /// Why it stopped.
    pub stop: StopReason,
}

impl Rendered {
    /// Bytes that a pixel takes: its sums, those of its levels and light groups among them, and what an iteration
    /// keeps of it besides ([`bytes_of_measures`]).
    pub fn bytes_per_pixel(&self) -> [usize; 2] {
        [self.pixels.first().map_or(0, PixelAccumulator::size), sample_bytes(&self.settings)]
    }

    /// Whether the maps of [`Method::Pm`](crate::render::Method::Pm), traced once, had no room for the photons of all its light paths.
    pub fn map_is_full(&self) -> bool {
        self.settings.method.has_one_map() && self.iterations > 0 && self.light_paths < u64::from(self.settings.photons)
    }

    /// Estimated relative error of the method's own image, bias included: root of the mean over pixels of the mean over
    /// RGB of the estimated squared error ([`SquaredError`]) over (mean_RGB^2 + floor), the papers' relMSE with the
    /// estimate in place of the squared difference, and with a [`floor`] that does not depend on the unit of radiance.
    /// `None` before two iterations, and while all is black. What it lacks [`Settings::told`] says.
    ///
    /// A surface that could show light and has shown none is not known to be dark: by Laplace's rule of succession the
    /// next of n iterations brings it light with probability 1 / (n + 2), and then its zero was wholly wrong (1).
    ///
    /// A pixel with fewer than two finite samples where others have them is taken for wholly wrong (1), for nothing is
    /// known of it; `None` if this holds for all.
    ///
    /// A pixel whose value rests on one bright sample counts with about 1, since its mean is as wrong as its variance
    /// is large: where such pixels rule the error, the estimate is too small until they have been seen several times.
    pub fn relative_error(&self) -> Option<f64> {
        error_estimate(&self.pixels, &self.settings).map(|error| error.with(self.unseen()).root())
    }

    /// Light of which hardly any photon has come.
    pub fn unseen(&self) -> Unseen {
        self.photon_record.unseen((&self.pixels, &self.bandwidths), &self.settings, self.light_paths)
    }

    /// Squared bandwidth of the last iteration of a level (from 0, the smallest) of the pixel that has this index.
    pub fn radius2(&self, index: usize, kind: Kind, level: usize) -> f32 {
        self.bandwidths.radius2(index, &self.pixels[index], kind, level)
    }

    /// Samples rejected as not finite.
    pub fn rejected(&self) -> u64 {
        self.rejections().rejected()
    }

    /// All that was left out as not finite.
    pub fn rejections(&self) -> Rejections {
        Rejections::of(&self.pixels, self.light_rejected)
    }
}

/// See [`Rendered::relative_error`].
pub(in crate::render) fn error_estimate(pixels: &[PixelAccumulator], settings: &Settings) -> Option<ErrorEstimate> {
    let (own, compared) = (settings.levels.own(), settings.compared_levels());
    let (mut variance, mut squared_bias) = (0.0, 0.0);
    let (mut lit, mut unknown) = (false, 0.0);
    let value = |pixel: &PixelAccumulator| pixel.mean(own).element_sum() / 3.0;
    let floor = floor::relative_to_mean(pixels.iter().map(value));
    for pixel in pixels {
        let Some(error) = SquaredError::of(pixel, own, compared) else {
            unknown += 1.0;
            continue;
        };
        let mean = value(pixel);
        if mean == 0.0 && could_show_light(pixel) {
            unknown += 1.0 / (f64::from(pixel.iterations) + 2.0);
            continue;
        }
        let scale = 1.0 / (3.0 * (mean * mean + floor));
        variance += pixel.variance_by_quarters().unwrap_or(error.variance).element_sum() * scale;
        squared_bias += error.squared_bias.element_sum() * scale;
        lit |= mean != 0.0;
    }
    let count = pixels.len() as f64;
    lit.then(|| ErrorEstimate {
        variance: variance / count,
        squared_bias: squared_bias.max(0.0) / count,
        unknown: unknown / count,
    })
}

/// Whether a surface is seen that is not black.
fn could_show_light(pixel: &PixelAccumulator) -> bool {
    pixel.depth().is_some() && pixel.albedo() != DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rgb, Vec3};
    use crate::render::Levels;
    use crate::transport::{Features, PixelSample};

    /// So many samples, the first of them not finite; each sees a surface of this albedo if it sees any.
    fn pixel(finite: u64, broken: u64, light: Rgb, albedo: Option<Rgb>) -> PixelAccumulator {
        let mut pixel = PixelAccumulator::new(1, 0, [1.0; 2]);
        for pass in 1..=finite + broken {
            let depth = if albedo.is_some() { 1.0 } else { 0.0 };
            let features = Features { albedo: albedo.unwrap_or_default(), normal: Vec3::ZERO, depth };
            let direct = if pass > broken { light } else { Rgb::NAN };
            pixel.add(pass, &PixelSample { direct, features, ..PixelSample::default() }, None);
        }
        pixel
    }

    /// Two finite samples, equal ones: no error at all.
    fn certain() -> PixelAccumulator {
        pixel(2, 0, Rgb::ONE, None)
    }

    #[test]
    fn pixels_without_finite_samples_are_errors() {
        let levels = Settings { levels: Levels::new(1), ..Settings::default() };
        let [rejected, once] = [pixel(0, 2, Rgb::ONE, None), pixel(1, 1, Rgb::ONE, None)];
        let relative_error = |pixels: &[&PixelAccumulator], s: &Settings| {
            let pixels: Vec<PixelAccumulator> = pixels.iter().map(|&pixel| pixel.clone()).collect();
            error_estimate(&pixels, s).map(|e| e.root())
        };
        let certain = &certain();
        assert_eq!(relative_error(&[certain, certain], &levels), Some(0.0));
        assert_eq!(relative_error(&[certain, &rejected, certain, certain], &levels), Some(0.5));
        assert_eq!(relative_error(&[certain, &once, certain, certain], &levels), Some(0.5));
        assert_eq!(relative_error(&[&rejected, &once], &levels), None);
    }

    /// Of four pixels two are lit. A black one counts once in so many iterations and two if it shows a surface, and not
    /// if it shows none; a picture that is black tells nothing.
    #[test]
    fn light_that_is_not_seen_is_not_known_to_be_none() {
        let levels = Settings { levels: Levels::new(1), ..Settings::default() };
        let relative_error = |pixels: &[PixelAccumulator]| error_estimate(pixels, &levels).map(|e| e.root());
        let empty = || pixel(14, 0, Rgb::ZERO, None);
        let dark = || pixel(14, 0, Rgb::ZERO, Some(Rgb::splat(0.5)));
        assert_eq!(relative_error(&[certain(), certain(), empty(), empty()]), Some(0.0));
        assert_eq!(relative_error(&[certain(), certain(), empty(), dark()]), Some(0.125));
        assert_eq!(relative_error(&[dark(), dark(), empty()]), None);
    }
}
