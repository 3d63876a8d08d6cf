//! Direct light at a vertex: next-event estimation and BSDF sampling, weighted by the balance heuristic \[Veach 1997,
//! 9.2\].
//!
//! At a vertex the lobes form two sets that never share light: those that gather photons (`gather`), where the path
//! ends, and those by which the path continues (`onward`). One light sample serves both. The BSDF sample of the
//! gathering lobes is a ray of their own, traced with probability [`BSDF_SAMPLE_PROBABILITY`]. The BSDF sample of the
//! onward lobes is the path itself, which continues with probability `survival`. A technique that is used with
//! probability n has density n p in the balance heuristic.

use super::lobe_layers::FirstScatter;
use super::pass_through::for_each_pass_through_light;
use super::scattering_vertex::ScatterPoint;
use super::segment::{End, Start, next_surface, token, with_blockers};
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3, is_lit};
use crate::random::Purpose;
use crate::scene::Scene;
use crate::trace::{Ray, Tracer};

/// Probability of tracing a BSDF sample of the gathering lobes. They are broad, so the light sample is nearly always
/// the better one; the BSDF sample bounds the error near large lights. One in sixteen instead of one in eight changes
/// the estimated error of no test scene by more than 0.6 %, and saves 3 % of the time.
pub const BSDF_SAMPLE_PROBABILITY: f32 = 0.0625;

/// Weight by the balance heuristic of a technique with density `pdf` against another.
#[inline]
pub fn balance(pdf: f32, other: f32) -> f32 {
    let sum = pdf + other;
    if sum > 0.0 && pdf.is_finite() {
        pdf / sum
    } else if pdf > 0.0 {
        1.0
    } else {
        0.0
    }
}

/// Light at the first surface of a camera path, divided among its diffuse, glossy and transmitting lobes; `None` if it is
/// not recorded.
pub(in crate::transport) type Division<'d> = Option<&'d mut [Rgb; 3]>;

/// Adds `light`, which the lobes of `set` scatter from `wi` with the value `f`, to the lobes of a surface.
fn divide<S: ScatterPoint>(into: &mut [Rgb; 3], vertex: &S, wi: Vec3, set: LobeSet, f: Rgb, light: Rgb) {
    if let FirstScatter::Surface(shares) = vertex.first_scatter(wi, Transport::Radiance, set, f) {
        into.iter_mut().zip(shares).for_each(|(sum, share)| *sum += light * share);
    }
}

/// Direct light at `vertex`, scattered towards `vertex.wo`, per unit of throughput. The path continues by `onward` with
/// probability `survival`.
#[inline]
pub fn direct_light(scene: &Scene, vertex: &impl ScatterPoint, gather: LobeSet, onward: LobeSet, survival: f32) -> Rgb {
    divided_direct_light(scene, vertex, gather, onward, survival, None)
}

/// [`direct_light`] that also adds the light to the lobes of the vertex.
#[inline]
pub(in crate::transport) fn divided_direct_light(
    scene: &Scene,
    vertex: &impl ScatterPoint,
    gather: LobeSet,
    onward: LobeSet,
    survival: f32,
    mut lobes: Division<'_>,
) -> Rgb {
    if scene.lights.is_empty() {
        return Rgb::ZERO;
    }
    let sets = [(gather, BSDF_SAMPLE_PROBABILITY), (onward, survival)];
    let mut light = next_event(scene, vertex, sets, lobes.as_deref_mut());
    if !gather.is_empty() && vertex.draws().one(Purpose::SecondTechnique) < BSDF_SAMPLE_PROBABILITY {
        light += bsdf_sample(scene, vertex, gather, lobes);
    }
    light
}

