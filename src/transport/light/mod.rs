//! Light paths that leave photons.

pub(in crate::transport) mod vertex_counts;

use crate::bsdf::{LobeSet, Transport};
use crate::light::{EmissionDensity, EmissionDraws, Emitter, Guide, Region, VolumeLight, guide};
use crate::math::{DVec2, DVec3, Rgb};
use crate::path_class::ClassSet;
use crate::photon::{ByKind, Kind, Photon, PhotonFlags, PhotonTag, ThinningKey, VolumePhoton};
use crate::random::{Domain, GOLDEN, Purpose, SobolPair, Stream, Streams, mix};
use crate::scene::Scene;
use crate::scene::contact::ContactPoint;
use crate::spectrum::{Band, IterationWavelengths, WavelengthSample};
use crate::stop::Stop;
use crate::transport::walk::camera_paths::Indirect;
use crate::transport::walk::initial_media::InitialMedia;
use crate::transport::walk::interior::Presence;
use crate::transport::walk::segment::{PrecomputedHit, token};
use crate::transport::walk::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::{PathStart, walk};
use bumpalo::Bump;

/// The light paths of one iteration: their number, and the low-discrepancy points of their emission, which are
/// scrambled anew for each iteration.
#[derive(Clone, Copy)]
pub struct LightPaths<'a> {
    streams: Streams,
    count: u32,
    max_depth: u32,
    choice: SobolPair,
    point: SobolPair,
    direction: SobolPair,
    guide: Option<&'a Guide>,
    region: Option<Region>,
    kinds: ByKind<bool>,
    wavelengths: Option<IterationWavelengths>,
    stop: Option<&'a Stop>,
}

/// Number of light paths between two checks whether the iteration is aborted.
const ABORT_CHECK_INTERVAL: u32 = 16;

/// The start of a light path.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    /// First ray of the path, and its throughput.
    pub start: PathStart,
    /// Random numbers of the path.
    pub stream: Stream,
    /// Whether the light is a delta light, which rays cannot hit.
    pub delta: bool,
    /// Index of the light that the path starts from.
    pub light: u32,
    /// Probability densities of origin and direction of the first ray.
    pub density: EmissionDensity,
    /// Component of the guide (distribution that aims light paths at what makes caustics) that sampled the start;
    /// [`guide::UNGUIDED`] without a guide.
    pub cell: usize,
    /// Density of unguided emission without a region of interest over the guide's density; 1 without a guide.
    pub ratio: f32,
    /// Density of starts sampled by power alone over the guide's density; 1 without a guide.
    pub weight: f32,
    /// Fraction of the density of the start that is not aimed at objects that make caustics, 0 to 1.
    pub unaimed: f32,
}

