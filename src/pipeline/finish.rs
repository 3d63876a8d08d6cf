//! Opens the finish of a render: finds the denoiser, loads the network, and reserves time for both.

use crate::combine::model::OutputForm;
use crate::combine::{Model, Network, Runtime};
use crate::error::{Error, Result};
use crate::film::{LayerSet, Size};
use crate::finish::{DenoiserChoice, Finish, Finished, Quality};
use crate::render::Clock;
use crate::stop::Stop;
use serde_json::{Value, json};

/// Largest share of the render's time limit that one run of the denoiser may take at a quality above the lowest.
const MAX_DENOISING_SHARE: f64 = 0.07;
/// Width and height of the picture by which the denoiser is timed, and of the one before, for which it loads its weights
/// (pixels).
const TIMED_SIDE: usize = 128;
const LOADING_SIDE: usize = 16;
/// Largest share of the render's time limit that the finish (network and denoiser) may take.
const MAX_FINISH_SHARE: f64 = 0.5;

/// The finish (network and denoiser) that the user asks for.
pub struct FinishRequest {
    /// The denoiser that the user asks for.
    pub denoiser: DenoiserChoice,
    /// The network of equation (6), which combines bandwidth levels, or one of the finish: the name of a built-in
    /// network, or an ONNX file; `None`: no network.
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
    model: Option<NetworkFacts>,
    /// Why the preferred denoiser is missing, if the built-in one takes its place; `None` otherwise.
    pub missing: Option<Error>,
}

/// Facts about a network for the header of a picture.
struct NetworkFacts {
    name: String,
    /// Hash of its file.
    hash: String,
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
/// A library that the user asks for by name is missing, or the network combines another number of levels, or is one of
/// the finish and there is no denoiser.
pub fn open(request: &FinishRequest, levels: Option<usize>) -> Result<OpenFinish> {
    let open = |name: &String| open_network(name, request.denoiser, levels);
    let (model, network) = request.model.as_ref().map(open).transpose()?.unzip();
    let (finish, missing) = Finish::open(request.denoiser, network)?;
    Ok(OpenFinish { finish, model, missing })
}

fn open_network(name: &str, denoiser: DenoiserChoice, levels: Option<usize>) -> Result<(NetworkFacts, Network)> {
    let model = Model::open(name)?;
    let network = Network::load(&model, &find_runtime()?, rayon::current_num_threads())?;
    let facts = network.metadata();
    let of_finish = facts.form == OutputForm::Picture;
    if of_finish && denoiser == DenoiserChoice::None {
        let cause = format!("the network {name} reads the denoised picture, which --denoise none does not make");
        return Err(Error::usage(cause).hint("leave one of the two out"));
    }
    if let Some(levels) = levels.filter(|levels| *levels != facts.levels) {
        let cause = if of_finish {
            format!("the network {name} reads pictures of one level, not of {levels}")
        } else {
            format!("the network {name} combines {} levels, not {levels}", facts.levels)
        };
        let error = Error::usage(cause);
        return Err(error.hint(format!("leave --model out, or render with --levels {}", facts.levels)));
    }
    let facts = NetworkFacts { name: name.into(), hash: model.hash(), training: facts.training.clone() };
    Ok((facts, network))
}

fn find_runtime() -> Result<Runtime> {
    Runtime::find().map_err(|mut error| {
        let advice = "or leave --model out, and the network with it";
        error.hint = Some(error.hint.map_or(advice.into(), |hint| format!("{hint}; {advice}")));
        error
    })
}

impl OpenFinish {
    /// The denoiser and the network, to finish pictures with.
    pub fn finish(&mut self) -> &mut Finish {
        &mut self.finish
    }

    /// Chooses the quality of the denoiser for a render with a time limit, and returns the seconds that the choice has
    /// taken and the finish will take. Both follow from timing the denoiser on a small picture. The clock decides when
    /// the render ends and how well its one picture is denoised, nothing else.
    ///
    /// `limit`: seconds of the render; `pixels`: of the picture; `parts`: finished parts besides the picture.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn reserve_time(&mut self, limit: f64, pixels: usize, parts: usize) -> Result<f64> {
        let timing = Clock::start();
        let has_qualities = self.finish.has_qualities();
        let [loading, timed] = [LOADING_SIDE, TIMED_SIDE].map(|side| Size { width: side, height: side });
        let mut time = |run: &dyn Fn(&mut Finish, Size) -> Result<()>| -> Result<f64> {
            run(&mut self.finish, loading)?;
            let clock = Clock::start();
            run(&mut self.finish, timed)?;
            Ok(clock.seconds() * pixels as f64 / timed.pixels() as f64)
        };
        let guides = time(&|finish, size| finish.warm_up_guides(size))?;
        let network = time(&|finish, size| finish.warm_up_network(size))?;
        let mut time = |quality| time(&|finish, size| finish.warm_up(size, quality));
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
        let seconds = guides + 2.0 * (picture.1 + network) + fast * parts as f64;
        Ok((timing.seconds() + seconds).min(MAX_FINISH_SHARE * limit))
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
            "model_hash": self.model.as_ref().map(|network| &network.hash),
            "levels": finished.combined,
            "training": self.model.as_ref().map(|network| &network.training),
            "clamped": {"below_zero": finished.clamped.below_zero, "too_bright": finished.clamped.too_bright},
            "error_at_half": finished.error.map(|error| error.noise.max(0.0).sqrt()),
        })
    }
}
