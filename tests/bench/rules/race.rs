//! Error as a function of iterations and core-seconds by method: Table 1 of \[CPPM 2020\].

use crate::ground::{Ground, METHODS, Shot, moments, settings};
use caustique::render::{RenderInput, Session};
use serde_json::{Value, json};

/// Methods alternate in every iteration, so that other load on the machine affects all equally.
pub fn race(ground: &Ground, (photons, iterations, seeds): (u32, u64, u64), reference_seconds: f64) -> Value {
    let reference = ground.reference(reference_seconds);
    let moments = moments(iterations);
    let mut runs: Vec<Vec<Value>> = METHODS.iter().map(|_| Vec::new()).collect();
    let mut last: Vec<Vec<Shot>> = METHODS.iter().map(|_| Vec::new()).collect();
    for seed in 0..seeds {
        let stages: Vec<RenderInput<'_>> = METHODS.iter().map(|m| ground.stage(&settings(*m, photons, seed))).collect();
        let mut sessions: Vec<Session<'_>> = stages.iter().map(Session::new).collect();
        let mut points: Vec<Vec<Value>> = METHODS.iter().map(|_| Vec::new()).collect();
        for i in 1..=iterations {
            for (session, points) in sessions.iter_mut().zip(&mut points) {
                session.step();
                if moments.contains(&i) {
                    let errors = reference.errors(&Shot::of(session));
                    points.push(json!([i, session.spent().cpu_seconds, errors.all, errors.photons, errors.display]));
                }
            }
        }
        for (run, points) in runs.iter_mut().zip(points) {
            run.push(points.into());
        }
        for (last, session) in last.iter_mut().zip(&sessions) {
            last.push(Shot::of(session));
        }
        eprintln!("{}: seed {seed} done", ground.name);
    }
    let by_method = |last: &Vec<Shot>| Some(reference.squared_bias(last.first()?, last.get(1)?));
    let biases: serde_json::Map<String, Value> =
        METHODS.iter().zip(&last).map(|(method, last)| (method.name().to_string(), json!(by_method(last)))).collect();
    let runs: serde_json::Map<String, Value> =
        METHODS.iter().zip(runs).map(|(method, run)| (method.name().to_string(), run.into())).collect();
    json!({
        "scene": ground.name, "size": ground.size(), "photons": photons, "iterations": iterations, "seeds": seeds,
        "reference": {"iterations": reference.iterations, "half": reference.noise(), "core_seconds": reference_seconds},
        "columns": ["iterations", "core_seconds", "all", "photons", "display"], "runs": runs, "squared_biases": biases,
    })
}
