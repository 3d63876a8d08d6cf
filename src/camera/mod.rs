//! Cameras: perspective and orthographic, with a thin lens; rays from the film and importance towards a point.

mod tiles;

pub use tiles::{GROUP, Place, band, par_pixels};

use crate::math::{DVec3, Mat3, Vec2, Vec3, warp};

/// How the film maps to directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Half width and half height of the film at distance 1.
    Perspective(Vec2),
    /// Half width and half height of the film (m).
    Orthographic(Vec2),
}

/// A camera with a film of `width x height` pixels. It looks along its local -Z, +Y up.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    position: Vec3,
    /// Local to world, orthonormal.
    rotation: Mat3,
    projection: Projection,
    lens_radius: f32,
    focus_distance: f32,
    /// Middle of the film against the axis, in the lengths of the projection.
    offset: Vec2,
    width: u32,
    height: u32,
    /// Share of a pixel's side that its rays cover.
    covered: f32,
}

/// A ray from the film.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Origin on the lens.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// What the camera measures from a point of the scene.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// Point of the film in pixels.
    pub film: Vec2,
    /// Unit direction from the point towards the lens.
    pub wi: Vec3,
    /// Point on the lens.
    pub lens: Vec3,
    /// Density per area of the point at which rays from the film through this lens point, with all `width * height`
    /// pixels together as one measurement of mean 1, arrive at distance d: importance over d^2 and the cosine at the
    /// camera; multiply by the cosine at the point.
    pub importance: f32,
}

impl Camera {
    /// A camera at `position`, local axes the columns of `rotation`.
    pub fn new(position: DVec3, rotation: Mat3, projection: Projection, lens: (f32, f32), size: (u32, u32)) -> Camera {
        let position = position.as_vec3();
        Camera {
            position,
            rotation,
            projection,
            lens_radius: lens.0,
            focus_distance: lens.1,
            offset: Vec2::ZERO,
            width: size.0,
            height: size.1,
            covered: 1.0,
        }
    }

    /// The same with its film moved by `shift`, in widths to the right and heights up.
    pub fn shifted(&self, shift: Vec2) -> Camera {
        let (Projection::Perspective(half) | Projection::Orthographic(half)) = self.projection;
        Camera { offset: 2.0 * shift * half, ..*self }
    }

    /// A sample of this camera's pixels, `factor` times as many a side, at least one, and spread evenly over the film:
    /// each sees as much as a pixel does here. What light paths send to the film is taken from all around it: as much
    /// noise as if there were all pixels and as many light paths.
    pub fn sparse(&self, factor: f64) -> Camera {
        let scaled = |side: u32| ((f64::from(side) * factor).round() as u32).max(1);
        let (width, height, covered) = (scaled(self.width), scaled(self.height), self.covered * factor.min(1.0) as f32);
        Camera { width, height, covered, ..*self }
    }

    /// The whole view in a smaller picture, `factor` times as many pixels a side, at least one: each sees as much more.
    pub fn smaller(&self, factor: f64) -> Camera {
        Camera { covered: self.covered, ..self.sparse(factor) }
    }

    /// The same without its lens: all is sharp.
    pub fn pinhole(&self) -> Camera {
        Camera { lens_radius: 0.0, focus_distance: 1.0, ..*self }
    }

    /// The point of the film, in pixels, for a point of the unit square in pixel `(x, y)`.
    #[inline]
    pub fn film(&self, (x, y): (u32, u32), u: Vec2) -> Vec2 {
        Vec2::new(x as f32, y as f32) + 0.5 + (u - 0.5) * self.covered
    }

    /// Width and height of the film in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Position of the lens' centre.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Corners of a plane that all rays start in.
    pub fn origins(&self) -> [Vec3; 4] {
        let (film, middle) = match self.projection {
            Projection::Perspective(_) => (Vec2::ZERO, Vec2::ZERO),
            Projection::Orthographic(half) => (half, self.offset),
        };
        let half = film + if self.has_lens() { self.lens_radius } else { 0.0 };
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .map(|(x, y)| self.position + self.rotation * (middle + half * Vec2::new(x, y)).extend(0.0))
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        -self.rotation.z_axis
    }

    /// Whether [`Camera::sample`] can find it from a point.
    pub fn connects(&self) -> bool {
        matches!(self.projection, Projection::Perspective(_))
    }

