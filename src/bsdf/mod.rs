//! The scattering model: one closed set of lobes that agrees with the glTF specification and conserves energy.

mod stub;
use crate::math::{Rgb, Vec3};
use std::ops::{BitAnd, BitOr};
pub use stub::*;

/// A set of lobe classes. The classes decide who carries light that arrives at a surface: see [`LobeSet::BROAD`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct LobeSet(pub u8);

impl LobeSet {
    /// No lobe.
    pub const NONE: LobeSet = LobeSet(0);
    /// Perfect mirrors and clear interfaces: a path can only continue.
    pub const DELTA: LobeSet = LobeSet(1);
    /// Glossy lobes too narrow to gather photons well (GGX alpha below [`SHARP_ALPHA`]): an eye path continues.
    pub const SHARP: LobeSet = LobeSet(2);
    /// Diffuse, sheen and wide glossy lobes: photons are gathered here.
    pub const BROAD: LobeSet = LobeSet(4);
    /// All of them.
    pub const ALL: LobeSet = LobeSet(7);
    /// Everything a light sample can be evaluated against.
    pub const SMOOTH: LobeSet = LobeSet(6);

    /// No class in the set.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Shares a class with `other`.
    #[inline]
    pub fn has(self, other: LobeSet) -> bool {
        self.0 & other.0 != 0
    }
}

impl BitOr for LobeSet {
    type Output = LobeSet;
    #[inline]
    fn bitor(self, other: LobeSet) -> LobeSet {
        LobeSet(self.0 | other.0)
    }
}

impl BitAnd for LobeSet {
    type Output = LobeSet;
    #[inline]
    fn bitand(self, other: LobeSet) -> LobeSet {
        LobeSet(self.0 & other.0)
    }
}

/// GGX alpha (perceptual roughness squared) below which a glossy lobe is [`LobeSet::SHARP`].
pub const SHARP_ALPHA: f32 = 0.2;

/// Which quantity a walk carries; refraction compresses radiance by 1/eta^2 and leaves importance's adjoint alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Walking from the eye: BSDFs weight radiance.
    Radiance,
    /// Walking from a light: the adjoint BSDF weights flux.
    Importance,
}

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction, local frame.
    pub wi: Vec3,
    /// f |cos wi| / pdf over the set of lobes asked for (for a delta lobe, its weight over the probability of choosing it).
    pub weight: Rgb,
    /// Density per solid angle of `wi` over the non-delta lobes of the set; for a delta sample the probability of choosing that lobe.
    pub pdf_w: f32,
    /// Class of the lobe drawn (exactly one).
    pub lobe: LobeSet,
    /// The direction crosses to the other side of the surface.
    pub transmitted: bool,
}
