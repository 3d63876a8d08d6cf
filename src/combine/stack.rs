//! The combiner's input: the layers it reads, their size check, and the treatment of values that are not finite.

use rayon::prelude::*;

use crate::error::{Error, ErrorKind, Result};
use crate::film::{LayerSet, Picture, Role, Size};

/// The layers of one render that the combiner reads.
#[derive(Clone, Debug, Default)]
pub struct LevelStack {
    /// Width and height of all layers in pixels.
    pub size: Size,
    /// Layers `Level1`, `Level2`, ...: scene-linear radiance estimated with each bandwidth, smallest first.
    pub levels: Vec<Picture>,
    /// Layers `Variance1`, `Variance2`, ...: variance of the mean radiance of each level.
    pub variances: Vec<Picture>,
    /// Layer `albedo`: reflectance at the first hit, 0 to 1.
    pub albedo: Picture,
    /// Layer `normal`: world-space unit normal at the first hit, zero on the background.
    pub normal: Picture,
    /// Layer `depth`: distance along the path to the first hit; 1e9 and more (or not finite) is background.
    pub depth: Vec<f32>,
}

impl LevelStack {
    /// Collects the combiner's layers from a set. A missing layer is left empty; the combiner then returns an error
    /// with its name.
    ///
    /// # Errors
    /// The set has no levels.
    pub fn of(set: &LayerSet) -> Result<LevelStack> {
        let numbered = |stem: &str| (1..).map_while(|k| set.picture(&format!("{stem}{k}"))).collect::<Vec<_>>();
        let of_role = |role| set.find(role).map(|layer| set.picture_of(layer)).unwrap_or_default();
        let levels = numbered("Level");
        if levels.is_empty() {
            let error = Error::new(ErrorKind::Image, "", "the file has no bandwidth levels (Level1, Level2, ...)");
            return Err(error.hint("render with --layers all"));
        }
        Ok(LevelStack {
            size: set.size(),
            levels,
            variances: numbered("Variance"),
            albedo: of_role(Role::Albedo),
            normal: of_role(Role::Normal),
            depth: depth_of(set),
        })
    }

    /// Checks that all planes exist and have the same size, and that the number of levels is `expected`.
    pub(crate) fn check(&self, expected: usize) -> Result<()> {
        let Size { width, height } = self.size;
        let pixels = width.checked_mul(height).unwrap_or(0);
        if pixels == 0 {
            return Err(Error::new(ErrorKind::Image, "", format!("an image of {width} x {height} pixels")));
        }
        let count = self.levels.len();
        check_levels(count, expected)?;
        for index in 0..count {
            check_layer(&format!("Level{}", index + 1), self.levels[index].len(), pixels)?;
            let variance = self.variances.get(index).map_or(0, |plane| plane.len());
            check_layer(&format!("Variance{}", index + 1), variance, pixels)?;
        }
        check_layer("albedo", self.albedo.len(), pixels)?;
        check_layer("normal", self.normal.len(), pixels)?;
        check_layer("depth", self.depth.len(), pixels)
    }

    /// Whether each pixel is finite in all bandwidth levels; only such pixels take part in equation (6).
    pub(crate) fn valid(&self) -> Vec<bool> {
        let at = |i: usize| self.levels.iter().all(|level| level[i].iter().all(|v| v.is_finite()));
        (0..self.size.pixels()).into_par_iter().map(at).collect()
    }
}

/// The layer `depth` of a set; empty if it has none.
pub(crate) fn depth_of(set: &LayerSet) -> Vec<f32> {
    let plane = set.find(Role::Depth).and_then(|layer| layer.planes.first());
    plane.map(|plane| plane.values.clone()).unwrap_or_default()
}

/// Checks that a picture of `count` bandwidth levels has as many as a network expects.
pub(crate) fn check_levels(count: usize, expected: usize) -> Result<()> {
    if count == expected {
        return Ok(());
    }
    let cause = format!("the image has {count} levels, the network takes {expected}");
    Err(Error::new(ErrorKind::Image, "", cause)
        .hint(format!("render with --levels {expected}, or give a network trained for {count} with --model")))
}

/// Checks that a layer that a network reads, of `size` pixels, has as many as the picture.
pub(crate) fn check_layer(name: &str, size: usize, pixels: usize) -> Result<()> {
    if size == pixels {
        return Ok(());
    }
    let cause = format!("the layer holds {size} pixels, the image {pixels}");
    Err(Error::new(ErrorKind::Image, format!("layer {name}"), cause).hint("render with --layers all"))
}

/// Fills every pixel of `image` that is not valid with its first finite level, else with the mean of level 1 over valid
/// pixels within `radius` in x and y, else with black.
pub(crate) fn fill_invalid(stack: &LevelStack, valid: &[bool], radius: usize, image: &mut Picture) {
    let Size { width, height } = stack.size;
    let replacement = |i: usize| {
        let own = stack.levels.iter().map(|level| level[i]).find(|rgb| rgb.iter().all(|v| v.is_finite()));
        own.unwrap_or_else(|| {
            let (x, y) = (i % width, i / width);
            let (mut sum, mut count) = ([0.0f64; 3], 0.0);
            for v in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                for u in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                    let k = v * width + u;
                    if valid[k] {
                        sum = std::array::from_fn(|c| sum[c] + f64::from(stack.levels[0][k][c]));
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 { sum.map(|s| (s / count) as f32) } else { [0.0; 3] }
        })
    };
    image.par_iter_mut().enumerate().filter(|(i, _)| !valid[*i]).for_each(|(i, out)| *out = replacement(i));
}
