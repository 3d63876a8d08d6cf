//! The only bounce loop. It handles intersection, nested solids, roulette and depth, and does not access the film. Each
//! algorithm is a [`Visitor`].

pub(in crate::transport) mod camera_paths;
pub(in crate::transport) mod cause;
pub(in crate::transport) mod direct;
pub(in crate::transport) mod fire;
pub(in crate::transport) mod flight;
pub(in crate::transport) mod initial_media;
pub(in crate::transport) mod interior;
pub(in crate::transport) mod light_samples;
pub(in crate::transport) mod lobe_layers;
pub(in crate::transport) mod pass_through;
pub(in crate::transport) mod pixel_sample;
pub(in crate::transport) mod probe;
pub(in crate::transport) mod roulette;
pub(in crate::transport) mod scattering_vertex;
pub(in crate::transport) mod segment;
pub(in crate::transport) mod vertex;
pub(in crate::transport) mod visible;

use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::light::Receiver;
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::FlightDensity;
use crate::random::{Draws, Purpose, Stream};
use crate::scene::Scene;
use crate::scene::contact::ContactPoint;
use crate::spectrum::{SPREAD, Wavelength, WavelengthSample};
use crate::stop::Stop;
use bumpalo::Bump;
use fire::MediumEmission;
use flight::{Fly, Split};
use interior::Interior;
use pass_through::{BulbHit, BulbView, PassThroughHit, for_each_bulb, for_each_pass_through_light};
use roulette::{MIN_DISPERSED_SHARE, branch_share, late_survival};
use scattering_vertex::ScatterPoint;
use segment::{Arrival, Attenuate, Clear, End, MediumArrival, PrecomputedHit, Start, camera_token, next_vertex, token};
use vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};

/// Number of vertices between two checks whether a path must end early.
pub const CUT_INTERVAL: u32 = 16;

/// The start of a camera path or light path.
#[derive(Clone, Copy, Debug)]
pub struct PathStart {
    /// Origin of the first ray, offset from any surface.
    pub origin: Vec3,
    /// Unit direction of the first ray.
    pub direction: Vec3,
    /// Throughput at the start: flux of a light path, or importance of a camera path.
    pub throughput: Rgb,
    /// The solids around the origin.
    pub interior: Interior,
    /// The point on a surface that the first ray leaves, if other surfaces touch it there.
    pub leaving: Option<ContactPoint>,
    /// Hit of the first ray, if it has been traced already.
    pub first: PrecomputedHit,
    /// Whether the path comes from a light at infinity.
    pub far: bool,
    /// Index of the color channel of a path of a single channel; `None` for all channels. A path of a single channel
    /// keeps its weight; losses become the probability that it ends.
    pub channel: Option<usize>,
    /// The wavelength that the path takes if it meets dispersive glass.
    pub wavelength_sample: WavelengthSample,
    /// Index of the light that a light path starts from, if it ends at the first vertex where light linking says so.
    pub linked: Option<u32>,
}

/// Traces the path from `start`, with at most `max_depth` segments, and shows its vertices to the visitor. The vertices
/// store their shading data in `arena`.
#[inline]
pub fn walk<'a, V: Visitor<'a>>(
    scene: &'a Scene,
    arena: &'a Bump,
    start: &PathStart,
    stream: Stream,
    transport: Transport,
    max_depth: u32,
    visitor: &mut V,
) {
    // Each kind of scene has its own instance of the loop, so that scenes without media or dispersion pay nothing for
    // them.
    if scene.survey.dispersion {
        walk_aside::<V, DISPERSION>(scene, arena, start, stream, transport, max_depth, visitor);
    } else if scene.survey.scattering || scene.survey.grids {
        walk_aside::<V, SCATTERING>(scene, arena, start, stream, transport, max_depth, visitor);
    } else if scene.survey.media {
        walk_aside::<V, ABSORPTION>(scene, arena, start, stream, transport, max_depth, visitor);
    } else {
        walk_in::<V, NOTHING>(scene, arena, start, stream, transport, max_depth, visitor);
    }
}

