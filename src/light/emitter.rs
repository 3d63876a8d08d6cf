//! One light source, and its power.

use super::bulb::{Bulb, ball_point};
use super::spot::{SpotEdge, spot_solid_angle};
use super::{Distribution, Environment, Spread};
use crate::geometry::{Shapes, triangle_error};
use crate::material::{EmissionGrid, Materials, MediumGrids};
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4, bounding_box, corners, luminance, warp};
use glam::Affine3A;
use std::f32::consts::PI;
use std::sync::Arc;

/// Bound on the rounding error of points on a triangle (m), given by a corner and the edges to the other corners.
#[inline]
pub(super) fn position_error(&[corner, a, b]: &[Vec3; 3]) -> f32 {
    triangle_error([corner, corner + a, corner + b])
}

/// A triangle of an emissive material, which emits light from one side or from both.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleLight {
    /// Index of the instance (the object) that the triangle belongs to.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh.
    pub primitive: u32,
    /// Area (m2).
    pub area: f32,
    /// Whether both sides emit.
    pub two_sided: bool,
    /// Emitted radiance (W/m2/sr), averaged over the triangle and over directions.
    pub radiance: Rgb,
    /// How the radiance depends on the direction.
    pub spread: Spread,
    /// Unit normal of the front side (xyz), and distance of the triangle's plane from the origin along it (w).
    /// `plane` and `corners` are copies, so that light sampling finds all data in one place.
    pub plane: Vec4,
    /// One corner, and the edges from it to the other two (m).
    pub corners: [Vec3; 3],
    /// Bound on the rounding error of points on the triangle (m).
    pub error: f32,
    /// Whether every point of the triangle emits `radiance`; false if a texture, for example, varies it.
    pub uniform: bool,
}

impl TriangleLight {
    /// Unit normal of the front side.
    #[inline]
    pub(super) fn normal(&self) -> Vec3 {
        self.plane.truncate()
    }

    /// The point with barycentric coordinates `b` of the second and the third corner (m).
    #[inline]
    pub(super) fn point(&self, b: Vec2) -> Vec3 {
        let [corner, first, second] = self.corners;
        corner + first * b.x + second * b.y
    }

    /// Radiance (W/m2/sr), averaged over directions, at the point with barycentric coordinates `b`. `None` if the triangle
    /// has no area.
    #[inline(always)]
    pub(super) fn radiance_at(&self, shapes: &Shapes, materials: &Materials, b: Vec2) -> Option<Rgb> {
        if self.uniform { Some(self.radiance) } else { self.textured_radiance(shapes, materials, b) }
    }

    /// [`TriangleLight::radiance_at`] a point of a triangle whose emission varies. Not inlined, so that the common case,
    /// uniform emission, stays small.
    #[cold]
    #[inline(never)]
    fn textured_radiance(&self, shapes: &Shapes, materials: &Materials, b: Vec2) -> Option<Rgb> {
        let light = shapes.surface(self.instance, self.primitive, [b.x, b.y])?;
        let material = &materials.list[light.material as usize];
        // Rays pass through cut-outs, so light samples must do so, too.
        Some(material.emitted(&light, &materials.textures) * material.coverage(&light, &materials.textures))
    }
}

/// A point or a spot whose intensity has a distribution of its own over directions, such as a photometric profile. It
/// shines from a point, or from a ball that no ray can hit.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapedLight {
    /// Position of the point, or of the ball's centre (m).
    pub p: Vec3,
    /// Radius of the ball that emits (m); 0 makes the light a mathematical point.
    pub radius: f32,
    /// Frame of the distribution; its normal is the axis, pointing in the direction of the emitted light.
    pub frame: Frame,
    /// Radiant intensity in a direction of relative intensity 1 (W/sr).
    pub intensity: Rgb,
    /// Relative intensity by direction.
    pub distribution: Arc<Distribution>,
    /// The ball, if camera paths see it.
    pub bulb: Option<Bulb>,
}

impl ShapedLight {
    /// Samples a point of the ball by the uniform point `u`. From every side, the ball looks like a uniform disc.
    #[inline]
    pub fn point(&self, u: Vec2) -> Vec3 {
        ball_point(self.p, self.radius, u)
    }

    /// Radiant intensity along a unit direction (W/sr).
    #[inline]
    pub(super) fn intensity_along(&self, d: Vec3) -> Rgb {
        self.intensity * self.distribution.relative(self.frame.to_local(d))
    }