impl<'a> LightPaths<'a> {
    /// The `count` light paths of iteration `i`.
    pub fn new(seed: u64, i: u64, domain: Domain, count: u32, max_depth: u32) -> LightPaths<'a> {
        let key = mix(mix(seed ^ 0x6c62_272e_07bb_0142).wrapping_add(i.wrapping_mul(GOLDEN)) ^ domain as u64);
        let pair = |k: u64| SobolPair::new(key.wrapping_add(k));
        let (choice, point, direction) = (pair(1), pair(2), pair(3));
        LightPaths {
            streams: Streams::new(seed, i, domain),
            count,
            max_depth,
            choice,
            point,
            direction,
            guide: None,
            region: None,
            kinds: [true; 2],
            wavelengths: None,
            stop: None,
        }
    }

    /// Aims light paths by `guide`, a distribution that prefers objects that make caustics; `None` for no guide.
    pub fn guided(self, guide: Option<&'a Guide>) -> LightPaths<'a> {
        LightPaths { guide, ..self }
    }

    /// Sends part of the light from infinity through a region of interest; `None` for no region.
    #[must_use]
    pub fn lighting(self, region: Option<Region>) -> LightPaths<'a> {
        LightPaths { region, ..self }
    }

    /// Replaces all random numbers except those of emission, whose points are stratified over the paths of an
    /// iteration.
    #[must_use]
    pub fn drawing(self, streams: Streams) -> LightPaths<'a> {
        LightPaths { streams, ..self }
    }

    /// Limits photons to the kinds that find the classes in `wanted`. Without any class no paths are traced.
    #[must_use]
    pub fn wanting(self, wanted: ClassSet, indirect: Indirect) -> LightPaths<'a> {
        LightPaths { count: if wanted.is_empty() { 0 } else { self.count }, kinds: indirect.kinds(wanted), ..self }
    }

    /// Limits the wavelengths of the paths to the ones chosen for an iteration.
    #[must_use]
    pub fn with(self, wavelengths: IterationWavelengths) -> LightPaths<'a> {
        LightPaths { wavelengths: Some(wavelengths), ..self }
    }

    /// Stops tracing when `stop` aborts the iteration, and ends paths when it cuts them.
    #[must_use]
    pub fn stopped_by(self, stop: Option<&'a Stop>) -> LightPaths<'a> {
        LightPaths { stop, ..self }
    }

    /// Whether the iteration is aborted. Checked at every few paths only, by `index`, the number of the path.
    #[inline]
    pub fn is_given_up(&self, index: u32) -> bool {
        index.is_multiple_of(ABORT_CHECK_INTERVAL) && self.stop.is_some_and(Stop::should_abort)
    }

    /// The wavelength that light path `index` takes if it meets dispersive glass.
    #[inline]
    pub fn wavelength(&self, index: u32) -> WavelengthSample {
        self.wavelength_sample_of(self.stream(u64::from(index)))
    }

    /// The wavelength that a path with these random numbers takes if it meets dispersive glass.
    #[inline]
    pub fn wavelength_sample_of(&self, stream: Stream) -> WavelengthSample {
        let wavelength = WavelengthSample::new(stream.vertex(0).one(Purpose::Wavelength));
        self.wavelengths.map_or(wavelength, |wavelengths| wavelengths.nearest(wavelength))
    }

    /// Number of light paths of the iteration.
    pub fn count(&self) -> u32 {
        self.count
    }

    #[inline]
    fn stream(&self, index: u64) -> Stream {
        self.streams.path(index)
    }

    /// The start of light path `index`; its flux is divided by the number of paths. `None` if no light emits.
    #[inline]
    pub fn emit(&self, scene: &Scene, initial_media: &InitialMedia, index: u32) -> Option<Emitted> {
        let draws = EmissionDraws {
            choice: self.choice.point_f64(index),
            point: self.point.point(index),
            direction: self.direction.point(index),
        };
        self.emit_by(scene, initial_media, self.stream(u64::from(index)), draws)
    }

    /// The start of a path whose random numbers all come from `stream`.
    pub fn emit_from(&self, scene: &Scene, initial_media: &InitialMedia, stream: Stream) -> Option<Emitted> {
        let draws = stream.vertex(0);
        let choice =
            DVec2::new(draws.one_fine(Purpose::EmitterChoice), f64::from(draws.nth(1).one(Purpose::EmitterChoice)));
        let (point, direction) = (draws.two(Purpose::EmitterPoint), draws.two(Purpose::EmitterDirection));
        self.emit_by(scene, initial_media, stream, EmissionDraws { choice, point, direction })
    }

    #[inline(always)]
    fn emit_by(
        &self,
        scene: &Scene,
        initial_media: &InitialMedia,
        stream: Stream,
        draws: EmissionDraws,
    ) -> Option<Emitted> {
        let (lights, shapes, materials) = (&scene.lights, &scene.shapes, &scene.materials);
        let (emission, cell, ratio, weight, unaimed) = match self.guide {
            Some(guide) => {
                let guided = guide.emit(lights, shapes, materials, self.region, draws)?;
                (guided.emission, guided.cell, guided.ratio, guided.weight, guided.unaimed)
            }
            None => {
                let EmissionDraws { choice, point, direction } = draws;
                let mut emission = lights.sample_emission(shapes, materials, choice.x, point, direction)?;
                lights.aim_with_region(&mut emission, self.region, choice.y as f32, point);
                let (mixed, unaimed) = lights.density_with_region(&emission, self.region);
                let (emission, _) = emission.reweighted(mixed)?;
                (emission, guide::UNGUIDED, 1.0, 1.0, unaimed / mixed)
            }
        };
        let mut flux = emission.flux / self.count as f32;
        if emission.infinite
            && let Some(medium) = scene.medium
        {
            // The light has crossed the medium that fills all space, from infinity.
            flux *= medium.transmittance(f32::INFINITY);
        }
        let (origin, direction) = (emission.origin, emission.direction);
        let draws = stream.vertex(0);
        let mut interior = initial_media.light(scene, emission.light, origin).decided(scene, draws);
        if let Emitter::Volume(VolumeLight { instance, .. }) = &lights.emitters()[emission.light as usize]
            && interior.host(scene) != Some(*instance)
        {
            return None;
        }
        let leaving = ContactPoint::on_light(scene, emission.light, origin);
        if let Some(place) = &leaving {
            interior = interior.before_entering(scene, place, direction, token(scene, draws, Purpose::Alpha));
        }
        Some(Emitted {
            start: PathStart {
                origin,
                direction,
                throughput: flux,
                interior,
                leaving,
                first: PrecomputedHit::Unknown,
                far: emission.infinite,
                channel: None,
                wavelength_sample: self.wavelength_sample_of(stream),
                linked: (!lights.links().is_empty()).then_some(emission.light),
            },
            stream,
            delta: emission.delta,
            light: emission.light,
            density: emission.density,
            cell,
            ratio,
            weight,
            unaimed,
        })
    }
}

