//! Bidirectional light transport: which strategies find a path, and what its two walks share.
//!
//! One presets-and-parts module serves light tracing, bidirectional path tracing \[Veach 1997, 10\], bidirectional
//! photon mapping and vertex connection and merging \[Georgiev et al. 2012\]. A light path is walked first; it leaves
//! splats (its vertices connected to the camera), vertices for the one camera path it belongs to, and photons for all eye
//! paths of the next pass. No light vertex outlives its pixel.

use super::camera_paths::CameraPaths;
use super::cause::Cause;
use super::initial_media::InitialMedia;
use super::mis::{Eta, Merges, Ratios, one_merge};
use crate::light::Group;
use crate::math::{Rgb, Vec3};
use crate::plan::PathClass;

/// Which strategies take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TechniqueSet {
    /// Light vertices are connected to the camera.
    pub camera: bool,
    /// Next-event estimation, connection of vertices, and camera paths that run into lights.
    pub connect: bool,
    /// Photons are merged.
    pub merge: bool,
    /// Depth of the first vertex of a light path and of a camera path that is merged (1 is the first surface).
    pub first_merged: [u32; 2],
}

impl TechniqueSet {
    /// Light tracing.
    pub const LIGHT: TechniqueSet = TechniqueSet { camera: true, connect: false, merge: false, first_merged: [1, 1] };
    /// Bidirectional path tracing.
    pub const BDPT: TechniqueSet = TechniqueSet { camera: true, connect: true, merge: false, first_merged: [1, 1] };
    /// Bidirectional photon mapping: every vertex merges, even direct light.
    pub const BPM: TechniqueSet = TechniqueSet { camera: false, connect: false, merge: true, first_merged: [1, 1] };
    /// Vertex connection and merging. Direct light is not merged, nor what the camera sees directly: other strategies do
    /// both better, without bias.
    pub const VCM: TechniqueSet = TechniqueSet { camera: true, connect: true, merge: true, first_merged: [2, 2] };

    /// Whether a light path's vertex at `depth` leaves photons.
    #[inline]
    pub fn light_vertex_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[0]
    }

    /// Whether a camera path's vertex at `depth` merges photons.
    #[inline]
    pub fn camera_vertex_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[1]
    }

    /// The merge that weights count at a camera path's vertex at `depth`, if any; `clear`: all before it are delta.
    #[inline]
    pub fn camera_vertex_merge(&self, depth: u32, clear: bool) -> Merges {
        if self.camera_vertex_merges(depth) { one_merge(clear) } else { Merges::ZERO }
    }

    /// The merge that weights count at a light path's vertex at `depth`, if any: the camera path's vertex behind it is not
    /// delta.
    #[inline]
    pub fn light_vertex_merge(&self, depth: u32) -> Merges {
        if self.light_vertex_merges(depth) { one_merge(false) } else { Merges::ZERO }
    }
}

/// What the bidirectional paths of a render share.
#[derive(Clone, Copy)]
pub struct Bidirectional<'a> {
    /// Camera paths.
    pub camera_paths: CameraPaths<'a>,
    /// The solids around the lights.
    pub initial_media: &'a InitialMedia,
    /// What finds paths.
    pub techniques: TechniqueSet,
    /// Light paths connected to the camera for every camera path of a pixel.
    pub light_paths: f32,
    /// Light paths of a pass whose photons are merged.
    pub merged_paths: f32,
    /// What alone is looked for, if not all that the two walks find.
    pub only: Option<Division>,
}

/// How a path of `segments` is divided among the two walks: the eye's goes as far as its vertex at depth `eye`, the
/// light's to the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Segments of the path.
    pub segments: u32,
    /// 0 is the camera, to which a light vertex is connected; `segments` the light, which a camera path runs into.
    pub camera: u32,
}

impl Division {
    /// That of a path found by connecting.
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

    /// Depth of the light walk's last vertex, 0 being the light; `None` where the camera path runs into that.
    #[inline]
    pub fn light(self) -> Option<u32> {
        self.segments.checked_sub(self.camera + 1)
    }
}

