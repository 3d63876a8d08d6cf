//! Directional albedos of the microfacet lobes, tabulated, so that what single scattering loses can be given back
//! \[Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"\].
//!
//! A table is a grid over the fourth roots of the cosine and of alpha, which puts nodes where the albedos bend: at cosines
//! near alpha, down to nearly smooth surfaces. Interpolation is linear, and averages integrate the interpolant exactly, so that compensation
//! gives back what the tables say is missing, no more and no less.

use super::fresnel::{grazing_weight, is_matched, reflect, refract};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use crate::math::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, TAU};

/// Nodes along each axis.
const NODES: usize = 32;

/// Points of the quadrature over visible normals, and the generator of their lattice (Fibonacci numbers: the integrands have
/// kinks along curves, at the horizon and the critical angle, where product rules converge slowly).
const LATTICE: (usize, usize) = (987, 610);

/// A function of the cosine in `[0, 1]`: values at the nodes.
#[derive(Clone, Copy, Debug)]
pub struct Row(pub [f32; NODES]);

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

const fn eighth(x: f64) -> f64 {
    let x2 = x * x;
    x2 * x2 * x2 * x2
}

/// Position of a cosine or an alpha on its axis: index of the node below, and the fraction to the next.
#[inline]
fn position(x: f32) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0).sqrt().sqrt() * (NODES - 1) as f32;
    let i = (x as usize).min(NODES - 2);
    (i, x - i as f32)
}

/// Cosine or alpha of a node, kept off zero: the limit is approached, not reached.
fn node(i: usize) -> f32 {
    let t = i as f32 / (NODES - 1) as f32;
    (t * t * t * t).max(1e-6)
}

impl Row {
    /// Zero everywhere.
    pub const ZERO: Row = Row([0.0; NODES]);
    /// One everywhere.
    pub const ONE: Row = Row([1.0; NODES]);

    /// A row from a function of the node.
    #[inline]
    pub fn from_fn(f: impl FnMut(usize) -> f32) -> Row {
        Row(std::array::from_fn(f))
    }

    /// The value at cosine `mu`.
    #[inline]
    pub fn at(&self, mu: f32) -> f32 {
        let (i, t) = position(mu);
        self.0[i] + (self.0[i + 1] - self.0[i]) * t
    }

    /// Its cosine-weighted average over the hemisphere.
    #[inline]
    pub fn average(&self) -> f32 {
        self.0.iter().zip(&AVERAGE).map(|(v, w)| v * w).sum()
    }
}

/// Squared cosines of the nodes: `t^8`. Uniform numbers between two of them are cosines with density 2 mu.
const SQUARES: [f32; NODES] = {
    let mut squares = [0.0f32; NODES];
    let mut i = 0;
    while i < NODES {
        squares[i] = eighth(i as f64 / (NODES - 1) as f64) as f32;
        i += 1;
    }
    squares
};

/// A row as the profile of a lobe that is to be sampled: directions are drawn as if it were constant between nodes.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    row: Row,
    /// Cosine-weighted average of the row.
    pub average: f32,
    /// Integral of what directions are drawn from.
    mass: f32,
}

impl Profile {
    /// Zero everywhere: never to be sampled.
    pub const ZERO: Profile = Profile { row: Row::ZERO, average: 0.0, mass: 0.0 };

    /// A profile that is nowhere negative.
    #[inline]
    pub fn new(row: Row) -> Profile {
        let mass = (0..NODES - 1).map(|i| (row.0[i] + row.0[i + 1]) * (SQUARES[i + 1] - SQUARES[i])).sum();
        Profile { row, average: row.average(), mass }
    }

    /// The value at cosine `mu`.
    #[inline]
    pub fn at(&self, mu: f32) -> f32 {
        self.row.at(mu)
    }

    /// The values at the nodes.
    #[inline]
    pub fn nodes(&self) -> &[f32; NODES] {
        &self.row.0
    }

    /// The value at cosine `mu`, and the density per solid angle with which [`Profile::sample`] draws it.
    #[inline]
    pub fn at_with_pdf_w(&self, mu: f32) -> (f32, f32) {
        let (i, t) = position(mu);
        let (a, b) = (self.row.0[i], self.row.0[i + 1]);
        (a + (b - a) * t, (a + b) / self.mass.max(f32::MIN_POSITIVE) * mu * FRAC_1_PI)
    }

