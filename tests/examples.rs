//! The examples of the library run, and write what they promise.

#[path = "../examples/layers.rs"]
mod layers;
#[path = "../examples/picture.rs"]
mod picture;
#[path = "../examples/progress.rs"]
mod progress;
#[path = "../examples/scene_from_code.rs"]
mod scene_from_code;

use caustique::image::exr;
use std::path::Path;

#[test]
fn examples_run() {
    let folder = tempfile::tempdir().unwrap();
    std::env::set_current_dir(folder.path()).unwrap();
    layers::main().unwrap();
    picture::main().unwrap();
    progress::main().unwrap();
    scene_from_code::main().unwrap();
    let read = |name: &str| exr::read(Path::new(name)).unwrap().0;
    assert_eq!(read("prism.exr").width, 160);
    assert!(Path::new("prism.png").exists());
    assert!(read("prism-so-far.exr").iterations.is_some_and(|iterations| iterations < 1000));
    // A Lambertian square of albedo 1 below a point light of intensity 100 at a distance of 2: 100 / 4 / pi at its middle.
    let floor = read("floor.exr");
    let middle = floor.beauty().unwrap().iter().copied().nth(32 * 64 + 32).unwrap();
    let expected = 25.0 * std::f32::consts::FRAC_1_PI;
    assert!(middle.iter().all(|x| (x / expected - 1.0).abs() < 0.1), "{middle:?} is not {expected}");
}
