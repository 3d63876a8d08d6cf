//! Camera paths that gather photons: one path samples its pixel at every bandwidth level.
//!
//! The rules below assign each path of light to one technique, so that it is counted once. X is the vertex where photons
//! may be gathered, seen from the light:
//! - a light, then X: next-event estimation at X and its BSDF sample ([`direct_light`]), for all lobes of X;
//! - a light, at least one bounce, then X: photons, for the broad lobes of X; the continued camera path, for its sharp
//!   lobes;
//! - a delta light, delta bounces only, then X: photons also for the sharp lobes of X, because no continued path could
//!   find that light;
//! - another light, delta bounces only, then the sharp lobes of X: both, weighted ([`crate::transport::gather::glint`]).
//!
//! With [`Indirect::Paths`] photons find caustics only, and the camera path also continues by the broad lobes of X.
//! Between its last broad bounce and a light there is then at least one vertex:
//! - if one of these vertices scatters broadly, next-event estimation there and the camera path find the light;
//! - if all have narrow lobes only, photons of caustics find it at every vertex of the camera path, for broad lobes. The
//!   camera path itself does not count such light.
//!
//! An X in a medium is treated as one with broad lobes only. Each segment has one in every medium that it crosses, and
//! continues to the surface behind ([`crate::transport::walk::flight`]).

use super::bandwidths::GatherBandwidths;
use super::glint::{Glints, Onward};
use super::photon_batch::{Scratch, Waiting};
use super::volume::Volume;
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::light::{EmissionDensity, Receiver};
use crate::math::{Rgb, Vec3};
use crate::medium::FlightDensity;
use crate::path_class::{CameraSuffix, ClassSet, Event, LightPrefix, Part, PathClass};
use crate::photon::{ByKind, Kernel, Near, Photon, PhotonMaps, VolumePhoton};
use crate::random::Purpose;
use crate::scene::Scene;
use crate::stop::Stop;
use crate::transport::bidirectional::shares::leads;
use crate::transport::walk::camera_paths::{CameraPathStart, CameraPaths, Indirect};
use crate::transport::walk::cause::Cause;
use crate::transport::walk::direct::{
    BSDF_SAMPLE_PROBABILITY, Division, balance, direct_light, divided_direct_light, next_event,
};
use crate::transport::walk::lobe_layers::{FirstScatter, LobeHistory, LobeRecord};
use crate::transport::walk::pass_through::{BulbHit, PassThroughHit};
use crate::transport::walk::pixel_sample::{BranchFeatures, MAX_LEVELS, PixelSample};
use crate::transport::walk::scattering_vertex::ScatterPoint;
use crate::transport::walk::segment::FirstHit;
use crate::transport::walk::vertex::{MediumLight, MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::walk;

/// Smallest probability with which a camera path continues by broad lobes, and by the other lobes, at a vertex that has
/// both.
const MIN_CHANCE: f32 = 0.1;

/// Visitor of a camera path that gathers.
pub(in crate::transport) struct GatheringWalk<'a, B> {
    pub kernel: Kernel,
    /// Whether the path continues by broad lobes ([`Indirect::Paths`]).
    pub paths: bool,
    pub scene: &'a Scene,
    pub photons: &'a PhotonMaps,
    pub near: &'a mut ByKind<Near<Photon>>,
    pub volume: Option<Volume<'a>>,
    pub near_volume: &'a mut Near<VolumePhoton>,
    pub waiting: &'a mut Waiting,
    pub bandwidths: &'a mut B,
    pub max_depth: u32,
    pub splits: u32,
    pub sample: PixelSample,
    /// G-buffer of the path.
    pub features: BranchFeatures,
    /// Length of the path so far (scene units).
    pub length: f32,
    /// Class of the path up to the last vertex: the kinds of its bounces.
    pub suffix: CameraSuffix,
    /// Lobes of the BSDF at the last vertex.
    pub lobes: LobeSet,
    pub classes: ClassSet,
    /// Whether the path has had a bounce at a broad lobe.
    pub scattered_broadly: bool,
    /// Whether only delta lobes have scattered the path.
    pub delta: bool,
    pub glints: Glints,
    /// Record of the light by the lobe of the first hit; `None` if it is not recorded.
    pub record: Option<&'a mut LobeRecord>,
    pub lobe_history: LobeHistory,
    /// The last vertex, as a receiver of direct light.
    pub last: Receiver,
    pub stop: Option<&'a Stop>,
}

