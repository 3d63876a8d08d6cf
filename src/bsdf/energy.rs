//! Tables of directional albedos of the lobes. They serve to compensate the energy that single scattering loses \[Kulla
//! and Conty 2017, "Revisiting Physically Based Shading at Imageworks"\], and to divide light among layers.

use super::anisotropic::{AnisotropicProfile, AnisotropicTables};
use super::fresnel::{Smooth, is_matched, reflect, refract};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use super::profile::{AdjacentRows, Grid, NODES, Position, Profile, node, row};
use super::sheen::{self, SheenModel};
use crate::math::{Vec2, Vec3, Vec4, sqr};
use std::sync::OnceLock;

/// Number of points and generator of the Fibonacci lattice for quadratures over visible normals. The integrands have
/// kinks along curves, at the horizon and the critical angle, where product rules converge slowly.
const LATTICE: (usize, usize) = (987, 610);

/// Index of refraction of clear coats in glTF (KHR_materials_clearcoat).
pub(super) const COAT_ETA: f32 = 1.5;

/// Index of the set of functions in [`SideTables`] for reflection. The four functions are the albedos of a perfect
/// reflector, of total internal reflection, and of other reflection per F0 and per F90.
const REFLECTED: usize = 0;
/// Index of the set of functions in [`SideTables`] for reflection plus transmission. The functions are the constant
/// part of the albedo, the part per F0, and the part per F90; the fourth is unused.
const SCATTERED: usize = 1;

/// Single-scattering albedos on one side of a rough dielectric. They are linear in the reflectances F0 at normal and
/// F90 at grazing incidence, so the tables hold the coefficients of both.
#[derive(Clone, Debug)]
pub(super) struct SideTables {
    /// Index of refraction of the other side over the index of this side.
    eta: f32,
    /// Tabulated functions of isotropic roughness: the sets [`REFLECTED`] and [`SCATTERED`].
    albedos: Grid<2>,
    /// Tabulated functions of anisotropic roughness: the sets [`REFLECTED`] and [`SCATTERED`].
    anisotropic: AnisotropicTables,
    /// Cosine-weighted share (0 to 1) of directions with total internal reflection at the smooth interface.
    pub average_total: f32,
    /// Cosine-weighted average of [`Smooth::grazing_weight`] over the hemisphere.
    pub average_grazing: f32,
}

/// Albedo tables of an interface between two media, seen from the thinner and from the denser side. Created at first
/// use.
#[derive(Clone, Debug)]
struct InterfaceTables {
    /// Index of refraction of the denser medium over that of the thinner one.
    eta: f32,
    sides: OnceLock<Box<[SideTables; 2]>>,
    /// Losses below a coat of this index.
    below_coat: CoverTables,
}

/// Tables of [`EnergyTables::covered_loss`], the energy that facets lose below a layer, for one kind of layer.
#[derive(Clone, Debug)]
struct CoverTables {
    /// Albedos of the layer at the nodes of its roughness.
    covers: OnceLock<[Profile; COVER_NODES]>,
    losses: Grid<3>,
}

/// Number of nodes of a layer's roughness in the tables. Each of the three sets of functions has four nodes, of which
/// neighbours share one.
const COVER_NODES: usize = 10;

/// The kind of a layer that covers the base of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CoverLayer {
    /// A clear coat of this relative index of refraction.
    Coat(f32),
    /// Sheen of this model.
    Sheen(SheenModel),
}

/// All albedo tables of a scene. Rows are computed at first use, on any thread. The result does not depend on when or
/// where, because the set of interfaces, and so the nearest one to an index, is fixed from the start.
#[derive(Clone, Debug)]
pub struct EnergyTables {
    interfaces: Vec<InterfaceTables>,
    /// Albedos of sheen, and losses below it, by its model.
    sheen: [Grid<1>; 2],
    below_sheen: [CoverTables; 2],
}

