//! The BSDF model: samples, densities and values agree, energy is conserved, and directions can be exchanged.
//!
//! Statistical checks have a family-wise error rate of 0.1 % (Sidak over the checks of a test) and fixed seeds. The
//! same checks reject planted bugs.

use crate::support;

use caustique::bsdf::{
    Bsdf, BsdfSample, DELTA_ALPHA, EnergyTables, LobeSet, Parameters, SHARP_ALPHA, SheenModel, Transport,
};
use caustique::math::{Rgb, Vec2, Vec3};
use caustique::random::mix;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::f64::consts::TAU;
use std::sync::LazyLock;
use support::bsdf;
use support::stats::{chi_squared_p, sidak};

const ERROR_RATE: f64 = 1e-3;

static TABLES: LazyLock<EnergyTables> = LazyLock::new(|| EnergyTables::new([1.33, 1.5, 2.4, 1.1, f32::INFINITY]));

/// Uniform numbers: hashes of a counter.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f32 {
        self.0 += 1;
        (mix(self.0.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 40) as f32 / 16_777_216.0
    }
    fn two(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }
}

fn plastic(alpha: f32, eta: f32) -> Parameters {
    Parameters { alpha_x: alpha, alpha_y: alpha, eta, specular: 1.0, ..Parameters::default() }
}
fn metal(alpha: f32) -> Parameters {
    Parameters { metallic: 1.0, ..plastic(alpha, 1.5) }
}
fn glass(alpha: f32, eta: f32) -> Parameters {
    Parameters { transmission: 1.0, ..plastic(alpha, eta) }
}
fn thin(alpha: f32) -> Parameters {
    Parameters { thin: true, ..glass(alpha, 1.5) }
}

/// A thin sheet that transmits part of the diffuse light.
fn sheet(p: Parameters) -> Parameters {
    Parameters { diffuse_transmission: 0.4, thin: true, ..p }
}

/// A surface with a thin film of index 1.33 and thickness 420 nm.
fn filmed(p: Parameters) -> Parameters {
    Parameters { film: 1.0, film_eta: 1.33, film_path: 2.0 * 1.33 * 420.0, ..p }
}

/// Named parameters of surfaces that lose no energy, for furnace tests.
fn white() -> Vec<(String, Parameters)> {
    let mut list = vec![("matte".to_string(), Parameters::default())];
    for alpha in [0.0, 0.002, 0.02, 0.1, 0.25, 0.5, 1.0f32] {
        list.push((format!("plastic {alpha}"), plastic(alpha, 1.5)));
        list.push((format!("metal {alpha}"), metal(alpha)));
        for eta in [1.1, 1.5, 2.4, 1.0 / 1.5] {
            list.push((format!("glass {alpha} eta {eta}"), glass(alpha, eta)));
        }
        list.push((format!("thin {alpha}"), thin(alpha)));
        list.push((format!("diamond-like plastic {alpha}"), plastic(alpha, 2.4)));
        let half = Parameters { metallic: 0.5, transmission: 0.5, ..plastic(alpha, 1.33) };
        list.push((format!("half of all {alpha}"), half));
        list.push((format!("half of all, thin {alpha}"), Parameters { thin: true, ..half }));
        list.push((format!("weak specular {alpha}"), Parameters { specular: 0.4, ..half }));
    }
    for (alpha_x, alpha_y) in [(0.5, 0.1), (0.2, 0.9), (0.97, 0.03), (0.3, 0.29)] {
        for eta in [1.1, 1.5, 1.0 / 2.4] {
            let stretched = Parameters { alpha_x, alpha_y, ..glass(0.0, eta) };
            list.push((format!("glass {alpha_x} {alpha_y} eta {eta}"), stretched));
        }
        let stretched = |p: Parameters| Parameters { alpha_x, alpha_y, ..p };
        list.push((format!("metal {alpha_x} {alpha_y}"), stretched(metal(0.0))));
        list.push((format!("thin wall {alpha_x} {alpha_y}"), stretched(thin(0.0))));
    }
    for (name, p) in [
        ("metal", metal(0.0)),
        ("rough metal", metal(0.5)),
        ("rougher metal", metal(1.0)),
        ("sharp metal", metal(0.1)),
        ("plastic", plastic(0.25, 1.5)),
        ("matte", Parameters::default()),
        ("matched", glass(0.3, 1.0)),
        ("smooth thin", thin(0.0)),
    ] {
        for (clearcoat, clearcoat_alpha) in [(1.0, 0.0), (0.6, 0.1), (1.0, 0.5)] {
            let coated = Parameters { clearcoat, clearcoat_alpha, ..p };
            list.push((format!("{name} below a coat {clearcoat} {clearcoat_alpha}"), coated));
        }
        let coated = Parameters { clearcoat: 1.0, clearcoat_alpha: 0.1, clearcoat_eta: 2.4, ..p };
        list.push((format!("{name} below a coat of index 2.4"), coated));
        for (sheen, sheen_alpha) in [(1.0, 0.1), (0.5, 0.5), (1.0, 1.0)] {
            let sheen_color = Rgb::splat(sheen);
            list.push((
                format!("{name} below sheen {sheen} {sheen_alpha}"),
                Parameters { sheen_color, sheen_alpha, ..p },
            ));
            let sheen_model = SheenModel::Fibers;
            list.push((
                format!("{name} below fibers {sheen} {sheen_alpha}"),
                Parameters { sheen_color, sheen_alpha, sheen_model, ..p },
            ));
        }
    }
    for alpha in [0.0, 0.1, 0.5] {
        list.push((format!("metal with a film {alpha}"), filmed(metal(alpha))));
        list.push((format!("thin wall with a film {alpha}"), filmed(thin(alpha))));
        let bubble = Parameters { eta: 1.0, ..filmed(thin(alpha)) };
        list.push((format!("film alone {alpha}"), Parameters { film: 0.7, ..bubble }));
    }
    for (name, p) in [
        ("matte", Parameters::default()),
        ("plastic", plastic(0.25, 1.5)),
        ("half of all", Parameters { metallic: 0.3, transmission: 0.4, thin: true, ..plastic(0.3, 1.5) }),
        ("coated", Parameters { clearcoat: 1.0, clearcoat_alpha: 0.1, ..Parameters::default() }),
    ] {
        list.push((format!("{name} sheet"), sheet(p)));
    }
    for diffuse_roughness in [0.1, 0.5, 1.0] {
        for (name, p) in [
            ("matte", Parameters::default()),
            ("smooth plastic", plastic(0.0, 1.5)),
            ("plastic", plastic(0.25, 1.5)),
            ("half of all", Parameters { metallic: 0.3, transmission: 0.4, ..plastic(0.3, 1.5) }),
            ("coated", Parameters { clearcoat: 1.0, clearcoat_alpha: 0.1, ..Parameters::default() }),
            ("sheet", sheet(plastic(0.25, 1.5))),
        ] {
            list.push((
                format!("{name}, diffuse roughness {diffuse_roughness}"),
                Parameters { diffuse_roughness, ..p },
            ));
        }
    }
    for eta in [1.5, 1.0 / 1.5] {
        list.push((format!("smooth glass with a film, eta {eta}"), filmed(glass(0.0, eta))));
    }
    list.push(("matched".into(), glass(0.3, 1.0)));
    list.push(("legacy ior 0".into(), plastic(0.3, f32::INFINITY)));
    list
}

