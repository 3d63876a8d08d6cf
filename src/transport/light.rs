//! Light paths that leave photons.

use super::camera_paths::Indirect;
use super::initial_media::InitialMedia;
use super::segment::{PrecomputedHit, token};
use super::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use super::walk::{PathStart, walk};
use crate::bsdf::{LobeSet, Transport};
use crate::light::{EmissionDensity, Guide, Region, guide};
use crate::math::{DVec2, DVec3, Rgb, Vec2};
use crate::photon::{ByKind, Kind, Photon, PhotonFlags, ThinningKey, VolumePhoton};
use crate::plan::ClassSet;
use crate::random::{Domain, GOLDEN, Purpose, SobolPair, Stream, Streams, mix};
use crate::scene::Scene;
use crate::scene::contact::ContactPoint;
use crate::spectrum::{Band, IterationWavelengths, WavelengthSample};
use crate::stop::Stop;
use bumpalo::Bump;

/// The light paths of one pass: their number, and the points their emission is drawn from, rescrambled every pass.
#[derive(Clone, Copy)]
pub struct LightPaths<'a> {
    streams: Streams,
    paths: u32,
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

/// Light paths between two looks at whether they are given up.
const ABORT_CHECK_INTERVAL: u32 = 16;

/// How a light path begins.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    /// Its start.
    pub start: PathStart,
    /// Random numbers of the path.
    pub stream: Stream,
    /// The light cannot be hit by a ray.
    pub delta: bool,
    /// Index of the light.
    pub light: u32,
    /// Densities of the start.
    pub density: EmissionDensity,
    /// Component of the guide that made it; [`guide::UNGUIDED`] where there is none.
    pub cell: usize,
    /// Density of unguided emission, without a region of interest, over that of the guide; 1 where there is no guide.
    pub ratio: f32,
    /// Density of starts that are drawn by power alone over that of the guide; 1 where there is no guide.
    pub weight: f32,
    /// Share of the start's density that paths of all light have, without those sent where caustics are made.
    pub unaimed: f32,
}

impl<'a> LightPaths<'a> {
    /// Pass `pass` of `paths` light paths.
    pub fn new(seed: u64, pass: u64, domain: Domain, paths: u32, max_depth: u32) -> LightPaths<'a> {
        let key = mix(mix(seed ^ 0x6c62_272e_07bb_0142).wrapping_add(pass.wrapping_mul(GOLDEN)) ^ domain as u64);
        let pair = |i: u64| SobolPair::new(key.wrapping_add(i));
        let (choice, point, direction) = (pair(1), pair(2), pair(3));
        LightPaths {
            streams: Streams::new(seed, pass, domain),
            paths,
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

    /// The same with emission guided, if there is a guide.
    pub fn guided(self, guide: Option<&'a Guide>) -> LightPaths<'a> {
        LightPaths { guide, ..self }
    }

    /// The same with part of the light from infinity through a region, if there is one.
    #[must_use]
    pub fn lighting(self, region: Option<Region>) -> LightPaths<'a> {
        LightPaths { region, ..self }
    }

    /// The same with other draws for all but emission, whose points are spread over the paths of a pass.
    #[must_use]
    pub fn drawing(self, streams: Streams) -> LightPaths<'a> {
        LightPaths { streams, ..self }
    }

