//! Division of light paths among tasks.

use rayon::prelude::*;
use std::ops::Range;

/// Light paths per parallel task. A constant, so that the order of photons does not depend on the number of threads.
const PATHS_PER_TASK: u32 = 1024;

/// Ranges of indices of `paths` light paths, one range per parallel task.
pub(super) fn light_path_ranges(paths: u32) -> impl IndexedParallelIterator<Item = Range<u32>> {
    let range = move |first: u32| first..paths.min(first.saturating_add(PATHS_PER_TASK));
    (0..paths).into_par_iter().step_by(PATHS_PER_TASK as usize).map(range)
}
