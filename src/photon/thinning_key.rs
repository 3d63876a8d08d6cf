//! Thinning of photons with different weights, so that counts follow the light.

/// Weight and rank of a photon, in 32 bits.
///
/// If more light paths are sent somewhere than power alone would send, each carries less flux. Its weight is its flux
/// relative to that of a path sampled by power alone. Its rank is the weight over a uniform number in (0, 1). Of
/// photons of weight w, a fraction `min(1, w / W)` has a rank above W, independently of each other: a thinned Poisson
/// process \[Lewis and Shedler 1979\]. If W is the largest weight, the remaining photons are as dense as photons of
/// weight W that carry the light in question.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThinningKey(u32);

/// The leading bits of a nonnegative number as an integer, which sorts like the number.
fn leading(x: f32) -> u32 {
    x.to_bits() >> 15
}

impl ThinningKey {
    /// Packs a weight above 0 and the rank that follows from `u`, which is uniform on `[0, 1)`.
    pub fn new(weight: f32, u: f32) -> ThinningKey {
        ThinningKey(leading(weight) << 16 | leading(weight / u))
    }

    /// The weight of the photon, with a relative error of at most 1/250.
    #[inline]
    pub fn weight(self) -> f32 {
        f32::from_bits(weight(self.0) << 15)
    }

    /// The packed bits; the upper half is the weight, the lower half the rank.
    #[inline]
    pub fn bits(self) -> u32 {
        self.0
    }
}

/// The weight of a photon from its [`ThinningKey::bits`], as an integer that sorts like the weight.
#[inline]
pub fn weight(bits: u32) -> u32 {
    bits >> 16
}

/// Whether the rank in a photon's [`ThinningKey::bits`] exceeds `weight` (an integer as [`weight`] returns it).
#[inline]
pub fn above(bits: u32, weight: u32) -> bool {
    bits & 0xffff > weight
}

/// Lower bound of all ranks that [`above`] accepts for this weight.
pub fn bound(weight: u32) -> f32 {
    f32::from_bits((weight + 1) << 15)
}
