//! Counter-based random numbers: a draw is a function of (seed, pass, domain, path, vertex, purpose).
//!
//! Nothing is consumed, so a draw does not depend on which other draws were made: a richer
//! scene tier gives the same bits on a plainer scene, and threads, shards and resumed renders agree.
//!
//! The function is a hash; for the first vertices of paths that ask for it ([`Streams::in_sequence`]) it is a point
//! of an Owen-scrambled Sobol' sequence, whose error falls faster than that of independent points \[Owen 1997,
//! "Scrambled net variance for integrals of smooth functions"\]: (path, vertex, purpose) has a sequence of its own,
//! and passes take its points one after the other. Passes are then not independent any more. What tells variances
//! takes [`QUARTERS`] of them, whose sequences are.

mod chain;
mod sobol;

pub use chain::Chain;
pub use sobol::SobolPair;

use glam::Vec2;

/// What kind of path a stream belongs to; keeps eye paths, light paths and pilots independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Domain {
    /// The eye path of a pixel that feeds level 1 (and single-path methods).
    CameraIndependent = 1,
    /// The eye path of a pixel that feeds levels 2 and up.
    CameraCorrelated = 2,
    /// Light paths.
    Light = 3,
    /// Eye paths of the pilot pass that sets initial bandwidths.
    PilotCamera = 4,
    /// Light paths of the pilot pass.
    PilotLight = 5,
    /// Light paths that serve the eye paths of [`Domain::CameraCorrelated`].
    LightCorrelated = 6,
    /// Light paths by which emission is guided.
    GuideLight = 7,
    /// Eye paths by which emission is guided.
    GuideCamera = 8,
    /// Anything in tests.
    Test = 99,
}

/// What a draw is for. One variant per decision of a walk; 2D purposes take two words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Position in the pixel (2D).
    Pixel = 1,
    /// Position on the lens (2D).
    Lens = 2,
    /// Which lobe of a BSDF.
    Lobe = 3,
    /// Direction from a BSDF (2D).
    Direction = 4,
    /// Russian roulette.
    Roulette = 5,
    /// Which light next-event estimation takes.
    LightChoice = 6,
    /// Point or direction on that light (2D).
    LightPoint = 7,
    /// Which light a light path starts from.
    EmitterChoice = 8,
    /// Point of emission (2D).
    EmitterPoint = 9,
    /// Direction of emission (2D).
    EmitterDirection = 10,
    /// Alpha cut-outs along the segment that leaves this vertex.
    Alpha = 11,
    /// Whether the second direct-light strategy is tried.
    SecondTechnique = 12,
    /// Lobe of that second strategy.
    SecondLobe = 13,
    /// Direction of that second strategy (2D).
    SecondDirection = 14,
    /// Free flight in a medium.
    Flight = 15,
    /// Direction from a phase function (2D).
    Phase = 16,
    /// Wavelength of a dispersed path.
    Wavelength = 17,
    /// Alpha cut-outs along a shadow ray.
    ShadowAlpha = 18,
    /// Alpha cut-outs along the second strategy's ray.
    SecondAlpha = 19,
    /// Whether a photon of constant flux outlives what it lost on its way here.
    Loss = 20,
    /// Which of several sets of lobes a path goes on with.
    LobeChoice = 21,
    /// Distance of a point in a medium by the angle as seen from a lamp.
    Equiangular = 22,
    /// Rank of a photon among those of other weights.
    ThinningKey = 23,
    /// Directions in which the borders of a medium are looked for.
    Border = 24,
    /// How they are turned.
    BorderTurn = 25,
    /// Which of the pixels that see a point of the film a light path goes to (2D).
    Splat = 26,
    /// Where on the film a Markov chain's path starts (2D).
    Film = 27,
    /// How such a path is divided among the two walks.
    Division = 28,
}

