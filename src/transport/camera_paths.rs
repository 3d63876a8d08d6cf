//! Camera paths that gather photons: what one path of a pixel measures at every bandwidth level.
//!
//! Who carries which light, so that every path is counted once (X is the vertex where photons may be gathered, seen
//! from the light):
//! - a light, then X: next-event estimation at X and its second strategy ([`direct_light`]), whatever the lobes of X;
//! - a light, at least one bounce, then X: photons, for the broad lobes of X; for its sharp lobes, the camera path itself,
//!   which goes on;
//! - a delta light, delta bounces only, then X: photons also for the sharp lobes of X: no path that goes on could find
//!   that light;
//! - another light, delta bounces only, then the sharp lobes of X: both, weighed ([`super::glint`]).
//!
//! Where only caustics are left to photons ([`Indirect::Paths`]), the camera path goes on with the broad lobes of X, too.
//! Between its last broad bounce and a light there is then at least one vertex:
//! - one that scatters the light broadly: next-event estimation there and its second strategy, the camera path;
//! - narrow lobes alone: photons of caustics, at every vertex of the camera path, for its broad lobes. The camera path itself
//!   does not count such light.
//!
//! An X in a medium is like one with broad lobes alone. Every segment has one in each medium it goes through, and the
//! surface behind as well ([`super::flight`]).

use super::bandwidths::{Bandwidths, Counter, FoundPhotons, MAX_LEVELS};
use super::cause::Cause;
use super::direct::{SECOND_STRATEGY, balance, direct_light, next_event};
use super::gather::{Batch, Scratch, Waiting};
use super::glint::{Glints, Merging};
use super::initial_media::InitialMedium;
use super::pass_through::PassThroughHit;
use super::scattering_vertex::ScatterPoint;
use super::segment::{FirstHit, PrecomputedHit, camera_token};
use super::shares::leads;
use super::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use super::volume::Volume;
use super::walk::{PathStart, walk};
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::camera::{Camera, GROUP_SIZE, TilePixel};
use crate::light::{EmissionDensity, Receiver};
use crate::math::{Rgb, Vec2, Vec3};
use crate::medium::FlightDensity;
use crate::photon::{ByKind, Kernel, Kind, Near, Photon, PhotonMap, PhotonMaps, VolumePhoton};
use crate::plan::{CameraSuffix, ClassSet, Event, LightPrefix, Part, PathClass};
use crate::random::{Purpose, Stream, Streams};
use crate::scene::Scene;
use crate::spectrum::{Wavelength, WavelengthSample};
use crate::stop::Stop;
use crate::trace::Ray;
use serde::{Deserialize, Serialize};
use std::f32::consts::FRAC_1_PI;

/// What denoisers want to know about a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Features {
    /// Directional albedo at the first hit that is not a perfect mirror or clear glass.
    pub albedo: Rgb,
    /// World-space shading normal there, towards the eye.
    pub normal: Vec3,
    /// Distance along the path.
    pub depth: f32,
}

/// Everything one camera path measures. Radiance per channel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Emitters seen directly or through perfect mirrors and clear glass.
    pub emission: Rgb,
    /// Light from lights at the first vertex that scatters otherwise.
    pub direct: Rgb,
    /// All other light that this path found, and shares with no photons.
    pub indirect: Rgb,
    /// Photons of caustics, per level.
    pub caustic_photons: [Rgb; MAX_LEVELS],
    /// All other photons, and what this path found of the light that they share with it, per level.
    pub indirect_photons: [Rgb; MAX_LEVELS],
    /// Light whose first vertex that is not clear is in a medium, found without photons.
    pub volume: Rgb,
    /// The same, found with photons or depending on their bandwidth, per level.
    pub volume_photons: [Rgb; MAX_LEVELS],
    /// G-buffer.
    pub features: Features,
    /// First visible hit.
    pub first: Option<FirstHit>,
    /// What was not finite, if anything: the sample is to be rejected.
    pub rejection: Option<Cause>,
}