/// Integrates over the normals of facets visible from `wo`. Calls `f` with Lambda(wo), a visible normal and its
/// quadrature weight. `turn` is the range of the azimuth as a share of the circle, if the rest is a mirror image.
fn over_facets(ggx: &Ggx, wo: Vec3, turn: f32, mut f: impl FnMut(f32, Vec3, f32)) {
    let lambda_o = ggx.lambda(wo);
    for k in 0..LATTICE.0 {
        // Points are denser at steep facets, whose reflections are lost.
        let phi = turn * (((k * LATTICE.1) % LATTICE.0) as f32 + 0.5) / LATTICE.0 as f32;
        let rest = 1.0 - (k as f32 + 0.5) / LATTICE.0 as f32;
        let weight = 2.0 * rest / LATTICE.0 as f32;
        f(lambda_o, ggx.sample_visible(wo, Vec2::new(phi, 1.0 - rest * rest)), weight);
    }
}

/// Tabulates an integral over visible normals at node `i` of alpha and all nodes of the cosine. `f` adds one term to
/// the sum; its arguments are the sum, the distribution, the viewing direction wo, Lambda(wo), a visible normal and its
/// quadrature weight.
fn tabulate<T: Copy>(i: usize, zero: T, f: impl Fn(&mut T, &Ggx, Vec3, f32, Vec3, f32)) -> [T; NODES] {
    let ggx = Ggx { alpha_x: node(i), alpha_y: node(i) };
    std::array::from_fn(|j| {
        let mu = node(j);
        let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
        let mut sum = zero;
        over_facets(&ggx, wo, 0.5, |lambda_o, h, weight| f(&mut sum, &ggx, wo, lambda_o, h, weight));
        sum
    })
}

/// The direction into which a facet of normal `h` reflects `wo`, and the share of the light that is not shadowed, G2 /
/// G1, which is zero below the horizon.
fn reflected_share(ggx: &Ggx, wo: Vec3, lambda_o: f32, h: Vec3) -> (Vec3, f32) {
    let wi = reflect(wo, h);
    (wi, if wi.z > 0.0 { g2_reflection(lambda_o, ggx.lambda(wi)) / g1(lambda_o) } else { 0.0 })
}

/// Adds the contribution of one facet to five sums: total internal reflection; other reflection without and with the
/// grazing weight; transmission without and with the grazing weight.
fn add_albedos(sums: &mut [f32; 5], smooth: &Smooth, ggx: &Ggx, wo: Vec3, lambda_o: f32, h: Vec3, weight: f32) {
    let cos = wo.dot(h).clamp(0.0, 1.0);
    let r = weight * reflected_share(ggx, wo, lambda_o, h).1;
    let Some((grazing, cos_t)) = smooth.grazing_weight(cos) else {
        sums[0] += r;
        return;
    };
    let wi = refract(wo, h, smooth.eta, cos_t);
    let t = if wi.z < 0.0 { weight * g2_transmission(lambda_o, ggx.lambda(wi)) / g1(lambda_o) } else { 0.0 };
    for (sum, term) in sums[1..].iter_mut().zip([r, r * grazing, t, t * grazing]) {
        *sum += term;
    }
}

/// The functions [`REFLECTED`] at one table entry, from the sums of [`add_albedos`].
fn reflected([total, r, rg, ..]: [f32; 5]) -> Vec4 {
    Vec4::new(total + r, total, r - rg, rg)
}

/// The functions [`SCATTERED`] at one table entry, from the sums of [`add_albedos`]. The transmitted part is t (1 - F0)
/// - tg (F90 - F0).
fn scattered([total, r, rg, t, tg]: [f32; 5]) -> Vec4 {
    Vec4::new(total + t, (r - rg) - (t - tg), rg - tg, 0.0)
}