/// Finaliser of SplitMix64 \[Steele, Lea, Flood 2014; constants of Stafford's Mix13\]: a bijection with full avalanche.
#[inline]
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Steps between numbers that are to be mixed: 2^64 over the golden ratio \[Steele, Lea, Flood 2014\].
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// 24 random bits to a float in `[0, 1)`.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// 64 random bits to a point of the unit square.
#[inline]
fn square(bits: u64) -> Vec2 {
    Vec2::new(unit((bits >> 32) as u32), unit(bits as u32))
}

/// 32 random bits to a number in `[0, 1)`, all of them kept.
#[inline]
fn fine(bits: u32) -> f64 {
    f64::from(bits) * (1.0 / 4_294_967_296.0)
}

/// Number of groups into which the passes of a render fall. Every group has sequences of its own, so means over
/// groups are independent, though the passes of a group are not. As few as still tell a variance: the fewer, the
/// longer the sequences.
pub const QUARTERS: u64 = 4;

/// Vertices of a path whose draws are points of sequences, the endpoint it starts from included. Eight rather than four
/// lowers squared errors by up to 3 % and costs no time that can be measured; later vertices bring too little.
const VERTICES: u32 = 8;

/// The group of pass `pass`. Passes of the picture count from 1 and take groups in turn.
#[inline]
pub fn quarter(pass: u64) -> u64 {
    turn(pass) % QUARTERS
}

/// Passes of the picture before this one. Pass 0 comes after all others: no number of passes gets there.
#[inline]
fn turn(pass: u64) -> u64 {
    pass.wrapping_sub(1)
}

/// The draws of all paths of a domain in one pass.
#[derive(Clone, Copy, Debug)]
pub struct Streams(Stream);

impl Streams {
    /// Those of `domain` in pass `pass` of a render with `seed`, all of them hashes.
    pub fn new(seed: u64, pass: u64, domain: Domain) -> Streams {
        let key = mix(seed.wrapping_add(GOLDEN));
        let key = mix(key ^ pass.wrapping_mul(GOLDEN).wrapping_add(domain as u64));
        Streams(Stream { key, reversed: 0, vertices: 0, chained: false })
    }

    /// The same with the first vertices of every path drawn from sequences, of which pass `pass` takes one point.
    pub fn in_sequence(seed: u64, pass: u64, domain: Domain) -> Streams {
        let index = turn(pass) / QUARTERS;
        // Where the index has more bits than a point, there are new sequences.
        let group = (index >> 32) * QUARTERS + quarter(pass);
        let key = mix(mix(seed.wrapping_add(GOLDEN)) ^ 0x2545_f491_4f6c_dd1d);
        let key = mix(key ^ group.wrapping_mul(GOLDEN).wrapping_add(domain as u64));
        Streams(Stream { key, reversed: (index as u32).reverse_bits(), vertices: VERTICES, chained: false })
    }

    /// Those of path `index`.
    #[inline]
    pub fn path(self, index: u64) -> Stream {
        Stream { key: mix(self.0.key.wrapping_add(index.wrapping_mul(GOLDEN))), ..self.0 }
    }
}

/// The draws of one path.
#[derive(Clone, Copy, Debug)]
pub struct Stream {
    /// That of all passes of a group, where draws are in sequences.
    key: u64,
    /// Index in the sequences of the group, bits in reverse order; 0 where there are none.
    reversed: u32,
    /// Vertices whose draws are points of sequences.
    vertices: u32,
    /// Its draws are the coordinates of a Markov chain.
    chained: bool,
}

impl Stream {
    /// The stream of path `index` in `domain` of pass `pass` of a render with `seed`, all its draws hashes.
    #[inline]
    pub fn new(seed: u64, pass: u64, domain: Domain, index: u64) -> Stream {
        Streams::new(seed, pass, domain).path(index)
    }

    /// The same with draws that are the coordinates of the Markov chain at work on this thread, and start as they are.
    #[must_use]
    pub fn chained(self) -> Stream {
        Stream { chained: true, ..self }
    }

