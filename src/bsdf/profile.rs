//! Tabulated functions of a cosine and of alpha, and lobes with such a function as their angular profile.
//!
//! Nodes are uniform in the fourth roots of the cosine and of alpha. This puts more nodes where albedos have a high
//! curvature: at cosines near alpha, down to nearly smooth surfaces. Interpolation is linear. Averages integrate the
//! interpolated function exactly, so that a compensation lobe normalized by them has exactly the tabulated albedo.

use crate::math::{Vec2, Vec3, Vec4, warp};
use std::f32::consts::FRAC_1_PI;
use std::sync::OnceLock;

/// Number of nodes of a table along each axis: the cosine, and alpha.
pub const NODES: usize = 32;

/// Weights of the nodes in `2 integral f(mu) mu dmu`, the cosine-weighted average, for an `f` that is linear in t, the
/// fourth root of mu, between nodes. `2 mu dmu = 8 t^7 dt`.
const AVERAGE: [f32; NODES] = {
    let mut weights = [0.0f64; NODES];
    let h = 1.0 / (NODES - 1) as f64;
    let mut i = 0;
    while i + 1 < NODES {
        let (a, b) = (i as f64 * h, (i + 1) as f64 * h);
        let (a8, b8) = (eighth(a), eighth(b));
        let zeroth = b8 - a8;
        let first = (b * b8 - a * a8) * 8.0 / 9.0;
        weights[i] += (b * zeroth - first) / h;
        weights[i + 1] += (first - a * zeroth) / h;
        i += 1;
    }
    let mut result = [0.0f32; NODES];
    let mut i = 0;
    while i < NODES {
        result[i] = weights[i] as f32;
        i += 1;
    }
    result
};

/// Weights of the nodes in twice the integral of `f 2 mu dmu`, for an `f` that is constant between nodes and there
/// equal to the mean of both nodes.
const MASS: [f32; NODES] = {
    let mut weights = [0.0f32; NODES];
    let mut i = 0;
    while i + 1 < NODES {
        let step = SQUARES[i + 1] - SQUARES[i];
        weights[i] += step;
        weights[i + 1] += step;
        i += 1;
    }
    weights
};

/// Squared cosines of the nodes, `t^8`. The square of a cosine with density `2 mu` is uniform.
const SQUARES: [f32; NODES] = {
    let mut squares = [0.0f32; NODES];
    let mut i = 0;
    while i < NODES {
        squares[i] = eighth(i as f64 / (NODES - 1) as f64) as f32;
        i += 1;
    }
    squares
};

const fn eighth(x: f64) -> f64 {
    let x2 = x * x;
    x2 * x2 * x2 * x2
}

/// Cosine or alpha of node `i` of a table. The first node is at 1e-6 instead of zero, where functions may be undefined.
pub fn node(i: usize) -> f32 {
    let t = i as f32 / (NODES - 1) as f32;
    (t * t * t * t).max(1e-6)
}

/// The position of a cosine or an alpha in a table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Position {
    /// Index of the table node below.
    i: usize,
    /// Fraction of the distance to the next node, 0 to 1.
    t: f32,
}

impl Position {
    /// Position of a cosine or alpha of 1, in units of nodes.
    pub const SCALE: f32 = (NODES - 1) as f32;

    /// The table position of a cosine or an alpha in `[0, 1]`.
    #[inline]
    pub fn new(x: f32) -> Position {
        let x = x.clamp(0.0, 1.0).sqrt().sqrt() * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        Position { i, t: x - i as f32 }
    }

    /// The position of node `i`.
    pub(super) fn of_node(i: usize) -> Position {
        Position { i: i.min(NODES - 2), t: if i == NODES - 1 { 1.0 } else { 0.0 } }
    }

    /// The position in units of nodes. Larger values have larger positions.
    pub fn value(self) -> f32 {
        self.i as f32 + self.t
    }

    /// The two adjacent nodes with their interpolation weights.
    pub fn adjacent_nodes(self) -> [(usize, f32); 2] {
        [(self.i, 1.0 - self.t), (self.i + 1, self.t)]
    }

    /// Interpolates linearly between values at the nodes.
    #[inline]
    pub fn interpolate(self, nodes: &[f32; NODES]) -> f32 {
        let (a, b) = (nodes[self.i], nodes[self.i + 1]);
        a + (b - a) * self.t
    }
}

/// Table row: values of four functions of the cosine, at its nodes, for one alpha.
type Row = [[f32; NODES]; 4];

/// The table row whose four functions have these values at the nodes of the cosine.
pub fn row(values: &[Vec4; NODES]) -> Row {
    std::array::from_fn(|k| values.map(|v| v[k]))
}

/// A table of functions of the cosine and alpha: at each node of alpha, N rows of four functions. They are computed at
/// first use, because most materials have one roughness and need only two nodes.
#[derive(Clone, Debug)]
pub struct Grid<const N: usize>([OnceLock<Box<[Row; N]>>; NODES]);