/// Surfaces with a thin film that lose a few per cent of the light: the diffuse light below, and the light between the
/// facets of rough glass, follow the strongest channel and the mean of the film's colours.
fn lossy_films() -> Vec<(String, Parameters)> {
    let list = [0.0, 0.1, 0.5].map(|alpha| (format!("plastic with a film {alpha}"), filmed(plastic(alpha, 1.5))));
    let glasses = [(0.25, 1.5), (0.5, 1.0 / 1.5)];
    let glasses =
        glasses.map(|(alpha, eta)| (format!("glass with a film {alpha} eta {eta}"), filmed(glass(alpha, eta))));
    list.into_iter().chain(glasses).collect()
}

/// [`white`] and coloured surfaces.
fn all() -> Vec<(String, Parameters)> {
    let mut list = white();
    list.extend(lossy_films());
    let tinted: Vec<_> = list
        .iter()
        .map(|(name, p)| {
            let specular_color = Rgb::new(1.0, 0.5, 0.2);
            (format!("tinted {name}"), Parameters { base_color: Rgb::new(0.9, 0.4, 0.0), specular_color, ..*p })
        })
        .collect();
    list.extend(tinted);
    let coats: Vec<_> = list
        .iter()
        .filter(|(name, p)| p.clearcoat > 0.0 && !name.contains("tinted"))
        .map(|(name, p)| (format!("{name} of colour"), Parameters { clearcoat_color: Rgb::new(0.9, 0.3, 0.0), ..*p }))
        .collect();
    list.extend(coats);
    for (name, p) in [
        ("smooth glass", glass(0.0, 1.5)),
        ("glass", glass(0.3, 1.5)),
        ("thin wall", thin(0.3)),
        ("plastic", plastic(0.25, 1.5)),
        ("legacy ior 0", plastic(0.3, f32::INFINITY)),
        ("plastic with a film", filmed(plastic(0.1, 1.5))),
    ] {
        let reflection_color = Rgb::new(0.9, 0.4, 0.1);
        list.push((format!("{name} of coloured reflection"), Parameters { reflection_color, ..p }));
    }
    for (name, p) in [("metal", metal(0.5)), ("plastic", plastic(0.5, 1.5)), ("thin wall", thin(0.5))] {
        let stretched = Parameters { alpha_x: 0.9, alpha_y: 0.2, single_scattering: true, ..p };
        list.push((format!("stretched {name} of single scattering"), stretched));
        list.push((format!("{name} of single scattering"), Parameters { single_scattering: true, ..p }));
    }
    list.push(("black metal".into(), Parameters { base_color: Rgb::ZERO, ..metal(0.3) }));
    list.push(("black glass".into(), Parameters { base_color: Rgb::ZERO, ..glass(0.3, 1.5) }));
    list.push(("black".into(), Parameters { base_color: Rgb::ZERO, ..Parameters::default() }));
    list
}

fn outgoing(mu: f32, phi: f32) -> Vec3 {
    let r = (1.0 - mu * mu).sqrt();
    Vec3::new(r * phi.cos(), r * phi.sin(), mu)
}

const COSINES: [f32; 6] = [1.0, 0.4, 0.1, 0.02, -0.7, -0.05];

