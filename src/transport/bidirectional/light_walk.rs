//! Light paths of the bidirectional methods.

use super::light_vertex::{LightVertex, Scatterer};
use super::mis::{self, Merges, MisState, Ratios};
use super::photon_merge::MergePhoton;
use super::shares::{Incident, PathHalves, shares, wanted};
use super::{Bidirectional, MergeLevels, PathRecorder, Technique};
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::light::{Group, Receiver};
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::FlightDensity;
use crate::path_class::{CameraSuffix, Event, LightPrefix, Part, PathClass};
use crate::random::Purpose;
use crate::stop::Stop;
use crate::transport::light::{Emitted, LightPaths};
use crate::transport::walk::cause::Cause;
use crate::transport::walk::interior::Presence;
use crate::transport::walk::lobe_layers::FirstScatter;
use crate::transport::walk::pixel_sample::PixelSample;
use crate::transport::walk::scattering_vertex::ScatterPoint;
use crate::transport::walk::segment::camera_token;
use crate::transport::walk::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::walk;

/// Light that a light path sends to a pixel through a connection to the camera. Its MIS weight depends on the
/// bandwidths of that pixel.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Index of the pixel, row by row.
    pub pixel: u32,
    /// Number of segments of the light path up to the light vertex.
    pub light: u32,
    /// Class of the whole path: the kinds of its bounces.
    pub class: PathClass,
    /// Light group of the light that the path starts from.
    pub group: Group,
    /// Radiance, without MIS weight.
    pub value: Rgb,
    /// Ratios of densities that determine the MIS weight.
    pub ratios: Ratios,
}

impl Splat {
    /// Adds the light, times its MIS weight at each bandwidth level, to the sample of its pixel.
    #[inline]
    pub fn apply(&self, levels: &MergeLevels, sample: &mut PixelSample) {
        if !self.value.is_finite() {
            return sample.reject(Cause::Splat);
        }
        add(sample, levels, self.class, self.value, self.ratios);
    }
}

/// Adds light to all bandwidth levels of a sample, each with its MIS weight.
#[inline]
pub(in crate::transport) fn add(
    sample: &mut PixelSample,
    levels: &MergeLevels,
    class: PathClass,
    value: Rgb,
    ratios: Ratios,
) {
    let into = match class.part() {
        // Such paths are not merged, so their weights do not depend on eta.
        Part::Emission => return sample.emission += value * ratios.weight(levels.eta()[0]),
        Part::Direct => return sample.direct += value * ratios.weight(levels.eta()[0]),
        Part::Caustic => &mut sample.caustic_photons,
        Part::Indirect => &mut sample.indirect_photons,
        Part::Volume => &mut sample.volume_photons,
    };
    for (into, &eta) in into.iter_mut().zip(levels.eta()) {
        *into += value * ratios.weight(eta);
    }
}

/// Vertices of one light path, which a camera path connects to.
pub type LightVertices<'s> = bumpalo::collections::Vec<'s, LightVertex<'s>>;

/// Splats (light for pixels) and photons that light paths leave.
#[derive(Default)]
pub struct Deposits {
    /// Light for pixels, of all paths so far.
    pub splats: Vec<Splat>,
    /// For each splat how its light vertex scatters the light; empty unless light is recorded by the lobe of the first hit.
    pub first: Vec<FirstScatter>,
    /// Photons for the next iteration, of all paths so far.
    pub photons: Vec<MergePhoton>,
    /// Number of paths that ended because their throughput was not finite.
    pub lost: u64,
}

impl Deposits {
    /// Empties the lists and keeps their capacity.
    pub fn clear(&mut self) {
        self.splats.clear();
        self.first.clear();
        self.photons.clear();
        self.lost = 0;
    }
}

