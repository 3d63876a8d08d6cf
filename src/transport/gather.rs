//! Photons gathered at a vertex, eight at a time.

use super::eye::{Bandwidths, MAX_LEVELS};
use crate::bsdf::{Gathering, LobeSet, Shading};
use crate::math::{Rgb, Vec3, Vec3A};
use crate::photon::{Near, Photon, PhotonFlags, VolumePhoton};
use bumpalo::Bump;
use wide::f32x8;

/// What a worker keeps from eye path to eye path of one pass.
#[derive(Default)]
pub struct Scratch {
    /// What the vertices of a path need.
    pub(super) arena: Bump,
    /// Photons near the last vertices.
    pub(super) near: Near<Photon>,
    /// Photons in media near the last vertices there.
    pub(super) near_volume: Near<VolumePhoton>,
}

/// Photons waiting for their BSDF, and the sums of those that have had it: by kind (other, caustic) and by the smallest level that holds
/// them.
pub(super) struct Batch<'a> {
    radii: &'a [f32],
    gathering: Gathering<'a>,
    /// For photons that no eye path that goes on could find; `None` where it is the same.
    unreachable: Option<Gathering<'a>>,
    count: usize,
    wi: [[f32; 8]; 3],
    flux: [[f32; 8]; 3],
    bin: [u8; 8],
    /// For those who count: where they are from the gathering point, and their distance squared.
    place: [(Vec3, f32); 8],
    bins: [[Vec3A; MAX_LEVELS]; 2],
}

impl<'a> Batch<'a> {
    /// Radii squared, ascending; `set` are the lobes that see photons, `all` those that see the ones nothing else finds.
    #[inline]
    pub fn new(radii: &'a [f32], shading: &'a Shading<'a>, set: LobeSet, all: LobeSet) -> Batch<'a> {
        Batch {
            radii,
            gathering: shading.gathering(set),
            unreachable: (set != all).then(|| shading.gathering(all)),
            count: 0,
            wi: [[0.0; 8]; 3],
            flux: [[0.0; 8]; 3],
            bin: [0; 8],
            place: [(Vec3::ZERO, 0.0); 8],
            bins: [[Vec3A::ZERO; MAX_LEVELS]; 2],
        }
    }

    /// Adds a photon at a distance squared below the largest radius squared from `p`.
    #[inline]
    pub fn push<B: Bandwidths>(&mut self, photon: &Photon, p: Vec3, distance2: f32, counter: &mut B) {
        let mut level = 0;
        for &radius2 in &self.radii[..self.radii.len() - 1] {
            level += usize::from(distance2 >= radius2);
        }
        let caustic = usize::from(photon.flags.has(PhotonFlags::CAUSTIC));
        if let (Some(gathering), true) = (&self.unreachable, photon.flags.has(PhotonFlags::UNREACHABLE)) {
            let light = gathering.photon(photon.wi) * photon.flux;
            self.bins[caustic][level] += Vec3A::from(light);
            if B::COUNTS && light != Rgb::ZERO {
                counter.count(photon.p - p, distance2);
            }
            return;
        }
        let at = self.count;
        for axis in 0..3 {
            self.wi[axis][at] = photon.wi[axis];
            self.flux[axis][at] = photon.flux[axis];
        }
        self.bin[at] = (caustic * MAX_LEVELS + level) as u8;
        if B::COUNTS {
            self.place[at] = (photon.p - p, distance2);
        }
        self.count += 1;
        if self.count == 8 {
            self.flush(counter);
        }
    }

    #[inline(never)]
    fn flush<B: Bandwidths>(&mut self, counter: &mut B) {
        let f = self.gathering.eight(self.wi.map(f32x8::from));
        let light: [[f32; 8]; 3] = std::array::from_fn(|c| (f[c] * f32x8::from(self.flux[c])).to_array());
        for (k, &bin) in self.bin[..self.count].iter().enumerate() {
            let bin = usize::from(bin);
            let light = Vec3A::new(light[0][k], light[1][k], light[2][k]);
            self.bins[bin / MAX_LEVELS][bin % MAX_LEVELS] += light;
            // Photons that bring nothing are not there [CPPM 2020, 7.2].
            if B::COUNTS && light != Vec3A::ZERO {
                counter.count(self.place[k].0, self.place[k].1);
            }
        }
        self.count = 0;
    }

    /// The sums.
    #[inline]
    pub fn finish<B: Bandwidths>(mut self, counter: &mut B) -> [[Rgb; MAX_LEVELS]; 2] {
        if self.count > 0 {
            self.flush(counter);
        }
        self.bins.map(|levels| levels.map(Rgb::from))
    }
}