/// Mean weight of sampled directions: the albedo. The points are Roberts' R3 sequence.
fn drawn_albedo(bsdf: &Bsdf, wo: Vec3, transport: Transport, side: u32) -> Rgb {
    let mut sum = glam::DVec3::ZERO;
    for k in 0..side * side {
        let [lobe, x, y] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3]
            .map(|a| (f64::from(k) * a + 0.5).fract() as f32);
        let u = Vec2::new(x, y);
        if let Some(s) = bsdf.sample(wo, transport, LobeSet::ALL, lobe, u) {
            sum += s.weight.as_dvec3();
        }
    }
    (sum / f64::from(side * side)).as_vec3()
}

/// Largest deviation of a white surface from albedo 1, over [`COSINES`] and, for anisotropic surfaces, over azimuths.
fn furnace_error(p: &Parameters) -> f32 {
    let bsdf = bsdf(p, &TABLES);
    let azimuths: &[f32] = if p.alpha_x == p.alpha_y { &[0.7] } else { &[0.05, 0.7, 1.5, 4.0] };
    let worst = |worst: f32, wo: Vec3| {
        let off = |side| (drawn_albedo(&bsdf, wo, Transport::Importance, side) - Rgb::ONE).abs().max_element();
        // More points where few are not accurate enough.
        let coarse = off(128);
        worst.max(if coarse > 0.003 { off(512) } else { coarse })
    };
    azimuths.iter().flat_map(|&phi| COSINES.map(|mu| outgoing(mu, phi))).fold(0.0, worst)
}

/// A surface that loses no energy is white under a white sky, from both sides: within 0.5 % for every roughness and
/// cover; within 1 % below fibres, whose albedo changes fast with their roughness; within 1.5 % in every direction for
/// anisotropic roughness; within 5 % for a ratio of alphas of thirty.
#[test]
fn white_furnace() {
    let allowed = |p: &Parameters| match p.alpha_x.max(p.alpha_y) / p.alpha_x.min(p.alpha_y) {
        stretch if stretch > 10.0 => 0.05,
        stretch if stretch > 1.0 => 0.015,
        _ if p.sheen_model == SheenModel::Fibers => 0.01,
        _ => 0.005,
    };
    let failures: Vec<String> = white()
        .par_iter()
        .map(|(name, p)| (name, furnace_error(p), allowed(p)))
        .filter(|(_, error, allowed)| error >= allowed || error.is_nan())
        .map(|(name, error, _)| format!("{name}: off by {error}"))
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    // A surface that loses 1 % is rejected.
    let grey = Parameters { base_color: Rgb::splat(0.99), ..metal(0.5) };
    assert!(furnace_error(&grey) > 0.005);
}

/// A white surface with a thin film loses at most 8 % of the light. Rough glass gains at most 1.5 %, in the channel that
/// differs most from the mean.
#[test]
fn films_keep_most_of_the_light() {
    for (name, p) in lossy_films() {
        let bsdf = bsdf(&p, &TABLES);
        for wo in COSINES.map(|mu| outgoing(mu, 0.7)) {
            let albedo = drawn_albedo(&bsdf, wo, Transport::Importance, 128);
            assert!(albedo.max_element() < 1.015 && albedo.min_element() > 0.92, "{name}, {wo}: {albedo}");
        }
    }
}

/// A film on smooth glass reflects equally from both sides, at angles that refraction joins, and transmits the rest.
#[test]
fn films_reflect_equally_from_both_sides() {
    let bsdf = bsdf(&filmed(glass(0.0, 1.5)), &TABLES);
    let shares = |wo: Vec3| {
        let mut shares = [Rgb::ZERO; 2];
        for k in 0..256 {
            let lobe = (k as f32 + 0.5) / 256.0;
            let s = bsdf.sample(wo, Transport::Importance, LobeSet::ALL, lobe, Vec2::splat(0.5)).expect("a direction");
            shares[usize::from(s.transmitted)] = s.weight * s.pdf_w;
        }
        shares
    };
    for mu in [1.0f32, 0.7, 0.3, 0.1] {
        let inside = (1.0 - (1.0 - mu * mu) / 2.25).sqrt();
        let ([above, through], [below, _]) = (shares(outgoing(mu, 0.0)), shares(-outgoing(inside, 0.0)));
        assert!((above + through - Rgb::ONE).abs().max_element() < 1e-4, "{mu}: {above} {through}");
        assert!((above - below).abs().max_element() < 1e-4, "{mu}: {above} is not {below}");
        assert!(mu < 0.5 || above.max_element() - above.min_element() > 0.004, "{mu}: {above} has no colour");
    }
}

/// The functions of a BSDF that the tests need. Implementations can plant bugs.
trait Scatter {
    fn sample(&self, wo: Vec3, set: LobeSet, lobe: f32, u: Vec2) -> Option<BsdfSample>;
    fn pdf(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> f32;
    fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb;
}

impl Scatter for Bsdf<'_> {
    fn sample(&self, wo: Vec3, set: LobeSet, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        Bsdf::sample(self, wo, Transport::Radiance, set, lobe, u)
    }
    fn pdf(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> f32 {
        Bsdf::pdf(self, wo, wi, Transport::Radiance, set)
    }
    fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        Bsdf::eval(self, wo, wi, transport, set)
    }
}

/// Numbers of cells of the sphere, with equal steps of the cosine and of the azimuth.
const CELLS: (usize, usize) = (24, 16);