struct LightWalk<'a, 's, R> {
    shared: &'a Bidirectional<'a>,
    mis: MisState,
    /// Index of the light that the path starts from.
    light: u32,
    group: Group,
    infinite: bool,
    prefix: LightPrefix,
    /// Lobes of the BSDF at the last vertex; `None` in a medium.
    lobes: Option<LobeSet>,
    /// Probability of the random decisions whether the solids around the last vertex exist, whose alpha is below 1.
    chance: f32,
    photons_only: bool,
    vertices: &'a mut LightVertices<'s>,
    left: &'a mut Deposits,
    record: &'a mut R,
}

impl<R: PathRecorder> LightWalk<'_, '_, R> {
    #[inline(always)]
    fn arrive(
        &mut self,
        (at, wi): (&Receiver, Vec3),
        distance: f32,
        cos: f32,
        flight: FlightDensity,
        scattered: Option<Scattered>,
    ) {
        if let Some(scattered) = scattered {
            self.prefix = self.prefix.then(Event::at_vertex(scattered.lobe, self.lobes));
        }
        let first_from_infinity = scattered.is_none() && self.infinite;
        let distance2 = if first_from_infinity { 1.0 } else { distance * distance };
        if scattered.is_none() {
            self.mis = self.mis.received(self.shared.camera_paths.scene.lights.next_event_ratio(at, self.light, wi));
        }
        self.mis = self.mis.arrive(distance2, cos).fly(flight);
    }

    /// Number of samples of the technique that joins the vertex at `depth`, the last one, and the vertex before it. Where
    /// alpha decides about the same solids for both subpaths, they join only if they agree.
    #[inline]
    fn joins(&self, depth: u32) -> f64 {
        self.shared.joins(depth) * f64::from(self.chance)
    }

    fn connect_camera<S: ScatterPoint>(&mut self, vertex: &S) {
        let Bidirectional { camera_paths, techniques, light_paths, .. } = self.shared;
        let draws = vertex.draws();
        let halves = PathHalves { suffix: CameraSuffix::START, prefix: self.prefix };
        if !wanted(vertex, halves, camera_paths.classes) {
            return;
        }
        let Some(sample) = camera_paths.camera.sample(vertex.p(), draws.two(Purpose::Lens)) else { return };
        if vertex.is_culled(camera_paths.scene, sample.wi) {
            return;
        }
        let (f, _) = vertex.evaluate_cos(sample.wi, Transport::Importance, LobeSet::ALL);
        // Density of the camera paths of one pixel.
        let pdf_a = sample.importance * self.shared.pixels();
        let value = vertex.throughput() * f * (pdf_a / light_paths);
        // A NaN rejects the sample of the pixel, so no ray is traced.
        if value.is_nan() {
            if let Some(((x, y), _)) = camera_paths.camera.sample_pixel(sample.film, || draws.two(Purpose::Splat)) {
                let (pixel, light, group) = (y * camera_paths.camera.size().0 + x, vertex.depth(), self.group);
                let (class, ratios) = (PathClass::Indirect, Ratios::ALONE);
                self.left.splats.push(Splat { pixel, light, class, group, value: Rgb::NAN, ratios });
                self.left.first.resize(if camera_paths.lobes { self.left.splats.len() } else { 0 }, FirstScatter::Emit);
            }
            return;
        }
        if !is_lit(value) {
            return;
        }
        let token = camera_token(camera_paths.scene, draws, Purpose::ShadowAlpha);
        let visibility = vertex.shadow_ray(camera_paths.scene, sample.wi, Some(sample.lens), token);
        if !is_lit(visibility.transmittance) {
            return;
        }
        let ratios = if techniques.connect {
            let reverse = vertex.reverse_pdf(sample.wi, Transport::Radiance);
            let arrival = pdf_a * vertex.cos(sample.wi) * visibility.flight.reverse;
            mis::camera(&self.mis, self.joins(vertex.depth()), arrival, *light_paths, reverse)
        } else {
            Ratios::ALONE
        };
        self.record.contribution(Technique::Camera { light: vertex.depth() }, value, sample.lens, ratios);
        let value = value * visibility.transmittance;
        if value.max_element() > 0.0 {
            let Some(((x, y), weight)) = camera_paths.camera.sample_pixel(sample.film, || draws.two(Purpose::Splat))
            else {
                return;
            };
            let value = value * weight;
            let (pixel, light, group) = (y * camera_paths.camera.size().0 + x, vertex.depth(), self.group);
            let incident = Incident { wi: sample.wi, transport: Transport::Importance, f };
            let shares = shares(vertex, halves, incident, camera_paths.classes);
            let splat = |(class, share)| Splat { pixel, light, class, group, value: value * share, ratios };
            self.left.splats.extend(shares.iter().map(splat));
            if camera_paths.lobes {
                let first = vertex.first_scatter(sample.wi, Transport::Importance, LobeSet::ALL, f);
                self.left.first.resize(self.left.splats.len(), first);
            }
        }
    }
}

