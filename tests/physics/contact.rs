//! Surfaces that coincide: glass on a floor, a liquid in a glass, boxes in a stack; and panes whose faces are closer
//! than rounding errors.
//!
//! Furnaces are t tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak over its checks).
//! Every check must reject a furnace that is off by 5 % (photons: 12 %). Black pixels must be exactly black.

use crate::support;

use caustique::camera::Camera;
use caustique::geometry::Mesh;
use caustique::material::{Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::render::{Control, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use support::scenes::{add, add_at, build, cuboid, glass, look_at, matte, mirror, point_light, quad, square};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 16;
const METHODS: [Method; 4] = [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm];

/// An empty scene under a sky of radiance 1.
fn white_sky() -> Description {
    let source = EnvironmentSource::Color(Rgb::ONE);
    Description {
        environment: Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 }),
        ..Description::default()
    }
}

fn picture(scene: &Scene, camera: &Camera, method: Method, iterations: u64, seed: u64) -> Vec<f64> {
    let settings = Settings { method, iterations: Some(iterations), photons: 4000, seed, ..Settings::default() };
    let rendered = render(scene, camera, &settings, |_, _| Control::Continue);
    rendered.pixels.iter().map(|pixel| pixel.mean(0).element_sum() / 3.0).collect()
}

/// Checks that the mean of a picture is 1. Photon methods have more noise, so they use more photons, and their planted
/// error is 12 % instead of 5 %.
fn is_white(what: &str, scene: &Scene, methods: &[Method]) {
    let camera = scene.camera(&square(16)).expect("a camera");
    let critical = t_critical(sidak(ERROR_RATE, methods.len()), 1, SEEDS as f64 - 1.0);
    for &method in methods {
        let means: Vec<f64> = (1..=SEEDS)
            .map(|seed| {
                let pixels = picture(scene, &camera, method, if method == Method::Sppm { 14 } else { 2 }, seed);
                pixels.iter().sum::<f64>() / pixels.len() as f64
            })
            .collect();
        let (mean, error) = mean_and_error(&means);
        println!("{what}, {method:?}: {mean:.5} +- {error:.5}");
        let passes = |expected: f64| (mean - expected).abs() < critical * error + 2e-3;
        assert!(passes(1.0), "{what}, {method:?}: {mean} +- {error}");
        let detects = if method == Method::Sppm { 0.12 } else { 0.05 };
        assert!(
            !passes(1.0 - detects) && !passes(1.0 + detects),
            "{what}, {method:?}: an error of {detects} is not detected ({mean} +- {error})"
        );
    }
}

/// Joins two meshes into one.
fn joined(a: Mesh, b: Mesh) -> Mesh {
    let first = a.positions.len() as u32;
    let mut mesh = a;
    mesh.positions.extend(b.positions);
    mesh.triangles.extend(b.triangles.into_iter().map(|t| t.map(|index| index + first)));
    mesh
}

/// A transform to a height that no float represents, so that coordinates are rounded.
fn placed() -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        DVec3::new(1.1, 0.7, 1.3),
        glam::DQuat::from_rotation_y(0.4),
        DVec3::new(0.37, 1.0 / 3.0, -0.21),
    )
}

/// A block of glass on a black floor hides a strong lamp below the floor. When rays started a little beyond a plane,
/// they skipped the floor in 31 to 45 % of the pixels.
#[test]
fn nothing_below_a_floor_is_seen_through_glass_that_stands_on_it() {
    for (name, on) in [("as modelled", DAffine3::IDENTITY), ("placed", placed())] {
        let mut description = Description::default();
        let at = |p: DVec3| on.transform_point3(p).as_vec3();
        // The floor has other corners than the block, so that the two planes differ by rounding errors.
        let (corner, x, z) =
            (at(DVec3::new(-3.0, 0.0, -3.0)), at(DVec3::new(3.0, 0.0, -3.0)), at(DVec3::new(-3.0, 0.0, 3.0)));
        add(&mut description, "floor", quad(corner, z - corner, x - corner), matte(0.0, 0.0));
        let below = Vec3::new(-9.0, -2.0, -9.0);
        add(&mut description, "lamp", quad(below, Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.0, 1e3));
        let mesh = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 1.0, 1.0), false);
        add_at(&mut description, "block", mesh, glass(1.5), on);
        let target = on.transform_point3(DVec3::new(0.0, 0.3, 0.0));
        description.cameras.push(look_at(target + DVec3::new(0.5, 3.0, 2.0), target, 30.0));
        let scene = build(description);
        let camera = scene.camera(&square(32)).expect("a camera");
        for method in METHODS {
            let lit = picture(&scene, &camera, method, 4, 1).into_iter().filter(|light| *light > 0.0).count();
            assert_eq!(lit, 0, "{name}, {method:?}: pixels that show what is below the floor");
        }
    }
}

