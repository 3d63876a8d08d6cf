//! Bidirectional light transport: which strategies find a path, and what its two walks share.
//!
//! One presets-and-parts module serves light tracing, bidirectional path tracing \[Veach 1997, 10\], bidirectional photon mapping
//! and vertex connection and merging \[Georgiev et al. 2012\]. A light path is walked first; it leaves splats (its vertices connected to the
//! camera), vertices for the one eye path it belongs to, and photons for all eye paths of the next pass. No light vertex outlives its pixel.

use super::eye::Eye;
use super::mis::{Eta, Merges, MisState, Ratios, one_merge};
use super::shares::leads;
use super::surroundings::Surroundings;
use crate::bsdf::{LobeSet, Shading, Transport};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::medium::HenyeyGreenstein;
use crate::plan::{ClassSet, Event, EyeSuffix, LightPrefix};
use crate::scene::contact::Place;

/// Which strategies take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strategies {
    /// Light vertices are connected to the camera.
    pub camera: bool,
    /// Next-event estimation, connection of vertices, and eye paths that run into lights.
    pub connect: bool,
    /// Photons are merged.
    pub merge: bool,
    /// Depth of the first vertex of a light path and of an eye path that is merged (1 is the first surface).
    pub first_merged: [u32; 2],
}

impl Strategies {
    /// Light tracing.
    pub const LIGHT: Strategies = Strategies { camera: true, connect: false, merge: false, first_merged: [1, 1] };
    /// Bidirectional path tracing.
    pub const BDPT: Strategies = Strategies { camera: true, connect: true, merge: false, first_merged: [1, 1] };
    /// Bidirectional photon mapping: every vertex merges, even direct light.
    pub const BPM: Strategies = Strategies { camera: false, connect: false, merge: true, first_merged: [1, 1] };

    /// Vertex connection and merging. Direct light is not merged, nor what the camera sees directly, if it can be connected to: other strategies do
    /// both better, without bias.
    pub fn vcm(camera_connects: bool) -> Strategies {
        Strategies { camera: true, connect: true, merge: true, first_merged: [2, if camera_connects { 2 } else { 1 }] }
    }

    /// Whether a light path's vertex at `depth` leaves photons.
    #[inline]
    pub fn light_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[0]
    }

    /// Whether an eye path's vertex at `depth` merges photons.
    #[inline]
    pub fn eye_merges(&self, depth: u32) -> bool {
        self.merge && depth >= self.first_merged[1]
    }

    /// The merge that weights count at an eye path's vertex at `depth`, if any; `clear`: all before it are delta.
    #[inline]
    pub fn eye_merge(&self, depth: u32, clear: bool) -> Merges {
        if self.eye_merges(depth) { one_merge(clear) } else { Merges::ZERO }
    }

    /// The merge that weights count at a light path's vertex at `depth`, if any: the eye path's vertex behind it is not delta.
    #[inline]
    pub fn light_merge(&self, depth: u32) -> Merges {
        if self.light_merges(depth) { one_merge(false) } else { Merges::ZERO }
    }
}

/// What the bidirectional paths of a render share.
#[derive(Clone, Copy)]
pub struct Bidirectional<'a> {
    /// Eye paths.
    pub eye: Eye<'a>,
    /// The solids around the lights.
    pub surroundings: &'a Surroundings,
    /// What finds paths.
    pub strategies: Strategies,
    /// Light paths connected to the camera for every eye path of a pixel.
    pub light_paths: f32,
    /// Light paths of a pass whose photons are merged.
    pub merged_paths: f32,
}

impl Bidirectional<'_> {
    /// Number of pixels.
    #[inline]
    pub fn pixels(&self) -> f32 {
        let (width, height) = self.eye.camera.size();
        width as f32 * height as f32
    }
}

/// Which strategy found a path; `light` and `eye` are depths of the last vertices of the two walks it was put together from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Technique {
    /// The eye path ran into a light with its segment number `eye`.
    Hit {
        /// See above.
        eye: u32,
    },
    /// Next-event estimation.
    NextEvent {
        /// See above.
        eye: u32,
    },
    /// Two vertices connected.
    Connect {
        /// See above.
        light: u32,
        /// See above.
        eye: u32,
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
        eye: u32,
    },
}

/// Looks over the shoulder of the walks: for pictures per technique, and for tests. `()` costs nothing.
pub trait Record {
    /// `technique` has found light: `value` unweighted (without visibility), `from` the point connected to or merged, and the ratios its
    /// weight comes from.
    #[inline]
    fn contribution(&mut self, technique: Technique, value: Rgb, from: Vec3, ratios: Ratios) {
        let _ = (technique, value, from, ratios);
    }

