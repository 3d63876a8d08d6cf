//! From one scattering vertex to the next: through alpha cut-outs (Embree skips them) and boundaries that do not scatter.

use super::interior::{Crossing, Interior, ior};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::scene::Scene;
use crate::trace::{Hit, Ray};

/// Boundaries without scattering that a segment may cross; more are taken for a numerical trap and end the path.
const MAX_NULL_CROSSINGS: u32 = 256;

/// The next scattering surface along a ray.
pub struct Arrival {
    /// The surface.
    pub surface: Surface,
    /// Index of refraction behind it (its back) over the one before it.
    pub eta: f32,
    /// For the surface of a solid: what is on its sides.
    pub crossing: Option<Crossing>,
    /// The solids the ray was in when it arrived.
    pub interior: Interior,
    /// What absorption and tinted boundaries on the way have left.
    pub transmittance: Rgb,
    /// Length of the way.
    pub distance: f32,
}

/// What a ray meets, if that is known before it is followed.
#[derive(Clone, Copy, Debug, Default)]
pub enum Known {
    /// It is not.
    #[default]
    Unknown,
    /// Nothing.
    Nothing,
    /// This triangle.
    Hit(Hit),
}

/// How a ray ended.
// Boxing the large variant would allocate once per ray.
#[allow(clippy::large_enum_variant)]
pub enum End {
    /// At a surface.
    Surface(Arrival),
    /// It left the scene, with this transmittance.
    Escaped(Rgb),
    /// In a numerical trap.
    Lost,
}

/// Beer-Lambert over `distance`; an infinite way through anything that absorbs leaves nothing.
#[inline]
fn absorb(scene: &Scene, interior: &Interior, distance: f32) -> Rgb {
    match interior.medium(scene) {
        None => Rgb::ONE,
        Some(medium) => {
            let through = |sigma: f32| if sigma > 0.0 { (-sigma * distance).exp() } else { 1.0 };
            let sigma = medium.sigma_a;
            Rgb::new(through(sigma.x), through(sigma.y), through(sigma.z))
        }
    }
}

/// What a surface hit by a ray is.
enum Boundary {
    /// Nothing: go on behind it with this tint and interior.
    None(Rgb, Interior),
    /// A scattering surface: index of refraction behind it over before it, and what is on its sides if it bounds a solid.
    Scattering(f32, Option<Crossing>),
}

#[inline(always)]
fn boundary(scene: &Scene, surface: &Surface, interior: &Interior, direction: Vec3) -> Boundary {
    let material = &scene.materials.list[surface.material as usize];
    if !material.is_solid_glass() {
        // What covers an opaque body meets the medium around it, air or water.
        let around = if scene.survey.solids { interior.ior(scene) } else { 1.0 };
        return Boundary::Scattering(material.ior / around, None);
    }
    let entering = direction.dot(surface.ng) < 0.0;
    let crossing = interior.crossing(scene, surface.instance, entering);
    // What gives light of its own is there whatever is behind it.
    if crossing.is_nothing() && !material.emits() {
        return Boundary::None(Rgb::ONE, crossing.interior);
    }
    let (before, after) = (ior(scene, crossing.before), ior(scene, crossing.after));
    let eta = if entering { after / before } else { before / after };
    if eta == 1.0 && !material.emits() {
        let parameters = material.parameters(surface, &scene.materials.textures, eta);
        if parameters.is_pure_transmission() {
            return Boundary::None(parameters.base_color, crossing.interior);
        }
    }
    Boundary::Scattering(eta, Some(crossing))
}

/// Follows a ray from inside `interior` to the next surface that scatters.
#[inline(always)]
pub fn next_surface(
    scene: &Scene,
    origin: Vec3,
    direction: Vec3,
    interior: Interior,
    token: u32,
    known: &Known,
) -> End {
    let mut ray = Ray { origin, direction, tmax: f32::INFINITY, token };
    let mut interior = interior;
    let mut transmittance = Rgb::ONE;
    let mut distance = 0.0;
    for crossed in 0..MAX_NULL_CROSSINGS {
        let met = match known {
            Known::Nothing if crossed == 0 => None,
            Known::Hit(hit) if crossed == 0 => Some(*hit),
            _ => scene.tracer.intersect(&ray),
        };
        let Some(hit) = met else {
            if scene.survey.media {
                transmittance *= absorb(scene, &interior, f32::INFINITY);
            }
            return End::Escaped(transmittance);
        };
        let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else {
            return End::Lost;
        };
        distance += hit.t;
        if scene.survey.media {
            transmittance *= absorb(scene, &interior, hit.t);
        }
        match boundary(scene, &surface, &interior, direction) {
            Boundary::Scattering(eta, crossing) => {
                return End::Surface(Arrival { surface, eta, crossing, interior, transmittance, distance });
            }
            Boundary::None(tint, behind) => {
                transmittance *= tint;
                interior = behind;
                ray.origin = surface.spawn(direction);
            }
        }
    }
    End::Lost
}

/// What is left of light between `origin` and the point `tmax` away along the unit `direction`: zero if anything scatters
/// there, else absorption and tints.
#[inline]
pub fn transmittance(scene: &Scene, origin: Vec3, direction: Vec3, tmax: f32, interior: Interior, token: u32) -> Rgb {
    let mut ray = Ray { origin, direction, tmax, token };
    if !scene.survey.null_boundaries {
        if scene.tracer.occluded(&ray) {
            return Rgb::ZERO;
        }
        return if scene.survey.media { absorb(scene, &interior, tmax) } else { Rgb::ONE };
    }
    let mut interior = interior;
    let mut left = Rgb::ONE;
    for _ in 0..MAX_NULL_CROSSINGS {
        let Some(hit) = scene.tracer.intersect(&ray) else {
            return if scene.survey.media { left * absorb(scene, &interior, ray.tmax) } else { left };
        };
        let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else {
            return Rgb::ZERO;
        };
        if scene.survey.media {
            left *= absorb(scene, &interior, hit.t);
        }
        match boundary(scene, &surface, &interior, direction) {
            Boundary::Scattering(..) => return Rgb::ZERO,
            Boundary::None(tint, behind) => {
                left *= tint;
                interior = behind;
                let next = surface.spawn(direction);
                ray.tmax -= (next - ray.origin).dot(direction);
                ray.origin = next;
                if ray.tmax <= 0.0 {
                    return left;
                }
            }
        }
    }
    Rgb::ZERO
}
