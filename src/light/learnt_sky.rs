//! Directions of the environment from which light arrives at a place, learnt before a render. The bins of the table are
//! the sectors of the environment; within a sector, the density is that of [`Environment::sample`].

use super::environment::{Environment, EnvironmentSample, SECTOR_COLUMNS, SECTOR_ROWS, Sectors};
use super::learnt_table::{Cell, LEARNT_SHARE, LearntTable, LightSamples, LitSample};
use super::receiver::Receiver;
use crate::math::{Rgb, Vec2, Vec3};

/// An environment, divided into sectors.
pub struct SkySectors {
    environment: Environment,
    sectors: Sectors,
}

impl SkySectors {
    /// Divides the directions of an environment.
    pub fn new(environment: &Environment) -> SkySectors {
        SkySectors { environment: environment.clone(), sectors: environment.sectors() }
    }

    /// Whether samples of a trial promise that it pays to learn.
    pub fn promise(&self, samples: &LightSamples) -> bool {
        LearntTable::<SECTOR_ROWS, SECTOR_COLUMNS>::promise(samples, &self.sectors.probabilities)
    }

    /// The light sample of a receiver in the direction `wi`, sampled by [`Environment::sample_at`]. `value`: the light
    /// that the receiver scatters, over the density of the sample. `bounce`: density with which a bounce finds the
    /// direction, over that of the sample.
    pub fn lit(&self, at: &Receiver, wi: Vec3, value: f32, bounce: f32) -> LitSample {
        let (_, image, sector) = self.environment.look_up(wi);
        let within = self.within(sector, image) / self.environment.pdf_w_at(at.n, wi, image);
        LitSample { bin: sector, value, bounce, within }
    }

    /// Density of sampling a direction in its sector alone, from that of [`Environment::sample`].
    #[inline]
    fn within(&self, sector: usize, image: f32) -> f32 {
        let probability = self.sectors.probabilities[sector];
        if probability > 0.0 { image / probability } else { 0.0 }
    }
}

/// A learnt distribution of directions towards the environment, by receiver. See the module.
pub struct LearntSky {
    sky: SkySectors,
    table: LearntTable<SECTOR_ROWS, SECTOR_COLUMNS>,
}

impl LearntSky {
    /// Learns from light samples; `None` if the table would not reduce the noise.
    pub fn learn(sky: SkySectors, samples: &LightSamples) -> Option<LearntSky> {
        let table = LearntTable::learn(samples, &sky.sectors.probabilities)?;
        Some(LearntSky { sky, table })
    }

    /// Whether the table was learnt under this environment, whose light it returns.
    pub fn is_of(&self, environment: &Environment) -> bool {
        match (&self.sky.environment, environment) {
            (Environment::Uniform(own), Environment::Uniform(other)) => own == other,
            (Environment::Image(own), Environment::Image(other)) => std::sync::Arc::ptr_eq(own, other),
            _ => false,
        }
    }

    /// Samples a direction for a receiver by the uniform point `u`, and returns it with its density. The sample itself
    /// holds the density of [`Environment::sample`].
    #[inline]
    pub fn sample(&self, at: &Receiver, u: Vec2) -> Option<(EnvironmentSample, f32)> {
        let SkySectors { environment, sectors } = &self.sky;
        let Some(cell) = self.table.cell(at) else { return environment.sample_with_density_at(at.n, u) };
        if u.x >= LEARNT_SHARE {
            let x = ((u.x - LEARNT_SHARE) / (1.0 - LEARNT_SHARE)).min(1.0f32.next_down());
            let sample = environment.sample_at(at.n, Vec2::new(x, u.y))?;
            let (.., sector) = environment.look_up(sample.wi);
            return Some((sample, self.density(at, cell, sample.wi, sector, sample.pdf_w)));
        }
        let (sector, rest) = cell.select(f64::from(u.x / LEARNT_SHARE), |_| f64::from(u.y))?;
        // Rounding to single precision must not give 1.
        let rest = Vec2::from(rest.map(|rest| (rest as f32).min(1.0f32.next_down())));
        let sample = environment.sample_sector(sectors, sector, rest)?;
        Some((sample, self.density(at, cell, sample.wi, sector, sample.pdf_w)))
    }

    /// Density per solid angle of the direction `wi` in a cell; `image`: that of [`Environment::sample`].
    #[inline]
    fn density(
        &self,
        at: &Receiver,
        cell: &Cell<SECTOR_ROWS, SECTOR_COLUMNS>,
        wi: Vec3,
        sector: usize,
        image: f32,
    ) -> f32 {
        cell.density(sector, self.sky.within(sector, image), self.sky.environment.pdf_w_at(at.n, wi, image))
    }

    /// Light from a direction, the density with which [`LearntSky::sample`] samples it for a receiver, and the density of
    /// [`Environment::sample`].
    #[inline]
    pub fn arriving(&self, at: &Receiver, d: Vec3) -> (Rgb, f32, f32) {
        let (radiance, image, sector) = self.sky.environment.look_up(d);
        let pdf_w = match self.table.cell(at) {
            None => self.sky.environment.pdf_w_at(at.n, d, image),
            Some(cell) => self.density(at, cell, d, sector, image),
        };
        (radiance, pdf_w, image)
    }
}
