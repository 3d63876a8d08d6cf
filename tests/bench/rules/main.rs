//! Compares the progressive rules SPPM, APPM and CPPM on the scenes of this project.
//!
//! `cargo bench --bench rules -- FIGURE [KEY=VALUE...]`. Standard output is one JSON object for `scripts/lab`.

mod ground;
mod neighbours;
mod parameters;
mod plot;
mod points;
mod race;
mod surface;

use ground::Ground;
use std::path::PathBuf;

/// KEY=VALUE options of the command line.
struct Options(Vec<(String, String)>);

impl Options {
    fn text(&self, key: &str, default: &str) -> String {
        let found = self.0.iter().find(|(name, _)| name == key);
        found.map_or(default, |(_, value)| value).to_string()
    }

    fn number(&self, key: &str, default: f64) -> f64 {
        let text = self.text(key, &default.to_string());
        text.parse().unwrap_or_else(|_| panic!("{key}={text} is no number"))
    }

    fn four(&self, key: &str) -> [usize; 4] {
        let text = self.text(key, "");
        let numbers: Option<Vec<usize>> = text.split(',').map(|part| part.parse().ok()).collect();
        let four = numbers.and_then(|numbers| numbers.try_into().ok());
        four.unwrap_or_else(|| panic!("{key}={text} is not four numbers"))
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let Some((figure, rest)) = arguments.split_first() else { return };
    let pairs = rest.iter().map(|pair| pair.split_once('=').unwrap_or_else(|| panic!("{pair} is not KEY=VALUE")));
    let options = Options(pairs.map(|(key, value)| (key.into(), value.into())).collect());
    let width = options.number("width", 64.0) as u32;
    let scenes = options.text("scene", "torus");
    let grounds: Vec<Ground> = scenes.split(',').map(|scene| Ground::new(scene, width)).collect();
    let photons = options.number("photons", 4096.0) as u32;
    let iterations = options.number("iterations", 1000.0) as u64;
    let seeds = options.number("seeds", 4.0) as u64;
    let reference = options.number("reference", 80.0);
    let file = PathBuf::from(options.text("file", ""));
    let work = (photons, iterations, seeds);
    let found = match figure.as_str() {
        "race" => race::race(&grounds[0], work, reference),
        "parameters" => parameters::parameters(&grounds[0], work, reference),
        "points" => {
            let [a, b, c, d] = options.four("places");
            points::points(&grounds[0], work, reference, [[a, b], [c, d]], &file)
        }
        "neighbours" => neighbours::neighbours(&grounds, work, reference, &file),
        "surface" => surface::surface(&grounds[0], photons, iterations, options.four("window"), &file),
        _ => panic!("no figure {figure}"),
    };
    println!("{found}");
}
