//! Nested solids in any number, and the initial medium stacks of paths.

use crate::support;

use caustique::geometry::Mesh;
use caustique::material::{Alpha, Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::path_class::{ClassSet, Switches};
use caustique::pipeline::choose::Chosen;
use caustique::pipeline::plan::{PlanInput, plan};
use caustique::random::{Domain, Stream};
use caustique::render::{Control, InitialBandwidth, Levels, Method, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, Projection};
use caustique::scene::{Description, Scene, View};
use caustique::transport::{CameraPaths, Indirect, InitialMedia, Interior, LightPaths};
use support::scenes::{add, build, cuboid, glass, look_at, matte, quad, sphere, square};
use support::stats::{Check, mean_and_error, t_critical};

/// Nested shells of two alternating glasses under a uniform sky.
fn shells(count: u32) -> Scene {
    let mut description = Description::default();
    for i in 0..count {
        let radius = 1.0 - 0.6 * i as f32 / count as f32;
        // Rays to the common centre of concentric shells would not be refracted.
        let center = Vec3::new(0.1, 0.05, 0.0) * (1.0 - radius);
        // Flat facets, because shading normals would lose light.
        let mesh = Mesh { normals: Vec::new(), ..sphere(center, radius, 24) };
        add(&mut description, &format!("shell {i}"), mesh, glass(if i % 2 == 0 { 1.5 } else { 1.4 }));
    }
    let source = EnvironmentSource::Color(Rgb::ONE);
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 30.0));
    build(description)
}

/// Nested shells of clear glass are invisible under a uniform sky. With a stack of at most six solids, seven shells
/// gave 1.21. A t test over seeds with an error rate of 0.1 % over nine checks.
#[test]
fn furnace_of_nested_shells() {
    for count in [7, 12, 40] {
        let scene = shells(count);
        let camera = scene.camera(&square(8)).expect("a camera");
        for method in [Method::Path, Method::Bdpt, Method::Sppm] {
            let mean = |seed| {
                let settings = Settings {
                    seed,
                    method,
                    levels: Levels::new(1),
                    photons: 1000,
                    iterations: Some(8),
                    ..Settings::default()
                };
                let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
                rendered.pixels.iter().map(|p| p.mean(0).x).sum::<f64>() / rendered.pixels.len() as f64
            };
            let means: Vec<f64> = (0..6).map(mean).collect();
            let (mean, error) = mean_and_error(&means);
            println!("{count} shells, {method:?}: {mean} +- {error}");
            let allowed = t_critical(1e-3, 9, 5.0) * error + 1e-3;
            assert!((mean - 1.0).abs() < allowed, "{count} shells, {method:?}: {mean} +- {error}");
            assert!(
                (mean - 1.21).abs() > allowed,
                "{count} shells, {method:?}: {error} is too inaccurate for the test"
            );
        }
    }
}

