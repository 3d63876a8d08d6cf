//! The camera of a picture: chosen by name and sized, or made when the scene has none.

use super::Scene;
use super::description::{CameraDescription, Projection};
use crate::camera::{self, Camera, Filter, Fisheye};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Instance;
use crate::math::{DAffine3, DMat3, DVec3, Mat3, Vec2, Vec3, bounding_box};
use serde::Serialize;
use std::borrow::Cow;
use std::str::FromStr;

/// Width of a picture in pixels, if neither the scene nor the user sets a size.
const DEFAULT_WIDTH: u32 = 1280;
/// Width over height of a picture when neither the camera nor the user gives it.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;
/// Vertical field of view of a view of the whole scene (radians): 35 degrees.
const VIEW_YFOV: f64 = 35.0 * std::f64::consts::PI / 180.0;
/// Share of the picture's height or width that the scene fills.
const VIEW_FILL: f64 = 0.9;
/// Maximum width and height of a picture in pixels.
pub const MAX_SIZE: u32 = 32_768;

/// The camera, size, window and pixel filter that the user asks for.
#[derive(Clone, Debug, Default)]
pub struct CameraRequest {
    /// Name of the camera; `None`: the scene's first camera.
    pub camera: Option<String>,
    /// A camera that the scene does not have, which replaces its cameras; `None`: one of them.
    pub own: Option<CameraDescription>,
    /// A view of the whole scene instead of a camera; `None`: the camera, or the default view if the scene has none.
    pub orbit: Option<Orbit>,
    /// Width of the whole picture in pixels; `None`: from the scene, or from the height.
    pub width: Option<u32>,
    /// Height of the whole picture in pixels; `None`: from the scene, or from the width.
    pub height: Option<u32>,
    /// The window of the picture to render; `None`: the window in the scene file, or the whole picture.
    pub crop: Option<Crop>,
    /// Filter that reconstructs pixels.
    pub filter: Filter,
}

/// A view of the whole scene from a place on a sphere around its middle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Orbit {
    /// Angle about +Y (degrees): 0 is the front (+Z), 90 the right side (+X).
    pub azimuth: f64,
    /// Angle above the horizon (degrees), -90 to 90.
    pub elevation: f64,
    /// Distance from the middle of the scene.
    pub distance: Distance,
}

/// Distance of a view from the middle of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Distance {
    /// A number of metres.
    Metres(f64),
    /// A factor on the distance from which the scene fills the picture.
    Framing(f64),
}

impl Default for Orbit {
    /// A three-quarter view from above.
    fn default() -> Orbit {
        Orbit { azimuth: 30.0, elevation: 20.0, distance: Distance::Framing(1.0) }
    }
}

impl FromStr for Orbit {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Orbit, String> {
        let fault = || "it must be AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,DISTANCE, such as 30,20 or 30,20,150%".into();
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        let (azimuth, elevation, distance) = match text.split(',').collect::<Vec<_>>()[..] {
            [azimuth, elevation] => (number(azimuth), number(elevation), Some(Distance::Framing(1.0))),
            [azimuth, elevation, distance] => {
                let distance = match distance.trim().strip_suffix('%') {
                    Some(share) => number(share).map(|share| Distance::Framing(share / 100.0)),
                    None => number(distance).map(Distance::Metres),
                };
                (number(azimuth), number(elevation), distance)
            }
            _ => return Err(fault()),
        };
        let (Some(azimuth), Some(elevation), Some(distance)) = (azimuth, elevation, distance) else {
            return Err(fault());
        };
        let (Distance::Metres(length) | Distance::Framing(length)) = distance;
        match (-90.0..=90.0).contains(&elevation) {
            false => Err("the elevation must be between -90 and 90 degrees".into()),
            true if length <= 0.0 => Err("the distance must be above zero".into()),
            true => Ok(Orbit { azimuth, elevation, distance }),
        }
    }
}

/// A window of a picture, which is rendered alone: left edge, top edge, width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crop {
    /// The four numbers in pixels.
    Pixels([u32; 4]),
    /// The four numbers in shares of the picture's width and height, 0 to 1.
    Shares([f64; 4]),
}

impl Crop {
    /// The window in pixels, for a picture of `width` x `height` pixels. Windows in shares have at least one pixel per
    /// side. `None` if the window is empty or not within the picture.
    pub fn window(self, (width, height): (u32, u32)) -> Option<[u32; 4]> {
        let [x, y, w, h] = match self {
            Crop::Pixels(window) => window,
            Crop::Shares([x, y, w, h]) => {
                let along = |start: f64, length: f64, side: u32| {
                    let side_f = f64::from(side);
                    let first = ((start * side_f).round() as u32).min(side.saturating_sub(1));
                    let last = (((start + length) * side_f).round() as u32).min(side);
                    (first, last.saturating_sub(first).max(1))
                };
                let ((x, w), (y, h)) = (along(x, w, width), along(y, h, height));
                [x, y, w, h]
            }
        };
        let fits =
            |start: u32, length: u32, side: u32| length > 0 && start.checked_add(length).is_some_and(|end| end <= side);
        (fits(x, w, width) && fits(y, h, height)).then_some([x, y, w, h])
    }
}

