//! Photons gathered at a vertex, eight at a time.

use super::eye::MAX_LEVELS;
use crate::bsdf::{Gathering, LobeSet, Shading};
use crate::math::{Rgb, Vec3A};
use crate::photon::{Near, Photon, PhotonFlags};
use bumpalo::Bump;
use wide::f32x8;

/// What a worker keeps from eye path to eye path of one pass.
#[derive(Default)]
pub struct Scratch {
    /// What the vertices of a path need.
    pub(super) arena: Bump,
    /// Photons near the last vertices.
    pub(super) near: Near<Photon>,
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
            bins: [[Vec3A::ZERO; MAX_LEVELS]; 2],
        }
    }

    /// Adds a photon at a distance squared below the largest radius squared.
    #[inline]
    pub fn push(&mut self, photon: &Photon, distance2: f32) {
        let mut level = 0;
        for &radius2 in &self.radii[..self.radii.len() - 1] {
            level += usize::from(distance2 >= radius2);
        }
        let caustic = usize::from(photon.flags.has(PhotonFlags::CAUSTIC));
        if let (Some(gathering), true) = (&self.unreachable, photon.flags.has(PhotonFlags::UNREACHABLE)) {
            self.bins[caustic][level] += Vec3A::from(gathering.photon(photon.wi) * photon.flux);
            return;
        }
        let at = self.count;
        for axis in 0..3 {
            self.wi[axis][at] = photon.wi[axis];
            self.flux[axis][at] = photon.flux[axis];
        }
        self.bin[at] = (caustic * MAX_LEVELS + level) as u8;
        self.count += 1;
        if self.count == 8 {
            self.flush();
        }
    }

    #[inline(never)]
    fn flush(&mut self) {
        let f = self.gathering.eight(self.wi.map(f32x8::from));
        let light: [[f32; 8]; 3] = std::array::from_fn(|c| (f[c] * f32x8::from(self.flux[c])).to_array());
        for (k, &bin) in self.bin[..self.count].iter().enumerate() {
            let bin = usize::from(bin);
            self.bins[bin / MAX_LEVELS][bin % MAX_LEVELS] += Vec3A::new(light[0][k], light[1][k], light[2][k]);
        }
        self.count = 0;
    }

    /// The sums.
    #[inline]
    pub fn finish(mut self) -> [[Rgb; MAX_LEVELS]; 2] {
        if self.count > 0 {
            self.flush();
        }
        self.bins.map(|levels| levels.map(Rgb::from))
    }
}