impl SideTables {
    fn new(eta: f32) -> SideTables {
        let smooth = Smooth::new(eta);
        // The midpoint rule in mu^2, which is the cosine-weighted measure.
        let n = 4096;
        let (mut total, mut grazing) = (0.0f64, 0.0f64);
        for i in 0..n {
            let mu = ((i as f32 + 0.5) / n as f32).sqrt();
            match smooth.grazing_weight(mu) {
                None => total += 1.0,
                Some((g, _)) => grazing += f64::from(g),
            }
        }
        SideTables {
            eta,
            albedos: Grid::new(),
            anisotropic: AnisotropicTables::default(),
            average_total: (total / f64::from(n)) as f32,
            average_grazing: (grazing / f64::from(n)) as f32,
        }
    }

    /// The table rows at the nodes on either side of an alpha.
    #[inline]
    fn albedos(&self, alpha: Position) -> AdjacentRows<'_, 2> {
        self.albedos.adjacent_rows(alpha, |i| {
            let smooth = Smooth::new(self.eta);
            let sums = tabulate(i, [0.0f32; 5], |sums, ggx, wo, lambda_o, h, weight| {
                add_albedos(sums, &smooth, ggx, wo, lambda_o, h, weight);
            });
            [row(&sums.map(reflected)), row(&sums.map(scattered))]
        })
    }

    /// Energy share that single scattering loses at a perfect reflector, as a function of the cosine: one minus its
    /// albedo.
    #[inline]
    pub fn white_loss(&self, alpha: Position) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 1.0, -Vec4::X)
    }

    /// Albedo of reflection at the interface, as a function of the cosine, for reflectances `f0` (normal) and `f90`
    /// (grazing).
    #[inline]
    pub fn reflection(&self, alpha: Position, f0: f32, f90: f32) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 0.0, Vec4::new(0.0, 1.0, f0, f90))
    }

    /// Transmittance of the interface to the base, as a function of the cosine: one minus the albedo of reflection and
    /// minus `multiple` times the white loss, which is the albedo of the compensation.
    #[inline]
    pub fn base_transmittance(&self, alpha: Position, f0: f32, f90: f32, multiple: f32) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 1.0 - multiple, Vec4::new(multiple, -1.0, -f0, -f90))
    }

    /// Energy share that single scattering loses at glass, as a function of the cosine: one minus the albedo of
    /// reflection and transmission.
    #[inline]
    pub fn glass_loss(&self, alpha: Position, f0: f32, f90: f32) -> Profile {
        Profile::new(self.albedos(alpha), SCATTERED, 1.0, Vec4::new(-1.0, -f0, -f90, 0.0))
    }

    /// The loss [`SideTables::white_loss`] for anisotropic roughness.
    pub fn anisotropic_white_loss(&self, alphas: [Position; 2]) -> AnisotropicProfile {
        self.anisotropic(alphas, REFLECTED, 1.0, -Vec4::X)
    }

    /// The loss [`SideTables::glass_loss`] for anisotropic roughness.
    pub fn anisotropic_glass_loss(&self, alphas: [Position; 2], f0: f32, f90: f32) -> AnisotropicProfile {
        self.anisotropic(alphas, SCATTERED, 1.0, -Vec4::new(1.0, f0, f90, 0.0))
    }

    /// The albedo [`SideTables::reflection`] for anisotropic roughness.
    pub fn anisotropic_reflection(&self, alphas: [Position; 2], f0: f32, f90: f32) -> AnisotropicProfile {
        self.anisotropic(alphas, REFLECTED, 0.0, Vec4::new(0.0, 1.0, f0, f90))
    }

    /// The function of direction that [`AnisotropicTables::profile`] makes for these alphas.
    fn anisotropic(&self, alphas: [Position; 2], n: usize, constant: f32, factors: Vec4) -> AnisotropicProfile {
        let smooth = Smooth::new(self.eta);
        self.anisotropic.profile(alphas, n, constant, factors, |alpha_x, alpha_y, wo| {
            let ggx = Ggx { alpha_x, alpha_y };
            let mut sums = [0.0; 5];
            over_facets(&ggx, wo, 1.0, |lambda_o, h, weight| {
                add_albedos(&mut sums, &smooth, &ggx, wo, lambda_o, h, weight);
            });
            [reflected(sums), scattered(sums)]
        })
    }

    /// The reflectance at normal incidence, 0 to 1, at which [`SideTables::average_reflectance`] is `average`.
    pub fn f0_of_average(&self, average: f32, f90: f32) -> f32 {
        let rest = 1.0 - self.average_total - self.average_grazing;
        ((average - f90 * self.average_grazing - self.average_total) / rest.max(1e-9)).clamp(0.0, 1.0)
    }

    /// Average reflectance of the smooth interface over the hemisphere, weighted by the cosine.
    #[inline]
    pub fn average_reflectance(&self, f0: f32, f90: f32) -> f32 {
        f0 * (1.0 - self.average_total - self.average_grazing) + f90 * self.average_grazing + self.average_total
    }
}

