//! Perspective and orthographic cameras with a thin lens, and panoramas: sampling of rays, and importance
//! towards a point.

mod filter;
mod tiles;

pub use filter::{Filter, MAX_FILTER_WIDTH};
pub use tiles::{GROUP_SIZE, TilePixel, par_pixels, pixels_per_band};

use crate::math::{DMat3, DMat4, DVec2, DVec3, DVec4, Mat3, Vec2, Vec3, warp};
use std::f32::consts::PI;

/// Projection of a camera, with the size of the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective projection: half width and half height of the film in a plane at distance 1 from the camera.
    Perspective(Vec2),
    /// Orthographic projection: half width and half height of the film (m).
    Orthographic(Vec2),
    /// Equirectangular projection: half the range of longitudes and of latitudes (radians). The film plane has longitudes
    /// to the right of the axis and latitudes above it. There is no lens.
    Equirectangular(Vec2),
    /// A circular picture of the directions around the axis. There is no lens.
    Fisheye(Fisheye),
}

/// A fisheye projection. The distance of a point of the film plane from the axis depends on the angle to the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fisheye {
    /// Half width and half height of the film.
    pub half: Vec2,
    /// The largest angle to the axis that is seen (radians).
    pub edge: f32,
    /// Whether the distance is 2 sin(angle / 2), so that equal solid angles have equal areas on the film; otherwise it is
    /// the angle.
    pub equal_area: bool,
}

/// Smallest sine in densities of panoramas, which are infinite at the poles.
const MIN_SINE: f32 = 1e-6;
/// Largest distance of the edge of a panorama from a pole (radians) at which the picture goes on beyond the pole.
const AT_POLE: f32 = 1e-3;

impl Projection {
    /// Half the size of the film, in the unit of the projection.
    fn half(self) -> Vec2 {
        match self {
            Projection::Perspective(half) | Projection::Orthographic(half) | Projection::Equirectangular(half) => half,
            Projection::Fisheye(fisheye) => fisheye.half,
        }
    }

    /// Whether the film is curved, so that points of the film plane stand for directions.
    #[inline]
    fn is_panorama(self) -> bool {
        matches!(self, Projection::Equirectangular(_) | Projection::Fisheye(_))
    }

    /// The unit direction in camera space that a point of a panorama's film plane stands for; `None` outside of the circle
    /// of a fisheye.
    #[inline]
    fn direction(self, at: Vec2) -> Option<Vec3> {
        let Projection::Fisheye(Fisheye { edge, equal_area, .. }) = self else {
            let ((sin, cos), (up, level)) = (at.x.sin_cos(), at.y.sin_cos());
            return Some(Vec3::new(level * sin, up, -level * cos));
        };
        let radius = at.length();
        let angle = if equal_area { 2.0 * (0.5 * radius).min(1.0).asin() } else { radius };
        let around = at.normalize_or_zero() * angle.sin();
        (angle <= edge && !(equal_area && radius > 2.0)).then(|| around.extend(-angle.cos()))
    }

    /// The point of a panorama's film plane that stands for a unit direction in camera space; `None` if a fisheye does not
    /// see it. Longitudes are within half a turn of `middle`.
    #[inline]
    fn place(self, direction: Vec3, middle: f32) -> Option<Vec2> {
        let Projection::Fisheye(Fisheye { edge, equal_area, .. }) = self else {
            let longitude = direction.x.atan2(-direction.z) - middle;
            let turned = longitude - 2.0 * PI * (longitude / (2.0 * PI)).round();
            return Some(Vec2::new(middle + turned, direction.y.clamp(-1.0, 1.0).asin()));
        };
        let across = direction.truncate();
        let angle = across.length().atan2(-direction.z);
        let radius = if equal_area { 2.0 * (0.5 * angle).sin() } else { angle };
        (angle <= edge).then(|| across.normalize_or_zero() * radius)
    }

