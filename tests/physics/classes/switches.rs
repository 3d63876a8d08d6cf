//! Pictures with only some classes, without them, and with all.

use super::room;
use crate::support::scenes::square;
use crate::support::stats::{mean_and_error, t_critical};
use crate::support::tiles::{SIZE, TILES, average, disagreeing, tiles};
use caustique::estimator::Parts;
use caustique::math::DVec3;
use caustique::path_class::{ClassSet, Effect, EffectSet};
use caustique::render::output::layer_shape;
use caustique::render::{Control, InitialBandwidth, Levels, Method, Rendered, Settings, render};
use caustique::scene::Scene;
use caustique::transport::Indirect;

const CLASSES: [Effect; 6] =
    [Effect::Emission, Effect::Direct, Effect::Indirect, Effect::Glossy, Effect::Caustic, Effect::Sds];

fn without(effects: &[Effect]) -> ClassSet {
    ClassSet::without(effects.iter().copied().collect::<EffectSet>())
}

fn only(effect: Effect) -> ClassSet {
    let others: Vec<Effect> = CLASSES.into_iter().filter(|other| *other != effect).collect();
    without(&others)
}

fn picture(scene: &Scene, size: u32, settings: &Settings) -> Rendered {
    let camera = scene.camera(&square(size)).expect("a camera");
    let rendered = render(scene, &camera, settings, |_, _| Control::Continue);
    assert_eq!(rendered.rejected(), 0);
    rendered
}

fn settings(method: Method, indirect: Indirect, classes: ClassSet) -> Settings {
    Settings {
        method,
        indirect,
        classes,
        photons: 4000,
        initial_bandwidth: if method == Method::Pm {
            InitialBandwidth::Nearest(20)
        } else {
            InitialBandwidth::Fixed(0.06)
        },
        levels: Levels::new(1),
        alpha: 1.0,
        iterations: Some(3),
        ..Settings::default()
    }
}

fn parts(parts: &Parts) -> [DVec3; 5] {
    [parts.emission, parts.direct, parts.caustic, parts.indirect, parts.volume]
}

/// The largest difference between the sum of two pictures and a third, over the parts, relative to the mean.
fn apart(a: &Rendered, b: &Rendered, sum: &Rendered) -> f64 {
    let mut worst = 0f64;
    let mean = sum.pixels.iter().map(|p| p.mean(0).element_sum() / 3.0).sum::<f64>() / sum.pixels.len() as f64;
    for ((a, b), sum) in a.pixels.iter().zip(&b.pixels).zip(&sum.pixels) {
        for ((a, b), sum) in parts(&a.parts()).into_iter().zip(parts(&b.parts())).zip(parts(&sum.parts())) {
            worst = worst.max(((a + b - sum).abs().max_element()) / (mean + sum.max_element()));
        }
    }
    worst
}

/// With the same random numbers, the picture of one class plus the picture of all others is the whole picture, in every
/// part. A render with photons only for caustics draws other numbers at surfaces with broad lobes; it is compared
/// below.
#[test]
fn one_class_and_all_others_sum_to_the_whole() {
    let scene = room(true);
    let methods = [
        (Method::Path, Indirect::Photons),
        (Method::Light, Indirect::Photons),
        (Method::Bdpt, Indirect::Photons),
        (Method::Bpm, Indirect::Photons),
        (Method::Vcm, Indirect::Photons),
        (Method::Sppm, Indirect::Photons),
        (Method::Sppm, Indirect::Paths),
    ];
    for (method, indirect) in methods {
        let whole = picture(&scene, 24, &settings(method, indirect, ClassSet::ALL));
        for effect in CLASSES {
            let photons = method == Method::Sppm && indirect == Indirect::Photons;
            if photons && matches!(effect, Effect::Caustic | Effect::Sds) {
                continue;
            }
            let of = |classes| picture(&scene, 24, &settings(method, indirect, classes));
            let (one, others) = (of(only(effect)), of(without(&[effect])));
            let apart_by = apart(&one, &others, &whole);
            assert!(apart_by < 1e-4, "{method:?} {indirect:?} {effect:?}: {apart_by}");
            let light = |rendered: &Rendered| rendered.pixels.iter().map(|p| p.mean(0).element_sum()).sum::<f64>();
            // Light paths connected to the camera do not find what is behind glass.
            if method != Method::Light || effect != Effect::Sds {
                assert!(light(&one) > 0.0 && light(&others) < light(&whole), "{method:?} {effect:?}");
                // The planted bug: the class counts twice.
                assert!(apart(&one, &whole, &whole) > 1e-3, "{method:?} {effect:?}: twice is not detected");
            }
        }
    }
}

