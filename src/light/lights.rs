//! All lights of a scene: selecting one, sampling it from a point, sampling emission, and the densities for MIS.

use super::Region;
use super::aim::CausticTargets;
use super::bulb::crossed_share;
use super::cdf::Cdf;
use super::cone::Cone;
use super::emission::{DirectSample, EmissionDensity, EmissionSample, EntryDisc};
use super::environment::EnvironmentSample;
use super::group::{Group, Groups};
use super::kind::{
    Emitter, EnvironmentLight, Light, LightRay, Owner, SceneParts, Selected, TriangleLight, VolumeLight,
};
use super::learnt::LearntLight;
use super::learnt_lights::LightBins;
use super::learnt_sky::LearntSky;
use super::learnt_table::LitSample;
use super::links::{LightLinks, LinkedObjects, Linking};
use super::receiver::Receiver;
use super::sampler::LightSampler;
use super::sky::Sky;
use crate::geometry::{Shapes, Surface};
use crate::material::{Materials, Objects};
use crate::math::{Rgb, Vec2, Vec3};
use std::f32::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// Share of the probability of selecting a light that all lights get equally; the rest is proportional to power.
const EQUAL_SHARE: f64 = 0.05;

/// The lights of a scene, with the distributions that select them.
#[derive(Clone)]
pub struct Lights {
    emitters: Arc<[Emitter]>,
    choice: Option<Arc<LightSampler>>,
    /// For each instance, the index of its first emitter; `u32::MAX` if the instance does not emit.
    first: Arc<[u32]>,
    /// For each instance and triangle, the index of its emitter minus the instance's entry in `first`; `u32::MAX` for
    /// triangles without area.
    relative: Arc<[Vec<u32>]>,
    /// Indices of the lights at infinity that rays can reach: the environment, then the suns of finite size.
    infinite: Arc<[u32]>,
    /// Indices of the lights whose bulbs camera paths see.
    bulbs: Arc<[u32]>,
    sky: Sky,
    targets: CausticTargets,
    groups: Groups,
    links: LightLinks,
}

impl Lights {
    /// Lists the emissive triangles of the shapes, then `others` (points, spots, suns), then the environment.
    pub fn new(objects: Objects<'_>, others: Vec<Emitter>, sky: Sky) -> Lights {
        Lights::build(objects, others, sky, CausticTargets::new(objects))
    }

    /// The lights at another moment of a moving scene, with the present light groups. The distributions that select
    /// lights are shared if `changed` is false: no light, no material and not the bounding sphere has changed.
    #[must_use]
    pub fn at_moment(&self, objects: Objects<'_>, others: Vec<Emitter>, sky: Sky, changed: bool) -> Lights {
        let targets = self.targets.at_moment(objects);
        if changed {
            let lights = Lights::build(objects, others, sky, targets);
            return lights.with_groups(self.groups.clone()).with_links(self.links.clone());
        }
        Lights {
            emitters: Arc::clone(&self.emitters),
            choice: self.choice.clone(),
            first: Arc::clone(&self.first),
            relative: Arc::clone(&self.relative),
            infinite: Arc::clone(&self.infinite),
            bulbs: Arc::clone(&self.bulbs),
            sky,
            targets,
            groups: self.groups.clone(),
            links: self.links.clone(),
        }
    }

