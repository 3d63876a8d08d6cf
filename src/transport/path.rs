//! Unidirectional path tracing with next-event estimation: the independent oracle.
//!
//! It shares the walk with the other methods, but keeps its own two-way multiple importance sampling over all lobes of a vertex at once
//! (`direct_light` splits them), so that the two check each other.

use super::bidirectional::{Part, Record, Technique, Trail};
use super::bidirectional_eye::{look, look_in_medium};
use super::eye::{Eye, EyeMeasure};
use super::site::{MediumVertex, Site};
use super::walk::{Next, PathStart, Scattered, Vertex, Visitor, walk};
use crate::bsdf::{LobeSet, Transport};
use crate::light::Receiver;
use crate::math::{Rgb, Vec3};
use crate::medium::Flight;
use crate::random::{Purpose, Stream};
use crate::scene::Scene;
use bumpalo::Bump;

struct PathTracer<'a, R> {
    scene: &'a Scene,
    max_depth: u32,
    measure: EyeMeasure,
    trail: Trail,
    last: Receiver,
    /// Depth of the last vertex.
    depth: u32,
    record: &'a mut R,
}

impl<R: Record> PathTracer<'_, R> {
    /// Weight of having run into an emitter: full where next-event estimation could not have found it.
    fn weight(scattered: Option<Scattered>, pdf_light: f32) -> f32 {
        match scattered {
            Some(s) if !s.lobe.has(LobeSet::DELTA) => s.pdf_w / (s.pdf_w + pdf_light),
            _ => 1.0,
        }
    }

    /// Light straight from a light, weighted, and its weight.
    fn next_event(&self, vertex: &impl Site) -> (Rgb, f32) {
        let (scene, draws) = (self.scene, vertex.draws());
        let (choice, point) = (draws.one(Purpose::LightChoice), draws.two(Purpose::LightPoint));
        let Some(light) =
            scene.lights.sample_direct(&scene.shapes, &scene.materials, &vertex.receiver(), choice, point)
        else {
            return (Rgb::ZERO, 1.0);
        };
        let (f, pdf) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
        if (f * light.radiance).max_element() <= 0.0 {
            return (Rgb::ZERO, 1.0);
        }
        let way = vertex.way(scene, light.wi, light.target, draws.token(Purpose::ShadowAlpha), false);
        let pdf = pdf * vertex.survival(LobeSet::ALL) * way.flight.forward;
        let weight = if light.delta { 1.0 } else { light.pdf_w / (light.pdf_w + pdf) };
        (f * light.radiance * (weight / light.pdf_w) * way.left, weight)
    }

    /// Light straight from a light at a vertex.
    fn lit<S: Site>(&mut self, vertex: &S) {
        if vertex.depth() < self.max_depth {
            let (light, weight) = self.next_event(vertex);
            let technique = Technique::NextEvent { eye: self.depth };
            self.add(technique, self.trail.next_event(S::IN_MEDIUM), vertex.throughput() * light, weight);
        }
    }

    /// Adds weighted light.
    fn add(&mut self, technique: Technique, part: Part, light: Rgb, weight: f32) {
        if weight > 0.0 {
            self.record.arrival(technique, 0, light / weight, weight);
        }
        let measure = &mut self.measure;
        *match part {
            Part::Emission => &mut measure.emission,
            Part::Direct => &mut measure.direct,
            Part::Caustic => &mut measure.caustic_photons[0],
            Part::Indirect => &mut measure.indirect,
            Part::Volume => &mut measure.volume,
        } += light;
    }
}

impl<'a, R: Record> Visitor<'a> for PathTracer<'_, R> {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        look(&mut self.trail, vertex, scattered, &mut self.measure);
        self.depth = vertex.depth;
        let from = if scattered.is_none() { Receiver::anywhere(vertex.from) } else { self.last };
        if let Some((radiance, pdf)) = self.scene.lights.hit(&self.scene.materials, &from, vertex.surface) {
            let part = self.trail.hit(scattered.map(|s| s.lobe));
            let weight = Self::weight(scattered, pdf);
            self.add(Technique::Hit { eye: self.depth }, part, vertex.throughput * radiance * weight, weight);
        }
        self.last = vertex.receiver();
        self.lit(vertex);
        self.trail.leave(vertex.shading.bsdf.lobes().has(LobeSet::SMOOTH));
        Next::Continue(LobeSet::ALL)
    }

    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        look_in_medium(&mut self.trail, vertex, scattered, &mut self.measure);
        self.depth = vertex.depth;
        self.last = vertex.receiver();
        self.lit(vertex);
        self.trail.leave_medium();
        Next::Continue(LobeSet::ALL)
    }

    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, _: Flight) {
        if let Some(scattered) = scattered {
            self.trail.scattered(scattered.lobe);
        }
        let part = self.trail.hit(scattered.map(|s| s.lobe));
        let (scene, technique) = (self.scene, Technique::Hit { eye: self.depth + 1 });
        let last = self.last;
        scene.lights.escape(&last, direction, |light, pdf, _| {
            let weight = Self::weight(scattered, pdf);
            self.add(technique, part, throughput * light * weight, weight);
        });
    }
}

/// What one path measures, on one level.
pub fn path_measure(
    eye: &Eye<'_>,
    arena: &Bump,
    (start, stream): &(PathStart, Stream),
    record: &mut impl Record,
) -> EyeMeasure {
    let (measure, trail) = (EyeMeasure::default(), Trail::START);
    let (scene, max_depth, last) = (eye.scene, eye.max_depth, Receiver::anywhere(start.origin));
    let mut tracer = PathTracer { scene, max_depth, measure, trail, last, depth: 0, record };
    walk(eye.scene, arena, start, *stream, Transport::Radiance, eye.max_depth, &mut tracer);
    tracer.measure
}

/// Radiance of one path through a uniform point of pixel `(x, y)`.
pub fn path_radiance(eye: &Eye<'_>, pixel: (u32, u32), stream: Stream) -> Rgb {
    path_measure(eye, &Bump::new(), &(eye.start(pixel, stream), stream), &mut ()).radiance(0)
}