impl PixelSample {
    /// Something that is not finite has come to the sample; what came first is its cause.
    #[cold]
    pub fn reject(&mut self, cause: Cause) {
        self.rejection.get_or_insert(cause);
    }

    /// The radiance estimate of a level.
    #[inline]
    pub fn radiance(&self, level: usize) -> Rgb {
        let surfaces =
            self.emission + self.direct + self.indirect + self.caustic_photons[level] + self.indirect_photons[level];
        surfaces + (self.volume + self.volume_photons[level])
    }
}

/// Least probability of going on with either set of lobes where there are two.
const LEAST_CHANCE: f32 = 0.1;

/// Who brings light that has been scattered broadly before the camera path's first broad bounce.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Indirect {
    /// Photons
    #[default]
    Photons,
    /// Camera paths, which go on; photons bring caustics alone
    Paths,
}

impl Indirect {
    /// Kinds of photons that bring these classes to camera paths.
    pub fn kinds(self, wanted: ClassSet) -> ByKind<bool> {
        let caustics: ClassSet = match self {
            Indirect::Photons => [PathClass::Caustic, PathClass::Sds].into_iter().collect(),
            Indirect::Paths => ClassSet::ALL,
        };
        let others = PathClass::ALL.into_iter().any(|class| wanted.has(class) && !caustics.has(class));
        [others, !(wanted & caustics).is_empty()]
    }
}

struct Gather<'a, B, K, const PATHS: bool> {
    kernel: K,
    scene: &'a Scene,
    photons: &'a PhotonMaps,
    near: &'a mut ByKind<Near<Photon>>,
    volume: Option<Volume<'a>>,
    near_volume: &'a mut Near<VolumePhoton>,
    waiting: &'a mut Waiting,
    bandwidths: B,
    max_depth: u32,
    sample: PixelSample,
    /// Length of the path so far.
    length: f32,
    /// What has happened up to the last vertex.
    suffix: CameraSuffix,
    /// Lobes of the last vertex.
    lobes: LobeSet,
    classes: ClassSet,
    /// The path has scattered broadly.
    broadly: bool,
    glints: Glints,
    /// The last vertex.
    last: Receiver,
}