fn direction(z: f64, phi: f64) -> Vec3 {
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)
}

/// Integral over a cell, which is halved if a finer rule disagrees.
fn integrate(f: &dyn Fn(Vec3) -> f64, z: (f64, f64), phi: (f64, f64), depth: u32) -> f64 {
    let rule = |n: usize| {
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let at = |(a, b): (f64, f64), i: usize| a + (b - a) * (i as f64 + 0.5) / n as f64;
                sum += f(direction(at(z, i), at(phi, j)));
            }
        }
        sum * (z.1 - z.0) * (phi.1 - phi.0) / (n * n) as f64
    };
    let (coarse, fine) = (rule(3), rule(5));
    if depth == 0 || (coarse - fine).abs() < 2e-6 + 2e-3 * fine.abs().min(1e-2) {
        return fine;
    }
    let (mz, mp) = (0.5 * (z.0 + z.1), 0.5 * (phi.0 + phi.1));
    [((z.0, mz), (phi.0, mp)), ((z.0, mz), (mp, phi.1)), ((mz, z.1), (phi.0, mp)), ((mz, z.1), (mp, phi.1))]
        .into_iter()
        .map(|(z, phi)| integrate(f, z, phi, depth - 1))
        .sum()
}

/// P-value of the hypothesis that sampled directions follow the density, and the largest relative difference between a
/// weight and `f |cos| / pdf`. Invalid samples and delta lobes have their own cell, so that the integral of the density
/// is tested, too.
fn triad(bsdf: &dyn Scatter, wo: Vec3, set: LobeSet, draws: usize, seed: u64) -> (f64, f32) {
    let (rows, columns) = CELLS;
    let mut counts = vec![0.0; rows * columns + 1];
    let mut expected = vec![0.0; rows * columns + 1];
    let mut uniform = Uniform(seed << 32);
    let mut difference = 0.0f32;
    for _ in 0..draws {
        let (lobe, u) = (uniform.next(), uniform.two());
        let cell = match bsdf.sample(wo, set, lobe, u) {
            Some(s) if s.lobe != LobeSet::DELTA => {
                assert!((s.wi.length() - 1.0).abs() < 1e-4 && s.weight.is_finite() && set.intersects(s.lobe));
                assert_eq!(s.transmitted, s.wi.z * wo.z < 0.0);
                let f = bsdf.eval(wo, s.wi, Transport::Radiance, set) * s.wi.z.abs();
                let pdf = bsdf.pdf(wo, s.wi, set);
                let off = (s.weight * pdf - f).abs().max_element() / f.max_element().max(1e-3 * pdf);
                difference = difference.max(off).max((s.pdf_w - pdf).abs() / pdf);
                let row = ((f64::from(s.wi.z) + 1.0) * 0.5 * rows as f64).min(rows as f64 - 1.0) as usize;
                let turn = f64::from(s.wi.y).atan2(f64::from(s.wi.x)).rem_euclid(TAU) / TAU;
                row * columns + (turn * columns as f64).min(columns as f64 - 1.0) as usize
            }
            _ => rows * columns,
        };
        counts[cell] += 1.0;
    }
    let density = |wi: Vec3| f64::from(bsdf.pdf(wo, wi, set));
    let mut total = 0.0;
    for row in 0..rows {
        for column in 0..columns {
            let z = |i: usize| 2.0 * i as f64 / rows as f64 - 1.0;
            let phi = |i: usize| TAU * i as f64 / columns as f64;
            let mass = integrate(&density, (z(row), z(row + 1)), (phi(column), phi(column + 1)), 9);
            expected[row * columns + column] = mass * draws as f64;
            total += mass;
        }
    }
    assert!(total < 1.002, "the density integrates to {total}");
    expected[rows * columns] = (1.0 - total).max(0.0) * draws as f64;
    (chi_squared_p(&counts, &expected), difference)
}

/// Parameters whose densities are wide enough to integrate over cells quickly.
fn triads() -> Vec<(String, Parameters)> {
    let rough = |p: &Parameters| p.alpha_x == 0.0 || p.alpha_x.min(p.alpha_y) >= 0.1;
    let mut list: Vec<_> = all().into_iter().filter(|(_, p)| rough(p)).collect();
    list.push(("anisotropic metal".into(), Parameters { alpha_x: 0.6, alpha_y: 0.15, ..metal(0.0) }));
    list.push(("anisotropic glass".into(), Parameters { alpha_x: 0.15, alpha_y: 0.5, ..glass(0.0, 1.5) }));
    list
}

const TRIAD_DRAWS: usize = 6_000;

#[test]
fn directions_follow_their_density() {
    let mut cases = vec![];
    for (name, p) in triads() {
        let bsdf = bsdf(&p, &TABLES);
        for mu in [0.9, 0.04, -0.4f32] {
            for set in [LobeSet::ALL, LobeSet::BROAD, LobeSet::SHARP, LobeSet::SHARP | LobeSet::DELTA] {
                // A set with the same lobes as ALL tests nothing new.
                if bsdf.lobes().intersects(set) && (set == LobeSet::ALL || bsdf.lobes() & set != bsdf.lobes()) {
                    cases.push((name.clone(), bsdf, outgoing(mu, 2.0), set));
                }
            }
        }
    }
    let least = sidak(ERROR_RATE, cases.len());
    println!("{} cases", cases.len());
    let failures: Vec<String> = cases
        .par_iter()
        .enumerate()
        .filter_map(|(i, (name, bsdf, wo, set))| {
            let (p, difference) = triad(bsdf, *wo, *set, TRIAD_DRAWS, i as u64);
            (p < least || difference > 2e-3)
                .then(|| format!("{name}, wo {wo}, {set:?}: p {p:.2e}, weights off by {difference:.2e}"))
        })
        .collect();
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), cases.len(), failures.join("\n"));
}