    /// Density per solid angle of a panorama's rays at a unit direction in camera space. Points are uniform on the film.
    #[inline]
    fn panorama_pdf_w(self, direction: Vec3) -> f32 {
        let half = self.half();
        // Solid angle over area of the film plane.
        let spread = match self {
            Projection::Fisheye(Fisheye { equal_area: true, .. }) => 1.0,
            Projection::Fisheye(_) => {
                let sine = direction.truncate().length();
                let angle = sine.atan2(-direction.z);
                if angle > MIN_SINE { sine.max(MIN_SINE) / angle } else { 1.0 }
            }
            _ => (1.0 - direction.y * direction.y).max(0.0).sqrt().max(MIN_SINE),
        };
        1.0 / (4.0 * half.x * half.y * spread)
    }
}

/// The whole picture, of which the film may be a crop window.
#[derive(Clone, Copy, Debug)]
struct Whole {
    /// Size of the whole picture, in pixels of the film (a fraction if the film has fewer pixels).
    film: Vec2,
    /// Top left corner of the film in the whole picture, in pixels of the film.
    corner: Vec2,
    /// The size `film`, rounded to whole pixels.
    size: (u32, u32),
    /// The corner `corner`, rounded to whole pixels.
    at: (u32, u32),
}

impl Whole {
    /// The whole picture of a camera whose film is not a window, in pixels.
    fn from_size(width: u32, height: u32) -> Whole {
        let film = Vec2::new(width as f32, height as f32);
        Whole { film, corner: Vec2::ZERO, size: (width, height), at: (0, 0) }
    }
}

/// A camera with a film of `width x height` pixels, which may be a crop window of a larger picture. It looks along its
/// local -Z, +Y up.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    position: Vec3,
    /// Orthonormal matrix from camera to world space. Contains a reflection if the camera's node does.
    rotation: Mat3,
    projection: Projection,
    lens_radius: f32,
    focus_distance: f32,
    /// Centre of the film relative to the optical axis, in the unit of the projection.
    offset: Vec2,
    width: u32,
    height: u32,
    /// Share (0 to 1) of a pixel's side that its rays cover; below 1 for [`Camera::subsample`].
    covered: f32,
    filter: Filter,
    whole: Whole,
}

/// A ray that starts on the lens, for a point of the film.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Origin on the lens.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Whether light arrives along the ray: the film point is not outside of the circle of a fisheye.
    pub seen: bool,
}

/// A connection from a point of the scene to the lens, for a light path's contribution.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// Point of the whole picture that sees the scene's point (pixels).
    pub film: Vec2,
    /// Unit direction from the point towards the lens.
    pub wi: Vec3,
    /// Point on the lens.
    pub lens: Vec3,
    /// Importance of the whole picture, taken as one measurement of mean 1, per area perpendicular to the ray at the
    /// point. For a perspective camera this is the importance at the lens times the cosine at the lens over the squared
    /// distance. Multiply by the cosine at the point.
    pub importance: f32,
}

