//! Light by the lobe of the first hit and by the number of bounces, as compositors know it from Cycles: diffuse, glossy and
//! transmitted light, each direct and indirect.
//!
//! The first vertex of a camera path divides the light of the path among its lobes. Light that arrives at this vertex by a
//! known direction is divided in proportion to the values of the lobes for this direction. A path that continues keeps the
//! shares of the direction in which it continues. So the layers are exact, and sum to the picture in every channel.

use super::vertex::Vertex;
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::math::Rgb;

/// A layer of light by the lobe of the first hit and by the number of bounces. The layers add up to the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeLayer {
    /// Lights with a surface that the camera sees directly.
    Emit,
    /// Environment and suns that the camera sees directly.
    Environment,
    /// Light that a diffuse lobe scatters to the camera, straight from a light.
    DiffuseDirect,
    /// Light that a diffuse lobe scatters to the camera after other bounces.
    DiffuseIndirect,
    /// Light that mirrors and glossy lobes reflect to the camera, straight from a light.
    GlossyDirect,
    /// Light that mirrors and glossy lobes reflect to the camera after other bounces.
    GlossyIndirect,
    /// Light that glass transmits to the camera, straight from a light.
    TransmissionDirect,
    /// Light that glass transmits to the camera after other bounces.
    TransmissionIndirect,
    /// Light that a medium scatters to the camera, straight from a light.
    VolumeDirect,
    /// Light that a medium scatters to the camera after other bounces.
    VolumeIndirect,
}

impl LobeLayer {
    /// All layers, in the order of [`LobeLight::layers`].
    pub const ALL: [LobeLayer; 10] = [
        LobeLayer::Emit,
        LobeLayer::Environment,
        LobeLayer::DiffuseDirect,
        LobeLayer::DiffuseIndirect,
        LobeLayer::GlossyDirect,
        LobeLayer::GlossyIndirect,
        LobeLayer::TransmissionDirect,
        LobeLayer::TransmissionIndirect,
        LobeLayer::VolumeDirect,
        LobeLayer::VolumeIndirect,
    ];
}

/// How the first vertex of a camera path scatters the light of the path to the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FirstScatter {
    /// Nothing scatters: the camera sees a light with a surface.
    #[default]
    Emit,
    /// Nothing scatters: the camera sees the environment or a sun.
    Environment,
    /// A surface, with the shares of its diffuse, glossy and transmitting lobes by channel, which sum to one.
    Surface([Rgb; 3]),
    /// A medium.
    Medium,
}

impl FirstScatter {
    /// How the first vertex scatters the light of a camera path that continues along `sample`, drawn from the lobes of
    /// `set`.
    pub(in crate::transport) fn of_sample(vertex: &Vertex<'_, '_>, sample: &BsdfSample, set: LobeSet) -> FirstScatter {
        FirstScatter::Surface(vertex.shading.shares_of_sample(sample, Transport::Radiance, set))
    }
}

/// Light of one iteration in a pixel, by [`LobeLayer`], and the colours of the first hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeLight {
    /// Radiance by layer, in the order of [`LobeLayer::ALL`].
    pub layers: [Rgb; LobeLayer::ALL.len()],
    /// Albedos of the diffuse, glossy and transmitting lobes at the first hit; zero without a surface.
    pub colors: [Rgb; 3],
}

impl LobeLight {
    /// Adds light that reaches the camera by `first`. `direct`: it has no other bounce.
    #[inline]
    pub fn add(&mut self, first: &FirstScatter, direct: bool, light: Rgb) {
        let mut put = |layer: LobeLayer, light: Rgb| self.layers[layer as usize] += light;
        let [diffuse, glossy, transmission, volume] = if direct {
            [LobeLayer::DiffuseDirect, LobeLayer::GlossyDirect, LobeLayer::TransmissionDirect, LobeLayer::VolumeDirect]
        } else {
            [
                LobeLayer::DiffuseIndirect,
                LobeLayer::GlossyIndirect,
                LobeLayer::TransmissionIndirect,
                LobeLayer::VolumeIndirect,
            ]
        };
        match first {
            FirstScatter::Emit => put(LobeLayer::Emit, light),
            FirstScatter::Environment => put(LobeLayer::Environment, light),
            FirstScatter::Medium => put(volume, light),
            FirstScatter::Surface(shares) => {
                for (layer, share) in [diffuse, glossy, transmission].into_iter().zip(shares) {
                    put(layer, light * *share);
                }
            }
        }
    }
}

/// Light of one camera path that gathers photons, by the lobe of the first hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct LobeRecord {
    /// Index of the bandwidth level that the record shows, among those of the path; `None` if the path does not sample it.
    pub(in crate::transport) level: Option<usize>,
    /// Light that the path finds.
    pub(in crate::transport) own: LobeLight,
    /// Light that photons bring.
    pub(in crate::transport) photons: LobeLight,
}

impl LobeRecord {
    /// Starts the record of a path, which samples the recorded bandwidth level at the index `level`, or not at all.
    pub fn start(&mut self, level: Option<usize>) {
        *self = LobeRecord { level, ..LobeRecord::default() };
    }

    /// All light of the path.
    pub fn all(&self) -> LobeLight {
        let mut sum = LobeLight::default();
        self.add_to(&mut sum, true);
        sum
    }

    /// Adds the light of photons to `sum`, and, if `own` is true, the light that the path finds.
    pub fn add_to(&self, sum: &mut LobeLight, own: bool) {
        for (sum, (path, photons)) in sum.layers.iter_mut().zip(self.own.layers.iter().zip(&self.photons.layers)) {
            *sum += *photons + if own { *path } else { Rgb::ZERO };
        }
        if own {
            sum.colors = self.own.colors;
        }
    }
}

/// The first vertex of a camera path as far as it is known, and the number of bounces so far.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::transport) struct LobeHistory {
    pub first: FirstScatter,
    /// Number of scattering events so far.
    pub bounces: u32,
}

impl LobeHistory {
    /// Records that the path continues from a vertex, which scatters it by `first` if it is the first one.
    #[inline]
    pub fn scatter(&mut self, first: impl FnOnce() -> FirstScatter) {
        if self.bounces == 0 {
            self.first = first();
        }
        self.bounces += 1;
    }

    /// How the first vertex scatters light that arrives at the current vertex, which divides it by `here` if it is the
    /// first one.
    #[inline]
    pub fn arriving(&self, here: impl FnOnce() -> FirstScatter) -> FirstScatter {
        if self.bounces == 0 { here() } else { self.first }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_in_the_order_of_their_list() {
        for (index, layer) in LobeLayer::ALL.into_iter().enumerate() {
            assert_eq!(layer as usize, index);
        }
    }

    /// All of the light is in some layers, for every kind of first scattering.
    #[test]
    fn all_light_is_in_some_layer() {
        let shares = [Rgb::new(0.5, 0.25, 0.0), Rgb::new(0.25, 0.5, 1.0), Rgb::new(0.25, 0.25, 0.0)];
        let all = [FirstScatter::Emit, FirstScatter::Environment, FirstScatter::Medium, FirstScatter::Surface(shares)];
        let mut light = LobeLight::default();
        let mut sum = Rgb::ZERO;
        for (k, first) in all.iter().enumerate() {
            for direct in [true, false] {
                let one = Rgb::new(1.0, 2.0, 4.0) * (1 << k) as f32;
                light.add(first, direct, one);
                sum += one;
            }
        }
        assert_eq!(light.layers.iter().copied().sum::<Rgb>(), sum);
        assert_eq!(light.layers[LobeLayer::GlossyDirect as usize], Rgb::new(2.0, 8.0, 32.0));
    }
}
