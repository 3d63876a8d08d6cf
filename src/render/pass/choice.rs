//! From settings to the passes that they ask for: the one place that knows which pass a method is.

use super::bidirectional::Passes;
use super::counting::Counting;
use super::integrator::Integrator;
use super::metropolis::Metropolis;
use super::path::Paths;
use super::pm::Pm;
use super::sppm::Sppm;
use crate::camera::Camera;
use crate::estimator::rule::CountingRule;
use crate::estimator::rule::adaptive::Adaptive;
use crate::estimator::rule::chi_squared::ChiSquared;
use crate::estimator::rule::local::LocalStatistics;
use crate::estimator::rule::thinned::Thinned;
use crate::photon::{Kernel, kernel};
use crate::render::settings::{BandwidthRule, Method};
use crate::render::settings::{KernelChoice, Settings};
use crate::scene::Scene;
use crate::transport::{InitialMedia, TechniqueSet};

/// The passes of a render, nothing done yet.
pub(in crate::render) fn integrator<'a>(
    scene: &'a Scene,
    camera: &'a Camera,
    settings: &'a Settings,
    initial_media: &'a InitialMedia,
) -> Box<dyn Integrator + 'a> {
    let pairs = |techniques| Box::new(Passes::new(scene, camera, settings, initial_media, techniques));
    match settings.method {
        Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm => {
            gathering(Sppm::new(scene, camera, settings, initial_media), settings)
        }
        Method::Pm => Box::new(Pm::new(scene, camera, settings, initial_media)),
        Method::Path => Box::new(Paths::new(settings.camera_paths(scene, camera, initial_media), settings)),
        Method::Light => pairs(TechniqueSet::LIGHT),
        Method::Bdpt => pairs(TechniqueSet::BDPT),
        Method::Bpm => pairs(TechniqueSet::BPM),
        Method::Vcm => pairs(TechniqueSet::VCM),
        Method::Mlt => Box::new(Metropolis::new(scene, camera, settings, initial_media)),
    }
}

/// Progressive photon mapping by the rule that the settings say.
fn gathering<'a>(sppm: Sppm<'a>, settings: &'a Settings) -> Box<dyn Integrator + 'a> {
    use BandwidthRule as Rule;
    match (settings.bandwidth_rule(), settings.kernel) {
        // Photons of equal flux are as dense as the light.
        (Some(Rule::ChiSquared), _) if sppm.guide().is_some() && !settings.has_channels() => {
            counting(sppm, settings, Thinned::new(&settings.chi_squared), kernel::Box)
        }
        (Some(Rule::ChiSquared), _) => counting(sppm, settings, ChiSquared::new(&settings.chi_squared), kernel::Box),
        (Some(Rule::Adaptive), KernelChoice::Box) => adaptive(sppm, settings, kernel::Box),
        (Some(Rule::Adaptive), KernelChoice::Epanechnikov) => adaptive(sppm, settings, kernel::Epanechnikov),
        (Some(Rule::Adaptive), KernelChoice::Gaussian) => adaptive(sppm, settings, kernel::Gaussian),
        (Some(Rule::Local), _) => counting(sppm, settings, LocalStatistics { alpha: settings.alpha }, kernel::Box),
        (Some(Rule::Memoryless) | None, _) => Box::new(sppm),
    }
}

fn adaptive<'a, K: Kernel + Default>(sppm: Sppm<'a>, settings: &'a Settings, kernel: K) -> Box<dyn Integrator + 'a> {
    counting(sppm, settings, Adaptive::<K>::default(), kernel)
}

fn counting<'a>(
    sppm: Sppm<'a>,
    settings: &'a Settings,
    rule: impl CountingRule + 'a,
    kernel: impl Kernel,
) -> Box<dyn Integrator + 'a> {
    Box::new(Counting::new(sppm, settings, rule, kernel))
}