impl<B: GatherBandwidths> GatheringWalk<'_, B> {
    /// Whether the vertex at which the path arrives divides the light among its lobes, for the record.
    #[inline]
    pub(in crate::transport) fn divides(&self) -> bool {
        self.record.is_some() && self.lobe_history.bounces == 0
    }

    /// Records light that arrives at a vertex after the first one.
    #[inline]
    pub(in crate::transport) fn record_indirect(&mut self, light: Rgb, of_photons: bool) {
        if let Some(lobes) = &mut self.record {
            let into = if of_photons { &mut lobes.photons } else { &mut lobes.own };
            into.add(&self.lobe_history.first, false, light);
        }
    }

    /// Records light of a light that the path has hit. The camera sees it by `seen` if nothing has scattered the path.
    #[inline]
    fn record_hit(&mut self, seen: FirstScatter, light: Rgb, of_photons: bool) {
        let LobeHistory { first, bounces } = self.lobe_history;
        if let Some(lobes) = &mut self.record {
            let into = if of_photons { &mut lobes.photons } else { &mut lobes.own };
            into.add(if bounces == 0 { &seen } else { &first }, bounces == 1, light);
        }
    }

    /// Records light that a vertex in a medium scatters. `direct`: it comes straight from a light.
    #[inline]
    fn record_in_medium(&mut self, direct: bool, light: Rgb, of_photons: bool) {
        let LobeHistory { first, bounces } = self.lobe_history;
        if let Some(lobes) = &mut self.record {
            let into = if of_photons { &mut lobes.photons } else { &mut lobes.own };
            into.add(if bounces == 0 { &FirstScatter::Medium } else { &first }, direct && bounces == 0, light);
        }
    }

    /// Adds the light `arriving` from a light that the path has hit. `pdf_light` is the density with which next-event
    /// estimation at the last vertex would have sampled it, `density` the density of light paths that start there. The
    /// camera sees the light by `seen` if nothing has scattered the path.
    #[inline]
    fn hit_light(
        &mut self,
        arriving: Rgb,
        pdf_light: f32,
        scattered: Option<Scattered>,
        seen: FirstScatter,
        density: impl FnOnce() -> Option<EmissionDensity>,
    ) {
        if self.paths && self.scattered_broadly && scattered.is_some_and(|s| !s.lobe.intersects(LobeSet::BROAD)) {
            // A caustic: photons find it.
            return;
        }
        let class = self.suffix.class_at_light(false);
        if !self.classes.has(class) {
            return;
        }
        if !arriving.is_finite() {
            return self.sample.reject(Cause::Emission);
        }
        let weighted = match scattered {
            Some(s) if !s.lobe.intersects(LobeSet::DELTA) => arriving * balance(s.pdf_w, pdf_light),
            // Next-event estimation cannot reach through a perfect mirror or clear glass, but photons may.
            Some(_) if self.glints.are_shared() => {
                let mut recorded = None;
                for (level, weight) in density().iter().flat_map(|density| self.glints.path_weights(density)) {
                    self.sample.indirect_photons[level] += arriving * weight;
                    if self.record.as_ref().is_some_and(|lobes| lobes.level == Some(level)) {
                        recorded = Some(arriving * weight);
                    }
                }
                if let Some(light) = recorded {
                    self.record_hit(seen, light, true);
                }
                return;
            }
            _ => arriving,
        };
        self.record_hit(seen, weighted, false);
        *match class.part() {
            Part::Emission => &mut self.sample.emission,
            Part::Direct => &mut self.sample.direct,
            _ => &mut self.sample.indirect,
        } += weighted;
    }

    /// Class of the path as it arrives at the next vertex.
    #[inline]
    fn suffix_on_arrival(&self, scattered: Option<Scattered>) -> CameraSuffix {
        scattered.map_or(self.suffix, |scattered| self.suffix.then(Event::at_surface(scattered.lobe, self.lobes)))
    }

    /// The lobes for which direct light is sampled: `broad` and `onward`, each empty if the picture does not show its
    /// class of direct light.
    #[inline]
    fn lit_lobes(&self, broad: LobeSet, onward: LobeSet) -> (LobeSet, LobeSet) {
        let on =
            |event: Event| self.classes.is_all() || self.classes.has(self.suffix.then(event).class_at_light(false));
        let only = |set: LobeSet, event: Event| if on(event) { set } else { LobeSet::empty() };
        (only(broad, Event::Broad), only(onward, Event::Sharp))
    }

    /// Whether the picture shows direct light in a medium at the end of a path of class `suffix`.
    #[inline]
    fn lit_in_medium(&self, suffix: CameraSuffix) -> bool {
        self.classes.has(suffix.then(Event::Medium).class_at_light(false))
    }

    /// Whether continuing by the lobes in `set` of the last vertex can reach light that the picture shows.
    #[inline]
    fn leads(&self, set: LobeSet) -> bool {
        self.classes.is_all() || leads(self.suffix, self.lobes, set, self.classes)
    }

    /// Adds direct light at a surface vertex, which `find` computes and divides among the lobes if asked to.
    #[inline]
    fn add_direct(&mut self, throughput: Rgb, find: impl FnOnce(Division<'_>) -> Rgb) {
        let light = if self.divides() {
            let mut by_lobe = [Rgb::ZERO; 3];
            let light = throughput * find(Some(&mut by_lobe));
            if let Some(lobes) = &mut self.record {
                lobes.own.add(&FirstScatter::Surface(by_lobe), true, throughput);
            }
            light
        } else {
            let light = throughput * find(None);
            self.record_indirect(light, false);
            light
        };
        if !light.is_finite() {
            self.sample.reject(Cause::DirectLight);
        }
        *if self.suffix.is_clear() { &mut self.sample.direct } else { &mut self.sample.indirect } += light;
    }

    /// Samples a vertex of a path that also continues by broad lobes: direct light, photons, and the lobes to continue
    /// with.
    #[inline]
    fn sample_and_continue(&mut self, vertex: &Vertex<'_, '_>, broad: LobeSet, onward: LobeSet) -> Next {
        let chance = match (broad.is_empty(), onward.is_empty()) {
            (true, _) => 0.0,
            (false, true) => 1.0,
            (false, false) => {
                let [broad, onward] = [broad, onward].map(|set| vertex.shading.albedo(set).max_element());
                (broad / (broad + onward)).clamp(MIN_CHANCE, 1.0 - MIN_CHANCE)
            }
        };
        if vertex.depth < self.max_depth {
            let probability = |set: LobeSet, chance: f32| {
                if chance > 0.0 { chance * vertex.survival_chosen(set, chance) } else { 0.0 }
            };
            // After a broad bounce, light that arrives by narrow lobes is a caustic of that bounce.
            let seen = if self.scattered_broadly { LobeSet::empty() } else { onward };
            let lit = self.lit_lobes(broad, seen);
            if lit != (LobeSet::empty(), LobeSet::empty()) {
                let sets = [(lit.0, probability(broad, chance)), (lit.1, probability(seen, 1.0 - chance))];
                let scene = self.scene;
                self.add_direct(vertex.throughput, |lobes| next_event(scene, vertex, sets, lobes));
            }
            self.gather(vertex, broad, Onward { lobes: seen, probability: probability(seen, 1.0 - chance) });
        }
        if !self.leads(broad | onward) {
            return Next::Stop;
        }
        if vertex.draws.one(Purpose::LobeChoice) < chance {
            self.scattered_broadly = true;
            Next::Choose(broad, chance)
        } else {
            Next::Choose(onward, 1.0 - chance)
        }
    }
}

