//! The scattering model: sample, density and value agree; energy is kept; directions can be exchanged.
//!
//! Statistical checks run at a family-wise error rate of 0.1 % (Sidak over the checks of a test) with fixed seeds. Planted bugs are
//! rejected by the same checks.

mod support;

use caustique::bsdf::{Bsdf, BsdfSample, Coverings, EnergyTables, LobeSet, Parameters, SHARP_ALPHA, Transport};
use caustique::math::{Rgb, Vec2, Vec3};
use caustique::random::mix;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;
use support::stats::{chi_squared_p, sidak};

const ERROR_RATE: f64 = 1e-3;

static TABLES: LazyLock<EnergyTables> =
    LazyLock::new(|| EnergyTables::new([1.33, 1.5, 2.4, 1.1, f32::INFINITY], Coverings { coat: true, sheen: true }));

/// Uniform numbers by counting, all of them hashes.
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

/// Named parameters, all without loss: a furnace tells what is missing.
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
        for (sheen, sheen_alpha) in [(1.0, 0.1), (0.5, 0.5), (1.0, 1.0)] {
            let sheen_color = Rgb::splat(sheen);
            list.push((
                format!("{name} below sheen {sheen} {sheen_alpha}"),
                Parameters { sheen_color, sheen_alpha, ..p },
            ));
        }
    }
    list.push(("matched".into(), glass(0.3, 1.0)));
    list.push(("legacy ior 0".into(), plastic(0.3, f32::INFINITY)));
    list
}

/// The same and coloured ones.
fn all() -> Vec<(String, Parameters)> {
    let mut list = white();
    let tinted: Vec<_> = list
        .iter()
        .map(|(name, p)| {
            let specular_color = Rgb::new(1.0, 0.5, 0.2);
            (format!("tinted {name}"), Parameters { base_color: Rgb::new(0.9, 0.4, 0.0), specular_color, ..*p })
        })
        .collect();
    list.extend(tinted);
    list.push(("black metal".into(), Parameters { base_color: Rgb::ZERO, ..metal(0.3) }));
    list.push(("black glass".into(), Parameters { base_color: Rgb::ZERO, ..glass(0.3, 1.5) }));
    list.push(("black".into(), Parameters { base_color: Rgb::ZERO, ..Parameters::default() }));
    list
}

fn outgoing(mu: f32, phi: f32) -> Vec3 {
    let r = (1.0 - mu * mu).sqrt();
    Vec3::new(r * phi.cos(), r * phi.sin(), mu)
}

const COSINES: [f32; 10] = [1.0, 0.8, 0.4, 0.1, 0.02, -1.0, -0.8, -0.4, -0.1, -0.02];

/// Mean weight of directions drawn: the albedo. The points are Roberts' R3 sequence.
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

/// A surface that loses nothing, under a white sky, is white: within 0.5 %, whatever its roughness, from both sides.
#[test]
fn white_furnace() {
    let mut worst = (0.0f32, String::new());
    for (name, p) in white() {
        let bsdf = Bsdf::new(&p, &TABLES);
        for mu in COSINES {
            let wo = outgoing(mu, 0.7);
            let off = |side| {
                let albedo = drawn_albedo(&bsdf, wo, Transport::Importance, side);
                (albedo, (albedo - Rgb::ONE).abs().max_element())
            };
            let (mut albedo, mut error) = off(160);
            if error > 0.002 {
                (albedo, error) = off(640);
            }
            if error > 0.004 {
                println!("FURN {name} {mu} {albedo}");
            }
            if error > worst.0 {
                worst = (error, format!("{name}, cosine {mu}: {albedo}"));
            }
        }
    }
    println!("worst: {worst:?}");
    assert!(worst.0 < 0.005, "{worst:?}");
}

/// What a triad test needs of a BSDF, so that bugs can be planted between.
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

/// Cells of the sphere: equal steps of the cosine and of the azimuth.
const CELLS: (usize, usize) = (24, 16);

fn direction(z: f64, phi: f64) -> Vec3 {
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)
}

/// Integral over a cell, halved where a finer rule disagrees.
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

/// P-value of "directions drawn follow the density", and the largest relative difference between a weight and
/// `f |cos| / pdf`. Directions not drawn, and those of delta lobes, are a cell of their own, so that the density's integral is tested too.
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
                assert!((s.wi.length() - 1.0).abs() < 1e-4 && s.weight.is_finite() && set.has(s.lobe));
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

/// Parameters whose densities are wide enough to be integrated over cells in little time.
fn triads() -> Vec<(String, Parameters)> {
    let rough = |p: &Parameters| p.alpha_x == 0.0 || p.alpha_x >= 0.1;
    let mut list: Vec<_> = all().into_iter().filter(|(_, p)| rough(p)).collect();
    list.push(("anisotropic metal".into(), Parameters { alpha_x: 0.6, alpha_y: 0.15, ..metal(0.0) }));
    list.push(("anisotropic glass".into(), Parameters { alpha_x: 0.15, alpha_y: 0.5, ..glass(0.0, 1.5) }));
    list
}

const TRIAD_DRAWS: usize = 20_000;

#[test]
fn directions_follow_their_density() {
    use rayon::prelude::*;
    let mut cases = vec![];
    for (name, p) in triads() {
        let bsdf = Bsdf::new(&p, &TABLES);
        for mu in [0.95, 0.3, 0.04, -0.6, -0.05f32] {
            for set in [LobeSet::ALL, LobeSet::BROAD, LobeSet::SHARP, LobeSet::SHARP | LobeSet::DELTA] {
                // A set that holds the same lobes as ALL says nothing new.
                if bsdf.lobes().has(set) && (set == LobeSet::ALL || bsdf.lobes() & set != bsdf.lobes()) {
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