/// Known bugs of other renderers, planted between the model and its test.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bug {
    None,
    MissingCosine,
    MissingJacobian,
    SwappedAlpha,
    LobeForgotten,
    WeightWithoutCosine,
    DeltaShareForgotten,
}

struct Planted<'a>(Bsdf<'a>, Bsdf<'a>, Bug);

impl Scatter for Planted<'_> {
    fn sample(&self, wo: Vec3, set: LobeSet, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let mut s = Bsdf::sample(&self.0, wo, Transport::Radiance, set, lobe, u)?;
        s.pdf_w = self.pdf(wo, s.wi, set);
        s.weight = self.eval(wo, s.wi, Transport::Radiance, set) * (s.wi.z.abs() / s.pdf_w);
        if self.2 == Bug::WeightWithoutCosine {
            s.weight /= s.wi.z.abs();
        }
        Some(s)
    }
    fn pdf(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> f32 {
        let pdf = |bsdf: &Bsdf, set| Bsdf::pdf(bsdf, wo, wi, Transport::Radiance, set);
        let own = pdf(&self.0, set);
        match self.2 {
            Bug::MissingCosine => own / (2.0 * wi.z.abs()),
            Bug::MissingJacobian if wi.z * wo.z < 0.0 => own / 2.25,
            Bug::SwappedAlpha => pdf(&self.1, set),
            Bug::LobeForgotten if wi.z * wo.z < 0.0 => 0.97 * own,
            Bug::DeltaShareForgotten => pdf(&self.0, LobeSet::SMOOTH),
            _ => own,
        }
    }
    fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        Bsdf::eval(&self.0, wo, wi, transport, set)
    }
}

#[test]
fn planted_bugs_in_densities_are_found() {
    let least = sidak(ERROR_RATE, 1000);
    let found = |p: Parameters, bug: Bug| {
        let swapped = Parameters { alpha_x: p.alpha_y, alpha_y: p.alpha_x, ..p };
        let planted = Planted(bsdf(&p, &TABLES), bsdf(&swapped, &TABLES), bug);
        let wo = outgoing(0.6, 0.5);
        let lobes = planted.0.lobes();
        let (p, difference) = triad(&planted, wo, lobes, 4 * TRIAD_DRAWS, 99);
        p < least || difference > 2e-3
    };
    let stretched = Parameters { alpha_x: 0.5, alpha_y: 0.3, ..glass(0.0, 1.5) };
    let coated = Parameters { clearcoat: 1.0, ..Parameters::default() };
    assert!(!found(stretched, Bug::None) && !found(coated, Bug::None));
    for bug in
        [Bug::MissingCosine, Bug::MissingJacobian, Bug::SwappedAlpha, Bug::LobeForgotten, Bug::WeightWithoutCosine]
    {
        assert!(found(stretched, bug), "{bug:?} passes");
    }
    assert!(found(coated, Bug::DeltaShareForgotten), "DeltaShareForgotten passes");
}

/// Pairs of directions on all sides, grazing ones included.
fn pairs(count: usize, seed: u64) -> Vec<(Vec3, Vec3)> {
    let mut uniform = Uniform(seed << 32);
    let mut one = || {
        let z = 2.0 * uniform.next() - 1.0;
        let z = if uniform.next() < 0.2 { z * 0.05 } else { z };
        direction(f64::from(z), TAU * f64::from(uniform.next()))
    };
    (0..count).map(|_| (one(), one())).collect()
}

fn index(p: &Parameters, w: Vec3) -> f32 {
    if w.z > 0.0 || p.thin { 1.0 } else { p.eta }
}

/// Largest relative violation of `f_radiance(o, i) / n_o^2 = f_radiance(i, o) / n_i^2`, which for reflection is
/// reciprocity, and of `f_radiance(o, i) = f_importance(i, o)`.
fn asymmetry(bsdf: &dyn Scatter, p: &Parameters) -> f32 {
    let mut worst = 0.0f32;
    for (o, i) in pairs(2000, 3) {
        let there = bsdf.eval(o, i, Transport::Radiance, LobeSet::ALL);
        let back = bsdf.eval(i, o, Transport::Radiance, LobeSet::ALL);
        let adjoint = bsdf.eval(i, o, Transport::Importance, LobeSet::ALL);
        let squared = |w| index(p, w) * index(p, w);
        let relative = |a: Rgb, b: Rgb| (a - b).abs().max_element() / a.max(b).max_element().max(1e-4);
        worst = worst.max(relative(there / squared(o), back / squared(i))).max(relative(there, adjoint));
    }
    worst
}

struct WithoutEta<'a>(Bsdf<'a>);