    /// Density per solid angle with which light paths leave along a unit direction.
    #[inline]
    pub(super) fn pdf_w(&self, d: Vec3) -> f32 {
        self.distribution.pdf_w(self.frame.to_local(d))
    }
}

/// The light that the medium in an object emits. Its points count as lights without size: no ray can hit one.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeLight {
    /// Index of the instance (the object) with the medium.
    pub instance: u32,
    /// The grids of the medium, with its emission.
    pub grids: Arc<MediumGrids>,
    /// Transform from the space of the object to world space.
    pub to_world: Affine3A,
}

impl VolumeLight {
    /// The emission of the medium; the light has one.
    fn emission(&self) -> Option<&EmissionGrid> {
        self.grids.emission.as_ref()
    }

    /// Volume of the grid's box (m3).
    fn volume(&self) -> f32 {
        let extent = self.emission().map_or(Vec3::ZERO, |emission| {
            let [low, high] = emission.grid().bounds();
            high - low
        });
        extent.element_product() * self.to_world.matrix3.determinant().abs()
    }

    /// Intensity of the whole light in each direction (W/sr), without absorption.
    pub fn intensity(&self) -> Rgb {
        self.emission().map_or(Rgb::ZERO, EmissionGrid::mean) * self.volume()
    }

    /// Samples a point by the uniform point `u`. Returns the point and its intensity over its density (W/sr).
    pub(super) fn sample(&self, u: Vec2) -> Option<(Vec3, Rgb)> {
        let emission = self.emission()?;
        let (cells, pdf) = emission.sample(u);
        let ([low, high], size) = (emission.grid().bounds(), emission.grid().size().map(|n| n as f32));
        let p = low + (high - low) * cells / Vec3::from_array(size);
        let cell = self.volume() / Vec3::from_array(size).element_product();
        Some((self.to_world.transform_point3(p), emission.at(cells) * (cell / pdf)))
    }

    /// Bounding box in world space.
    pub(super) fn bounds(&self) -> [Vec3; 2] {
        let own = self.emission().map_or([Vec3::ZERO; 2], |emission| emission.grid().bounds());
        bounding_box(corners(own.into()).map(|corner| self.to_world.transform_point3(corner))).into()
    }
}

/// A light source. The scene has one flat list of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A triangle of an emissive material.
    Triangle(TriangleLight),
    /// A point light, of no size, that shines equally in all directions.
    Point {
        /// Position (m).
        p: Vec3,
        /// Radiant intensity (W/sr).
        intensity: Rgb,
    },
    /// A light that shines into a cone with a soft edge, from a point, or uniformly from a disc across the axis of the
    /// cone. No ray can hit the disc.
    Spot {
        /// Position of the point, or of the disc's centre (m).
        p: Vec3,
        /// Radius of the disc that emits (m); 0 makes the spot a mathematical point.
        radius: f32,
        /// Frame whose normal is the spot's axis, pointing in the direction of the emitted light.
        frame: Frame,
        /// Radiant intensity on the axis (W/sr).
        intensity: Rgb,
        /// 1 minus the cosine of the half angle of the cone of full intensity. For narrow cones, the cosine itself
        /// would lose its digits.
        inner: f32,
        /// 1 minus the cosine of the half angle beyond which the intensity is zero; greater than `inner`.
        outer: f32,
        /// Falloff of the intensity between `inner` and `outer`.
        edge: SpotEdge,
        /// The ball that emits in place of the disc, if camera paths see it.
        bulb: Option<Bulb>,
    },
    /// A point or a spot with a distribution of its own over directions.
    Shaped(ShapedLight),
    /// A medium that emits.
    Volume(VolumeLight),
    /// Light from a small cone of directions at infinity.
    Sun {
        /// Frame whose normal points from the scene towards the sun.
        frame: Frame,
        /// Irradiance on a surface that faces the sun (W/m2).
        irradiance: Rgb,
        /// 1 minus the cosine of the half angle of the sun's disc; 0 is exactly parallel light.
        one_minus_cos: f32,
        /// Whether camera rays do not see the sun's disc, although it lights the scene.
        hidden_from_camera: bool,
    },
    /// The environment (image or uniform colour) at infinity, stored in [`Sky`].
    Environment,
}

