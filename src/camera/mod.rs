//! Cameras: perspective and orthographic, with a thin lens; rays from the film and importance towards a point.

mod filter;
mod tiles;

pub use filter::{Filter, WIDEST};
pub use tiles::{GROUP, Place, band, par_pixels};

use crate::math::{DMat3, DMat4, DVec3, DVec4, Mat3, Vec2, Vec3, warp};

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
    /// Local to world, orthonormal, with a mirroring where the camera's node mirrors.
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
    filter: Filter,
    /// Width of the whole picture over that of this film, which is a window of it.
    whole: f32,
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
            filter: Filter::default(),
            whole: 1.0,
        }
    }

    /// The same with its film moved by `shift`, in widths to the right and heights up.
    pub fn shifted(&self, shift: Vec2) -> Camera {
        let (Projection::Perspective(half) | Projection::Orthographic(half)) = self.projection;
        Camera { offset: 2.0 * shift * half, ..*self }
    }

    /// The same with another pixel filter.
    pub fn filtered(&self, filter: Filter) -> Camera {
        Camera { filter, ..*self }
    }

    /// A window of the picture: left edge, top edge, width and height in pixels. All but its size is as in the whole
    /// picture.
    pub fn window(&self, [x, y, width, height]: [u32; 4]) -> Camera {
        let (Projection::Perspective(half) | Projection::Orthographic(half)) = self.projection;
        let (corner, size) = (Vec2::new(x as f32, y as f32), Vec2::new(width as f32, height as f32));
        let offset = self.plane(corner + 0.5 * size, half);
        let half = half * size / Vec2::new(self.width as f32, self.height as f32);
        let projection = match self.projection {
            Projection::Perspective(_) => Projection::Perspective(half),
            Projection::Orthographic(_) => Projection::Orthographic(half),
        };
        let whole = self.whole * self.width as f32 / width as f32;
        Camera { projection, offset, width, height, whole, ..*self }
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

    /// A point of the film, in pixels, that pixel `(x, y)` sees, for a point of the unit square.
    #[inline]
    pub fn film(&self, (x, y): (u32, u32), u: Vec2) -> Vec2 {
        let from_middle = match self.filter {
            Filter::Box(width) => (u - 0.5) * width,
            filter => Vec2::new(filter.inverse(u.x), filter.inverse(u.y)),
        };
        Vec2::new(x as f32, y as f32) + 0.5 + from_middle * self.covered
    }

    /// One of the pixels that see the point `film`, drawn by `u` in proportion to their filters there, and the sum of
    /// these; `None` where it lies beyond the picture.
    #[inline]
    pub fn pixel(&self, film: Vec2, u: impl FnOnce() -> Vec2) -> Option<((u32, u32), f32)> {
        if self.filter == Filter::Box(1.0) {
            return Some((((film.x as u32).min(self.width - 1), (film.y as u32).min(self.height - 1)), 1.0));
        }
        let u = u();
        let [(x, along), (y, across)] =
            [(film.x, u.x), (film.y, u.y)].map(|(film, u)| filter::choose(self.filter, film, u));
        let (x, y) = (u32::try_from(x).ok()?, u32::try_from(y).ok()?);
        (x < self.width && y < self.height).then_some(((x, y), along * across))
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

    /// World to camera (x to the right, y up, z along the view) and world to the picture (x to the right and y down, from
    /// 0 to 1, after division by w) as OpenEXR has them: row by row, for row vectors on their left. `origin` is the
    /// world's point that positions here are counted from.
    pub fn matrices(&self, origin: DVec3) -> [[f32; 16]; 2] {
        let rotation = self.rotation.as_dmat3();
        let axes = DMat3::from_cols(rotation.x_axis, rotation.y_axis, -rotation.z_axis).transpose();
        let position = self.position.as_dvec3() + origin;
        let to_camera = DMat4::from_mat3(axes) * DMat4::from_translation(-position);
        let (Projection::Perspective(half) | Projection::Orthographic(half)) = self.projection;
        let (half, offset) = (half.as_dvec2(), self.offset.as_dvec2());
        // x in the picture is (1 + (x - offset) / half) / 2, of points at distance 1 along the view.
        let (sx, sy) = (0.5 / half.x, -0.5 / half.y);
        let (ox, oy) = (0.5 - offset.x * sx, 0.5 - offset.y * sy);
        let film = match self.projection {
            Projection::Perspective(_) => DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(ox, oy, 0.0, 1.0),
                DVec4::new(0.0, 0.0, 1.0, 0.0),
            ),
            Projection::Orthographic(_) => DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(0.0, 0.0, 1.0, 0.0),
                DVec4::new(ox, oy, 0.0, 1.0),
            ),
        };
        // For row vectors the transposed, row by row: the columns, one after the other.
        [to_camera, film * to_camera].map(|m| m.to_cols_array().map(|x| x as f32))
    }

    /// Width that the whole picture spans per metre of distance (perspective; 0 for an orthographic camera), and at distance
    /// 0.
    pub fn span(&self) -> (f32, f32) {
        match self.projection {
            Projection::Perspective(half) => (2.0 * half.x * self.whole, 0.0),
            Projection::Orthographic(half) => (0.0, 2.0 * half.x * self.whole),
        }
    }

    /// Width of the whole picture in pixels.
    pub fn whole_width(&self) -> f32 {
        self.width as f32 * self.whole
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
        // Pixels at the edge see a little beyond it.
        let beyond = (self.filter.radius() - 0.5).max(0.0);
        let seen = |x: f32, side: u32| x >= -beyond && x < side as f32 + beyond;
        if !(seen(film.x, self.width) && seen(film.y, self.height)) {
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

    fn some(projection: Projection) -> Camera {
        let rotation = Mat3::from_rotation_y(0.4) * Mat3::from_rotation_x(-0.2);
        Camera::new(DVec3::new(1.0, 2.0, 3.0), rotation, projection, (0.2, 4.0), (160, 90))
            .shifted(Vec2::new(0.1, -0.3))
    }

    /// A window sees what the whole picture sees there, and light paths bring its pixels as much.
    #[test]
    fn windows_are_parts_of_the_picture() {
        for projection in
            [Projection::Perspective(Vec2::new(0.8, 0.45)), Projection::Orthographic(Vec2::new(0.8, 0.45))]
        {
            let whole = some(projection);
            let corner = Vec2::new(40.0, 30.0);
            let window = whole.window([40, 30, 60, 20]);
            let deeper = window.window([10, 5, 20, 10]);
            assert_eq!((window.size(), deeper.size()), ((60, 20), (20, 10)));
            for camera in [window, deeper] {
                let (a, b) = (whole.span(), camera.span());
                assert!((a.0 - b.0).abs() < 1e-5 && (a.1 - b.1).abs() < 1e-5);
                assert!((camera.whole_width() - 160.0).abs() < 1e-3);
            }
            for i in 0..100 {
                let draws = Stream::new(0, 0, Domain::Test, i).vertex(0);
                let (film, lens) = (draws.two(Purpose::Pixel) * Vec2::new(20.0, 10.0), draws.two(Purpose::Lens));
                let a = whole.ray(corner + Vec2::new(10.0, 5.0) + film, lens);
                for b in [window.ray(Vec2::new(10.0, 5.0) + film, lens), deeper.ray(film, lens)] {
                    assert!((a.direction - b.direction).length() < 1e-5 && (a.origin - b.origin).length() < 1e-5);
                }
                let p = a.origin + a.direction * 5.0;
                let Some(of_whole) = whole.sample(p, lens) else { continue };
                let of_window = window.sample(p, lens).expect("it is in the window");
                assert!((of_whole.film - corner - of_window.film).length() < 2e-2);
                let pixels = [160.0 * 90.0, 60.0 * 20.0];
                let per_pixel = [of_whole.importance * pixels[0], of_window.importance * pixels[1]];
                // Importance is that of all pixels together: the same for each.
                assert!(
                    (of_whole.importance / pixels[1] * pixels[0] / of_window.importance - 1.0).abs() < 1e-3,
                    "{per_pixel:?}"
                );
            }
        }
    }

    /// Where a point is in the picture the header's matrices say, too.
    #[test]
    fn matrices_lead_to_the_film() {
        for projection in
            [Projection::Perspective(Vec2::new(0.8, 0.45)), Projection::Orthographic(Vec2::new(0.8, 0.45))]
        {
            let camera = some(projection).pinhole();
            let origin = DVec3::new(100.0, -20.0, 5.0);
            let [to_camera, to_ndc] = camera.matrices(origin);
            let by = |m: &[f32; 16], p: DVec3| {
                let p = [p.x, p.y, p.z, 1.0];
                let column = |c: usize| (0..4).map(|row| p[row] * f64::from(m[4 * row + c])).sum::<f64>();
                let w = column(3);
                DVec3::new(column(0) / w, column(1) / w, column(2) / w)
            };
            for film in [Vec2::new(0.0, 0.0), Vec2::new(160.0, 90.0), Vec2::new(20.0, 70.0)] {
                let ray = camera.ray(film, Vec2::splat(0.5));
                let p = ray.origin + ray.direction * 3.0;
                let world = p.as_dvec3() + origin;
                let ndc = by(&to_ndc, world);
                let expected = film / Vec2::new(160.0, 90.0);
                assert!((ndc.truncate().as_vec2() - expected).length() < 1e-3, "{projection:?}, {film}: {ndc}");
                assert!((by(&to_camera, world).z - f64::from(camera.depth(p))).abs() < 1e-3);
            }
        }
    }
}
