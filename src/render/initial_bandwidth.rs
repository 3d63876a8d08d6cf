//! Initial bandwidths, one per pixel and kind of photons. They come from a pilot whose photons are not accumulated.
//!
//! The pilot depends on the arguments only, so shards and resumed renders compute the same bandwidths. A pixel's
//! largest bandwidth is the distance to the k-th nearest photon of the kind on the surface around the gathering point
//! of its pilot path. It is at most [`SCREEN_CAP`] (by default) of the picture's width at that distance; this cap is
//! also the bandwidth if fewer than k photons lie within it. In a strongly magnified view hardly any photon would lie
//! within the cap, and indirect light would be missing. So the cap is at least the bandwidth in which one photon is
//! expected where photon density is typical. A pixel whose pilot path gathers nowhere gets the median of the others; if
//! there are none, the cap at the distance of the scene's radius.

use crate::camera::{Camera, par_pixels, pixels_per_band};
use crate::photon::{Located, Nearest, PhotonMap, VolumePhoton};
use crate::random::{Domain, Streams};
use crate::stat::median;
use crate::transport::{CameraPathStart, CameraPaths, GatherPoint};
use bumpalo::Bump;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Largest initial bandwidth over the width that the picture covers at the gathering point. A kernel wider than
/// a tenth of the picture has no local information.
pub const SCREEN_CAP: f32 = 0.05;
/// Initial bandwidth over the width of a pixel at the gathering point, for `--initial-bandwidth footprint`.
pub const FOOTPRINT_PIXELS: f32 = 3.0;
/// Smallest bandwidth over the radius of the scene's bounding sphere. At a perfect focus the distance between
/// photons is zero.
pub const MIN_BANDWIDTH_RATIO: f32 = 1e-7;

/// Smallest bandwidth that a user may set, over the radius of the scene's bounding sphere. It is a hundred steps
/// (2^-24) of single precision positions; the smallest of five levels is a quarter of it. Below that, distances of
/// photons are rounding errors.
pub const MIN_USER_BANDWIDTH_RATIO: f32 = 1e-5;

/// Half width, in pixels, of the square of pixels whose median [`initial_volume_bandwidths`] takes.
const NEIGHBOURHOOD: usize = 3;

/// Rule that sets the initial bandwidth of the largest bandwidth level of each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum InitialBandwidth {
    /// Distance to the k-th nearest photon of the pilot iteration, which runs before the first one.
    Nearest(usize),
    /// [`FOOTPRINT_PIXELS`] times the width of a pixel at the gathering point.
    Footprint,
    /// One bandwidth for all pixels (scene units).
    Fixed(f32),
}

/// Width that the picture covers at the end of a camera path of this length (scene units).
pub fn picture_width_at(camera: &Camera, length: f32) -> f32 {
    let (slope, at_zero) = camera.span();
    slope * length + at_zero
}

/// Radius (scene units) of [`InitialBandwidth::Footprint`] at the end of a camera path of this length.
pub fn footprint(camera: &Camera, length: f32) -> f32 {
    FOOTPRINT_PIXELS * picture_width_at(camera, length) / camera.whole_width()
}

/// Initial bandwidth of the largest bandwidth level of every pixel, for the photons of each pilot map (photons
/// of the iteration that runs before the first), row by row (scene units). It is at most `widest` times the picture's
/// width, or the bandwidth in which one photon is expected if that is larger.
pub fn initial_bandwidths<const MAPS: usize>(
    camera_paths: &CameraPaths<'_>,
    rule: InitialBandwidth,
    widest: f32,
    seed: u64,
    pilots: [&PhotonMap; MAPS],
) -> Vec<[f32; MAPS]> {
    let allowed = pilots.map(|pilot| bandwidth_of_one(rule, pilot, f32::sqrt));
    bandwidths(camera_paths, rule, Bounds { widest, allowed }, seed, pilots, |arena, start| {
        camera_paths.gather_point(arena, start)
    })
}

