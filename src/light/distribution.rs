//! The intensity of a light by direction: a pattern (a photometric profile or a picture), limited to the cone of a spot,
//! with its importance sampling.
//!
//! Directions are in the frame of the light, whose normal is the axis. A grid divides them into cells. A sample selects
//! a cell by its flux, and a direction uniformly in the coordinates of the grid. Densities and intensities are exact for
//! any grid; a cell without light is never selected.

use super::cdf::Cdf;
use super::picture::Picture;
use super::profile::{Profile, interval, one_minus_cos_of, polar_angle};
use super::spot::{SpotEdge, spot_falloff};
use crate::math::{DVec3, Rgb, Vec2, Vec3, luminance, warp};
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Largest extent of a cell in the polar angle (radians).
const MAX_POLAR_STEP: f32 = PI / 90.0;
/// Smallest number of rows of cells between the axis and the edge of the light.
const MIN_ROWS: f32 = 32.0;
/// Largest extent of a cell in the azimuth (turns).
const MAX_AZIMUTH_STEP: f32 = 1.0 / 36.0;
/// Smallest and largest number of cells across a picture, and down.
const PICTURE_CELLS: [usize; 2] = [32, 512];
/// Half angle (radians) of the widest cone that limits the cells of a picture.
const MAX_PICTURE_ANGLE: f32 = 1.55;
/// Share of the largest value in a cell that its weight has at least, so that no direction with light is too improbable.
const PEAK_SHARE: f64 = 0.05;

/// Radiation pattern of a light: its emission in each direction, relative to its intensity.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// A measured photometric profile.
    Profile(Profile),
    /// A picture that the light throws.
    Picture(Picture),
}

/// The cone of a spot; the half angles are given as 1 minus the cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotCone {
    /// Half angle of the cone of full intensity.
    pub inner: f32,
    /// Half angle beyond which there is no light; greater than `inner`.
    pub outer: f32,
    /// Falloff of the intensity between `inner` and `outer`.
    pub edge: SpotEdge,
}

/// The relative intensity of a light over directions, which light paths sample by its flux.
#[derive(Clone, Debug)]
pub struct Distribution {
    pattern: Arc<Pattern>,
    cone: Option<SpotCone>,
    grid: Grid,
    /// Integral of the relative intensity over all directions (sr).
    flux: Rgb,
    /// Largest luminance of the relative intensity.
    peak: f32,
    /// Half angle of the cone around the axis that has all light, as 1 minus its cosine.
    reach: f32,
}

/// The grid is determined by the pattern and the cone.
impl PartialEq for Distribution {
    fn eq(&self, other: &Distribution) -> bool {
        self.cone == other.cone && (Arc::ptr_eq(&self.pattern, &other.pattern) || self.pattern == other.pattern)
    }
}

/// The light at a point of a grid.
struct Value {
    /// Relative intensity of the pattern.
    intensity: Rgb,
    /// Factor of the cone on the intensity.
    falloff: f32,
    /// Solid angle per area of the coordinates.
    solid_angle: f32,
}

/// Cells between ascending edges of rows and columns, with the probabilities of their selection.
#[derive(Clone, Debug)]
struct Grid {
    edges: [Vec<f32>; 2],
    rows: Cdf,
    /// Selects a column of each row; `None` for rows without light.
    columns: Vec<Option<Cdf>>,
}

impl Grid {
    /// Makes the grid of cells with the given edges; `weight` gives the weight of the cell in a row and a column. `None`
    /// if all weights are zero.
    fn new(edges: [Vec<f32>; 2], weight: impl Fn(usize, usize) -> f64) -> Option<Grid> {
        let across = edges[1].len() - 1;
        let columns = (0..edges[0].len() - 1).map(|row| Cdf::new((0..across).map(|column| weight(row, column))));
        let columns: Vec<Option<Cdf>> = columns.collect();
        let rows = Cdf::new(columns.iter().map(|row| row.as_ref().map_or(0.0, Cdf::total)))?;
        Some(Grid { edges, rows, columns })
    }

    fn extent(&self, axis: usize, index: usize) -> f32 {
        self.edges[axis][index + 1] - self.edges[axis][index]
    }

