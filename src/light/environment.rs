//! Environment lights: a latitude-longitude image or a uniform colour.

use super::cdf::Cdf;
use crate::math::{Frame, Rgb, Vec2, Vec3, atan2_turns, luminance, sin_cos_turns, warp};
use rayon::prelude::*;
use std::array::from_fn;
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// Light that arrives from all directions at infinity.
#[derive(Clone, Debug)]
pub enum Environment {
    /// Equal radiance from all directions.
    Uniform(Rgb),
    /// A latitude-longitude image of the radiance.
    Image(Arc<ImageEnvironment>),
}

/// A direction towards the environment, sampled by [`Environment::sample`].
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit direction, pointing away from the scene.
    pub wi: Vec3,
    /// Density per solid angle of the direction; 0 where the environment is black.
    pub pdf_w: f32,
    /// Radiance that arrives from the direction (W/m2/sr).
    pub radiance: Rgb,
}

/// Number of shares of the cosine that are compared for an image, `k / SHARES`. The largest share is below one, so that
/// weights stay bounded where only shading normals face a direction.
const SHARES: usize = 8;
/// Share of the cosine under a uniform sky, the largest.
const UNIFORM_SHARE: f32 = (SHARES - 1) as f32 / SHARES as f32;
/// Largest ratio of variances for which an image is sampled by the cosine at all. The variances are those of independent
/// samples. Stratified ones lose by a choice between two densities: at a predicted ratio of 0.76, variance rose 1.4 times.
const MAX_VARIANCE_RATIO: f64 = 0.5;
/// Directions of an image by which its share is chosen.
const SHARE_SAMPLES: u32 = 1024;
/// Number of patches in a strip.
const PATCHES: usize = 4;
/// Rows and columns of the sectors into which the sky is divided, see [`Sectors`].
pub(super) const SECTOR_ROWS: usize = 12;
pub(super) const SECTOR_COLUMNS: usize = 24;
/// Number of sectors of the sky.
pub(super) const SECTORS: usize = SECTOR_ROWS * SECTOR_COLUMNS;

/// The texels of a row that the patches of a strip need, by channel; the next strip repeats the last one. Texels after
/// the end of the row are those at its start. A strip fills one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Strip([[f32; PATCHES + 1]; 3]);

/// A latitude-longitude image (rows from the top, u = 1/2 + atan2(z, x) / 2 pi), interpolated bilinearly, and sampled in
/// proportion to its luminance.
///
/// The patch between the centres of four texels is the unit of interpolation. A band is a row of patches; the first and
/// the last band lie between a pole and the nearest row of texels, and have half the height. A sample selects a band, a
/// strip of patches in it, and a point in the strip. The density in a strip is proportional to the interpolated product
/// of luminance and sine of the polar angle, and is computed from the texels: a sample needs no table of
/// texels' probabilities.
#[derive(Clone, Debug)]
pub struct ImageEnvironment {
    texels: Texels,
    /// Sine and cosine of the rotation about +Y.
    rotation: (f32, f32),
    /// Selects a band.
    rows: Cdf,
    /// Selects a strip of a band; `None` for black bands.
    columns: Vec<Option<Cdf>>,
    mean: Rgb,
    /// Share of the cosine in next-event estimation at surfaces, see [`Environment::sample_at`].
    cosine: f32,
}

/// The texels of an image in strips, and its bands.
#[derive(Clone, Debug)]
struct Texels {
    /// Number of texels in a row.
    width: usize,
    /// Number of strips in a row.
    row: usize,
    strips: Vec<Strip>,
    bands: Vec<Band>,
}

/// The sectors of an environment: a coarse grid of its directions. The sectors of an image are blocks of its bands and
/// strips; those of a uniform environment have equal solid angles.
pub(super) struct Sectors {
    /// For each sector, the probability that [`Environment::sample`] samples a direction in it.
    pub probabilities: Vec<f32>,
    /// For each sector of an image, selects one of its bands; `None` for black sectors. Empty for a uniform environment.
    bands: Vec<Option<Cdf>>,
}

