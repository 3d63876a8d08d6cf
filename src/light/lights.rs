//! All lights of a scene: choosing one, sampling it from a point, sampling emission, and the densities for MIS.

use super::Region;
use super::aim::CausticTargets;
use super::cdf::Cdf;
use super::cone::Cone;
use super::emission::{DirectSample, EmissionDensity, EmissionSample, EntryDisc};
use super::emitter::{Emitter, Sky, position_error, spot_falloff, spot_point, spot_solid_angle};
use super::group::{Group, Groups};
use super::receiver::Receiver;
use super::sampler::LightSampler;
use super::spread::Spread;
use crate::geometry::{Shapes, Surface, offset_origin, shadow_end};
use crate::material::{Alpha, Materials};
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4, one_minus_cos, warp};
use std::f32::consts::{PI, TAU};
use std::ops::Range;

/// Share of the choices that all lights get alike; the rest goes by power.
const EQUAL_SHARE: f64 = 0.05;

/// Light paths that leave a surface at a smaller cosine carry nothing.
const LEAST_COSINE: f32 = 1e-6;

/// The lights of a scene.
pub struct Lights {
    emitters: Vec<Emitter>,
    choice: Option<LightSampler>,
    /// Index of the first emitter of an instance, `u32::MAX` for instances that do not emit; and then the emitter of
    /// each of its triangles, relative to it (`u32::MAX` for those without area).
    first: Vec<u32>,
    relative: Vec<Vec<u32>>,
    /// Suns of finite size.
    suns: Vec<u32>,
    environment: Option<u32>,
    sky: Sky,
    targets: CausticTargets,
    groups: Groups,
}

/// What a triangle that does not look the same all over emits at a point; out of the way of lamps that do.
#[cold]
#[inline(never)]
fn uneven(shapes: &Shapes, materials: &Materials, (instance, primitive): (u32, u32), b: Vec2) -> Option<Rgb> {
    let light = shapes.surface(instance, primitive, [b.x, b.y])?;
    let material = &materials.list[light.material as usize];
    // A cut-out part gives no light: rays pass it, so samples must, too.
    Some(material.emitted(&light, &materials.textures) * material.coverage(&light, &materials.textures))
}

impl Lights {
    /// The emissive triangles of the shapes, then `others` (points, spots, suns), then the sky's environment.
    pub fn new(shapes: &Shapes, materials: &Materials, others: Vec<Emitter>, sky: Sky) -> Lights {
        let mut emitters = Vec::new();
        let mut first = vec![u32::MAX; shapes.instances.len()];
        let mut relative = vec![Vec::new(); shapes.instances.len()];
        for (i, instance) in shapes.instances.iter().enumerate() {
            let material = &materials.list[instance.material as usize];
            if !material.emits() {
                continue;
            }
            let mesh = &shapes.meshes[instance.mesh as usize];
            first[i] = emitters.len() as u32;
            for primitive in 0..mesh.triangles.len() as u32 {
                let [a, b, c] = instance.corners(mesh, primitive);
                let area = 0.5 * (b - a).cross(c - a).length();
                // Mean emission from a few points, enough to choose by; the radiance of a sample is looked up exactly.
                let probes = [[1.0 / 3.0, 1.0 / 3.0], [0.6, 0.2], [0.2, 0.6], [0.2, 0.2]];
                let (mut radiance, mut plane, mut coat) = (Rgb::ZERO, Vec4::ZERO, 0.0);
                for barycentric in probes {
                    if let Some(surface) = shapes.surface(i as u32, primitive, barycentric) {
                        plane = surface.ng.extend(surface.ng.dot(surface.p));
                        radiance += material.emitted(&surface, &materials.textures) / probes.len() as f32;
                        coat += material.coat(&surface, &materials.textures) / probes.len() as f32;
                    }
                }
                if material.unlit {
                    coat = 0.0;
                }
                let textured = material.unlit || material.emission_texture.is_some();
                let plain = !textured && matches!(material.alpha, Alpha::Opaque);
                if plain {
                    radiance = material.emission;
                }
                if textured || !mesh.colors.is_empty() {
                    // No texel may be impossible to choose: keep a tenth of the brightest.
                    radiance = radiance.max(material.brightest_emission() * 0.1);
                }
                if !(area > 0.0 && area.is_finite()) || radiance.max_element() <= 0.0 {
                    relative[i].push(u32::MAX);
                    continue;
                }
                relative[i].push(emitters.len() as u32 - first[i]);
                let two_sided = material.double_sided;
                let corners = [a, b - a, c - a];
                let instance = i as u32;
                emitters.push(Emitter::Triangle {
                    instance,
                    primitive,
                    area,
                    two_sided,
                    radiance,
                    spread: Spread::new(material.spread).below_coat(coat),
                    plane,
                    corners,
                    plain,
                });
            }
        }
        emitters.extend(others);
        let mut environment = None;
        if sky.environment.is_some() {
            environment = Some(emitters.len() as u32);
            emitters.push(Emitter::Environment);
        }
        let suns = (0..emitters.len() as u32)
            .filter(|&i| matches!(emitters[i as usize], Emitter::Sun { one_minus_cos, .. } if one_minus_cos > 0.0))
            .collect();
        let powers: Vec<f64> = emitters.iter().map(|e| e.power(&sky)).collect();
        // A lamp beside the sun is weak as seen from the whole scene, and the brightest thing on its own table: a share
        // of the paths goes to all lights alike. It also keeps every probability above the resolution of the random
        // numbers.
        let floor = EQUAL_SHARE * powers.iter().sum::<f64>() / powers.len().max(1) as f64;
        let floored = powers.iter().map(|&power| if power > 0.0 { power + floor } else { 0.0 });
        let choice = LightSampler::new(&emitters, &sky, floored);
        let (targets, groups) = (CausticTargets::new(shapes, materials), Groups::default());
        Lights { emitters, choice, first, relative, suns, environment, sky, targets, groups }
    }