/// For rules with photon statistics and for one photon map: a part that is switched off is empty, and the others are
/// not.
#[test]
fn every_method_leaves_out_what_is_switched_off() {
    let scene = room(true);
    for method in [Method::Pm, Method::Ppm, Method::Appm, Method::Cppm] {
        let off = settings(method, Indirect::Photons, without(&[Effect::Caustic, Effect::Sds, Effect::Emission]));
        let rendered = picture(&scene, 16, &off);
        let sum =
            |part: fn(&Parts) -> DVec3| rendered.pixels.iter().map(|p| part(&p.parts()).element_sum()).sum::<f64>();
        assert_eq!((sum(|p| p.caustic), sum(|p| p.emission)), (0.0, 0.0), "{method:?}");
        assert!(sum(|p| p.direct) > 0.0 && sum(|p| p.indirect) > 0.0, "{method:?}");
        let layers = rendered.layers(&layer_shape(&rendered.settings, &scene), |_| true).expect("there are layers");
        assert!(layers.get("Caustic").is_none() && layers.get("Emission").is_none() && layers.get("Direct").is_some());
        // No light remains for photons.
        let lit = without(&[Effect::Caustic, Effect::Sds, Effect::Indirect, Effect::Glossy, Effect::Volume]);
        let rendered = picture(&scene, 16, &settings(method, Indirect::Photons, lit));
        let sum =
            |part: fn(&Parts) -> DVec3| rendered.pixels.iter().map(|p| part(&p.parts()).element_sum()).sum::<f64>();
        assert!(sum(|p| p.direct) > 0.0 && sum(|p| p.indirect) == 0.0, "{method:?}");
        assert!(rendered.pixels.iter().all(|p| p.iterations > 0), "{method:?}");
    }
}

/// The remaining light has the same bits if bandwidths do not depend on the switched-off light. Without effects that
/// photons carry no photon is traced, and without effects of surfaces light paths end early.
#[test]
fn unneeded_photons_are_not_traced() {
    let scene = room(true);
    let of = |classes| picture(&scene, 24, &settings(Method::Sppm, Indirect::Photons, classes));
    let whole = of(ClassSet::ALL);
    let plain = of(without(&[Effect::Caustic, Effect::Sds]));
    assert!(plain.stats.photons < whole.stats.photons && plain.stats.light_paths == whole.stats.light_paths);
    for (a, b) in plain.pixels.iter().zip(&whole.pixels) {
        let [a, b] = [a, b].map(|p| [p.parts().emission, p.parts().direct, p.parts().indirect]);
        assert_eq!(a, b);
    }
    let caustics = of(without(&[Effect::Indirect, Effect::Glossy]));
    assert!(
        caustics.stats.photons + plain.stats.photons < whole.stats.photons * 11 / 10,
        "{} {}",
        caustics.stats.photons,
        whole.stats.photons
    );
    let none = of(without(&[Effect::Caustic, Effect::Sds, Effect::Indirect, Effect::Glossy]));
    assert_eq!((none.stats.photons, none.stats.light_paths), (0, 0));
    for (a, b) in none.pixels.iter().zip(&whole.pixels) {
        assert_eq!(a.parts().emission, b.parts().emission);
    }
    let paths = picture(&scene, 24, &settings(Method::Sppm, Indirect::Paths, only(Effect::Direct)));
    assert_eq!(paths.stats.light_paths, 0);
}

/// Tiles of one effect, by several seeds.
fn by(scene: &Scene, method: (Method, Indirect), effect: Effect, iterations: u64, photons: u32) -> Vec<Vec<f64>> {
    let of = |seed| {
        let settings = Settings {
            seed,
            photons,
            iterations: Some(iterations),
            initial_bandwidth: InitialBandwidth::Fixed(0.04),
            ..settings(method.0, method.1, only(effect))
        };
        let rendered = picture(scene, SIZE, &settings);
        tiles(|index| rendered.pixels[index].mean(0).element_sum() / 3.0)
    };
    (0..10).map(of).collect()
}

/// Whether the means of whole pictures differ by more than noise and 3 %.
fn differ(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let of = |images: &[Vec<f64>]| {
        mean_and_error(&images.iter().map(|tiles| tiles.iter().sum::<f64>() / TILES as f64).collect::<Vec<_>>())
    };
    let ((a, error_a), (b, error_b)) = (of(a), of(b));
    (a - b).abs() > t_critical(1e-3, 1, 9.0) * error_a.hypot(error_b) + 0.03 * b
}

/// Each class alone has the same light by photons, by paths, and by MIS. A class that is carried twice or not at all
/// would be twice as bright or black.
#[test]
fn every_class_has_the_same_light_by_every_method() {
    let scene = room(false);
    let critical = t_critical(1e-3, TILES, 9.0);
    for effect in CLASSES {
        // Paths rarely hit the lights of caustics.
        let passes = match effect {
            Effect::Caustic => 32,
            Effect::Sds => 128,
            _ => 8,
        };
        let paths = by(&scene, (Method::Path, Indirect::Photons), effect, passes, 0);
        assert!(average(&paths) > 1e-4, "{effect:?} is dark");
        for method in
            [(Method::Sppm, Indirect::Photons), (Method::Sppm, Indirect::Paths), (Method::Vcm, Indirect::Photons)]
        {
            let mut others = by(&scene, method, effect, 5, 15_000);
            println!("{effect:?}: paths {:.5}, {method:?} {:.5}", average(&paths), average(&others));
            let found = disagreeing(&others, &paths, critical, 0.03);
            assert!(found.is_empty() && !differ(&others, &paths), "{effect:?} {method:?}: {found:#?}");
            others.iter_mut().flatten().for_each(|tile| *tile *= 2.0);
            assert!(differ(&others, &paths), "{effect:?} {method:?}: twice is not detected");
        }
    }
}
