//! Guided emission does not change the mean, whatever it has learned, and finds light that unguided emission misses.
//! Also tests the choice of `auto`.
//!
//! Means are compared by t tests over independent iterations at a family-wise error rate of 0.1 %. Each test must
//! reject paths whose flux ignores the guide.

use crate::support;

use caustique::choose::{Choice, EffectWeight, choose};
use caustique::estimator::PixelAccumulator;
use caustique::light::{Guide, Pattern, Profile, Region, SpotEdge};
use caustique::material::Material;
use caustique::math::{DVec3, Rgb, Vec2, Vec3};
use caustique::medium::MediumParameters;
use caustique::path_class::{ClassSet, Effect, PathClass};
use caustique::plan::switch;
use caustique::random::Domain;
use caustique::render::{Candidate, Control, InitialBandwidth, Levels, Method, Settings, Shard, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene, Survey, View};
use caustique::stat::floor;
use caustique::stop::Stop;
use caustique::texture::{Texels, Texture, TextureRef, Wrap};
use caustique::transport::{Indirect, InitialMedia, LightPaths};
use std::sync::Arc;
use support::scenes::{add, build, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square};
use support::stats::{mean_and_error, t_critical};

const PASSES: u64 = 48;
const PATHS: u32 = 4096;
/// A ball of glass, a mirror, and places beside them.
const REGIONS: [(Vec3, f32); 4] = [
    (Vec3::new(-0.5, 0.4, 0.0), 0.3),
    (Vec3::new(0.6, 0.3, 0.2), 0.25),
    (Vec3::new(0.0, 1.0, 0.5), 0.3),
    (Vec3::new(-0.5, 0.75, 0.0), 0.2),
];

fn targets(description: &mut Description) {
    add(description, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), matte(0.5, 0.0));
    add(description, "ball", sphere(REGIONS[0].0, 0.3, 32), glass(1.5));
    add(description, "mirror", sphere(REGIONS[1].0, 0.2, 32), mirror());
    description.cameras.push(look_at(DVec3::new(0.0, 1.5, 4.0), DVec3::new(0.0, 0.3, 0.0), 40.0));
}

/// Scenes with one kind of light each, and one with all kinds.
fn lit() -> Vec<(&'static str, Scene)> {
    type Light = fn(&mut Description);
    let lamp: Light = |d| {
        let mesh = quad(Vec3::new(-0.5, 2.0, -0.5), Vec3::X, Vec3::Z);
        add(d, "lamp", mesh, matte(0.0, 3.0));
    };
    let sheet: Light = |d| {
        let material = caustique::material::Material { double_sided: true, ..matte(0.0, 2.0) };
        add(d, "sheet", quad(Vec3::new(0.1, 0.2, -0.3), Vec3::Y, Vec3::Z * 0.5), material);
    };
    let point: Light = |d| d.lights.push(point_light(DVec3::new(0.2, 1.7, 0.8), 4.0));
    let kinds = |kind| PunctualLight { kind, ..point_light(DVec3::new(-0.2, 0.5, 3.0), 5.0) };
    let spot = kinds(PunctualKind::Spot { inner: 0.3, outer: 0.6, edge: SpotEdge::Squared });
    let honeycomb: Light = |d| {
        let material = Material { spread: 0.9, ..matte(0.0, 3.0) };
        add(d, "honeycomb", quad(Vec3::new(-0.5, 1.5, -0.5), Vec3::X, Vec3::Z), material);
    };
    let values = (0..15).map(|i| [0.2, 1.0, 0.0, 0.5, 0.7, 0.1, 0.9][i % 7]).collect::<Vec<f32>>();
    let values = [&values[..], &values[..5]].concat();
    let profile = Profile::new(vec![0.0, 0.3, 0.6, 1.2, 3.0], vec![0.0, 0.3, 0.6, 1.0], values).expect("a profile");
    let pattern = Some(Arc::new(Pattern::Profile(profile)));
    let shaped = PunctualLight { pattern, radius: 0.1, ..point_light(DVec3::new(0.2, 0.6, 2.0), 8.0) };
    let sky: Light = |d| {
        let (width, height) = (16, 8);
        let texels = (0..width * height).map(|i| [0.2 + (i % 5) as f32, 1.0, 0.5]).collect();
        let source = EnvironmentSource::Image { width, height, texels };
        d.environment = Some(EnvironmentDescription { source, rotation_deg: 20.0, strength: 1.0 });
    };
    let scene = |lights: &[Light], punctual: &[PunctualLight]| {
        let mut description = Description::default();
        targets(&mut description);
        lights.iter().for_each(|light| light(&mut description));
        description.lights.extend(punctual.iter().cloned());
        build(description)
    };
    vec![
        ("lamp", scene(&[lamp], &[])),
        ("sheet of two sides", scene(&[sheet], &[])),
        ("point", scene(&[point], &[])),
        ("spot", scene(&[], std::slice::from_ref(&spot))),
        ("profile", scene(&[], std::slice::from_ref(&shaped))),
        ("honeycomb", scene(&[honeycomb], &[])),
        ("sky", scene(&[sky], &[])),
        ("all", scene(&[lamp, sheet, point, sky], &[spot])),
    ]
}

