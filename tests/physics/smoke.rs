//! Compares heterogeneous media with closed forms, with homogeneous media, and methods with each other.
//!
//! Closed forms are t tests over independent seeds, tiles Welch's t tests, at a family-wise error rate of 0.1 % per
//! test (Sidak over its checks), plus the stated bias of the kernel. Every check must reject a planted error of a
//! stated size.

use crate::support;

use caustique::material::{Alpha, Material, MediumGrids, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::medium::{DensityGrid, EmissionGrid, Grid};
use caustique::random::HashSequence;
use caustique::render::{InitialBandwidth, Levels, Method, Rendered, Settings};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use std::sync::Arc;
use support::channels::{self, SIZE, agree};
use support::render;
use support::scenes::{add, add_at, build, cuboid, glass, look_at, matte, quad};
use support::stats::Check;

/// A density grid over the box from -1 to 1 of `cells` per edge, whose value at a cell's centre is `value`.
fn grid(cells: u32, value: impl Fn(Vec3) -> f32) -> DensityGrid {
    let centre = |i: u32| (i as f32 + 0.5) * 2.0 / cells as f32 - 1.0;
    let values = (0..cells.pow(3))
        .map(|i| value(Vec3::new(centre(i % cells), centre(i / cells % cells), centre(i / cells / cells))))
        .collect();
    let grid = Grid::new([cells; 3], 1, [Vec3::NEG_ONE, Vec3::ONE], values).expect("it is valid");
    DensityGrid::new(grid).expect("it has one channel")
}

/// Smoke: a few dense puffs in thin haze, at random places, and emptiness around.
fn puffs(seed: u64) -> DensityGrid {
    let mut random = HashSequence::new(seed);
    let mut number = || random.one();
    let balls: Vec<(Vec3, f32)> =
        (0..5).map(|_| (Vec3::new(number(), number(), number()) * 1.2 - 0.6, 0.15 + 0.3 * number())).collect();
    grid(24, |p| {
        let puff = |&(centre, radius): &(Vec3, f32)| (1.0 - p.distance(centre) / radius).max(0.0);
        let haze = if p.abs().max_element() < 0.7 { 0.1 } else { 0.0 };
        haze + 2.0 * balls.iter().map(puff).sum::<f32>()
    })
}

fn coefficients(sigma_a: impl Into<[f32; 3]>, sigma_s: impl Into<[f32; 3]>, g: f32) -> MediumParameters {
    MediumParameters { sigma_a: Rgb::from(sigma_a.into()), sigma_s: Rgb::from(sigma_s.into()), g }
}

/// Material of a mesh that only contains a medium: its surface is invisible.
fn holds(medium: MediumParameters, density: Option<DensityGrid>) -> Material {
    let grids = density.map(|density| Arc::new(MediumGrids { density, emission: None }));
    Material { medium: Some(medium), grids, ..glass(1.0) }
}

/// The box from -1 to 1, in which grids lie.
fn domain() -> caustique::geometry::Mesh {
    cuboid(Vec3::NEG_ONE, Vec3::ONE, false)
}

fn settings(iterations: u64, seed: u64) -> Settings {
    Settings { seed, levels: Levels::new(1), iterations: Some(iterations), ..Settings::default() }
}

/// Settings of a photon method that gathers photons in media.
fn photons(photons: u32, radius: f32, iterations: u64, seed: u64) -> Settings {
    let initial_bandwidth = InitialBandwidth::Fixed(radius);
    Settings { photons, initial_bandwidth, levels: Levels::new(5), ..settings(iterations, seed) }
}

fn seeds(scene: &Scene, method: Method, seeds: u64, of: impl Fn(u64) -> Settings) -> Vec<Vec<f64>> {
    channels::seeds(method, seeds, |seed| render(scene, method, SIZE, &of(seed)))
}

/// Checks the means of the picture's channels, one value per seed.
fn check_means(what: &str, rendered: &[Rendered], expected: [f64; 3], bias: f64, detects: f64) {
    for (c, expected) in expected.into_iter().enumerate() {
        let mean = |rendered: &Rendered| {
            let level = rendered.settings.levels.picture_level();
            rendered.pixels.iter().map(|p| p.mean(level)[c]).sum::<f64>() / rendered.pixels.len() as f64
        };
        let values: Vec<f64> = rendered.iter().map(mean).collect();
        Check { expected, bias, detects }.run(12, &format!("{what}, channel {c}"), &values);
    }
}

/// A lamp behind smoke whose density falls off exponentially with the height. The object is turned, scaled and moved.
#[test]
fn exponential_density_attenuates_as_its_integral() {
    const FALLOFF: f64 = 1.5;
    const SCALE: f64 = 0.7;
    let sigma_t = [0.6, 1.0, 0.1];
    let mut description = Description::default();
    let lamp = quad(Vec3::new(-9.0, -3.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0);
    add(&mut description, "lamp", lamp, matte(0.0, 5.0));
    let density = grid(64, |p| (-FALLOFF * f64::from(p.y + 1.0)).exp() as f32);
    let medium = coefficients([0.1, 0.7, 0.1], [0.5, 0.3, 0.0], 0.2);
    let to_world = DAffine3::from_translation(DVec3::new(0.2, 0.3, -0.1))
        * DAffine3::from_rotation_y(0.4)
        * DAffine3::from_scale(DVec3::splat(SCALE));
    add_at(&mut description, "smoke", domain(), holds(medium, Some(density)), to_world);
    description.cameras.push(look_at(DVec3::new(0.2, 4.0, -0.1), DVec3::new(0.2, 0.0, -0.1), 0.5));
    let scene = build(description);
    let depth = SCALE * (1.0 - (-2.0 * FALLOFF).exp()) / FALLOFF;
    let expected = sigma_t.map(|sigma| 5.0 * (-sigma * depth).exp());
    for method in [Method::Path, Method::Bdpt, Method::Vcm, Method::Light] {
        let one = |seed| render(&scene, method, 4, &Settings { max_depth: 1, ..settings(200, seed) });
        let rendered: Vec<Rendered> = (0..8).map(one).collect();
        check_means(&format!("lamp behind smoke, {method:?}"), &rendered, expected, 2e-3, 0.1);
    }
    let one = |seed| render(&scene, Method::Sppm, 4, &Settings { max_depth: 1, ..photons(0, 0.1, 20, seed) });
    let rendered: Vec<Rendered> = (0..8).map(one).collect();
    check_means("lamp behind smoke, sppm", &rendered, expected, 2e-3, 0.03);
}

/// Smoke without absorption is invisible under a uniform sky, for any phase function and any differences between
/// channels.
#[test]
fn furnace_of_smoke() {
    for (sigma_s, g) in [([3.0; 3], 0.0), ([4.0, 1.5, 0.5], 0.6)] {
        let mut description = Description::default();
        add(&mut description, "smoke", domain(), holds(coefficients([0.0; 3], sigma_s, g), Some(puffs(5))));
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.4, 0.9, 3.0), DVec3::ZERO, 36.0));
        let scene = build(description);
        for method in [Method::Path, Method::Bdpt, Method::Vcm] {
            let rendered: Vec<Rendered> = (0..8).map(|seed| render(&scene, method, 8, &settings(100, seed))).collect();
            check_means(&format!("furnace, g {g}, {method:?}"), &rendered, [1.0; 3], 1e-3, 0.05);
        }
    }
}