    fn build(objects: Objects<'_>, others: Vec<Emitter>, sky: Sky, targets: CausticTargets) -> Lights {
        let mut emitters = Vec::new();
        let instances = &objects.shapes.instances;
        let mut first = vec![u32::MAX; instances.len()];
        let mut relative = vec![Vec::new(); instances.len()];
        for (i, instance) in instances.iter().enumerate() {
            let material = objects.material(instance);
            let grids = material.grids.as_ref().filter(|_| material.medium_emission().is_some());
            if let (Some(grids), Some(placement)) = (grids, &instance.to_world) {
                let (instance, grids, to_world) = (i as u32, Arc::clone(grids), placement.points);
                emitters.push(VolumeLight { instance, grids, to_world }.into());
            }
            if !material.emits() {
                continue;
            }
            first[i] = emitters.len() as u32;
            for primitive in 0..objects.mesh(instance).triangles.len() as u32 {
                let emitter = TriangleLight::new(objects, i as u32, primitive);
                relative[i].push(emitter.as_ref().map_or(u32::MAX, |_| emitters.len() as u32 - first[i]));
                emitters.extend(emitter.map(Emitter::from));
            }
        }
        emitters.extend(others);
        if sky.shines() {
            emitters.push(EnvironmentLight.into());
        }
        let indices = |which: &dyn Fn(&Emitter) -> bool| -> Vec<u32> {
            (0..emitters.len() as u32).filter(|&i| which(&emitters[i as usize])).collect()
        };
        let bulbs = indices(&|light| light.bulb().is_some()).into();
        let mut infinite = indices(&|light| light.is_infinite() && !light.is_delta());
        infinite.sort_by_key(|&i| emitters[i as usize].owner() != Owner::Environment);
        let powers: Vec<f64> = emitters.iter().map(|e| e.power(&sky)).collect();
        // Next to a sun, a desk light has almost no share of the total power, but it dominates its own table. So every
        // light gets a minimum probability, which is also above the resolution of the random numbers.
        let floor = EQUAL_SHARE * powers.iter().sum::<f64>() / powers.len().max(1) as f64;
        let floored = powers.iter().map(|&power| if power > 0.0 { power + floor } else { 0.0 });
        let choice = LightSampler::new(&emitters, &sky, floored).map(Arc::new);
        let (groups, links) = (Groups::default(), LightLinks::default());
        let (emitters, first, relative, infinite) = (emitters.into(), first.into(), relative.into(), infinite.into());
        Lights { emitters, choice, first, relative, infinite, bulbs, sky, targets, groups, links }
    }

    /// Assigns the lights to light groups, whose light gets layers of its own.
    #[must_use]
    pub fn with_groups(self, groups: Groups) -> Lights {
        Lights { groups, ..self }
    }

    /// Replaces what is known about where light arrives. What was learnt about other lights than these is left out.
    #[must_use]
    pub fn with_learnt(self, learnt: &LearntLight) -> Lights {
        let is_same =
            |sky: &Arc<LearntSky>| self.sky.environment.as_ref().is_some_and(|environment| sky.is_of(environment));
        let sky = learnt.sky.clone().filter(is_same);
        let choice = self.choice.map(|choice| Arc::new(choice.with_learnt(learnt.lights.as_ref())));
        Lights { sky: Sky { learnt: sky, ..self.sky }, choice, ..self }
    }

    /// The bins of lights for which probabilities can be learnt; `None` if there is nothing to choose.
    pub fn bins(&self) -> Option<LightBins> {
        self.choice.as_ref()?.bins()
    }

    /// The sample of the light with an index at a receiver, from which `bins` learn. `value`: the light that the receiver
    /// scatters, over the density of the sample. `bounce`: density with which a bounce finds the point of the light, over
    /// that of the sample.
    pub fn lit(&self, bins: &LightBins, at: &Receiver, light: u32, value: f32, bounce: f32) -> LitSample {
        let probability = self.choice.as_ref().map_or(0.0, |choice| choice.pdf(at, light as usize));
        bins.lit(at, light, probability, value, bounce)
    }

    /// Limits the light and the shadows of lights to some objects.
    #[must_use]
    pub fn with_links(self, links: LightLinks) -> Lights {
        Lights { links, ..self }
    }

    /// The linkings of each light.
    pub fn links(&self) -> &LightLinks {
        &self.links
    }

    /// Whether a receiver receives the light of the light with index `light`, as far as light linking decides.
    #[inline]
    pub fn shines_on(&self, light: u32, receiver: &Receiver) -> bool {
        self.links.is_empty() || self.linked(light).lights(receiver)
    }

    /// The objects that block the light of the light with index `light`.
    #[inline]
    pub fn blockers(&self, light: u32) -> Linking {
        if self.links.is_empty() { Linking::default() } else { self.linked(light).blockers }
    }