/// A row of patches.
#[derive(Clone, Copy, Debug)]
struct Band {
    /// Index of the first strip of the texels above, and of the texels below.
    first: [usize; 2],
    /// Upper edge and height, in the coordinate v: 0 at the top of the image, 1 at the bottom.
    start: f32,
    height: f32,
    /// Sine of the polar angle at the upper and the lower edge, over the largest luminance of the image.
    weights: [f32; 2],
}

/// A strip of patches with the importance of its texels: their luminance times the weight of their edge of the band.
struct Patches<'a> {
    strips: [&'a Strip; 2],
    importance: [[f32; PATCHES + 1]; 2],
    /// For each patch, the sum of the importance of its corners, and of the corners of all patches before.
    sums: [f32; PATCHES],
}

/// Samples a number from 0 to 1 by the uniform number `u`, with a density that changes linearly from `a` to `b`; both are
/// at least zero.
#[inline]
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let start = a / (a + b).max(f32::MIN_POSITIVE);
    let end = 1.0 - start;
    let root = (start * start + u * (end - start) * (end + start)).max(0.0).sqrt();
    (u / (start + root).max(f32::MIN_POSITIVE)).min(1.0)
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

impl<'a> Patches<'a> {
    /// The first `count` patches between two strips of a band of these weights.
    #[inline]
    fn new(strips: [&'a Strip; 2], weights: [f32; 2], count: usize) -> Patches<'a> {
        let importance: [[f32; PATCHES + 1]; 2] = from_fn(|side| {
            let Strip([red, green, blue]) = strips[side];
            from_fn(|i| weights[side] * luminance(Rgb::new(red[i], green[i], blue[i])))
        });
        let column: [f32; PATCHES + 1] = from_fn(|i| importance[0][i] + importance[1][i]);
        let mut sum = 0.0;
        let sums = from_fn(|i| {
            sum += if i < count { column[i] + column[i + 1] } else { 0.0 };
            sum
        });
        Patches { strips, importance, sums }
    }

    /// Sum of the importance of the corners of all patches.
    #[inline]
    fn total(&self) -> f32 {
        self.sums[PATCHES - 1]
    }

    /// Interpolated importance at the upper and the lower edge, at the fraction `x` of the width of a patch.
    #[inline]
    fn edges(&self, patch: usize, x: f32) -> [f32; 2] {
        let patch = patch.min(PATCHES - 1);
        self.importance.map(|row| lerp(row[patch], row[patch + 1], x))
    }

    /// Samples a point by the uniform point `u`: the index of a patch, and the fractions of its width and of the height.
    #[inline]
    fn sample(&self, u: Vec2) -> (usize, Vec2) {
        let target = u.x * self.total();
        let patch = self.sums[..PATCHES - 1].iter().map(|&sum| usize::from(target >= sum)).sum::<usize>();
        let before = if patch == 0 { 0.0 } else { self.sums[patch - 1] };
        let rest = ((target - before) / (self.sums[patch] - before).max(f32::MIN_POSITIVE)).min(1.0);
        let [left, right] = [patch, patch + 1].map(|i| self.importance[0][i] + self.importance[1][i]);
        let x = sample_linear(left, right, rest);
        let [above, below] = self.edges(patch, x);
        (patch, Vec2::new(x, sample_linear(above, below, u.y)))
    }

    /// Density of [`Patches::sample`], per area of the patches as unit squares.
    #[inline]
    fn density(&self, patch: usize, at: Vec2) -> f32 {
        let [above, below] = self.edges(patch, at.x);
        // The importance of a patch is the mean of its corners.
        4.0 * lerp(above, below, at.y) / self.total().max(f32::MIN_POSITIVE)
    }

    #[inline]
    fn radiance(&self, patch: usize, at: Vec2) -> Rgb {
        let patch = patch.min(PATCHES - 1);
        let row =
            |Strip(channels): &Strip| Rgb::from_array(channels.each_ref().map(|c| lerp(c[patch], c[patch + 1], at.x)));
        let [above, below] = self.strips.map(row);
        above.lerp(below, at.y)
    }
}

impl Texels {
    fn new(width: usize, height: usize, radiance: &[[f32; 3]]) -> Texels {
        let row = width.div_ceil(PATCHES);
        let strip = |index: usize| {
            let (y, first) = (index / row, index % row * PATCHES);
            Strip(from_fn(|c| from_fn(|i| radiance[y * width + (first + i) % width][c])))
        };
        let luminances = radiance.iter().map(|&texel| luminance(Rgb::from_array(texel)));
        let brightest = luminances.filter(|luminance| luminance.is_finite()).fold(0.0, f32::max);
        let bands = (0..=height).map(|k| Band::new(k, height, row, brightest)).collect();
        Texels { width, row, strips: (0..height * row).into_par_iter().map(strip).collect(), bands }
    }

    #[inline]
    fn patches(&self, band: usize, strip: usize) -> Patches<'_> {
        let Band { first, weights, .. } = &self.bands[band];
        Patches::new(first.map(|first| &self.strips[first + strip]), *weights, self.width - strip * PATCHES)
    }

    /// Density per solid angle of a direction whose polar angle has this sine, from the probability of its strip and the
    /// density within it.
    #[inline]
    fn density(&self, band: &Band, probability: f32, within: f32, sin_theta: f32) -> f32 {
        let per_uv = probability * within * self.width as f32 / band.height;
        per_uv / (TAU * PI * sin_theta.max(f32::MIN_POSITIVE))
    }
}

impl ImageEnvironment {
    /// Builds the sampling distribution of an image of `width * height` finite, non-negative texels, already scaled by
    /// the environment's strength. `rotation` about +Y is in radians. `None` if all texels are black.
    pub fn new(width: usize, height: usize, radiance: &[[f32; 3]], rotation: f32) -> Option<ImageEnvironment> {
        let texels = Texels::new(width, height, radiance);
        let importance = |band, strip| f64::from(texels.patches(band, strip).total());
        let column = |band| Cdf::new((0..texels.row).map(|strip| importance(band, strip)));
        let columns: Vec<Option<Cdf>> = (0..=height).into_par_iter().map(column).collect();
        let total = |column: &Option<Cdf>| column.as_ref().map_or(0.0, Cdf::total);
        let rows = Cdf::new(columns.iter().zip(&texels.bands).map(|(c, band)| total(c) * f64::from(band.height)))?;
        let mean = mean(width, height, radiance);
        let image = ImageEnvironment { texels, rotation: rotation.sin_cos(), rows, columns, mean, cosine: 0.0 };
        Some(ImageEnvironment { cosine: image.best_share(), ..image })
    }

