//! Weights of effects: the share of the picture's light, the error of the picture without the effect, and the work that
//! leaving it out would save.
//!
//! Every render separates the additive parts of its pixels, which measure most light effects. Two light effects share a
//! part with others, so pictures of their classes alone measure them: light by narrow lobes, and caustics seen in mirrors
//! and glass. An effect that is a property of the scene is measured by a picture of the scene without it. Squared errors
//! are products of the two halves of the iterations, whose noise is independent.

use super::pilot_settings::{self, TRIMMED_PILOT_SHARE, mean, reference_values, relative_weight};
use crate::camera::Camera;
use crate::estimator::PixelAccumulator;
use crate::math::DVec3;
use crate::path_class::{ClassSet, Effect};
use crate::plan::{Presence, switch};
use crate::render::{Candidate, Cost, RenderInput, Session, Settings};
use crate::scene::{Scene, View};
use crate::stat::floor;

/// Number of additive parts of a pixel's light.
const PARTS: usize = 5;
/// Light effects that are one additive part of the picture each, in the order of [`parts()`].
const EFFECTS_OF_PARTS: [Effect; PARTS] =
    [Effect::Emission, Effect::Direct, Effect::Indirect, Effect::Caustic, Effect::Volume];
/// Light effects that are not an additive part of the picture but share parts with others.
const EFFECTS_WITHOUT_PART: [Effect; 2] = [Effect::Glossy, Effect::Sds];
/// Iterations of each picture that measures effects.
pub(super) const ITERATIONS: u64 = 6;
/// Iterations of each half of a picture that measures effects.
const HALF: u64 = ITERATIONS / 2;
/// Largest number of pictures that the light effects of a scene need.
pub(super) const MAX_LIGHT_PICTURES: usize = 1 + EFFECTS_WITHOUT_PART.len();
/// Number of standard errors by which an error must exceed 0 to be significant.
const SIGNIFICANCE: f64 = 2.0;
/// Core-seconds per triangle to commit a scene to Embree. Measured: 0.4 us with 250,000 triangles on one core.
const SECONDS_PER_TRIANGLE: f64 = 1e-6;

/// Contribution of an effect, such as caustics, to a picture: its light, and the error and the cost of leaving it out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectWeight {
    /// The effect that was measured.
    pub effect: Effect,
    /// Share of the picture's light that the effect brings, 0 to 1; `None` for effects that only change the light of
    /// others.
    pub energy: Option<f64>,
    /// Relative error (the root of relMSE) of the picture without the effect; `None` if noise hides it.
    pub error_if_off: Option<f64>,
    /// Core-seconds per iteration that leaving the effect out would save, predicted from counted vertices; `None`
    /// before a candidate is chosen.
    pub saved: Option<f64>,
}

/// Weight of an effect (light, and error without it) before a candidate is chosen.
pub(super) struct WeighedEffect {
    weight: EffectWeight,
    /// Cost of iterations in the scene without the effect; `None` for effects that are not properties of the scene.
    cost_without: Option<Cost>,
}

/// Effects of the scene that no setting of a render leaves out, such as dispersion. What such an effect costs is
/// measured in a second scene, which is built without it.
pub(super) fn scene_effects(presence: &Presence) -> Vec<Effect> {
    Effect::ALL.into_iter().filter(|effect| !effect.is_class() && presence.has(*effect)).collect()
}

/// Core-seconds to build the scene without an effect.
pub(super) fn rebuild_seconds(scene: &Scene, effect: Effect) -> f64 {
    if effect == Effect::Alpha { scene.shapes.triangles() as f64 * SECONDS_PER_TRIANGLE } else { 0.0 }
}

/// Settings of the pictures that measure effects. They find all classes of light paths, so that classes that the user
/// has switched off are measured, too.
pub(super) fn settings(settings: &Settings, photon_share: f64) -> Settings {
    Settings { classes: ClassSet::ALL, ..pilot_settings::with_all_levels(settings, photon_share) }
}

/// Additive parts of each pixel's light, for each half of the iterations.
type Halves = [Vec<[DVec3; PARTS]>; 2];

/// Light of each pixel, for each half of the iterations.
type LightHalves = [Vec<DVec3>; 2];

