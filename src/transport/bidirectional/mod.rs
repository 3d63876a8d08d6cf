//! Bidirectional light transport: the techniques of a method, and what its two walks share.
//!
//! One implementation serves light tracing, bidirectional path tracing \[Veach 1997, 10\], bidirectional photon
//! mapping, and vertex connection and merging \[Georgiev et al. 2012\]. The light path is walked first. It leaves
//! splats (its vertices connected to the camera), vertices for its own camera path, and photons for all camera paths of
//! the next iteration. Light vertices live only as long as their pixel.

pub(in crate::transport) mod camera_walk;
pub(in crate::transport) mod light_vertex;
pub(in crate::transport) mod light_walk;
pub mod mis;
pub(in crate::transport) mod path;
pub(in crate::transport) mod path_history;
pub(in crate::transport) mod photon_merge;
pub(in crate::transport) mod shares;

use crate::light::Group;
use crate::math::{Rgb, Vec3};
use crate::path_class::PathClass;
use crate::transport::walk::camera_paths::CameraPaths;
use crate::transport::walk::cause::Cause;
use crate::transport::walk::initial_media::InitialMedia;
use crate::transport::walk::lobe_layers::FirstScatter;
use mis::{Eta, Merges, Ratios, one_merge};

/// The sampling techniques that a bidirectional method combines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TechniqueSet {
    /// Whether light vertices are connected to the camera.
    pub camera: bool,
    /// Whether next-event estimation, connections of vertices, and camera paths that hit lights count.
    pub connect: bool,
    /// Whether photons are merged.
    pub merge: bool,
    /// Depth of the first merged vertex of a light path, and of a camera path (1 is the first surface).
    pub first_merged: [u32; 2],
}

impl TechniqueSet {
    /// The techniques of light tracing.
    pub const LIGHT: TechniqueSet = TechniqueSet { camera: true, connect: false, merge: false, first_merged: [1, 1] };
    /// The techniques of bidirectional path tracing.
    pub const BDPT: TechniqueSet = TechniqueSet { camera: true, connect: true, merge: false, first_merged: [1, 1] };
    /// The techniques of bidirectional photon mapping: every vertex merges, direct light included.
    pub const BPM: TechniqueSet = TechniqueSet { camera: false, connect: false, merge: true, first_merged: [1, 1] };
    /// The techniques of vertex connection and merging. Direct light and directly visible vertices are not merged,
    /// because other techniques sample them better, without bias.
    pub const VCM: TechniqueSet = TechniqueSet { camera: true, connect: true, merge: true, first_merged: [2, 2] };

    /// Whether a light path leaves a photon at its vertex number `depth` (1 is the first surface).
    #[inline]
    pub fn light_vertex_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[0]
    }

    /// Whether a camera path merges photons at its vertex number `depth` (1 is the first surface).
    #[inline]
    pub fn camera_vertex_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[1]
    }

    /// How often merging at camera vertex number `depth` counts in MIS weights: once or not at all. `clear`: all
    /// earlier vertices are delta.
    #[inline]
    pub fn camera_vertex_merge(&self, depth: u32, clear: bool) -> Merges {
        if self.camera_vertex_merges(depth) { one_merge(clear) } else { Merges::ZERO }
    }

    /// How often merging at light vertex number `depth` counts in MIS weights: once or not at all. The camera path
    /// behind it has a vertex that is not delta.
    #[inline]
    pub fn light_vertex_merge(&self, depth: u32) -> Merges {
        if self.light_vertex_merges(depth) { one_merge(false) } else { Merges::ZERO }
    }
}

/// Settings and shared data of the bidirectional paths of a render.
#[derive(Clone, Copy)]
pub struct Bidirectional<'a> {
    /// Settings and shared data of the camera paths.
    pub camera_paths: CameraPaths<'a>,
    /// The solids around the camera and around each light.
    pub initial_media: &'a InitialMedia,
    /// Techniques that the method combines.
    pub techniques: TechniqueSet,
    /// Number of light paths connected to the camera, for each camera path of a pixel.
    pub light_paths: f32,
    /// Number of light paths whose vertices each vertex of a camera path connects to.
    pub connections: f32,
    /// Number of light paths whose photons are merged in one iteration.
    pub merged_paths: f32,
    /// Fraction of the initial throughput down to which roulette does not end a camera path.
    pub spared: f32,
    /// Limits paths to one division between camera and light subpath; `None` for no limit.
    pub only: Option<Division>,
}

