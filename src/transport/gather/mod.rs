//! Kernel density estimation at a vertex of a camera path: photons on surfaces, all levels of a kind from one query.

pub(in crate::transport) mod bandwidths;
pub(in crate::transport) mod boundary_kernel;
pub(in crate::transport) mod gathering_walk;
pub(in crate::transport) mod glint;
pub(in crate::transport) mod lobe_gather;
pub(in crate::transport) mod photon_batch;
pub(in crate::transport) mod volume;

use crate::bsdf::LobeSet;
use crate::math::Rgb;
use crate::path_class::{Event, LightPrefix, Part};
use crate::photon::{Kind, Near, Photon, PhotonMap};
use crate::spectrum::Wavelength;
use crate::transport::walk::cause::Cause;
use crate::transport::walk::interior::Presence;
use crate::transport::walk::lobe_layers::FirstScatter;
use crate::transport::walk::vertex::Vertex;
use bandwidths::{FoundPhotons, GatherBandwidths, PhotonCounter};
use gathering_walk::GatheringWalk;
use glint::{GlintGather, Onward};
use lobe_gather::LobeGather;
use photon_batch::Batch;
use std::f32::consts::FRAC_1_PI;

impl<B: GatherBandwidths> GatheringWalk<'_, B> {
    /// Adds radiance from the photons around a vertex \[post-reconstruction 2021, (2) and (3)\]: for the lobes in
    /// `broad`, and for those in `onward` where photons share light with the continued path.
    #[inline]
    pub fn gather(&mut self, vertex: &Vertex<'_, '_>, broad: LobeSet, onward: Onward) {
        // Light of a delta light at sharp lobes belongs to the class of broad ones.
        let suffix = self.suffix.then(Event::Broad);
        let frame = B::frame(vertex.surface.ng);
        for (kind, prefix) in [(Kind::Indirect, LightPrefix::SCATTERED), (Kind::Caustic, LightPrefix::FOCUSED)] {
            let class = suffix.class_with(prefix);
            let photons = &self.photons[kind as usize];
            // Even an empty map takes its share of the light: the weights of continued paths count it.
            let shares = onward.lobes.intersects(LobeSet::SHARP) && photons.paths() > 0;
            if (photons.photons().is_empty() && !shares) || !self.classes.has(class) {
                continue;
            }
            // Caustics that surfaces scatter again before the camera sees them are indirect light.
            let caustic = kind == Kind::Caustic && (!self.paths || class.part() == Part::Caustic);
            self.gather_kind(kind, caustic, vertex, &frame, broad, onward);
        }
    }

    // Compiled once for both kinds and all callers, because it is by far the largest function here.
    #[inline(never)]
    fn gather_kind(
        &mut self,
        kind: Kind,
        caustic: bool,
        vertex: &Vertex<'_, '_>,
        frame: &B::Frame,
        broad: LobeSet,
        onward: Onward,
    ) {
        let (p, ng) = (vertex.surface.p, vertex.surface.ng);
        let photons = &self.photons[kind as usize];
        let mut bandwidths = self.bandwidths.levels(kind, photons, p, ng, self.length);
        if self.paths && self.scattered_broadly {
            let largest2 = bandwidths.bandwidth2[bandwidths.count.saturating_sub(1)];
            let factor = (bandwidths.indirect_cap2 / largest2).min(1.0);
            bandwidths.bandwidth2.iter_mut().for_each(|bandwidth2| *bandwidth2 *= factor);
        }
        let sharp = onward.lobes & LobeSet::SHARP;
        let shared = kind == Kind::Caustic
            && !sharp.is_empty()
            && self.classes.has(self.suffix.then(Event::Sharp).class_with(LightPrefix::FOCUSED));
        let mut glints =
            shared.then(|| self.glints.gather(self.kernel, vertex.shading, ng, onward, &bandwidths, photons));
        let (order, bandwidths) = (bandwidths.order, &bandwidths.bandwidth2[..bandwidths.count]);
        // Index of the bandwidth whose light is recorded by the lobe of the first hit.
        let recorded = self.record.as_ref().and_then(|lobes| lobes.level);
        let recorded =
            recorded.and_then(|level| order[..bandwidths.len()].iter().position(|k| usize::from(*k) == level));
        let divided = recorded.filter(|_| self.divides());
        if let Some(glints) = &mut glints {
            glints.divide(divided);
        }
        let mut lobe_gather =
            divided.map(|k| LobeGather::new(self.kernel, vertex.shading, bandwidths[k], [broad, broad | sharp]));
        let Some(&largest) = bandwidths.last() else { return };
        let longest = self.max_depth - vertex.depth;
        let mut counter = self.bandwidths.counter(kind, frame);
        let reach2 = counter.reach2(largest);
        // Bandwidth rules count the photons that broad lobes see. Metal has no broad lobes, so glints count there.
        let counts = <B::Counter<'_> as PhotonCounter>::COUNTS && broad.is_empty();
        if let Some(glints) = glints.as_mut().filter(|_| counts) {
            glints.extend_reach(reach2);
        }
        let mut batch = Batch::new(self.kernel, bandwidths, self.waiting, vertex, broad, broad | sharp);
        let Presence { absent, .. } = vertex.presence(self.scene);
        let near = &mut self.near[kind as usize];
        let push = |photon: &Photon, distance2| {
            if u32::from(photon.depth) <= longest && photon.tag.absent() == absent {
                if let Some(glints) = &mut glints {
                    let light = glints.push(photon, distance2);
                    if counts && light != Rgb::ZERO {
                        let light = (light * vertex.throughput).element_sum() / 3.0;
                        counter.count(&FoundPhotons::one(photon.p - p, distance2, light, photon.thinning_key));
                    }
                }
                if let Some(lobe_gather) = &mut lobe_gather {
                    lobe_gather.push(photon, distance2);
                }
                batch.push(photon, distance2, &mut counter);
            }
        };
        match &vertex.wavelength {
            None => photons.gather(near, p, ng, reach2, push),
            Some(wavelength) => gather_dispersed(photons, near, vertex, wavelength, reach2, push),
        }
        let sums = batch.finish(&mut counter);
        drop(counter);
        if let Some(k) = recorded {
            let glint = glints.as_ref().map_or([Rgb::ZERO; 2], |glints| [glints.sums()[k], glints.transmitted()]);
            let scale = FRAC_1_PI / bandwidths[k];
            if let Some(lobe_gather) = &lobe_gather {
                let [diffuse, glossy, transmitted] = lobe_gather.divide(sums[k]).map(|sum| sum * scale);
                let by_lobe = [diffuse, glossy + glint[0] - glint[1], transmitted + glint[1]];
                if let Some(lobes) = &mut self.record {
                    lobes.photons.add(&FirstScatter::Surface(by_lobe), false, vertex.throughput);
                }
            } else {
                self.record_indirect(vertex.throughput * (sums[k] * scale + glint[0]), true);
            }
        }
        let into = if caustic { &mut self.sample.caustic_photons } else { &mut self.sample.indirect_photons };
        let mut finite = true;
        for ((level, sum), bandwidth2) in order.into_iter().zip(sums).zip(bandwidths) {
            let light = vertex.throughput * (FRAC_1_PI / bandwidth2) * sum;
            finite &= light.is_finite();
            into[usize::from(level)] += light;
        }
        for (level, sum) in order.into_iter().zip(glints.into_iter().flat_map(GlintGather::finish)) {
            let light = vertex.throughput * sum;
            finite &= light.is_finite();
            self.sample.indirect_photons[usize::from(level)] += light;
        }
        if !finite {
            self.sample.reject(Cause::Photons);
        }
    }
}

/// Visits the photons around a vertex whose path has a wavelength: photons with a compatible wavelength, with their
/// flux weighted. Not inlined, so that the common case stays small.
#[inline(never)]
fn gather_dispersed(
    photons: &PhotonMap,
    near: &mut Near<Photon>,
    vertex: &Vertex<'_, '_>,
    wavelength: &Wavelength,
    reach2: f32,
    mut push: impl FnMut(&Photon, f32),
) {
    photons.gather(near, vertex.surface.p, vertex.surface.ng, reach2, |photon, distance2| {
        if let Some(weight) = wavelength.connection_factor(photon.tag.band()) {
            push(&Photon { flux: photon.flux * weight, ..*photon }, distance2);
        }
    });
}
