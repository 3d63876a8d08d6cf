//! The MIS weights of all techniques of a path sum to one within 1e-5, for a million whole paths in scenes with very
//! different densities: tiny lamps, slits, sharp lobes, thick media, glass of weak refraction. With a planted bug they
//! do not.

use super::*;
use rayon::prelude::*;

/// Number of whole paths per scene.
const EACH: usize = 125_000;
const TOLERANCE: f64 = 1e-5;
/// Number of pairs of subpaths between two checks of the total count.
const BATCH: u32 = 512;

/// Largest deviation of a sum from one over [`EACH`] whole paths; and the same with a planted bug, for one path in
/// [`BATCH`].
fn worst(what: &str, scene: &Scene, radius: f32, bug: Bug) -> [f64; 2] {
    let camera: Camera = scene.camera(&square(SIZE)).expect("a camera");
    let initial_media = InitialMedia::new(scene, camera.position());
    let lab = Lab::new(scene, &camera, &initial_media, radius, ONE_OF_EACH);
    let (mut paths, mut worst, mut begun) = (0, [0.0f64; 2], 0);
    while paths < EACH {
        let batch: Vec<(usize, [f64; 2])> = (begun..begun + BATCH)
            .into_par_iter()
            .map(|path| {
                let (mut count, mut worst) = (0, [0.0f64; 2]);
                lab.paths(path, |technique, strategy, whole, _| {
                    let error = (lab.sum(whole, None) - 1.0).abs();
                    assert!(error <= TOLERANCE, "{what}, {path}, {technique:?}, {strategy:?}: 1 + {error:e}");
                    worst[0] = worst[0].max(error);
                    if path % 64 == 0 {
                        worst[1] = worst[1].max((lab.sum(whole, Some(bug)) - 1.0).abs());
                    }
                    count += 1;
                });
                (count, worst)
            })
            .collect();
        for (count, error) in batch {
            paths += count;
            worst = [0, 1].map(|k: usize| worst[k].max(error[k]));
        }
        begun += BATCH;
    }
    println!("{what}: {paths} paths of {begun} pairs, sums off by {:.1e}; with {bug:?} by {:.1e}", worst[0], worst[1]);
    worst
}

fn checked(what: &str, description: Description, radius: f32, bug: Bug) {
    let [_, planted] = worst(what, &build(description), radius, bug);
    assert!(planted > 100.0 * TOLERANCE, "{what}: {bug:?} is not detected ({planted:e})");
}

/// A square lamp of this side below the ceiling of a glossy room.
fn lit(side: f32) -> Description {
    let mut description = room();
    let corner = Vec3::new(-0.5 * side, 1.9, -0.5 * side);
    let lamp = Material { double_sided: true, ..matte(0.2, 8.0 / (side * side)) };
    add(&mut description, "lamp", quad(corner, Vec3::X * side, Vec3::Z * side), lamp);
    description
}

#[test]
fn a_lamp_of_two_micrometres() {
    let mut description = lit(2e-6);
    add(&mut description, "mirror", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), mirror());
    checked("dust", description, 0.1, Bug::Cosine);
}

#[test]
fn a_slit_of_light() {
    let mut description = room();
    let slit = quad(Vec3::new(-0.5, 1.9, 0.0), Vec3::X, Vec3::Z * 1e-5);
    add(&mut description, "slit", slit, Material { double_sided: true, ..matte(0.2, 1e5) });
    checked("slit", description, 0.1, Bug::Reverse);
}

#[test]
fn lobes_as_sharp_as_mirrors() {
    let mut description = lit(0.8);
    for (x, roughness) in [(-0.5, 0.02), (0.0, 0.05), (0.5, 0.1)] {
        let metal = Material { metallic: 1.0.into(), roughness: roughness.into(), ..Material::default() };
        add(&mut description, "metal", sphere(Vec3::new(x, 0.3, 0.2), 0.24, 64), metal);
    }
    checked("sharp", description, 1e-3, Bug::Reverse);
}

#[test]
fn glass_that_hardly_bends_and_glass_that_bends_much() {
    let mut description = lit(0.2);
    for (x, ior, roughness) in [(-0.5, 1.0001, 0.3), (0.0, 4.0, 0.1), (0.5, 1.5, 0.0)] {
        let ball = sphere(Vec3::new(x, 0.3, 0.2), 0.24, 64);
        add(&mut description, "glass", ball, Material { roughness: roughness.into(), ..glass(ior) });
    }
    checked("glass", description, 0.1, Bug::DirectMerged);
}

#[test]
fn a_thick_medium_with_a_sharp_peak() {
    let mut description = lit(0.8);
    description.medium = Some(MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::new(20.0, 5.0, 1.0), g: 0.95 });
    checked("thick", description, 0.1, Bug::FlightDensity);
}

#[test]
fn a_sun_beside_a_lamp() {
    let mut description = outdoors();
    let lamp = quad(Vec3::new(-0.8, 1.2, -0.6), Vec3::X * 1e-4, Vec3::Z * 1e-4);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 1e9) });
    checked("sun and lamp", description, 1e-2, Bug::Chosen);
}

#[test]
fn bandwidths_of_a_millionth_and_of_the_room() {
    // Almost no photon is merged within a millionth.
    for (radius, bug) in [(1e-6, Bug::Cosine), (1.0, Bug::NothingShared)] {
        let mut description = lit(0.8);
        add(&mut description, "glass", sphere(Vec3::new(0.4, 0.4, 0.2), 0.3, 64), glass(1.5));
        checked("bandwidths", description, radius, bug);
    }
}
