//! The layer of motion vectors, in Blender's convention: `X Y` is the place of a point in the previous frame less its place
//! in this one, `Z W` its place in this frame less that in the next, in pixels, x to the right and y up (Cycles,
//! `kernel/geom/primitive.h`).

use super::request::Request;
use crate::error::Result;
use crate::film::MOTION;
use crate::math::DVec2;
use crate::path_class::ClassSet;
use crate::scene::gltf::MovingFile;
use crate::scene::{Pose, Scene, TrianglePoint, View, usd};
use crate::stop::Stop;
use crate::transport::{CameraPaths, Indirect, InitialMedia, visible_surface};
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
    let vector = |arena: &mut Bump, pixel: usize| {
        let at = ((pixel % width as usize) as u32, (pixel / width as usize) as u32);
        vector(&camera_paths, &poses, arena, at).unwrap_or([0.0; 4])
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

/// The motion vector of a pixel; `None` if it shows no surface.
fn vector(
    camera_paths: &CameraPaths<'_>,
    [previous, now, next]: &[Pose; 3],
    arena: &mut Bump,
    pixel: (u32, u32),
) -> Option<[f32; 4]> {
    let surface = visible_surface(camera_paths, arena, pixel)?;
    let p = surface.p.as_dvec3();
    let point = TrianglePoint::new(camera_paths.scene, surface.instance, surface.primitive, p);
    let position = now.position(&point)?;
    let place = now.camera.project(position)?;
    let [(width, height), _] = camera_paths.camera.whole();
    let size = DVec2::new(f64::from(width), -f64::from(height));
    // The vector of an object that is missing in the other frame shows the motion of the camera alone.
    let place_in = |pose: &Pose| pose.camera.project(pose.position(&point).unwrap_or(position));
    let moved = |from: Option<DVec2>, to: Option<DVec2>| {
        let vector = (from.zip(to)).map_or(DVec2::ZERO, |(from, to)| (from - to) * size).as_vec2();
        // Adding zero makes -0 positive.
        if vector.is_finite() { (vector + 0.0).to_array() } else { [0.0; 2] }
    };
    let [x, y] = moved(place_in(previous), Some(place));
    let [z, w] = moved(Some(place), place_in(next));
    Some([x, y, z, w])
}
