//! Photon mapping and path tracing share little code, and must agree tile by tile on scenes that path tracing can
//! render.
//!
//! Standard errors come from independent renders, because photons correlate pixels. The family-wise error rate is 0.1 %
//! per scene (Sidak over tiles). A planted bug, one brighter tile, must be rejected.

use crate::support;

use caustique::material::Material;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::random::{Domain, Stream};
use caustique::render::{Control, InitialBandwidth, Levels, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use caustique::transport::{Indirect, path_radiance};
use support::scenes::{
    add, build, camera_paths, cuboid, glass, glossy_balls, lit_room, look_at, matte, quad, sphere, square,
};
use support::stats::t_critical;
use support::tiles::{SIZE, TILES, average, tiles};

fn mean(c: Rgb) -> f64 {
    f64::from(c.element_sum()) / 3.0
}

/// Photons for all indirect light; and guided photons for caustics only, with camera paths that continue.
const INDIRECT_MODES: [(Indirect, bool); 2] = [(Indirect::Photons, false), (Indirect::Paths, true)];

fn by_photons(
    scene: &Scene,
    (indirect, guided): (Indirect, bool),
    photons: u32,
    radius: f32,
    iterations: u64,
    seeds: u64,
) -> Vec<Vec<f64>> {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    (0..seeds)
        .map(|seed| {
            let settings = Settings {
                seed,
                photons,
                indirect,
                guided,
                initial_bandwidth: InitialBandwidth::Fixed(radius),
                levels: Levels::new(1),
                iterations: Some(iterations),
                ..Settings::default()
            };
            let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
            assert_eq!(rendered.rejected(), 0);
            tiles(|index| rendered.pixels[index].mean(0).element_sum() / 3.0)
        })
        .collect()
}

fn by_paths(scene: &Scene, paths: u64, seeds: u64) -> Vec<Vec<f64>> {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let camera_paths = camera_paths(scene, &camera);
    (0..seeds)
        .map(|seed| {
            tiles(|index| {
                let (x, y, index) = (index as u32 % SIZE, index as u32 / SIZE, index as u64);
                let path =
                    |pass| mean(path_radiance(&camera_paths, (x, y), Stream::new(seed, pass, Domain::Test, index)));
                (0..paths).map(path).sum::<f64>() / paths as f64
            })
        })
        .collect()
}

/// The tiles in which two sets of renders differ by more than noise and `bias` (relative) allow.
fn disagreeing(a: &[Vec<f64>], b: &[Vec<f64>], bias: f64) -> Vec<String> {
    support::tiles::disagreeing(a, b, t_critical(1e-3, TILES, (a.len().min(b.len()) - 1) as f64), bias)
}

fn check(what: &str, photons: &[Vec<f64>], paths: &[Vec<f64>], bias: f64, planted: f64) {
    println!("{what}: photons {:.5}, paths {:.5}", average(photons), average(paths));
    let found = disagreeing(photons, paths, bias);
    assert!(found.is_empty(), "{what}: {found:#?}");
    // The planted bug: one tile is brighter, as if a part of its light counted twice.
    let mut wrong = photons.to_vec();
    for seed in &mut wrong {
        seed[5] *= 1.0 + planted;
    }
    assert!(!disagreeing(&wrong, paths, bias).is_empty(), "{what}: a tile brighter by {planted} is not detected");
}

/// Plastic and rough metal in a room: wide and narrow layered lobes, at which camera paths gather photons or continue.
#[test]
fn glossy_room() {
    let scene = build(glossy_balls());
    let paths = by_paths(&scene, 8, 20);
    for mode in INDIRECT_MODES {
        check(&format!("glossy room, {mode:?}"), &by_photons(&scene, mode, 20_000, 0.05, 3, 20), &paths, 0.015, 0.15);
    }
}

/// A lamp behind glass, seen in varnished walls and sharp metal. Photons find it, and so do camera paths that continue,
/// which suffice here.
#[test]
#[ignore = "long"]
fn lamp_behind_glass_in_a_varnished_room() {
    let varnish = Material {
        base_color: [0.5, 0.4, 0.3, 1.0],
        metallic: 0.0.into(),
        roughness: 0.35.into(),
        ..Material::default()
    };
    let mut description = lit_room(varnish);
    add(&mut description, "pane", cuboid(Vec3::new(-0.6, 1.8, -0.6), Vec3::new(0.6, 1.9, 0.6), false), glass(1.5));
    let metal = Material {
        base_color: [0.9, 0.7, 0.4, 1.0],
        metallic: 1.0.into(),
        roughness: 0.3.into(),
        ..Material::default()
    };
    add(&mut description, "metal", sphere(Vec3::new(0.3, 0.5, 0.0), 0.5, 64), metal);
    let scene = build(description);
    let paths = by_paths(&scene, 80, 20);
    for mode in INDIRECT_MODES {
        check(&format!("varnish, {mode:?}"), &by_photons(&scene, mode, 20_000, 0.06, 4, 20), &paths, 0.02, 0.2);
    }
}

/// Smooth and rough glass under a large lamp, which paths can hit.
#[test]
#[ignore = "long"]
fn glass_room() {
    let mut description = lit_room(matte(0.5, 0.0));
    add(&mut description, "smooth", sphere(Vec3::new(-0.45, 0.45, 0.0), 0.4, 128), glass(1.5));
    let rough = Material { roughness: 0.4.into(), ..glass(1.4) };
    add(&mut description, "rough", sphere(Vec3::new(0.45, 0.45, 0.3), 0.4, 64), rough);
    let scene = build(description);
    let paths = by_paths(&scene, 20, 20);
    for mode in INDIRECT_MODES {
        check(&format!("glass room, {mode:?}"), &by_photons(&scene, mode, 40_000, 0.04, 3, 20), &paths, 0.02, 0.2);
    }
}

/// A scene lit by a bright patch of the sky, with a glass pane in the open.
#[test]
fn under_the_sky() {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    add(
        &mut description,
        "block",
        cuboid(Vec3::new(-0.6, 0.0, -0.6), Vec3::new(-0.1, 0.7, -0.1), false),
        matte(0.6, 0.0),
    );
    add(&mut description, "pane", cuboid(Vec3::new(0.1, 0.05, 0.0), Vec3::new(0.8, 0.6, 0.08), false), glass(1.5));
    let (width, height) = (32, 16);
    let mut texels = vec![[0.3, 0.4, 0.6]; (width * height) as usize];
    for y in 2..6 {
        for x in 3..9 {
            texels[y * width as usize + x] = [12.0, 10.0, 8.0];
        }
    }
    let source = EnvironmentSource::Image { width, height, texels };
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 30.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(1.2, 1.4, 2.2), DVec3::new(0.0, 0.2, 0.0), 40.0));
    let scene = build(description);
    let paths = by_paths(&scene, 64, 24);
    for mode in INDIRECT_MODES {
        check(&format!("sky, {mode:?}"), &by_photons(&scene, mode, 60_000, 0.04, 4, 24), &paths, 0.02, 0.2);
    }
}
