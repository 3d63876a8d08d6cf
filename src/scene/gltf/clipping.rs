//! Clip planes of cameras (specification, section 3.10.3): they are not applied, so a camera shows what it should not
//! where something is before or behind them.

use crate::math::{DAffine3, DVec3};
use crate::scene::Description;
use crate::scene::description::{CameraDescription, PictureDefaults, PlacedMesh, Projection};
use smallvec::SmallVec;

/// Aspect ratio of a picture whose shape nothing says.
const USUAL_ASPECT: f64 = 16.0 / 9.0;

/// What is nearer to a camera, in parts of its near plane's distance, goes through the camera itself.
const THROUGH: f64 = 0.01;

/// Triangles that are looked at for one plane: a tenth of a second. A scene that has more before them is not warned of.
const MOST_TRIANGLES: usize = 1 << 20;

/// A range of depths (m), of which nothing that is shown is nearer than `least`.
struct Span {
    low: f64,
    high: f64,
    least: f64,
}

/// The clip planes of a camera (m from it).
#[derive(Clone, Copy)]
pub(super) struct Clip {
    pub(super) near: f32,
    pub(super) far: f32,
}

/// Warns of each camera that has something in view before its near or behind its far plane.
pub(super) fn check(out: &mut Description, clips: &[Clip], bounds: &[(DVec3, DVec3)]) {
    for (camera, clip) in out.cameras.iter().zip(clips) {
        let view = View::new(camera, &out.picture);
        let shown = |span: Span| {
            let mut left = MOST_TRIANGLES;
            out.instances.iter().any(|placed| view.shows(out, placed, bounds, &span, &mut left))
        };
        let (near, far) = (f64::from(clip.near), f64::from(clip.far));
        let before = Span { low: 0.0, high: near, least: THROUGH * near };
        let behind = Span { low: far, high: f64::INFINITY, least: 0.0 };
        let place = format!("camera \"{}\"", camera.name);
        let near = shown(before).then(|| format!("nearer than its znear of {} m", clip.near));
        let far = shown(behind).then(|| format!("farther than its zfar of {} m", clip.far));
        out.warnings.extend([near, far].into_iter().flatten().map(|what| {
            format!("{place}: what is {what} is shown all the same: clip planes are ignored (hide or remove it)")
        }));
    }
}

/// What a camera sees: points p in its space, depth along -z, with n . p >= 0 for each of four normals and offsets.
struct View {
    to_camera: DAffine3,
    sides: [(DVec3, f64); 4],
}

impl View {
    fn new(camera: &CameraDescription, picture: &PictureDefaults) -> View {
        let resolved = picture.resolution.map(|[width, height]| f64::from(width) / f64::from(height));
        // Unit vectors: a camera has no size.
        let axes = camera.to_world.matrix3;
        let unit = |axis: DVec3| axis.normalize_or_zero();
        let matrix3 = crate::math::DMat3::from_cols(unit(axes.x_axis), unit(axes.y_axis), unit(axes.z_axis));
        let to_camera = DAffine3 { matrix3, ..camera.to_world }.inverse();
        let [x, y] = [DVec3::X, DVec3::Y];
        let sides = match camera.projection {
            Projection::Perspective { yfov, aspect } => {
                let up = (0.5 * f64::from(yfov)).tan();
                let right = up * resolved.or(aspect.map(f64::from)).unwrap_or(USUAL_ASPECT);
                [x, -x, y, -y].map(|n| (n - DVec3::Z * if n.x == 0.0 { up } else { right }, 0.0))
            }
            Projection::Orthographic { xmag, ymag } => {
                [x, -x, y, -y].map(|n| (n, f64::from(if n.x == 0.0 { ymag } else { xmag })))
            }
        };
        View { to_camera, sides }
    }

    /// Whether some of a placed mesh is in view at such a depth; `left` counts down the triangles that are looked at.
    fn shows(
        &self,
        out: &Description,
        placed: &PlacedMesh,
        bounds: &[(DVec3, DVec3)],
        span: &Span,
        left: &mut usize,
    ) -> bool {
        let Span { low, high, least: nearest } = *span;
        if high <= low || placed.hidden_from_camera {
            return false;
        }
        let to_camera = self.to_camera * placed.to_world;
        let ends = [(DVec3::NEG_Z, -low), (DVec3::Z, high)];
        let planes = || self.sides.iter().chain(ends.iter().filter(|(_, offset)| offset.is_finite()));
        let outside = |points: &[DVec3]| planes().any(|&(n, offset)| points.iter().all(|&p| n.dot(p) + offset < 0.0));
        let (least, most) = bounds[placed.mesh as usize];
        let corner = |i: usize| DVec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), least, most);
        if outside(&std::array::from_fn::<_, 8, _>(|i| to_camera.transform_point3(corner(i)))) {
            return false;
        }
        let mesh = &out.meshes[placed.mesh as usize];
        let looked_at = mesh.triangles.len().min(*left);
        *left -= looked_at;
        let place = |i: u32| to_camera.transform_point3(mesh.positions[i as usize].as_dvec3());
        mesh.triangles[..looked_at].iter().any(|triangle| {
            let corners = triangle.map(place);
            if outside(&corners) {
                return false;
            }
            let polygon = planes().fold(Polygon::from_slice(&corners), |polygon, plane| cut(&polygon, plane));
            polygon.len() > 2 && polygon.iter().all(|p| -p.z >= nearest)
        })
    }
}

/// Corners: three, and one more for each plane.
type Polygon = SmallVec<[DVec3; 9]>;

/// The part of a convex polygon with n . p + offset >= 0 \[Sutherland and Hodgman 1974\].
fn cut(polygon: &[DVec3], &(n, offset): &(DVec3, f64)) -> Polygon {
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
