//! The one place that knows the integrator of each method.

use super::bidirectional::Passes;
use super::integrator::Integrator;
use super::metropolis::Metropolis;
use super::path::Paths;
use super::photon_tracer::PhotonTracer;
use super::pixel_bandwidths::{Counted, Scheduled};
use super::pm::Pm;
use super::sppm::Sppm;
use crate::estimator::rule::CountingRule;
use crate::estimator::rule::adaptive::Adaptive;
use crate::estimator::rule::chi_squared::ChiSquared;
use crate::estimator::rule::local::LocalStatistics;
use crate::estimator::rule::thinned::Thinned;
use crate::photon::{Kernel, kernel};
use crate::render::input::RenderInput;
use crate::render::settings::{BandwidthRule, KernelChoice, Method};
use crate::transport::TechniqueSet;

/// Makes the integrator of the settings' method, before the first iteration.
pub(in crate::render) fn integrator<'a>(input: &'a RenderInput<'a>) -> Box<dyn Integrator + 'a> {
    let pairs = |techniques| Box::new(Passes::new(input, techniques));
    match input.settings.method {
        Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm => sppm(input, PhotonTracer::new(input)),
        Method::Pm => Box::new(Pm::new(input.camera, input.settings.lobes)),
        Method::Path => Box::new(Paths::new(input)),
        Method::Light => pairs(TechniqueSet::LIGHT),
        Method::Bdpt => pairs(TechniqueSet::BDPT),
        Method::Bpm => pairs(TechniqueSet::BPM),
        Method::Vcm => pairs(TechniqueSet::VCM),
        Method::Mlt => Box::new(Metropolis::new(input.camera, input.settings.lobes)),
    }
}

/// Makes the integrator of progressive photon mapping with the bandwidth rule and the kernel of the settings.
fn sppm<'a>(input: &'a RenderInput<'a>, tracer: PhotonTracer) -> Box<dyn Integrator + 'a> {
    use BandwidthRule as Rule;
    let settings = &input.settings;
    match settings.bandwidth_rule() {
        // Photons of equal flux need no thinning: they are as dense as the light.
        Some(Rule::ChiSquared) if tracer.guide().is_some() && !settings.has_channels() => {
            counted(input, tracer, Thinned::new(&settings.chi_squared), kernel::Box)
        }
        Some(Rule::ChiSquared) => counted(input, tracer, ChiSquared::new(&settings.chi_squared), kernel::Box),
        Some(Rule::Adaptive) => match settings.kernel {
            KernelChoice::Box => adaptive(input, tracer, kernel::Box),
            KernelChoice::Epanechnikov => adaptive(input, tracer, kernel::Epanechnikov),
            KernelChoice::Gaussian => adaptive(input, tracer, kernel::Gaussian),
        },
        Some(Rule::Local) => counted(input, tracer, LocalStatistics { alpha: settings.alpha }, kernel::Box),
        Some(Rule::Memoryless) | None => match settings.kernel {
            KernelChoice::Box => memoryless(input, tracer, kernel::Box),
            KernelChoice::Epanechnikov => memoryless(input, tracer, kernel::Epanechnikov),
            KernelChoice::Gaussian => memoryless(input, tracer, kernel::Gaussian),
        },
    }
}

fn memoryless<'a>(input: &'a RenderInput<'a>, tracer: PhotonTracer, kernel: impl Kernel) -> Box<dyn Integrator + 'a> {
    Box::new(Sppm::new(input, tracer, Scheduled::new(&input.settings), kernel))
}

fn adaptive<'a, K: Kernel + Default>(
    input: &'a RenderInput<'a>,
    tracer: PhotonTracer,
    kernel: K,
) -> Box<dyn Integrator + 'a> {
    counted(input, tracer, Adaptive::<K>::default(), kernel)
}

fn counted<'a>(
    input: &'a RenderInput<'a>,
    tracer: PhotonTracer,
    rule: impl CountingRule + 'a,
    kernel: impl Kernel,
) -> Box<dyn Integrator + 'a> {
    let RenderInput { scene, settings, .. } = input;
    let kinds = settings.bandwidth_kinds(&scene.survey);
    let bandwidths = Counted::new(settings, kinds, tracer.map_count(), rule);
    Box::new(Sppm::new(input, tracer, bandwidths, kernel))
}