impl Scatter for WithoutEta<'_> {
    fn sample(&self, wo: Vec3, set: LobeSet, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        Scatter::sample(&self.0, wo, set, lobe, u)
    }
    fn pdf(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> f32 {
        Scatter::pdf(&self.0, wo, wi, set)
    }
    fn eval(&self, wo: Vec3, wi: Vec3, _: Transport, set: LobeSet) -> Rgb {
        Bsdf::eval(&self.0, wo, wi, Transport::Importance, set)
    }
}

#[test]
fn directions_can_be_exchanged() {
    for (name, p) in all() {
        // For an index near 1 the half vector of refraction is a small difference, whose rounding errors matter in
        // narrow lobes.
        let allowed = if p.alpha_x.min(p.alpha_y) < 0.05 { 0.2 } else { 1e-2 };
        let worst = asymmetry(&bsdf(&p, &TABLES), &p);
        assert!(worst < allowed, "{name}: off by {worst}");
    }
    let p = glass(0.3, 1.5);
    assert!(asymmetry(&WithoutEta(bsdf(&p, &TABLES)), &p) > 0.5, "a missing eta^2 passes");
}

/// Smooth glass and water: the values of Fresnel's and Snell's equations and the factor 1/eta^2, from both sides and in
/// both directions.
#[test]
fn smooth_glass_by_the_book() {
    let p = glass(0.0, 1.5);
    let bsdf = bsdf(&p, &TABLES);
    assert_eq!(bsdf.lobes(), LobeSet::DELTA);
    for (transport, radiance) in [(Transport::Radiance, true), (Transport::Importance, false)] {
        for (wo, eta) in [(outgoing(0.6, 0.0), 1.5f32), (-outgoing(0.9, 0.0), 1.0 / 1.5)] {
            // Fresnel's equations in angles, unlike in the model.
            let theta_o = wo.z.abs().acos();
            let theta_i = (theta_o.sin() / eta).asin();
            let s = ((theta_o - theta_i).sin() / (theta_o + theta_i).sin()).powi(2);
            let t = ((theta_o - theta_i).tan() / (theta_o + theta_i).tan()).powi(2);
            let reflectance = 0.5 * (s + t);
            let mut seen = [false; 2];
            for k in 0..64 {
                let lobe = (k as f32 + 0.5) / 64.0;
                let s = bsdf.sample(wo, transport, LobeSet::ALL, lobe, Vec2::splat(0.5)).expect("a direction");
                assert_eq!(s.lobe, LobeSet::DELTA);
                let (value, wi) = if s.transmitted {
                    let scale = if radiance { 1.0 / (eta * eta) } else { 1.0 };
                    ((1.0 - reflectance) * scale, Vec3::new(-theta_i.sin(), 0.0, -theta_i.cos()) * wo.z.signum())
                } else {
                    (reflectance, Vec3::new(-wo.x, -wo.y, wo.z))
                };
                let wi = if s.transmitted { Vec3::new(-wo.x / eta, 0.0, wi.z) } else { wi };
                seen[usize::from(s.transmitted)] = true;
                assert!((s.wi - wi).length() < 1e-4, "{:?} is not {wi}", s.wi);
                assert!((s.weight.x * s.pdf_w - value).abs() < 1e-4, "{} is not {value}", s.weight.x * s.pdf_w);
            }
            assert_eq!(seen, [true; 2]);
        }
    }
    // Beyond the critical angle (41.8 degrees) all light is reflected.
    let wo = -outgoing(0.7, 0.3);
    for k in 0..16 {
        let lobe = (k as f32 + 0.5) / 16.0;
        let s = bsdf.sample(wo, Transport::Radiance, LobeSet::ALL, lobe, Vec2::splat(0.5)).expect("a direction");
        assert!(!s.transmitted && (s.weight.x - 1.0).abs() < 1e-5);
    }
}

/// Reflectance of KHR_materials_specular, of metal and of a clear coat at normal incidence.
#[test]
fn reflectance_at_normal_incidence_follows_the_extensions() {
    let mirror = |p: Parameters| {
        let bsdf = bsdf(&p, &TABLES);
        let s = bsdf.sample(Vec3::Z, Transport::Radiance, LobeSet::DELTA, 0.5, Vec2::splat(0.5)).expect("a direction");
        s.weight * s.pdf_w
    };
    let near = |a: Rgb, b: Rgb| assert!((a - b).abs().max_element() < 1e-4, "{a} is not {b}");
    let black = Parameters { base_color: Rgb::ZERO, ..plastic(0.0, 1.5) };
    near(mirror(black), Rgb::splat(0.04));
    near(mirror(Parameters { specular: 0.5, ..black }), Rgb::splat(0.02));
    near(mirror(Parameters { specular_color: Rgb::new(1.0, 0.5, 50.0), ..black }), Rgb::new(0.04, 0.02, 1.0));
    near(mirror(Parameters { eta: f32::INFINITY, ..black }), Rgb::ONE);
    let gold = Rgb::new(1.0, 0.8, 0.3);
    near(mirror(Parameters { base_color: gold, ..metal(0.0) }), gold);
    near(mirror(Parameters { metallic: 0.5, base_color: gold, ..plastic(0.0, 1.5) }), gold * 0.5 + Rgb::splat(0.02));
    near(mirror(Parameters { clearcoat: 0.5, base_color: Rgb::ZERO, ..Parameters::default() }), Rgb::splat(0.02));
    let dense = Parameters { clearcoat: 1.0, clearcoat_eta: 2.0, base_color: Rgb::ZERO, ..Parameters::default() };
    near(mirror(dense), Rgb::splat(1.0 / 9.0));
}