/// Contents of a scene besides surfaces, as constants 0 to 3. Each value includes the smaller ones: nothing, absorbing
/// media, scattering or heterogeneous media, dispersive solids.
const NOTHING: u8 = 0;
const ABSORPTION: u8 = 1;
const SCATTERING: u8 = 2;
const DISPERSION: u8 = 3;

/// Traces a path in a scene with media. Not inlined, so that the case without media stays small.
#[inline(never)]
fn walk_aside<'a, V: Visitor<'a>, const BESIDES: u8>(
    scene: &'a Scene,
    arena: &'a Bump,
    start: &PathStart,
    stream: Stream,
    transport: Transport,
    max_depth: u32,
    visitor: &mut V,
) {
    walk_in::<V, BESIDES>(scene, arena, start, stream, transport, max_depth, visitor);
}

#[inline(always)]
fn walk_in<'a, V: Visitor<'a>, const BESIDES: u8>(
    scene: &'a Scene,
    arena: &'a Bump,
    start: &PathStart,
    stream: Stream,
    transport: Transport,
    max_depth: u32,
    visitor: &mut V,
) {
    let PathStart { origin, direction, throughput, interior, leaving, far, channel, wavelength_sample, .. } = *start;
    let PathStart { ref first, linked, .. } = *start;
    let survival_scale = 1.0 / (visitor.spared() * throughput.max_element());
    if !(survival_scale.is_finite() && throughput.is_finite()) {
        end(throughput, visitor);
        return;
    }
    let mut path = Path {
        scene,
        arena,
        stream,
        transport,
        max_depth,
        channel: channel.map(|channel| (channel, throughput[channel])),
        wavelength_sample,
        linked,
        far,
        depth: 1,
        origin,
        direction,
        throughput,
        interior,
        survival_scale,
        reach: if BESIDES >= SCATTERING { scene.reach(origin) } else { f32::INFINITY },
        scattered: None,
        in_medium: false,
        leaving,
        wavelength: None,
        splits: visitor.splits(),
        share: 1.0,
    };
    if V::BRANCHES {
        path.follow_branch::<V, BESIDES>(first, visitor);
    } else {
        path.follow::<V, BESIDES>(first, visitor);
    }
}

/// Ends a path, and tells the visitor if its throughput is not finite.
#[inline]
fn end<'a, V: Visitor<'a>>(throughput: Rgb, visitor: &mut V) -> Option<()> {
    if !throughput.is_finite() {
        visitor.lost();
    }
    None
}

/// State of a path during the walk.
#[derive(Clone, Copy)]
struct Path<'a> {
    scene: &'a Scene,
    arena: &'a Bump,
    stream: Stream,
    transport: Transport,
    max_depth: u32,
    /// Channel index and weight of a path of a single channel; `None` for all channels.
    channel: Option<(usize, f32)>,
    wavelength_sample: WavelengthSample,
    /// Index of the light that a light path starts from, if light linking limits its light.
    linked: Option<u32>,
    far: bool,
    /// Number of the current path segment, from 1.
    depth: u32,
    origin: Vec3,
    direction: Vec3,
    throughput: Rgb,
    interior: Interior,
    /// Factor of the throughput in roulette, see [`Vertex::survival_scale`].
    survival_scale: f32,
    /// Distance from the scene's centre beyond which the path's contribution falls off ([`Scene::reach`]).
    reach: f32,
    /// How the last vertex scattered the path.
    scattered: Option<Scattered>,
    /// Whether the last vertex lies in a medium.
    in_medium: bool,
    /// The point on a surface that the path leaves, if other surfaces touch it there.
    leaving: Option<ContactPoint>,
    wavelength: Option<Wavelength>,
    /// Number of further smooth interfaces at which the path may be split; 0 after a lobe that is not delta.
    splits: u32,
    /// Share of this branch in the path, see [`Vertex::share`].
    share: f32,
}