    /// The draws at vertex `vertex` of the path (0 is the endpoint the path starts from).
    #[inline]
    pub fn vertex(self, vertex: u32) -> Draws {
        Draws {
            key: mix(self.key ^ (u64::from(vertex) + 1).wrapping_mul(0xd1b5_4a32_d192_ed03)),
            reversed: self.reversed,
            source: match vertex < self.vertices {
                _ if self.chained => Source::Chain,
                true => Source::Sequence,
                false => Source::Hash,
            },
        }
    }
}

/// Where draws come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Hash,
    Sequence,
    Chain,
}

/// The draws at one vertex of a path.
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    /// Of a stream in sequences, the key of all passes of a group.
    key: u64,
    reversed: u32,
    source: Source,
}

impl Draws {
    /// Draws for the `n`-th of several like decisions at this vertex.
    #[inline]
    pub fn nth(self, n: u32) -> Draws {
        Draws { key: mix(self.key ^ (u64::from(n) + 1).wrapping_mul(0xa076_1d64_78bd_642f)), ..self }
    }

    /// 64 bits for `purpose`, which passes of a group share.
    #[inline]
    fn key_of(self, purpose: Purpose) -> u64 {
        self.key.wrapping_add((purpose as u64).wrapping_mul(GOLDEN))
    }

    /// The coordinates of a chain.
    #[cold]
    #[inline(never)]
    fn chained(self, purpose: Purpose) -> Vec2 {
        Chain::draw_here(self.id(purpose), square(self.hash(purpose)))
    }

    /// What tells the coordinates of a chain apart.
    pub fn id(self, purpose: Purpose) -> u64 {
        mix(self.key_of(purpose))
    }

    /// 64 random bits for `purpose`.
    #[inline]
    pub fn bits(self, purpose: Purpose) -> u64 {
        if self.source == Source::Chain {
            let u = self.chained(purpose);
            return mix(u64::from(u.x.to_bits()) << 32 | u64::from(u.y.to_bits()));
        }
        self.hash(purpose)
    }

    #[inline]
    fn hash(self, purpose: Purpose) -> u64 {
        mix(self.key_of(purpose).wrapping_add(u64::from(self.reversed).wrapping_mul(0x9fb2_1c65_1e98_df25)))
    }

    #[inline]
    fn pair(self, purpose: Purpose) -> SobolPair {
        SobolPair::keyed(mix(self.key_of(purpose)))
    }

    /// Uniform on `[0, 1)`.
    #[inline]
    pub fn one(self, purpose: Purpose) -> f32 {
        match self.source {
            Source::Sequence => self.pair(purpose).first_reversed(self.reversed),
            Source::Hash => unit((self.hash(purpose) >> 32) as u32),
            Source::Chain => self.chained(purpose).x,
        }
    }

    /// The number of [`Draws::one`] with all of its 32 bits: to choose among more than 2^24.
    #[inline]
    pub fn one_fine(self, purpose: Purpose) -> f64 {
        match self.source {
            Source::Sequence => fine(self.pair(purpose).first_bits(self.reversed)),
            Source::Hash => fine((self.hash(purpose) >> 32) as u32),
            Source::Chain => f64::from(self.chained(purpose).x),
        }
    }

    /// Uniform on `[0, 1)^2`.
    #[inline]
    pub fn two(self, purpose: Purpose) -> Vec2 {
        match self.source {
            Source::Sequence => self.pair(purpose).point_reversed(self.reversed),
            Source::Hash => square(self.hash(purpose)),
            Source::Chain => self.chained(purpose),
        }
    }

