//! What effects of light mean to the picture: how much of it they are, how wrong it would be without them, and what leaving them out would save.
//!
//! The additive parts of the picture are told apart by any render. Two effects share a part with others, and pictures of their classes alone tell them: what
//! narrow lobes show, and caustics seen in mirrors and glass.

use super::Way;
use super::contest::ITERATIONS;
use super::trial::{self, DARK, mean, values};
use crate::camera::Camera;
use crate::estimator::Pixel;
use crate::math::DVec3;
use crate::plan::{ClassSet, Effect};
use crate::render::cost::Cost;
use crate::render::method::Method;
use crate::render::session::{Session, Stage};
use crate::render::settings::Settings;
use crate::scene::Scene;

/// Effects that have a part of the picture, in the order of [`parts()`].
const WHOLE: [Effect; 5] = [Effect::Emission, Effect::Direct, Effect::Indirect, Effect::Caustic, Effect::Volume];
/// Effects that are in parts of others.
const APART: [Effect; 2] = [Effect::Glossy, Effect::Sds];

/// What an effect means to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weight {
    /// The effect.
    pub effect: Effect,
    /// Its share of the picture's light.
    pub energy: f64,
    /// Relative error (the root of relMSE) of the picture without it.
    pub error_if_off: f64,
    /// Counted core-seconds of an iteration that leaving it out would save; `None` where that is not counted.
    pub saved: Option<f64>,
}

/// Pictures that [`weigh`] makes, at most.
pub(super) const PICTURES: usize = 1 + APART.len();

/// The pixels of a picture.
fn picture(scene: &Scene, camera: &Camera, settings: &Settings) -> Vec<Pixel> {
    let stage = Stage::new(scene, camera, settings);
    let mut session = Session::new(&stage);
    for _ in 0..ITERATIONS.0 {
        session.step();
    }
    session.pixels().to_vec()
}

/// The additive parts of a pixel.
fn parts(pixel: &Pixel) -> [DVec3; 5] {
    let (parts, n) = (&pixel.parts, f64::from(pixel.iterations.max(1)));
    [parts.emission, parts.direct, parts.indirect, parts.caustic, parts.volume].map(|part| part / n)
}

/// All classes of light paths are weighed, those too that are switched off: what that leaves out is told.
pub(super) fn settings(of: &Settings, photons: f64) -> Settings {
    Settings { classes: ClassSet::ALL, ..trial::settings(of, photons) }
}

/// Weighs the effects of light on a small picture by [`settings`] of a way that finds all of them. `present`: effects that the scene calls for.
///
/// Media that absorb and do not scatter have no part of the light of their own: they are not weighed, nor what else is a property of the scene.
pub(super) fn weigh(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    present: impl Fn(Effect) -> bool,
) -> Vec<Weight> {
    let pixels = picture(scene, camera, settings);
    let values = values(&pixels, camera.size(), settings.levels);
    let mut whole: Vec<[DVec3; 5]> = pixels.iter().map(parts).collect();
    let total = whole.iter().flatten().map(|part| mean(*part)).sum::<f64>().max(f64::MIN_POSITIVE);
    let weight = |effect: Effect, picture: &mut dyn Iterator<Item = DVec3>| {
        let (mut sum, mut squares) = (0.0, 0.0);
        for (light, value) in picture.zip(&values) {
            sum += mean(light);
            squares += mean(light * light) / (value * value + DARK);
        }
        let error_if_off = (squares / values.len().max(1) as f64).sqrt();
        Weight { effect, energy: (sum / total).max(0.0), error_if_off, saved: None }
    };
    let mut weights = Vec::new();
    for effect in APART.into_iter().filter(|effect| present(*effect)) {
        let settings = Settings { classes: settings.classes & ClassSet::of(effect), ..settings.clone() };
        if settings.classes.is_empty() {
            continue;
        }
        let picture: Vec<[DVec3; 5]> = picture(scene, camera, &settings).iter().map(parts).collect();
        weights.push(weight(effect, &mut picture.iter().map(|parts| parts.iter().sum())));
        for (parts, apart) in whole.iter_mut().zip(picture) {
            for (part, apart) in parts.iter_mut().zip(apart) {
                *part -= apart;
            }
        }
    }
    let apart = |effect: Effect| effect != Effect::Volume || scene.survey.scattering();
    for (k, effect) in WHOLE.into_iter().enumerate().filter(|(_, effect)| present(*effect) && apart(*effect)) {
        weights.push(weight(effect, &mut whole.iter().map(|parts| parts[k])));
    }
    weights
}

/// Core-seconds of an iteration that leaving an effect out would save, where that is counted: what photons bring, and light that was scattered before.
pub(super) fn saved(cost: &Cost, (way, settings): (Way, &Settings), effect: Effect, pixels: f64) -> Option<f64> {
    let counted = match effect {
        Effect::Indirect => way.method == Method::Path || way.method.gathers(),
        Effect::Glossy | Effect::Caustic | Effect::Sds | Effect::Volume => way.method.gathers(),
        _ => false,
    };
    if !counted {
        return None;
    }
    // Of an effect that is left out: what it would cost.
    let of = ClassSet::of(effect);
    let [with, without] = [settings.classes.and(of), settings.classes & of.complement()]
        .map(|classes| cost.of(way, &Settings { classes, ..settings.clone() }, pixels));
    Some((with - without).max(0.0))
}
