//! Media that emit.

use super::{Arrival, Light, LightRay, Owner, SceneParts, Selected};
use crate::geometry::Shapes;
use crate::light::bounds::Bounds;
use crate::light::{Cone, DirectSample, EmissionSample, Receiver, Sky};
use crate::material::{EmissionGrid, MediumGrids};
use crate::math::{Rgb, Vec2, Vec3, bounding_box, corners, luminance, warp};
use glam::Affine3A;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

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
    fn intensity(&self) -> Rgb {
        self.emission().map_or(Rgb::ZERO, EmissionGrid::mean) * self.volume()
    }

    /// Samples a point by the uniform point `u`. Returns the point and its intensity over its density (W/sr).
    fn origin(&self, u: Vec2) -> Option<(Vec3, Rgb)> {
        let emission = self.emission()?;
        let (cells, pdf) = emission.sample(u);
        let ([low, high], size) = (emission.grid().bounds(), emission.grid().size().map(|n| n as f32));
        let p = low + (high - low) * cells / Vec3::from_array(size);
        let cell = self.volume() / Vec3::from_array(size).element_product();
        Some((self.to_world.transform_point3(p), emission.at(cells) * (cell / pdf)))
    }

    /// Bounding box in world space.
    fn world_box(&self) -> [Vec3; 2] {
        let own = self.emission().map_or([Vec3::ZERO; 2], |emission| emission.grid().bounds());
        bounding_box(corners(own.into()).map(|corner| self.to_world.transform_point3(corner))).into()
    }
}

impl Light for VolumeLight {
    fn name(&self) -> &'static str {
        "emissive medium"
    }

    fn owner(&self) -> Owner {
        Owner::Medium(self.instance)
    }

    fn power(&self, _: &Sky) -> f64 {
        f64::from(luminance(self.intensity())) * (4.0 * std::f64::consts::PI)
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        0.0
    }

    fn bounds(&self) -> Option<Bounds> {
        let bounds = Bounds::of_point(Vec3::ZERO, Vec3::Z, PI, 0.5 * PI, luminance(self.intensity()));
        Some(bounds.with_box(self.world_box()))
    }

    #[inline]
    fn is_delta(&self) -> bool {
        true
    }

    #[inline]
    fn is_infinite(&self) -> bool {
        false
    }

    fn any_point(&self, _: &Shapes) -> Option<Vec3> {
        let [low, high] = self.world_box();
        Some((low + high) * 0.5)
    }

    fn shines(&self, _: Vec3) -> bool {
        true
    }

    #[inline]
    fn point(&self, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        self.origin(u).map(|(at, _)| (at, None))
    }

    // Not inlined, so that the common lights stay fast.
    #[inline(never)]
    fn sample(&self, _: &SceneParts, receiver: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        let (at, intensity) = self.origin(u)?;
        let to = at - receiver.p;
        let (wi, distance2) = (to.try_normalize()?, to.length_squared());
        Some(selected.delta(wi, at, intensity / distance2, 0.5 / TAU / distance2))
    }

    #[inline]
    fn emit(&self, _: &SceneParts, _: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let (origin, intensity) = self.origin(point)?;
        Some(LightRay::isotropic(origin, intensity, warp::sphere_uniform(direction)))
    }

    #[inline]
    fn density(&self, _: Vec3) -> Option<(f32, f32)> {
        Some((0.5 / TAU, 1.0))
    }

    #[inline]
    fn redirected_flux(&self, emission: &EmissionSample, _: Vec3, _: f32, _: f32) -> Option<Rgb> {
        Some(emission.flux)
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, _: Vec3, _: bool) -> Option<Arrival> {
        None
    }
}