/// How the segments of a path are divided among camera subpath and light subpath. The camera path reaches its vertex at
/// depth `camera`, the light path the vertex before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Number of segments of the whole path.
    pub segments: u32,
    /// Depth of the last camera vertex: 0 if a light vertex is connected to the camera; `segments` if the camera path
    /// hits a light.
    pub camera: u32,
}

impl Division {
    /// The division of the path that `technique` found; `None` for merging.
    pub fn of(technique: Technique) -> Option<Division> {
        let (segments, camera) = match technique {
            Technique::Hit { camera } => (camera, camera),
            Technique::NextEvent { camera } => (camera + 1, camera),
            Technique::Connect { light, camera } => (light + camera + 1, camera),
            Technique::Camera { light } => (light + 1, 0),
            Technique::Merge { .. } => return None,
        };
        Some(Division { segments, camera })
    }

    /// Depth of the last vertex of the light path, 0 for the light itself; `None` if the camera path hits the light.
    #[inline]
    pub fn light(self) -> Option<u32> {
        self.segments.checked_sub(self.camera + 1)
    }
}

impl Bidirectional<'_> {
    /// Whether a camera path contributes if its segment `depth` hits a light.
    #[inline]
    pub(in crate::transport) fn hits_at(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.camera == depth && only.segments == depth)
    }

    /// Whether a camera vertex at `depth` is connected.
    #[inline]
    pub(in crate::transport) fn connects_camera_vertex(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.camera == depth && only.segments > depth)
    }

    /// Number of samples of the technique that joins the last two vertices of a subpath whose last vertex has this
    /// `depth`. If the first of them is the light or the camera, it is next-event estimation or a connection of the light
    /// path to the camera, else a connection.
    #[inline]
    pub(in crate::transport) fn joins(&self, depth: u32) -> f64 {
        if depth == 1 { 1.0 } else { f64::from(self.connections) }
    }

    /// Whether camera vertices are connected to lights.
    #[inline]
    pub(in crate::transport) fn next_event(&self) -> bool {
        self.only.is_none_or(|only| only.light() == Some(0))
    }

    /// Whether light paths leave vertices to which camera vertices connect.
    #[inline]
    pub(in crate::transport) fn keeps_light_vertices(&self) -> bool {
        self.techniques.connect && self.connections > 0.0
    }

    /// Whether a light vertex at `depth` is connected.
    #[inline]
    pub(in crate::transport) fn connects_light_vertex(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.light() == Some(depth))
    }

    /// Whether light vertices are connected to the camera.
    #[inline]
    pub(in crate::transport) fn connects_camera(&self) -> bool {
        self.only.is_none_or(|only| only.camera == 0)
    }

    /// Whether a camera path ends at `depth`.
    #[inline]
    pub(in crate::transport) fn ends_camera_path(&self, depth: u32) -> bool {
        self.only.is_some_and(|only| only.camera <= depth)
    }

    /// Whether a light path ends at `depth`.
    #[inline]
    pub(in crate::transport) fn ends_light_path(&self, depth: u32) -> bool {
        self.only.is_some_and(|only| only.light().is_none_or(|light| light <= depth))
    }

    /// Number of pixels of the whole picture.
    #[inline]
    pub fn pixels(&self) -> f32 {
        self.camera_paths.camera.whole_pixels()
    }
}

/// The technique that found a path. `light` and `camera` are the depths (numbers of segments) of the last vertices of
/// the two subpaths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Technique {
    /// Segment number `camera` of the camera path hit a light.
    Hit {
        /// Depth of the camera subpath.
        camera: u32,
    },
    /// Next-event estimation.
    NextEvent {
        /// Depth of the camera subpath.
        camera: u32,
    },
    /// A light vertex was connected to a camera vertex.
    Connect {
        /// Depth of the light subpath.
        light: u32,
        /// Depth of the camera subpath.
        camera: u32,
    },
    /// A light vertex was connected to the camera.
    Camera {
        /// Depth of the light subpath.
        light: u32,
    },
    /// A photon was merged with a camera vertex.
    Merge {
        /// Depth of the light subpath.
        light: u32,
        /// Depth of the camera subpath.
        camera: u32,
    },
}

impl Technique {
    /// Whether the path has a single scattering event between camera and light.
    #[inline]
    pub fn is_direct(self) -> bool {
        let segments = match self {
            Technique::Hit { camera } => camera,
            Technique::NextEvent { camera } => camera + 1,
            Technique::Connect { light, camera } => light + camera + 1,
            Technique::Camera { light } => light + 1,
            Technique::Merge { light, camera } => light + camera,
        };
        segments == 2
    }