    /// Samples a point by the uniform point `u`. Returns it with its density per area.
    #[inline]
    fn sample(&self, u: Vec2) -> Option<(Vec2, f32)> {
        let (row, pdf_row, y) = self.rows.sample(f64::from(u.x));
        let (column, pdf_column, x) = self.columns[row].as_ref()?.sample(f64::from(u.y));
        let [height, width] = [self.extent(0, row), self.extent(1, column)];
        let at = Vec2::new(self.edges[0][row] + height * y, self.edges[1][column] + width * x);
        Some((at, pdf_row * pdf_column / (height * width)))
    }

    /// Density per area with which a point is sampled.
    #[inline]
    fn density(&self, at: Vec2) -> f32 {
        let outside = |edges: &[f32], x: f32| !(edges[0] <= x && x <= edges[edges.len() - 1]);
        if outside(&self.edges[0], at.x) || outside(&self.edges[1], at.y) {
            return 0.0;
        }
        let (row, column) = (interval(&self.edges[0], at.x).0, interval(&self.edges[1], at.y).0);
        let Some(columns) = &self.columns[row] else { return 0.0 };
        self.rows.pdf(row) * columns.pdf(column) / (self.extent(0, row) * self.extent(1, column))
    }

    /// Density at a point that rounding may have moved out of the grid, where a hard edge still has light.
    #[inline]
    fn density_near(&self, at: Vec2) -> f32 {
        const TOLERANCE: f32 = 8.0 * f32::EPSILON * PI;
        let [rows, columns] = &self.edges;
        let inside =
            at.clamp(Vec2::new(rows[0], columns[0]), Vec2::new(rows[rows.len() - 1], columns[columns.len() - 1]));
        if (at - inside).abs().max_element() > TOLERANCE { 0.0 } else { self.density(inside) }
    }
}

/// Ascending edges from `start` to `end` with all `knots` between them, at most `step` apart.
fn edges(start: f32, end: f32, step: f32, knots: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut marks: Vec<f32> = knots.filter(|&x| start < x && x < end).chain([start, end]).collect();
    marks.sort_by(f32::total_cmp);
    marks.dedup();
    let mut out = vec![start];
    for pair in marks.windows(2) {
        let parts = ((pair[1] - pair[0]) / step).ceil().max(1.0);
        out.extend((1..parts as usize).map(|k| pair[0] + (pair[1] - pair[0]) * (k as f32 / parts)));
        out.push(pair[1]);
    }
    out.dedup();
    out
}

impl Distribution {
    /// The distribution of a pattern, limited to the cone of a spot if there is one. `None` if no light is left.
    pub fn new(pattern: Arc<Pattern>, cone: Option<SpotCone>) -> Option<Distribution> {
        match &*pattern {
            Pattern::Profile(profile) => Self::of_profile(&pattern, profile, cone),
            Pattern::Picture(picture) => Self::of_picture(&pattern, picture, cone),
        }
    }

    fn of_profile(pattern: &Arc<Pattern>, profile: &Profile, cone: Option<SpotCone>) -> Option<Distribution> {
        if profile.has_own_pole() {
            return Self::about_pole(pattern, profile, cone);
        }
        let [first, last] = profile.lit();
        let last = cone.map_or(last, |cone| last.min(polar_angle(cone.outer)));
        if first >= last {
            return None;
        }
        let bends = cone.into_iter().flat_map(|cone| [polar_angle(cone.inner), polar_angle(cone.outer)]);
        let step = MAX_POLAR_STEP.min((last - first) / MIN_ROWS);
        let mut rows = edges(first, last, step, profile.polar().iter().copied().chain(bends));
        rows.iter_mut().for_each(|angle| *angle = one_minus_cos_of(*angle));
        rows.dedup();
        let reach = rows[rows.len() - 1];
        let azimuth = profile.azimuth();
        let turn = [azimuth[0], azimuth[azimuth.len() - 1]];
        let columns = match profile.is_symmetric() {
            true => turn.to_vec(),
            false => edges(turn[0], turn[1], MAX_AZIMUTH_STEP, azimuth.iter().copied()),
        };
        let value = |at: Vec2| {
            let intensity = Rgb::splat(profile.at(polar_angle(at.x), at.y));
            Value { intensity, falloff: falloff(cone, at.x), solid_angle: TAU }
        };
        Distribution::from_cells(pattern, cone, reach, [rows, columns], 1, value)
    }

