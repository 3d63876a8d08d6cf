//! How probable it is that a path goes on.

/// After this many bounces even a path that loses nothing may end, so that light trapped between perfect mirrors ends
/// without a limit on depth.
const LATE: u32 = 64;
/// After this many all but such light is gone.
const TRAPPED: u32 = 1 << 16;
/// The same where nothing but perfect mirrors and clear glass is met: what gets so far between them most often never
/// comes out, and there is no next-event estimation on the way that could have found anything.
const TRAPPED_IN_MIRRORS: u32 = 1 << 8;

/// Least probability of going on: keeps the weight of what survives bounded.
const LEAST_SURVIVAL: f32 = 0.02;

/// Probability of going on where a path of `depth` keeps a share `expected` of its weight; `mirrored` says whether by
/// a delta lobe, and is asked late alone.
#[inline]
pub(super) fn survival(expected: f32, depth: u32, mirrored: impl FnOnce() -> bool) -> f32 {
    // Written so that NaN ends the path.
    let survival = if expected > 0.0 { expected.clamp(LEAST_SURVIVAL, 1.0) } else { 0.0 };
    survival.min(late_survival(depth, mirrored))
}

/// Probability of going on at most.
///
/// With `1 - c / n` at the `n`-th bounce a path gets there with `P(n) ~ n^-c`, and an estimate that finds `f(n)` on its
/// way has the second moment `sum_mn f(m) f(n) / P(min(m, n))`. It is finite for whatever loses a share of itself at
/// every bounce, whatever that share, unlike with a constant survival `s`, which must be above the albedo squared; and
/// for c = 1/2 it grows as a logarithm only for what comes back out of a half space that absorbs nothing, `f(n) ~
/// n^-3/2`. A trapped path then has 16 sqrt(n) bounces among the first n on average: with c = 2 from some n on, an end.
#[inline]
pub(super) fn late_survival(depth: u32, mirrored: impl FnOnce() -> bool) -> f32 {
    if depth <= LATE {
        return 1.0;
    }
    let trapped = if mirrored() { TRAPPED_IN_MIRRORS } else { TRAPPED };
    let c = if depth <= trapped { 0.5 } else { 2.0 };
    1.0 - c / depth as f32
}
