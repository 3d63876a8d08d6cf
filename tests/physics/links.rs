//! Light linking: lights that shine on some objects only, by all methods; and shadow linking: lights that only some
//! objects block, by path tracing.
//!
//! The closed form is checked by t tests over independent seeds at a family-wise error rate of 0.1 % (Sidak); besides
//! noise they allow for the error of kernels where photons are gathered (3 %). Every check must reject a picture that is
//! off by 40 %.

use crate::support;

use caustique::geometry::Mesh;
use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::pipeline::check::check_settings;
use caustique::render::{Control, InitialBandwidth, Levels, Method, Settings, render};
use caustique::scene::Scene;
use caustique::scene::description::{Description, Linked, Links, PunctualKind, PunctualLight};
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 8;
/// Field of view of the camera above the floors (degrees).
const VIEW: f32 = 60.0;

/// Adds an object in a collection of its own name.
fn put(description: &mut Description, name: &str, mesh: Mesh, material: Material) {
    add(description, name, mesh, material);
    let links = Links { collections: vec![name.into()], ..Links::default() };
    description.instances.last_mut().expect("the instance was added").links = Some(Arc::new(links));
}

fn receivers(include: &[&str], exclude: &[&str]) -> Option<Arc<Links>> {
    let names = |names: &[&str]| names.iter().map(|&name| name.into()).collect();
    let receivers = Linked { include: names(include), exclude: names(exclude) };
    Some(Arc::new(Links { receivers, ..Links::default() }))
}

/// The objects in these collections do not block the light of a light.
fn passed(exclude: &[&str]) -> Option<Arc<Links>> {
    let receivers = receivers(&[], exclude)?.receivers.clone();
    Some(Arc::new(Links { blockers: receivers, ..Links::default() }))
}

fn settings(method: Method) -> Settings {
    Settings {
        method,
        photons: 1000,
        // These two have as many light paths as pixels.
        iterations: Some(if matches!(method, Method::Light | Method::Bpm) { 2000 } else { 16 }),
        levels: Levels::new(1),
        initial_bandwidth: InitialBandwidth::Fixed(0.15),
        alpha: method.default_alpha(),
        ..Settings::default()
    }
}

/// The pixels of a picture of `size` x `size` pixels.
fn picture(scene: &Scene, settings: &Settings, size: u32) -> Vec<caustique::math::DVec3> {
    let camera = scene.camera(&square(size)).expect("a camera");
    let rendered = render(scene, &camera, settings, |_, _| Control::Continue);
    rendered.pixels.iter().map(|pixel| pixel.mean(0)).collect()
}

