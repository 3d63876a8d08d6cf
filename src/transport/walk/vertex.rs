//! Vertices of a path, and the visitor that receives them.

use super::Segment;
use super::interior::{Interior, Presence};
use super::pass_through::{BulbHit, PassThroughHit};
use super::pixel_sample::Features;
use super::roulette::survival;
use super::segment::MediumArrival;
use crate::bsdf::{BsdfSample, LobeSet, Shading};
use crate::geometry::Surface;
use crate::material::Alpha;
use crate::math::{Rgb, Vec3};
use crate::medium::{FlightDensity, HenyeyGreenstein};
use crate::random::Draws;
use crate::scene::Scene;
use crate::spectrum::Wavelength;
use crate::stop::Stop;

/// A vertex of a path on a surface. References with lifetime `'a` outlive the walk.
pub struct Vertex<'v, 'a> {
    /// The surface point of the vertex.
    pub surface: &'v Surface,
    /// The BSDF, for light scattered towards `wo`.
    pub shading: &'v Shading<'a>,
    /// Unit direction back along the path, to the previous vertex.
    pub wo: Vec3,
    /// Throughput of the path before this vertex scatters.
    pub throughput: Rgb,
    /// Number of path segments up to this vertex: 1 at the first surface.
    pub depth: u32,
    /// Length of the path segment that ends here (scene units).
    pub distance: f32,
    /// Origin of the path segment that ends here.
    pub from: Vec3,
    /// The solids around the path before the surface, on the side of `wo`.
    pub interior: Interior,
    /// The solids on the other side of the surface.
    pub interior_behind: Interior,
    /// Random numbers for the decisions at this vertex.
    pub draws: Draws,
    /// Probability densities of flight through media on the segment that ends here, in both directions.
    pub flight: FlightDensity,
    /// The wavelength of the path; `None` if it has not met dispersive glass (this vertex included). The throughput
    /// contains its weight.
    pub wavelength: Option<Wavelength>,
    /// Share of this branch in a path that has been split: its probability without splits, over its probability with
    /// them. 1 if no split has happened.
    pub share: f32,
    pub(in crate::transport) survival_scale: f32,
}

impl Vertex<'_, '_> {
    /// The G-buffer of this vertex, at the end of a camera path of this length (scene units).
    pub(in crate::transport) fn features(&self, length: f32) -> Features {
        let n = self.shading.frame.n;
        Features {
            albedo: self.shading.albedo(LobeSet::ALL),
            normal: if n.dot(self.wo) < 0.0 { -n } else { n },
            depth: length,
            share: 1.0,
        }
    }

    /// What alpha has decided about the solids on both sides of the surface.
    #[inline(always)]
    pub fn presence(&self, scene: &Scene) -> Presence {
        Presence::at_surface(scene, [&self.interior, &self.interior_behind])
    }

    /// What alpha has decided for the path to end here: about the solids around, and about the hit. A light path and a camera
    /// path that meet at a surface have both decided it, and light counts it once.
    #[inline(always)]
    pub fn meeting(&self, scene: &Scene) -> Presence {
        if !scene.survey.alpha {
            return Presence::CERTAIN;
        }
        let Presence { absent, chance } = self.presence(scene);
        let material = &scene.materials.list[self.surface.material as usize];
        let hit = match material.alpha_per_hit() {
            Alpha::Blend => material.coverage(self.surface, &scene.materials.textures),
            Alpha::Opaque | Alpha::Mask(_) => 1.0,
        };
        Presence { absent, chance: chance * hit }
    }

    /// Probability that roulette lets the path continue if the visitor asks for the lobes in `set`. It does not depend
    /// on the sampled direction, so MIS weights can use it.
    #[inline]
    pub fn survival(&self, set: LobeSet) -> f32 {
        self.survival_chosen(set, 1.0)
    }

