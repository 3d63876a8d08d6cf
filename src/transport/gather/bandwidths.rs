//! The interface between gathering and bandwidth rules: a rule gives the bandwidths at each vertex of a camera path, and
//! counts the photons found there.

use crate::math::Vec3;
use crate::photon::{ByKind, Kind, PhotonMap, ThinningKey};
use crate::transport::walk::pixel_sample::MAX_LEVELS;
use wide::f32x8;

/// Squared bandwidths of the bandwidth levels of one camera path, in ascending order.
#[derive(Clone, Copy, Debug)]
pub struct LevelBandwidths {
    pub(in crate::transport) bandwidth2: [f32; MAX_LEVELS],
    pub(in crate::transport) count: usize,
    /// Largest squared bandwidth after the camera path's first broad bounce (square scene units).
    pub(in crate::transport) indirect_cap2: f32,
    /// The bandwidth level that each bandwidth belongs to.
    pub(in crate::transport) order: [u8; MAX_LEVELS],
}

impl LevelBandwidths {
    /// Takes squared bandwidths of at most [`MAX_LEVELS`] levels, in ascending order from level 0.
    #[inline]
    pub fn new(bandwidth2: impl Iterator<Item = f32>) -> LevelBandwidths {
        let mut bandwidths = LevelBandwidths {
            bandwidth2: [0.0; MAX_LEVELS],
            count: 0,
            indirect_cap2: f32::INFINITY,
            order: std::array::from_fn(|level| level as u8),
        };
        for r in bandwidth2.take(MAX_LEVELS) {
            bandwidths.bandwidth2[bandwidths.count] = r;
            bandwidths.count += 1;
        }
        bandwidths
    }

    /// Caps squared bandwidths at `indirect_cap2` after the path's first broad bounce. A pixel that sees few photons has a
    /// large bandwidth. Its path may arrive where photons are dense, and there a smaller one suffices.
    #[inline]
    #[must_use]
    pub fn capped_after_broad_bounce(self, indirect_cap2: f32) -> LevelBandwidths {
        LevelBandwidths { indirect_cap2, ..self }
    }

    /// Assigns the bandwidths to the levels in `order` (each below [`MAX_LEVELS`]).
    #[inline]
    #[must_use]
    pub fn with_order(self, order: [u8; MAX_LEVELS]) -> LevelBandwidths {
        LevelBandwidths { order, ..self }
    }
}

/// Up to eight photons found around a vertex.
#[derive(Clone, Copy, Debug)]
pub struct FoundPhotons {
    /// Positions of the photons relative to the vertex.
    pub offset: [f32x8; 3],
    /// Squared distances of the photons from the vertex; infinite in unused lanes.
    pub distance2: f32x8,
    /// Radiance times area that each photon adds to the path's sample, mean of RGB.
    pub light: f32x8,
    /// Bits of the thinning keys of the photons; zero unless [`PhotonCounter::NEEDS_THINNING_KEYS`].
    pub thinning_keys: [u32; 8],
}

impl FoundPhotons {
    /// A single photon, in the first lane.
    pub fn one(offset: Vec3, distance2: f32, light: f32, thinning_key: ThinningKey) -> FoundPhotons {
        FoundPhotons {
            thinning_keys: [thinning_key.bits(), 0, 0, 0, 0, 0, 0, 0],
            offset: offset.to_array().map(|x| first_lane(x, 0.0)),
            distance2: first_lane(distance2, f32::INFINITY),
            light: first_lane(light, 0.0),
        }
    }
}

/// A vector with `x` in the first lane and `others` in the other seven.
pub(in crate::transport) fn first_lane(x: f32, others: f32) -> f32x8 {
    f32x8::from([x, others, others, others, others, others, others, others])
}

/// The bandwidths of one camera path, and how its photons are counted.
pub trait GatherBandwidths {
    /// Coordinate frame of a vertex, as the counter needs it.
    type Frame;
    /// Counter of the photons found at a vertex.
    type Counter<'c>: PhotonCounter
    where
        Self: 'c;

    /// The frame of a vertex with geometric normal `ng`.
    fn frame(ng: Vec3) -> Self::Frame;

    /// Bandwidths for photons of `kind` at a vertex at `p` with geometric normal `ng`, where the camera path has
    /// this `length`.
    fn levels(&mut self, kind: Kind, photons: &PhotonMap, p: Vec3, ng: Vec3, length: f32) -> LevelBandwidths;

    /// The counter of the photons of `kind` that are found at a vertex.
    fn counter<'c>(&'c mut self, kind: Kind, frame: &'c Self::Frame) -> Self::Counter<'c>;
}

/// Counts the photons found at one vertex.
pub trait PhotonCounter {
    /// Whether [`PhotonCounter::count`] is called at all.
    const COUNTS: bool = true;
    /// Whether [`PhotonCounter::reach2`] may exceed the largest bandwidth.
    const BEYOND: bool = false;
    /// Whether [`FoundPhotons::thinning_keys`] is filled in.
    const NEEDS_THINNING_KEYS: bool = false;

    /// Counts photons within reach.
    fn count(&mut self, photons: &FoundPhotons);

    /// Squared bandwidth within which photons are counted; at least `largest2`, the largest bandwidth's.
    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        largest2
    }
}

/// Counts nothing.
impl PhotonCounter for () {
    const COUNTS: bool = false;

    #[inline]
    fn count(&mut self, _: &FoundPhotons) {}
}

/// Constant bandwidths along the path, without counts.
impl GatherBandwidths for ByKind<LevelBandwidths> {
    type Frame = ();
    type Counter<'c>
        = ()
    where
        Self: 'c;

    #[inline]
    fn frame(_: Vec3) {}

    #[inline]
    fn levels(&mut self, kind: Kind, _: &PhotonMap, _: Vec3, _: Vec3, _: f32) -> LevelBandwidths {
        self[kind as usize]
    }

    #[inline]
    fn counter(&mut self, _: Kind, (): &()) {}
}
