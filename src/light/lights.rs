//! All lights of a scene: selecting one, sampling it from a point, sampling emission, and the densities for MIS.

use super::Region;
use super::aim::CausticTargets;
use super::bulb::crossed_share;
use super::cdf::Cdf;
use super::cone::Cone;
use super::emission::{DirectSample, EmissionDensity, EmissionSample, EntryDisc};
use super::emitter::{Emitter, ShapedLight, Sky, TriangleLight, VolumeLight, position_error, spot_point};
use super::environment::EnvironmentSample;
use super::group::{Group, Groups};
use super::receiver::Receiver;
use super::sampler::LightSampler;
use super::spot::{spot_falloff, spot_solid_angle};
use super::spread::Spread;
use crate::geometry::{Shapes, Surface, offset_origin, shadow_end};
use crate::material::{Alpha, Materials};
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4, one_minus_cos, warp};
use std::f32::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// Share of the probability of selecting a light that all lights get equally; the rest is proportional to power.
const EQUAL_SHARE: f64 = 0.05;

/// Smallest cosine at which light paths leave a surface. At smaller ones, densities over the cosine overflow.
const MIN_COSINE: f32 = 1e-6;

/// The lights of a scene, with the distributions that select them.
pub struct Lights {
    emitters: Arc<[Emitter]>,
    choice: Option<Arc<LightSampler>>,
    /// For each instance, the index of its first emitter; `u32::MAX` if the instance does not emit.
    first: Arc<[u32]>,
    /// For each instance and triangle, the index of its emitter minus the instance's entry in `first`; `u32::MAX` for
    /// triangles without area.
    relative: Arc<[Vec<u32>]>,
    /// Indices of the suns of finite size, which rays can hit.
    suns: Arc<[u32]>,
    /// Indices of the lights whose bulbs camera paths see.
    bulbs: Arc<[u32]>,
    environment: Option<u32>,
    sky: Sky,
    targets: CausticTargets,
    groups: Groups,
}