/// Flux of light paths through the regions, one value per iteration. If `honest` is false, the flux ignores the guide
/// (the planted bug).
fn flux(scene: &Scene, guide: Option<&Guide>, region: Option<Region>, first: u64, honest: bool) -> Vec<[f64; 4]> {
    let initial_media = InitialMedia::new(scene, Vec3::new(0.0, 1.5, 4.0));
    let pass = |pass| {
        let pass = LightPaths::new(3, first + pass, Domain::Test, PATHS, u32::MAX).guided(guide).lighting(region);
        let mut sums = [0.0; 4];
        for emitted in (0..PATHS).filter_map(|index| pass.emit(scene, &initial_media, index)) {
            let (origin, d) = (emitted.start.origin, emitted.start.direction);
            let weight = if honest { 1.0 } else { 1.0 / emitted.ratio };
            for (sum, (center, radius)) in sums.iter_mut().zip(REGIONS) {
                let to = center - origin;
                let along = to.dot(d);
                if along > 0.0 && (to - d * along).length() < radius {
                    *sum += f64::from(emitted.start.throughput.element_sum() * weight);
                }
            }
        }
        sums
    };
    (0..PASSES).map(pass).collect()
}

#[test]
fn guiding_does_not_change_the_mean() {
    let scenes = lit();
    let critical = t_critical(1e-3, 5 * scenes.len() * REGIONS.len(), (PASSES - 1) as f64);
    for (name, scene) in &scenes {
        let mut guide = Guide::new(&scene.lights, true).expect("something to aim at");
        // Meaningless training data must not change the mean.
        let error: Vec<f64> = (0..guide.cells()).map(|cell| ((cell * 7 + 3) % 11) as f64).collect();
        let ones = vec![1.0; error.len()];
        guide.learn(&error, &ones, &ones);
        assert!((0.199..=0.901).contains(&guide.unguided()), "{name}: {}", guide.unguided());
        let whole = scene.lights.sky().radius;
        let [wide, narrow] = [0.4, 0.1].map(|share| Some(Region::new(Vec3::new(0.3, 0.2, -0.1), share * whole, whole)));
        let native = flux(scene, None, None, 0, true);
        let same = [
            ("guided", flux(scene, Some(&guide), None, 1000, true)),
            ("guided, to where the picture is", flux(scene, Some(&guide), wide, 2000, true)),
            ("guided, to where a small picture is", flux(scene, Some(&guide), narrow, 3000, true)),
            ("to where the picture is", flux(scene, None, wide, 4000, true)),
            ("to where a small picture is", flux(scene, None, narrow, 5000, true)),
        ];
        let forgetful = flux(scene, Some(&guide), None, 1000, false);
        let mut unnoticed = 0;
        for region in 0..REGIONS.len() {
            let of = |passes: &[[f64; 4]]| mean_and_error(&passes.iter().map(|sums| sums[region]).collect::<Vec<_>>());
            let ((a, error_a), (wrong, error_wrong)) = (of(&native), of(&forgetful));
            for (how, flux) in &same {
                let (b, error_b) = of(flux);
                let allowed = critical * error_a.hypot(error_b) + 1e-12;
                println!("{name}, region {region}: {a:.4} +- {error_a:.4}, {how} {b:.4} +- {error_b:.4}");
                assert!((a - b).abs() <= allowed, "{name}, region {region}: {a} and {how} {b}, allowed {allowed}");
            }
            unnoticed += usize::from((a - wrong).abs() <= critical * error_a.hypot(error_wrong));
        }
        assert!(unnoticed < REGIONS.len(), "{name}: flux that forgets the guide is not detected");
    }
}