    /// The distribution of a profile whose pole is across the axis of the light. The coordinates are the angles about that
    /// pole; the axis is at azimuth 0 of the equator.
    fn about_pole(pattern: &Arc<Pattern>, profile: &Profile, cone: Option<SpotCone>) -> Option<Distribution> {
        let (mut polar, azimuth) = (profile.lit(), profile.azimuth());
        let mut turns = [azimuth[0], azimuth[azimuth.len() - 1]];
        // The part of the angles that is within the cone.
        if let Some(outer) = cone.map(|cone| polar_angle(cone.outer)).filter(|&outer| outer < FRAC_PI_2) {
            polar = [polar[0].max(FRAC_PI_2 - outer), polar[1].min(FRAC_PI_2 + outer)];
            turns = [turns[0].max(-outer / TAU), turns[1].min(outer / TAU)];
        }
        if polar[0] >= polar[1] || turns[0] >= turns[1] {
            return None;
        }
        let step = |[start, end]: [f32; 2], most: f32| most.min((end - start) / MIN_ROWS);
        // The axis is at the corner of a cell, so that the falloff of the cone decreases away from it in each cell.
        let knots = profile.polar().iter().copied().chain([FRAC_PI_2]);
        let mut rows = edges(polar[0], polar[1], step(polar, MAX_POLAR_STEP), knots);
        rows.iter_mut().for_each(|angle| *angle = one_minus_cos_of(*angle));
        rows.dedup();
        let knots = azimuth.iter().copied().chain([-0.25, 0.0, 0.25]);
        let columns = edges(turns[0], turns[1], step(turns, MAX_AZIMUTH_STEP), knots);
        let height = |at: Vec2| Self::height(profile.direction_from_pole(Self::around_pole(at)));
        let corners = rows.iter().flat_map(|&row| columns.iter().map(move |&column| Vec2::new(row, column)));
        let widest = corners.map(height).fold(0.0, f32::max) + 4.0 * f32::EPSILON;
        let reach = cone.map_or(widest, |cone| widest.min(cone.outer)).min(2.0);
        let value = |at: Vec2| {
            let intensity = Rgb::splat(profile.at(polar_angle(at.x), at.y));
            Value { intensity, falloff: falloff(cone, height(at)), solid_angle: TAU }
        };
        Distribution::from_cells(pattern, cone, reach, [rows, columns], 1, value)
    }

    /// The unit direction, in the frame of the pole, with these coordinates: 1 minus the cosine of the angle to the pole, and
    /// the azimuth (turns).
    #[inline]
    fn around_pole(at: Vec2) -> Vec3 {
        let sin = (at.x * (2.0 - at.x)).max(0.0).sqrt();
        warp::around_z(sin, 1.0 - at.x, at.y)
    }

    fn of_picture(pattern: &Arc<Pattern>, picture: &Picture, cone: Option<SpotCone>) -> Option<Distribution> {
        // The part of the picture that is within the cone.
        let tangent = cone.map_or(FRAC_PI_2, |cone| polar_angle(cone.outer)).min(MAX_PICTURE_ANGLE).tan();
        let part = picture.half_size().map(|half| (tangent / half).min(1.0));
        let texels = [0, 1].map(|axis| (picture.size()[axis] as f32 * part[axis]).ceil() as usize);
        // An even number, so that the axis is at the corner of a cell: the falloff decreases away from it.
        let cells = texels.map(|n| n.clamp(PICTURE_CELLS[0], PICTURE_CELLS[1]).next_multiple_of(2));
        let edges = |axis: usize| {
            let at = |k: usize| part[axis] * (2.0 * k as f32 / cells[axis] as f32 - 1.0);
            (0..=cells[axis]).map(at).collect::<Vec<f32>>()
        };
        let edges = [edges(0), edges(1)];
        // Points of a cell are at most half a texel apart, so no bright texel is overlooked.
        let steps = texels[0].div_ceil(cells[0]).max(texels[1].div_ceil(cells[1]));
        let corner = one_minus_cos_of(Vec2::from_array(picture.half_size()).length().atan());
        let reach = cone.map_or(corner, |cone| corner.min(cone.outer));
        let value = |at: Vec2| Value {
            intensity: picture.at(at),
            falloff: falloff(cone, Self::height(picture.direction(at))),
            solid_angle: picture.solid_angle(at),
        };
        Distribution::from_cells(pattern, cone, reach, edges, steps, value)
    }

