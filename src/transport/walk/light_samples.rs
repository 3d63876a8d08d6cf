//! Light samples along a camera path, from which a render learns where light arrives.

use super::camera_paths::{CameraPathStart, CameraPaths};
use super::scattering_vertex::ScatterPoint;
use super::vertex::{Next, Scattered, Vertex, Visitor};
use super::walk;
use crate::bsdf::{LobeSet, Transport};
use crate::light::{DirectSample, LightBins, LightSamples, LitSample, Receiver, SkySectors};
use crate::math::{Vec2, is_lit, luminance};
use crate::random::Purpose;
use crate::scene::Scene;
use bumpalo::Bump;

/// Number of samples at a vertex. They form a lattice.
const SAMPLES: u32 = 8;
/// Steps of the second coordinate and of the choice of a light from one point of the lattice to the next, in units of the
/// first coordinate's step.
const LATTICE: [u32; 2] = [3, 5];
/// Largest number of segments of a path that learns. Later vertices are near earlier ones.
const MAX_SEGMENTS: u32 = 6;

/// The light of which probabilities are learnt, by bins.
#[derive(Clone, Copy)]
pub enum LightBinsOf<'a> {
    /// The environment alone.
    Sky(&'a SkySectors),
    /// All lights.
    Lights(&'a LightBins),
}

impl LightBinsOf<'_> {
    /// Whether samples of a trial promise that it pays to learn.
    pub fn promise(self, samples: &LightSamples) -> bool {
        match self {
            LightBinsOf::Sky(sky) => sky.promise(samples),
            LightBinsOf::Lights(bins) => bins.promise(samples),
        }
    }

    /// Samples light at a receiver by uniform numbers for the choice of a light and for its point.
    fn sample(self, scene: &Scene, at: &Receiver, choice: f64, point: Vec2) -> Option<DirectSample> {
        match self {
            LightBinsOf::Sky(_) => scene.lights.sample_environment(at, point),
            LightBinsOf::Lights(_) => scene.lights.sample_direct(&scene.shapes, &scene.materials, at, choice, point),
        }
    }

    /// A light sample with its bin; [`LitSample`] explains `value` and `bounce`.
    fn lit(self, scene: &Scene, at: &Receiver, light: &DirectSample, value: f32, bounce: f32) -> LitSample {
        match self {
            LightBinsOf::Sky(sky) => sky.lit(at, light.wi, value, bounce),
            LightBinsOf::Lights(bins) => scene.lights.lit(bins, at, light.light, value, bounce),
        }
    }
}

struct SampleLight<'a, 's> {
    scene: &'a Scene,
    bins: LightBinsOf<'a>,
    half: usize,
    samples: &'s mut LightSamples,
}

impl<'a> Visitor<'a> for SampleLight<'a, '_> {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        if vertex.smooth().is_empty() {
            return Next::Continue(LobeSet::ALL);
        }
        let (scene, at) = (self.scene, vertex.receiver(self.scene));
        self.samples.begin(&at, luminance(vertex.throughput).powi(2), self.half, SAMPLES);
        let (shift, first) = (vertex.draws.two(Purpose::LightPoint), vertex.draws.one_fine(Purpose::LightChoice));
        for i in 0..SAMPLES {
            let [y, choice] = LATTICE.map(|step| (i * step % SAMPLES) as f32 / SAMPLES as f32);
            let point = (Vec2::new(i as f32 / SAMPLES as f32, y) + shift).fract();
            let choice = (f64::from(choice) + first).fract();
            let Some(light) = self.bins.sample(scene, &at, choice, point) else { continue };
            let (f, bounce) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
            let arriving = f * light.radiance / light.pdf_w;
            if !is_lit(arriving) {
                continue;
            }
            let value = luminance(arriving * vertex.shadow_ray_to_light(scene, &light).transmittance);
            // No bounce finds a delta light.
            let bounce = if light.delta { 0.0 } else { bounce * vertex.survival(LobeSet::ALL) / light.pdf_w };
            self.samples.add(self.bins.lit(scene, &at, &light, value, bounce));
        }
        Next::Continue(LobeSet::ALL)
    }
}

impl CameraPaths<'_> {
    /// Samples light at the surface vertices of a camera path. `half`: the half of the samples, 0 or 1, to which the path
    /// belongs.
    pub fn sample_light(
        &self,
        bins: LightBinsOf<'_>,
        arena: &Bump,
        start: &CameraPathStart,
        half: usize,
        samples: &mut LightSamples,
    ) {
        let mut visitor = SampleLight { scene: self.scene, bins, half, samples };
        let segments = self.max_depth.min(MAX_SEGMENTS);
        walk(self.scene, arena, &start.ray, start.stream, Transport::Radiance, segments, &mut visitor);
    }
}
