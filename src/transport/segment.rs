//! From one scattering vertex to the next: through alpha cut-outs (Embree skips them) and boundaries that do not
//! scatter.

use super::interior::{Crossing, Interior, ior};
use crate::geometry::Surface;
use crate::material::MediumParameters;
use crate::math::{Rgb, Vec3};
use crate::medium::FlightDensity;
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::scene::contact::{self, ContactPoint, RaySurfaces};
use crate::trace::{CAMERA_RAY_BIT, Hit, Ray};

/// Boundaries without scattering that a segment may cross, as those of heaped drops of one liquid; more are taken for a
/// numerical trap and end the path.
const MAX_NULL_CROSSINGS: u32 = 1 << 16;

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

/// The first hit of a camera path.
#[derive(Clone, Copy, Debug)]
pub struct FirstHit {
    /// World position.
    pub p: Vec3,
    /// Index of the instance.
    pub instance: u32,
}

/// A vertex of a medium on a ray.
pub struct MediumArrival {
    /// World position.
    pub p: Vec3,
    /// The medium.
    pub medium: MediumParameters,
    /// The solids around it.
    pub interior: Interior,
    /// Transmittance up to here over the density per length of this point.
    pub weight: Rgb,
    /// Length of the way.
    pub distance: f32,
    /// What it shows as a first hit.
    pub first: Option<FirstHit>,
}

/// What a ray meets, if that is known before it is followed.
#[derive(Clone, Copy, Debug, Default)]
pub enum PrecomputedHit {
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
    /// In a medium.
    Medium(MediumArrival),
    /// It left the scene, with this transmittance.
    Escaped(Rgb),
    /// In a numerical trap.
    Lost,
}

/// A part of a ray's way that lies in one medium.
pub(super) struct Span {
    /// The medium.
    pub medium: MediumParameters,
    /// The solids here.
    pub interior: Interior,
    /// Where it begins.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Its length, maybe infinite.
    pub distance: f32,
    /// Length of the way before it.
    pub before: f32,
    /// What the way before it has left.
    pub left: Rgb,
    /// Parts before it, in media or not.
    pub crossed: u32,
    /// The surface at its end.
    pub beyond: Option<FirstHit>,
}

impl Span {
    /// What a vertex in here shows as a first hit: the object that holds the medium, or what lies behind a medium that
    /// fills the scene.
    pub fn first_hit(&self, scene: &Scene, p: Vec3) -> Option<FirstHit> {
        match self.interior.host(scene) {
            Some(instance) => Some(FirstHit { p, instance }),
            None => self.beyond,
        }
    }
}

/// What media do to a ray.
pub(super) trait Through {
    /// There may be some.
    const MEDIA: bool = true;
    /// On its way through `span`.
    fn pass(&mut self, span: &Span) -> Passage;
}

/// Outcome of [`Through::pass`].
pub(super) enum Passage {
    /// What is left at the end of the span.
    Left(Rgb),
    /// A vertex of the medium.
    Ended(MediumArrival),
}

/// Light is attenuated, no more \[Beer-Lambert\].
pub(super) struct Attenuate;

impl Through for Attenuate {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        Passage::Left(span.medium.transmittance(span.distance))
    }
}

/// There are none.
pub(super) struct Clear;

impl Through for Clear {
    const MEDIA: bool = false;

    #[inline]
    fn pass(&mut self, _: &Span) -> Passage {
        Passage::Left(Rgb::ONE)
    }
}

/// Out of the way of rays that meet no medium: they stay in registers, for what is told here of one is a copy.
#[cold]
#[inline(never)]
fn pass(through: &mut impl Through, span: &Span) -> Passage {
    through.pass(span)
}

/// What a surface hit by a ray is.
enum Boundary {
    /// Nothing: go on behind it with this tint and interior.
    None(Rgb, Interior),
    /// A scattering surface: index of refraction behind it over before it, and what is on its sides if it bounds a
    /// solid.
    Scattering(f32, Option<Crossing>),
}