impl InterfaceTables {
    fn new(eta: f32) -> InterfaceTables {
        InterfaceTables { eta, sides: OnceLock::new(), below_coat: CoverTables::new() }
    }

    /// The tables for directions on the thinner side and on the denser side of the interface.
    #[inline]
    fn sides(&self) -> &[SideTables; 2] {
        self.sides.get_or_init(|| Box::new([self.eta, 1.0 / self.eta].map(SideTables::new)))
    }
}

impl CoverTables {
    const fn new() -> CoverTables {
        CoverTables { covers: OnceLock::new(), losses: Grid::new() }
    }

    /// The energy that facets of roughness `alpha` lose below a layer of roughness `cover_alpha`, as a function of the
    /// cosine. `cover` returns the albedo of the layer at a roughness.
    fn profile(&self, alpha: Position, cover_alpha: f32, cover: impl Fn(Position) -> Profile) -> Profile {
        let losses = self.losses.adjacent_rows(alpha, |i| {
            let covers = self.covers.get_or_init(|| {
                std::array::from_fn(|k| cover(Position::new(sqr(k as f32 / (COVER_NODES - 1) as f32))))
            });
            let sums = tabulate(i, [0.0f32; COVER_NODES], |sums, ggx, wo, lambda_o, h, weight| {
                let (wi, share) = reflected_share(ggx, wo, lambda_o, h);
                if share > 0.0 {
                    let (o, i) = (Position::new(wo.z), Position::new(wi.z));
                    for (sum, profile) in sums.iter_mut().zip(covers) {
                        *sum += weight * share * (profile.at(i) - profile.at(o)).max(0.0);
                    }
                }
            });
            [0, 3, 6].map(|k| row(&sums.map(|s| Vec4::new(s[k], s[k + 1], s[k + 2], s[k + 3]))))
        });
        let x = cover_alpha.clamp(0.0, 1.0).sqrt() * (COVER_NODES - 1) as f32;
        let group = ((x / 3.0) as usize).min(2);
        let x = x - 3.0 * group as f32;
        let hat = |k: f32| (1.0 - (x - k).abs()).max(0.0);
        Profile::new(losses, group, 0.0, Vec4::new(hat(0.0), hat(1.0), hat(2.0), hat(3.0)))
    }
}

impl EnergyTables {
    /// Tables for interfaces of the relative indices of refraction `etas` and for 1.5. An index and its inverse share
    /// tables. Interfaces of other indices use the nearest tables.
    pub fn new(etas: impl IntoIterator<Item = f32>) -> EnergyTables {
        let etas = etas.into_iter().chain([COAT_ETA]).filter(|e| *e > 0.0);
        let mut etas: Vec<f32> = etas.map(|e| if e < 1.0 { 1.0 / e } else { e }).collect();
        etas.sort_by(f32::total_cmp);
        // Indices within this tolerance differ by less than the error of the tables.
        etas.dedup_by(|a, b| *a - *b < 1e-3 * *b || (a.is_infinite() && b.is_infinite()));
        etas.retain(|e| !is_matched(*e));
        EnergyTables {
            interfaces: etas.into_iter().map(InterfaceTables::new).collect(),
            sheen: [const { Grid::new() }; 2],
            below_sheen: [const { CoverTables::new() }; 2],
        }
    }