impl<'a, B: GatherBandwidths> Visitor<'a> for GatheringWalk<'_, B> {
    const BRANCHES: bool = true;
    const SPLITS: bool = true;

    #[inline]
    fn stop(&self) -> Option<&Stop> {
        self.stop
    }

    #[inline]
    fn splits(&self) -> u32 {
        self.splits
    }

    #[inline]
    fn end(&mut self, share: f32) {
        self.sample.features.add(&self.features, share);
    }

    #[inline]
    fn branch(&mut self, follow: impl FnOnce(&mut Self)) {
        let scattering = (self.scattered_broadly, self.delta, self.glints, self.lobe_history);
        let before = (self.length, self.suffix, self.lobes, self.last, self.features);
        follow(self);
        (self.scattered_broadly, self.delta, self.glints, self.lobe_history) = scattering;
        (self.length, self.suffix, self.lobes, self.last, self.features) = before;
    }

    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        let (surface, shading) = (vertex.surface, vertex.shading);
        if scattered.is_none() {
            self.sample.first.get_or_insert(FirstHit { p: surface.p, instance: surface.instance });
            self.last = Receiver::anywhere(vertex.from);
            if let Some(lobes) = &mut self.record {
                lobes.own.colors = shading.lobe_albedos();
            }
        }
        self.suffix = self.suffix_on_arrival(scattered);
        self.length += vertex.distance;
        let (lights, materials, from) = (&self.scene.lights, &self.scene.materials, self.last);
        if let Some((radiance, pdf)) = lights.hit_radiance(materials, &from, surface, vertex.wo) {
            let density = || Some(lights.emitted(materials, &from, surface, vertex.wo)?.1);
            self.hit_light(vertex.throughput * radiance, pdf, scattered, FirstScatter::Emit, density);
        }
        self.last = vertex.receiver(self.scene);
        let lobes = shading.bsdf.lobes();
        let smooth = lobes & LobeSet::SMOOTH;
        // Lights and other surfaces that scatter nothing have features, too.
        if lobes != LobeSet::DELTA {
            let length = self.length;
            self.features.store(lobes, || vertex.features(length));
        }
        self.lobes = lobes;
        if smooth.is_empty() {
            return Next::Continue(lobes);
        }
        self.glints.arrive();
        let broad = lobes & LobeSet::BROAD;
        let onward = lobes & (LobeSet::SHARP | LobeSet::DELTA);
        if self.paths {
            return self.sample_and_continue(vertex, broad, onward);
        }
        if vertex.depth < self.max_depth {
            let survival = if onward.is_empty() { 0.0 } else { vertex.survival(onward) };
            let (lit, lit_onward) = self.lit_lobes(broad, onward);
            if !(lit | lit_onward).is_empty() {
                let scene = self.scene;
                self.add_direct(vertex.throughput, |lobes: Division<'_>| {
                    divided_direct_light(scene, vertex, lit, lit_onward, survival, lobes)
                });
            }
            self.gather(vertex, broad, Onward { lobes: onward, probability: survival });
        }
        if self.leads(onward) { Next::Continue(onward) } else { Next::Stop }
    }

    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        let (lights, materials, before) = (&self.scene.lights, &self.scene.materials, self.suffix);
        let from =
            if scattered.is_none() { Receiver::anywhere(hit.surface.p + hit.wo * hit.distance) } else { self.last };
        self.suffix = self.suffix_on_arrival(scattered);
        if let Some((radiance, pdf)) = lights.hit_radiance(materials, &from, &hit.surface, hit.wo) {
            let density = || Some(lights.emitted(materials, &from, &hit.surface, hit.wo)?.1);
            self.hit_light(hit.throughput * radiance, pdf, scattered, FirstScatter::Emit, density);
        }
        self.suffix = before;
    }

    fn bulb(&mut self, hit: &BulbHit, scattered: Option<Scattered>) {
        if !self.scene.lights.shines_on(hit.emitter, &self.last) {
            return;
        }
        let before = self.suffix;
        self.suffix = self.suffix_on_arrival(scattered);
        if matches!(self.suffix.class_at_light(false), PathClass::Emission | PathClass::Coat) {
            self.hit_light(hit.light, 0.0, scattered, FirstScatter::Emit, || None);
        }
        self.suffix = before;
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        // The first hit is in the medium with the probability that the medium stops the ray.
        if scattered.is_none() && self.sample.first.is_none() && vertex.draws.one(Purpose::Roulette) < vertex.opacity {
            self.sample.first = vertex.arrival.first;
        }
        if vertex.depth < self.max_depth {
            let suffix = self.suffix_on_arrival(scattered);
            let lit = self.lit_in_medium(suffix);
            let direct = if lit {
                vertex.throughput * direct_light(self.scene, vertex, LobeSet::BROAD, LobeSet::empty(), 0.0)
            } else {
                Rgb::ZERO
            };
            let gathered = self.gather_in_medium(vertex, suffix);
            if let Some(level) = self.record.as_ref().and_then(|lobes| lobes.level) {
                self.record_in_medium(true, direct, false);
                self.record_in_medium(false, gathered.map_or(Rgb::ZERO, |gathered| gathered[level]), true);
            }
            let sample = &mut self.sample;
            let (light, photons) = if suffix.is_clear() {
                (&mut sample.volume, &mut sample.volume_photons)
            } else {
                (&mut sample.indirect, &mut sample.indirect_photons)
            };
            *light += direct;
            for (sum, gathered) in photons.iter_mut().zip(gathered.into_iter().flatten()) {
                *sum += gathered;
            }
            if !direct.is_finite() {
                sample.reject(Cause::DirectLight);
            } else if !gathered.iter().flatten().all(|light| light.is_finite()) {
                sample.reject(Cause::Photons);
            }
        }
        Next::Stop
    }

    #[inline]
    fn medium_next_event(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) {
        let suffix = self.suffix_on_arrival(scattered);
        if vertex.depth < self.max_depth && !self.scene.lights.is_empty() && self.lit_in_medium(suffix) {
            let sets = [(LobeSet::BROAD, BSDF_SAMPLE_PROBABILITY), (LobeSet::empty(), 0.0)];
            let light = vertex.throughput * next_event(self.scene, vertex, sets, None);
            self.record_in_medium(true, light, false);
            if !light.is_finite() {
                self.sample.reject(Cause::DirectLight);
            }
            *if suffix.is_clear() { &mut self.sample.volume } else { &mut self.sample.indirect } += light;
        }
    }

    fn hole(&mut self) {
        // A medium before it may have stopped the ray.
        self.sample.first.get_or_insert(FirstHit::HOLE);
    }

    #[inline]
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, _: FlightDensity) {
        let scene = self.scene;
        self.suffix = self.suffix_on_arrival(scattered);
        let last = self.last;
        scene.lights.for_each_infinite(&last, direction, scattered.is_none(), |radiance, direct, start, _| {
            let onward = || scene.lights.entry_pdf_a(last.p, direction);
            let density =
                || Some(EmissionDensity { direct, start, onward: onward(), cos: 1.0, infinite: true, delta: false });
            self.hit_light(throughput * radiance, direct, scattered, FirstScatter::Environment, density);
        });
    }

    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        self.delta &= sample.lobe == LobeSet::DELTA;
        self.glints.scatter(vertex.surface.ng, sample);
        if self.record.is_some() {
            self.lobe_history.scatter(|| FirstScatter::of_sample(vertex, sample, sample.lobe));
        }
    }

    fn sees_medium_light(&self, _: Option<Scattered>) -> bool {
        self.delta
    }

    fn medium_light(&mut self, light: &MediumLight, scattered: Option<Scattered>) {
        let class = self.suffix_on_arrival(scattered).class_at_light(false);
        if !self.classes.has(class) {
            return;
        }
        if !light.light.is_finite() {
            return self.sample.reject(Cause::Emission);
        }
        self.record_hit(FirstScatter::Emit, light.light, false);
        *match class.part() {
            Part::Emission => &mut self.sample.emission,
            Part::Direct => &mut self.sample.direct,
            _ => &mut self.sample.indirect,
        } += light.light;
    }

    fn lost(&mut self) {
        self.sample.reject(Cause::Path);
    }
}

