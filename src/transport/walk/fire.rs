//! Light that media emit, as camera paths see it.
//!
//! The points of an emissive medium count as lights without size: next-event estimation samples them, and light paths
//! start from them. A camera path adds their light on the segments where no other technique can find it: before its
//! first vertex, and behind perfect mirrors and clear glass.

use super::segment::{Passage, PrecomputedHit, Span, Start, Through, next_vertex};
use super::vertex::{MediumLight, Scattered, Visitor};
use crate::math::Rgb;
use crate::medium::GridRay;
use crate::random::{Draws, HashSequence, Purpose, mix};
use crate::scene::Scene;

/// Number of points on each part of a segment at which the emission is sampled.
const SAMPLES: u32 = 4;

/// Distinguishes the random numbers of this file from those of collisions on the same segment.
const KEY: u64 = 0x66_69_72_65;

/// Shows the visitor the light of the media on a segment.
pub(in crate::transport) struct MediumEmission<'a, V> {
    pub scene: &'a Scene,
    pub visitor: &'a mut V,
    /// Throughput of the path at the start of the segment.
    pub throughput: Rgb,
    pub draws: Draws,
    /// Number of the segment, from 1.
    pub depth: u32,
    pub scattered: Option<Scattered>,
}

impl<'a, V: Visitor<'a>> MediumEmission<'_, V> {
    /// Follows the segment from `start` to the surface at its end. `known` is its first hit, if it has been traced.
    #[cold]
    #[inline(never)]
    pub fn show(&mut self, start: Start, known: &PrecomputedHit) {
        next_vertex(self.scene, start, known, self);
    }
}

impl<'a, V: Visitor<'a>> Through for MediumEmission<'_, V> {
    fn pass(&mut self, span: &Span) -> Passage {
        let (scene, medium) = (self.scene, &span.medium);
        let Some((instance, grids, placement)) = span.interior.grids(scene) else {
            return Passage::Left(medium.transmittance(span.distance));
        };
        let (origin, direction, sigma_t) = (span.origin, span.direction, medium.sigma_t());
        let ray = GridRay::new(&grids.density, placement, origin, direction);
        let mut random = HashSequence::new(mix(self.draws.nth(span.crossed).bits(Purpose::Tracking) ^ KEY));
        if let Some(emission) = &grids.emission {
            let along = GridRay::new(emission.along(), placement, origin, direction);
            let proxy = along.proxy(span.distance);
            let (mut radiance, mut nearest) = (Rgb::ZERO, f32::INFINITY);
            for sample in 0..SAMPLES {
                let depth = (sample as f32 + random.one()) / SAMPLES as f32 * proxy.depth();
                let Some((distance, density)) = proxy.distance(depth).filter(|_| proxy.depth() > 0.0) else { break };
                let left = ray.transmittance(sigma_t, distance, &mut random);
                radiance += emission.at(along.cells_at(distance)) * left * (proxy.depth() / density / SAMPLES as f32);
                nearest = nearest.min(distance);
            }
            if radiance != Rgb::ZERO {
                let (p, light) = (origin + direction * nearest, self.throughput * span.left * radiance);
                let light = MediumLight { instance, p, light, depth: self.depth };
                self.visitor.medium_light(&light, self.scattered);
            }
        }
        Passage::Left(ray.transmittance(sigma_t, span.distance, &mut random))
    }
}
