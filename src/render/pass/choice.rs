//! The one place that knows the integrator of each method.

use super::bidirectional::Passes;
use super::integrator::Integrator;
use super::metropolis::Metropolis;
use super::path::Paths;
use super::photon_tracer::PhotonTracer;
use super::pixel_bandwidths::{Counted, Scheduled};
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

/// Makes the integrator of the settings' method, before the first iteration.
pub(in crate::render) fn integrator<'a>(
    scene: &'a Scene,
    camera: &'a Camera,
    settings: &'a Settings,
    initial_media: &'a InitialMedia,
) -> Box<dyn Integrator + 'a> {
    let pairs = |techniques| Box::new(Passes::new(scene, camera, settings, initial_media, techniques));
    match settings.method {
        Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm => {
            sppm(PhotonTracer::new(scene, camera, settings, initial_media), settings)
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

/// Makes the integrator of progressive photon mapping with the bandwidth rule and the kernel of the settings.
fn sppm<'a>(tracer: PhotonTracer<'a>, settings: &'a Settings) -> Box<dyn Integrator + 'a> {
    use BandwidthRule as Rule;
    match settings.bandwidth_rule() {
        // Photons of equal flux need no thinning: they are as dense as the light.
        Some(Rule::ChiSquared) if tracer.guide().is_some() && !settings.has_channels() => {
            counted(tracer, settings, Thinned::new(&settings.chi_squared), kernel::Box)
        }
        Some(Rule::ChiSquared) => counted(tracer, settings, ChiSquared::new(&settings.chi_squared), kernel::Box),
        Some(Rule::Adaptive) => match settings.kernel {
            KernelChoice::Box => adaptive(tracer, settings, kernel::Box),
            KernelChoice::Epanechnikov => adaptive(tracer, settings, kernel::Epanechnikov),
            KernelChoice::Gaussian => adaptive(tracer, settings, kernel::Gaussian),
        },
        Some(Rule::Local) => counted(tracer, settings, LocalStatistics { alpha: settings.alpha }, kernel::Box),
        Some(Rule::Memoryless) | None => match settings.kernel {
            KernelChoice::Box => memoryless(tracer, settings, kernel::Box),
            KernelChoice::Epanechnikov => memoryless(tracer, settings, kernel::Epanechnikov),
            KernelChoice::Gaussian => memoryless(tracer, settings, kernel::Gaussian),
        },
    }
}

fn memoryless<'a>(tracer: PhotonTracer<'a>, settings: &'a Settings, kernel: impl Kernel) -> Box<dyn Integrator + 'a> {
    Box::new(Sppm::new(tracer, settings, Scheduled::new(settings), kernel))
}

fn adaptive<'a, K: Kernel + Default>(
    tracer: PhotonTracer<'a>,
    settings: &'a Settings,
    kernel: K,
) -> Box<dyn Integrator + 'a> {
    counted(tracer, settings, Adaptive::<K>::default(), kernel)
}

fn counted<'a>(
    tracer: PhotonTracer<'a>,
    settings: &'a Settings,
    rule: impl CountingRule + 'a,
    kernel: impl Kernel,
) -> Box<dyn Integrator + 'a> {
    let kinds = settings.bandwidth_kinds(&tracer.camera_paths().scene.survey);
    let bandwidths = Counted::new(settings, kinds, tracer.map_count(), rule);
    Box::new(Sppm::new(tracer, settings, bandwidths, kernel))
}