impl Bidirectional<'_> {
    /// Whether a camera path that runs into a light with segment number `depth` tells of it.
    #[inline]
    pub(super) fn hits_at(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.camera == depth && only.segments == depth)
    }

    /// Whether a camera path's vertex at `depth` is connected.
    #[inline]
    pub(super) fn connects_camera_vertex(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.camera == depth && only.segments > depth)
    }

    /// Whether it is connected to a light itself.
    #[inline]
    pub(super) fn next_event(&self) -> bool {
        self.only.is_none_or(|only| only.light() == Some(0))
    }

    /// Whether a light path's vertex at `depth` is connected.
    #[inline]
    pub(super) fn connects_light_vertex(&self, depth: u32) -> bool {
        self.only.is_none_or(|only| only.light() == Some(depth))
    }

    /// Whether a light path's vertex is connected to the camera.
    #[inline]
    pub(super) fn connects_camera(&self) -> bool {
        self.only.is_none_or(|only| only.camera == 0)
    }

    /// Whether a camera path has an end at `depth`.
    #[inline]
    pub(super) fn ends_camera_path(&self, depth: u32) -> bool {
        self.only.is_some_and(|only| only.camera <= depth)
    }

    /// Whether a light path has an end at `depth`.
    #[inline]
    pub(super) fn ends_light_path(&self, depth: u32) -> bool {
        self.only.is_some_and(|only| only.light().is_none_or(|light| light <= depth))
    }

    /// Number of pixels of the whole picture.
    #[inline]
    pub fn pixels(&self) -> f32 {
        self.camera_paths.camera.whole_pixels()
    }
}

/// Which strategy found a path; `light` and `eye` are depths of the last vertices of the two walks it was put together
/// from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Technique {
    /// The camera path ran into a light with its segment number `eye`.
    Hit {
        /// See above.
        camera: u32,
    },
    /// Next-event estimation.
    NextEvent {
        /// See above.
        camera: u32,
    },
    /// Two vertices connected.
    Connect {
        /// See above.
        light: u32,
        /// See above.
        camera: u32,
    },
    /// A light vertex connected to the camera.
    Camera {
        /// See above.
        light: u32,
    },
    /// A photon merged.
    Merge {
        /// See above.
        light: u32,
        /// See above.
        camera: u32,
    },
}

impl Technique {
    /// Why a sample is rejected to which it brings what is not finite.
    pub(super) fn cause(self) -> Cause {
        match self {
            Technique::Hit { .. } => Cause::Emission,
            Technique::NextEvent { .. } => Cause::DirectLight,
            Technique::Connect { .. } => Cause::Connection,
            Technique::Camera { .. } => Cause::Splat,
            Technique::Merge { .. } => Cause::Photons,
        }
    }
}

/// Looks over the shoulder of the walks: for pictures per technique, and for tests. `()` costs nothing.
pub trait Record {
    /// `technique` has found light: `value` unweighted (without visibility), `from` the point connected to or merged,
    /// and the ratios its weight comes from.
    #[inline]
    fn contribution(&mut self, technique: Technique, value: Rgb, from: Vec3, ratios: Ratios) {
        let _ = (technique, value, from, ratios);
    }

    /// `technique` brings light to the camera path's own pixel: of a class and of a group of lights, on a `level`, `value`
    /// unweighted, with visibility and kernel, and its weight. Depths count from 1, also for light from infinity.
    #[inline]
    fn arrival(&mut self, technique: Technique, of: (PathClass, Group), level: usize, value: Rgb, weight: f32) {
        let _ = (technique, of, level, value, weight);
    }
}

impl Record for () {}

/// Bandwidths of the levels of one camera path, ascending, with their etas.
#[derive(Clone, Copy, Debug)]
pub struct MergeLevels {
    radius2: [f32; super::MAX_LEVELS],
    eta: [Eta; super::MAX_LEVELS],
    count: usize,
}

impl MergeLevels {
    /// From radii squared in ascending order (at most [`super::MAX_LEVELS`]) and an eta each.
    #[inline]
    pub fn new(levels: impl Iterator<Item = (f32, Eta)>) -> MergeLevels {
        let mut all = MergeLevels { radius2: [0.0; super::MAX_LEVELS], eta: [Eta::NONE; super::MAX_LEVELS], count: 0 };
        for (radius2, eta) in levels.take(super::MAX_LEVELS) {
            all.radius2[all.count] = radius2;
            all.eta[all.count] = eta;
            all.count += 1;
        }
        all
    }

    /// Radii squared.
    #[inline]
    pub fn radius2(&self) -> &[f32] {
        &self.radius2[..self.count]
    }

    /// Etas.
    #[inline]
    pub fn eta(&self) -> &[Eta] {
        &self.eta[..self.count]
    }
}