    /// For camera paths to which photons bring no other classes than `wanted`: none, if that is none; else without those
    /// of caustics, or with those alone.
    #[must_use]
    pub fn wanting(self, wanted: ClassSet, indirect: Indirect) -> LightPaths<'a> {
        LightPaths { paths: if wanted.is_empty() { 0 } else { self.paths }, kinds: indirect.kinds(wanted), ..self }
    }

    /// Whose paths take no other wavelengths than these.
    #[must_use]
    pub fn with(self, wavelengths: IterationWavelengths) -> LightPaths<'a> {
        LightPaths { wavelengths: Some(wavelengths), ..self }
    }

    /// Which ends where its iteration is given up.
    #[must_use]
    pub fn stopped_by(self, stop: &'a Stop) -> LightPaths<'a> {
        LightPaths { stop: Some(stop), ..self }
    }

    /// Whether path `index` and all others of its iteration are given up.
    #[inline]
    pub fn is_given_up(&self, index: u32) -> bool {
        index.is_multiple_of(ABORT_CHECK_INTERVAL) && self.stop.is_some_and(Stop::should_abort)
    }

    /// The wavelength of path `index`.
    #[inline]
    pub fn wavelength(&self, index: u32) -> WavelengthSample {
        self.wavelength_sample_of(self.stream(u64::from(index)))
    }

    /// The wavelength of a path with these draws.
    #[inline]
    pub fn wavelength_sample_of(&self, stream: Stream) -> WavelengthSample {
        let wavelength = WavelengthSample::new(stream.vertex(0).one(Purpose::Wavelength));
        self.wavelengths.map_or(wavelength, |wavelengths| wavelengths.nearest(wavelength))
    }

    /// Number of light paths.
    pub fn count(&self) -> u32 {
        self.paths
    }

    #[inline]
    fn stream(&self, index: u64) -> Stream {
        self.streams.path(index)
    }

    /// The beginning of path `index`, its flux divided by the number of paths.
    #[inline]
    pub fn emit(&self, scene: &Scene, initial_media: &InitialMedia, index: u32) -> Option<Emitted> {
        let draws = (self.choice.point_f64(index), self.point.point(index), self.direction.point(index));
        self.emit_by(scene, initial_media, self.stream(u64::from(index)), draws)
    }

    /// The beginning of a path all of whose draws are those of `stream`.
    pub fn emit_from(&self, scene: &Scene, initial_media: &InitialMedia, stream: Stream) -> Option<Emitted> {
        let draws = stream.vertex(0);
        let choice =
            DVec2::new(draws.one_fine(Purpose::EmitterChoice), f64::from(draws.nth(1).one(Purpose::EmitterChoice)));
        let (point, direction) = (draws.two(Purpose::EmitterPoint), draws.two(Purpose::EmitterDirection));
        self.emit_by(scene, initial_media, stream, (choice, point, direction))
    }

    #[inline(always)]
    fn emit_by(
        &self,
        scene: &Scene,
        initial_media: &InitialMedia,
        stream: Stream,
        (choice, point, direction): (DVec2, Vec2, Vec2),
    ) -> Option<Emitted> {
        let (lights, shapes, materials) = (&scene.lights, &scene.shapes, &scene.materials);
        let (emission, cell, ratio, weight, unaimed) = match self.guide {
            Some(guide) => {
                let guided = guide.emit(lights, shapes, materials, self.region, (choice, point, direction))?;
                (guided.emission, guided.cell, guided.ratio, guided.weight, guided.unaimed)
            }
            None => {
                let mut emission = lights.sample_emission(shapes, materials, choice.x, point, direction)?;
                lights.aim_with_region(&mut emission, self.region, choice.y as f32, point);
                let (mixed, unaimed) = lights.density_with_region(&emission, self.region);
                let (emission, _) = emission.reweighted(mixed)?;
                (emission, guide::UNGUIDED, 1.0, 1.0, unaimed / mixed)
            }
        };
        let mut flux = emission.flux / self.paths as f32;
        if emission.infinite
            && let Some(medium) = scene.medium
        {
            // It has come through the medium that fills all space, from infinity.
            flux *= medium.transmittance(f32::INFINITY);
        }
        let (origin, direction) = (emission.origin, emission.direction);
        let mut interior = initial_media.light(scene, emission.light, origin);
        let leaving = ContactPoint::on_light(scene, emission.light, origin);
        if let Some(place) = &leaving {
            interior = interior.before(scene, place, direction, token(scene, stream.vertex(0), Purpose::Alpha));
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

/// Photons of some light paths, in the order of paths and vertices.
#[derive(Default)]
pub struct Photons {
    /// On surfaces.
    pub surface: ByKind<Vec<Photon>>,
    /// In media.
    pub volume: Vec<VolumePhoton>,
    /// Paths that ended because their weight was not finite.
    pub lost: u64,
}

/// Leaves a photon at every vertex after the first (direct light is not the photons') that is not a perfect mirror or
/// clear glass.
///
/// Paths that were sent where caustics are made are many and carry little. After its first broad bounce such a path is
/// one among those that light everything: it goes on with a probability, their share of the density of its start, and
/// then carries as much as they do. Else bandwidths would be set by dense photons of little flux, and filled by sparse
/// ones of much. But in a solid that scatters light, such as milk in a glass, it is one of the few that get there at
/// all, and that scattering is what it was sent for: until it comes to an opaque surface it goes on as it is.
struct Deposit<'a> {
    scene: &'a Scene,
    photons: &'a mut Photons,
    /// Lobes that a path goes on with.
    onward: LobeSet,
    kinds: ByKind<bool>,
    caustic: bool,
    flags: PhotonFlags,
    /// A medium in a solid has scattered it, and it has come to nothing opaque since.
    within: bool,
    /// It has been made one among those that light everything.
    thinned: bool,
    /// The path may go on then, and its flux is multiplied by this.
    goes_on: bool,
    gain: f32,
    /// What flux is multiplied by here.
    scale: f32,
    /// What photons would weigh if it were 1; `None` where no light path is guided.
    weight: Option<f32>,
    /// Vertices so far.
    vertices: u32,
}

impl<'a> Deposit<'a> {
    /// Of a light path just begun, which goes on after a broad bounce with a probability.
    fn new(
        scene: &'a Scene,
        photons: &'a mut Photons,
        pass: &LightPaths,
        emitted: &Emitted,
        probability: f32,
    ) -> Deposit<'a> {
        let onward = if pass.kinds[Kind::Indirect as usize] { LobeSet::ALL } else { LobeSet::SHARP | LobeSet::DELTA };
        Deposit {
            scene,
            photons,
            onward,
            kinds: pass.kinds,
            caustic: true,
            flags: if emitted.delta {
                PhotonFlags::UNREACHABLE
            } else {
                PhotonFlags::from_area_light(emitted.density.ray_density())
            },
            within: false,
            thinned: false,
            goes_on: emitted.stream.vertex(0).one(Purpose::Loss) < probability,
            gain: 1.0 / probability,
            scale: 1.0,
            weight: pass.guide.is_some().then_some(emitted.weight),
            vertices: 0,
        }
    }

    /// At a vertex that a bounce has sent the path to: whether it goes on there.
    #[inline]
    fn arrives(&mut self, scattered: Option<Scattered>) -> bool {
        self.vertices += 1;
        let Some(scattered) = scattered else { return true };
        if scattered.lobe != LobeSet::DELTA {
            self.flags = PhotonFlags::default();
        }
        // A medium, which focuses nothing, is as broad as can be.
        self.caustic &= !scattered.lobe.intersects(LobeSet::BROAD);
        if self.caustic || self.thinned || self.within {
            return true;
        }
        (self.thinned, self.scale) = (true, self.gain);
        self.goes_on
    }
}

impl<'a> Visitor<'a> for Deposit<'_> {
    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        self.within &= vertex.shading.bsdf.transmits();
        if !self.arrives(scattered) {
            return Next::Stop;
        }
        // Whatever the lobes just here: photons measure the light that arrives around a gathering point, across borders
        // of materials and dark texels.
        let gathers = vertex.shading.bsdf.lobes() != LobeSet::DELTA;
        let kind = if self.caustic { Kind::Caustic } else { Kind::Indirect };
        if scattered.is_some() && gathers && self.kinds[kind as usize] {
            let thinning_key =
                self.weight.map(|weight| ThinningKey::new(weight * self.scale, vertex.draws.one(Purpose::ThinningKey)));
            self.photons.surface[kind as usize].push(Photon {
                p: vertex.surface.p,
                wi: vertex.wo,
                ng: vertex.surface.ng,
                flux: vertex.throughput * self.scale,
                flags: self.flags,
                depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
                band: Band::of(vertex.wavelength.as_ref()),
                thinning_key: thinning_key.unwrap_or_default(),
            });
        }
        Next::Continue(self.onward)
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        self.within = vertex.arrival.interior.host(self.scene).is_some();
        if !self.arrives(scattered) {
            return Next::Stop;
        }
        if scattered.is_some() {
            self.photons.volume.push(VolumePhoton {
                p: vertex.arrival.p,
                wi: vertex.wo,
                flux: vertex.arriving * self.scale,
                medium: vertex.medium_id(self.scene),
                depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
                band: Band::of(vertex.wavelength.as_ref()),
            });
        }
        Next::Continue(self.onward)
    }

    fn lost(&mut self) {
        self.photons.lost += 1;
    }
}

