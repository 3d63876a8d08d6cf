//! Warps of uniform points `u` of the unit square `[0, 1)^2` to other distributions, and their densities. The suffix
//! `_pdf_w` means a density per solid angle.

use super::{sin_cos_octant, sin_cos_turns};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_4, TAU};

/// Maps a point of the unit square to a uniform point of the unit disc (density 1/pi), area-preserving and continuous
/// \[Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square"\].
#[inline]
pub fn disc_concentric(u: Vec2) -> Vec2 {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    let (r, ratio) = if a.abs() > b.abs() { (a, b / a) } else { (b, a / b) };
    let (sin, cos) = sin_cos_octant(FRAC_PI_4 * ratio);
    if a.abs() > b.abs() { Vec2::new(r * cos, r * sin) } else { Vec2::new(r * sin, r * cos) }
}

/// Maps a point of the unit square to a unit direction of the upper hemisphere (local z up), with density cos / pi.
#[inline]
pub fn hemisphere_cosine(u: Vec2) -> Vec3 {
    let d = disc_concentric(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// The point at height `z` and at the distance `r` from the z axis, whose azimuth is in turns (one turn is 2 pi).
#[inline]
pub fn around_z(r: f32, z: f32, azimuth: f32) -> Vec3 {
    let (sin, cos) = sin_cos_turns(azimuth);
    Vec3::new(r * cos, r * sin, z)
}

/// Maps a point of the unit square to a uniform unit direction of the sphere, with density 1 / (4 pi).
#[inline]
pub fn sphere_uniform(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    around_z((1.0 - z * z).max(0.0).sqrt(), z, u.y)
}

/// Maps a point of the unit square to a uniform direction of the cone of half angle `acos(1 - one_minus_cos)` around
/// local z. Narrow cones (the sun) stay exact in f32 because the argument is 1 minus the cosine.
#[inline]
pub fn cone_uniform(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let h = u.x * one_minus_cos;
    around_z((h * (2.0 - h)).max(0.0).sqrt(), 1.0 - h, u.y)
}

/// Density per solid angle of [`cone_uniform`] for directions inside the cone.
#[inline]
pub fn cone_uniform_pdf_w(one_minus_cos: f32) -> f32 {
    1.0 / (TAU * one_minus_cos)
}

/// Maps a point of the unit square to the barycentric coordinates `(b1, b2)` of a uniform point of a triangle \[Heitz
/// 2019, "A Low-Distortion Map Between Triangle and Square"\].
#[inline]
pub fn triangle_uniform(u: Vec2) -> Vec2 {
    let (mut b0, mut b1);
    if u.x < u.y {
        b0 = 0.5 * u.x;
        b1 = u.y - b0;
    } else {
        b1 = 0.5 * u.y;
        b0 = u.x - b1;
    }
    b0 = b0.clamp(0.0, 1.0);
    b1 = b1.clamp(0.0, 1.0 - b0);
    Vec2::new(b0, b1)
}
