//! Limits on instance transforms, and on the rays in scenes with instances.
//!
//! Embree transforms rays to the space of an instance in single precision. Coordinates there must not exceed
//! [`MAX_COORDINATE`] either: a library built with assertions aborts the program.

use crate::geometry::{Bounds, MAX_COORDINATE};

/// Least limit on a ray's coordinates: every scene accepts rays with coordinates up to at least this value.
const MIN_RAY_LIMIT: f32 = 1e9;

/// Smallest volume of the parallelepiped that an instance's matrix makes of the axes, scaled to unit length. Below it,
/// rounding errors make the inverse useless.
const MIN_VOLUME: f64 = 1e-4;

/// The largest coordinate of a ray that stays valid in the space of an instance with the matrix `local_to_world`
/// (column-major 3x4). `None` if the matrix is not finite, not invertible, or too extreme for single precision.
pub fn max_ray_coordinate(local_to_world: &[f32; 12], child: Option<Bounds>) -> Option<f32> {
    if !local_to_world.iter().all(|x| x.is_finite()) {
        return None;
    }
    let m = local_to_world.map(f64::from);
    let column = |k: usize| [m[k], m[k + 1], m[k + 2]];
    let [x, y, z, move_by] = [column(0), column(3), column(6), column(9)];
    let determinant = dot(x, cross(y, z));
    let lengths = [x, y, z].map(|v| dot(v, v).sqrt()).iter().product::<f64>();
    // Embree computes the determinant in f32. This form rejects NaN.
    let regular = (determinant as f32).is_normal() && determinant.abs() >= MIN_VOLUME * lengths;
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
    // For each row of the inverse, |local| <= sum |row| * |ray| + |row . translation|. Half of the range is left for
    // rounding errors.
    let rows = [cross(y, z), cross(z, x), cross(x, y)].map(|v| v.map(|a| a / determinant));
    let bound = |row: [f64; 3]| (0.5 * max - dot(row, move_by).abs()) / row.iter().map(|a| a.abs()).sum::<f64>();
    let limit = rows.into_iter().map(bound).fold(max, f64::min) as f32;
    (limit >= MIN_RAY_LIMIT).then_some(limit)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