/// Traces light path `index` of the pass and appends its photons. Returns the component of the guide that made it, if
/// it began at all, and how many vertices it had.
#[inline]
pub fn light_path(
    scene: &Scene,
    arena: &Bump,
    initial_media: &InitialMedia,
    pass: &LightPaths,
    index: u32,
    photons: &mut Photons,
) -> Option<(usize, u32)> {
    let emitted = pass.emit(scene, initial_media, index)?;
    let mut deposit = Deposit::new(scene, photons, pass, &emitted, emitted.unaimed);
    walk(scene, arena, &emitted.start, emitted.stream, Transport::Importance, pass.max_depth, &mut deposit);
    let vertices = deposit.vertices;
    Some((emitted.cell, vertices))
}

/// Flux of all lights (W), from the beginnings of light paths.
pub fn emitted_flux(scene: &Scene, initial_media: &InitialMedia) -> DVec3 {
    const SAMPLES: u32 = 4096;
    let pass = LightPaths::new(0, 0, Domain::PilotLight, SAMPLES, u32::MAX);
    let emitted = (0..SAMPLES).filter_map(|index| pass.emit(scene, initial_media, index));
    // `emit` divides by the number of paths.
    emitted.map(|emitted| emitted.start.throughput.as_dvec3()).sum()
}

