//! Where the error of a picture is: the worst tiles, and the objects and kinds of light with the largest shares.
//!
//! The squared error of a pixel is divided among the kinds of light in proportion to their noise. The noise of a kind is
//! the difference between neighbouring pixels of its layer, without the texture of the albedo. Edges of objects count as
//! noise, so the shares are approximate. A pixel belongs to the object that covers at least half of it.

use super::layers::SceneNames;
use crate::estimator::PixelAccumulator;
use crate::film::{LayerSet, Picture};
use crate::finish::Windows;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Number of tiles along the longer side of a picture.
const TILES_ALONG: usize = 20;
/// Largest number of tiles that are reported.
const MAX_TILES: usize = 10;
/// Smallest share of the squared error for which an object and a kind of light are reported.
const MIN_SHARE: f64 = 0.05;
/// Pixels on each side of the middle one in the windows in which noise is averaged.
const REACH: usize = 7;
/// Added to the albedo by which noise is divided, so that black surfaces do not divide by zero.
const ALBEDO_OFFSET: f32 = 0.01;
/// Layer names of the kinds of light, with the names of these kinds for people.
const LIGHTS: [(&str, &str); 4] = [
    ("Direct", "direct light"),
    ("Indirect", "indirect light"),
    ("Caustic", "caustics"),
    ("Volume", "light from media"),
];

/// The object and the material that each pixel shows.
#[derive(Default)]
pub(super) struct Visible {
    /// For each pixel, indices of its object and material; `None` if no object covers half of the pixel.
    of_pixels: Vec<Option<[u32; 2]>>,
    objects: Vec<String>,
    materials: Vec<String>,
}

impl Visible {
    pub fn of(pixels: &[PixelAccumulator], names: &SceneNames) -> Visible {
        let most = |pixel: &PixelAccumulator| {
            let (instance, fraction) = pixel.coverage.fractions().next()?;
            names.instances.get(instance as usize).copied().filter(|_| fraction >= 0.5)
        };
        Visible {
            of_pixels: pixels.par_iter().map(most).collect(),
            objects: names.objects.clone(),
            materials: names.materials.clone(),
        }
    }

    /// Names of the object and the material with these indices; `None` if there are none.
    fn names(&self, of: [u32; 2]) -> Option<[&str; 2]> {
        Some([self.objects.get(of[0] as usize)?, self.materials.get(of[1] as usize)?])
    }
}

/// An object and a kind of light, with their share of the picture's squared error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// Share of the picture's squared error, 0 to 1.
    pub share: f64,
    /// Name of the object; empty if there is none.
    pub object: String,
    /// Name of the object's material.
    pub material: String,
    /// The kind of light, such as `caustics`.
    pub light: String,
}

/// A tile of the picture with its share of the squared error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tile {
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The object and the kind of light that hold most of the tile's squared error, with the tile's share of the
    /// picture's.
    #[serde(flatten)]
    pub place: Place,
}

/// The objects, kinds of light and tiles that hold most of a picture's squared error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Objects and kinds of light, that with the largest share of the squared error first.
    pub by: Vec<Place>,
    /// Tiles, that with the largest share of the squared error first.
    pub tiles: Vec<Tile>,
}

/// Holder of squared error: indices of an object and its material, `None` without an object, and the index of a kind of
/// light.
type Holder = (Option<[u32; 2]>, usize);

/// Sums of squared errors by object, material and kind of light.
#[derive(Clone, Default)]
struct Holders(BTreeMap<Holder, f64>);

impl Holders {
    fn add(&mut self, object: Option<[u32; 2]>, squared: f64, shares: [f32; LIGHTS.len()]) {
        for (light, share) in shares.into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            *self.0.entry((object, light)).or_default() += squared * f64::from(share);
        }
    }

    /// Objects and kinds of light with their squared errors, the largest first.
    fn sorted(&self) -> Vec<(Holder, f64)> {
        let mut sorted: Vec<_> = self.0.iter().map(|(key, squared)| (*key, *squared)).collect();
        sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
        sorted
    }
}

impl Worst {
    /// Finds where most of a picture's squared error is. `squared`: squared errors of the pixels; `weight`: factors
    /// that make them relative; `set`: the layers of the kinds of light; `visible`: the objects in the pixels.
    pub(super) fn of(squared: &Picture, weight: &[f32], set: &LayerSet, visible: &Visible) -> Worst {
        let relative: Vec<f64> =
            squared.iter().zip(weight).map(|(rgb, weight)| f64::from(rgb.iter().sum::<f32>() / 3.0 * weight)).collect();
        let (size, shares) = (set.size(), noise_shares(set));
        let object = |i: usize| visible.of_pixels.get(i).copied().flatten();
        let side = size.width.max(size.height).div_ceil(TILES_ALONG).max(1);
        let across = size.width.div_ceil(side);
        let mut tiles = vec![(0.0, Holders::default()); across * size.height.div_ceil(side)];
        let mut whole = Holders::default();
        for (i, &squared) in relative.iter().enumerate() {
            let (sum, holders) = &mut tiles[i / size.width / side * across + i % size.width / side];
            *sum += squared;
            holders.add(object(i), squared, shares[i]);
            whole.add(object(i), squared, shares[i]);
        }
        let total = relative.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let place = |(of, light): Holder, squared: f64| {
            let [object, material] = of.and_then(|of| visible.names(of)).unwrap_or_default().map(String::from);
            Place { share: squared / total, object, material, light: LIGHTS[light].1.into() }
        };
        let by = whole.sorted().into_iter().map(|(key, squared)| place(key, squared));
        let mut order: Vec<usize> = (0..tiles.len()).filter(|tile| tiles[*tile].0 > 0.0).collect();
        order.sort_by(|&a, &b| tiles[b].0.total_cmp(&tiles[a].0));
        let tile = |index: usize| {
            let (x, y) = (index % across * side, index / across * side);
            let (sum, holders) = &tiles[index];
            let (key, _) = *holders.sorted().first()?;
            let (width, height) = (side.min(size.width - x), side.min(size.height - y));
            Some(Tile { x, y, width, height, place: place(key, *sum) })
        };
        Worst {
            by: by.filter(|place| place.share >= MIN_SHARE).collect(),
            tiles: order.into_iter().filter_map(tile).take(MAX_TILES).collect(),
        }
    }
}