/// The walls of a room, and a camera in it.
fn walls() -> Description {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.5, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.8, 0.0), 55.0));
    description
}

/// A room with a lamp, and a medium in a box that is smaller than the room.
fn room(medium: MediumParameters, density: Option<DensityGrid>) -> Scene {
    let mut description = walls();
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    let to_world = DAffine3::from_translation(DVec3::new(0.1, 0.8, 0.1))
        * DAffine3::from_rotation_y(0.3)
        * DAffine3::from_scale(DVec3::new(0.6, 0.7, 0.5));
    add_at(&mut description, "smoke", domain(), holds(medium, density), to_world);
    build(description)
}

/// A grid of equal densities renders as the homogeneous medium, by each method.
#[test]
fn uniform_grids_agree_with_homogeneous_media() {
    let (medium, density) = (coefficients([0.2, 0.6, 1.0], [1.5, 1.0, 0.5], 0.3), 2.0);
    let homogeneous = room(medium.scaled(density), None);
    let uniform = room(medium, Some(grid(12, |_| density)));
    for method in [Method::Path, Method::Bdpt, Method::Vcm] {
        let [a, b] = [&uniform, &homogeneous].map(|scene| seeds(scene, method, 8, |seed| settings(25, seed)));
        agree(&format!("uniform grid, {method:?}"), &a, &b, 1e-3, 0.2);
    }
    let of = |seed| photons(10_000, 0.06, 10, seed);
    let [a, b] = [&uniform, &homogeneous].map(|scene| seeds(scene, Method::Sppm, 8, of));
    agree("uniform grid, sppm", &a, &b, 1e-3, 0.2);
}