/// A ray passes or enters glass of partial alpha as a whole: in a furnace the glass is invisible, and a slab transmits
/// its alpha times (1 - R) / (1 + R) = 12/13 plus all of the rest. When faces were skipped one by one, the means were
/// 1.046 and 1.130. A t test over seeds with an error rate of 0.1 % over all checks.
#[test]
fn rays_pass_or_enter_glass_with_alpha_as_a_whole() {
    for alpha in [0.0f32, 0.3, 0.7] {
        let partial =
            Material { alpha: Alpha::Blend, base_color: [1.0, 1.0, 1.0, alpha], roughness: 0.0.into(), ..glass(1.5) };
        let mut furnace = Description::default();
        let source = EnvironmentSource::Color(Rgb::ONE);
        furnace.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        let ball = Mesh { normals: Vec::new(), ..sphere(Vec3::ZERO, 1.0, 24) };
        add(&mut furnace, "ball", ball, partial.clone());
        let mut slab = Description::default();
        add(&mut slab, "slab", cuboid(Vec3::new(-9.0, -9.0, -0.5), Vec3::new(9.0, 9.0, 0.5), false), partial);
        add(&mut slab, "lamp", quad(Vec3::new(-99.0, -99.0, -2.0), Vec3::X * 198.0, Vec3::Y * 198.0), matte(0.0, 1.0));
        let share = f64::from(alpha);
        for (what, mut description, expected) in
            [("furnace", furnace, 1.0), ("slab", slab, 1.0 - share + share * 12.0 / 13.0)]
        {
            description.cameras.push(look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 10.0));
            let scene = build(description);
            let camera = scene.camera(&square(8)).expect("a camera");
            for method in [Method::Path, Method::Bdpt, Method::Sppm] {
                let mean = |seed| {
                    let settings = Settings { seed, method, photons: 1000, iterations: Some(8), ..Settings::default() };
                    let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
                    rendered.pixels.iter().map(|p| p.mean(0).x).sum::<f64>() / rendered.pixels.len() as f64
                };
                let (mean, error) = mean_and_error(&(0..12).map(mean).collect::<Vec<f64>>());
                println!("{what} {alpha}, {method:?}: {mean} +- {error}, {expected}");
                let allowed = t_critical(1e-3, 18, 11.0) * error + 2e-3;
                assert!((mean - expected).abs() < allowed, "{what} {alpha}, {method:?}: {mean} +- {error}, {expected}");
                assert!(allowed < 0.03, "{what} {alpha}, {method:?}: {error} is too inaccurate for the test");
            }
        }
    }
}

/// A solid exists for the share alpha of the light, so white solids of any alpha that scatter, with and without a white
/// ball inside, are invisible under a white sky: subpaths that are joined inside must agree whether the solid exists.
/// Camera inside and outside. When both decided apart, light was lost: the means were 0.53 to 0.95.
#[test]
fn subpaths_agree_whether_a_solid_exists() {
    let white = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(2.0), g: 0.3 };
    let partial = |alpha: f32, ior: f32, medium: Option<MediumParameters>| Material {
        alpha: Alpha::Blend,
        base_color: [1.0, 1.0, 1.0, alpha],
        medium,
        ..glass(ior)
    };
    let wax = Material {
        transmission: 0.0.into(),
        diffuse_transmission: 1.0.into(),
        specular: 0.0.into(),
        ..partial(0.5, 1.5, Some(white))
    };
    let fog = || partial(0.4, 1.0, Some(white));
    let usual = [(Method::Path, 0.08), (Method::Bdpt, 0.15), (Method::Vcm, 0.15), (Method::Sppm, 0.25)];
    let others = [Method::Cppm, Method::Appm, Method::Ppm, Method::Mlt].map(|method| (method, 0.3));
    // Methods that do not render media that scatter.
    let of_surfaces = [Method::Pm, Method::Bpm].map(|method| (method, 0.3));
    let cases = [
        ("fog", fog(), false, 4.0, &usual[..], 24),
        ("wax", wax, false, 4.0, &usual, 24),
        ("ball", fog(), true, 4.0, &usual, 24),
        ("inside", fog(), true, 0.9, &usual, 24),
        ("ball", fog(), true, 4.0, &others, 12),
        ("clear", partial(0.4, 1.0, None), true, 4.0, &of_surfaces, 24),
    ];
    for (what, solid, ball, eye, methods, iterations) in cases {
        let mut description = Description::default();
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        add(&mut description, "box", cuboid(Vec3::NEG_ONE, Vec3::ONE, false), solid.clone());
        // A second solid around it, whose alpha is another decision.
        let outer = Material { priority: -1, ..solid };
        add(&mut description, "around", cuboid(Vec3::splat(-1.3), Vec3::splat(1.3), false), outer);
        if ball {
            add(&mut description, "ball", sphere(Vec3::ZERO, 0.5, 16), matte(1.0, 0.0));
        }
        description.cameras.push(look_at(DVec3::new(0.1, 0.2, eye), DVec3::ZERO, 30.0));
        let scene = build(description);
        for &(method, detects) in methods {
            let settings = |seed| Settings {
                seed,
                // One map has all photons.
                photons: if method.has_one_map() { 100_000 } else { 4000 },
                initial_bandwidth: match method {
                    Method::Pm => InitialBandwidth::Nearest(20),
                    // Few of its paths meet. At 0.4, the curved ball loses 5 %.
                    Method::Bpm => InitialBandwidth::Fixed(0.2),
                    _ => InitialBandwidth::Fixed(0.1),
                },
                alpha: if method == Method::Bpm { 1.0 } else { Settings::default().alpha },
                levels: Levels::new(1),
                iterations: Some(iterations),
                ..Settings::default()
            };
            let mean = |seed| {
                let rendered = support::render(&scene, method, 8, &settings(seed));
                rendered.pixels.iter().map(|p| p.mean(0).x).sum::<f64>() / rendered.pixels.len() as f64
            };
            let bias = if matches!(method, Method::Path | Method::Bdpt | Method::Mlt) { 1e-3 } else { 0.02 };
            let check = Check { expected: 1.0, bias, detects };
            check.run(22, &format!("{what}, {method:?}"), &(0..12).map(mean).collect::<Vec<f64>>());
        }
    }
}