    /// Probability that roulette lets the path continue, if the visitor chooses the lobes in `set` among several sets
    /// with probability `chance`.
    #[inline]
    pub fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32 {
        let expected = (self.throughput * self.shading.albedo(set)).max_element() * self.survival_scale / chance;
        survival(expected, self.depth, || self.shading.bsdf.lobes() & set == LobeSet::DELTA)
    }
}

/// A vertex of a path in a medium.
pub struct MediumVertex {
    /// Position and medium of the vertex.
    pub arrival: MediumArrival,
    /// Unit direction back along the path, to the previous vertex.
    pub wo: Vec3,
    /// Throughput of the path times the scattering coefficient; the phase function is the remaining factor.
    pub throughput: Rgb,
    /// Throughput without the scattering coefficient: arriving radiance, or flux times length for light paths.
    pub arriving: Rgb,
    /// Number of path segments up to this vertex.
    pub depth: u32,
    /// Origin of the path segment that ends here.
    pub from: Vec3,
    /// Random numbers for the decisions at this vertex.
    pub draws: Draws,
    /// Probability densities of flight through media on the segment that ends here, in both directions.
    pub flight: FlightDensity,
    /// Fraction of light that the medium removes along its whole part of the ray, for walks that pass every medium with
    /// one vertex in it; 1 for sampled collisions.
    pub opacity: f32,
    /// MIS weight (0 to 1) of next-event estimation at this vertex, where a second vertex is sampled for it
    /// (`flight.rs`).
    pub next_event: f32,
    /// The wavelength of the path; `None` if it has not met dispersive glass.
    pub wavelength: Option<Wavelength>,
    /// Share of this branch in a path that has been split, as [`Vertex::share`].
    pub share: f32,
    pub(in crate::transport) survival_scale: f32,
}

impl MediumVertex {
    /// The phase function of the medium.
    #[inline]
    pub fn phase(&self) -> HenyeyGreenstein {
        self.arrival.medium.phase()
    }

    /// Single-scattering albedo of the medium.
    pub fn albedo(&self) -> Rgb {
        let sigma_t = self.arrival.medium.sigma_t();
        Rgb::select(sigma_t.cmpgt(Rgb::ZERO), self.arrival.medium.sigma_s / sigma_t, Rgb::ZERO)
    }

    /// What alpha has decided about the solids around the vertex.
    #[inline(always)]
    pub fn presence(&self, scene: &Scene) -> Presence {
        Presence::of(scene, &self.arrival.interior)
    }

    /// Identifier of the medium ([`Interior::medium_id`]).
    #[inline]
    pub fn medium_id(&self, scene: &Scene) -> u32 {
        self.arrival.interior.medium_id(scene)
    }
}

/// Light that a medium emits along a segment of a camera path.
pub struct MediumLight {
    /// Index of the instance (the object) with the medium.
    pub instance: u32,
    /// A point of the medium on the segment.
    pub p: Vec3,
    /// Light that arrives at the camera, with the throughput of the path.
    pub light: Rgb,
    /// Number of path segments up to the light.
    pub depth: u32,
}

/// How the previous vertex scattered the path.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// The lobe of the BSDF that scattered the path.
    pub lobe: LobeSet,
    /// Density of the direction per solid angle, times the probabilities that roulette let the path continue and that
    /// no medium scattered it on the segment. Undefined for delta lobes.
    pub pdf_w: f32,
}

/// Decision of a [`Visitor`] how the path continues after a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// End the path.
    Stop,
    /// Continue in a direction sampled from these lobes.
    Continue(LobeSet),
    /// Continue in a direction sampled from these lobes, which were chosen among several sets with this probability.
    Choose(LobeSet, f32),
}