    /// The distribution over cells with the given edges. `value` gives the light at coordinates of the grid, and is
    /// evaluated at `2 * steps + 1` points along each side of a cell.
    fn from_cells(
        pattern: &Arc<Pattern>,
        cone: Option<SpotCone>,
        reach: f32,
        edges: [Vec<f32>; 2],
        steps: usize,
        value: impl Fn(Vec2) -> Value + Sync,
    ) -> Option<Distribution> {
        if edges.iter().any(|edges| edges.len() < 2) {
            return None;
        }
        // Weights of the composite Simpson rule.
        let simpson = |k: usize| {
            let weight = if k == 0 || k == 2 * steps { 1.0 } else { [2.0, 4.0][k % 2] };
            weight / (6.0 * steps as f64)
        };
        let cell = |row: &[f32], column: &[f32]| {
            let (mut flux, mut mean, mut brightest, mut widest) = (DVec3::ZERO, 0.0f64, 0.0f32, 0.0f32);
            let at = |edges: &[f32], k: usize| edges[0] + (edges[1] - edges[0]) * (k as f32 / (2 * steps) as f32);
            let mut solid_angle = 0.0f64;
            for (i, j) in (0..=2 * steps).flat_map(|i| (0..=2 * steps).map(move |j| (i, j))) {
                let value = value(Vec2::new(at(row, i), at(column, j)));
                let weight = simpson(i) * simpson(j) * f64::from(value.solid_angle);
                flux += (value.intensity * value.falloff).as_dvec3() * weight;
                mean += f64::from(luminance(value.intensity) * value.falloff) * weight;
                brightest = brightest.max(luminance(value.intensity));
                widest = widest.max(value.falloff);
                solid_angle += weight;
            }
            let area = f64::from(row[1] - row[0]) * f64::from(column[1] - column[0]);
            let peak = brightest * widest;
            let weight = mean * (1.0 - PEAK_SHARE) + solid_angle * f64::from(peak) * PEAK_SHARE;
            (flux * area, weight * area, peak)
        };
        let row = |row: &[f32]| edges[1].windows(2).map(|column| cell(row, column)).collect::<Vec<_>>();
        let cells: Vec<Vec<(DVec3, f64, f32)>> = edges[0].par_windows(2).map(row).collect();
        let flux: DVec3 = cells.iter().flatten().map(|cell| cell.0).sum();
        let peak = cells.iter().flatten().map(|cell| cell.2).fold(0.0, f32::max);
        let grid = Grid::new(edges, |row, column| cells[row][column].1)?;
        Some(Distribution { pattern: Arc::clone(pattern), cone, grid, flux: flux.as_vec3(), peak, reach })
    }

    /// The radiation pattern, before the cone limits it.
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The cone that limits the pattern, if the light is a spot.
    pub fn cone(&self) -> Option<SpotCone> {
        self.cone
    }

    /// Integral of the relative intensity over all directions (sr).
    pub fn flux(&self) -> Rgb {
        self.flux
    }

    /// Largest luminance of the relative intensity.
    pub(super) fn peak(&self) -> f32 {
        self.peak
    }

    /// Half angle of the cone around the axis that has all light, as 1 minus its cosine.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// 1 minus the cosine of the angle between a unit direction in the frame of the light and the axis.
    #[inline]
    fn height(d: Vec3) -> f32 {
        0.5 * (d.x * d.x + d.y * d.y + (1.0 - d.z) * (1.0 - d.z))
    }

    /// Relative intensity along a unit direction in the frame of the light.
    #[inline]
    pub fn relative(&self, d: Vec3) -> Rgb {
        let height = Self::height(d);
        let falloff = falloff(self.cone, height);
        if falloff == 0.0 {
            return Rgb::ZERO;
        }
        match &*self.pattern {
            Pattern::Profile(profile) => {
                let d = profile.to_pole(d);
                Rgb::splat(profile.at(polar_angle(Self::height(d)), profile.turns(d)) * falloff)
            }
            Pattern::Picture(picture) => picture.coordinates(d).map_or(Rgb::ZERO, |at| picture.at(at) * falloff),
        }
    }