/// All solids around a point are found from inside, and leaving them in any order leaves the others on the stack: forty
/// steps along a ray.
#[test]
fn all_solids_around_a_point_are_known() {
    let scene = shells(40);
    let middle = Vec3::new(0.06, 0.03, 0.0);
    let mut interior = Interior::at(&scene, middle);
    for left in (0..40).rev() {
        let instance = interior.host(&scene).expect("a solid");
        assert_eq!(instance, left);
        let crossing = interior.crossing(&scene, instance, false);
        assert_eq!(crossing.before, Some(left));
        interior = crossing.interior;
    }
    assert_eq!(interior, Interior::default());
    // Entered in order and left in the same order: the first one is removed from the bottom of the stack.
    for instance in 0..40 {
        interior = interior.crossing(&scene, instance, true).interior;
    }
    assert_eq!(interior, Interior::at(&scene, middle));
    for instance in 0..39 {
        interior = interior.crossing(&scene, instance, false).interior;
        assert_eq!(interior.host(&scene), Some(39));
    }
    assert_eq!(interior.crossing(&scene, 39, false).interior, Interior::default());
}

/// Water up to y = 0 in a basin.
fn basin() -> Description {
    let mut description = Description::default();
    let medium = MediumParameters { sigma_a: Rgb::ONE, sigma_s: Rgb::ZERO, g: 0.0 };
    let water = Material { medium: Some(medium), ..glass(1.33) };
    add(&mut description, "water", cuboid(Vec3::new(-2.0, -2.0, -2.0), Vec3::new(2.0, 0.0, 2.0), false), water);
    description
}

/// Light from a lamp that crosses the water surface, and from a ball of emissive glass that emits to both sides, starts
/// in the medium at its own position. It started in the medium at the centre of each triangle.
#[test]
fn light_starts_in_the_medium_of_its_lamp() {
    let mut description = basin();
    let lamp = quad(Vec3::new(-1.0, -0.5, 0.0), Vec3::X * 0.8, Vec3::Y);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.0, 1.0) });
    let glowing = Material { emission: Rgb::ONE, double_sided: true, ..glass(1.5) };
    add(&mut description, "glowing", sphere(Vec3::new(0.9, 1.0, 0.0), 0.5, 16), glowing);
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO, 40.0));
    let scene = build(description);
    let camera = scene.camera(&square(8)).expect("a camera");
    let initial_media = InitialMedia::of(&scene, &camera);
    let pass = LightPaths::new(0, 1, Domain::Light, 4096, 8);
    let (mut wet, mut inside, mut outside) = (0, 0, 0);
    for emitted in (0..pass.count()).filter_map(|index| pass.emit(&scene, &initial_media, index)) {
        let (p, d) = (emitted.start.origin, emitted.start.direction);
        let within_ball = (p - Vec3::new(0.9, 1.0, 0.0)).dot(d) < 0.0;
        let expected = match () {
            () if p.x < 0.0 && p.y < 0.0 => Some(0),
            () if p.x > 0.0 && within_ball => Some(2),
            () => None,
        };
        // The ball has flat facets, so at the rim both media are correct.
        if p.x > 0.0 && (p - Vec3::new(0.9, 1.0, 0.0)).normalize().dot(d).abs() < 0.4 {
            continue;
        }
        assert_eq!(emitted.start.interior.material(&scene), expected, "{p} {d}");
        match expected {
            Some(0) => wet += 1,
            Some(_) => inside += 1,
            None => outside += 1,
        }
    }
    assert!(wet > 300 && inside > 300 && outside > 600, "{wet} {inside} {outside}");
}

