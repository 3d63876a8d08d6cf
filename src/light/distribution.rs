//! The intensity of a light by direction: a pattern (a photometric profile), limited to the cone of a spot, with its
//! importance sampling.
//!
//! Directions are in the frame of the light, whose normal is the axis. A grid divides them into cells. A sample selects
//! a cell by its flux, and a direction uniformly in the coordinates of the grid. Densities and intensities are exact for
//! any grid; a cell without light is never selected.

use super::cdf::Cdf;
use super::emitter::{SpotEdge, spot_falloff};
use super::profile::{Profile, interval, one_minus_cos_of, polar_angle};
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// Largest extent of a cell in the polar angle (radians).
const MAX_POLAR_STEP: f32 = PI / 90.0;
/// Smallest number of rows of cells between the axis and the edge of the light.
const MIN_ROWS: f32 = 32.0;
/// Largest extent of a cell in the azimuth (turns).
const MAX_AZIMUTH_STEP: f32 = 1.0 / 36.0;
/// Share of the largest value in a cell that its weight has at least, so that no direction with light is too improbable.
const PEAK_SHARE: f64 = 0.05;

/// What a light shines with in each direction, relative to its intensity.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// A measured photometric profile.
    Profile(Profile),
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
        let Pattern::Profile(profile) = &*pattern;
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
        let azimuth = profile.azimuth();
        let turn = [azimuth[0], azimuth[azimuth.len() - 1]];
        let columns = match profile.is_symmetric() {
            true => turn.to_vec(),
            false => edges(turn[0], turn[1], MAX_AZIMUTH_STEP, azimuth.iter().copied()),
        };
        let value = |at: Vec2| luminance(Rgb::splat(profile.at(polar_angle(at.x), at.y) * falloff(cone, at.x)));
        Distribution::from_cells(pattern.clone(), cone, [rows, columns], value)
    }

    /// The distribution over cells with the given edges. `value` is the luminance at coordinates of the grid.
    fn from_cells(
        pattern: Arc<Pattern>,
        cone: Option<SpotCone>,
        edges: [Vec<f32>; 2],
        value: impl Fn(Vec2) -> f32,
    ) -> Option<Distribution> {
        if edges.iter().any(|edges| edges.len() < 2) {
            return None;
        }
        let (across, reach) = (edges[1].len() - 1, edges[0][edges[0].len() - 1]);
        let (mut flux, mut peak) = (0.0f64, 0.0f32);
        let mut weights = Vec::with_capacity((edges[0].len() - 1) * across);
        for row in edges[0].windows(2) {
            for column in edges[1].windows(2) {
                // Simpson's rule. The middle is lit if any inner point is.
                let (mut mean, mut highest) = (0.0f64, 0.0f32);
                for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                    let at = |edges: &[f32], k: usize| edges[0] + (edges[1] - edges[0]) * (0.5 * k as f32);
                    let x = value(Vec2::new(at(row, i), at(column, j)));
                    mean += f64::from(x) * [1.0, 4.0, 1.0][i] * [1.0, 4.0, 1.0][j] / 36.0;
                    highest = highest.max(x);
                }
                let solid_angle = f64::from(TAU) * f64::from(row[1] - row[0]) * f64::from(column[1] - column[0]);
                flux += solid_angle * mean;
                peak = peak.max(highest);
                weights.push(solid_angle * (mean * (1.0 - PEAK_SHARE) + f64::from(highest) * PEAK_SHARE));
            }
        }
        let grid = Grid::new(edges, |row, column| weights[row * across + column])?;
        Some(Distribution { pattern, cone, grid, flux: Rgb::splat(flux as f32), peak, reach })
    }

    /// What the light shines with, before the cone limits it.
    pub fn pattern(&self) -> &Pattern {
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
            Pattern::Profile(profile) => Rgb::splat(profile.at(polar_angle(height), profile.turns(d)) * falloff),
        }
    }

    /// Density per solid angle with which [`Distribution::sample`] samples a unit direction in the frame of the light.
    #[inline]
    pub fn pdf_w(&self, d: Vec3) -> f32 {
        match &*self.pattern {
            Pattern::Profile(profile) => self.grid.density(Vec2::new(Self::height(d), profile.turns(d))) / TAU,
        }
    }

    /// Samples a unit direction in the frame of the light by the uniform point `u`. Returns it with its density per solid
    /// angle. The relative intensity may be zero there.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        let (at, density) = self.grid.sample(u)?;
        match &*self.pattern {
            Pattern::Profile(_) => {
                let sin = (at.x * (2.0 - at.x)).max(0.0).sqrt();
                Some((warp::around_z(sin, 1.0 - at.x, at.y), density / TAU))
            }
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

    fn cone(seed: u64) -> Option<SpotCone> {
        let outer = [0.004f32, 0.3, 0.9][(seed % 3) as usize];
        (!seed.is_multiple_of(4)).then_some(SpotCone { inner: 0.5 * outer, outer, edge: SpotEdge::Smooth })
    }

    /// Samples have the density that `pdf_w` returns, and their mean weight is the integral of the intensity. No
    /// direction with light has density zero.
    #[test]
    fn samples_match_their_density_and_carry_the_flux() {
        for seed in 0..24 {
            let shape = Distribution::new(Arc::new(Pattern::Profile(profile(seed))), cone(seed)).expect("light");
            let (n, mut differing, mut mean, mut squares) = (300u32, 0, 0.0f64, 0.0f64);
            for i in 0..n * n {
                let u = Vec2::new((0.5 + (i % n) as f32) / n as f32, (0.5 + (i / n) as f32) / n as f32);
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
            assert!((mean / flux - 1.0).abs() < 6e-3, "{seed}: {mean}, {flux}");
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
            assert!(lit > 1000, "{seed}: {lit}");
        }
    }
}
