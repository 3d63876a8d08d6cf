//! Light samples of the environment along a camera path, from which a render learns where that light arrives.

use super::camera_paths::{CameraPathStart, CameraPaths};
use super::scattering_vertex::ScatterPoint;
use super::vertex::{Next, Scattered, Vertex, Visitor};
use super::walk;
use crate::bsdf::{LobeSet, Transport};
use crate::light::{Environment, SkySamples};
use crate::math::{Vec2, is_lit, luminance};
use crate::random::Purpose;
use crate::scene::Scene;
use bumpalo::Bump;

/// Number of samples at a vertex. They form a lattice.
const SAMPLES: u32 = 8;
/// Step of the second coordinate from one point of the lattice to the next, in units of the first coordinate's step.
const LATTICE: u32 = 3;
/// Largest number of segments of a path that learns. Later vertices are near earlier ones.
const MAX_SEGMENTS: u32 = 6;

struct SampleSky<'a, 's> {
    scene: &'a Scene,
    environment: &'a Environment,
    half: usize,
    samples: &'s mut SkySamples,
}

impl<'a> Visitor<'a> for SampleSky<'a, '_> {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        if vertex.smooth().is_empty() {
            return Next::Continue(LobeSet::ALL);
        }
        let (scene, at) = (self.scene, vertex.receiver(self.scene));
        self.samples.begin(&at, luminance(vertex.throughput).powi(2), self.half, SAMPLES);
        let shift = vertex.draws.two(Purpose::LightPoint);
        for i in 0..SAMPLES {
            let point = Vec2::new(i as f32, (i * LATTICE % SAMPLES) as f32) / SAMPLES as f32;
            let Some(light) = scene.lights.sample_environment(&at, (point + shift).fract()) else { continue };
            let (f, bounce) = vertex.evaluate_cos(light.wi, Transport::Radiance, LobeSet::ALL);
            let arriving = f * light.radiance / light.pdf_w;
            if !is_lit(arriving) {
                continue;
            }
            let value = luminance(arriving * vertex.shadow_ray_to_light(scene, &light).transmittance);
            let bounce = bounce * vertex.survival(LobeSet::ALL) / light.pdf_w;
            self.samples.add(self.environment, &at, light.wi, value, bounce);
        }
        Next::Continue(LobeSet::ALL)
    }
}

impl CameraPaths<'_> {
    /// Samples the environment at the surface vertices of a camera path. `half`: the half of the samples, 0 or 1, to which
    /// the path belongs.
    pub fn sample_sky(
        &self,
        environment: &Environment,
        arena: &Bump,
        start: &CameraPathStart,
        half: usize,
        samples: &mut SkySamples,
    ) {
        let mut visitor = SampleSky { scene: self.scene, environment, half, samples };
        let segments = self.max_depth.min(MAX_SEGMENTS);
        walk(self.scene, arena, &start.ray, start.stream, Transport::Radiance, segments, &mut visitor);
    }
}
