//! Counter-based random numbers: a draw is a function of (seed, iteration, domain, path, vertex, purpose).
//!
//! There is no generator state, so a draw does not depend on which other draws were made. Any number of threads, shards
//! and resumed renders give the same numbers.
//!
//! The function is a hash. In streams made by [`Streams::in_sequence`], it is a point of an Owen-scrambled Sobol'
//! sequence for the first vertices of a path, because the error of such points falls faster than that of independent
//! ones \[Owen 1997, "Scrambled net variance for integrals of smooth functions"\]. Each (path, vertex, purpose) has its
//! own sequence, which advances by one point per iteration. Iterations are then not independent of each other.
//! Variances are therefore estimated from [`QUARTERS`], groups of iterations with independent sequences.

mod chain;
mod sobol;

pub use chain::Chain;
pub use sobol::SobolPair;

use glam::Vec2;

/// The kind of path that random numbers are for. Streams of different domains are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Domain {
    /// Camera path of a pixel for the smallest bandwidth level, and for methods with one camera path per pixel.
    CameraIndependent = 1,
    /// Camera path of a pixel that all bandwidth levels but the smallest share.
    CameraCorrelated = 2,
    /// Light paths.
    Light = 3,
    /// Camera paths of the pilot iteration, which runs before the first and sets initial bandwidths.
    PilotCamera = 4,
    /// Light paths of the pilot iteration, which runs before the first and sets initial bandwidths.
    PilotLight = 5,
    /// Light paths for the camera paths of [`Domain::CameraCorrelated`].
    LightCorrelated = 6,
    /// Light paths that train the guiding of emission.
    GuideLight = 7,
    /// Camera paths that train the guiding of emission.
    GuideCamera = 8,
    /// Moments of the shutter interval at which iterations render a moving scene.
    Shutter = 9,
    /// Camera paths that learn where light of the environment arrives.
    LearningCamera = 10,
    /// Paths in unit tests.
    Test = 99,
}

/// The decision at a path vertex that a random number is for. (2D) marks decisions that take a point of the unit
/// square, [`Draws::two`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Position in the pixel (2D).
    Pixel = 1,
    /// Position on the lens (2D).
    Lens = 2,
    /// Choice of a lobe of a BSDF.
    Lobe = 3,
    /// Direction from a lobe (2D).
    Direction = 4,
    /// Russian roulette: whether the path continues.
    Roulette = 5,
    /// Choice of the light in next-event estimation.
    LightChoice = 6,
    /// Point or direction on the light of next-event estimation (2D).
    LightPoint = 7,
    /// Choice of the light that a light path starts from.
    EmitterChoice = 8,
    /// Point on the light that a light path starts from (2D).
    EmitterPoint = 9,
    /// Direction in which a light path starts (2D).
    EmitterDirection = 10,
    /// Alpha cut-outs along the segment that leaves this vertex.
    Alpha = 11,
    /// Whether direct light is also estimated by BSDF sampling.
    SecondTechnique = 12,
    /// Choice of a lobe of the BSDF sample for direct light.
    SecondLobe = 13,
    /// Direction of the BSDF sample for direct light (2D).
    SecondDirection = 14,
    /// Free-flight distance in a medium (2D).
    Flight = 15,
    /// Direction from a phase function (2D).
    Phase = 16,
    /// Wavelength of a dispersed path.
    Wavelength = 17,
    /// Alpha cut-outs along a shadow ray.
    ShadowAlpha = 18,
    /// Alpha cut-outs along the ray of the BSDF sample for direct light.
    SecondAlpha = 19,
    /// Russian roulette by which losses end light paths instead of lowering the flux of photons.
    Loss = 20,
    /// Choice among the sets of lobes that a path may continue with.
    LobeChoice = 21,
    /// Distance of a point in a medium, sampled uniformly in the angle as seen from a light.
    Equiangular = 22,
    /// Rank in the thinning key of a photon.
    ThinningKey = 23,
    /// Directions of the rays that look for the boundaries of a medium.
    Border = 24,
    /// Random rotation of the rays that look for the boundaries of a medium.
    BorderTurn = 25,
    /// Choice of the pixel that receives a light path's contribution to a film point (2D).
    Splat = 26,
    /// Film point where a path of a Markov chain starts (2D).
    Film = 27,
    /// How many vertices of a path of a Markov chain lie on its camera and on its light subpath.
    Division = 28,
    /// Whether a camera path merges with photons.
    Merging = 29,
    /// Moment of an iteration within the shutter interval.
    Moment = 30,
    /// Tentative collisions along a ray in a heterogeneous medium.
    Tracking = 31,
    /// Point of a bulb on a camera path's segment.
    Bulb = 32,
}

