//! Cost of an iteration by phase, and the overhead of bandwidth levels and the finish, as Table 2 of
//! \[post-reconstruction 2021\].

use super::entry::Entry;
use super::point::RunEnd;
use crate::render::Phases;
use serde::Serialize;

/// Cost of an iteration of one entry, a row of the report's table: means over seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Overhead {
    /// Iterations of a run.
    pub iterations: f64,
    /// Wall-clock seconds of the pilot, the preparation by test renders, and of the iterations.
    pub render_seconds: f64,
    /// Wall-clock seconds of the finish with its layers, which runs once; `None` without a finish.
    pub finish_seconds: Option<f64>,
    /// Wall-clock seconds of render and finish, divided by iterations.
    pub seconds_per_iteration: f64,
    /// Core-seconds of render and finish, divided by iterations.
    pub cpu_seconds_per_iteration: f64,
    /// Core-seconds of the pilot, the preparation by test renders; it runs once.
    pub pilot: f64,
    /// Core-seconds per iteration for tracing light paths.
    pub light: f64,
    /// Core-seconds per iteration for building photon maps.
    pub map: f64,
    /// Core-seconds per iteration for tracing camera paths, and light paths that are traced in turns with them.
    pub eye: f64,
    /// Seconds per iteration relative to the first entry's; NaN if either is unknown.
    pub over_first: f64,
    /// Seconds per iteration relative to the first entry with the same method; `None` if this is the first.
    pub over_plain: Option<f64>,
}

/// The cost of iterations, one row for each entry; `None` for a run without iterations.
pub fn table(entries: &[Entry], endings: &[RunEnd]) -> Vec<Option<Overhead>> {
    let rows: Vec<Option<Overhead>> = (0..entries.len()).map(|run| row(run, endings)).collect();
    let cost = |run: usize| rows[run].as_ref().map(|row| row.seconds_per_iteration).filter(|cost| *cost > 0.0);
    let against = |run: usize, base: usize| Some(cost(run)? / cost(base)?);
    let method = |run: usize| entries[run].settings.method;
    let mut table = rows.clone();
    for (run, row) in table.iter_mut().enumerate() {
        let Some(row) = row else { continue };
        row.over_first = against(run, 0).unwrap_or(f64::NAN);
        let plain = (0..run).find(|&other| method(other) == method(run));
        row.over_plain = plain.and_then(|plain| against(run, plain));
    }
    table
}

fn row(run: usize, endings: &[RunEnd]) -> Option<Overhead> {
    let mine: Vec<&RunEnd> = endings.iter().filter(|e| e.run == run && e.iterations > 0).collect();
    let n = mine.len() as f64;
    let mean = |get: &dyn Fn(&RunEnd) -> f64| mine.iter().map(|ending| get(ending)).sum::<f64>() / n;
    if mine.is_empty() {
        return None;
    }
    let finish = |e: &RunEnd| e.finish.unwrap_or_default();
    let each = |get: fn(&Phases) -> f64| mean(&|e| get(&e.phases) / e.iterations as f64);
    Some(Overhead {
        iterations: mean(&|e| e.iterations as f64),
        render_seconds: mean(&|e| e.spent.seconds),
        finish_seconds: mine[0].finish.map(|_| mean(&|e| finish(e).seconds)),
        seconds_per_iteration: mean(&|e| (e.spent.seconds + finish(e).seconds) / e.iterations as f64),
        cpu_seconds_per_iteration: mean(&|e| (e.spent.cpu_seconds + finish(e).cpu_seconds) / e.iterations as f64),
        pilot: mean(&|e| e.phases.pilot),
        light: each(|p| p.light),
        map: each(|p| p.map),
        eye: each(|p| p.eye),
        over_first: 1.0,
        over_plain: None,
    })
}
