//! Bandwidths on a curved surface: Figure 4 of \[CPPM 2020\].

use crate::ground::{Ground, settings};
use caustique::film::Size;
use caustique::image::png;
use caustique::image::tonemap::Look;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::{Method, Session};
use serde_json::{Value, json};
use std::path::Path;

/// Colours from small to large values, black to yellow (after matplotlib's inferno).
const SCALE: [[f32; 3]; 6] = [
    [0.0, 0.0, 0.015],
    [0.26, 0.04, 0.41],
    [0.58, 0.15, 0.40],
    [0.87, 0.32, 0.23],
    [0.99, 0.65, 0.04],
    [0.99, 1.0, 0.64],
];

fn colour(share: f32) -> Rgb {
    let at = share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f32;
    let low = (at as usize).min(SCALE.len() - 2);
    Vec3::from_array(SCALE[low]).lerp(Vec3::from_array(SCALE[low + 1]), at - low as f32)
}

/// A crop of the picture by CPPM, and the bandwidths of SPPM and of CPPM there on a common logarithmic scale.
pub fn surface(ground: &Ground, photons: u32, iterations: u64, window: [usize; 4], file: &Path) -> Value {
    let (width, _) = ground.size();
    let [x0, y0, w, h] = window;
    let cut = |values: &dyn Fn(usize) -> Rgb| -> Vec<Rgb> {
        (0..h).flat_map(|y| (0..w).map(move |x| (y + y0) * width + x + x0)).map(values).collect()
    };
    let mut picture = Vec::new();
    let maps: Vec<Vec<f32>> = [Method::Sppm, Method::Cppm]
        .into_iter()
        .map(|method| {
            let stage = ground.stage(&settings(method, photons, 0));
            let mut session = Session::new(&stage);
            while session.iterations() < iterations {
                session.step();
            }
            picture = session.pixels().iter().map(|p| p.mean(0)).collect::<Vec<DVec3>>();
            let layers = session.layers(|name| name == "Radius1").unwrap_or_else(|e| panic!("{e}"));
            layers.get("Radius1").map(|l| l.triples().iter().map(|v| v[0]).collect()).unwrap_or_default()
        })
        .collect();
    // The scale covers the values in the window except the outermost hundredths.
    let inside: Vec<usize> = (0..h).flat_map(|y| (0..w).map(move |x| (y + y0) * width + x + x0)).collect();
    let mut all: Vec<f32> = maps.iter().flat_map(|map| inside.iter().map(|p| map[*p])).collect();
    all.sort_by(f32::total_cmp);
    let (low, high) = (all[all.len() / 100], all[all.len() - 1 - all.len() / 100]);
    let parts = [
        cut(&|p| Look::default().display(picture[p].as_vec3())),
        cut(&|p| colour((maps[0][p] / low).ln() / (high / low).ln())),
        cut(&|p| colour((maps[1][p] / low).ln() / (high / low).ln())),
    ];
    let row = |y: usize| parts.iter().flat_map(move |part| part[y * w..(y + 1) * w].iter().copied());
    png::write(file, Size { width: 3 * w, height: h }, (0..h).flat_map(row)).unwrap_or_else(|e| panic!("{e}"));
    let quartiles = |map: &Vec<f32>| {
        let mut values: Vec<f32> = inside.iter().map(|p| map[*p]).collect();
        values.sort_by(f32::total_cmp);
        [0.05, 0.25, 0.5, 0.75, 0.95].map(|q| values[(q * (values.len() - 1) as f64) as usize])
    };
    json!({
        "scene": ground.name, "size": ground.size(), "photons": photons, "iterations": iterations, "window": window,
        "scale": [low, high], "quantiles": [0.05, 0.25, 0.5, 0.75, 0.95], "sppm": quartiles(&maps[0]), "cppm": quartiles(&maps[1]),
    })
}
