//! The visible region of the scene, for light from infinity. Light paths from a sun or an environment cover the whole
//! scene; without a region to aim at, few of them would arrive where the camera looks.

use crate::camera::{par_pixels, pixels_per_band};
use crate::light::{Light, Region};
use crate::math::Vec3;
use crate::random::{Domain, Streams};
use crate::scene::Scene;
use crate::stat::median;
use crate::transport::CameraPaths;
use bumpalo::Bump;
use rayon::prelude::*;

/// Number of camera paths that find the region, a sphere around most visible points.
const SAMPLED_PATHS: f64 = 1024.0;
/// Share of the visible points that lie within the sphere before it is enlarged.
const COVERED_SHARE: f64 = 0.8;
/// Factor by which the sphere's radius is enlarged, because objects that light the points are around them.
const RADIUS_FACTOR: f32 = 1.5;
/// Largest area of the sphere's disc at which it is used, relative to the disc around the scene.
const MAX_AREA_SHARE: f32 = 0.25;

/// A sphere around most of the visible points, toward which lights at infinity send light paths; `None` if that is most
/// of the scene, or if no light is at infinity.
pub(super) fn region(camera_paths: &CameraPaths<'_>, seed: u64) -> Option<Region> {
    let Scene { lights, .. } = camera_paths.scene;
    if !lights.emitters().iter().any(|emitter| emitter.is_infinite()) {
        return None;
    }
    let (width, height) = camera_paths.camera.size();
    let camera =
        camera_paths.camera.subsample((SAMPLED_PATHS / (f64::from(width) * f64::from(height))).sqrt().min(1.0));
    let camera_paths = CameraPaths { camera: &camera, ..*camera_paths };
    let (width, height) = camera.size();
    let mut seen: Vec<Option<Vec3>> = vec![None; width as usize * height as usize];
    let streams = Streams::new(seed, 0, Domain::PilotCamera);
    par_pixels(seen.par_chunks_mut(pixels_per_band(width)), (width, height), Bump::new, |arena, seen, places| {
        let starts = camera_paths.starts(places, streams);
        for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
            seen[place.at] = camera_paths.gather_point(arena, start).map(|point| point.p);
            arena.reset();
        }
    });
    let seen: Vec<Vec3> = seen.into_iter().flatten().collect();
    let along = |axis: usize| {
        let mut values: Vec<f32> = seen.iter().map(|p| p[axis]).collect();
        median(&mut values, f32::total_cmp)
    };
    let center = Vec3::new(along(0)?, along(1)?, along(2)?);
    let covered = ((seen.len() as f64 * COVERED_SHARE) as usize).min(seen.len() - 1);
    let mut distances: Vec<f32> = seen.iter().map(|p| p.distance(center)).collect();
    let radius = RADIUS_FACTOR * *distances.select_nth_unstable_by(covered, f32::total_cmp).1;
    let whole = lights.sky().radius;
    (radius > 0.0 && radius * radius < MAX_AREA_SHARE * whole * whole).then(|| Region::new(center, radius, whole))
}
