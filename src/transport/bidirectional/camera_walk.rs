//! Camera paths of the bidirectional methods, given a light path and the photons of the previous iteration.

use super::light_vertex::LightVertex;
use super::light_walk::{add, scatter};
use super::mis::{self, End, Merges, MisState, NextEventPdfs, Ratios, one_merge};
use super::path_history::PathHistory;
use super::photon_merge::{Merge, MergePhoton};
use super::shares::{Connection, Incident, PathHalves, connection_shares, shares, wanted};
use super::{Bidirectional, MergeLevels, PathKind, PathRecorder, Technique};
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::light::{EmissionDensity, Group, Receiver};
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::FlightDensity;
use crate::path_class::{LightPrefix, Part, PathClass};
use crate::photon::PhotonMap;
use crate::random::{Purpose, mix};
use crate::stop::Stop;
use crate::transport::walk::camera_paths::{CameraPathStart, CameraPaths};
use crate::transport::walk::cause::Cause;
use crate::transport::walk::interior::{Interior, Presence};
use crate::transport::walk::lobe_layers::{FirstScatter, LobeHistory};
use crate::transport::walk::pass_through::{BulbHit, PassThroughHit};
use crate::transport::walk::pixel_sample::{Features, PixelSample};
use crate::transport::walk::scattering_vertex::{ScatterPoint, ShadowTarget};
use crate::transport::walk::segment::{Destination, FirstHit, with_camera_bit};
use crate::transport::walk::vertex::{MediumLight, MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::walk;
use bumpalo::Bump;

/// Light path and photons that the vertices of a camera path are connected to and merged with.
pub struct CameraWalkContext<'a> {
    /// Vertices of the light paths that this camera path connects to.
    pub vertices: &'a [LightVertex<'a>],
    /// Photons of the previous iteration; `None` if this camera path merges none. If no camera path of the pixel merges
    /// any, all etas, the factors of merging in MIS weights, must be [`mis::Eta::NONE`].
    pub photons: Option<&'a PhotonMap<MergePhoton>>,
    /// Merging bandwidths of the pixel of the camera path, by bandwidth level.
    pub levels: &'a MergeLevels,
}

/// Number of connections of one vertex between two checks whether paths must end early.
const CONNECTIONS_PER_CHECK: usize = 256;

struct CameraWalk<'a, R> {
    shared: &'a Bidirectional<'a>,
    context: &'a CameraWalkContext<'a>,
    mis: MisState,
    history: PathHistory,
    /// The last vertex of the camera path, as a receiver of direct light.
    last: Receiver,
    /// Number of path segments up to the last vertex.
    depth: u32,
    /// Probability of the decisions of alpha about the solids around the end of the last segment; 1 for the first.
    chance: f32,
    /// The first vertex, if light is recorded by its lobes.
    lobes: Option<LobeHistory>,
    sample: &'a mut PixelSample,
    record: &'a mut R,
}

/// Hit of a light by a camera path, as the recorder receives it.
struct LightHit {
    /// Number of the path segment that hits the light; 0 for light from infinity.
    depth: u32,
    /// Position of the hit; for light from infinity, its direction.
    at: Vec3,
}

/// Stores the first hit and the G-buffer in the sample of a camera path that arrives at a surface.
#[inline]
pub(in crate::transport) fn record_surface(
    history: &mut PathHistory,
    vertex: &Vertex<'_, '_>,
    scattered: Option<Scattered>,
    sample: &mut PixelSample,
) {
    match scattered {
        None => sample.first = Some(FirstHit { p: vertex.surface.p, instance: vertex.surface.instance }),
        Some(scattered) => history.scattered(scattered.lobe),
    }
    history.length += vertex.distance;
    let lobes = vertex.shading.bsdf.lobes();
    if lobes.intersects(LobeSet::SMOOTH) {
        let length = history.length;
        history.features.store(lobes, || vertex.features(length));
    }
}

