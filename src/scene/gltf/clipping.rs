//! Clip planes of cameras (specification, section 3.10.3): they are not applied, so a camera shows what it should not
//! where something is before or behind them.

use crate::math::{DAffine3, DVec3};
use crate::scene::Description;
use crate::scene::description::{CameraDescription, Picture, Placed, Projection};

/// Aspect ratio of a picture whose shape nothing says.
const USUAL_ASPECT: f64 = 16.0 / 9.0;

/// What is nearer to a camera, in parts of its near plane's distance, goes through the camera itself.
const THROUGH: f64 = 0.01;

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
        let shown = |span: Span| out.instances.iter().any(|placed| view.shows(out, placed, bounds, &span));
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
    fn new(camera: &CameraDescription, picture: &Picture) -> View {
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

    /// Whether some of a placed mesh is in view at such a depth.
    fn shows(&self, out: &Description, placed: &Placed, bounds: &[(DVec3, DVec3)], span: &Span) -> bool {
        let Span { low, high, least: nearest } = *span;
        let to_camera = self.to_camera * placed.to_world;
        let (least, most) = bounds[placed.mesh as usize];
        let corner = |i: usize| DVec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), least, most);
        let depths = (0..8).map(|i| -to_camera.transform_point3(corner(i)).z);
        let (first, last) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
        if high <= low || placed.hidden_from_camera || last <= low || first >= high {
            return false;
        }
        let mesh = &out.meshes[placed.mesh as usize];
        let place = |i: u32| to_camera.transform_point3(mesh.positions[i as usize].as_dvec3());
        let ends = [(DVec3::NEG_Z, -low), (DVec3::Z, high)];
        mesh.triangles.iter().any(|triangle| {
            let planes = self.sides.iter().chain(ends.iter().filter(|(_, offset)| offset.is_finite()));
            let polygon = planes.fold(triangle.map(place).to_vec(), |polygon, plane| cut(&polygon, plane));
            polygon.len() > 2 && polygon.iter().all(|p| -p.z >= nearest)
        })
    }
}

/// The part of a convex polygon with n . p + offset >= 0 \[Sutherland and Hodgman 1974\].
fn cut(polygon: &[DVec3], &(n, offset): &(DVec3, f64)) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
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
