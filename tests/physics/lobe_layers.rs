//! Light by the lobe of the first hit: it adds up to the picture, is where closed forms have it, and methods agree.

use crate::support;

use caustique::light::SpotEdge;
use caustique::material::Material;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::medium::MediumParameters;
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Control, Levels, Method, Rendered, Settings, Shard, render};
use caustique::scene::Scene;
use caustique::scene::description::{
    Description, EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight,
};
use caustique::transport::{Indirect, LobeLayer};
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square};

const WHOLE: Shard = Shard { index: 0, count: 1 };

fn settings(method: Method) -> Settings {
    let levels = Levels::decorrelated(if matches!(method, Method::Vcm | Method::Sppm) { 5 } else { 1 });
    Settings { method, levels, lobes: true, photons: 2000, iterations: Some(4), ..Settings::default() }
}

fn picture(scene: &Scene, settings: &Settings, size: u32) -> Rendered {
    let camera = scene.camera(&square(size)).expect("a camera");
    render(scene, &camera, settings, |_, _| Control::Continue)
}

/// A material with random lobes: plastic, metal, glass, sheen, a coat and diffuse transmission in random strengths.
fn random_material(seed: u64) -> Material {
    let draws = |index: u32| Stream::new(seed, 0, Domain::Test, 7).vertex(index);
    let (a, b, c) = (draws(0).two(Purpose::Pixel), draws(1).two(Purpose::Pixel), draws(2).two(Purpose::Pixel));
    let (d, e) = (draws(3).two(Purpose::Pixel), draws(4).two(Purpose::Pixel));
    let sometimes = |u: f32| if u < 0.5 { 0.0 } else { 2.0 * u - 1.0 };
    Material {
        base_color: [0.2 + 0.7 * a.x, 0.2 + 0.7 * a.y, 0.5, 1.0],
        roughness: b.x.into(),
        metallic: sometimes(b.y).into(),
        transmission: sometimes(c.x).into(),
        thin: true,
        clearcoat: sometimes(c.y).into(),
        clearcoat_roughness: d.x.into(),
        sheen_color: Rgb::splat(sometimes(d.y)).into(),
        sheen_roughness: 0.5.into(),
        diffuse_transmission: sometimes(e.x).into(),
        ..Material::default()
    }
}

/// Walls of random materials, solid glass, a mirror and all kinds of lights.
fn random_scene(seed: u64) -> Description {
    let mut scene = Description::default();
    let material = |index: u64| random_material(100 * seed + index);
    add(&mut scene, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), material(0));
    let screen = Material { transmission: 0.5.into(), metallic: 0.0.into(), ..material(1) };
    add(&mut scene, "screen", quad(Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 2.0, Vec3::Y * 2.0), screen);
    add(&mut scene, "mirror", quad(Vec3::new(0.0, 0.0, -1.5), Vec3::X * 2.0, Vec3::Y * 2.0), mirror());
    add(&mut scene, "left", sphere(Vec3::new(-0.9, 0.5, 0.0), 0.4, 24), material(2));
    add(&mut scene, "glass", sphere(Vec3::new(0.0, 0.5, 0.3), 0.4, 24), glass(1.5));
    add(
        &mut scene,
        "rough",
        sphere(Vec3::new(0.9, 0.5, 0.0), 0.4, 24),
        Material { roughness: 0.4.into(), ..glass(1.4) },
    );
    add(&mut scene, "panel", quad(Vec3::new(0.5, 2.5, -0.5), Vec3::X, Vec3::Z), matte(0.0, 9.0));
    let spot = PunctualKind::Spot { inner: 0.3, outer: 0.5, edge: SpotEdge::default() };
    scene.lights.push(PunctualLight { radius: 0.1, ..point_light(DVec3::new(-1.0, 1.7, 0.5), 4.0) });
    scene.lights.push(PunctualLight { kind: spot, ..point_light(DVec3::new(0.0, 3.0, 0.2), 6.0) });
    scene.lights.push(PunctualLight { kind: PunctualKind::Sun { angle: 0.05 }, ..point_light(DVec3::ZERO, 0.3) });
    let source = EnvironmentSource::Color(Rgb::new(0.2, 0.3, 0.5));
    scene.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    scene.cameras.push(look_at(DVec3::new(0.3, 1.6, 3.5), DVec3::new(0.0, 0.6, 0.0), 50.0));
    scene
}

/// Variants of all methods: levels with one and two camera paths, and camera paths that go on after photons.
fn variants() -> Vec<Settings> {
    let mut all: Vec<Settings> = Method::ALL.iter().map(|method| settings(*method)).collect();
    let sppm = settings(Method::Sppm);
    all.push(Settings { indirect: Indirect::Paths, ..sppm.clone() });
    let mut plus = settings(Method::Cppm);
    plus.chi_squared.plus = true;
    all.extend([plus, Settings { levels: Levels::new(5), ..sppm }]);
    all
}

