//! Free-flight sampling in media with three colour channels.
//!
//! One channel is drawn, and a distance is sampled from its extinction coefficient. The density of the sample is the
//! mixture over all channels \[single-sample MIS with the balance heuristic, Veach 1997, 9.2.4; "spectral MIS"\].
//! Channels are drawn in proportion to their throughput. So the sum over channels of a path's throughput never grows,
//! and no channel gets a large weight.
//!
//! MIS weights of connected paths need the densities of paths that were not traced, whose throughput is unknown. They
//! use the mixture with equal probabilities of the channels ([`FlightDensity`]) instead. The weights still sum to one.

use super::{Equiangular, HALF_STEP, MediumParameters};
use crate::math::{Rgb, Vec2, is_lit};

/// A sampled collision of a ray with a medium: the point where the ray scatters or is absorbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// Distance from the origin of the ray (m).
    pub distance: f32,
    /// Transmittance up to the collision, over its density per length.
    pub weight: Rgb,
}

/// The outcome of free-flight sampling: whether the ray collides with the medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FlightOutcome {
    /// The ray reaches its end without a collision. The weight is the transmittance over the probability of this
    /// outcome.
    Passed(Rgb),
    /// The ray collides with the medium.
    Collided(Collision),
}

impl MediumParameters {
    /// Samples the free flight in the medium of a ray with `throughput` over at most `distance` (m), which may be
    /// infinite. `u` is uniform on the unit square.
    #[inline]
    pub fn sample_flight(&self, throughput: Rgb, distance: f32, u: Vec2) -> FlightOutcome {
        let sigma = self.sigma_t();
        let share = shares(throughput);
        let sampled = sample_channel(sigma, share, u.x);
        let t = if sampled > 0.0 { -(1.0 - (u.y + HALF_STEP)).ln() / sampled } else { f32::INFINITY };
        if t < distance {
            let left = self.transmittance(t);
            FlightOutcome::Collided(Collision { distance: t, weight: left / (share * sigma * left).element_sum() })
        } else {
            let left = self.transmittance(distance);
            FlightOutcome::Passed(left / (share * left).element_sum())
        }
    }

    /// The distribution of scattering points of a ray with `throughput` over `distance`, which may be infinite, given
    /// that it scatters. `None` if the ray cannot scatter.
    #[inline]
    pub fn collision_distribution(&self, throughput: Rgb, distance: f32) -> Option<CollisionDistribution<'_>> {
        let sigma = self.sigma_t();
        // Probability of a collision per channel; -expm1 keeps thin media exact.
        let collided = -(-sigma * distance).map(exp_m1);
        let collided = Rgb::select(sigma.cmpgt(Rgb::ZERO), collided, Rgb::ZERO);
        let albedo = Rgb::select(sigma.cmpgt(Rgb::ZERO), self.sigma_s / sigma, Rgb::ZERO);
        let scattered = throughput * albedo * collided;
        is_lit(scattered).then(|| CollisionDistribution { medium: self, distance, collided, share: shares(scattered) })
    }
}

/// The distribution of scattering points on a ray in a medium, with colour channels drawn in proportion to the light
/// that they scatter.
#[derive(Clone, Copy, Debug)]
pub struct CollisionDistribution<'m> {
    medium: &'m MediumParameters,
    /// Length of the ray (m); may be infinite.
    distance: f32,
    /// Probability of a collision on the whole ray, per channel: one minus the transmittance.
    collided: Rgb,
    /// Probability with which each channel is drawn; they sum to 1.
    share: Rgb,
}

impl CollisionDistribution<'_> {
    /// Samples a scattering point of the ray; `u` is uniform on the unit square. `None` if its distance or weight is
    /// not finite.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<Collision> {
        let t = self.sample_depth(u);
        self.at(t, self.pdf(t))
    }

    /// The distance (m) of [`CollisionDistribution::sample`] alone. In a medium of varying density, it is the integral of
    /// the density.
    #[inline]
    pub fn sample_depth(&self, u: Vec2) -> f32 {
        let sigma_t = sample_channel(self.medium.sigma_t(), self.share, u.x);
        let collided = sample_channel(self.collided, self.share, u.x);
        let t = -(-(u.y + HALF_STEP) * collided).ln_1p() / sigma_t;
        t.min(self.distance)
    }

    /// Samples a scattering point of the ray equiangularly with respect to a light.
    #[inline]
    pub fn sample_equiangular(&self, light: &Equiangular, u: f32) -> Option<Collision> {
        let t = light.sample_inside(u).min(self.distance);
        self.at(t, light.pdf(t))
    }

    #[inline]
    fn at(&self, distance: f32, pdf: f32) -> Option<Collision> {
        let weight = self.medium.transmittance(distance) / pdf;
        (distance.is_finite() && weight.is_finite()).then_some(Collision { distance, weight })
    }

    /// Density per length (1/m) with which [`CollisionDistribution::sample`] draws `distance`.
    #[inline]
    pub fn pdf(&self, distance: f32) -> f32 {
        // Exponential densities of the channels, normalized on the length of the ray.
        let left = self.medium.transmittance(distance);
        let density = self.medium.sigma_t() * left / self.collided;
        let density = Rgb::select(self.collided.cmpgt(Rgb::ZERO), density, Rgb::ZERO);
        (self.share * density).element_sum()
    }
}