    /// A direction of the upper hemisphere.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let mut left = u.x * self.mass;
        let mut square = 0.0;
        for i in 0..NODES - 1 {
            let value = self.row.0[i] + self.row.0[i + 1];
            let mass = value * (SQUARES[i + 1] - SQUARES[i]);
            if left < mass {
                square = SQUARES[i] + left / value;
                break;
            }
            left -= mass;
        }
        let r = (1.0 - square).max(0.0).sqrt();
        let phi = TAU * u.y;
        Vec3::new(r * phi.cos(), r * phi.sin(), square.sqrt())
    }
}

/// A function of the cosine and of alpha: rows at the nodes of alpha.
#[derive(Clone, Debug)]
pub struct Table(Vec<Row>);

impl Table {
    /// The row at `alpha`.
    #[inline]
    pub fn row(&self, alpha: f32) -> Row {
        let (i, t) = position(alpha);
        let (a, b) = (&self.0[i].0, &self.0[i + 1].0);
        Row::from_fn(|j| a[j] + (b[j] - a[j]) * t)
    }
}

/// Albedos of single scattering at one side of a rough dielectric, split so that the reflectances at normal and at grazing
/// incidence can be chosen later: everything is linear in them.
#[derive(Clone, Debug)]
pub struct SideTables {
    /// Reflection where it is not total, as if all were reflected.
    pub reflected: Table,
    /// The same, weighted by [`grazing_weight`].
    pub reflected_grazing: Table,
    /// Transmission, as if all were transmitted.
    pub transmitted: Table,
    /// The same, weighted by [`grazing_weight`].
    pub transmitted_grazing: Table,
    /// Cosine-weighted averages for a smooth interface: share of directions reflected in total, and of [`grazing_weight`].
    pub average_total: f32,
    /// See `average_total`.
    pub average_grazing: f32,
}

/// Tables of one pair of media.
#[derive(Clone, Debug)]
pub struct InterfaceTables {
    /// Index of the far medium over the near one, at least 1.
    pub eta: f32,
    /// Seen from the medium of the lower index.
    pub thin: SideTables,
    /// Seen from the medium of the higher index.
    pub dense: SideTables,
}

/// Everything tabulated for a scene; immutable, looked up without locks.
#[derive(Clone, Debug)]
pub struct EnergyTables {
    /// Albedo of the reflecting lobe of a perfect reflector.
    pub(super) white: Table,
    /// The same, weighted by Schlick's weight of F90.
    pub(super) schlick: Table,
    interfaces: Vec<InterfaceTables>,
}

/// Tabulates `N` functions at once: `f` gives, for a lobe, the direction towards the viewer, Lambda of it and a visible normal,
/// the terms of their sums.
fn tabulate<const N: usize>(f: impl Fn(&Ggx, Vec3, f32, Vec3) -> [f32; N] + Sync) -> [Table; N] {
    let rows: Vec<[Row; N]> = (0..NODES)
        .into_par_iter()
        .map(|i| {
            let ggx = Ggx { alpha_x: node(i), alpha_y: node(i) };
            let mut rows = [Row::ZERO; N];
            for j in 0..NODES {
                let mu = node(j);
                let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
                let lambda_o = ggx.lambda(wo);
                let mut sums = [0.0f32; N];
                for k in 0..LATTICE.0 {
                    // A half of the azimuth: the rest is its mirror image. Graded towards the steep facets, whose
                    // reflections are the ones that are lost.
                    let phi = 0.5 * (((k * LATTICE.1) % LATTICE.0) as f32 + 0.5) / LATTICE.0 as f32;
                    let rest = 1.0 - (k as f32 + 0.5) / LATTICE.0 as f32;
                    let weight = 2.0 * rest / LATTICE.0 as f32;
                    let terms = f(&ggx, wo, lambda_o, ggx.sample_visible(wo, Vec2::new(phi, 1.0 - rest * rest)));
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        *sum += weight * term;
                    }
                }
                for (row, sum) in rows.iter_mut().zip(sums) {
                    row.0[j] = sum;
                }
            }
            rows
        })
        .collect();
    std::array::from_fn(|n| Table(rows.iter().map(|r| r[n]).collect()))
}