/// Finaliser of SplitMix64 \[Steele, Lea, Flood 2014; constants of Stafford's Mix13\]: a bijection with full avalanche.
#[inline]
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Increment between consecutive inputs of [`mix`]: 2^64 over the golden ratio \[Steele, Lea, Flood 2014\].
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A sequence of independent uniform numbers, which is a function of a key.
#[derive(Clone, Copy, Debug)]
pub struct HashSequence(u64);

impl HashSequence {
    /// The sequence of a key, for example of [`Draws::bits`]. Sequences of different keys are independent.
    #[inline]
    pub fn new(key: u64) -> HashSequence {
        HashSequence(mix(key.wrapping_add(GOLDEN)))
    }

    /// The next number, in `[0, 1)`.
    #[inline]
    pub fn one(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(GOLDEN);
        unit((mix(self.0) >> 32) as u32)
    }
}

/// A float in `[0, 1)` from the upper 24 of 32 random bits.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A point of the unit square from 64 random bits.
#[inline]
fn square(bits: u64) -> Vec2 {
    Vec2::new(unit((bits >> 32) as u32), unit(bits as u32))
}

/// A number in `[0, 1)` with all of 32 random bits.
#[inline]
fn unit_f64(bits: u32) -> f64 {
    f64::from(bits) * (1.0 / 4_294_967_296.0)
}

/// Number of groups (quarters) of the iterations of a render. Each quarter has its own sequences, so the means of
/// quarters are independent although the iterations within one are not. Four, because sequences are longer with fewer
/// quarters, and fewer give no usable variance.
pub const QUARTERS: u64 = 4;

/// Number of vertices of a path, its endpoint on the lens or light included, whose random numbers are points of
/// low-discrepancy sequences. Eight instead of four lowers squared errors by up to 3 % at no measurable cost; more gain
/// too little.
const SEQUENCE_VERTICES: u32 = 8;

/// The quarter (0 to 3) of an iteration. Iterations count from 1 and take quarters in turn.
#[inline]
pub fn quarter(iteration: u64) -> u64 {
    iterations_before(iteration) % QUARTERS
}

/// Number of iterations before this one. Iteration 0, which is not part of the picture, counts as the last possible
/// one.
#[inline]
fn iterations_before(iteration: u64) -> u64 {
    iteration.wrapping_sub(1)
}

/// Random numbers of all paths of one domain (kind of path) in one iteration.
#[derive(Clone, Copy, Debug)]
pub struct Streams(Stream);

impl Streams {
    /// Streams of independent random numbers (hashes) for the paths of `domain` in an iteration of a render with
    /// `seed`.
    pub fn new(seed: u64, iteration: u64, domain: Domain) -> Streams {
        let key = mix(seed.wrapping_add(GOLDEN));
        let key = mix(key ^ iteration.wrapping_mul(GOLDEN).wrapping_add(domain as u64));
        Streams(Stream { key, reversed: 0, vertices: 0, chained: false })
    }

    /// Streams whose random numbers at the first vertices of every path are points of Sobol' sequences, one point per
    /// iteration.
    pub fn in_sequence(seed: u64, iteration: u64, domain: Domain) -> Streams {
        let index = iterations_before(iteration) / QUARTERS;
        // Points have 32 bits of index. The higher bits of the index select other sequences.
        let group = (index >> 32) * QUARTERS + quarter(iteration);
        let key = mix(mix(seed.wrapping_add(GOLDEN)) ^ 0x2545_f491_4f6c_dd1d);
        let key = mix(key ^ group.wrapping_mul(GOLDEN).wrapping_add(domain as u64));
        Streams(Stream { key, reversed: (index as u32).reverse_bits(), vertices: SEQUENCE_VERTICES, chained: false })
    }

