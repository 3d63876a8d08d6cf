//! The cone of a spot: the falloff of its intensity, and its solid angle.

use crate::math::sqr;
use std::f32::consts::TAU;

/// Falloff of a spot's intensity across its edge, as a function of a ramp that is linear in the cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotEdge {
    /// The square of the ramp, as KHR_lights_punctual recommends.
    #[default]
    Squared,
    /// The smoothstep of the ramp, 3 t^2 - 2 t^3, as in Blender.
    Smooth,
}

impl SpotEdge {
    #[inline]
    fn falloff(self, ramp: f32) -> f32 {
        match self {
            SpotEdge::Squared => sqr(ramp),
            SpotEdge::Smooth => sqr(ramp) * (3.0 - 2.0 * ramp),
        }
    }

    /// Mean of the falloff over the edge, as the ramp goes from 0 to 1.
    #[inline]
    pub(super) fn mean(self) -> f32 {
        match self {
            SpotEdge::Squared => 1.0 / 3.0,
            SpotEdge::Smooth => 0.5,
        }
    }

    /// Inverse of the falloff's normalised integral: the ramp, 0 to 1, below which `share` (0 to 1) of the light in the
    /// edge lies.
    #[inline]
    pub(super) fn ramp(self, share: f32) -> f32 {
        match self {
            SpotEdge::Squared => share.cbrt(),
            SpotEdge::Smooth => {
                // Newton's iteration for 2 t^3 - t^4 = share. The function is convex, so the iteration decreases to
                // the root after its first step.
                let mut t = (0.5 * share).cbrt();
                for _ in 0..5 {
                    let slope = t * t * (6.0 - 4.0 * t);
                    if slope > 0.0 {
                        t = (t - (t * t * t * (2.0 - t) - share) / slope).min(1.0);
                    }
                }
                t
            }
        }
    }
}

/// Intensity of a spot relative to the intensity on its axis, 0 to 1. The angle to the axis and both edges are given as
/// 1 minus the cosine.
#[inline]
pub fn spot_falloff(one_minus_cos: f32, inner: f32, outer: f32, edge: SpotEdge) -> f32 {
    if one_minus_cos <= inner {
        1.0
    } else if one_minus_cos >= outer {
        0.0
    } else {
        edge.falloff((outer - one_minus_cos) / (outer - inner))
    }
}

/// Integral of [`spot_falloff`] over all directions (sr): the spot's flux over its intensity on the axis.
#[inline]
pub fn spot_solid_angle(inner: f32, outer: f32, edge: SpotEdge) -> f32 {
    TAU * (inner + (outer - inner) * edge.mean())
}
