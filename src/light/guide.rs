//! Guided emission: most light paths start towards objects that make caustics, or from the lights that matter most for
//! the picture.
//!
//! A start is sampled from a mixture. With probability [`Guide::unguided`] it is sampled by
//! [`Lights::sample_emission`], otherwise from a cell: a light alone, or a pair of a light and a target. The light
//! determines the origin. Towards a target, the direction is uniform in the cone that the target's bounding sphere
//! subtends (for light from infinity, the line is uniform over the sphere's disc); in a cell without a target, the
//! light samples the direction. The flux of a start is its unguided flux times the ratio of its unguided density to its
//! density in the mixture \[Veach 1997, (9.15), the balance heuristic\], so the mean does not change. The ratio is at
//! most 1 / `unguided`, or 1.5 / `unguided` with a region of interest.
//!
//! [`Guide::learn`] sets the probabilities of the cells from the error that their photons leave in the picture.

use super::emission::{EmissionDraws, EmissionSample, EntryDisc};
use super::lights::Lights;
use super::{Cdf, Emitter, Region};
use crate::geometry::{Shapes, offset_origin};
use crate::material::Materials;
use crate::math::{Frame, Rgb, Vec2, Vec3, one_minus_cos, warp};
use std::f32::consts::PI;
use std::ops::Range;

/// Minimum share of the light paths that start unguided (from a light selected by its power), which find light that the
/// guide has not seen.
const MIN_UNGUIDED_SHARE: f64 = 0.2;
/// Maximum share of the light paths that start towards caustic targets (objects that can make caustics) if light paths
/// carry all light. If neighbouring photons set the bandwidths, more paths to targets would widen the bandwidths of all
/// light except caustics.
const MAX_TARGETED_SHARE: f64 = 0.2;
/// Share of the guided light paths that is distributed over all cells (pairs of a light and a target) by the power of
/// the lights, whatever the guide has learned.
const PRIOR_SHARE: f64 = 0.1;
/// Maximum number of guided lights; weaker lights emit only unguided paths.
const MAX_LIGHTS: usize = 256;

/// Index of the cell that stands for unguided light paths, whose light is selected by its power.
pub const UNGUIDED: usize = 0;

/// Emitters that are guided together as one light: the triangles of an object, or one other light.
#[derive(Clone)]
struct GuidedLight {
    emitters: Range<usize>,
    /// Probability that selection by power gives one of these emitters.
    probability: f64,
    /// Sum of the probabilities, by power, of all emitters before these.
    below: f64,
    /// Probability of the cell that pairs this light with no target, over `probability`.
    own: f32,
    /// For each caustic target that this light is paired with, its index and the probability of the pair (a cell) over
    /// `probability`.
    targets: Vec<(usize, f32)>,
}

/// Guided emission: the probability of each cell (a light, or a pair of a light and a caustic target) from which light
/// paths start.
#[derive(Clone)]
pub struct Guide {
    lights: Vec<GuidedLight>,
    /// For each emitter, the index in `lights` of its guided light; `u32::MAX` for unguided emitters.
    light_of: Vec<u32>,
    /// For each cell, the index of its light in `lights`, and its caustic target if it has one. The entry of
    /// [`UNGUIDED`] is not used.
    cells: Vec<(usize, Option<usize>)>,
    /// Probability that each cell has by the power of its light alone, before [`Guide::learn`].
    prior: Vec<f64>,
    /// Maximum share, 0 to 1, of the light paths that start towards caustic targets.
    max_targeted: f64,
    choice: Cdf,
}

/// The start of a light path, sampled by [`Guide::emit`].
pub struct GuidedEmission {
    /// The sampled start. Its densities are those of unguided emission, which the MIS weights use.
    pub emission: EmissionSample,
    /// Index of the cell (a light, or a pair of a light and a target) that the start was sampled from; may be
    /// [`UNGUIDED`].
    pub cell: usize,
    /// Density of the start in unguided emission over its density in guided emission: the factor that was applied to
    /// the flux.
    pub ratio: f32,
    /// Density of the start without aiming at targets and without guiding, over its density in guided emission.
    pub weight: f32,
    /// Part, 0 to 1, of the start's density that remains without aiming at caustic targets (their cells and discs).
    pub unaimed: f32,
}

