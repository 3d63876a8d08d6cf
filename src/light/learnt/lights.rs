//! Lights whose light arrives at a place, learnt before a render. The bins of the table are clusters of the light tree
//! and lights at infinity; within a bin, lights are selected by expected irradiance.

use super::table::{Cell, LearntTable, LightSamples, LitSample};
use crate::light::receiver::Receiver;
use crate::light::sampler::{IrradianceSampler, LightSampler};
use std::sync::Arc;

/// Rows and columns of the bins.
const ROWS: usize = 8;
const COLUMNS: usize = 8;
/// Largest number of bins.
pub const BINS: usize = ROWS * COLUMNS;

/// The probabilities of the bins for a receiver.
pub type LightCell = Cell<ROWS, COLUMNS>;

/// The lights of a scene, divided into bins.
pub struct LightBins {
    lights: Arc<LightSampler>,
    near: Arc<IrradianceSampler>,
    /// For each bin, its probability in the selection by power.
    powers: Vec<f32>,
}

impl LightBins {
    /// Divides the lights; `None` if there is at most one bin.
    pub(in crate::light) fn new(lights: &Arc<LightSampler>) -> Option<LightBins> {
        let near = Arc::clone(lights.near.as_ref()?);
        let mut powers = vec![0.0; BINS];
        for (light, bin) in near.bins().enumerate() {
            powers[bin] += lights.power().pdf(light);
        }
        let sum: f32 = powers.iter().sum();
        powers.iter_mut().for_each(|power| *power /= sum);
        let several = powers.iter().filter(|&&power| power > 0.0).count() > 1;
        several.then(|| LightBins { lights: Arc::clone(lights), near, powers })
    }

    /// Whether samples of a trial promise that it pays to learn.
    pub fn promise(&self, samples: &LightSamples) -> bool {
        LearntTable::<ROWS, COLUMNS>::promise(samples, &self.powers)
    }

    /// The sample of the light with an index at a receiver. `value`: the light that the receiver scatters, over the
    /// density of the sample. `bounce`: density with which a bounce finds the point of the light, over that of the sample.
    pub fn lit(&self, at: &Receiver, light: u32, value: f32, bounce: f32) -> LitSample {
        let light = light as usize;
        let [within, _] = self.near.pdfs(at, light);
        LitSample { bin: self.near.bin(light), value, bounce, within: within / self.lights.pdf(at, light) }
    }
}

/// Learnt probabilities of bins of lights, by receiver. See the module.
pub struct LearntLights {
    bins: LightBins,
    table: LearntTable<ROWS, COLUMNS>,
}

impl LearntLights {
    /// Learns from light samples; `None` if the table would not reduce the noise.
    pub fn learn(bins: LightBins, samples: &LightSamples) -> Option<LearntLights> {
        let table = LearntTable::learn(samples, &bins.powers)?;
        Some(LearntLights { bins, table })
    }

    /// Whether the table was learnt for these lights.
    pub(in crate::light) fn is_of(&self, near: &Arc<IrradianceSampler>) -> bool {
        Arc::ptr_eq(&self.bins.near, near)
    }

    /// The cell of a receiver; `None` where the table knows nothing.
    #[inline]
    pub(in crate::light) fn cell(&self, at: &Receiver) -> Option<&LightCell> {
        self.table.cell(at)
    }
}
