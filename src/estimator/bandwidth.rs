//! Initial bandwidths: one per pixel, for both eye paths, from a pilot pass whose photons are not accumulated.
//!
//! The pilot depends on the arguments alone, so shards and resumed renders make the same bandwidths. A pixel's largest bandwidth is
//! the distance to the k-th nearest photon of its own surface around its pilot path's gathering point, at most [`SCREEN_CAP`] of the
//! picture's width there. With fewer than k photons within the cap it is the cap. A pixel whose pilot path gathers nowhere
//! gets the median of the others (or, with no others, the cap at the scene's size).

use crate::camera::{Camera, band, par_pixels};
use crate::photon::{Located, Nearest, PhotonMap, VolumePhoton};
use crate::random::{Domain, Stream, Streams};
use crate::transport::{Eye, GatherPoint, PathStart};
use bumpalo::Bump;
use rayon::prelude::*;

/// Largest bandwidth over the width that the picture spans at the gathering point: a kernel wider than a tenth of the picture says
/// nothing about a place.
pub const SCREEN_CAP: f32 = 0.05;
/// `--initial-bandwidth footprint`: radius over the width of a pixel at the gathering point.
pub const FOOTPRINT_PIXELS: f32 = 3.0;
/// Smallest bandwidth over the scene's radius: where photons fall on one point (a perfect focus) the distance is zero.
pub const LEAST: f32 = 1e-7;

/// What sets the largest initial bandwidth.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Largest initial bandwidth of every pixel, row by row.
pub fn initial_bandwidths(eye: &Eye<'_>, rule: InitialBandwidth, seed: u64, pilot: &PhotonMap) -> Vec<f32> {
    bandwidths(eye, rule, seed, pilot, |arena, start| eye.gather_point(arena, start))
}

/// Largest initial bandwidth of every pixel for photons in media: around a point of the first medium on its pilot path, in three dimensions.
pub fn initial_volume_bandwidths(
    eye: &Eye<'_>,
    rule: InitialBandwidth,
    seed: u64,
    pilot: &PhotonMap<VolumePhoton>,
) -> Vec<f32> {
    bandwidths(eye, rule, seed, pilot, |arena, start| eye.volume_point(arena, start))
}

fn bandwidths<P: Located>(
    eye: &Eye<'_>,
    rule: InitialBandwidth,
    seed: u64,
    pilot: &PhotonMap<P>,
    find: impl Fn(&Bump, &(PathStart, Stream)) -> Option<GatherPoint> + Sync,
) -> Vec<f32> {
    let (scene, camera) = (eye.scene, eye.camera);
    let (width, height) = camera.size();
    let pixels = width as usize * height as usize;
    if let InitialBandwidth::Fixed(r) = rule {
        return vec![r; pixels];
    }
    let least = LEAST * scene.lights.sky().radius;
    let of_point = |nearest: &mut Nearest<P>, point: &GatherPoint| {
        let span = span(camera, point.length);
        let cap = SCREEN_CAP * span;
        let r = match rule {
            InitialBandwidth::Nearest(k) => {
                nearest.radius2(pilot, point.p, point.ng, k, cap * cap).map_or(cap, f32::sqrt)
            }
            _ => (FOOTPRINT_PIXELS * span / width as f32).min(cap),
        };
        r.max(least)
    };
    let mut found: Vec<Option<f32>> = vec![None; pixels];
    let streams = Streams::new(seed, 0, Domain::PilotEye);
    par_pixels(
        found.par_chunks_mut(band(width)),
        (width, height),
        <(Bump, Nearest<P>)>::default,
        |(arena, nearest), found, places| {
            let starts = eye.starts(places, streams);
            for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                found[place.at] = find(arena, start).map(|point| of_point(nearest, &point));
                arena.reset();
            }
        },
    );
    let mut known: Vec<f32> = found.iter().flatten().copied().collect();
    let fallback = if known.is_empty() {
        (SCREEN_CAP * span(camera, scene.lights.sky().radius)).max(least)
    } else {
        let middle = known.len() / 2;
        *known.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    found.into_iter().map(|r| r.unwrap_or(fallback)).collect()
}
