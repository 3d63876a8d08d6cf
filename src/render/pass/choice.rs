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
use crate::photon::Kernel;
use crate::render::input::RenderInput;
use crate::render::settings::{BandwidthRule, Method};
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
            counted(input, tracer, Thinned::new(&settings.chi_squared), Kernel::Box)
        }
        Some(Rule::ChiSquared) => counted(input, tracer, ChiSquared::new(&settings.chi_squared), Kernel::Box),
        Some(Rule::Adaptive) => counted(input, tracer, Adaptive { kernel: settings.kernel }, settings.kernel),
        Some(Rule::Local) => counted(input, tracer, LocalStatistics { alpha: settings.alpha }, Kernel::Box),
        Some(Rule::Memoryless) | None => Box::new(Sppm::new(input, tracer, Scheduled::new(settings), settings.kernel)),
    }
}

fn counted<'a>(
    input: &'a RenderInput<'a>,
    tracer: PhotonTracer,
    rule: impl CountingRule + 'a,
    kernel: Kernel,
) -> Box<dyn Integrator + 'a> {
    let RenderInput { scene, settings, .. } = input;
    let kinds = settings.bandwidth_kinds(&scene.survey);
    let bandwidths = Counted::new(settings, kinds, tracer.map_count(), rule);
    Box::new(Sppm::new(input, tracer, bandwidths, kernel))
}