/// Light paths of one channel, all of the same flux: lights send them in proportion to what they emit, and what a path
/// would lose is the probability that it ends. So photons differ in number only, and their density alone tells where
/// light varies \[CPPM 2020, 9.4\].
#[derive(Clone, Copy, Debug)]
pub struct EqualFlux {
    channel: usize,
    /// Flux of a path (W), for passes of one path.
    flux: f32,
}

impl EqualFlux {
    /// Of a channel (0 to 2): as much flux as a light path carries on average, so that paths are as many. A channel
    /// that the sample has not seen may be that of a rare light: it gets the mean of all three, for any flux above zero
    /// leaves every light what it is, in more paths or fewer. `None` where no light shines.
    pub fn new(scene: &Scene, initial_media: &InitialMedia, channel: usize) -> Option<EqualFlux> {
        let flux = emitted_flux(scene, initial_media);
        let flux = if flux[channel] > 0.0 { flux[channel] } else { flux.element_sum() / 3.0 };
        (flux > 0.0).then_some(EqualFlux { channel, flux: flux as f32 })
    }

    /// Traces what light path `index` of the pass stands for: copies of it, as many as the common flux goes into its
    /// own on average.
    pub fn light_path(
        &self,
        scene: &Scene,
        arena: &mut Bump,
        initial_media: &InitialMedia,
        pass: &LightPaths,
        index: u32,
        photons: &mut Photons,
    ) {
        let Some(emitted) = pass.emit(scene, initial_media, index) else { return };
        let flux = self.flux / pass.paths as f32;
        let copies = emitted.start.throughput[self.channel] / flux;
        let copies = (copies + emitted.stream.vertex(0).one(Purpose::Loss)) as u64;
        let mut throughput = Rgb::ZERO;
        throughput[self.channel] = flux;
        let start = PathStart { throughput, channel: Some(self.channel), ..emitted.start };
        for copy in 0..copies {
            let stream = if copy == 0 { emitted.stream } else { pass.stream(u64::from(index) | copy << 32) };
            // All carry the same already.
            let mut deposit = Deposit::new(scene, photons, pass, &emitted, 1.0);
            walk(scene, arena, &start, stream, Transport::Importance, pass.max_depth, &mut deposit);
            arena.reset();
        }
    }
}