    /// The share of the cosine with the least variance of unoccluded light on white surfaces, in the mean over normals,
    /// where bounces, which follow the cosine, find the light as well and both are weighed by the balance heuristic:
    /// `int f^2 / (p + q) - (int f p / (p + q))^2 - (int f q / (p + q))^2` for the densities p and q.
    fn best_share(&self) -> f32 {
        let normals = (0..27).map(|i| Vec3::new((i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32) - 1.0);
        let normals: Vec<Vec3> = normals.filter_map(Vec3::try_normalize).collect();
        // Integrals by normal and share.
        let mut integrals = vec![[[0.0; 3]; SHARES]; normals.len()];
        for i in 0..SHARE_SAMPLES {
            let u = Vec2::new((i as f32 + 0.5) / SHARE_SAMPLES as f32, i.reverse_bits() as f32 * 0.5f32.powi(32));
            let Some(EnvironmentSample { wi, pdf_w, radiance }) = self.sample(u) else { continue };
            for (n, of_normal) in normals.iter().zip(&mut integrals) {
                let bounce = wi.dot(*n).max(0.0) * FRAC_1_PI;
                let light = luminance(radiance) * bounce;
                for (share, [squares, by_light, by_bounce]) in of_normal.iter_mut().enumerate() {
                    let density = lerp(pdf_w, bounce, share as f32 / SHARES as f32);
                    let both = f64::from(density + bounce) * f64::from(pdf_w) * f64::from(SHARE_SAMPLES);
                    *squares += f64::from(light).powi(2) / both;
                    *by_light += f64::from(light * density) / both;
                    *by_bounce += f64::from(light * bounce) / both;
                }
            }
        }
        let variance = |share: usize| -> f64 {
            integrals.iter().map(|of_normal| of_normal[share]).map(|[s, p, q]| s - p * p - q * q).sum()
        };
        let best = (0..SHARES).min_by(|&a, &b| variance(a).total_cmp(&variance(b))).unwrap_or_default();
        let pays = variance(best) < MAX_VARIANCE_RATIO * variance(0);
        if pays { best as f32 / SHARES as f32 } else { 0.0 }
    }

    #[inline]
    fn to_image(&self, d: Vec3) -> Vec3 {
        let (s, c) = self.rotation;
        // The image is rotated counter-clockwise about +Y, seen from above; a look-up rotates back.
        Vec3::new(c * d.x - s * d.z, d.y, s * d.x + c * d.z)
    }

    #[inline]
    fn to_world(&self, d: Vec3) -> Vec3 {
        let (s, c) = self.rotation;
        Vec3::new(c * d.x + s * d.z, d.y, -s * d.x + c * d.z)
    }

    /// Radiance from direction `d`, the density with which `sample` draws it, and its band and strip.
    fn look_up(&self, d: Vec3) -> (Rgb, f32, [usize; 2]) {
        let (d, Texels { width, bands, .. }) = (self.to_image(d), &self.texels);
        let sin_theta = (d.x * d.x + d.z * d.z).sqrt();
        let v = 2.0 * atan2_turns(sin_theta, d.y);
        let k = ((v * (bands.len() - 1) as f32 + 0.5) as usize).min(bands.len() - 1);
        let band = &bands[k];
        // Patches begin at the centre of texel 0.
        let x = (0.5 + atan2_turns(d.z, d.x)) * *width as f32 - 0.5;
        let x = if x < 0.0 { x + *width as f32 } else { x };
        let column = (x as usize).min(width - 1);
        let (strip, patch) = (column / PATCHES, column % PATCHES);
        let at = Vec2::new(x - column as f32, (v - band.start) / band.height).clamp(Vec2::ZERO, Vec2::ONE);
        let patches = self.texels.patches(k, strip);
        let radiance = patches.radiance(patch, at);
        let Some(columns) = &self.columns[k] else { return (radiance, 0.0, [k, strip]) };
        let probability = self.rows.pdf(k) * columns.pdf(strip);
        (radiance, self.texels.density(band, probability, patches.density(patch, at), sin_theta), [k, strip])
    }

    fn sample(&self, u: Vec2) -> Option<EnvironmentSample> {
        let (k, pdf_y, rest_y) = self.rows.sample(f64::from(u.x));
        let (strip, pdf_x, rest_x) = self.columns[k].as_ref()?.sample(f64::from(u.y));
        Some(self.sample_strip(k, strip, pdf_y * pdf_x, Vec2::new(rest_x, rest_y)))
    }

    /// Samples a point of a strip of band `k` by the uniform point `u`. `probability` is that of the strip.
    #[inline]
    fn sample_strip(&self, k: usize, strip: usize, probability: f32, u: Vec2) -> EnvironmentSample {
        let (band, patches) = (&self.texels.bands[k], self.texels.patches(k, strip));
        let (patch, at) = patches.sample(u);
        let (sin_theta, cos_theta) = sin_cos_turns(0.5 * (band.start + band.height * at.y));
        let x = (strip * PATCHES + patch) as f32 + 0.5 + at.x;
        let (sin_phi, cos_phi) = sin_cos_turns(x / self.texels.width as f32 - 0.5);
        let wi = self.to_world(Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi));
        let pdf_w = self.texels.density(band, probability, patches.density(patch, at), sin_theta);
        EnvironmentSample { wi, pdf_w, radiance: patches.radiance(patch, at) }
    }