impl Guide {
    /// Builds a cell for every pair of a guided light and a caustic target, with probabilities by power. `all`: light
    /// paths carry all light, not only caustics, so each of several lights also has a cell without a target. `None` if
    /// there is no guided cell.
    pub fn new(lights: &Lights, all: bool) -> Option<Guide> {
        let targets = lights.targets().spheres().len();
        let guided = guided_lights(lights)?;
        let mut light_of = vec![u32::MAX; lights.emitters().len()];
        for (index, light) in guided.iter().enumerate() {
            light_of[light.emitters.clone()].fill(index as u32);
        }
        let own = all && guided.len() > 1;
        let targets_of_light = || (0..targets).map(Some).chain(own.then_some(None));
        let mut cells = vec![(usize::MAX, None)];
        cells.extend((0..guided.len()).flat_map(|light| targets_of_light().map(move |target| (light, target))));
        if cells.len() == 1 {
            return None;
        }
        let power: f64 = guided.iter().map(|light| light.probability).sum();
        // Half of the paths go to targets if there are cells with and without targets.
        let half = if own && targets > 0 { 0.5 } else { 1.0 };
        let by_power = |&(light, target): &(usize, Option<usize>)| {
            let count = if target.is_some() { targets as f64 } else { 1.0 };
            half * guided[light].probability / (power * count)
        };
        let prior: Vec<f64> = std::iter::once(0.0).chain(cells[1..].iter().map(by_power)).collect();
        let weights = prior.iter().enumerate().map(|(cell, p)| if cell == UNGUIDED { 0.5 } else { 0.5 * p });
        let choice = Cdf::new(weights)?;
        let max_targeted = if all { MAX_TARGETED_SHARE } else { 1.0 };
        let mut guide = Guide { lights: guided, light_of, cells, prior, max_targeted, choice };
        guide.update_lights();
        Some(guide)
    }

    /// The guide for the lights of another moment of a moving scene, whose powers and targets may differ. It keeps the
    /// probabilities of the cells if it has the same lights and number of targets there, and starts anew otherwise.
    /// `None` if there is no guided cell.
    pub fn for_lights(&self, lights: &Lights) -> Option<Guide> {
        let guided = guided_lights(lights)?;
        let now = |light: &GuidedLight| guided.iter().find(|other| other.emitters == light.emitters);
        let now: Option<Vec<GuidedLight>> = self.lights.iter().map(|light| now(light).cloned()).collect();
        let targets = self.cells.iter().filter_map(|cell| cell.1).max().map_or(0, |last| last + 1);
        match now
            .filter(|_| targets == lights.targets().spheres().len() && self.light_of.len() == lights.emitters().len())
        {
            Some(lights) => {
                let mut guide = Guide { lights, ..self.clone() };
                guide.update_lights();
                Some(guide)
            }
            None => Guide::new(lights, self.max_targeted < 1.0),
        }
    }

    /// Number of cells (lights, and pairs of a light and a caustic target), with the cell of unguided paths.
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// Probability that a light path starts unguided, from a light selected by its power.
    pub fn unguided(&self) -> f32 {
        self.choice.pdf(UNGUIDED)
    }

    /// Sets the probabilities of the cells (pairs of a light and a target) that minimise the picture's error for equal
    /// work. For each cell c, `error[c]` is the sum of the squared relative errors that its photons left in the
    /// picture, `paths[c]` the number of its light paths, `work[c]` their total cost. With n paths in each cell, the
    /// error is the sum of `error * paths / n` and the work the sum of `n * work / paths`. The optimal n is
    /// proportional to `sqrt(error * paths / (work / paths))`.
    pub fn learn(&mut self, error: &[f64], paths: &[f64], work: &[f64]) {
        let best = |(&error, (&paths, &work)): (&f64, (&f64, &f64))| {
            if work > 0.0 { (error * paths * paths / work).sqrt() } else { 0.0 }
        };
        let best: Vec<f64> = error.iter().zip(paths.iter().zip(work)).map(best).collect();
        let guided: f64 = best[1..].iter().sum();
        if !(guided.is_finite() && guided > 0.0) {
            return;
        }
        let unguided = (best[UNGUIDED] / (best[UNGUIDED] + guided)).clamp(MIN_UNGUIDED_SHARE, 1.0 - PRIOR_SHARE);
        let weight = |(cell, best): (usize, f64)| {
            if cell == UNGUIDED {
                unguided
            } else {
                (1.0 - unguided) * ((1.0 - PRIOR_SHARE) * best / guided + PRIOR_SHARE * self.prior[cell])
            }
        };
        let mut weights: Vec<f64> = best.iter().copied().enumerate().map(weight).collect();
        let targeted: f64 = weights.iter().zip(&self.cells).filter(|(_, cell)| cell.1.is_some()).map(|(w, _)| w).sum();
        if targeted > self.max_targeted {
            let others = (1.0 - self.max_targeted) / (1.0 - targeted);
            for (weight, (_, target)) in weights.iter_mut().zip(&self.cells) {
                *weight *= if target.is_some() { self.max_targeted / targeted } else { others };
            }
        }
        if let Some(choice) = Cdf::new(weights.into_iter()) {
            self.choice = choice;
            self.update_lights();
        }
    }

    /// Copies the probability of each cell to the guided light that it belongs to.
    fn update_lights(&mut self) {
        for light in &mut self.lights {
            light.targets.clear();
            light.own = 0.0;
        }
        for (cell, &(light, target)) in self.cells.iter().enumerate().skip(1) {
            let probability = self.choice.pdf(cell);
            if probability > 0.0 {
                let light = &mut self.lights[light];
                let weight = (f64::from(probability) / light.probability) as f32;
                match target {
                    Some(target) => light.targets.push((target, weight)),
                    None => light.own = weight,
                }
            }
        }
    }

