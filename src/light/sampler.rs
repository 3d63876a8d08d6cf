//! Selection of a light for next-event estimation at a receiver.

use super::cdf::Cdf;
use super::kind::{Emitter, Light, Owner};
use super::learnt::{BINS, LEARNT_SHARE, LearntLights, LightCell};
use super::receiver::Receiver;
use super::sky::Sky;
use super::tree::LightTree;
use std::sync::Arc;

/// Share of the probability of selecting a light that is proportional to power at every receiver. It limits how much
/// probability a near light behind a wall can take from the other lights.
const POWER_SHARE: f64 = 0.1;
/// Minimum probability, in the selection by expected irradiance, of the lights at infinity together and of the finite
/// lights together, if a scene has both.
const MIN_SHARE: f32 = 0.0625;

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
    pub near: Option<Arc<IrradianceSampler>>,
    /// Which lights arrive where; `None` if that is not known.
    learnt: Option<Arc<LearntLights>>,
}

/// Selects lights by the irradiance expected at the receiver.
pub(super) struct IrradianceSampler {
    tree: LightTree,
    /// Selects among the lights at infinity, by the irradiance on a surface that faces them; `None` without such
    /// lights.
    infinite: Option<Cdf>,
    /// The bins for which probabilities are learnt.
    bins: Vec<Bin>,
    /// For each emitter, its bin.
    bin_of: Vec<u32>,
}

/// Lights that share a learnt probability.
#[derive(Clone, Copy)]
enum Bin {
    /// A cluster of the tree.
    Cluster(u32),
    /// A light at infinity, by its index.
    Light(usize),
    /// All lights at infinity, if there are many.
    Infinite,
}

/// Largest number of lights at infinity that have a bin each.
const MAX_INFINITE: usize = BINS / 4;

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

impl IrradianceSampler {
    fn new(tree: LightTree, emitters: &[Emitter], sky: &Sky) -> IrradianceSampler {
        let infinite = Cdf::new(emitters.iter().map(|emitter| f64::from(emitter.irradiance(sky))));
        let at_infinity = |&i: &usize| infinite.as_ref().is_some_and(|infinite| infinite.pdf(i) > 0.0);
        let far: Vec<usize> = (0..emitters.len()).filter(at_infinity).collect();
        let mut bins: Vec<Bin> = tree.clusters(BINS - MAX_INFINITE).into_iter().map(Bin::Cluster).collect();
        let mut bin_of = vec![0; emitters.len()];
        for (bin, of) in bins.iter().enumerate() {
            if let Bin::Cluster(cluster) = *of {
                tree.emitters(cluster).iter().for_each(|&emitter| bin_of[emitter as usize] = bin as u32);
            }
        }
        let one_each = far.len() <= MAX_INFINITE;
        for (k, &light) in far.iter().enumerate() {
            bin_of[light] = (bins.len() + if one_each { k } else { 0 }) as u32;
        }
        if one_each {
            bins.extend(far.into_iter().map(Bin::Light));
        } else {
            bins.push(Bin::Infinite);
        }
        IrradianceSampler { tree, infinite, bins, bin_of }
    }

    /// The bin of a light.
    #[inline]
    pub fn bin(&self, index: usize) -> usize {
        self.bin_of[index] as usize
    }

    /// For each light, its bin.
    pub fn bins(&self) -> impl Iterator<Item = usize> {
        self.bin_of.iter().map(|&bin| bin as usize)
    }

    /// Probability of selecting one of the lights at infinity, in the selection by expected irradiance.
    #[inline]
    fn infinite_share(&self, at: &Receiver) -> f32 {
        let Some(infinite) = &self.infinite else { return 0.0 };
        let (irradiance, near) = (infinite.total() as f32, self.tree.importance(at));
        if near > 0.0 { (irradiance / (irradiance + near)).clamp(MIN_SHARE, 1.0 - MIN_SHARE) } else { 1.0 }
    }

    #[inline]
    fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        let share = self.infinite_share(at);
        let split = f64::from(share);
        match &self.infinite {
            Some(infinite) if u < split => {
                let (index, pdf, _) = infinite.sample(u / split);
                Some((index, share * pdf))
            }
            _ => {
                let rest = ((u - split) / (1.0 - split)).min(1.0f64.next_down());
                let (index, pdf) = self.tree.sample(at, rest)?;
                Some((index, (1.0 - share) * pdf))
            }
        }
    }

    /// Selects a light of a bin by the uniform number `u`; `None` if no light of the bin can reach the receiver.
    #[inline]
    fn sample_in(&self, bin: usize, at: &Receiver, u: f64) -> Option<usize> {
        match *self.bins.get(bin)? {
            Bin::Cluster(cluster) => self.tree.sample_in(cluster, at, u).map(|(index, _)| index),
            Bin::Light(index) => Some(index),
            Bin::Infinite => Some(self.infinite.as_ref()?.sample(u).0),
        }
    }

    #[inline]
    fn pdf(&self, at: &Receiver, index: usize) -> f32 {
        let [_, pdf] = self.pdfs(at, index);
        pdf
    }

    /// Probabilities of selecting the light `index` in its bin, and among all lights.
    #[inline]
    pub fn pdfs(&self, at: &Receiver, index: usize) -> [f32; 2] {
        let (share, infinite) = (self.infinite_share(at), self.infinite.as_ref().map_or(0.0, |of| of.pdf(index)));
        match self.bins[self.bin(index)] {
            Bin::Cluster(cluster) => {
                let [within, pdf] = self.tree.pdfs(cluster, at, index);
                [within, (1.0 - share) * pdf]
            }
            Bin::Light(_) => [1.0, share * infinite],
            Bin::Infinite => [infinite, share * infinite],
        }
    }
}