/// Cells with nine times the error get three times the light paths, and cells with nine times the cost a third. A fifth
/// of the paths stays unguided.
#[test]
fn light_paths_follow_error_and_cost_of_cells() {
    let scene = &lit()[2].1;
    let mut guide = Guide::new(&scene.lights, false).expect("something to aim at");
    assert_eq!(guide.cells(), 3);
    let share = |guide: &Guide, seed| {
        let pass = LightPaths::new(seed, 0, Domain::Test, 20_000, u32::MAX).guided(Some(guide));
        let initial_media = InitialMedia::new(scene, Vec3::new(0.0, 1.5, 4.0));
        let mut counts = [0.0f64; 3];
        for emitted in (0..20_000).filter_map(|index| pass.emit(scene, &initial_media, index)) {
            counts[emitted.cell] += 1.0 / 20_000.0;
        }
        counts
    };
    guide.learn(&[0.0, 9.0, 1.0], &[1.0; 3], &[1.0; 3]);
    let [unguided, first, second] = share(&guide, 1);
    assert!((unguided - 0.2).abs() < 0.01, "{unguided}");
    // A tenth of the guided paths follows the power of the lights.
    assert!((first - 0.8 * (0.9 * 0.75 + 0.05)).abs() < 0.01 && (second - 0.8 * (0.9 * 0.25 + 0.05)).abs() < 0.01);
    // Without any error, nothing is learned.
    let before = share(&guide, 2);
    guide.learn(&[1.0, 0.0, 0.0], &[1.0; 3], &[1.0; 3]);
    assert_eq!(before, share(&guide, 2));
    // The same error from paths of nine times the cost: a third of the paths.
    guide.learn(&[0.0, 1.0, 1.0], &[1.0; 3], &[1.0, 1.0, 9.0]);
    let [_, first, second] = share(&guide, 3);
    assert!((first - 0.8 * (0.9 * 0.75 + 0.05)).abs() < 0.01 && (second - 0.8 * (0.9 * 0.25 + 0.05)).abs() < 0.01);
    // If light paths carry all light, a fifth goes to objects that make caustics, regardless of their error.
    let mut guide = Guide::new(&scene.lights, true).expect("something to aim at");
    guide.learn(&[0.0, 9.0, 1.0], &[1.0; 3], &[1.0; 3]);
    let [unguided, first, second] = share(&guide, 4);
    assert!((unguided - 0.8).abs() < 0.01, "{unguided}");
    assert!((first - 0.2 * (0.9 * 0.75 + 0.05)).abs() < 0.01 && (second - 0.2 * (0.9 * 0.25 + 0.05)).abs() < 0.01);
}

/// Mean of a part of the light and the variance of all light, summed over pixels, after twelve iterations with one
/// level.
fn light_and_variance(scene: &Scene, settings: Settings, part: impl Fn(&PixelAccumulator) -> DVec3) -> (f64, f64) {
    let camera = scene.camera(&square(16)).expect("a camera");
    let settings = Settings { levels: Levels::new(1), iterations: Some(12), ..settings };
    let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
    let light: f64 = rendered.pixels.iter().map(|p| part(p).element_sum() / 12.0).sum();
    let variance: f64 =
        rendered.pixels.iter().map(|p| p.variance_by_quarters().expect("twelve iterations").element_sum()).sum();
    println!("guided {}, {:?}: light {light:.3}, variance {variance:.6}", settings.guided, settings.indirect);
    (light, variance)
}

