//! The interface between integrators and the loop over iterations.

use super::photon_counts::PhotonCounts;
use super::techniques::TechniquePicture;
use crate::estimator::PixelAccumulator;
use crate::light::Guide;
use crate::photon::ByKind;
use crate::render::clock::Phases;
use crate::render::input::RenderInput;

/// Numbers of light paths and photons of one iteration.
#[derive(Default)]
pub(in crate::render) struct Work {
    /// Number of light paths traced.
    pub light_paths: u64,
    /// Number of photons in the map.
    pub photons: usize,
    /// Number of photons and light paths that were rejected because they were not finite.
    pub rejected: u64,
    /// Numbers of surface photons stored and gathered, by kind (caustic, indirect); zero for methods without photons.
    pub counts: PhotonCounts,
}

/// Renders the iterations of a method, one at a time. It holds what passes from one iteration to the next. Scene and camera
/// are arguments, because they move between iterations if there is motion blur.
pub(in crate::render) trait Integrator {
    /// Runs the pilot that finds the initial bandwidths, if the method has one, and makes the pixels for the first
    /// iteration; none if the user has stopped the render.
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator>;
    /// Adds iteration `i` (from 1) to all pixels, and its core-seconds to `phases`. Returns `None` if the iteration was
    /// interrupted ([`Settings::stop`](crate::render::Settings::stop)) and has changed nothing.
    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work>;
    /// Squared bandwidths of every pixel and level after the last iteration (square scene units), by kind of photons; `None` if
    /// they follow from the number of the iteration.
    fn counted(&self) -> Option<ByKind<Vec<f32>>> {
        None
    }
    /// State that the next iteration needs from earlier ones, packed to bytes. It leaves out data that follow from the
    /// settings.
    ///
    /// # Errors
    /// None: the state is packed in memory.
    fn state(&self) -> postcard::Result<Vec<u8>> {
        Ok(Vec::new())
    }
    /// Restores a packed state, after [`Integrator::pixels`]. Returns false if the state is of another method or
    /// picture.
    fn restore(&mut self, state: &[u8]) -> bool {
        state.is_empty()
    }
    /// Learnt distribution of the starts of light paths; `None` if they are not guided.
    fn guide(&self) -> Option<&Guide> {
        None
    }
    /// Takes the picture of each technique, as the mean over `iterations`; empty for methods without techniques.
    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        let _ = iterations;
        Vec::new()
    }
}
