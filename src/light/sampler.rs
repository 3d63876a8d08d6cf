//! The choice of a light for a point that receives light.

use super::cdf::Cdf;
use super::emitter::{Emitter, Sky};
use super::receiver::Receiver;
use super::tree::LightTree;
use crate::math::luminance;
use std::f32::consts::PI;

/// Share of the choices that go by power wherever the light is received: what a near lamp behind a wall takes from the
/// others has this bound.
const BY_POWER: f64 = 0.1;
/// Least share of the other choices for lights at infinity, and for all others, where there are both.
const LEAST_SHARE: f32 = 0.0625;

/// Probability of a choice that goes by power or by what arrives.
#[inline]
fn mixed(by_power: f32, near: f32) -> f32 {
    BY_POWER as f32 * by_power + (1.0 - BY_POWER as f32) * near
}

/// Which light is asked for light.
pub(super) struct LightSampler {
    power: Cdf,
    /// Where there is more to choose from than the halves of one rectangle.
    near: Option<Near>,
}

/// By what arrives.
struct Near {
    tree: LightTree,
    /// Lights at infinity, by the irradiance they may bring.
    infinite: Option<Cdf>,
}

impl LightSampler {
    /// `None` if no light gives any light; `powers` are those of the emitters, with a floor.
    pub fn new(emitters: &[Emitter], sky: &Sky, powers: impl Iterator<Item = f64>) -> Option<LightSampler> {
        let power = Cdf::new(powers)?;
        let near = several(emitters).then(|| LightTree::new(emitters)).flatten().map(|tree| {
            let irradiance = |emitter: &Emitter| match emitter {
                Emitter::Sun { irradiance, .. } => luminance(*irradiance),
                Emitter::Environment => sky.environment.as_ref().map_or(0.0, |e| luminance(e.mean()) * PI),
                _ => 0.0,
            };
            Near { tree, infinite: Cdf::new(emitters.iter().map(|emitter| f64::from(irradiance(emitter)))) }
        });
        Some(LightSampler { power, near })
    }

    /// By power alone, as emission is chosen.
    #[inline]
    pub fn power(&self) -> &Cdf {
        &self.power
    }

    /// A light and its probability.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        let Some(near) = self.near.as_ref().filter(|_| !at.in_medium) else {
            let (index, pdf, _) = self.power.sample(u);
            return Some((index, pdf));
        };
        if u < BY_POWER {
            let (index, pdf, _) = self.power.sample(u / BY_POWER);
            return Some((index, mixed(pdf, near.pdf(at, index))));
        }
        let u = ((u - BY_POWER) / (1.0 - BY_POWER)).min(1.0f64.next_down());
        let (index, pdf) = near.sample(at, u)?;
        Some((index, mixed(self.power.pdf(index), pdf)))
    }

    /// Probability of choosing a light.
    #[inline]
    pub fn pdf(&self, at: &Receiver, index: usize) -> f32 {
        let power = self.power.pdf(index);
        match &self.near {
            Some(near) if !at.in_medium => mixed(power, near.pdf(at, index)),
            _ => power,
        }
    }
}

/// Whether it matters which emitter is chosen.
fn several(emitters: &[Emitter]) -> bool {
    match emitters {
        [Emitter::Triangle { instance: a, .. }, Emitter::Triangle { instance: b, .. }] => a != b,
        _ => emitters.len() > 1,
    }
}

impl Near {
    /// Share of the lights at infinity.
    #[inline]
    fn share(&self, at: &Receiver) -> f32 {
        let Some(infinite) = &self.infinite else { return 0.0 };
        let (irradiance, near) = (infinite.total() as f32, self.tree.importance(at));
        if near > 0.0 { (irradiance / (irradiance + near)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) } else { 1.0 }
    }

    #[inline]
    fn sample(&self, at: &Receiver, u: f64) -> Option<(usize, f32)> {
        let share = self.share(at);
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
        let share = self.share(at);
        match &self.infinite {
            Some(infinite) if infinite.pdf(index) > 0.0 => share * infinite.pdf(index),
            _ => (1.0 - share) * self.tree.pdf(at, index),
        }
    }
}