    /// The linkings of the light with index `light`. Media that emit light have none, as in Cycles.
    #[inline]
    fn linked(&self, light: u32) -> LinkedObjects {
        let LightLinks { instances, others, .. } = &self.links;
        let linked = match self.emitters[light as usize].owner() {
            Owner::Surface(instance) => instances.get(instance as usize),
            Owner::Light => self.other_index(light, others.len()).and_then(|at| others.get(at)),
            Owner::Medium(_) | Owner::Environment => None,
        };
        linked.copied().unwrap_or_default()
    }

    /// Index of a light among the `count` points, spots and suns.
    #[inline]
    fn other_index(&self, light: u32, count: usize) -> Option<usize> {
        // They are the emitters between the triangles and the environment.
        let last = self.emitters.len() - usize::from(self.sky.shines());
        (light as usize + count).checked_sub(last)
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
        match self.emitters[light as usize].owner() {
            Owner::Surface(instance) | Owner::Medium(instance) => {
                instances.get(instance as usize).copied().unwrap_or_default()
            }
            Owner::Environment => *environment,
            Owner::Light => {
                let index = self.other_index(light, others.len());
                index.and_then(|at| others.get(at)).copied().unwrap_or_default()
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
        self.emitters.iter().filter(|light| light.owner() == Owner::Light)
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

    /// Density with which next-event estimation at a receiver samples a point of a light, or the direction `wi` towards
    /// light from infinity, over the density with which light paths start there.
    #[inline]
    pub fn next_event_ratio(&self, receiver: &Receiver, light: u32, wi: Vec3) -> f32 {
        let (Some(choice), index) = (&self.choice, light as usize) else { return 1.0 };
        let chosen = choice.pdf(receiver, index) / choice.power().pdf(index);
        chosen * self.emitters[index].relative_density(&self.sky, receiver, wi)
    }

    /// Ranges of emitter indices that belong to one object (the triangles of an instance, or a single other light),
    /// each with the probability that selection by power gives an emitter in the range.
    pub(super) fn emitters_by_object(&self) -> impl Iterator<Item = (Range<usize>, f64)> {
        let same = |a: &Emitter, b: &Emitter| matches!(a.owner(), Owner::Surface(_)) && a.owner() == b.owner();
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

    /// Calls `each(radiance, distance, light)` for every bulb on the ray from `origin` along the unit `d`, up to the
    /// distance `reach(light)`. The light comes from all points of the bulb along the ray; `distance` is that of one of
    /// them, which the uniform number `u` selects. `camera`: the ray starts at the camera.
    pub fn for_each_bulb(
        &self,
        origin: Vec3,
        d: Vec3,
        reach: impl Fn(u32) -> f32,
        camera: bool,
        u: f32,
        mut each: impl FnMut(Rgb, f32, u32),
    ) {
        for &index in self.bulbs.iter() {
            let emitter = &self.emitters[index as usize];
            if camera && emitter.bulb().is_some_and(|bulb| bulb.hidden_from_camera) {
                continue;
            }
            let Some(((p, radius), intensity)) = emitter.bulb_along(-d) else { continue };
            if intensity != Rgb::ZERO
                && let Some((share, distance)) = crossed_share(p, radius, origin, d, reach(index), u)
            {
                each(intensity * (share / (PI * radius * radius)), distance, index);
            }
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
        if !self.shines_on(index as u32, receiver) {
            return None;
        }
        let (scene, selected) = (self.scene(shapes, materials), Selected { light: index as u32, probability });
        let mut sample = self.emitters[index].sample(&scene, receiver, selected, u)?;
        sample.arrival_factor *= self.choice()?.pdf(index) / probability;
        Some(sample)
    }

    /// Samples the environment for a receiver; `None` if there is none.
    pub fn sample_environment(&self, receiver: &Receiver, u: Vec2) -> Option<DirectSample> {
        let light = *self.infinite.first()?;
        let (EnvironmentSample { wi, radiance, .. }, pdf_w) = self.sky.sample_at(receiver, u)?;
        let selected = Selected { light, probability: self.choice.as_ref()?.pdf(receiver, light as usize) };
        Some(selected.infinite(wi, radiance, pdf_w, false))
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

    fn scene<'a>(&'a self, shapes: &'a Shapes, materials: &'a Materials) -> SceneParts<'a> {
        SceneParts { shapes, materials, sky: &self.sky }
    }

    /// The point on a light that [`Lights::sample_direct`] samples for any receiver in a medium with these random
    /// numbers, and the cone of its light if it is a spot. `None` for light from infinity.
    #[inline]
    pub fn sample_point(&self, choice: f64, u: Vec2) -> Option<(Vec3, Option<Cone>)> {
        let (index, ..) = self.choice()?.sample(choice);
        self.emitters[index].point(u)
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

    /// Density per area (1/m2) with which light paths from infinity, aimed at caustic targets, start along the line
    /// through `p` with unit direction `wi` towards the light.
    #[inline]
    pub fn entry_pdf_a(&self, p: Vec3, wi: Vec3) -> f32 {
        self.targets.density(&self.sky, p, wi)
    }

    /// Index of the light that a surface belongs to; `None` if it emits nothing.
    #[inline]
    pub fn surface_light(&self, surface: &Surface) -> Option<u32> {
        let first = self.first[surface.instance as usize];
        if first == u32::MAX {
            return None;
        }
        let relative = self.relative[surface.instance as usize][surface.primitive as usize];
        (relative != u32::MAX).then_some(first + relative)
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
        let index = self.surface_light(surface)? as usize;
        let Emitter::Triangle(triangle) = &self.emitters[index] else { return None };
        if !self.shines_on(index as u32, from) {
            return None;
        }
        let (relative, onward, cos) = triangle.along(surface, wo)?;
        let radiance = materials.list[surface.material as usize].emitted(surface, &materials.textures) * relative;
        let choice = self.choice.as_ref()?;
        let [direct, start] = [choice.pdf(from, index), choice.power().pdf(index)].map(|chosen| chosen / triangle.area);
        let direct = direct * triangle.density_at(from, surface.p.distance_squared(from.p), cos);
        Some((radiance, EmissionDensity { direct, start, onward, cos, infinite: false, delta: false }))
    }

    /// Calls `each(radiance, direct, start, group)` for every light at infinity that a ray from `from` along `d`
    /// reaches when it leaves the scene, with the densities of [`EmissionDensity`] and the light group. Camera rays
    /// skip lights that are hidden from cameras, other rays those that [`Lights::for_each_linked_sun`] calls.
    #[inline]
    pub fn for_each_infinite(
        &self,
        from: &Receiver,
        d: Vec3,
        camera: bool,
        mut each: impl FnMut(Rgb, f32, f32, Group),
    ) {
        let Some(choice) = &self.choice else { return };
        for &index in self.infinite.iter() {
            if self.shines_on(index, from)
                && (camera || self.blockers(index).is_all())
                && let Some(light) = self.emitters[index as usize].arriving(&self.sky, from, d, camera)
            {
                let [direct, start] = [choice.pdf(from, index as usize), choice.power().pdf(index as usize)];
                each(light.radiance, direct * light.direct, start * light.start, self.group(index));
            }
        }
    }

    /// Calls `each(light, radiance, density)` for every sun with shadow linking whose disc a ray from `from` along `d`
    /// points to: its index, its radiance, and the density with which next-event estimation samples the direction.
    pub fn for_each_linked_sun(&self, from: &Receiver, d: Vec3, mut each: impl FnMut(u32, Rgb, f32)) {
        let Some(choice) = &self.choice else { return };
        for &index in self.infinite.iter() {
            if !self.blockers(index).is_all()
                && self.shines_on(index, from)
                && let Some(light) = self.emitters[index as usize].arriving(&self.sky, from, d, false)
            {
                each(index, light.radiance, choice.pdf(from, index as usize) * light.direct);
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
        let ray = emitter.emit(&self.scene(shapes, materials), rest < 0.5, point, direction)?;
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
        let emitter = &self.emitters[emission.light as usize];
        let (onward, cos) = emitter.density(d)?;
        emission.flux = emitter.redirected_flux(emission, d, onward, cos)?;
        emission.direction = d;
        (emission.density.onward, emission.density.cos) = (onward, cos);
        Some(())
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
        if emission.infinite { self.sky.disc_pdf_a() } else { emission.density.onward }
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

    /// Whether any triangle of the instance (object) is a light.
    pub fn emits(&self, instance: u32) -> bool {
        self.relative[instance as usize].iter().any(|&i| i != u32::MAX)
    }
}