    /// `technique` brings light to the eye path's own pixel: on a `level`, `value` unweighted, with visibility and kernel, and its weight.
    /// Depths count from 1, also for light from infinity.
    #[inline]
    fn arrival(&mut self, technique: Technique, level: usize, value: Rgb, weight: f32) {
        let _ = (technique, level, value, weight);
    }
}

impl Record for () {}

/// How a light path's vertex scatters.
// Boxing the large variant would allocate once per vertex.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Scatterer<'s> {
    /// A surface.
    Surface(Surface, Shading<'s>),
    /// A point of a medium.
    Medium(Vec3, HenyeyGreenstein),
}

/// A light path's vertex that eye vertices can be connected to.
#[derive(Clone, Copy, Debug)]
pub struct LightVertex<'s> {
    /// Where and how it scatters.
    pub scatterer: Scatterer<'s>,
    /// Unit direction towards where the light came from.
    pub wo: Vec3,
    /// Flux (W) of the path as if it were the only one.
    pub throughput: Rgb,
    /// Number of segments up to here.
    pub depth: u32,
    /// Partial sums of the weights.
    pub mis: MisState,
    /// What has happened on the way here.
    pub beam: LightPrefix,
    /// The path has taken a wavelength, the one its eye path takes if it does.
    pub dispersed: bool,
}

impl LightVertex<'_> {
    /// World position.
    #[inline]
    pub fn p(&self) -> Vec3 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => surface.p,
            Scatterer::Medium(p, _) => *p,
        }
    }

    /// Whether it is in a medium.
    #[inline]
    pub fn in_medium(&self) -> bool {
        matches!(self.scatterer, Scatterer::Medium(..))
    }

    /// Where a shadow ray that comes against `w` ends.
    #[inline]
    pub fn spawn(&self, w: Vec3) -> Vec3 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => surface.spawn(w),
            Scatterer::Medium(p, _) => *p,
        }
    }

    /// The surface it is on, if others lie on that.
    #[inline]
    pub fn touching(&self) -> Option<Place> {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => Place::touching(surface),
            Scatterer::Medium(..) => None,
        }
    }

    /// Geometric cosine of a direction; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => w.dot(surface.ng).abs(),
            Scatterer::Medium(..) => 1.0,
        }
    }

    /// Its lobes that are not delta.
    #[inline]
    pub fn smooth(&self) -> LobeSet {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.bsdf.lobes() & LobeSet::SMOOTH,
            Scatterer::Medium(..) => LobeSet::BROAD,
        }
    }

    /// Scattering of its light into `wi` times the cosine, and the density of drawing `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3) -> (Rgb, f32) {
        self.evaluate_set_cos(wi, LobeSet::ALL)
    }

    /// The same of some lobes; a medium has but one.
    #[inline]
    pub fn evaluate_set_cos(&self, wi: Vec3, set: LobeSet) -> (Rgb, f32) {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.evaluate_cos(wi, Transport::Importance, set),
            Scatterer::Medium(_, phase) => {
                let f = phase.pdf_w(self.wo, wi);
                (Rgb::splat(f), f)
            }
        }
    }

    /// Density with which an eye path that comes along `wi` would go back along the light path.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.reverse_pdf(wi, Transport::Radiance, LobeSet::ALL),
            Scatterer::Medium(_, phase) => phase.pdf_w(self.wo, wi),
        }
    }
}

/// What decides which class the light of an eye path is of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trail {
    /// What has happened up to the last vertex.
    pub sight: EyeSuffix,
    /// Lobes of the last vertex; `None` in a medium.
    lobes: Option<LobeSet>,
    /// Length of the path so far.
    pub length: f32,
    /// All vertices scattered by delta lobes.
    pub delta: bool,
}

impl Trail {
    pub const START: Trail = Trail { sight: EyeSuffix::START, lobes: None, length: 0.0, delta: true };

    /// The last vertex sent the path on by `lobe`.
    #[inline]
    pub fn scattered(&mut self, lobe: LobeSet) {
        self.delta &= lobe == LobeSet::DELTA;
        self.sight = self.sight.then(Event::by(lobe, self.lobes));
    }

    /// No vertex before this one scatters but by mirrors and clear glass.
    #[inline]
    pub fn is_clear(&self) -> bool {
        self.sight.is_clear()
    }

    /// Leaves a vertex with some lobes; `None`: in a medium.
    #[inline]
    pub fn leave(&mut self, lobes: Option<LobeSet>) {
        self.lobes = lobes;
    }

    /// Whether going on from the last vertex can come to light of a class that is wanted.
    #[inline]
    pub fn leads(&self, on: ClassSet) -> bool {
        on.is_all()
            || match self.lobes {
                None => !(self.sight.then(Event::Medium).ahead() & on).is_empty(),
                Some(lobes) => leads(self.sight, lobes, lobes, on),
            }
    }
}

/// Bandwidths of the levels of one eye path, ascending, with their etas.
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
