//! Photons in media.

use super::map::Located;
use crate::math::{Rgb, Vec3};
use crate::spectrum::Band;

/// A photon in a medium: a vertex of a light path, reduced to the data that gathering needs.
#[derive(Clone, Copy, Debug)]
pub struct VolumePhoton {
    /// World position.
    pub p: Vec3,
    /// Unit direction towards the previous vertex of the light path.
    pub wi: Vec3,
    /// Flux times length (W m), already divided by the number of light paths of the iteration. The sum over a volume,
    /// divided by the volume, is the fluence.
    pub flux: Rgb,
    /// Identifier of the medium that contains the photon; gathering points in other media ignore it.
    pub medium: u32,
    /// Number of segments of the light path up to the photon.
    pub depth: u16,
    /// Band of the light path's wavelength; 0 for a path without one, which has not met dispersive glass.
    pub band: Band,
}

/// Normal that all photons in media have. Queries with this normal find all of them.
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
