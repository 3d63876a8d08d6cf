//! Bandwidth and error of pixels as functions of iterations: Figure 9 of \[CPPM 2020\].

use crate::ground::{Ground, METHODS, Shot, moments, settings};
use crate::plot::{Curve, Panel, panels};
use caustique::render::{RenderInput, Session};
use serde_json::{Value, json};
use std::path::Path;

/// Bandwidths (of the first seed) and errors of the light of photons (root mean square over seeds, relative to the
/// truth) at a smooth place and at an edge.
pub fn points(
    ground: &Ground,
    (photons, iterations, seeds): (u32, u64, u64),
    reference_seconds: f64,
    places: [[usize; 2]; 2],
    file: &Path,
) -> Value {
    let reference = ground.reference(reference_seconds);
    let (width, _) = ground.size();
    let moments = moments(iterations);
    let pixels = places.map(|[x, y]| y * width + x);
    // By place and method.
    let mut bandwidths = vec![vec![Vec::new(); METHODS.len()]; pixels.len()];
    let mut errors = vec![vec![vec![0.0; moments.len()]; METHODS.len()]; pixels.len()];
    for seed in 0..seeds {
        let stages: Vec<RenderInput<'_>> = METHODS.iter().map(|m| ground.stage(&settings(*m, photons, seed))).collect();
        for (m, stage) in stages.iter().enumerate() {
            let mut session = Session::new(stage);
            for (at, moment) in moments.iter().enumerate() {
                while session.iterations() < *moment {
                    session.step();
                }
                let layers = session.layers(|name| name == "Radius1").unwrap_or_else(|e| panic!("{e}"));
                let radii = layers.get("Radius1").map(|layer| layer.triples()).unwrap_or_default();
                let shot = Shot::of(&session);
                for (p, pixel) in pixels.iter().enumerate() {
                    let truth = reference.photons(*pixel);
                    let error = (shot.photons[*pixel] - truth).length() / truth.length();
                    errors[p][m][at] += error * error / seeds as f64;
                    if seed == 0 {
                        bandwidths[p][m].push(f64::from(radii[*pixel][0]));
                    }
                }
            }
        }
        eprintln!("{}: seed {seed} done", ground.name);
    }
    let rooted = |squares: &Vec<f64>| squares.iter().map(|s| s.sqrt()).collect::<Vec<f64>>();
    let errors: Vec<Vec<Vec<f64>>> = errors.iter().map(|each| each.iter().map(rooted).collect()).collect();
    let curves = |of: &Vec<Vec<f64>>| -> Vec<Curve> {
        let each = METHODS.iter().zip(of).enumerate();
        each.map(|(colour, (method, values))| {
            let points = moments.iter().zip(values).map(|(n, v)| (*n as f64, *v, 0.0)).collect();
            Curve { name: method.name().to_uppercase(), points, dashed: false, colour }
        })
        .collect()
    };
    let names = ["smooth light", "edge of a caustic"];
    let panel = |title: String, curves| Panel { title, across: "iterations", curves };
    let drawn: Vec<Panel> = (0..2)
        .flat_map(|p| {
            [
                panel(format!("{}: bandwidth (m)", names[p]), curves(&bandwidths[p])),
                panel(format!("{}: error, of the truth", names[p]), curves(&errors[p])),
            ]
        })
        .collect();
    panels(file, &drawn, (2, 2)).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let last = |of: &Vec<Vec<f64>>| of.iter().map(|v| v.last().copied()).collect::<Vec<_>>();
    json!({
        "scene": ground.name, "size": ground.size(), "photons": photons, "iterations": iterations, "seeds": seeds, "places": places,
        "methods": METHODS.map(|m| m.name()), "moments": moments, "bandwidths": bandwidths, "errors": errors,
        "last": {"bandwidths": bandwidths.iter().map(last).collect::<Vec<_>>(), "errors": errors.iter().map(last).collect::<Vec<_>>()},
        "truth": pixels.map(|p| reference.photons(p).to_array()),
        "noise": pixels.map(|p| {
            let [a, b] = &reference.halves;
            0.5 * a.photons[p].distance(b.photons[p]) / reference.photons(p).length()
        }),
    })
}
