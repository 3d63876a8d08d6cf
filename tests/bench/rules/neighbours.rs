//! Error as a function of the number of neighbours that set the initial bandwidth: Figure 11 of \[CPPM 2020\].

use crate::ground::{Errors, Ground, METHODS, mean, settings};
use crate::plot::{Curve, Panel, panels};
use caustique::estimator::InitialBandwidth;
use caustique::render::{Method, Settings};
use serde_json::{Value, json};
use std::path::Path;

const NEIGHBOURS: [usize; 6] = [5, 10, 20, 40, 80, 160];

/// Errors by method and number of neighbours, and of APPM with a uniform initial bandwidth of a tenth of the scene's
/// radius.
pub fn neighbours(
    grounds: &[Ground],
    (photons, iterations, seeds): (u32, u64, u64),
    reference_seconds: f64,
    file: &Path,
) -> Value {
    let (mut all, mut drawn) = (Vec::new(), Vec::new());
    for ground in grounds {
        let reference = ground.reference(reference_seconds);
        let after = |settings: &Settings| reference.errors(&ground.render(settings, iterations));
        let mut found: Vec<Vec<Vec<Errors>>> = vec![vec![Vec::new(); NEIGHBOURS.len()]; METHODS.len()];
        let mut everywhere = Vec::new();
        let radius = 0.1 * ground.scene.lights.sky().radius;
        for seed in 0..seeds {
            for (method, found) in METHODS.iter().zip(&mut found) {
                for (k, found) in NEIGHBOURS.iter().zip(found) {
                    let initial = InitialBandwidth::Nearest(*k);
                    found.push(after(&Settings { initial_bandwidth: initial, ..settings(*method, photons, seed) }));
                }
            }
            let initial = InitialBandwidth::Fixed(radius);
            everywhere.push(after(&Settings { initial_bandwidth: initial, ..settings(Method::Appm, photons, seed) }));
            eprintln!("{}: seed {seed} done", ground.name);
        }
        let point = |k: usize, errors: &[Errors]| {
            let values: Vec<f64> = errors.iter().map(|e| e.display).collect();
            let (mean, error) = mean(&values);
            (k as f64, mean, error)
        };
        let mut curves: Vec<Curve> = METHODS
            .iter()
            .zip(&found)
            .enumerate()
            .map(|(colour, (method, found))| Curve {
                name: method.name().to_uppercase(),
                points: NEIGHBOURS.iter().zip(found).map(|(k, errors)| point(*k, errors)).collect(),
                dashed: false,
                colour,
            })
            .collect();
        curves.push(Curve {
            name: "APPM from one bandwidth".into(),
            points: [NEIGHBOURS[0], NEIGHBOURS[5]].map(|k| point(k, &everywhere)).to_vec(),
            dashed: true,
            colour: 1,
        });
        let title = format!("{}: squared error on a screen", ground.name);
        drawn.push(Panel { title, across: "neighbours that set the first bandwidth", curves });
        let objects = |errors: &[Errors]| errors.iter().map(Errors::object).collect::<Vec<_>>();
        let rows = METHODS.iter().zip(&found).map(|(method, found)| {
            json!({"method": method.name(), "errors": found.iter().map(|e| objects(e)).collect::<Vec<_>>()})
        });
        all.push(json!({
            "scene": ground.name, "size": ground.size(), "rows": rows.collect::<Vec<_>>(),
            "radius": radius, "everywhere": objects(&everywhere),
        }));
    }
    panels(file, &drawn, (1, grounds.len())).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    json!({"photons": photons, "iterations": iterations, "seeds": seeds, "neighbours": NEIGHBOURS, "scenes": all})
}
