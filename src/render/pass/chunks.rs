//! Light paths in units of work of a fixed size, so that results do not depend on threads.

use rayon::prelude::*;
use std::ops::Range;

/// Light paths per unit of work. Constant, so that the photons' order does not depend on threads.
const CHUNK: u32 = 1024;

/// So many light paths in units of work.
pub(super) fn chunks(paths: u32) -> impl IndexedParallelIterator<Item = Range<u32>> {
    (0..paths).into_par_iter().step_by(CHUNK as usize).map(move |first| first..paths.min(first.saturating_add(CHUNK)))
}
