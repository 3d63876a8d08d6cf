//! The pixels in which a camera sees smooth glass or a mirror.

use crate::geometry::Surface;
use crate::math::{Vec2, Vec3};
use crate::scene::contact::RaySurfaces;
use crate::scene::{Scene, View};
use crate::trace::Ray;

/// Most surfaces that cameras do not see on a ray, after which it counts as seeing nothing.
const MAX_HIDDEN_SURFACES: usize = 64;
/// The random number of the rays, which decides whether a surface with alpha is there.
const TOKEN: u32 = 0x8000_0000;

/// For each pixel, whether the first surface that the camera sees in its middle is smooth glass or a mirror
/// ([`Material::is_smooth`](crate::material::Material::is_smooth)).
pub fn shows_glass_or_mirror(View { scene, camera }: View<'_>) -> Vec<bool> {
    let (width, height) = camera.size();
    let shows = |pixel: (u32, u32)| {
        let ray = camera.ray(camera.film_point(pixel, Vec2::splat(0.5)), Vec2::splat(0.5));
        first_seen(scene, ray.origin, ray.direction)
            .is_some_and(|surface| scene.materials.list[surface.material as usize].is_smooth())
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(shows).collect()
}

/// The first surface on a ray that cameras see.
fn first_seen(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Surface> {
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax: f32::INFINITY, token: TOKEN }, None);
    for _ in 0..MAX_HIDDEN_SURFACES {
        let (surface, _) = along.next(scene, false)?;
        let hidden = scene.shapes.instances[surface.instance as usize].hidden_from_camera;
        if !hidden && !scene.culls(&surface, direction) {
            return Some(surface);
        }
        along.pass(&surface);
    }
    None
}
