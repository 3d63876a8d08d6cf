//! Rays through a heterogeneous medium: collisions by delta tracking, transmittance by ratio tracking.
//!
//! Delta tracking fills the medium with fictitious matter up to a majorant, the highest density of each block of cells.
//! A tentative collision is real with the probability density / majorant; otherwise the ray continues \[Woodcock et al.
//! 1965\]. Here the density scales all channels alike, so a tentative point is real with the same probability in each
//! channel, and the mixture over channels of `flight.rs` extends to the whole chain of tentative points: with `k`
//! fictitious collisions over the majorant's depth A, its density in a channel is proportional to
//! `sigma^k exp(-sigma A)` \[Miller et al. 2019, "A null-scattering path integral formulation of light transport"\].
//!
//! Ratio tracking multiplies the probabilities of fictitious collisions instead of deciding by them. As control variate
//! it takes the mean density of each block, whose transmittance is known, and estimates only the residual \[Novak et al.
//! 2014, "Residual Ratio Tracking for Estimating Attenuation in Participating Media"\]. Where the density is constant
//! the estimate is exact.
//!
//! MIS weights need the density of a collision anywhere on a path, but the true one contains a transmittance that is
//! only estimated. They use the transmittance of the mean densities of blocks instead ([`GridRay::mean_depth`]), which
//! is the same for all techniques that sample a path. So the weights still sum to one.

use super::{BLOCK_CELLS, Block, DensityGrid};
use crate::geometry::Placement;
use crate::math::{Rgb, Vec2, Vec3};
use crate::medium::flight::{sample_channel, shares};
use crate::medium::{FlightDensity, HALF_STEP, MediumParameters};
use crate::random::HashSequence;
use smallvec::SmallVec;

/// Transmittances below this are continued with probability [`SURVIVAL`] only, and then weighted up.
const ROULETTE_TRANSMITTANCE: f32 = 1e-3;
/// Probability that ratio tracking goes on below [`ROULETTE_TRANSMITTANCE`].
const SURVIVAL: f32 = 0.25;
/// Lower bound on the density of a proxy, relative to the highest density in its block. It bounds the weights of
/// points that are denser than the mean of their block.
const MIN_PROXY_SHARE: f32 = 0.125;
/// Lower bounds on density and transmittance in the densities of MIS, which keep ratios of them finite. Any positive
/// values are valid, if all techniques use them.
const MIN_RELATIVE_DENSITY: f32 = 1e-6;
const MIN_TRANSMITTANCE: f32 = 1e-30;

/// A ray in the space of a density grid. Distances along it are those in world space (m).
#[derive(Clone, Copy, Debug)]
pub struct GridRay<'g> {
    density: &'g DensityGrid,
    /// Origin (cells).
    origin: Vec3,
    /// Direction (cells per metre).
    direction: Vec3,
}

/// The outcome of delta tracking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridFlight {
    /// The ray reaches its end. The weight is the transmittance over the probability of this outcome.
    Passed(Rgb),
    /// The ray collides with the medium.
    Collided {
        /// Distance from the origin of the ray (m).
        distance: f32,
        /// Transmittance up to the collision, over its density per length.
        weight: Rgb,
        /// Density of the medium at the collision, above 0.
        density: f32,
    },
}

/// A part of a ray that lies in one block.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Distances (m) at which the ray enters and leaves the block.
    start: f32,
    end: f32,
    block: Block,
}

/// The blocks along a ray, in their order \[Amanatides and Woo 1987\].
struct Pieces<'g> {
    density: &'g DensityGrid,
    /// Index of the next block along each axis; out of range at the end.
    at: [i32; 3],
    step: [i32; 3],
    /// Distance at which the ray leaves the next block along each axis.
    leave: [f32; 3],
    /// Distance to cross one block along each axis.
    across: [f32; 3],
    t: f32,
    end: f32,
}