/// Two lamps in separate rooms, and the camera in one. Guiding sends more light paths from the lamp that is visible,
/// and the picture has less noise after the same number of paths.
#[test]
fn visible_lamps_get_more_light_paths() {
    let scene = {
        let mut d = Description::default();
        for (name, x, power) in [("seen", 0.0, 2.0), ("next door", 6.0, 40.0)] {
            let walls = cuboid(Vec3::new(x - 2.0, 0.0, -2.0), Vec3::new(x + 2.0, 3.0, 2.0), true);
            add(&mut d, name, walls, matte(0.6, 0.0));
            d.lights.push(point_light(DVec3::new(f64::from(x), 2.5, 0.0), power));
        }
        d.cameras.push(look_at(DVec3::new(0.0, 1.5, 1.9), DVec3::new(0.0, 0.5, -1.0), 60.0));
        build(d)
    };
    let guide = Guide::new(&scene.lights, true).expect("two lamps");
    assert_eq!(guide.cells(), 3);
    assert!(Guide::new(&scene.lights, false).is_none(), "nothing makes caustics");
    let picture = |guided| {
        let wide = InitialBandwidth::Fixed(0.2);
        light_and_variance(
            &scene,
            Settings { photons: 4000, guided, initial_bandwidth: wide, ..Settings::default() },
            |p| p.parts().indirect,
        )
    };
    let ((light, unguided), (same, guided)) = (picture(false), picture(true));
    assert!((light / same - 1.0).abs() < 0.2, "{light} and {same}");
    // By power, one path in fifteen comes from the visible lamp; with guiding, three in four.
    assert!(unguided > 4.0 * guided, "{unguided} and {guided}");
}

/// Rules with photon statistics find the same light with guided paths as with unguided ones: means of 16 seeds, Welch's
/// test, one false alarm in a thousand.
#[test]
fn rules_with_photon_statistics_can_be_guided() {
    let scene = room_with(0.15);
    let critical = t_critical(1e-3, 2, 15.0);
    for method in [Method::Appm, Method::Cppm] {
        let mean = |guided: bool| {
            let seeds = (1..=16).map(|seed| {
                let narrow = InitialBandwidth::Fixed(0.05);
                let settings =
                    Settings { photons: 10_000, guided, initial_bandwidth: narrow, seed, ..Settings::default() };
                light_and_variance(&scene, Settings { method, ..settings }, |p| p.parts().caustic).0
            });
            mean_and_error(&seeds.collect::<Vec<f64>>())
        };
        let ((a, error_a), (b, error_b)) = (mean(false), mean(true));
        let allowed = critical * error_a.hypot(error_b);
        println!("{method:?}: {a:.4} +- {error_a:.4}, guided {b:.4} +- {error_b:.4}");
        assert!(a != b, "not guided");
        assert!((a - b).abs() <= allowed, "{method:?}: {a} and guided {b}, allowed {allowed}");
        assert!((a - 1.5 * b).abs() > allowed, "{method:?}: half as much again is not detected");
    }
}

/// A small ball far below a lamp: the noise of its caustic with and without guiding, after the same number of light
/// paths.
#[test]
fn the_caustic_of_a_small_ball_is_found() {
    let scene = small_ball();
    let variance = |guided, indirect| {
        let narrow = InitialBandwidth::Fixed(0.02);
        let settings = Settings { photons: 20_000, guided, indirect, initial_bandwidth: narrow, ..Settings::default() };
        light_and_variance(&scene, settings, |p| p.parts().caustic)
    };
    let (_, unguided) = variance(false, Indirect::Photons);
    for indirect in [Indirect::Photons, Indirect::Paths] {
        let (caustic, guided) = variance(true, indirect);
        assert!(caustic > 0.0);
        // Of 20,000 unguided paths 0.1 hit the ball on average; of guided ones thousands do.
        assert!(unguided > 10.0 * guided, "{indirect:?}: {unguided} and {guided}");
    }
}

fn small_ball() -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0), matte(0.5, 0.0));
    add(&mut description, "ball", sphere(Vec3::new(0.0, 0.12, 0.0), 0.05, 48), glass(1.5));
    description.lights.push(point_light(DVec3::new(3.0, 10.0, 2.0), 100.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.5, 0.7), DVec3::new(0.0, 0.03, 0.0), 30.0));
    build(description)
}

fn glass_room() -> Scene {
    room_with(0.4)
}