impl Camera {
    /// A camera at `position` whose axes (right, up, backward) are the columns of `rotation`. `lens` is its radius and
    /// focus distance (m), `size` the width and height of the film in pixels.
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
            whole: Whole::from_size(size.0, size.1),
        }
    }

    /// A copy of this camera with the film moved by `shift`, in widths to the right and heights upwards.
    pub fn with_shift(&self, shift: Vec2) -> Camera {
        Camera { offset: 2.0 * shift * self.projection.half(), ..*self }
    }

    /// A copy of this camera whose film is centred at a point of the film plane, in the unit of the projection.
    pub fn with_centre(&self, offset: Vec2) -> Camera {
        Camera { offset, ..*self }
    }

    /// A copy of this camera with another pixel filter.
    pub fn with_filter(&self, filter: Filter) -> Camera {
        Camera { filter, ..*self }
    }

    /// A copy of this camera whose film is a crop window of the present film: left edge, top edge, width and height in
    /// pixels. Rays and random numbers of its pixels are those of the whole picture, to the bit.
    pub fn crop(&self, [x, y, width, height]: [u32; 4]) -> Camera {
        let Whole { corner, at, .. } = self.whole;
        let (corner, at) = (corner + Vec2::new(x as f32, y as f32), (at.0 + x, at.1 + y));
        Camera { width, height, whole: Whole { corner, at, ..self.whole }, ..*self }
    }

    /// A copy of this camera whose film is the whole picture.
    pub fn uncropped(&self) -> Camera {
        let Whole { size: (width, height), .. } = self.whole;
        Camera { width, height, whole: Whole { corner: Vec2::ZERO, at: (0, 0), ..self.whole }, ..*self }
    }

    /// A copy of this camera with `factor` times the pixels per side (at least one pixel), spread evenly over the film.
    /// Each covers the area of one pixel of this camera, so camera paths have the noise of single pixels. Light paths
    /// contribute from all of the film, so with proportionally fewer light paths their noise is that of the full
    /// picture.
    pub fn subsample(&self, factor: f64) -> Camera {
        let scaled = |side: u32| ((f64::from(side) * factor).round() as u32).max(1);
        let (width, height, covered) = (scaled(self.width), scaled(self.height), self.covered * factor.min(1.0) as f32);
        // The new pixels are not pixels of the whole picture, so `size` and `at` are those of a film without a window.
        let mut whole = Whole::from_size(width, height);
        let size = Vec2::new(self.width as f32, self.height as f32);
        if self.whole.film != size {
            let scale = whole.film / size;
            (whole.film, whole.corner) = (self.whole.film * scale, self.whole.corner * scale);
        }
        Camera { width, height, covered, whole, ..*self }
    }

    /// A copy of this camera with `factor` times the pixels per side (at least one pixel), which together cover the
    /// view of this camera.
    pub fn downscale(&self, factor: f64) -> Camera {
        Camera { covered: self.covered, ..self.subsample(factor) }
    }

    /// A copy of this camera as a pinhole camera: everything is in focus.
    pub fn without_lens(&self) -> Camera {
        Camera { lens_radius: 0.0, focus_distance: 1.0, ..*self }
    }

    /// Samples the filter of pixel `(x, y)` of the film by a point of the unit square. Returns the film point in the
    /// whole picture (pixels).
    #[inline]
    pub fn film_point(&self, (x, y): (u32, u32), u: Vec2) -> Vec2 {
        let from_centre = match self.filter {
            Filter::Box(width) => (u - 0.5) * width,
            filter => Vec2::new(filter.inverse(u.x), filter.inverse(u.y)),
        };
        self.whole.corner + Vec2::new(x as f32, y as f32) + 0.5 + from_centre * self.covered
    }

    /// Draws one of the pixels whose filters cover a point `film` of the whole picture, in proportion to their filters
    /// there. Returns its column and row, and the sum of the filters. `None` if the drawn pixel is outside of the film.
    #[inline]
    pub fn sample_pixel(&self, film: Vec2, u: impl FnOnce() -> Vec2) -> Option<((u32, u32), f32)> {
        let corner = self.whole.corner;
        if self.filter == Filter::Box(1.0) {
            let within = film - corner;
            return Some((((within.x as u32).min(self.width - 1), (within.y as u32).min(self.height - 1)), 1.0));
        }
        // After `subsample` of a window, the corner may be between two pixels.
        let (u, begin) = (u(), corner.floor());
        let film = film - (corner - begin);
        let (row, across) = filter::sample_pixel(self.filter, film.y, u.y);
        let (row, film_x) = self.over_pole(row, film.x);
        let (column, along) = filter::sample_pixel(self.filter, film_x, u.x);
        let place = |k: i64, begin: f32| u32::try_from(k - begin as i64).ok();
        let (x, y) = (place(self.around(column), begin.x)?, place(row, begin.y)?);
        (x < self.width && y < self.height).then_some(((x, y), along * across))
    }

    /// Number of pixels in a full turn; `None` unless the film is an equirectangular panorama.
    #[inline]
    fn turn(&self) -> Option<f32> {
        let Projection::Equirectangular(half) = self.projection else { return None };
        Some(self.whole.film.x * PI / half.x)
    }

    /// The row of a panorama that lies where `row` would continue it beyond a pole, and the point `x` of the film where it
    /// is crossed; `row` and `x` themselves if there is no pole between.
    #[inline]
    fn over_pole(&self, row: i64, x: f32) -> (i64, f32) {
        let Some(turn) = self.turn() else { return (row, x) };
        let rows = self.whole.film.y.round() as i64;
        let is_pole = |latitude: f32| latitude.abs() > 0.5 * PI - AT_POLE;
        let (top, bottom) = (self.offset.y + self.projection.half().y, self.offset.y - self.projection.half().y);
        let mirrored = match row {
            ..0 if is_pole(top) => -1 - row,
            _ if row >= rows && is_pole(bottom) => 2 * rows - 1 - row,
            _ => return (row, x),
        };
        (mirrored, (x + 0.5 * turn).rem_euclid(turn))
    }

    /// The column that continues a full panorama at `column`, which may lie beyond its seam.
    #[inline]
    fn around(&self, column: i64) -> i64 {
        let columns = self.whole.film.x;
        if self.turn().is_some_and(|turn| (turn - columns).abs() < 0.5) {
            column.rem_euclid(columns.round().max(1.0) as i64)
        } else {
            column
        }
    }

    /// Width and height of the whole picture, and column and row of this film's top left corner in it (pixels).
    pub fn whole(&self) -> [(u32, u32); 2] {
        [self.whole.size, self.whole.at]
    }

    /// Width and height (pixels) of the film, and of the whole picture.
    pub fn sizes(&self) -> [(u32, u32); 2] {
        [self.size(), self.whole.size]
    }

    /// Area of the whole picture, in numbers of pixels of this film.
    pub fn whole_pixels(&self) -> f32 {
        self.whole.film.x * self.whole.film.y
    }

    /// Row-major index, in the whole picture, of a pixel of the film; it is the key of the pixel's random numbers.
    #[inline]
    pub fn pixel_key(&self, (x, y): (u32, u32)) -> u64 {
        let Whole { size, at, .. } = self.whole;
        u64::from(at.1 + y) * u64::from(size.0) + u64::from(at.0 + x)
    }

    /// Width and height of the film in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Centre of the lens in world space (m).
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Corners of a rectangle that contains the origins of all camera rays.
    pub fn origins(&self) -> [Vec3; 4] {
        let (film, centre) = match self.projection {
            Projection::Orthographic(half) => {
                let size = Vec2::new(self.width as f32, self.height as f32);
                (half * size / self.whole.film, self.plane(self.whole.corner + 0.5 * size, half))
            }
            _ => (Vec2::ZERO, Vec2::ZERO),
        };
        let half = film + if self.has_lens() { self.lens_radius } else { 0.0 };
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .map(|(x, y)| self.position + self.rotation * (centre + half * Vec2::new(x, y)).extend(0.0))
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        -self.rotation.z_axis
    }

    /// Whether the lens has a radius, so that the picture has depth of field.
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0 && !self.projection.is_panorama()
    }

    /// Converts a point of the whole picture (pixels, y down) to a point of the film plane (y up) in the unit of the
    /// projection, relative to the optical axis.
    #[inline]
    fn plane(&self, film: Vec2, half: Vec2) -> Vec2 {
        let ndc = film / self.whole.film * 2.0 - 1.0;
        Vec2::new(ndc.x, -ndc.y) * half + self.offset
    }

    /// The ray through the point `film` of the whole picture (pixels). `lens` is a point of the unit square that
    /// samples the lens.
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2) -> CameraRay {
        let mut seen = true;
        let (mut origin, focus) = match self.projection {
            Projection::Perspective(half) => (Vec3::ZERO, self.plane(film, half).extend(-1.0) * self.focus_distance),
            Projection::Orthographic(half) => {
                let p = self.plane(film, half);
                (p.extend(0.0), p.extend(-self.focus_distance))
            }
            panorama => {
                let direction = panorama.direction(self.plane(film, panorama.half()));
                seen = direction.is_some();
                (Vec3::ZERO, direction.unwrap_or(Vec3::NEG_Z))
            }
        };
        if self.has_lens() {
            origin += (warp::disc_concentric(lens) * self.lens_radius).extend(0.0);
        }
        CameraRay {
            origin: self.position + self.rotation * origin,
            direction: (self.rotation * (focus - origin)).normalize(),
            seen,
        }
    }

    /// The matrices `worldToCamera` (x to the right, y up, z along the view) and `worldToNDC` (x to the right, y down,
    /// from 0 to 1 after division by w) of OpenEXR: row-major, for row vectors. `origin` is the world position of this
    /// scene's origin. A panorama has no matrix to NDC.
    pub fn matrices(&self, origin: DVec3) -> ([f32; 16], Option<[f32; 16]>) {
        let rotation = self.rotation.as_dmat3();
        let axes = DMat3::from_cols(rotation.x_axis, rotation.y_axis, -rotation.z_axis).transpose();
        let position = self.position.as_dvec3() + origin;
        let to_camera = DMat4::from_mat3(axes) * DMat4::from_translation(-position);
        let (half, offset) = (self.projection.half().as_dvec2(), self.offset.as_dvec2());
        // A point at distance 1 along the view has the NDC x coordinate (1 + (x - offset) / half) / 2.
        let (sx, sy) = (0.5 / half.x, -0.5 / half.y);
        let (ox, oy) = (0.5 - offset.x * sx, 0.5 - offset.y * sy);
        let film = match self.projection {
            Projection::Equirectangular(_) | Projection::Fisheye(_) => None,
            Projection::Perspective(_) => Some(DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(ox, oy, 0.0, 1.0),
                DVec4::new(0.0, 0.0, 1.0, 0.0),
            )),
            Projection::Orthographic(_) => Some(DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(0.0, 0.0, 1.0, 0.0),
                DVec4::new(ox, oy, 0.0, 1.0),
            )),
        };
        // Row vectors need the transposed matrix. Its rows are the columns, which `to_cols_array` returns.
        let rows = |m: DMat4| m.to_cols_array().map(|x| x as f32);
        (rows(to_camera), film.map(|film| rows(film * to_camera)))
    }

    /// Width of the view of the whole picture (m) as a linear function of distance: its slope, which is 0 for an
    /// orthographic camera, and its value at distance 0, which is 0 for a perspective camera. The slope is the angle of the view: at
    /// most pi of a perspective camera, because a wide film still sees less than half a circle.
    pub fn span(&self) -> (f32, f32) {
        match self.projection {
            Projection::Perspective(half) => ((2.0 * half.x).min(PI), 0.0),
            Projection::Orthographic(half) => (0.0, 2.0 * half.x),
            Projection::Equirectangular(half) => (2.0 * half.x, 0.0),
            Projection::Fisheye(Fisheye { edge, .. }) => (2.0 * edge, 0.0),
        }
    }

    /// Width of the whole picture in pixels.
    pub fn whole_width(&self) -> f32 {
        self.whole.film.x
    }

    /// Depth (m) of the point `p` along the viewing direction, from the camera; the distance to the camera of a panorama.
    pub fn depth(&self, p: Vec3) -> f32 {
        if self.projection.is_panorama() {
            return p.distance(self.position);
        }
        (p - self.position).dot(self.forward())
    }

    /// Projects the point `p` through the centre of the lens. Returns its place in the whole picture: x from the left and
    /// y from the top, 0 to 1 within the picture. `None` if a perspective camera has the point behind it.
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        let local = self.rotation.as_dmat3().transpose() * (p - self.position.as_dvec3());
        let (half, distance) = match self.projection {
            Projection::Equirectangular(half) | Projection::Fisheye(Fisheye { half, .. }) => {
                let at = self.projection.place(local.normalize_or_zero().as_vec3(), self.offset.x)?;
                let plane = ((at - self.offset) / half).as_dvec2();
                return Some(DVec2::new(1.0 + plane.x, 1.0 - plane.y) * 0.5);
            }
            Projection::Perspective(half) => (half, -local.z),
            Projection::Orthographic(half) => (half, 1.0),
        };
        let plane = (local.truncate() / distance - self.offset.as_dvec2()) / half.as_dvec2();
        (distance > 0.0).then(|| DVec2::new(1.0 + plane.x, 1.0 - plane.y) * 0.5)
    }

    /// Connects the point `p` to the lens; `lens` is a point of the unit square that samples it. `None` if `p` is out
    /// of view.
    ///
    /// In an orthographic camera each film point has its own lens. The rays through one lens point of every lens are
    /// parallel, so they form a beam with the cross-section of the film, and the importance does not depend on
    /// distance.
    #[inline]
    pub fn sample(&self, p: Vec3, lens: Vec2) -> Option<CameraSample> {
        let mut lens_local = Vec3::ZERO;
        if self.has_lens() {
            lens_local = (warp::disc_concentric(lens) * self.lens_radius).extend(0.0);
        }
        let (half, lens_world, to, at) = match self.projection {
            Projection::Perspective(_) | Projection::Equirectangular(_) | Projection::Fisheye(_) => {
                let lens_world = self.position + self.rotation * lens_local;
                (self.projection.half(), lens_world, p - lens_world, Vec2::ZERO)
            }
            Projection::Orthographic(half) => {
                let local = self.rotation.transpose() * (p - self.position);
                // The ray of the central film point goes from the lens point to the focus point on the axis.
                let ray = Vec3::new(0.0, 0.0, -self.focus_distance) - lens_local;
                let to = ray * (-local.z / self.focus_distance);
                let at = (local - to).truncate();
                (half, self.position + self.rotation * at.extend(0.0), self.rotation * to, at - lens_local.truncate())
            }
        };
        let distance2 = to.length_squared();
        let wi = -to.try_normalize()?;
        let local = self.rotation.transpose() * -wi;
        let cos = -local.z;
        if cos <= 0.0 && !self.projection.is_panorama() {
            return None;
        }
        let (on_film, importance) = match self.projection {
            Projection::Equirectangular(_) | Projection::Fisheye(_) => {
                (self.projection.place(local, self.offset.x)?, self.projection.panorama_pdf_w(local) / distance2)
            }
            Projection::Perspective(_) => {
                // The intersection with the focus plane, scaled to a film point at distance 1.
                let focus = lens_local + local * (self.focus_distance / cos);
                let importance = 1.0 / (4.0 * half.x * half.y * cos * cos * cos * distance2);
                (focus.truncate() / self.focus_distance, importance)
            }
            Projection::Orthographic(_) => (at, 1.0 / (4.0 * half.x * half.y * cos)),
        };
        let plane = (on_film - self.offset) / half;
        let film = Vec2::new(plane.x + 1.0, 1.0 - plane.y) * 0.5 * self.whole.film;
        // Filters of edge pixels reach beyond the film.
        let beyond = (self.filter.radius() - 0.5).max(0.0);
        let seen = |x: f32, from: f32, side: u32| x >= from - beyond && x < from + side as f32 + beyond;
        let corner = self.whole.corner;
        // Filters of a panorama also reach over its seam and its poles.
        let is_round = beyond > 0.0 && self.turn().is_some();
        if !(is_round || seen(film.x, corner.x, self.width) && seen(film.y, corner.y, self.height)) {
            return None;
        }
        Some(CameraSample { film, wi, lens: lens_world, importance })
    }

    /// Density of the camera rays of the whole picture through a lens point, at a unit direction in view. Per solid
    /// angle for a perspective camera, per area perpendicular to the direction for an orthographic one. Film points are
    /// uniform over an area of `4 half.x half.y`, at distance 1 or in the plane of the lens.
    #[inline]
    pub fn pdf_w(&self, direction: Vec3) -> f32 {
        let cos = direction.dot(self.forward());
        match self.projection {
            Projection::Equirectangular(_) | Projection::Fisheye(_) => {
                self.projection.panorama_pdf_w(self.rotation.transpose() * direction)
            }
            _ if cos <= 0.0 => 0.0,
            Projection::Perspective(half) => 1.0 / (4.0 * half.x * half.y * cos * cos * cos),
            Projection::Orthographic(half) => 1.0 / (4.0 * half.x * half.y * cos),
        }
    }

    /// Whether the camera is orthographic, so that [`Camera::pdf_w`] is per area and the same at any distance.
    #[inline]
    pub fn is_orthographic(&self) -> bool {
        matches!(self.projection, Projection::Orthographic(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// A connection from a point on a camera ray returns the film point of the ray, with and without lens and shift.
    #[test]
    fn rays_and_connections_are_inverse() {
        let half = Vec2::new(0.8, 0.45);
        let lenses = [(0.0, Vec2::ZERO), (0.3, Vec2::ZERO), (0.3, Vec2::new(0.7, -0.2))];
        let wide = Vec2::new(2.9, 1.5);
        let fisheye = |equal_area| Projection::Fisheye(Fisheye { half: Vec2::new(1.1, 0.9), edge: 3.0, equal_area });
        let all = [
            Projection::Perspective(half),
            Projection::Orthographic(half),
            Projection::Equirectangular(wide),
            fisheye(false),
            fisheye(true),
        ];
        for (projection, (lens_radius, shift)) in all.into_iter().flat_map(|p| lenses.map(|lens| (p, lens))) {
            // Panoramas have no shift.
            if projection.is_panorama() && shift != Vec2::ZERO {
                continue;
            }
            let rotation = Mat3::from_rotation_y(0.4) * Mat3::from_rotation_x(-0.2);
            let camera = Camera::new(DVec3::new(1.0, 2.0, 3.0), rotation, projection, (lens_radius, 4.0), (160, 90));
            let camera = camera.with_shift(shift);
            for i in 0..1000 {
                let draws = Stream::new(0, 0, Domain::Test, i).vertex(0);
                let film = draws.two(Purpose::Pixel) * Vec2::new(160.0, 90.0);
                let lens = draws.two(Purpose::Lens);
                let ray = camera.ray(film, lens);
                if !ray.seen {
                    continue;
                }
                let p = ray.origin + ray.direction * (0.5 + 9.0 * draws.one(Purpose::Lobe));
                let sample = camera.sample(p, lens).unwrap();
                assert!((sample.film - film).length() < 2e-2, "{film} {}", sample.film);
                assert!((sample.wi + ray.direction).length() < 1e-4);
                assert!((sample.lens - ray.origin).length() < 1e-3);
                if lens_radius == 0.0 {
                    let projected = camera.project(p.as_dvec3()).unwrap().as_vec2() * Vec2::new(160.0, 90.0);
                    assert!((projected - film).length() < 2e-2, "{film} {projected}");
                }
                let distance2 = if camera.is_orthographic() { 1.0 } else { (p - sample.lens).length_squared() };
                assert!((sample.importance * distance2 / camera.pdf_w(ray.direction) - 1.0).abs() < 1e-3);
            }
        }
    }

    /// Uniform light on the film of a panorama gives every pixel the same, also where its filter reaches over the seam or
    /// over a pole, and in a window. The last pictures reach one pole alone, and are odd in width.
    #[test]
    fn filters_reach_over_the_seam_and_the_poles() {
        const POINTS: u64 = 400_000;
        let panorama = |half: Vec2, middle: f32, size: (u32, u32)| {
            let projection = Projection::Equirectangular(half);
            let camera = Camera::new(DVec3::ZERO, Mat3::IDENTITY, projection, (0.0, 1.0), size);
            camera.with_centre(Vec2::new(0.0, middle)).with_filter(Filter::Gaussian(3.0))
        };
        let full = panorama(Vec2::new(PI, 0.5 * PI), 0.0, (16, 8));
        let north = panorama(Vec2::new(PI, 0.25 * PI), 0.25 * PI, (15, 4));
        for camera in [full, full.crop([0, 0, 3, 3]), north] {
            let mut light = vec![0.0; (camera.width * camera.height) as usize];
            for i in 0..POINTS {
                let draws = Stream::new(0, 0, Domain::Test, i).vertex(0);
                let film = draws.two(Purpose::Pixel) * camera.whole.film;
                if let Some(((x, y), weight)) = camera.sample_pixel(film, || draws.two(Purpose::Splat)) {
                    light[(y * camera.width + x) as usize] += f64::from(weight);
                }
            }
            let expected = POINTS as f64 / f64::from(camera.whole_pixels());
            // The southern edge of the last picture is no pole.
            let rows = if camera.offset.y > 0.0 { 2 } else { camera.height };
            for (pixel, light) in light[..(rows * camera.width) as usize].iter().enumerate() {
                assert!((light / expected - 1.0).abs() < 6.0 / expected.sqrt(), "{pixel}: {light} of {expected}");
            }
        }
    }

    fn some(projection: Projection) -> Camera {
        let rotation = Mat3::from_rotation_y(0.4) * Mat3::from_rotation_x(-0.2);
        Camera::new(DVec3::new(1.0, 2.0, 3.0), rotation, projection, (0.2, 4.0), (160, 90))
            .with_shift(Vec2::new(0.1, -0.3))
    }

    /// Rays, keys and light path contributions of a crop window are those of the whole picture, to the bit.
    #[test]
    fn crop_windows_are_parts_of_the_whole_picture() {
        for projection in
            [Projection::Perspective(Vec2::new(0.8, 0.45)), Projection::Orthographic(Vec2::new(0.8, 0.45))]
        {
            let whole = some(projection);
            let corner = Vec2::new(40.0, 30.0);
            let window = whole.crop([40, 30, 60, 20]);
            let deeper = window.crop([10, 5, 20, 10]);
            assert_eq!((window.size(), deeper.size()), ((60, 20), (20, 10)));
            for camera in [window, deeper] {
                let (a, b) = (whole.span(), camera.span());
                assert!((a.0 - b.0).abs() < 1e-5 && (a.1 - b.1).abs() < 1e-5);
                assert!((camera.whole_width() - 160.0).abs() < 1e-3);
            }
            for i in 0..100 {
                let draws = Stream::new(0, 0, Domain::Test, i).vertex(0);
                let (film, lens) = (draws.two(Purpose::Pixel) * Vec2::new(20.0, 10.0), draws.two(Purpose::Lens));
                let at = corner + Vec2::new(10.0, 5.0) + film;
                let (a, place) = (whole.ray(at, lens), (film.x as u32, film.y as u32));
                let of_whole = whole.film_point((50 + place.0, 35 + place.1), lens);
                assert_eq!(of_whole, window.film_point((10 + place.0, 5 + place.1), lens));
                assert_eq!(of_whole, deeper.film_point(place, lens));
                assert_eq!(whole.pixel_key((50 + place.0, 35 + place.1)), deeper.pixel_key(place));
                let p = a.origin + a.direction * 5.0;
                let Some(of_whole) = whole.sample(p, lens) else { continue };
                for camera in [window, deeper] {
                    let sample = camera.sample(p, lens).expect("a point in the window");
                    assert_eq!((of_whole.film, of_whole.importance), (sample.film, sample.importance));
                }
                let pixel =
                    |camera: &Camera| camera.sample_pixel(of_whole.film, || lens).expect("a pixel of the film").0;
                let (x, y) = pixel(&deeper);
                assert_eq!((pixel(&whole), pixel(&window)), ((50 + x, 35 + y), (10 + x, 5 + y)));
            }
        }
    }

    /// The matrices of the EXR header map a point on a camera ray to its film point.
    #[test]
    fn header_matrices_project_points_to_the_film() {
        for projection in
            [Projection::Perspective(Vec2::new(0.8, 0.45)), Projection::Orthographic(Vec2::new(0.8, 0.45))]
        {
            let camera = some(projection).without_lens();
            let origin = DVec3::new(100.0, -20.0, 5.0);
            let (to_camera, to_ndc) = camera.matrices(origin);
            let to_ndc = to_ndc.expect("a flat picture has a matrix");
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
