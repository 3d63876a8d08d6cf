//! Guided emission: most light paths start toward what makes caustics, from the lights that reach it, and the rest from
//! the lights that light the picture.
//!
//! A start is drawn from a mixture: with probability [`Guide::unguided`] as [`Lights::sample_emission`] draws it, else
//! from a cell, a lamp alone or a pair of a lamp and a target. The lamp gives the origin; toward a target the direction
//! is uniform in the cone that its bounding sphere fills from there (for light from infinity, the line is uniform over
//! the sphere's disc), else it is the lamp's own. Whatever component made it, a start carries its native flux times the
//! ratio of its native density to its density in the mixture \[Veach 1997, (9.15), the balance heuristic\], at most 1 /
//! unguided (half as much again where part of the unguided ones go to a region of interest): the mean is that of
//! unguided emission.
//!
//! How probable cells are is learnt from the error that their photons leave in the picture ([`Guide::learn`]).

use super::emission::{EmissionSample, EntryDisc};
use super::emitter::position_error;
use super::lights::Lights;
use super::{Cdf, Emitter, Region};
use crate::geometry::{Shapes, offset_origin};
use crate::material::Materials;
use crate::math::{DVec2, Frame, Vec2, Vec3, one_minus_cos, warp};
use std::f32::consts::PI;
use std::ops::Range;

/// Least share of unguided light paths: what the guide has never seen keeps its photons.
const LEAST_UNGUIDED: f64 = 0.2;
/// Most of the paths that go to targets where they are for all light: with bandwidths that neighbours set, more of them
/// would be paid for with wider bandwidths for all that is no caustic. A few, sent where they matter, are many times
/// what came there by chance.
const MOST_TARGETED: f64 = 0.2;
/// Share of the guided paths that all cells keep, by their lamps' power.
const PRIOR: f64 = 0.1;
/// Lamps that can be guided; beyond this many the weakest go unguided.
const MAX_LAMPS: usize = 256;

/// The cell of unguided paths.
pub const UNGUIDED: usize = 0;

/// Emitters that are guided together: a lamp's triangles, or one punctual light.
struct Lamp {
    emitters: Range<usize>,
    /// Probability of choosing one of them by power, and where in the choice they begin.
    probability: f64,
    below: f64,
    /// Probability of the lamp's own cell, of paths to anywhere, over `probability`.
    own: f32,
    /// Targets and the probability of their cells over `probability`.
    targets: Vec<(usize, f32)>,
}

/// Probabilities of cells.
pub struct Guide {
    lamps: Vec<Lamp>,
    /// Lamp of an emitter; `u32::MAX` for those unguided.
    lamp_of: Vec<u32>,
    /// Lamp of a cell, and its target if it has one; that of [`UNGUIDED`] means nothing.
    cells: Vec<(usize, Option<usize>)>,
    /// Of the cells by power alone.
    prior: Vec<f64>,
    /// Most of the paths that go to targets.
    most_targeted: f64,
    choice: Cdf,
}

/// A guided start.
pub struct GuidedEmission {
    /// The start; its densities are those of unguided emission, by which strategies are weighed against each other.
    pub emission: EmissionSample,
    /// The component that made it.
    pub cell: usize,
    /// Native density over the mixture's: what the flux was multiplied by.
    pub ratio: f32,
    /// Density of starts that are drawn by power alone over the mixture's.
    pub weight: f32,
    /// Share of the mixture's density that paths of all light have, without those sent where caustics are made.
    pub unaimed: f32,
}

