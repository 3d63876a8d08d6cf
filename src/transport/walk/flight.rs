//! How walks cross media: by random collisions, or by splitting.
//!
//! A walk with collisions ([`Fly`]) samples the point where a medium scatters it, and continues from there. A walk that
//! splits ([`Split`]) shows its visitor one vertex in every medium on its segment, and continues to the surface behind,
//! attenuated. The visitor samples light at such a vertex, but the walk does not scatter there. Gathering camera paths
//! split, because a vertex in a medium is their end.
//!
//! In a heterogeneous medium, [`Fly`] finds collisions by delta tracking. [`Split`] samples its vertex from a piecewise
//! constant proxy of the density instead, whose distribution has a closed form, and estimates the transmittance up to
//! the vertex by ratio tracking (`src/medium/grid/ray.rs`).
//!
//! The vertex is sampled in proportion to the light that the medium scatters along the ray. This suits all light except
//! direct light of a nearby light, which falls off with the squared distance. Near a light, a second vertex samples
//! only direct light, uniformly in the angle as seen from the light ([`Equiangular`]). Both vertices share next-event
//! estimation by the balance heuristic. They use the same random numbers, hence the same point of the light. Given
//! these numbers both densities are known and the shares sum to one, so the estimate is unbiased however lights are
//! chosen.

use super::direct::balance;
use super::segment::{MediumArrival, Passage, Span, Through};
use super::vertex::{MediumVertex, Scattered, Visitor};
use crate::math::{Rgb, Vec3};
use crate::medium::{
    Collision, CollisionDistribution, Equiangular, FlightDensity, FlightOutcome, GridFlight, GridRay, Proxy,
};
use crate::random::{Draws, HashSequence, Purpose, mix};
use crate::scene::Scene;
use crate::spectrum::Wavelength;

/// The arrival at a collision in a medium, where it has `density`: 1 if the medium is homogeneous.
fn arrival(scene: &Scene, span: &Span, collision: Collision, density: Option<f32>) -> MediumArrival {
    let p = span.origin + span.direction * collision.distance;
    MediumArrival {
        p,
        medium: density.map_or(span.medium, |density| span.medium.scaled(density)),
        interior: span.interior,
        weight: span.left * collision.weight,
        distance: span.before + collision.distance,
        first: span.first_hit(scene, p),
    }
}

/// Crosses media with random collisions: a medium may scatter the ray at a sampled point.
pub(in crate::transport) struct Fly<'a> {
    pub scene: &'a Scene,
    /// Throughput of the path at the start of the ray.
    pub throughput: Rgb,
    pub draws: Draws,
    /// Whether the ray starts at a vertex in a medium.
    pub from_medium: bool,
    /// Whether the ray comes from a light at infinity.
    pub from_infinity: bool,
    /// Probability densities of the flight through media so far, in both directions.
    pub flight: FlightDensity,
}

impl Through for Fly<'_> {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        let medium = &span.medium;
        if let Some(ray) = span.grid_ray(self.scene) {
            return self.pass_grid(span, &ray);
        }
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
                Passage::Ended(arrival(self.scene, span, collision, None))
            }
        }
    }
}

impl Fly<'_> {
    /// [`Through::pass`] in a heterogeneous medium.
    #[cold]
    #[inline(never)]
    fn pass_grid(&mut self, span: &Span, ray: &GridRay<'_>) -> Passage {
        let medium = &span.medium;
        let draws = self.draws.nth(span.crossed);
        let mut random = HashSequence::new(draws.bits(Purpose::Tracking));
        if !medium.scatters() {
            return Passage::Left(ray.transmittance(medium.sigma_t(), span.distance, &mut random));
        }
        let starts = span.crossed == 0 && self.from_medium;
        let throughput = self.throughput * span.left;
        match ray.sample_flight(medium, throughput, span.distance, draws.two(Purpose::Flight), &mut random) {
            GridFlight::Passed(weight) => {
                self.flight = ray.flight_density(self.flight, medium, span.distance, starts, false);
                Passage::Left(weight)
            }
            GridFlight::Collided { distance, weight, density } => {
                self.flight = ray.flight_density(self.flight, medium, distance, starts, true);
                Passage::Ended(arrival(self.scene, span, Collision { distance, weight }, Some(density)))
            }
        }
    }
}

/// Crosses media by splitting: the visitor gets one vertex in every medium, and the ray continues, attenuated, to the
/// surface behind.
pub(in crate::transport) struct Split<'a, V> {
    pub scene: &'a Scene,
    pub visitor: &'a mut V,
    pub throughput: Rgb,
    pub draws: Draws,
    pub depth: u32,
    pub scattered: Option<Scattered>,
    pub from: Vec3,
    pub wavelength: Option<Wavelength>,
    pub share: f32,
    pub survival_scale: f32,
}