    /// The sector that contains a strip of a band.
    #[inline]
    fn sector(&self, [band, strip]: [usize; 2]) -> usize {
        let row = band * SECTOR_ROWS / self.texels.bands.len();
        row * SECTOR_COLUMNS + strip * SECTOR_COLUMNS / self.texels.row
    }

    /// The bands and the strips of a sector.
    #[inline]
    fn parts_of_sector(&self, sector: usize) -> [Range<usize>; 2] {
        let part = |i: usize, parts: usize, all: usize| (i * all).div_ceil(parts)..((i + 1) * all).div_ceil(parts);
        let bands = part(sector / SECTOR_COLUMNS, SECTOR_ROWS, self.texels.bands.len());
        [bands, part(sector % SECTOR_COLUMNS, SECTOR_COLUMNS, self.texels.row)]
    }

    fn sectors(&self) -> Sectors {
        let (mut probabilities, mut bands) = (Vec::with_capacity(SECTORS), Vec::with_capacity(SECTORS));
        for sector in 0..SECTORS {
            let [own, strips] = self.parts_of_sector(sector);
            let within = |columns: &Cdf| columns.below(strips.end) - columns.below(strips.start);
            let probability = |k: usize| f64::from(self.rows.pdf(k)) * self.columns[k].as_ref().map_or(0.0, within);
            probabilities.push(own.clone().map(probability).sum::<f64>() as f32);
            bands.push(Cdf::new(own.map(probability)));
        }
        Sectors { probabilities, bands }
    }

