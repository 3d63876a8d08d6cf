//! The layer of motion vectors, in Blender's convention: `X Y` is the place of a point in the previous frame less its place
//! in this one, `Z W` its place in this frame less that in the next, in pixels, x to the right and y up (Cycles,
//! `kernel/geom/primitive.h`).

use super::request::Request;
use crate::error::Result;
use crate::film::MOTION;
use crate::math::{DVec2, DVec3, Mat2, Vec2, Vec3};
use crate::path_class::ClassSet;
use crate::scene::gltf::MovingFile;
use crate::scene::{Pose, Scene, TrianglePoint, View, usd};
use crate::stop::Stop;
use crate::transport::{CameraPaths, Indirect, InitialMedia, PointOnRay, Through, Visible, last_ray, visible_surface};
use bumpalo::Bump;
use rayon::prelude::*;

/// The motion vectors of a picture, row by row from the top; zero where nothing is seen or nothing moves. `None` if the
/// user has not asked for them.
///
/// # Errors
/// The scene is invalid one frame earlier or later.
pub(super) fn motion_vectors(
    request: &Request,
    View { scene, camera }: View<'_>,
    file: Option<&MovingFile>,
    stop: &Stop,
) -> Result<Option<Vec<[f32; 4]>>> {
    if !request.layers.wants(MOTION) {
        return Ok(None);
    }
    let (width, height) = camera.size();
    let pixels = width as usize * height as usize;
    let Some(poses) = poses(request, scene, file, stop)? else { return Ok(Some(vec![[0.0; 4]; pixels])) };
    let camera = camera.without_lens();
    let interior = InitialMedia::of(scene, &camera).camera;
    let camera_paths = CameraPaths {
        lobes: false,
        scene,
        camera: &camera,
        interior,
        splits: 0,
        max_depth: u32::MAX,
        indirect: Indirect::Photons,
        classes: ClassSet::ALL,
        stop: None,
    };
    let cameras = poses.each_ref().map(|pose| pose.camera.without_lens());
    let others = cameras.each_ref().map(|camera| {
        let interior = InitialMedia::of(scene, camera).camera;
        CameraPaths { camera, interior, ..camera_paths }
    });
    let vector = |arena: &mut Bump, pixel: usize| {
        let at = ((pixel % width as usize) as u32, (pixel / width as usize) as u32);
        vector(&camera_paths, &poses, &others, arena, at).unwrap_or([0.0; 4])
    };
    Ok(Some((0..pixels).into_par_iter().map_init(Bump::new, vector).collect()))
}

/// The poses of a scene in the previous frame, in its frame and in the next one; `None` if nothing is animated.
fn poses(request: &Request, scene: &Scene, file: Option<&MovingFile>, stop: &Stop) -> Result<Option<[Pose; 3]>> {
    let (path, options) = (&request.scene.path, &request.scene.options);
    let moments = file.map(MovingFile::moments).transpose()?;
    let pose = |after_frame: f64| {
        let description = match &moments {
            Some(moments) => moments.describe_pose(after_frame)?,
            None => usd::read(path, options, after_frame, stop)?,
        };
        Pose::new(scene, description, &request.picture.camera).map_err(|e| e.within(path.display()))
    };
    if moments.is_none() && !(usd::is_stage(path) && options.frame.is_some()) {
        return Ok(None);
    }
    Ok(Some([pose(-1.0)?, pose(0.0)?, pose(1.0)?]))
}

/// The motion vector of a pixel; `None` if it shows no surface. `others`: camera paths of the cameras of all poses.
fn vector(
    camera_paths: &CameraPaths<'_>,
    poses: &[Pose; 3],
    others: &[CameraPaths<'_>; 3],
    arena: &mut Bump,
    pixel: (u32, u32),
) -> Option<[f32; 4]> {
    let Visible { surface, through } = visible_surface(camera_paths, arena, pixel)?;
    let point = TrianglePoint::new(camera_paths.scene, surface.instance, surface.primitive, surface.p.as_dvec3());
    let position = poses[1].position(&point)?;
    let [(width, height), _] = camera_paths.camera.whole();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let film = camera_paths.camera.film_point(pixel, Vec2::splat(0.5));
    let key = camera_paths.camera.pixel_key(pixel);
    let [before, now, after] = [0, 1, 2].map(|k| {
        let project = |p: DVec3| Some(poses[k].camera.project(p)? * size);
        // The vector of an object that is missing in the other frame shows the motion of the camera alone.
        let target = poses[k].position(&point).unwrap_or(position);
        match through {
            None => project(target),
            Some(_) if k == 1 => Some(film.as_dvec2()),
            Some(Through { path, first }) => {
                let start = project(first.as_dvec3())?;
                let found = place_of_image(&others[k], arena, (key, path), start.as_vec2(), target.as_vec3());
                Some(found.map_or(start, |film| film.as_dvec2()))
            }
        }
    });
    let moved = |from: Option<DVec2>, to: Option<DVec2>| {
        let vector = (from.zip(to)).map_or(DVec2::ZERO, |(from, to)| (from - to) * DVec2::new(1.0, -1.0)).as_vec2();
        // Adding zero makes -0 positive.
        if vector.is_finite() { (vector + 0.0).to_array() } else { [0.0; 2] }
    };
    let ([x, y], [z, w]) = (moved(before, now), moved(now, after));
    Some([x, y, z, w])
}

/// Film points between which the motion of a path's last ray is measured (pixels).
const STEP: f32 = 0.25;
/// Largest change of the place at which Newton's method ends (pixels), and its largest number of steps.
const TOLERANCE: f32 = 1e-2;
const MAX_STEPS: usize = 12;

/// The point of the whole picture at which a camera sees `target` by a path of a pixel (its key, and the number of the
/// path) through mirrors and clear glass, which rest. Found by Newton's method from the point `start`; `None` if it is not,
/// as where the image leaves the mirror.
fn place_of_image(
    camera_paths: &CameraPaths<'_>,
    arena: &mut Bump,
    (key, path): (u64, u64),
    start: Vec2,
    target: Vec3,
) -> Option<Vec2> {
    let mut ray = |film: Vec2| last_ray(camera_paths, arena, key, path, film);
    // By how much the last ray from a film point misses the target, in the plane across the one from `film`, and the change
    // of that per pixel.
    let mut missed = |film: Vec2| {
        let middle = ray(film)?;
        let (right, up) = middle.direction.any_orthonormal_pair();
        let offset = |PointOnRay { p, direction }: PointOnRay| {
            let along = (p - target).dot(middle.direction) / direction.dot(middle.direction);
            let apart = p - target - direction * along;
            Vec2::new(apart.dot(right), apart.dot(up))
        };
        let here = offset(middle);
        let mut slope = |axis: Vec2| {
            // At an edge, one of the neighbours is missing.
            let (step, beside) = [STEP, -STEP].into_iter().find_map(|step| Some((step, ray(film + step * axis)?)))?;
            Some((offset(beside) - here) / step)
        };
        Some((here, Mat2::from_cols(slope(Vec2::X)?, slope(Vec2::Y)?)))
    };
    let mut film = start;
    for _ in 0..MAX_STEPS {
        let (here, slopes) = missed(film)?;
        let step = -(slopes.inverse() * here);
        film += step;
        if !film.is_finite() {
            return None;
        }
        if step.abs().max_element() < TOLERANCE {
            return Some(film);
        }
    }
    None
}
