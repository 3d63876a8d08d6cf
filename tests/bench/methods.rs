//! The cost of methods: processor seconds of an iteration at 512 x 512 and of a million light and camera paths, in a
//! Cornell box with a mirror sphere, and of path tracing in a purely diffuse one. The last line is JSON for
//! `scripts/lab`.

#[path = "../support/mod.rs"]
mod support;

use caustique::bsdf::Shading;
use caustique::geometry::{Mesh, Surface};
use caustique::material::Material;
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, InitialBandwidth, Levels, Method, Settings, render};
use caustique::scene::{CameraRequest, Description, Scene};
use caustique::transport::{LightVertex, MergePhoton};
use support::scenes::{add, build, cuboid, look_at, matte, mirror, quad, sphere};

/// The Cornell box. `ball` is the material of a sphere in it.
fn cornell(ball: Option<Material>) -> Description {
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
    match ball {
        Some(material) => add(&mut description, "ball", sphere(Vec3::new(0.3, 0.45, 0.1), 0.45, 128), material),
        None => {
            add(
                &mut description,
                "low block",
                block(Vec3::new(0.33, 0.3, 0.37), Vec3::new(0.3, 0.3, 0.3), -0.29),
                white(),
            );
            add(
                &mut description,
                "high block",
                block(Vec3::new(-0.33, 0.6, -0.28), Vec3::new(0.3, 0.6, 0.3), 0.29),
                white(),
            );
        }
    }
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.2), DVec3::new(0.0, 1.0, 0.0), 36.0));
    description
}

/// A box rotated about the vertical axis.
fn block(center: Vec3, half: Vec3, angle: f32) -> Mesh {
    let mut mesh = cuboid(-half, half, false);
    for p in &mut mesh.positions {
        let (sin, cos) = angle.sin_cos();
        *p = center + Vec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x);
    }
    mesh
}

/// A lamp of many triangles.
fn many(description: &mut Description, cells: u32) {
    let mut mesh = Mesh::default();
    let side = 0.5 / cells as f32;
    for i in 0..cells * cells {
        let corner = Vec3::new(-0.25 + side * (i % cells) as f32, 1.98, -0.25 + side * (i / cells) as f32);
        let part = quad(corner, Vec3::X * side, Vec3::Z * side);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions);
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|i| first + i)));
    }
    add(description, "many lamps", mesh, matte(0.0, 15.0));
}

struct Cost {
    seconds: f64,
    light_paths: f64,
    photons: u64,
}

/// Processor seconds of an iteration, the minimum over some runs. Without the first iteration, which merges nothing and
/// starts with cold caches.
fn cost(scene: &Scene, method: Method, levels: usize) -> Cost {
    let camera = scene
        .camera(&CameraRequest { width: Some(512), height: Some(512), ..CameraRequest::default() })
        .expect("a camera");
    let settings = Settings {
        method,
        initial_bandwidth: InitialBandwidth::Footprint,
        levels: Levels::new(levels),
        alpha: 0.75,
        iterations: Some(12),
        ..Settings::default()
    };
    let (mut seconds, mut light_paths, mut photons) = (f64::INFINITY, 0.0, 0);
    for _ in 0..2 {
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        let (first, last) = (&rendered.stats.history[0], &rendered.stats.history[rendered.stats.history.len() - 1]);
        let iterations = (last.iterations - first.iterations) as f64;
        seconds = f64::min(seconds, (last.cpu_seconds - first.cpu_seconds) / iterations);
        light_paths = rendered.stats.light_paths as f64 / rendered.stats.iterations as f64;
        photons = rendered.stats.photons;
    }
    Cost { seconds, light_paths, photons }
}

fn main() {
    let pixels = 512.0 * 512.0;
    let diffuse = build(cornell(None));
    let path = cost(&diffuse, Method::Path, 1);
    println!("512 x 512, Cornell box, all diffuse");
    println!("path: {:.2} million paths per core-second", pixels * 1e-6 / path.seconds);
    let mut crowded = cornell(None);
    many(&mut crowded, 224);
    let crowded = cost(&build(crowded), Method::Path, 1).seconds / path.seconds;
    println!("with a lamp of {} triangles in place of 2: {crowded:.2} times the time", 2 * 224 * 224);
    println!("\n512 x 512, Cornell box with a mirror sphere: processor seconds");
    println!(
        "{:<8}{:>8}{:>12}{:>24}{:>24}",
        "method", "levels", "iteration", "million light paths", "million eye paths"
    );
    let ball = build(cornell(Some(mirror())));
    let (mut vcm, mut photons) = (0.0, [0; 2]);
    let methods = [
        (Method::Path, 1),
        (Method::Light, 1),
        (Method::Bdpt, 1),
        (Method::Bpm, 1),
        (Method::Sppm, 1),
        (Method::Sppm, 5),
        (Method::Vcm, 1),
        (Method::Vcm, 5),
    ];
    for (method, levels) in methods {
        let Cost { seconds, light_paths, photons: left } = cost(&ball, method, levels);
        let eye_paths = pixels * if levels > 1 { 2.0 } else { 1.0 };
        let per_million = |paths: f64| if paths > 0.0 { format!("{:.2}", seconds / paths * 1e6) } else { "-".into() };
        let (light, eye) = (per_million(light_paths), per_million(eye_paths));
        println!("{:<8}{levels:>8}{seconds:>12.2}{light:>24}{eye:>24}", format!("{method:?}").to_lowercase());
        match (method, levels) {
            // Merges every vertex that is not on a mirror.
            (Method::Bpm, _) => photons[0] = left,
            (Method::Vcm, 1) => (vcm, photons[1]) = (seconds, left),
            _ => {}
        }
    }
    // Memory for keeping the light vertices of an iteration until its camera paths merge them, and for the photons kept
    // for the next iteration.
    let mib = |count: u64, size: usize| count as f64 * size as f64 / f64::from(1 << 20);
    // A light vertex refers to its surface point and BSDF.
    let vertex = size_of::<LightVertex>() + size_of::<Surface>() + size_of::<Shading>();
    let (kept, whole) = (mib(photons[1], size_of::<MergePhoton>()), mib(photons[0], vertex));
    println!("\nmemory of vcm: {} photons of {} bytes, {kept:.0} MiB;", photons[1], size_of::<MergePhoton>());
    println!("as light vertices kept whole: {} of {} bytes, {whole:.0} MiB", photons[0], vertex);
    println!(
        "{{\"time_with_100352_emitters\": {crowded:.3}, \"vcm_photons_mib\": {kept:.1}, \"vcm_vertices_mib\": {whole:.1}, \"path_diffuse_million_per_core_s\": {:.3}, \"vcm_512\": {vcm:.3}}}",
        pixels * 1e-6 / path.seconds
    );
}
