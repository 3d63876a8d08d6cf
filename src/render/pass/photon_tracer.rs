//! The light paths of stochastic progressive photon mapping: photon maps of an iteration, and initial bandwidths from a
//! pilot.

use super::guiding::{guide_at, learn_guide};
use super::integrator::Work;
use super::light_path_ranges::light_path_ranges;
use super::region::region;
use super::volume::{Maps, VolumeMap};
use crate::estimator::PixelAccumulator;
use crate::light::{Guide, Region};
use crate::photon::{Kind, PhotonMap, kind};
use crate::random::Domain;
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::initial_bandwidth::{
    InitialBandwidth, initial_bandwidths, initial_volume_bandwidths, median_bandwidth2,
};
use crate::render::input::RenderInput;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::transport::{EqualFlux, Indirect, InitialMedia, LightPaths, Photons, light_path};
use bumpalo::Bump;
use rayon::prelude::*;
use std::ops::Range;

/// Traces all light paths of an iteration and returns their photons, in the order of paths and vertices.
pub fn trace_photons(scene: &Scene, initial_media: &InitialMedia, paths: &LightPaths) -> Photons {
    trace_range(scene, initial_media, paths, 0..paths.count())
}

/// Traces the light paths of an iteration whose indices lie in `range`.
pub(super) fn trace_range(
    scene: &Scene,
    initial_media: &InitialMedia,
    paths: &LightPaths,
    range: Range<u32>,
) -> Photons {
    trace_by(paths, range, |arena, index, photons| {
        light_path(scene, arena, initial_media, paths, index, photons);
    })
}

/// Calls `light_path` for the light paths whose indices lie in `range`, and returns their photons in the order of
/// paths.
fn trace_by(
    paths: &LightPaths,
    range: Range<u32>,
    light_path: impl Fn(&mut Bump, u32, &mut Photons) + Sync,
) -> Photons {
    let parts: Vec<Photons> = light_path_ranges(range.len() as u32)
        .map_init(Bump::new, |arena, part| {
            let mut photons = Photons::default();
            for index in part.take_while(|index| !paths.is_given_up(*index)) {
                light_path(arena, range.start + index, &mut photons);
                arena.reset();
            }
            photons
        })
        .collect();
    let mut photons = Photons::default();
    for part in parts {
        photons.lost += part.lost;
        kind::append(&mut photons.surface, part.surface);
        photons.volume.extend(part.volume);
    }
    photons
}

/// Photons of equal flux for each channel; `None` if the settings do not trace the channels separately.
fn equal_flux(input: &RenderInput<'_>) -> Option<[Option<EqualFlux>; 3]> {
    let of_channel = |channel| EqualFlux::new(input.scene, &input.initial_media, channel);
    input.settings.has_channels().then(|| std::array::from_fn(of_channel))
}

/// Pixels before the first iteration, with their initial bandwidths, and a bound of bandwidths.
pub(super) struct InitialPixels {
    pub pixels: Vec<PixelAccumulator>,
    /// Largest squared bandwidth after a camera path's first broad bounce, before the bandwidths shrink.
    pub indirect_cap2: f32,
}

/// Traces the light paths of a render.
pub(super) struct PhotonTracer {
    guide: Option<Guide>,
    /// Sphere toward which lights at infinity send their light paths; `None`: the whole scene.
    region: Option<Region>,
    /// Photons of equal flux, where the channels are traced separately.
    equal_flux: Option<[Option<EqualFlux>; 3]>,
}

impl PhotonTracer {
    /// Makes the tracer, and learns the guide of light paths if the settings ask for one.
    pub fn new(input: &RenderInput<'_>) -> PhotonTracer {
        let RenderInput { scene, settings, initial_media, .. } = input;
        let camera_paths = input.camera_paths();
        let guided = settings.guided && !settings.photon_classes(&scene.survey).is_empty();
        let region = region(&camera_paths, settings.seed);
        let guide = guided.then(|| learn_guide(&camera_paths, initial_media, settings, region)).flatten();
        PhotonTracer { guide, region, equal_flux: equal_flux(input) }
    }

    /// The learnt distribution of starts of light paths; `None` if guiding is off or not worth its cost.
    pub fn guide(&self) -> Option<&Guide> {
        self.guide.as_ref()
    }

    /// Number of photon maps of an iteration: one, or one for each channel.
    pub fn map_count(&self) -> usize {
        self.equal_flux.map_or(1, |channels| channels.len())
    }

    /// Traces the photons of iteration `i` and builds their maps: one, or one for each colour channel.
    pub fn maps(&self, input: &RenderInput<'_>, i: u64, phases: &mut Phases) -> (Vec<Maps>, Work) {
        let mut work = Work::default();
        let equal_flux = if input.moves() { equal_flux(input) } else { self.equal_flux };
        let maps = match &equal_flux {
            None => {
                let guide = guide_at(self.guide(), input);
                let paths = self.light_paths(input, i, Domain::Light, guide.as_deref());
                let trace = || trace_photons(input.scene, &input.initial_media, &paths);
                vec![timed_map(input, i, &paths, paths.count(), trace, phases, &mut work)]
            }
            Some(channels) => {
                (0..).zip(channels).map(|(k, f)| channel_map(input, i, k, *f, phases, &mut work)).collect()
            }
        };
        (maps, work)
    }

