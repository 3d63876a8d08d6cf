//! Initial bandwidths: one per pixel and kind of photons, for both camera paths, from a pilot pass whose photons are not
//! accumulated.
//!
//! The pilot depends on the arguments alone, so shards and resumed renders make the same bandwidths. A pixel's largest
//! bandwidth is the distance to the k-th nearest photon of the kind on its own surface around its pilot path's
//! gathering point, at most [`SCREEN_CAP`] of the picture's width there (by default). With fewer than k photons within
//! the cap it is the cap. A magnified view may be so small that no photon ever lies within its cap, and all the light
//! that photons bring would be missing: the cap is no smaller than the radius in which one photon is expected where
//! photons usually lie. A pixel whose pilot path gathers nowhere gets the median of the others (or, with no others,
//! the cap at the scene's size).

use crate::camera::{Camera, par_pixels, pixels_per_band};
use crate::photon::{Located, Nearest, PhotonMap, VolumePhoton};
use crate::random::{Domain, Stream, Streams};
use crate::stat::median;
use crate::transport::{CameraPaths, GatherPoint, PathStart};
use bumpalo::Bump;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Largest bandwidth over the width that the picture spans at the gathering point: a kernel wider than a tenth of the
/// picture says nothing about a place.
pub const SCREEN_CAP: f32 = 0.05;
/// `--initial-bandwidth footprint`: radius over the width of a pixel at the gathering point.
pub const FOOTPRINT_PIXELS: f32 = 3.0;
/// Smallest bandwidth over the scene's radius: where photons fall on one point (a perfect focus) the distance is zero.
pub const LEAST: f32 = 1e-7;

/// Smallest bandwidth over the scene's radius that may be asked for: positions are single precision numbers, a hundred
/// of whose steps (2^-24) it is, and the smallest of five levels a quarter of that. Photons are not found where their
/// distance is rounding.
pub const LEAST_ASKED: f32 = 1e-5;

/// Pixels to each side that [`initial_volume_bandwidths`] looks at.
const NEIGHBOURHOOD: usize = 3;

/// What sets the largest initial bandwidth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum InitialBandwidth {
    /// Distance to the k-th nearest pilot photon.
    Nearest(usize),
    /// [`FOOTPRINT_PIXELS`] pixels.
    Footprint,
    /// The same everywhere (scene units).
    Fixed(f32),
}

/// Width that the picture spans at the end of a path of some length.
pub fn span(camera: &Camera, length: f32) -> f32 {
    let (slope, at_zero) = camera.span();
    slope * length + at_zero
}

/// [`InitialBandwidth::Footprint`] at the end of a path of some length.
pub fn footprint(camera: &Camera, length: f32) -> f32 {
    FOOTPRINT_PIXELS * span(camera, length) / camera.whole_width()
}

/// Largest initial bandwidth of every pixel for the photons of each pilot map, row by row; at most `widest` of the
/// picture's width, if one photon is expected within that.
pub fn initial_bandwidths<const MAPS: usize>(
    camera_paths: &CameraPaths<'_>,
    rule: InitialBandwidth,
    widest: f32,
    seed: u64,
    pilots: [&PhotonMap; MAPS],
) -> Vec<[f32; MAPS]> {
    let enough = pilots.map(|pilot| enough(rule, pilot, f32::sqrt));
    bandwidths(camera_paths, (rule, Bounds { widest, enough }), seed, pilots, |arena, start| {
        camera_paths.gather_point(arena, start)
    })
}

/// Largest initial bandwidth of every pixel for photons in media: around a point of the first medium on its pilot path,
/// in three dimensions.
///
/// Where on the way that point lies is chance, and what is true near the eye is not true of the whole way: each pixel
/// takes the median of those around it, and what bounds it is the picture's width at the surface behind. From within a
/// medium that bound may be so near that hardly a pixel ever finds a photon, and all are dark: it is not below the
/// radius in which one is expected.
pub fn initial_volume_bandwidths(
    camera_paths: &CameraPaths<'_>,
    rule: InitialBandwidth,
    widest: f32,
    seed: u64,
    pilot: &PhotonMap<VolumePhoton>,
) -> Vec<f32> {
    let bounds = Bounds { widest, enough: [enough(rule, pilot, f32::cbrt)] };
    let found =
        bandwidths(camera_paths, (rule, bounds), seed, [pilot], |arena, start| camera_paths.volume_point(arena, start));
    medians(found.as_flattened(), camera_paths.camera.size().0 as usize)
}

/// The median of every pixel's neighbourhood, of `2 NEIGHBOURHOOD + 1` pixels squared within the picture.
fn medians(values: &[f32], width: usize) -> Vec<f32> {
    let height = values.len() / width.max(1);
    let around = |at: usize, end: usize| at.saturating_sub(NEIGHBOURHOOD)..(at + NEIGHBOURHOOD + 1).min(end);
    let around_pixel = |index: usize| {
        let (x, y) = (index % width, index / width);
        let mut near: Vec<f32> =
            around(y, height).flat_map(|y| around(x, width).map(move |x| values[y * width + x])).collect();
        median(&mut near, f32::total_cmp).unwrap_or(0.0)
    };
    (0..values.len()).into_par_iter().map(around_pixel).collect()
}

