//! Vertices of a path, and who receives them.

use super::interior::Interior;
use super::pass_through::PassThroughHit;
use super::roulette::survival;
use super::segment::MediumArrival;
use crate::bsdf::{BsdfSample, LobeSet, Shading};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec3};
use crate::medium::{FlightDensity, HenyeyGreenstein};
use crate::random::Draws;
use crate::scene::Scene;
use crate::spectrum::Wavelength;

/// A vertex of a path on a surface. What it refers to by `'a` outlives the walk.
pub struct Vertex<'v, 'a> {
    /// The surface.
    pub surface: &'v Surface,
    /// How it scatters, seen along `wo`.
    pub shading: &'v Shading<'a>,
    /// Unit direction back along the path.
    pub wo: Vec3,
    /// Weight of the path up to here, before this vertex scatters.
    pub throughput: Rgb,
    /// Number of segments up to here: 1 at the first surface.
    pub depth: u32,
    /// Length of the last segment.
    pub distance: f32,
    /// Origin of the last segment.
    pub from: Vec3,
    /// The solids the path is in on the side of `wo`.
    pub interior: Interior,
    /// The solids behind the surface.
    pub interior_behind: Interior,
    /// Random numbers of this vertex.
    pub draws: Draws,
    /// Densities of the last segment's flight through media.
    pub flight: FlightDensity,
    /// The wavelength the path has taken, here at the latest; its weight is in the throughput.
    pub wavelength: Option<Wavelength>,
    pub(super) survival_scale: f32,
}

impl Vertex<'_, '_> {
    /// Probability that the walk goes on from here if the visitor asks for the lobes of `set`. Known before a direction
    /// is drawn, so that MIS weights can use it.
    #[inline]
    pub fn survival(&self, set: LobeSet) -> f32 {
        self.survival_chosen(set, 1.0)
    }

    /// The same if the visitor chooses these lobes with probability `chance`.
    #[inline]
    pub fn survival_chosen(&self, set: LobeSet, chance: f32) -> f32 {
        let expected = (self.throughput * self.shading.albedo(set)).max_element() * self.survival_scale / chance;
        survival(expected, self.depth, || self.shading.bsdf.lobes() & set == LobeSet::DELTA)
    }
}

/// A vertex of a path in a medium.
pub struct MediumVertex {
    /// What the walk has met.
    pub arrival: MediumArrival,
    /// Unit direction back along the path.
    pub wo: Vec3,
    /// Weight of the path up to here, the scattering coefficient included: what is left is to multiply by the phase
    /// function.
    pub throughput: Rgb,
    /// The same without the scattering coefficient: radiance that arrives, or flux times length for light paths.
    pub arriving: Rgb,
    /// Number of segments up to here.
    pub depth: u32,
    /// Origin of the last segment.
    pub from: Vec3,
    /// Random numbers of this vertex.
    pub draws: Draws,
    /// Densities of the last segment's flight.
    pub flight: FlightDensity,
    /// Share of the light that the medium takes from rays through all of it; 1 where chance has brought the path here.
    pub opacity: f32,
    /// Share of next-event estimation that is this vertex's, where another is drawn for it (`flight.rs`).
    pub next_event: f32,
    /// The wavelength the path has taken.
    pub wavelength: Option<Wavelength>,
    pub(super) survival_scale: f32,
}

impl MediumVertex {
    /// Where it scatters to.
    #[inline]
    pub fn phase(&self) -> HenyeyGreenstein {
        self.arrival.medium.phase()
    }

    /// Share of light that is scattered, not absorbed.
    pub fn albedo(&self) -> Rgb {
        let sigma_t = self.arrival.medium.sigma_t();
        Rgb::select(sigma_t.cmpgt(Rgb::ZERO), self.arrival.medium.sigma_s / sigma_t, Rgb::ZERO)
    }

    /// Which medium this is: the index of its material, or `u32::MAX` for the one that fills the scene.
    #[inline]
    pub fn medium_id(&self, scene: &Scene) -> u32 {
        self.arrival.interior.material(scene).unwrap_or(u32::MAX)
    }
}

/// How the last vertex sent the path here.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Class of the lobe.
    pub lobe: LobeSet,
    /// Density per solid angle of the direction, times the probability that the path went on and was not scattered by a
    /// medium on its way; for a delta lobe meaningless.
    pub pdf_w: f32,
}

/// What a visitor wants next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// End the path.
    Stop,
    /// Go on with a direction from these lobes.
    Continue(LobeSet),
    /// Go on with a direction from these lobes, which were chosen from several sets with this probability.
    Choose(LobeSet, f32),
}

/// Receives the vertices of a walk.
pub trait Visitor<'a> {
    /// Share of its first weight down to which a path is spared roulette (but for what is trapped); below it goes on
    /// with the probability of what it has left of that share.
    const SPARED: f32 = 1.0;
    /// The walk takes media by splitting (`flight.rs`) and does not scatter at their vertices.
    const SPLITS: bool = false;
    /// A vertex; `scattered` is how the vertex before sent the path here (`None` at the first).
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next;
    /// A lamp without a body on the way to the next vertex, of walks from the eye.
    #[inline]
    fn pass_through_light(&mut self, hit: &PassThroughHit, scattered: Option<Scattered>) {
        let _ = (hit, scattered);
    }
    /// As [`Visitor::surface`], in a medium that scatters. A walk that splits goes on whatever the answer.
    fn medium(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) -> Next {
        let _ = (vertex, scattered);
        Next::Stop
    }
    /// A second vertex in the same medium, of a walk that splits, at which nothing but its share of next-event
    /// estimation is to be measured.
    #[inline]
    fn medium_next_event(&mut self, vertex: &MediumVertex, scattered: Option<Scattered>) {
        let _ = (vertex, scattered);
    }
    /// `sample` is drawn at `vertex`, and the path goes on.
    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_, 'a>, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// As [`Visitor::scatter`], in a medium.
    #[inline]
    fn scatter_medium(&mut self, vertex: &MediumVertex, sample: &BsdfSample) {
        let _ = (vertex, sample);
    }
    /// The path has ended because its weight is not finite.
    fn lost(&mut self) {}
    /// The path leaves the scene along `direction` with weight `throughput`; `flight`: densities of its way to
    /// infinity.
    fn escape(&mut self, direction: Vec3, throughput: Rgb, scattered: Option<Scattered>, flight: FlightDensity) {
        let _ = (direction, throughput, scattered, flight);
    }
}
