//! Compares the cost of an iteration that `--method auto` predicts from counted work with the measured cost.
//!
//! `cargo bench --bench cost -- SCENE.glb... [width=W] [levels=M]`: core-seconds of an iteration by candidate and
//! scene. The last line is JSON for `scripts/lab`.

use caustique::choose::counted_cost;
use caustique::render::Candidate;
use caustique::render::{Levels, Method, RenderInput, Session, Settings, cpu_seconds};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{CameraRequest, Scene};
use caustique::transport::Indirect;

/// Number of iterations, of which the median counts.
const ITERATIONS: usize = 7;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let number = |name: &str| arguments.iter().find_map(|a| a.strip_prefix(name)?.parse().ok());
    let width = number("width=").unwrap_or(320);
    let levels = number("levels=").map(|levels| Levels::new(levels as usize));
    let plain = Candidate::unguided;
    let caustics = Candidate { indirect: Indirect::Paths, guided: true, ..plain(Method::Sppm) };
    let candidates = [
        plain(Method::Path),
        plain(Method::Bdpt),
        plain(Method::Vcm),
        plain(Method::Sppm),
        Candidate { guided: true, ..plain(Method::Sppm) },
        caustics,
    ];
    let mut rows = Vec::new();
    for path in arguments.iter().filter(|a| !a.contains('=')) {
        let description = read(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let scene = Scene::build(description, 0).unwrap_or_else(|e| panic!("{e}"));
        let camera = scene
            .camera(&CameraRequest { width: Some(width), ..CameraRequest::default() })
            .unwrap_or_else(|e| panic!("{e}"));
        for candidate in candidates {
            let settings = Settings::for_candidate(candidate);
            let settings = Settings { levels: levels.unwrap_or(settings.levels), ..settings };
            let stage = RenderInput::new(&scene, &camera, &settings);
            let mut session = Session::new(&stage);
            session.step();
            let mut taken: Vec<f64> = (0..ITERATIONS)
                .map(|_| {
                    let start = cpu_seconds();
                    session.step();
                    cpu_seconds() - start
                })
                .collect();
            taken.sort_by(f64::total_cmp);
            let seconds = taken[ITERATIONS / 2];
            let counted = counted_cost(&scene, &camera, candidate, &settings);
            println!(
                "{path:<24} {:<60} counted {counted:7.3}  measured {seconds:7.3}  ratio {:5.2}",
                candidate.name(),
                counted / seconds
            );
            rows.push(
                serde_json::json!({"scene": path, "candidate": candidate.name(), "counted": counted, "measured": seconds}),
            );
        }
    }
    println!("{}", serde_json::json!({ "rows": rows }));
}