/// G2 over G1 of the reflected direction; zero below the horizon.
fn reflected_share(ggx: &Ggx, wo: Vec3, lambda_o: f32, h: Vec3) -> f32 {
    let wi = reflect(wo, h);
    if wi.z <= 0.0 {
        return 0.0;
    }
    g2_reflection(lambda_o, ggx.lambda(wi)) / g1(lambda_o)
}

impl SideTables {
    fn new(eta: f32) -> SideTables {
        let [reflected, reflected_grazing, transmitted, transmitted_grazing] = tabulate(|ggx, wo, lambda_o, h| {
            let cos = wo.dot(h).clamp(0.0, 1.0);
            let Some((grazing, cos_t)) = grazing_weight(cos, eta) else { return [0.0; 4] };
            let r = reflected_share(ggx, wo, lambda_o, h);
            let wi = refract(wo, h, eta, cos_t);
            let t = if wi.z < 0.0 { g2_transmission(lambda_o, ggx.lambda(wi)) / g1(lambda_o) } else { 0.0 };
            [r, r * grazing, t, t * grazing]
        });
        // Midpoints in mu^2: the cosine-weighted measure.
        let n = 4096;
        let (mut total, mut grazing) = (0.0f64, 0.0f64);
        for i in 0..n {
            let mu = ((i as f32 + 0.5) / n as f32).sqrt();
            match grazing_weight(mu, eta) {
                None => total += 1.0,
                Some((g, _)) => grazing += f64::from(g),
            }
        }
        SideTables {
            reflected,
            reflected_grazing,
            transmitted,
            transmitted_grazing,
            average_total: (total / f64::from(n)) as f32,
            average_grazing: (grazing / f64::from(n)) as f32,
        }
    }
}

impl EnergyTables {
    /// Tables for interfaces of the relative indices `etas` (an index and its inverse share one), and for 1.5; others use the nearest.
    pub fn for_etas(etas: impl IntoIterator<Item = f32>) -> EnergyTables {
        let mut etas: Vec<f32> =
            etas.into_iter().chain([1.5]).filter(|e| *e > 0.0).map(|e| if e < 1.0 { 1.0 / e } else { e }).collect();
        etas.sort_by(f32::total_cmp);
        // Nearer ones than this differ by less than the tables' own error.
        etas.dedup_by(|a, b| *a - *b < 1e-3 * *b || (a.is_infinite() && b.is_infinite()));
        etas.retain(|e| !is_matched(*e));
        let [white, schlick] = tabulate(|ggx, wo, lambda_o, h| {
            let r = reflected_share(ggx, wo, lambda_o, h);
            [r, r * super::fresnel::schlick_weight(wo.dot(h).clamp(0.0, 1.0))]
        });
        let interfaces = etas
            .into_iter()
            .map(|eta| InterfaceTables { eta, thin: SideTables::new(eta), dense: SideTables::new(1.0 / eta) })
            .collect();
        EnergyTables { white, schlick, interfaces }
    }

    /// Tables of the sides of an interface of relative index `eta`: the one seen from above, the one seen from below.
    /// `None` if none were made, or if the interface does nothing.
    #[inline]
    pub(super) fn sides(&self, eta: f32) -> Option<[&SideTables; 2]> {
        if is_matched(eta) {
            return None;
        }
        let wanted = if eta < 1.0 { 1.0 / eta } else { eta };
        let after = self.interfaces.partition_point(|t| t.eta < wanted);
        let nearest = match (after.checked_sub(1).and_then(|i| self.interfaces.get(i)), self.interfaces.get(after)) {
            (Some(a), Some(b)) => {
                if wanted - a.eta < b.eta - wanted {
                    a
                } else {
                    b
                }
            }
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => return None,
        };
        Some(if eta < 1.0 { [&nearest.dense, &nearest.thin] } else { [&nearest.thin, &nearest.dense] })
    }
}
