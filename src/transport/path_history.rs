//! What a camera path has gone through, which decides the class of the light it finds.

use super::shares::leads;
use crate::bsdf::LobeSet;
use crate::plan::{CameraSuffix, ClassSet, Event};

/// What decides which class the light of a camera path is of.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathHistory {
    /// What has happened up to the last vertex.
    pub suffix: CameraSuffix,
    /// Lobes of the last vertex; `None` in a medium.
    lobes: Option<LobeSet>,
    /// Length of the path so far.
    pub length: f32,
    /// All vertices scattered by delta lobes.
    pub delta: bool,
}

impl PathHistory {
    pub const START: PathHistory = PathHistory { suffix: CameraSuffix::START, lobes: None, length: 0.0, delta: true };

    /// The last vertex sent the path on by `lobe`.
    #[inline]
    pub fn scattered(&mut self, lobe: LobeSet) {
        self.delta &= lobe == LobeSet::DELTA;
        self.suffix = self.suffix.then(Event::by(lobe, self.lobes));
    }

    /// No vertex before this one scatters but by mirrors and clear glass.
    #[inline]
    pub fn is_clear(&self) -> bool {
        self.suffix.is_clear()
    }

    /// Leaves a vertex with some lobes; `None`: in a medium.
    #[inline]
    pub fn leave(&mut self, lobes: Option<LobeSet>) {
        self.lobes = lobes;
    }

    /// Whether going on from the last vertex can come to light of a class that is wanted.
    #[inline]
    pub fn leads(&self, on: ClassSet) -> bool {
        on.is_all()
            || match self.lobes {
                None => !(self.suffix.then(Event::Medium).reachable_classes() & on).is_empty(),
                Some(lobes) => leads(self.suffix, lobes, lobes, on),
            }
    }
}