/// The radius in which one photon is expected where photons usually lie, of which those within the k-th nearest take
/// `root` of k times that; 0 where it is not known.
fn enough<P: Located>(rule: InitialBandwidth, pilot: &PhotonMap<P>, root: impl Fn(f32) -> f32) -> f32 {
    let InitialBandwidth::Nearest(k) = rule else { return 0.0 };
    let one = median_radius2(pilot, k).sqrt() / root(k as f32);
    if one.is_finite() { one } else { 0.0 }
}

/// What bandwidths are not to exceed.
#[derive(Clone, Copy)]
struct Bounds<const MAPS: usize> {
    /// Over the picture's width.
    widest: f32,
    /// They may be as large as this at least, by map.
    enough: [f32; MAPS],
}

impl<const MAPS: usize> Bounds<MAPS> {
    /// For a map, at the end of a path where the picture spans so much.
    fn at(self, map: usize, span: f32) -> f32 {
        (self.widest * span).max(self.enough[map])
    }
}

/// Median over photons of the squared distance to the k-th nearest; infinite where there are too few.
pub fn median_radius2<P: Located>(map: &PhotonMap<P>, k: usize) -> f32 {
    const SAMPLES: usize = 256;
    let mut nearest = Nearest::default();
    let every = map.photons().iter().step_by(map.photons().len().div_ceil(SAMPLES).max(1));
    let of = |photon: &P| nearest.radius2(map, photon.position(), photon.normal(), k, f32::INFINITY);
    let mut found: Vec<f32> = every.filter_map(of).collect();
    median(&mut found, f32::total_cmp).unwrap_or(f32::INFINITY)
}

fn bandwidths<P: Located, const MAPS: usize>(
    camera_paths: &CameraPaths<'_>,
    (rule, bounds): (InitialBandwidth, Bounds<MAPS>),
    seed: u64,
    pilots: [&PhotonMap<P>; MAPS],
    find: impl Fn(&Bump, &(PathStart, Stream)) -> Option<GatherPoint> + Sync,
) -> Vec<[f32; MAPS]> {
    let (scene, camera) = (camera_paths.scene, camera_paths.camera);
    let (width, height) = camera.size();
    let pixels = width as usize * height as usize;
    if let InitialBandwidth::Fixed(r) = rule {
        return vec![[r; MAPS]; pixels];
    }
    let least = LEAST * scene.lights.sky().radius;
    let of_point = |map: usize, nearest: &mut Nearest<P>, point: &GatherPoint| {
        let cap = bounds.at(map, span(camera, point.length));
        let r = match rule {
            InitialBandwidth::Nearest(k) => {
                nearest.radius2(pilots[map], point.p, point.ng, k, cap * cap).map_or(cap, f32::sqrt)
            }
            _ => footprint(camera, point.length).min(cap),
        };
        r.max(least)
    };
    let mut found: Vec<Option<[f32; MAPS]>> = vec![None; pixels];
    let streams = Streams::new(seed, 0, Domain::PilotCamera);
    par_pixels(
        found.par_chunks_mut(pixels_per_band(width)),
        (width, height),
        || (Bump::new(), std::array::from_fn::<_, MAPS, _>(|_| Nearest::default())),
        |(arena, nearest), found, places| {
            let starts = camera_paths.starts(places, streams);
            for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                let of = |point| std::array::from_fn(|map| of_point(map, &mut nearest[map], &point));
                found[place.at] = find(arena, start).map(of);
                arena.reset();
            }
        },
    );
    let fallback = std::array::from_fn(|map| {
        let mut known: Vec<f32> = found.iter().flatten().map(|r| r[map]).collect();
        let usual = || bounds.at(map, span(camera, scene.lights.sky().radius)).max(least);
        median(&mut known, f32::total_cmp).unwrap_or_else(usual)
    });
    found.into_iter().map(|r| r.unwrap_or(fallback)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_forget_what_is_odd_and_keep_edges() {
        let (width, height) = (20, 12);
        let side = |index: usize| if index % width < 10 { 1.0 } else { 2.0 };
        let values = (0..width * height).map(|i| if i % 7 == 0 { 1e-3 } else { side(i) }).collect::<Vec<f32>>();
        let found = medians(&values, width);
        for (index, &value) in found.iter().enumerate().filter(|(index, _)| !(8..12).contains(&(index % width))) {
            assert_eq!(value, side(index), "pixel {index}");
        }
        assert_eq!(medians(&[3.0], 1), [3.0]);
        assert!(medians(&[], 0).is_empty());
    }
}
