//! Free flight: where on a ray a medium scatters, drawn with all three channels in mind.
//!
//! One channel is drawn and its distance of flight sampled; the density is that of the mixture over the channels, so
//! every channel has a share in every sample \[single-sample MIS with the balance heuristic, Veach 1997, 9.2.4;
//! "spectral MIS"\]. Channels are drawn in proportion to what they have to lose: then no weight makes the sum over
//! channels of a path's throughput grow, however often and however differently they scatter, and none can be starved,
//! for a sample's density is at least the channel's own.
//!
//! MIS between whole paths must know the densities of paths it has not walked, and cannot ask for the throughput they
//! would have had. It takes the even mixture of the channels in its place ([`FlightDensity`]): the weights still sum to one,
//! which is all that they must.

use super::{Equiangular, MediumParameters};
use crate::math::{Rgb, Vec2, is_lit};

/// A point on a ray at which a medium scatters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// Distance from the origin.
    pub distance: f32,
    /// Transmittance up to there, over the density per length of the point.
    pub weight: Rgb,
}

/// How a ray fares in a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FlightOutcome {
    /// It gets to the end, and what it carries is multiplied by this: transmittance over the probability of getting
    /// there.
    Passed(Rgb),
    /// It collides.
    Collided(Collision),
}

/// Least and strictly positive uniform number: no flight has length zero.
const HALF_STEP: f32 = 0.5 / 16_777_216.0;

impl MediumParameters {
    /// Draws how a ray of `throughput` fares on the next `distance` (maybe infinite). `u` is uniform on the unit
    /// square.
    #[inline]
    pub fn sample_flight(&self, throughput: Rgb, distance: f32, u: Vec2) -> FlightOutcome {
        let sigma = self.sigma_t();
        let share = shares(throughput);
        let drawn = pick(sigma, share, u.x);
        let t = if drawn > 0.0 { -(1.0 - (u.y + HALF_STEP)).ln() / drawn } else { f32::INFINITY };
        if t < distance {
            let left = self.transmittance(t);
            FlightOutcome::Collided(Collision { distance: t, weight: left / (share * sigma * left).element_sum() })
        } else {
            let left = self.transmittance(distance);
            FlightOutcome::Passed(left / (share * left).element_sum())
        }
    }

    /// The points of the next `distance` (maybe infinite) at which a ray of `throughput` is scattered, as if it had to
    /// be. `None` where nothing is scattered.
    #[inline]
    pub fn collision_distribution(&self, throughput: Rgb, distance: f32) -> Option<CollisionDistribution<'_>> {
        let sigma = self.sigma_t();
        // Share of each channel that is scattered on the way; -expm1 keeps thin media exact.
        let lost = -(-sigma * distance).map(exp_m1);
        let lost = Rgb::select(sigma.cmpgt(Rgb::ZERO), lost, Rgb::ZERO);
        let albedo = Rgb::select(sigma.cmpgt(Rgb::ZERO), self.sigma_s / sigma, Rgb::ZERO);
        let scattered = throughput * albedo * lost;
        is_lit(scattered).then(|| CollisionDistribution { medium: self, distance, lost, share: shares(scattered) })
    }
}

/// Points of a ray at which a medium scatters it, distributed as the light is that is scattered there.
#[derive(Clone, Copy, Debug)]
pub struct CollisionDistribution<'m> {
    medium: &'m MediumParameters,
    /// Length of the way.
    distance: f32,
    /// Share of each channel that is taken on the way.
    lost: Rgb,
    /// Probabilities of the channels.
    share: Rgb,
}

impl CollisionDistribution<'_> {
    /// Draws one.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<Collision> {
        let drawn = pick(self.medium.sigma_t(), self.share, u.x);
        let within = pick(self.lost, self.share, u.x);
        let t = -(-(u.y + HALF_STEP) * within).ln_1p() / drawn;
        let t = t.min(self.distance);
        self.at(t, self.pdf(t))
    }

    /// Draws one by the angle as seen from a lamp.
    #[inline]
    pub fn sample_equiangular(&self, lamp: &Equiangular, u: f32) -> Option<Collision> {
        let t = lamp.sample(u + HALF_STEP).min(self.distance);
        self.at(t, lamp.pdf(t))
    }

    #[inline]
    fn at(&self, distance: f32, pdf: f32) -> Option<Collision> {
        let weight = self.medium.transmittance(distance) / pdf;
        (distance.is_finite() && weight.is_finite()).then_some(Collision { distance, weight })
    }

    /// Density per length with which [`CollisionDistribution::sample`] draws `distance`.
    #[inline]
    pub fn pdf(&self, distance: f32) -> f32 {
        // Densities of the channels, each cut off at the end of the ray.
        let left = self.medium.transmittance(distance);
        let density = self.medium.sigma_t() * left / self.lost;
        let density = Rgb::select(self.lost.cmpgt(Rgb::ZERO), density, Rgb::ZERO);
        (self.share * density).element_sum()
    }
}

