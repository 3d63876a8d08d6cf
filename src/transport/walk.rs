//! The bounce loop. It owns intersection, the solids a path is in, roulette and depth, and knows no film; an algorithm is a
//! [`Visitor`].

use super::flight::{Fly, Split};
use super::interior::Interior;
use super::segment::{Arrival, Attenuate, Clear, End, PrecomputedHit, Start, next_vertex, token};
use super::site::{MediumVertex, ScatterPoint};
use crate::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::Flight;
use crate::random::{Draws, Purpose, Stream};
use crate::scene::Scene;
use crate::scene::contact::Place;
use crate::spectrum::{Wavelength, WavelengthSample};
use bumpalo::Bump;

/// After this many bounces even a path that loses nothing may end, so that light trapped between perfect mirrors ends
/// without a limit on depth.
const LATE: u32 = 64;
/// After this many all but such light is gone.
const TRAPPED: u32 = 1 << 16;

/// Least probability of going on: keeps the weight of what survives bounded.
const LEAST_SURVIVAL: f32 = 0.02;

/// Where a path starts.
#[derive(Clone, Copy, Debug)]
pub struct PathStart {
    /// Origin of the first ray, off any surface.
    pub origin: Vec3,
    /// Unit direction of the first ray.
    pub direction: Vec3,
    /// Weight of the path: flux or importance.
    pub throughput: Rgb,
    /// The solids the origin is in.
    pub interior: Interior,
    /// What the first ray meets, if it has been traced already.
    pub first: PrecomputedHit,
    /// It has come from infinity.
    pub far: bool,
    /// The one channel of a path that keeps its weight: what it would lose is the probability that it ends.
    pub channel: Option<usize>,
    /// The wavelength it takes if it meets dispersive glass.
    pub hue: WavelengthSample,
}

/// A vertex of a path on a surface. What it refers to by `'a` outlives the walk.
pub struct Vertex<'v, 'a> {
    /// The surface.
    pub surface: &'v Surface,
    /// How it scatters, seen along `wo`.
    pub shading: &'v Shading<'a>,
    /// Unit direction back along the path.
    pub wo: Vec3,
    /// Weight of the path up to here, before this vertex scatters.
    pub throughput: Rgb,
    /// Number of segments up to here: 1 at the first surface.
    pub depth: u32,
    /// Length of the last segment.
    pub distance: f32,
    /// Origin of the last segment.
    pub from: Vec3,
    /// The solids the path is in on the side of `wo`.
    pub interior: Interior,
    /// The solids behind the surface.
    pub interior_behind: Interior,
    /// Random numbers of this vertex.
    pub draws: Draws,
    /// Densities of the last segment's flight through media.
    pub flight: Flight,
    /// The wavelength the path has taken, here at the latest; its weight is in the throughput.
    pub wavelength: Option<Wavelength>,
    survival_scale: f32,
}

/// How the last vertex sent the path here.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Class of the lobe.
    pub lobe: LobeSet,
    /// Density per solid angle of the direction, times the probability that the path went on and was not scattered by a medium on its way; for a
    /// delta lobe meaningless.
    pub pdf_w: f32,
}

/// What a visitor wants next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// End the path.
    Stop,
    /// Go on with a direction from these lobes.
    Continue(LobeSet),
    /// Go on with a direction from these lobes, which were chosen from several sets with this probability.
    Choose(LobeSet, f32),
}

/// Receives the vertices of a walk.
pub trait Visitor<'a> {
    /// Share of its first weight down to which a path is spared roulette (but for what is trapped); below it goes on
    /// with the probability of what it has left of that share.
    const SPARED: f32 = 1.0;
    /// The walk takes media by splitting (`flight.rs`) and does not scatter at their vertices.
    const SPLITS: bool = false;
    /// A vertex; `scattered` is how the vertex before sent the path here (`None` at the first).
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next;
    /// As [`Visitor::surface`], in a medium that scatters. A walk that splits goes on whatever the answer.
    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        let _ = (vertex, scattered);
        Next::Stop
    }
    /// A second vertex in the same medium, of a walk that splits, at which nothing but its share of next-event estimation is to be measured.
    #[inline]
    fn lit(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) {
        let _ = (vertex, scattered);
    }
    /// `sample` is drawn at `vertex`, and the path goes on.
    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// As [`Visitor::scatter`], in a medium.
    #[inline]
    fn scatter_medium(&mut self, vertex: &MediumVertex, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// The path leaves the scene along `direction` with weight `throughput`; `flight`: densities of its way to infinity.
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, flight: Flight) {
        let _ = (direction, throughput, scattered, flight);
    }
}

