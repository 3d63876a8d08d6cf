//! Evaluation of the BSDF for photons at a vertex, eight at a time.

use super::bandwidths::{FoundPhotons, PhotonCounter, first_lane};
use crate::bsdf::{Gathering, LobeSet};
use crate::math::{Rgb, Vec3};
use crate::photon::{ByKind, Kernel, Near, Photon, PhotonFlags, VolumePhoton};
use crate::transport::walk::lobe_layers::LobeRecord;
use crate::transport::walk::pixel_sample::MAX_LEVELS;
use crate::transport::walk::vertex::Vertex;
use bumpalo::Bump;
use wide::{CmpEq, CmpLt, f32x8};

/// Memory that a thread reuses for all camera paths of one iteration.
#[derive(Default)]
pub struct Scratch {
    /// Memory for the shading data of the vertices of a path.
    pub(in crate::transport) arena: Bump,
    /// Cache of the photons on surfaces around the last vertices, by kind.
    pub(in crate::transport) near: ByKind<Near<Photon>>,
    /// Cache of the photons in media around the last vertices.
    pub(in crate::transport) near_volume: Near<VolumePhoton>,
    /// Photons that have been found and whose BSDF is not evaluated yet.
    pub(in crate::transport) waiting: Waiting,
    /// Light of the last camera path by the lobe of the first hit, if that is recorded.
    pub lobes: LobeRecord,
}

/// Photons whose BSDF is not evaluated yet; eight are evaluated at once. They are stored as rows, which takes two
/// stores each; shuffles make columns of eight rows.
#[derive(Default)]
pub(in crate::transport) struct Waiting {
    photons: [Photon; 8],
    count: usize,
}

impl Waiting {
    #[inline(always)]
    fn push(&mut self, photon: &Photon) {
        self.photons[self.count] = *photon;
        self.count += 1;
    }

    /// Positions, directions, normals and fluxes of the eight photons, by component.
    #[inline(always)]
    fn columns(&self) -> [[f32x8; 3]; 4] {
        let photons = self.photons.each_ref();
        let rows = photons.map(|Photon { p, wi, ng, .. }| [p.x, p.y, p.z, wi.x, wi.y, wi.z, ng.x, ng.y]);
        let [px, py, pz, wx, wy, wz, nx, ny] = f32x8::transpose(rows.map(f32x8::from));
        // The last four values (normal z and flux) are the second half of a row of eight, which is one load.
        let rows = photons.map(|Photon { wi, ng, flux, .. }| [wi.y, wi.z, ng.x, ng.y, ng.z, flux.x, flux.y, flux.z]);
        let [.., nz, red, green, blue] = f32x8::transpose(rows.map(f32x8::from));
        [[px, py, pz], [wx, wy, wz], [nx, ny, nz], [red, green, blue]]
    }
}

/// Numbers of the eight SIMD lanes.
const LANES: f32x8 = f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// Eight dot products, summed in the order of `Vec3::dot`.
#[inline(always)]
fn dot(a: &[f32x8; 3], b: &[f32x8; 3]) -> f32x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Photons of one kind that wait for their BSDF at a vertex, and the sums of the evaluated ones.
pub(in crate::transport) struct Batch<'a, 's> {
    kernel: Kernel,
    bandwidths: &'s [f32],
    p: Vec3,
    throughput: Rgb,
    gathering: Gathering<'a>,
    /// BSDF for photons whose light no continued camera path could find; `None` if it is that of `gathering`.
    unreachable: Option<Gathering<'a>>,
    waiting: &'s mut Waiting,
    /// Sums of light by bandwidth level; each lane sums every eighth photon.
    sums: [[f32x8; 3]; MAX_LEVELS],
}

impl<'a, 's> Batch<'a, 's> {
    /// `bandwidths` are squared and ascending. Photons are evaluated with the lobes of `set`, those that no continued path
    /// could find with the lobes of `all`.
    #[inline]
    pub fn new(
        kernel: Kernel,
        bandwidths: &'s [f32],
        waiting: &'s mut Waiting,
        vertex: &Vertex<'a, '_>,
        set: LobeSet,
        all: LobeSet,
    ) -> Batch<'a, 's> {
        let shading = vertex.shading;
        Batch {
            kernel,
            bandwidths,
            p: vertex.surface.p,
            throughput: vertex.throughput,
            gathering: shading.gathering(set),
            unreachable: (set != all).then(|| shading.gathering(all)),
            waiting,
            sums: [[f32x8::ZERO; 3]; MAX_LEVELS],
        }
    }