    /// The random numbers of path number `index`.
    #[inline]
    pub fn path(self, index: u64) -> Stream {
        Stream { key: mix(self.0.key.wrapping_add(index.wrapping_mul(GOLDEN))), ..self.0 }
    }
}

/// Random numbers of one path.
#[derive(Clone, Copy, Debug)]
pub struct Stream {
    /// Key of the hashes of this path. With sequences, all iterations of a quarter share it.
    key: u64,
    /// Index of the point of this iteration in the low-discrepancy sequences, with its bits in reverse order; 0 without
    /// sequences.
    reversed: u32,
    /// Number of vertices, from the start of the path, whose random numbers are points of sequences.
    vertices: u32,
    /// Whether random numbers are the coordinates of the Markov chain that is active on the thread.
    chained: bool,
}

impl Stream {
    /// Independent random numbers (hashes) of path number `index` of `domain` in an iteration of a render with `seed`.
    #[inline]
    pub fn new(seed: u64, iteration: u64, domain: Domain, index: u64) -> Stream {
        Streams::new(seed, iteration, domain).path(index)
    }

    /// A stream whose random numbers are the coordinates of the thread's active [`Chain`]. The numbers of `self` are
    /// the initial state of the chain.
    #[must_use]
    pub fn chained(self) -> Stream {
        Stream { chained: true, ..self }
    }

    /// The stream of a branch that the path begins at vertex number `vertex`, independent of this stream. `number`, from
    /// 0, counts the branches that begin there.
    #[must_use]
    pub fn branch(self, vertex: u32, number: u32) -> Stream {
        let branch = u64::from(vertex) << 32 | (u64::from(number) + 1);
        Stream { key: mix(self.key ^ branch.wrapping_mul(0x9e6c_63d0_876a_68de)), ..self }
    }

    /// Random numbers at vertex number `vertex` of the path. Vertex 0 is its endpoint on the lens or light.
    #[inline]
    pub fn vertex(self, vertex: u32) -> Draws {
        Draws {
            key: mix(self.key ^ (u64::from(vertex) + 1).wrapping_mul(0xd1b5_4a32_d192_ed03)),
            reversed: self.reversed,
            generator: match vertex < self.vertices {
                _ if self.chained => Generator::Chain,
                true => Generator::Sequence,
                false => Generator::Hash,
            },
        }
    }
}

/// How the random numbers at a vertex are computed: as hashes, points of sequences, or coordinates of a Markov chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Generator {
    Hash,
    Sequence,
    Chain,
}

/// Random numbers at one vertex of a path, one or two for each [`Purpose`].
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    /// Key of the hashes at this vertex. With sequences, all iterations of a quarter share it.
    key: u64,
    reversed: u32,
    generator: Generator,
}

impl Draws {
    /// Random numbers for decision number `n`, where a vertex makes several decisions of one purpose.
    #[inline]
    pub fn nth(self, n: u32) -> Draws {
        Draws { key: mix(self.key ^ (u64::from(n) + 1).wrapping_mul(0xa076_1d64_78bd_642f)), ..self }
    }

    /// Key of the hash for `purpose`. With sequences, all iterations of a quarter share it.
    #[inline]
    fn key_of(self, purpose: Purpose) -> u64 {
        self.key.wrapping_add((purpose as u64).wrapping_mul(GOLDEN))
    }

    /// Coordinates for `purpose` in the active Markov chain, a point of the unit square.
    #[cold]
    #[inline(never)]
    fn chained(self, purpose: Purpose) -> Vec2 {
        Chain::draw_active(self.id(purpose), square(self.hash(purpose)))
    }

    /// Identifies the coordinates for `purpose` at this vertex in a Markov [`Chain`].
    pub fn id(self, purpose: Purpose) -> u64 {
        mix(self.key_of(purpose))
    }

    /// 64 random bits for `purpose`.
    #[inline]
    pub fn bits(self, purpose: Purpose) -> u64 {
        let hash = self.hash(purpose);
        if self.generator == Generator::Chain {
            let u = self.chained(purpose);
            // The initial state of a chain is the ordinary path, with the bits of its decisions.
            if u != square(hash) {
                return mix(u64::from(u.x.to_bits()) << 32 | u64::from(u.y.to_bits()));
            }
        }
        hash
    }

