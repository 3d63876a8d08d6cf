//! Where light is received.

use crate::math::Vec3;

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where.
    pub p: Vec3,
    /// Unit normal on the side that light has to come from; zero where it may come from anywhere.
    pub n: Vec3,
    /// It is in a medium. Lights are chosen for it by power alone: points on the way through a medium are drawn by the
    /// lamp, which has to be chosen before them.
    pub in_medium: bool,
}

impl Receiver {
    /// A point lit from anywhere, outside of media.
    #[inline]
    pub fn anywhere(p: Vec3) -> Receiver {
        Receiver { p, n: Vec3::ZERO, in_medium: false }
    }
}
