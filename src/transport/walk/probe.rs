//! The first vertex where a camera path gathers photons, and the contribution of a photon there.

use super::camera_paths::{CameraPathStart, CameraPaths};
use super::direct::direct_light;
use super::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use super::walk;
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3};
use crate::photon::NO_NORMAL;
use bumpalo::Bump;
use std::f32::consts::FRAC_1_PI;

/// The first surface point on a camera path at which photons are gathered.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// World position.
    pub p: Vec3,
    /// Unit geometric normal; [`crate::photon::NO_NORMAL`] in a medium.
    pub ng: Vec3,
    /// Length of the camera path up to the point; in a medium, up to the surface behind it, if there is one (scene
    /// units).
    pub length: f32,
}

/// The first surface vertex where a camera path gathers photons, with its light.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// Position, normal and path length of the vertex.
    pub point: GatherPoint,
    /// Radiance that a photon adds to the pixel, per flux over area, for a Lambertian surface of the vertex's albedo.
    pub weight: Rgb,
    /// Radiance that direct light adds to the pixel.
    pub direct: Rgb,
}

/// Visitor that finds the first vertex where a camera path gathers photons and evaluates it with `look`.
struct Find<F, T> {
    look: F,
    found: Option<(GatherPoint, T)>,
    length: f32,
}

impl<'a, T, F: FnMut(&Vertex<'_, '_>) -> T> Visitor<'a> for Find<F, T> {
    const SPLITS: bool = true;

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        self.length += vertex.distance;
        let lobes = vertex.shading.bsdf.lobes();
        if lobes.intersects(LobeSet::BROAD) {
            let point = GatherPoint { p: vertex.surface.p, ng: vertex.surface.ng, length: self.length };
            self.found = Some((point, (self.look)(vertex)));
            return Next::Stop;
        }
        Next::Continue(lobes)
    }
}

impl CameraPaths<'_> {
    /// The first surface point where a camera path gathers photons; `None` if there is none.
    pub fn gather_point(&self, arena: &Bump, start: &CameraPathStart) -> Option<GatherPoint> {
        self.find(arena, start, |_| ()).map(|(point, ())| point)
    }

    /// The first surface vertex where a camera path gathers photons, with its light; `None` if there is none.
    pub fn probe(&self, arena: &Bump, start: &CameraPathStart) -> Option<Probe> {
        let look = |vertex: &Vertex<'_, '_>| {
            let weight = vertex.throughput * vertex.shading.albedo(LobeSet::BROAD) * FRAC_1_PI;
            let direct = vertex.throughput * direct_light(self.scene, vertex, LobeSet::BROAD, LobeSet::empty(), 0.0);
            (weight, direct)
        };
        self.find(arena, start, look).map(|(point, (weight, direct))| Probe { point, weight, direct })
    }

    fn find<T>(
        &self,
        arena: &Bump,
        start: &CameraPathStart,
        look: impl FnMut(&Vertex<'_, '_>) -> T,
    ) -> Option<(GatherPoint, T)> {
        let mut find = Find { look, found: None, length: 0.0 };
        walk(self.scene, arena, &start.ray, start.stream, Transport::Radiance, self.max_depth, &mut find);
        find.found
    }
}

impl CameraPaths<'_> {
    /// The first point in a scattering medium on a camera path; `None` if there is none.
    pub fn volume_point(&self, arena: &Bump, start: &CameraPathStart) -> Option<GatherPoint> {
        let mut find = FindVolumePoint { found: None, length: 0.0 };
        walk(self.scene, arena, &start.ray, start.stream, Transport::Radiance, self.max_depth, &mut find);
        find.found
    }
}

struct FindVolumePoint {
    found: Option<GatherPoint>,
    length: f32,
}

impl<'a> Visitor<'a> for FindVolumePoint {
    const SPLITS: bool = true;

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        self.length += vertex.distance;
        if let Some(found) = &mut self.found {
            found.length = self.length;
            return Next::Stop;
        }
        let lobes = vertex.shading.bsdf.lobes();
        if lobes.intersects(LobeSet::BROAD) { Next::Stop } else { Next::Continue(lobes) }
    }

    fn medium(&mut self, vertex: &MediumVertex, _: Option<Scattered>) -> Next {
        let length = self.length + vertex.arrival.distance;
        self.found.get_or_insert(GatherPoint { p: vertex.arrival.p, ng: NO_NORMAL, length });
        Next::Stop
    }
}
