//! The light of each group of lights, as it arrives in the pixels of a tile.

use super::tiles::TILE_PIXELS;
use crate::light::Group;
use crate::math::Rgb;
use crate::plan::{Part, PathClass};

/// All light of a group, and its caustics.
pub(super) type OfGroup = [Rgb; 2];

/// What an iteration brings to the pixels of a tile.
pub(super) struct TileGroups {
    groups: usize,
    light: Vec<OfGroup>,
}

impl TileGroups {
    /// Of so many groups; no light yet.
    pub fn new(groups: usize) -> TileGroups {
        TileGroups { groups, light: vec![OfGroup::default(); groups * TILE_PIXELS] }
    }

    /// Adds light to the pixel at `slot`.
    #[inline]
    pub fn add(&mut self, slot: usize, (class, group): (PathClass, Group), light: Rgb) {
        let Some(group) = group.index().filter(|group| *group < self.groups) else { return };
        let [all, caustic] = &mut self.light[slot * self.groups + group];
        *all += light;
        if class.part() == Part::Caustic {
            *caustic += light;
        }
    }

    /// What has arrived at `slot`, group by group.
    pub fn at(&self, slot: usize) -> &[OfGroup] {
        &self.light[slot * self.groups..][..self.groups]
    }

    /// Before the next iteration.
    pub fn clear(&mut self) {
        self.light.fill(OfGroup::default());
    }
}