impl<B: GatherBandwidths> GatheringWalk<'_, B> {
    /// Radiance by bandwidth level from the photons around a vertex in a medium; zero if the picture does not show
    /// their class.
    #[inline]
    fn gather_in_medium(&mut self, vertex: &MediumVertex, suffix: CameraSuffix) -> Option<[Rgb; MAX_LEVELS]> {
        let longest = self.max_depth - vertex.depth;
        let medium = vertex.medium_id(self.scene);
        let wanted = self.classes.has(suffix.then(Event::Medium).class_with(LightPrefix::SCATTERED));
        self.volume.filter(|_| wanted).map(|volume| {
            let mut sums = volume.gather(self.kernel, self.near_volume, vertex, medium, longest);
            if sums.iter().any(|&sum| sum != Rgb::ZERO) {
                let masses = volume.kernel_mass_inside(self.kernel, self.scene, vertex, medium);
                sums.iter_mut().zip(masses).for_each(|(sum, mass)| *sum /= mass);
            }
            sums
        })
    }
}

impl CameraPaths<'_> {
    /// Traces one camera path and samples its light at all bandwidth levels of `bandwidths`, and of `volume` where
    /// media scatter, with `kernel`. `scratch` must not have served photons of another iteration.
    #[inline]
    pub fn sample<B: GatherBandwidths>(
        &self,
        scratch: &mut Scratch,
        start: &CameraPathStart,
        photons: &PhotonMaps,
        volume: Option<Volume<'_>>,
        bandwidths: &mut B,
        kernel: Kernel,
    ) -> PixelSample {
        let mut visitor = GatheringWalk {
            kernel,
            paths: self.indirect == Indirect::Paths,
            scene: self.scene,
            photons,
            near: &mut scratch.near,
            volume,
            near_volume: &mut scratch.near_volume,
            waiting: &mut scratch.waiting,
            bandwidths,
            max_depth: self.max_depth,
            splits: self.splits,
            sample: PixelSample::default(),
            features: BranchFeatures::NONE,
            length: 0.0,
            suffix: CameraSuffix::START,
            lobes: LobeSet::empty(),
            classes: self.classes,
            scattered_broadly: false,
            delta: true,
            glints: Glints::NONE,
            record: Some(&mut scratch.lobes).filter(|record| self.lobes && record.level.is_some()),
            lobe_history: LobeHistory::default(),
            last: Receiver::anywhere(Vec3::ZERO),
            stop: self.stop,
        };
        walk(self.scene, &scratch.arena, &start.ray, start.stream, Transport::Radiance, self.max_depth, &mut visitor);
        let sample = visitor.sample;
        scratch.arena.reset();
        sample
    }
}
