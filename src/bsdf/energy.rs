//! Directional albedos of the lobes, tabulated, so that what single scattering loses can be given back
//! \[Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"\], and layers share light.

use super::fresnel::{Smooth, is_matched, reflect, refract};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use super::profile::{Between, Grid, NODES, Position, Profile, node, row};
use super::sheen;
use super::stretched::{Pairs, Stretched};
use crate::math::{Vec2, Vec3, Vec4, sqr};
use std::sync::OnceLock;

/// Points of the quadrature over visible normals, and the generator of their lattice (Fibonacci numbers: the integrands
/// have kinks along curves, at the horizon and the critical angle, where product rules converge slowly).
const LATTICE: (usize, usize) = (987, 610);

/// Index of refraction of clear coats (KHR_materials_clearcoat).
pub(super) const COAT_ETA: f32 = 1.5;

/// Functions of [`SideTables`] for reflection: of a perfect reflector, of total reflection, of the rest per F0, per F90.
const REFLECTED: usize = 0;
/// For reflection and transmission: constant, per F0, per F90; the fourth is unused.
const SCATTERED: usize = 1;

/// Albedos of single scattering at one side of a rough dielectric, split so that the reflectances F0 at normal and F90
/// at grazing incidence can be chosen later: everything is linear in them.
#[derive(Clone, Debug)]
pub(super) struct SideTables {
    /// Index of the other side over this one's.
    eta: f32,
    /// [`REFLECTED`] and [`SCATTERED`].
    albedos: Grid<2>,
    /// The same of facets that are wider one way.
    stretched: Pairs,
    /// Cosine-weighted averages for a smooth interface: share of directions reflected in total, and of
    /// [`Smooth::grazing_weight`].
    pub average_total: f32,
    /// See `average_total`.
    pub average_grazing: f32,
}

/// Tables of one pair of media, seen from the thinner and from the denser one: made once, when they are first asked
/// for.
#[derive(Clone, Debug)]
struct InterfaceTables {
    /// Index of the denser medium over the thinner one.
    eta: f32,
    sides: OnceLock<Box<[SideTables; 2]>>,
}

/// What facets lose below a coat or a sheen, beyond its transmittance at `wo`: see [`EnergyTables::covered_loss`].
#[derive(Clone, Debug)]
struct CoverTables {
    /// Albedos of the covering at the nodes of its roughness.
    covers: OnceLock<[Profile; COVER_NODES]>,
    losses: Grid<3>,
}

/// Nodes of a cover's roughness, four to a grid, the ends shared.
const COVER_NODES: usize = 10;

/// What may lie on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Covering {
    /// A clear coat.
    Coat,
    /// Sheen.
    Sheen,
}

/// Everything tabulated for a scene, each row when it is first asked for. What pairs of media there can be is known from
/// the start, and which of them the nearest to an index is; so it makes no difference to what is looked up when, or by
/// which thread, a row is tabulated.
#[derive(Clone, Debug)]
pub struct EnergyTables {
    interfaces: Vec<InterfaceTables>,
    sheen: Grid<1>,
    below_coat: CoverTables,
    below_sheen: CoverTables,
}

/// Integrates over the facets that are seen from `wo`: `f` is given Lambda of it, a visible normal and its weight in
/// the quadrature. `turn` is the share of the azimuth that is looked at, where the rest is its mirror image.
fn over_facets(ggx: &Ggx, wo: Vec3, turn: f32, mut f: impl FnMut(f32, Vec3, f32)) {
    let lambda_o = ggx.lambda(wo);
    for k in 0..LATTICE.0 {
        // Graded towards the steep facets, whose reflections are the ones that are lost.
        let phi = turn * (((k * LATTICE.1) % LATTICE.0) as f32 + 0.5) / LATTICE.0 as f32;
        let rest = 1.0 - (k as f32 + 0.5) / LATTICE.0 as f32;
        let weight = 2.0 * rest / LATTICE.0 as f32;
        f(lambda_o, ggx.sample_visible(wo, Vec2::new(phi, 1.0 - rest * rest)), weight);
    }
}

/// Tabulates a function of the cosine at node `i` of alpha: `f` is given a lobe, the direction towards the viewer, Lambda
/// of it, a visible normal and its weight in the quadrature.
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

/// The reflected direction, and G2 over G1 of it; zero below the horizon.
fn reflected_share(ggx: &Ggx, wo: Vec3, lambda_o: f32, h: Vec3) -> (Vec3, f32) {
    let wi = reflect(wo, h);
    (wi, if wi.z > 0.0 { g2_reflection(lambda_o, ggx.lambda(wi)) / g1(lambda_o) } else { 0.0 })
}

