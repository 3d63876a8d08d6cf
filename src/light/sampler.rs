//! Selection of a light for next-event estimation at a receiver.

use super::cdf::Cdf;
use super::irradiance::IrradianceSampler;
use super::kind::{Emitter, Light, Owner};
use super::learnt_lights::{LearntLights, LightBins, LightCell};
use super::learnt_table::LEARNT_SHARE;
use super::receiver::Receiver;
use super::sky::Sky;
use super::tree::LightTree;
use std::sync::Arc;

/// Share of the probability of selecting a light that is proportional to power at every receiver. It limits how much
/// probability a near light behind a wall can take from the other lights.
const POWER_SHARE: f64 = 0.1;

/// Probability of selecting a light in the mixture of two distributions: its probability by power, and `near`, its
/// probability by the irradiance expected at the receiver.
#[inline]
fn mixed(by_power: f32, near: f32) -> f32 {
    POWER_SHARE as f32 * by_power + (1.0 - POWER_SHARE as f32) * near
}

/// Selects a light for next-event estimation, by power and by the irradiance expected at the receiver (the point that
/// receives light), or by what was learnt about it.
#[derive(Clone)]
pub(super) struct LightSampler {
    power: Arc<Cdf>,
    /// Selection by expected irradiance; `None` if it would not help: the scene has one light only, or the two
    /// triangles of one object.
    near: Option<Arc<IrradianceSampler>>,
    /// Which lights arrive where; `None` if that is not known.
    learnt: Option<Arc<LearntLights>>,
}

impl LightSampler {
    /// Builds the distributions over the emitters; `powers` are their weights in the selection by power. `None` if all
    /// are zero.
    pub fn new(emitters: &[Emitter], sky: &Sky, powers: impl Iterator<Item = f64>) -> Option<LightSampler> {
        let power = Arc::new(Cdf::new(powers)?);
        let near = has_several_lights(emitters).then(|| LightTree::new(emitters)).flatten();
        let near = near.map(|tree| Arc::new(IrradianceSampler::new(tree, emitters, sky)));
        Some(LightSampler { power, near, learnt: None })
    }

    /// The sampler with what was learnt about its lights.
    pub fn with_learnt(&self, learnt: Option<&Arc<LearntLights>>) -> LightSampler {
        let is_same = |learnt: &&Arc<LearntLights>| self.near.as_ref().is_some_and(|near| learnt.is_of(near));
        LightSampler { learnt: learnt.filter(is_same).cloned(), ..self.clone() }
    }

    /// The bins of lights for which probabilities can be learnt; `None` if there is nothing to choose.
    pub fn bins(&self) -> Option<LightBins> {
        LightBins::new(&self.power, self.near.as_ref()?)
    }

    /// The distribution over the emitters by power alone, which selects lights for the starts of light paths.
    #[inline]
    pub fn power(&self) -> &Cdf {
        &self.power
    }

    /// Selects a light for a receiver by the uniform number `u`. Returns its index and its probability; `None` if no
    /// light can reach the receiver.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        if let Some(near) = &self.near
            && let Some(cell) = self.cell(at)
        {
            let share = f64::from(LEARNT_SHARE);
            let index = if u < share {
                let (bin, [_, rest]) = cell.select(u / share, |rest| rest)?;
                near.sample_in(bin, at, rest)?
            } else {
                self.sample_unlearnt(at, ((u - share) / (1.0 - share)).min(1.0f64.next_down()))?.0
            };
            return Some((index, self.learnt_pdf(near, cell, at, index)));
        }
        self.sample_unlearnt(at, u)
    }

    /// [`LightSampler::sample`] where nothing was learnt.
    #[inline]
    fn sample_unlearnt(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        let Some(near) = self.near.as_ref().filter(|_| !at.in_medium) else {
            let (index, pdf, _) = self.power.sample(u);
            return Some((index, pdf));
        };
        if u < POWER_SHARE {
            let (index, pdf, _) = self.power.sample(u / POWER_SHARE);
            return Some((index, mixed(pdf, near.pdf(at, index))));
        }
        let u = ((u - POWER_SHARE) / (1.0 - POWER_SHARE)).min(1.0f64.next_down());
        let (index, pdf) = near.sample(at, u)?;
        Some((index, mixed(self.power.pdf(index), pdf)))
    }

    /// Probability with which [`LightSampler::sample`] selects the light `index` at a receiver.
    #[inline]
    pub fn pdf(&self, at: &Receiver, index: usize) -> f32 {
        match (&self.near, self.cell(at)) {
            (Some(near), Some(cell)) => self.learnt_pdf(near, cell, at, index),
            (Some(near), None) if !at.in_medium => mixed(self.power.pdf(index), near.pdf(at, index)),
            _ => self.power.pdf(index),
        }
    }

    /// What was learnt about a receiver.
    #[inline]
    fn cell(&self, at: &Receiver) -> Option<&LightCell> {
        self.learnt.as_ref()?.cell(at)
    }

    #[inline]
    fn learnt_pdf(&self, near: &IrradianceSampler, cell: &LightCell, at: &Receiver, index: usize) -> f32 {
        let [within, pdf] = near.pdfs(at, index);
        cell.density(near.bin(index), within, mixed(self.power.pdf(index), pdf))
    }
}

/// Whether a scene has more lights than one emitter or the two triangles of a rectangle, so that selection depends on
/// the receiver.
fn has_several_lights(emitters: &[Emitter]) -> bool {
    match emitters {
        [first, second] if matches!(first.owner(), Owner::Surface(_)) => first.owner() != second.owner(),
        _ => emitters.len() > 1,
    }
}
