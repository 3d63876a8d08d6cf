//! Photons gathered at a vertex, eight at a time.

use super::bandwidths::{Bandwidths, Found, MAX_LEVELS};
use super::walk::Vertex;
use crate::bsdf::{Gathering, LobeSet};
use crate::math::{Rgb, Vec3, Vec3A};
use crate::photon::{ByKind, Kernel, Near, Photon, PhotonFlags, VolumePhoton};
use bumpalo::Bump;
use wide::{CmpEq, f32x8};

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

/// One bin per level, and one for those beyond the largest bandwidth, which are only counted.
const BINS: usize = MAX_LEVELS + 1;

/// Photons of one kind waiting for their BSDF, and the sums of those that have had it. With the box kernel a photon is in the bin of
/// the smallest level that holds it, and levels are sums of bins; with others it has its weight in every level.
pub(super) struct Batch<'a, K> {
    kernel: std::marker::PhantomData<K>,
    radii: &'a [f32],
    p: Vec3,
    throughput: Rgb,
    gathering: Gathering<'a>,
    /// For photons that no eye path that goes on could find; `None` where it is the same.
    unreachable: Option<Gathering<'a>>,
    count: usize,
    wi: [[f32; 8]; 3],
    cosine: [f32; 8],
    flux: [[f32; 8]; 3],
    bin: [u8; 8],
    /// For those who count: where they are from the gathering point.
    offset: [[f32; 8]; 3],
    /// For those and for kernels: their distance squared.
    distance2: [f32; 8],
    bins: [Vec3A; BINS],
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
            wi: [[0.0; 8]; 3],
            cosine: [0.0; 8],
            flux: [[0.0; 8]; 3],
            bin: [0; 8],
            offset: [[0.0; 8]; 3],
            distance2: [f32::INFINITY; 8],
            bins: [Vec3A::ZERO; BINS],
        }
    }

    /// Adds a photon at a distance squared within reach.
    #[inline(always)]
    pub fn push<B: Bandwidths>(&mut self, photon: &Photon, distance2: f32, counter: &mut B) {
        let mut level = 0;
        let last = self.radii.len() - usize::from(!B::BEYOND);
        for &radius2 in &self.radii[..last] {
            level += usize::from(distance2 >= radius2);
        }
        if photon.flags.has(PhotonFlags::UNREACHABLE) && self.unreachable.is_some() {
            return self.push_unreachable(photon, level, distance2, counter);
        }
        let at = self.count;
        for axis in 0..3 {
            self.wi[axis][at] = photon.wi[axis];
            self.flux[axis][at] = photon.flux[axis];
        }
        self.cosine[at] = photon.cosine();
        self.bin[at] = level as u8;
        if B::COUNTS {
            for axis in 0..3 {
                self.offset[axis][at] = photon.p[axis] - self.p[axis];
            }
        }
        if B::COUNTS || !K::BOX {
            self.distance2[at] = distance2;
        }
        self.count += 1;
        if self.count == 8 {
            self.flush(counter);
        }
    }

    /// Adds a photon that no eye path could find: few, and out of the way of the others.
    #[inline(never)]
    fn push_unreachable<B: Bandwidths>(&mut self, photon: &Photon, level: usize, distance2: f32, counter: &mut B) {
        let Some(gathering) = &self.unreachable else { return };
        let light = gathering.photon(photon.wi, photon.cosine()) * photon.flux;
        self.add(level, light.into(), distance2);
        if B::COUNTS && light != Rgb::ZERO {
            let light = (light * self.throughput).element_sum() / 3.0;
            counter.count(&Found::one(photon.p - self.p, distance2, light));
        }
    }

    #[inline(never)]
    fn flush<B: Bandwidths>(&mut self, counter: &mut B) {
        let f = self.gathering.eight(self.wi.map(f32x8::from), f32x8::from(self.cosine));
        let found: [f32x8; 3] = std::array::from_fn(|c| f[c] * f32x8::from(self.flux[c]));
        let [r, g, b] = found.map(f32x8::to_array);
        for k in 0..self.count {
            self.add(usize::from(self.bin[k]), Vec3A::new(r[k], g[k], b[k]), self.distance2[k]);
        }
        if B::COUNTS {
            // What is left of the last eight is not there, nor are photons that bring nothing [CPPM 2020, 7.2].
            self.distance2[self.count..].fill(f32::INFINITY);
            let light = found[0] * self.throughput.x + found[1] * self.throughput.y + found[2] * self.throughput.z;
            let dark = light.cmp_eq(f32x8::ZERO);
            counter.count(&Found {
                offset: self.offset.map(f32x8::from),
                distance2: dark.blend(f32x8::splat(f32::INFINITY), f32x8::from(self.distance2)),
                light: light * (1.0 / 3.0),
            });
        }
        self.count = 0;
    }

    /// Adds what a photon brings to the levels that hold it.
    #[inline(always)]
    fn add(&mut self, level: usize, light: Vec3A, distance2: f32) {
        if K::BOX {
            self.bins[level] += light;
        } else {
            for (bin, radius2) in self.bins.iter_mut().zip(self.radii).skip(level) {
                *bin += light * K::weight(distance2 / radius2);
            }
        }
    }

    /// The sums by level.
    #[inline]
    pub fn finish<B: Bandwidths>(&mut self, counter: &mut B) -> [Rgb; BINS] {
        if self.count > 0 {
            self.flush(counter);
        }
        if K::BOX {
            for level in 1..self.radii.len() {
                let within = self.bins[level - 1];
                self.bins[level] += within;
            }
        }
        self.bins.map(Rgb::from)
    }
}