/// Rays of an orthographic camera in front of a basin start in the water or above it.
#[test]
fn rays_start_in_the_medium_of_the_film() {
    let mut description = basin();
    let mut described = look_at(DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, 40.0);
    described.projection = Projection::Orthographic { xmag: 1.0, ymag: 1.0 };
    description.cameras.push(described);
    let scene = build(description);
    let camera = scene.camera(&square(16)).expect("a camera");
    let (interior, classes) = (InitialMedia::of(&scene, &camera).camera, ClassSet::ALL);
    let camera_paths = CameraPaths {
        lobes: false,
        scene: &scene,
        camera: &camera,
        interior,
        splits: 0,
        max_depth: 8,
        indirect: Indirect::Photons,
        classes,
        stop: None,
    };
    for index in 0..256u32 {
        let start = camera_paths.start((index % 16, index / 16), Stream::new(0, 1, Domain::Test, u64::from(index)));
        let wet = start.interior.material(&scene).is_some();
        assert_eq!(wet, start.origin.y < 0.0, "{}", start.origin);
    }
}

/// Overlapping solids of equal priority have the same medium in any order of entry, and the medium of the inner one if
/// one contains the other. A plan reports overlapping pairs of equal priority, and no others; smoke, whose boundary does
/// not refract, is in no pair.
#[test]
fn overlaps_do_not_depend_on_the_direction() {
    let boxes = |higher: i32| {
        let mut description = Description::default();
        let water = Material { name: "water".into(), ..glass(1.33) };
        let jar = Material { name: "jar".into(), priority: higher, ..glass(1.5) };
        add(&mut description, "water", cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 1.0), false), water);
        add(&mut description, "jar", cuboid(Vec3::new(-0.2, -0.1, 0.3), Vec3::new(0.6, 0.4, 0.7), false), jar);
        add(&mut description, "pebble", cuboid(Vec3::splat(0.8), Vec3::splat(0.9), false), glass(1.6));
        let smoke = cuboid(Vec3::splat(-0.5), Vec3::splat(0.5), false);
        add(&mut description, "smoke", smoke, Material { name: "smoke".into(), ..glass(1.0) });
        description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO, 40.0));
        build(description)
    };
    for (higher, host) in [(0, 1), (1, 1), (-1, 0)] {
        let scene = boxes(higher);
        let in_turn = |order: [u32; 2]| {
            let enter = |interior: Interior, solid: u32| interior.crossing(&scene, solid, true).interior;
            order.into_iter().fold(Interior::default(), enter).host(&scene)
        };
        assert_eq!([in_turn([0, 1]), in_turn([1, 0])], [Some(host); 2], "priority {higher}");
        assert_eq!([in_turn([0, 2]), in_turn([2, 0])], [Some(2); 2]);
        let camera = scene.camera(&square(8)).expect("a camera");
        let chosen = Chosen::named(Settings { method: Method::Path, ..Settings::default() });
        let input = PlanInput { chosen: &chosen, max_depth: None, switches: Switches::default() };
        let plan = plan(input, View::new(&scene, &camera), &Default::default());
        let named = |warning: &&String| warning.starts_with("objects \"water\" and \"jar\" overlap");
        assert_eq!(plan.warnings.iter().filter(named).count(), usize::from(higher == 0), "{:?}", plan.warnings);
        for other in ["pebble", "smoke"] {
            assert!(!plan.warnings.iter().any(|warning| warning.contains(other) && warning.contains("overlap")));
        }
    }
}