impl Iterator for Pieces<'_> {
    type Item = Piece;

    #[inline]
    fn next(&mut self) -> Option<Piece> {
        if self.t >= self.end {
            return None;
        }
        let [bx, by, bz] = self.density.blocks_size.map(|n| n as i32);
        let [x, y, z] = self.at;
        if x < 0 || y < 0 || z < 0 || x >= bx || y >= by || z >= bz {
            return None;
        }
        let block = self.density.blocks[(z as usize * by as usize + y as usize) * bx as usize + x as usize];
        let [a, b, c] = self.leave;
        let axis = if a <= b && a <= c { 0 } else { 1 + usize::from(c < b) };
        let start = self.t;
        let end = self.leave[axis].clamp(start, self.end);
        self.at[axis] += self.step[axis];
        self.leave[axis] += self.across[axis];
        self.t = end;
        Some(Piece { start, end, block })
    }
}

impl<'g> GridRay<'g> {
    /// The ray from `origin` along the unit `direction` in world space, for a grid in an object with this placement.
    #[inline]
    pub fn new(density: &'g DensityGrid, placement: &Placement, origin: Vec3, direction: Vec3) -> GridRay<'g> {
        let to_local = placement.normals.transpose();
        let grid = &density.grid;
        let local = Vec3::from(to_local * (glam::Vec3A::from(origin) - placement.points.translation));
        let direction = Vec3::from(to_local * glam::Vec3A::from(direction)) * grid.cells_per_metre();
        GridRay { density, origin: grid.to_cells(local), direction }
    }

    /// Position at `distance` (m) in cells.
    #[inline]
    pub fn cells_at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }

    /// Density at `distance`, which must lie inside the box.
    #[inline]
    fn density_inside(&self, distance: f32) -> f32 {
        self.density.grid.channel_at(self.cells_at(distance), 0)
    }

    /// Density at a distance (m), 0 outside the box.
    #[inline]
    pub fn density(&self, distance: f32) -> f32 {
        let p = self.cells_at(distance);
        let size = Vec3::from_array(self.density.grid.size.map(|n| n as f32));
        if p.cmpge(Vec3::ZERO).all() && p.cmple(size).all() { self.density.grid.channel_at(p, 0) } else { 0.0 }
    }

    /// Distances (m) between which the ray is inside the box and between 0 and `distance`; an empty range if it is not.
    #[inline]
    fn inside(&self, distance: f32) -> [f32; 2] {
        let mut range = [0.0f32, distance];
        for axis in 0..3 {
            let (o, d, n) = (self.origin[axis], self.direction[axis], self.density.grid.size[axis] as f32);
            if d == 0.0 {
                if !(0.0..=n).contains(&o) {
                    return [0.0, 0.0];
                }
                continue;
            }
            let (a, b) = (-o / d, (n - o) / d);
            range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
        }
        // A NaN gives an empty range.
        if range[1] > range[0] && range[1].is_finite() { range } else { [0.0, 0.0] }
    }

