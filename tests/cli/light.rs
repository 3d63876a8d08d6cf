//! Whole renders of small files whose mean radiance is known.

use crate::{Folder, values};
use std::path::Path;

/// Methods of which each samples light in a way of its own, with options.
const METHODS: [&str; 4] = ["path", "bdpt", "vcm", "sppm --photons 40000"];
/// A shutter that is open for all of the animation.
const OPEN: &str = "--frames 0 --frame-rate 1 --shutter 0,1";

/// Solids with alpha, hidden solids, fires, and lights and solids that change have the light that they should, by all
/// methods. The tolerance is at least four standard errors of the noisiest method.
#[test]
fn files_have_their_known_light() {
    let folder = Folder::new();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/light");
    for entry in std::fs::read_dir(source).expect("the folder is there") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, folder.path(&path.file_name().expect("a name").to_string_lossy())).expect("a copy");
    }
    for (file, options, expected, tolerance) in [
        ("wax_alpha1", "", 0.8896, 0.08),
        ("wax_alpha05", "", 0.4448, 0.08),
        ("hidden_camera_inside", "", 1.0, 1e-4),
        ("fire_alone", "", 1.0, 1e-3),
        ("fade_in", "--frames 0 --frame-rate 24", 0.0, 0.0),
        ("fade_in", OPEN, 1.0 / std::f64::consts::PI, 0.01),
        // A tessellated ball of radius 0.1 and of intensity 5 in the mean.
        ("fade_in_ball", OPEN, 5.0 / (0.01 * std::f64::consts::PI), 0.02),
        ("overlap_scaled", OPEN, 0.2925, 0.01),
        ("overlap_scaled", "--frames 0 --frame-rate 1 --shutter 0.75,0.75", 0.3679, 1e-3),
        // 1000 candela within 10 degrees both ways, on an area of 27.98 of reflectance 0.8.
        ("ies_typeB", "", 1000.0 * 0.12123 / 27.98 * 0.8 / std::f64::consts::PI, 0.005),
    ] {
        for method in METHODS {
            let picture = "-o picture.exr --overwrite --no-finish --layers beauty --width 16 --height 16";
            let outcome =
                folder.run(&format!("render {file}.gltf {picture} --iterations 64 --method {method} {options}"));
            assert_eq!(outcome.code, Some(0), "{file}: {}", outcome.stderr);
            let (set, _) = folder.read("picture.exr");
            let pixels = values(&set, "");
            let mean = pixels.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / (3 * pixels.len()) as f64;
            println!("{file} {options}, {method}: {mean:.5}, {expected:.5}");
            assert!((mean - expected).abs() <= tolerance * expected, "{file} {options}, {method}: {mean}");
        }
    }
}
