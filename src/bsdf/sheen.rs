//! Sheen of cloth: the Charlie distribution of KHR_materials_sheen \[Estevez and Kulla 2017, "Production Friendly
//! Microfacet Sheen BRDF"\].

use crate::math::sqr;
use std::f32::consts::FRAC_1_PI;

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

/// Albedo of white sheen of this alpha, at the cosine `cos_o` with the normal.
pub fn albedo(alpha: f32, cos_o: f32) -> f32 {
    let (rows, columns) = (48, 24);
    let sin_o = (1.0 - cos_o * cos_o).max(0.0).sqrt();
    let mut sum = 0.0;
    for i in 0..rows {
        // The midpoint rule in the square root of the cosine, which is finer towards the horizon.
        let root = (i as f32 + 0.5) / rows as f32;
        let cos_i = root * root;
        let sin_i = (1.0 - cos_i * cos_i).max(0.0).sqrt();
        for j in 0..columns {
            let phi = std::f32::consts::PI * (j as f32 + 0.5) / columns as f32;
            let (x, y, z) = (sin_o + sin_i * phi.cos(), sin_i * phi.sin(), cos_o + cos_i);
            let cos_h = z / (x * x + y * y + z * z).sqrt().max(1e-9);
            sum += eval(cos_o, cos_i, cos_h, alpha) * cos_i * 2.0 * root;
        }
    }
    sum * std::f32::consts::TAU / (rows * columns) as f32
}
