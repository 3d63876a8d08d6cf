//! A picture per sampling technique, weighted and unweighted: how the strategies of a method share its light \[Veach
//! 1997, 10.4\].
//!
//! Tiles keep their own pictures, so that they need no locks and sums do not depend on threads. Light that is not
//! finite is left out.

use super::groups::{OfGroup, TileGroups};
use super::tiles::{TILE_PIXELS, Tiles};
use crate::film::Picture;
use crate::light::Group;
use crate::math::Rgb;
use crate::plan::PathClass;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::transport::{MergeLevels, PathRecorder, Splat, Technique};

/// From this depth of a walk on, deeper ones share a picture: paths have no longest length.
const DEEPEST: u32 = 6;
const DEPTHS: usize = DEEPEST as usize;
/// Pictures that there can be.
pub const MAX_TECHNIQUES: usize = 3 * DEPTHS + 2 * DEPTHS * DEPTHS;

/// What one technique finds.
pub struct TechniquePicture {
    /// Which one.
    pub technique: Technique,
    /// Radiance per pixel, row by row from the top: its share of the method's picture. The shares of all techniques sum
    /// to it.
    pub weighted: Picture,
    /// The same without weights: what the technique would give alone (merging: with the kernel of the method's own
    /// bandwidth).
    pub unweighted: Picture,
}

impl TechniquePicture {
    /// A name for files: what is done, and as in \[Veach 1997\] the number of vertices `s` of the light's walk and `t`
    /// of the eye's, both ends counted; `up` where deeper walks are in it, too. A merged photon is a vertex of both
    /// walks.
    pub fn name(&self) -> String {
        let count = |depth: u32| format!("{}{}", depth + 1, if depth >= DEEPEST { "up" } else { "" });
        match self.technique {
            Technique::Hit { camera } => format!("hit_s0_t{}", count(camera)),
            Technique::NextEvent { camera } => format!("nextevent_s1_t{}", count(camera)),
            Technique::Connect { light, camera } => format!("connect_s{}_t{}", count(light), count(camera)),
            Technique::Camera { light } => format!("camera_s{}_t1", count(light)),
            Technique::Merge { light, camera } => format!("merge_s{}_t{}", count(light), count(camera)),
        }
    }
}

/// Where the picture of a technique is kept; depths are 1 and up.
fn index(technique: Technique) -> usize {
    let at = |depth: u32| depth.clamp(1, DEEPEST) as usize - 1;
    match technique {
        Technique::Hit { camera } => at(camera),
        Technique::NextEvent { camera } => DEPTHS + at(camera),
        Technique::Camera { light } => 2 * DEPTHS + at(light),
        Technique::Connect { light, camera } => (3 + at(light)) * DEPTHS + at(camera),
        Technique::Merge { light, camera } => (3 + DEPTHS + at(light)) * DEPTHS + at(camera),
    }
}

/// The inverse of [`index`].
fn technique(index: usize) -> Technique {
    let (row, camera) = (index / DEPTHS, (index % DEPTHS) as u32 + 1);
    let light = |row: usize| row as u32 + 1;
    match row {
        0 => Technique::Hit { camera },
        1 => Technique::NextEvent { camera },
        2 => Technique::Camera { light: camera },
        row if row < 3 + DEPTHS => Technique::Connect { light: light(row - 3), camera },
        row => Technique::Merge { light: light(row - 3 - DEPTHS), camera },
    }
}

/// Watches the light that reaches the pixels of a tile. `()` costs nothing.
pub(super) trait Watch: PathRecorder + Send + Sync {
    /// What the eye path finds from now on belongs to the pixel at `slot`; only `level` of its levels counts, if any.
    #[inline]
    fn begin(&mut self, slot: usize, level: Option<usize>) {
        let _ = (slot, level);
    }

    /// A light path has sent light to the pixel at `slot`.
    #[inline]
    fn splat(&mut self, slot: usize, level: Option<usize>, splat: &Splat, levels: &MergeLevels) {
        let _ = (slot, level, splat, levels);
    }

    /// What the iteration has brought to the pixel at `slot`, by groups of lights.
    #[inline]
    fn groups(&self, slot: usize) -> &[OfGroup] {
        let _ = slot;
        &[]
    }
}

impl Watch for () {}

/// What is looked at besides the picture itself, in a tile.
pub(super) struct Watches {
    slot: usize,
    level: Option<usize>,
    pictures: Option<TilePictures>,
    groups: Option<TileGroups>,
}

impl Watches {
    /// A picture per technique, and light by so many groups, where they are wanted.
    fn new(techniques: bool, groups: usize) -> Watches {
        let groups = (groups > 0).then(|| TileGroups::new(groups));
        Watches { slot: 0, level: None, pictures: techniques.then(TilePictures::new), groups }
    }

    fn add(&mut self, technique: Technique, of: (PathClass, Group), value: Rgb, weight: f32) {
        if let Some(pictures) = &mut self.pictures {
            pictures.add(self.slot, technique, value, weight);
        }
        if let Some(groups) = &mut self.groups {
            groups.add(self.slot, of, value * weight);
        }
    }
}