impl<'s, R: PathRecorder> Visitor<'s> for LightWalk<'_, 's, R> {
    #[inline]
    fn stop(&self) -> Option<&Stop> {
        self.shared.camera_paths.stop
    }

    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 's>, scattered: Option<Scattered>) -> Next {
        let Bidirectional { camera_paths, techniques, merged_paths, .. } = self.shared;
        self.arrive(
            (&vertex.receiver(camera_paths.scene), vertex.wo),
            vertex.distance,
            vertex.wo.dot(vertex.surface.ng).abs(),
            vertex.flight,
            scattered,
        );
        let lobes = vertex.shading.bsdf.lobes();
        self.lobes = Some(lobes);
        // All lobes count: photons represent the light that arrives around a merging point, across borders of
        // materials.
        if lobes != LobeSet::DELTA
            && techniques.light_vertex_merges(vertex.depth)
            && vertex.depth < camera_paths.max_depth
        {
            let flux = vertex.throughput / *merged_paths;
            let (joins, presence) = (self.joins(vertex.depth), vertex.meeting(camera_paths.scene));
            self.left.photons.push(MergePhoton::new(vertex, flux, self.prefix, self.group, &self.mis, joins, presence));
        }
        let connected = self.shared.connects_light_vertex(vertex.depth);
        if connected && lobes.intersects(LobeSet::SMOOTH) && !self.photons_only && vertex.depth < camera_paths.max_depth
        {
            if self.shared.keeps_light_vertices() {
                let arena = self.vertices.bump();
                let sides = [&vertex.interior, &vertex.interior_behind];
                self.vertices.push(LightVertex {
                    scatterer: Scatterer::Surface(arena.alloc(*vertex.surface), arena.alloc(*vertex.shading)),
                    wo: vertex.wo,
                    throughput: vertex.throughput,
                    depth: vertex.depth,
                    mis: self.mis,
                    prefix: self.prefix,
                    dispersed: vertex.wavelength.is_some(),
                    group: self.group,
                    presence: sides.map(|side| Presence::of(camera_paths.scene, side)),
                    chance_before: self.chance,
                });
            }
            if techniques.camera
                && self.shared.connects_camera()
                && !camera_paths.scene.shapes.instances[vertex.surface.instance as usize].is_unseen()
            {
                self.connect_camera(vertex);
            }
        }
        if self.shared.ends_light_path(vertex.depth) { Next::Stop } else { Next::Continue(LobeSet::ALL) }
    }

    #[inline]
    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        let Bidirectional { camera_paths, techniques, .. } = self.shared;
        self.arrive(
            (&vertex.receiver(camera_paths.scene), vertex.wo),
            vertex.arrival.distance,
            1.0,
            vertex.flight,
            scattered,
        );
        self.lobes = None;
        let connected = self.shared.connects_light_vertex(vertex.depth);
        if connected && !self.photons_only && vertex.depth < camera_paths.max_depth {
            if self.shared.keeps_light_vertices() {
                self.vertices.push(LightVertex {
                    scatterer: Scatterer::Medium(vertex.arrival.p, vertex.phase()),
                    wo: vertex.wo,
                    throughput: vertex.throughput,
                    depth: vertex.depth,
                    mis: self.mis,
                    prefix: self.prefix,
                    dispersed: vertex.wavelength.is_some(),
                    group: self.group,
                    presence: [vertex.presence(camera_paths.scene); 2],
                    chance_before: self.chance,
                });
            }
            let scene = camera_paths.scene;
            let hidden = scene.survey.hidden_solids && vertex.arrival.interior.is_hidden(scene);
            if techniques.camera && self.shared.connects_camera() && !hidden {
                self.connect_camera(vertex);
            }
        }
        if self.shared.ends_light_path(vertex.depth) { Next::Stop } else { Next::Continue(LobeSet::ALL) }
    }

    fn lost(&mut self) {
        self.left.lost += 1;
    }

    #[inline]
    fn scatter_medium(&mut self, vertex: &MediumVertex, sample: &BsdfSample) {
        let joins = self.joins(vertex.depth);
        self.mis = self.mis.scatter(1.0, sample.pdf_w, sample.pdf_w, joins, Merges::ZERO);
        self.chance = vertex.presence(self.shared.camera_paths.scene).chance;
        self.record.continues(|chance| vertex.survival_chosen(LobeSet::ALL, chance));
    }

    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 's>, sample: &BsdfSample) {
        let scene = self.shared.camera_paths.scene;
        let chance = f64::from(vertex.meeting(scene).chance);
        let merges = self.shared.techniques.light_vertex_merge(vertex.depth) * chance;
        let joins = self.joins(vertex.depth);
        self.mis = scatter(self.mis, vertex, sample, Transport::Radiance, joins, merges);
        let side = if sample.transmitted { &vertex.interior_behind } else { &vertex.interior };
        self.chance = Presence::of(scene, side).chance;
        self.record.continues(|chance| vertex.survival_chosen(LobeSet::ALL, chance));
    }
}