impl<'a> Path<'a> {
    /// Follows the path from its current vertex to its end. `first` is the hit of its next ray, if it is known.
    #[inline(always)]
    fn follow<V: Visitor<'a>, const BESIDES: u8>(&mut self, first: &PrecomputedHit, visitor: &mut V) {
        let mut known = first;
        while self.depth <= self.max_depth && !self.is_cut(visitor) {
            let (end, flight) = self.travel::<V, BESIDES>(known, visitor);
            known = &PrecomputedHit::Unknown;
            if self.scene.survey.hidden_solids && self.depth == 1 && self.transport == Transport::Radiance {
                self.enter_hidden_solids(&end);
            }
            if self.scene.survey.holdouts
                && self.depth == 1
                && self.transport == Transport::Radiance
                && let End::Surface(arrival) = &end
                && self.scene.shapes.instances[arrival.surface.instance as usize].holdout
            {
                visitor.hole();
                return;
            }
            if self.depth == 1 && self.linked.is_some_and(|light| !receives(self.scene, &end, light)) {
                return;
            }
            let goes_on = match end {
                End::Surface(arrival) => self.surface::<V, BESIDES>(arrival, flight, visitor),
                End::Medium(met) => self.medium(met, flight, visitor),
                End::Escaped(left) => {
                    visitor.escape(self.direction, self.throughput * left, self.scattered, flight);
                    None
                }
                End::Lost => None,
            };
            if goes_on.is_none() {
                return;
            }
            self.depth += 1;
        }
    }

    /// Whether the path ends early. Checked at every few vertices only, so that most paths never ask.
    #[inline(always)]
    fn is_cut<V: Visitor<'a>>(&self, visitor: &V) -> bool {
        self.depth.is_multiple_of(CUT_INTERVAL) && visitor.stop().is_some_and(Stop::should_end_path)
    }

    /// [`Path::follow`] for paths that may split, and for their branches.
    #[inline(never)]
    fn follow_branch<V: Visitor<'a>, const BESIDES: u8>(&mut self, first: &PrecomputedHit, visitor: &mut V) {
        self.follow::<V, BESIDES>(first, visitor);
        visitor.end(self.share);
    }

    /// Follows the path to the next vertex. Returns where the segment ends, and the probability densities of flight
    /// through media along it.
    #[inline(always)]
    fn travel<V: Visitor<'a>, const BESIDES: u8>(
        &mut self,
        met: &PrecomputedHit,
        visitor: &mut V,
    ) -> (End, FlightDensity) {
        let Path { scene, throughput, depth, scattered, wavelength, survival_scale, share, origin, .. } = *self;
        let draws = self.stream.vertex(depth - 1);
        let camera = depth == 1 && self.transport == Transport::Radiance;
        let token =
            if camera { camera_token(scene, draws, Purpose::Alpha) } else { token(scene, draws, Purpose::Alpha) };
        let start = Start { origin, direction: self.direction, interior: self.interior, leaving: self.leaving, token };
        let mut flight = FlightDensity::ONE;
        let end = if BESIDES < ABSORPTION {
            next_vertex(scene, start, met, &mut Clear)
        } else if BESIDES < SCATTERING {
            next_vertex(scene, start, met, &mut Attenuate { scene, token })
        } else if V::SPLITS {
            let from = origin;
            let mut split =
                Split { scene, visitor, throughput, draws, depth, scattered, from, wavelength, share, survival_scale };
            next_vertex(scene, start, met, &mut split)
        } else {
            let (from_medium, from_infinity) = (self.in_medium, self.far && depth == 1);
            let mut fly = Fly { scene, throughput, draws, from_medium, from_infinity, flight };
            let end = next_vertex(scene, start, met, &mut fly);
            flight = fly.flight;
            end
        };
        if BESIDES >= SCATTERING
            && self.transport == Transport::Radiance
            && scene.survey.fire
            && visitor.sees_medium_light(scattered)
        {
            MediumEmission { scene, visitor, throughput, draws, depth, scattered }.show(start, met);
        }
        let segment = Segment { start: &start, end: &end, from_medium: self.in_medium, throughput, depth, scattered };
        if self.transport == Transport::Radiance && scene.pass_through_lights.is_some() {
            visit_pass_through_lights(scene, &segment, visitor);
        }
        if V::SHADOW_LINKS && scene.survey.shadow_links && scattered.is_some() {
            visitor.linked_suns(&segment);
        }
        if self.transport == Transport::Radiance
            && scene.lights.has_bulbs()
            && scattered.is_none_or(|scattered| scattered.lobe == LobeSet::DELTA)
        {
            visit_bulbs(scene, &segment, draws, visitor);
        }
        if BESIDES >= SCATTERING
            && let (End::Surface(_) | End::Escaped(_), Some(scattered)) = (&end, &mut self.scattered)
        {
            scattered.pdf_w *= flight.forward;
        }
        (end, flight)
    }

    /// Keeps roulette from treating the lower throughput of a camera ray that ends in a hidden solid as absorption, as
    /// where a ray is refracted.
    #[cold]
    fn enter_hidden_solids(&mut self, end: &End) {
        let there = match end {
            End::Surface(arrival) => &arrival.interior,
            End::Medium(arrival) => &arrival.interior,
            End::Escaped(_) | End::Lost => return,
        };
        self.survival_scale *= (there.ior(self.scene) / self.interior.ior(self.scene)).powi(2);
    }

    /// Scatters the path in a medium; `None` ends it.
    #[inline(always)]
    fn medium<V: Visitor<'a>>(&mut self, met: MediumArrival, flight: FlightDensity, visitor: &mut V) -> Option<()> {
        let Path { scene, depth, wavelength, survival_scale, share, reach, .. } = *self;
        let arriving = self.throughput * met.weight;
        // The contribution of light far from the scene falls off with the squared distance.
        let back = (reach * reach / met.p.distance_squared(scene.lights.sky().center)).min(1.0);
        let draws = self.stream.vertex(depth);
        let vertex = MediumVertex {
            wo: -self.direction,
            throughput: arriving * met.medium.sigma_s,
            arrival: met,
            arriving,
            depth,
            from: self.origin,
            draws,
            flight,
            opacity: 1.0,
            next_event: 1.0,
            wavelength,
            share,
            survival_scale: survival_scale * back,
        };
        // A medium may not scatter the channel that was sampled.
        if !is_lit(vertex.throughput) {
            return end(vertex.throughput, visitor);
        }
        let set = match visitor.medium(&vertex, self.scattered) {
            Next::Stop => return None,
            Next::Continue(set) | Next::Choose(set, _) => set & LobeSet::BROAD,
        };
        let survival = vertex.survival(set);
        if set.is_empty() || depth == self.max_depth {
            return None;
        }
        if !draws.happens(survival, Purpose::Roulette) {
            return end(vertex.throughput, visitor);
        }
        let sample = vertex.sample(self.transport, set, 0.0, draws.two(Purpose::Phase))?;
        visitor.scatter_medium(&vertex, &sample);
        self.throughput = vertex.throughput * sample.weight / survival;
        self.scattered = Some(Scattered { lobe: sample.lobe, pdf_w: sample.pdf_w * survival });
        (self.origin, self.direction) = (vertex.arrival.p, sample.wi);
        (self.interior, self.in_medium, self.leaving) = (vertex.arrival.interior, true, None);
        self.splits = 0;
        Some(())
    }

    /// Scatters the path at a surface; `None` ends it.
    #[inline(always)]
    fn surface<V: Visitor<'a>, const BESIDES: u8>(
        &mut self,
        arrival: Arrival,
        flight: FlightDensity,
        visitor: &mut V,
    ) -> Option<()> {
        self.throughput *= arrival.transmittance;
        if V::BRANCHES && BESIDES >= DISPERSION && self.takes_wavelengths(&arrival) {
            self.split_wavelengths(&arrival, flight, visitor);
            return None;
        }
        self.scatter::<V, BESIDES>(&arrival, flight, visitor)
    }

    /// Shows the visitor a surface vertex and scatters the path there; `None` ends it.
    #[inline(always)]
    fn scatter<V: Visitor<'a>, const BESIDES: u8>(
        &mut self,
        arrival: &Arrival,
        flight: FlightDensity,
        visitor: &mut V,
    ) -> Option<()> {
        let Arrival { ref surface, eta, ref crossing, interior: here, distance, .. } = *arrival;
        let Path { scene, depth, transport, .. } = *self;
        let dispersed = match crossing {
            Some(crossing) if BESIDES >= DISPERSION && crossing.disperses(scene) => Some(crossing),
            _ => None,
        };
        let eta = dispersed.map_or(eta, |crossing| {
            let taken = self.take_wavelength();
            crossing.eta(scene, self.direction.dot(surface.ng) < 0.0, &taken)
        });
        if self.lose().is_none() {
            return end(self.throughput, visitor);
        }
        let wo = -self.direction;
        let shading = scene.scattering.shading(&scene.materials, surface, eta, wo, self.arena);
        let behind = crossing.as_ref().map_or(here, |c| c.interior);
        let draws = self.stream.vertex(depth);
        let vertex = Vertex {
            surface,
            shading: &shading,
            wo,
            throughput: self.throughput,
            depth,
            distance,
            from: self.origin,
            interior: here,
            interior_behind: behind,
            draws,
            flight,
            wavelength: self.wavelength,
            share: self.share,
            survival_scale: self.survival_scale,
        };
        let (set, chance) = match visitor.surface(&vertex, self.scattered) {
            Next::Stop => return None,
            Next::Continue(set) => (set & shading.bsdf.lobes(), 1.0),
            Next::Choose(set, chance) => (set & shading.bsdf.lobes(), chance),
        };
        if set.is_empty() || depth == self.max_depth {
            return None;
        }
        let survival = match self.channel {
            None => vertex.survival_chosen(set, chance),
            // Its roulette takes place on arrival. This one only ends trapped light.
            Some(_) => late_survival(depth, || set == LobeSet::DELTA),
        };
        if !draws.happens(survival, Purpose::Roulette) {
            return end(self.throughput, visitor);
        }
        let going = survival * chance;
        // Radiance grows with the squared index of refraction.
        let scale = if crossing.is_some() && transport == Transport::Radiance {
            let eta = if self.direction.dot(surface.ng) < 0.0 { eta } else { 1.0 / eta };
            eta * eta
        } else {
            1.0
        };
        if V::BRANCHES
            && self.splits > 0
            && set == LobeSet::DELTA
            && let Some(branches) = shading.interface_branches(transport)
        {
            self.split_interface::<V, BESIDES>(&vertex, branches, going, scale, visitor);
            return Some(());
        }
        let lobe = draws.one_if(shading.bsdf.has_several_lobes(), Purpose::Lobe);
        let sample = shading.sample(transport, set, lobe, draws.two(Purpose::Direction))?;
        self.leave(&vertex, &sample, going, scale, visitor);
        Some(())
    }

    /// Continues the path from `vertex` along `sample`. The visitor and roulette let it continue with the probability
    /// `going`; radiance grows by the factor `scale` behind the surface.
    #[inline(always)]
    fn leave<V: Visitor<'a>>(
        &mut self,
        vertex: &Vertex<'_, 'a>,
        sample: &BsdfSample,
        going: f32,
        scale: f32,
        visitor: &mut V,
    ) {
        visitor.scatter(vertex, sample);
        self.throughput *= sample.weight / going;
        self.scattered = Some(Scattered { lobe: sample.lobe, pdf_w: sample.pdf_w * going });
        if sample.transmitted {
            // A path that has entered a dense medium has lost nothing and regains the factor when it leaves, so roulette
            // must not treat the factor as absorption.
            self.survival_scale *= scale;
        }
        if sample.lobe != LobeSet::DELTA {
            self.splits = 0;
        }
        self.direction = sample.wi;
        self.origin = vertex.surface.ray_origin(sample.wi);
        (self.in_medium, self.leaving) = (false, ContactPoint::touching(vertex.surface));
        self.interior = if sample.transmitted { vertex.interior_behind } else { vertex.interior };
    }

    /// Splits the path at a smooth interface: follows both branches, the weaker one to the end, or one of them.
    /// Shares sum to one in all cases, so that branches of equal radiance add no noise.
    #[inline(never)]
    fn split_interface<V: Visitor<'a>, const BESIDES: u8>(
        &mut self,
        vertex: &Vertex<'_, 'a>,
        [weak, strong]: [BsdfSample; 2],
        going: f32,
        scale: f32,
        visitor: &mut V,
    ) {
        self.splits -= 1;
        let share = branch_share(self.share, weak.pdf_w);
        if !vertex.draws.happens(weak.pdf_w / share, Purpose::Lobe) {
            return self.leave(vertex, &strong, going, scale, visitor);
        }
        if share == 1.0 {
            return self.leave(vertex, &weak, going, scale, visitor);
        }
        let mut branch = *self;
        branch.stream = self.stream.branch(self.depth, 0);
        branch.take_share(share);
        visitor.branch(|visitor| {
            branch.leave(vertex, &weak, going, scale, visitor);
            branch.depth += 1;
            branch.follow_branch::<V, BESIDES>(&PrecomputedHit::Unknown, visitor);
        });
        self.take_share(1.0 - share);
        self.leave(vertex, &strong, going, scale, visitor);
    }

    /// Reduces the path to a branch that has the fraction `share` of its weight. Roulette does not treat this as a loss.
    #[inline]
    fn take_share(&mut self, share: f32) {
        self.share *= share;
        self.throughput *= share;
        self.survival_scale /= share;
    }

    /// Whether the path meets dispersive glass for the first time, and splits into several wavelengths there.
    #[inline]
    fn takes_wavelengths(&self, arrival: &Arrival) -> bool {
        self.splits > 0
            && self.wavelength.is_none()
            && self.share >= MIN_DISPERSED_SHARE
            && arrival.crossing.as_ref().is_some_and(|crossing| crossing.disperses(self.scene))
    }

    /// Follows one branch of the path for each of several wavelengths.
    #[inline(never)]
    fn split_wavelengths<V: Visitor<'a>>(&mut self, arrival: &Arrival, flight: FlightDensity, visitor: &mut V) {
        for (k, wavelength) in self.wavelength_sample.spread().enumerate() {
            let mut branch = *self;
            if k > 0 {
                branch.stream = self.stream.branch(self.depth, k as u32);
            }
            branch.take_share(1.0 / f32::from(SPREAD));
            branch.throughput *= wavelength.weight;
            branch.wavelength = Some(wavelength);
            visitor.branch(|visitor| {
                if branch.scatter::<V, DISPERSION>(arrival, flight, visitor).is_some() {
                    branch.depth += 1;
                    branch.follow_branch::<V, DISPERSION>(&PrecomputedHit::Unknown, visitor);
                } else {
                    visitor.end(branch.share);
                }
            });
        }
        // Nothing of the path is left.
        self.share = 0.0;
    }

    /// The path's wavelength, which it takes at the first dispersive glass. It does so even if it is reflected: the
    /// probability of reflection depends on the wavelength, and all techniques must agree whether the path has one.
    #[inline(always)]
    fn take_wavelength(&mut self) -> Wavelength {
        if let Some(taken) = self.wavelength {
            return taken;
        }
        let taken = match self.channel {
            None => self.wavelength_sample.wavelength(),
            Some((channel, _)) => self
                .wavelength_sample
                .sample_in_channel(channel, self.stream.vertex(self.depth).one(Purpose::Wavelength)),
        };
        self.throughput *= taken.weight;
        self.wavelength = Some(taken);
        taken
    }

    /// Roulette of a path of a single channel, by the weight that it has lost; `None` ends it.
    #[inline(always)]
    fn lose(&mut self) -> Option<()> {
        let Some((channel, weight)) = self.channel else { return Some(()) };
        let left = self.throughput[channel] / weight;
        // Written so that NaN ends the path.
        if left > 0.0 && self.stream.vertex(self.depth).one(Purpose::Loss) < left {
            self.throughput /= left.min(1.0);
            Some(())
        } else {
            None
        }
    }
}

