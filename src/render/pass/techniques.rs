//! A picture per sampling technique, weighted and unweighted, which shows how techniques share the light of a method
//! \[Veach 1997, 10.4\].
//!
//! Every tile has its own pictures. So they need no locks, and sums do not depend on threads. Light that is not finite is
//! left out.

use super::groups::{GroupLight, TileGroups};
use super::tiles::{TILE_PIXELS, Tiles};
use crate::film::Picture;
use crate::math::Rgb;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::transport::{FirstScatter, LobeLight, MergeLevels, PathKind, PathRecorder, Splat, Technique};

/// Depth from which all deeper subpaths share one picture, because the depth of paths has no bound.
const MAX_PICTURE_DEPTH: u32 = 6;
const DEPTHS: usize = MAX_PICTURE_DEPTH as usize;
/// Largest number of technique pictures of a render.
pub const MAX_TECHNIQUES: usize = 3 * DEPTHS + 2 * DEPTHS * DEPTHS;

/// Picture of the light that one sampling technique finds.
pub struct TechniquePicture {
    /// Sampling technique that finds the light.
    pub technique: Technique,
    /// Radiance with MIS weights. The sum over all techniques is the method's picture.
    pub weighted: Picture,
    /// Radiance without MIS weights: the picture of the technique alone. Merging uses the bandwidth of the method's own
    /// picture.
    pub unweighted: Picture,
}

impl TechniquePicture {
    /// Name for files: the kind of the technique, and the numbers of vertices `s` of the light subpath and `t` of the
    /// camera subpath \[Veach 1997\], both ends included. `up` marks a picture that includes deeper subpaths. A merged
    /// photon is a vertex of both subpaths.
    pub fn name(&self) -> String {
        let count = |depth: u32| format!("{}{}", depth + 1, if depth >= MAX_PICTURE_DEPTH { "up" } else { "" });
        match self.technique {
            Technique::Hit { camera } => format!("hit_s0_t{}", count(camera)),
            Technique::NextEvent { camera } => format!("nextevent_s1_t{}", count(camera)),
            Technique::Connect { light, camera } => format!("connect_s{}_t{}", count(light), count(camera)),
            Technique::Camera { light } => format!("camera_s{}_t1", count(light)),
            Technique::Merge { light, camera } => format!("merge_s{}_t{}", count(light), count(camera)),
        }
    }
}

/// Index of a technique's picture among those of all techniques. Depths begin at 1.
fn index(technique: Technique) -> usize {
    let at = |depth: u32| depth.clamp(1, MAX_PICTURE_DEPTH) as usize - 1;
    match technique {
        Technique::Hit { camera } => at(camera),
        Technique::NextEvent { camera } => DEPTHS + at(camera),
        Technique::Camera { light } => 2 * DEPTHS + at(light),
        Technique::Connect { light, camera } => (3 + at(light)) * DEPTHS + at(camera),
        Technique::Merge { light, camera } => (3 + DEPTHS + at(light)) * DEPTHS + at(camera),
    }
}

/// Technique of the picture with this index; the inverse of [`index`].
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

/// Records the light that reaches the pixels of a tile, beside the picture itself. `()` records nothing, at no cost.
pub(super) trait TileRecorder: PathRecorder + Send + Sync {
    /// Assigns the light of the following camera path to the pixel at index `slot` of the tile. Only light of the
    /// bandwidth level `level` counts; `None`: no light does.
    #[inline]
    fn select_pixel(&mut self, slot: usize, level: Option<usize>) {
        let _ = (slot, level);
    }

    /// Records the splat that a light path has sent to the pixel at index `slot` of the tile, where its light vertex
    /// scatters the light by `first`.
    #[inline]
    fn record_splat(
        &mut self,
        slot: usize,
        level: Option<usize>,
        splat: &Splat,
        first: FirstScatter,
        levels: &MergeLevels,
    ) {
        let _ = (slot, level, splat, first, levels);
    }

    /// Light of this iteration in the pixel at index `slot` of the tile, by light group, and by the lobe of the first hit
    /// if it is recorded.
    #[inline]
    fn group_light(&self, slot: usize) -> (&[GroupLight], Option<&LobeLight>) {
        let _ = slot;
        (&[], None)
    }
}

impl TileRecorder for () {}

/// Light recorded in a tile: pictures of sampling techniques, and light of light groups.
pub(super) struct TileRecords {
    slot: usize,
    level: Option<usize>,
    pictures: Option<TilePictures>,
    groups: Option<TileGroups>,
}

