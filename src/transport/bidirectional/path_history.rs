//! The history of a camera path, which determines the class of the light that it finds.

use super::shares::leads;
use crate::bsdf::LobeSet;
use crate::path_class::{CameraSuffix, ClassSet, Event};
use crate::transport::walk::pixel_sample::BranchFeatures;

/// Class, lobes and length of a camera path up to its last vertex.
#[derive(Clone, Copy, Debug)]
pub(in crate::transport) struct PathHistory {
    /// Class of the path up to the last vertex: the kinds of its bounces.
    pub suffix: CameraSuffix,
    /// Lobes of the BSDF at the last vertex; `None` in a medium.
    lobes: Option<LobeSet>,
    /// Length of the path so far (scene units).
    pub length: f32,
    /// Whether all vertices so far scattered the path by delta lobes.
    pub delta: bool,
    /// G-buffer of the path.
    pub features: BranchFeatures,
}

impl PathHistory {
    pub const START: PathHistory = PathHistory {
        suffix: CameraSuffix::START,
        lobes: None,
        length: 0.0,
        delta: true,
        features: BranchFeatures::NONE,
    };

    /// Records that the last vertex scattered the path by `lobe`.
    #[inline]
    pub fn scattered(&mut self, lobe: LobeSet) {
        self.delta &= lobe == LobeSet::DELTA;
        self.suffix = self.suffix.then(Event::at_vertex(lobe, self.lobes));
    }

    /// Sets the lobes of the vertex that the path leaves; `None` in a medium.
    #[inline]
    pub fn leave(&mut self, lobes: Option<LobeSet>) {
        self.lobes = lobes;
    }

    /// Whether continuing from the last vertex can reach light of a class in `on`.
    #[inline]
    pub fn leads(&self, on: ClassSet) -> bool {
        on.is_all()
            || match self.lobes {
                None => !(self.suffix.then(Event::Medium).reachable_classes() & on).is_empty(),
                Some(lobes) => leads(self.suffix, lobes, lobes, on),
            }
    }
}