impl<B: Bandwidths, K: Kernel, const PATHS: bool> Gather<'_, B, K, PATHS> {
    /// Adds radiance that arrives from an emitter which the path has run into. `pdf_light` is the density with which
    /// next-event estimation at the last vertex would have found it, `density` that of light paths that begin there.
    #[inline]
    fn run_into(
        &mut self,
        (radiance, throughput): (Rgb, Rgb),
        pdf_light: f32,
        scattered: Option<Scattered>,
        density: impl FnOnce() -> Option<EmissionDensity>,
    ) {
        if PATHS && self.broadly && scattered.is_some_and(|s| !s.lobe.intersects(LobeSet::BROAD)) {
            // A caustic.
            return;
        }
        let class = self.suffix.class_at_light(false);
        if !self.classes.has(class) {
            return;
        }
        let arriving = throughput * radiance;
        if !arriving.is_finite() {
            return self.sample.reject(Cause::Emission);
        }
        let weighted = match scattered {
            Some(s) if !s.lobe.intersects(LobeSet::DELTA) => arriving * balance(s.pdf_w, pdf_light),
            // Behind a perfect mirror or clear glass next-event estimation cannot see it, but photons may.
            Some(_) if self.glints.shared() => {
                for (level, weight) in density().iter().flat_map(|density| self.glints.weights(density)) {
                    self.sample.indirect_photons[level] += arriving * weight;
                }
                return;
            }
            _ => arriving,
        };
        *match class.part() {
            Part::Emission => &mut self.sample.emission,
            Part::Direct => &mut self.sample.direct,
            _ => &mut self.sample.indirect,
        } += weighted;
    }

    /// What has happened to a path that arrives at the next vertex.
    #[inline]
    fn arrived(&self, scattered: Option<Scattered>) -> CameraSuffix {
        scattered.map_or(self.suffix, |scattered| self.suffix.then(Event::of(scattered.lobe, self.lobes)))
    }

    /// The lobes that are lit at a vertex, broad ones and those that the path goes on with: all, but for classes that
    /// are switched off.
    #[inline]
    fn lit_lobes(&self, broad: LobeSet, onward: LobeSet) -> (LobeSet, LobeSet) {
        let on =
            |event: Event| self.classes.is_all() || self.classes.has(self.suffix.then(event).class_at_light(false));
        let only = |set: LobeSet, event: Event| if on(event) { set } else { LobeSet::empty() };
        (only(broad, Event::Broad), only(onward, Event::Sharp))
    }

    /// Whether a medium is lit.
    #[inline]
    fn lit_in_medium(&self, suffix: CameraSuffix) -> bool {
        self.classes.has(suffix.then(Event::Medium).class_at_light(false))
    }

    /// Whether going on by some lobes of the last vertex can come to light of a class that is wanted.
    #[inline]
    fn leads(&self, set: LobeSet) -> bool {
        self.classes.is_all() || leads(self.suffix, self.lobes, set, self.classes)
    }

    /// Adds direct light at a vertex.
    #[inline]
    fn add_direct(&mut self, light: Rgb) {
        if !light.is_finite() {
            self.sample.reject(Cause::DirectLight);
        }
        *if self.suffix.is_clear() { &mut self.sample.direct } else { &mut self.sample.indirect } += light;
    }

    /// Direct light and photons at a vertex from which the path goes on whatever its lobes, and with which of them.
    #[inline]
    fn go_on(&mut self, vertex: &Vertex<'_, '_>, broad: LobeSet, onward: LobeSet) -> Next {
        let chance = match (broad.is_empty(), onward.is_empty()) {
            (true, _) => 0.0,
            (false, true) => 1.0,
            (false, false) => {
                let [broad, onward] = [broad, onward].map(|set| vertex.shading.albedo(set).max_element());
                (broad / (broad + onward)).clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE)
            }
        };
        if vertex.depth < self.max_depth {
            let tries = |set: LobeSet, chance: f32| {
                if chance > 0.0 { chance * vertex.survival_chosen(set, chance) } else { 0.0 }
            };
            // What narrow lobes send on to the last broad bounce is a caustic there.
            let seen = if self.broadly { LobeSet::empty() } else { onward };
            let lit = self.lit_lobes(broad, seen);
            if lit != (LobeSet::empty(), LobeSet::empty()) {
                let sets = [(lit.0, tries(broad, chance)), (lit.1, tries(seen, 1.0 - chance))];
                self.add_direct(vertex.throughput * next_event(self.scene, vertex, sets));
            }
            self.gather(vertex, broad, seen, tries(seen, 1.0 - chance));
        }
        if !self.leads(broad | onward) {
            return Next::Stop;
        }
        if vertex.draws.one(Purpose::LobeChoice) < chance {
            self.broadly = true;
            Next::Choose(broad, chance)
        } else {
            Next::Choose(onward, 1.0 - chance)
        }
    }

    /// Photons around the vertex: kernel density estimation, all levels of a kind from one query [post-reconstruction
    /// 2021, (2) and (3)]. The path goes on by the lobes of `onward` with probability `going`.
    #[inline]
    fn gather(&mut self, vertex: &Vertex<'_, '_>, broad: LobeSet, onward: LobeSet, going: f32) {
        // What a photon of a light without size makes of sharp lobes is in the same class.
        let suffix = self.suffix.then(Event::Broad);
        let place = B::place(vertex.surface.ng);
        for (kind, prefix) in [(Kind::Indirect, LightPrefix::SCATTERED), (Kind::Caustic, LightPrefix::FOCUSED)] {
            let class = suffix.class_with(prefix);
            let photons = &self.photons[kind as usize];
            // Where none has come this time, camera paths still leave photons their share.
            let shares = onward.intersects(LobeSet::SHARP) && photons.paths() > 0;
            if (photons.photons().is_empty() && !shares) || !self.classes.has(class) {
                continue;
            }
            // Caustics that surfaces scatter on before they are seen are indirect light.
            let caustic = kind == Kind::Caustic && (!PATHS || class.part() == Part::Caustic);
            self.gather_kind(kind, caustic, vertex, &place, broad, (onward, going));
        }
    }

    // Once for both kinds and all who gather: by far the most code of all that compilers see here.
    #[inline(never)]
    fn gather_kind(
        &mut self,
        kind: Kind,
        caustic: bool,
        vertex: &Vertex<'_, '_>,
        place: &B::Place,
        broad: LobeSet,
        (onward, going): (LobeSet, f32),
    ) {
        let (p, ng) = (vertex.surface.p, vertex.surface.ng);
        let photons = &self.photons[kind as usize];
        let mut radii = self.bandwidths.at(kind, photons, p, ng, self.length);
        if PATHS && self.broadly {
            let largest2 = radii.radius2[radii.count.saturating_sub(1)];
            let factor = (radii.later2 / largest2).min(1.0);
            radii.radius2.iter_mut().for_each(|radius2| *radius2 *= factor);
        }
        let sharp = onward & LobeSet::SHARP;
        let shared = kind == Kind::Caustic
            && !sharp.is_empty()
            && self.classes.has(self.suffix.then(Event::Sharp).class_with(LightPrefix::FOCUSED));
        let mut glints =
            shared.then(|| self.glints.merge(self.kernel, (vertex.shading, ng), (onward, going), &radii, photons));
        let (order, radii) = (radii.order, &radii.radius2[..radii.count]);
        let Some(&largest) = radii.last() else { return };
        let longest = self.max_depth - vertex.depth;
        let mut counter = self.bandwidths.counter(kind, place);
        let reach2 = counter.reach2(largest);
        // Bandwidths follow what broad lobes see of photons; metal has none.
        let counts = <B::Counter<'_> as Counter>::COUNTS && broad.is_empty();
        if let Some(glints) = glints.as_mut().filter(|_| counts) {
            glints.look_beyond(reach2);
        }
        let mut batch = Batch::new(self.kernel, radii, self.waiting, vertex, broad, broad | sharp);
        let near = &mut self.near[kind as usize];
        let push = |photon: &Photon, distance2| {
            if u32::from(photon.depth) <= longest {
                if let Some(glints) = &mut glints {
                    let light = glints.push(photon, distance2);
                    if counts && light != Rgb::ZERO {
                        let light = (light * vertex.throughput).element_sum() / 3.0;
                        counter.count(&FoundPhotons::one(photon.p - p, distance2, light, photon.thinning_key));
                    }
                }
                batch.push(photon, distance2, &mut counter);
            }
        };
        match &vertex.wavelength {
            None => photons.gather(near, p, ng, reach2, push),
            Some(wavelength) => gather_dispersed(photons, near, vertex, wavelength, reach2, push),
        }
        let sums = batch.finish(&mut counter);
        let into = if caustic { &mut self.sample.caustic_photons } else { &mut self.sample.indirect_photons };
        let mut finite = true;
        for ((level, sum), radius2) in order.into_iter().zip(sums).zip(radii) {
            let light = vertex.throughput * (FRAC_1_PI / radius2) * sum;
            finite &= light.is_finite();
            into[usize::from(level)] += light;
        }
        for (level, sum) in order.into_iter().zip(glints.into_iter().flat_map(Merging::finish)) {
            let light = vertex.throughput * sum;
            finite &= light.is_finite();
            self.sample.indirect_photons[usize::from(level)] += light;
        }
        if !finite {
            self.sample.reject(Cause::Photons);
        }
    }
}