impl TileRecords {
    /// Makes a tile that records pictures of techniques if `techniques` is true, the light of `groups` light groups, and
    /// light by the lobe of the first hit if `lobes` is true.
    fn new(techniques: bool, groups: usize, lobes: bool) -> TileRecords {
        let groups = (groups > 0 || lobes).then(|| TileGroups::new(groups, lobes));
        TileRecords { slot: 0, level: None, pictures: techniques.then(TilePictures::new), groups }
    }

    fn add(&mut self, technique: Technique, of: &PathKind, value: Rgb, weight: f32) {
        if let Some(pictures) = &mut self.pictures {
            pictures.add(self.slot, technique, value, weight);
        }
        if let Some(groups) = &mut self.groups {
            groups.add(self.slot, technique, of, value * weight);
        }
    }
}

/// Recorders of all tiles of the film; `None` if nothing is recorded.
#[derive(Default)]
pub(super) struct FilmRecorder(Option<Vec<TileRecords>>);

impl FilmRecorder {
    /// Makes the recorders of the technique pictures, light groups and lobes that the settings ask for.
    pub fn new(settings: &Settings, scene: &Scene, tiles: &Tiles) -> FilmRecorder {
        let (techniques, groups, lobes) = (settings.techniques, settings.light_groups(scene), settings.lobes);
        let records = || (0..tiles.count()).map(|_| TileRecords::new(techniques, groups, lobes)).collect();
        FilmRecorder((techniques || groups > 0 || lobes).then(records))
    }

    /// Starts an iteration. Returns the recorders of all tiles; `None` if nothing is recorded.
    pub fn start_iteration(&mut self) -> Option<&mut [TileRecords]> {
        let tiles = self.0.as_deref_mut()?;
        tiles.iter_mut().filter_map(|tile| tile.groups.as_mut()).for_each(TileGroups::clear);
        Some(tiles)
    }

    /// Takes the pictures of all techniques that have found light, as means over `iterations`.
    pub fn take_pictures(&mut self, tiles: &Tiles, iterations: u64) -> Vec<TechniquePicture> {
        let parts: Vec<_> = self.0.take().into_iter().flatten().filter_map(|tile| tile.pictures).collect();
        if parts.is_empty() { Vec::new() } else { collect(tiles, parts, iterations) }
    }
}

impl PathRecorder for TileRecords {
    #[inline]
    fn arrival(&mut self, technique: Technique, of: PathKind, level: usize, value: Rgb, weight: f32) {
        if self.level == Some(level) {
            self.add(technique, &of, value, weight);
        }
    }

    #[inline]
    fn caught(&mut self, light: [Rgb; 2]) {
        if let Some(groups) = self.groups.as_mut().filter(|_| self.level.is_some()) {
            groups.add_caught(self.slot, light);
        }
    }

    #[inline]
    fn first_surface(&mut self, colors: [Rgb; 3]) {
        if let Some(groups) = self.groups.as_mut().filter(|_| self.level.is_some()) {
            groups.set_colors(self.slot, colors);
        }
    }
}

impl TileRecorder for TileRecords {
    #[inline]
    fn select_pixel(&mut self, slot: usize, level: Option<usize>) {
        (self.slot, self.level) = (slot, level);
    }

    #[inline]
    fn record_splat(
        &mut self,
        slot: usize,
        level: Option<usize>,
        splat: &Splat,
        first: FirstScatter,
        levels: &MergeLevels,
    ) {
        self.select_pixel(slot, level);
        if let Some(level) = level {
            let weight = splat.ratios.weight(levels.eta()[level]);
            let of = PathKind { class: splat.class, group: splat.group, first };
            self.add(Technique::Camera { light: splat.light }, &of, splat.value, weight);
        }
    }

    #[inline]
    fn group_light(&self, slot: usize) -> (&[GroupLight], Option<&LobeLight>) {
        self.groups.as_ref().map_or((&[], None), |groups| (groups.at(slot), groups.lobes_at(slot)))
    }
}

/// Weighted and unweighted light of one technique for each pixel of a tile, as sums over iterations.
type Sums = [[Rgb; 2]; TILE_PIXELS];

/// Pictures of all sampling techniques in one tile.
struct TilePictures {
    pictures: Vec<Option<Box<Sums>>>,
}

impl TilePictures {
    /// Makes a tile whose pictures are black.
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

/// Joins the tiles to pictures of all techniques that have found light, as means over `iterations`.
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
            // Sums are freed one by one, so that pictures are not in memory twice.
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
    fn every_technique_has_a_picture_with_a_unique_name() {
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