    /// Density per solid angle with which [`Distribution::sample`] samples a unit direction in the frame of the light.
    #[inline]
    pub fn pdf_w(&self, d: Vec3) -> f32 {
        match &*self.pattern {
            Pattern::Profile(profile) if profile.has_own_pole() => {
                let d = profile.to_pole(d);
                self.grid.density_near(Vec2::new(Self::height(d), profile.turns(d))) / TAU
            }
            Pattern::Profile(profile) => self.grid.density(Vec2::new(Self::height(d), profile.turns(d))) / TAU,
            Pattern::Picture(picture) => {
                picture.coordinates(d).map_or(0.0, |at| self.grid.density(at) / picture.solid_angle(at))
            }
        }
    }

    /// Samples a unit direction in the frame of the light by the uniform point `u`. Returns it with its density per solid
    /// angle. The relative intensity may be zero there.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        let (at, density) = self.grid.sample(u)?;
        match &*self.pattern {
            Pattern::Profile(profile) => Some((profile.direction_from_pole(Self::around_pole(at)), density / TAU)),
            Pattern::Picture(picture) => Some((picture.direction(at), density / picture.solid_angle(at))),
        }
    }
}

/// Falloff of a spot's cone at an angle to the axis, given as 1 minus its cosine; 1 without a cone.
#[inline]
fn falloff(cone: Option<SpotCone>, height: f32) -> f32 {
    cone.map_or(1.0, |SpotCone { inner, outer, edge }| spot_falloff(height, inner, outer, edge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Mat3;
    use crate::random::{Domain, Purpose, Stream};

    /// A random profile, with dark directions, of either symmetry.
    fn profile(seed: u64) -> Profile {
        let draws = |k: u64| Stream::new(31, k, Domain::Test, seed).vertex(0);
        let (rows, columns) =
            (2 + (seed % 9) as usize, if seed.is_multiple_of(3) { 1 } else { 3 + (seed % 5) as usize });
        let end = if seed.is_multiple_of(2) { PI } else { 0.5 * PI };
        let polar: Vec<f32> = (0..rows).map(|i| end * i as f32 / (rows - 1) as f32).collect();
        let azimuth: Vec<f32> = (0..=columns).map(|j| j as f32 / columns as f32 - 0.3).collect();
        let value = |i: usize, j: usize| {
            let x = draws((i * 100 + j % columns) as u64).one(Purpose::Lobe);
            if x < 0.3 { 0.0 } else { x * x }
        };
        let mut values: Vec<f32> =
            (0..=columns).flat_map(|j| (0..rows).map(move |i| (i, j))).map(|(i, j)| value(i, j)).collect();
        for j in [0, columns] {
            values[j * rows] = 1.0;
        }
        Profile::new(polar, azimuth, values).expect("a profile")
    }

    /// A random profile about a pole across the axis of the light, with hard edges.
    fn profile_about_pole(seed: u64) -> Profile {
        let draw = |k: u64| Stream::new(35, k, Domain::Test, seed).vertex(0).one(Purpose::Lobe);
        let range = |k: u64, n: usize, least: f32, most: f32| -> Vec<f32> {
            let half = least + (most - least) * draw(k);
            (0..n).map(|i| half * (2.0 * i as f32 / (n - 1) as f32 - 1.0 + 0.1 * draw(k + 1))).collect()
        };
        let (rows, columns) = (2 + (seed % 4) as usize, 2 + (seed % 3) as usize);
        let polar = range(0, rows, 0.002, 1.4).iter().map(|angle| FRAC_PI_2 + angle).collect();
        let azimuth = range(10, columns, 0.0003, 0.45);
        let value = |k: usize| if draw(k as u64 + 20) < 0.3 { 0.0 } else { draw(k as u64 + 50) };
        let mut values: Vec<f32> = (0..rows * columns).map(value).collect();
        values[rows * columns / 2] = 1.0;
        let (sin, cos) = (TAU * draw(99)).sin_cos();
        let pole = Vec3::new(cos, sin, 0.0);
        let mirrored = if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
        let to_pole = Mat3::from_cols(Vec3::Z, pole.cross(Vec3::Z) * mirrored, pole).transpose();
        Profile::about_pole(to_pole, polar, azimuth, values).expect("a profile")
    }

    /// A random picture with black texels.
    fn picture(seed: u64) -> Picture {
        let (width, height) = ([3, 40, 700][(seed % 3) as usize], [1, 50, 20][(seed / 3 % 3) as usize]);
        let value = |i: usize| {
            let x = Stream::new(33, seed, Domain::Test, i as u64).vertex(0).one(Purpose::Lobe);
            if x < 0.5 { 0.0 } else { x * x }
        };
        let mut texels: Vec<[f32; 3]> = (0..width * height).map(|i| [value(i), 0.5 * value(i), 0.2]).collect();
        texels.iter_mut().for_each(|texel| *texel = if texel[0] > 0.0 { *texel } else { [0.0; 3] });
        texels[0] = [1.0; 3];
        texels[width * height / 2] = [1.0; 3];
        Picture::new(width, height, texels, 0.2 + 0.4 * (seed % 4) as f32).expect("a picture")
    }

    fn pattern(seed: u64) -> Arc<Pattern> {
        Arc::new(match seed {
            0..24 => Pattern::Profile(profile(seed)),
            24..48 => Pattern::Picture(picture(seed)),
            _ => Pattern::Profile(profile_about_pole(seed)),
        })
    }

    fn cone(seed: u64) -> Option<SpotCone> {
        let outer = [0.004f32, 0.3, 0.9][(seed % 3) as usize];
        (!seed.is_multiple_of(4)).then_some(SpotCone { inner: 0.5 * outer, outer, edge: SpotEdge::Smooth })
    }

    /// Samples have the density that `pdf_w` returns, and their mean weight is the integral of the intensity. No
    /// direction with light has density zero.
    #[test]
    fn samples_match_their_density_and_carry_the_flux() {
        for seed in 0..72 {
            let Some(shape) = Distribution::new(pattern(seed), cone(seed)) else {
                // A narrow cone may see black texels alone.
                assert!(seed >= 24 && seed % 3 == 0, "{seed}");
                continue;
            };
            let (n, mut differing, mut mean, mut squares) = (300u32, 0, 0.0f64, 0.0f64);
            for i in 0..n * n {
                let within = Stream::new(34, seed, Domain::Test, u64::from(i)).vertex(0).two(Purpose::Pixel);
                let u = (Vec2::new((i % n) as f32, (i / n) as f32) + within) / n as f32;
                let (d, pdf) = shape.sample(u).expect("a direction");
                assert!((d.length() - 1.0).abs() < 1e-5);
                let weight = f64::from(shape.relative(d).x / pdf);
                mean += weight / f64::from(n * n);
                squares += weight * weight / f64::from(n * n);
                differing += u32::from((shape.pdf_w(d) / pdf - 1.0).abs() > 1e-4);
            }
            // At an edge of a cell, rounding may select its neighbour.
            assert!(differing < n * n / 200, "{seed}: {differing}");
            let flux = f64::from(shape.flux().x);
            // Four standard deviations: one false alarm in 300 seeds.
            assert!((mean / flux - 1.0).abs() < 6.5e-3, "{seed}: {mean}, {flux}");
            // Paths carry about the same flux: the variance of the weights is small.
            assert!(squares / (mean * mean) < 1.5, "{seed}: {}", squares / (mean * mean));
            let mut lit = 0;
            for i in 0..20_000 {
                let reach = shape.reach();
                let u = Stream::new(32, seed, Domain::Test, i).vertex(0).two(Purpose::Direction);
                let d = warp::cone_uniform(u, (1.2 * reach).min(2.0));
                let relative = shape.relative(d).x;
                assert!(relative == 0.0 || shape.pdf_w(d) > 0.0, "{seed}: {d}, {relative}");
                lit += usize::from(relative > 0.0);
            }
            // Long pictures cover a small part of the cone around them.
            assert!(lit > if seed < 24 { 1000 } else { 5 }, "{seed}: {lit}");
        }
    }
}
