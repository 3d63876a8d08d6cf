//! Tabulated functions of a cosine and a roughness, and the lobes whose angular profile they are.
//!
//! A grid runs over the fourth roots of the cosine and of alpha, which puts nodes where albedos bend: at cosines near
//! alpha, down to nearly smooth surfaces. Interpolation is linear; averages integrate the interpolant exactly, so that
//! a lobe normalised by them gives back what the table says is missing, no more and no less.

use crate::math::{Vec2, Vec3, Vec4};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::OnceLock;

/// Nodes along each axis.
pub const NODES: usize = 32;

/// Weights of the nodes in `2 integral f(mu) mu dmu` for `f` linear in the fourth root of mu, t, between them:
/// `2 mu dmu = 8 t^7 dt`.
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

/// Weights of the nodes in the integral of `f 2 mu dmu` times two, `f` made constant between nodes: the mean of its two
/// ends, doubled.
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

/// Squared cosines of the nodes: `t^8`. Uniform numbers between two of them are squares of cosines with density `2 mu`.
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

/// Cosine or alpha of a node, kept off zero: the limit is approached, not reached.
pub fn node(i: usize) -> f32 {
    let t = i as f32 / (NODES - 1) as f32;
    (t * t * t * t).max(1e-6)
}

/// A cosine or an alpha on its axis: index of the node below, and the fraction to the next.
#[derive(Clone, Copy, Debug, Default)]
pub struct Position {
    i: usize,
    t: f32,
}

impl Position {
    /// Position of cosine 1.
    pub const SCALE: f32 = (NODES - 1) as f32;

    /// Of a cosine or an alpha.
    #[inline]
    pub fn new(x: f32) -> Position {
        let x = x.clamp(0.0, 1.0).sqrt().sqrt() * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        Position { i, t: x - i as f32 }
    }

    /// Up to a factor, the fourth root of what it is the position of.
    pub fn value(self) -> f32 {
        self.i as f32 + self.t
    }

    /// The nodes around it, with their shares of an interpolation.
    pub fn around(self) -> [(usize, f32); 2] {
        [(self.i, 1.0 - self.t), (self.i + 1, self.t)]
    }

    /// Interpolated between values at the nodes.
    #[inline]
    pub fn between(self, nodes: &[f32; NODES]) -> f32 {
        let (a, b) = (nodes[self.i], nodes[self.i + 1]);
        a + (b - a) * self.t
    }
}

/// Four functions of the cosine at one alpha.
type Row = [[f32; NODES]; 4];

/// Values of four functions at the nodes of the cosine.
pub fn row(values: &[Vec4; NODES]) -> Row {
    std::array::from_fn(|k| values.map(|v| v[k]))
}

/// Rows of N times four functions of the cosine, at the nodes of alpha. A row is made when it is first asked for: most
/// materials have one roughness, and look at two of them.
#[derive(Clone, Debug)]
pub struct Grid<const N: usize>([OnceLock<Box<[Row; N]>>; NODES]);

impl<const N: usize> Grid<N> {
    /// Without any row yet.
    pub const fn new() -> Grid<N> {
        Grid([const { OnceLock::new() }; NODES])
    }

    /// How many rows there are by now.
    pub fn made(&self) -> usize {
        self.0.iter().filter(|row| row.get().is_some()).count()
    }

    /// The rows around `alpha`; `make` makes the one of a node. It runs on the thread that asks first, and must not
    /// share its work with others: while it waited for them, it could be handed a path that needs the same row, and
    /// wait for itself.
    #[inline]
    pub fn around(&self, alpha: Position, make: impl Fn(usize) -> [Row; N]) -> Between<'_, N> {
        let at = |i: usize| &**self.0[i].get_or_init(|| Box::new(make(i)));
        Between { low: at(alpha.i), high: at(alpha.i + 1), t: alpha.t }
    }
}

/// Two neighbouring rows of a grid, and a place between them.
#[derive(Clone, Copy)]
pub struct Between<'g, const N: usize> {
    low: &'g [Row; N],
    high: &'g [Row; N],
    t: f32,
}

/// A function of the cosine at one alpha, affine in the four of a grid: the angular profile of a lobe. Its nodes are
/// kept, so that a photon costs one interpolation and no look at the grid.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    nodes: [f32; NODES],
    /// Cosine-weighted average over the hemisphere.
    pub average: f32,
    mass: f32,
}

/// Sum of products, in an order that vector instructions like.
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
    /// The same everywhere.
    pub const fn constant(constant: f32) -> Profile {
        Profile { nodes: [constant; NODES], average: constant, mass: 2.0 * constant }
    }

    /// `constant + factors . functions`, at least zero, with the functions of number `n` of a grid.
    #[inline]
    pub fn new<const N: usize>(grid: Between<'_, N>, n: usize, constant: f32, factors: Vec4) -> Profile {
        let Between { low, high, t } = grid;
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
        Profile::of(nodes)
    }

    /// From its values at the nodes.
    #[inline]
    pub fn of(nodes: [f32; NODES]) -> Profile {
        Profile { nodes, average: dot(&nodes, &AVERAGE), mass: dot(&nodes, &MASS) }
    }

    /// Values at the nodes.
    #[inline]
    pub(super) fn nodes(&self) -> &[f32; NODES] {
        &self.nodes
    }

    /// What [`Profile::sample`] draws is in proportion to, summed up.
    #[inline]
    pub(super) fn mass(&self) -> f32 {
        self.mass
    }

    /// The value at a cosine.
    #[inline]
    pub fn at(&self, mu: Position) -> f32 {
        mu.between(&self.nodes)
    }

    /// The value at the cosine `mu`, whose position is `at`, and the density per solid angle with which
    /// [`Profile::sample`] draws it.
    #[inline]
    pub fn at_with_pdf_w(&self, at: Position, mu: f32) -> (f32, f32) {
        let (a, b) = (self.nodes[at.i], self.nodes[at.i + 1]);
        (a + (b - a) * at.t, (a + b) / self.mass.max(f32::MIN_POSITIVE) * mu * FRAC_1_PI)
    }

    /// A direction of the upper hemisphere, drawn as if the profile were constant between nodes; `None` where the
    /// profile is nothing.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        let mut left = u.x * self.mass;
        for i in 0..NODES - 1 {
            let value = self.nodes[i] + self.nodes[i + 1];
            let mass = value * (SQUARES[i + 1] - SQUARES[i]);
            if left < mass {
                let square = SQUARES[i] + left / value;
                let r = (1.0 - square).max(0.0).sqrt();
                let phi = TAU * u.y;
                return Some(Vec3::new(r * phi.cos(), r * phi.sin(), square.sqrt()));
            }
            left -= mass;
        }
        None
    }

    /// Cosine-weighted average of the profile times another function of the cosine.
    pub fn average_with(&self, other: impl Fn(Position) -> f32) -> f32 {
        (0..NODES)
            .map(|i| {
                AVERAGE[i]
                    * self.nodes[i]
                    * other(Position { i: i.min(NODES - 2), t: if i == NODES - 1 { 1.0 } else { 0.0 } })
            })
            .sum()
    }
}