impl Scene {
    /// The camera that `request` asks for, with the window of the picture as its film. If only one of width and height
    /// is given, the camera's aspect ratio gives the other.
    ///
    /// # Errors
    /// No camera has the name, the size is zero or too large, or the window is not within the picture.
    pub fn camera(&self, request: &CameraRequest) -> Result<Camera> {
        let whole = self.whole_camera(request)?;
        Ok(self.window(request, whole.size())?.map_or(whole, |window| whole.crop(window)))
    }

    /// The window to render, in pixels, of a picture of `size` pixels; `None` for the whole picture.
    ///
    /// # Errors
    /// The window is not within the picture.
    pub fn window(&self, request: &CameraRequest, size: (u32, u32)) -> Result<Option<[u32; 4]>> {
        let Some(crop) = request.crop.or(self.picture.crop.map(Crop::Shares)) else { return Ok(None) };
        let window = crop.window(size).ok_or_else(|| {
            let (width, height) = size;
            let cause = format!("--crop: the window is not within the picture of {width} x {height} pixels");
            Error::usage(cause).hint(
                "it is X,Y,W,H: left edge, top edge, width and height, in pixels or in shares such as 0.25,0,0.5,1",
            )
        })?;
        Ok(Some(window).filter(|window| *window != [0, 0, size.0, size.1]))
    }

    /// The camera that `request` asks for, with the whole picture as its film.
    ///
    /// # Errors
    /// No camera has the name, or the size is zero or too large.
    pub fn whole_camera(&self, request: &CameraRequest) -> Result<Camera> {
        self.whole_camera_among(&self.cameras, request)
    }

    /// Does the work of [`Scene::whole_camera`] for `cameras`, which are those of the scene at another time.
    ///
    /// # Errors
    /// As for [`Scene::whole_camera`].
    pub(super) fn whole_camera_among(&self, cameras: &[CameraDescription], request: &CameraRequest) -> Result<Camera> {
        let described = self.described_camera(cameras, request)?;
        let (width, height) = self.picture_size(request, described.projection)?;
        let film_aspect = width as f32 / height as f32;
        let projection = match described.projection {
            Projection::Perspective { yfov, .. } => {
                let half = (0.5 * yfov).tan();
                camera::Projection::Perspective(Vec2::new(half * film_aspect, half))
            }
            Projection::Orthographic { xmag, ymag } => {
                // A picture of another aspect ratio shows at least the camera's whole view.
                let ymag = ymag.abs().max(xmag.abs() / film_aspect);
                camera::Projection::Orthographic(Vec2::new(ymag * film_aspect, ymag))
            }
            Projection::Equirectangular { longitude, latitude } => {
                let half = Vec2::new(longitude[1] - longitude[0], latitude[1] - latitude[0]) * 0.5;
                camera::Projection::Equirectangular(half)
            }
            Projection::Fisheye { fov, equal_area, half_size } => {
                camera::Projection::Fisheye(Fisheye { half: half_size.into(), edge: 0.5 * fov, equal_area })
            }
        };
        let lens = if described.aperture_radius > 0.0 && described.focus_distance > 0.0 {
            (described.aperture_radius, described.focus_distance)
        } else {
            (0.0, 1.0)
        };
        let position = described.to_world.translation - self.origin;
        let camera = Camera::new(position, rotation(&described.to_world), projection, lens, (width, height));
        let camera = match described.projection {
            Projection::Equirectangular { longitude, latitude } => {
                camera.with_centre(Vec2::new(longitude[0] + longitude[1], latitude[0] + latitude[1]) * 0.5)
            }
            Projection::Fisheye { .. } => camera,
            _ => camera.with_shift(described.shift.into()),
        };
        Ok(camera.with_filter(request.filter))
    }