/// Photons of several light paths, in the order of paths and vertices.
#[derive(Default)]
pub struct Photons {
    /// Photons on surfaces, by kind.
    pub surface: ByKind<Vec<Photon>>,
    /// Photons in media.
    pub volume: Vec<VolumePhoton>,
    /// Number of paths that ended because their throughput was not finite.
    pub lost: u64,
}

/// Visitor that leaves a photon at every vertex after the first, except at perfect mirrors and clear glass. The first
/// vertex receives direct light, which photons do not carry.
///
/// Paths aimed at what makes caustics are many, and each carries little flux. After its first broad bounce such a path
/// contributes to general indirect light. It survives with probability `unaimed`, and then carries as much flux as
/// unaimed paths. Otherwise dense photons of low flux would set the bandwidths, and sparse photons of high flux would
/// fill them. In a solid that scatters light, such as milk in a glass, the aimed paths are the ones that arrive, and
/// they are aimed there for that scattering. So inside, thinning waits until the path meets an opaque surface.
struct Deposit<'a> {
    scene: &'a Scene,
    photons: &'a mut Photons,
    /// Lobes by which the path continues.
    onward: LobeSet,
    kinds: ByKind<bool>,
    caustic: bool,
    flags: PhotonFlags,
    /// Whether a medium in a solid has scattered the path, and it has met nothing opaque since.
    inside_solid: bool,
    /// Whether the roulette after the first broad bounce has taken place.
    thinned: bool,
    /// Whether the path survives the roulette after its first broad bounce; its flux is then multiplied by `gain`.
    goes_on: bool,
    gain: f32,
    /// Factor by which the flux of the path is multiplied now.
    scale: f32,
    /// Weight in the thinning keys of photons at a `scale` of 1; `None` if no light path is guided.
    weight: Option<f32>,
    /// Number of vertices of the path so far.
    vertices: u32,
    stop: Option<&'a Stop>,
}

impl<'a> Deposit<'a> {
    /// The visitor of a light path that survives its first broad bounce with `probability`.
    fn new(
        scene: &'a Scene,
        photons: &'a mut Photons,
        paths: &LightPaths<'a>,
        emitted: &Emitted,
        probability: f32,
    ) -> Deposit<'a> {
        let onward = if paths.kinds[Kind::Indirect as usize] { LobeSet::ALL } else { LobeSet::SHARP | LobeSet::DELTA };
        Deposit {
            scene,
            photons,
            onward,
            kinds: paths.kinds,
            caustic: true,
            flags: if emitted.delta {
                PhotonFlags::UNREACHABLE
            } else {
                PhotonFlags::from_area_light(emitted.density.ray_density())
            },
            inside_solid: false,
            thinned: false,
            goes_on: emitted.stream.vertex(0).one(Purpose::Loss) < probability,
            gain: 1.0 / probability,
            scale: 1.0,
            weight: paths.guide.is_some().then_some(emitted.weight),
            vertices: 0,
            stop: paths.stop,
        }
    }

    /// Notes that the path arrives at a vertex. Returns false if it ends there.
    #[inline]
    fn arrives(&mut self, scattered: Option<Scattered>) -> bool {
        self.vertices += 1;
        let Some(scattered) = scattered else { return true };
        if scattered.lobe != LobeSet::DELTA {
            self.flags = PhotonFlags::default();
        }
        // Scattering in a medium counts as broad.
        self.caustic &= !scattered.lobe.intersects(LobeSet::BROAD);
        if self.caustic || self.thinned || self.inside_solid {
            return true;
        }
        (self.thinned, self.scale) = (true, self.gain);
        self.goes_on
    }
}

