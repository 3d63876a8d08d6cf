//! Which instance transforms can be traced, and with which rays.
//!
//! Embree carries rays into the instance's space by the inverse matrix, in single precision, and takes only
//! coordinates up to [`MAX_COORDINATE`] there too: a library built with assertions aborts the program on others.

use crate::geometry::{Bounds, MAX_COORDINATE};

/// Every scene takes rays with coordinates at least this large.
const LEAST_REACH: f32 = 1e9;

/// Least volume of the parallelepiped of the unit axes' images, scaled to unit length. Below, rounding makes the
/// inverse meaningless.
const LEAST_VOLUME: f64 = 1e-4;

/// The largest coordinate of a ray's origin and direction that stays valid in the instance's space. None if the
/// matrix (column-major 3x4) is not finite, not invertible, or too extreme for single precision.
pub fn reach(local_to_world: &[f32; 12], child: Option<Bounds>) -> Option<f32> {
    if !local_to_world.iter().all(|x| x.is_finite()) {
        return None;
    }
    let m = local_to_world.map(f64::from);
    let column = |k: usize| [m[k], m[k + 1], m[k + 2]];
    let [x, y, z, move_by] = [column(0), column(3), column(6), column(9)];
    let determinant = dot(x, cross(y, z));
    let lengths = [x, y, z].map(|v| dot(v, v).sqrt()).iter().product::<f64>();
    // Embree forms the determinant in f32; written so that NaN fails.
    let regular = (determinant as f32).is_normal() && determinant.abs() >= LEAST_VOLUME * lengths;
    if !regular {
        return None;
    }
    let max = f64::from(MAX_COORDINATE);
    let far = child.is_some_and(|Bounds { min, max: top }| {
        let extent: [f64; 3] = std::array::from_fn(|k| f64::from(min[k].abs().max(top[k].abs())));
        (0..3).any(|k| {
            m[k].abs() * extent[0] + m[3 + k].abs() * extent[1] + m[6 + k].abs() * extent[2] + move_by[k].abs() > max
        })
    });
    if far {
        return None;
    }
    // Each row of the inverse gives |local| <= sum |row| * |ray| + |moved|; half is left to rounding.
    let rows = [cross(y, z), cross(z, x), cross(x, y)].map(|v| v.map(|a| a / determinant));
    let bound = |row: [f64; 3]| (0.5 * max - dot(row, move_by).abs()) / row.iter().map(|a| a.abs()).sum::<f64>();
    let reach = rows.into_iter().map(bound).fold(max, f64::min) as f32;
    (reach >= LEAST_REACH).then_some(reach)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
