//! Unidirectional path tracing with next-event estimation; tests use it as an independent reference.
//!
//! It shares the walk with the other methods, but computes its own weights of two techniques, over all lobes of a
//! vertex at once (`direct_light` treats two sets of lobes), so that tests can compare the two.

use super::camera_walk::{record_medium, record_surface};
use super::path_history::PathHistory;
use super::shares::{Incident, PathHalves, shares, wanted};
use super::{PathKind, PathRecorder, Technique};
use crate::bsdf::{BsdfSample, LobeSet, Transport};
use crate::light::{Group, Receiver};
use crate::math::{Rgb, Vec3, is_lit};
use crate::medium::FlightDensity;
use crate::path_class::{ClassSet, LightPrefix, Part};
use crate::random::Stream;
use crate::scene::Scene;
use crate::stop::Stop;
use crate::trace::Tracer;
use crate::transport::walk::camera_paths::{CameraPathStart, CameraPaths};
use crate::transport::walk::cause::Cause;
use crate::transport::walk::direct::caught_light;
use crate::transport::walk::lobe_layers::{FirstScatter, LobeHistory};
use crate::transport::walk::pass_through::{BulbHit, PassThroughHit, to_infinity};
use crate::transport::walk::pixel_sample::PixelSample;
use crate::transport::walk::roulette::SPARED_BY_ROULETTE;
use crate::transport::walk::scattering_vertex::ScatterPoint;
use crate::transport::walk::segment::{FirstHit, Visibility};
use crate::transport::walk::vertex::{MediumLight, MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::{Segment, walk};
use bumpalo::Bump;

struct PathTracer<'a, R> {
    scene: &'a Scene,
    max_depth: u32,
    splits: u32,
    classes: ClassSet,
    /// The first vertex, if light is recorded by its lobes.
    lobes: Option<LobeHistory>,
    sample: &'a mut PixelSample,
    history: PathHistory,
    last: Receiver,
    /// Number of path segments up to the last vertex.
    depth: u32,
    /// Whether the last vertex is the first one, on a shadow catcher. Lights that the path then finds, and other catchers,
    /// are in the photograph below the picture.
    on_catcher: bool,
    record: &'a mut R,
    stop: Option<&'a Stop>,
}

