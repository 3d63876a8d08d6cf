//! Rays in fixed directions, and the surfaces that they hit.

use crate::camera::{Camera, CameraRay};
use crate::geometry::Surface;
use crate::math::{Vec2, Vec3};
use crate::scene::Scene;
use crate::scene::contact::RaySurfaces;
use crate::trace::Ray;

/// Maximum number of transmitting surfaces that a test ray passes before it gives up.
const MAX_SURFACES: usize = 64;

/// `n` unit directions, spread evenly over the sphere on a spiral with the golden angle between neighbours.
pub(super) fn directions(n: u32) -> impl Iterator<Item = Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..n).map(move |i| {
        let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
        let (sin, cos) = (golden * f64::from(i)).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vec3::new((r * cos) as f32, y as f32, (r * sin) as f32)
    })
}

/// Number of test rays along each edge of the picture.
const RAYS_PER_EDGE: u32 = 32;

/// Rays of a camera, evenly spread over the picture.
pub(super) fn of_camera(camera: &Camera) -> impl Iterator<Item = CameraRay> {
    let (width, height) = camera.size();
    let at = |i: u32, size: u32| ((f64::from(i) + 0.5) / f64::from(RAYS_PER_EDGE) * f64::from(size)) as u32;
    (0..RAYS_PER_EDGE * RAYS_PER_EDGE).map(move |i| {
        let film = camera.film_point((at(i % RAYS_PER_EDGE, width), at(i / RAYS_PER_EDGE, height)), Vec2::splat(0.5));
        camera.ray(film, Vec2::splat(0.5))
    })
}

/// The first opaque surface that a camera ray sees; `token` is the random number for alpha. The ray passes transmitting
/// surfaces, objects that cameras do not see, and back faces that glTF culls.
pub(super) fn first_seen(scene: &Scene, mut origin: Vec3, direction: Vec3, token: u32) -> Option<Surface> {
    for _ in 0..MAX_SURFACES {
        let surface = first_opaque(scene, origin, direction, f32::INFINITY, token)?;
        let hidden = scene.shapes.instances[surface.instance as usize].hidden_from_camera;
        if !hidden && !scene.culls(&surface, direction) {
            return Some(surface);
        }
        origin = surface.ray_origin(direction);
    }
    None
}

/// The first surface along a ray of length `tmax`, opaque or not; `token` is the random number for alpha.
pub(super) fn first(scene: &Scene, origin: Vec3, direction: Vec3, tmax: f32, token: u32) -> Option<Surface> {
    let hit = scene.tracer.intersect(&Ray { origin, direction, tmax, token })?;
    scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)
}

/// The first opaque surface along a ray of length `tmax`, which passes other surfaces without refraction; `token` is
/// the random number for alpha.
pub(super) fn first_opaque(scene: &Scene, origin: Vec3, direction: Vec3, tmax: f32, token: u32) -> Option<Surface> {
    first_opaque_after(scene, origin, direction, tmax, token, |_| {})
}

/// Does the work of [`first_opaque`], and calls `passed` with each transmitting surface on the way.
pub(super) fn first_opaque_after(
    scene: &Scene,
    origin: Vec3,
    direction: Vec3,
    tmax: f32,
    token: u32,
    mut passed: impl FnMut(&Surface),
) -> Option<Surface> {
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax, token }, None);
    for _ in 0..MAX_SURFACES {
        let (surface, _) = along.next(scene, false)?;
        if !scene.materials.list[surface.material as usize].transmits() {
            return Some(surface);
        }
        passed(&surface);
        along.pass(&surface);
    }
    None
}

/// At most `n` indices, evenly spread over `0..len`.
pub(super) fn spread_indices(len: usize, n: usize) -> impl Iterator<Item = usize> {
    let n = n.min(len);
    (0..n).map(move |i| (2 * i + 1) * len / (2 * n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_indices_are_evenly_spread() {
        let all: Vec<Vec3> = directions(256).collect();
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-6));
        assert!((all.iter().copied().sum::<Vec3>() / 256.0).length() < 0.01);
        assert_eq!(spread_indices(3, 8).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(spread_indices(100, 4).collect::<Vec<_>>(), [12, 37, 62, 87]);
        assert_eq!(spread_indices(0, 4).count(), 0);
    }
}