/// MIS state after a surface vertex has scattered; `back` is the transport of the opposite subpath, `joins` the number of
/// samples of the technique that joins the vertex and the previous one.
#[inline]
pub(in crate::transport) fn scatter(
    mis: MisState,
    vertex: &Vertex<'_, '_>,
    sample: &BsdfSample,
    back: Transport,
    joins: f64,
    merges: Merges,
) -> MisState {
    let cos = sample.wi.dot(vertex.surface.ng).abs();
    if sample.lobe == LobeSet::DELTA {
        return mis.scatter_delta(cos);
    }
    mis.scatter(cos, sample.pdf_w, vertex.shading.reverse_pdf(sample.wi, back, LobeSet::ALL), joins, merges)
}

impl<'s> Bidirectional<'s> {
    /// Traces the light path that starts with `emitted`, which leaves vertices, splats and photons; with `photons_only` it
    /// leaves photons only.
    #[inline]
    pub fn light_path<R: PathRecorder>(
        &self,
        paths: &LightPaths,
        emitted: &Emitted,
        photons_only: bool,
        vertices: &mut LightVertices<'s>,
        left: &mut Deposits,
        record: &mut R,
    ) {
        let camera_paths = &self.camera_paths;
        let arena = vertices.bump();
        let mut start = emitted.start;
        start.throughput *= paths.count() as f32;
        let mut visitor = LightWalk {
            shared: self,
            mis: MisState::light(&emitted.density),
            light: emitted.light,
            group: camera_paths.scene.lights.group(emitted.light),
            infinite: emitted.density.infinite,
            prefix: LightPrefix::start(emitted.delta),
            lobes: None,
            chance: 1.0,
            photons_only,
            vertices,
            left,
            record,
        };
        walk(
            camera_paths.scene,
            arena,
            &start,
            emitted.stream,
            Transport::Importance,
            camera_paths.max_depth,
            &mut visitor,
        );
    }
}