/// Adds a facet's share of: total reflection; the rest reflected, and weighted by the grazing weight; transmitted, and
/// weighted.
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

/// [`REFLECTED`] from what [`add_albedos`] has added up.
fn reflected([total, r, rg, ..]: [f32; 5]) -> Vec4 {
    Vec4::new(total + r, total, r - rg, rg)
}

/// [`SCATTERED`] from what [`add_albedos`] has added up: transmitted is what F leaves, t (1 - F0) - tg (F90 - F0).
fn scattered([total, r, rg, t, tg]: [f32; 5]) -> Vec4 {
    Vec4::new(total + t, (r - rg) - (t - tg), rg - tg, 0.0)
}

impl SideTables {
    fn new(eta: f32) -> SideTables {
        let smooth = Smooth::new(eta);
        // Midpoints in mu^2: the cosine-weighted measure.
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
            stretched: Pairs::default(),
            average_total: (total / f64::from(n)) as f32,
            average_grazing: (grazing / f64::from(n)) as f32,
        }
    }

    /// The albedos around an alpha.
    #[inline]
    fn albedos(&self, alpha: Position) -> Between<'_, 2> {
        self.albedos.around(alpha, |i| {
            let smooth = Smooth::new(self.eta);
            let sums = tabulate(i, [0.0f32; 5], |sums, ggx, wo, lambda_o, h, weight| {
                add_albedos(sums, &smooth, ggx, wo, lambda_o, h, weight);
            });
            [row(&sums.map(reflected)), row(&sums.map(scattered))]
        })
    }

    /// Share of what arrives that the facets of a perfect reflector scatter less than all of: what compensation gives
    /// back.
    #[inline]
    pub fn white_loss(&self, alpha: Position) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 1.0, -Vec4::X)
    }

    /// Albedo of reflection.
    #[inline]
    pub fn reflection(&self, alpha: Position, f0: f32, f90: f32) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 0.0, Vec4::new(0.0, 1.0, f0, f90))
    }

    /// What neither reflection nor compensation by `multiple` of the white loss reflects.
    #[inline]
    pub fn let_through(&self, alpha: Position, f0: f32, f90: f32, multiple: f32) -> Profile {
        Profile::new(self.albedos(alpha), REFLECTED, 1.0 - multiple, Vec4::new(multiple, -1.0, -f0, -f90))
    }

    /// What reflection and transmission together lose.
    #[inline]
    pub fn glass_loss(&self, alpha: Position, f0: f32, f90: f32) -> Profile {
        Profile::new(self.albedos(alpha), SCATTERED, 1.0, Vec4::new(-1.0, -f0, -f90, 0.0))
    }

    /// The same of facets that are wider one way.
    pub fn stretched_glass_loss(&self, alphas: [Position; 2], f0: f32, f90: f32) -> Stretched {
        self.stretched(alphas, (SCATTERED, 1.0, -Vec4::new(1.0, f0, f90, 0.0)))
    }

    /// As [`SideTables::reflection`], of facets that are wider one way.
    pub fn stretched_reflection(&self, alphas: [Position; 2], f0: f32, f90: f32) -> Stretched {
        self.stretched(alphas, (REFLECTED, 0.0, Vec4::new(0.0, 1.0, f0, f90)))
    }

    fn stretched(&self, alphas: [Position; 2], functions: (usize, f32, Vec4)) -> Stretched {
        let smooth = Smooth::new(self.eta);
        self.stretched.around(alphas, functions, |alpha_x, alpha_y, wo| {
            let ggx = Ggx { alpha_x, alpha_y };
            let mut sums = [0.0; 5];
            over_facets(&ggx, wo, 1.0, |lambda_o, h, weight| {
                add_albedos(&mut sums, &smooth, &ggx, wo, lambda_o, h, weight);
            });
            [reflected(sums), scattered(sums)]
        })
    }

    /// Average reflectance of the smooth interface.
    #[inline]
    pub fn average_reflectance(&self, f0: f32, f90: f32) -> f32 {
        f0 * (1.0 - self.average_total - self.average_grazing) + f90 * self.average_grazing + self.average_total
    }
}

impl InterfaceTables {
    fn new(eta: f32) -> InterfaceTables {
        InterfaceTables { eta, sides: OnceLock::new() }
    }

    /// From the thinner medium, from the denser one.
    #[inline]
    fn sides(&self) -> &[SideTables; 2] {
        self.sides.get_or_init(|| Box::new([self.eta, 1.0 / self.eta].map(SideTables::new)))
    }
}