    #[inline]
    fn hash(self, purpose: Purpose) -> u64 {
        mix(self.key_of(purpose).wrapping_add(u64::from(self.reversed).wrapping_mul(0x9fb2_1c65_1e98_df25)))
    }

    #[inline]
    fn pair(self, purpose: Purpose) -> SobolPair {
        SobolPair::keyed(mix(self.key_of(purpose)))
    }

    /// A uniform random number in `[0, 1)` for `purpose`.
    #[inline]
    pub fn one(self, purpose: Purpose) -> f32 {
        match self.generator {
            Generator::Sequence => self.pair(purpose).first_reversed(self.reversed),
            Generator::Hash => unit((self.hash(purpose) >> 32) as u32),
            Generator::Chain => self.chained(purpose).x,
        }
    }

    /// The number of [`Draws::one`] if it is `needed`, otherwise any number in `[0, 1)`. A Markov chain draws it always,
    /// so that its state does not depend on who needs it.
    #[inline]
    pub fn one_if(self, needed: bool, purpose: Purpose) -> f32 {
        if needed || self.generator == Generator::Chain { self.one(purpose) } else { 0.0 }
    }

    /// Whether an event of this probability happens, decided by the number of [`Draws::one`]. An event of probability 1
    /// costs no random number.
    #[inline]
    pub fn happens(self, probability: f32, purpose: Purpose) -> bool {
        self.one_if(probability < 1.0, purpose) < probability
    }

    /// The number of [`Draws::one`] with all of its 32 bits, for choices among more than 2^24.
    #[inline]
    pub fn one_fine(self, purpose: Purpose) -> f64 {
        match self.generator {
            Generator::Sequence => unit_f64(self.pair(purpose).first_bits(self.reversed)),
            Generator::Hash => unit_f64((self.hash(purpose) >> 32) as u32),
            Generator::Chain => f64::from(self.chained(purpose).x),
        }
    }

    /// A uniform random point of the unit square `[0, 1)^2` for `purpose`.
    #[inline]
    pub fn two(self, purpose: Purpose) -> Vec2 {
        match self.generator {
            Generator::Sequence => self.pair(purpose).point_reversed(self.reversed),
            Generator::Hash => square(self.hash(purpose)),
            Generator::Chain => self.chained(purpose),
        }
    }