/// Whether the object or the medium at the end of the first segment of a light path receives its light, as far as light
/// linking decides.
#[cold]
#[inline(never)]
fn receives(scene: &Scene, end: &End, light: u32) -> bool {
    let (p, links) = match end {
        End::Surface(arrival) => (arrival.surface.p, scene.linkings(arrival.surface.instance)),
        End::Medium(arrival) => (arrival.p, arrival.interior.linkings(scene)),
        End::Escaped(_) | End::Lost => return true,
    };
    scene.lights.shines_on(light, &Receiver { links, ..Receiver::anywhere(p) })
}

/// A segment of a camera path that has been followed to its end.
pub struct Segment<'s> {
    /// Start of the segment.
    pub start: &'s Start,
    end: &'s End,
    /// Whether the segment starts at a vertex in a medium.
    pub from_medium: bool,
    /// Throughput of the path at the start.
    pub throughput: Rgb,
    /// Number of the segment, from 1.
    pub depth: u32,
    /// How the vertex at the start scattered the path.
    pub scattered: Option<Scattered>,
}

/// Shows the visitor the pass-through lights on a segment.
#[cold]
#[inline(never)]
fn visit_pass_through_lights<'a, V: Visitor<'a>>(scene: &Scene, segment: &Segment<'_>, visitor: &mut V) {
    let Segment { start, end, from_medium, throughput, depth, scattered } = *segment;
    // A split walk continues behind a vertex of a medium, and so do the lights.
    let reach = if let End::Surface(arrival) = end { arrival.distance } else { f32::INFINITY };
    let linked = V::SHADOW_LINKS && scattered.is_some();
    for_each_pass_through_light(
        scene,
        start,
        reach,
        from_medium,
        linked,
        |surface, distance, transmittance, flight| {
            let (surface, wo, throughput) = (*surface, -start.direction, throughput * transmittance);
            let scattered = scattered.map(|s| Scattered { pdf_w: s.pdf_w * flight.forward, ..s });
            visitor.pass_through_light(&PassThroughHit { surface, wo, throughput, depth, distance, flight }, scattered);
        },
    );
}

/// Shows the visitor the bulbs of lights on a segment that starts at the camera or at a delta lobe.
#[cold]
#[inline(never)]
fn visit_bulbs<'a, V: Visitor<'a>>(scene: &Scene, segment: &Segment<'_>, draws: Draws, visitor: &mut V) {
    let Segment { start, end, from_medium, throughput, depth, scattered } = *segment;
    let reach = if let End::Surface(arrival) = end { arrival.distance } else { f32::INFINITY };
    let seen = BulbView { reach, from_medium, camera: depth == 1, linked: V::SHADOW_LINKS && scattered.is_some() };
    for_each_bulb(scene, start, &seen, draws, |radiance, at, emitter| {
        visitor.bulb(&BulbHit { light: throughput * radiance, emitter, depth, at }, scattered);
    });
}
