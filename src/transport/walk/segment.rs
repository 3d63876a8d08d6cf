//! Rays from one scattering vertex to the next, through alpha cut-outs (Embree skips them) and boundaries that do not
//! scatter; and shadow rays.

use super::interior::{Crossing, Interior, Presence, ior};
use crate::geometry::Surface;
use crate::light::Linking;
use crate::material::MediumParameters;
use crate::math::{Rgb, Vec3};
use crate::medium::{FlightDensity, GridRay};
use crate::random::{Draws, HashSequence, Purpose, mix};
use crate::scene::Scene;
use crate::scene::contact::{self, ContactPoint, RaySurfaces};
use crate::trace::{CAMERA_RAY_BIT, Hit, LINKING_BITS, Ray};

/// Largest number of boundaries without scattering that a path segment may cross, as between many drops of one liquid.
/// More are taken for a numerical trap and end the path.
const MAX_NULL_CROSSINGS: u32 = 1 << 16;

/// The next scattering surface along a ray, and what the ray has crossed before.
pub struct Arrival {
    /// The point where the ray hits the surface.
    pub surface: Surface,
    /// Index of refraction on the back of the surface over that on its front.
    pub eta: f32,
    /// The media on both sides of the surface, if it bounds a solid.
    pub crossing: Option<Crossing>,
    /// The solids around the ray on arrival.
    pub interior: Interior,
    /// Transmittance of absorbing media and tinted boundaries on the segment, 0 to 1 per channel.
    pub transmittance: Rgb,
    /// Length of the path segment (scene units).
    pub distance: f32,
}

/// In place of the instance that a camera path hits first: it ends at a hole in the picture, such as a holdout.
pub const HOLE: u32 = u32::MAX;

/// The first visible hit of a camera path, for coverage and depth.
#[derive(Clone, Copy, Debug)]
pub struct FirstHit {
    /// World position.
    pub p: Vec3,
    /// Index of the instance that is hit, or [`HOLE`].
    pub instance: u32,
}

impl FirstHit {
    /// A hole in the picture, which has no position.
    pub const HOLE: FirstHit = FirstHit { p: Vec3::NAN, instance: HOLE };
}

/// A collision of a ray in a medium.
pub struct MediumArrival {
    /// World position of the collision.
    pub p: Vec3,
    /// The medium that the ray collides in.
    pub medium: MediumParameters,
    /// The solids around the point of collision.
    pub interior: Interior,
    /// Transmittance up to the collision over the probability density of the collision per length.
    pub weight: Rgb,
    /// Length of the path segment (scene units).
    pub distance: f32,
    /// The hit to report if this collision is the first hit of its camera path.
    pub first: Option<FirstHit>,
}

/// The first hit of a ray, if the ray has been traced already, for example in a packet.
#[derive(Clone, Copy, Debug, Default)]
pub enum PrecomputedHit {
    /// The ray has not been traced.
    #[default]
    Unknown,
    /// The ray hits nothing.
    Nothing,
    /// The ray hits this triangle.
    Hit(Hit),
}

/// Where a ray ends: at a surface, in a medium, or outside the scene.
// Boxing the large variant would allocate once per ray.
#[allow(clippy::large_enum_variant)]
pub enum End {
    /// The ray reaches a scattering surface.
    Surface(Arrival),
    /// A medium scatters the ray.
    Medium(MediumArrival),
    /// The ray leaves the scene, with this transmittance (0 to 1 per channel).
    Escaped(Rgb),
    /// The ray is in a numerical trap: it has crossed too many boundaries.
    Lost,
}

/// The part of a ray that lies in one medium.
pub(in crate::transport) struct Span {
    /// The medium that the span lies in.
    pub medium: MediumParameters,
    /// The solids around the span.
    pub interior: Interior,
    /// Point where the ray enters the span.
    pub origin: Vec3,
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Length of the span; may be infinite.
    pub distance: f32,
    /// Distance from the origin of the ray to the start of the span.
    pub before: f32,
    /// Transmittance of the ray up to the start of the span.
    pub left: Rgb,
    /// Number of parts of the ray before the span, in media or not.
    pub crossed: u32,
    /// Hit on the surface at the end of the span; `None` if there is none.
    pub beyond: Option<FirstHit>,
}

