//! What an iteration has measured of all pixels, where light of one pixel's paths still arrives in others: one level
//! takes half the bytes of a measure that has room for all.

use super::method::Method;
use super::settings::Settings;
use super::tiles::TILE_PIXELS;
use crate::math::Rgb;
use crate::transport::{Cause, EyeMeasure, Features, FirstHit};
use rayon::prelude::*;
use std::mem::size_of;

/// Of a measure, what all levels share.
#[derive(Clone, Copy, Default)]
struct Shared {
    emission: Rgb,
    direct: Rgb,
    indirect: Rgb,
    volume: Rgb,
    features: Features,
    first: Option<FirstHit>,
    broken: Option<Cause>,
}

/// What photons bring at a level, or what depends on their bandwidth: caustics, indirect light, light from media.
type OfLevel = [Rgb; 3];

/// Bytes that an iteration keeps of a pixel besides its sums: nothing where no light arrives in other pixels than a
/// path's own.
pub fn bytes_of_measures(settings: &Settings) -> usize {
    let pairs = 1 + usize::from(settings.levels.two_paths);
    match settings.method {
        Method::Path => 0,
        method if method.gathers() || method == Method::Pm => 0,
        Method::Mlt => size_of::<EyeMeasure>(),
        _ => pairs * size_of::<Shared>() + settings.levels.count * size_of::<OfLevel>(),
    }
}

/// Measures of all pixels, tile by tile.
pub(super) struct Measures {
    levels: usize,
    shared: Vec<Shared>,
    by_level: Vec<OfLevel>,
}

impl Measures {
    /// Of so many tiles and levels; nothing measured yet.
    pub fn new(tiles: usize, levels: usize) -> Measures {
        let pixels = tiles * TILE_PIXELS;
        let by_level = vec![OfLevel::default(); pixels * levels];
        Measures { levels, shared: vec![Shared::default(); pixels], by_level }
    }

    /// Those of each tile.
    pub fn par_tiles(&mut self) -> impl IndexedParallelIterator<Item = TileMeasures<'_>> {
        let levels = self.levels;
        let by_level = self.by_level.par_chunks_mut(TILE_PIXELS * levels);
        let tile = move |(shared, by_level)| TileMeasures { levels, shared, by_level };
        self.shared.par_chunks_mut(TILE_PIXELS).zip(by_level).map(tile)
    }

    /// The measure of the pixel that is kept at `slot`.
    #[inline]
    pub fn get(&self, slot: usize) -> EyeMeasure {
        unpack(&self.shared[slot], &self.by_level[slot * self.levels..][..self.levels])
    }
}

/// Measures of the pixels of a tile.
pub(super) struct TileMeasures<'m> {
    levels: usize,
    shared: &'m mut [Shared],
    by_level: &'m mut [OfLevel],
}

impl TileMeasures<'_> {
    /// The measure at a slot of the tile.
    #[inline]
    pub fn get(&self, slot: usize) -> EyeMeasure {
        unpack(&self.shared[slot], &self.by_level[slot * self.levels..][..self.levels])
    }

    /// Keeps a measure; nothing of it but its first levels may be lit.
    #[inline]
    pub fn set(&mut self, slot: usize, measure: &EyeMeasure) {
        let &EyeMeasure { emission, direct, indirect, volume, features, first, broken, .. } = measure;
        self.shared[slot] = Shared { emission, direct, indirect, volume, features, first, broken };
        for (level, into) in self.by_level[slot * self.levels..][..self.levels].iter_mut().enumerate() {
            *into = [measure.caustic_photons[level], measure.indirect_photons[level], measure.volume_photons[level]];
        }
    }
}

#[inline]
fn unpack(shared: &Shared, by_level: &[OfLevel]) -> EyeMeasure {
    let Shared { emission, direct, indirect, volume, features, first, broken } = *shared;
    let shared = EyeMeasure { emission, direct, indirect, volume, features, first, broken, ..EyeMeasure::default() };
    by_level.iter().enumerate().fold(shared, |mut measure, (level, &[caustic, indirect, volume])| {
        measure.caustic_photons[level] = caustic;
        measure.indirect_photons[level] = indirect;
        measure.volume_photons[level] = volume;
        measure
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::MAX_LEVELS;

    /// A measure comes back as it was kept, whatever its neighbours are.
    #[test]
    fn a_measure_comes_back() {
        for levels in [1, 4, MAX_LEVELS] {
            let mut measures = Measures::new(2, levels);
            let measure = |at: usize| {
                let value = |k: usize| Rgb::new(at as f32, k as f32, 0.5);
                let mut measure = EyeMeasure { emission: value(1), direct: value(2), ..EyeMeasure::default() };
                (measure.indirect, measure.volume) = (value(3), value(4));
                measure.features.depth = at as f32;
                measure.first = at.is_multiple_of(2).then_some(FirstHit { p: value(5), instance: at as u32 });
                measure.broken = at.is_multiple_of(3).then_some(Cause::Sum);
                for level in 0..levels {
                    measure.caustic_photons[level] = value(10 + level);
                    measure.indirect_photons[level] = value(20 + level);
                    measure.volume_photons[level] = value(30 + level);
                }
                measure
            };
            measures.par_tiles().enumerate().for_each(|(tile, mut measures)| {
                for slot in 0..TILE_PIXELS {
                    measures.set(slot, &measure(tile * TILE_PIXELS + slot));
                    let kept = measures.get(slot);
                    assert_eq!(format!("{kept:?}"), format!("{:?}", measure(tile * TILE_PIXELS + slot)));
                }
            });
            for at in 0..2 * TILE_PIXELS {
                assert_eq!(format!("{:?}", measures.get(at)), format!("{:?}", measure(at)));
            }
        }
    }
}
