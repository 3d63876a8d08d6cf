//! Closed forms of photon fields: a floor lit by the mirror images of a lamp.
//!
//! Direct light of the lamp is not carried by photons, and with paths of at most [`Field::max_depth`] segments every
//! photon on the floor has been reflected by one mirror. So the irradiance by photons is that of the lamp's images, and
//! the expectation of a kernel is its mean over a disc. Independent photons of equal flux have the variance of a
//! Poisson process.

use super::scenes::{add, build, look_at, matte, mirror, point_light, quad};
use caustique::estimator::PixelAccumulator;
use caustique::math::{DVec3, Vec3};
use caustique::render::{InitialBandwidth, Levels, Settings};
use caustique::scene::description::Projection;
use caustique::scene::{CameraRequest, Description, Scene};
use std::f64::consts::PI;

/// Columns and rows of the coarsest picture. Its pixels have the side [`PIXEL`] and start at [`CORNER`].
pub const SIZE: (u32, u32) = (8, 16);
/// Side of a pixel (m).
pub const PIXEL: f64 = 0.1;
/// Smallest x and z of the picture (m).
pub const CORNER: (f64, f64) = (0.0, -0.8);
/// Reflectance of the floor; radiance of the square lamp; its side; height of its centre.
const RHO: f64 = 0.5;
const RADIANCE: f64 = 10.0;
const SIDE: f64 = 0.06;
const HEIGHT: f64 = 0.2;
/// Position of the mirrors: x of the wall, and the height of the ceiling where there is one.
const MIRROR: f64 = -0.25;
const CEILING: f64 = 1.0;
/// Intensity of the point lamp (W/sr).
const INTENSITY: f64 = 1.0;

/// The light on the floor, and the view of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// A square lamp that faces the mirror wall; the floor is seen from above.
    Square,
    /// A point lamp, reflected by the wall and the mirror ceiling; the floor is seen in the ceiling. Only merging finds
    /// the light of photons.
    Point,
}