    fn light_paths<'s>(
        &self,
        input: &'s RenderInput<'_>,
        i: u64,
        domain: Domain,
        guide: Option<&'s Guide>,
    ) -> LightPaths<'s> {
        let RenderInput { scene, settings, .. } = input;
        let Settings { seed, photons, max_depth, .. } = *settings;
        LightPaths::new(seed, i, domain, photons, max_depth)
            .guided(guide)
            .lighting(self.region)
            .wanting(settings.photon_classes(&scene.survey), settings.indirect)
            .with(IterationWavelengths::new(seed, i))
            .stopped_by(Some(&settings.stop))
    }

    /// Makes the pixels before the first iteration. Their bandwidths come from a pilot, if the settings derive them
    /// from photons.
    pub fn initial_pixels(&self, input: &RenderInput<'_>) -> InitialPixels {
        let RenderInput { scene, settings, .. } = input;
        let Settings { initial_bandwidth: initial, max_initial_bandwidth: [surface, volume], seed, .. } = *settings;
        let camera_paths = &input.camera_paths();
        let pilot = if matches!(initial, InitialBandwidth::Nearest(_)) {
            trace_photons(scene, &input.initial_media, &self.light_paths(input, 0, Domain::PilotLight, self.guide()))
        } else {
            Photons::default()
        };
        let maps = pilot.surface.map(PhotonMap::build);
        let bandwidths = initial_bandwidths(camera_paths, initial, surface, seed, maps.each_ref());
        let indirect_cap2 = match (initial, settings.indirect) {
            (InitialBandwidth::Nearest(k), Indirect::Paths) => median_bandwidth2(&maps[Kind::Caustic as usize], k),
            _ => f32::INFINITY,
        };
        let mut pixels = settings.pixels(scene, &bandwidths);
        if scene.survey.scattering {
            let pilot = PhotonMap::build(pilot.volume);
            let bandwidths = initial_volume_bandwidths(camera_paths, initial, volume, seed, &pilot);
            for (pixel, bandwidth) in pixels.iter_mut().zip(bandwidths) {
                pixel.volume_bandwidth = bandwidth;
            }
        }
        InitialPixels { pixels, indirect_cap2 }
    }
}

/// Traces a third of the light paths for one colour channel and builds the map of their photons.
fn channel_map(
    input: &RenderInput<'_>,
    i: u64,
    channel: u64,
    flux: Option<EqualFlux>,
    phases: &mut Phases,
    work: &mut Work,
) -> Maps {
    let RenderInput { scene, settings, initial_media, .. } = input;
    let Settings { seed, max_depth, photons, .. } = *settings;
    // The channels share no random numbers.
    let paths = LightPaths::new(seed, 3 * i + channel, Domain::Light, (photons / 3).max(1), max_depth)
        .with(IterationWavelengths::new(seed, i))
        .stopped_by(Some(&settings.stop))
        .wanting(settings.photon_classes(&scene.survey), Indirect::Photons);
    let trace = || {
        flux.map_or(Photons::default(), |flux| {
            trace_by(&paths, 0..paths.count(), |arena, index, photons| {
                flux.light_path(scene, arena, initial_media, &paths, index, photons);
            })
        })
    };
    timed_map(input, i, &paths, 0, trace, phases, work)
}

/// Traces photons, builds their map, and adds times and counts to `phases` and `work`. `expected_paths` is the
/// number of light paths from which glints (light that mirrors and clear glass send to sharp lobes) derive the
/// expected number of photons; 0 if glints are not gathered.
fn timed_map(
    input: &RenderInput<'_>,
    i: u64,
    paths: &LightPaths,
    expected_paths: u32,
    trace: impl FnOnce() -> Photons,
    phases: &mut Phases,
    work: &mut Work,
) -> Maps {
    let start = cpu_seconds();
    let photons = trace();
    let traced = cpu_seconds();
    let maps = build(input, photons, expected_paths, i);
    phases.light += traced - start;
    phases.map += cpu_seconds() - traced;
    work.light_paths += u64::from(paths.count());
    work.photons += maps.len();
    work.rejected += maps.rejected();
    work.counts.add(&maps.counts());
    maps
}

/// Builds the maps of the photons of iteration `i`. Glints (light that mirrors and clear glass send to
/// sharp lobes) are gathered if photons of caustics are traced.
fn build(input: &RenderInput<'_>, photons: Photons, expected_paths: u32, i: u64) -> Maps {
    let RenderInput { scene, settings, .. } = input;
    let survey = &scene.survey;
    let lost = photons.lost;
    let volume = survey.scattering.then(|| VolumeMap::new(photons.volume, i, settings));
    let [others, caustics] = photons.surface.map(PhotonMap::build);
    let [_, has_caustics] = settings.bandwidth_kinds(survey);
    let surface = [others, caustics.of_paths(if has_caustics { expected_paths } else { 0 })];
    Maps { surface, volume, wavelengths: IterationWavelengths::new(settings.seed, i), lost }
}
