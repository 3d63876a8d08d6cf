//! Photons at the first vertex of a camera path, divided among its diffuse, glossy and transmitting lobes.

use crate::bsdf::{LobeSet, Shading, Transport};
use crate::math::Rgb;
use crate::photon::{Kernel, Photon, PhotonFlags};

/// Sums over photons of the light that diffuse and transmitting lobes scatter, at one bandwidth.
pub(in crate::transport) struct LobeGather<'a> {
    kernel: Kernel,
    shading: &'a Shading<'a>,
    /// Squared bandwidth of the kernel (square scene units).
    bandwidth2: f32,
    /// Lobes for most photons, and for photons whose light no continued path could find.
    sets: [LobeSet; 2],
    diffuse: Rgb,
    transmitted: Rgb,
}

impl<'a> LobeGather<'a> {
    pub fn new(kernel: Kernel, shading: &'a Shading<'a>, bandwidth2: f32, sets: [LobeSet; 2]) -> LobeGather<'a> {
        LobeGather { kernel, shading, bandwidth2, sets, diffuse: Rgb::ZERO, transmitted: Rgb::ZERO }
    }

    /// Adds a photon at this squared distance.
    #[inline(never)]
    pub fn push(&mut self, photon: &Photon, distance2: f32) {
        if distance2 >= self.bandwidth2 {
            return;
        }
        let set = self.sets[usize::from(photon.flags == PhotonFlags::UNREACHABLE)];
        let value = self.shading.gather(photon.wi, photon.cosine(), set);
        if value == Rgb::ZERO {
            return;
        }
        let light = value * photon.flux * self.kernel.weight(distance2 / self.bandwidth2);
        let whole = self.shading.eval_cos(photon.wi, Transport::Radiance, set);
        let [diffuse, _, transmitted] = self.shading.lobe_shares(photon.wi, Transport::Radiance, set, whole);
        self.diffuse += light * diffuse;
        self.transmitted += light * transmitted;
    }

    /// The light `all` of the photons, divided among diffuse, glossy and transmitting lobes.
    pub fn divide(&self, all: Rgb) -> [Rgb; 3] {
        let diffuse = self.diffuse.min(all);
        let transmitted = self.transmitted.min(all - diffuse);
        [diffuse, all - diffuse - transmitted, transmitted]
    }
}