/// The light sample for several sets of lobes, each with the probability that its BSDF sample is traced. The BSDF
/// samples themselves are not part of it. Also adds the light to the lobes of the vertex.
#[inline]
pub(in crate::transport) fn next_event(
    scene: &Scene,
    vertex: &impl ScatterPoint,
    sets: [(LobeSet, f32); 2],
    lobes: Division<'_>,
) -> Rgb {
    let Some(sample) = vertex.sample_light(scene) else { return Rgb::ZERO };
    let mut scattered = Rgb::ZERO;
    for (set, probability) in sets {
        // Delta lobes scatter nothing towards a light sample, but the density of the set accounts for them.
        if !set.intersects(LobeSet::SMOOTH) {
            continue;
        }
        let (f, pdf) = vertex.evaluate_cos(sample.wi, Transport::Radiance, set);
        scattered += f * if sample.delta { 1.0 } else { balance(sample.pdf_w, probability * pdf) };
    }
    let arriving = scattered * sample.radiance / sample.pdf_w * vertex.next_event_share();
    // A NaN rejects the sample whatever the ray hits, so no ray is traced.
    if arriving.is_nan() {
        return Rgb::NAN;
    }
    if !is_lit(arriving) {
        return Rgb::ZERO;
    }
    let left = vertex.shadow_ray_to_light(scene, &sample).transmittance;
    // Infinite light behind an occluder would give NaN.
    if !is_lit(left) {
        return Rgb::ZERO;
    }
    if let Some(lobes) = lobes {
        let arriving = sample.radiance / sample.pdf_w * vertex.next_event_share() * left;
        for (set, probability) in sets.into_iter().filter(|(set, _)| set.intersects(LobeSet::SMOOTH)) {
            let (f, pdf) = vertex.evaluate_cos(sample.wi, Transport::Radiance, set);
            let weight = if sample.delta { 1.0 } else { balance(sample.pdf_w, probability * pdf) };
            divide(lobes, vertex, sample.wi, set, f, f * weight * arriving);
        }
    }
    arriving * left
}

/// Direct light at a vertex on a shadow catcher, with the shadows of all objects and with those of catchers alone, both
/// by the same sample of a light.
pub(in crate::transport) fn caught_light(scene: &Scene, vertex: &impl ScatterPoint, catchers: &Tracer) -> [Rgb; 2] {
    let Some(light) = vertex.sample_light(scene) else { return [Rgb::ZERO; 2] };
    let (f, _) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
    let arriving = vertex.throughput() * f * light.radiance / light.pdf_w;
    if !(is_lit(arriving) && arriving.is_finite()) {
        return [Rgb::ZERO; 2];
    }
    let token = with_blockers(scene, token(scene, vertex.draws(), Purpose::ShadowAlpha), light.light);
    let origin = vertex.ray_origin(light.wi);
    let (direction, tmax) = match light.target {
        None => (light.wi, f32::INFINITY),
        Some(target) => ((target - origin) / (target - origin).length(), (target - origin).length()),
    };
    if catchers.occluded(&Ray { origin, direction, tmax, token }) {
        return [Rgb::ZERO; 2];
    }
    [arriving * vertex.shadow_ray_to_light(scene, &light).transmittance, arriving]
}

#[inline]
fn bsdf_sample<S: ScatterPoint>(scene: &Scene, vertex: &S, set: LobeSet, lobes: Division<'_>) -> Rgb {
    let draws = vertex.draws();
    let (lobe, direction) = (draws.one(Purpose::SecondLobe), draws.two(Purpose::SecondDirection));
    let Some(sample) = vertex.sample(Transport::Radiance, set, lobe, direction) else { return Rgb::ZERO };
    let interior = *vertex.interiors()[usize::from(sample.transmitted)];
    let (origin, token) = (vertex.ray_origin(sample.wi), token(scene, draws, Purpose::SecondAlpha));
    let start = Start { origin, direction: sample.wi, interior, leaving: vertex.touching(), token };
    let weight = |pdf_light: f32| balance(BSDF_SAMPLE_PROBABILITY * sample.pdf_w, pdf_light) / BSDF_SAMPLE_PROBABILITY;
    let (mut light, mut reach) = (Rgb::ZERO, f32::INFINITY);
    match next_surface(scene, start) {
        End::Surface(arrival) => {
            reach = arrival.distance;
            let from = vertex.receiver(scene);
            if let Some((radiance, pdf)) =
                scene.lights.hit_radiance(&scene.materials, &from, &arrival.surface, -sample.wi)
            {
                light = radiance * arrival.transmittance * weight(pdf);
            }
        }
        End::Escaped(left) => {
            let add = |radiance, pdf, _, _| light += radiance * left * weight(pdf);
            scene.lights.for_each_infinite(&vertex.receiver(scene), sample.wi, false, add);
        }
        End::Medium(_) | End::Lost => {}
    }
    for_each_pass_through_light(scene, &start, reach, S::IN_MEDIUM, false, |surface, _, left, _| {
        if let Some((radiance, pdf)) =
            scene.lights.hit_radiance(&scene.materials, &vertex.receiver(scene), surface, -sample.wi)
        {
            light += radiance * left * weight(pdf);
        }
    });
    if let (Some(lobes), true) = (lobes, is_lit(light)) {
        let (f, _) = vertex.evaluate_cos(sample.wi, Transport::Radiance, set);
        divide(lobes, vertex, sample.wi, set, f, sample.weight * light);
    }
    sample.weight * light
}
