//! Lights whose light arrives at a place, learnt before a render. The bins of the table are clusters of the light tree
//! and lights at infinity; within a bin, lights are selected by expected irradiance.

use super::cdf::Cdf;
use super::irradiance::{COLUMNS, IrradianceSampler, ROWS};
use super::learnt_table::{Cell, LearntTable, LightSamples, LitSample};
use super::receiver::Receiver;
use std::sync::Arc;

/// The probabilities of the bins for a receiver.
pub(super) type LightCell = Cell<ROWS, COLUMNS>;

/// The lights of a scene, divided into bins.
pub struct LightBins {
    near: Arc<IrradianceSampler>,
    /// For each bin, its probability in the selection by power.
    powers: Vec<f32>,
}

impl LightBins {
    /// Divides the lights, which are selected by `power` or by `near`; `None` if there is at most one bin.
    pub(super) fn new(power: &Cdf, near: &Arc<IrradianceSampler>) -> Option<LightBins> {
        let mut powers = vec![0.0; ROWS * COLUMNS];
        for (light, bin) in near.bins().enumerate() {
            powers[bin] += power.pdf(light);
        }
        let sum: f32 = powers.iter().sum();
        powers.iter_mut().for_each(|power| *power /= sum);
        let several = powers.iter().filter(|&&power| power > 0.0).count() > 1;
        several.then(|| LightBins { near: Arc::clone(near), powers })
    }

    /// Whether samples of a trial promise that it pays to learn.
    pub fn promise(&self, samples: &LightSamples) -> bool {
        LearntTable::<ROWS, COLUMNS>::promise(samples, &self.powers)
    }

    /// The sample of a light at a receiver. `probability`: that of selecting the light without a table.
    pub(super) fn lit(&self, at: &Receiver, light: u32, probability: f32, value: f32, bounce: f32) -> LitSample {
        let [within, _] = self.near.pdfs(at, light as usize);
        LitSample { bin: self.near.bin(light as usize), value, bounce, within: within / probability }
    }
}

/// Learnt probabilities of bins of lights, by receiver. See the module.
pub struct LearntLights {
    near: Arc<IrradianceSampler>,
    table: LearntTable<ROWS, COLUMNS>,
}

impl LearntLights {
    /// Learns from light samples; `None` if the table would not reduce the noise.
    pub fn learn(bins: LightBins, samples: &LightSamples) -> Option<LearntLights> {
        let table = LearntTable::learn(samples, &bins.powers)?;
        Some(LearntLights { near: bins.near, table })
    }

    /// Whether the table was learnt for these lights.
    pub(super) fn is_of(&self, near: &Arc<IrradianceSampler>) -> bool {
        Arc::ptr_eq(&self.near, near)
    }

    /// The cell of a receiver; `None` where the table knows nothing.
    #[inline]
    pub(super) fn cell(&self, at: &Receiver) -> Option<&LightCell> {
        self.table.cell(at)
    }
}