    /// The same lights in groups.
    #[must_use]
    pub fn grouped(self, groups: Groups) -> Lights {
        Lights { groups, ..self }
    }

    /// The groups that they are in.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// The group of a light.
    #[inline]
    pub fn group(&self, light: u32) -> Group {
        let Groups { names, instances, others, environment, .. } = &self.groups;
        if names.is_empty() {
            return Group::NONE;
        }
        match &self.emitters[light as usize] {
            Emitter::Triangle { instance, .. } => instances.get(*instance as usize).copied().unwrap_or_default(),
            Emitter::Environment => *environment,
            _ => {
                // Others stand between the triangles and the environment.
                let last = self.emitters.len() - usize::from(self.environment.is_some());
                (light as usize + others.len())
                    .checked_sub(last)
                    .and_then(|at| others.get(at))
                    .copied()
                    .unwrap_or_default()
            }
        }
    }

    /// The group of a surface that glows.
    #[inline]
    pub fn surface_group(&self, surface: &Surface) -> Group {
        self.groups.instances.get(surface.instance as usize).copied().unwrap_or_default()
    }

    /// No light gives any light.
    pub fn is_empty(&self) -> bool {
        self.choice.is_none()
    }

    /// The power of two of all light together; 0 if there is none.
    pub fn power_exponent(&self) -> i32 {
        let power: f64 = self.emitters.iter().map(|emitter| emitter.power(&self.sky)).sum();
        if power.is_normal() { ((power.to_bits() >> 52) & 0x7ff) as i32 - 1023 } else { 0 }
    }

    /// The lights; indices are those of [`EmissionSample::light`].
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// The bounding sphere and the environment.
    pub fn sky(&self) -> &Sky {
        &self.sky
    }

    /// What can make caustics.
    pub fn targets(&self) -> &CausticTargets {
        &self.targets
    }

    /// The choice of lights by power; `None` if there is none.
    pub(super) fn choice(&self) -> Option<&Cdf> {
        self.choice.as_ref().map(LightSampler::power)
    }

    /// Probability of choosing a light for a receiver over that of choosing it for emission.
    #[inline]
    pub fn choice_ratio(&self, receiver: &Receiver, light: u32) -> f32 {
        let Some(choice) = &self.choice else { return 1.0 };
        choice.pdf(receiver, light as usize) / choice.power().pdf(light as usize)
    }

