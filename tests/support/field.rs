//! A field of photons in closed form: a square lamp that faces a mirror lights a floor by its mirror image alone, as far as photons go.
//!
//! The lamp hangs in the plane x = 0 and faces the mirror at x = -0.25; on its way from there to the floor that the camera sees light passes below it, and with paths
//! of three segments every photon there has come by the mirror. The floor's irradiance is an integral over the image of the lamp; a kernel's expectation is
//! its mean over discs. Photons of equal flux that fall independently have the variance of a Poisson process.

use super::scenes::{add, build, look_at, matte, mirror, quad};
use caustique::estimator::{InitialBandwidth, Pixel};
use caustique::math::{DVec3, Vec3};
use caustique::render::{Levels, Settings};
use caustique::scene::description::Projection;
use caustique::scene::{Description, Scene, View};
use std::f64::consts::PI;

/// Pixels across and down, each of side [`PIXEL`], from [`CORNER`] on.
pub const SIZE: (u32, u32) = (8, 16);
/// Side of a pixel (m).
pub const PIXEL: f64 = 0.1;
/// Least x and z of the picture.
pub const CORNER: (f64, f64) = (0.0, -0.8);
/// Reflectance of the floor, radiance of the lamp, its side and the height of its centre.
const RHO: f64 = 0.5;
const RADIANCE: f64 = 10.0;
const SIDE: f64 = 0.06;
const HEIGHT: f64 = 0.2;
/// Where the mirror is.
const MIRROR: f64 = -0.25;

/// The scene, with its one camera.
pub fn scene() -> Scene {
    let mut description = Description::default();
    let floor = quad(Vec3::new(MIRROR as f32, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 4.0);
    add(&mut description, "floor", floor, matte(RHO as f32, 0.0));
    let wall = quad(Vec3::new(MIRROR as f32, 0.0, -3.0), Vec3::Y * 3.0, Vec3::Z * 6.0);
    add(&mut description, "mirror", wall, mirror());
    let (low, side) = ((HEIGHT - 0.5 * SIDE) as f32, SIDE as f32);
    let lamp = quad(Vec3::new(0.0, low, -0.5 * side), Vec3::Z * side, Vec3::Y * side);
    add(&mut description, "lamp", lamp, matte(0.0, RADIANCE as f32));
    let (width, height) = (f64::from(SIZE.0) * PIXEL, f64::from(SIZE.1) * PIXEL);
    let center = DVec3::new(CORNER.0 + 0.5 * width, 0.0, CORNER.1 + 0.5 * height);
    let mut camera = look_at(center + DVec3::Y * 2.0, center, 40.0);
    camera.projection = Projection::Orthographic { xmag: (0.5 * width) as f32, ymag: (0.5 * height) as f32 };
    description.cameras.push(camera);
    build(description)
}

/// The picture.
pub fn view() -> View {
    View { camera: None, width: Some(SIZE.0), height: Some(SIZE.1) }
}

/// Settings of one level with this first bandwidth, and paths of three segments.
pub fn settings(radius: f64, photons: u32, seed: u64) -> Settings {
    Settings {
        seed,
        photons,
        levels: Levels::new(1),
        initial: InitialBandwidth::Fixed(radius as f32),
        max_depth: 3,
        ..Settings::default()
    }
}

/// What photons bring to a pixel, on average over its iterations.
pub fn photons_of(pixel: &Pixel) -> f64 {
    (pixel.parts.caustic.x + pixel.parts.indirect.x) / f64::from(pixel.iterations.max(1))
}

/// Irradiance of the floor at (x, z) by the mirror image (W/m2).
pub fn irradiance(x: f64, z: f64) -> f64 {
    const N: i32 = 12;
    let at = |i: i32| (f64::from(i) + 0.5) / f64::from(N) * SIDE - 0.5 * SIDE;
    let mut sum = 0.0;
    for i in 0..N {
        for j in 0..N {
            // The image is as far behind the mirror, and faces +x.
            let (dx, dy, dz) = (x - 2.0 * MIRROR, HEIGHT + at(i), z - at(j));
            let d2 = dx * dx + dy * dy + dz * dz;
            sum += dx * dy / (d2 * d2);
        }
    }
    RADIANCE * sum * (SIDE / f64::from(N)).powi(2)
}

/// Mean of the irradiance over the disc of squared radius `radius2` around (x, z): six directions on three circles whose radii
/// halve equal areas, exact to the sixth order in the radius.
fn disc(x: f64, z: f64, radius2: f64) -> f64 {
    // Gauss-Legendre in the squared radius.
    const NODES: [(f64, f64); 3] =
        [(0.112_701_665_379_258, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_742, 5.0 / 18.0)];
    NODES.iter().map(|(s, weight)| weight * ring(x, z, (s * radius2).sqrt())).sum()
}

fn ring(x: f64, z: f64, r: f64) -> f64 {
    let at = |k: i32| (2.0 * PI * f64::from(k) / 6.0).sin_cos();
    (0..6).map(at).map(|(sin, cos)| irradiance(x + r * cos, z + r * sin)).sum::<f64>() / 6.0
}

/// What one iteration gives a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// Expectation (radiance).
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

/// One pixel's moments as functions of the squared bandwidth, of the box kernel.
pub struct PixelField {
    /// Radiance without bias: the mean over the pixel.
    pub truth: f64,
    /// Expectation at squared radii 0, a half and one of the largest.
    means: [f64; 3],
    largest2: f64,
    /// Variance of the field over the pixel.
    spread: f64,
    /// Flux of a photon (W).
    flux: f64,
}

impl PixelField {
    /// Of pixel (i, j) for bandwidths up to `radius` and so many photons an iteration.
    pub fn new((i, j): (u32, u32), radius: f64, photons: u32) -> PixelField {
        let largest2 = radius * radius;
        let mut means = [0.0; 3];
        let (mut first, mut second) = (0.0, 0.0);
        const N: i32 = 4;
        for k in 0..N * N {
            // The camera looks down: its right is -x, and its up is z.
            let at = |k: i32, pixel: u32| (f64::from(pixel) + (f64::from(k) + 0.5) / f64::from(N)) * PIXEL;
            let (x, z) = (CORNER.0 + at(k % N, SIZE.0 - 1 - i), CORNER.1 + at(k / N, SIZE.1 - 1 - j));
            for (mean, share) in means.iter_mut().zip([0.0, 0.5, 1.0]) {
                let e = if share == 0.0 { irradiance(x, z) } else { disc(x, z, share * largest2) };
                *mean += e * RHO / PI / f64::from(N * N);
            }
            let e = irradiance(x, z) * RHO / PI;
            first += e / f64::from(N * N);
            second += e * e / f64::from(N * N);
        }
        let flux = RADIANCE * PI * SIDE * SIDE / f64::from(photons);
        PixelField { truth: means[0], means, largest2, spread: second - first * first, flux }
    }

    /// At a squared bandwidth: of photons that fall independently.
    pub fn moments(&self, radius2: f64) -> Moments {
        let s = radius2 / self.largest2;
        let [a, b, c] = self.means;
        // The parabola through the three.
        let mean = a + s * (4.0 * b - 3.0 * a - c) + s * s * 2.0 * (a + c - 2.0 * b);
        let variance = mean * self.flux * RHO / PI / (PI * radius2) + self.spread;
        Moments { mean, variance }
    }
}