    /// Whether a lens blurs.
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0
    }

    /// Film point in pixels (y down) to the film's plane: `[-1, 1]^2`, y up, times the half size, about the film's
    /// middle.
    #[inline]
    fn plane(&self, film: Vec2, half: Vec2) -> Vec2 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let ndc = film / size * 2.0 - 1.0;
        Vec2::new(ndc.x, -ndc.y) * half + self.offset
    }

    /// The ray through `film` (pixels) from lens point `lens` (uniform on the unit square).
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2) -> CameraRay {
        let (mut origin, focus) = match self.projection {
            Projection::Perspective(half) => (Vec3::ZERO, self.plane(film, half).extend(-1.0) * self.focus_distance),
            Projection::Orthographic(half) => {
                let p = self.plane(film, half);
                (p.extend(0.0), p.extend(-self.focus_distance))
            }
        };
        if self.has_lens() {
            origin += (warp::disc_concentric(lens) * self.lens_radius).extend(0.0);
        }
        CameraRay {
            origin: self.position + self.rotation * origin,
            direction: (self.rotation * (focus - origin)).normalize(),
        }
    }

    /// Width that the picture spans per metre of distance (perspective; 0 for an orthographic camera), and at distance
    /// 0.
    pub fn span(&self) -> (f32, f32) {
        match self.projection {
            Projection::Perspective(half) => (2.0 * half.x, 0.0),
            Projection::Orthographic(half) => (0.0, 2.0 * half.x),
        }
    }

    /// Depth of `p` along the viewing direction.
    pub fn depth(&self, p: Vec3) -> f32 {
        (p - self.position).dot(self.forward())
    }

    /// The camera seen from `p` through lens point `lens`; `None` when `p` is out of view or the camera is orthographic
    /// without a lens (its directions cannot be hit).
    #[inline]
    pub fn sample(&self, p: Vec3, lens: Vec2) -> Option<CameraSample> {
        let Projection::Perspective(half) = self.projection else { return None };
        let mut lens_local = Vec3::ZERO;
        if self.has_lens() {
            lens_local = (warp::disc_concentric(lens) * self.lens_radius).extend(0.0);
        }
        let lens_world = self.position + self.rotation * lens_local;
        let to = p - lens_world;
        let distance2 = to.length_squared();
        let wi = -to.try_normalize()?;
        let local = self.rotation.transpose() * -wi;
        let cos = -local.z;
        if cos <= 0.0 {
            return None;
        }
        // Where the ray crosses the plane in focus, as a film point at distance 1.
        let focus = lens_local + local * (self.focus_distance / cos);
        let plane = (focus.truncate() / self.focus_distance - self.offset) / half;
        let film = Vec2::new(plane.x + 1.0, 1.0 - plane.y) * 0.5 * Vec2::new(self.width as f32, self.height as f32);
        if !(film.x >= 0.0 && film.y >= 0.0 && film.x < self.width as f32 && film.y < self.height as f32) {
            return None;
        }
        // Film points are uniform over the area 4 half.x half.y at distance 1: density per solid angle 1 / (area
        // cos^3).
        let importance = 1.0 / (4.0 * half.x * half.y * cos * cos * cos * distance2);
        Some(CameraSample { film, wi, lens: lens_world, importance })
    }

    /// Density per solid angle of [`Camera::ray`]'s direction over the whole film, for a unit direction in view.
    #[inline]
    pub fn pdf_w(&self, direction: Vec3) -> f32 {
        match self.projection {
            Projection::Perspective(half) => {
                let cos = direction.dot(self.forward());
                if cos > 0.0 { 1.0 / (4.0 * half.x * half.y * cos * cos * cos) } else { 0.0 }
            }
            Projection::Orthographic(_) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// A ray and the connection back agree about the film point, with and without a lens and a shift.
    #[test]
    fn rays_and_connections_are_inverse() {
        for (lens_radius, shift) in [(0.0, Vec2::ZERO), (0.3, Vec2::ZERO), (0.3, Vec2::new(0.7, -0.2))] {
            let rotation = Mat3::from_rotation_y(0.4) * Mat3::from_rotation_x(-0.2);
            let projection = Projection::Perspective(Vec2::new(0.8, 0.45));
            let camera = Camera::new(DVec3::new(1.0, 2.0, 3.0), rotation, projection, (lens_radius, 4.0), (160, 90));
            let camera = camera.shifted(shift);
            for i in 0..1000 {
                let draws = Stream::new(0, 0, Domain::Test, i).vertex(0);
                let film = draws.two(Purpose::Pixel) * Vec2::new(160.0, 90.0);
                let lens = draws.two(Purpose::Lens);
                let ray = camera.ray(film, lens);
                let p = ray.origin + ray.direction * (0.5 + 9.0 * draws.one(Purpose::Lobe));
                let sample = camera.sample(p, lens).unwrap();
                assert!((sample.film - film).length() < 2e-2, "{film} {}", sample.film);
                assert!((sample.wi + ray.direction).length() < 1e-4);
                let distance2 = (p - sample.lens).length_squared();
                assert!((sample.importance * distance2 / camera.pdf_w(ray.direction) - 1.0).abs() < 1e-3);
            }
        }
    }
}