impl CoverTables {
    const fn new() -> CoverTables {
        CoverTables { covers: OnceLock::new(), losses: Grid::new() }
    }

    /// `cover(alpha)` is the albedo of the covering of a roughness.
    fn profile(&self, alpha: Position, cover_alpha: f32, cover: impl Fn(Position) -> Profile) -> Profile {
        let losses = self.losses.around(alpha, |i| {
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
    /// Tables for interfaces of the relative indices `etas` (an index and its inverse share one), and for 1.5; others
    /// use the nearest.
    pub fn new(etas: impl IntoIterator<Item = f32>) -> EnergyTables {
        let etas = etas.into_iter().chain([COAT_ETA]).filter(|e| *e > 0.0);
        let mut etas: Vec<f32> = etas.map(|e| if e < 1.0 { 1.0 / e } else { e }).collect();
        etas.sort_by(f32::total_cmp);
        // Nearer ones than this differ by less than the tables' own error.
        etas.dedup_by(|a, b| *a - *b < 1e-3 * *b || (a.is_infinite() && b.is_infinite()));
        etas.retain(|e| !is_matched(*e));
        EnergyTables {
            interfaces: etas.into_iter().map(InterfaceTables::new).collect(),
            sheen: Grid::new(),
            below_coat: CoverTables::new(),
            below_sheen: CoverTables::new(),
        }
    }

    /// How many rows are tabulated by now, of all pairs of media: what making them has cost.
    pub fn tabulated(&self) -> usize {
        let sides = self.interfaces.iter().filter_map(|pair| pair.sides.get()).flat_map(|sides| sides.iter());
        sides.map(|side| side.albedos.made()).sum()
    }

    /// The pair of media nearest to an interface of relative index `eta`; `None` if the interface does nothing.
    #[inline]
    fn nearest(&self, eta: f32) -> Option<&InterfaceTables> {
        if is_matched(eta) {
            return None;
        }
        let wanted = if eta < 1.0 { 1.0 / eta } else { eta };
        let after = self.interfaces.partition_point(|t| t.eta < wanted);
        let before = after.checked_sub(1).and_then(|i| self.interfaces.get(i));
        match (before, self.interfaces.get(after)) {
            (Some(a), Some(b)) if wanted - a.eta < b.eta - wanted => Some(a),
            (_, Some(b)) => Some(b),
            (a, None) => a,
        }
    }

    /// Tables of the sides of an interface of relative index `eta`: the one seen from above, the one seen from below.
    /// `None` if the interface does nothing.
    #[inline]
    pub(super) fn sides(&self, eta: f32) -> Option<[&SideTables; 2]> {
        let [thin, dense] = self.nearest(eta)?.sides();
        Some(if eta < 1.0 { [dense, thin] } else { [thin, dense] })
    }

    /// Share of what arrives that facets lose even if they reflect perfectly: seen from the thinner medium it is the
    /// same for every pair.
    #[inline]
    pub(super) fn white_loss(&self, alpha: Position) -> Profile {
        self.sides(COAT_ETA).map_or(Profile::constant(0.0), |[above, _]| above.white_loss(alpha))
    }

    /// Albedo of a clear coat.
    #[inline]
    pub(super) fn coat_albedo(&self, alpha: Position) -> Profile {
        let f0 = super::fresnel::normal_incidence(COAT_ETA);
        self.sides(COAT_ETA).map_or(Profile::constant(0.0), |[above, _]| above.reflection(alpha, f0, 1.0))
    }

    /// Albedo of white sheen.
    #[inline]
    pub(super) fn sheen_albedo(&self, alpha: Position) -> Profile {
        let made = |i: usize| [row(&std::array::from_fn(|j| Vec4::X * sheen::albedo(node(i), node(j))))];
        Profile::new(self.sheen.around(alpha, made), 0, 0.0, Vec4::X)
    }

    /// Facets below a covering of albedo E are seen through `1 - max(E(o), E(i))`, which is exact for mirrors and keeps
    /// the exchange of directions. Rough ones then lose `integral f max(E(i) - E(o), 0) cos` of what `1 - E(o)` would
    /// let them keep: this profile.
    #[inline]
    pub(super) fn covered_loss(&self, covering: Covering, alpha: Position, cover_alpha: f32) -> Profile {
        match covering {
            Covering::Coat => self.below_coat.profile(alpha, cover_alpha, |alpha| self.coat_albedo(alpha)),
            Covering::Sheen => self.below_sheen.profile(alpha, cover_alpha, |alpha| self.sheen_albedo(alpha)),
        }
    }
}