    /// The camera of the request: its own, a view of the whole scene, the one of a name among `cameras`, or the first of
    /// them. Without cameras it is the default view.
    fn described_camera<'c>(
        &self,
        cameras: &'c [CameraDescription],
        request: &CameraRequest,
    ) -> Result<Cow<'c, CameraDescription>> {
        if let Some(own) = &request.own {
            return Ok(Cow::Owned(own.clone()));
        }
        let Some(name) = request.camera.as_deref() else {
            return match (request.orbit, cameras.first()) {
                (None, Some(first)) => Ok(Cow::Borrowed(first)),
                (orbit, _) => self.view(orbit.unwrap_or_default(), request).map(Cow::Owned),
            };
        };
        cameras.iter().find(|camera| camera.name == name).map(Cow::Borrowed).ok_or_else(|| {
            let names: Vec<String> = cameras.iter().map(|c| format!("\"{}\"", c.name)).collect();
            let error =
                Error::new(ErrorKind::Usage, self.source.display(), format_args!("there is no camera \"{name}\""));
            error.hint(if names.is_empty() {
                "the scene has no camera".into()
            } else {
                format!("it has {}", names.join(", "))
            })
        })
    }

    /// Width and height of the whole picture in pixels: from the request, else from the scene. The aspect ratio gives a
    /// side that neither sets.
    fn picture_size(&self, request: &CameraRequest, projection: Projection) -> Result<(u32, u32)> {
        let aspect = match (self.picture.resolution, projection) {
            (Some([width, height]), _) => width as f32 / height as f32,
            (None, Projection::Perspective { aspect, .. }) => aspect.unwrap_or(DEFAULT_ASPECT),
            (None, Projection::Orthographic { xmag, ymag }) => (xmag / ymag).abs(),
            (None, Projection::Equirectangular { longitude, latitude }) => {
                (longitude[1] - longitude[0]) / (latitude[1] - latitude[0])
            }
            (None, Projection::Fisheye { half_size, .. }) => half_size[0] / half_size[1],
        };
        let scaled = |x: u32, factor: f32| ((x as f32 * factor).round() as u32).max(1);
        let (width, height) = match (request.width, request.height) {
            (Some(w), Some(h)) => (w, h),
            (Some(w), None) => (w, scaled(w, 1.0 / aspect)),
            (None, Some(h)) => (scaled(h, aspect), h),
            (None, None) => match self.picture.resolution {
                Some([width, height]) => (width, height),
                None => (DEFAULT_WIDTH, scaled(DEFAULT_WIDTH, 1.0 / aspect)),
            },
        };
        if width == 0 || height == 0 || width > MAX_SIZE || height > MAX_SIZE {
            let cause = format!("a picture of {width} x {height} pixels cannot be made");
            return Err(
                Error::new(ErrorKind::Usage, "", cause).hint(format!("--width and --height are from 1 to {MAX_SIZE}"))
            );
        }
        Ok((width, height))
    }

    /// A camera that looks at the middle of the scene.
    fn view(&self, orbit: Orbit, request: &CameraRequest) -> Result<CameraDescription> {
        let projection = Projection::Perspective { yfov: VIEW_YFOV as f32, aspect: None };
        let (width, height) = self.picture_size(request, projection)?;
        let ((sa, ca), (se, ce)) = (orbit.azimuth.to_radians().sin_cos(), orbit.elevation.to_radians().sin_cos());
        let back = DVec3::new(sa * ce, se, ca * ce);
        let right = DVec3::new(ca, 0.0, -sa);
        let matrix = DMat3::from_cols(right, back.cross(right), back);
        let (low, high) = bounding_box(self.framed_points());
        let middle = if low.cmple(high).all() { 0.5 * (low + high) } else { self.lights.sky().center };
        let distance = match orbit.distance {
            Distance::Metres(length) => length,
            Distance::Framing(factor) => {
                factor * self.framing_distance(middle, matrix, f64::from(width) / f64::from(height))
            }
        };
        Ok(CameraDescription {
            name: "default".into(),
            to_world: DAffine3 { matrix3: matrix, translation: middle.as_dvec3() + self.origin + back * distance },
            projection,
            aperture_radius: 0.0,
            focus_distance: 1.0,
            shift: [0.0; 2],
        })
    }

    /// The vertices that views of the whole scene frame.
    fn framed_points(&self) -> impl Iterator<Item = Vec3> {
        let framed = |instance: &Instance| self.preset_floor != Some(instance.object);
        self.shapes.points_of(framed)
    }

    /// Distance (m) from `middle` at which a camera with the axes of `rotation` sees all vertices, with a margin.
    fn framing_distance(&self, middle: Vec3, rotation: DMat3, aspect: f64) -> f64 {
        let half = (0.5 * VIEW_YFOV).tan() * VIEW_FILL;
        let to_camera = rotation.transpose();
        let least = |p: Vec3| {
            let p = to_camera * (p - middle).as_dvec3();
            p.z + (p.x.abs() / aspect).max(p.y.abs()) / half
        };
        let radius = f64::from(self.lights.sky().radius);
        let distance = self.framed_points().map(least).fold(0.0, f64::max);
        // A scene without meshes, or one that is a point.
        if distance > 0.0 { distance } else { radius / half }
    }
}

/// Orthonormal axes of a camera node's transform, as columns. They are left-handed if the transform mirrors, so that +X
/// stays to the right.
fn rotation(to_world: &DAffine3) -> Mat3 {
    let back = to_world.matrix3.z_axis.normalize_or(DVec3::Z);
    let up = to_world.matrix3.y_axis;
    let right = up.cross(back).normalize_or(DVec3::X);
    let hand = if to_world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(hand * right, back.cross(right), back).as_mat3()
}
