//! Bandwidths where camera paths gather: what gathering asks of those who set them, and tells them.

use crate::math::Vec3;
use crate::photon::{ByKind, Kind, PhotonMap, ThinningKey};
use wide::f32x8;

/// Most bandwidth levels of one camera path.
pub const MAX_LEVELS: usize = 5;

/// Bandwidths of the levels of one camera path: radii squared in ascending order.
#[derive(Clone, Copy, Debug)]
pub struct LevelRadii {
    pub(super) radius2: [f32; MAX_LEVELS],
    pub(super) count: usize,
    /// Largest radius squared beyond the camera path's first broad bounce.
    pub(super) later2: f32,
    /// The level of each radius.
    pub(super) order: [u8; MAX_LEVELS],
}

impl LevelRadii {
    /// From radii squared in ascending order; at most [`MAX_LEVELS`].
    #[inline]
    pub fn new(radius2: impl Iterator<Item = f32>) -> LevelRadii {
        let mut radii = LevelRadii {
            radius2: [0.0; MAX_LEVELS],
            count: 0,
            later2: f32::INFINITY,
            order: std::array::from_fn(|level| level as u8),
        };
        for r in radius2.take(MAX_LEVELS) {
            radii.radius2[radii.count] = r;
            radii.count += 1;
        }
        radii
    }

    /// The same, where beyond the path's first broad bounce no squared radius is larger than `later2`: a pixel that
    /// sees no photons has a large one, and its path may come to where they are dense, which nobody sees sharply.
    #[inline]
    #[must_use]
    pub fn later(self, later2: f32) -> LevelRadii {
        LevelRadii { later2, ..self }
    }

    /// The same, of these levels (each below [`MAX_LEVELS`]) in this order instead of from 0 up.
    #[inline]
    #[must_use]
    pub fn of(self, order: [u8; MAX_LEVELS]) -> LevelRadii {
        LevelRadii { order, ..self }
    }
}

/// Up to eight photons that bring light to a vertex.
#[derive(Clone, Copy, Debug)]
pub struct FoundPhotons {
    /// Where they are from the vertex.
    pub offset: [f32x8; 3],
    /// Their distances squared; infinite where there is none.
    pub distance2: f32x8,
    /// What they add to the path's measure, mean of RGB, before it is divided by an area.
    pub light: f32x8,
    /// Their marks' bits, for those who ask for marks.
    pub thinning_keys: [u32; 8],
}

impl FoundPhotons {
    /// One photon.
    pub fn one(offset: Vec3, distance2: f32, light: f32, thinning_key: ThinningKey) -> FoundPhotons {
        FoundPhotons {
            thinning_keys: [thinning_key.bits(), 0, 0, 0, 0, 0, 0, 0],
            offset: offset.to_array().map(|x| lane(x, 0.0)),
            distance2: lane(distance2, f32::INFINITY),
            light: lane(light, 0.0),
        }
    }
}

/// A number in the first of eight places, and another in the others.
pub(super) fn lane(x: f32, others: f32) -> f32x8 {
    f32x8::from([x, others, others, others, others, others, others, others])
}

/// Bandwidths where a camera path gathers.
pub trait Bandwidths {
    /// What counting needs to know of a vertex, whatever the kind.
    type Place;
    /// Who is told of the photons found at a vertex.
    type Counter<'c>: Counter
    where
        Self: 'c;

    /// That of a vertex with geometric normal `ng`.
    fn place(ng: Vec3) -> Self::Place;

    /// Those for photons of a kind at a vertex at `p` with geometric normal `ng`, after a path of some `length`.
    fn at(&mut self, kind: Kind, photons: &PhotonMap, p: Vec3, ng: Vec3, length: f32) -> LevelRadii;
    /// Who is told of those.
    fn counter<'c>(&'c mut self, kind: Kind, place: &'c Self::Place) -> Self::Counter<'c>;
}

/// Counts the photons found at one vertex.
pub trait Counter {
    /// Whether [`Counter::count`] is to be called.
    const COUNTS: bool = true;
    /// Whether [`Counter::reach2`] may be larger than the largest bandwidth.
    const BEYOND: bool = false;
    /// Whether photons' marks are asked for.
    const NEEDS_THINNING_KEYS: bool = false;

    /// Photons within reach.
    fn count(&mut self, photons: &FoundPhotons);
    /// Radius squared within which photons are to be counted, at least `largest2`, that of the largest bandwidth.
    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        largest2
    }
}

/// Counts nothing.
impl Counter for () {
    const COUNTS: bool = false;

    #[inline]
    fn count(&mut self, _: &FoundPhotons) {}
}

/// The same all along the path.
impl Bandwidths for &ByKind<LevelRadii> {
    type Place = ();
    type Counter<'c>
        = ()
    where
        Self: 'c;

    #[inline]
    fn place(_: Vec3) {}

    #[inline]
    fn at(&mut self, kind: Kind, _: &PhotonMap, _: Vec3, _: Vec3, _: f32) -> LevelRadii {
        self[kind as usize]
    }

    #[inline]
    fn counter(&mut self, _: Kind, (): &()) {}
}
