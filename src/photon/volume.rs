//! Photons in media.

use super::map::Located;
use crate::math::{Rgb, Vec3};
use crate::spectrum::Band;

/// A light-path vertex in a medium.
#[derive(Clone, Copy, Debug)]
pub struct VolumePhoton {
    /// World position.
    pub p: Vec3,
    /// Unit direction towards where the light came from.
    pub wi: Vec3,
    /// Flux times length (W m), already divided by the number of light paths of the pass: summed over a volume and
    /// divided by it, it is the fluence there, whatever the medium.
    pub flux: Rgb,
    /// Which medium it is in: gathering points in others do not see it.
    pub medium: u32,
    /// Segments of the light path up to here.
    pub depth: u16,
    /// Of the light path's wavelength.
    pub band: Band,
}

/// The normal of all photons in media, which have none: queries with it leave none out.
pub const NO_NORMAL: Vec3 = Vec3::Z;

impl Located for VolumePhoton {
    #[inline]
    fn position(&self) -> Vec3 {
        self.p
    }

    #[inline]
    fn normal(&self) -> Vec3 {
        NO_NORMAL
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.p.is_finite() && self.flux.is_finite()
    }
}