fn exp_m1(x: f32) -> f32 {
    x.exp_m1()
}

/// Probabilities of the channels in proportion to `of`; even where there is nothing to go by.
#[inline]
fn shares(of: Rgb) -> Rgb {
    let sum = of.element_sum();
    if sum > 0.0 && sum.is_finite() { of / sum } else { Rgb::splat(1.0 / 3.0) }
}

/// The channel's entry in `of` that `u` draws.
#[inline]
fn pick(of: Rgb, share: Rgb, u: f32) -> f32 {
    // The last channel that can be drawn takes what rounding leaves.
    if u < share.x || share.y + share.z <= 0.0 {
        of.x
    } else if u < share.x + share.y || share.z <= 0.0 {
        of.y
    } else {
        of.z
    }
}

/// Densities of flight along one segment, both ways, with the even mixture of the channels: per length where the end it
/// flies to lies in a scattering medium, else the probability of getting there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightDensity {
    /// From the start to the end.
    pub forward: f32,
    /// From the end to the start.
    pub reverse: f32,
}

impl FlightDensity {
    /// Nothing on the way scatters.
    pub const ONE: FlightDensity = FlightDensity { forward: 1.0, reverse: 1.0 };

    /// Goes on through `distance` of `medium`. `starts`, `ends`: the segment starts or ends in here, at a vertex of the
    /// medium.
    #[must_use]
    #[inline]
    pub fn through(self, medium: &MediumParameters, distance: f32, starts: bool, ends: bool) -> FlightDensity {
        if !medium.scatters() {
            return self;
        }
        let left = medium.transmittance(distance);
        let pass = left.element_sum() / 3.0;
        let stop = (medium.sigma_t() * left).element_sum() / 3.0;
        FlightDensity {
            forward: self.forward * if ends { stop } else { pass },
            reverse: self.reverse * if starts { stop } else { pass },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::random::{Domain, Purpose, Stream};

    const DRAWS: u64 = 400_000;

    fn media() -> [MediumParameters; 3] {
        let medium = |a: [f32; 3], s: [f32; 3]| MediumParameters { sigma_a: a.into(), sigma_s: s.into(), g: 0.0 };
        [
            medium([0.1; 3], [0.9; 3]),
            // One channel flies freely, one is opaque.
            medium([0.0, 0.0, 30.0], [0.3, 0.0, 10.0]),
            medium([0.5, 1e-3, 0.0], [4.0, 0.0, 1e-3]),
        ]
    }

    /// Means over draws of both outcomes of a flight against their closed forms, per channel: passing gives the
    /// transmittance, colliding (with `f(t) = t`, so that distances count) the integral of `t T(t)`, however points are
    /// drawn, when both ways share it, and when one of them draws on a part of the ray only. Returns the largest
    /// deviation in standard errors.
    fn flight_error(bug: impl Fn(Collision, Rgb) -> Rgb) -> f64 {
        let mut worst = 0.0f64;
        let lamp = Vec3::new(0.1, 0.4, 0.0);
        for (at, medium) in media().into_iter().enumerate() {
            for (distance, throughput) in [(0.7f32, Rgb::ONE), (2.0, Rgb::new(1.0, 5.0, 0.2))] {
                // By channel, and by kind of value: the sum, and that of squares.
                let mut sums = [[[0.0f64; 2]; 6]; 3];
                for i in 0..DRAWS {
                    let draws = Stream::new(31, at as u64, Domain::Test, i).vertex(0);
                    let mut values = [Rgb::ZERO; 6];
                    match medium.sample_flight(throughput, distance, draws.two(Purpose::Flight)) {
                        FlightOutcome::Passed(weight) => values[0] = weight,
                        FlightOutcome::Collided(hit) => {
                            assert!(hit.distance > 0.0 && hit.distance < distance);
                            values[1] = bug(hit, medium.sigma_t()) * hit.distance;
                        }
                    }
                    let Some(collisions) = medium.collision_distribution(throughput, distance) else {
                        panic!("it scatters")
                    };
                    let seen = |part| Equiangular::new(Vec3::ZERO, Vec3::X, part, lamp).expect("an angle");
                    let ways = [seen([0.0, distance]), seen([0.3 * distance, 0.5 * distance])];
                    let share = |lamp: &Equiangular, pdf: f32, at: f32| pdf / (collisions.pdf(at) + lamp.pdf(at));
                    if let Some(hit) = collisions.sample(draws.two(Purpose::Phase)) {
                        values[2] = bug(hit, medium.sigma_t()) * hit.distance;
                        for (lamp, shared) in ways.iter().zip([4, 5]) {
                            values[shared] += values[2] * share(lamp, collisions.pdf(hit.distance), hit.distance);
                        }
                    }
                    for (lamp, shared) in ways.iter().zip([4, 5]) {
                        if let Some(hit) = collisions.sample_equiangular(lamp, draws.one(Purpose::Equiangular)) {
                            let value = bug(hit, medium.sigma_t()) * hit.distance;
                            values[shared] += value * share(lamp, lamp.pdf(hit.distance), hit.distance);
                            if shared == 4 {
                                values[3] = value;
                            }
                        }
                    }
                    for (c, sums) in sums.iter_mut().enumerate() {
                        for (sum, value) in sums.iter_mut().zip(values) {
                            let x = f64::from(value[c]);
                            *sum = [sum[0] + x, sum[1] + x * x];
                        }
                    }
                }
                for (c, sums) in sums.iter().enumerate() {
                    let (sigma, d) = (f64::from(medium.sigma_t()[c]), f64::from(distance));
                    let left = (-sigma * d).exp();
                    let integral =
                        if sigma > 0.0 { (1.0 - left * (1.0 + sigma * d)) / (sigma * sigma) } else { 0.5 * d * d };
                    let scatters = medium.sigma_s[c] > 0.0;
                    for (kind, (expected, sum)) in
                        [left, integral, integral, integral, integral, integral].into_iter().zip(sums).enumerate()
                    {
                        // A channel that is not scattered need not be drawn: its weight is multiplied by zero.
                        if kind > 0 && !scatters {
                            continue;
                        }
                        let n = DRAWS as f64;
                        let mean = sum[0] / n;
                        let error = ((sum[1] / n - mean * mean) / n).sqrt();
                        worst = worst.max((mean - expected).abs() / (error + 1e-5 * expected));
                    }
                }
            }
        }
        worst
    }

    /// 5 sigma over 96 checks: false alarms below 6e-5. A density of the drawn channel alone is found.
    #[test]
    fn flights_are_unbiased_in_every_channel() {
        let right = flight_error(|hit, _| hit.weight);
        assert!(right < 5.0, "{right}");
        let wrong = flight_error(|hit, sigma| hit.weight * (1.0 + 0.02 * sigma * hit.distance));
        assert!(wrong > 5.0, "{wrong}");
    }

    /// However long a path and however different its channels, flights do not make the sum of its throughput grow.
    #[test]
    fn no_channel_runs_away() {
        let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::new(0.5, 2.0, 8.0), g: 0.0 };
        for i in 0..200 {
            let mut throughput = Rgb::ONE;
            for vertex in 0..50 {
                let u = Stream::new(2, 0, Domain::Test, i).vertex(vertex).two(Purpose::Flight);
                throughput *= match medium.sample_flight(throughput, 0.3, u) {
                    FlightOutcome::Passed(weight) => weight,
                    FlightOutcome::Collided(hit) => hit.weight * medium.sigma_s,
                };
                assert!(throughput.element_sum() < 3.001, "path {i}, vertex {vertex}: {throughput}");
            }
        }
    }

    #[test]
    fn densities_of_flight_compose() {
        let medium = media()[0];
        let whole = FlightDensity::ONE.through(&medium, 1.5, false, true);
        let parts = FlightDensity::ONE.through(&medium, 0.5, false, false).through(&medium, 1.0, false, true);
        assert!((whole.forward / parts.forward - 1.0).abs() < 1e-5);
        // Grey: T to a surface, sigma T to a vertex of the medium.
        assert!((whole.reverse - (-1.5f32).exp()).abs() < 1e-6 && (whole.forward - whole.reverse).abs() < 1e-6);
        let clear = MediumParameters { sigma_a: Rgb::ONE, ..MediumParameters::default() };
        assert_eq!(FlightDensity::ONE.through(&clear, 2.0, false, false), FlightDensity::ONE);
    }
}