/// Renders a picture to measure effects. Returns its pixels, and the means of their additive parts over each half of
/// the iterations; `None` if the user stops the render.
fn render_halves(scene: &Scene, camera: &Camera, settings: &Settings) -> Option<(Vec<PixelAccumulator>, Halves)> {
    let input = RenderInput::new(scene, camera, settings);
    let mut session = Session::new(&input);
    let mut advance = || {
        for _ in 0..HALF {
            session.step();
        }
        (!settings.stop.requested()).then(|| session.pixels().to_vec())
    };
    let (first, all) = (advance()?, advance()?);
    let mean = |sums: [DVec3; PARTS]| sums.map(|sum| sum / HALF as f64);
    let halves = [
        first.iter().map(|pixel| mean(parts(pixel))).collect(),
        first.iter().zip(&all).map(|(first, all)| mean(difference(&parts(all), &parts(first)))).collect(),
    ];
    Some((all, halves))
}

/// Sums of the additive parts of a pixel.
fn parts(pixel: &PixelAccumulator) -> [DVec3; PARTS] {
    let parts = pixel.parts();
    [parts.emission, parts.direct, parts.indirect, parts.caustic, parts.volume]
}

fn difference(a: &[DVec3; PARTS], b: &[DVec3; PARTS]) -> [DVec3; PARTS] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Sum of all additive parts of each pixel, minus that of `other`, for each half of the iterations.
fn light(halves: &Halves, other: Option<&Halves>) -> LightHalves {
    std::array::from_fn(|half| {
        let sum = |parts: &[DVec3; PARTS]| parts.iter().sum::<DVec3>();
        let subtrahend = |index: usize| other.map_or(DVec3::ZERO, |other| sum(&other[half][index]));
        halves[half].iter().enumerate().map(|(index, parts)| sum(parts) - subtrahend(index)).collect()
    })
}

fn light_of_part(halves: &Halves, part: usize) -> LightHalves {
    halves.each_ref().map(|half| half.iter().map(|parts| parts[part]).collect())
}

/// Picture with all effects that pictures without one are compared with.
struct Reference {
    halves: Halves,
    /// Value of each pixel that errors are relative to.
    values: Vec<f64>,
    /// Floor of relative errors, added to squared values, see [`floor`].
    floor: f64,
    /// Sum of the light of all pixels.
    total: f64,
}

impl Reference {
    fn new(view: View<'_>, settings: &Settings) -> Option<Reference> {
        let (pixels, halves) = render_halves(view.scene, view.camera, settings)?;
        let values = reference_values(&pixels, view.camera.size(), settings.levels);
        let total = 0.5 * light(&halves, None).iter().flatten().map(|light| mean(*light)).sum::<f64>();
        let floor = floor::relative_to_mean(values.iter().copied());
        Some(Reference { halves, values, floor, total: total.max(f64::MIN_POSITIVE) })
    }

    /// Share of this light in all light of the picture, 0 to 1.
    fn energy(&self, light: &LightHalves) -> f64 {
        (0.5 * light.iter().flatten().map(|light| mean(*light)).sum::<f64>() / self.total).clamp(0.0, 1.0)
    }

    /// Squared relative error (relMSE) of the picture without `light`, and its standard error, trimmed of the pixels
    /// where the halves differ most.
    fn relmse(&self, [first, second]: &LightHalves) -> (f64, f64) {
        let pixels = first.iter().zip(second).zip(&self.values).map(|((first, second), value)| {
            let (weight, difference) = (relative_weight(*value, self.floor), *first - *second);
            (mean(difference * difference) * weight, mean(*first * *second) * weight)
        });
        let mut pixels: Vec<(f64, f64)> = pixels.collect();
        pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
        pixels.truncate(pixels.len() - (pixels.len() as f64 * TRIMMED_PILOT_SHARE) as usize);
        let n = pixels.len().max(1) as f64;
        let sum = |power: i32| pixels.iter().map(|(_, square)| square.powi(power)).sum::<f64>();
        let relmse = sum(1) / n;
        (relmse, (sum(2) / n - relmse * relmse).max(0.0).sqrt() / n.sqrt())
    }

    /// Weight of a light effect by its light. Light is not negative, so its error is given however noisy it is.
    fn weigh_light(&self, effect: Effect, light: &LightHalves) -> WeighedEffect {
        let error_if_off = Some(self.relmse(light).0.max(0.0).sqrt());
        let weight = EffectWeight { effect, energy: Some(self.energy(light)), error_if_off, saved: None };
        WeighedEffect { weight, cost_without: None }
    }