    /// Samples the start of a light path. Part of the starts from infinity without a target go through the region of
    /// interest (the sphere around most visible surfaces), if there is one.
    #[inline]
    pub fn emit(
        &self,
        lights: &Lights,
        shapes: &Shapes,
        materials: &Materials,
        region: Option<Region>,
        EmissionDraws { choice, point, direction }: EmissionDraws,
    ) -> Option<GuidedEmission> {
        let (cell, _, rest) = self.choice.sample(choice.y);
        let (light, target) = self.cells[cell];
        let u = match self.lights.get(light) {
            // Restricts the selection to the emitters of this light. `next_down`, because the sum may be rounded up.
            Some(light) => {
                (light.below + choice.x * light.probability).min((light.below + light.probability).next_down())
            }
            None => choice.x,
        };
        // A direction without light is no fault if the start is aimed afterwards.
        let mut emission = match target {
            Some(_) => lights.sample_start(shapes, materials, u, point, direction)?,
            None => lights.sample_emission(shapes, materials, u, point, direction)?,
        };
        match target {
            Some(target) => emission = Self::aim_at(lights, emission, target, point, direction)?,
            None => lights.aim_with_region(&mut emission, region, rest, point),
        }
        let light = self.lights.get(self.light_of[emission.light as usize] as usize);
        let (density, unaimed) = lights.density_with_region(&emission, region);
        // The probability of the cells without a target, over the probability of the light.
        let untargeted = self.unguided() + light.map_or(0.0, |light| light.own);
        let mut mixed = untargeted * density;
        for &(other, weight) in light.iter().flat_map(|light| &light.targets) {
            let sampled = target == Some(other) || emission.entry == EntryDisc::Target(other);
            mixed += weight * Self::target_density(lights, &emission, other, sampled);
        }
        let plain = lights.unaimed_density(&emission);
        let (emission, ratio) = emission.reweighted(mixed)?;
        Some(GuidedEmission { emission, cell, ratio, weight: plain / mixed, unaimed: untargeted * unaimed / mixed })
    }

    /// Turns an unguided start of a light path towards a caustic target, with the flux and densities that unguided
    /// emission has in the new direction.
    fn aim_at(
        lights: &Lights,
        mut emission: EmissionSample,
        target: usize,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let (center, radius) = lights.targets().spheres()[target];
        if emission.infinite {
            lights.targets().aim_at(lights.sky(), &mut emission, target, point);
            return (emission.flux != Rgb::ZERO).then_some(emission);
        }
        let Some((axis, one_minus_cos)) = cone(emission.origin, center, radius) else {
            return (emission.flux != Rgb::ZERO).then_some(emission);
        };
        let d = Frame::from_normal(axis).to_world(warp::cone_uniform(direction, one_minus_cos));
        if let Emitter::Triangle(triangle) = &lights.emitters()[emission.light as usize] {
            let at = triangle.at(warp::triangle_uniform(point));
            emission.origin = offset_origin(at, triangle.normal(), d, triangle.error);
        }
        lights.redirect(&mut emission, d)?;
        Some(emission)
    }

    /// Density with which the cell of a caustic target samples the direction of a start per solid angle (the line per
    /// area, for light from infinity). `sampled`: the start was sampled towards this target, so rounding at the rim
    /// does not matter.
    #[inline]
    fn target_density(lights: &Lights, emission: &EmissionSample, target: usize, sampled: bool) -> f32 {
        let (center, radius) = lights.targets().spheres()[target];
        let d = emission.direction;
        if emission.infinite {
            let v = emission.origin - center;
            let off_axis = (v - d * v.dot(d)).length_squared();
            return if sampled || off_axis < radius * radius { 1.0 / (PI * radius * radius) } else { 0.0 };
        }
        match cone(emission.origin, center, radius) {
            // A start inside the target's sphere keeps its direction.
            None => emission.density.onward,
            Some((axis, size)) => {
                let within = one_minus_cos(d, axis) < size;
                if sampled || within { warp::cone_uniform_pdf_w(size) } else { 0.0 }
            }
        }
    }
}

/// The strongest lights by power, at most [`MAX_LIGHTS`], without cells so far. `None` if no light has any power.
fn guided_lights(lights: &Lights) -> Option<Vec<GuidedLight>> {
    let choice = lights.choice()?;
    let mut guided: Vec<GuidedLight> = lights
        .emitters_by_object()
        .filter(|(_, probability)| *probability > 0.0)
        .map(|(emitters, probability)| {
            let below = choice.below(emitters.start);
            GuidedLight { emitters, probability, below, own: 0.0, targets: Vec::new() }
        })
        .collect();
    guided.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    guided.truncate(MAX_LIGHTS);
    Some(guided)
}

/// Axis of the cone of directions in which a sphere is seen from `p`, and 1 minus the cosine of its half angle; `None`
/// if `p` is inside the sphere.
#[inline]
fn cone(p: Vec3, center: Vec3, radius: f32) -> Option<(Vec3, f32)> {
    let to = center - p;
    let distance2 = to.length_squared();
    let sin2 = radius * radius / distance2;
    (sin2 < 0.9999).then(|| (to / distance2.sqrt(), sin2 / (1.0 + (1.0 - sin2).sqrt())))
}