    /// Samples a direction in a sector by the uniform point `u`. Its density is that of `sample`, over all sectors.
    #[inline]
    fn sample_sector(&self, sectors: &Sectors, sector: usize, u: Vec2) -> Option<EnvironmentSample> {
        let [bands, strips] = self.parts_of_sector(sector);
        let (k, _, rest_y) = sectors.bands[sector].as_ref()?.sample(f64::from(u.x));
        let k = bands.start + k;
        let columns = self.columns[k].as_ref()?;
        let [below, end] = [strips.start, strips.end].map(|strip| columns.below(strip));
        let among = (below + f64::from(u.y) * (end - below)).min(end.next_down());
        let (strip, pdf_x, rest_x) = columns.sample(among);
        Some(self.sample_strip(k, strip, self.rows.pdf(k) * pdf_x, Vec2::new(rest_x, rest_y)))
    }
}

impl Band {
    /// Band `k` of an image of `height` rows of texels, each of `row` strips.
    fn new(k: usize, height: usize, row: usize, brightest: f32) -> Band {
        let edge = |k: usize| (k as f64 - 0.5).clamp(0.0, height as f64) / height as f64;
        let (start, end) = (edge(k), edge(k + 1));
        // At the poles the sine is zero, or below zero by rounding.
        let weight = |v: f64| ((std::f64::consts::PI * v).sin().max(0.0) / f64::from(brightest)) as f32;
        Band {
            first: [k.saturating_sub(1), k.min(height - 1)].map(|y| y * row),
            start: start as f32,
            height: (end - start) as f32,
            weights: [start, end].map(weight),
        }
    }
}

/// The sector of a uniform environment that contains a direction.
#[inline]
fn uniform_sector(d: Vec3) -> usize {
    let row = ((0.5 - 0.5 * d.z) * SECTOR_ROWS as f32) as usize;
    // Azimuths from -1/2 turn on; the remainder makes them start at 0.
    let column = (atan2_turns(d.y, d.x) * SECTOR_COLUMNS as f32).floor() as i32;
    row.min(SECTOR_ROWS - 1) * SECTOR_COLUMNS + column.rem_euclid(SECTOR_COLUMNS as i32) as usize
}

/// Radiance of an image averaged over all directions.
fn mean(width: usize, height: usize, radiance: &[[f32; 3]]) -> Rgb {
    let (mut sum, mut weight) = (glam::DVec3::ZERO, 0.0);
    for (y, row) in radiance.chunks(width).enumerate() {
        let w = (std::f64::consts::PI * (y as f64 + 0.5) / height as f64).sin();
        for &texel in row {
            sum += w * Vec3::from_array(texel).as_dvec3();
        }
        weight += w * width as f64;
    }
    (sum / weight).as_vec3()
}

impl Environment {
    /// Radiance (W/m2/sr) that arrives from direction `d` (unit, pointing away from the scene), and the density per solid
    /// angle with which [`Environment::sample`] draws the direction.
    #[inline]
    pub fn radiance_and_pdf_w(&self, d: Vec3) -> (Rgb, f32) {
        match self {
            Environment::Uniform(radiance) => (*radiance, 0.25 * FRAC_1_PI),
            Environment::Image(image) => {
                let (radiance, pdf_w, _) = image.look_up(d);
                (radiance, pdf_w)
            }
        }
    }

