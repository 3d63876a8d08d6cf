//! Light of each light group in the pixels of a tile.

use super::tiles::TILE_PIXELS;
use crate::light::Group;
use crate::math::Rgb;
use crate::plan::{Part, PathClass};

/// Radiance from one light group (lights with a layer of their own): all of it, and its caustics alone.
pub(super) type GroupLight = [Rgb; 2];

/// Light that one iteration brings to the pixels of a tile, by light group (lights with a layer of their own).
pub(super) struct TileGroups {
    groups: usize,
    light: Vec<GroupLight>,
}

impl TileGroups {
    /// Makes a tile without light, for this number of light groups.
    pub fn new(groups: usize) -> TileGroups {
        TileGroups { groups, light: vec![GroupLight::default(); groups * TILE_PIXELS] }
    }

    /// Adds light of a class from a group to the pixel at index `slot` of the tile.
    #[inline]
    pub fn add(&mut self, slot: usize, (class, group): (PathClass, Group), light: Rgb) {
        let Some(group) = group.index().filter(|group| *group < self.groups) else { return };
        let [all, caustic] = &mut self.light[slot * self.groups + group];
        *all += light;
        if class.part() == Part::Caustic {
            *caustic += light;
        }
    }

    /// Light of each group in the pixel at index `slot` of the tile.
    pub fn at(&self, slot: usize) -> &[GroupLight] {
        &self.light[slot * self.groups..][..self.groups]
    }

    /// Sets the light of all pixels to zero, before an iteration.
    pub fn clear(&mut self) {
        self.light.fill(GroupLight::default());
    }
}
