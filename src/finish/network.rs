//! The network of the finish: from an estimate, its denoised pictures and the noise of the estimate it makes the picture
//! towards which the estimate moves within its bound.
//!
//! `scripts/lab/train/finish_model.py` defines the network, `finish_data.py` and `finish_views.py` its input planes; a
//! test compares the planes that are made here. The output is a weighted mean of pixels of these pictures.

use super::bound::{self, Noise};
use super::estimate::{Estimate, level_count, quarters};
use super::{conserve, temporal};
use crate::combine::Network;
use crate::combine::model::FINISH_PLANES;
use crate::combine::output::{NetworkOutput, Rect};
use crate::combine::stack::{check_layer, check_levels, depth_of};
use crate::combine::tensor::{self, BACKGROUND_DEPTH, Normalisation};
use crate::combine::tile::Tile;
use crate::error::{Error, ErrorKind, Result};
use crate::film::{LayerSet, Picture, Size, channel_mean};
use std::array::from_fn;

/// Largest magnitude of the network's input, which training stores as half floats.
const LARGEST: f32 = 6e4;
/// Additive parts of the estimate whose light the network reads, in order.
const PARTS: [&str; 5] = ["Emission", "Direct", "Indirect", "Caustic", "Volume"];
/// Largest ratio of the output to the sum of the brightest pixels of these pictures that rounding can produce.
const ROUNDING: f32 = 1.0001;
/// Bytes per pixel of the picture that the network takes: its input pictures, the spread and the output.
const BYTES_PER_PIXEL: u64 = 130;
/// Bytes that the network takes for a tile of the picture.
const TILE_BYTES: u64 = 200 << 20;

/// Bytes that the network takes for a picture of `pixels` pixels.
pub fn bytes(pixels: u64) -> u64 {
    BYTES_PER_PIXEL * pixels + TILE_BYTES
}

/// Layers of a picture that the network reads, apart from its estimate.
pub struct Planes {
    /// Reflectance and normal at the first rough hit, with their noise.
    guides: [Picture; 2],
    /// Distance to that hit.
    depth: Vec<f32>,
    /// Means over RGB of [`PARTS`]; zero where the picture has no such part.
    parts: Vec<[f32; PARTS.len()]>,
    /// Correlation of the noise of neighbours, see [`temporal::correlation`].
    correlation: Vec<f32>,
}

impl Planes {
    /// The planes of a layer set with this estimate, whose guides have not been cleaned.
    ///
    /// # Errors
    /// The set has several bandwidth levels, lacks a layer, or does not say how many iterations it has.
    pub fn of(set: &LayerSet, estimate: &Estimate) -> Result<Planes> {
        check_levels(level_count(set).max(1), 1)?;
        if estimate.samples.is_none() {
            let cause = "the file does not say how many iterations it has, which the network of --model reads";
            return Err(Error::new(ErrorKind::Image, "", cause).hint("leave --model out"));
        }
        let guides = [&estimate.albedo, &estimate.normal].map(|guide| guide.clone().unwrap_or_default());
        let depth = depth_of(set);
        for (name, size) in [("albedo", guides[0].len()), ("normal", guides[1].len()), ("depth", depth.len())] {
            check_layer(name, size, set.pixels())?;
        }
        let mut parts = vec![[0.0; PARTS.len()]; set.pixels()];
        for (k, name) in PARTS.iter().enumerate() {
            for (means, rgb) in parts.iter_mut().zip(set.picture(name).iter().flat_map(|part| part.iter())) {
                means[k] = channel_mean(*rgb) as f32;
            }
        }
        let correlation = temporal::correlation(set.size(), quarters(set).as_ref());
        Ok(Planes { guides, depth, parts, correlation })
    }
}

/// The network's input for a picture. Radiance is in units of its trimmed mean, and depth of its median.
struct Input<'a> {
    planes: &'a Planes,
    estimate: &'a Estimate,
    /// The picture that is denoised without the network, and the denoised whole, if that is another one.
    denoised: [&'a Picture; 2],
    noise: Noise<'a>,
    scales: Normalisation,
    /// Whether the additive parts are those of the estimate; otherwise the network gets none.
    has_parts: bool,
}