    /// Adds a photon within reach, at this squared distance.
    #[inline(always)]
    pub fn push<C: PhotonCounter>(&mut self, photon: &Photon, distance2: f32, counter: &mut C) {
        if photon.flags == PhotonFlags::UNREACHABLE && self.unreachable.is_some() {
            return self.push_unreachable(photon, distance2, counter);
        }
        self.waiting.push(photon);
        if self.waiting.count == 8 {
            self.flush(counter);
        }
    }

    /// Adds a photon that no continued camera path could find. There are few of them, so they are not batched.
    #[inline(never)]
    fn push_unreachable<C: PhotonCounter>(&mut self, photon: &Photon, distance2: f32, counter: &mut C) {
        let Some(gathering) = &self.unreachable else { return };
        let light = gathering.photon(photon.wi, photon.cosine()) * photon.flux;
        let found = FoundPhotons::one(
            photon.p - self.p,
            distance2,
            (light * self.throughput).element_sum() / 3.0,
            photon.thinning_key,
        );
        self.add::<C>(&light.to_array().map(|light| first_lane(light, 0.0)), found.distance2);
        if C::COUNTS && light != Rgb::ZERO {
            counter.count(&found);
        }
    }

    #[inline(never)]
    fn flush<C: PhotonCounter>(&mut self, counter: &mut C) {
        let [p, wi, ng, flux] = self.waiting.columns();
        let there = LANES.cmp_lt(f32x8::splat(self.waiting.count as f32));
        let from = self.p.to_array().map(f32x8::splat);
        let offset = [p[0] - from[0], p[1] - from[1], p[2] - from[2]];
        // In the order of operations of the map's query.
        let distance2 = there.blend(dot(&offset, &offset), f32x8::splat(f32::INFINITY));
        // Unused lanes hold stale photons; a zero cosine makes them contribute nothing.
        let cosine = there & dot(&wi, &ng).abs();
        let f = self.gathering.photons8(wi, cosine);
        let found = [f[0] * flux[0], f[1] * flux[1], f[2] * flux[2]];
        self.add::<C>(&found, distance2);
        if C::COUNTS {
            let weight = self.throughput.to_array().map(f32x8::splat);
            let light = found[0].mul_add(weight[0], found[1].mul_add(weight[1], found[2] * weight[2]));
            // Photons without contribution are not counted [CPPM 2020, 7.2].
            let dark = light.cmp_eq(f32x8::ZERO);
            counter.count(&FoundPhotons {
                offset,
                distance2: dark.blend(f32x8::splat(f32::INFINITY), distance2),
                light: light * (1.0 / 3.0),
                thinning_keys: if C::NEEDS_THINNING_KEYS {
                    self.waiting.photons.map(|photon| photon.thinning_key.bits())
                } else {
                    [0; 8]
                },
            });
        }
        self.waiting.count = 0;
    }

    /// Adds the light of eight photons to each bandwidth level whose bandwidth exceeds their distance.
    #[inline(always)]
    fn add<C: PhotonCounter>(&mut self, light: &[f32x8; 3], distance2: f32x8) {
        // With one level, each photon within reach is within its bandwidth.
        if self.kernel == Kernel::Box && !C::BEYOND && self.bandwidths.len() == 1 {
            self.sums[0].iter_mut().zip(light).for_each(|(sum, light)| *sum += *light);
            return;
        }
        for (sums, &bandwidth2) in self.sums.iter_mut().zip(self.bandwidths) {
            let within = distance2.cmp_lt(f32x8::splat(bandwidth2));
            let weight = match self.kernel {
                Kernel::Box => f32x8::ONE,
                kernel => f32x8::from((distance2 / bandwidth2).to_array().map(|s| kernel.weight(s))),
            };
            for (sum, light) in sums.iter_mut().zip(light) {
                // Unused lanes are infinitely far away, where the product is NaN, so the mask comes last.
                *sum += within & (*light * weight);
            }
        }
    }

    /// Evaluates the waiting photons and returns the sums of light by bandwidth level.
    #[inline]
    pub fn finish<C: PhotonCounter>(&mut self, counter: &mut C) -> [Rgb; MAX_LEVELS] {
        if self.waiting.count > 0 {
            self.flush(counter);
        }
        self.sums.map(|sums| Rgb::from(sums.map(f32x8::reduce_add)))
    }
}
