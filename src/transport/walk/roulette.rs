//! Russian roulette: the probability that a path continues.

/// Number of bounces after which even a path without losses may end, so that light trapped between perfect mirrors ends
/// without a limit on depth.
const LATE_BOUNCES: u32 = 64;
/// Number of bounces after which only trapped light is left.
const TRAPPED_BOUNCES: u32 = 1 << 16;
/// Number of bounces after which light is taken for trapped if it met perfect mirrors and clear glass only. Such a path
/// rarely comes out again, and no next-event estimation could have contributed.
const TRAPPED_BOUNCES_IN_MIRRORS: u32 = 1 << 8;

/// Fraction of the initial throughput down to which roulette does not end a path. Roulette increases the weight of
/// surviving paths. From the first bounce on, it would save nearly half of the time but more than double squared errors;
/// this value is about optimal.
pub const SPARED_BY_ROULETTE: f32 = 0.25;
/// Smallest probability of continuing, which bounds the weight of surviving paths.
const MIN_SURVIVAL: f32 = 0.02;

/// Largest number of smooth interfaces at which a camera path splits into reflection and transmission.
pub const MAX_SPLITS: u32 = 4;
/// Smallest share of the weight of a camera path that a branch behind a smooth interface has when both are followed. So a
/// path has at most about the reciprocal of this number of branches.
const MIN_BRANCH_SHARE: f32 = 0.25;
/// Smallest share of the weight of a camera path that is split into several wavelengths.
pub(in crate::transport) const MIN_DISPERSED_SHARE: f32 = 0.5;

/// Share that the weaker branch behind a smooth interface has where it is followed, of a path that has the share `path`
/// itself. `weak` is the branch's probability if one of the two is chosen. 1: the other branch is not followed then.
#[inline]
pub(in crate::transport) fn branch_share(path: f32, weak: f32) -> f32 {
    (MIN_BRANCH_SHARE / path).clamp(weak, 1.0)
}

/// Probability that a path of `depth` bounces continues, if it is expected to keep the fraction `expected` of its
/// weight. `mirrored` tells whether it continues by a delta lobe; it is called for long paths only.
#[inline]
pub(in crate::transport) fn survival(expected: f32, depth: u32, mirrored: impl FnOnce() -> bool) -> f32 {
    // Written so that NaN ends the path.
    let survival = if expected > 0.0 { expected.clamp(MIN_SURVIVAL, 1.0) } else { 0.0 };
    survival.min(late_survival(depth, mirrored))
}

/// Upper bound of the probability of continuing.
///
/// With `1 - c / n` at the `n`-th bounce, a path reaches it with probability `P(n) ~ n^-c`. An estimate that collects
/// `f(n)` there has the second moment `sum_mn f(m) f(n) / P(min(m, n))`. It is finite for any light that loses a fixed
/// fraction at every bounce; a constant survival `s` would have to exceed the squared albedo. For c = 1/2 it grows as a
/// logarithm only for light from a half space without absorption, `f(n) ~ n^-3/2`. A trapped path then has 16 sqrt(n)
/// bounces among the first n on average; c = 2 from some n on ends it.
#[inline]
pub(in crate::transport) fn late_survival(depth: u32, mirrored: impl FnOnce() -> bool) -> f32 {
    if depth <= LATE_BOUNCES {
        return 1.0;
    }
    let trapped = if mirrored() { TRAPPED_BOUNCES_IN_MIRRORS } else { TRAPPED_BOUNCES };
    let c = if depth <= trapped { 0.5 } else { 2.0 };
    1.0 - c / depth as f32
}