/// The check above detects a hole of a tenth of the block.
#[test]
fn what_is_below_a_hole_is_seen() {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 3.1), matte(0.0, 0.0));
    add(&mut description, "lamp", quad(Vec3::new(-9.0, -2.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.0, 1e3));
    add(&mut description, "block", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::ONE, false), glass(1.5));
    description.cameras.push(look_at(DVec3::new(0.5, 3.3, 2.0), DVec3::new(0.0, 0.3, 0.0), 30.0));
    let scene = build(description);
    let camera = scene.camera(&square(32)).expect("a camera");
    assert!(picture(&scene, &camera, Method::Path, 4, 1).into_iter().any(|light| light > 0.0));
}

/// A glass filled with a liquid, whose faces coincide with those of the glass, on a white floor. When the second of two
/// coinciding faces was skipped, the mean was 2.16.
#[test]
fn a_liquid_in_a_glass_adds_no_light() {
    let mut description = white_sky();
    add(&mut description, "floor", quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(1.0, 0.0));
    let wall = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0), false);
    let cavity = cuboid(Vec3::new(-0.8, 0.2, -0.8), Vec3::new(0.8, 1.8, 0.8), true);
    add(&mut description, "glass", joined(wall, cavity), glass(1.5));
    add(&mut description, "liquid", cuboid(Vec3::new(-0.8, 0.2, -0.8), Vec3::new(0.8, 1.2, 0.8), false), glass(1.33));
    description.cameras.push(look_at(DVec3::new(0.7, 3.0, 4.0), DVec3::new(0.0, 0.9, 0.0), 35.0));
    is_white("liquid in a glass", &build(description), &METHODS);
}

/// Stacks of blocks: of one glass, of two glasses, and of one mesh.
#[test]
fn stacks_of_blocks_add_no_light() {
    let block = |k: i32| {
        let (low, high) = (0.7 * k as f32, 0.7 * (k + 1) as f32);
        cuboid(Vec3::new(-1.0, low, -1.0), Vec3::new(1.0, high, 1.0), false)
    };
    let stack = |mut add_block: Box<dyn FnMut(&mut Description)>| {
        let mut description = white_sky();
        add_block(&mut description);
        description.cameras.push(look_at(DVec3::new(0.7, 3.0, 5.0), DVec3::new(0.0, 1.0, 0.0), 35.0));
        build(description)
    };
    let of = |indices: [f32; 3]| {
        stack(Box::new(move |d| {
            for (k, ior) in indices.into_iter().enumerate() {
                add_at(d, "block", block(k as i32), glass(ior), placed());
            }
        }))
    };
    is_white("three blocks of one glass", &of([1.5; 3]), &METHODS);
    is_white("three glasses", &of([1.3, 1.5, 1.8]), &METHODS);
    let one = stack(Box::new(move |d| {
        add(d, "stack", joined(joined(block(0), block(1)), block(2)), glass(1.5));
    }));
    is_white("one mesh", &one, &METHODS);
    // Shadow rays connect to rough glass from outside and from inside, so they cross coinciding surfaces.
    let rough = stack(Box::new(move |d| {
        for (k, ior) in [1.3, 1.5, 1.8].into_iter().enumerate() {
            add(d, "block", block(k as i32), Material { roughness: 0.3.into(), ..glass(ior) });
        }
    }));
    is_white("three rough glasses", &rough, &METHODS);
}

/// Thin panes far from the origin, 16 and 41 rounding errors thick. When rays started 32 rounding errors beyond a
/// plane, they skipped both faces, and the mean was 0.46.
#[test]
fn thin_panes_far_from_the_origin_are_not_skipped() {
    for (away, thickness) in [(900.0, 1e-3), (3000.0, 1e-2)] {
        let mut description = white_sky();
        let at = away as f32;
        let pane = cuboid(Vec3::new(at, -1.0, -1.0), Vec3::new(at + thickness, 1.0, 1.0), false);
        let clear: Material = glass(1.5);
        add(&mut description, "pane", pane, clear);
        description.cameras.push(look_at(DVec3::new(away - 3.0, 0.2, 0.3), DVec3::new(away, 0.0, 0.0), 30.0));
        is_white("a pane far away", &build(description), &[Method::Path, Method::Bdpt]);
    }
}

