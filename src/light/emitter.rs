//! One light source and the densities that belong to it.

use super::{Environment, Spread};
use crate::geometry::{Shapes, triangle_error};
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4, luminance, sqr, warp};
use std::f32::consts::{PI, TAU};

/// How far the points of a triangle, given by a corner and the edges to the others, may be off (scene units).
#[inline]
pub(super) fn position_error(&[corner, a, b]: &[Vec3; 3]) -> f32 {
    triangle_error([corner, corner + a, corner + b])
}

/// A light source. The set is closed: a scene's lights are one flat list.
#[derive(Clone, Debug)]
pub enum Emitter {
    /// A triangle of an emissive material.
    Triangle {
        /// Instance it belongs to.
        instance: u32,
        /// Triangle in the instance's mesh.
        primitive: u32,
        /// Area (m2).
        area: f32,
        /// Emits from both sides.
        two_sided: bool,
        /// Mean emitted radiance.
        radiance: Rgb,
        /// How it falls off with the angle.
        spread: Spread,
        /// Unit normal of its front and the plane's distance from the origin along it. This and the next are here so
        /// that light sampling, which asks every time, finds all it needs in one place.
        plane: Vec4,
        /// A corner, and the edges to the others (m).
        corners: [Vec3; 3],
        /// It looks the same all over: what it emits everywhere is `radiance`.
        plain: bool,
    },
    /// A mathematical point.
    Point {
        /// Position.
        p: Vec3,
        /// Radiant intensity (W/sr).
        intensity: Rgb,
    },
    /// What shines into a cone with an edge, from a point, or alike from every point of a disc across its axis that no
    /// ray can hit.
    Spot {
        /// Position; the middle of the disc.
        p: Vec3,
        /// Radius of the disc (m); 0 is a mathematical point.
        radius: f32,
        /// Frame whose normal is the axis, in the direction of the light.
        frame: Frame,
        /// Radiant intensity on the axis (W/sr).
        intensity: Rgb,
        /// 1 - cos of the half angle of full intensity: a narrow one's cosine has no digits left.
        inner: f32,
        /// 1 - cos of the half angle of no intensity, which is greater.
        outer: f32,
        /// How it falls off between them.
        edge: SpotEdge,
    },
    /// Light from a small cone of directions at infinity.
    Sun {
        /// Frame whose normal points towards the sun.
        frame: Frame,
        /// Irradiance on a surface that faces it (W/m2).
        irradiance: Rgb,
        /// 1 - cos of the half angle; 0 is exactly parallel light.
        one_minus_cos: f32,
        /// Cameras do not see its disc.
        hidden_from_camera: bool,
    },
    /// The environment.
    Environment,
}

/// The sphere that holds the scene, and what shines on it from infinity.
#[derive(Clone, Debug)]
pub struct Sky {
    /// Centre of the scene's bounding sphere.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
    /// The environment, if any.
    pub environment: Option<Environment>,
    /// Cameras do not see it.
    pub hidden_from_camera: bool,
}

/// How a spot's intensity falls across its edge, as a function of a ramp that is linear in the cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotEdge {
    /// The ramp's square: what KHR_lights_punctual recommends.
    #[default]
    Squared,
    /// Its smoothstep, 3 t^2 - 2 t^3: Blender's.
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

    /// Mean over the ramp.
    #[inline]
    pub(super) fn mean(self) -> f32 {
        match self {
            SpotEdge::Squared => 1.0 / 3.0,
            SpotEdge::Smooth => 0.5,
        }
    }

    /// The ramp below which a share of the light in the edge lies.
    #[inline]
    pub(super) fn ramp(self, share: f32) -> f32 {
        match self {
            SpotEdge::Squared => share.cbrt(),
            SpotEdge::Smooth => {
                // Newton's iteration for 2 t^3 - t^4 = share, which is convex: after its first step it comes down to
                // the root.
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

/// A spot's intensity against that on its axis, at an angle to it; of it and of the borders 1 - cos is told.
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

/// Solid angle that a spot fills, what its edge dims counted in part.
#[inline]
pub fn spot_solid_angle(inner: f32, outer: f32, edge: SpotEdge) -> f32 {
    TAU * (inner + (outer - inner) * edge.mean())
}

/// Where on its disc a spot at `p` shines from.
#[inline]
pub fn spot_point(p: Vec3, radius: f32, frame: &Frame, u: Vec2) -> Vec3 {
    if radius == 0.0 {
        return p;
    }
    let on = warp::disc_concentric(u) * radius;
    p + frame.t * on.x + frame.b * on.y
}

impl Emitter {
    /// Emitted flux (W) as a luminance: what the choice of lights is proportional to. For light from infinity, the flux
    /// through the scene's bounding sphere.
    pub fn power(&self, sky: &Sky) -> f64 {
        // In f64, which no light overflows: what is infinitely strong would never be chosen.
        const PI: f64 = std::f64::consts::PI;
        let radius = f64::from(sky.radius);
        let (sphere, disc) = (4.0 * PI, PI * radius * radius);
        let light = |rgb: Rgb| f64::from(luminance(rgb));
        match self {
            Emitter::Triangle { area, two_sided, radiance, .. } => {
                light(*radiance) * f64::from(*area) * PI * if *two_sided { 2.0 } else { 1.0 }
            }
            Emitter::Point { intensity, .. } => light(*intensity) * sphere,
            Emitter::Spot { intensity, inner, outer, edge, .. } => {
                light(*intensity) * f64::from(spot_solid_angle(*inner, *outer, *edge))
            }
            Emitter::Sun { irradiance, .. } => light(*irradiance) * disc,
            Emitter::Environment => sky.environment.as_ref().map_or(0.0, |e| light(e.mean())) * sphere * disc,
        }
    }

    /// A point of the light, just before its front; `None` for light from infinity.
    pub fn anywhere(&self, shapes: &Shapes) -> Option<Vec3> {
        match self {
            Emitter::Triangle { instance, primitive, .. } => {
                shapes.surface(*instance, *primitive, [1.0 / 3.0, 1.0 / 3.0]).map(|s| s.ray_origin(s.ng))
            }
            Emitter::Point { p, .. } | Emitter::Spot { p, .. } => Some(*p),
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// No ray that is not aimed at it can find it.
    pub fn is_delta(&self) -> bool {
        match self {
            Emitter::Point { .. } | Emitter::Spot { .. } => true,
            Emitter::Sun { one_minus_cos, .. } => *one_minus_cos == 0.0,
            Emitter::Triangle { .. } | Emitter::Environment => false,
        }
    }

    /// Its light comes from infinity.
    pub fn is_infinite(&self) -> bool {
        matches!(self, Emitter::Sun { .. } | Emitter::Environment)
    }

    /// Radiance of a sun of finite size.
    #[inline]
    pub fn sun_radiance(irradiance: Rgb, one_minus_cos: f32) -> Rgb {
        // E = integral of L cos over the cone = L pi sin^2, and sin^2 = h (2 - h) with h = 1 - cos.
        irradiance / (PI * one_minus_cos * (2.0 - one_minus_cos))
    }
}