/// Largest initial bandwidth of every pixel for photons in media, around a point in the first medium on its pilot path.
///
/// The position of the point on the path is random, and density near the camera differs from density further away. So
/// each pixel takes the median of its neighbourhood, and the cap is derived from the picture's width at the surface
/// behind. From inside a medium that cap may be so small that hardly any pixel finds a photon. So it is at least the
/// bandwidth in which one photon is expected.
pub fn initial_volume_bandwidths(
    camera_paths: &CameraPaths<'_>,
    rule: InitialBandwidth,
    widest: f32,
    seed: u64,
    pilot: &PhotonMap<VolumePhoton>,
) -> Vec<f32> {
    let bounds = Bounds { widest, allowed: [bandwidth_of_one(rule, pilot, f32::cbrt)] };
    let found =
        bandwidths(camera_paths, rule, bounds, seed, [pilot], |arena, start| camera_paths.volume_point(arena, start));
    medians(found.as_flattened(), camera_paths.camera.size().0 as usize)
}

/// Median around every pixel: over the square of `2 NEIGHBOURHOOD + 1` pixels on a side, as far as it is in the
/// picture.
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

/// Radius (scene units) in which one photon is expected where photon density is typical: the distance to the k-th
/// nearest photon of the pilot iteration over `root(k)`; 0 if it is unknown.
fn bandwidth_of_one<P: Located>(rule: InitialBandwidth, pilot: &PhotonMap<P>, root: impl Fn(f32) -> f32) -> f32 {
    let InitialBandwidth::Nearest(k) = rule else { return 0.0 };
    let one = median_bandwidth2(pilot, k).sqrt() / root(k as f32);
    if one.is_finite() { one } else { 0.0 }
}

/// Upper bounds of initial bandwidths.
#[derive(Clone, Copy)]
struct Bounds<const MAPS: usize> {
    /// Bound as a fraction of the picture's width at the gathering point.
    widest: f32,
    /// Radius (scene units) that is always allowed, by photon map.
    allowed: [f32; MAPS],
}

impl<const MAPS: usize> Bounds<MAPS> {
    /// Upper bound of the bandwidth for photon map `map`, at a gathering point where the picture is `span` wide (scene
    /// units).
    fn at(self, map: usize, span: f32) -> f32 {
        (self.widest * span).max(self.allowed[map])
    }
}

/// Median over all photons of the squared distance to the k-th nearest photon (square scene units); infinite if there
/// are too few.
pub fn median_bandwidth2<P: Located>(map: &PhotonMap<P>, k: usize) -> f32 {
    const SAMPLES: usize = 256;
    let mut nearest = Nearest::default();
    let every = map.photons().iter().step_by(map.photons().len().div_ceil(SAMPLES).max(1));
    let of = |photon: &P| nearest.bandwidth2(map, photon.position(), photon.normal(), k, f32::INFINITY);
    let mut found: Vec<f32> = every.filter_map(of).collect();
    median(&mut found, f32::total_cmp).unwrap_or(f32::INFINITY)
}

fn bandwidths<P: Located, const MAPS: usize>(
    camera_paths: &CameraPaths<'_>,
    rule: InitialBandwidth,
    bounds: Bounds<MAPS>,
    seed: u64,
    pilots: [&PhotonMap<P>; MAPS],
    find: impl Fn(&Bump, &CameraPathStart) -> Option<GatherPoint> + Sync,
) -> Vec<[f32; MAPS]> {
    let (scene, camera) = (camera_paths.scene, camera_paths.camera);
    let (width, height) = camera.size();
    let pixels = width as usize * height as usize;
    if let InitialBandwidth::Fixed(r) = rule {
        return vec![[r; MAPS]; pixels];
    }
    let least = MIN_BANDWIDTH_RATIO * scene.lights.sky().radius;
    let of_point = |map: usize, nearest: &mut Nearest<P>, point: &GatherPoint| {
        let cap = bounds.at(map, picture_width_at(camera, point.length));
        let r = match rule {
            InitialBandwidth::Nearest(k) => {
                nearest.bandwidth2(pilots[map], point.p, point.ng, k, cap * cap).map_or(cap, f32::sqrt)
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
            if camera_paths.is_stopped() {
                return;
            }
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
        let usual = || bounds.at(map, picture_width_at(camera, scene.lights.sky().radius)).max(least);
        median(&mut known, f32::total_cmp).unwrap_or_else(usual)
    });
    found.into_iter().map(|r| r.unwrap_or(fallback)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_remove_outliers_and_keep_edges() {
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