#[inline(always)]
fn boundary(scene: &Scene, surface: &Surface, interior: &Interior, direction: Vec3, token: u32) -> Boundary {
    let material = &scene.materials.list[surface.material as usize];
    if !material.is_solid_glass() {
        // What covers an opaque body meets the medium around it, air or water.
        let around = if scene.survey.solids { interior.ior(scene) } else { 1.0 };
        return Boundary::Scattering(material.ior / around, None);
    }
    let entering = direction.dot(surface.ng) < 0.0;
    let crossing = interior.crossing(scene, surface.instance, entering);
    // A ray that has passed the solid's front as if it were not there is not in it, and leaves it unseen.
    if material.has_alpha_per_entry()
        && if entering { !scene.solid_is_present(surface, token) } else { crossing.interior == *interior }
    {
        return Boundary::None(Rgb::ONE, *interior);
    }
    // What gives light of its own is there whatever is behind it.
    if crossing.is_nothing() && !material.emits() {
        return Boundary::None(Rgb::ONE, crossing.interior);
    }
    let (before, after) = (ior(scene, crossing.before), ior(scene, crossing.after));
    let eta = if entering { after / before } else { before / after };
    // Of two glasses with one index some wavelengths are refracted all the same.
    if eta == 1.0 && !material.emits() && !(scene.survey.dispersion && crossing.disperses(scene)) {
        let parameters = material.parameters(surface, &scene.materials.textures, eta);
        if parameters.is_clear_if_matched() {
            return Boundary::None(parameters.base_color, crossing.interior);
        }
    }
    Boundary::Scattering(eta, Some(crossing))
}

/// What decides where a ray passes what is there in part only; nothing is drawn where all is there.
#[inline(always)]
pub(super) fn token(scene: &Scene, draws: Draws, purpose: Purpose) -> u32 {
    let bits = if scene.survey.alpha { draws.token(purpose) } else { 0 };
    told(scene, bits, false)
}

/// The same of a camera's own ray, or of one to its lens: such rays pass what is hidden from cameras, too.
#[inline(always)]
pub(super) fn camera_token(scene: &Scene, draws: Draws, purpose: Purpose) -> u32 {
    told(scene, token(scene, draws, purpose), true)
}

/// Random bits that tell of a camera's ray where that matters.
#[inline(always)]
pub(super) fn told(scene: &Scene, bits: u32, camera: bool) -> u32 {
    let matters = scene.survey.hidden_from_camera || scene.survey.culled;
    if matters { bits & !CAMERA_RAY_BIT | if camera { CAMERA_RAY_BIT } else { 0 } } else { bits }
}

/// A ray from inside `interior`, about to be followed.
#[derive(Clone, Copy)]
pub struct Start {
    /// Where it starts.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// The solids around its start.
    pub interior: Interior,
    /// The surface that it leaves, if others lie on that.
    pub leaving: Option<ContactPoint>,
    /// Decides about cut-outs.
    pub token: u32,
}

/// Follows a ray to the next surface that scatters; media on the way attenuate.
#[inline(always)]
pub fn next_surface(scene: &Scene, start: Start) -> End {
    next_vertex(scene, start, &PrecomputedHit::Unknown, &mut Attenuate)
}

/// Follows a ray to the next surface that scatters, `through` whatever media.
#[inline(always)]
pub(super) fn next_vertex<T: Through>(scene: &Scene, start: Start, known: &PrecomputedHit, through: &mut T) -> End {
    let Start { origin, direction, mut interior, leaving, token } = start;
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax: f32::INFINITY, token }, leaving);
    let mut transmittance = Rgb::ONE;
    let mut distance = 0.0;
    for crossed in 0..MAX_NULL_CROSSINGS {
        let met = match known {
            PrecomputedHit::Nothing if crossed == 0 => None,
            PrecomputedHit::Hit(hit) if crossed == 0 => along.surface_at(scene, hit, !interior.is_open()),
            _ => along.next(scene, !interior.is_open()),
        };
        let (origin, before, left) = (along.ray().origin, distance, transmittance);
        let medium = if T::MEDIA && scene.survey.media { interior.medium(scene) } else { None };
        let Some((mut surface, t)) = met else {
            if let Some(medium) = medium {
                let (distance, beyond) = (f32::INFINITY, None);
                let span = Span { medium, interior, origin, direction, distance, before, left, crossed, beyond };
                match pass(through, &span) {
                    Passage::Left(left) => transmittance *= left,
                    Passage::Ended(arrival) => return End::Medium(arrival),
                }
            }
            return End::Escaped(transmittance);
        };
        if let Some(medium) = medium
            && t > 0.0
        {
            let (distance, beyond) = (t, Some(FirstHit { p: surface.p, instance: surface.instance }));
            let span = Span { medium, interior, origin, direction, distance, before, left, crossed, beyond };
            match pass(through, &span) {
                Passage::Left(left) => transmittance *= left,
                Passage::Ended(arrival) => return End::Medium(arrival),
            }
        }
        distance += t;
        if token & CAMERA_RAY_BIT != 0 && scene.culls(&surface, direction) {
            let Some(other) = contact::visible_on_culled(scene, &surface, direction, token) else {
                along.pass(&surface);
                continue;
            };
            surface = other;
        }
        match boundary(scene, &surface, &interior, direction, token) {
            Boundary::Scattering(eta, crossing) => {
                return End::Surface(Arrival { surface, eta, crossing, interior, transmittance, distance });
            }
            Boundary::None(tint, behind) => {
                transmittance *= tint;
                interior = behind;
                along.pass(&surface);
            }
        }
    }
    End::Lost
}

