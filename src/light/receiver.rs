//! Receivers of light.

use crate::geometry::ALL_LINKINGS;
use crate::math::Vec3;

/// A point that receives light, for which a light is selected.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position of the point (m).
    pub p: Vec3,
    /// Unit normal on the side that receives light; zero if light may come from any direction.
    pub n: Vec3,
    /// Whether the point is in a participating medium. Lights are then selected by power alone: points along a ray in a
    /// medium are sampled for a given light, so the light has to be selected before the point.
    pub in_medium: bool,
    /// Linkings that the object of the point is part of: a bit for each ([`crate::geometry::Instance::linkings`]).
    pub links: u64,
}

impl Receiver {
    /// A receiver outside media that light reaches from any direction.
    #[inline]
    pub fn anywhere(p: Vec3) -> Receiver {
        Receiver { p, n: Vec3::ZERO, in_medium: false, links: ALL_LINKINGS }
    }
}
