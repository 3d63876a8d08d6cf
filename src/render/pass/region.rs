//! The region that a picture shows, for light from infinity: of a lamp as wide as the scene few paths would come where
//! anybody looks.

use crate::camera::{par_pixels, pixels_per_band};
use crate::light::Region;
use crate::math::Vec3;
use crate::random::{Domain, Streams};
use crate::scene::Scene;
use crate::stat::median;
use crate::transport::CameraPaths;
use bumpalo::Bump;
use rayon::prelude::*;

/// Eye paths that are asked.
const PATHS: f64 = 1024.0;
/// Share of the points seen that it holds, and how much wider it is: what lights them is around them.
const HELD: (f64, f32) = (0.8, 1.5);
/// A region of more than this share of the scene's disc is none.
const WIDEST: f32 = 0.25;

/// A sphere around most of what the eye's paths see, if that is little of the scene.
pub(super) fn region(camera_paths: &CameraPaths<'_>, seed: u64) -> Option<Region> {
    let Scene { lights, .. } = camera_paths.scene;
    if !lights.emitters().iter().any(|emitter| emitter.is_infinite()) {
        return None;
    }
    let (width, height) = camera_paths.camera.size();
    let camera = camera_paths.camera.subsample((PATHS / (f64::from(width) * f64::from(height))).sqrt().min(1.0));
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
    let held = ((seen.len() as f64 * HELD.0) as usize).min(seen.len() - 1);
    let mut distances: Vec<f32> = seen.iter().map(|p| p.distance(center)).collect();
    let radius = HELD.1 * *distances.select_nth_unstable_by(held, f32::total_cmp).1;
    let whole = lights.sky().radius;
    (radius > 0.0 && radius * radius < WIDEST * whole * whole).then(|| Region::new(center, radius, whole))
}
