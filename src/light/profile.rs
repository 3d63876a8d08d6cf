//! Photometric profiles: the relative intensity of a luminaire, measured at angles around it (IESNA LM-63).

use crate::math::{Mat3, Vec3, atan2_turns};
use std::f32::consts::{FRAC_1_PI, PI};

/// Relative intensity over directions around a pole, interpolated linearly in both angles. Beyond the measured angles it
/// is zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// The transform from the frame of the light to one whose z axis is the pole, and whose x axis is that of the light;
    /// `None` if the axis of the light is the pole.
    to_pole: Option<Mat3>,
    /// Angles to the pole (radians), ascending, from 0 to pi.
    polar: Vec<f32>,
    /// Angles about the pole (turns), ascending. If the axis of the light is the pole, the last is the first plus 1.
    azimuth: Vec<f32>,
    /// Relative intensity, 0 to 1; all polar angles of the first azimuth, then of the next one.
    values: Vec<f32>,
}

/// Polar angle (radians) of a direction, given as 1 minus its cosine.
#[inline]
pub(super) fn polar_angle(one_minus_cos: f32) -> f32 {
    2.0 * (0.5 * one_minus_cos).clamp(0.0, 1.0).sqrt().asin()
}

/// 1 minus the cosine of an angle (radians).
#[inline]
pub(super) fn one_minus_cos_of(angle: f32) -> f32 {
    let sin = (0.5 * angle).sin();
    2.0 * sin * sin
}

/// The interval of ascending `knots` that contains `x`, and the position of `x` in it, 0 to 1. `x` must not be outside.
#[inline]
pub(super) fn interval(knots: &[f32], x: f32) -> (usize, f32) {
    let last = knots.len().saturating_sub(2);
    let i = knots.partition_point(|&knot| knot <= x).saturating_sub(1).min(last);
    let (start, end) = (knots[i], knots[i + 1]);
    (i, ((x - start) / (end - start)).clamp(0.0, 1.0))
}

impl Profile {
    /// A profile of `values` at every pair of a polar angle (radians) and an azimuth (turns), all polar angles of an
    /// azimuth together. The last azimuth is a turn after the first one, with equal values. `None` if no value is
    /// positive, if a value is negative or not finite, or if the angles are not ascending or of the wrong number.
    pub fn new(polar: Vec<f32>, azimuth: Vec<f32>, values: Vec<f32>) -> Option<Profile> {
        Self::about(None, polar, azimuth, values)
    }

    /// The profile of [`Profile::new`] about a pole across the axis of the light, with azimuths from -0.5 to 0.5 turns, 0
    /// along the axis. `to_pole` is an orthogonal transform from the frame of the light to one whose z axis is the pole and
    /// whose x axis is that of the light.
    pub fn about_pole(to_pole: Mat3, polar: Vec<f32>, azimuth: Vec<f32>, values: Vec<f32>) -> Option<Profile> {
        Self::about(Some(to_pole), polar, azimuth, values)
    }

    fn about(to_pole: Option<Mat3>, polar: Vec<f32>, azimuth: Vec<f32>, mut values: Vec<f32>) -> Option<Profile> {
        let ascending = |angles: &[f32]| angles.len() > 1 && angles.windows(2).all(|pair| pair[0] < pair[1]);
        let peak = values.iter().copied().fold(0.0, f32::max);
        let valid = values.iter().all(|x| x.is_finite() && *x >= 0.0) && peak > 0.0;
        let complete = ascending(&polar) && ascending(&azimuth) && values.len() == polar.len() * azimuth.len();
        if !(valid && complete) {
            return None;
        }
        values.iter_mut().for_each(|x| *x /= peak);
        Some(Profile { to_pole, polar, azimuth, values })
    }

    /// Polar angles (radians) of the measurements.
    pub(super) fn polar(&self) -> &[f32] {
        &self.polar
    }

    /// Whether the pole of the angles is across the axis of the light.
    pub(super) fn has_own_pole(&self) -> bool {
        self.to_pole.is_some()
    }

    /// A direction in the frame of the light, in the frame of the pole.
    #[inline]
    pub(super) fn to_pole(&self, d: Vec3) -> Vec3 {
        self.to_pole.map_or(d, |to_pole| to_pole * d)
    }

    /// A direction in the frame of the pole, in the frame of the light.
    #[inline]
    pub(super) fn direction_from_pole(&self, d: Vec3) -> Vec3 {
        self.to_pole.map_or(d, |to_pole| to_pole.transpose() * d)
    }

    /// Azimuths (turns) of the measurements.
    pub(super) fn azimuth(&self) -> &[f32] {
        &self.azimuth
    }

    /// Whether the intensity does not depend on the azimuth.
    pub(super) fn is_symmetric(&self) -> bool {
        let rows = self.values.chunks(self.polar.len());
        rows.clone().zip(rows.skip(1)).all(|(a, b)| a == b)
    }

    /// Range of polar angles (radians) with light.
    pub(super) fn lit(&self) -> [f32; 2] {
        let n = self.polar.len();
        let lit = |i: usize| self.values.iter().skip(i).step_by(n).any(|&x| x > 0.0);
        let (first, last) = ((0..n).find(|&i| lit(i)).unwrap_or(0), (0..n).rfind(|&i| lit(i)).unwrap_or(n - 1));
        [self.polar[first.saturating_sub(1)], self.polar[(last + 1).min(n - 1)]]
    }

    /// Azimuth (turns) of a direction in the frame of the pole, within a turn from the first of the measurements.
    #[inline]
    pub(super) fn turns(&self, d: Vec3) -> f32 {
        let start = self.azimuth[0];
        start + (atan2_turns(d.y, d.x) - start).rem_euclid(1.0)
    }

    /// Relative intensity at a polar angle (radians) and an azimuth (turns).
    #[inline]
    pub(super) fn at(&self, polar: f32, azimuth: f32) -> f32 {
        let n = self.polar.len();
        // A measured end at a pole or at the horizon must not depend on rounding.
        let tolerance = 4.0 * f32::EPSILON * PI;
        let last = self.azimuth[self.azimuth.len() - 1];
        if polar < self.polar[0] - tolerance || polar > self.polar[n - 1] + tolerance || azimuth > last + tolerance {
            return 0.0;
        }
        let (i, x) = interval(&self.polar, polar);
        let (j, y) = interval(&self.azimuth, azimuth);
        let row = |j: usize| {
            let row = &self.values[j * n..(j + 1) * n];
            row[i] + (row[i + 1] - row[i]) * x
        };
        let (a, b) = (row(j), row(j + 1));
        a + (b - a) * y
    }

    /// The ranges of the angles as degrees, for messages: polar angles from the axis.
    pub fn degrees(&self) -> [f32; 2] {
        let n = self.polar.len();
        [self.polar[0], self.polar[n - 1]].map(|angle| angle * 180.0 * FRAC_1_PI)
    }
}