    /// [`Environment::radiance_and_pdf_w`], and the sector that contains the direction.
    #[inline]
    pub(super) fn look_up(&self, d: Vec3) -> (Rgb, f32, usize) {
        match self {
            Environment::Uniform(radiance) => (*radiance, 0.25 * FRAC_1_PI, uniform_sector(d)),
            Environment::Image(image) => {
                let (radiance, pdf_w, strip) = image.look_up(d);
                (radiance, pdf_w, image.sector(strip))
            }
        }
    }

    /// Divides the directions into sectors.
    pub(super) fn sectors(&self) -> Sectors {
        match self {
            Environment::Uniform(_) => {
                Sectors { probabilities: vec![1.0 / SECTORS as f32; SECTORS], bands: Vec::new() }
            }
            Environment::Image(image) => image.sectors(),
        }
    }

    /// Samples a direction in a sector by the uniform point `u`, with the density of [`Environment::sample`] over the
    /// probability of the sector. The result holds the density of [`Environment::sample`].
    #[inline]
    pub(super) fn sample_sector(&self, sectors: &Sectors, sector: usize, u: Vec2) -> Option<EnvironmentSample> {
        match self {
            Environment::Uniform(_) => {
                let (row, column) = ((sector / SECTOR_COLUMNS) as f32, (sector % SECTOR_COLUMNS) as f32);
                self.sample(Vec2::new((row + u.x) / SECTOR_ROWS as f32, (column + u.y) / SECTOR_COLUMNS as f32))
            }
            Environment::Image(image) => image.sample_sector(sectors, sector, u),
        }
    }

    /// Samples a direction towards the environment, in proportion to the luminance of an image. `None` where an image is
    /// black.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<EnvironmentSample> {
        match self {
            Environment::Uniform(radiance) => {
                let wi = warp::sphere_uniform(u);
                Some(EnvironmentSample { wi, pdf_w: 0.25 * FRAC_1_PI, radiance: *radiance })
            }
            Environment::Image(image) => image.sample(u).filter(|sample| sample.pdf_w > 0.0),
        }
    }

    /// Samples a direction for a receiver with the unit normal `n`: with the probability [`Environment::cosine_share`] in
    /// proportion to the cosine, else as [`Environment::sample`] does, which gives the density of the result. If `n` is
    /// zero, light comes from any direction.
    #[inline]
    pub fn sample_at(&self, n: Vec3, u: Vec2) -> Option<EnvironmentSample> {
        let share = if n == Vec3::ZERO { 0.0 } else { self.cosine_share() };
        if u.x < share {
            let wi = Frame::from_normal(n).to_world(warp::hemisphere_cosine(Vec2::new(u.x / share, u.y)));
            let (radiance, pdf_w) = self.radiance_and_pdf_w(wi);
            return Some(EnvironmentSample { wi, pdf_w, radiance });
        }
        self.sample(Vec2::new(((u.x - share) / (1.0 - share)).min(1.0f32.next_down()), u.y))
    }

    /// Samples a direction as [`Environment::sample_at`] does, and returns it with the density of that.
    #[inline]
    pub(super) fn sample_with_density_at(&self, n: Vec3, u: Vec2) -> Option<(EnvironmentSample, f32)> {
        let sample = self.sample_at(n, u)?;
        let density = self.pdf_w_at(n, sample.wi, sample.pdf_w);
        Some((sample, density))
    }

    /// Density per solid angle with which [`Environment::sample_at`] samples the direction `d`, which
    /// [`Environment::sample`] samples with the density `pdf_w`.
    #[inline]
    pub fn pdf_w_at(&self, n: Vec3, d: Vec3, pdf_w: f32) -> f32 {
        if n == Vec3::ZERO { pdf_w } else { lerp(pdf_w, d.dot(n).max(0.0) * FRAC_1_PI, self.cosine_share()) }
    }

    /// Share of the directions in next-event estimation at surfaces that are sampled by the cosine, which wastes none
    /// below the horizon. The rest is sampled by luminance.
    pub(super) fn cosine_share(&self) -> f32 {
        match self {
            Environment::Uniform(_) => UNIFORM_SHARE,
            Environment::Image(image) => image.cosine,
        }
    }

