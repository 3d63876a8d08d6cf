//! Photons gathered at a vertex, eight at a time.

use super::bandwidths::{Bandwidths, Found, MAX_LEVELS, lane};
use super::walk::Vertex;
use crate::bsdf::{Gathering, LobeSet};
use crate::math::{Rgb, Vec3};
use crate::photon::{ByKind, Kernel, Near, Photon, PhotonFlags, VolumePhoton};
use bumpalo::Bump;
use wide::{CmpEq, CmpLt, f32x8};

/// What a worker keeps from eye path to eye path of one pass.
#[derive(Default)]
pub struct Scratch {
    /// What the vertices of a path need.
    pub(super) arena: Bump,
    /// Photons near the last vertices.
    pub(super) near: ByKind<Near<Photon>>,
    /// Photons in media near the last vertices there.
    pub(super) near_volume: Near<VolumePhoton>,
}

/// A photon that is waiting: the direction of its light, its cosine, its flux, and how far it is from the gathering point, squared.
type Row = [f32; 8];

/// In the place of a photon that is not there: it has no cosine, so it brings nothing.
const ABSENT: Row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY];

/// Photons of one kind waiting for their BSDF, and the sums of those that have had it.
pub(super) struct Batch<'a, K> {
    kernel: std::marker::PhantomData<K>,
    radii: &'a [f32],
    p: Vec3,
    throughput: Rgb,
    gathering: Gathering<'a>,
    /// For photons that no eye path that goes on could find; `None` where it is the same.
    unreachable: Option<Gathering<'a>>,
    count: usize,
    rows: [Row; 8],
    /// For those who count: where they are from the gathering point.
    offset: [[f32; 8]; 3],
    /// And, for those who ask for them, their marks.
    marks: [u32; 8],
    /// By level, of every eighth photon.
    sums: [[f32x8; 3]; MAX_LEVELS],
}

impl<'a, K: Kernel> Batch<'a, K> {
    /// Radii squared, ascending; `set` are the lobes that see photons, `all` those that see the ones nothing else finds.
    #[inline]
    pub fn new(_: K, radii: &'a [f32], vertex: &Vertex<'a, '_>, set: LobeSet, all: LobeSet) -> Batch<'a, K> {
        let shading = vertex.shading;
        Batch {
            kernel: std::marker::PhantomData,
            radii,
            p: vertex.surface.p,
            throughput: vertex.throughput,
            gathering: shading.gathering(set),
            unreachable: (set != all).then(|| shading.gathering(all)),
            count: 0,
            rows: [ABSENT; 8],
            offset: [[0.0; 8]; 3],
            marks: [0; 8],
            sums: [[f32x8::ZERO; 3]; MAX_LEVELS],
        }
    }

    /// Adds a photon at a distance squared within reach.
    #[inline(always)]
    pub fn push<B: Bandwidths>(&mut self, photon: &Photon, distance2: f32, counter: &mut B) {
        if photon.flags.has(PhotonFlags::UNREACHABLE) && self.unreachable.is_some() {
            return self.push_unreachable(photon, distance2, counter);
        }
        let at = self.count;
        let Photon { wi, flux, .. } = photon;
        self.rows[at] = [wi.x, wi.y, wi.z, photon.cosine(), flux.x, flux.y, flux.z, distance2];
        if B::COUNTS {
            for axis in 0..3 {
                self.offset[axis][at] = photon.p[axis] - self.p[axis];
            }
        }
        if B::MARKS {
            self.marks[at] = photon.mark.bits();
        }
        self.count += 1;
        if self.count == 8 {
            self.flush(counter);
        }
    }

    /// Adds a photon that no eye path could find: few, and out of the way of the others.
    #[inline(never)]
    fn push_unreachable<B: Bandwidths>(&mut self, photon: &Photon, distance2: f32, counter: &mut B) {
        let Some(gathering) = &self.unreachable else { return };
        let light = gathering.photon(photon.wi, photon.cosine()) * photon.flux;
        let found =
            Found::one(photon.p - self.p, distance2, (light * self.throughput).element_sum() / 3.0, photon.mark);
        self.add::<B>(&light.to_array().map(|light| lane(light, 0.0)), found.distance2);
        if B::COUNTS && light != Rgb::ZERO {
            counter.count(&found);
        }
    }

    #[inline(never)]
    fn flush<B: Bandwidths>(&mut self, counter: &mut B) {
        let [x, y, z, cosine, red, green, blue, distance2] = f32x8::transpose(self.rows.map(f32x8::from));
        let f = self.gathering.eight([x, y, z], cosine);
        let found = [f[0] * red, f[1] * green, f[2] * blue];
        self.add::<B>(&found, distance2);
        if B::COUNTS {
            let weight = self.throughput.to_array().map(f32x8::splat);
            let light = found[0].mul_add(weight[0], found[1].mul_add(weight[1], found[2] * weight[2]));
            // Photons that bring nothing do not count [CPPM 2020, 7.2].
            let dark = light.cmp_eq(f32x8::ZERO);
            counter.count(&Found {
                offset: self.offset.map(f32x8::from),
                distance2: dark.blend(f32x8::splat(f32::INFINITY), distance2),
                light: light * (1.0 / 3.0),
                marks: self.marks,
            });
        }
        self.count = 0;
    }

    /// Adds what photons bring to the levels that hold them.
    #[inline(always)]
    fn add<B: Bandwidths>(&mut self, light: &[f32x8; 3], distance2: f32x8) {
        // What is within reach is within the largest.
        if K::BOX && !B::BEYOND && self.radii.len() == 1 {
            self.sums[0].iter_mut().zip(light).for_each(|(sum, light)| *sum += *light);
            return;
        }
        for (sums, &radius2) in self.sums.iter_mut().zip(self.radii) {
            let within = distance2.cmp_lt(f32x8::splat(radius2));
            let weight = if K::BOX { f32x8::ONE } else { f32x8::from((distance2 / radius2).to_array().map(K::weight)) };
            for (sum, light) in sums.iter_mut().zip(light) {
                // What is not there is infinitely far away, and its product not a number: masked last.
                *sum += within & if K::BOX { *light } else { *light * weight };
            }
        }
    }

    /// The sums by level.
    #[inline]
    pub fn finish<B: Bandwidths>(&mut self, counter: &mut B) -> [Rgb; MAX_LEVELS] {
        if self.count > 0 {
            self.rows[self.count..].fill(ABSENT);
            self.flush(counter);
        }
        self.sums.map(|sums| Rgb::from(sums.map(f32x8::reduce_add)))
    }
}