impl Input<'_> {
    /// The value of an input plane, by its number, at pixel `i`.
    fn value(&self, plane: usize, i: usize) -> f32 {
        let Input { planes, estimate, noise: Noise { spread, limit, .. }, scales, .. } = self;
        let radiance = |x: f32| stored(x * scales.exposure);
        match plane {
            0..3 => radiance(estimate.mean[i][plane]).max(0.0),
            3..6 => radiance(self.denoised[0][i][plane - 3]).max(0.0),
            6 => radiance((channel_mean(estimate.deviation[i].map(|error| error * error)) as f32).sqrt()),
            7..10 => {
                let spread = spread[i][plane - 7];
                // No limit at all where there is no spread would be no number.
                if spread > 0.0 { radiance(limit * spread) } else { 0.0 }
            }
            10..13 => stored(planes.guides[0][i][plane - 10]),
            13..16 => stored(planes.guides[1][i][plane - 13]),
            16 if planes.depth[i] < BACKGROUND_DEPTH => stored(planes.depth[i] / scales.depth),
            16 => LARGEST,
            17..22 if self.has_parts => radiance(planes.parts[i][plane - 17]),
            17..22 => 0.0,
            22 => planes.correlation[i],
            24..27 => radiance(self.denoised[1][i][plane - 24]).max(0.0),
            _ => (estimate.samples.unwrap_or(1).max(1) as f32).log2(),
        }
    }

    /// The input planes of the pixels of a rectangle.
    fn fill(&self, rect: Rect) -> Vec<f32> {
        tensor::rows(self.estimate.mean.size(), FINISH_PLANES, rect, |plane, start, out| {
            out.iter_mut().enumerate().for_each(|(x, out)| *out = self.value(plane, start + x));
        })
    }

    /// The largest output that weights, which sum to one, can give.
    fn brightest(&self) -> f32 {
        let of = |planes: std::ops::Range<usize>| {
            let values = planes.flat_map(|plane| (0..self.estimate.mean.len()).map(move |i| self.value(plane, i)));
            values.fold(0.0, f32::max)
        };
        ROUNDING * (of(0..3) + of(3..6) + of(24..27))
    }
}

/// A value as the training data hold it: at most [`LARGEST`], and zero for no number.
fn stored(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(-LARGEST, LARGEST) }
}

/// A loaded network of the finish.
pub struct FinishNetwork {
    network: Network,
}

impl FinishNetwork {
    /// A network whose output is a picture.
    pub fn new(network: Network) -> FinishNetwork {
        FinishNetwork { network }
    }

    /// The network's picture of an estimate, whose denoised picture is `whole`. `mean`: its mean with the denoised parts,
    /// if the additive parts in `planes` are those of this estimate. The denoised picture stays where the output is no
    /// possible picture, and where it is itself too bright to be read.
    ///
    /// # Errors
    /// [`ErrorKind::Model`]: the network fails.
    pub fn run(
        &mut self,
        planes: &Planes,
        estimate: &Estimate,
        whole: &Picture,
        mean: Option<&Picture>,
    ) -> Result<Picture> {
        let pixels = self.network.metadata().tile_pixels();
        self.run_tiled(planes, estimate, whole, mean, pixels)
    }

    /// [`run`](Self::run) in tiles of about `pixels` pixels; their size changes the result by rounding only.
    fn run_tiled(
        &mut self,
        planes: &Planes,
        estimate: &Estimate,
        whole: &Picture,
        mean: Option<&Picture>,
        pixels: usize,
    ) -> Result<Picture> {
        if whole.is_empty() {
            return Ok(whole.clone());
        }
        let spread = bound::spread(estimate);
        let noise = Noise::new(estimate, &spread);
        // The network was trained with pictures of --denoise full.
        let free = Noise { limit: f32::INFINITY, ..noise };
        let full = |denoised: &Picture| conserve::bounded(&estimate.mean, denoised, free).0;
        let (whole, mean) = (full(whole), mean.map(full));
        let denoised = mean.as_ref().unwrap_or(&whole);
        let scales = Normalisation::new(Some(&estimate.mean), &planes.depth);
        let has_parts = mean.is_some();
        let input = Input { planes, estimate, denoised: [denoised, &whole], noise, scales, has_parts };
        let brightest = input.brightest();
        let colours = |tile: &Tile, output: NetworkOutput| {
            let Rect { x0, y0, x1, y1 } = tile.core;
            let colour = |x: usize, y: usize| {
                let own: [f32; 3] = from_fn(|c| output.row(c, y)[x - output.rect.x0]);
                let without = denoised[y * denoised.size().width + x];
                let is_possible = |c: usize| {
                    // The input clamps what is brighter.
                    let is_read = without[c] * scales.exposure < LARGEST;
                    is_read && (0.0..=brightest).contains(&own[c]) && (own[c] / scales.exposure).is_finite()
                };
                if (0..3).all(is_possible) { own.map(|value| value / scales.exposure) } else { without }
            };
            (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect::<Vec<_>>()
        };
        self.network.run_tiled(denoised.size(), pixels, |rect| input.fill(rect), colours)
    }

    /// Runs the network on a grey picture, so that the caller can time it.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn warm_up(&mut self, Size { width, height }: Size) -> Result<()> {
        let stride = self.network.metadata().stride;
        let rect = Rect { x0: 0, y0: 0, x1: width.next_multiple_of(stride), y1: height.next_multiple_of(stride) };
        let input = vec![0.5; FINISH_PLANES * rect.width() * rect.height()];
        self.network.run(&input, rect).map(|_| ())
    }
}

#[cfg(test)]
mod tests;
