//! The part of a kernel's ball that lies in the medium whose photons it gathers.
//!
//! Near a boundary of the medium, part of the ball holds no photons of it. The estimate is divided by the kernel's mass
//! inside the medium instead of the mass of the whole ball, and is then unbiased for light that is constant over the
//! ball \[boundary kernels; Silverman 1986, "Density Estimation", 2.10\]. Rays estimate the mass. For the kernel `K` of
//! radius r, a ray that is inside from a to b has the mass `int_a^b 3 t^2 K(t^2 / r^2) dt / r^3`, and the mean over all
//! directions is the mass of the ball.

use super::volume::Volume;
use crate::geometry::Surface;
use crate::math::{Frame, Vec3, sin_cos_turns, warp};
use crate::photon::Kernel;
use crate::random::Purpose;
use crate::scene::Scene;
use crate::scene::contact::RaySurfaces;
use crate::trace::{Hit, Ray};
use crate::transport::walk::interior::Interior;
use crate::transport::walk::pixel_sample::MAX_LEVELS;
use crate::transport::walk::segment::token;
use crate::transport::walk::vertex::MediumVertex;

/// Number of rays that look for the boundaries of a medium around a vertex. They point to the corners of a randomly
/// rotated cube. Each has an opposite one, so that planes through the centre are exact.
const RAYS: usize = 8;
/// Smallest fraction of the kernel inside the medium by which light is divided. A smaller divisor would give photons an
/// unbounded weight.
const MIN_MASS: f32 = 0.05;
/// Largest number of boundaries that a ray crosses.
const MAX_BORDERS: u32 = 32;

impl Volume<'_> {
    /// Fraction (0 to 1) of the gathering kernel around `vertex` that is inside the medium, by bandwidth level.
    pub(in crate::transport) fn kernel_mass_inside(
        &self,
        kernel: Kernel,
        scene: &Scene,
        vertex: &MediumVertex,
        medium: u32,
    ) -> [f32; MAX_LEVELS] {
        let bandwidth2 = self.bandwidths2();
        let reach = bandwidth2.iter().fold(0.0, |largest: f32, &bandwidth2| largest.max(bandwidth2)).sqrt();
        let draws = vertex.draws;
        let frame = Frame::from_normal(warp::sphere_uniform(draws.two(Purpose::Border)));
        let (sin, cos) = sin_cos_turns(draws.one(Purpose::BorderTurn));
        let direction = |k: usize| {
            let side = |bit: usize| if k & bit == 0 { -1.0f32 } else { 1.0 };
            let corner = Vec3::new(side(1), side(2), side(4)) / 3f32.sqrt();
            frame.to_world(Vec3::new(cos * corner.x - sin * corner.y, sin * corner.x + cos * corner.y, corner.z))
        };
        let ray = |k: usize| {
            let token = token(scene, draws, Purpose::Border);
            Ray { origin: vertex.arrival.p, direction: direction(k), tmax: reach, token }
        };
        let mut hits = [const { None }; RAYS];
        scene.tracer.intersect8(|k| Some(ray(k)), |k, hit| hits[k] = Some(hit));
        let mut mass_inside = [1.0; MAX_LEVELS];
        for (k, hit) in hits.into_iter().enumerate() {
            let Some(hit) = hit else { continue };
            let mut lost = |from: f32, to: f32| {
                for (mass_inside, &bandwidth2) in mass_inside.iter_mut().zip(bandwidth2) {
                    let radius = bandwidth2.sqrt();
                    *mass_inside -= (mass(kernel, to / radius) - mass(kernel, from / radius)) / RAYS as f32;
                }
            };
            for_each_part_outside(scene, ray(k), hit, vertex.arrival.interior, medium, &mut lost);
        }
        mass_inside.map(|mass_inside| mass_inside.max(MIN_MASS))
    }
}

