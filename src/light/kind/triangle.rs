//! Triangles of emissive materials.

use super::{Arrival, Light, LightRay, Owner, SceneParts, Selected};
use crate::geometry::{Shapes, Surface, offset_origin, shadow_end, triangle_error};
use crate::light::bounds::Bounds;
use crate::light::{Cone, DirectSample, EmissionSample, Receiver, Sky, Spread};
use crate::material::{Alpha, Objects};
use crate::math::{Frame, Rgb, SphericalTriangle, Vec2, Vec3, Vec4, luminance, warp};
use std::f32::consts::PI;

/// Smallest cosine at which light paths leave a surface. At smaller ones, densities over the cosine overflow.
const MIN_COSINE: f32 = 1e-6;

/// Largest squared distance of a receiver from a triangle's centre, in units of its area, at which the solid angle is
/// sampled. From farther away, points of the triangle contribute nearly alike.
const NEAR: f32 = 16.0;
/// Smallest solid angle (sr) that is sampled, and smallest squared height of the receiver over the triangle's plane in
/// units of its area. Below, rounding decides about directions.
const MIN_SOLID_ANGLE: f32 = 1e-3;
const MIN_HEIGHT: f32 = 1e-6;

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
    /// The light of a triangle of an emissive material; `None` if the triangle has no area or does not emit.
    pub fn new(objects: Objects<'_>, instance: u32, primitive: u32) -> Option<TriangleLight> {
        let Objects { shapes, materials } = objects;
        let placed = &shapes.instances[instance as usize];
        let (material, mesh) = (objects.material(placed), objects.mesh(placed));
        let [a, b, c] = placed.corners(mesh, primitive);
        let area = 0.5 * (b - a).cross(c - a).length();
        // The mean over a few points suffices to select a light; a sample's radiance is looked up exactly.
        let probes = [[1.0 / 3.0, 1.0 / 3.0], [0.6, 0.2], [0.2, 0.6], [0.2, 0.2]];
        let (mut radiance, mut plane, mut coat, mut coat_ior) = (Rgb::ZERO, Vec4::ZERO, 0.0, 0.0);
        for barycentric in probes {
            if let Some(surface) = shapes.surface(instance, primitive, barycentric) {
                plane = surface.ng.extend(surface.ng.dot(surface.p));
                radiance += material.emitted(&surface, &materials.textures) / probes.len() as f32;
                coat += material.coat(&surface, &materials.textures) / probes.len() as f32;
                coat_ior += material.coat_ior(&surface, &materials.textures) / probes.len() as f32;
            }
        }
        if material.unlit {
            coat = 0.0;
        }
        if material.clearcoat_ior.texture.is_none() {
            coat_ior = material.clearcoat_ior.factor;
        }
        let textured = material.has_textured_emission();
        let uniform = !textured && matches!(material.alpha, Alpha::Opaque);
        if uniform {
            radiance = material.emission;
        }
        if textured || !mesh.colors.is_empty() {
            // Every texel needs a selection probability: assume at least a tenth of the brightest.
            radiance = radiance.max(material.brightest_emission() * 0.1);
        }
        if !(area > 0.0 && area.is_finite()) || radiance.max_element() <= 0.0 {
            return None;
        }
        let corners = [a, b - a, c - a];
        Some(TriangleLight {
            instance,
            primitive,
            area,
            two_sided: material.double_sided,
            radiance,
            spread: Spread::new(material.spread).below_coat(coat, coat_ior),
            plane,
            corners,
            error: triangle_error([a, a + corners[1], a + corners[2]]),
            uniform,
        })
    }

    /// Unit normal of the front side.
    #[inline]
    pub(in crate::light) fn normal(&self) -> Vec3 {
        self.plane.truncate()
    }

    /// The point with barycentric coordinates `b` of the second and the third corner (m).
    #[inline]
    pub(in crate::light) fn at(&self, b: Vec2) -> Vec3 {
        let [corner, first, second] = self.corners;
        corner + first * b.x + second * b.y
    }

    /// Radiance (W/m2/sr), averaged over directions, at the point with barycentric coordinates `b`. `None` if the triangle
    /// has no area.
    #[inline(always)]
    pub(in crate::light) fn radiance_at(&self, scene: &SceneParts, b: Vec2) -> Option<Rgb> {
        if self.uniform { Some(self.radiance) } else { self.textured_radiance(scene, b) }
    }

    /// [`TriangleLight::radiance_at`] a point of a triangle whose emission varies. Not inlined, so that the common case,
    /// uniform emission, stays small.
    #[cold]
    #[inline(never)]
    fn textured_radiance(&self, &SceneParts { shapes, materials, .. }: &SceneParts, b: Vec2) -> Option<Rgb> {
        let light = shapes.surface(self.instance, self.primitive, [b.x, b.y])?;
        let material = &materials.list[light.material as usize];
        // Rays pass through cut-outs, so light samples must do so, too.
        Some(material.emitted(&light, &materials.textures) * material.coverage(&light, &materials.textures))
    }

    /// The radiance at a surface of the triangle along `wo`, relative to [`TriangleLight::radiance_at`], the density per
    /// solid angle with which light paths leave along `wo`, and the cosine; `None` if the triangle emits nothing there.
    #[inline]
    pub(in crate::light) fn along(&self, surface: &Surface, wo: Vec3) -> Option<(f32, f32, f32)> {
        let cos = surface.ng.dot(wo);
        if !(cos > 0.0 || (self.two_sided && cos < 0.0)) {
            return None;
        }
        let cos = cos.abs();
        Some((self.spread.relative_radiance(cos), self.cosine_density(cos), cos))
    }

    /// The directions from a receiver to the triangle, if they are sampled instead of points of the triangle: from near,
    /// and outside media, where points along a ray are sampled for a given point of a light.
    #[inline]
    fn directions(&self, receiver: &Receiver) -> Option<SphericalTriangle> {
        let [corner, first, second] = self.corners;
        let a = corner - receiver.p;
        let height = self.normal().dot(receiver.p) - self.plane.w;
        let is_far = (a + (first + second) / 3.0).length_squared() > NEAR * self.area;
        if receiver.in_medium || is_far || height * height < MIN_HEIGHT * self.area {
            return None;
        }
        let directions = SphericalTriangle::new([a, a + first, a + second], 2.0 * self.area * height)?;
        (directions.solid_angle() >= MIN_SOLID_ANGLE).then_some(directions)
    }

    /// Density per area with which [`Light::sample`] samples a point of the triangle for a receiver, relative to a uniform
    /// one. The point is at a squared distance, and the direction to it has the cosine `cos` to the normal.
    #[inline]
    pub(in crate::light) fn density_at(&self, receiver: &Receiver, distance2: f32, cos: f32) -> f32 {
        let of = |directions: SphericalTriangle| self.area * cos / (directions.solid_angle() * distance2);
        self.directions(receiver).map_or(1.0, of)
    }

    /// Barycentric coordinates of the second and the third corner of the point in the unit direction `d` from `p`.
    #[inline]
    fn coordinates(&self, p: Vec3, d: Vec3) -> Vec2 {
        let ([corner, first, second], ng) = (self.corners, self.normal());
        let point = p + d * ((self.plane.w - ng.dot(p)) / ng.dot(d)) - corner;
        let normal = first.cross(second);
        let b = Vec2::new(normal.dot(point.cross(second)), normal.dot(first.cross(point))) / normal.length_squared();
        let x = b.x.clamp(0.0, 1.0);
        Vec2::new(x, b.y.clamp(0.0, 1.0 - x))
    }

    /// Density per solid angle with which light paths leave in a direction of cosine `cos` to the normal.
    #[inline]
    fn cosine_density(&self, cos: f32) -> f32 {
        self.spread.pdf_w(cos) * if self.two_sided { 0.5 } else { 1.0 }
    }
}