/// Stores the first hit and the G-buffer in the sample of a camera path that arrives at a vertex in a medium.
#[inline]
pub(in crate::transport) fn record_medium(
    history: &mut PathHistory,
    vertex: &MediumVertex,
    scattered: Option<Scattered>,
    sample: &mut PixelSample,
) {
    match scattered {
        None => sample.first = vertex.arrival.first,
        Some(scattered) => history.scattered(scattered.lobe),
    }
    history.length += vertex.arrival.distance;
    let features = Features { albedo: vertex.albedo(), normal: vertex.wo, depth: history.length, share: 1.0 };
    history.features.store(LobeSet::BROAD, || features);
}

impl<R: PathRecorder> CameraWalk<'_, R> {
    /// Whether `light`, which `technique` has found, is worth a shadow ray. NaN rejects the sample.
    #[inline]
    fn finds(&mut self, technique: Technique, light: Rgb) -> bool {
        if light.is_nan() {
            self.sample.reject(technique.cause());
            return false;
        }
        is_lit(light)
    }

    /// Number of samples of the technique that joins the vertex at `depth`, the last one, and the vertex before it. Where
    /// alpha decides about the same solids for both subpaths, they join only if they agree.
    #[inline]
    fn joins(&self, depth: u32) -> f64 {
        self.shared.joins(depth) * f64::from(self.chance)
    }

    /// Notes the decisions of alpha about the solids around the end of a segment.
    #[inline]
    fn arrive_in(&mut self, interior: &Interior, depth: u32) {
        let scene = self.shared.camera_paths.scene;
        // Only one subpath decides if a light vertex is connected to the camera.
        self.chance = if depth == 1 { 1.0 } else { Presence::of(scene, interior).chance };
    }

    /// How the first vertex scatters light that arrives at the current one, which scatters it by `here`.
    #[inline]
    fn first(&self, here: impl FnOnce() -> FirstScatter) -> FirstScatter {
        self.lobes.map_or(FirstScatter::Emit, |lobes| lobes.arriving(here))
    }

    #[inline]
    fn add(&mut self, technique: Technique, of: PathKind, value: Rgb, ratios: Ratios) {
        if !value.is_finite() {
            return self.sample.reject(technique.cause());
        }
        for (level, &eta) in self.context.levels.eta().iter().enumerate() {
            self.record.arrival(technique, of, level, value, ratios.weight(eta));
        }
        add(self.sample, self.context.levels, of.class, value, ratios);
    }

    /// Adds `value` from a light that the path has hit.
    #[inline]
    fn hit_light(&mut self, value: Rgb, group: Group, hit: LightHit, density: &EmissionDensity) {
        let class = self.history.suffix.class_at_light(false);
        if !self.shared.hits_at(self.depth) || !self.shared.camera_paths.classes.has(class) {
            return;
        }
        let ratios = if self.history.delta {
            Ratios::ALONE
        } else if self.shared.techniques.connect {
            mis::hit(&self.mis, density)
        } else {
            return;
        };
        self.record.contribution(Technique::Hit { camera: hit.depth }, value, hit.at, ratios);
        let seen = if density.infinite { FirstScatter::Environment } else { FirstScatter::Emit };
        let first = self.first(|| seen);
        self.add(Technique::Hit { camera: self.depth }, PathKind { class, group, first }, value, ratios);
    }

    #[inline]
    fn next_event<S: ScatterPoint>(&mut self, vertex: &S) {
        let CameraPaths { scene, classes, .. } = self.shared.camera_paths;
        let halves = PathHalves { suffix: self.history.suffix, prefix: LightPrefix::start(false) };
        if !wanted(vertex, halves, classes) {
            return;
        }
        let Some(light) = vertex.sample_light(scene) else { return };
        let (f, pdf) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
        let value = vertex.throughput() * f * light.radiance / light.pdf_w;
        let technique = Technique::NextEvent { camera: vertex.depth() };
        if !self.finds(technique, value) {
            return;
        }
        let visibility = vertex.shadow_ray_to_light(scene, &light);
        if !is_lit(visibility.transmittance) {
            return;
        }
        let pdfs = NextEventPdfs {
            pdf_w: pdf * visibility.flight.forward,
            reverse_pdf_w: vertex.reverse_pdf(light.wi, Transport::Importance),
            light_pdf_w: light.pdf_w,
            arrival_pdf_a: scene.lights.arrival_pdf_a(&light, vertex.p())
                * vertex.cos(light.wi)
                * visibility.flight.reverse,
            delta: light.delta,
        };
        let ratios = mis::next_event(&self.mis, self.joins(vertex.depth()), &pdfs);
        let at = light.target.unwrap_or(light.wi);
        self.record.contribution(technique, value, at, ratios);
        let incident = Incident { wi: light.wi, transport: Transport::Radiance, f };
        let (value, group) = (value * visibility.transmittance, scene.lights.group(light.light));
        let first = self.first(|| vertex.first_scatter(light.wi, Transport::Radiance, LobeSet::ALL, f));
        for (class, share) in shares(vertex, halves, incident, classes).iter() {
            self.add(technique, PathKind { class, group, first }, value * share, ratios);
        }
    }

    #[inline]
    fn connect<S: ScatterPoint>(&mut self, vertex: &S, light: &LightVertex<'_>) {
        let Bidirectional { camera_paths, techniques, connections, .. } = self.shared;
        let to = light.p() - vertex.p();
        let distance2 = to.length_squared();
        let distance = distance2.sqrt();
        let d = to / distance;
        let (f_camera, pdf_camera) = vertex.evaluate_cos(d, Transport::Radiance, LobeSet::ALL);
        let technique = Technique::Connect { light: light.depth, camera: vertex.depth() };
        if !self.finds(technique, f_camera) {
            return;
        }
        let (f_light, pdf_light) = light.evaluate_cos(-d);
        let suffix = self.history.suffix;
        let connection = Connection { d, f: f_camera, f_light };
        let shares = || connection_shares(vertex, light, suffix, &connection, camera_paths.classes);
        if !camera_paths.classes.is_all() && shares().is_empty() {
            return;
        }
        let presence = light.presence(-d);
        let connections = connections * presence.chance;
        let mut value = vertex.throughput() * f_camera * f_light * light.throughput / (distance2 * connections);
        if let (true, Some(wavelength)) = (light.dispersed, vertex.wavelength()) {
            value *= wavelength.inverse_weight() * wavelength.pairing;
        }
        if !self.finds(technique, value) {
            return;
        }
        // Each pair of vertices decides about cut-outs independently.
        let bits = mix(vertex.draws().bits(Purpose::SecondAlpha).wrapping_add(u64::from(light.depth)));
        let token = with_camera_bit(camera_paths.scene, bits as u32, false);
        let destination = match camera_paths.scene.alpha_solids.is_empty() {
            true => Destination::Any,
            false => Destination::Agreeing(presence.absent),
        };
        let (p, in_medium) = (Some(light.shadow_end(-d, distance)), light.in_medium());
        let target = ShadowTarget { p, in_medium, reaching: light.touching(), destination };
        let visibility = vertex.shadow_ray_to(camera_paths.scene, d, token, target);
        if !is_lit(visibility.transmittance) {
            return;
        }
        let (cos_camera, cos_light) = (vertex.cos(d), light.cos(d));
        let ratios = mis::connect(
            &End {
                mis: &light.mis,
                reverse_pdf_w: light.reverse_pdf(-d),
                arrival_pdf_a: pdf_camera * cos_light / distance2 * visibility.flight.forward,
                joins: self.shared.joins(light.depth) * f64::from(light.chance_before),
                merges: if light.in_medium() {
                    Merges::ZERO
                } else {
                    techniques.light_vertex_merge(light.depth) * light.merge_chance()
                },
            },
            &End {
                mis: &self.mis,
                reverse_pdf_w: vertex.reverse_pdf(d, Transport::Importance),
                arrival_pdf_a: pdf_light * cos_camera / distance2 * visibility.flight.reverse,
                joins: self.joins(vertex.depth()),
                merges: if S::IN_MEDIUM {
                    Merges::ZERO
                } else {
                    let [here, behind] = vertex.interiors();
                    let chance = Presence::at_surface(camera_paths.scene, [here, behind]).chance;
                    techniques.camera_vertex_merge(vertex.depth(), self.history.delta) * f64::from(chance)
                },
            },
            f64::from(connections),
        );
        self.record.contribution(technique, value, light.p(), ratios);
        let (value, group) = (value * visibility.transmittance, light.group);
        let first = self.first(|| vertex.first_scatter(d, Transport::Radiance, LobeSet::ALL, f_camera));
        for (class, share) in shares().iter() {
            self.add(technique, PathKind { class, group, first }, value * share, ratios);
        }
    }

    /// Adds next-event estimation and connections with all vertices of the light paths at a vertex of the camera path.
    #[inline]
    fn connect_all(&mut self, vertex: &impl ScatterPoint) {
        if !self.shared.connects_camera_vertex(vertex.depth()) {
            return;
        }
        if self.shared.next_event() {
            self.next_event(vertex);
        }
        let longest = self.shared.camera_paths.max_depth - vertex.depth();
        for (index, light) in self.context.vertices.iter().enumerate() {
            if (index + 1).is_multiple_of(CONNECTIONS_PER_CHECK) && self.stop().is_some_and(Stop::should_end_path) {
                break;
            }
            if light.depth < longest {
                self.connect(vertex, light);
            }
        }
    }

    /// Squared length of a segment, which converts densities per solid angle to area; 1 for the parallel rays of an
    /// orthographic camera.
    #[inline]
    fn distance2(&self, distance: f32, scattered: Option<Scattered>) -> f32 {
        if scattered.is_none() && self.shared.camera_paths.camera.is_orthographic() { 1.0 } else { distance * distance }
    }
}

