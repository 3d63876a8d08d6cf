//! Curves of an animation: keys over time, and interpolation between them (specification, section 3.11 and appendix C).

use super::document::{Document, get};
use super::fault;
use crate::error::Result;
use serde::Deserialize;

const DAMAGED: &str = "the file is damaged: export the animation again";

/// An animation sampler in the file.
#[derive(Deserialize)]
pub(super) struct Sampler {
    input: usize,
    output: usize,
    #[serde(default)]
    interpolation: Interpolation,
}

#[derive(Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Interpolation {
    Step,
    #[default]
    Linear,
    CubicSpline,
}

/// An animated value over time: keys at increasing times, and the interpolation between them.
pub(super) struct Curve {
    /// Times of the keys (seconds).
    times: Vec<f32>,
    /// For each key, `width` numbers of its value; for splines the in-tangent, the value and the out-tangent.
    values: Vec<f32>,
    /// Number of components of a value.
    pub(super) width: usize,
    interpolation: Interpolation,
}

impl Curve {
    /// Reads the curve of a sampler.
    ///
    /// # Errors
    /// Times do not increase, a number is not finite, or the number of values does not fit the number of keys.
    pub(super) fn read(document: &Document, sampler: &Sampler) -> Result<Curve> {
        let input = |e: crate::error::Error| e.within("input");
        let times: Vec<f32> = document.floats::<1>(sampler.input).map_err(input)?.into_iter().flatten().collect();
        let values = flat(document, sampler.output).map_err(|e| e.within("output"))?;
        if times.is_empty() {
            return Err(fault("input", "it has no key").hint(DAMAGED));
        }
        if let Some(i) = times.iter().position(|t| !(t.is_finite() && *t >= 0.0)) {
            return Err(fault("input", format!("the time of key {i} is {} s", times[i])).hint(DAMAGED));
        }
        if let Some(i) = times.windows(2).position(|w| w[0] >= w[1]) {
            let cause = format!("keys {i} and {} are at {} s and {} s: times must grow", i + 1, times[i], times[i + 1]);
            return Err(fault("input", cause).hint(DAMAGED));
        }
        let slots = times.len() * sampler.interpolation.slots();
        if values.is_empty() || !values.len().is_multiple_of(slots) {
            let cause = format!("{} numbers cannot be shared out among {slots} values", values.len());
            return Err(fault("output", cause).hint(DAMAGED));
        }
        if let Some(i) = values.iter().position(|x| !x.is_finite()) {
            let width = values.len() / times.len();
            return Err(fault("output", format!("key {} has a value that is not finite", i / width)).hint(DAMAGED));
        }
        Ok(Curve { width: values.len() / slots, times, values, interpolation: sampler.interpolation })
    }

    /// Time of the first key of the curve (seconds).
    pub(super) fn start(&self) -> f64 {
        f64::from(self.times[0])
    }

    /// Whether the value is the same at all times.
    pub(super) fn is_constant(&self) -> bool {
        let slots = self.interpolation.slots();
        let first = self.value(0);
        let is_flat = |key: usize| {
            let tangents = (0..slots).filter(|slot| *slot != slots / 2).flat_map(|slot| self.slot(key, slot));
            self.value(key) == first && (self.times.len() == 1 || tangents.into_iter().all(|x| x == 0.0))
        };
        (0..self.times.len()).all(is_flat)
    }

    /// The curve's value at a time (seconds), clamped to the first and last key. `rotation`: values are unit
    /// quaternions.
    pub(super) fn value_at(&self, time: f64, rotation: bool) -> Vec<f64> {
        // Files have times in f32, so a time that equals a key's time up to rounding counts as the key's.
        let after = self.times.partition_point(|key| f64::from(*key) <= time + 1e-6 * time.max(1.0));
        let Some(k) = after.checked_sub(1) else { return self.value(0) };
        if after == self.times.len() || self.interpolation == Interpolation::Step {
            return self.value(k);
        }
        let [start, end] = [k, after].map(|key| f64::from(self.times[key]));
        let (step, s) = (end - start, ((time - start) / (end - start)).max(0.0));
        match self.interpolation {
            Interpolation::CubicSpline => {
                let value = self.spline(k, step, s);
                if rotation { quaternion(&value).map_or(value, |unit| unit.to_array().to_vec()) } else { value }
            }
            _ => {
                let (from, to) = (self.value(k), self.value(after));
                match (rotation, quaternion(&from), quaternion(&to)) {
                    (true, Some(from), Some(to)) => from.slerp(to, s).to_array().to_vec(),
                    _ => from.iter().zip(&to).map(|(a, b)| a + (b - a) * s).collect(),
                }
            }
        }
    }

    /// The value of the key with this index, without tangents.
    fn value(&self, key: usize) -> Vec<f64> {
        self.slot(key, self.interpolation.slots() / 2)
    }

    fn slot(&self, key: usize, slot: usize) -> Vec<f64> {
        let start = (key * self.interpolation.slots() + slot) * self.width;
        self.values[start..start + self.width].iter().map(|x| f64::from(*x)).collect()
    }

    /// Cubic Hermite interpolation between key `k` and the next key, `step` seconds later, at parameter `s` in [0, 1]
    /// (appendix C.5).
    fn spline(&self, k: usize, step: f64, s: f64) -> Vec<f64> {
        let (s2, s3) = (s * s, s * s * s);
        let parts = [
            (self.value(k), 2.0 * s3 - 3.0 * s2 + 1.0),
            (self.slot(k, 2), step * (s3 - 2.0 * s2 + s)),
            (self.value(k + 1), 3.0 * s2 - 2.0 * s3),
            (self.slot(k + 1, 0), step * (s3 - s2)),
        ];
        (0..self.width).map(|i| parts.iter().map(|(value, weight)| value[i] * weight).sum()).collect()
    }
}

impl Interpolation {
    /// Number of values that the file stores per key: 3 for splines (in-tangent, value, out-tangent), otherwise 1.
    fn slots(self) -> usize {
        if self == Interpolation::CubicSpline { 3 } else { 1 }
    }
}

fn quaternion(value: &[f64]) -> Option<glam::DQuat> {
    let four = <[f64; 4]>::try_from(value).ok()?;
    glam::DVec4::from_array(four).try_normalize().map(glam::DQuat::from_vec4)
}

/// All numbers of the accessor with this index, one after the other, for elements of any width.
fn flat(document: &Document, index: usize) -> Result<Vec<f32>> {
    get(&document.accessors, index, "accessor")?;
    Ok(match document.width(index)? {
        1 => document.floats::<1>(index)?.into_flattened(),
        2 => document.floats::<2>(index)?.into_flattened(),
        3 => document.floats::<3>(index)?.into_flattened(),
        _ => document.floats::<4>(index)?.into_flattened(),
    })
}
