//! Rough diffuse reflection below an interface and a cover: EON \[Portsmouth, Kutz and Hill 2024, "EON: A practical
//! energy-preserving rough diffuse BRDF"\], which Cycles uses, too.
//!
//! Light that facets scatter once follows Fujii's model, `f(o, i) = A (1 + r s / t) / pi`. A separable lobe returns
//! the light that this loses. The paper normalizes it for a base in the open. Here, light reaches and leaves the base
//! through layers of the transmittance T(cos), so the albedo of single scattering, `integral T(i) f(o, i) cos /
//! average of T`, is integrated with T: with the azimuth in closed form, and the cosine by weights of the nodes of T.
//! So a white base below any interface and cover returns what they let through.

use super::profile::{NODES, Position, Profile, node};
use crate::math::{Rgb, Vec2, Vec3, sqr, warp};
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::OnceLock;

/// Rough diffuse reflection, relative to Lambertian reflection, below layers of a given transmittance.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoughDiffuse {
    /// The roughness r, in (0, 1].
    roughness: f32,
    /// Factor A of single scattering.
    scale: f32,
    /// Share of the light that single scattering loses at a white base, as a function of the cosine.
    lost: Profile,
    /// Average of `lost` over all light that the layers let through, 0 to 1.
    average_lost: f32,
}

impl RoughDiffuse {
    /// The base of this roughness, in (0, 1], below layers of the transmittance `through`.
    pub fn new(roughness: f32, through: &Profile) -> RoughDiffuse {
        let scale = 1.0 / (1.0 + roughness * (0.5 - 2.0 / (3.0 * PI)));
        let average = through.average.max(1e-9);
        let lost = Profile::from_nodes(retroreflection_weights().map(|weights| {
            let sum: f32 = weights.iter().zip(through.nodes()).map(|(weight, value)| weight * value).sum();
            (1.0 - scale * (1.0 + roughness * sum / average)).max(0.0)
        }));
        let average_lost = lost.average_with(|mu| through.at(mu)) / average;
        RoughDiffuse { roughness, scale, lost, average_lost }
    }

    /// Factor of the light that a base of this colour scatters several times, with which [`RoughDiffuse::values`] is
    /// multiplied.
    pub fn multiple_scattering(&self, base: Rgb) -> Rgb {
        self.multiple_albedo(base) / self.average_lost.max(1e-9)
    }

    /// Albedo of the light that a base of this colour scatters several times, relative to a white one.
    fn multiple_albedo(&self, base: Rgb) -> Rgb {
        base * base * (1.0 - self.average_lost) / (Rgb::ONE - base * self.average_lost)
    }

    /// Albedo of a base of this colour, relative to the light that reaches it, for a direction of table position `at`.
    pub fn albedo(&self, base: Rgb, at: Position) -> Rgb {
        let lost = self.lost.at(at);
        base * (1.0 - lost) + self.multiple_albedo(base) * lost
    }

    /// Values of the lobes of single and of multiple scattering, relative to Lambertian reflection, for two unit
    /// directions above the surface with the table positions of their cosines.
    #[inline]
    pub fn values(&self, o: Vec3, at_o: Position, i: Vec3, at_i: Position) -> [f32; 2] {
        let s = o.x * i.x + o.y * i.y;
        let retroreflection = if s > 0.0 { s / o.z.max(i.z) } else { s };
        let single = self.scale * (1.0 + self.roughness * retroreflection).max(0.0);
        [single, self.lost.at(at_o) * self.lost.at(at_i)]
    }

    /// Samples a direction above the surface, seen along `o`; `u_part` chooses the part of the mixture.
    pub fn sample(&self, o: Vec3, u_part: f32, u: Vec2) -> Vec3 {
        if u_part < self.uniform_share(o.z) {
            return warp::around_z((1.0 - u.x * u.x).max(0.0).sqrt(), u.x, u.y);
        }
        let transform = Transform::new(o, self.roughness);
        let disk = warp::around_z(u.x.sqrt(), 0.0, u.y);
        let clipped = transform.clipped();
        let x = -((1.0 - sqr(disk.y)).max(0.0).sqrt() * (1.0 - clipped) + disk.x * clipped);
        let h = Vec3::new(x, disk.y, (1.0 - sqr(x) - sqr(disk.y)).max(0.0).sqrt());
        transform.apply(h).normalize()
    }

    /// Density per solid angle with which [`RoughDiffuse::sample`] draws `i`, which is above the surface.
    pub fn pdf_w(&self, o: Vec3, i: Vec3) -> f32 {
        let uniform = self.uniform_share(o.z);
        uniform * 0.5 * FRAC_1_PI + (1.0 - uniform) * Transform::new(o, self.roughness).pdf_w(i)
    }

    /// Share of directions that are sampled uniformly, which bounds the weights at the horizon (listing 4 of the
    /// paper).
    fn uniform_share(&self, mu: f32) -> f32 {
        self.roughness.powf(0.1) * (0.162925 + (-0.372058 + (0.538233 - 0.290822 * mu) * mu) * mu)
    }
}

