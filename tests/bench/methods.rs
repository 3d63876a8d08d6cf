//! What methods cost: VCM's processor seconds for an iteration at 512 x 512 in a Cornell box with a mirror sphere, and for a million light and eye
//! paths, beside the other methods on the same scene.

#[path = "../support/mod.rs"]
mod support;

use caustique::estimator::InitialBandwidth;
use caustique::material::Material;
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, Levels, Method, Settings, render};
use caustique::scene::{Description, View};
use support::scenes::{add, build, look_at, matte, mirror, quad, sphere};

fn cornell() -> Description {
    let mut description = Description::default();
    let color = |r, g, b| Material { base_color: [r, g, b, 1.0], ..matte(0.0, 0.0) };
    let white = || color(0.7, 0.7, 0.7);
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    add(&mut description, "floor", quad(Vec3::new(-1.0, 0.0, -1.0), z, x), white());
    add(&mut description, "ceiling", quad(Vec3::new(-1.0, 2.0, -1.0), x, z), white());
    add(&mut description, "back", quad(Vec3::new(-1.0, 0.0, -1.0), x, y), white());
    add(&mut description, "left", quad(Vec3::new(-1.0, 0.0, -1.0), y, z), color(0.6, 0.05, 0.05));
    add(&mut description, "right", quad(Vec3::new(1.0, 0.0, -1.0), z, y), color(0.05, 0.5, 0.05));
    let lamp = quad(Vec3::new(-0.25, 1.99, -0.25), Vec3::X * 0.5, Vec3::Z * 0.5);
    add(&mut description, "lamp", lamp, matte(0.0, 15.0));
    add(&mut description, "ball", sphere(Vec3::new(0.3, 0.45, 0.1), 0.45, 128), mirror());
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.2), DVec3::new(0.0, 1.0, 0.0), 36.0));
    description
}

fn main() {
    let scene = build(cornell());
    let camera = scene.camera(&View { camera: None, width: Some(512), height: Some(512) }).expect("a camera");
    println!("512 x 512, Cornell box with a mirror sphere");
    println!("{:<18}{:>12}{:>22}{:>12}", "method", "core-s/pass", "core-s/million pairs", "photons");
    for (method, levels) in
        [(Method::Path, 1), (Method::Light, 1), (Method::Bdpt, 1), (Method::Bpm, 1), (Method::Vcm, 1), (Method::Vcm, 5)]
    {
        let settings = Settings {
            method,
            initial: InitialBandwidth::Footprint,
            levels: Levels::new(levels),
            alpha: 0.75,
            iterations: Some(4),
            ..Settings::default()
        };
        let mut photons = 0;
        let rendered = render(&scene, &camera, &settings, |progress, _| {
            photons = progress.photons;
            Control::Continue
        });
        // From the end of the first pass, which merges nothing.
        let (first, last) = (&rendered.history[0], &rendered.history[rendered.history.len() - 1]);
        let seconds = (last.cpu_seconds - first.cpu_seconds) / (last.iterations - first.iterations) as f64;
        let pairs = (512.0 * 512.0) * if levels > 1 { 2.0 } else { 1.0 } / 1e6;
        let name = format!("{method:?}, {levels} level(s)");
        println!("{name:<18}{seconds:>12.2}{:>22.2}{photons:>12}", seconds / pairs);
    }
}
