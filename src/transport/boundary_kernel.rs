//! The part of a kernel's ball that lies in the medium whose photons it gathers.
//!
//! Next to a border the ball reaches into what holds no photons of the medium. Divided by the kernel's mass within it,
//! not by that of all of the ball, the estimate is right for light that is the same all over the ball \[boundary
//! kernels; Silverman 1986, "Density Estimation", 2.10\]. The mass is measured along rays: of the kernel `K` with
//! radius r a ray that is in the medium from a to b has `int_a^b 3 t^2 K(t^2 / r^2) dt / r^3`, and the mean over all
//! directions is the mass.

use super::bandwidths::MAX_LEVELS;
use super::interior::Interior;
use super::segment::token;
use super::vertex::MediumVertex;
use super::volume::Volume;
use crate::geometry::Surface;
use crate::math::{Frame, Vec3, warp};
use crate::photon::Kernel;
use crate::random::Purpose;
use crate::scene::Scene;
use crate::scene::contact::RaySurfaces;
use crate::trace::{Hit, Ray};
use std::f32::consts::TAU;

/// Rays: to the corners of a cube that is turned at random. For every one there is its opposite, which makes planes
/// through the centre exact.
const RAYS: usize = 8;
/// A smaller part is not told from none: photons there would count without a bound.
const LEAST: f32 = 0.05;
/// Borders that a ray looks at.
const MAX_BORDERS: u32 = 32;

impl Volume<'_> {
    /// The kernel's mass in the medium around `vertex`, by level.
    pub(super) fn kernel_mass_inside<K: Kernel>(
        &self,
        _: K,
        scene: &Scene,
        vertex: &MediumVertex,
        medium: u32,
    ) -> [f32; MAX_LEVELS] {
        let radius2 = self.radii2();
        let reach = radius2.iter().fold(0.0, |largest: f32, &radius2| largest.max(radius2)).sqrt();
        let draws = vertex.draws;
        let frame = Frame::from_normal(warp::sphere_uniform(draws.two(Purpose::Border)));
        let (sin, cos) = (TAU * draws.one(Purpose::BorderTurn)).sin_cos();
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
        let mut room = [1.0; MAX_LEVELS];
        for (k, hit) in hits.into_iter().enumerate() {
            let Some(hit) = hit else { continue };
            let mut lost = |from: f32, to: f32| {
                for (room, &radius2) in room.iter_mut().zip(radius2) {
                    let radius = radius2.sqrt();
                    *room -= (mass::<K>(to / radius) - mass::<K>(from / radius)) / RAYS as f32;
                }
            };
            leave(scene, ray(k), hit, vertex.arrival.interior, medium, &mut lost);
        }
        room.map(|room| room.max(LEAST))
    }
}

/// Follows a ray behind `hit` and calls `lost` for all parts of it, as far as it goes, that are not in the medium.
fn leave(scene: &Scene, ray: Ray, hit: Hit, interior: Interior, medium: u32, lost: &mut impl FnMut(f32, f32)) {
    let reach = ray.tmax;
    let mut along = RaySurfaces::new(ray, None);
    let mut at = Whereabouts { interior, bodies: 0 };
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

/// Where a ray is.
struct Whereabouts {
    /// Among solids that light enters.
    interior: Interior,
    /// In how many others.
    bodies: u32,
}

impl Whereabouts {
    fn is_in(&self, scene: &Scene, medium: u32) -> bool {
        self.bodies == 0 && self.interior.material(scene).unwrap_or(u32::MAX) == medium
    }

    /// Whether there may be something behind the surface: out of the body that holds all there is, a room, there is
    /// nothing.
    fn cross(&mut self, scene: &Scene, surface: &Surface, direction: Vec3) -> bool {
        let entering = direction.dot(surface.ng) < 0.0;
        if scene.materials.list[surface.material as usize].is_solid_glass() {
            self.interior = self.interior.crossing(scene, surface.instance, entering).interior;
            return true;
        }
        let mesh = scene.shapes.instances[surface.instance as usize].mesh;
        // What is open has light on both sides.
        if !scene.shapes.meshes[mesh as usize].closed {
            return true;
        }
        if entering {
            self.bodies += 1;
        } else if self.bodies > 0 {
            self.bodies -= 1;
        } else {
            return false;
        }
        true
    }
}

/// Nodes of Gauss-Legendre quadrature on [0, 1], and their weights: exact for polynomials up to degree 9, such as the
/// box and Epanechnikov's kernel have.
const NODES: [(f32, f32); 5] = [
    (0.046_910_08, 0.118_463_44),
    (0.230_765_35, 0.239_314_33),
    (0.5, 0.284_444_45),
    (0.769_234_66, 0.239_314_33),
    (0.953_089_9, 0.118_463_44),
];

/// Mass of a kernel within a share `x` of its radius, beyond which there is none.
fn mass<K: Kernel>(x: f32) -> f32 {
    if x >= 1.0 {
        return 1.0;
    }
    let at = |(node, weight): (f32, f32)| weight * (x * node) * (x * node) * K::ball_weight((x * node) * (x * node));
    3.0 * x * NODES.into_iter().map(at).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::kernel;

    /// `x^3`, `5/2 x^3 - 3/2 x^5`, and for all that the mass of the ball is one.
    #[test]
    fn masses_of_kernels() {
        for k in 0..=20 {
            let x = k as f32 / 20.0 * 0.9999;
            assert!((mass::<kernel::Box>(x) - x.powi(3)).abs() < 1e-6);
            let expected = 2.5 * x.powi(3) - 1.5 * x.powi(5);
            assert!((mass::<kernel::Epanechnikov>(x) - expected).abs() < 1e-6);
        }
        assert!((mass::<kernel::Gaussian>(0.999_99) - 1.0).abs() < 1e-3);
    }
}