/// The plan reports a pane that is too thin for single precision at its position (3 rounding errors of 0.24 mm in a
/// scene of kilometres), and does not report a thicker one.
#[test]
fn panes_too_thin_for_single_precision_are_reported() {
    for (thickness, named) in [(7e-4, true), (0.02, false)] {
        let mut description = white_sky();
        let pane = cuboid(Vec3::new(3000.0, -1.0, -1.0), Vec3::new(3000.0 + thickness, 1.0, 1.0), false);
        add(&mut description, "pane", pane, glass(1.5));
        add(&mut description, "ground", square_of(-4000.0, 4000.0), matte(0.5, 0.0));
        description.cameras.push(look_at(DVec3::new(2997.0, 0.2, 0.3), DVec3::new(3000.0, 0.0, 0.0), 30.0));
        let scene = build(description);
        let reported = scene.warnings.iter().any(|warning| warning.contains("\"pane\"") && warning.contains("thinner"));
        assert_eq!(reported, named, "{thickness}: {:?}", scene.warnings);
    }
}

/// A square in the plane y = 0.
fn square_of(low: f32, high: f32) -> Mesh {
    quad(Vec3::new(low, -2.0, low), Vec3::Z * (high - low), Vec3::X * (high - low))
}

/// Mean of a picture over seeds, and its standard error.
fn mean_of(scene: &Scene, method: Method, iterations: u64) -> (f64, f64) {
    let camera = scene.camera(&square(12)).expect("a camera");
    let mean = |seed| {
        let pixels = picture(scene, &camera, method, iterations, seed);
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    mean_and_error(&(1..=SEEDS).map(mean).collect::<Vec<_>>())
}

/// Checks by all `methods` that `scenes[0]` has the brightness of all other scenes but the last, within 1 % and noise,
/// and differs from the last. Photon methods have too much noise for the last scene; they must reject an error of 15 %
/// instead.
fn look_alike(what: &str, scenes: &[Scene], methods: &[Method]) {
    let checks = methods.len() * (scenes.len() - 1);
    let critical = t_critical(sidak(ERROR_RATE, checks), 1, SEEDS as f64 - 1.0);
    for &method in methods {
        let iterations = match method {
            Method::Path => 10,
            Method::Sppm => 7,
            _ => 3,
        };
        let means: Vec<(f64, f64)> = scenes.iter().map(|scene| mean_of(scene, method, iterations)).collect();
        println!("{what}, {method:?}: {means:.5?}");
        let alike =
            |other: (f64, f64)| (means[0].0 - other.0).abs() <= critical * means[0].1.hypot(other.1) + 0.01 * other.0;
        let (&planted, others) = means[1..].split_last().expect("another scene");
        assert!(others.iter().all(|&other| alike(other)), "{what}, {method:?}: {means:?}");
        let off = (1.15 * others[0].0, others[0].1);
        let rejects = !alike(planted) || method == Method::Sppm && !alike(off);
        assert!(rejects, "{what}, {method:?}: the two are not distinguished {means:?}");
    }
}

/// A block of glass `gap` above a table, seen through its side, under a sky with a lamp beside it.
fn block_on(table: Material, gap: f32, optical_contact: bool) -> Scene {
    let mut description = white_sky();
    add(&mut description, "table", quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0), table);
    add(&mut description, "lamp", quad(Vec3::new(1.5, 0.1, -1.0), Vec3::Z * 2.0, Vec3::Y * 1.5), matte(0.0, 6.0));
    let block = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 1.0, 1.0), false);
    let lifted = DAffine3::from_translation(DVec3::Y * f64::from(gap));
    add_at(&mut description, "block", block, Material { optical_contact, ..glass(1.5) }, lifted);
    description.cameras.push(look_at(DVec3::new(0.3, 0.9, 4.0), DVec3::new(0.0, 0.35, 0.9), 12.0));
    build(description)
}