/// What is looked at besides the picture, by tile, if anything is.
#[derive(Default)]
pub(super) struct Watched(Option<Vec<Watches>>);

impl Watched {
    /// As the settings want.
    pub fn new(settings: &Settings, scene: &Scene, tiles: &Tiles) -> Watched {
        let (techniques, groups) = (settings.techniques, settings.light_groups(scene));
        let watches = || (0..tiles.count()).map(|_| Watches::new(techniques, groups)).collect();
        Watched((techniques || groups > 0).then(watches))
    }

    /// Before an iteration: what watches it, tile by tile.
    pub fn begin(&mut self) -> Option<&mut [Watches]> {
        let watches = self.0.as_deref_mut()?;
        watches.iter_mut().filter_map(|watches| watches.groups.as_mut()).for_each(TileGroups::clear);
        Some(watches)
    }

    /// The pictures of all techniques that have found light, after so many iterations; they are taken.
    pub fn collect(&mut self, tiles: &Tiles, iterations: u64) -> Vec<TechniquePicture> {
        let parts: Vec<_> = self.0.take().into_iter().flatten().filter_map(|watches| watches.pictures).collect();
        if parts.is_empty() { Vec::new() } else { collect(tiles, parts, iterations) }
    }
}

impl PathRecorder for Watches {
    #[inline]
    fn arrival(&mut self, technique: Technique, of: (PathClass, Group), level: usize, value: Rgb, weight: f32) {
        if self.level == Some(level) {
            self.add(technique, of, value, weight);
        }
    }
}

impl Watch for Watches {
    #[inline]
    fn begin(&mut self, slot: usize, level: Option<usize>) {
        (self.slot, self.level) = (slot, level);
    }

    #[inline]
    fn splat(&mut self, slot: usize, level: Option<usize>, splat: &Splat, levels: &MergeLevels) {
        self.begin(slot, level);
        if let Some(level) = level {
            let weight = splat.ratios.weight(levels.eta()[level]);
            self.add(Technique::Camera { light: splat.light }, (splat.class, splat.group), splat.value, weight);
        }
    }

    #[inline]
    fn groups(&self, slot: usize) -> &[OfGroup] {
        self.groups.as_ref().map_or(&[], |groups| groups.at(slot))
    }
}

/// Weighted and unweighted sums over iterations, pixel by pixel.
type Sums = [[Rgb; 2]; TILE_PIXELS];

/// The pictures of a tile.
struct TilePictures {
    pictures: Vec<Option<Box<Sums>>>,
}

impl TilePictures {
    /// All black.
    fn new() -> TilePictures {
        let pictures = std::iter::repeat_with(|| None).take(MAX_TECHNIQUES).collect();
        TilePictures { pictures }
    }

    fn add(&mut self, slot: usize, technique: Technique, value: Rgb, weight: f32) {
        if value == Rgb::ZERO || !value.is_finite() || !weight.is_finite() {
            return;
        }
        let sums = self.pictures[index(technique)].get_or_insert_with(|| Box::new([[Rgb::ZERO; 2]; TILE_PIXELS]));
        let [weighted, unweighted] = &mut sums[slot];
        *weighted += value * weight;
        *unweighted += value;
    }
}

/// The pictures of all techniques that have found light: means over `iterations`.
fn collect(tiles: &Tiles, mut parts: Vec<TilePictures>, iterations: u64) -> Vec<TechniquePicture> {
    let scale = 1.0 / iterations.max(1) as f32;
    let mut pictures = Vec::new();
    for index in 0..MAX_TECHNIQUES {
        if parts.iter().all(|part| part.pictures[index].is_none()) {
            continue;
        }
        let black = Picture::filled(tiles.size(), [0.0; 3]);
        let mut picture = TechniquePicture { technique: technique(index), weighted: black.clone(), unweighted: black };
        for (tile, part) in parts.iter_mut().enumerate() {
            // Taken and freed, so that the pictures are not in memory twice.
            let Some(sums) = part.pictures[index].take() else { continue };
            for place in tiles.pixels(tile) {
                let at = place.index as usize;
                let [weighted, unweighted] = sums[place.at];
                picture.weighted[at] = (weighted * scale).to_array();
                picture.unweighted[at] = (unweighted * scale).to_array();
            }
        }
        pictures.push(picture);
    }
    pictures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_technique_has_its_picture() {
        let mut names = std::collections::HashSet::new();
        for at in 0..MAX_TECHNIQUES {
            assert_eq!(index(technique(at)), at);
            let picture = TechniquePicture {
                technique: technique(at),
                weighted: Picture::default(),
                unweighted: Picture::default(),
            };
            assert!(names.insert(picture.name()), "{}", picture.name());
        }
        assert!(names.contains("connect_s2_t7up") && names.contains("hit_s0_t2") && names.contains("camera_s7up_t1"));
        assert_eq!(index(Technique::Merge { light: 40, camera: 2 }), index(Technique::Merge { light: 6, camera: 2 }));
    }
}
