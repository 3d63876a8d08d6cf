//! The kinds of lights, one file each, and the only place that lists them. A new kind is its file, its line in
//! [`Emitter`], and the place that reads it from a scene.

mod environment;
mod point;
mod shaped;
mod spot;
mod sun;
mod triangle;
mod volume;

pub use environment::EnvironmentLight;
pub use point::PointLight;
pub use shaped::ShapedLight;
pub use spot::SpotLight;
pub use sun::SunLight;
pub use triangle::TriangleLight;
pub use volume::VolumeLight;

use super::bounds::Bounds;
use super::{Bulb, Cone, DirectSample, EmissionSample, Receiver, Sky, SpotCone, SpotEdge};
use crate::geometry::Shapes;
use crate::material::Materials;
use crate::math::{Rgb, Vec2, Vec3};
use enum_dispatch::enum_dispatch;
use std::f32::consts::TAU;

/// A light source. The scene has one flat list of them.
#[enum_dispatch(Light)]
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A triangle of an emissive material.
    Triangle(TriangleLight),
    /// A point light.
    Point(PointLight),
    /// A cone of light with a soft edge.
    Spot(SpotLight),
    /// A point or a spot with a distribution of its own over directions.
    Shaped(ShapedLight),
    /// A medium that emits.
    Volume(VolumeLight),
    /// Light from a small cone of directions at infinity.
    Sun(SunLight),
    /// The environment.
    Environment(EnvironmentLight),
}

/// What a light belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// The surface of the instance (object) with this index.
    Surface(u32),
    /// The medium in the instance (object) with this index.
    Medium(u32),
    /// Nothing: it is a light of its own, such as a point, a spot or a sun.
    Light,
    /// The environment of the scene.
    Environment,
}

/// The parts of a scene from which its lights take data.
pub struct SceneParts<'a> {
    pub shapes: &'a Shapes,
    pub materials: &'a Materials,
    pub sky: &'a Sky,
}

/// A light that was selected for next-event estimation: its index, and the probability of selecting it.
#[derive(Clone, Copy)]
pub struct Selected {
    pub light: u32,
    pub probability: f32,
}

impl Selected {
    /// The sample of a point `target` of a delta light that is not at infinity. `radiance`: the irradiance on a surface
    /// that faces the light.
    #[inline]
    fn delta(self, wi: Vec3, target: Vec3, radiance: Rgb, arrival_factor: f32) -> DirectSample {
        let Selected { light, probability: pdf_w } = self;
        DirectSample { wi, target: Some(target), radiance, pdf_w, delta: true, arrival_factor, light }
    }

    /// The sample of a direction of a light at infinity, which has the density `pdf_w` per solid angle; 1 for a delta
    /// light.
    #[inline]
    pub(in crate::light) fn infinite(self, wi: Vec3, radiance: Rgb, pdf_w: f32, delta: bool) -> DirectSample {
        let pdf_w = self.probability * pdf_w;
        DirectSample { wi, target: None, radiance, pdf_w, delta, arrival_factor: 1.0, light: self.light }
    }
}

/// Light from infinity along a direction; its densities do not include the selection of the light.
pub struct Arrival {
    pub radiance: Rgb,
    /// Density per solid angle of the direction in [`Light::sample`].
    pub direct: f32,
    /// Density per solid angle of the direction in [`Light::emit`].
    pub start: f32,
}

/// A sampled ray that leaves a given light; its densities do not include the selection of the light.
pub struct LightRay {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Emitted flux over the density of the ray (W).
    pub flux: Rgb,
    /// Density of the ray's point on the light per area, or of its direction per solid angle for light from infinity; 1
    /// for points.
    pub start: f32,
    /// Density of the ray's direction per solid angle, or of its point of entry into the scene per area for light from
    /// infinity.
    pub onward: f32,
    /// Cosine of the ray to the normal at the light; 1 at infinity and for points.
    pub cos: f32,
}

impl LightRay {
    /// A ray from a point of this intensity (W/sr) in all directions.
    #[inline]
    fn isotropic(origin: Vec3, intensity: Rgb, direction: Vec3) -> LightRay {
        LightRay { origin, direction, flux: intensity * (2.0 * TAU), start: 1.0, onward: 0.5 / TAU, cos: 1.0 }
    }
}

/// What every kind of light can do.
#[enum_dispatch]
pub trait Light {
    /// Name of the kind in `caustique info`.
    fn name(&self) -> &'static str;

    /// What the light belongs to.
    fn owner(&self) -> Owner;

    /// Luminance of the flux that the light emits (W), by which lights are selected; in `f64`, which does not overflow,
    /// because a light of infinite power could not be selected. For light from infinity, the flux through the scene's
    /// bounding sphere.
    fn power(&self, sky: &Sky) -> f64;

    /// Luminance of the irradiance on a surface that faces a light at infinity (W/m2); 0 for other lights.
    fn irradiance(&self, sky: &Sky) -> f32;

    /// Bounds of the light in the light tree; `None` for light from infinity.
    fn bounds(&self) -> Option<Bounds>;

    /// Whether the light is a delta light: no ray that scatters can hit it.
    fn is_delta(&self) -> bool;