    /// Number of table rows computed so far, for all pairs of media.
    pub fn row_count(&self) -> usize {
        let sides = self.interfaces.iter().filter_map(|pair| pair.sides.get()).flat_map(|sides| sides.iter());
        sides.map(|side| side.albedos.row_count()).sum()
    }

    /// The tables of the index nearest to the relative index `eta`; `None` for matched indices, which do not reflect.
    #[inline]
    fn nearest(&self, eta: f32) -> Option<&InterfaceTables> {
        if is_matched(eta) {
            return None;
        }
        let target = if eta < 1.0 { 1.0 / eta } else { eta };
        let after = self.interfaces.partition_point(|t| t.eta < target);
        let before = after.checked_sub(1).and_then(|i| self.interfaces.get(i));
        match (before, self.interfaces.get(after)) {
            (Some(a), Some(b)) if target - a.eta < b.eta - target => Some(a),
            (_, Some(b)) => Some(b),
            (a, None) => a,
        }
    }

    /// The tables of an interface of relative index `eta`, for directions above and below it. `None` for matched
    /// indices.
    #[inline]
    pub(super) fn sides(&self, eta: f32) -> Option<[&SideTables; 2]> {
        let [thin, dense] = self.nearest(eta)?.sides();
        Some(if eta < 1.0 { [dense, thin] } else { [thin, dense] })
    }

    /// Energy share that single scattering loses at a perfect reflector, as a function of the cosine. From the thinner
    /// medium it is equal for all pairs.
    #[inline]
    pub(super) fn white_loss(&self, alpha: Position) -> Profile {
        self.sides(COAT_ETA).map_or(Profile::constant(0.0), |[above, _]| above.white_loss(alpha))
    }

    /// The loss [`EnergyTables::white_loss`] for anisotropic roughness, as a function of the direction.
    pub(super) fn anisotropic_white_loss(&self, alphas: [Position; 2]) -> Option<AnisotropicProfile> {
        self.sides(COAT_ETA).map(|[above, _]| above.anisotropic_white_loss(alphas))
    }

    /// Albedo of a clear coat of roughness `alpha` and relative index `eta`, as a function of the cosine.
    #[inline]
    pub(super) fn coat_albedo(&self, alpha: Position, eta: f32) -> Profile {
        let f0 = super::fresnel::normal_incidence(eta);
        self.sides(eta).map_or(Profile::constant(0.0), |[above, _]| above.reflection(alpha, f0, 1.0))
    }

    /// Albedo of white sheen of a model and of roughness `alpha`, as a function of the cosine.
    #[inline]
    pub(super) fn sheen_albedo(&self, model: SheenModel, alpha: Position) -> Profile {
        let made = |i: usize| [row(&std::array::from_fn(|j| Vec4::X * sheen::albedo(model, node(i), node(j))))];
        Profile::new(self.sheen[model as usize].adjacent_rows(alpha, made), 0, 0.0, Vec4::X)
    }

    /// Energy that rough facets below a layer of albedo E lose because they are attenuated by `1 - max(E(o), E(i))` and
    /// not by `1 - E(o)`: the profile `integral f max(E(i) - E(o), 0) cos`.
    #[inline]
    pub(super) fn covered_loss(&self, layer: CoverLayer, alpha: Position, cover_alpha: f32) -> Profile {
        match layer {
            CoverLayer::Coat(eta) => match self.nearest(eta) {
                None => Profile::constant(0.0),
                Some(tables) => {
                    // The index of the tables' first use must not matter.
                    let usual = self.nearest(COAT_ETA).is_some_and(|usual| usual.eta == tables.eta);
                    let eta = if usual { COAT_ETA } else { tables.eta };
                    tables.below_coat.profile(alpha, cover_alpha, |alpha| self.coat_albedo(alpha, eta))
                }
            },
            CoverLayer::Sheen(model) => {
                let tables = &self.below_sheen[model as usize];
                tables.profile(alpha, cover_alpha, |alpha| self.sheen_albedo(model, alpha))
            }
        }
    }
}
