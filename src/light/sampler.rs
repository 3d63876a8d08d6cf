//! Selection of a light for next-event estimation at a receiver.

use super::cdf::Cdf;
use super::kind::{Emitter, Light, Owner};
use super::receiver::Receiver;
use super::sky::Sky;
use super::tree::LightTree;

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
/// receives light).
pub(super) struct LightSampler {
    power: Cdf,
    /// Selection by expected irradiance; `None` if it would not help: the scene has one light only, or the two
    /// triangles of one object.
    near: Option<IrradianceSampler>,
}

/// Selects lights by the irradiance expected at the receiver.
struct IrradianceSampler {
    tree: LightTree,
    /// Selects among the lights at infinity, by the irradiance on a surface that faces them; `None` without such
    /// lights.
    infinite: Option<Cdf>,
}

impl LightSampler {
    /// Builds the distributions over the emitters; `powers` are their weights in the selection by power. `None` if all
    /// are zero.
    pub fn new(emitters: &[Emitter], sky: &Sky, powers: impl Iterator<Item = f64>) -> Option<LightSampler> {
        let power = Cdf::new(powers)?;
        let near = has_several_lights(emitters).then(|| LightTree::new(emitters)).flatten().map(|tree| {
            let irradiance = emitters.iter().map(|emitter| f64::from(emitter.irradiance(sky)));
            IrradianceSampler { tree, infinite: Cdf::new(irradiance) }
        });
        Some(LightSampler { power, near })
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
        let power = self.power.pdf(index);
        match &self.near {
            Some(near) if !at.in_medium => mixed(power, near.pdf(at, index)),
            _ => power,
        }
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

    #[inline]
    fn pdf(&self, at: &Receiver, index: usize) -> f32 {
        let share = self.infinite_share(at);
        match &self.infinite {
            Some(infinite) if infinite.pdf(index) > 0.0 => share * infinite.pdf(index),
            _ => (1.0 - share) * self.tree.pdf(at, index),
        }
    }
}
