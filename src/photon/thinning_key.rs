//! What lets photons of different weights be counted as if all weighed the same.

/// The weight of a photon and its rank among those of any weight.
///
/// Where light paths are sent more often than their light asks for, each carries less: its weight is what it carries
/// over what it would if starts were drawn by power alone. A rank is the weight over a number that is uniform on (0,
/// 1), so that of photons of weight w those with a rank above W are a share `min(1, w / W)`, each on its own: a Poisson
/// process, thinned \[Lewis and Shedler 1979\]. With W no less than any weight, they are as dense as photons that all
/// weigh W and bring the same light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThinningKey(u32);

/// The leading bits of a number that is not negative, in the order of numbers.
fn leading(x: f32) -> u32 {
    x.to_bits() >> 15
}

impl ThinningKey {
    /// Of a weight above 0; `u` is uniform on `[0, 1)`.
    pub fn new(weight: f32, u: f32) -> ThinningKey {
        ThinningKey(leading(weight) << 16 | leading(weight / u))
    }

    /// The weight, to one in 250.
    #[inline]
    pub fn weight(self) -> f32 {
        f32::from_bits(weight(self.0) << 15)
    }

    /// All of it, in order of weight.
    #[inline]
    pub fn bits(self) -> u32 {
        self.0
    }
}

/// Weights of [`ThinningKey::bits`], in their order.
#[inline]
pub fn weight(bits: u32) -> u32 {
    bits >> 16
}

/// Whether the rank of a mark is above the largest number of a weight.
#[inline]
pub fn above(bits: u32, weight: u32) -> bool {
    bits & 0xffff > weight
}

/// The number that ranks above a weight are not below.
pub fn bound(weight: u32) -> f32 {
    f32::from_bits((weight + 1) << 15)
}