/// Grey walls with the camera between them.
fn room() -> Description {
    let mut description = Description::default();
    add(&mut description, "room", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true), matte(0.5, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.9, 0.0), 50.0));
    description
}

/// The room with a ball of glass of this radius under a lamp.
fn room_with(radius: f32) -> Scene {
    let mut description = room();
    add(&mut description, "lamp", quad(Vec3::new(-0.2, 1.98, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4), matte(0.0, 20.0));
    add(&mut description, "ball", sphere(Vec3::new(0.0, 0.45, 0.0), radius, 64), glass(1.5));
    build(description)
}

/// The room with a point light, without objects that focus light.
fn matte_room() -> Scene {
    let mut description = room();
    description.lights.push(point_light(DVec3::new(0.0, 1.5, 0.0), 1.0));
    build(description)
}

fn auto(scene: &Scene, threads: usize, iterations: u64) -> Choice {
    auto_among(scene, threads, iterations, |_| true)
}

/// The weight of an effect.
fn weight(weights: &[EffectWeight], effect: Effect) -> Option<EffectWeight> {
    weights.iter().find(|weight| weight.effect == effect).copied()
}

/// The choice of `auto` among the allowed candidates.
fn auto_among(scene: &Scene, threads: usize, iterations: u64, allowed: impl Fn(Candidate) -> bool + Sync) -> Choice {
    let camera = scene.camera(&square(24)).expect("a camera");
    let settings =
        |candidate| Settings { photons: 2000, iterations: Some(iterations), ..Settings::for_candidate(candidate) };
    let make = |candidate| allowed(candidate).then(|| settings(candidate));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| choose(View::new(scene, &camera), make, &Stop::default())).expect("a choice")
}

/// A second of a time limit counts as the work of the threads that the user names, except in shards, whose numbers of
/// threads may differ.
#[test]
fn a_time_limit_is_planned_as_the_work_of_the_named_threads() {
    let scene = matte_room();
    let camera = scene.camera(&square(24)).expect("a camera");
    let seconds_to_measure = |threads, count| {
        let shard = Shard { index: 0, count };
        let make = |candidate| {
            let usual = Settings::for_candidate(candidate);
            Some(Settings { time: Some(1e-3), iterations: None, threads, shard, ..usual })
        };
        choose(View::new(&scene, &camera), make, &Stop::default()).expect("a choice").seconds_to_measure
    };
    let unnamed = seconds_to_measure(0, 1);
    assert_eq!([1, 2, 16].map(|threads| seconds_to_measure(threads, 1) / unnamed), [2.0, 1.0, 0.125]);
    assert_eq!(seconds_to_measure(16, 3), unnamed);
}

/// The choice and the predicted errors do not depend on the number of threads, to the bit.
#[test]
fn the_choice_does_not_depend_on_threads() {
    let scene = matte_room();
    let [one, three] = [1, 3].map(|threads| auto(&scene, threads, 5000));
    assert!(one.pilots.len() >= 3, "{:?}", one.reason);
    assert_eq!(one.candidate, three.candidate);
    for (a, b) in one.pilots.iter().zip(&three.pilots) {
        println!("{}: {:.5}", a.candidate.name(), a.error());
        assert_eq!(a.squared_error.to_bits(), b.squared_error.to_bits(), "{}", a.candidate.name());
    }
    let chosen = one.chosen_pilot().expect("a trial");
    let best = one.pilots.iter().all(|trial| trial.squared_error >= chosen.squared_error);
    assert!(best, "{}", chosen.candidate.name());
    let bits = |choice: &Choice| -> Vec<_> {
        choice.weights.iter().map(|w| (w.effect, w.energy.map(f64::to_bits), w.saved.map(f64::to_bits))).collect()
    };
    assert_eq!(bits(&one), bits(&three));
}