    /// The blocks on the first `distance` metres of the ray.
    #[inline]
    fn pieces(&self, distance: f32) -> Pieces<'g> {
        let [t, end] = self.inside(distance);
        let edge = BLOCK_CELLS as f32;
        let p = self.cells_at(t);
        let (mut at, mut step) = ([0; 3], [0; 3]);
        let (mut leave, mut across) = ([f32::INFINITY; 3], [f32::INFINITY; 3]);
        for axis in 0..3 {
            let last = self.density.blocks_size[axis] as i32 - 1;
            at[axis] = ((p[axis] / edge) as i32).clamp(0, last);
            let d = self.direction[axis];
            if d != 0.0 {
                step[axis] = if d > 0.0 { 1 } else { -1 };
                let border = (at[axis] + i32::from(d > 0.0)) as f32 * edge;
                leave[axis] = (border - self.origin[axis]) / d;
                across[axis] = edge / d.abs();
            }
        }
        Pieces { density: self.density, at, step, leave, across, t, end }
    }

    /// Approximate integral of the density over the first `distance` metres, from the means of the blocks.
    pub fn mean_depth(&self, distance: f32) -> f32 {
        self.pieces(distance).map(|piece| piece.block.mean * (piece.end - piece.start)).sum()
    }

    /// An unbiased estimate of the transmittance of the first `distance` metres, for the extinction coefficient
    /// `sigma_t` (1/m) at density 1. Never negative; above 1 at times.
    pub fn transmittance(&self, sigma_t: Rgb, distance: f32, random: &mut HashSequence) -> Rgb {
        let mut left = Rgb::ONE;
        let most = sigma_t.max_element();
        if most <= 0.0 {
            return left;
        }
        let relative = sigma_t / most;
        for Piece { start, end, block: Block { low, high, mean } } in self.pieces(distance) {
            if high <= 0.0 {
                continue;
            }
            left *= (-sigma_t * (mean * (end - start))).map(f32::exp);
            let largest = left.max_element();
            if largest < ROULETTE_TRANSMITTANCE {
                if largest <= 0.0 || random.one() >= SURVIVAL {
                    return Rgb::ZERO;
                }
                left /= SURVIVAL;
            }
            // Factors lie between 0 and 2.
            let residual = (high - mean).max(mean - low);
            let rate = most * residual;
            if rate <= 0.0 {
                continue;
            }
            let mut t = start;
            loop {
                t += exponential(random.one()) / rate;
                if t >= end {
                    break;
                }
                left *= Rgb::ONE - relative * ((self.density_inside(t) - mean) / residual);
            }
        }
        left.max(Rgb::ZERO)
    }

    /// Samples a collision of a ray with `throughput` on its first `distance` metres, in a medium whose coefficients at
    /// density 1 are `medium`. `u` is uniform on the unit square, `random` gives all further numbers.
    pub fn sample_flight(
        &self,
        medium: &MediumParameters,
        throughput: Rgb,
        distance: f32,
        u: Vec2,
        random: &mut HashSequence,
    ) -> GridFlight {
        let sigma_t = medium.sigma_t();
        let share = shares(throughput);
        let sampled = sample_channel(sigma_t, share, u.x);
        // Depth of the majorant's density so far (m), and number of fictitious collisions.
        let (mut depth, mut fictitious) = (0.0, 0u32);
        let mut left = exponential(u.y);
        for Piece { start, end, block } in self.pieces(distance) {
            let (rate, mut t) = (sampled * block.high, start);
            if block.high <= 0.0 {
                continue;
            }
            loop {
                let step = left / rate;
                // A channel without extinction gives an infinite step, which leaves the block.
                if t + step < end {
                    t += step;
                    depth += block.high * step;
                } else {
                    depth += block.high * (end - t);
                    left = (left - rate * (end - t)).max(0.0);
                    break;
                }
                let density = self.density_inside(t);
                if random.one() * block.high < density {
                    let ratio = ratios(sigma_t, share, depth, fictitious);
                    let weight = ratio / ((share * ratio * sigma_t).element_sum() * density);
                    return GridFlight::Collided { distance: t, weight, density };
                }
                fictitious += 1;
                left = exponential(random.one());
            }
        }
        GridFlight::Passed(ratios(sigma_t, share, depth, fictitious))
    }

    /// The proxy for the density on the first `distance` metres.
    pub fn proxy(&self, distance: f32) -> Proxy {
        let mut proxy = Proxy::default();
        for Piece { start, end, block } in self.pieces(distance) {
            if block.high > 0.0 && end > start {
                let density = block.mean.max(MIN_PROXY_SHARE * block.high);
                proxy.parts.push(ProxyPart { start, end, density, before: proxy.depth });
                proxy.depth += density * (end - start);
            }
        }
        proxy
    }

    /// [`FlightDensity::through`] of the first `distance` metres, with the transmittance of the mean densities of
    /// blocks.
    #[must_use]
    pub fn flight_density(
        &self,
        so_far: FlightDensity,
        medium: &MediumParameters,
        distance: f32,
        starts: bool,
        ends: bool,
    ) -> FlightDensity {
        if !medium.scatters() {
            return so_far;
        }
        let sigma_t = medium.sigma_t();
        let left = (-sigma_t * self.mean_depth(distance)).map(f32::exp).max(Rgb::splat(MIN_TRANSMITTANCE));
        let factor = |stops: bool, at: f32| {
            if stops {
                let density = self.density(at).max(MIN_RELATIVE_DENSITY * self.density.highest);
                (sigma_t * left).element_sum() / 3.0 * density
            } else {
                left.element_sum() / 3.0
            }
        };
        FlightDensity {
            forward: so_far.forward * factor(ends, distance),
            reverse: so_far.reverse * factor(starts, 0.0),
        }
    }
}