/// What a ray to a light, or between two vertices, meets on its way.
#[derive(Clone, Copy, Debug)]
pub struct ShadowRay {
    /// What is left of the light.
    pub left: Rgb,
    /// Densities of flying it both ways.
    pub flight: FlightDensity,
}

impl ShadowRay {
    const BLOCKED: ShadowRay = ShadowRay { left: Rgb::ZERO, flight: FlightDensity::ONE };

    /// Goes on through `distance` of what fills the space.
    #[inline]
    fn pass(&mut self, scene: &Scene, interior: &Interior, distance: f32, starts: bool, ends: bool) {
        if scene.survey.media {
            *self = self.through(scene, interior, distance, starts, ends);
        }
    }

    #[cold]
    #[inline(never)]
    fn through(self, scene: &Scene, interior: &Interior, distance: f32, starts: bool, ends: bool) -> ShadowRay {
        let Some(medium) = interior.medium(scene) else { return self };
        let left = self.left * medium.transmittance(distance);
        let scatters = scene.survey.scattering;
        let flight = if scatters { self.flight.through(&medium, distance, starts, ends) } else { self.flight };
        ShadowRay { left, flight }
    }
}

/// A ray to a point, or to infinity, whose way is asked for.
#[derive(Clone, Copy)]
pub struct Between {
    /// From where, and how.
    pub start: Start,
    /// Distance to the end; may be infinite.
    pub tmax: f32,
    /// The surface at the end, if others lie on that.
    pub reaching: Option<ContactPoint>,
    /// Whether the way starts and ends at a vertex of a medium.
    pub in_medium: [bool; 2],
}

/// What is left of light between two points (zero if anything scatters there, else absorption and tints), and the
/// densities of flight.
#[inline]
pub fn shadow_ray(scene: &Scene, between: &Between) -> ShadowRay {
    let Between { start: Start { origin, direction, ref interior, leaving, token }, tmax, reaching, .. } = *between;
    let [starts, ends] = between.in_medium;
    let culls = scene.survey.culled && token & CAMERA_RAY_BIT != 0;
    if scene.survey.null_boundaries || culls || leaving.is_some() || reaching.is_some() {
        return way_through(scene, between);
    }
    if scene.tracer.occluded(&Ray { origin, direction, tmax, token }) {
        return ShadowRay::BLOCKED;
    }
    let mut way = ShadowRay { left: Rgb::ONE, flight: FlightDensity::ONE };
    way.pass(scene, interior, tmax, starts, ends);
    way
}

/// The same through boundaries that do not scatter.
fn way_through(scene: &Scene, between: &Between) -> ShadowRay {
    let Between { start: Start { origin, direction, mut interior, leaving, token }, tmax, reaching, .. } = *between;
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax, token }, leaving);
    let mut way = ShadowRay { left: Rgb::ONE, flight: FlightDensity::ONE };
    let [mut starts, ends] = between.in_medium;
    for _ in 0..MAX_NULL_CROSSINGS {
        let Some((mut surface, t)) = along.next(scene, !interior.is_open()) else {
            way.pass(scene, &interior, along.ray().tmax.max(0.0), starts, ends);
            let Some(place) = reaching else { return way };
            for surface in &contact::surfaces_before(scene, &place, direction, token) {
                match boundary(scene, surface, &interior, direction, token) {
                    Boundary::Scattering(..) => return ShadowRay::BLOCKED,
                    Boundary::None(tint, behind) => (way.left, interior) = (way.left * tint, behind),
                }
            }
            return way;
        };
        if t > 0.0 {
            way.pass(scene, &interior, t, starts, false);
            starts = false;
        }
        // Towards the lens, so that the lens sees its other side.
        if token & CAMERA_RAY_BIT != 0 && scene.culls(&surface, -direction) {
            let Some(other) = contact::visible_on_culled(scene, &surface, -direction, token) else {
                along.pass(&surface);
                continue;
            };
            surface = other;
        }
        match boundary(scene, &surface, &interior, direction, token) {
            Boundary::Scattering(..) => return ShadowRay::BLOCKED,
            Boundary::None(tint, behind) => {
                way.left *= tint;
                interior = behind;
                along.pass(&surface);
            }
        }
    }
    ShadowRay::BLOCKED
}
