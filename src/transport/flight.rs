//! How walks take media: by chance, or by splitting.
//!
//! A walk by chance ([`Fly`]) draws where it is scattered and is there or goes past: paths as long as they come. A walk
//! that splits ([`Split`]) shows its visitor one vertex in every medium on its way and goes on to the surface behind,
//! attenuated. Such a vertex is measured, not scattered from; it suits camera paths that gather, for which a vertex in a
//! medium is an end.
//!
//! Such a vertex is drawn by how much of the ray is scattered where, as suits all light but that straight from a lamp
//! nearby, which falls off with the distance squared. Where one is near there is a second vertex for that alone, drawn
//! by the angle as seen from the lamp ([`Equiangular`]), and both share next-event estimation by the balance heuristic.
//! They share its random numbers, too, so the lamp's point is the same for both. Given these numbers both densities are
//! known, and the shares sum to one: nothing is biased, however lights are chosen.

use super::direct::balance;
use super::segment::{MediumArrival, Passage, Span, Through};
use super::vertex::{MediumVertex, Scattered, Visitor};
use crate::math::{Rgb, Vec3};
use crate::medium::{Collision, Equiangular, FlightDensity, FlightOutcome};
use crate::random::{Draws, Purpose};
use crate::scene::Scene;
use crate::spectrum::Wavelength;

fn arrival(scene: &Scene, span: &Span, collision: Collision) -> MediumArrival {
    let p = span.origin + span.direction * collision.distance;
    MediumArrival {
        p,
        medium: span.medium,
        interior: span.interior,
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
    pub flight: FlightDensity,
}

impl Through for Fly<'_> {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        let medium = &span.medium;
        if !medium.scatters() {
            return Passage::Left(medium.transmittance(span.distance));
        }
        let first = span.crossed == 0;
        let starts = first && self.from_medium;
        let far = |distance| if first && self.from_infinity { f32::INFINITY } else { distance };
        let u = self.draws.nth(span.crossed).two(Purpose::Flight);
        match medium.sample_flight(self.throughput * span.left, span.distance, u) {
            FlightOutcome::Passed(weight) => {
                self.flight = self.flight.through(medium, far(span.distance), starts, false);
                Passage::Left(weight)
            }
            FlightOutcome::Collided(collision) => {
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

impl<V> Split<'_, V> {
    /// The way as seen from the point of a light to which next-event estimation goes, if that is near or shines on
    /// little of it.
    #[inline]
    fn lamp(&self, span: &Span, draws: &Draws) -> Option<Equiangular> {
        let (choice, point) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
        let (lamp, cone) = self.scene.lights.sample_point(choice, point)?;
        let lit = match cone {
            Some(cone) => cone.within(span.origin, span.direction, span.distance)?,
            None => [0.0, span.distance],
        };
        let seen = Equiangular::new(span.origin, span.direction, lit, lamp)?;
        // Light comes from within a mean free path, mostly.
        let length = span.distance.min(3.0 / span.medium.sigma_t().element_sum());
        (seen.is_near(length) || seen.is_short(length)).then_some(seen)
    }

    /// A vertex on the way; see [`MediumVertex`] for `opacity` and `next_event`.
    #[inline]
    fn vertex(&self, span: &Span, at: Collision, draws: Draws, opacity: f32, next_event: f32) -> MediumVertex {
        let met = arrival(self.scene, span, at);
        let arriving = self.throughput * met.weight;
        MediumVertex {
            wo: -span.direction,
            throughput: arriving * met.medium.sigma_s,
            arriving,
            depth: self.depth,
            from: self.from,
            draws,
            flight: FlightDensity::ONE,
            opacity,
            next_event,
            wavelength: self.wavelength,
            survival_scale: self.survival_scale,
            arrival: met,
        }
    }
}

impl<'a, V: Visitor<'a>> Through for Split<'_, V> {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        let left = span.medium.transmittance(span.distance);
        if !span.medium.scatters() {
            return Passage::Left(left);
        }
        // One for the points, the others for what is measured there; the surface behind has draws of its own.
        let draws = self.draws.nth(span.crossed);
        if let Some(collisions) = span.medium.collision_distribution(self.throughput * span.left, span.distance) {
            let lamp = self.lamp(span, &draws);
            let opacity = 1.0 - left.element_sum() / 3.0;
            if let Some(at) = collisions.sample(draws.two(Purpose::Flight)) {
                let by_angle = lamp.map_or(0.0, |lamp| lamp.pdf(at.distance));
                let share = balance(collisions.pdf(at.distance), by_angle);
                let vertex = self.vertex(span, at, draws, opacity, share);
                self.visitor.medium(&vertex, self.scattered);
            }
            if let Some(lamp) = lamp
                && let Some(at) = collisions.sample_equiangular(&lamp, draws.one(Purpose::Equiangular))
            {
                let share = balance(lamp.pdf(at.distance), collisions.pdf(at.distance));
                let vertex = self.vertex(span, at, draws, opacity, share);
                self.visitor.medium_next_event(&vertex, self.scattered);
            }
        }
        Passage::Left(left)
    }
}