/// The layers add up to the picture in every pixel, and recording them does not change the picture.
#[test]
fn layers_add_up_to_the_picture_by_all_methods() {
    for seed in 0..2 {
        let scene = build(random_scene(seed));
        for settings in variants() {
            let rendered = picture(&scene, &settings, 16);
            let plain = picture(&scene, &Settings { lobes: false, ..settings.clone() }, 16);
            let own = rendered.settings.levels.picture_level();
            let mut total = [DVec3::ZERO; LobeLayer::ALL.len()];
            for (index, (pixel, plain)) in rendered.pixels.iter().zip(&plain.pixels).enumerate() {
                let what = format!("{:?}, {:?}, seed {seed}, pixel {index}", settings.method, settings.indirect);
                let whole = pixel.mean(own);
                assert_eq!(whole, plain.mean(own), "{what}: recording changes the picture");
                assert!(!plain.has_lobes() && plain.size() < pixel.size());
                let layers = LobeLayer::ALL.map(|layer| pixel.lobe_light(layer));
                let sum: DVec3 = layers.iter().sum();
                assert!((sum - whole).abs().cmple(whole * 1e-5 + 1e-9).all(), "{what}: {sum} of {whole}: {layers:?}");
                assert!(layers.iter().all(|layer| layer.min_element() >= -1e-6 * whole.max_element()), "{what}");
                total.iter_mut().zip(layers).for_each(|(total, layer)| *total += layer);
            }
            // The scene has light in all layers, except those of media; light tracing sees no lights on mirrors.
            let dark = |layer: LobeLayer| total[layer as usize] == DVec3::ZERO;
            for layer in LobeLayer::ALL {
                let of_medium = matches!(layer, LobeLayer::VolumeDirect | LobeLayer::VolumeIndirect);
                assert_eq!(dark(layer), of_medium, "{:?}, seed {seed}: {layer:?} {total:?}", settings.method);
            }
        }
    }
}

/// Shards join to the bits of the whole render.
#[test]
fn shards_join_their_layers_too() {
    let scene = build(random_scene(3));
    for method in [Method::Path, Method::Vcm, Method::Sppm, Method::Mlt] {
        let shard = |shard| picture(&scene, &Settings { shard, ..settings(method) }, 12);
        let whole = shard(WHOLE);
        let [mut joined, other] = [0, 1].map(|index| shard(Shard { index, count: 2 }));
        for ((pixel, other), whole) in joined.pixels.iter_mut().zip(other.pixels).zip(&whole.pixels) {
            pixel.join(other);
            assert!(LobeLayer::ALL.iter().all(|layer| pixel.lobe_light(*layer) == whole.lobe_light(*layer)));
            assert_eq!(pixel.lobe_colors(), whole.lobe_colors());
        }
    }
}

/// Means over the pixels of all layers, red channel.
fn means(rendered: &Rendered) -> [f64; LobeLayer::ALL.len()] {
    let count = rendered.pixels.len() as f64;
    LobeLayer::ALL.map(|layer| rendered.pixels.iter().map(|pixel| pixel.lobe_light(layer).x).sum::<f64>() / count)
}

/// Mean and standard error of the means over `renders` renders with different seeds.
fn estimate(scene: &Scene, of: &Settings, size: u32, renders: u64) -> [[f64; 2]; LobeLayer::ALL.len()] {
    let all: Vec<_> =
        (0..renders).map(|seed| means(&picture(scene, &Settings { seed: 77 + seed, ..of.clone() }, size))).collect();
    std::array::from_fn(|layer| {
        let count = renders as f64;
        let mean = all.iter().map(|one| one[layer]).sum::<f64>() / count;
        let square = all.iter().map(|one| (one[layer] - mean).powi(2)).sum::<f64>();
        [mean, (square / (count * (count - 1.0))).sqrt()]
    })
}

/// A scene whose light is in a single layer.
struct ClosedForm {
    name: &'static str,
    scene: Description,
    layer: LobeLayer,
    /// Radiance of every pixel.
    value: f64,
    methods: &'static [Method],
}

/// A camera above the origin that sees a small part of the floor.
fn above(scene: &mut Description) {
    scene.cameras.push(look_at(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 1.0));
}

fn floor(scene: &mut Description, material: Material) {
    add(scene, "floor", quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), material);
}