/// The weights of effects sum to the picture and agree with those of a longer render within a quarter, the noise of six
/// iterations. Caustics seen in the glass do not count as caustics beside it.
#[test]
fn effects_are_weighed() {
    let scene = glass_room();
    let choice = auto(&scene, 2, 5000);
    let energy = |effect: Effect| weight(&choice.weights, effect).and_then(|w| w.energy).unwrap_or(0.0);
    println!("{:?}", choice.weights);
    let sum: f64 = choice.weights.iter().filter_map(|w| w.energy).sum();
    assert!((sum - 1.0).abs() < 0.02, "{sum}");
    assert!(choice.weights.iter().all(|w| w.error_if_off.is_some_and(|error| error.is_finite() && error >= 0.0)));
    let camera = scene.camera(&square(24)).expect("a camera");
    let light = |effects: &[Effect]| -> f64 {
        let classes = PathClass::ALL.into_iter().filter(|class| effects.contains(&class.effect())).collect();
        let settings = Settings { classes, photons: 20_000, iterations: Some(48), ..Settings::default() };
        let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
        rendered.pixels.iter().map(|pixel| pixel.mean(3).element_sum()).sum()
    };
    let all = light(&Effect::ALL);
    for effect in [Effect::Direct, Effect::Indirect, Effect::Caustic, Effect::Sds] {
        let (estimated, found) = (energy(effect), light(&[effect]) / all);
        println!("{effect:?}: {estimated:.4} estimated, {found:.4} found");
        assert!((estimated - found).abs() < 0.25 * found + 0.002, "{effect:?}: {estimated} estimated, {found} found");
    }
}

/// A point light shines into a clear ball of cloudy glass. No connection finds light that scatters once in it, and
/// `vcm` merges photons only on surfaces: it prints a warning, and `auto` chooses photons in media.
#[test]
fn cloudy_glass_under_a_point_light_is_rendered_by_photons_in_media() {
    let cloudy = |size: bool, ior: f32| {
        let mut description = Description::default();
        let medium = Some(MediumParameters { sigma_a: Rgb::splat(0.5), sigma_s: Rgb::splat(2.0), g: 0.3 });
        add(&mut description, "ball", sphere(Vec3::ZERO, 0.5, 24), Material { medium, ..glass(ior) });
        let mut light = point_light(DVec3::new(0.0, 1.5, 0.5), 4.0);
        light.radius = if size { 0.2 } else { 0.0 };
        description.lights.push(light);
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 25.0));
        build(description)
    };
    let chosen = |scene: &Scene| {
        let camera = scene.camera(&square(16)).expect("a camera");
        let make = |candidate| Some(Settings { iterations: Some(4), ..Settings::for_candidate(candidate) });
        choose(View::new(scene, &camera), make, &Stop::default()).expect("a choice").candidate
    };
    assert_eq!(chosen(&cloudy(false, 1.2)), Candidate::GUIDED_GATHERING);
    assert_eq!(chosen(&cloudy(true, 1.2)), Candidate::GUIDED);
    let finds = |scene: &Scene, method: Method| method.search().finds(Effect::Sds, &scene.survey);
    let methods = [Method::Vcm, Method::Sppm];
    assert_eq!(methods.map(|method| finds(&cloudy(false, 1.2), method)), [false, true]);
    assert_eq!(methods.map(|method| finds(&cloudy(true, 1.2), method)), [true, true]);
    assert_eq!(methods.map(|method| finds(&cloudy(false, 1.0), method)), [true, true]);
}

/// Effects that are switched off are weighed as if they were on, because this is the light that the picture lacks.
/// Scattering media have a share of the light. Media that only absorb are not weighed.
#[test]
fn switched_off_effects_are_weighed_too() {
    let weights = |scene: &Scene, off: ClassSet| {
        let camera = scene.camera(&square(24)).expect("a camera");
        let make = |candidate| {
            let settings = Settings { photons: 2000, iterations: Some(20_000), ..Settings::for_candidate(candidate) };
            (candidate == Candidate::GATHERING).then(|| Settings { classes: off.complement(), ..settings })
        };
        choose(View::new(scene, &camera), make, &Stop::default()).expect("a choice").weights
    };
    // Glass needs photons, too, so leaving out this effect saves nothing where there is glass.
    for (scene, saves) in [(glass_room(), false), (matte_room(), true)] {
        let [whole, off] = [ClassSet::NONE, ClassSet::of(Effect::Indirect)]
            .map(|off| weight(&weights(&scene, off), Effect::Indirect).expect("indirect light"));
        println!("{whole:?}, switched off {off:?}");
        assert!(whole.energy > Some(0.05) && whole.error_if_off > Some(0.05));
        assert_eq!((whole.saved > Some(0.0), whole), (saves, off));
    }
    for scattering in [0.0, 0.3] {
        let (sigma_a, sigma_s) = (Rgb::splat(0.3), Rgb::splat(scattering));
        let mut description = Description { medium: Some(MediumParameters { sigma_a, sigma_s, g: 0.0 }), ..room() };
        description.lights.push(point_light(DVec3::new(0.5, 1.5, 0.5), 3.0));
        let volume = weight(&weights(&build(description), ClassSet::NONE), Effect::Volume).expect("a medium");
        println!("scattering {scattering}: {volume:?}");
        assert!(volume.error_if_off > Some(0.01));
        assert_eq!(volume.energy.map(|energy| energy > 0.01), (scattering > 0.0).then_some(true));
    }
}