/// The colour of the reflection counts at all angles, and takes no light from transmission.
#[test]
fn reflection_has_its_colour_at_all_angles() {
    let color = Rgb::new(0.9, 0.4, 0.1);
    let tinted = |p: Parameters| Parameters { reflection_color: color, ..p };
    for mu in [1.0f32, 0.6, 0.2, 0.05] {
        let wo = outgoing(mu, 0.3);
        let albedo = |p: Parameters| drawn_albedo(&bsdf(&p, &TABLES), wo, Transport::Importance, 64);
        let mirror = albedo(tinted(Parameters { base_color: Rgb::ZERO, ..plastic(0.0, f32::INFINITY) }));
        assert!((mirror - color).abs().max_element() < 1e-4, "{mu}: {mirror}");
        let inside = (1.0 - (1.0 - mu * mu) / 2.25).sqrt();
        let s = ((mu - 1.5 * inside) / (mu + 1.5 * inside)).powi(2);
        let t = ((1.5 * mu - inside) / (1.5 * mu + inside)).powi(2);
        let (reflected, glass) = (0.5 * (s + t), albedo(tinted(glass(0.0, 1.5))));
        let expected = color * reflected + Rgb::splat(1.0 - reflected);
        assert!((glass - expected).abs().max_element() < 2e-3, "{mu}: {glass} is not {expected}");
    }
}

/// Without the light that facets scatter more than once, the albedo of a perfect reflector is E. The lobe that is left
/// out is (1 - E(o)) (1 - E(i)) / (pi (1 - E_avg)) [Kulla and Conty 2017].
#[test]
fn single_scattering_leaves_out_the_compensation() {
    for alpha in [0.3, 0.6, 1.0] {
        let [single, whole] =
            [true, false].map(|single_scattering| bsdf(&Parameters { single_scattering, ..metal(alpha) }, &TABLES));
        let lost = |mu: f32| 1.0 - drawn_albedo(&single, outgoing(mu, 0.3), Transport::Importance, 128).x;
        let n = 64;
        // The midpoint rule in mu^2, which is the cosine-weighted measure.
        let average = (0..n).map(|k| lost(((k as f32 + 0.5) / n as f32).sqrt())).sum::<f32>() / n as f32;
        assert!(average > 0.01, "{alpha}: {average}");
        for (o, i) in [(1.0, 0.8), (0.7, 0.3), (0.4, 0.4)] {
            let value =
                |bsdf: &Bsdf| bsdf.eval(outgoing(o, 0.3), outgoing(i, 2.0), Transport::Radiance, LobeSet::ALL).x;
            let (found, expected) = (value(&whole) - value(&single), lost(o) * lost(i) / (PI * average));
            assert!((found - expected).abs() < 0.05 * expected + 1e-4, "{alpha}, {o}, {i}: {found} is not {expected}");
            assert!((found - 1.2 * expected).abs() > 0.05 * expected + 1e-4, "an error of 20 % is not detected");
        }
    }
}

/// A mirror below a smooth coat of colour c reflects `(1 - E) c^(1 / cos)`, with the cosine of the refracted ray and
/// the reflectance E of the coat, where the coat is; a diffuse base has the mean path on its other side.
#[test]
fn coloured_coats_absorb_along_refracted_paths() {
    let color = Rgb::new(0.9, 0.3, 0.02);
    for (eta, coat) in [(1.5f32, 1.0), (1.5, 0.4), (2.4, 1.0)] {
        let p = Parameters { clearcoat: coat, clearcoat_eta: eta, clearcoat_color: color, ..metal(0.0) };
        let bsdf = bsdf(&p, &TABLES);
        for mu in [1.0f32, 0.6, 0.2] {
            let wo = outgoing(mu, 0.3);
            let inside = (1.0 - (1.0 - mu * mu) / (eta * eta)).sqrt();
            let s = ((mu - eta * inside) / (mu + eta * inside)).powi(2);
            let t = ((eta * mu - inside) / (eta * mu + inside)).powi(2);
            let reflected = 0.5 * (s + t) * coat;
            let absorbed = color.map(|c| 1.0 - coat + coat * c.powf(1.0 / inside));
            let expected = Rgb::splat(reflected) + absorbed * (1.0 - reflected);
            let found = drawn_albedo(&bsdf, wo, Transport::Radiance, 64);
            // The reflectance of the coat below which facets lie is from a table.
            assert!((found - expected).abs().max_element() < 6e-3, "{eta} {coat} {mu}: {found} is not {expected}");
        }
    }
}

