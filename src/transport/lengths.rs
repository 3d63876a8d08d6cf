//! How long paths are: what the cost of a method is estimated from, without a clock.

use super::eye::Eye;
use super::interior::Surroundings;
use super::light::LightPass;
use super::walk::{Next, Scattered, Vertex, Visitor, walk};
use crate::bsdf::{LobeSet, Transport};
use crate::light::Guide;
use crate::random::{Domain, Stream};
use bumpalo::Bump;
use rayon::prelude::*;

/// Paths of each kind that are walked.
const PATHS: u32 = 4096;
/// Paths per unit of work.
const CHUNK: usize = 256;

/// Mean numbers of vertices of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lengths {
    /// Of an eye path that goes on whatever the lobes.
    pub eye: f64,
    /// Of one that ends at broad lobes.
    pub eye_to_broad: f64,
    /// Of a light path that goes on whatever the lobes.
    pub light: f64,
    /// Of one that ends at broad lobes.
    pub light_to_broad: f64,
    /// Those of an eye path that have lobes which are not delta: they ask for light, gather photons and are connected.
    pub eye_open: f64,
    /// The same of a light path.
    pub light_open: f64,
}

/// Counts vertices, those up to the first with broad lobes, and those that are no perfect mirrors or clear glass.
struct Count {
    all: u32,
    to_broad: u32,
    open: u32,
    narrow: bool,
}

impl<'a> Visitor<'a> for Count {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        self.narrow &= scattered.is_none_or(|s| !s.lobe.has(LobeSet::BROAD));
        self.all += 1;
        self.to_broad += u32::from(self.narrow);
        self.open += u32::from(vertex.shading.bsdf.lobes() != LobeSet::DELTA);
        Next::Continue(LobeSet::ALL)
    }
}

impl Lengths {
    /// Of paths of a view, the light paths guided if there is a guide.
    pub fn new(eye: &Eye<'_>, surroundings: &Surroundings, seed: u64, guide: Option<&Guide>) -> Lengths {
        let (width, height) = eye.camera.size();
        let pixels = u64::from(width) * u64::from(height);
        let lights = LightPass::new(seed, 0, Domain::GuideLight, PATHS, eye.max_depth).guided(guide);
        let count = |index: u32| {
            let arena = Bump::new();
            let new = || Count { all: 0, to_broad: 0, open: 0, narrow: true };
            let (mut from_eye, mut from_light) = (new(), new());
            let pixel = u64::from(index) * pixels / u64::from(PATHS);
            let at = ((pixel % u64::from(width)) as u32, (pixel / u64::from(width)) as u32);
            let stream = Stream::new(seed, u64::MAX, Domain::GuideEye, u64::from(index));
            let start = eye.start(at, stream);
            walk(eye.scene, &arena, &start, stream, Transport::Radiance, eye.max_depth, &mut from_eye);
            if let Some(emitted) = lights.emit(eye.scene, surroundings, index) {
                let (start, stream) = (&emitted.start, emitted.stream);
                walk(eye.scene, &arena, start, stream, Transport::Importance, eye.max_depth, &mut from_light);
            }
            [&from_eye, &from_light].map(|count| [count.all, count.to_broad, count.open].map(f64::from))
        };
        let counts: Vec<[[f64; 3]; 2]> = (0..PATHS).into_par_iter().with_min_len(CHUNK).map(count).collect();
        // Whole numbers: their sums do not depend on any order.
        let mean = |of: usize, k: usize| counts.iter().map(|count| count[of][k]).sum::<f64>() / f64::from(PATHS);
        let [[eye, eye_to_broad, eye_open], [light, light_to_broad, light_open]] =
            [0, 1].map(|of| [0, 1, 2].map(|k| mean(of, k)));
        Lengths { eye, eye_to_broad, light, light_to_broad, eye_open, light_open }
    }
}