/// The photons around a vertex that its path meets, weighted where both have taken a wavelength. Out of the way of
/// paths that have none.
#[inline(never)]
fn gather_dispersed(
    photons: &PhotonMap,
    near: &mut Near<Photon>,
    vertex: &Vertex<'_, '_>,
    wavelength: &Wavelength,
    reach2: f32,
    mut push: impl FnMut(&Photon, f32),
) {
    photons.gather(near, vertex.surface.p, vertex.surface.ng, reach2, |photon, distance2| {
        if let Some(weight) = wavelength.connection_factor(photon.band) {
            push(&Photon { flux: photon.flux * weight, ..*photon }, distance2);
        }
    });
}

impl<'a, B: Bandwidths, K: Kernel, const PATHS: bool> Visitor<'a> for Gather<'_, B, K, PATHS> {
    const SPLITS: bool = true;

    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        let (surface, shading) = (vertex.surface, vertex.shading);
        if scattered.is_none() {
            self.sample.first.get_or_insert(FirstHit { p: surface.p, instance: surface.instance });
            self.last = Receiver::anywhere(vertex.from);
        }
        self.suffix = self.arrived(scattered);
        self.length += vertex.distance;
        let (lights, materials, from) = (&self.scene.lights, &self.scene.materials, self.last);
        if let Some((radiance, pdf)) = lights.hit_radiance(materials, &from, surface, vertex.wo) {
            let density = || Some(lights.emitted(materials, &from, surface, vertex.wo)?.1);
            self.run_into((radiance, vertex.throughput), pdf, scattered, density);
        }
        self.last = vertex.receiver();
        let lobes = shading.bsdf.lobes();
        let smooth = lobes & LobeSet::SMOOTH;
        // Lamps and other surfaces that scatter nothing have features, too.
        if self.suffix.is_clear() && lobes != LobeSet::DELTA {
            self.sample.features = Features {
                albedo: shading.albedo(LobeSet::ALL),
                normal: if shading.frame.n.dot(vertex.wo) < 0.0 { -shading.frame.n } else { shading.frame.n },
                depth: self.length,
            };
        }
        self.lobes = lobes;
        if smooth.is_empty() {
            return Next::Continue(lobes);
        }
        self.glints.arrive();
        let broad = lobes & LobeSet::BROAD;
        let onward = lobes & (LobeSet::SHARP | LobeSet::DELTA);
        if PATHS {
            return self.go_on(vertex, broad, onward);
        }
        if vertex.depth < self.max_depth {
            let survival = if onward.is_empty() { 0.0 } else { vertex.survival(onward) };
            let lit = self.lit_lobes(broad, onward);
            if lit != (LobeSet::empty(), LobeSet::empty()) {
                self.add_direct(vertex.throughput * direct_light(self.scene, vertex, lit.0, lit.1, survival));
            }
            self.gather(vertex, broad, onward, survival);
        }
        if self.leads(onward) { Next::Continue(onward) } else { Next::Stop }
    }

    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        let (lights, materials, before) = (&self.scene.lights, &self.scene.materials, self.suffix);
        let from =
            if scattered.is_none() { Receiver::anywhere(hit.surface.p + hit.wo * hit.distance) } else { self.last };
        self.suffix = self.arrived(scattered);
        if let Some((radiance, pdf)) = lights.hit_radiance(materials, &from, &hit.surface, hit.wo) {
            let density = || Some(lights.emitted(materials, &from, &hit.surface, hit.wo)?.1);
            self.run_into((radiance, hit.throughput), pdf, scattered, density);
        }
        self.suffix = before;
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        // A medium hides what is behind it as often as it takes the light.
        if scattered.is_none() && self.sample.first.is_none() && vertex.draws.one(Purpose::Roulette) < vertex.opacity {
            self.sample.first = vertex.met.first;
        }
        if vertex.depth < self.max_depth {
            let suffix = self.arrived(scattered);
            let lit = self.lit_in_medium(suffix);
            let direct = if lit {
                vertex.throughput * direct_light(self.scene, vertex, LobeSet::BROAD, LobeSet::empty(), 0.0)
            } else {
                Rgb::ZERO
            };
            let longest = self.max_depth - vertex.depth;
            let medium = vertex.medium_id(self.scene);
            let gather = |volume: Volume<'_>| {
                let mut sums = volume.gather(self.kernel, self.near_volume, vertex, medium, longest);
                if sums.iter().any(|&sum| sum != Rgb::ZERO) {
                    let room = volume.room(self.kernel, self.scene, vertex, medium);
                    sums.iter_mut().zip(room).for_each(|(sum, room)| *sum /= room);
                }
                sums
            };
            let wanted = self.classes.has(suffix.then(Event::Medium).class_with(LightPrefix::SCATTERED));
            let gathered = self.volume.filter(|_| wanted).map(gather);
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
    fn lit(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) {
        let suffix = self.arrived(scattered);
        if vertex.depth < self.max_depth && !self.scene.lights.is_empty() && self.lit_in_medium(suffix) {
            let light = vertex.throughput
                * next_event(self.scene, vertex, [(LobeSet::BROAD, SECOND_STRATEGY), (LobeSet::empty(), 0.0)]);
            if !light.is_finite() {
                self.sample.reject(Cause::DirectLight);
            }
            *if suffix.is_clear() { &mut self.sample.volume } else { &mut self.sample.indirect } += light;
        }
    }

    #[inline]
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, _: FlightDensity) {
        let scene = self.scene;
        self.suffix = self.arrived(scattered);
        let last = self.last;
        scene.lights.for_each_infinite(&last, direction, scattered.is_none(), |radiance, direct, start, _| {
            let onward = || scene.lights.entry_pdf_a(last.p, direction);
            let density =
                || Some(EmissionDensity { direct, start, onward: onward(), cos: 1.0, infinite: true, delta: false });
            self.run_into((radiance, throughput), direct, scattered, density);
        });
    }

    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        self.glints.scatter(vertex.surface.ng, sample);
    }

    fn lost(&mut self) {
        self.sample.reject(Cause::Path);
    }
}