    /// 32 random bits for the alpha decisions along a ray, see [`Ray::token`](crate::trace::Ray::token).
    #[inline]
    pub fn token(self, purpose: Purpose) -> u32 {
        (self.bits(purpose) >> 32) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean and three correlations of 10^6 draws are within 5 sigma (error rate below 1e-5).
    #[test]
    fn draws_are_uniform_and_uncorrelated() {
        let n = 1_000_000u64;
        let (mut sum, mut pair, mut next, mut cross) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        let mut last = 0.5f64;
        for i in 0..n {
            let draws = Stream::new(1, 2, Domain::Test, i).vertex(0);
            let u = draws.two(Purpose::Pixel);
            let (x, y) = (f64::from(u.x) - 0.5, f64::from(u.y) - 0.5);
            sum += x;
            pair += x * y;
            next += x * (last - 0.5);
            cross += x * (f64::from(draws.one(Purpose::Lobe)) - 0.5);
            last = x + 0.5;
        }
        let n = n as f64;
        assert!((sum / n).abs() < 5.0 * (1.0 / 12.0 / n).sqrt());
        for product in [pair, next, cross] {
            assert!((product / n).abs() < 5.0 * (1.0 / 12.0) / n.sqrt());
        }
    }

    /// The iteration that uses point number `index` of the sequences of a quarter.
    fn iteration(quarter: u64, index: u64) -> u64 {
        1 + quarter + QUARTERS * index
    }

    fn draws(seed: u64, iteration: u64, path: u64) -> Draws {
        Streams::in_sequence(seed, iteration, Domain::Test).path(path).vertex(1)
    }

    /// The mean and four correlations of 10^6 paths of one iteration are within 5 sigma (three iterations, error rate
    /// below 1e-5).
    #[test]
    fn draws_in_sequence_are_uniform_and_uncorrelated_between_paths_vertices_and_purposes() {
        let n = 1_000_000u64;
        for index in [0, 5, 1 << 40] {
            let (mut sum, mut products, mut last) = (0.0f64, [0.0f64; 4], 0.0);
            for i in 0..n {
                let stream = Streams::in_sequence(1, iteration(2, index), Domain::Test).path(i);
                let (first, second) = (stream.vertex(0), stream.vertex(1));
                let u = first.two(Purpose::Pixel);
                let (x, y) = (f64::from(u.x) - 0.5, f64::from(u.y) - 0.5);
                let others = [first.one(Purpose::Lobe), second.two(Purpose::Pixel).x].map(|u| f64::from(u) - 0.5);
                sum += x;
                for (product, other) in products.iter_mut().zip([y, last, others[0], others[1]]) {
                    *product += x * other;
                }
                last = x;
            }
            let n = n as f64;
            assert!((sum / n).abs() < 5.0 * (1.0 / 12.0 / n).sqrt());
            for product in products {
                assert!((product / n).abs() < 5.0 * (1.0 / 12.0) / n.sqrt());
            }
        }
    }

    /// In every sequence (quarter, path, vertex, n), points `k 2^m .. (k + 1) 2^m` put one point in every elementary
    /// interval of area 2^-m. Hashes do not.
    #[test]
    fn iterations_of_a_quarter_are_nets() {
        let in_net = |draws: &dyn Fn(u64) -> Draws| {
            let m = 6u32;
            let n = 1u64 << m;
            let one_each = |cell: &dyn Fn(Draws) -> usize, at: u64| {
                let mut seen = vec![0; n as usize];
                (0..n).for_each(|i| seen[cell(draws(at + i))] += 1);
                seen.iter().all(|&count| count == 1)
            };
            [0, 3 * n].into_iter().all(|at| {
                let line = |draws: Draws| (draws.one(Purpose::Roulette) * n as f32) as usize;
                one_each(&line, at)
                    && (0..=m).all(|split| {
                        let (nx, ny) = (1usize << split, 1usize << (m - split));
                        let cell = |draws: Draws| {
                            let u = draws.two(Purpose::LightPoint);
                            (u.x * nx as f32) as usize * ny + (u.y * ny as f32) as usize
                        };
                        one_each(&cell, at)
                    })
            })
        };
        for quarter in 0..QUARTERS {
            for path in 0..16 {
                for vertex in [0, 1, SEQUENCE_VERTICES - 1, SEQUENCE_VERTICES] {
                    let draws = |index| {
                        let streams = Streams::in_sequence(path, iteration(quarter, index), Domain::CameraCorrelated);
                        streams.path(path).vertex(vertex)
                    };
                    let (sequence, nth) = (in_net(&draws), in_net(&|index| draws(index).nth(3)));
                    assert_eq!(
                        (sequence, nth),
                        (vertex < SEQUENCE_VERTICES, vertex < SEQUENCE_VERTICES),
                        "quarter {quarter}, path {path}, vertex {vertex}"
                    );
                }
            }
        }
    }

    /// [`Draws::bits`] differs between all iterations, vertices and n. Streams without sequences follow the formula.
    #[test]
    fn tokens_and_later_vertices_are_hashes() {
        let mut seen = std::collections::HashSet::new();
        for iteration in 0..1000 {
            for vertex in 0..SEQUENCE_VERTICES + 2 {
                let draws = Streams::in_sequence(7, iteration, Domain::Test).path(5).vertex(vertex);
                assert!(seen.insert(draws.bits(Purpose::Alpha)), "iteration {iteration}, vertex {vertex}");
                assert!(seen.insert(draws.nth(1).bits(Purpose::Alpha)), "iteration {iteration}, vertex {vertex}");
            }
        }
        let hashed = Stream::new(7, 3, Domain::Light, 5).vertex(2);
        let key = mix(mix(7u64.wrapping_add(GOLDEN)) ^ 3u64.wrapping_mul(GOLDEN).wrapping_add(Domain::Light as u64));
        let key = mix(mix(key.wrapping_add(5u64.wrapping_mul(GOLDEN))) ^ 3u64.wrapping_mul(0xd1b5_4a32_d192_ed03));
        let bits = mix(key.wrapping_add((Purpose::Lobe as u64).wrapping_mul(GOLDEN)));
        assert_eq!((hashed.bits(Purpose::Lobe), hashed.one(Purpose::Lobe)), (bits, unit((bits >> 32) as u32)));
    }

    /// Events happen if the number of [`Draws::one`] is below their probability. A Markov chain draws a number also where
    /// none is needed, so its coordinates exist afterwards.
    #[test]
    fn numbers_that_nobody_needs_are_drawn_only_in_a_chain() {
        for i in 0..1000 {
            let draws = Stream::new(3, 1, Domain::Test, i).vertex(0);
            let (u, probability) = (draws.one(Purpose::Roulette), i as f32 / 999.0);
            assert_eq!(draws.happens(probability, Purpose::Roulette), u < probability);
            let [needed, other] = [true, false].map(|needed| draws.one_if(needed, Purpose::Roulette));
            assert_eq!((needed, (0.0..1.0).contains(&other)), (u, true));
        }
        let draws = Streams::new(3, 1, Domain::Test).path(0).chained().vertex(0);
        let mut chain = Chain::new(5);
        chain.set_initial(draws.id(Purpose::Roulette), Vec2::new(0.625, 0.5));
        assert_eq!(chain.run(|| draws.one_if(false, Purpose::Roulette)), 0.625);
    }

    /// The first path of a Markov chain draws the bits and numbers of the ordinary path; a mutated path draws others.
    #[test]
    fn chains_start_at_the_bits_of_the_ordinary_path() {
        for i in 0..1000 {
            let stream = Streams::new(3, 1, Domain::Test).path(i);
            let [ordinary, chained] = [stream, stream.chained()].map(|stream| stream.vertex(1).nth(2));
            let of = |draws: Draws| (draws.bits(Purpose::Alpha), draws.token(Purpose::Alpha), draws.two(Purpose::Lobe));
            let mut chain = Chain::new(i);
            assert_eq!(chain.run(|| of(chained)), of(ordinary));
            chain.propose();
            let mutated = chain.run(|| of(chained));
            assert!(mutated.0 != of(ordinary).0 && mutated.1 != of(ordinary).1, "path {i}");
            chain.accept_or_reject(0.0);
            assert_eq!(chain.run(|| of(chained)), of(ordinary));
        }
    }

    /// Iteration 0 and iterations beyond the 2^32 points of a sequence have their own draws.
    #[test]
    fn every_iteration_has_its_own_points() {
        let late = [iteration(0, 1 << 32), iteration(0, (1 << 32) + 1), iteration(1, 2 << 32)];
        let iterations = [0, 1, 2, 5, late[0], late[1], late[2], u64::MAX];
        let point = |iteration| draws(1, iteration, 0).two(Purpose::Pixel).to_array().map(f32::to_bits);
        let points: std::collections::HashSet<_> = iterations.map(point).into_iter().collect();
        assert_eq!(points.len(), iterations.len());
        assert_eq!([1, 2, 3, 4, 5, 8, 9].map(quarter), [0, 1, 2, 3, 0, 3, 0]);
    }

    /// The indicator of a quarter disc (area pi / 4) times a linear function (mean 1/2). Neither is aligned with
    /// elementary intervals.
    fn integrand(draws: Draws) -> f64 {
        let inside = draws.two(Purpose::Direction).length_squared() < 1.0;
        f64::from(u8::from(inside)) * f64::from(draws.one(Purpose::Lobe))
    }

    const INTEGRAL: f64 = std::f64::consts::PI / 8.0;

    /// Error of the mean over the first `count` points of a quarter's sequence.
    fn error(seed: u64, quarter: u64, path: u64, count: u64) -> f64 {
        let sum: f64 = (0..count).map(|index| integrand(draws(seed, iteration(quarter, index), path))).sum();
        sum / count as f64 - INTEGRAL
    }

    /// Correlation of two errors times the square root of the number of pairs. Nearly a standard normal deviate if the
    /// errors are independent.
    fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
        let (mut xy, mut xx, mut yy, mut n) = (0.0, 0.0, 0.0, 0.0f64);
        for (x, y) in pairs {
            (xy, xx, yy, n) = (xy + x * y, xx + x * x, yy + y * y, n + 1.0);
        }
        xy / (xx * yy).sqrt() * n.sqrt()
    }