impl<'a, R: PathRecorder> Visitor<'a> for CameraWalk<'_, R> {
    const BRANCHES: bool = true;

    #[inline]
    fn spared(&self) -> f32 {
        self.shared.spared
    }

    #[inline]
    fn stop(&self) -> Option<&Stop> {
        self.shared.camera_paths.stop
    }

    #[inline]
    fn splits(&self) -> u32 {
        self.shared.camera_paths.splits
    }

    #[inline]
    fn end(&mut self, share: f32) {
        self.sample.features.add(&self.history.features, share);
    }

    #[inline]
    fn branch(&mut self, follow: impl FnOnce(&mut Self)) {
        let before = (self.mis, self.history, self.last, self.depth, self.lobes);
        self.record.begin_branch();
        follow(self);
        self.record.end_branch();
        (self.mis, self.history, self.last, self.depth, self.lobes) = before;
    }

    #[inline]
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        let Bidirectional { camera_paths, techniques, .. } = self.shared;
        record_surface(&mut self.history, vertex, scattered, self.sample);
        if scattered.is_none() && self.lobes.is_some() {
            self.record.first_surface(vertex.shading.lobe_albedos());
        }
        self.depth = vertex.depth;
        self.arrive_in(&vertex.interior, vertex.depth);
        let cos = vertex.wo.dot(vertex.surface.ng).abs();
        self.mis = self.mis.arrive(self.distance2(vertex.distance, scattered), cos).fly(vertex.flight);
        if let Some((radiance, density)) =
            camera_paths.scene.lights.emitted(&camera_paths.scene.materials, &self.last, vertex.surface, vertex.wo)
        {
            let group = camera_paths.scene.lights.surface_group(vertex.surface);
            let hit = LightHit { depth: vertex.depth, at: vertex.surface.p };
            self.hit_light(vertex.throughput * radiance, group, hit, &density);
        }
        let smooth = vertex.shading.bsdf.lobes().intersects(LobeSet::SMOOTH);
        if smooth && vertex.depth < camera_paths.max_depth {
            if techniques.connect {
                self.connect_all(vertex);
            }
            if let (true, Some(photons)) = (techniques.camera_vertex_merges(vertex.depth), self.context.photons) {
                let (presence, joins) = (vertex.presence(camera_paths.scene), self.joins(vertex.depth));
                let PixelSample { direct, volume_photons, caustic_photons, indirect_photons, merge_difference, .. } =
                    &mut *self.sample;
                let add = |class: PathClass, level: usize, radiance: Rgb| {
                    *match class.part() {
                        Part::Volume => &mut volume_photons[level],
                        // With bidirectional photon mapping, which has one level.
                        Part::Emission | Part::Direct => &mut *direct,
                        Part::Caustic => &mut caustic_photons[level],
                        Part::Indirect => &mut indirect_photons[level],
                    } += radiance;
                };
                let merge = Merge {
                    photons,
                    levels: self.context.levels,
                    mis: &self.mis,
                    joins,
                    absent: presence.absent,
                    own: one_merge(self.history.delta) * f64::from(vertex.meeting(camera_paths.scene).chance),
                    suffix: self.history.suffix,
                    lobes: self.lobes.as_ref(),
                    classes: camera_paths.classes,
                    longest: camera_paths.max_depth - vertex.depth,
                };
                if !merge.run(vertex, self.record, add, merge_difference) {
                    self.sample.reject(Cause::Photons);
                }
            }
        }
        self.history.leave(Some(vertex.shading.bsdf.lobes()));
        // A path restricted to hit a light ends there, too.
        if !self.history.leads(camera_paths.classes) || self.shared.ends_camera_path(vertex.depth) {
            return Next::Stop;
        }
        self.last = vertex.receiver(camera_paths.scene);
        // Without connections and merging, only light through mirrors and clear glass is left to find.
        Next::Continue(if techniques.connect || techniques.merge { LobeSet::ALL } else { LobeSet::DELTA })
    }

    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        let (lights, materials) = (&self.shared.camera_paths.scene.lights, &self.shared.camera_paths.scene.materials);
        let Some((radiance, density)) = lights.emitted(materials, &self.last, &hit.surface, hit.wo) else { return };
        let before = (self.mis, self.history, self.depth);
        if let Some(scattered) = scattered {
            self.history.scattered(scattered.lobe);
        }
        self.depth = hit.depth;
        let cos = hit.wo.dot(hit.surface.ng).abs();
        self.mis = self.mis.arrive(self.distance2(hit.distance, scattered), cos).fly(hit.flight);
        let (group, at) = (lights.surface_group(&hit.surface), hit.surface.p);
        self.hit_light(hit.throughput * radiance, group, LightHit { depth: hit.depth, at }, &density);
        (self.mis, self.history, self.depth) = before;
    }

    fn sees_medium_light(&self, scattered: Option<Scattered>) -> bool {
        self.history.delta && scattered.is_none_or(|scattered| scattered.lobe == LobeSet::DELTA)
    }

    fn medium_light(&mut self, light: &MediumLight, scattered: Option<Scattered>) {
        let before = (self.history, self.depth);
        if let Some(scattered) = scattered {
            self.history.scattered(scattered.lobe);
        }
        self.depth = light.depth;
        let group = self.shared.camera_paths.scene.lights.object_group(light.instance);
        // Only delta lobes have scattered the path, so that no other technique finds the light.
        let density = EmissionDensity { direct: 1.0, start: 1.0, onward: 1.0, cos: 1.0, infinite: false, delta: true };
        self.hit_light(light.light, group, LightHit { depth: light.depth, at: light.p }, &density);
        (self.history, self.depth) = before;
    }

    fn bulb(&mut self, hit: &BulbHit, scattered: Option<Scattered>) {
        let before = (self.history, self.depth);
        if let Some(scattered) = scattered {
            self.history.scattered(scattered.lobe);
        }
        self.depth = hit.depth;
        let lights = &self.shared.camera_paths.scene.lights;
        if self.history.delta && lights.shines_on(hit.emitter, &self.last) {
            // Its density does not count, because no other technique finds the path.
            let density =
                EmissionDensity { direct: 0.0, start: 0.0, onward: 0.0, cos: 1.0, infinite: false, delta: true };
            self.hit_light(hit.light, lights.group(hit.emitter), LightHit { depth: hit.depth, at: hit.at }, &density);
        }
        (self.history, self.depth) = before;
    }

    fn lost(&mut self) {
        self.sample.reject(Cause::Path);
    }

    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        let chance = f64::from(vertex.meeting(self.shared.camera_paths.scene).chance);
        let merges = self.shared.techniques.camera_vertex_merge(vertex.depth, self.history.delta) * chance;
        let joins = self.joins(vertex.depth);
        if let Some(lobes) = &mut self.lobes {
            lobes.scatter(|| FirstScatter::of_sample(vertex, sample, LobeSet::ALL));
        }
        self.mis = scatter(self.mis, vertex, sample, Transport::Importance, joins, merges);
        self.record.continues(|chance| vertex.survival_chosen(LobeSet::ALL, chance));
    }

    #[inline]
    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        let Bidirectional { camera_paths, techniques, .. } = self.shared;
        record_medium(&mut self.history, vertex, scattered, self.sample);
        self.depth = vertex.depth;
        self.arrive_in(&vertex.arrival.interior, vertex.depth);
        self.mis = self.mis.arrive(self.distance2(vertex.arrival.distance, scattered), 1.0).fly(vertex.flight);
        if techniques.connect && vertex.depth < camera_paths.max_depth {
            self.connect_all(vertex);
        }
        self.history.leave(None);
        if !self.history.leads(camera_paths.classes) || self.shared.ends_camera_path(vertex.depth) {
            return Next::Stop;
        }
        self.last = vertex.receiver(camera_paths.scene);
        // As on surfaces: only mirrors and clear glass show what light tracing does not find.
        if techniques.connect || techniques.merge { Next::Continue(LobeSet::ALL) } else { Next::Stop }
    }

    #[inline]
    fn scatter_medium(&mut self, vertex: &MediumVertex, sample: &BsdfSample) {
        let joins = self.joins(vertex.depth);
        if let Some(lobes) = &mut self.lobes {
            lobes.scatter(|| FirstScatter::Medium);
        }
        self.mis = self.mis.scatter(1.0, sample.pdf_w, sample.pdf_w, joins, Merges::ZERO);
        self.record.continues(|chance| vertex.survival_chosen(LobeSet::ALL, chance));
    }

    fn hole(&mut self) {
        self.sample.first = Some(FirstHit::HOLE);
    }

    #[inline]
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, flight: FlightDensity) {
        if let Some(scattered) = scattered {
            self.history.scattered(scattered.lobe);
        }
        self.depth += 1;
        self.mis = self.mis.fly(flight);
        let lights = &self.shared.camera_paths.scene.lights;
        let (last, onward) = (self.last, lights.entry_pdf_a(self.last.p, direction));
        lights.for_each_infinite(&last, direction, scattered.is_none(), |radiance, direct, start, group| {
            let density = EmissionDensity { direct, start, onward, cos: 1.0, infinite: true, delta: false };
            self.hit_light(throughput * radiance, group, LightHit { depth: 0, at: direction }, &density);
        });
    }
}

impl Bidirectional<'_> {
    /// Traces a camera path and overwrites `sample` with its light at all bandwidth levels.
    #[inline]
    pub fn camera_path<R: PathRecorder>(
        &self,
        arena: &Bump,
        start: &CameraPathStart,
        context: &CameraWalkContext<'_>,
        record: &mut R,
        sample: &mut PixelSample,
    ) {
        *sample = PixelSample::default();
        let camera_paths = &self.camera_paths;
        let CameraPathStart { ray, stream } = start;
        let pdf_w = camera_paths.camera.pdf_w(ray.direction) * self.pixels();
        let mut visitor = CameraWalk {
            shared: self,
            context,
            mis: MisState::camera(self.light_paths, pdf_w),
            history: PathHistory::START,
            last: Receiver::anywhere(ray.origin),
            depth: 0,
            chance: 1.0,
            lobes: camera_paths.lobes.then(LobeHistory::default),
            sample,
            record,
        };
        walk(camera_paths.scene, arena, ray, *stream, Transport::Radiance, camera_paths.max_depth, &mut visitor);
    }
}