impl<R: PathRecorder> PathTracer<'_, R> {
    /// MIS weight of hitting a light whose density by next-event estimation is `pdf_light`; 1 if next-event estimation
    /// could not have sampled it.
    fn weight(scattered: Option<Scattered>, pdf_light: f32) -> f32 {
        match scattered {
            Some(s) if !s.lobe.intersects(LobeSet::DELTA) => s.pdf_w / (s.pdf_w + pdf_light),
            _ => 1.0,
        }
    }

    /// Adds next-event estimation at a vertex of the path.
    fn lit<S: ScatterPoint>(&mut self, vertex: &S) {
        let scene = self.scene;
        let halves = PathHalves { suffix: self.history.suffix, prefix: LightPrefix::start(false) };
        if vertex.depth() >= self.max_depth || !wanted(vertex, halves, self.classes) {
            return;
        }
        let Some(light) = vertex.sample_light(scene) else { return };
        let (f, pdf) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
        if (f * light.radiance).max_element() <= 0.0 {
            return;
        }
        let visibility = vertex.shadow_ray_to_light(scene, &light);
        if !is_lit(visibility.transmittance) {
            return;
        }
        let pdf = pdf * vertex.survival(LobeSet::ALL) * visibility.flight.forward;
        let weight = if light.delta { 1.0 } else { light.pdf_w / (light.pdf_w + pdf) };
        let value = vertex.throughput() * (f * light.radiance * (weight / light.pdf_w) * visibility.transmittance);
        let technique = Technique::NextEvent { camera: self.depth };
        let incident = Incident { wi: light.wi, transport: Transport::Radiance, f };
        let shares = shares(vertex, halves, incident, self.classes);
        let (first, group) = (
            self.first(|| vertex.first_scatter(light.wi, Transport::Radiance, LobeSet::ALL, f)),
            scene.lights.group(light.light),
        );
        for (class, share) in shares.iter() {
            self.add(technique, PathKind { class, group, first }, value * share, weight);
        }
    }

    /// How the first vertex scatters light that arrives at the current one, which scatters it by `here`.
    fn first(&self, here: impl FnOnce() -> FirstScatter) -> FirstScatter {
        self.lobes.map_or(FirstScatter::Emit, |lobes| lobes.arriving(here))
    }

    /// Adds light, already multiplied by its MIS weight, to the sample; light group, first vertex and weight are for the
    /// recorder.
    fn add(&mut self, technique: Technique, of: PathKind, light: Rgb, weight: f32) {
        let class = of.class;
        if !self.classes.has(class) {
            return;
        }
        if !light.is_finite() {
            return self.sample.reject(technique.cause());
        }
        if weight > 0.0 {
            self.record.arrival(technique, of, 0, light / weight, weight);
        }
        let sample = &mut *self.sample;
        *match class.part() {
            Part::Emission => &mut sample.emission,
            Part::Direct => &mut sample.direct,
            Part::Caustic => &mut sample.caustic_photons[0],
            Part::Indirect => &mut sample.indirect,
            Part::Volume => &mut sample.volume,
        } += light;
    }

    /// The history of the path where it meets a light on the way to the next vertex.
    fn arriving(&self, scattered: Option<Scattered>) -> PathHistory {
        let mut history = self.history;
        if let Some(scattered) = scattered {
            history.scattered(scattered.lobe);
        }
        history
    }

    /// [`PathTracer::add`] for a light of this group that the path meets on segment `depth`.
    fn add_hit(&mut self, history: &PathHistory, depth: u32, group: Group, light: Rgb, weight: f32) {
        let (class, first) = (history.suffix.class_at_light(false), self.first(|| FirstScatter::Emit));
        self.add(Technique::Hit { camera: depth }, PathKind { class, group, first }, light, weight);
    }

    /// Whether a vertex shows no light of its own because of shadow catchers: the path arrives at a catcher first, whose
    /// light is recorded apart, or at a light or another catcher from there, where it ends.
    #[cold]
    #[inline(never)]
    fn catches(&mut self, vertex: &Vertex<'_, '_>, scattered: Option<Scattered>, catchers: &Tracer) -> bool {
        let instance = &self.scene.shapes.instances[vertex.surface.instance as usize];
        let came_from_catcher = std::mem::take(&mut self.on_catcher);
        if scattered.is_none() && instance.shadow_catcher {
            self.record.caught(caught_light(self.scene, vertex, catchers).map(|light| light * vertex.share));
            self.on_catcher = true;
        }
        let emits = || self.scene.materials.list[vertex.surface.material as usize].emits();
        self.on_catcher || (came_from_catcher && (instance.shadow_catcher || emits()))
    }

    /// Whether a hit of a surface shows its light: the path finds lights with shadow linking apart from hits, see
    /// [`Visitor::SHADOW_LINKS`].
    fn sees(&self, instance: u32, scattered: Option<Scattered>) -> bool {
        scattered.is_none() || self.scene.lights.links().blockers_of(instance).is_all()
    }

    /// Decides how the path continues after a vertex.
    fn next(&self) -> Next {
        if self.history.leads(self.classes) { Next::Continue(LobeSet::ALL) } else { Next::Stop }
    }
}

