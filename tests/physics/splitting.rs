//! Camera paths that split at smooth interfaces and into wavelengths have the mean of whole paths, and less variance.
//!
//! Statistical tests have a family-wise error rate of 0.1 % each (Sidak over tiles and channels). Every comparison must
//! reject pictures that are brighter by a stated share.

use crate::support;

use bumpalo::Bump;
use caustique::material::Material;
use caustique::math::{Rgb, Vec3};
use caustique::random::{Domain, Stream};
use caustique::render::{InitialBandwidth, Levels, Method, Settings};
use caustique::scene::Scene;
use caustique::spectrum::{SPREAD, Wavelength, WavelengthSample};
use caustique::transport::{CameraPathStart, CameraPaths, MAX_SPLITS, PixelSample, path_sample};
use support::channels::{SIZE, TILE, TILES, agree, seeds};
use support::render;
use support::scenes::{add, build, camera_paths, cuboid, glass, lit_room, matte, sphere, square};

/// A clear ball, and one that disperses, behind a thin pane and before walls.
fn glasses() -> Scene {
    let mut description = lit_room(matte(0.5, 0.0));
    add(&mut description, "clear", sphere(Vec3::new(-0.45, 0.6, 0.3), 0.4, 64), glass(1.5));
    let dispersing = Material { dispersion: 4.0, ..glass(1.5) };
    add(&mut description, "dispersing", sphere(Vec3::new(0.45, 0.9, 0.3), 0.4, 64), dispersing);
    let pane = Material { thin: true, ..glass(1.5) };
    add(&mut description, "pane", cuboid(Vec3::new(-0.6, 0.2, 1.2), Vec3::new(0.6, 1.6, 1.3), false), pane);
    build(description)
}

/// Samples of one camera path for each pixel and each of `paths` iterations.
fn samples(scene: &Scene, splits: u32, paths: u64, seed: u64, mut add: impl FnMut(u32, &PixelSample)) {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let camera_paths = CameraPaths { splits, ..camera_paths(scene, &camera) };
    let (mut arena, mut sample) = (Bump::new(), PixelSample::default());
    for index in 0..SIZE * SIZE {
        for path in 0..paths {
            arena.reset();
            let stream = Stream::new(seed, path, Domain::Test, u64::from(index));
            let ray = camera_paths.start((index % SIZE, index / SIZE), stream);
            let start = CameraPathStart { ray, stream };
            path_sample(&camera_paths, &arena, &start, &mut (), &mut sample);
            add(index, &sample);
        }
    }
}

/// Means of `value` by tile and channel, for several seeds.
fn means(scene: &Scene, splits: u32, paths: u64, value: impl Fn(&PixelSample) -> Rgb) -> Vec<Vec<f64>> {
    let of_seed = |seed| {
        let mut sums = vec![0.0; 3 * TILES];
        samples(scene, splits, paths, seed, |index, sample| {
            let tile = (index / SIZE / TILE * (SIZE / TILE) + index % SIZE / TILE) as usize;
            for c in 0..3 {
                sums[3 * tile + c] += f64::from(value(sample)[c]) / (f64::from(TILE * TILE) * paths as f64);
            }
        });
        sums
    };
    (0..12).map(of_seed).collect()
}

/// The wavelengths of a split path are of different bands, have the path's own wavelength first, and one is connected.
#[test]
fn wavelengths_of_a_split_path_are_in_different_bands() {
    for i in 0..1000 {
        let sample = WavelengthSample::new(i as f32 / 1000.0);
        let all: Vec<Wavelength> = sample.spread().collect();
        assert_eq!(all.len(), usize::from(SPREAD));
        assert_eq!((all[0].nm, all[0].band), (sample.wavelength().nm, sample.wavelength().band));
        assert_eq!(all.iter().map(|wavelength| wavelength.pairing).sum::<f32>(), f32::from(SPREAD));
        for (k, a) in all.iter().enumerate() {
            assert!(all[..k].iter().all(|b| a.band != b.band && (a.nm - b.nm).abs() > 10.0), "{all:?}");
        }
    }
}

/// Light, albedo, normals and shares of split paths have the means of whole ones.
#[test]
fn split_paths_have_the_mean_of_whole_paths() {
    let scene = glasses();
    let light = |sample: &PixelSample| sample.radiance(0);
    let whole = means(&scene, 0, 96, light);
    agree("light", &means(&scene, MAX_SPLITS, 64, light), &whole, 0.0, 0.1);
    // Normals have both signs.
    let features = |sample: &PixelSample| {
        Rgb::new(sample.features.albedo.x, 1.0 + sample.features.normal.z, sample.features.share)
    };
    agree("features", &means(&scene, MAX_SPLITS, 32, features), &means(&scene, 0, 32, features), 0.0, 0.05);
}

/// Splitting lowers the variance of lamps seen in glass, which is all from the choice of a branch and the place in the
/// pixel, by more than a quarter.
#[test]
fn split_paths_have_less_variance() {
    let scene = glasses();
    let variance = |splits: u32| {
        let mut sums = vec![(Rgb::ZERO, Rgb::ZERO); (SIZE * SIZE) as usize];
        let paths = 64;
        samples(&scene, splits, paths, 5, |index, sample| {
            let light = sample.emission;
            let (sum, squares) = &mut sums[index as usize];
            *sum += light;
            *squares += light * light;
        });
        let of = |(sum, squares): &(Rgb, Rgb)| (*squares - *sum * *sum / paths as f32).element_sum();
        sums.iter().map(of).sum::<f32>()
    };
    let [whole, split] = [0, MAX_SPLITS].map(variance);
    println!("{whole} {split}");
    assert!(split < 0.75 * whole, "{split} of {whole}");
}

/// Bidirectional methods and photons agree with whole paths where camera paths split: weights, wavelengths that are
/// connected, and photons.
#[test]
fn all_methods_agree_with_whole_paths() {
    let scene = glasses();
    let whole = means(&scene, 0, 96, |sample| sample.radiance(0));
    let settings = |iterations, seed| Settings {
        seed,
        photons: 10_000,
        iterations: Some(iterations),
        initial_bandwidth: InitialBandwidth::Fixed(0.06),
        levels: Levels::new(1),
        ..Settings::default()
    };
    for (method, iterations, bias) in [(Method::Bdpt, 24, 0.0), (Method::Vcm, 32, 0.01), (Method::Sppm, 16, 0.02)] {
        let split = seeds(method, 12, |seed| render(&scene, method, SIZE, &settings(iterations, seed)));
        agree(&format!("{method:?}"), &split, &whole, bias, 0.2);
    }
}