/// Properties of the scene are weighed against the scene without them: the weight agrees with two long renders, or is
/// `None` if noise hides it. A wall of two greys, the sky through an open roof, and a lens too small for visible blur.
#[test]
fn properties_of_the_scene_are_weighed() {
    let mut description = Description::default();
    let halves = |x: usize| if x == 0 { [1.0; 4] } else { [0.25, 0.25, 0.25, 1.0] };
    let texels = Texels::Floats((0..2).map(halves).collect());
    let wrap = [Wrap::Clamp; 2];
    description.textures = vec![Texture { name: "halves".into(), width: 2, height: 1, texels, wrap, linear: false }];
    let first = TextureRef { texture: 0, set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    let mut wall = quad(Vec3::new(-1.0, 0.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    wall.uvs[0] = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    add(&mut description, "wall", wall, Material { base_color_texture: Some(first), ..matte(0.8, 0.0) });
    add(&mut description, "ball", sphere(Vec3::new(0.0, 1.0, 0.8), 0.3, 48), glass(1.5));
    description.lights.push(point_light(DVec3::new(0.0, 1.0, 2.0), 4.0));
    let source = EnvironmentSource::Color(Rgb::splat(0.3));
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::new(0.0, 1.0, 0.0), 30.0));
    let pinhole = build(description.clone());
    (description.cameras[0].aperture_radius, description.cameras[0].focus_distance) = (1e-5, 4.0);
    let scene = build(description);
    let weights = auto(&scene, 2, 20_000).weights;
    let camera = pinhole.camera(&square(24)).expect("a camera");
    let picture = |scene: &Scene| -> Vec<f64> {
        let settings = Settings { photons: 20_000, iterations: Some(64), ..Settings::default() };
        let rendered = render(scene, &camera, &settings, |_, _| Control::Continue);
        rendered.pixels.iter().map(|pixel| pixel.mean(3).element_sum() / 3.0).collect()
    };
    let whole = picture(&pinhole);
    for effect in [Effect::Textures, Effect::Environment] {
        let without = picture(&switch::without_effect(&pinhole, effect).expect("it is built"));
        let pixels = whole.iter().zip(&without);
        let floor = floor::relative_to_mean(whole.iter().copied());
        let found = pixels.map(|(a, b)| (a - b).powi(2) / (a * a + floor)).sum::<f64>() / whole.len() as f64;
        let estimated = weight(&weights, effect).expect("a weight");
        println!("{estimated:?}, {:.4} found", found.sqrt());
        let error = estimated.error_if_off.expect("an error");
        assert!((error / found.sqrt() - 1.0).abs() < 0.2, "{effect:?}: {error} estimated, {} found", found.sqrt());
        let share = 1.0 - without.iter().sum::<f64>() / whole.iter().sum::<f64>();
        match estimated.energy {
            Some(energy) => assert!((energy / share - 1.0).abs() < 0.15, "{energy} estimated, {share} found"),
            None => assert_eq!(effect, Effect::Textures),
        }
        assert!(estimated.saved.is_some_and(f64::is_finite));
    }
    let lens = weight(&weights, Effect::DepthOfField).expect("a weight");
    assert!(lens.error_if_off.is_none_or(|error| error < 0.02) && lens.energy.is_none(), "{lens:?}");
}

/// A pilot that the user stops compares nothing.
#[test]
fn a_pilot_can_be_stopped() {
    let scene = matte_room();
    let camera = scene.camera(&square(24)).expect("a camera");
    let pilots = |stop: bool| {
        let make =
            |candidate| Some(Settings { photons: 2000, iterations: Some(5000), ..Settings::for_candidate(candidate) });
        let stop = Stop::from_flag(Arc::new(stop.into()));
        choose(View::new(&scene, &camera), make, &stop).expect("a choice").pilots.len()
    };
    assert_eq!(pilots(true), 0);
    assert!(pilots(false) >= 3);
}

/// If one light path in half a million hits the glass, unguided candidates have neither the light nor visible noise in
/// a pilot. Guided ones have both, so the picture has more noise.
#[test]
fn caustics_are_left_to_guided_light_paths() {
    let mut description = Description::default();
    add(
        &mut description,
        "hall",
        cuboid(Vec3::new(-20.0, 0.0, -20.0), Vec3::new(20.0, 30.0, 20.0), true),
        matte(0.3, 0.0),
    );
    add(&mut description, "ball", sphere(Vec3::new(0.0, 0.1, 0.0), 0.05, 64), glass(1.5));
    description.lights.push(point_light(DVec3::new(8.0, 20.0, 0.0), 5000.0));
    description.cameras.push(look_at(DVec3::new(0.0, 0.3, 0.5), DVec3::new(0.0, 0.05, 0.0), 50.0));
    let scene = build(description);
    let choice = auto(&scene, 2, 20_000);
    let Candidate { guided, counts, .. } = choice.candidate;
    assert!(guided && counts.light_paths > 0 && counts.merging > 0.0, "{}", choice.candidate.name());
    let camera = scene.camera(&square(24)).expect("a camera");
    let light = |candidate| {
        let settings = Settings { iterations: Some(16), ..Settings::for_candidate(candidate) };
        let rendered = render(&scene, &camera, &settings, |_, _| Control::Continue);
        rendered.pixels.iter().map(|pixel| pixel.parts().caustic.element_sum()).sum::<f64>()
    };
    let (guided, unguided) = (light(Candidate::GUIDED), light(Candidate::DEFAULT));
    println!("{guided:.3e} of caustics by guided light paths, {unguided:.3e} by others");
    assert!(guided > 0.0 && unguided < 0.2 * guided);
    let unguided = auto_among(&scene, 2, 20_000, |candidate| !candidate.guided);
    assert!(!unguided.candidate.guided);
}

/// Candidates that the scene does not need are not tried, and a short render tries none.
#[test]
fn only_needed_candidates_are_tried() {
    let scene = matte_room();
    let matte_only = auto(&scene, 2, 5000);
    let tried: Vec<Method> = matte_only.pilots.iter().map(|trial| trial.candidate.rendered_by()).collect();
    assert!([Method::Vcm, Method::Path, Method::Bdpt].iter().all(|method| tried.contains(method)), "{tried:?}");
    assert!(matte_only.pilots.iter().all(|trial| !trial.candidate.guided));
    // Without narrow lobes, no photons of caustics are traced.
    let of_caustics = Settings { indirect: Indirect::Paths, ..Settings::default() };
    let photons = |narrow_lobes| of_caustics.photon_classes(&Survey { narrow_lobes, ..Survey::default() });
    assert!(photons(false).is_empty() && photons(true).has(PathClass::IndirectFocus));
    // Both kinds of light cost connections.
    let choice = auto_among(&scene, 2, 20_000, |candidate| candidate.counts.connections > 0);
    let saved = |effect: Effect| weight(&choice.weights, effect).and_then(|w| w.saved);
    let whole = choice.chosen_pilot().map(|trial| trial.seconds_per_iteration);
    assert!(saved(Effect::Indirect) > Some(0.0) && saved(Effect::Indirect) < whole, "{:?}", choice.weights);
    assert!(saved(Effect::Direct) > Some(0.0) && saved(Effect::Direct) < whole, "{:?}", choice.weights);
    let short = auto(&glass_room(), 2, 2);
    assert!(short.pilots.is_empty() && short.candidate == Candidate::GUIDED);
}