/// An exponentially distributed number with mean 1, by a uniform number; never 0.
#[inline]
fn exponential(u: f32) -> f32 {
    -(1.0 - (u + HALF_STEP)).ln()
}

/// For each channel, the density of a chain of tentative collisions over the mixture over channels. A channel that is
/// never drawn carries no light, and has the ratio 0.
#[inline]
fn ratios(sigma_t: Rgb, share: Rgb, depth: f32, fictitious: u32) -> Rgb {
    let logarithm = |sigma: f32, share: f32| match (share > 0.0, sigma > 0.0) {
        (false, _) => f32::NEG_INFINITY,
        (true, true) => fictitious as f32 * sigma.ln() - sigma * depth,
        (true, false) => {
            if fictitious == 0 {
                0.0
            } else {
                f32::NEG_INFINITY
            }
        }
    };
    let logarithms =
        Rgb::new(logarithm(sigma_t.x, share.x), logarithm(sigma_t.y, share.y), logarithm(sigma_t.z, share.z));
    let relative = (logarithms - Rgb::splat(logarithms.max_element())).map(f32::exp);
    relative / (share * relative).element_sum()
}

/// A constant density on a part of a ray.
#[derive(Clone, Copy, Debug)]
struct ProxyPart {
    start: f32,
    end: f32,
    density: f32,
    /// Depth (density times metres) before the part.
    before: f32,
}

/// A piecewise constant density that approximates the true one along a ray. Points sampled from it have a density in
/// closed form. It is positive wherever the true density is.
#[derive(Clone, Debug, Default)]
pub struct Proxy {
    parts: SmallVec<[ProxyPart; 24]>,
    depth: f32,
}

impl Proxy {
    /// Integral of the density over the ray.
    #[inline]
    pub fn depth(&self) -> f32 {
        self.depth
    }

    /// The part of the ray at `distance`, if it has a density there.
    #[inline]
    fn part_at(&self, distance: f32) -> Option<&ProxyPart> {
        let after = self.parts.partition_point(|part| part.start <= distance);
        self.parts.get(after.checked_sub(1)?).filter(|part| distance <= part.end)
    }

    /// The integral of the density up to `distance`, and the density there; `None` if it is 0 there.
    #[inline]
    pub fn at(&self, distance: f32) -> Option<(f32, f32)> {
        self.part_at(distance).map(|part| (part.before + part.density * (distance - part.start), part.density))
    }