/// Two floors below a light of each kind. The camera sees the middle of one of them.
fn floors(light: &str, links: Option<Arc<Links>>, seen: f64) -> Description {
    let mut scene = Description::default();
    for (name, x) in [("left", -2.0), ("right", 0.0)] {
        put(&mut scene, name, quad(Vec3::new(x, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), matte(0.5, 0.0));
    }
    let kind = match light {
        "sun" => PunctualKind::Sun { angle: 0.02 },
        _ => PunctualKind::Point,
    };
    let radius = if light == "ball" { 0.05 } else { 0.0 };
    if light == "panel" {
        // It faces down; its intensity along its normal is 4.
        let quad = quad(Vec3::new(-0.05, 2.0, -0.05), Vec3::X * 0.1, Vec3::Z * 0.1);
        add(&mut scene, light, quad, matte(0.0, 400.0));
        scene.instances[2].links = links;
    } else {
        let pass_through = light == "ball";
        let place = point_light(DVec3::new(0.0, 2.0, 0.0), 4.0);
        scene.lights.push(PunctualLight { kind, radius, pass_through, links, ..place });
        if light == "sun" {
            let down = glam::DQuat::from_rotation_x(-0.5 * PI);
            scene.lights[0].to_world = caustique::math::DAffine3::from_quat(down);
        }
    }
    scene.cameras.push(look_at(DVec3::new(seen, 1.0, 0.0), DVec3::new(seen, 0.0, 0.0), VIEW));
    scene
}

/// The mean radiance of the part of the lit floor that the camera sees.
fn lit(light: &str) -> f64 {
    const POINTS: u32 = 64;
    let half = f64::from(0.5 * VIEW).to_radians().tan();
    let side = |i: u32| half * (2.0 * (f64::from(i) + 0.5) / f64::from(POINTS) - 1.0);
    let points = (0..POINTS * POINTS).map(|i| (0.7 + side(i % POINTS)).powi(2) + side(i / POINTS).powi(2));
    let irradiance = |distance2: f64| {
        let cos = 2.0 / (4.0 + distance2).sqrt();
        match light {
            "sun" => 4.0,
            "panel" => cos.powi(4),
            _ => cos.powi(3),
        }
    };
    0.5 / PI * points.map(irradiance).sum::<f64>() / f64::from(POINTS * POINTS)
}

#[test]
fn lights_shine_on_the_objects_that_they_are_linked_to_by_all_methods() {
    let linked = [receivers(&["left"], &[]), receivers(&[], &["right"]), receivers(&["left", "right"], &["right"])];
    let kinds = ["point", "ball", "sun", "panel"];
    let methods = Method::ALL;
    let critical = t_critical(sidak(ERROR_RATE, kinds.len() * methods.len()), 1, SEEDS as f64 - 1.0);
    let mut faults = Vec::new();
    for (index, kind) in kinds.into_iter().enumerate() {
        let links = &linked[index % linked.len()];
        let [left, right] = [-0.7, 0.7].map(|seen| build(floors(kind, links.clone(), seen)));
        for &method in methods {
            let settings = settings(method);
            let dark = picture(&right, &settings, 4);
            assert!(dark.iter().all(|&pixel| pixel == DVec3::ZERO), "{kind}, {method:?}: the other floor is lit");
            let mean = |seed| {
                picture(&left, &Settings { seed, ..settings.clone() }, 4).iter().map(|p| p.y).sum::<f64>() / 16.0
            };
            let (mean, error) = mean_and_error(&(1..=SEEDS).map(mean).collect::<Vec<f64>>());
            let [mean, error] = [mean, error].map(|value| value / lit(kind));
            println!("{kind}, {method:?}: {mean:.4} +- {error:.4}");
            let passes = |expected: f64| (mean - expected).abs() < critical * error + 0.03;
            if !passes(1.0) || passes(1.4) || passes(0.6) {
                faults.push(format!("{kind}, {method:?}: {mean:.4} +- {error:.4}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A floor, a mirror, a ball of glass and a cube of fog, under lights of all kinds that shine on the objects in `on` alone.
/// Cameras do not see the lights.
fn room(on: Option<&str>) -> Scene {
    let links = on.and_then(|name| receivers(&[name], &[]));
    let mut scene = Description::default();
    put(&mut scene, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), matte(0.8, 0.0));
    put(&mut scene, "mirror", quad(Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0), mirror());
    put(&mut scene, "ball", sphere(Vec3::new(0.0, 0.6, 0.0), 0.5, 16), glass(1.5));
    let medium = MediumParameters { sigma_a: Rgb::splat(0.2), sigma_s: Rgb::splat(2.0), g: 0.3 };
    let fog = Material { medium: Some(medium), ..glass(1.0) };
    put(&mut scene, "fog", cuboid(Vec3::new(-1.5, 0.1, 0.0), Vec3::new(-0.7, 0.9, 0.8), false), fog);
    let light = |p: DVec3, kind, radius| PunctualLight {
        kind,
        radius,
        bulb: radius > 0.0 && kind != PunctualKind::Point,
        pass_through: true,
        hidden_from_camera: true,
        links: links.clone(),
        ..point_light(p, 4.0)
    };
    let edge = caustique::light::SpotEdge::default();
    scene.lights.push(light(DVec3::new(-1.0, 2.0, 0.5), PunctualKind::Point, 0.1));
    scene.lights.push(light(DVec3::new(0.0, 3.0, 0.2), PunctualKind::Spot { inner: 0.5, outer: 0.7, edge }, 0.1));
    let mut sun = light(DVec3::ZERO, PunctualKind::Sun { angle: 0.05 }, 0.0);
    sun.to_world = caustique::math::DAffine3::from_quat(glam::DQuat::from_rotation_x(-1.2));
    scene.lights.push(PunctualLight { intensity: Rgb::ONE, bulb: false, ..sun });
    add(&mut scene, "panel", quad(Vec3::new(0.5, 2.5, -0.5), Vec3::X, Vec3::Z), matte(0.0, 5.0));
    let panel = scene.instances.last_mut().expect("the instance was added");
    (panel.links, panel.hidden_from_camera) = (links, true);
    scene.cameras.push(look_at(DVec3::new(0.3, 1.6, 3.5), DVec3::new(0.0, 0.5, 0.0), 45.0));
    build(scene)
}

/// Every path has one first receiver, so pictures whose lights shine on one object each sum to the whole: of the same
/// random numbers to the rounding error, in every pixel.
#[test]
fn pictures_of_single_receivers_sum_to_the_whole() {
    for method in [Method::Path, Method::Bdpt, Method::Light, Method::Vcm, Method::Sppm] {
        let settings = Settings { iterations: Some(4), ..settings(method) };
        let [whole, parts @ ..] = [None, Some("floor"), Some("mirror"), Some("ball"), Some("fog")]
            .map(|on| picture(&room(on), &settings, 16));
        let scale = whole.iter().map(|pixel| pixel.y).sum::<f64>() / whole.len() as f64;
        for (index, whole) in whole.iter().enumerate() {
            let sum: DVec3 = parts.iter().map(|part| part[index]).sum();
            let what = format!("{method:?}, pixel {index}: {sum} of {whole}");
            assert!((sum - *whole).abs().max_element() < 1e-4 * (whole.max_element() + scale), "{what}");
        }
        for (part, name) in parts.iter().zip(["floor", "mirror", "ball", "fog"]) {
            let sum: f64 = part.iter().map(|pixel| pixel.y).sum();
            println!("{method:?}, {name}: {:.3}", sum / (scale * whole.len() as f64));
            assert!(sum > 0.0, "{method:?}: nothing receives light on the {name}");
        }
    }
}

/// A floor below a light of one kind, which is at a height of 2. The camera sees the floor below the screens that
/// `screens` adds at heights around 1.
fn screened(floor: Material, kind: &str, links: Option<Arc<Links>>, screens: impl Fn(&mut Description)) -> Scene {
    let mut scene = Description::default();
    put(&mut scene, "floor", quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0), floor);
    // The middle of the picture shows it in a mirror.
    let at = DVec3::new(0.3, 2.0, -10.0 / 3.0);
    match kind {
        "panel" => {
            put(&mut scene, kind, quad(at.as_vec3() - Vec3::new(0.5, 0.0, 0.5), Vec3::X, Vec3::Z), matte(0.0, 4.0));
            let panel = scene.instances.last_mut().expect("the instance was added");
            let own = Links { collections: vec![kind.into()], ..Links::default() };
            panel.links =
                Some(links.map_or(own.clone(), |links| Links { blockers: links.blockers.clone(), ..own }).into());
        }
        _ => {
            let edge = caustique::light::SpotEdge::default();
            let (kind, radius) = match kind {
                "sun" => (PunctualKind::Sun { angle: 0.3 }, 0.0),
                "spot" => (PunctualKind::Spot { inner: 0.5, outer: 0.7, edge }, 0.2),
                "ball" => (PunctualKind::Point, 0.3),
                _ => (PunctualKind::Point, 0.0),
            };
            let bulb = matches!(kind, PunctualKind::Spot { .. });
            let mut light = PunctualLight { kind, radius, bulb, pass_through: true, links, ..point_light(at, 4.0) };
            light.to_world.matrix3 = glam::DMat3::from_rotation_x(-0.828 * PI);
            scene.lights.push(light);
        }
    }
    screens(&mut scene);
    scene.cameras.push(look_at(DVec3::new(0.3, 0.6, 1.0), DVec3::new(0.3, 0.0, 0.0), 0.5 * VIEW));
    build(scene)
}

/// Screens of every kind that a shadow ray may cross: an opaque one, glass with another glass inside, and fog.
fn add_screens(scene: &mut Description) {
    put(scene, "screen", quad(Vec3::new(-8.0, 0.8, -8.0), Vec3::Z * 16.0, Vec3::X * 16.0), matte(0.8, 0.0));
    let slab = |low: f32, high: f32| cuboid(Vec3::new(-7.0, low, -7.0), Vec3::new(7.0, high, 7.0), false);
    put(scene, "screen", slab(0.9, 1.2), glass(1.5));
    put(scene, "screen", slab(1.0, 1.1), glass(1.3));
    let medium = MediumParameters { sigma_a: Rgb::splat(2.0), sigma_s: Rgb::splat(3.0), g: 0.3 };
    put(scene, "screen", slab(1.3, 1.6), Material { medium: Some(medium), ..glass(1.0) });
}

/// Screens that do not block the light of a light leave no trace in the light on the floor, in every pixel of the same
/// random numbers, whether next-event estimation or a ray from a glossy floor or a mirror finds the light. Screens that
/// block it make the floor dark.
#[test]
fn objects_that_do_not_block_a_light_do_not_exist_for_it() {
    let settings = Settings { max_depth: 2, iterations: Some(64), ..settings(Method::Path) };
    let glossy = Material { roughness: 0.2.into(), ..mirror() };
    let fog = Material {
        medium: Some(MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(2.0), g: 0.5 }),
        ..glass(1.0)
    };
    for (name, floor) in [("matte", matte(0.5, 0.0)), ("glossy", glossy), ("mirror", mirror()), ("fog", fog)] {
        for kind in ["point", "ball", "sun", "spot", "panel"] {
            let add: fn(&mut Description) = match name {
                // The medium reaches up to the first screen.
                "fog" => |scene| {
                    let cube = cuboid(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 0.7, 3.0), false);
                    (scene.meshes[0], scene.instances[0].name) = (cube.into(), "cube".into());
                },
                _ => |_| (),
            };
            let picture = |links, screens: bool| {
                let scene = screened(floor.clone(), kind, links, |scene| {
                    add(scene);
                    if screens {
                        add_screens(scene);
                    }
                });
                picture(&scene, &settings, 8)
            };
            let [open, linked, blocked] =
                [picture(None, false), picture(passed(&["screen", kind]), true), picture(None, true)];
            let sum = |picture: &[DVec3]| picture.iter().map(|pixel| pixel.y).sum::<f64>();
            println!("{name}, {kind}: {} {} {}", sum(&open), sum(&linked), sum(&blocked));
            // A mirror shows no point.
            assert_eq!(sum(&open) > 0.0, (name, kind) != ("mirror", "point"), "{name}, {kind}: the floor");
            assert_eq!(sum(&blocked), 0.0, "{name}, {kind}: light passes screens that block it");
            // A ray that finds the light in fog is a random collision where the light is an object, but not with linking.
            if name == "fog" {
                let ratio = sum(&linked) / sum(&open);
                assert!((ratio - 1.0).abs() < 0.03, "{kind}: {ratio} in fog");
                continue;
            }
            let scale = sum(&open) / open.len() as f64;
            for (index, (open, linked)) in open.iter().zip(&linked).enumerate() {
                let what = format!("{name}, {kind}, pixel {index}: {linked} instead of {open}");
                assert!((*open - *linked).abs().max_element() <= 1e-3 * (open.max_element() + scale), "{what}");
            }
        }
    }
}

/// Where a solid that does not block a light fills the space, the light meets what would be there without the solid: the
/// medium of the scene, and solids of less priority, which absorb or block it.
#[test]
fn solids_that_do_not_block_a_light_leave_what_else_is_there() {
    let settings = Settings { max_depth: 2, iterations: Some(64), ..settings(Method::Path) };
    let slab = |low: f32, high: f32| cuboid(Vec3::new(-7.0, low, -7.0), Vec3::new(7.0, high, 7.0), false);
    let absorbing = |sigma: f32| MediumParameters { sigma_a: Rgb::splat(sigma), sigma_s: Rgb::ZERO, g: 0.0 };
    let around = |ior: f32, medium| Material { priority: 2, medium, ..glass(ior) };
    let inside = |ior: f32, medium| Material { priority: 1, medium, ..glass(ior) };
    type Case<'a> = (&'a str, Option<MediumParameters>, Option<Material>, Material);
    let cases: [Case<'_>; 4] = [
        ("fog and glass", Some(absorbing(0.5)), None, around(1.5, None)),
        ("fog and an absorbing solid", Some(absorbing(0.5)), None, around(1.5, Some(absorbing(3.0)))),
        ("a drink", None, Some(inside(1.0, Some(absorbing(1.0)))), around(1.5, None)),
        ("glass in glass", None, Some(inside(1.5, None)), around(1.0, Some(absorbing(3.0)))),
    ];
    for kind in ["point", "ball", "panel"] {
        for (name, medium, nested, screen) in &cases {
            let picture = |passes: bool| {
                let links = passed(&["screen", kind]);
                let scene = screened(matte(0.5, 0.0), kind, links, |scene| {
                    scene.medium = *medium;
                    if let Some(nested) = nested {
                        put(scene, "nested", slab(1.0, 1.3), nested.clone());
                    }
                    if passes {
                        put(scene, "screen", slab(0.8, 1.5), screen.clone());
                    }
                });
                picture(&scene, &settings, 8)
            };
            let [without, with] = [false, true].map(picture);
            let scale = without.iter().map(|pixel| pixel.y).sum::<f64>() / without.len() as f64;
            assert_eq!(scale > 0.0, *name != "glass in glass", "{kind}, {name}");
            for (index, (without, with)) in without.iter().zip(&with).enumerate() {
                let what = format!("{kind}, {name}, pixel {index}: {with} instead of {without}");
                assert!((*without - *with).abs().max_element() <= 1e-3 * (without.max_element() + scale), "{what}");
            }
        }
    }
}

/// An object that does not block the light of a light receives it all the same, and lights other objects.
#[test]
fn objects_that_do_not_block_a_light_receive_it() {
    let lit = |links| {
        let scene = screened(matte(0.0, 0.0), "panel", links, |scene| {
            put(scene, "screen", quad(Vec3::new(-3.0, 0.8, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0), matte(0.8, 0.0));
            scene.cameras.insert(0, look_at(DVec3::new(0.3, 1.4, 1.0), DVec3::new(0.3, 0.8, 0.0), VIEW));
        });
        picture(&scene, &Settings { iterations: Some(64), ..settings(Method::Path) }, 8)
    };
    let [whole, linked] = [lit(None), lit(passed(&["screen"]))];
    let sum = |picture: &[DVec3]| picture.iter().map(|pixel| pixel.y).sum::<f64>();
    assert!(sum(&whole) > 0.0 && (sum(&linked) / sum(&whole) - 1.0).abs() < 1e-3, "{} {}", sum(&whole), sum(&linked));
}

/// Methods with light paths refuse shadow linking, and name the method that renders it.
#[test]
fn other_methods_refuse_shadow_linking() {
    let scene = |links| screened(matte(0.5, 0.0), "ball", links, |_| ());
    let check = |method, scene: &Scene| check_settings(&settings(method), Path::new("scene.glb"), scene);
    for &method in Method::ALL {
        let refused = check(method, &scene(passed(&["floor"])));
        match method {
            Method::Path => refused.expect("path renders it"),
            _ => {
                let error = refused.expect_err("it is refused");
                assert!(error.cause.contains("does not render shadow linking"), "{error}");
                assert_eq!(error.hint.as_deref(), Some("choose --method path"));
            }
        }
        assert!(check(method, &scene(None)).is_ok(), "{method:?}");
    }
}