impl<V> Split<'_, V> {
    /// Equiangular distribution along `span` as seen from the light point of next-event estimation; `None` unless the
    /// light is near or lights only a small part of the span. `mean_density` is the factor of the medium's coefficients.
    #[inline]
    fn near_light(&self, span: &Span, draws: &Draws, mean_density: f32) -> Option<Equiangular> {
        let (choice, point) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
        let (light, cone) = self.scene.lights.sample_point(choice, point)?;
        let lit = match cone {
            Some(cone) => cone.within(span.origin, span.direction, span.distance)?,
            None => [0.0, span.distance],
        };
        let seen = Equiangular::new(span.origin, span.direction, lit, light)?;
        // Most light comes from within one mean free path.
        let length = span.distance.min(3.0 / (mean_density * span.medium.sigma_t().element_sum()));
        (seen.is_near(length) || seen.is_short(length)).then_some(seen)
    }

    /// The medium vertex for the collision `at`, where the medium has the density `at.1`; [`MediumVertex`] explains
    /// `opacity` and `next_event`.
    #[inline]
    fn vertex(
        &self,
        span: &Span,
        at: (Collision, Option<f32>),
        draws: Draws,
        opacity: f32,
        next_event: f32,
    ) -> MediumVertex {
        let met = arrival(self.scene, span, at.0, at.1);
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
            share: self.share,
            survival_scale: self.survival_scale,
            arrival: met,
        }
    }
}

impl<'a, V: Visitor<'a>> Through for Split<'_, V> {
    #[inline]
    fn pass(&mut self, span: &Span) -> Passage {
        if let Some(ray) = span.grid_ray(self.scene) {
            return self.pass_grid(span, &ray);
        }
        let left = span.medium.transmittance(span.distance);
        if !span.medium.scatters() {
            return Passage::Left(left);
        }
        // One set of draws positions the vertices, the others sample light there; the surface behind has its own.
        let draws = self.draws.nth(span.crossed);
        if let Some(collisions) = span.medium.collision_distribution(self.throughput * span.left, span.distance) {
            let light = self.near_light(span, &draws, 1.0);
            let opacity = 1.0 - left.element_sum() / 3.0;
            if let Some(at) = collisions.sample(draws.two(Purpose::Flight)) {
                let by_angle = light.map_or(0.0, |light| light.pdf(at.distance));
                let share = balance(collisions.pdf(at.distance), by_angle);
                let vertex = self.vertex(span, (at, None), draws, opacity, share);
                self.visitor.medium(&vertex, self.scattered);
            }
            if let Some(light) = light
                && let Some(at) = collisions.sample_equiangular(&light, draws.one(Purpose::Equiangular))
            {
                let share = balance(light.pdf(at.distance), collisions.pdf(at.distance));
                let vertex = self.vertex(span, (at, None), draws, opacity, share);
                self.visitor.medium_next_event(&vertex, self.scattered);
            }
        }
        Passage::Left(left)
    }
}

/// Random numbers of the transmittance estimates of one span: up to the surface behind it, and up to each vertex.
const TO_END: u64 = 1;
const TO_VERTEX: u64 = 2;
const TO_EQUIANGULAR: u64 = 3;

impl<'a, V: Visitor<'a>> Split<'_, V> {
    /// [`Through::pass`] in a heterogeneous medium.
    #[cold]
    #[inline(never)]
    fn pass_grid(&mut self, span: &Span, ray: &GridRay<'_>) -> Passage {
        let (medium, draws) = (&span.medium, self.draws.nth(span.crossed));
        let bits = draws.bits(Purpose::Tracking);
        let transmittance = |distance: f32, of: u64| {
            ray.transmittance(medium.sigma_t(), distance, &mut HashSequence::new(mix(bits ^ of)))
        };
        let left = transmittance(span.distance, TO_END);
        let proxy = ray.proxy(span.distance);
        let depth = proxy.depth();
        if !medium.scatters() || depth <= 0.0 {
            return Passage::Left(left);
        }
        // The proxy is homogeneous over its depth.
        let Some(collisions) = medium.collision_distribution(self.throughput * span.left, depth) else {
            return Passage::Left(left);
        };
        let opacity = 1.0 - medium.transmittance(depth).element_sum() / 3.0;
        let light = self.near_light(span, &draws, depth / span.distance);
        let collision = |distance: f32, pdf: f32, of: u64| {
            let weight = transmittance(distance, of) / pdf;
            let density = ray.density(distance);
            // A point without density scatters nothing.
            let valid = density > 0.0 && distance.is_finite() && weight.is_finite();
            valid.then_some((Collision { distance, weight }, Some(density)))
        };
        let by_depth = collisions.sample_depth(draws.two(Purpose::Flight));
        if let Some((distance, density)) = proxy.distance(by_depth)
            && let pdf = pdf(&collisions, &proxy, distance).unwrap_or(collisions.pdf(by_depth) * density)
            && let Some(at) = collision(distance, pdf, TO_VERTEX)
        {
            let share = balance(pdf, light.map_or(0.0, |light| light.pdf(distance)));
            let vertex = self.vertex(span, at, draws, opacity, share);
            self.visitor.medium(&vertex, self.scattered);
        }
        if let Some(light) = light
            && let distance = light.sample_inside(draws.one(Purpose::Equiangular))
            && let Some(at) = collision(distance, light.pdf(distance), TO_EQUIANGULAR)
        {
            let share = balance(light.pdf(distance), pdf(&collisions, &proxy, distance).unwrap_or(0.0));
            let vertex = self.vertex(span, at, draws, opacity, share);
            self.visitor.medium_next_event(&vertex, self.scattered);
        }
        Passage::Left(left)
    }
}

/// Density per length (1/m) with which a point of the proxy is sampled at `distance`; `None` where it has no density.
fn pdf(collisions: &CollisionDistribution<'_>, proxy: &Proxy, distance: f32) -> Option<f32> {
    proxy.at(distance).map(|(depth, density)| collisions.pdf(depth) * density)
}