/// The bounding sphere of the scene, and the environment around it.
#[derive(Clone, Debug)]
pub struct Sky {
    /// Centre of the scene's bounding sphere (m).
    pub center: Vec3,
    /// Radius of the scene's bounding sphere (m).
    pub radius: f32,
    /// The light from all directions around the scene; `None` if the scene has no environment.
    pub environment: Option<Environment>,
    /// Whether camera rays do not see the environment, although it lights the scene.
    pub hidden_from_camera: bool,
}

/// Samples a point uniformly on the disc of a spot with centre `p` and the axis of `frame`, or of its bulb.
#[inline]
pub fn spot_point((p, radius, bulb): (Vec3, f32, Option<Bulb>), frame: &Frame, u: Vec2) -> Vec3 {
    if radius == 0.0 {
        return p;
    }
    if bulb.is_some() {
        return ball_point(p, radius, u);
    }
    let on = warp::disc_concentric(u) * radius;
    p + frame.t * on.x + frame.b * on.y
}

impl Emitter {
    /// Luminance of the flux that the light emits (W), by which lights are selected. For light from infinity, the flux
    /// through the scene's bounding sphere.
    pub fn power(&self, sky: &Sky) -> f64 {
        // In f64, which does not overflow: a light of infinite power could not be selected.
        const PI: f64 = std::f64::consts::PI;
        let radius = f64::from(sky.radius);
        let (sphere, disc) = (4.0 * PI, PI * radius * radius);
        let light = |rgb: Rgb| f64::from(luminance(rgb));
        match self {
            Emitter::Triangle(TriangleLight { area, two_sided, radiance, .. }) => {
                light(*radiance) * f64::from(*area) * PI * if *two_sided { 2.0 } else { 1.0 }
            }
            Emitter::Point { intensity, .. } => light(*intensity) * sphere,
            Emitter::Spot { intensity, inner, outer, edge, .. } => {
                light(*intensity) * f64::from(spot_solid_angle(*inner, *outer, *edge))
            }
            Emitter::Shaped(shaped) => light(shaped.intensity * shaped.distribution.flux()),
            Emitter::Volume(volume) => light(volume.intensity()) * sphere,
            Emitter::Sun { irradiance, .. } => light(*irradiance) * disc,
            Emitter::Environment => sky.environment.as_ref().map_or(0.0, |e| light(e.mean())) * sphere * disc,
        }
    }

    /// Some fixed point of the light, offset from its front so that a ray can start there; `None` for light from
    /// infinity.
    pub fn any_point(&self, shapes: &Shapes) -> Option<Vec3> {
        match self {
            Emitter::Triangle(TriangleLight { instance, primitive, .. }) => {
                shapes.surface(*instance, *primitive, [1.0 / 3.0, 1.0 / 3.0]).map(|s| s.ray_origin(s.ng))
            }
            Emitter::Point { p, .. } | Emitter::Spot { p, .. } | Emitter::Shaped(ShapedLight { p, .. }) => Some(*p),
            Emitter::Volume(volume) => {
                let [low, high] = volume.bounds();
                Some((low + high) * 0.5)
            }
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// The bulb that camera paths see, if the light has one.
    pub fn bulb(&self) -> Option<Bulb> {
        match self {
            Emitter::Spot { bulb, .. } | Emitter::Shaped(ShapedLight { bulb, .. }) => *bulb,
            _ => None,
        }
    }

    /// Whether the light is a delta light: no ray that scatters can hit it.
    pub fn is_delta(&self) -> bool {
        match self {
            Emitter::Point { .. } | Emitter::Spot { .. } | Emitter::Shaped(_) | Emitter::Volume(_) => true,
            Emitter::Sun { one_minus_cos, .. } => *one_minus_cos == 0.0,
            Emitter::Triangle(_) | Emitter::Environment => false,
        }
    }

    /// Whether the light is at infinity.
    pub fn is_infinite(&self) -> bool {
        matches!(self, Emitter::Sun { .. } | Emitter::Environment)
    }

    /// Radiance (W/m2/sr) of a sun of finite size that gives `irradiance`; its half angle is given as 1 minus the
    /// cosine.
    #[inline]
    pub fn sun_radiance(irradiance: Rgb, one_minus_cos: f32) -> Rgb {
        // E = integral of L cos over the cone = L pi sin^2, and sin^2 = h (2 - h) with h = 1 - cos.
        irradiance / (PI * one_minus_cos * (2.0 - one_minus_cos))
    }
}