    /// 32 random bits, the token of a ray's alpha decisions: a hash.
    #[inline]
    pub fn token(self, purpose: Purpose) -> u32 {
        (self.bits(purpose) >> 32) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and lag correlations of 10^6 draws stay within 5 sigma (error rate below 1e-5 with the 4 checks here).
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

    /// The pass that takes point `index` of a group's sequences.
    fn pass(group: u64, index: u64) -> u64 {
        1 + group + QUARTERS * index
    }

    fn draws(seed: u64, pass: u64, path: u64) -> Draws {
        Streams::in_sequence(seed, pass, Domain::Test).path(path).vertex(1)
    }

    /// All draws of 10^6 paths of one pass, as those that are hashes: within 5 sigma (error rate below 1e-5 with the
    /// 12 checks here).
    #[test]
    fn draws_in_sequence_are_uniform_and_uncorrelated_between_paths_vertices_and_purposes() {
        let n = 1_000_000u64;
        for turn in [0, 5, 1 << 40] {
            let (mut sum, mut products, mut last) = (0.0f64, [0.0f64; 4], 0.0);
            for i in 0..n {
                let stream = Streams::in_sequence(1, pass(2, turn), Domain::Test).path(i);
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

    /// 2^m points in a row, from a multiple of their number on, of every sequence of (path, vertex, purpose, n-th) of
    /// every group put one point in every elementary interval of area 2^-m; hashes do not.
    #[test]
    fn passes_of_a_group_are_nets() {
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
        for group in 0..QUARTERS {
            for path in 0..16 {
                for vertex in [0, 1, VERTICES - 1, VERTICES] {
                    let draws = |index| {
                        Streams::in_sequence(path, pass(group, index), Domain::CameraCorrelated)
                            .path(path)
                            .vertex(vertex)
                    };
                    let (sequence, nth) = (in_net(&draws), in_net(&|index| draws(index).nth(3)));
                    assert_eq!(
                        (sequence, nth),
                        (vertex < VERTICES, vertex < VERTICES),
                        "group {group}, path {path}, vertex {vertex}"
                    );
                }
            }
        }
    }

    /// Whatever is not a sample stays a hash of all that a pass is told apart by; hashed streams are the plain formula.
    #[test]
    fn tokens_and_later_vertices_are_hashes() {
        let mut seen = std::collections::HashSet::new();
        for pass in 0..1000 {
            for vertex in 0..VERTICES + 2 {
                let draws = Streams::in_sequence(7, pass, Domain::Test).path(5).vertex(vertex);
                assert!(seen.insert(draws.bits(Purpose::Alpha)), "pass {pass}, vertex {vertex}");
                assert!(seen.insert(draws.nth(1).bits(Purpose::Alpha)), "pass {pass}, vertex {vertex}");
            }
        }
        let hashed = Stream::new(7, 3, Domain::Light, 5).vertex(2);
        let key = mix(mix(7u64.wrapping_add(GOLDEN)) ^ 3u64.wrapping_mul(GOLDEN).wrapping_add(Domain::Light as u64));
        let key = mix(mix(key.wrapping_add(5u64.wrapping_mul(GOLDEN))) ^ 3u64.wrapping_mul(0xd1b5_4a32_d192_ed03));
        let bits = mix(key.wrapping_add((Purpose::Lobe as u64).wrapping_mul(GOLDEN)));
        assert_eq!((hashed.bits(Purpose::Lobe), hashed.one(Purpose::Lobe)), (bits, unit((bits >> 32) as u32)));
    }

    /// Passes 0 and those beyond 2^32 points of a sequence have draws of their own.
    #[test]
    fn every_pass_has_its_own_points() {
        let passes = [0, 1, 2, 5, pass(0, 1 << 32), pass(0, (1 << 32) + 1), pass(1, 2 << 32), u64::MAX];
        let points: std::collections::HashSet<_> =
            passes.map(|pass| draws(1, pass, 0).two(Purpose::Pixel).to_array().map(f32::to_bits)).into_iter().collect();
        assert_eq!(points.len(), passes.len());
        assert_eq!([1, 2, 3, 4, 5, 8, 9].map(quarter), [0, 1, 2, 3, 0, 3, 0]);
    }

    /// A quarter disc, of area pi / 4, times a slope, of mean 1/2: both are far from what elementary intervals tell
    /// at once.
    fn integrand(draws: Draws) -> f64 {
        let inside = draws.two(Purpose::Direction).length_squared() < 1.0;
        f64::from(u8::from(inside)) * f64::from(draws.one(Purpose::Lobe))
    }

    const INTEGRAL: f64 = std::f64::consts::PI / 8.0;

    /// Error of the mean over the first `count` points of a group's sequence.
    fn error(seed: u64, group: u64, path: u64, count: u64) -> f64 {
        let sum: f64 = (0..count).map(|index| integrand(draws(seed, pass(group, index), path))).sum();
        sum / count as f64 - INTEGRAL
    }

    /// Correlation of two errors, times the root of the number of pairs: of independent ones a standard normal
    /// deviate, nearly.
    fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
        let (mut xy, mut xx, mut yy, mut n) = (0.0, 0.0, 0.0, 0.0f64);
        for (x, y) in pairs {
            (xy, xx, yy, n) = (xy + x * y, xx + x * x, yy + y * y, n + 1.0);
        }
        xy / (xx * yy).sqrt() * n.sqrt()
    }

    /// Means over 16 points of groups, of neighbouring paths and of the domains of a pixel: within 5 sigma over 20
    /// 000 pixels (9 checks, error rate below 1e-5). Two stretches of one sequence, which make up for each other, do
    /// not pass.
    #[test]
    fn groups_paths_and_domains_are_independent() {
        let n = 20_000;
        for a in 0..QUARTERS {
            for b in 0..a {
                let z = correlation((0..n).map(|path| (error(3, a, path, 16), error(3, b, path, 16))));
                assert!(z.abs() < 5.0, "groups {a} and {b}: {z}");
            }
        }
        let paths = correlation((0..n).map(|path| (error(3, 0, path, 16), error(3, 0, path + 1, 16))));
        let seeds = correlation((0..n).map(|path| (error(3, 0, path, 16), error(4, 0, path, 16))));
        let in_domain = |domain, path| {
            let draws = |i| Streams::in_sequence(3, pass(0, i), domain).path(path).vertex(1);
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

    /// Errors of 64 passes, over 4000 pixels: without bias; the variance that groups tell is the true one; both
    /// within 5 sigma (error rate below 1e-5 with that of the hashes). Squared errors are below 0.4 of those of
    /// hashes, which fail that bound.
    #[test]
    fn sequences_tell_integrals_better_than_hashes() {
        let (pixels, passes) = (4000u64, 64);
        let (mut sum, mut squares, mut told, mut hashed) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for path in 0..pixels {
            let groups: Vec<f64> = (0..QUARTERS).map(|group| error(9, group, path, passes / QUARTERS)).collect();
            let mean = groups.iter().sum::<f64>() / QUARTERS as f64;
            (sum, squares) = (sum + mean, squares + mean * mean);
            let spread: f64 = groups.iter().map(|group| (group - mean) * (group - mean)).sum();
            told += spread / (QUARTERS * (QUARTERS - 1)) as f64;
            let of_hashes = (1..=passes).map(|pass| integrand(Stream::new(9, pass, Domain::Test, path).vertex(1)));
            hashed += (of_hashes.sum::<f64>() / passes as f64 - INTEGRAL).powi(2);
        }
        let n = pixels as f64;
        assert!((sum / n).abs() < 5.0 * (squares / n / n).sqrt(), "bias {}", sum / n);
        // Both are chi-squared, with one degree of freedom and with three per pixel.
        let sigma = (2.0 / n + 2.0 / (n * (QUARTERS - 1) as f64)).sqrt();
        assert!((told / squares - 1.0).abs() < 5.0 * sigma, "groups tell {told} of {squares}");
        // Variance of an integrand whose square has mean pi / 12, over 64 points.
        let independent = n * (std::f64::consts::PI / 12.0 - INTEGRAL * INTEGRAL) / passes as f64;
        let low = |squares: f64| squares < 0.4 * independent;
        assert!(low(squares), "squared errors {} of hashes'", squares / independent);
        assert!(!low(hashed), "hashes pass: {}", hashed / independent);
        assert!((hashed / independent - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "hashes: {}", hashed / independent);
    }
}