/// Share of each kind of light in the noise of each pixel, 0 to 1.
fn noise_shares(set: &LayerSet) -> Vec<[f32; LIGHTS.len()]> {
    let size = set.size();
    let albedo = set.picture("albedo");
    let albedo = |i: usize, c: usize| albedo.as_ref().map_or(1.0, |albedo| albedo[i][c].max(0.0) + ALBEDO_OFFSET);
    let all = vec![true; size.pixels()];
    let noise = |(layer, _): (&str, &str)| -> Option<Vec<[f32; 1]>> {
        let light = set.picture(layer)?;
        let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
        let plain = Picture::from_fn(size, |i| std::array::from_fn(|c| finite(light[i][c]) / albedo(i, c)));
        let smooth = Windows::new(size, 1, &all).means(&plain);
        let grain = |i: usize| [(0..3).map(|c| ((plain[i][c] - smooth[i][c]) * albedo(i, c)).powi(2)).sum::<f32>()];
        let grain: Vec<[f32; 1]> = (0..size.pixels()).into_par_iter().map(grain).collect();
        Some(Windows::new(size, REACH, &all).means(&grain))
    };
    let noises = LIGHTS.map(noise);
    let of_pixel = |i: usize| {
        let noise = noises.each_ref().map(|noise| noise.as_ref().map_or(0.0, |noise| noise[i][0].max(0.0)));
        let sum: f32 = noise.iter().sum();
        if sum > 0.0 { noise.map(|noise| noise / sum) } else { [0.0; LIGHTS.len()] }
    };
    (0..size.pixels()).map(of_pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Layer, Size};

    /// A glass lamp on the left has noisy caustics, a floor on the right has slightly noisy direct light.
    #[test]
    fn objects_and_lights_are_reported_by_their_shares() {
        let (width, height) = (80, 40);
        let left = |i: usize| i % width < width / 2;
        let rough = |i: usize, of: f32| of * if (i * 7919) % 13 < 6 { 1.0 } else { 0.5 };
        let light = |of: &(dyn Fn(usize) -> f32 + Sync)| Picture::from_fn(Size { width, height }, |i| [of(i); 3]);
        let mut set = LayerSet::new(width, height);
        for (name, values) in [
            ("Caustic", light(&|i| if left(i) { rough(i, 2.0) } else { 0.0 })),
            ("Direct", light(&|i| if left(i) { 1.0 } else { rough(i, 1.0) })),
            ("albedo", light(&|_| 0.5)),
        ] {
            set.push(Layer::interleaved(name, "RGB", values)).expect("sizes agree");
        }
        let visible = Visible {
            of_pixels: (0..width * height).map(|i| Some(if left(i) { [0, 1] } else { [1, 0] })).collect(),
            objects: vec!["Lamp".into(), "Floor".into()],
            materials: vec!["Wood".into(), "Glass".into()],
        };
        let squared = light(&|i| if left(i) { 4.0 } else { 1.0 });
        let worst = Worst::of(&squared, &vec![1.0; width * height], &set, &visible);
        let first = &worst.by[0];
        assert_eq!([&*first.object, &*first.material, &*first.light], ["Lamp", "Glass", "caustics"]);
        assert!((first.share - 0.8).abs() < 0.03, "{}", first.share);
        let second = &worst.by[1];
        assert_eq!([&*second.object, &*second.light], ["Floor", "direct light"]);
        assert_eq!(worst.tiles.len(), MAX_TILES);
        let tile = &worst.tiles[0];
        assert!((tile.width, tile.height) == (4, 4) && tile.x < 40 && tile.place.object == "Lamp");
        assert!((tile.place.share - 4.0 * 16.0 / (2.5 * 3200.0)).abs() < 1e-6, "{}", tile.place.share);
    }

    #[test]
    fn a_black_picture_has_no_worst_places() {
        let set = LayerSet::new(3, 2);
        let worst = Worst::of(&Picture::filled(set.size(), [0.0; 3]), &[1.0; 6], &set, &Visible::default());
        assert_eq!(worst, Worst { by: vec![], tiles: vec![] });
    }
}
