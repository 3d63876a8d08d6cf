//! Warns about objects before the near plane or behind the far plane of a camera (specification, section 3.10.3),
//! because clip planes are not applied.

use crate::math::{DAffine3, DVec3, Vec3, corners};
use crate::scene::Description;
use crate::scene::description::{CameraDescription, PictureDefaults, PlacedMesh, Projection};
use smallvec::SmallVec;

/// Width over height of a picture if neither the scene nor the camera sets it.
const DEFAULT_ASPECT: f64 = 16.0 / 9.0;

/// Geometry nearer to a camera than this share of the near plane's distance passes through the camera, and is not
/// reported.
const MIN_DEPTH_SHARE: f64 = 0.01;

/// Maximum number of triangles that are tested for one plane, a tenth of a second. Larger scenes may get no warning.
const MAX_TRIANGLES: usize = 1 << 20;

/// A range of depths from a camera that a clip plane would cut away (m).
struct DepthRange {
    low: f64,
    high: f64,
    /// Depth (m) below which geometry is not reported, because it may pass through the camera.
    min_reported: f64,
}

/// Distances of the clip planes from a camera (m).
#[derive(Clone, Copy)]
pub(super) struct Clip {
    pub(super) near: f32,
    pub(super) far: f32,
}

/// Adds a warning for each camera with visible geometry before its near plane or behind its far plane.
pub(super) fn check(out: &mut Description, clips: &[Clip], bounds: &[(Vec3, Vec3)]) {
    for (camera, clip) in out.cameras.iter().zip(clips) {
        let view = Frustum::new(camera, &out.picture);
        let shown = |range: DepthRange| {
            let mut left = MAX_TRIANGLES;
            out.instances.iter().any(|placed| view.shows(out, placed, bounds, &range, &mut left))
        };
        let (near, far) = (f64::from(clip.near), f64::from(clip.far));
        let before = DepthRange { low: 0.0, high: near, min_reported: MIN_DEPTH_SHARE * near };
        let behind = DepthRange { low: far, high: f64::INFINITY, min_reported: 0.0 };
        let place = format!("camera \"{}\"", camera.name);
        let near = shown(before).then(|| format!("nearer than its znear of {} m", clip.near));
        let far = shown(behind).then(|| format!("farther than its zfar of {} m", clip.far));
        out.warnings.extend(
            [near, far].into_iter().flatten().map(|what| {
                format!("{place}: objects {what} are visible: clip planes are ignored (hide or remove them)")
            }),
        );
    }
}

/// The view frustum of a camera.
struct Frustum {
    to_camera: DAffine3,
    /// Normals and offsets of the sides in camera space: points p with n . p + offset >= 0 are inside. Depth is -z.
    sides: [(DVec3, f64); 4],
}

impl Frustum {
    fn new(camera: &CameraDescription, picture: &PictureDefaults) -> Frustum {
        let resolved = picture.resolution.map(|[width, height]| f64::from(width) / f64::from(height));
        // The scale of a camera's node is ignored.
        let axes = camera.to_world.matrix3;
        let unit = |axis: DVec3| axis.normalize_or_zero();
        let matrix3 = crate::math::DMat3::from_cols(unit(axes.x_axis), unit(axes.y_axis), unit(axes.z_axis));
        let to_camera = DAffine3 { matrix3, ..camera.to_world }.inverse();
        let [x, y] = [DVec3::X, DVec3::Y];
        let sides = match camera.projection {
            // A panorama sees all sides.
            Projection::Equirectangular { .. } | Projection::Fisheye { .. } => [(DVec3::ZERO, 0.0); 4],
            Projection::Perspective { yfov, aspect } => {
                let up = (0.5 * f64::from(yfov)).tan();
                let right = up * resolved.or(aspect.map(f64::from)).unwrap_or(DEFAULT_ASPECT);
                [x, -x, y, -y].map(|n| (n - DVec3::Z * if n.x == 0.0 { up } else { right }, 0.0))
            }
            Projection::Orthographic { xmag, ymag } => {
                [x, -x, y, -y].map(|n| (n, f64::from(if n.x == 0.0 { ymag } else { xmag })))
            }
        };
        Frustum { to_camera, sides }
    }

    /// Whether part of an instance is in view of the camera within a range of depths. `left` is the number of triangles
    /// that may still be tested, and decreases.
    fn shows(
        &self,
        out: &Description,
        placed: &PlacedMesh,
        bounds: &[(Vec3, Vec3)],
        range: &DepthRange,
        left: &mut usize,
    ) -> bool {
        let DepthRange { low, high, min_reported } = *range;
        if high <= low || placed.hidden_from_camera {
            return false;
        }
        let to_camera = self.to_camera * placed.to_world;
        let ends = [(DVec3::NEG_Z, -low), (DVec3::Z, high)];
        let planes = || self.sides.iter().chain(ends.iter().filter(|(_, offset)| offset.is_finite()));
        let outside = |points: &[DVec3]| planes().any(|&(n, offset)| points.iter().all(|&p| n.dot(p) + offset < 0.0));
        let corners = corners(bounds[placed.mesh as usize]);
        if outside(&corners.map(|corner| to_camera.transform_point3(corner.as_dvec3()))) {
            return false;
        }
        let mesh = &out.meshes[placed.mesh as usize];
        let tested = mesh.triangles.len().min(*left);
        *left -= tested;
        let in_camera = |i: u32| to_camera.transform_point3(mesh.positions[i as usize].as_dvec3());
        mesh.triangles[..tested].iter().any(|triangle| {
            let corners = triangle.map(in_camera);
            if outside(&corners) {
                return false;
            }
            let polygon = planes().fold(Polygon::from_slice(&corners), |polygon, plane| clip_polygon(&polygon, plane));
            polygon.len() > 2 && polygon.iter().all(|p| -p.z >= min_reported)
        })
    }
}

/// Corners of a clipped triangle: three, and one more for each of six planes.
type Polygon = SmallVec<[DVec3; 9]>;

/// Clips a convex polygon to the half-space n . p + offset >= 0 \[Sutherland and Hodgman 1974\].
fn clip_polygon(polygon: &[DVec3], &(n, offset): &(DVec3, f64)) -> Polygon {
    let mut kept = Polygon::new();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (a, b) = (n.dot(p) + offset, n.dot(q) + offset);
        if a >= 0.0 {
            kept.push(p);
        }
        if a * b < 0.0 {
            kept.push(p.lerp(q, a / (a - b)));
        }
    }
    kept
}
