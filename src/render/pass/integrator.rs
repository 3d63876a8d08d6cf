//! What the passes of a method are to the loop over iterations.

use super::photon_counts::PhotonCounts;
use super::techniques::TechniquePicture;
use crate::estimator::PixelAccumulator;
use crate::light::Guide;
use crate::photon::ByKind;
use crate::render::clock::Phases;

/// What an iteration has done.
#[derive(Default)]
pub(in crate::render) struct Work {
    /// Light paths walked.
    pub light_paths: u64,
    /// Photons of the map used.
    pub photons: usize,
    /// Those that were left out of it and light paths that ended because they were not finite.
    pub rejected: u64,
    /// Photons on surfaces by kind, where a method has any.
    pub counts: PhotonCounts,
}

/// The passes of a method.
pub(in crate::render) trait Integrator {
    /// The pixels before the first iteration.
    fn pixels(&mut self) -> Vec<PixelAccumulator>;
    /// Adds iteration `i` (from 1) to all pixels, and what it cost to `phases`; `None` where it was given up
    /// ([`Settings::stop`](crate::render::Settings::stop)) and has changed nothing.
    fn iterate(&mut self, i: u64, pixels: &mut [PixelAccumulator], phases: &mut Phases) -> Option<Work>;
    /// Squared radii by kind of photons of every pixel and level after the last iteration (square scene units), of
    /// methods where they do not follow from the iteration.
    fn counted(&self) -> Option<ByKind<Vec<f32>>> {
        None
    }
    /// What it has learnt from iterations and the next one needs, packed; what follows from the settings alone is made
    /// again.
    ///
    /// # Errors
    /// None: it is written to memory.
    fn state(&self) -> postcard::Result<Vec<u8>> {
        Ok(Vec::new())
    }
    /// Takes such a state, after [`Iterate::pixels`]; false where it is another's.
    fn restore(&mut self, state: &[u8]) -> bool {
        state.is_empty()
    }
    /// Where its light paths start, if they are guided.
    fn guide(&self) -> Option<&Guide> {
        None
    }
    /// Pictures per technique after so many iterations, of methods that have them.
    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        let _ = iterations;
        Vec::new()
    }
}