impl Vertex<'_, '_> {
    /// Probability that the walk goes on from here if the visitor asks for the lobes of `set`. PrecomputedHit before a direction
    /// is drawn, so that MIS weights can use it.
    #[inline]
    pub fn survival(&self, set: LobeSet) -> f32 {
        self.survival_chosen(set, 1.0)
    }

    /// The same if the visitor chooses these lobes with probability `chance`.
    #[inline]
    pub fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32 {
        let albedo = self.shading.albedo(set);
        survival((self.throughput * albedo).max_element() * self.survival_scale / chance, self.depth)
    }
}

/// Probability of going on where a path of `depth` keeps a share `expected` of its weight.
#[inline]
pub(super) fn survival(expected: f32, depth: u32) -> f32 {
    // Written so that NaN ends the path.
    let survival = if expected > 0.0 { expected.clamp(LEAST_SURVIVAL, 1.0) } else { 0.0 };
    survival.min(late_survival(depth))
}

/// Probability of going on at most.
///
/// With `1 - c / n` at the `n`-th bounce a path gets there with `P(n) ~ n^-c`, and an estimate that finds `f(n)` on its
/// way has the second moment `sum_mn f(m) f(n) / P(min(m, n))`. It is finite for whatever loses a share of itself at
/// every bounce, whatever that share, unlike with a constant survival `s`, which must be above the albedo squared; and
/// for c = 1/2 it grows as a logarithm only for what comes back out of a half space that absorbs nothing, `f(n) ~
/// n^-3/2`. A trapped path then has 16 sqrt(n) bounces among the first n on average: with c = 2 from some n on, an end.
#[inline]
fn late_survival(depth: u32) -> f32 {
    let c = if depth <= LATE {
        return 1.0;
    } else if depth <= TRAPPED {
        0.5
    } else {
        2.0
    };
    1.0 - c / depth as f32
}

/// Walks from `start`. `transport` says which way; the path has at most `max_depth` segments. What vertices need beyond the scene is
/// made in `arena`, which may be reset when none of them is left.
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
    // Scenes without media or dispersion walk as if there were none in the world.
    if scene.survey.dispersion {
        walk_aside::<V, DISPERSION>(scene, arena, start, stream, transport, max_depth, visitor);
    } else if scene.survey.scattering {
        walk_aside::<V, SCATTERING>(scene, arena, start, stream, transport, max_depth, visitor);
    } else if scene.survey.media {
        walk_aside::<V, ABSORPTION>(scene, arena, start, stream, transport, max_depth, visitor);
    } else {
        walk_in::<V, NOTHING>(scene, arena, start, stream, transport, max_depth, visitor);
    }
}

/// What a scene has besides surfaces, each with all before it: nothing, media that absorb, media that scatter, solids that refract colours differently.
const NOTHING: u8 = 0;
const ABSORPTION: u8 = 1;
const SCATTERING: u8 = 2;
const DISPERSION: u8 = 3;