/// Receives the vertices of a walk, which traces one path, and decides how the path continues. Each rendering algorithm
/// is a visitor.
pub trait Visitor<'a>: Sized {
    /// Whether the walk splits at media (`flight.rs`): it shows one vertex in every medium and continues to the surface
    /// behind without scattering there.
    const SPLITS: bool = false;
    /// Whether paths may split: [`Visitor::splits`] may be above 0.
    const BRANCHES: bool = false;
    /// Whether the path finds the lights with shadow linking behind objects that do not block their light
    /// (`pass_through.rs`), and ignores them where it hits them otherwise, except from the camera.
    const SHADOW_LINKS: bool = false;
    /// Fraction of the initial throughput down to which roulette does not end a path (except trapped light). Below it,
    /// a path survives with probability throughput over that fraction.
    #[inline]
    fn spared(&self) -> f32 {
        1.0
    }
    /// Number of smooth interfaces at which one path may be split into reflection and transmission. Only the first vertices of a
    /// path split, as long as all its lobes are delta lobes.
    #[inline]
    fn splits(&self) -> u32 {
        0
    }
    /// The switch that ends paths early; `None` if there is none.
    #[inline]
    fn stop(&self) -> Option<&Stop> {
        None
    }
    /// Lets `follow` trace one branch of the path, and restores the visitor's state of the path afterwards. Visitors whose
    /// paths are split implement it.
    #[inline]
    fn branch(&mut self, follow: impl FnOnce(&mut Self)) {
        follow(self);
    }
    /// The path ends, or one of its branches, which has this share of the path ([`Vertex::share`]).
    #[inline]
    fn end(&mut self, share: f32) {
        let _ = share;
    }
    /// The path arrives at a surface vertex; the result decides how it continues. `scattered` describes the scattering
    /// at the previous vertex; `None` at the first.
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next;
    /// The segment to the next vertex crosses a pass-through light, which emits but does not block rays; camera paths
    /// only.
    #[inline]
    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        let _ = (hit, scattered);
    }
    /// The path follows a segment that does not start at the camera. Suns with shadow linking may shine along it
    /// through objects that do not block their light. Called if [`Visitor::SHADOW_LINKS`].
    #[inline]
    fn linked_suns(&mut self, segment: &Segment<'_>) {
        let _ = segment;
    }
    /// Whether [`Visitor::medium_light`] is to be called for the segment that the path follows now. `scattered`: how
    /// the path was scattered at the start of the segment; `None` at the start of the path.
    #[inline]
    fn sees_medium_light(&self, scattered: Option<Scattered>) -> bool {
        let _ = scattered;
        false
    }
    /// The medium on a part of the segment to the next surface emits light; camera paths only.
    #[inline]
    fn medium_light(&mut self, light: &MediumLight, scattered: Option<Scattered>) {
        let _ = (light, scattered);
    }
    /// The segment to the next vertex, which starts at the camera or at a delta lobe, crosses the bulb of a light; camera
    /// paths only. If all lobes on the path were delta lobes, no other technique finds this light; otherwise others do,
    /// and it must be ignored.
    #[inline]
    fn bulb(&mut self, hit: &BulbHit, scattered: Option<Scattered>) {
        let _ = (hit, scattered);
    }
    /// The path arrives at a vertex in a scattering medium; the result decides how it continues. A walk that splits
    /// ignores it.
    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        let _ = (vertex, scattered);
        Next::Stop
    }
    /// A walk that splits shows a second vertex in a medium, for which only next-event estimation, weighted by
    /// [`MediumVertex::next_event`], is to be added.
    #[inline]
    fn medium_next_event(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) {
        let _ = (vertex, scattered);
    }
    /// The path continues from the surface vertex `vertex` along `sample`.
    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// The path continues from `vertex`, which lies in a medium, along `sample`.
    #[inline]
    fn scatter_medium(&mut self, vertex: &MediumVertex, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// The path has ended because its throughput is not finite.
    fn lost(&mut self) {}
    /// The camera path ends at a holdout, a hole in the picture.
    fn hole(&mut self) {}
    /// The path leaves the scene along `direction`. `flight` has the probability densities of flight to infinity.
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, flight: FlightDensity) {
        let _ = (direction, throughput, scattered, flight);
    }
}