impl Light for TriangleLight {
    fn name(&self) -> &'static str {
        "emissive triangles"
    }

    #[inline]
    fn owner(&self) -> Owner {
        Owner::Surface(self.instance)
    }

    fn power(&self, _: &Sky) -> f64 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        f64::from(luminance(self.radiance)) * f64::from(self.area) * std::f64::consts::PI * sides
    }

    fn irradiance(&self, _: &Sky) -> f32 {
        0.0
    }

    fn bounds(&self) -> Option<Bounds> {
        let [a, b, c] = [self.corners[0], self.corners[0] + self.corners[1], self.corners[0] + self.corners[2]];
        let intensity = luminance(self.radiance) * self.area * self.spread.relative_radiance(1.0);
        let bounds = Bounds::of_point(a, self.normal(), 0.0, 0.5 * PI, intensity);
        let bounds = bounds.with_box([a.min(b).min(c), a.max(b).max(c)]);
        Some(Bounds { two_sided: self.two_sided, cosine: true, ..bounds })
    }

    #[inline]
    fn is_delta(&self) -> bool {
        false
    }

    #[inline]
    fn is_infinite(&self) -> bool {
        false
    }

    fn any_point(&self, shapes: &Shapes) -> Option<Vec3> {
        shapes.surface(self.instance, self.primitive, [1.0 / 3.0, 1.0 / 3.0]).map(|s| s.ray_origin(s.ng))
    }

    fn shines(&self, d: Vec3) -> bool {
        self.two_sided || self.normal().dot(d) > 0.0
    }

    #[inline]
    fn point(&self, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        Some((self.at(warp::triangle_uniform(u)), None))
    }

    #[inline(always)]
    fn sample(&self, scene: &SceneParts, receiver: &Receiver, selected: Selected, u: Vec2) -> Option<DirectSample> {
        // Most receivers are behind some one-sided light, so this cheap test comes first. Near the plane, rounding
        // decides.
        let ng = self.normal();
        if !self.two_sided && ng.dot(receiver.p) <= self.plane.w {
            return None;
        }
        let directions = self.directions(receiver);
        let b = match &directions {
            Some(directions) => self.coordinates(receiver.p, directions.sample(u)),
            None => warp::triangle_uniform(u),
        };
        let at = self.at(b);
        let to = at - receiver.p;
        let distance2 = to.length_squared();
        let wi = to.try_normalize()?;
        let cos = -ng.dot(wi);
        if cos == 0.0 || (cos < 0.0 && !self.two_sided) {
            return None;
        }
        let relative = self.spread.relative_radiance(cos.abs());
        if relative == 0.0 {
            return None;
        }
        let radiance = self.radiance_at(scene, b)? * relative;
        let uniform = distance2 / (self.area * cos.abs());
        let density = directions.map_or(uniform, |directions| directions.solid_angle().recip());
        let pdf_w = selected.probability * density;
        let arrival_factor = self.cosine_density(cos.abs()) / distance2 * (uniform / density);
        let target = Some(shadow_end(at, ng, -wi, self.error, distance2.sqrt()));
        Some(DirectSample { wi, target, radiance, pdf_w, delta: false, arrival_factor, light: selected.light })
    }

    #[inline(always)]
    fn emit(&self, scene: &SceneParts, back: bool, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let b = warp::triangle_uniform(point);
        let ng = self.normal();
        let frame = Frame::from_normal(if self.two_sided && back { -ng } else { ng });
        let (d, weight) = self.spread.sample(direction);
        let d = frame.to_world(d);
        let radiance = self.radiance_at(scene, b)?;
        let cos = ng.dot(d).abs();
        if cos < MIN_COSINE {
            return None;
        }
        let flux = radiance * (PI * self.area * weight * if self.two_sided { 2.0 } else { 1.0 });
        let (origin, onward) = (offset_origin(self.at(b), ng, d, self.error), self.cosine_density(cos));
        Some(LightRay { origin, direction: d, flux, start: 1.0 / self.area, onward, cos })
    }

    #[inline]
    fn density(&self, d: Vec3) -> Option<(f32, f32)> {
        let cos = self.normal().dot(d);
        let cos = if self.two_sided { cos.abs() } else { cos };
        let density = if cos >= MIN_COSINE { self.cosine_density(cos) } else { 0.0 };
        (density > 0.0).then_some((density, cos))
    }

    #[inline]
    fn redirected_flux(&self, emission: &EmissionSample, _: Vec3, _: f32, cos: f32) -> Option<Rgb> {
        if self.spread == Spread::LAMBERTIAN {
            return Some(emission.flux);
        }
        let before = self.spread.relative_radiance(emission.density.cos);
        (before != 0.0).then(|| emission.flux * (self.spread.relative_radiance(cos) / before))
    }

    #[inline]
    fn arriving(&self, _: &Sky, _: &Receiver, _: Vec3, _: bool) -> Option<Arrival> {
        None
    }

    #[inline]
    fn relative_density(&self, _: &Sky, receiver: &Receiver, wi: Vec3) -> f32 {
        let ng = self.normal();
        let cos = ng.dot(wi);
        let distance = (self.plane.w - ng.dot(receiver.p)) / cos;
        self.density_at(receiver, distance * distance, cos.abs())
    }
}