    /// Weights of all light effects that are present in the scene.
    fn weigh_light_effects(
        &self,
        view: View<'_>,
        settings: &Settings,
        presence: &Presence,
    ) -> Option<Vec<WeighedEffect>> {
        let mut weighed = Vec::new();
        let mut rest = self.halves.clone();
        for effect in EFFECTS_WITHOUT_PART.into_iter().filter(|effect| presence.has(*effect)) {
            let settings = Settings { classes: settings.classes & ClassSet::of(effect), ..settings.clone() };
            if settings.classes.is_empty() {
                continue;
            }
            let (_, alone) = render_halves(view.scene, view.camera, &settings)?;
            weighed.push(self.weigh_light(effect, &light(&alone, None)));
            for (rest, alone) in rest.iter_mut().flatten().zip(alone.iter().flatten()) {
                *rest = difference(rest, alone);
            }
        }
        for (part, effect) in EFFECTS_OF_PARTS.into_iter().enumerate() {
            if presence.has(effect) && (effect != Effect::Volume || view.scene.survey.scattering) {
                weighed.push(self.weigh_light(effect, &light_of_part(&rest, part)));
            }
        }
        Some(weighed)
    }

    /// Weight of an effect that is a property of the scene, measured by a picture without it. `energy` is its share of
    /// the light, if it also is a light effect.
    fn weigh_scene_effect(
        &self,
        effect: Effect,
        without: View<'_>,
        settings: &Settings,
        energy: Option<f64>,
    ) -> Option<EffectWeight> {
        let (_, halves) = render_halves(without.scene, without.camera, settings)?;
        let lost = light(&self.halves, Some(&halves));
        let (relmse, noise) = self.relmse(&lost);
        let energy = energy.or_else(|| (effect == Effect::Environment).then(|| self.energy(&lost)));
        let error_if_off = (relmse > SIGNIFICANCE * noise).then(|| relmse.sqrt());
        Some(EffectWeight { effect, energy, error_if_off, saved: None })
    }
}

/// Measures the weights of the light effects that are present, and of `scene_effects`, in a small picture. `settings`
/// find all light; `count` counts the vertices in a scene without an effect. `None` if the user stops the measurement.
pub(super) fn weigh(
    view: View<'_>,
    settings: &Settings,
    presence: &Presence,
    scene_effects: &[Effect],
    count: impl Fn(&Scene, &Camera) -> Cost,
) -> Option<Vec<WeighedEffect>> {
    let reference = Reference::new(view, settings)?;
    let mut weighed = reference.weigh_light_effects(view, settings, presence)?;
    for &effect in scene_effects {
        // The lens belongs to the camera, not to the scene.
        let rebuilt = (effect != Effect::DepthOfField).then(|| switch::without_effect(view.scene, effect));
        let (scene, camera) = match &rebuilt {
            None => (view.scene, view.camera.without_lens()),
            Some(Ok(scene)) => (scene, *view.camera),
            Some(Err(_)) => continue,
        };
        let as_light = weighed.iter().position(|weighed| weighed.weight.effect == effect);
        let energy = as_light.and_then(|index| weighed.swap_remove(index).weight.energy);
        let weight = reference.weigh_scene_effect(effect, View::new(scene, &camera), settings, energy)?;
        weighed.push(WeighedEffect { weight, cost_without: Some(count(scene, &camera)) });
    }
    Some(weighed)
}

impl WeighedEffect {
    /// Completes the weight with the core-seconds that a candidate would save without the effect. `cost` is counted
    /// without a guide.
    pub fn weight_for(self, cost: &Cost, candidate: Candidate, settings: &Settings, pixels: f64) -> EffectWeight {
        let saved = match self.cost_without {
            Some(without) => {
                // The saved share of unguided paths stands in for the share of guided ones.
                let unguided = Candidate { guided: false, ..candidate };
                let [with, without] = [cost, &without].map(|cost| cost.iteration_seconds(unguided, settings, pixels));
                (1.0 - without / with).max(0.0) * cost.iteration_seconds(candidate, settings, pixels)
            }
            None => {
                let classes = ClassSet::of(self.weight.effect);
                let [with, without] = [settings.classes.and(classes), settings.classes & classes.complement()]
                    .map(|classes| Settings { classes, ..settings.clone() })
                    .map(|settings| cost.iteration_seconds(candidate, &settings, pixels));
                (with - without).max(0.0)
            }
        };
        EffectWeight { saved: Some(saved), ..self.weight }
    }
}
