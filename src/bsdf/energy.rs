//! Directional albedos of the microfacet lobes, tabulated, so that what single scattering loses can be given back
//! \[Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"\].
//!
//! A table is a grid over the square roots of the cosine and of alpha, which puts nodes where the albedos bend: at grazing angles of
//! nearly smooth surfaces. Interpolation is linear, and averages integrate the interpolant exactly, so that compensation
//! gives back what the tables say is missing, no more and no less.

use super::fresnel::{grazing_weight, is_matched, reflect, refract};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use crate::math::{Vec2, Vec3};
use rayon::prelude::*;

/// Nodes along each axis.
const NODES: usize = 32;

/// Points of the quadrature over visible normals: along the azimuth (a half of it: the rest is its mirror image) and across.
const QUADRATURE: (usize, usize) = (8, 24);

/// A function of the cosine in `[0, 1]`: values at the nodes.
#[derive(Clone, Copy, Debug)]
pub struct Row(pub [f32; NODES]);

/// Weights of the nodes in `2 integral f(mu) mu dmu` for `f` linear in `sqrt(mu)` between them.
const AVERAGE: [f32; NODES] = {
    let mut weights = [0.0f64; NODES];
    let h = 1.0 / (NODES - 1) as f64;
    let mut i = 0;
    while i + 1 < NODES {
        let (a, b) = (i as f64 * h, (i + 1) as f64 * h);
        let fourth = b * b * b * b - a * a * a * a;
        let fifth = 0.8 * (b * b * b * b * b - a * a * a * a * a);
        weights[i] += (b * fourth - fifth) / h;
        weights[i + 1] += (fifth - a * fourth) / h;
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
        let x = mu.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let t = x - i as f32;
        self.0[i] + (self.0[i + 1] - self.0[i]) * t
    }

    /// Its cosine-weighted average over the hemisphere.
    #[inline]
    pub fn average(&self) -> f32 {
        self.0.iter().zip(&AVERAGE).map(|(v, w)| v * w).sum()
    }
}

/// A function of the cosine and of alpha: rows at the nodes of `sqrt(alpha)`.
#[derive(Clone, Debug)]
pub struct Table(Vec<Row>);

impl Table {
    /// The row at `alpha`.
    #[inline]
    pub fn row(&self, alpha: f32) -> Row {
        let x = alpha.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let t = x - i as f32;
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

/// Cosine and alpha of a node, kept off zero: the limits are approached, not reached.
fn cosine(node: usize) -> f32 {
    let t = node as f32 / (NODES - 1) as f32;
    (t * t).max(1e-5)
}

fn alpha(node: usize) -> f32 {
    let t = node as f32 / (NODES - 1) as f32;
    (t * t).max(1e-6)
}

/// Tabulates `N` functions at once: `f` gives, for a lobe, the direction towards the viewer, Lambda of it and a visible normal,
/// the terms of their sums.
fn tabulate<const N: usize>(f: impl Fn(&Ggx, Vec3, f32, Vec3) -> [f32; N] + Sync) -> [Table; N] {
    let rows: Vec<[Row; N]> = (0..NODES)
        .into_par_iter()
        .map(|i| {
            let ggx = Ggx { alpha_x: alpha(i), alpha_y: alpha(i) };
            let mut rows = [Row::ZERO; N];
            for j in 0..NODES {
                let mu = cosine(j);
                let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
                let lambda_o = ggx.lambda(wo);
                let mut sums = [0.0f32; N];
                for a in 0..QUADRATURE.0 {
                    for b in 0..QUADRATURE.1 {
                        let u = Vec2::new(
                            0.5 * (a as f32 + 0.5) / QUADRATURE.0 as f32,
                            (b as f32 + 0.5) / QUADRATURE.1 as f32,
                        );
                        let terms = f(&ggx, wo, lambda_o, ggx.sample_visible(wo, u));
                        for (sum, term) in sums.iter_mut().zip(terms) {
                            *sum += term;
                        }
                    }
                }
                for (row, sum) in rows.iter_mut().zip(sums) {
                    row.0[j] = sum / (QUADRATURE.0 * QUADRATURE.1) as f32;
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