/// Clipped linearly transformed cosine, with the fit of the paper (listing 3). The cosine lobe is clipped to the
/// directions that the transform takes above the surface.
struct Transform {
    /// Axes of the frame whose first one is the projection of the viewing direction.
    axes: [Vec3; 2],
    /// The entries of the matrix that differ from 0 and 1: `[[a, 0, b], [0, c, 0], [d, 0, 1]]`.
    entries: [f32; 4],
}

impl Transform {
    fn new(o: Vec3, r: f32) -> Transform {
        let x = Vec3::new(o.x, o.y, 0.0).try_normalize().unwrap_or(Vec3::X);
        let mu = o.z;
        let a = 1.0 + r * (0.303392 + (-0.518982 + 0.111709 * mu) * mu + (-0.276266 + 0.335918 * mu) * r);
        let b = r * (-1.16407 + 1.15859 * mu + (0.150815 - 0.150105 * mu) * r) / (mu * mu * mu - 1.43545);
        let c = 1.0 + (0.20013 + (-0.506373 + 0.261777 * mu) * mu) * r;
        let d = (0.540852 + (-1.01625 + 0.475392 * mu) * mu) * r / (-1.0743 + mu * (0.0725628 + mu));
        Transform { axes: [x, Vec3::new(-x.y, x.x, 0.0)], entries: [a, b, c, d] }
    }

    /// Area of the clipped unit disk, over pi.
    fn clipped(&self) -> f32 {
        0.5 * (1.0 + 1.0 / (sqr(self.entries[3]) + 1.0).sqrt())
    }

    fn apply(&self, h: Vec3) -> Vec3 {
        let ([a, b, c, d], [x, y]) = (self.entries, self.axes);
        x * (a * h.x + b * h.z) + y * (c * h.y) + Vec3::Z * (d * h.x + h.z).max(0.0)
    }

    fn pdf_w(&self, i: Vec3) -> f32 {
        let ([a, b, c, d], [x, y]) = (self.entries, self.axes);
        let i = Vec3::new(i.dot(x), i.dot(y), i.z);
        let determinant = c * (a - b * d);
        let h = Vec3::new(c * (i.x - b * i.z), (a - b * d) * i.y, c * (a * i.z - d * i.x));
        let jacobian = sqr(determinant / h.length_squared().max(f32::MIN_POSITIVE));
        jacobian * h.z.max(0.0) * FRAC_1_PI / self.clipped()
    }
}

/// Weights of the nodes of a transmittance T, which is linear in the fourth root of the cosine between nodes, in
/// `integral T(i) (s / t) cos / pi` over the hemisphere, for each node of the other cosine.
fn retroreflection_weights() -> &'static [[f32; NODES]; NODES] {
    static WEIGHTS: OnceLock<Box<[[f32; NODES]; NODES]>> = OnceLock::new();
    WEIGHTS.get_or_init(|| Box::new(std::array::from_fn(weights_at_node)))
}

fn weights_at_node(j: usize) -> [f32; NODES] {
    /// Points of the midpoint rule between nodes.
    const STEPS: usize = 32;
    let mu_o = f64::from(node(j)).min(1.0);
    let sin_o = (1.0 - mu_o * mu_o).max(0.0).sqrt();
    let mut weights = [0.0f64; NODES];
    for k in 0..NODES - 1 {
        for step in 0..STEPS {
            let part = (step as f64 + 0.5) / STEPS as f64;
            let t = (k as f64 + part) / (NODES - 1) as f64;
            let mu = t.powi(4);
            // Integrated over the azimuth, s / t is 2 sin sin (1 / max(cos, cos) - 1).
            let azimuths = 2.0 * sin_o * (1.0 - mu * mu).max(0.0).sqrt() * (1.0 / mu_o.max(mu) - 1.0);
            let term = azimuths * mu * 4.0 * t.powi(3) / (STEPS * (NODES - 1)) as f64 / std::f64::consts::PI;
            weights[k] += term * (1.0 - part);
            weights[k + 1] += term * part;
        }
    }
    weights.map(|weight| weight as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the open, the albedo of single scattering is that of the paper (equation 11).
    #[test]
    fn single_scattering_has_its_closed_form() {
        for roughness in [0.1f32, 0.5, 1.0] {
            let rough = RoughDiffuse::new(roughness, &Profile::constant(1.0));
            for j in 1..NODES {
                let mu = node(j);
                let sin = (1.0 - mu * mu).max(0.0).sqrt();
                let g = sin * (mu.acos() - 2.0 / 3.0 - sin * mu) + 2.0 / 3.0 * (sin / mu) * (1.0 - sin.powi(3));
                let expected = rough.scale * (1.0 + roughness * g * FRAC_1_PI);
                let found = 1.0 - rough.lost.at(Position::of_node(j));
                assert!((found - expected).abs() < 1e-3, "r {roughness}, cosine {mu}: {found} is not {expected}");
            }
            let expected = rough.scale * (1.0 + roughness * (2.0 / 3.0 - 28.0 / (15.0 * PI)));
            assert!((1.0 - rough.average_lost - expected).abs() < 1e-3, "{} {expected}", rough.average_lost);
        }
    }
}