    /// The distance at which the integral of the density reaches `depth`, and the density there; `None` if the ray has
    /// none.
    #[inline]
    pub fn distance(&self, depth: f32) -> Option<(f32, f32)> {
        let after = self.parts.partition_point(|part| part.before <= depth);
        let part = self.parts.get(after.max(1) - 1)?;
        let distance = part.start + (depth - part.before) / part.density;
        Some((distance.clamp(part.start, part.end), part.density))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::Grid;
    use crate::random::mix;
    use glam::{Affine3A, Quat};

    const DRAWS: u32 = 40_000;

    /// A ray through a random density that varies along x, and the medium.
    struct Case {
        density: DensityGrid,
        placement: Placement,
        origin: Vec3,
        direction: Vec3,
        /// Length of the ray (m), and the scale of the object.
        length: f32,
        scale: f32,
        medium: MediumParameters,
    }

    /// A random object with density `value(x)` for x from 0 to 1 at the centres of cells, and a ray along its x axis
    /// from the first centre to the last.
    fn case(seed: u64, value: impl Fn(f64) -> f64) -> Case {
        let mut random = HashSequence::new(seed);
        let cells = 20 + (random.one() * 60.0) as u32;
        let values: Vec<f32> =
            (0..4 * cells).map(|i| value(f64::from(i % cells) / f64::from(cells - 1)) as f32).collect();
        // One metre lies between the first and the last centre.
        let half = 0.5 / (cells - 1) as f32;
        let bounds = [Vec3::new(-half, -0.5, -0.5), Vec3::new(1.0 + half, 0.5, 0.5)];
        let density =
            DensityGrid::new(Grid::new([cells, 2, 2], 1, bounds, values).expect("valid")).expect("one channel");
        let axis = Vec3::new(random.one(), random.one(), random.one() + 0.1).normalize();
        let (scale, turn) = (0.5 + 2.0 * random.one(), Quat::from_axis_angle(axis, 6.0 * random.one()));
        let to_world =
            Affine3A::from_scale_rotation_translation(Vec3::splat(scale), turn, Vec3::new(1.0, -2.0, random.one()));
        let start = Vec3::new(0.0, 0.3 * random.one(), 0.3 * random.one());
        let sigma = |x: f32| Rgb::new(x, 2.0 * x, 0.2 * x) / scale;
        Case {
            density,
            origin: to_world.transform_point3(start),
            direction: to_world.transform_vector3(Vec3::X).normalize(),
            placement: Placement::new(to_world),
            length: scale,
            scale,
            medium: MediumParameters { sigma_a: sigma(0.3), sigma_s: sigma(1.0 + random.one()), g: 0.0 },
        }
    }

    /// Mean and standard error of values.
    fn mean(values: impl Iterator<Item = f64>) -> (f64, f64) {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for x in values {
            (n, sum, squares) = (n + 1.0, sum + x, squares + x * x);
        }
        let mean = sum / n;
        (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
    }

    /// Largest deviation, in standard errors, of transmittances, collisions and points of the proxy from their closed
    /// forms, with the estimates of a ray multiplied by `bug`. `integral(x)` is the integral of the density up to x.
    fn deviation(seed: u64, value: impl Fn(f64) -> f64, integral: impl Fn(f64) -> f64, bug: f64) -> f64 {
        let Case { density, placement, origin, direction, length, scale, medium } = case(seed, value);
        let ray = GridRay::new(&density, &placement, origin, direction);
        let sigma_t = medium.sigma_t();
        let depth = f64::from(scale) * integral(1.0);
        let exact = |c: usize, distance: f32| {
            (-f64::from(sigma_t[c]) * f64::from(scale) * integral(f64::from(distance / scale))).exp()
        };
        assert!((f64::from(ray.mean_depth(length)) / depth - 1.0).abs() < 0.2, "the means of blocks");
        let collided = |flight: GridFlight| match flight {
            GridFlight::Passed(_) => Rgb::ZERO,
            GridFlight::Collided { weight, density, .. } => weight * density * sigma_t,
        };
        let mut worst = 0f64;
        for c in 0..3 {
            let left = (-f64::from(sigma_t[c]) * depth).exp();
            let sequence = |i: u32, of: u64| HashSequence::new(mix(u64::from(i) | of << 40 | seed << 48));
            let flight = |i: u32| {
                let mut random = sequence(i, 2);
                let u = Vec2::new(random.one(), random.one());
                ray.sample_flight(&medium, Rgb::new(1.0, 0.3, 2.0), length, u, &mut random)
            };
            let passed = |i: u32| match flight(i) {
                GridFlight::Passed(weight) => f64::from(weight[c]),
                GridFlight::Collided { .. } => 0.0,
            };
            let proxy = ray.proxy(length);
            let collisions = medium.collision_distribution(Rgb::ONE, proxy.depth()).expect("it scatters");
            let by_proxy = |i: u32| {
                let mut random = sequence(i, 3);
                let (distance, _) =
                    proxy.distance(collisions.sample_depth(Vec2::new(random.one(), random.one()))).expect("a density");
                let (depth, density) = proxy.at(distance).expect("a density");
                let pdf = f64::from(collisions.pdf(depth) * density);
                exact(c, distance) * f64::from(ray.density(distance) * sigma_t[c]) / pdf
            };
            for ((value, error), expected) in [
                mean((0..DRAWS).map(|i| f64::from(ray.transmittance(sigma_t, length, &mut sequence(i, 1))[c]))),
                mean((0..DRAWS).map(passed)),
                mean((0..DRAWS).map(|i| f64::from(collided(flight(i))[c]))),
                mean((0..DRAWS).map(by_proxy)),
            ]
            .into_iter()
            .zip([left, left, 1.0 - left, 1.0 - left])
            .map(|((value, error), expected)| ((value * bug, error), expected))
            {
                // Interpolation between cells and single precision.
                worst = worst.max((value - expected).abs() / (error + 1e-3 * expected));
            }
        }
        worst
    }

    /// Linear and exponential densities with random parameters: 120 checks of 5 standard errors, so the rate of false
    /// alarms is below 7e-5. Estimates that are 3 % too large are detected in each case.
    #[test]
    fn estimates_agree_with_closed_forms() {
        for seed in 0..5u64 {
            let mut random = HashSequence::new(!seed);
            let (a, b) = (f64::from(random.one()), 4.0 * f64::from(random.one()));
            let linear = |bug| deviation(seed, |x| a + b * x, |x| a * x + 0.5 * b * x * x, bug);
            let k = 1.0 + 4.0 * f64::from(random.one());
            let exponential =
                |bug| deviation(seed, |x| 3.0 * (-k * x).exp(), |x| 3.0 * (1.0 - (-k * x).exp()) / k, bug);
            for (worst, wrong) in [(linear(1.0), linear(1.03)), (exponential(1.0), exponential(1.03))] {
                assert!(worst < 5.0 && wrong > 5.0, "seed {seed}: {worst}, {wrong} with the planted error");
            }
        }
    }

    /// In a uniform grid, estimates equal the closed form, and rays outside the box meet nothing.
    #[test]
    fn uniform_grids_are_exact() {
        let Case { density, placement, origin, direction, length, medium, .. } = case(3, |_| 1.5);
        let ray = GridRay::new(&density, &placement, origin, direction);
        let left = ray.transmittance(medium.sigma_t(), length, &mut HashSequence::new(7));
        assert!((left / medium.transmittance(1.5 * length) - Rgb::ONE).abs().max_element() < 1e-4);
        let away = GridRay::new(&density, &placement, origin - direction * 9.0, -direction);
        assert_eq!(away.transmittance(medium.sigma_t(), f32::INFINITY, &mut HashSequence::new(7)), Rgb::ONE);
        assert_eq!((away.mean_depth(f32::INFINITY), away.density(1.0), away.proxy(9.0).depth()), (0.0, 0.0, 0.0));
        let whole = GridRay::new(&density, &placement, origin - direction * 9.0, direction);
        assert!(whole.mean_depth(f32::INFINITY) > 1.5 * length && whole.mean_depth(8.9) < 0.2);
    }

    /// The parts of a ray in blocks join, and cover the box.
    #[test]
    fn blocks_cover_the_ray() {
        let Case { placement, .. } = case(1, |_| 1.0);
        let values = (0..19 * 25 * 8).map(|i| (mix(i) >> 40) as f32).collect();
        let grid = Grid::new([19, 25, 8], 1, [Vec3::ZERO, Vec3::ONE], values).expect("valid");
        let density = DensityGrid::new(grid).expect("one channel");
        for i in 0..2000 {
            let mut random = HashSequence::new(i);
            let mut point = || Vec3::new(random.one(), random.one(), random.one()) * 3.0 - 1.0;
            let (origin, towards) = (point(), point());
            let mut direction = (towards - origin).normalize();
            if i % 5 == 0 {
                direction = Vec3::AXES[i as usize % 3];
            }
            let origin = placement.points.transform_point3(origin);
            let direction = placement.points.transform_vector3(direction).normalize();
            let ray = GridRay::new(&density, &placement, origin, direction);
            let [start, end] = ray.inside(f32::INFINITY);
            let pieces: Vec<Piece> = ray.pieces(f32::INFINITY).collect();
            let covered: f32 = pieces.iter().map(|piece| piece.end - piece.start).sum();
            assert!((covered - (end - start)).abs() < 1e-4 * (1.0 + end), "ray {i}: {covered} of {}", end - start);
            for Piece { start, end, block } in pieces.into_iter().filter(|piece| piece.end - piece.start > 1e-4) {
                let value = ray.density_inside(0.5 * (start + end));
                assert!(value >= block.low && value <= block.high, "ray {i}");
            }
        }
    }
}
