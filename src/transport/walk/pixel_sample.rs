//! The sample of one camera path: radiance by part and level, and the G-buffer.

use super::cause::Cause;
use super::segment::FirstHit;
use crate::bsdf::LobeSet;
use crate::math::{Rgb, Vec3};

/// Largest number of bandwidth levels (bandwidths) of one camera path.
pub const MAX_LEVELS: usize = 5;

/// G-buffer of one camera path, at its first vertex that scatters broadly; at its last narrow one if there is none, and
/// zero if all are perfect mirrors or clear glass. If the path is split, albedo and normal are sums over its branches,
/// weighted by their shares, and depth is the mean.
#[derive(Clone, Copy, Debug, Default)]
pub struct Features {
    /// Directional albedo.
    pub albedo: Rgb,
    /// World-space shading normal on the side of the camera.
    pub normal: Vec3,
    /// Length of the path up to the vertex (scene units).
    pub depth: f32,
    /// Sum of the shares of the branches of the path that have such a vertex.
    pub share: f32,
}

impl Features {
    /// Adds the features of a branch, if it has any and a share of the path.
    #[inline]
    pub(in crate::transport) fn add(&mut self, branch: &BranchFeatures, share: f32) {
        if let Some(features) = branch.features.filter(|_| share > 0.0) {
            self.albedo += features.albedo * share;
            self.normal += features.normal * share;
            self.share += share;
            self.depth += (features.depth - self.depth) * (share / self.share);
        }
    }
}

/// G-buffer of one branch of a camera path so far.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::transport) struct BranchFeatures {
    features: Option<Features>,
    /// Whether `features` are those of a vertex that scatters broadly, so that later vertices do not replace them.
    settled: bool,
}

impl BranchFeatures {
    /// `BranchFeatures` of a branch without vertices.
    pub const NONE: BranchFeatures = BranchFeatures { features: None, settled: false };

    /// Stores the G-buffer of a vertex with these lobes, unless the branch has met one that scatters broadly.
    #[inline]
    pub fn store(&mut self, lobes: LobeSet, features: impl FnOnce() -> Features) {
        if !self.settled {
            self.features = Some(features());
            self.settled = lobes.intersects(LobeSet::BROAD);
        }
    }
}

/// Area within the merging bandwidth over that within a quarter of it, whose photons show the bias of merging.
pub const INNER_AREAS: f32 = 16.0;

/// The contribution of one camera path to its pixel. Radiance is linear RGB.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Lights seen directly or through perfect mirrors and clear glass.
    pub emission: Rgb,
    /// Direct light at the first vertex that is not a perfect mirror or clear glass.
    pub direct: Rgb,
    /// All other light that the camera path finds and that photons do not find, too.
    pub indirect: Rgb,
    /// Radiance from photons of caustics, by bandwidth level (0 is the smallest).
    pub caustic_photons: [Rgb; MAX_LEVELS],
    /// Radiance from all other photons, and from light that camera path and photons both find, by bandwidth level.
    pub indirect_photons: [Rgb; MAX_LEVELS],
    /// Light whose first vertex (apart from clear ones) lies in a medium, found without photons.
    pub volume: Rgb,
    /// Light whose first vertex (apart from clear ones) lies in a medium, as far as it depends on a bandwidth, by level.
    pub volume_photons: [Rgb; MAX_LEVELS],
    /// With one bandwidth: merged light less its estimate within a quarter of the bandwidth, over [`INNER_AREAS`].
    pub merge_difference: Rgb,
    /// G-buffer of the camera path.
    pub features: Features,
    /// First visible hit of the camera path; `None` if it hits nothing.
    pub first: Option<FirstHit>,
    /// Why the sample has to be rejected: the source of its first value that is not finite; `None` if all are finite.
    pub rejection: Option<Cause>,
}

impl PixelSample {
    /// Marks the sample as rejected; the first cause stays.
    #[cold]
    pub fn reject(&mut self, cause: Cause) {
        self.rejection.get_or_insert(cause);
    }

    /// Radiance estimate at a bandwidth level (from 0, the smallest), the sum of all parts.
    #[inline]
    pub fn radiance(&self, level: usize) -> Rgb {
        let surfaces =
            self.emission + self.direct + self.indirect + self.caustic_photons[level] + self.indirect_photons[level];
        surfaces + (self.volume + self.volume_photons[level])
    }
}
