//! Environment lights: a latitude-longitude image or a uniform colour.

use super::cdf::Cdf;
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

/// Light that arrives from all directions at infinity.
#[derive(Clone, Debug)]
pub enum Environment {
    /// Equal radiance from all directions.
    Uniform(Rgb),
    /// A latitude-longitude image of the radiance.
    Image(Arc<ImageEnvironment>),
}

/// A latitude-longitude image (rows from the top, u = 1/2 + atan2(z, x) / 2 pi), importance-sampled by luminance.
#[derive(Clone, Debug)]
pub struct ImageEnvironment {
    width: usize,
    height: usize,
    radiance: Vec<[f32; 3]>,
    /// Sine and cosine of the rotation about +Y.
    rotation: (f32, f32),
    rows: Cdf,
    columns: Vec<Option<Cdf>>,
}

impl ImageEnvironment {
    /// Builds the sampling distribution of an image of `width * height` finite, non-negative texels, already scaled by
    /// the environment's strength. `rotation` about +Y is in radians. `None` if all texels are black.
    pub fn new(width: usize, height: usize, radiance: Vec<[f32; 3]>, rotation: f32) -> Option<ImageEnvironment> {
        // Bilinear interpolation spreads a texel over the neighbouring cells. So the weight of a cell is the
        // tent-weighted mean over its 3x3 neighbourhood, which is positive wherever the radiance is.
        let value = |x: usize, y: usize| f64::from(luminance(Vec3::from_array(radiance[y * width + x])));
        let smooth = |x: usize, y: usize| {
            let mut sum = 0.0;
            for (dy, wy) in [(height - 1, 1.0), (0, 6.0), (1, 1.0)] {
                let row = match dy {
                    0 => y,
                    1 => (y + 1).min(height - 1),
                    _ => y.saturating_sub(1),
                };
                for (dx, wx) in [(width - 1, 1.0), (0, 6.0), (1, 1.0)] {
                    sum += wx * wy / 64.0 * value((x + dx) % width, row);
                }
            }
            sum
        };
        let columns: Vec<Option<Cdf>> = (0..height).map(|y| Cdf::new((0..width).map(|x| smooth(x, y)))).collect();
        let rows = Cdf::new(columns.iter().enumerate().map(|(y, row)| {
            let theta = std::f64::consts::PI * (y as f64 + 0.5) / height as f64;
            row.as_ref().map_or(0.0, |row| row.total() * theta.sin())
        }))?;
        Some(ImageEnvironment { width, height, radiance, rotation: rotation.sin_cos(), rows, columns })
    }

    fn to_image(&self, d: Vec3) -> Vec3 {
        let (s, c) = self.rotation;
        // The image is rotated counter-clockwise about +Y, seen from above; a look-up rotates back.
        Vec3::new(c * d.x - s * d.z, d.y, s * d.x + c * d.z)
    }

    fn to_world(&self, d: Vec3) -> Vec3 {
        let (s, c) = self.rotation;
        Vec3::new(c * d.x + s * d.z, d.y, -s * d.x + c * d.z)
    }

    fn coordinates(&self, d: Vec3) -> Vec2 {
        let d = self.to_image(d);
        Vec2::new(0.5 + d.z.atan2(d.x) * (0.5 * FRAC_1_PI), d.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI)
    }

    fn radiance(&self, d: Vec3) -> Rgb {
        let uv = self.coordinates(d);
        let (x, y) = (uv.x * self.width as f32 - 0.5, uv.y * self.height as f32 - 0.5);
        let (fx, fy) = (x.floor(), y.floor());
        let texel = |x: i64, y: i64| {
            let x = x.rem_euclid(self.width as i64) as usize;
            let y = y.clamp(0, self.height as i64 - 1) as usize;
            Vec3::from_array(self.radiance[y * self.width + x])
        };
        let (ix, iy) = (fx as i64, fy as i64);
        let top = texel(ix, iy).lerp(texel(ix + 1, iy), x - fx);
        let bottom = texel(ix, iy + 1).lerp(texel(ix + 1, iy + 1), x - fx);
        top.lerp(bottom, y - fy)
    }

    /// Density per solid angle with which directions in a texel (the cell) are sampled, if the texel has this
    /// probability: at polar angle theta, it has the solid angle 2 pi^2 sin(theta) / (width height).
    fn density(&self, cell: (usize, usize), probability: f32, sin_theta: f32) -> f32 {
        debug_assert!(cell.0 < self.width);
        probability * (self.width * self.height) as f32 / (TAU * PI * sin_theta.max(1e-6))
    }

    fn pdf_w(&self, d: Vec3) -> f32 {
        let uv = self.coordinates(d);
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        let Some(columns) = &self.columns[y] else { return 0.0 };
        let sin_theta = (1.0 - d.y * d.y).max(0.0).sqrt();
        self.density((x, y), self.rows.pdf(y) * columns.pdf(x), sin_theta)
    }

    fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let (y, pdf_y, rest_y) = self.rows.sample(f64::from(u.x));
        // Every row with a positive probability has columns.
        let Some(columns) = &self.columns[y] else { return (Vec3::Y, 0.0) };
        let (x, pdf_x, rest_x) = columns.sample(f64::from(u.y));
        let theta = PI * (y as f32 + rest_y) / self.height as f32;
        let phi = TAU * ((x as f32 + rest_x) / self.width as f32 - 0.5);
        let (sin_theta, cos_theta) = theta.sin_cos();
        let d = Vec3::new(sin_theta * phi.cos(), cos_theta, sin_theta * phi.sin());
        (self.to_world(d), self.density((x, y), pdf_y * pdf_x, sin_theta))
    }

    /// Radiance averaged over all directions.
    fn mean(&self) -> Rgb {
        let mut sum = glam::DVec3::ZERO;
        let mut weight = 0.0;
        for y in 0..self.height {
            let w = (std::f64::consts::PI * (y as f64 + 0.5) / self.height as f64).sin();
            for x in 0..self.width {
                sum += w * Vec3::from_array(self.radiance[y * self.width + x]).as_dvec3();
            }
            weight += w * self.width as f64;
        }
        (sum / weight).as_vec3()
    }
}

impl Environment {
    /// Radiance (W/m2/sr) that arrives from direction `d` (unit, pointing away from the scene).
    #[inline]
    pub fn radiance(&self, d: Vec3) -> Rgb {
        match self {
            Environment::Uniform(radiance) => *radiance,
            Environment::Image(image) => image.radiance(d),
        }
    }

    /// Samples a direction towards the environment, by luminance if it is an image. Returns the direction and its
    /// density per solid angle.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec3, f32) {
        match self {
            Environment::Uniform(_) => (warp::sphere_uniform(u), 0.25 * FRAC_1_PI),
            Environment::Image(image) => image.sample(u),
        }
    }

    /// Density per solid angle of [`Environment::sample`].
    #[inline]
    pub fn pdf_w(&self, d: Vec3) -> f32 {
        match self {
            Environment::Uniform(_) => 0.25 * FRAC_1_PI,
            Environment::Image(image) => image.pdf_w(d),
        }
    }

    /// Radiance averaged over all directions (W/m2/sr).
    pub fn mean(&self) -> Rgb {
        match self {
            Environment::Uniform(radiance) => *radiance,
            Environment::Image(image) => image.mean(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    fn image(rotation: f32) -> Environment {
        let (w, h) = (32usize, 16usize);
        let mut texels = vec![[0.1, 0.2, 0.05]; w * h];
        texels[5 * w + 20] = [100.0, 80.0, 60.0];
        for x in 0..w {
            texels[15 * w + x] = [0.0; 3];
        }
        Environment::Image(Arc::new(ImageEnvironment::new(w, h, texels, rotation).unwrap()))
    }

    /// Importance sampling and uniform sampling estimate the same integral of radiance, and `pdf_w` returns the density
    /// of each sample.
    #[test]
    fn samples_follow_their_density() {
        let environment = image(0.7);
        let n = 200_000u64;
        let (mut by_importance, mut squares, mut by_uniform, mut uniform_squares) = (0.0, 0.0, 0.0, 0.0);
        let mut wrong = 0;
        for i in 0..n {
            let u = Stream::new(1, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
            let (d, pdf) = environment.sample(u);
            assert!((d.length() - 1.0).abs() < 1e-4);
            let again = environment.pdf_w(d);
            wrong += u32::from((pdf - again).abs() > 1e-2 * pdf);
            let x = f64::from(luminance(environment.radiance(d)) / pdf);
            by_importance += x;
            squares += x * x;
            let d = warp::sphere_uniform(Stream::new(2, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint));
            let x = f64::from(luminance(environment.radiance(d)) * 4.0 * PI);
            by_uniform += x;
            uniform_squares += x * x;
        }
        // Rounding rarely moves a direction into the next cell.
        assert!(wrong < 200, "{wrong} of {n} directions have another density than they were sampled with");
        let n = n as f64;
        let (a, b) = (by_importance / n, by_uniform / n);
        let variance = (squares / n - a * a) / n + (uniform_squares / n - b * b) / n;
        // Two-sided 4 sigma: one false alarm in 16,000 seeds.
        assert!((a - b).abs() < 4.0 * variance.sqrt(), "{a} {b} +- {}", variance.sqrt());
    }

    /// `interface.md`: u = 1/2 + atan2(z, x) / 2 pi; a rotation turns the image counter-clockwise seen from above (+Y).
    #[test]
    fn mapping_and_rotation_are_as_documented() {
        let (w, h) = (64usize, 32usize);
        let mut texels = vec![[0.0; 3]; w * h];
        texels[16 * w + w / 2] = [1.0; 3]; // u just above 1/2: direction +X
        let at = |rotation: f32| {
            let image = ImageEnvironment::new(w, h, texels.clone(), rotation).unwrap();
            [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z]
                .map(|d| Environment::Image(Arc::new(image.clone())).radiance(d).x > 0.1)
        };
        assert_eq!(at(0.0), [true, false, false, false, false]);
        // Seen from +Y with X to the right, counter-clockwise by a quarter turns +X to -Z.
        assert_eq!(at(std::f32::consts::FRAC_PI_2), [false, false, false, false, true]);
    }
}
