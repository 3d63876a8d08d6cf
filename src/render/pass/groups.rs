//! Light of each light group in the pixels of a tile.

use super::tiles::TILE_PIXELS;
use crate::light::Group;
use crate::math::Rgb;
use crate::plan::{Part, PathClass};

/// Radiance of a light group: all of it, and its caustics.
pub(super) type GroupLight = [Rgb; 2];

/// Light of one iteration in the pixels of a tile, by light group.
pub(super) struct TileGroups {
    groups: usize,
    light: Vec<GroupLight>,
}

impl TileGroups {
    /// No light of `groups` groups.
    pub fn new(groups: usize) -> TileGroups {
        TileGroups { groups, light: vec![GroupLight::default(); groups * TILE_PIXELS] }
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

    /// Light of each group at `slot`.
    pub fn at(&self, slot: usize) -> &[GroupLight] {
        &self.light[slot * self.groups..][..self.groups]
    }

    /// Removes all light, before an iteration.
    pub fn clear(&mut self) {
        self.light.fill(GroupLight::default());
    }
}