/// Follows a ray beyond `hit` and calls `lost(from, to)` for every part of it that lies outside the medium.
fn for_each_part_outside(
    scene: &Scene,
    ray: Ray,
    hit: Hit,
    interior: Interior,
    medium: u32,
    lost: &mut impl FnMut(f32, f32),
) {
    let reach = ray.tmax;
    let mut along = RaySurfaces::new(ray, None);
    let mut at = SurroundingSolids { interior, closed_meshes: 0 };
    let (mut met, mut outside) = (along.surface_at(scene, &hit, true), None);
    for _ in 0..MAX_BORDERS {
        let Some((surface, t)) = met else { break };
        let distance = reach - along.ray().tmax + t;
        let stays = at.cross(scene, &surface, ray.direction);
        match (stays && at.is_in(scene, medium), outside) {
            (true, Some(from)) => {
                lost(from, distance);
                outside = None;
            }
            (false, None) => outside = Some(distance),
            _ => {}
        }
        along.pass(&surface);
        if !stays || along.ray().tmax <= 0.0 {
            break;
        }
        met = along.next(scene, true);
    }
    if let Some(from) = outside {
        lost(from, f32::INFINITY);
    }
}

/// The solids around the current point of a ray.
struct SurroundingSolids {
    /// Nested solids that light enters.
    interior: Interior,
    /// Number of other closed meshes around the point.
    closed_meshes: u32,
}

impl SurroundingSolids {
    fn is_in(&self, scene: &Scene, medium: u32) -> bool {
        self.closed_meshes == 0 && self.interior.medium_id(scene) == medium
    }

    /// Crosses a surface. Returns false if nothing lies behind it: the ray leaves the closed mesh, such as a room, that
    /// contains the scene.
    fn cross(&mut self, scene: &Scene, surface: &Surface, direction: Vec3) -> bool {
        let entering = direction.dot(surface.ng) < 0.0;
        if scene.materials.list[surface.material as usize].is_solid() {
            self.interior = self.interior.crossing(scene, surface.instance, entering).interior;
            return true;
        }
        let mesh = scene.shapes.instances[surface.instance as usize].mesh;
        // An open mesh has the medium on both sides.
        if !scene.shapes.meshes[mesh as usize].closed {
            return true;
        }
        if entering {
            self.closed_meshes += 1;
        } else if self.closed_meshes > 0 {
            self.closed_meshes -= 1;
        } else {
            return false;
        }
        true
    }
}

/// Nodes of Gauss-Legendre quadrature on [0, 1], and their weights. Exact for polynomials up to degree 9, as those of
/// the box and Epanechnikov kernels.
const NODES: [(f32, f32); 5] = [
    (0.046_910_08, 0.118_463_44),
    (0.230_765_35, 0.239_314_33),
    (0.5, 0.284_444_45),
    (0.769_234_66, 0.239_314_33),
    (0.953_089_9, 0.118_463_44),
];

/// Mass of `kernel` within the fraction `x` of its radius.
fn mass(kernel: Kernel, x: f32) -> f32 {
    if x >= 1.0 {
        return 1.0;
    }
    let at =
        |(node, weight): (f32, f32)| weight * (x * node) * (x * node) * kernel.ball_weight((x * node) * (x * node));
    3.0 * x * NODES.into_iter().map(at).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mass is `x^3` for the box, `5/2 x^3 - 3/2 x^5` for Epanechnikov's kernel, and 1 over the whole ball.
    #[test]
    fn masses_of_kernels() {
        for k in 0..=20 {
            let x = k as f32 / 20.0 * 0.9999;
            assert!((mass(Kernel::Box, x) - x.powi(3)).abs() < 1e-6);
            let expected = 2.5 * x.powi(3) - 1.5 * x.powi(5);
            assert!((mass(Kernel::Epanechnikov, x) - expected).abs() < 1e-6);
        }
        assert!((mass(Kernel::Gaussian, 0.999_99) - 1.0).abs() < 1e-3);
    }
}
