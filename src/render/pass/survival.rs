//! Probabilities that roulette lets the paths of a proxy render get as far as a sample, which variances of renders with
//! another roulette contain (docs/theory.md, choosing numbers of samples).

use crate::math::Vec3;
use crate::transport::{PathRecorder, SPARED_BY_ROULETTE};

/// Probabilities that roulette lets a camera path get as far as a vertex.
#[derive(Clone, Copy)]
pub(super) struct CameraSurvival {
    /// With the roulette of the proxy, which spares camera paths as in path tracing.
    spared: f32,
    /// With a roulette that spares no path.
    unspared: f32,
}

impl CameraSurvival {
    /// At the camera.
    pub const START: CameraSurvival = CameraSurvival { spared: 1.0, unspared: 1.0 };

    /// Follows the path to the next vertex. `survival(chance)` is the probability that the roulette of the proxy allows it
    /// if the throughput of the path is divided by `chance`.
    #[inline]
    pub fn continues(&mut self, survival: impl Fn(f32) -> f32) {
        // A path that roulette has spared less often has a larger throughput.
        let onward = survival(self.unspared / (SPARED_BY_ROULETTE * self.spared));
        self.spared *= survival(1.0);
        self.unspared *= onward;
    }

    /// Factor of the second moment of a sample if no path is spared.
    pub fn ratio(self) -> f64 {
        f64::from(self.spared / self.unspared)
    }

    /// Factor of the second moment if a spared camera path samples the whole path, of which `light` is the probability
    /// that roulette lets the light path get as far. Unspared paths survive with about the light that is left.
    pub fn without_light_path(self, light: f64) -> f64 {
        let spared = |survival: f64| (survival / f64::from(SPARED_BY_ROULETTE)).min(1.0);
        let camera = f64::from(self.unspared);
        light * spared(camera) / spared(camera * light)
    }
}

/// Probabilities that roulette lets a light path get as far as its vertices.
#[derive(Default)]
pub(super) struct LightSurvival(Vec<f32>);

impl LightSurvival {
    /// Starts a new light path.
    pub fn restart(&mut self) {
        self.0.clear();
        self.0.push(1.0);
    }

    /// The probability for the vertex at `depth`, from 1.
    pub fn at(&self, depth: u32) -> f32 {
        self.0.get(depth as usize - 1).copied().unwrap_or(1.0)
    }
}

impl PathRecorder for LightSurvival {
    fn continues(&mut self, survival: impl Fn(f32) -> f32) {
        let so_far = self.0.last().copied().unwrap_or(1.0);
        self.0.push(so_far * survival(1.0));
    }
}

/// Photons of an iteration, by the bits of their positions, with the probability that roulette lets the light path get
/// there.
#[derive(Default)]
pub(super) struct PhotonSurvival(Vec<([u32; 3], f32)>);

impl PhotonSurvival {
    /// Adds a photon.
    pub fn push(&mut self, p: Vec3, survival: f32) {
        self.0.push((p.to_array().map(f32::to_bits), survival));
    }

    /// Adds the photons of another list.
    pub fn append(&mut self, other: &PhotonSurvival) {
        self.0.extend_from_slice(&other.0);
    }

    /// Sorts the photons, which [`PhotonSurvival::of`] needs.
    pub fn sort(&mut self) {
        self.0.sort_unstable_by_key(|(at, _)| *at);
    }

    /// The probability for the photon at `p`; any one of those for photons at equal positions, 1 if there is none.
    pub fn of(&self, p: Vec3) -> f32 {
        let bits = p.to_array().map(f32::to_bits);
        self.0.binary_search_by_key(&bits, |(at, _)| *at).map_or(1.0, |index| self.0[index].1)
    }
}