/// All methods find the same light in coloured smoke.
#[test]
fn methods_agree_in_smoke() {
    let scene = room(coefficients([0.3, 0.6, 1.2], [4.0, 3.0, 1.5], 0.4), Some(puffs(11)));
    let path = seeds(&scene, Method::Path, 10, |seed| settings(60, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 10, |seed| settings(25, seed));
    agree("smoke, bdpt", &bdpt, &path, 2e-3, 0.15);
    let vcm = seeds(&scene, Method::Vcm, 10, |seed| settings(25, seed));
    agree("smoke, vcm", &vcm, &path, 0.01, 0.15);
    let mlt = seeds(&scene, Method::Mlt, 10, |seed| settings(25, seed));
    agree("smoke, mlt", &mlt, &path, 2e-3, 0.15);
    let sppm = seeds(&scene, Method::Sppm, 10, |seed| photons(10_000, 0.06, 12, seed));
    agree("smoke, sppm", &sppm, &bdpt, 0.03, 0.3);
}

/// Material of smoke that emits `color` (W/sr/m3) times the same density.
fn burns(medium: MediumParameters, density: DensityGrid, color: impl Into<[f32; 3]>) -> Material {
    let emission = EmissionGrid::new(density.grid().clone(), Rgb::from(color.into()));
    Material { grids: Some(Arc::new(MediumGrids { density, emission })), ..holds(medium, None) }
}

/// A medium that emits as much as it absorbs from a sky of radiance 1 is invisible \[Kirchhoff\], whatever it scatters.
#[test]
fn fire_in_equilibrium_is_invisible() {
    let sigma_a = [0.5, 1.5, 3.0];
    for sigma_s in [0.0, 0.4] {
        let mut description = Description::default();
        let medium = coefficients(sigma_a, [sigma_s; 3], 0.0);
        add(&mut description, "fire", domain(), burns(medium, puffs(5), sigma_a));
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.4, 0.9, 3.0), DVec3::ZERO, 36.0));
        let scene = build(description);
        for method in [Method::Path, Method::Bdpt, Method::Vcm] {
            let rendered: Vec<Rendered> = (0..8).map(|seed| render(&scene, method, 8, &settings(100, seed))).collect();
            check_means(&format!("equilibrium, {method:?}"), &rendered, [1.0; 3], 2e-3, 0.1);
        }
        let of = |seed| photons(4000, 0.2, 30, seed);
        let rendered: Vec<Rendered> = (0..8).map(|seed| render(&scene, Method::Sppm, 8, &of(seed))).collect();
        check_means("equilibrium, sppm", &rendered, [1.0; 3], 0.01, 0.1);
    }
}

/// All methods find the same light of a fire that lights a room, seen directly and by a mirror.
#[test]
fn methods_agree_by_firelight() {
    let mut description = walls();
    let mirror = quad(Vec3::new(-0.95, 0.3, -0.9), Vec3::Y * 1.4, Vec3::new(0.5, 0.0, -0.05));
    add(&mut description, "mirror", mirror, support::scenes::mirror());
    let to_world = DAffine3::from_translation(DVec3::new(0.2, 0.6, 0.1)) * DAffine3::from_scale(DVec3::splat(0.3));
    let medium = coefficients([1.0, 2.0, 4.0], [0.5; 3], 0.3);
    add_at(&mut description, "fire", domain(), burns(medium, puffs(3), [20.0, 8.0, 1.0]), to_world);
    let scene = build(description);
    let path = seeds(&scene, Method::Path, 10, |seed| settings(60, seed));
    let bdpt = seeds(&scene, Method::Bdpt, 10, |seed| settings(30, seed));
    // Paths miss the caustic of the mirror, which is small.
    agree("firelight, bdpt", &bdpt, &path, 5e-3, 0.15);
    let mlt = seeds(&scene, Method::Mlt, 10, |seed| settings(30, seed));
    agree("firelight, mlt", &mlt, &bdpt, 2e-3, 0.2);
    let vcm = seeds(&scene, Method::Vcm, 10, |seed| settings(30, seed));
    agree("firelight, vcm", &vcm, &bdpt, 0.01, 0.15);
    let sppm = seeds(&scene, Method::Sppm, 10, |seed| photons(10_000, 0.06, 16, seed));
    agree("firelight, sppm", &sppm, &bdpt, 0.03, 0.3);
}

/// The irradiance at the origin of a floor from points that emit `emission` (W/sr/m3), in the box from `low` to `high`,
/// without absorption: midpoints of 64 cells per edge.
fn irradiance(low: DVec3, high: DVec3, emission: impl Fn(DVec3) -> f64) -> f64 {
    const CELLS: i32 = 64;
    let cell = (high - low) / f64::from(CELLS);
    let middle = |i: i32| f64::from(i) + 0.5;
    let mut sum = 0.0;
    for (x, y, z) in (0..CELLS).flat_map(|x| (0..CELLS).flat_map(move |y| (0..CELLS).map(move |z| (x, y, z)))) {
        let p = low + cell * DVec3::new(middle(x), middle(y), middle(z));
        sum += emission(p) * p.y / p.length().powi(3);
    }
    sum * cell.element_product()
}

