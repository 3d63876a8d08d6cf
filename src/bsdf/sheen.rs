//! Sheen of cloth, by either of two models: the Charlie distribution of KHR_materials_sheen \[Estevez and Kulla 2017,
//! "Production Friendly Microfacet Sheen BRDF"\], and a layer of fibres that Cycles and OpenPBR use \[Zeltner, Burley
//! and Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines"\].
//!
//! The fit of the latter depends on the viewing direction, and is reciprocal only as far as it is exact. The lobe here
//! is the mean of the fits for both directions, so that light paths and camera paths agree.

use crate::math::{Vec2, Vec3, sqr};
use std::f32::consts::FRAC_1_PI;

/// The model of a layer of sheen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SheenModel {
    /// The distribution of KHR_materials_sheen.
    #[default]
    Charlie,
    /// A layer of fibres, as in Cycles and OpenPBR. Their roughness is the square root of alpha.
    Fibers,
}

/// Smallest roughness of fibres, as in Cycles.
const MIN_ROUGHNESS: f32 = 1e-3;

/// Smallest alpha of sheen. Below it the distribution overflows at the horizon, and the sheen is invisible.
pub const MIN_ALPHA: f32 = 0.01;

/// Fit of Smith's Lambda for sheen at a cosine with the normal \[Estevez and Kulla 2017, section 3\].
#[inline]
fn lambda(cos: f32, alpha: f32) -> f32 {
    let l = |x: f32| {
        let t = sqr(1.0 - alpha);
        let mix = |smooth: f32, rough: f32| smooth * t + rough * (1.0 - t);
        let (a, b, c, d, e) = (
            mix(25.3245, 21.5473),
            mix(3.32435, 3.82987),
            mix(0.16801, 0.19823),
            mix(-1.27393, -1.97760),
            mix(-4.85967, -4.32054),
        );
        a / (1.0 + b * x.powf(c)) + d * x + e
    };
    if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() }
}

/// Value of the lobe of white sheen (1/sr, without cosine), from the cosines of both directions and of the half vector
/// with the normal.
#[inline]
pub fn eval(cos_o: f32, cos_i: f32, cos_h: f32, alpha: f32) -> f32 {
    let alpha = alpha.max(MIN_ALPHA);
    let sin_h = (1.0 - cos_h * cos_h).max(0.0).sqrt();
    let d = (2.0 + 1.0 / alpha) * sin_h.powf(1.0 / alpha) * (0.5 * FRAC_1_PI);
    let g = 1.0 / (1.0 + lambda(cos_o, alpha) + lambda(cos_i, alpha));
    d * g / (4.0 * cos_o * cos_i).max(1e-9)
}

/// Value of the lobe of white sheen by `model` (1/sr, without cosine), for two unit directions above the surface.
#[inline]
pub fn eval_model(model: SheenModel, o: Vec3, i: Vec3, alpha: f32) -> f32 {
    match model {
        SheenModel::Charlie => {
            let Some(h) = (o + i).try_normalize() else { return 0.0 };
            eval(o.z, i.z, h.z.min(1.0), alpha)
        }
        SheenModel::Fibers => {
            let roughness = alpha.sqrt();
            0.5 * (fibers_seen_along(o, i, roughness) + fibers_seen_along(i, o, roughness))
        }
    }
}

/// Value of sheen of fibres for light from `i`, as the fit has it for the viewing direction `o`.
#[inline]
fn fibers_seen_along(o: Vec3, i: Vec3, roughness: f32) -> f32 {
    let [a, b, albedo] = fit(o.z, roughness);
    let across = Vec2::new(o.x, o.y).try_normalize().unwrap_or(Vec2::X);
    let (x, y) = (across.dot(Vec2::new(i.x, i.y)), across.perp_dot(Vec2::new(i.x, i.y)));
    let length2 = sqr(a * x + b * i.z) + sqr(a * y) + sqr(i.z);
    albedo * FRAC_1_PI * sqr(a / length2.max(f32::MIN_POSITIVE))
}

