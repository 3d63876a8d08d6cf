//! The scattering model: sample, density and value agree; energy is kept; directions can be exchanged.
//!
//! Statistical checks run at a family-wise error rate of 0.1 % (Sidak over the checks of a test) with fixed seeds. Planted bugs are
//! rejected by the same checks.

mod support;

use caustique::bsdf::{Bsdf, BsdfSample, EnergyTables, LobeSet, Parameters, SHARP_ALPHA, Transport};
use caustique::math::{Rgb, Vec2, Vec3};
use caustique::random::mix;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;
use support::stats::{chi_squared_p, sidak};

const ERROR_RATE: f64 = 1e-3;

static TABLES: LazyLock<EnergyTables> = LazyLock::new(|| EnergyTables::for_etas([1.33, 1.5, 2.4, 1.1, f32::INFINITY]));

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
    let now = std::time::Instant::now();
    EnergyTables::for_etas([1.5]);
    println!("tables {:?}", now.elapsed());
    let mut worst = (0.0f32, String::new());
    for (name, p) in white() {
        let bsdf = Bsdf::new(&p, &TABLES);
        for mu in COSINES {
            let albedo = drawn_albedo(&bsdf, outgoing(mu, 0.7), Transport::Importance, 256);
            let error = (albedo - Rgb::ONE).abs().max_element();
            if error > worst.0 {
                worst = (error, format!("{name}, cosine {mu}: {albedo}"));
            }
            if !(error < 0.005) {
                println!("FURNACE {name}, cosine {mu}: {albedo}");
            }
        }
    }
    println!("worst: {worst:?}");
    assert!(worst.0 < 0.005);
}