impl Span {
    /// The span as a ray in the density grid of its medium; `None` if the medium is homogeneous.
    #[inline]
    pub fn grid_ray<'s>(&self, scene: &'s Scene) -> Option<GridRay<'s>> {
        self.interior.grid_ray(scene, self.origin, self.direction)
    }

    /// The hit to report for a collision at `p`: the object that contains the medium, or the surface behind a medium
    /// that fills the scene.
    pub fn first_hit(&self, scene: &Scene, p: Vec3) -> Option<FirstHit> {
        match self.interior.host(scene) {
            Some(instance) => Some(FirstHit { p, instance }),
            None => self.beyond,
        }
    }
}

/// How a ray crosses media: attenuated, with random collisions, or by splitting.
pub(in crate::transport) trait Through {
    /// False if the scene has no media.
    const MEDIA: bool = true;
    /// Takes the ray through `span`, and returns whether it reaches the end or collides.
    fn pass(&mut self, span: &Span) -> Passage;
}

/// Outcome of [`Through::pass`].
pub(in crate::transport) enum Passage {
    /// The ray reaches the end of the span with this transmittance.
    Left(Rgb),
    /// The ray collides in the span.
    Ended(MediumArrival),
}

/// Media only attenuate the ray \[Beer-Lambert\]. Heterogeneous ones take their random numbers from its token.
pub(in crate::transport) struct Attenuate<'a> {
    pub scene: &'a Scene,
    pub token: u32,
}

impl Through for Attenuate<'_> {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        Passage::Left(match span.grid_ray(self.scene) {
            Some(ray) => attenuation(&ray, &span.medium, span.distance, self.token, span.crossed),
            None => span.medium.transmittance(span.distance),
        })
    }
}

/// An unbiased estimate of the transmittance of part number `crossed` of a ray with this token, over `distance`
/// (m) in a heterogeneous medium.
#[cold]
#[inline(never)]
fn attenuation(ray: &GridRay<'_>, medium: &MediumParameters, distance: f32, token: u32, crossed: u32) -> Rgb {
    let key = mix(u64::from(token) << 32 | u64::from(crossed));
    ray.transmittance(medium.sigma_t(), distance, &mut HashSequence::new(key))
}

/// For scenes without media, where there is nothing to cross.
pub(in crate::transport) struct Clear;

impl Through for Clear {
    const MEDIA: bool = false;

    #[inline]
    fn pass(&mut self, _: &Span) -> Passage {
        Passage::Left(Rgb::ONE)
    }
}

/// Crosses one span of a medium. Not inlined, so that rays without media keep their state in registers: only a copy of
/// it escapes here.
#[cold]
#[inline(never)]
fn cross(through: &mut impl Through, span: &Span) -> Passage {
    through.pass(span)
}

/// How a surface affects a ray that hits it.
enum Boundary {
    /// The ray continues behind the surface, with this tint and inside these solids.
    None(Rgb, Interior),
    /// The surface scatters the ray. Fields: index of refraction behind the surface over that before it, and the media
    /// on both sides if the surface bounds a solid.
    Scattering(f32, Option<Crossing>),
}

/// What the surface does to a ray along `direction`. `to_lens`: a camera ray is traced backwards, towards the lens.
#[inline(always)]
fn boundary(
    scene: &Scene,
    surface: &Surface,
    interior: &Interior,
    direction: Vec3,
    token: u32,
    to_lens: bool,
) -> Boundary {
    let material = &scene.materials.list[surface.material as usize];
    if !material.is_solid() {
        // The coat of an opaque body borders on the medium around the body, such as air or water.
        let around = if scene.survey.solids { interior.ior(scene) } else { 1.0 };
        return Boundary::Scattering(material.ior / around, None);
    }
    let entering = direction.dot(surface.ng) < 0.0;
    if material.has_alpha_per_entry()
        && !(entering && scene.solid_is_present(surface, token))
        && let Some(behind) = interior.pass_absent(scene, surface.instance, entering)
    {
        return Boundary::None(Rgb::ONE, behind);
    }
    let crossing = interior.crossing(scene, surface.instance, entering);
    if passes_hidden_solids(scene, token) && scene.shapes.instances[surface.instance as usize].hidden_from_camera {
        let (before, after) = (ior(scene, crossing.before), ior(scene, crossing.after));
        // Radiance over the squared index of refraction stays constant, as if the ray were refracted.
        let ratio = if to_lens { after / before } else { before / after };
        return Boundary::None(Rgb::splat(ratio * ratio), crossing.interior);
    }
    if passes_unlinked_solids(scene, token) && !blocks(scene, token, surface.instance) {
        let behind = interior.pass_absent(scene, surface.instance, entering);
        return Boundary::None(Rgb::ONE, behind.unwrap_or(crossing.interior));
    }
    // A surface that emits light is never skipped.
    if crossing.is_nothing() && !material.emits() {
        return Boundary::None(Rgb::ONE, crossing.interior);
    }
    let (before, after) = (ior(scene, crossing.before), ior(scene, crossing.after));
    let eta = if entering { after / before } else { before / after };
    // Two dispersive glasses with equal index refract other wavelengths.
    if eta == 1.0 && !material.emits() && !(scene.survey.dispersion && crossing.disperses(scene)) {
        let parameters = material.parameters(surface, &scene.materials.textures, eta);
        if parameters.is_clear_if_matched() {
            return Boundary::None(parameters.base_color, crossing.interior);
        }
    }
    Boundary::Scattering(eta, Some(crossing))
}

