//! Light of each light group, and light by the lobe of the first hit, in the pixels of a tile.

use super::tiles::TILE_PIXELS;
use crate::math::Rgb;
use crate::path_class::Part;
use crate::transport::{LobeLight, PathKind, Technique};

/// Radiance from one light group (lights with a layer of their own): all of it, and its caustics alone.
pub(super) type GroupLight = [Rgb; 2];

/// Light that one iteration brings to the pixels of a tile, by light group (lights with a layer of their own), and, if it
/// is asked for, by the lobe of the first hit.
pub(super) struct TileGroups {
    groups: usize,
    light: Vec<GroupLight>,
    /// Empty unless it is asked for.
    lobes: Vec<LobeLight>,
}

impl TileGroups {
    /// Makes a tile without light, for this number of light groups. `lobes`: it also holds the light by the lobe of the
    /// first hit.
    pub fn new(groups: usize, lobes: bool) -> TileGroups {
        let light = vec![GroupLight::default(); groups * TILE_PIXELS];
        TileGroups { groups, light, lobes: vec![LobeLight::default(); if lobes { TILE_PIXELS } else { 0 }] }
    }

    /// Adds the light that `technique` finds by a kind of path to the pixel at index `slot` of the tile.
    #[inline]
    pub fn add(&mut self, slot: usize, technique: Technique, of: &PathKind, light: Rgb) {
        if let Some(lobes) = self.lobes.get_mut(slot) {
            lobes.add(&of.first, technique.is_direct(), light);
        }
        let Some(group) = of.group.index().filter(|group| *group < self.groups) else { return };
        let [all, caustic] = &mut self.light[slot * self.groups + group];
        *all += light;
        if of.class.part() == Part::Caustic {
            *caustic += light;
        }
    }

    /// Adds the light on a shadow catcher, with and without the shadows of other objects, to the pixel at index `slot` of
    /// the tile. The scene has a catcher.
    #[inline]
    pub fn add_caught(&mut self, slot: usize, light: [Rgb; 2]) {
        if let Some(sums) = self.light.get_mut((slot + 1) * self.groups - 1) {
            sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
        }
    }

    /// Sets the albedos of the lobes at the first hit of the pixel at index `slot` of the tile.
    #[inline]
    pub fn set_colors(&mut self, slot: usize, colors: [Rgb; 3]) {
        if let Some(lobes) = self.lobes.get_mut(slot) {
            lobes.colors = colors;
        }
    }

    /// Light of each group in the pixel at index `slot` of the tile.
    pub fn at(&self, slot: usize) -> &[GroupLight] {
        &self.light[slot * self.groups..][..self.groups]
    }

    /// Light in the pixel at index `slot` of the tile by the lobe of the first hit; `None` if it is not recorded.
    pub fn lobes_at(&self, slot: usize) -> Option<&LobeLight> {
        self.lobes.get(slot)
    }

    /// Sets the light of all pixels to zero, before an iteration.
    pub fn clear(&mut self) {
        self.light.fill(GroupLight::default());
        self.lobes.fill(LobeLight::default());
    }
}