fn closed_forms() -> Vec<ClosedForm> {
    use Method::{Bdpt, Bpm, Mlt, Path, Pm, Sppm, Vcm};
    let pi = std::f64::consts::PI;
    let mut all = Vec::new();
    // A diffuse floor under a point light.
    let mut scene = Description::default();
    floor(&mut scene, matte(0.6, 0.0));
    scene.lights.push(point_light(DVec3::new(0.0, 2.0, 0.0), 5.0));
    above(&mut scene);
    let value = 0.6 / pi * 5.0 / 4.0;
    let methods = &[Path, Bdpt, Vcm, Sppm, Pm, Mlt];
    all.push(ClosedForm { name: "diffuse", scene, layer: LobeLayer::DiffuseDirect, value, methods });
    // A diffuse floor in an even sky sees only the sky.
    let mut scene = Description::default();
    floor(&mut scene, matte(0.6, 0.0));
    let source = EnvironmentSource::Color(Rgb::splat(2.0));
    scene.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    above(&mut scene);
    let methods = &[Path, Bdpt, Vcm, Sppm];
    all.push(ClosedForm { name: "sky", scene, layer: LobeLayer::DiffuseDirect, value: 1.2, methods });
    // A mirror that shows a panel.
    let mut scene = Description::default();
    floor(&mut scene, mirror());
    add(&mut scene, "panel", quad(Vec3::new(-9.0, 8.0, -9.0), Vec3::X * 18.0, Vec3::Z * 18.0), matte(0.0, 3.0));
    above(&mut scene);
    let methods = &[Path, Bdpt, Bpm, Vcm, Sppm, Mlt];
    all.push(ClosedForm { name: "mirror", scene, layer: LobeLayer::GlossyDirect, value: 3.0, methods });
    // A small mirror that shows a diffuse wall under a point light, whose image the wall has elsewhere.
    let mut scene = Description::default();
    add(&mut scene, "mirror", quad(Vec3::new(-0.1, 0.0, -0.1), Vec3::Z * 0.2, Vec3::X * 0.2), mirror());
    add(&mut scene, "wall", quad(Vec3::new(-9.0, 8.0, -9.0), Vec3::X * 18.0, Vec3::Z * 18.0), matte(0.5, 0.0));
    scene.lights.push(point_light(DVec3::new(3.0, 6.0, 0.0), 70.0));
    let value = 0.5 / pi * 70.0 * 2.0 / 13f64.powf(1.5);
    above(&mut scene);
    let methods = &[Path, Bdpt, Vcm, Mlt];
    all.push(ClosedForm { name: "wall", scene, layer: LobeLayer::GlossyIndirect, value, methods });
    // A slab of glass before a panel: (1 - R) / (1 + R) of the light passes, with all reflections in the slab.
    let mut scene = Description::default();
    add(&mut scene, "slab", cuboid(Vec3::new(-9.0, -0.1, -9.0), Vec3::new(9.0, 0.1, 9.0), false), glass(1.5));
    add(&mut scene, "panel", quad(Vec3::new(-9.0, -4.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.0, 3.0));
    above(&mut scene);
    let methods = &[Path, Bdpt, Vcm, Sppm, Mlt];
    let value = 3.0 * (1.0 - 0.04) / (1.0 + 0.04);
    all.push(ClosedForm { name: "slab", scene, layer: LobeLayer::TransmissionIndirect, value, methods });
    // A thin pane: one event, so its light is direct.
    let mut scene = Description::default();
    floor(&mut scene, Material { thin: true, ..glass(1.5) });
    add(&mut scene, "panel", quad(Vec3::new(-9.0, -4.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.0, 3.0));
    above(&mut scene);
    let methods = &[Path, Bdpt, Vcm, Sppm, Mlt];
    let value = 3.0 * (1.0 - 0.04);
    all.push(ClosedForm { name: "pane", scene, layer: LobeLayer::TransmissionDirect, value, methods });
    all
}

/// Each scene has all of its light in one layer, with the radiance of its closed form. A value 3 % off is rejected, and
/// so is the light in another layer. Checks at 6 standard errors and 0.2 % for rounding: the rate of false alarms of all
/// 30 is below 1e-4.
#[test]
fn closed_forms_have_their_light_in_one_layer() {
    for ClosedForm { name, scene, layer, value, methods } in closed_forms() {
        let scene = build(scene);
        for method in methods {
            let all = estimate(&scene, &Settings { iterations: Some(64), ..settings(*method) }, 4, 8);
            let [mean, error] = all[layer as usize];
            let agrees = |value: f64| (mean - value).abs() <= 6.0 * error + 2e-3 * value;
            assert!(agrees(value), "{name}, {method:?}: {mean} +- {error} of {value}");
            assert!(
                !agrees(1.03 * value) && !agrees(0.97 * value),
                "{name}, {method:?}: {mean} +- {error} is too vague"
            );
            for other in LobeLayer::ALL.into_iter().filter(|other| *other != layer) {
                assert_eq!(all[other as usize], [0.0; 2], "{name}, {method:?}: {other:?}");
            }
        }
    }
}

/// Methods agree on every layer of scenes whose surfaces have several lobes: the shares of camera paths, of connections,
/// of light paths and of photons are the same. Rate of false alarms at 6 standard errors of 12 renders: below 1e-3 for
/// all 40 comparisons. `bias`: what photons may add.
#[test]
fn methods_agree_on_all_layers() {
    let mut scene = random_scene(5);
    // Only camera paths find the caustics of small lights in reasonable time.
    scene.lights.clear();
    let scene = build(scene);
    let of = |method| estimate(&scene, &Settings { iterations: Some(24), ..settings(method) }, 12, 12);
    let reference = of(Method::Path);
    let agrees = |one: &[f64; 2], other: &[f64; 2], bias: f64| {
        let error = one[1].hypot(other[1]);
        (one[0] - other[0]).abs() <= 6.0 * error + bias * one[0].max(other[0])
    };
    let mut rejected = 0;
    for (method, bias) in [(Method::Bdpt, 0.0), (Method::Vcm, 0.03), (Method::Sppm, 0.05), (Method::Mlt, 0.0)] {
        let found = of(method);
        for layer in LobeLayer::ALL {
            let (one, other) = (&reference[layer as usize], &found[layer as usize]);
            assert!(agrees(one, other, bias), "{method:?}, {layer:?}: {other:?}, path tracing has {one:?}");
        }
        // Faults: lobes are exchanged, or direct and indirect light are.
        let pairs = [
            (LobeLayer::DiffuseDirect, LobeLayer::GlossyDirect),
            (LobeLayer::GlossyDirect, LobeLayer::TransmissionDirect),
            (LobeLayer::DiffuseDirect, LobeLayer::DiffuseIndirect),
        ];
        rejected += pairs.iter().filter(|(a, b)| !agrees(&reference[*a as usize], &found[*b as usize], bias)).count();
    }
    assert_eq!(rejected, 12, "exchanged layers go unnoticed");
}

/// The colours are the albedos of the lobes, whatever the light.
#[test]
fn colours_are_albedos_of_the_lobes() {
    let of = |material: Material| {
        let mut scene = Description::default();
        floor(&mut scene, material);
        above(&mut scene);
        picture(&build(scene), &settings(Method::Path), 2).pixels[0].lobe_colors()
    };
    let near = |found: [DVec3; 3], expected: [f64; 3]| {
        let apart = found.iter().zip(expected).map(|(found, expected)| (*found - expected).abs().max_element());
        assert!(apart.fold(0.0, f64::max) < 2e-3, "{found:?} {expected:?}");
    };
    near(of(matte(0.6, 0.0)), [0.6, 0.0, 0.0]);
    near(of(mirror()), [0.0, 1.0, 0.0]);
    near(of(Material { thin: true, ..glass(1.5) }), [0.0, 0.04, 0.96]);
    near(of(glass(1.5)), [0.0, 0.04, 0.96]);
}

/// Media have layers of their own, and what is seen through them adds up, too.
#[test]
fn layers_add_up_in_fog() {
    let fog = MediumParameters { sigma_a: Rgb::splat(0.05), sigma_s: Rgb::new(0.1, 0.2, 0.3), g: 0.3 };
    let scene = build(Description { medium: Some(fog), ..random_scene(7) });
    for method in [Method::Path, Method::Light, Method::Bdpt, Method::Vcm, Method::Sppm, Method::Cppm, Method::Mlt] {
        let rendered = picture(&scene, &settings(method), 12);
        let own = rendered.settings.levels.picture_level();
        let mut total = [0.0; LobeLayer::ALL.len()];
        for (index, pixel) in rendered.pixels.iter().enumerate() {
            let (whole, layers) = (pixel.mean(own), LobeLayer::ALL.map(|layer| pixel.lobe_light(layer)));
            let sum: DVec3 = layers.iter().sum();
            assert!(
                (sum - whole).abs().cmple(whole * 1e-5 + 1e-9).all(),
                "{method:?}, pixel {index}: {sum} of {whole}"
            );
            total.iter_mut().zip(layers).for_each(|(total, layer)| *total += layer.x);
        }
        let lit = |layer: LobeLayer| total[layer as usize] > 0.0;
        assert!(lit(LobeLayer::VolumeDirect) && lit(LobeLayer::VolumeIndirect), "{method:?}: {total:?}");
    }
}
