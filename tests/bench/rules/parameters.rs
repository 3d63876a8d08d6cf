//! Effect of CPPM's parameters on its error: Tables 2 to 4 of \[CPPM 2020\].

use crate::ground::{Ground, settings};
use caustique::estimator::rule::chi_squared::ChiSquaredSettings;
use caustique::render::{Method, Settings};
use serde_json::{Value, json};

/// The paper's settings with the table of each.
fn variants() -> Vec<(&'static str, ChiSquaredSettings)> {
    let usual = ChiSquaredSettings::default();
    let mut all = vec![("default", usual)];
    for (k, beta) in [(0.7, 2.0), (0.8, 1.0), (0.8, 1.6), (0.9, 1.2)] {
        all.push(("rate", ChiSquaredSettings { k, beta, ..usual }));
    }
    for annuli in 1..=3 {
        let sectors = [4, 6, 8, 10].map(|sectors| ("partition", ChiSquaredSettings { annuli, sectors, ..usual }));
        all.extend(sectors.into_iter().filter(|(_, settings)| *settings != usual));
    }
    for significance in [0.01, 0.1] {
        all.push(("significance", ChiSquaredSettings { significance, ..usual }));
    }
    all
}

/// Errors of all variants and of SPPM, by seed.
pub fn parameters(ground: &Ground, (photons, iterations, seeds): (u32, u64, u64), reference_seconds: f64) -> Value {
    let reference = ground.reference(reference_seconds);
    let variants = variants();
    let mut errors: Vec<Vec<Value>> = variants.iter().map(|_| Vec::new()).collect();
    let mut sppm = Vec::new();
    let after = |settings: &Settings| reference.errors(&ground.render(settings, iterations)).object();
    for seed in 0..seeds {
        sppm.push(after(&settings(Method::Sppm, photons, seed)));
        for ((_, chi_squared), errors) in variants.iter().zip(&mut errors) {
            let chi_squared = *chi_squared;
            errors.push(after(&Settings { chi_squared, ..settings(Method::Cppm, photons, seed) }));
        }
        eprintln!("{}: seed {seed} done", ground.name);
    }
    let rows = variants.iter().zip(errors).map(|((table, s), errors)| {
        json!({
            "table": table, "k": s.k, "beta": s.beta, "annuli": s.annuli, "sectors": s.sectors, "significance": s.significance,
            "errors": errors,
        })
    });
    json!({
        "scene": ground.name, "size": ground.size(), "photons": photons, "iterations": iterations, "seeds": seeds,
        "reference_iterations": reference.iterations, "sppm": sppm, "rows": rows.collect::<Vec<_>>(),
    })
}