/// The emitter of a triangle of an emissive material; `None` if the triangle has no area or does not emit.
fn triangle_emitter(shapes: &Shapes, materials: &Materials, instance: u32, primitive: u32) -> Option<Emitter> {
    let placed = &shapes.instances[instance as usize];
    let material = &materials.list[placed.material as usize];
    let mesh = &shapes.meshes[placed.mesh as usize];
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
    if material.clearcoat_ior_texture.is_none() {
        coat_ior = material.clearcoat_ior;
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
    Some(Emitter::Triangle(TriangleLight {
        instance,
        primitive,
        area,
        two_sided: material.double_sided,
        radiance,
        spread: Spread::new(material.spread).below_coat(coat, coat_ior),
        plane,
        corners,
        error: position_error(&corners),
        uniform,
    }))
}

/// A sampled ray that leaves a given light; its densities do not include the selection of the light.
struct LightRay {
    origin: Vec3,
    direction: Vec3,
    /// Emitted flux over the density of the ray (W).
    flux: Rgb,
    /// Density of the ray's point on the light per area, or of its direction per solid angle for light from infinity; 1
    /// for points.
    start: f32,
    /// Density of the ray's direction per solid angle, or of its point of entry into the scene per area for light from
    /// infinity.
    onward: f32,
    /// Cosine of the ray to the normal at the light; 1 at infinity and for points.
    cos: f32,
}

impl Lights {
    /// Lists the emissive triangles of the shapes, then `others` (points, spots, suns), then the environment.
    pub fn new(shapes: &Shapes, materials: &Materials, others: Vec<Emitter>, sky: Sky) -> Lights {
        Lights::build(shapes, materials, others, sky, CausticTargets::new(shapes, materials))
    }

    /// The lights at another moment of a moving scene, with the present light groups. The distributions that select
    /// lights are shared if `changed` is false: no light, no material and not the bounding sphere has changed.
    #[must_use]
    pub fn at_moment(
        &self,
        (shapes, materials): (&Shapes, &Materials),
        others: Vec<Emitter>,
        sky: Sky,
        changed: bool,
    ) -> Lights {
        let targets = self.targets.at_moment(shapes, materials);
        if changed {
            return Lights::build(shapes, materials, others, sky, targets).with_groups(self.groups.clone());
        }
        Lights {
            emitters: Arc::clone(&self.emitters),
            choice: self.choice.clone(),
            first: Arc::clone(&self.first),
            relative: Arc::clone(&self.relative),
            suns: Arc::clone(&self.suns),
            bulbs: Arc::clone(&self.bulbs),
            environment: self.environment,
            sky,
            targets,
            groups: self.groups.clone(),
        }
    }

    fn build(
        shapes: &Shapes,
        materials: &Materials,
        others: Vec<Emitter>,
        sky: Sky,
        targets: CausticTargets,
    ) -> Lights {
        let mut emitters = Vec::new();
        let mut first = vec![u32::MAX; shapes.instances.len()];
        let mut relative = vec![Vec::new(); shapes.instances.len()];
        for (i, instance) in shapes.instances.iter().enumerate() {
            let material = &materials.list[instance.material as usize];
            let grids = material.grids.as_ref().filter(|_| material.medium_emission().is_some());
            if let (Some(grids), Some(placement)) = (grids, &instance.to_world) {
                let (instance, grids, to_world) = (i as u32, Arc::clone(grids), placement.points);
                emitters.push(Emitter::Volume(VolumeLight { instance, grids, to_world }));
            }
            if !material.emits() {
                continue;
            }
            first[i] = emitters.len() as u32;
            for primitive in 0..shapes.meshes[instance.mesh as usize].triangles.len() as u32 {
                let emitter = triangle_emitter(shapes, materials, i as u32, primitive);
                relative[i].push(emitter.as_ref().map_or(u32::MAX, |_| emitters.len() as u32 - first[i]));
                emitters.extend(emitter);
            }
        }
        emitters.extend(others);
        let mut environment = None;
        if sky.environment.is_some() {
            environment = Some(emitters.len() as u32);
            emitters.push(Emitter::Environment);
        }
        let bulbs = (0..emitters.len() as u32).filter(|&i| emitters[i as usize].bulb().is_some()).collect();
        let suns = (0..emitters.len() as u32)
            .filter(|&i| matches!(emitters[i as usize], Emitter::Sun { one_minus_cos, .. } if one_minus_cos > 0.0))
            .collect();
        let powers: Vec<f64> = emitters.iter().map(|e| e.power(&sky)).collect();
        // Next to a sun, a desk light has almost no share of the total power, but it dominates its own table. So every
        // light gets a minimum probability, which is also above the resolution of the random numbers.
        let floor = EQUAL_SHARE * powers.iter().sum::<f64>() / powers.len().max(1) as f64;
        let floored = powers.iter().map(|&power| if power > 0.0 { power + floor } else { 0.0 });
        let choice = LightSampler::new(&emitters, &sky, floored).map(Arc::new);
        let groups = Groups::default();
        let (emitters, first, relative) = (emitters.into(), first.into(), relative.into());
        Lights { emitters, choice, first, relative, suns, bulbs, environment, sky, targets, groups }
    }

    /// Assigns the lights to light groups, whose light gets layers of its own.
    #[must_use]
    pub fn with_groups(self, groups: Groups) -> Lights {
        Lights { groups, ..self }
    }

    /// The light groups of the scene: named sets of lights, each with layers of its own.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// The light group of the light with index `light`; [`Group::NONE`] if it has none.
    #[inline]
    pub fn group(&self, light: u32) -> Group {
        let Groups { names, instances, others, environment, .. } = &self.groups;
        if names.is_empty() {
            return Group::NONE;
        }
        match &self.emitters[light as usize] {
            Emitter::Triangle(TriangleLight { instance, .. }) | Emitter::Volume(VolumeLight { instance, .. }) => {
                instances.get(*instance as usize).copied().unwrap_or_default()
            }
            Emitter::Environment => *environment,
            _ => {
                // `others` are the emitters between the triangles and the environment.
                let last = self.emitters.len() - usize::from(self.environment.is_some());
                (light as usize + others.len())
                    .checked_sub(last)
                    .and_then(|at| others.get(at))
                    .copied()
                    .unwrap_or_default()
            }
        }
    }

    /// The light group of the object that a surface belongs to.
    #[inline]
    pub fn surface_group(&self, surface: &Surface) -> Group {
        self.object_group(surface.instance)
    }

    /// The light group of an instance (an object).
    #[inline]
    pub fn object_group(&self, instance: u32) -> Group {
        self.groups.instances.get(instance as usize).copied().unwrap_or_default()
    }

    /// Whether no light of the scene has any power.
    pub fn is_empty(&self) -> bool {
        self.choice.is_none()
    }

    /// Exponent to base 2 of the total power of all lights over the squared radius of the scene (W/m2); 0 without lights.
    /// Unlike power, it does not depend on the unit of length in which the scene is modelled.
    pub fn irradiance_exponent(&self) -> i32 {
        let power: f64 = self.emitters.iter().map(|emitter| emitter.power(&self.sky)).sum();
        let irradiance = power / f64::from(self.sky.radius).powi(2);
        if irradiance.is_normal() { ((irradiance.to_bits() >> 52) & 0x7ff) as i32 - 1023 } else { 0 }
    }

    /// The lights that belong to no object and are not the environment: points, spots and suns.
    pub fn others(&self) -> impl Iterator<Item = &Emitter> {
        let of_objects = |light: &Emitter| matches!(light, Emitter::Triangle(_) | Emitter::Volume(_));
        self.emitters.iter().filter(move |light| !of_objects(light) && !matches!(light, Emitter::Environment))
    }

    /// The lights, indexed by [`EmissionSample::light`].
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// The scene's bounding sphere, and the environment around it.
    pub fn sky(&self) -> &Sky {
        &self.sky
    }

    /// Caustic targets: the bounding spheres of the objects that can make caustics.
    pub fn targets(&self) -> &CausticTargets {
        &self.targets
    }

    /// The distribution that selects lights by power; `None` if no light has any.
    pub(super) fn choice(&self) -> Option<&Cdf> {
        self.choice.as_ref().map(|choice| choice.power())
    }

    /// Probability of selecting a light for next-event estimation at a receiver, over the probability of selecting it
    /// for the start of a light path.
    #[inline]
    pub fn choice_ratio(&self, receiver: &Receiver, light: u32) -> f32 {
        let Some(choice) = &self.choice else { return 1.0 };
        choice.pdf(receiver, light as usize) / choice.power().pdf(light as usize)
    }

    /// Ranges of emitter indices that belong to one object (the triangles of an instance, or a single other light),
    /// each with the probability that selection by power gives an emitter in the range.
    pub(super) fn emitters_by_object(&self) -> impl Iterator<Item = (Range<usize>, f64)> {
        let same = |a: &Emitter, b: &Emitter| match (a, b) {
            (
                Emitter::Triangle(TriangleLight { instance: a, .. }),
                Emitter::Triangle(TriangleLight { instance: b, .. }),
            ) => a == b,
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

    /// Whether camera paths see the bulb of any light.
    #[inline]
    pub fn has_bulbs(&self) -> bool {
        !self.bulbs.is_empty()
    }

    /// Calls `each(radiance, distance, group)` for every bulb on the ray from `origin` along the unit `d`, up to the
    /// distance `reach`. The light comes from all points of the bulb along the ray; `distance` is that of one of them,
    /// which the uniform number `u` selects. `camera`: the ray starts at the camera.
    pub fn for_each_bulb(
        &self,
        (origin, d): (Vec3, Vec3),
        reach: f32,
        camera: bool,
        u: f32,
        mut each: impl FnMut(Rgb, f32, Group),
    ) {
        for &index in self.bulbs.iter() {
            let emitter = &self.emitters[index as usize];
            if camera && emitter.bulb().is_some_and(|bulb| bulb.hidden_from_camera) {
                continue;
            }
            let (ball, intensity) = match emitter {
                Emitter::Spot { p, radius, frame, intensity, inner, outer, edge, .. } => {
                    ((*p, *radius), *intensity * spot_falloff(one_minus_cos(-d, frame.n), *inner, *outer, *edge))
                }
                Emitter::Shaped(shaped) => ((shaped.p, shaped.radius), shaped.intensity_along(-d)),
                _ => continue,
            };
            if intensity != Rgb::ZERO
                && let Some((share, distance)) = crossed_share(ball, origin, d, reach, u)
            {
                each(intensity * (share / (PI * ball.1 * ball.1)), distance, self.group(index));
            }
        }
    }

    /// Density per solid angle with which light `index`, not at infinity, emits along the unit `d` from any of its
    /// points, and the cosine at the light; `None` if it emits nothing along `d`.
    #[inline]
    pub(super) fn direction_density(&self, index: usize, d: Vec3) -> Option<(f32, f32)> {
        match &self.emitters[index] {
            Emitter::Triangle(TriangleLight { two_sided, spread, plane, .. }) => {
                let cos = plane.truncate().dot(d);
                let cos = if *two_sided { cos.abs() } else { cos };
                let density = if cos >= MIN_COSINE { Self::cosine_density(cos, *two_sided, spread) } else { 0.0 };
                (density > 0.0).then_some((density, cos))
            }
            Emitter::Point { .. } | Emitter::Volume(_) => Some((0.5 / TAU, 1.0)),
            Emitter::Spot { frame, inner, outer, edge, .. } => {
                let falloff = spot_falloff(one_minus_cos(d, frame.n), *inner, *outer, *edge);
                (falloff > 0.0).then(|| (falloff / spot_solid_angle(*inner, *outer, *edge), 1.0))
            }
            Emitter::Shaped(shaped) => {
                let density = shaped.pdf_w(d);
                (density > 0.0).then_some((density, 1.0))
            }
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// Selects a light for a receiver and samples a point of it (next-event estimation). `None` if the selected light
    /// does not shine on the receiver.
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
        let mut sample = self.sample_light(shapes, materials, receiver.p, (index, probability), u)?;
        sample.arrival_factor *= self.choice()?.pdf(index) / probability;
        Some(sample)
    }

    /// Density per area (1/m2) with which light paths from the sampled point or direction of a light arrive on a surface
    /// at the receiver `p` that faces `sample.wi`, times the probability of selecting the light for emission over the
    /// probability of selecting it in [`Lights::sample_direct`]. Separate from sampling, because only methods with light
    /// paths need it.
    #[inline]
    pub fn arrival_pdf_a(&self, sample: &DirectSample, p: Vec3) -> f32 {
        let entry = if sample.target.is_none() { self.entry_pdf_a(p, sample.wi) } else { 1.0 };
        sample.arrival_factor * entry
    }

    /// Samples a point of the light `index`, which was selected with `probability`, as seen from `p`. `None` if the
    /// light does not shine on `p`.
    #[inline]
    fn sample_light(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        p: Vec3,
        (index, probability): (usize, f32),
        u: Vec2,
    ) -> Option<DirectSample> {
        let light = index as u32;
        match &self.emitters[index] {
            Emitter::Triangle(triangle) => {
                Self::sample_triangle(triangle, (shapes, materials), p, (light, probability), u)
            }
            Emitter::Point { p: at, intensity } => {
                let to = *at - p;
                let (wi, target, pdf_w) = (to.try_normalize()?, Some(*at), probability);
                let radiance = *intensity / to.length_squared();
                let arrival_factor = 0.5 / TAU / to.length_squared();
                Some(DirectSample { wi, target, radiance, pdf_w, delta: true, arrival_factor, light })
            }
            Emitter::Spot { p: middle, radius, frame, intensity, inner, outer, edge, bulb } => {
                let at = spot_point((*middle, *radius, *bulb), frame, u);
                let to = at - p;
                let (wi, target, pdf_w) = (to.try_normalize()?, Some(at), probability);
                let falloff = spot_falloff(one_minus_cos(-wi, frame.n), *inner, *outer, *edge);
                if falloff == 0.0 {
                    return None;
                }
                let radiance = *intensity * (falloff / to.length_squared());
                let arrival_factor = falloff / (spot_solid_angle(*inner, *outer, *edge) * to.length_squared());
                Some(DirectSample { wi, target, radiance, pdf_w, delta: true, arrival_factor, light })
            }
            Emitter::Shaped(shaped) => Self::sample_shaped(shaped, p, (light, probability), u),
            Emitter::Volume(volume) => Self::sample_volume(volume, p, (light, probability), u),
            Emitter::Sun { frame, irradiance, one_minus_cos, .. } => {
                if *one_minus_cos == 0.0 {
                    let (wi, radiance, pdf_w) = (frame.n, *irradiance, probability);
                    return Some(DirectSample {
                        wi,
                        target: None,
                        radiance,
                        pdf_w,
                        delta: true,
                        arrival_factor: 1.0,
                        light,
                    });
                }
                let wi = frame.to_world(warp::cone_uniform(u, *one_minus_cos));
                let radiance = Emitter::sun_radiance(*irradiance, *one_minus_cos);
                let pdf_w = probability * warp::cone_uniform_pdf_w(*one_minus_cos);
                Some(DirectSample { wi, target: None, radiance, pdf_w, delta: false, arrival_factor: 1.0, light })
            }
            Emitter::Environment => {
                let environment = self.sky.environment.as_ref()?;
                let EnvironmentSample { wi, pdf_w, radiance } = environment.sample(u)?;
                let (pdf_w, arrival_factor) = (probability * pdf_w, 1.0);
                let sample = DirectSample { wi, target: None, radiance, pdf_w, delta: false, arrival_factor, light };
                (pdf_w > 0.0).then_some(sample)
            }
        }
    }

    /// Does the work of [`Lights::sample_light`] for a point or a spot with a distribution of its own. Not inlined, so
    /// that the common lights stay fast.
    #[inline(never)]
    fn sample_shaped(shaped: &ShapedLight, p: Vec3, (light, probability): (u32, f32), u: Vec2) -> Option<DirectSample> {
        let at = shaped.point(u);
        let to = at - p;
        let (wi, distance2) = (to.try_normalize()?, to.length_squared());
        let radiance = shaped.intensity_along(-wi) / distance2;
        if radiance == Rgb::ZERO {
            return None;
        }
        let arrival_factor = shaped.pdf_w(-wi) / distance2;
        Some(DirectSample { wi, target: Some(at), radiance, pdf_w: probability, delta: true, arrival_factor, light })
    }

    /// Does the work of [`Lights::sample_light`] for a medium that emits.
    #[inline(never)]
    fn sample_volume(volume: &VolumeLight, p: Vec3, (light, probability): (u32, f32), u: Vec2) -> Option<DirectSample> {
        let (at, intensity) = volume.sample(u)?;
        let to = at - p;
        let (wi, distance2) = (to.try_normalize()?, to.length_squared());
        let (radiance, arrival_factor) = (intensity / distance2, 0.5 / TAU / distance2);
        Some(DirectSample { wi, target: Some(at), radiance, pdf_w: probability, delta: true, arrival_factor, light })
    }

    /// Does the work of [`Lights::sample_light`] for a triangle.
    #[inline(always)]
    fn sample_triangle(
        triangle: &TriangleLight,
        (shapes, materials): (&Shapes, &Materials),
        p: Vec3,
        (light, probability): (u32, f32),
        u: Vec2,
    ) -> Option<DirectSample> {
        // Most receivers are behind some one-sided light, so this cheap test comes first. Near the plane, rounding
        // decides.
        let ng = triangle.normal();
        if !triangle.two_sided && ng.dot(p) <= triangle.plane.w {
            return None;
        }
        let b = warp::triangle_uniform(u);
        let at = triangle.point(b);
        let to = at - p;
        let distance2 = to.length_squared();
        let wi = to.try_normalize()?;
        let cos = -ng.dot(wi);
        if cos == 0.0 || (cos < 0.0 && !triangle.two_sided) {
            return None;
        }
        let relative = triangle.spread.relative_radiance(cos.abs());
        if relative == 0.0 {
            return None;
        }
        let radiance = triangle.radiance_at(shapes, materials, b)? * relative;
        let pdf_w = probability * distance2 / (triangle.area * cos.abs());
        let arrival_factor = Self::cosine_density(cos.abs(), triangle.two_sided, &triangle.spread) / distance2;
        let target = Some(shadow_end(at, ng, -wi, triangle.error, distance2.sqrt()));
        Some(DirectSample { wi, target, radiance, pdf_w, delta: false, arrival_factor, light })
    }

    /// The point on a light that [`Lights::sample_direct`] samples for any receiver in a medium with these random
    /// numbers, and the cone of its light if it is a spot. `None` for light from infinity.
    #[inline]
    pub fn sample_point(&self, choice: f64, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        let (index, ..) = self.choice()?.sample(choice);
        match &self.emitters[index] {
            Emitter::Triangle(triangle) => Some((triangle.point(warp::triangle_uniform(u)), None)),
            Emitter::Point { p, .. } => Some((*p, None)),
            Emitter::Spot { p, radius, frame, outer, bulb, .. } => {
                let at = spot_point((*p, *radius, *bulb), frame, u);
                Some((at, Cone::new(at, frame.n, *outer)))
            }
            Emitter::Shaped(shaped) => {
                let at = shaped.point(u);
                Some((at, Cone::new(at, shaped.frame.n, shaped.distribution.reach())))
            }
            Emitter::Volume(volume) => volume.sample(u).map(|(at, _)| (at, None)),
            Emitter::Sun { .. } | Emitter::Environment => None,
        }
    }

    /// Radiance that a surface hit by a ray emits along `wo`, back to the ray's origin `from`, and the density per
    /// solid angle with which next-event estimation at `from` ([`Lights::sample_direct`]) samples that point. The
    /// density is 0 for a light that touches the surface at the origin.
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

    /// Density per solid angle with which light paths leave a triangle in a direction of cosine `cos` to its normal.
    #[inline]
    fn cosine_density(cos: f32, two_sided: bool, spread: &Spread) -> f32 {
        spread.pdf_w(cos) * if two_sided { 0.5 } else { 1.0 }
    }

    /// Density per area (1/m2) with which light paths from infinity, aimed at caustic targets, start along the line
    /// through `p` with unit direction `wi` towards the light.
    #[inline]
    pub fn entry_pdf_a(&self, p: Vec3, wi: Vec3) -> f32 {
        self.targets.density(&self.sky, p, wi)
    }

    /// Radiance that a surface emits along `wo` towards the point `from`, and the densities with which a light path
    /// starts at that point of the surface along `wo`.
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
        let Emitter::Triangle(TriangleLight { area, two_sided, spread, .. }) = &self.emitters[index] else {
            return None;
        };
        let cos = surface.ng.dot(wo);
        if !(cos > 0.0 || (*two_sided && cos < 0.0)) {
            return None;
        }
        let radiance = materials.list[surface.material as usize].emitted(surface, &materials.textures);
        let cos = cos.abs();
        let radiance = radiance * spread.relative_radiance(cos);
        let choice = self.choice.as_ref()?;
        let [direct, start] = [choice.pdf(from, index), choice.power().pdf(index)].map(|chosen| chosen / area);
        let onward = Self::cosine_density(cos, *two_sided, spread);
        Some((radiance, EmissionDensity { direct, start, onward, cos, infinite: false, delta: false }))
    }

    /// Calls `each(radiance, direct, start, group)` for every light at infinity that a ray from `from` along `d`
    /// reaches when it leaves the scene, with the densities of [`EmissionDensity`] and the light group. Camera rays
    /// skip lights that are hidden from cameras.
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
            let (radiance, pdf_w) = environment.radiance_and_pdf_w(d);
            met(radiance, index, pdf_w);
        }
        for &index in self.suns.iter() {
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

    /// Samples the start of a light path: selects a light by power, then a point and a direction of it.
    #[inline]
    pub fn sample_emission(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        choice: f64,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let emission = self.sample_start(shapes, materials, choice, point, direction)?;
        // Non-finite flux is emitted too, so that the pixels it reaches report it.
        (emission.flux.max_element() > 0.0 || !emission.flux.is_finite()).then_some(emission)
    }

    /// Does the work of [`Lights::sample_emission`]. The flux may be zero, in a direction without light.
    #[inline]
    pub(super) fn sample_start(
        &self,
        shapes: &Shapes,
        materials: &Materials,
        choice: f64,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let (index, probability, rest) = self.choice()?.sample(choice);
        let emitter = &self.emitters[index];
        let ray = match emitter {
            Emitter::Triangle(triangle) => {
                Self::emit_from_triangle(triangle, (shapes, materials), rest < 0.5, point, direction)?
            }
            Emitter::Point { p, intensity } => {
                let (direction, flux) = (warp::sphere_uniform(direction), *intensity * (2.0 * TAU));
                LightRay { origin: *p, direction, flux, start: 1.0, onward: 0.5 / TAU, cos: 1.0 }
            }
            Emitter::Spot { .. } => Self::emit_from_spot(emitter, point, direction)?,
            Emitter::Shaped(shaped) => Self::emit_from_shaped(shaped, point, direction)?,
            Emitter::Volume(volume) => {
                let (origin, intensity) = volume.sample(point)?;
                let (direction, flux) = (warp::sphere_uniform(direction), intensity * (2.0 * TAU));
                LightRay { origin, direction, flux, start: 1.0, onward: 0.5 / TAU, cos: 1.0 }
            }
            Emitter::Sun { frame, irradiance, one_minus_cos, .. } => {
                let d = -frame.to_world(warp::cone_uniform(direction, *one_minus_cos));
                // A facing surface receives the irradiance E from the whole cone; a path from one direction carries
                // L / pdf = E / mean cosine.
                let flux = *irradiance * (2.0 / (2.0 - one_minus_cos));
                let start = if *one_minus_cos == 0.0 { 1.0 } else { warp::cone_uniform_pdf_w(*one_minus_cos) };
                let onward = 1.0 / (PI * self.sky.radius * self.sky.radius);
                let (origin, flux) = (self.sample_scene_disc(point, d), flux / onward);
                LightRay { origin, direction: d, flux, start, onward, cos: 1.0 }
            }
            Emitter::Environment => {
                let environment = self.sky.environment.as_ref()?;
                let EnvironmentSample { wi, pdf_w: start, radiance } = environment.sample(direction)?;
                let onward = 1.0 / (PI * self.sky.radius * self.sky.radius);
                let (origin, flux) = (self.sample_scene_disc(point, -wi), radiance / (start * onward));
                LightRay { origin, direction: -wi, flux, start, onward, cos: 1.0 }
            }
        };
        let LightRay { origin, direction, flux, start, onward, cos } = ray;
        let flux = flux / probability;
        let (infinite, delta) = (emitter.is_infinite(), emitter.is_delta());
        let start = start * probability;
        let density = EmissionDensity { direct: start, start, onward, cos, infinite, delta };
        let (light, entry) = (index as u32, EntryDisc::Whole);
        Some(EmissionSample { origin, direction, flux, light, delta, infinite, entry, density })
    }

    /// Turns the start of a light path at a light that is not at infinity into the unit direction `d`, with the flux and
    /// the densities that unguided emission has there. `None` if the light emits nothing along `d`.
    pub(super) fn redirect(&self, emission: &mut EmissionSample, d: Vec3) -> Option<()> {
        let (onward, cos) = self.direction_density(emission.light as usize, d)?;
        match &self.emitters[emission.light as usize] {
            Emitter::Shaped(shaped) => {
                emission.flux = shaped.intensity_along(d) / (onward * emission.density.start);
                if emission.flux == Rgb::ZERO {
                    return None;
                }
            }
            Emitter::Triangle(TriangleLight { spread, .. }) if *spread != Spread::LAMBERTIAN => {
                let before = spread.relative_radiance(emission.density.cos);
                if before == 0.0 {
                    return None;
                }
                emission.flux *= spread.relative_radiance(cos) / before;
            }
            _ => {}
        }
        emission.direction = d;
        (emission.density.onward, emission.density.cos) = (onward, cos);
        Some(())
    }

    /// Samples a ray that leaves a triangle; `back` selects its back side, if it emits from both sides.
    #[inline(always)]
    fn emit_from_triangle(
        triangle: &TriangleLight,
        (shapes, materials): (&Shapes, &Materials),
        back: bool,
        point: Vec2,
        direction: Vec2,
    ) -> Option<LightRay> {
        let b = warp::triangle_uniform(point);
        let (ng, two_sided) = (triangle.normal(), triangle.two_sided);
        let frame = Frame::from_normal(if two_sided && back { -ng } else { ng });
        let (d, weight) = triangle.spread.sample(direction);
        let d = frame.to_world(d);
        let radiance = triangle.radiance_at(shapes, materials, b)?;
        let cos = ng.dot(d).abs();
        if cos < MIN_COSINE {
            return None;
        }
        let flux = radiance * (PI * triangle.area * weight * if two_sided { 2.0 } else { 1.0 });
        let origin = offset_origin(triangle.point(b), ng, d, triangle.error);
        let onward = Self::cosine_density(cos, two_sided, &triangle.spread);
        Some(LightRay { origin, direction: d, flux, start: 1.0 / triangle.area, onward, cos })
    }

    /// Samples a ray that leaves a spot.
    #[inline(always)]
    fn emit_from_spot(spot: &Emitter, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let Emitter::Spot { p, radius, frame, intensity, inner, outer, edge, bulb } = spot else { return None };
        // The full cone and the penumbra are selected by their flux. In the penumbra, the integral of the falloff is
        // inverted, so every path carries the same flux.
        let penumbra = (outer - inner) * edge.mean();
        let x = direction.x * (inner + penumbra);
        let h = if x < *inner { x } else { outer - (outer - inner) * edge.ramp((x - inner) / penumbra) };
        let sin = (h * (2.0 - h)).max(0.0).sqrt();
        let filled = spot_solid_angle(*inner, *outer, *edge);
        let falloff = spot_falloff(h, *inner, *outer, *edge);
        let direction = frame.to_world(warp::around_z(sin, 1.0 - h, direction.y));
        let (origin, flux) = (spot_point((*p, *radius, *bulb), frame, point), *intensity * filled);
        Some(LightRay { origin, direction, flux, start: 1.0, onward: falloff / filled, cos: 1.0 })
    }

    /// Samples a ray that leaves a point or a spot with a distribution of its own.
    #[inline(never)]
    fn emit_from_shaped(shaped: &ShapedLight, point: Vec2, direction: Vec2) -> Option<LightRay> {
        let (local, onward) = shaped.distribution.sample(direction)?;
        let flux = shaped.intensity * shaped.distribution.relative(local) / onward;
        let (origin, direction) = (shaped.point(point), shaped.frame.to_world(local));
        Some(LightRay { origin, direction, flux, start: 1.0, onward, cos: 1.0 })
    }

    /// Aims the start of a light path from infinity at caustic targets (see [`CausticTargets::aim`]). Starts at other
    /// lights do not change.
    #[inline]
    pub fn aim(&self, emission: &mut EmissionSample, u: f32, point: Vec2) {
        if emission.infinite {
            self.targets.aim(&self.sky, emission, u, point);
        }
    }

    /// Aims the start of a light path from infinity at caustic targets, and part of the starts at the region of
    /// interest, if there is one. Flux and density do not account for the region yet: see
    /// [`Lights::density_with_region`].
    #[inline]
    pub fn aim_with_region(&self, emission: &mut EmissionSample, region: Option<Region>, u: f32, point: Vec2) {
        match region {
            Some(region) if emission.infinite => {
                self.targets.aim_with_region(&self.sky, emission, region, u, point);
            }
            _ => self.aim(emission, u, point),
        }
    }

    /// Density of a light path's start as it would be without aiming at caustic targets.
    #[inline]
    pub fn unaimed_density(&self, emission: &EmissionSample) -> f32 {
        if emission.infinite { 1.0 / (PI * self.sky.radius * self.sky.radius) } else { emission.density.onward }
    }

    /// Density of an aimed start in the mixture of the discs of scene, caustic targets and region of interest, and the
    /// part of this density without the targets (paths through the disc of the whole scene or of the region).
    #[inline]
    pub fn density_with_region(&self, emission: &EmissionSample, region: Option<Region>) -> (f32, f32) {
        let onward = emission.density.onward;
        match region {
            _ if !emission.infinite => (onward, onward),
            Some(region) => self.targets.density_with_region(&self.sky, emission, region),
            None => (onward, onward * self.targets.unaimed_share(&self.sky, emission)),
        }
    }

    /// Samples a point of the disc perpendicular to `d`, as wide as the scene's bounding sphere, through which light of
    /// direction `d` enters the scene.
    fn sample_scene_disc(&self, u: Vec2, d: Vec3) -> Vec3 {
        let frame = Frame::from_normal(d);
        let q = warp::disc_concentric(u) * self.sky.radius;
        self.sky.center + frame.t * q.x + frame.b * q.y - d * self.sky.radius
    }

    /// Whether any triangle of the instance (object) is a light.
    pub fn emits(&self, instance: u32) -> bool {
        self.relative[instance as usize].iter().any(|&i| i != u32::MAX)
    }
}
