//! Light linking, which objects receive the light of a light, and shadow linking, which objects block it.
//!
//! Light linking multiplies the contribution of a path by 0 or 1. The factor depends on the light and on the object at
//! the first vertex after it, which all techniques know. No density depends on it, so MIS weights stay as they are.
//!
//! Shadow linking decides which objects block the segment from the light to the first vertex after it. An object that
//! does not block receives the light and lets it pass as well. A light path does only one of these, so only path
//! tracing renders shadow linking: see `src/transport/walk/pass_through.rs`.

use super::receiver::Receiver;
use crate::trace::{LINKING_BITS, LINKING_SHIFT};

/// Largest number of different linkings of the lights of a scene.
pub const MAX_LINKINGS: usize = 63;

/// A set of objects: those with this bit ([`crate::geometry::Instance::linkings`]). 0: all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Linking(pub u8);

impl Linking {
    /// Whether all objects are part of the linking.
    #[inline]
    pub fn is_all(self) -> bool {
        self.0 == 0
    }

    /// Whether an object with these bits is part of the linking.
    #[inline]
    pub fn has(self, linkings: u64) -> bool {
        linkings >> self.0 & 1 == 1
    }

    /// The linking of the objects that block the ray with this token, in a scene with shadow linking.
    #[inline]
    pub fn of_ray(token: u32) -> Linking {
        Linking(((token & LINKING_BITS) >> LINKING_SHIFT) as u8)
    }

    /// The token for a ray that only the objects of the linking block.
    #[inline]
    pub fn mark(self, token: u32) -> u32 {
        token & !LINKING_BITS | u32::from(self.0) << LINKING_SHIFT
    }
}

/// The linkings of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkedObjects {
    /// The objects that receive its light.
    pub receivers: Linking,
    /// The objects that block its light.
    pub blockers: Linking,
}

impl LinkedObjects {
    /// Whether a receiver is lit by a light with these linkings.
    #[inline]
    pub fn lights(self, receiver: &Receiver) -> bool {
        self.receivers.has(receiver.links)
    }
}

/// The linkings of each light of a scene. Empty lists: no light has one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightLinks {
    /// Linkings of the surface of each instance (object), by the index of the instance.
    pub instances: Vec<LinkedObjects>,
    /// Linkings of each point, spot and sun, in the order of the emitters.
    pub others: Vec<LinkedObjects>,
    /// Linkings that a medium that belongs to no object is part of: a bit for each.
    pub medium_linkings: u64,
}

impl LightLinks {
    /// Whether no light has a linking.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }

    /// The linkings of objects that block light: a bit for each. 0 in scenes without shadow linking.
    pub fn blockers(&self) -> u64 {
        let all = self.instances.iter().chain(&self.others).map(|linked| linked.blockers);
        all.filter(|blockers| !blockers.is_all()).fold(0, |bits, blockers| bits | 1 << blockers.0)
    }

    /// The objects that block the light of the surface of an instance (object).
    #[inline]
    pub fn blockers_of(&self, instance: u32) -> Linking {
        self.instances.get(instance as usize).map_or(Linking::default(), |linked| linked.blockers)
    }
}
