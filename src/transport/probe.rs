//! Where an eye path first gathers photons, and what a photon there would count in its pixel.

use super::direct::direct_light;
use super::eye::Eye;
use super::walk::{Next, PathStart, Scattered, Vertex, Visitor, walk};
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3};
use crate::random::Stream;
use crate::scene::Scene;
use bumpalo::Bump;

/// The first vertex of an eye path that gathers photons.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// World position.
    pub p: Vec3,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Length of the eye path.
    pub length: f32,
    /// Radiance that a photon adds to the pixel, per flux over area: that of a Lambertian surface of the same albedo.
    pub weight: Rgb,
    /// Radiance that direct light adds to the pixel.
    pub direct: Rgb,
}

struct Find<'a> {
    scene: &'a Scene,
    found: Option<Probe>,
    length: f32,
}

impl<'a> Visitor<'a> for Find<'_> {
    const SPLITS: bool = true;

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        self.length += vertex.distance;
        let lobes = vertex.shading.bsdf.lobes();
        if !lobes.has(LobeSet::BROAD) {
            return Next::Continue(lobes);
        }
        let weight = vertex.throughput * vertex.shading.albedo(LobeSet::BROAD) * std::f32::consts::FRAC_1_PI;
        let direct = vertex.throughput * direct_light(self.scene, vertex, LobeSet::BROAD, LobeSet::NONE, 0.0);
        let (p, ng) = (vertex.surface.p, vertex.surface.ng);
        self.found = Some(Probe { p, ng, length: self.length, weight, direct });
        Next::Stop
    }
}

impl Eye<'_> {
    /// Looks where an eye path first gathers photons on a surface.
    pub fn probe(&self, arena: &Bump, start: &PathStart, stream: Stream) -> Option<Probe> {
        let mut find = Find { scene: self.scene, found: None, length: 0.0 };
        walk(self.scene, arena, start, stream, Transport::Radiance, self.max_depth, &mut find);
        find.found
    }
}
