//! Light linking: which objects receive the light of a light.
//!
//! It multiplies the contribution of a path by 0 or 1. The factor depends on the light and on the object at the first vertex
//! after it, which all techniques know. No density depends on it, so MIS weights stay as they are.

use super::receiver::Receiver;

/// Largest number of different linkings of the lights of a scene.
pub const MAX_LINKINGS: usize = 63;

/// The linking of a light: the bit of the objects that receive its light ([`crate::geometry::Instance::receives`]). 0: all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Linking(pub u8);

impl Linking {
    /// Whether a receiver is lit by a light with this linking.
    #[inline]
    pub fn lights(self, receiver: &Receiver) -> bool {
        receiver.links >> self.0 & 1 == 1
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