impl<'a, R: PathRecorder> Visitor<'a> for PathTracer<'_, R> {
    const BRANCHES: bool = true;
    const SHADOW_LINKS: bool = true;

    #[inline]
    fn spared(&self) -> f32 {
        SPARED_BY_ROULETTE
    }

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
        self.sample.features.add(&self.history.features, share);
    }

    #[inline]
    fn branch(&mut self, follow: impl FnOnce(&mut Self)) {
        let before = (self.lobes, self.history, self.last, self.depth, self.on_catcher);
        follow(self);
        (self.lobes, self.history, self.last, self.depth, self.on_catcher) = before;
    }

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        record_surface(&mut self.history, vertex, scattered, self.sample);
        if scattered.is_none() && self.lobes.is_some() {
            self.record.first_surface(vertex.shading.lobe_albedos());
        }
        self.depth = vertex.depth;
        if let Some(catchers) = &self.scene.catchers
            && self.catches(vertex, scattered, catchers)
        {
            self.last = vertex.receiver(self.scene);
            self.history.leave(Some(vertex.shading.bsdf.lobes()));
            return if self.on_catcher { self.next() } else { Next::Stop };
        }
        let from = if scattered.is_none() { Receiver::anywhere(vertex.from) } else { self.last };
        if self.sees(vertex.surface.instance, scattered)
            && let Some((radiance, pdf)) =
                self.scene.lights.hit_radiance(&self.scene.materials, &from, vertex.surface, vertex.wo)
        {
            let (class, first) = (self.history.suffix.class_at_light(false), self.first(|| FirstScatter::Emit));
            let of = PathKind { class, group: self.scene.lights.surface_group(vertex.surface), first };
            let weight = Self::weight(scattered, pdf);
            self.add(Technique::Hit { camera: self.depth }, of, vertex.throughput * radiance * weight, weight);
        }
        self.last = vertex.receiver(self.scene);
        self.lit(vertex);
        self.history.leave(Some(vertex.shading.bsdf.lobes()));
        self.next()
    }

    fn lost(&mut self) {
        self.sample.reject(Cause::Path);
    }

    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        if let Some(lobes) = &mut self.lobes {
            lobes.scatter(|| FirstScatter::of_sample(vertex, sample, LobeSet::ALL));
        }
    }

    #[inline]
    fn scatter_medium(&mut self, _: &MediumVertex, _: &BsdfSample) {
        if let Some(lobes) = &mut self.lobes {
            lobes.scatter(|| FirstScatter::Medium);
        }
    }

    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        if self.on_catcher {
            return;
        }
        let history = self.arriving(scattered);
        if let Some((radiance, pdf)) =
            self.scene.lights.hit_radiance(&self.scene.materials, &self.last, &hit.surface, hit.wo)
        {
            let weight = Self::weight(scattered, pdf);
            let (light, group) = (hit.throughput * radiance * weight, self.scene.lights.surface_group(&hit.surface));
            self.add_hit(&history, hit.depth, group, light, weight);
        }
    }

    #[cold]
    fn linked_suns(&mut self, segment: &Segment<'_>) {
        let Segment { start, throughput, depth, scattered, .. } = *segment;
        if self.on_catcher {
            return;
        }
        let (scene, last, history) = (self.scene, self.last, self.arriving(scattered));
        scene.lights.for_each_linked_sun(&last, start.direction, |light, radiance, pdf| {
            let Visibility { transmittance, flight } = to_infinity(scene, segment, light);
            let scattered = scattered.map(|s| Scattered { pdf_w: s.pdf_w * flight.forward, ..s });
            let weight = Self::weight(scattered, pdf);
            self.add_hit(
                &history,
                depth,
                scene.lights.group(light),
                throughput * transmittance * radiance * weight,
                weight,
            );
        });
    }

    fn sees_medium_light(&self, scattered: Option<Scattered>) -> bool {
        scattered.is_none_or(|scattered| scattered.lobe == LobeSet::DELTA)
    }

    fn medium_light(&mut self, light: &MediumLight, scattered: Option<Scattered>) {
        let group = self.scene.lights.object_group(light.instance);
        self.add_hit(&self.arriving(scattered), light.depth, group, light.light, 1.0);
    }

    fn bulb(&mut self, hit: &BulbHit, scattered: Option<Scattered>) {
        let history = self.arriving(scattered);
        let lights = &self.scene.lights;
        if history.delta && !self.on_catcher && lights.shines_on(hit.emitter, &self.last) {
            self.add_hit(&history, hit.depth, lights.group(hit.emitter), hit.light, 1.0);
        }
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        record_medium(&mut self.history, vertex, scattered, self.sample);
        self.on_catcher = false;
        self.depth = vertex.depth;
        self.last = vertex.receiver(self.scene);
        self.lit(vertex);
        self.history.leave(None);
        self.next()
    }

    fn hole(&mut self) {
        self.sample.first = Some(FirstHit::HOLE);
    }

    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, _: FlightDensity) {
        if self.on_catcher {
            return;
        }
        if let Some(scattered) = scattered {
            self.history.scattered(scattered.lobe);
        }
        let class = self.history.suffix.class_at_light(false);
        let first = self.first(|| FirstScatter::Environment);
        let (scene, technique) = (self.scene, Technique::Hit { camera: self.depth + 1 });
        let last = self.last;
        scene.lights.for_each_infinite(&last, direction, scattered.is_none(), |light, pdf, _, group| {
            let weight = Self::weight(scattered, pdf);
            self.add(technique, PathKind { class, group, first }, throughput * light * weight, weight);
        });
    }
}

/// Traces one path and overwrites `sample` with its light, at level 0.
pub fn path_sample(
    camera_paths: &CameraPaths<'_>,
    arena: &Bump,
    start: &CameraPathStart,
    record: &mut impl PathRecorder,
    sample: &mut PixelSample,
) {
    *sample = PixelSample::default();
    let history = PathHistory::START;
    let CameraPaths { scene, max_depth, splits, classes, stop, .. } = *camera_paths;
    let lobes = camera_paths.lobes.then(LobeHistory::default);
    let last = Receiver::anywhere(start.ray.origin);
    let (depth, on_catcher) = (0, false);
    let mut tracer =
        PathTracer { scene, max_depth, splits, classes, lobes, sample, history, last, depth, on_catcher, record, stop };
    walk(camera_paths.scene, arena, &start.ray, start.stream, Transport::Radiance, camera_paths.max_depth, &mut tracer);
}

/// Radiance of one path through a uniform point of pixel `(x, y)`.
pub fn path_radiance(camera_paths: &CameraPaths<'_>, pixel: (u32, u32), stream: Stream) -> Rgb {
    let mut sample = PixelSample::default();
    let start = CameraPathStart { ray: camera_paths.start(pixel, stream), stream };
    path_sample(camera_paths, &Bump::new(), &start, &mut (), &mut sample);
    sample.radiance(0)
}