impl<'a> Visitor<'a> for Deposit<'_> {
    #[inline]
    fn stop(&self) -> Option<&Stop> {
        self.stop
    }

    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        self.inside_solid &= vertex.shading.bsdf.transmits();
        if !self.arrives(scattered) {
            return Next::Stop;
        }
        // All lobes count: photons represent the light that arrives around a gathering point, across borders of
        // materials and dark texels.
        let gathers = vertex.shading.bsdf.lobes() != LobeSet::DELTA;
        let kind = if self.caustic { Kind::Caustic } else { Kind::Indirect };
        if scattered.is_some() && gathers && self.kinds[kind as usize] {
            let Presence { absent, chance } = vertex.meeting(self.scene);
            let thinning_key =
                self.weight.map(|weight| ThinningKey::new(weight * self.scale, vertex.draws.one(Purpose::ThinningKey)));
            self.photons.surface[kind as usize].push(Photon {
                p: vertex.surface.p,
                wi: vertex.wo,
                ng: vertex.surface.ng,
                flux: vertex.throughput * (self.scale / chance),
                flags: self.flags,
                depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
                tag: PhotonTag::new(Band::of_wavelength(vertex.wavelength.as_ref()), absent),
                thinning_key: thinning_key.unwrap_or_default(),
            });
        }
        Next::Continue(self.onward)
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        self.inside_solid = vertex.arrival.interior.host(self.scene).is_some();
        if !self.arrives(scattered) {
            return Next::Stop;
        }
        if scattered.is_some() {
            self.photons.volume.push(VolumePhoton {
                p: vertex.arrival.p,
                wi: vertex.wo,
                flux: vertex.arriving * (self.scale / vertex.presence(self.scene).chance),
                medium: vertex.medium_id(self.scene),
                depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
                band: Band::of_wavelength(vertex.wavelength.as_ref()),
            });
        }
        Next::Continue(self.onward)
    }

    fn lost(&mut self) {
        self.photons.lost += 1;
    }
}

/// Traces light path `index` and appends its photons. Returns the component of the guide that sampled it and the number
/// of its vertices; `None` if no light emits.
#[inline]
pub fn light_path(
    scene: &Scene,
    arena: &Bump,
    initial_media: &InitialMedia,
    paths: &LightPaths,
    index: u32,
    photons: &mut Photons,
) -> Option<(usize, u32)> {
    let emitted = paths.emit(scene, initial_media, index)?;
    let mut deposit = Deposit::new(scene, photons, paths, &emitted, emitted.unaimed);
    walk(scene, arena, &emitted.start, emitted.stream, Transport::Importance, paths.max_depth, &mut deposit);
    let vertices = deposit.vertices;
    Some((emitted.cell, vertices))
}

/// Flux of all lights (W), estimated from starts of light paths.
pub fn emitted_flux(scene: &Scene, initial_media: &InitialMedia) -> DVec3 {
    const SAMPLES: u32 = 4096;
    let paths = LightPaths::new(0, 0, Domain::PilotLight, SAMPLES, u32::MAX);
    let emitted = (0..SAMPLES).filter_map(|index| paths.emit(scene, initial_media, index));
    // `emit` divides by the number of paths.
    emitted.map(|emitted| emitted.start.throughput.as_dvec3()).sum()
}

/// Light paths of a single channel with equal flux. Lights send them in proportion to their emission, and losses become
/// the probability that a path ends. So photons differ in number only, and their density follows the light \[CPPM 2020,
/// 9.4\].
#[derive(Clone, Copy, Debug)]
pub struct EqualFlux {
    channel: usize,
    /// Flux (W) that each path would have if an iteration had one path only.
    flux: f32,
}

impl EqualFlux {
    /// For a channel (0 to 2), with the mean flux of a light path, so that the number of paths stays the same. If the
    /// sample sees no light in the channel, a rare light may still have some: any flux above zero is unbiased, and the
    /// mean of all channels is used. `None` if no light shines.
    pub fn new(scene: &Scene, initial_media: &InitialMedia, channel: usize) -> Option<EqualFlux> {
        let flux = emitted_flux(scene, initial_media);
        let flux = if flux[channel] > 0.0 { flux[channel] } else { flux.element_sum() / 3.0 };
        (flux > 0.0).then_some(EqualFlux { channel, flux: flux as f32 })
    }

    /// Traces copies of light path `index`; their expected number is the path's own flux over the common flux.
    pub fn light_path(
        &self,
        scene: &Scene,
        arena: &mut Bump,
        initial_media: &InitialMedia,
        paths: &LightPaths,
        index: u32,
        photons: &mut Photons,
    ) {
        let Some(emitted) = paths.emit(scene, initial_media, index) else { return };
        let flux = self.flux / paths.count as f32;
        let copies = emitted.start.throughput[self.channel] / flux;
        let copies = (copies + emitted.stream.vertex(0).one(Purpose::Loss)) as u64;
        let mut throughput = Rgb::ZERO;
        throughput[self.channel] = flux;
        let start = PathStart { throughput, channel: Some(self.channel), ..emitted.start };
        for copy in 0..copies {
            let stream = if copy == 0 { emitted.stream } else { paths.stream(u64::from(index) | copy << 32) };
            // All copies carry equal flux already.
            let mut deposit = Deposit::new(scene, photons, paths, &emitted, 1.0);
            walk(scene, arena, &start, stream, Transport::Importance, paths.max_depth, &mut deposit);
            arena.reset();
        }
    }
}