    /// Radiance averaged over all directions (W/m2/sr).
    pub fn mean(&self) -> Rgb {
        match self {
            Environment::Uniform(radiance) => *radiance,
            Environment::Image(image) => image.mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    fn image(rotation: f32) -> Environment {
        let (w, h) = (32usize, 16usize);
        let mut texels = vec![[0.1, 0.2, 0.05]; w * h];
        texels[5 * w + 20] = [100.0, 80.0, 60.0];
        for x in 0..w {
            texels[15 * w + x] = [0.0; 3];
        }
        Environment::Image(Arc::new(ImageEnvironment::new(w, h, &texels, rotation).unwrap()))
    }

    /// Importance sampling and uniform sampling estimate the same integral of radiance, and `pdf_w` returns the density
    /// of each sample.
    #[test]
    fn samples_follow_their_density() {
        let environment = image(0.7);
        let n = 200_000u64;
        let (mut by_importance, mut squares, mut by_uniform, mut uniform_squares) = (0.0, 0.0, 0.0, 0.0);
        let mut wrong = 0;
        for i in 0..n {
            let u = Stream::new(1, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
            let EnvironmentSample { wi, pdf_w, radiance } = environment.sample(u).unwrap();
            assert!((wi.length() - 1.0).abs() < 1e-6);
            let (found, pdf) = environment.radiance_and_pdf_w(wi);
            wrong += u32::from((pdf_w - pdf).abs() > 1e-3 * pdf || (radiance - found).length() > 1e-3 * found.length());
            let x = f64::from(luminance(radiance) / pdf_w);
            by_importance += x;
            squares += x * x;
            let d = warp::sphere_uniform(Stream::new(2, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint));
            let x = f64::from(luminance(environment.radiance_and_pdf_w(d).0) * 4.0 * PI);
            by_uniform += x;
            uniform_squares += x * x;
        }
        // Rounding rarely moves a direction into the next cell.
        assert!(wrong < 200, "{wrong} of {n} directions have another density than they were sampled with");
        let n = n as f64;
        let (a, b) = (by_importance / n, by_uniform / n);
        let variance = (squares / n - a * a) / n + (uniform_squares / n - b * b) / n;
        // Two-sided 4 sigma: one false alarm in 16,000 seeds.
        assert!((a - b).abs() < 4.0 * variance.sqrt(), "{a} {b} +- {}", variance.sqrt());
    }

    /// The irradiance at surfaces of any normal is that of sampling by luminance alone, with at most a quarter of the
    /// variance under a uniform sky, less under a dim one, and no more around a small sun.
    #[test]
    fn surfaces_receive_the_same_light_with_less_noise() {
        let dim: Vec<[f32; 3]> = (0..32 * 16).map(|i| [1.0 + (i / 32) as f32 * 0.02; 3]).collect();
        let dim = Environment::Image(Arc::new(ImageEnvironment::new(32, 16, &dim, 0.2).unwrap()));
        for (environment, most) in [(Environment::Uniform(Rgb::ONE), 0.25), (dim, 0.4), (image(0.7), 1.05)] {
            let mut variances = [0.0; 2];
            for k in 0..8 {
                let n = warp::sphere_uniform(Stream::new(5, 0, Domain::Test, k).vertex(0).two(Purpose::LightPoint));
                // Of sampling by luminance, and for a receiver of the normal: mean, and variance of the mean.
                let [plain, cosine] = [Vec3::ZERO, n].map(|normal| {
                    let count = 20_000u64;
                    let (mut sum, mut squares) = (0.0, 0.0);
                    for i in 0..count {
                        let u = Stream::new(6 + k, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
                        let EnvironmentSample { wi, pdf_w, radiance } = environment.sample_at(normal, u).unwrap();
                        let density = environment.pdf_w_at(normal, wi, pdf_w);
                        let x = f64::from(luminance(radiance) * wi.dot(n).max(0.0) / density);
                        sum += x;
                        squares += x * x;
                    }
                    let mean = sum / count as f64;
                    (mean, (squares / count as f64 - mean * mean) / count as f64)
                });
                // Two-sided 4.5 sigma, 24 times: one false alarm in 6,000 seeds.
                assert!((plain.0 - cosine.0).abs() < 4.5 * (plain.1 + cosine.1).sqrt(), "{n}: {plain:?} {cosine:?}");
                variances = [variances[0] + plain.1, variances[1] + cosine.1];
            }
            let share = environment.cosine_share();
            assert!(variances[1] <= most * variances[0], "{variances:?}, share {share}");
        }
    }

    /// `interface.md`: u = 1/2 + atan2(z, x) / 2 pi; a rotation turns the image counter-clockwise seen from above (+Y).
    #[test]
    fn mapping_and_rotation_are_as_documented() {
        let (w, h) = (64usize, 32usize);
        let mut texels = vec![[0.0; 3]; w * h];
        texels[16 * w + w / 2] = [1.0; 3]; // u just above 1/2: direction +X
        let at = |rotation: f32| {
            let image = ImageEnvironment::new(w, h, &texels, rotation).unwrap();
            [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z]
                .map(|d| Environment::Image(Arc::new(image.clone())).radiance_and_pdf_w(d).0.x > 0.1)
        };
        assert_eq!(at(0.0), [true, false, false, false, false]);
        // Seen from +Y with X to the right, counter-clockwise by a quarter turns +X to -Z.
        assert_eq!(at(std::f32::consts::FRAC_PI_2), [false, false, false, false, true]);
    }

    /// Images of any size, with widths that fill no strip, and with texels at the poles: samples are spread over the
    /// sphere with their density, so that the mean of 1 / density is the solid angle.
    #[test]
    fn images_of_any_size_are_sampled_everywhere() {
        for (w, h) in [(1usize, 1usize), (2, 1), (3, 2), (5, 3), (7, 16), (64, 32)] {
            let texels: Vec<[f32; 3]> = (0..w * h).map(|i| [1.0 + (i * 7 % 5) as f32, 1.0, 2.0]).collect();
            let image = Environment::Image(Arc::new(ImageEnvironment::new(w, h, &texels, 0.3).unwrap()));
            let n = 100_000u64;
            let mut moments = [glam::DVec4::ZERO; 2];
            for i in 0..n {
                let u = Stream::new(3, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
                let EnvironmentSample { wi, pdf_w, radiance } = image.sample(u).unwrap();
                assert!(radiance.min_element() >= 0.999 && pdf_w.is_finite(), "{w} x {h}: {wi} {pdf_w}");
                let x = wi.as_dvec3().extend(1.0) / f64::from(pdf_w);
                moments = [moments[0] + x, moments[1] + x * x];
            }
            let [mean, square] = moments.map(|sum| sum / n as f64);
            let error = ((square - mean * mean) / n as f64).max(glam::DVec4::ZERO).powf(0.5);
            // Four two-sided tests at 4.5 sigma for each of six images: one false alarm in 6,000 seeds.
            let apart = (mean - glam::DVec4::new(0.0, 0.0, 0.0, 4.0 * std::f64::consts::PI)).abs();
            assert!(apart.cmple(4.5 * error).all(), "{w} x {h}: {mean} +- {error}");
        }
    }

    /// Away from the poles the density is proportional to the luminance, also around a sun of one texel: the samples of
    /// an unoccluded environment have no noise.
    #[test]
    fn the_density_is_proportional_to_the_luminance() {
        let (w, h) = (128usize, 64usize);
        let mut texels: Vec<[f32; 3]> = (0..w * h).map(|i| [0.5 + (i * 7 % 11) as f32 * 0.02; 3]).collect();
        texels[20 * w + 33] = [10_000.0; 3];
        let image = ImageEnvironment::new(w, h, &texels, 0.0).unwrap();
        for i in 0..20_000u64 {
            let u = Stream::new(4, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
            let EnvironmentSample { wi, pdf_w, radiance } = image.sample(u).unwrap();
            let ratio = luminance(radiance) / pdf_w / (4.0 * PI * luminance(image.mean));
            assert!(wi.y.abs() > 0.9 || (0.95..1.05).contains(&ratio), "{ratio} at {wi}");
        }
    }
}