/// Out of the way of the other, which is inlined.
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
    let PathStart { mut origin, mut direction, mut throughput, mut interior, ref first, far, channel, hue } = *start;
    let weight = channel.map_or(1.0, |channel| throughput[channel]);
    let mut known = first;
    let mut survival_scale = 1.0 / (V::SPARED * throughput.max_element());
    if !survival_scale.is_finite() {
        return;
    }
    let mut scattered: Option<Scattered> = None;
    let mut in_medium = false;
    let mut leaving: Option<Place> = None;
    let mut wavelength = None;
    for depth in 1..=max_depth {
        let last = stream.vertex(depth - 1);
        let token = token(scene, last, Purpose::Alpha);
        let met = std::mem::replace(&mut known, &PrecomputedHit::Unknown);
        let mut flight = Flight::FREE;
        let start = Start { origin, direction, interior, leaving, token };
        let end = if BESIDES < ABSORPTION {
            next_vertex(scene, start, met, &mut Clear)
        } else if BESIDES < SCATTERING {
            next_vertex(scene, start, met, &mut Attenuate)
        } else if V::SPLITS {
            let from = origin;
            let draws = last;
            let mut split =
                Split { scene, visitor, throughput, draws, depth, scattered, from, wavelength, survival_scale };
            next_vertex(scene, start, met, &mut split)
        } else {
            let (from_medium, from_infinity) = (in_medium, far && depth == 1);
            let mut fly = Fly { scene, throughput, draws: last, from_medium, from_infinity, flight };
            let end = next_vertex(scene, start, met, &mut fly);
            flight = fly.flight;
            end
        };
        if BESIDES >= SCATTERING
            && let (End::Surface(_) | End::Escaped(_), Some(scattered)) = (&end, &mut scattered)
        {
            scattered.pdf_w *= flight.forward;
        }
        let arrival = match end {
            End::Surface(arrival) => arrival,
            End::Medium(met) => {
                let wo = -direction;
                let arriving = throughput * met.weight;
                let sigma_s = met.medium.sigma_s;
                let draws = stream.vertex(depth);
                let vertex = MediumVertex {
                    met,
                    wo,
                    throughput: arriving * sigma_s,
                    arriving,
                    depth,
                    from: origin,
                    draws,
                    flight,
                    opacity: 1.0,
                    next_event: 1.0,
                    wavelength,
                    survival_scale,
                };
                // Where the channel that has brought it here scatters nothing, it carries nothing.
                if !is_lit(vertex.throughput) {
                    return;
                }
                let set = match visitor.medium(&vertex, scattered) {
                    Next::Stop => return,
                    Next::Continue(set) | Next::Choose(set, _) => set & LobeSet::BROAD,
                };
                let survival = vertex.survival(set);
                if set.is_empty() || depth == max_depth || draws.one(Purpose::Roulette) >= survival {
                    return;
                }
                let Some(sample) = vertex.sample(transport, set, 0.0, draws.two(Purpose::Phase)) else { return };
                visitor.scatter_medium(&vertex, &sample);
                throughput = vertex.throughput * sample.weight / survival;
                scattered = Some(Scattered { lobe: sample.lobe, pdf_w: sample.pdf_w * survival });
                (origin, direction) = (vertex.met.p, sample.wi);
                (interior, in_medium, leaving) = (vertex.met.interior, true, None);
                continue;
            }
            End::Escaped(left) => {
                visitor.escape(direction, throughput * left, scattered, flight);
                return;
            }
            End::Lost => return,
        };
        let Arrival { ref surface, mut eta, ref crossing, interior: here, transmittance, distance } = arrival;
        throughput *= transmittance;
        if BESIDES >= DISPERSION
            && let Some(crossing) = crossing
            && crossing.disperses(scene)
        {
            // Even where light is only reflected: whether it is depends on the wavelength, and all ways to put a path together must agree that it has one.
            let taken = wavelength.get_or_insert_with(|| {
                let taken = match channel {
                    None => hue.wavelength(),
                    Some(channel) => hue.wavelength_of(channel, stream.vertex(depth).one(Purpose::Wavelength)),
                };
                throughput *= taken.weight;
                taken
            });
            eta = crossing.eta(scene, direction.dot(surface.ng) < 0.0, taken);
        }
        if let Some(channel) = channel {
            let left = throughput[channel] / weight;
            // Written so that NaN ends the path.
            if left > 0.0 && stream.vertex(depth).one(Purpose::Loss) < left {
                throughput /= left.min(1.0);
            } else {
                return;
            }
        }
        let shading = scene.scattering.shading(&scene.materials, surface, eta, -direction, arena);
        let behind = crossing.as_ref().map_or(here, |c| c.interior);
        let draws = stream.vertex(depth);
        let vertex = Vertex {
            surface,
            shading: &shading,
            wo: -direction,
            throughput,
            depth,
            distance,
            from: origin,
            interior: here,
            interior_behind: behind,
            draws,
            flight,
            wavelength,
            survival_scale,
        };
        let (set, chance) = match visitor.surface(&vertex, scattered) {
            Next::Stop => return,
            Next::Continue(set) => (set & shading.bsdf.lobes(), 1.0),
            Next::Choose(set, chance) => (set & shading.bsdf.lobes(), chance),
        };
        if set.is_empty() || depth == max_depth {
            return;
        }
        let survival = match channel {
            None => vertex.survival_chosen(set, chance),
            // It has its roulette on arrival; this one ends what is trapped without loss.
            Some(_) => late_survival(depth),
        };
        if draws.one(Purpose::Roulette) >= survival {
            return;
        }
        let sample = shading.sample(transport, set, draws.one(Purpose::Lobe), draws.two(Purpose::Direction));
        let Some(sample) = sample else { return };
        visitor.scatter(&vertex, &sample);
        let going = survival * chance;
        throughput *= sample.weight / going;
        scattered = Some(Scattered { lobe: sample.lobe, pdf_w: sample.pdf_w * going });
        if sample.transmitted && crossing.is_some() && transport == Transport::Radiance {
            // Radiance is denser where the index is higher, by its square; a path that has only come in there has lost nothing, and gets
            // it back on the way out. Roulette must not take it for absorption.
            let eta = if direction.dot(surface.ng) < 0.0 { eta } else { 1.0 / eta };
            survival_scale *= eta * eta;
        }
        direction = sample.wi;
        origin = surface.spawn(direction);
        in_medium = false;
        leaving = Place::touching(surface);
        interior = if sample.transmitted { behind } else { here };
    }
}