    /// Whether the light is at infinity.
    fn is_infinite(&self) -> bool;

    /// Some fixed point of the light, offset from its front so that a ray can start there; `None` for light from
    /// infinity.
    fn any_point(&self, shapes: &Shapes) -> Option<Vec3>;

    /// Whether the light emits along the unit `d`.
    fn shines(&self, d: Vec3) -> bool;

    /// The point that [`Light::sample`] samples for any receiver, and the cone of its light if it is a spot. `None` for
    /// light from infinity.
    fn point(&self, u: Vec2) -> Option<(Vec3, Option<Cone>)>;

    /// Samples a point of the light, or a direction of light from infinity, for a receiver. `None` if the light does not
    /// shine on it.
    fn sample(&self, scene: &SceneParts, receiver: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample>;

    /// Samples a ray that leaves the light; `back` selects the back side of a surface that emits from both.
    fn emit(&self, scene: &SceneParts, back: bool, point: Vec2, direction: Vec2) -> Option<LightRay>;

    /// Density per solid angle with which [`Light::emit`] samples the unit direction `d` from any point of the light, and
    /// the cosine at the light. `None` if it does not, and for light from infinity.
    fn density(&self, d: Vec3) -> Option<(f32, f32)>;

    /// Flux of the start of a light path after its direction has been replaced by `d`, for which [`Light::density`]
    /// gives `onward` and `cos`. `None` if the light emits nothing along `d`, and for light from infinity.
    fn redirected_flux(&self, emission: &EmissionSample, d: Vec3, onward: f32, cos: f32) -> Option<Rgb>;

    /// Light from infinity that a ray from a receiver along `d` reaches when it leaves the scene. `None` if the ray
    /// reaches none. `camera`: the ray starts at the camera.
    fn arriving(&self, sky: &Sky, at: &Receiver, d: Vec3, camera: bool) -> Option<Arrival>;

    /// Density with which [`Light::sample`] samples a point of the light for a receiver, or light from infinity, along the
    /// unit `wi`, over the density with which light paths start there.
    #[inline]
    fn relative_density(&self, sky: &Sky, receiver: &Receiver, wi: Vec3) -> f32 {
        match self.arriving(sky, receiver, wi, false) {
            Some(Arrival { direct, start, .. }) if start > 0.0 => direct / start,
            _ => 1.0,
        }
    }

    /// The bulb that camera paths see, if the light has one.
    fn bulb(&self) -> Option<Bulb> {
        None
    }

    /// Centre and radius of the ball of a light with a bulb, and its intensity along the unit `d` (W/sr).
    fn bulb_along(&self, _d: Vec3) -> Option<((Vec3, f32), Rgb)> {
        None
    }
}

/// Kind of a light that a scene file places with a transform and an intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// A point light of equal intensity in all directions.
    Point,
    /// A spot, which emits into a cone with a soft edge.
    Spot {
        /// Half angle of the cone of full intensity (radians).
        inner: f32,
        /// Half angle of the cone outside which the intensity is zero (radians).
        outer: f32,
        /// Falloff of the intensity between `inner` and `outer`.
        edge: SpotEdge,
    },
    /// A sun: light from infinity, from a cone of directions.
    Sun {
        /// Angular diameter of the sun (radians); 0 is exactly parallel light.
        angle: f32,
    },
}

/// Position, direction and strength of a punctual light.
#[derive(Clone, Copy, Debug)]
pub struct LightPlacement {
    /// Position (m).
    pub p: Vec3,
    /// Unit direction in which the light shines.
    pub axis: Vec3,
    /// The x axis of the light's space, a unit vector.
    pub right: Vec3,
    /// Radiant intensity (W/sr); irradiance for a sun (W/m2).
    pub intensity: Rgb,
    /// Radius of the disc or ball that emits (m); 0 for a point.
    pub radius: f32,
    /// The ball, if camera paths see it.
    pub bulb: Option<Bulb>,
    /// Whether camera rays do not see the light.
    pub hidden_from_camera: bool,
}

/// 1 minus the cosine of an angle (radians), exact for small angles.
fn one_minus_cos(angle: f64) -> f64 {
    2.0 * (0.5 * angle).sin().powi(2)
}

impl PunctualKind {
    /// The cone that limits the light, if it is a spot.
    pub fn cone(self) -> Option<SpotCone> {
        let PunctualKind::Spot { inner, outer, edge } = self else { return None };
        let [inner, outer] = [inner, outer].map(|angle| one_minus_cos(f64::from(angle)));
        // The ramp between the two has a width.
        let (inner, outer) = (inner as f32, outer.max(inner * (1.0 + 1e-6)) as f32);
        Some(SpotCone { inner, outer, edge })
    }

    /// The light of this kind at a place of the scene.
    pub fn emitter(self, light: &LightPlacement) -> Emitter {
        match self {
            PunctualKind::Sun { angle } => SunLight::new(light, one_minus_cos(0.5 * f64::from(angle)) as f32).into(),
            PunctualKind::Point | PunctualKind::Spot { .. } => match self.cone() {
                Some(cone) => SpotLight::new(light, cone).into(),
                None => PointLight { p: light.p, intensity: light.intensity }.into(),
            },
        }
    }
}