/// Every lobe is in exactly one class: values of single classes sum to the value of all classes.
#[test]
fn every_lobe_is_in_one_class() {
    assert_eq!(bsdf(&metal(DELTA_ALPHA * 0.9), &TABLES).lobes(), LobeSet::DELTA);
    assert_eq!(bsdf(&metal(SHARP_ALPHA * 0.9), &TABLES).lobes(), LobeSet::SHARP);
    assert_eq!(bsdf(&metal(SHARP_ALPHA * 1.1), &TABLES).lobes(), LobeSet::BROAD);
    assert_eq!(bsdf(&plastic(0.1, 1.5), &TABLES).lobes(), LobeSet::SMOOTH);
    assert_eq!(bsdf(&plastic(0.0, 1.5), &TABLES).lobes(), LobeSet::DELTA | LobeSet::BROAD);
    assert_eq!(bsdf(&glass(0.5, 1.0), &TABLES).lobes(), LobeSet::DELTA);
    // Rough glass of a nearly matched index deflects light little.
    assert_eq!(bsdf(&glass(0.5, 1.5), &TABLES).lobes(), LobeSet::BROAD);
    assert_eq!(bsdf(&glass(0.5, 1.1), &TABLES).lobes(), LobeSet::SHARP);
    assert_eq!(bsdf(&glass(0.5, 1.0 / 1.1), &TABLES).lobes(), LobeSet::SHARP);
    assert_eq!(bsdf(&Parameters { thin: true, ..glass(0.5, 1.1) }, &TABLES).lobes(), LobeSet::BROAD);
    assert_eq!(bsdf(&Parameters { metallic: 1.0, ..glass(0.5, 1.1) }, &TABLES).lobes(), LobeSet::BROAD);
    let black = Parameters { base_color: Rgb::ZERO, ..Parameters::default() };
    assert_eq!(bsdf(&black, &TABLES).lobes(), LobeSet::empty());
    for (name, p) in all() {
        let bsdf = bsdf(&p, &TABLES);
        for (o, i) in pairs(50, 5) {
            let f = |set| bsdf.eval(o, i, Transport::Radiance, set);
            let (sum, all) = (f(LobeSet::BROAD) + f(LobeSet::SHARP), f(LobeSet::ALL));
            assert!((sum - all).abs().max_element() <= 1e-4 * all.max_element(), "{name}: {sum} is not {all}");
            assert_eq!(f(LobeSet::DELTA), Rgb::ZERO);
            for set in [LobeSet::DELTA, LobeSet::SHARP, LobeSet::BROAD] {
                if !bsdf.lobes().intersects(set) {
                    assert_eq!(f(set), Rgb::ZERO, "{name}");
                    assert_eq!(bsdf.albedo(o, set), Rgb::ZERO, "{name}");
                }
            }
            if p.transmission == 0.0 && p.diffuse_transmission == 0.0 && o.z * i.z < 0.0 {
                assert_eq!(all, Rgb::ZERO, "{name}: an opaque surface lets light through");
            }
        }
    }
}

/// The albedo estimate for Russian roulette is near the true albedo.
#[test]
fn albedo_is_near_the_truth() {
    let mut faults = Vec::new();
    for (name, p) in all() {
        let bsdf = bsdf(&p, &TABLES);
        // For anisotropic glass, the albedo of reflection is from a coarser table.
        let within = if p.transmission > 0.0 && p.alpha_x != p.alpha_y { 0.2 } else { 0.12 };
        for mu in [1.0, 0.5, -0.5] {
            let wo = outgoing(mu, 1.0);
            let (estimate, drawn) = (bsdf.albedo(wo, LobeSet::ALL), drawn_albedo(&bsdf, wo, Transport::Importance, 64));
            if (estimate - drawn).abs().max_element() >= within {
                faults.push(format!("{name}, {mu}: {estimate} is not {drawn}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// No parameter of a file and no ray gives a value that is not finite.
#[test]
fn extremes_stay_finite() {
    let mut uniform = Uniform(77 << 32);
    let tiny = 1e-30f32;
    let directions = [
        Vec3::Z,
        -Vec3::Z,
        Vec3::X,
        outgoing(1e-4, 0.3),
        outgoing(1e-7, 1.0),
        -outgoing(1e-5, 2.0),
        Vec3::new(1.0, 0.0, tiny),
    ];
    for (name, p) in all() {
        for alpha in [p.alpha_x, DELTA_ALPHA, 1e-5] {
            let p = Parameters { alpha_x: alpha, ..p };
            let bsdf = bsdf(&p, &TABLES);
            for wo in directions {
                assert!(bsdf.albedo(wo, LobeSet::ALL).is_finite(), "{name} {alpha} {wo}");
                for transport in [Transport::Radiance, Transport::Importance] {
                    for wi in directions {
                        let (f, pdf) = bsdf.evaluate(wo, wi, transport, LobeSet::ALL);
                        assert!(f.is_finite() && pdf.is_finite(), "{name} {alpha} {wo} {wi}: {f} {pdf}");
                        assert!(f.min_element() >= 0.0 && pdf >= 0.0, "{name} {alpha} {wo} {wi}: {f} {pdf}");
                    }
                    for k in 0..32 {
                        let edge = [0.0, 1.0 - f32::EPSILON / 2.0, 0.5][k % 3];
                        let u = if k < 9 {
                            Vec2::new(edge, [0.0, 1.0 - f32::EPSILON / 2.0, 0.3][k / 3])
                        } else {
                            uniform.two()
                        };
                        let lobe = if k < 9 { edge } else { uniform.next() };
                        if let Some(s) = bsdf.sample(wo, transport, LobeSet::ALL, lobe, u) {
                            assert!(
                                s.weight.is_finite() && s.pdf_w > 0.0 && s.wi.is_finite(),
                                "{name} {alpha} {wo} {s:?}"
                            );
                            assert!(s.weight.min_element() >= 0.0, "{name} {alpha} {wo} {s:?}");
                        }
                    }
                }
            }
        }
    }
}
