//! Light linking and shadow linking: which objects receive the light of a light, and which block it.
//!
//! Light linking multiplies the contribution of a path by 0 or 1. The factor depends on the light and on the object at
//! the first vertex after it, which all techniques know. No density depends on it, so MIS weights stay as they are.

use super::receiver::Receiver;

/// Largest number of different linkings of the lights of a scene, for light and for shadows each.
pub const MAX_LINKINGS: usize = 63;

/// Indices of the linkings of a light: bits of [`crate::geometry::ObjectLinks`]. 0: no linking.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Linking {
    /// Bit of the objects that receive the light.
    pub receivers: u8,
    /// Bit of the objects that block the light.
    pub blockers: u8,
}

impl Linking {
    /// Whether a receiver is lit by a light with this linking.
    #[inline]
    pub fn lights(self, receiver: &Receiver) -> bool {
        receiver.links >> self.receivers & 1 == 1
    }
}

/// The linking of each light of a scene. Empty lists: no light has one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightLinks {
    /// Linking of the surface of each instance (object), by the index of the instance.
    pub instances: Vec<Linking>,
    /// Linking of each point, spot and sun, in the order of the emitters.
    pub others: Vec<Linking>,
    /// Linkings whose light a medium that belongs to no object receives: a bit for each.
    pub medium_receives: u64,
}

impl LightLinks {
    /// Whether no light has a linking.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }
}
