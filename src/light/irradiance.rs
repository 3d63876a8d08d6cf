//! Selection of lights by the irradiance expected at a receiver: by the tree of lights, and among those at infinity.

use super::cdf::Cdf;
use super::kind::{Emitter, Light};
use super::receiver::Receiver;
use super::sky::Sky;
use super::tree::LightTree;

/// Minimum probability, in the selection by expected irradiance, of the lights at infinity together and of the finite
/// lights together, if a scene has both.
const MIN_SHARE: f32 = 0.0625;
/// Rows and columns of the bins of lights for which probabilities are learnt ([`super::learnt_table`]).
pub(super) const ROWS: usize = 8;
pub(super) const COLUMNS: usize = 8;
/// Largest number of bins, and of lights at infinity that have a bin each.
const BINS: usize = ROWS * COLUMNS;
const MAX_INFINITE: usize = BINS / 4;

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

impl IrradianceSampler {
    pub fn new(tree: LightTree, emitters: &[Emitter], sky: &Sky) -> IrradianceSampler {
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

    /// Selects a light for a receiver by the uniform number `u`. Returns its index and its probability; `None` if no light
    /// can reach the receiver.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
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
    pub fn sample_in(&self, bin: usize, at: &Receiver, u: f64) -> Option<usize> {
        match *self.bins.get(bin)? {
            Bin::Cluster(cluster) => self.tree.sample_in(cluster, at, u).map(|(index, _)| index),
            Bin::Light(index) => Some(index),
            Bin::Infinite => Some(self.infinite.as_ref()?.sample(u).0),
        }
    }

    /// Probability with which [`IrradianceSampler::sample`] selects the light `index`.
    #[inline]
    pub fn pdf(&self, at: &Receiver, index: usize) -> f32 {
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