/// Random bits from which alpha cut-outs along a ray are decided, and its transmittance in heterogeneous media is
/// estimated; 0 if the scene has neither.
#[inline(always)]
pub(in crate::transport) fn token(scene: &Scene, draws: Draws, purpose: Purpose) -> u32 {
    let bits = if scene.survey.alpha || scene.survey.grids { draws.token(purpose) } else { 0 };
    let bits = if scene.survey.shadow_links { bits & !LINKING_BITS } else { bits };
    with_camera_bit(scene, bits, false)
}

/// The token of a shadow ray to the light with index `light`, which only the objects block that block its light.
#[inline(always)]
pub(in crate::transport) fn with_blockers(scene: &Scene, token: u32, light: u32) -> u32 {
    if !scene.survey.shadow_links {
        return token;
    }
    scene.lights.blockers(light).mark(token)
}

/// Random bits as [`token`], for a ray from or to the lens. Such rays pass objects that are hidden from cameras.
#[inline(always)]
pub(in crate::transport) fn camera_token(scene: &Scene, draws: Draws, purpose: Purpose) -> u32 {
    with_camera_bit(scene, token(scene, draws, purpose), true)
}

/// Sets or clears the bit in a token that marks rays of the camera, if the scene has objects that are hidden from
/// cameras.
#[inline(always)]
pub(in crate::transport) fn with_camera_bit(scene: &Scene, bits: u32, camera: bool) -> u32 {
    let matters = scene.survey.hidden_from_camera || scene.survey.culled;
    if matters { bits & !CAMERA_RAY_BIT | if camera { CAMERA_RAY_BIT } else { 0 } } else { bits }
}

/// Whether the ray of a token is a camera ray in a scene with solids that are hidden from cameras. Such a ray crosses
/// the boundaries of hidden solids straight, and meets no medium where a hidden solid fills the space.
#[inline(always)]
fn passes_hidden_solids(scene: &Scene, token: u32) -> bool {
    scene.survey.hidden_solids && token & CAMERA_RAY_BIT != 0
}

/// Whether the ray of a token is a shadow ray to a light with shadow linking, in a scene with solids that do not block
/// such light. These solids do not exist for the ray, which crosses their boundaries straight.
#[inline(always)]
fn passes_unlinked_solids(scene: &Scene, token: u32) -> bool {
    scene.survey.unlinked_solids && token & LINKING_BITS != 0
}

/// Whether an instance blocks the light to which the shadow ray of a token leads. The scene has shadow linking.
#[inline]
fn blocks(scene: &Scene, token: u32, instance: u32) -> bool {
    Linking::of_ray(token).has(scene.linkings(instance))
}

/// The medium that affects a ray inside these solids; `None` without one.
#[inline(always)]
fn medium(scene: &Scene, interior: &Interior, token: u32) -> Option<MediumParameters> {
    if passes_hidden_solids(scene, token) && interior.is_hidden(scene) {
        return None;
    }
    if passes_unlinked_solids(scene, token) && interior.host(scene).is_some_and(|host| !blocks(scene, token, host)) {
        return None;
    }
    interior.medium(scene)
}

/// Start of a ray between two path vertices.
#[derive(Clone, Copy)]
pub struct Start {
    /// Origin of the ray.
    pub origin: Vec3,
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// The solids around the origin of the ray.
    pub interior: Interior,
    /// The point on a surface that the ray leaves, if other surfaces touch it there.
    pub leaving: Option<ContactPoint>,
    /// Random bits from which alpha cut-outs along the ray are decided, and its transmittance in heterogeneous media is
    /// estimated.
    pub token: u32,
}

/// Follows a ray to the next scattering surface and returns where it ends. Media attenuate it.
#[inline(always)]
pub fn next_surface(scene: &Scene, start: Start) -> End {
    next_vertex(scene, start, &PrecomputedHit::Unknown, &mut Attenuate { scene, token: start.token })
}