/// Number of nodes of the fit along the cosine and the roughness.
const NODES: usize = 32;

/// The fit of \[Zeltner, Burley and Chiang 2022\] to a layer of fibres: for each roughness and cosine, the entries a
/// and b of the inverse transform `[[a, 0, b], [0, a, 0], [0, 0, 1]]`, and the albedo. The data are from the authors'
/// supplement, under the Apache License 2.0, see `scripts/notices/ltc-sheen.txt`.
static FIT: [[[f32; 3]; NODES]; NODES] = {
    let bytes = include_bytes!("sheen_fit.bin");
    let mut fit = [[[0.0; 3]; NODES]; NODES];
    let mut k = 0;
    while k < 3 * NODES * NODES {
        let bits = u32::from_le_bytes([bytes[4 * k], bytes[4 * k + 1], bytes[4 * k + 2], bytes[4 * k + 3]]);
        fit[k / (3 * NODES)][k / 3 % NODES][k % 3] = f32::from_bits(bits);
        k += 1;
    }
    fit
};

/// The entries of [`FIT`] at a cosine and a roughness, interpolated linearly.
#[inline]
fn fit(cos: f32, roughness: f32) -> [f32; 3] {
    let position = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        (i, x - i as f32)
    };
    let ((i, u), (j, v)) = (position(cos), position(roughness.max(MIN_ROUGHNESS)));
    std::array::from_fn(|k| {
        let row = |row: &[[f32; 3]; NODES]| row[i][k] + (row[i + 1][k] - row[i][k]) * u;
        let (low, high) = (row(&FIT[j]), row(&FIT[j + 1]));
        low + (high - low) * v
    })
}

/// Albedo of white sheen by `model` of this alpha, at the cosine `cos_o` with the normal.
pub fn albedo(model: SheenModel, alpha: f32, cos_o: f32) -> f32 {
    // The lobe of fibres of low roughness is narrow at the horizon.
    let (rows, columns) = match model {
        SheenModel::Charlie => (48, 24),
        SheenModel::Fibers => (96, 48),
    };
    let sin_o = (1.0 - cos_o * cos_o).max(0.0).sqrt();
    let mut sum = 0.0;
    for i in 0..rows {
        // The midpoint rule in the square root of the cosine, which is finer towards the horizon.
        let root = (i as f32 + 0.5) / rows as f32;
        let cos_i = root * root;
        let sin_i = (1.0 - cos_i * cos_i).max(0.0).sqrt();
        for j in 0..columns {
            let phi = std::f32::consts::PI * (j as f32 + 0.5) / columns as f32;
            let value = match model {
                SheenModel::Charlie => {
                    let (x, y, z) = (sin_o + sin_i * phi.cos(), sin_i * phi.sin(), cos_o + cos_i);
                    let cos_h = z / (x * x + y * y + z * z).sqrt().max(1e-9);
                    eval(cos_o, cos_i, cos_h, alpha)
                }
                SheenModel::Fibers => {
                    let i = Vec3::new(sin_i * phi.cos(), sin_i * phi.sin(), cos_i);
                    eval_model(model, Vec3::new(sin_o, 0.0, cos_o), i, alpha)
                }
            };
            sum += value * cos_i * 2.0 * root;
        }
    }
    sum * std::f32::consts::TAU / (rows * columns) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The symmetric lobe of fibres has the albedo of the fit within 0.12, and within 0.05 where the viewer does not
    /// graze the surface.
    #[test]
    fn symmetric_fibers_have_about_the_albedo_of_the_fit() {
        for roughness in [0.2f32, 0.3, 0.5, 0.7, 1.0] {
            for (cos, within) in [(0.03, 0.13), (0.1, 0.05), (0.4, 0.02), (0.7, 0.015), (1.0, 0.01)] {
                let (found, expected) = (albedo(SheenModel::Fibers, sqr(roughness), cos), fit(cos, roughness)[2]);
                assert!((found - expected).abs() < within, "{roughness} {cos}: {found} is not {expected}");
            }
        }
    }
}
