//! Opens the finish of a render: finds the denoiser, loads the network, and reserves time for both.

use crate::combine::{Combiner, Model, Runtime};
use crate::error::{Error, Result};
use crate::film::{LayerSet, Size};
use crate::finish::{DenoiserChoice, Finish, Finished, Quality};
use crate::render::Clock;
use crate::stop::Stop;
use serde_json::{Value, json};

/// Largest share of the render's time limit that one run of the denoiser may take at a quality above the lowest.
const MAX_DENOISING_SHARE: f64 = 0.07;
/// Width and height of the picture by which the denoiser is timed (pixels).
const TIMED_SIDE: usize = 192;
/// Largest share of the render's time limit that the finish (network and denoiser) may take.
const MAX_FINISH_SHARE: f64 = 0.5;

/// The finish (network and denoiser) that the user asks for.
pub struct FinishRequest {
    /// The denoiser that the user asks for.
    pub denoiser: DenoiserChoice,
    /// The network of equation (6), which combines bandwidth levels: the name of a built-in network, or an ONNX file;
    /// `None`: levels are not combined.
    pub model: Option<String>,
}

/// Text of the warning that the built-in denoiser replaces a missing one.
pub fn missing_denoiser(error: &Error) -> String {
    let hint = error.hint.as_ref().map(|hint| format!("; {hint}")).unwrap_or_default();
    format!("{error}: our own denoiser takes its place, whose pictures are grainier{hint}")
}

/// A finish (denoiser and network) whose libraries have been found and whose network has been loaded.
pub struct OpenFinish {
    finish: Finish,
    model: Option<Network>,
    /// Why the preferred denoiser is missing, if the built-in one takes its place; `None` otherwise.
    pub missing: Option<Error>,
}

/// Name and training of a network.
struct Network {
    name: String,
    training: String,
}

/// Reads the network of a request, so that a wrong name is found before any work is done.
///
/// # Errors
/// The network or ONNX Runtime is missing.
pub fn check(request: &FinishRequest) -> Result<()> {
    let Some(name) = request.model.as_deref() else { return Ok(()) };
    Model::open(name)?;
    find_runtime().map(drop)
}

/// Finds the libraries and loads the network, with the threads of the current rayon pool. `levels`: the number of
/// bandwidth levels of the render, if known.
///
/// # Errors
/// A library that the user asks for by name is missing, or the network combines another number of levels.
pub fn open(request: &FinishRequest, levels: Option<usize>) -> Result<OpenFinish> {
    let opened = request.model.as_deref().map(|name| open_network(name, levels)).transpose()?;
    let (model, combiner) = opened.unzip();
    let (finish, missing) = Finish::open(request.denoiser, combiner)?;
    Ok(OpenFinish { finish, model, missing })
}

fn open_network(name: &str, levels: Option<usize>) -> Result<(Network, Combiner)> {
    let model = Model::open(name)?;
    let combiner = Combiner::new(&model, &find_runtime()?)?;
    let facts = combiner.metadata();
    if let Some(levels) = levels.filter(|levels| *levels != facts.levels) {
        let cause = format!("the network {name} combines {} levels, not {levels}", facts.levels);
        let error = Error::usage(cause);
        return Err(error.hint(format!("leave --model out, or render with --levels {}", facts.levels)));
    }
    let network = Network { name: name.into(), training: facts.training.clone() };
    Ok((network, combiner))
}

fn find_runtime() -> Result<Runtime> {
    Runtime::find().map_err(|mut error| {
        let advice = "or leave --model out: levels are not combined by the network then";
        error.hint = Some(error.hint.map_or(advice.into(), |hint| format!("{hint}; {advice}")));
        error
    })
}

impl OpenFinish {
    /// The denoiser and the network, to finish pictures with.
    pub fn finish(&mut self) -> &mut Finish {
        &mut self.finish
    }

    /// Chooses the quality of the denoiser for a render with a time limit, and returns the seconds that the finish will
    /// take. Both follow from timing the denoiser on a small picture. The clock decides when the render ends and how
    /// well its one picture is denoised, nothing else.
    ///
    /// `limit`: seconds of the render; `pixels`: of the picture; `parts`: finished parts besides the picture.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn reserve_time(&mut self, limit: f64, pixels: usize, parts: usize) -> Result<f64> {
        let has_qualities = self.finish.has_qualities();
        let small = Size { width: TIMED_SIDE, height: TIMED_SIDE };
        let mut time = |run: &dyn Fn(&mut Finish) -> Result<()>| -> Result<f64> {
            // The first run also loads the library's weights.
            run(&mut self.finish)?;
            let clock = Clock::start();
            run(&mut self.finish)?;
            Ok(clock.seconds() * pixels as f64 / small.pixels() as f64)
        };
        let guides = time(&|finish| finish.warm_up_guides(small))?;
        let mut time = |quality| time(&|finish| finish.warm_up(small, quality));
        let fast = time(Quality::Fast)?;
        let mut picture = (Quality::Fast, fast);
        if has_qualities {
            for quality in [Quality::High, Quality::Balanced] {
                let seconds = time(quality)?;
                if seconds <= MAX_DENOISING_SHARE * limit {
                    picture = (quality, seconds);
                    break;
                }
            }
        }
        self.finish.quality = picture.0;
        // The guides, the picture, the half of its iterations that gives its error, and its parts.
        Ok((guides + 2.0 * picture.1 + fast * parts as f64).min(MAX_FINISH_SHARE * limit))
    }

    /// Finishes a preview: at the lowest quality, without a bound, without its error and its parts.
    ///
    /// # Errors
    /// See [`Finish::apply`]. [`ErrorKind::Interrupted`](crate::error::ErrorKind::Interrupted): `stop` was requested
    /// meanwhile.
    pub fn apply_to_preview(&mut self, set: &mut LayerSet, stop: Option<&Stop>) -> Result<()> {
        let quality = std::mem::replace(&mut self.finish.quality, Quality::Fast);
        (self.finish.preview, self.finish.stop) = (true, stop.cloned());
        let applied = self.finish.apply(set, |_| false);
        (self.finish.quality, self.finish.preview, self.finish.stop) = (quality, false, None);
        applied.map(|_| ())
    }

    /// The denoiser and the network, without the name of the network.
    pub fn into_finish(self) -> Finish {
        self.finish
    }

    /// Names of the network and the denoiser, for messages.
    pub fn name(&self) -> String {
        let denoiser = self.finish.denoiser();
        match &self.model {
            Some(network) => format!("{}, {denoiser}", network.name),
            None => denoiser,
        }
    }

    /// The value of the key `combined` in the EXR's header, which describes the finish: denoiser, network, error.
    pub fn header(&self, finished: &Finished) -> Value {
        let quality = match self.finish.quality {
            Quality::High => "high",
            Quality::Balanced => "balanced",
            Quality::Fast => "fast",
        };
        json!({
            "denoiser": self.finish.denoiser(),
            "quality": quality,
            "model": self.model.as_ref().map(|network| &network.name),
            "levels": finished.combined,
            "training": self.model.as_ref().map(|network| &network.training),
            "clamped": {"below_zero": finished.clamped.below_zero, "too_bright": finished.clamped.too_bright},
            "error_at_half": finished.error.map(|error| error.noise.max(0.0).sqrt()),
        })
    }
}