    /// The emitters of every lamp, the triangles of an instance or a light alone, and the probability of choosing one
    /// of them.
    pub(super) fn lamps(&self) -> impl Iterator<Item = (Range<usize>, f64)> {
        let same = |a: &Emitter, b: &Emitter| match (a, b) {
            (Emitter::Triangle { instance: a, .. }, Emitter::Triangle { instance: b, .. }) => a == b,
            _ => false,
        };
        let below = |end: usize| {
            self.choice().map_or(0.0, |choice| if end == self.emitters.len() { 1.0 } else { choice.below(end) })
        };
        self.emitters.chunk_by(same).scan(0, move |first, emitters| {
            let range = *first..*first + emitters.len();
            *first = range.end;
            let probability = below(range.end) - below(range.start);
            Some((range, probability))
        })
    }

    /// Density per solid angle of emission along `d` from any point of a light that is not at infinity, and the cosine
    /// there; `None` where nothing leaves it.
    #[inline]
    pub(super) fn onward(&self, index: usize, d: Vec3) -> Option<(f32, f32)> {
        match &self.emitters[index] {
            Emitter::Triangle { two_sided, spread, plane, .. } => {
                let cos = plane.truncate().dot(d);
                let cos = if *two_sided { cos.abs() } else { cos };
                let density = if cos >= LEAST_COSINE { Self::onto(cos, *two_sided, spread) } else { 0.0 };
                (density > 0.0).then_some((density, cos))
            }
            Emitter::Point { .. } => Some((0.5 / TAU, 1.0)),
            Emitter::Spot { frame, inner, outer, edge, .. } => {
                let falloff = spot_falloff(one_minus_cos(d, frame.n), *inner, *outer, *edge);
                (falloff > 0.0).then(|| (falloff / spot_solid_angle(*inner, *outer, *edge), 1.0))
            }
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// A light chosen for a receiver, seen from there. `None` where the one chosen does not shine on it.
    #[inline]
    pub fn sample_direct(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        receiver: &Receiver,
        choice: f64,
        u: Vec2,
    ) -> Option<DirectSample> {
        let (index, probability) = self.choice.as_ref()?.sample(receiver, choice)?;
        let mut sample = self.seen_from(shapes, materials, receiver.p, (index, probability), u)?;
        sample.arrival_pdf_a *= self.choice()?.pdf(index) / probability;
        Some(sample)
    }

    /// The light of an index, chosen with a probability, seen from `p`.
    #[inline]
    fn seen_from(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        p: Vec3,
        (index, probability): (usize, f32),
        u: Vec2,
    ) -> Option<DirectSample> {
        let light = index as u32;
        match &self.emitters[index] {
            Emitter::Triangle { instance, primitive, area, two_sided, radiance, spread, plane, corners, plain } => {
                // Most lamps have a back, and most points are behind some lamp: asked before more is looked up. Near
                // the plane rounding decides.
                let ng = plane.truncate();
                if !*two_sided && ng.dot(p) <= plane.w {
                    return None;
                }
                let b = warp::triangle_uniform(u);
                let at = corners[0] + corners[1] * b.x + corners[2] * b.y;
                let to = at - p;
                let distance2 = to.length_squared();
                let wi = to.try_normalize()?;
                let cos = -ng.dot(wi);
                if cos == 0.0 || (cos < 0.0 && !two_sided) {
                    return None;
                }
                let toward = spread.of(cos.abs());
                if toward == 0.0 {
                    return None;
                }
                let radiance = if *plain { *radiance } else { uneven(shapes, materials, (*instance, *primitive), b)? };
                let radiance = radiance * toward;
                let pdf_w = probability * distance2 / (area * cos.abs());
                let arrival_pdf_a = Self::onto(cos.abs(), *two_sided, spread) / distance2;
                let target = Some(shadow_end(at, ng, -wi, position_error(corners), distance2.sqrt()));
                Some(DirectSample { wi, target, radiance, pdf_w, delta: false, arrival_pdf_a, light })
            }
            Emitter::Point { p: at, intensity } => {
                let to = *at - p;
                let wi = to.try_normalize()?;
                let radiance = *intensity / to.length_squared();
                let arrival_pdf_a = 0.5 / TAU / to.length_squared();
                Some(DirectSample {
                    wi,
                    target: Some(*at),
                    radiance,
                    pdf_w: probability,
                    delta: true,
                    arrival_pdf_a,
                    light,
                })
            }
            Emitter::Spot { p: middle, radius, frame, intensity, inner, outer, edge } => {
                let at = spot_point(*middle, *radius, frame, u);
                let to = at - p;
                let wi = to.try_normalize()?;
                let falloff = spot_falloff(one_minus_cos(-wi, frame.n), *inner, *outer, *edge);
                if falloff == 0.0 {
                    return None;
                }
                let radiance = *intensity * (falloff / to.length_squared());
                let arrival_pdf_a = falloff / (spot_solid_angle(*inner, *outer, *edge) * to.length_squared());
                Some(DirectSample {
                    wi,
                    target: Some(at),
                    radiance,
                    pdf_w: probability,
                    delta: true,
                    arrival_pdf_a,
                    light,
                })
            }
            Emitter::Sun { frame, irradiance, one_minus_cos, .. } => {
                if *one_minus_cos == 0.0 {
                    let (wi, radiance, pdf_w) = (frame.n, *irradiance, probability);
                    let arrival_pdf_a = self.entry_pdf_a(p, wi);
                    return Some(DirectSample { wi, target: None, radiance, pdf_w, delta: true, arrival_pdf_a, light });
                }
                let wi = frame.to_world(warp::cone_uniform(u, *one_minus_cos));
                let radiance = Emitter::sun_radiance(*irradiance, *one_minus_cos);
                let pdf_w = probability * warp::cone_uniform_pdf_w(*one_minus_cos);
                let arrival_pdf_a = self.entry_pdf_a(p, wi);
                Some(DirectSample { wi, target: None, radiance, pdf_w, delta: false, arrival_pdf_a, light })
            }
            Emitter::Environment => {
                let environment = self.sky.environment.as_ref()?;
                let (wi, pdf) = environment.sample(u);
                let pdf_w = probability * pdf;
                (pdf_w > 0.0).then(|| DirectSample {
                    wi,
                    target: None,
                    radiance: environment.radiance(wi),
                    pdf_w,
                    delta: false,
                    arrival_pdf_a: self.entry_pdf_a(p, wi),
                    light,
                })
            }
        }
    }

    /// The point of a light to which [`Lights::sample_direct`] goes from anywhere in a medium with these numbers, and
    /// the cone that the light stays in. `None` for light from infinity.
    #[inline]
    pub fn sample_point(&self, choice: f64, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        let (index, ..) = self.choice()?.sample(choice);
        match &self.emitters[index] {
            Emitter::Triangle { corners, .. } => {
                let b = warp::triangle_uniform(u);
                Some((corners[0] + corners[1] * b.x + corners[2] * b.y, None))
            }
            Emitter::Point { p, .. } => Some((*p, None)),
            Emitter::Spot { p, radius, frame, outer, .. } => {
                let at = spot_point(*p, *radius, frame, u);
                Some((at, Cone::new(at, frame.n, *outer)))
            }
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// Radiance that a surface hit by a ray sends back along it, which is `wo`, and the density per solid angle with which
    /// [`Lights::sample_direct`] would have found that point from the ray's origin. A light that touches the surface that
    /// the ray has left is at no distance.
    #[inline]
    pub fn hit_radiance(
        &self,
        materials: &Materials,
        from: &Receiver,
        surface: &Surface,
        wo: Vec3,
    ) -> Option<(Rgb, f32)> {
        let (radiance, density) = self.emitted(materials, from, surface, wo)?;
        Some((radiance, density.direct * surface.p.distance_squared(from.p) / density.cos))
    }

    /// Density per solid angle of emission along cosine `cos` from a triangle.
    #[inline]
    fn onto(cos: f32, two_sided: bool, spread: &Spread) -> f32 {
        spread.pdf_w(cos) * if two_sided { 0.5 } else { 1.0 }
    }

    /// Density per area with which light paths from infinity, once aimed, enter the scene along the line through `p`
    /// towards the light, `wi`.
    #[inline]
    pub fn entry_pdf_a(&self, p: Vec3, wi: Vec3) -> f32 {
        self.targets.density(&self.sky, p, wi)
    }

    /// Radiance of a surface along `wo`, where `from` is, and the densities of starting a light path there that way.
    #[inline]
    pub fn emitted(
        &self,
        materials: &Materials,
        from: &Receiver,
        surface: &Surface,
        wo: Vec3,
    ) -> Option<(Rgb, EmissionDensity)> {
        let first = self.first[surface.instance as usize];
        if first == u32::MAX {
            return None;
        }
        let relative = self.relative[surface.instance as usize][surface.primitive as usize];
        if relative == u32::MAX {
            return None;
        }
        let index = (first + relative) as usize;
        let Emitter::Triangle { area, two_sided, spread, .. } = &self.emitters[index] else { return None };
        let cos = surface.ng.dot(wo);
        if !(cos > 0.0 || (*two_sided && cos < 0.0)) {
            return None;
        }
        let radiance = materials.list[surface.material as usize].emitted(surface, &materials.textures);
        let cos = cos.abs();
        let radiance = radiance * spread.of(cos);
        let choice = self.choice.as_ref()?;
        let [direct, start] = [choice.pdf(from, index), choice.power().pdf(index)].map(|chosen| chosen / area);
        let onward = Self::onto(cos, *two_sided, spread);
        Some((radiance, EmissionDensity { direct, start, onward, cos, infinite: false, delta: false }))
    }

    /// Calls `each(radiance, direct, start, group)` for every light at infinity that a ray leaving the scene from a receiver
    /// along `d` meets, with the densities of [`EmissionDensity`]; a camera's own ray does not meet those that are
    /// hidden from cameras.
    #[inline]
    pub fn for_each_infinite(
        &self,
        from: &Receiver,
        d: Vec3,
        camera: bool,
        mut each: impl FnMut(Rgb, f32, f32, Group),
    ) {
        let Some(choice) = &self.choice else { return };
        let mut met = |radiance: Rgb, index: u32, pdf: f32| {
            let [direct, start] = [choice.pdf(from, index as usize), choice.power().pdf(index as usize)];
            each(radiance, direct * pdf, start * pdf, self.group(index));
        };
        if let (Some(index), Some(environment)) = (self.environment, &self.sky.environment)
            && !(camera && self.sky.hidden_from_camera)
        {
            met(environment.radiance(d), index, environment.pdf_w(d));
        }
        for &index in &self.suns {
            if let Emitter::Sun { frame, irradiance, one_minus_cos: size, hidden_from_camera } =
                &self.emitters[index as usize]
            {
                let size = *size;
                if one_minus_cos(d, frame.n) < size && !(camera && *hidden_from_camera) {
                    let pdf = warp::cone_uniform_pdf_w(size);
                    met(Emitter::sun_radiance(*irradiance, size), index, pdf);
                }
            }
        }
    }

    /// The start of a light path, its light chosen by power.
    #[inline]
    pub fn sample_emission(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        choice: f64,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let (index, probability, rest) = self.choice()?.sample(choice);
        let emitter = &self.emitters[index];
        // Densities: the point (the direction, at infinity) without the choice of the light, then the rest; the cosine
        // at the light.
        let (origin, d, flux, [direct, onward, cos]) = match emitter {
            Emitter::Triangle { instance, primitive, area, two_sided, radiance, spread, plane, corners, plain } => {
                let b = warp::triangle_uniform(point);
                let (at, ng) = (corners[0] + corners[1] * b.x + corners[2] * b.y, plane.truncate());
                let back = *two_sided && rest < 0.5;
                let frame = Frame::from_normal(if back { -ng } else { ng });
                let (d, along) = spread.sample(direction);
                let d = frame.to_world(d);
                let radiance = if *plain { *radiance } else { uneven(shapes, materials, (*instance, *primitive), b)? };
                let cos = ng.dot(d).abs();
                // Along the surface nothing leaves it, and densities over the cosine would not be numbers.
                if cos < LEAST_COSINE {
                    return None;
                }
                let flux = radiance * (PI * area * along * if *two_sided { 2.0 } else { 1.0 });
                (
                    offset_origin(at, ng, d, position_error(corners)),
                    d,
                    flux,
                    [1.0 / area, Self::onto(cos, *two_sided, spread), cos],
                )
            }
            Emitter::Point { p, intensity } => {
                (*p, warp::sphere_uniform(direction), *intensity * (2.0 * TAU), [1.0, 0.5 / TAU, 1.0])
            }
            Emitter::Spot { p, radius, frame, intensity, inner, outer, edge } => {
                // Full cone and penumbra are chosen by their flux; inside the penumbra the falloff's integral is
                // inverted, so every path carries the same flux.
                let penumbra = (outer - inner) * edge.mean();
                let x = direction.x * (inner + penumbra);
                let h = if x < *inner { x } else { outer - (outer - inner) * edge.ramp((x - inner) / penumbra) };
                let sin = (h * (2.0 - h)).max(0.0).sqrt();
                let (s, c) = (TAU * direction.y).sin_cos();
                let filled = spot_solid_angle(*inner, *outer, *edge);
                let falloff = spot_falloff(h, *inner, *outer, *edge);
                let d = frame.to_world(Vec3::new(sin * c, sin * s, 1.0 - h));
                (spot_point(*p, *radius, frame, point), d, *intensity * filled, [1.0, falloff / filled, 1.0])
            }
            Emitter::Sun { frame, irradiance, one_minus_cos, .. } => {
                let d = -frame.to_world(warp::cone_uniform(direction, *one_minus_cos));
                // Irradiance is what a facing surface gets from the whole cone; a path from direction d stands for
                // L / pdf = E / mean cosine.
                let flux = *irradiance * (2.0 / (2.0 - one_minus_cos));
                let pdf_w = if *one_minus_cos == 0.0 { 1.0 } else { warp::cone_uniform_pdf_w(*one_minus_cos) };
                let entry = 1.0 / (PI * self.sky.radius * self.sky.radius);
                (self.disc(point, d), d, flux / entry, [pdf_w, entry, 1.0])
            }
            Emitter::Environment => {
                let environment = self.sky.environment.as_ref()?;
                let (wi, pdf) = environment.sample(direction);
                if pdf <= 0.0 {
                    return None;
                }
                let entry = 1.0 / (PI * self.sky.radius * self.sky.radius);
                (self.disc(point, -wi), -wi, environment.radiance(wi) / (pdf * entry), [pdf, entry, 1.0])
            }
        };
        let flux = flux / probability;
        let infinite = emitter.is_infinite();
        let delta = emitter.is_delta();
        let start = direct * probability;
        let density = EmissionDensity { direct: start, start, onward, cos, infinite, delta };
        // What is not finite sets out, for somebody to see that it was there.
        (flux.max_element() > 0.0 || !flux.is_finite()).then_some(EmissionSample {
            origin,
            direction: d,
            flux,
            light: index as u32,
            delta,
            infinite,
            entry: EntryDisc::Whole,
            density,
        })
    }

    /// Aims the start of a path from infinity at what can make caustics (see [`CausticTargets::aim`]); others stay as they
    /// are.
    #[inline]
    pub fn aim(&self, emission: &mut EmissionSample, u: f32, point: Vec2) {
        if emission.infinite {
            self.targets.aim(&self.sky, emission, u, point);
        }
    }

    /// The same, and part of the paths from infinity through the disc of a region of interest, if there is one. Flux
    /// and density are those without the region.
    #[inline]
    pub fn aim_with_region(&self, emission: &mut EmissionSample, region: Option<Region>, u: f32, point: Vec2) {
        match region {
            Some(region) if emission.infinite => {
                self.targets.aim_with_region(&self.sky, emission, region, u, point);
            }
            _ => self.aim(emission, u, point),
        }
    }

    /// Density that a start has where none are aimed.
    #[inline]
    pub fn plain(&self, emission: &EmissionSample) -> f32 {
        if emission.infinite { 1.0 / (PI * self.sky.radius * self.sky.radius) } else { emission.density.onward }
    }

    /// Density that an aimed start has with the region in the mixture, and the part of it that paths of all light have:
    /// those through the whole scene and the region, without what is aimed.
    #[inline]
    pub fn density_with_region(&self, emission: &EmissionSample, region: Option<Region>) -> (f32, f32) {
        let onward = emission.density.onward;
        match region {
            _ if !emission.infinite => (onward, onward),
            Some(region) => self.targets.density_with_region(&self.sky, emission, region),
            None => (onward, onward * self.targets.unaimed(&self.sky, emission)),
        }
    }

    /// A point of the disc, before the scene as seen along `d`, through which light of direction `d` enters the scene.
    fn disc(&self, u: Vec2, d: Vec3) -> Vec3 {
        let frame = Frame::from_normal(d);
        let q = warp::disc_concentric(u) * self.sky.radius;
        self.sky.center + frame.t * q.x + frame.b * q.y - d * self.sky.radius
    }

    /// Whether any triangle of the instance gives light.
    pub fn emits(&self, instance: u32) -> bool {
        self.relative[instance as usize].iter().any(|&i| i != u32::MAX)
    }
}
