//! What effects mean to the picture: how much of its light they are, how wrong it would be without them, and what
//! leaving them out would save.
//!
//! The additive parts of the picture are told apart by any render. Two effects of light share a part with others, and
//! pictures of their classes alone tell them: what narrow lobes show, and caustics seen in mirrors and glass. What is a
//! property of the scene is told by a picture of the scene without it. Squares are products of two halves of the
//! iterations, whose noise is not the same: what they have in common is the light.

use super::pilot_settings::{self, WORST, mean, scale, values};
use crate::camera::Camera;
use crate::estimator::PixelAccumulator;
use crate::math::DVec3;
use crate::plan::{ClassSet, Effect, Presence, switch};
use crate::render::{Candidate, Cost, RenderInput, Session, Settings};
use crate::scene::Scene;
use crate::stat::floor;

/// Effects that have a part of the picture, in the order of [`parts()`].
const WHOLE: [Effect; 5] = [Effect::Emission, Effect::Direct, Effect::Indirect, Effect::Caustic, Effect::Volume];
/// Effects that are in parts of others.
const APART: [Effect; 2] = [Effect::Glossy, Effect::Sds];
/// Iterations of a picture, and of each half of it.
pub(super) const ITERATIONS: u64 = 6;
const HALF: u64 = ITERATIONS / 2;
/// Standard errors that a difference has to stand out by.
const TOLD: f64 = 2.0;
/// Core-seconds that a triangle takes to be committed to Embree (one core, 250,000 of them: 0.4 us).
const TRIANGLE: f64 = 1e-6;

/// What an effect means to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectWeight {
    /// The effect.
    pub effect: Effect,
    /// Its share of the picture's light; `None` where it has none of its own, but changes that of others.
    pub energy: Option<f64>,
    /// Relative error (the root of relMSE) of the picture without it; `None` where noise hides it.
    pub error_if_off: Option<f64>,
    /// Counted core-seconds of an iteration that leaving it out would save; `None` before a way is chosen.
    pub saved: Option<f64>,
}

/// A weight, and what an iteration of the scene without the effect is counted to cost, where it is another scene.
pub(super) struct Weighed {
    pub weight: EffectWeight,
    without: Option<Cost>,
}

/// Effects that a picture of the scene without them tells, of those that it calls for.
pub(super) fn properties(presence: &Presence) -> Vec<Effect> {
    Effect::ALL.into_iter().filter(|effect| !effect.is_class() && presence.has(*effect)).collect()
}

/// Pictures that tell the effects of light, at most.
pub(super) const PICTURES: usize = 1 + APART.len();

/// Core-seconds that it takes to make the scene without an effect.
pub(super) fn making(scene: &Scene, effect: Effect) -> f64 {
    if effect == Effect::Alpha { scene.shapes.triangles() as f64 * TRIANGLE } else { 0.0 }
}

/// The additive parts of each pixel, by either half of the iterations.
type Halves = [Vec<[DVec3; 5]>; 2];

/// The pixels of a picture, and their parts.
fn picture(scene: &Scene, camera: &Camera, settings: &Settings) -> (Vec<PixelAccumulator>, Halves) {
    let stage = RenderInput::new(scene, camera, settings);
    let mut session = Session::new(&stage);
    let mut advance = || {
        for _ in 0..HALF {
            session.step();
        }
        session.pixels().to_vec()
    };
    let [first, all] = [advance(), advance()];
    let halves = [
        first.iter().map(|pixel| parts(pixel).map(|sum| sum / HALF as f64)).collect(),
        first
            .iter()
            .zip(&all)
            .map(|(first, all)| difference(&parts(all), &parts(first)).map(|sum| sum / HALF as f64))
            .collect(),
    ];
    (all, halves)
}

/// Sums of the additive parts of a pixel.
fn parts(pixel: &PixelAccumulator) -> [DVec3; 5] {
    let parts = pixel.parts();
    [parts.emission, parts.direct, parts.indirect, parts.caustic, parts.volume]
}

fn difference(a: &[DVec3; 5], b: &[DVec3; 5]) -> [DVec3; 5] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Light of each pixel by either half: all its parts together, less those of another picture.
fn light(of: &Halves, less: Option<&Halves>) -> [Vec<DVec3>; 2] {
    std::array::from_fn(|half| {
        let sum = |parts: &[DVec3; 5]| parts.iter().sum::<DVec3>();
        let other = |index: usize| less.map_or(DVec3::ZERO, |less| sum(&less[half][index]));
        of[half].iter().enumerate().map(|(index, parts)| sum(parts) - other(index)).collect()
    })
}

/// All classes of light paths are weighed, those too that are switched off: what that leaves out is told.
pub(super) fn settings(of: &Settings, photons: f64) -> Settings {
    Settings { classes: ClassSet::ALL, ..pilot_settings::with_levels(of, photons) }
}

/// What light of so many pixels means to pictures that are worth `values`.
struct Scale<'a> {
    values: &'a [f64],
    /// See [`floor`].
    floor: f64,
    /// All light of the picture.
    total: f64,
}