impl<const N: usize> Grid<N> {
    /// A table without computed rows.
    pub const fn new() -> Grid<N> {
        Grid([const { OnceLock::new() }; NODES])
    }

    /// Number of nodes of alpha whose rows have been computed.
    pub fn row_count(&self) -> usize {
        self.0.iter().filter(|row| row.get().is_some()).count()
    }

    /// The rows at the nodes adjacent to `alpha`. `make` computes the rows of a node, on the first thread that needs
    /// them. It must not use the thread pool: while it waited there, the thread could take up a path that needs the
    /// same row, and so wait for itself.
    #[inline]
    pub fn adjacent_rows(&self, alpha: Position, make: impl Fn(usize) -> [Row; N]) -> AdjacentRows<'_, N> {
        let at = |i: usize| &**self.0[i].get_or_init(|| Box::new(make(i)));
        AdjacentRows { low: at(alpha.i), high: at(alpha.i + 1), t: alpha.t }
    }
}

/// The table rows at two adjacent nodes of alpha, and the position of an alpha between them.
#[derive(Clone, Copy)]
pub struct AdjacentRows<'g, const N: usize> {
    low: &'g [Row; N],
    high: &'g [Row; N],
    t: f32,
}

/// The angular profile of a lobe: a function of the cosine at one alpha, an affine combination of the four functions of
/// a row. It stores its values at the nodes, so that a photon costs one interpolation and no access to the grid.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    nodes: [f32; NODES],
    /// Cosine-weighted average over the hemisphere.
    pub average: f32,
    /// Integral of the profile that normalizes the density of [`Profile::sample`].
    mass: f32,
}

/// Dot product, with the terms summed in an order that can be vectorized.
#[inline]
fn dot(a: &[f32; NODES], b: &[f32; NODES]) -> f32 {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum()
}

impl Profile {
    /// The profile with one value at all cosines.
    pub const fn constant(constant: f32) -> Profile {
        Profile { nodes: [constant; NODES], average: constant, mass: 2.0 * constant }
    }

    /// The profile `max(constant + factors . functions, 0)`, with the four tabulated functions of row number `n`.
    #[inline]
    pub fn new<const N: usize>(grid: AdjacentRows<'_, N>, n: usize, constant: f32, factors: Vec4) -> Profile {
        let AdjacentRows { low, high, t } = grid;
        let (low, high) = (&low[n], &high[n]);
        let mut nodes = [constant; NODES];
        for (k, factor) in factors.to_array().into_iter().enumerate() {
            if factor != 0.0 {
                for j in 0..NODES {
                    nodes[j] += factor * (low[k][j] + (high[k][j] - low[k][j]) * t);
                }
            }
        }
        for node in &mut nodes {
            *node = node.max(0.0);
        }
        Profile::from_nodes(nodes)
    }

    /// The profile with these values at the nodes of the cosine.
    #[inline]
    pub fn from_nodes(nodes: [f32; NODES]) -> Profile {
        Profile { nodes, average: dot(&nodes, &AVERAGE), mass: dot(&nodes, &MASS) }
    }

    /// Values of the profile at the nodes of the cosine.
    #[inline]
    pub(super) fn nodes(&self) -> &[f32; NODES] {
        &self.nodes
    }

    /// Integral of the profile that normalizes the density of [`Profile::sample`].
    #[inline]
    pub(super) fn mass(&self) -> f32 {
        self.mass
    }

    /// The value of the profile at a cosine, given by its table position.
    #[inline]
    pub fn at(&self, mu: Position) -> f32 {
        mu.interpolate(&self.nodes)
    }

    /// The value at the cosine `mu`, whose position is `at`, and the density per solid angle with which
    /// [`Profile::sample`] draws a direction of that cosine.
    #[inline]
    pub fn at_with_pdf_w(&self, at: Position, mu: f32) -> (f32, f32) {
        let (a, b) = (self.nodes[at.i], self.nodes[at.i + 1]);
        (a + (b - a) * at.t, (a + b) / self.mass.max(f32::MIN_POSITIVE) * mu * FRAC_1_PI)
    }

    /// Samples a direction of the upper hemisphere in proportion to the profile times the cosine, with the profile
    /// replaced by its mean between nodes. `None` if the profile is zero.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        let mut left = u.x * self.mass;
        for i in 0..NODES - 1 {
            let value = self.nodes[i] + self.nodes[i + 1];
            let mass = value * (SQUARES[i + 1] - SQUARES[i]);
            if left < mass {
                let square = SQUARES[i] + left / value;
                return Some(warp::around_z((1.0 - square).max(0.0).sqrt(), square.sqrt(), u.y));
            }
            left -= mass;
        }
        None
    }

    /// Cosine-weighted average of the profile times another function of the cosine.
    pub fn average_with(&self, other: impl Fn(Position) -> f32) -> f32 {
        (0..NODES).map(|i| AVERAGE[i] * self.nodes[i] * other(Position::of_node(i))).sum()
    }
}