    /// Means over 16 points are uncorrelated between quarters, neighbouring paths, seeds and domains: within 5 sigma
    /// over 20,000 pixels (9 checks, error rate below 1e-5). Halves of one sequence are correlated and must fail.
    #[test]
    fn quarters_paths_and_domains_are_independent() {
        let n = 20_000;
        for a in 0..QUARTERS {
            for b in 0..a {
                let z = correlation((0..n).map(|path| (error(3, a, path, 16), error(3, b, path, 16))));
                assert!(z.abs() < 5.0, "quarters {a} and {b}: {z}");
            }
        }
        let paths = correlation((0..n).map(|path| (error(3, 0, path, 16), error(3, 0, path + 1, 16))));
        let seeds = correlation((0..n).map(|path| (error(3, 0, path, 16), error(4, 0, path, 16))));
        let in_domain = |domain, path| {
            let draws = |i| Streams::in_sequence(3, iteration(0, i), domain).path(path).vertex(1);
            (0..16).map(|i| integrand(draws(i))).sum::<f64>() / 16.0 - INTEGRAL
        };
        let domains = (0..n).map(|path| (in_domain(Domain::CameraIndependent, path), in_domain(Domain::Light, path)));
        let domains = correlation(domains);
        assert!([paths, seeds, domains].iter().all(|z| z.abs() < 5.0), "{paths}, {seeds}, {domains}");
        let halves = correlation((0..n).map(|path| {
            let first = error(3, 0, path, 8);
            (first, 2.0 * error(3, 0, path, 16) - first)
        }));
        assert!(halves < -5.0, "halves of a sequence pass for independent: {halves}");
    }