/// A glass on a table looks as if it were lifted by a hair. When table and glass counted as in optical contact, there
/// was no total internal reflection at its foot.
#[test]
fn a_glass_on_a_table_looks_like_one_just_above_it() {
    let metal = Material { base_color: [0.7, 0.7, 0.7, 1.0], roughness: 0.4.into(), ..mirror() };
    for (what, table) in [("matte table", matte(0.6, 0.0)), ("metal table", metal)] {
        let of = |gap, optical| block_on(table.clone(), gap, optical);
        look_alike(what, &[of(0.0, false), of(1e-3, false), of(1e-4, false), of(0.0, true)], &METHODS);
    }
}

/// A lamp that touches the foot of a glass shines through its surface, like a lamp just below it.
#[test]
fn a_lamp_that_touches_a_glass_shines_like_one_just_below_it() {
    let of = |gap: f32, optical_contact: bool| {
        let mut description = Description::default();
        add(&mut description, "wall", quad(Vec3::new(-2.0, -1.0, -2.0), Vec3::X * 4.0, Vec3::Y * 4.0), matte(0.7, 0.0));
        let lamp = quad(Vec3::new(-0.6, 0.0, -0.6), Vec3::Z * 1.2, Vec3::X * 1.2);
        add(&mut description, "lamp", lamp, matte(0.3, 5.0));
        let block = cuboid(Vec3::new(-1.0, gap, -1.0), Vec3::new(1.0, 1.0 + gap, 1.0), false);
        let rough = Material { roughness: 0.3.into(), optical_contact, ..glass(1.5) };
        add(&mut description, "block", block, rough);
        description.cameras.push(look_at(DVec3::new(0.5, 1.3, 5.0), DVec3::new(0.0, 0.6, 0.0), 30.0));
        build(description)
    };
    look_alike("lamp below a glass", &[of(0.0, false), of(1e-4, false), of(0.0, true)], &METHODS);
}

/// A room full of fog, whose faces coincide with the walls or are behind them.
fn foggy_room(beyond: f32, density: f32) -> Scene {
    let mut description = Description::default();
    let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    add(&mut description, "room", cuboid(low, high, true), matte(0.5, 0.0));
    let medium = MediumParameters { sigma_a: Rgb::splat(0.2 * density), sigma_s: Rgb::splat(density), g: 0.3 };
    let fog = Material { medium: Some(medium), ..glass(1.0) };
    add(&mut description, "fog", cuboid(low - beyond, high + beyond, false), fog);
    add(&mut description, "lamp", quad(Vec3::new(-0.3, 1.9, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6), matte(0.0, 8.0));
    description.lights.push(point_light(DVec3::new(0.5, 0.4, 0.5), 0.3));
    description.cameras.push(look_at(DVec3::new(0.1, 1.0, 0.9), DVec3::new(0.0, 0.8, -1.0), 60.0));
    build(description)
}

/// Fog that ends on the walls of a room surrounds cameras, lamps and points in the room. It did not when the search for
/// the solids around a point stopped at the walls.
#[test]
fn fog_that_ends_on_walls_is_found() {
    let scenes = [foggy_room(0.0, 1.0), foggy_room(0.05, 1.0), foggy_room(0.0, 0.1)];
    look_alike("fog", &scenes, &[Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm]);
}

/// A point light in dark glass, under a lid that touches the glass: absorption starts at the light.
#[test]
fn a_point_light_in_glass_under_a_touching_lid_is_in_the_glass() {
    let of = |gap: f32, sigma: f32| {
        let mut description = Description::default();
        let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 1.0, 1.0));
        let medium = Some(MediumParameters { sigma_a: Rgb::splat(sigma), ..MediumParameters::default() });
        add(&mut description, "glass", cuboid(low, high, false), Material { medium, ..glass(1.0) });
        let lid = quad(Vec3::new(-1.5, 1.0 + gap, -1.5), Vec3::X * 3.0, Vec3::Z * 3.0);
        add(&mut description, "lid", lid, matte(0.5, 0.0));
        add(
            &mut description,
            "floor",
            quad(Vec3::new(-3.0, -0.5, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0),
            matte(0.5, 0.0),
        );
        description.lights.push(point_light(DVec3::new(0.1, 0.8, 0.1), 1.0));
        description.cameras.push(look_at(DVec3::new(3.0, 0.3, 3.0), DVec3::new(0.5, -0.4, 0.5), 25.0));
        build(description)
    };
    look_alike("lid", &[of(0.0, 1.2), of(1e-3, 1.2), of(0.0, 0.6)], &[Method::Path, Method::Bdpt, Method::Vcm]);
}