/// Follows a ray to the next scattering surface, or to a collision in a medium, and returns where it ends. `known` is
/// its first hit if it has been traced; `through` crosses media.
#[inline(always)]
pub(in crate::transport) fn next_vertex<T: Through>(
    scene: &Scene,
    start: Start,
    known: &PrecomputedHit,
    through: &mut T,
) -> End {
    let Start { origin, direction, mut interior, leaving, token } = start;
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax: f32::INFINITY, token }, leaving);
    let mut transmittance = Rgb::ONE;
    let mut distance = 0.0;
    for crossed in 0..MAX_NULL_CROSSINGS {
        let traced = match known {
            PrecomputedHit::Nothing if crossed == 0 => Some(None),
            PrecomputedHit::Hit(hit) if crossed == 0 => Some(Some(*hit)),
            _ => None,
        };
        let met = along.next_traced(scene, traced, !interior.is_open());
        let (origin, before, left) = (along.ray().origin, distance, transmittance);
        let medium = if T::MEDIA && scene.survey.media { medium(scene, &interior, token) } else { None };
        let Some((mut surface, t)) = met else {
            if let Some(medium) = medium {
                let (distance, beyond) = (f32::INFINITY, None);
                let span = Span { medium, interior, origin, direction, distance, before, left, crossed, beyond };
                match cross(through, &span) {
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
            match cross(through, &span) {
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
        match boundary(scene, &surface, &interior, direction, token, false) {
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

/// Result of a shadow ray: how much light passes, and the densities of a path along it.
#[derive(Clone, Copy, Debug)]
pub struct Visibility {
    /// Transmittance, 0 to 1 per channel; zero if the ray is blocked.
    pub transmittance: Rgb,
    /// Probability densities of flight through media along the ray in both directions, for MIS.
    pub flight: FlightDensity,
}

impl Visibility {
    /// A surface blocks the ray.
    pub(in crate::transport) const BLOCKED: Visibility =
        Visibility { transmittance: Rgb::ZERO, flight: FlightDensity::ONE };
    /// Nothing is in the way of the ray.
    pub(in crate::transport) const CLEAR: Visibility =
        Visibility { transmittance: Rgb::ONE, flight: FlightDensity::ONE };

    /// Crosses `part` of the ray. `starts` and `ends`: a path vertex in the medium lies at the start or at the end.
    #[inline]
    fn pass(&mut self, scene: &Scene, part: RayPart<'_>, starts: bool, ends: bool) {
        if scene.survey.media {
            *self = self.through(scene, part, starts, ends);
        }
    }

    #[cold]
    #[inline(never)]
    fn through(self, scene: &Scene, part: RayPart<'_>, starts: bool, ends: bool) -> Visibility {
        let RayPart { interior, origin, direction, distance, token, crossed } = part;
        let Some(medium) = medium(scene, interior, token) else { return self };
        if let Some(ray) = interior.grid_ray(scene, origin, direction) {
            let transmittance = self.transmittance * attenuation(&ray, &medium, distance, token, crossed);
            let flight = ray.flight_density(self.flight, &medium, distance, starts, ends);
            return Visibility { transmittance, flight };
        }
        let transmittance = self.transmittance * medium.transmittance(distance);
        let scatters = scene.survey.scattering;
        let flight = if scatters { self.flight.through(&medium, distance, starts, ends) } else { self.flight };
        Visibility { transmittance, flight }
    }
}

/// A part of a shadow ray that lies inside of the same solids.
struct RayPart<'i> {
    interior: &'i Interior,
    /// Start of the part.
    origin: Vec3,
    direction: Vec3,
    /// Length of the part (m); may be infinite.
    distance: f32,
    /// Random bits of the ray.
    token: u32,
    /// Number of the ray's parts before this one.
    crossed: u32,
}

/// The solids in which a shadow ray must arrive at its end. Otherwise it counts as blocked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Destination {
    /// Any solids.
    Any,
    /// Solids with alpha of which those with this code are absent ([`Presence::absent`]).
    Agreeing(u8),
    /// Solids of which this instance fills the space.
    Inside(u32),
}

impl Destination {
    #[inline(always)]
    fn admits(self, scene: &Scene, interior: &Interior) -> bool {
        match self {
            Destination::Any => true,
            Destination::Agreeing(absent) => Presence::of(scene, interior).absent == absent,
            Destination::Inside(instance) => interior.host(scene) == Some(instance),
        }
    }
}

/// A shadow ray: a ray to a point or to infinity.
#[derive(Clone, Copy)]
pub struct ShadowRay {
    /// Start of the shadow ray.
    pub start: Start,
    /// Length of the shadow ray; may be infinite.
    pub tmax: f32,
    /// The point on a surface at the end of the ray, if other surfaces touch it there.
    pub reaching: Option<ContactPoint>,
    /// Whether the shadow ray starts at a vertex in a medium, and whether it ends at one.
    pub in_medium: [bool; 2],
    /// The solids in which the shadow ray must arrive.
    pub destination: Destination,
    /// Whether the ray ends at the lens, if its token is that of a camera ray; otherwise such a ray starts there.
    pub to_lens: bool,
}

/// Transmittance along a shadow ray (zero if a scattering surface blocks it, otherwise that of media and tinted
/// boundaries), and the densities of flight.
#[inline]
pub fn shadow_ray(scene: &Scene, between: &ShadowRay) -> Visibility {
    let ShadowRay { start: Start { origin, direction, ref interior, leaving, token }, tmax, reaching, .. } = *between;
    let [starts, ends] = between.in_medium;
    let culls = scene.survey.culled && token & CAMERA_RAY_BIT != 0;
    if scene.survey.null_boundaries
        || culls
        || passes_hidden_solids(scene, token)
        || passes_unlinked_solids(scene, token)
        || leaving.is_some()
        || reaching.is_some()
    {
        return trace_through_boundaries(scene, between);
    }
    if !between.destination.admits(scene, interior) || scene.tracer.occluded(&Ray { origin, direction, tmax, token }) {
        return Visibility::BLOCKED;
    }
    let mut visibility = Visibility::CLEAR;
    let part = RayPart { interior, origin, direction, distance: tmax, token, crossed: 0 };
    visibility.pass(scene, part, starts, ends);
    visibility
}

/// Traces a [`shadow_ray`] through boundaries that do not scatter.
fn trace_through_boundaries(scene: &Scene, between: &ShadowRay) -> Visibility {
    let ShadowRay { start: Start { origin, direction, mut interior, leaving, token }, tmax, reaching, .. } = *between;
    let to_lens = between.to_lens;
    if passes_unlinked_solids(scene, token) {
        let exists = |solid| blocks(scene, token, solid) || between.destination == Destination::Inside(solid);
        interior = interior.limited(scene, exists);
    }
    let mut along = RaySurfaces::new(Ray { origin, direction, tmax, token }, leaving);
    let mut visibility = Visibility::CLEAR;
    let [mut starts, ends] = between.in_medium;
    for crossed in 0..MAX_NULL_CROSSINGS {
        let before = along.ray().origin;
        let Some((mut surface, t)) = along.next(scene, !interior.is_open()) else {
            let distance = along.ray().tmax.max(0.0);
            let part = RayPart { interior: &interior, origin: before, direction, distance, token, crossed };
            visibility.pass(scene, part, starts, ends);
            if to_lens && passes_hidden_solids(scene, token) {
                visibility.transmittance *= interior.seen_radiance(scene);
            }
            let touching = reaching.map(|place| contact::surfaces_before(scene, &place, direction, token));
            for surface in touching.iter().flatten() {
                match boundary(scene, surface, &interior, direction, token, to_lens) {
                    Boundary::Scattering(..) => return Visibility::BLOCKED,
                    Boundary::None(tint, behind) => {
                        (visibility.transmittance, interior) = (visibility.transmittance * tint, behind)
                    }
                }
            }
            return if between.destination.admits(scene, &interior) { visibility } else { Visibility::BLOCKED };
        };
        if t > 0.0 {
            let part = RayPart { interior: &interior, origin: before, direction, distance: t, token, crossed };
            visibility.pass(scene, part, starts, false);
            starts = false;
        }
        let from_lens = if to_lens { -direction } else { direction };
        if token & CAMERA_RAY_BIT != 0 && scene.culls(&surface, from_lens) {
            let Some(other) = contact::visible_on_culled(scene, &surface, from_lens, token) else {
                along.pass(&surface);
                continue;
            };
            surface = other;
        }
        match boundary(scene, &surface, &interior, direction, token, to_lens) {
            Boundary::Scattering(..) => return Visibility::BLOCKED,
            Boundary::None(tint, behind) => {
                visibility.transmittance *= tint;
                interior = behind;
                along.pass(&surface);
            }
        }
    }
    Visibility::BLOCKED
}
