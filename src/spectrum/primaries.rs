//! Primaries and white points of linear RGB. The program computes in linear Rec. 709.

use crate::math::{DMat3, DVec3};
use exr::math::Vec2;
use exr::meta::attribute::Chromaticities;

/// Rec. 709 (sRGB primaries, D65).
pub const REC_709: Chromaticities =
    Chromaticities { red: Vec2(0.64, 0.33), green: Vec2(0.3, 0.6), blue: Vec2(0.15, 0.06), white: Vec2(0.3127, 0.329) };
/// AP1 and the white of ACES (SMPTE ST 2065-1, Academy S-2014-004).
pub const AP1: Chromaticities = Chromaticities {
    red: Vec2(0.713, 0.293),
    green: Vec2(0.165, 0.83),
    blue: Vec2(0.128, 0.044),
    white: Vec2(0.32168, 0.33767),
};

/// The matrix from the linear RGB of these chromaticities to Rec. 709; `None` if they are those of Rec. 709 or define no
/// colour space.
pub fn to_rec_709(declared: &Chromaticities) -> Option<DMat3> {
    if close(declared, &REC_709) { None } else { conversion(declared, &REC_709) }
}

/// Whether two colour spaces are the same up to the rounding of tables.
fn close(a: &Chromaticities, b: &Chromaticities) -> bool {
    let near = |a: Vec2<f32>, b: Vec2<f32>| (a.0 - b.0).abs() < 1e-3 && (a.1 - b.1).abs() < 1e-3;
    near(a.red, b.red) && near(a.green, b.green) && near(a.blue, b.blue) && near(a.white, b.white)
}

/// The matrix from one linear RGB to another, with the Bradford adaptation of white; `None` if the chromaticities
/// define no colour space.
pub fn conversion(from: &Chromaticities, to: &Chromaticities) -> Option<DMat3> {
    // Responses of the cones, by columns: the Bradford transform.
    let cones = DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    let (old, new) = (cones * xyz(from.white), cones * xyz(to.white));
    let adapted = cones.inverse() * DMat3::from_diagonal(new / old) * cones;
    let matrix = to_xyz(to).inverse() * adapted * to_xyz(from);
    matrix.is_finite().then_some(matrix)
}

/// CIE XYZ of a chromaticity at luminance 1.
fn xyz(Vec2(x, y): Vec2<f32>) -> DVec3 {
    let (x, y) = (f64::from(x), f64::from(y));
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// The matrix from linear RGB to CIE XYZ: white is the sum of the primaries.
fn to_xyz(space: &Chromaticities) -> DMat3 {
    let primaries = DMat3::from_cols(xyz(space.red), xyz(space.green), xyz(space.blue));
    primaries * DMat3::from_diagonal(primaries.inverse() * xyz(space.white))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published matrix from linear Rec. 709 to ACEScg with Bradford adaptation, to the six digits of tables.
    #[test]
    fn rec_709_to_acescg_equals_the_published_matrix() {
        let published =
            [[0.613_097, 0.339_523, 0.047_379], [0.070_194, 0.916_354, 0.013_452], [0.020_616, 0.109_570, 0.869_815]];
        let matrix = conversion(&REC_709, &AP1).expect("both are colour spaces");
        for (row, wanted) in published.into_iter().enumerate() {
            for (column, wanted) in wanted.into_iter().enumerate() {
                assert!((matrix.col(column)[row] - wanted).abs() < 2e-5, "{row} {column}: {matrix}");
            }
        }
    }
}