/// A fire lights from the places where cameras see it: not where a clear solid of higher priority takes its place, for a
/// share alpha of the light if its mesh exists for that share, and alone where a larger fire of equal priority
/// overlaps it. The part of its grid that is outside of its mesh does not burn. The integral over all of its places,
/// for a floor below and for the view of the camera.
#[test]
fn fires_light_from_where_they_are_seen() {
    let clear = coefficients([0.0; 3], [0.0; 3], 0.0);
    let fire = |alpha: f32, emission: f32| Material {
        alpha: Alpha::Blend,
        base_color: [1.0, 1.0, 1.0, alpha],
        ..burns(clear, grid(2, |_| 1.0), [emission; 3])
    };
    let within = |p: DVec3, centre: DVec3, half: f64| (p - centre).abs().max_element() < half;
    let (centre, aside) = (DVec3::Y * 2.0, DVec3::new(0.25, 1.75, 0.25));
    let place = |at: DVec3, half: f64| DAffine3::from_translation(at) * DAffine3::from_scale(DVec3::splat(half));
    let inner = || cuboid(Vec3::splat(-0.5), Vec3::splat(0.5), false);
    type Other = Option<(caustique::geometry::Mesh, Material, f64)>;
    let scenes: [(&str, Other, f32); 5] = [
        ("alone", None, 1.0),
        ("alpha", None, 0.4),
        ("displaced", Some((domain(), Material { priority: 1, ..glass(1.0) }, 0.0)), 1.0),
        ("overlapping", Some((domain(), fire(1.0, 0.5), 0.5)), 1.0),
        ("cut off", Some((inner(), fire(1.0, 3.0), 3.0)), 1.0),
    ];
    for (what, other, alpha) in scenes {
        let mut description = Description::default();
        let floor = quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0);
        add(&mut description, "floor", floor, matte(0.5, 0.0));
        add_at(&mut description, "fire", domain(), fire(alpha, 1.0), place(centre, 1.0));
        let half = if what == "cut off" { 0.25 } else { 0.5 };
        let inside = other.as_ref().map(|(.., emission)| *emission);
        if let Some((mesh, material, _)) = other {
            add_at(&mut description, "other", mesh, material, place(aside, 0.5));
        }
        let emission = |p: DVec3| match inside {
            Some(emission) if within(p, aside, half) => emission,
            _ => f64::from(alpha),
        };
        let lit = irradiance(centre - 1.0, centre + 1.0, emission) * 0.5 / std::f64::consts::PI;
        let mut seen = description.clone();
        description.cameras.push(look_at(DVec3::new(0.3, 0.5, 0.0), DVec3::ZERO, 0.5));
        let through = DVec3::new(0.25, 6.0, 0.25);
        seen.cameras.push(look_at(through, DVec3::new(0.25, 2.0, 0.25), 0.1));
        seen.materials[0] = Material { name: "floor".into(), ..matte(0.0, 0.0) };
        let of_inside = inside.map_or(0.0, |emission| 2.0 * half * (emission - 1.0));
        for (view, description, expected) in
            [("floor", description, lit), ("view", seen, (2.0 + of_inside) * f64::from(alpha))]
        {
            let scene = build(description);
            for method in [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm, Method::Light] {
                if method == Method::Light && view == "floor" {
                    continue;
                }
                let one = |seed| {
                    render(&scene, method, 4, &Settings { levels: Levels::new(1), ..photons(200, 0.05, 120, seed) })
                };
                let rendered: Vec<Rendered> = (0..8).map(one).collect();
                check_means(&format!("fire {what}, {view}, {method:?}"), &rendered, [expected; 3], 2e-3, 0.2);
            }
        }
    }
}

/// The other methods that render heterogeneous media.
#[test]
#[ignore = "long"]
fn more_methods_agree_in_smoke() {
    let scene = room(coefficients([0.3, 0.6, 1.2], [4.0, 3.0, 1.5], 0.4), Some(puffs(11)));
    let bdpt = seeds(&scene, Method::Bdpt, 10, |seed| settings(60, seed));
    let light = seeds(&scene, Method::Light, 10, |seed| settings(150, seed));
    agree("smoke, light", &light, &bdpt, 5e-3, 0.3);
    let cppm = seeds(&scene, Method::Cppm, 10, |seed| photons(10_000, 0.06, 20, seed));
    agree("smoke, cppm", &cppm, &bdpt, 0.03, 0.3);
}