/// What all camera paths of a render share.
#[derive(Clone, Copy)]
pub struct CameraPaths<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// The solids around the camera.
    pub interior: InitialMedium,
    /// Longest path in segments.
    pub max_depth: u32,
    /// Who brings indirect light where photons are gathered.
    pub indirect: Indirect,
    /// Classes of light paths to be measured.
    pub classes: ClassSet,
    /// What ends an iteration, if anything may.
    pub stop: Option<&'a Stop>,
}

impl CameraPaths<'_> {
    /// Whether the iteration under way is given up.
    #[inline]
    pub fn is_given_up(&self) -> bool {
        self.stop.is_some_and(Stop::should_abort)
    }

    /// Camera depth and position of what a measure has seen first, if anything (scene units; of the scene as it was
    /// read).
    pub fn first_hit(&self, sample: &PixelSample) -> Option<(f32, Vec3)> {
        let p = sample.first?.p;
        Some((self.camera.depth(p), (p.as_dvec3() + self.scene.origin).as_vec3()))
    }

    /// The first ray of a camera path through a uniform point of pixel `(x, y)`.
    #[inline]
    pub fn start(&self, pixel: (u32, u32), stream: Stream) -> PathStart {
        self.start_at(pixel, stream.vertex(0).two(Purpose::Pixel), stream)
    }

    /// The same through the point of the pixel that `within`, uniform on the unit square, draws.
    #[inline]
    pub fn start_at(&self, pixel: (u32, u32), within: Vec2, stream: Stream) -> PathStart {
        let draws = stream.vertex(0);
        let film = self.camera.film_point(pixel, within);
        let ray = self.camera.ray(film, draws.two(Purpose::Lens));
        PathStart {
            origin: ray.origin,
            direction: ray.direction,
            throughput: Rgb::ONE,
            interior: self.interior.at(self.scene, ray.origin),
            leaving: None,
            first: PrecomputedHit::Unknown,
            far: false,
            channel: None,
            wavelength_sample: WavelengthSample::new(draws.one(Purpose::Wavelength)),
        }
    }

    /// The starts of the camera paths of neighbouring pixels, first rays traced together.
    #[inline]
    pub fn starts(
        &self,
        places: &[Option<TilePixel>; GROUP_SIZE],
        streams: Streams,
    ) -> [Option<(PathStart, Stream)>; GROUP_SIZE] {
        self.starts_through(places, streams, streams)
    }

    /// The same, through points of pixels and lens that are drawn from `film`.
    pub fn starts_through(
        &self,
        places: &[Option<TilePixel>; GROUP_SIZE],
        film: Streams,
        streams: Streams,
    ) -> [Option<(PathStart, Stream)>; GROUP_SIZE] {
        let mut starts = [const { None }; GROUP_SIZE];
        for (start, place) in starts.iter_mut().zip(places) {
            if let Some(place) = place {
                let key = self.camera.pixel_key(place.pixel);
                let stream = streams.path(key);
                let first = PrecomputedHit::Nothing;
                let film = film.path(key);
                *start = Some((PathStart { first, ..self.start(place.pixel, film) }, stream));
            }
        }
        let mut hits = [const { None }; GROUP_SIZE];
        let ray = |k: usize| {
            starts[k].as_ref().map(|(start, stream): &(PathStart, Stream)| Ray {
                origin: start.origin,
                direction: start.direction,
                tmax: f32::INFINITY,
                token: camera_token(self.scene, stream.vertex(0), Purpose::Alpha),
            })
        };
        self.scene.tracer.intersect8(ray, |k, hit| hits[k] = Some(hit));
        let triangles = hits.iter().flatten().map(|hit| (hit.instance, hit.primitive));
        self.scene.shapes.prefetch(triangles);
        for (start, hit) in starts.iter_mut().zip(hits) {
            if let (Some((start, _)), Some(hit)) = (start, hit) {
                start.first = PrecomputedHit::Hit(hit);
            }
        }
        starts
    }

    /// Traces one camera path and measures all levels of `bandwidths`, and of `volume` where media scatter, with `kernel`.
    /// `scratch` has served no other photons.
    #[inline]
    pub fn sample(
        &self,
        scratch: &mut Scratch,
        (start, stream): &(PathStart, Stream),
        photons: &PhotonMaps,
        volume: Option<Volume<'_>>,
        bandwidths: impl Bandwidths,
        kernel: impl Kernel,
    ) -> PixelSample {
        match self.indirect {
            Indirect::Photons => {
                self.sample_with::<_, _, false>(scratch, start, *stream, photons, volume, bandwidths, kernel)
            }
            Indirect::Paths => {
                self.sample_with::<_, _, true>(scratch, start, *stream, photons, volume, bandwidths, kernel)
            }
        }
    }

    #[inline]
    #[allow(clippy::too_many_arguments, reason = "those of `sample`")]
    fn sample_with<B: Bandwidths, K: Kernel, const PATHS: bool>(
        &self,
        scratch: &mut Scratch,
        start: &PathStart,
        stream: Stream,
        photons: &PhotonMaps,
        volume: Option<Volume<'_>>,
        bandwidths: B,
        kernel: K,
    ) -> PixelSample {
        let mut gather = Gather::<B, K, PATHS> {
            kernel,
            scene: self.scene,
            photons,
            near: &mut scratch.near,
            volume,
            near_volume: &mut scratch.near_volume,
            waiting: &mut scratch.waiting,
            bandwidths,
            max_depth: self.max_depth,
            sample: PixelSample::default(),
            length: 0.0,
            suffix: CameraSuffix::START,
            lobes: LobeSet::empty(),
            classes: self.classes,
            broadly: false,
            glints: Glints::NONE,
            last: Receiver::anywhere(Vec3::ZERO),
        };
        walk(self.scene, &scratch.arena, start, stream, Transport::Radiance, self.max_depth, &mut gather);
        let sample = gather.sample;
        scratch.arena.reset();
        sample
    }
}