    /// The cause to report if a contribution of the technique is not finite.
    pub(in crate::transport) fn cause(self) -> Cause {
        match self {
            Technique::Hit { .. } => Cause::Emission,
            Technique::NextEvent { .. } => Cause::DirectLight,
            Technique::Connect { .. } => Cause::Connection,
            Technique::Camera { .. } => Cause::Splat,
            Technique::Merge { .. } => Cause::Photons,
        }
    }
}

/// Class, light group and first scattering of a path that brings light to a pixel: they select its layers.
#[derive(Clone, Copy, Debug)]
pub struct PathKind {
    /// Class of the path: the kinds of its bounces.
    pub class: PathClass,
    /// Light group of the light that the path starts from.
    pub group: Group,
    /// How the first vertex seen from the camera scatters the light. Not known unless [`CameraPaths::lobes`] is set.
    pub first: FirstScatter,
}

/// Observes the contributions of paths, for pictures per technique and for tests. `()` costs nothing.
pub trait PathRecorder {
    /// `technique` has found light: `value` without weight and visibility, the point `from` that was connected or
    /// merged, and the ratios that determine the weight.
    #[inline]
    fn contribution(&mut self, technique: Technique, value: Rgb, from: Vec3, ratios: Ratios) {
        let _ = (technique, value, from, ratios);
    }

    /// The path, a camera path or a light path, continues from a vertex. `survival(chance)` is the probability that
    /// roulette allows it if its throughput is divided by `chance`.
    #[inline]
    fn continues(&mut self, survival: impl Fn(f32) -> f32) {
        let _ = survival;
    }

    /// A branch of a camera path that splits follows, up to the matching [`PathRecorder::end_branch`]. The path then goes on
    /// from where the branch began.
    #[inline]
    fn begin_branch(&mut self) {}

    /// The last branch that has begun ends.
    #[inline]
    fn end_branch(&mut self) {}

    /// `technique` adds light to the camera path's own pixel at `level`: the kind of the path, `value` with visibility and
    /// kernel but without weight, and the weight. Depths count from 1, also for light from infinity.
    #[inline]
    fn arrival(&mut self, technique: Technique, of: PathKind, level: usize, value: Rgb, weight: f32) {
        let _ = (technique, of, level, value, weight);
    }

    /// The camera path hits a surface first, whose diffuse, glossy and transmitting lobes have these albedos. Not called
    /// unless [`CameraPaths::lobes`] is set.
    #[inline]
    fn first_surface(&mut self, colors: [Rgb; 3]) {
        let _ = colors;
    }

    /// The camera path hits a shadow catcher first, which reflects this light to the camera, with and without the shadows
    /// of other objects.
    #[inline]
    fn caught(&mut self, light: [Rgb; 2]) {
        let _ = light;
    }
}

impl PathRecorder for () {}

/// Merging bandwidths of the bandwidth levels of a pixel, ascending, each with its eta (factor of merging in MIS weights).
#[derive(Clone, Copy, Debug)]
pub struct MergeLevels {
    bandwidth2: [f32; crate::transport::MAX_LEVELS],
    eta: [Eta; crate::transport::MAX_LEVELS],
    count: usize,
    /// Probability that a camera path of the pixel merges, which eta contains.
    probability: f32,
}

impl MergeLevels {
    /// Takes squared bandwidths in ascending order (at most [`crate::transport::MAX_LEVELS`]), each with its eta.
    #[inline]
    pub fn new(levels: impl Iterator<Item = (f32, Eta)>) -> MergeLevels {
        let mut all = MergeLevels {
            bandwidth2: [0.0; crate::transport::MAX_LEVELS],
            eta: [Eta::NONE; crate::transport::MAX_LEVELS],
            count: 0,
            probability: 1.0,
        };
        for (bandwidth2, eta) in levels.take(crate::transport::MAX_LEVELS) {
            all.bandwidth2[all.count] = bandwidth2;
            all.eta[all.count] = eta;
            all.count += 1;
        }
        all
    }

    /// Sets the probability, above 0, with which a camera path of the pixel merges. The etas that were given must have this
    /// probability as a factor.
    #[must_use]
    #[inline]
    pub fn with_probability(self, probability: f32) -> MergeLevels {
        MergeLevels { probability, ..self }
    }

    /// Probability that a camera path of the pixel merges.
    #[inline]
    pub fn probability(&self) -> f32 {
        self.probability
    }

    /// Squared merging bandwidths in ascending order (square scene units).
    #[inline]
    pub fn bandwidth2(&self) -> &[f32] {
        &self.bandwidth2[..self.count]
    }

    /// Eta of each bandwidth: the factor of merging in MIS weights.
    #[inline]
    pub fn eta(&self) -> &[Eta] {
        &self.eta[..self.count]
    }
}