impl Guide {
    /// Every pair of a lamp and a target, lamps by power; `all`: light paths are for more than caustics, and each of
    /// several lamps has a cell of its own for that. `None` where there would be nothing to choose, or nothing shines.
    pub fn new(lights: &Lights, all: bool) -> Option<Guide> {
        let choice = lights.choice()?;
        let targets = lights.targets().spheres().len();
        let mut lamps: Vec<Lamp> = Vec::new();
        let mut below = 0.0;
        for (range, probability) in lights.lamps() {
            if probability > 0.0 {
                lamps.push(Lamp { emitters: range, probability, below, own: 0.0, targets: Vec::new() });
            }
            below += probability;
        }
        lamps.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        lamps.truncate(MAX_LAMPS);
        // As the choice itself has rounded it.
        for lamp in &mut lamps {
            lamp.below = choice.below(lamp.emitters.start);
        }
        let mut lamp_of = vec![u32::MAX; lights.emitters().len()];
        for (index, lamp) in lamps.iter().enumerate() {
            lamp_of[lamp.emitters.clone()].fill(index as u32);
        }
        let own = all && lamps.len() > 1;
        let of_lamp = || (0..targets).map(Some).chain(own.then_some(None));
        let mut cells = vec![(usize::MAX, None)];
        cells.extend((0..lamps.len()).flat_map(|lamp| of_lamp().map(move |target| (lamp, target))));
        if cells.len() == 1 {
            return None;
        }
        let power: f64 = lamps.iter().map(|lamp| lamp.probability).sum();
        // Half of it for caustics, where there is both.
        let half = if own && targets > 0 { 0.5 } else { 1.0 };
        let each = |&(lamp, target): &(usize, Option<usize>)| {
            let alike = if target.is_some() { targets as f64 } else { 1.0 };
            half * lamps[lamp].probability / (power * alike)
        };
        let prior: Vec<f64> = std::iter::once(0.0).chain(cells[1..].iter().map(each)).collect();
        let weights = prior.iter().enumerate().map(|(cell, p)| if cell == UNGUIDED { 0.5 } else { 0.5 * p });
        let choice = Cdf::new(weights)?;
        let most_targeted = if all { MOST_TARGETED } else { 1.0 };
        let mut guide = Guide { lamps, lamp_of, cells, prior, most_targeted, choice };
        guide.spread();
        Some(guide)
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// Probability of an unguided start.
    pub fn unguided(&self) -> f32 {
        self.choice.pdf(UNGUIDED)
    }

    /// Makes a cell as probable as leaves the least error after as much work: `error[c]` is the sum of the squared
    /// relative errors that its photons left in the picture, made by `paths[c]` light paths at the cost of `work[c]` in
    /// all. Of strata with n paths each the sum of `error * paths / n` is least, where the sum of `n * work / paths` is
    /// given, for n in proportion to `sqrt(error * paths / (work / paths))`.
    pub fn learn(&mut self, error: &[f64], paths: &[f64], work: &[f64]) {
        let best = |(&error, (&paths, &work)): (&f64, (&f64, &f64))| {
            if work > 0.0 { (error * paths * paths / work).sqrt() } else { 0.0 }
        };
        let best: Vec<f64> = error.iter().zip(paths.iter().zip(work)).map(best).collect();
        let guided: f64 = best[1..].iter().sum();
        if !(guided.is_finite() && guided > 0.0) {
            return;
        }
        let unguided = (best[UNGUIDED] / (best[UNGUIDED] + guided)).clamp(LEAST_UNGUIDED, 1.0 - PRIOR);
        let weight = |(cell, best): (usize, f64)| {
            if cell == UNGUIDED {
                unguided
            } else {
                (1.0 - unguided) * ((1.0 - PRIOR) * best / guided + PRIOR * self.prior[cell])
            }
        };
        let mut weights: Vec<f64> = best.iter().copied().enumerate().map(weight).collect();
        let targeted: f64 = weights.iter().zip(&self.cells).filter(|(_, cell)| cell.1.is_some()).map(|(w, _)| w).sum();
        if targeted > self.most_targeted {
            let others = (1.0 - self.most_targeted) / (1.0 - targeted);
            for (weight, (_, target)) in weights.iter_mut().zip(&self.cells) {
                *weight *= if target.is_some() { self.most_targeted / targeted } else { others };
            }
        }
        if let Some(choice) = Cdf::new(weights.into_iter()) {
            self.choice = choice;
            self.spread();
        }
    }

    /// Gives every lamp its targets.
    fn spread(&mut self) {
        for lamp in &mut self.lamps {
            lamp.targets.clear();
            lamp.own = 0.0;
        }
        for (cell, &(lamp, target)) in self.cells.iter().enumerate().skip(1) {
            let probability = self.choice.pdf(cell);
            if probability > 0.0 {
                let lamp = &mut self.lamps[lamp];
                let weight = (f64::from(probability) / lamp.probability) as f32;
                match target {
                    Some(target) => lamp.targets.push((target, weight)),
                    None => lamp.own = weight,
                }
            }
        }
    }

    /// A start; unguided ones from infinity are in part sent through a region, if there is one. `choice`, `point` and
    /// `direction` are uniform on the unit square.
    #[inline]
    pub fn emit(
        &self,
        lights: &Lights,
        shapes: &Shapes,
        materials: &Materials,
        region: Option<Region>,
        (choice, point, direction): (DVec2, Vec2, Vec2),
    ) -> Option<GuidedEmission> {
        let (cell, _, rest) = self.choice.sample(choice.y);
        let (lamp, target) = self.cells[cell];
        let u = match self.lamps.get(lamp) {
            // The part of the choice that falls on this lamp, and a hair less, for the sum may have been rounded up.
            Some(lamp) => (lamp.below + choice.x * lamp.probability).min((lamp.below + lamp.probability).next_down()),
            None => choice.x,
        };
        let mut emission = lights.sample_emission(shapes, materials, u, point, direction)?;
        match target {
            Some(target) => emission = self.turn(lights, emission, target, point, direction)?,
            None => lights.aim_with_region(&mut emission, region, rest, point),
        }
        let lamp = self.lamps.get(self.lamp_of[emission.light as usize] as usize);
        let (anywhere, unaimed) = lights.density_with_region(&emission, region);
        // By components that do not look at targets.
        let untargeted = self.unguided() + lamp.map_or(0.0, |lamp| lamp.own);
        let mut mixed = untargeted * anywhere;
        for &(other, weight) in lamp.iter().flat_map(|lamp| &lamp.targets) {
            mixed += weight
                * Self::density(
                    lights,
                    &emission,
                    other,
                    target == Some(other) || emission.entry == EntryDisc::Target(other),
                );
        }
        let plain = lights.plain(&emission);
        let (emission, ratio) = emission.reweighted(mixed)?;
        Some(GuidedEmission { emission, cell, ratio, weight: plain / mixed, unaimed: untargeted * unaimed / mixed })
    }

    /// Turns a native start of the lamp toward a target, its flux and densities those that native emission would give
    /// it there.
    fn turn(
        &self,
        lights: &Lights,
        mut emission: EmissionSample,
        target: usize,
        point: Vec2,
        direction: Vec2,
    ) -> Option<EmissionSample> {
        let (center, radius) = lights.targets().spheres()[target];
        if emission.infinite {
            lights.targets().through(lights.sky(), &mut emission, target, point);
            return Some(emission);
        }
        let Some((axis, one_minus_cos)) = cone(emission.origin, center, radius) else { return Some(emission) };
        let d = Frame::from_normal(axis).to_world(warp::cone_uniform(direction, one_minus_cos));
        if let Emitter::Triangle { plane, corners, .. } = &lights.emitters()[emission.light as usize] {
            let b = warp::triangle_uniform(point);
            let at = corners[0] + corners[1] * b.x + corners[2] * b.y;
            emission.origin = offset_origin(at, plane.truncate(), d, position_error(corners));
        }
        emission.direction = d;
        (emission.density.onward, emission.density.cos) = lights.onward(emission.light as usize, d)?;
        Some(emission)
    }

    /// Density of the start's direction (of its line, from infinity) toward a target; `inside`: it was drawn from
    /// there, whatever rounding says.
    #[inline]
    fn density(lights: &Lights, emission: &EmissionSample, target: usize, inside: bool) -> f32 {
        let (center, radius) = lights.targets().spheres()[target];
        let d = emission.direction;
        if emission.infinite {
            let v = emission.origin - center;
            let off_axis = (v - d * v.dot(d)).length_squared();
            return if inside || off_axis < radius * radius { 1.0 / (PI * radius * radius) } else { 0.0 };
        }
        match cone(emission.origin, center, radius) {
            // From within a target nothing is turned.
            None => emission.density.onward,
            Some((axis, size)) => {
                let within = one_minus_cos(d, axis) < size;
                if inside || within { warp::cone_uniform_pdf_w(size) } else { 0.0 }
            }
        }
    }
}

/// Axis of the cone that a sphere fills from `p`, and 1 - cos of its half angle; `None` from within.
#[inline]
fn cone(p: Vec3, center: Vec3, radius: f32) -> Option<(Vec3, f32)> {
    let to = center - p;
    let distance2 = to.length_squared();
    let sin2 = radius * radius / distance2;
    (sin2 < 0.9999).then(|| (to / distance2.sqrt(), sin2 / (1.0 + (1.0 - sin2).sqrt())))
}