impl Scale<'_> {
    /// Share of the light.
    fn energy(&self, light: &[Vec<DVec3>; 2]) -> f64 {
        (0.5 * light.iter().flatten().map(|light| mean(*light)).sum::<f64>() / self.total).clamp(0.0, 1.0)
    }

    /// relMSE by lack of the light, and its standard error, without the pixels where the halves disagree most.
    fn relmse(&self, [first, second]: &[Vec<DVec3>; 2]) -> (f64, f64) {
        let pixels = first.iter().zip(second).zip(self.values).map(|((first, second), value)| {
            let (scale, apart) = (scale(*value, self.floor), *first - *second);
            (mean(apart * apart) * scale, mean(*first * *second) * scale)
        });
        let mut pixels: Vec<(f64, f64)> = pixels.collect();
        pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
        pixels.truncate(pixels.len() - (pixels.len() as f64 * WORST) as usize);
        let n = pixels.len().max(1) as f64;
        let sum = |power: i32| pixels.iter().map(|(_, square)| square.powi(power)).sum::<f64>();
        let relmse = sum(1) / n;
        (relmse, (sum(2) / n - relmse * relmse).max(0.0).sqrt() / n.sqrt())
    }
}

/// Weighs effects on a small picture by [`settings`] of a way that finds all of them: those of light that the scene
/// calls for, and those of its `properties`. `count` counts what the scene costs without one.
pub(super) fn weigh(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    presence: &Presence,
    properties: &[Effect],
    count: impl Fn(&Scene, &Camera) -> Cost,
) -> Vec<Weighed> {
    let (pixels, whole) = picture(scene, camera, settings);
    let values = values(&pixels, camera.size(), settings.levels);
    let total = 0.5 * light(&whole, None).iter().flatten().map(|light| mean(*light)).sum::<f64>();
    let floor = floor::relative_to_mean(values.iter().copied());
    let scale = Scale { values: &values, floor, total: total.max(f64::MIN_POSITIVE) };
    // Light is never negative: noise hides none of it.
    let of_light = |effect: Effect, light: &[Vec<DVec3>; 2]| {
        let error_if_off = Some(scale.relmse(light).0.max(0.0).sqrt());
        Weighed {
            weight: EffectWeight { effect, energy: Some(scale.energy(light)), error_if_off, saved: None },
            without: None,
        }
    };
    let mut weighed = Vec::new();
    let mut rest = whole.clone();
    for effect in APART.into_iter().filter(|effect| presence.has(*effect)) {
        let settings = Settings { classes: settings.classes & ClassSet::of(effect), ..settings.clone() };
        if settings.classes.is_empty() {
            continue;
        }
        let (_, apart) = picture(scene, camera, &settings);
        weighed.push(of_light(effect, &light(&apart, None)));
        for (rest, apart) in rest.iter_mut().flatten().zip(apart.iter().flatten()) {
            *rest = difference(rest, apart);
        }
    }
    let part = |k: usize| [0, 1].map(|half: usize| rest[half].iter().map(|parts| parts[k]).collect());
    let own = |effect: Effect| presence.has(effect) && (effect != Effect::Volume || scene.survey.scattering);
    let parts = WHOLE.into_iter().enumerate().filter(|(_, effect)| own(*effect));
    weighed.extend(parts.map(|(k, effect)| of_light(effect, &part(k))));
    for &effect in properties {
        // A lens is the camera's.
        let made = (effect != Effect::DepthOfField).then(|| switch::without(scene, effect));
        let (scene, camera) = match &made {
            None => (scene, camera.without_lens()),
            Some(Ok(made)) => (made, *camera),
            Some(Err(_)) => continue,
        };
        let (_, lacking) = picture(scene, &camera, settings);
        let lost = light(&whole, Some(&lacking));
        let (relmse, noise) = scale.relmse(&lost);
        let part = weighed.iter().position(|weighed| weighed.weight.effect == effect);
        let energy = match part {
            Some(part) => weighed.swap_remove(part).weight.energy,
            None => (effect == Effect::Environment).then(|| scale.energy(&lost)),
        };
        let error_if_off = (relmse > TOLD * noise).then(|| relmse.sqrt());
        let weight = EffectWeight { effect, energy, error_if_off, saved: None };
        weighed.push(Weighed { weight, without: Some(count(scene, &camera)) });
    }
    weighed
}

impl Weighed {
    /// The weight, with the core-seconds of an iteration by `way` that leaving the effect out would save. `cost` is
    /// counted without a guide.
    pub fn saving(self, cost: &Cost, candidate: Candidate, settings: &Settings, pixels: f64) -> EffectWeight {
        let saved = match self.without {
            // Of unguided paths it tells the share.
            Some(without) => {
                let unguided = Candidate { guided: false, ..candidate };
                let [with, without] = [cost, &without].map(|cost| cost.of(unguided, settings, pixels));
                (1.0 - without / with).max(0.0) * cost.of(candidate, settings, pixels)
            }
            None => saved(cost, (candidate, settings), self.weight.effect, pixels),
        };
        EffectWeight { saved: Some(saved), ..self.weight }
    }
}

/// Core-seconds of an iteration that leaving an effect of light out would save.
fn saved(cost: &Cost, (candidate, settings): (Candidate, &Settings), effect: Effect, pixels: f64) -> f64 {
    // Of an effect that is left out: what it would cost.
    let of = ClassSet::of(effect);
    let [with, without] = [settings.classes.and(of), settings.classes & of.complement()]
        .map(|classes| cost.of(candidate, &Settings { classes, ..settings.clone() }, pixels));
    (with - without).max(0.0)
}