    /// Over 64 iterations and 4,000 pixels, the mean is unbiased and the variance between quarters is the true
    /// variance, both within 5 sigma (error rate below 1e-5). Squared errors are below 0.4 times those of hashes.
    #[test]
    fn sequences_integrate_better_than_hashes() {
        let (pixels, iterations) = (4000u64, 64);
        let (mut sum, mut squares, mut estimated, mut hashed) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for path in 0..pixels {
            let quarters: Vec<f64> = (0..QUARTERS).map(|q| error(9, q, path, iterations / QUARTERS)).collect();
            let mean = quarters.iter().sum::<f64>() / QUARTERS as f64;
            (sum, squares) = (sum + mean, squares + mean * mean);
            let spread: f64 = quarters.iter().map(|quarter| (quarter - mean) * (quarter - mean)).sum();
            estimated += spread / (QUARTERS * (QUARTERS - 1)) as f64;
            let hash = |iteration| integrand(Stream::new(9, iteration, Domain::Test, path).vertex(1));
            hashed += ((1..=iterations).map(hash).sum::<f64>() / iterations as f64 - INTEGRAL).powi(2);
        }
        let n = pixels as f64;
        assert!((sum / n).abs() < 5.0 * (squares / n / n).sqrt(), "bias {}", sum / n);
        // `squares` has one degree of freedom per pixel, `estimated` three.
        let sigma = (2.0 / n + 2.0 / (n * (QUARTERS - 1) as f64)).sqrt();
        assert!((estimated / squares - 1.0).abs() < 5.0 * sigma, "estimated {estimated}, true {squares}");
        // Variance of the mean of 64 independent points; the squared integrand has the mean pi / 12.
        let independent = n * (std::f64::consts::PI / 12.0 - INTEGRAL * INTEGRAL) / iterations as f64;
        let low = |squares: f64| squares < 0.4 * independent;
        assert!(low(squares), "squared error over that of hashes: {}", squares / independent);
        assert!(!low(hashed), "hashes are below the bound: {}", hashed / independent);
        assert!((hashed / independent - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "hashes: {}", hashed / independent);
    }
}