impl Field {
    /// The scene with its only camera.
    pub fn scene(self) -> Scene {
        let mut description = Description::default();
        let floor = quad(Vec3::new(MIRROR as f32, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 4.0);
        add(&mut description, "floor", floor, matte(RHO as f32, 0.0));
        let wall = quad(Vec3::new(MIRROR as f32, 0.0, -3.0), Vec3::Y * 3.0, Vec3::Z * 6.0);
        add(&mut description, "mirror", wall, mirror());
        let (width, height) = (f64::from(SIZE.0) * PIXEL, f64::from(SIZE.1) * PIXEL);
        let center = DVec3::new(CORNER.0 + 0.5 * width, 0.0, CORNER.1 + 0.5 * height);
        let mut camera = match self {
            Field::Square => {
                let (low, side) = ((HEIGHT - 0.5 * SIDE) as f32, SIDE as f32);
                let lamp = quad(Vec3::new(0.0, low, -0.5 * side), Vec3::Z * side, Vec3::Y * side);
                add(&mut description, "lamp", lamp, matte(0.0, RADIANCE as f32));
                look_at(center + DVec3::Y * 2.0, center, 40.0)
            }
            Field::Point => {
                let at = Vec3::new(MIRROR as f32, CEILING as f32, -3.0);
                add(&mut description, "ceiling", quad(at, Vec3::X * 4.0, Vec3::Z * 6.0), mirror());
                description.lights.push(point_light(DVec3::Y * HEIGHT, INTENSITY as f32));
                look_at(center + DVec3::Y * 0.5, center + DVec3::Y, 40.0)
            }
        };
        camera.projection = Projection::Orthographic { xmag: (0.5 * width) as f32, ymag: (0.5 * height) as f32 };
        description.cameras.push(camera);
        build(description)
    }

    /// Number of segments of the longest paths.
    pub fn max_depth(self) -> u32 {
        match self {
            Field::Square => 3,
            Field::Point => 4,
        }
    }

    /// Settings of one bandwidth level with this initial bandwidth.
    pub fn settings(self, radius: f64, photons: u32, seed: u64) -> Settings {
        Settings {
            seed,
            photons,
            levels: Levels::new(1),
            initial_bandwidth: InitialBandwidth::Fixed(radius as f32),
            max_depth: self.max_depth(),
            ..Settings::default()
        }
    }

    /// Irradiance of the floor at (x, z) by the mirror images (W/m2).
    pub fn irradiance(self, x: f64, z: f64) -> f64 {
        match self {
            Field::Square => {
                const N: i32 = 12;
                let at = |i: i32| (f64::from(i) + 0.5) / f64::from(N) * SIDE - 0.5 * SIDE;
                let mut sum = 0.0;
                for i in 0..N {
                    for j in 0..N {
                        // The image is at the same distance behind the mirror, and faces +x.
                        let (dx, dy, dz) = (x - 2.0 * MIRROR, HEIGHT + at(i), z - at(j));
                        let d2 = dx * dx + dy * dy + dz * dz;
                        sum += dx * dy / (d2 * d2);
                    }
                }
                RADIANCE * sum * (SIDE / f64::from(N)).powi(2)
            }
            Field::Point => {
                let images = [(2.0 * MIRROR, HEIGHT), (0.0, 2.0 * CEILING - HEIGHT)];
                let of = |(from, height): (f64, f64)| {
                    INTENSITY * height * ((x - from).powi(2) + height * height + z * z).powf(-1.5)
                };
                images.into_iter().map(of).sum()
            }
        }
    }

    /// Flux of a photon (W), for `photons` light paths per iteration.
    fn flux(self, photons: u32) -> f64 {
        let power = match self {
            Field::Square => RADIANCE * PI * SIDE * SIDE,
            Field::Point => 4.0 * PI * INTENSITY,
        };
        power / f64::from(photons)
    }

    /// Mean of the irradiance over the disc of squared radius `bandwidth2` around (x, z): six directions on three circles,
    /// exact to the sixth order in the radius.
    fn disc(self, x: f64, z: f64, bandwidth2: f64) -> f64 {
        // Gauss-Legendre quadrature in the squared radius.
        const NODES: [(f64, f64); 3] =
            [(0.112_701_665_379_258, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_742, 5.0 / 18.0)];
        NODES.iter().map(|(s, weight)| weight * self.ring(x, z, (s * bandwidth2).sqrt())).sum()
    }

    fn ring(self, x: f64, z: f64, r: f64) -> f64 {
        let at = |k: i32| (2.0 * PI * f64::from(k) / 6.0).sin_cos();
        (0..6).map(at).map(|(sin, cos)| self.irradiance(x + r * cos, z + r * sin)).sum::<f64>() / 6.0
    }
}

/// The picture, with `finer` pixels per pixel of [`SIZE`] in each direction.
pub fn view(finer: u32) -> CameraRequest {
    CameraRequest { width: Some(SIZE.0 * finer), height: Some(SIZE.1 * finer), ..CameraRequest::default() }
}

/// Mean contribution of photons to a pixel over its iterations.
pub fn photons_of(pixel: &PixelAccumulator) -> f64 {
    (pixel.parts().caustic.x + pixel.parts().indirect.x) / f64::from(pixel.iterations.max(1))
}

/// Moments of the contribution of one iteration to a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// Expectation (radiance).
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

/// The moments of one pixel as functions of the squared bandwidth, for the box kernel.
pub struct PixelField {
    /// Unbiased radiance: the mean over the pixel.
    pub truth: f64,
    /// Expectation at the squared radii 0, half the largest, and the largest.
    means: [f64; 3],
    largest2: f64,
    /// Variance of the field over the pixel.
    spread: f64,
    /// Flux of a photon (W).
    flux: f64,
}

impl PixelField {
    /// The moments of pixel (i, j) of a view, for bandwidths up to `radius` and `photons` light paths per iteration.
    pub fn new(field: Field, (i, j): (u32, u32), finer: u32, radius: f64, photons: u32) -> PixelField {
        let largest2 = radius * radius;
        let mut means = [0.0; 3];
        let (mut first, mut second) = (0.0, 0.0);
        const N: i32 = 4;
        // The right of the camera that looks down is -x; up is z in both views.
        let across = if field == Field::Square { SIZE.0 * finer - 1 - i } else { i };
        let up = SIZE.1 * finer - 1 - j;
        for k in 0..N * N {
            let at = |k: i32, pixel: u32| {
                (f64::from(pixel) + (f64::from(k) + 0.5) / f64::from(N)) * PIXEL / f64::from(finer)
            };
            let (x, z) = (CORNER.0 + at(k % N, across), CORNER.1 + at(k / N, up));
            for (mean, share) in means.iter_mut().zip([0.0, 0.5, 1.0]) {
                let e = if share == 0.0 { field.irradiance(x, z) } else { field.disc(x, z, share * largest2) };
                *mean += e * RHO / PI / f64::from(N * N);
            }
            let e = field.irradiance(x, z) * RHO / PI;
            first += e / f64::from(N * N);
            second += e * e / f64::from(N * N);
        }
        let flux = field.flux(photons);
        PixelField { truth: means[0], means, largest2, spread: second - first * first, flux }
    }

    /// The moments at a squared bandwidth, for independent photons.
    pub fn moments(&self, bandwidth2: f64) -> Moments {
        let s = bandwidth2 / self.largest2;
        let [a, b, c] = self.means;
        // The parabola through the three expectations.
        let mean = a + s * (4.0 * b - 3.0 * a - c) + s * s * 2.0 * (a + c - 2.0 * b);
        let variance = mean * self.flux * RHO / PI / (PI * bandwidth2) + self.spread;
        Moments { mean, variance }
    }
}