fn exp_m1(x: f32) -> f32 {
    x.exp_m1()
}

/// Probabilities of the three colour channels in proportion to `of`; equal if `of` is zero or not finite.
#[inline]
pub(super) fn shares(of: Rgb) -> Rgb {
    let sum = of.element_sum();
    if sum > 0.0 && sum.is_finite() { of / sum } else { Rgb::splat(1.0 / 3.0) }
}

/// The entry in `of` of the channel that `u` draws with the probabilities `share`.
#[inline]
pub(super) fn sample_channel(of: Rgb, share: Rgb, u: f32) -> f32 {
    // If rounding leaves a rest, the last channel with a probability above zero takes it.
    if u < share.x || share.y + share.z <= 0.0 {
        of.x
    } else if u < share.x + share.y || share.z <= 0.0 {
        of.y
    } else {
        of.z
    }
}

/// Densities of the free flight along a path segment in both directions, with equal probabilities of the colour
/// channels. A density is per length if the segment ends at a vertex of a scattering medium in that direction.
/// Otherwise it is the probability of passing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightDensity {
    /// Density (or probability of passing) from the start of the segment to its end.
    pub forward: f32,
    /// Density (or probability of passing) from the end of the segment to its start.
    pub reverse: f32,
}

impl FlightDensity {
    /// The densities of a segment without scattering media.
    pub const ONE: FlightDensity = FlightDensity { forward: 1.0, reverse: 1.0 };

    /// The densities of the segment extended by `distance` (m) in `medium`. `starts` and `ends`: the start or end of
    /// the segment is a vertex in this medium.
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
            // Three very different channels, one of them without scattering.
            medium([0.0, 0.0, 30.0], [0.3, 0.0, 10.0]),
            medium([0.5, 1e-3, 0.0], [4.0, 0.0, 1e-3]),
        ]
    }

    /// Compares means over draws with their closed forms, per channel. The weight of passing has the mean T(distance),
    /// and a collision at t, weighted with t, has the mean `integral t T(t) dt`. The latter must hold for free flight,
    /// for `CollisionDistribution::sample`, for equiangular sampling, and for MIS of the last two, also if the
    /// equiangular samples cover only a part of the ray. Returns the largest deviation in standard errors.
    fn flight_error(bug: impl Fn(Collision, Rgb) -> Rgb) -> f64 {
        let mut worst = 0.0f64;
        let light = Vec3::new(0.1, 0.4, 0.0);
        for (at, medium) in media().into_iter().enumerate() {
            for (distance, throughput) in [(0.7f32, Rgb::ONE), (2.0, Rgb::new(1.0, 5.0, 0.2))] {
                // Sums of values and of squares, by channel and kind of value.
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
                    let angles = |segment| Equiangular::new(Vec3::ZERO, Vec3::X, segment, light).expect("an angle");
                    let samplings = [angles([0.0, distance]), angles([0.3 * distance, 0.5 * distance])];
                    let share = |other: &Equiangular, pdf: f32, at: f32| pdf / (collisions.pdf(at) + other.pdf(at));
                    if let Some(hit) = collisions.sample(draws.two(Purpose::Phase)) {
                        values[2] = bug(hit, medium.sigma_t()) * hit.distance;
                        for (angles, shared) in samplings.iter().zip([4, 5]) {
                            values[shared] += values[2] * share(angles, collisions.pdf(hit.distance), hit.distance);
                        }
                    }
                    for (angles, shared) in samplings.iter().zip([4, 5]) {
                        if let Some(hit) = collisions.sample_equiangular(angles, draws.one(Purpose::Equiangular)) {
                            let value = bug(hit, medium.sigma_t()) * hit.distance;
                            values[shared] += value * share(angles, angles.pdf(hit.distance), hit.distance);
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
                        // The weight of a channel without scattering is multiplied by zero, so it need not be drawn.
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

    /// All deviations are below 5 sigma (96 checks, false alarms below 6e-5). A wrong density is detected.
    #[test]
    fn flights_are_unbiased_in_every_channel() {
        let right = flight_error(|hit, _| hit.weight);
        assert!(right < 5.0, "{right}");
        let wrong = flight_error(|hit, sigma| hit.weight * (1.0 + 0.02 * sigma * hit.distance));
        assert!(wrong > 5.0, "{wrong}");
    }

    /// Free flights do not increase the sum of the throughput over channels, even on long paths with very different
    /// channels.
    #[test]
    fn throughput_does_not_grow() {
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
        // In a grey medium with sigma = 1, the density is T towards a surface and sigma T = T towards a medium vertex.
        assert!((whole.reverse - (-1.5f32).exp()).abs() < 1e-6 && (whole.forward - whole.reverse).abs() < 1e-6);
        let clear = MediumParameters { sigma_a: Rgb::ONE, ..MediumParameters::default() };
        assert_eq!(FlightDensity::ONE.through(&clear, 2.0, false, false), FlightDensity::ONE);
    }
}
