//! How walks take media: by chance, or by splitting.
//!
//! A walk by chance ([`Fly`]) draws where it is scattered and is there or goes past: paths as long as they come. A walk that splits
//! ([`Split`]) shows its visitor one vertex in every medium on its way and goes on to the surface behind, attenuated. Such a vertex is measured,
//! not scattered from; it suits eye paths that gather, for which a vertex in a medium is an end.

use super::segment::{MediumArrival, Passage, Span, Through};
use super::site::MediumVertex;
use super::walk::{Scattered, Visitor};
use crate::math::{Rgb, Vec3};
use crate::medium::{Collision, Fate, Flight};
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::spectrum::Wavelength;

fn arrival(scene: &Scene, span: &Span<'_>, collision: Collision) -> MediumArrival {
    let p = span.origin + span.direction * collision.distance;
    MediumArrival {
        p,
        medium: *span.medium,
        interior: *span.interior,
        weight: span.left * collision.weight,
        distance: span.before + collision.distance,
        first: span.first_hit(scene, p),
    }
}

/// Free flight.
pub(super) struct Fly<'a> {
    pub scene: &'a Scene,
    /// What the ray carried when it started.
    pub throughput: Rgb,
    pub draws: Draws,
    /// The ray starts at a vertex of a medium.
    pub from_medium: bool,
    /// It has come from infinity already when it starts.
    pub from_infinity: bool,
    /// Densities up to where it is.
    pub flight: Flight,
}

impl Through for Fly<'_> {
    #[inline]
    fn pass(&mut self, span: &Span<'_>) -> Passage {
        let medium = span.medium;
        if !medium.scatters() {
            return Passage::Left(medium.transmittance(span.distance));
        }
        let first = span.crossed == 0;
        let starts = first && self.from_medium;
        let far = |distance| if first && self.from_infinity { f32::INFINITY } else { distance };
        let u = self.draws.nth(span.crossed).two(Purpose::Flight);
        match medium.fly(self.throughput * span.left, span.distance, u) {
            Fate::Passed(weight) => {
                self.flight = self.flight.through(medium, far(span.distance), starts, false);
                Passage::Left(weight)
            }
            Fate::Collided(collision) => {
                self.flight = self.flight.through(medium, far(collision.distance), starts, true);
                Passage::Ended(arrival(self.scene, span, collision))
            }
        }
    }
}

/// Splitting.
pub(super) struct Split<'a, V> {
    pub scene: &'a Scene,
    pub visitor: &'a mut V,
    pub throughput: Rgb,
    pub draws: Draws,
    pub depth: u32,
    pub scattered: Option<Scattered>,
    pub from: Vec3,
    pub wavelength: Option<Wavelength>,
    pub survival_scale: f32,
}

impl<'a, V: Visitor<'a>> Through for Split<'_, V> {
    #[inline]
    fn pass(&mut self, span: &Span<'_>) -> Passage {
        let left = span.medium.transmittance(span.distance);
        // One for the point, the others for what is measured there; the surface behind has draws of its own.
        let draws = self.draws.nth(span.crossed);
        let carried = self.throughput * span.left;
        if span.medium.scatters()
            && let Some(collision) = span.medium.collide(carried, span.distance, draws.two(Purpose::Flight))
        {
            let met = arrival(self.scene, span, collision);
            let arriving = self.throughput * met.weight;
            let vertex = MediumVertex {
                wo: -span.direction,
                throughput: arriving * met.medium.sigma_s,
                arriving,
                depth: self.depth,
                from: self.from,
                draws,
                flight: Flight::FREE,
                opacity: 1.0 - left.element_sum() / 3.0,
                wavelength: self.wavelength,
                survival_scale: self.survival_scale,
                met,
            };
            self.visitor.medium(&vertex, self.scattered);
        }
        Passage::Left(left)
    }
}
