//! The bounce loop. It owns intersection, the solids a path is in, roulette and depth, and knows no film; an algorithm is a
//! [`Visitor`].

use super::flight::{Fly, Split};
use super::glow::{Glow, glows};
use super::interior::Interior;
use super::roulette::late_survival;
use super::segment::{Arrival, Attenuate, Clear, End, PrecomputedHit, Start, camera_token, next_vertex, token};
use super::site::ScatterPoint;
use super::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::Flight;
use crate::random::{Purpose, Stream};
use crate::scene::Scene;
use crate::scene::contact::Place;
use crate::spectrum::WavelengthSample;
use bumpalo::Bump;

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
        let camera = depth == 1 && transport == Transport::Radiance;
        let token = if camera { camera_token(scene, last, Purpose::Alpha) } else { token(scene, last, Purpose::Alpha) };
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
        if transport == Transport::Radiance && scene.bodiless.is_some() {
            show_glows(scene, &start, &end, (in_medium, throughput, depth), scattered, visitor);
        }
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

/// Shows a visitor the lamps without a body on a segment that has ended somewhere, which began in a medium or not with some
/// weight and is the last of so many.
#[cold]
#[inline(never)]
fn show_glows<'a, V: Visitor<'a>>(
    scene: &Scene,
    start: &Start,
    end: &End,
    (from_medium, throughput, depth): (bool, Rgb, u32),
    scattered: Option<Scattered>,
    visitor: &mut V,
) {
    // Behind a vertex of a medium there may be more, whose light comes past it.
    let reach = if let End::Surface(arrival) = end { arrival.distance } else { f32::INFINITY };
    glows(scene, start, reach, from_medium, |surface, distance, left, flight| {
        let (surface, wo, throughput) = (*surface, -start.direction, throughput * left);
        let scattered = scattered.map(|s| Scattered { pdf_w: s.pdf_w * flight.forward, ..s });
        visitor.glow(&Glow { surface, wo, throughput, depth, distance, flight }, scattered);
    });
}
