//! A finish that is ready: the denoiser found, the network loaded, its time known.

use crate::combine::{Combiner, Model, Runtime};
use crate::error::{Error, Result};
use crate::film::LayerSet;
use crate::film::Size;
use crate::finish::{Denoiser, DenoiserChoice, Finish, Finished, Quality};
use crate::render::Clock;
use serde_json::{Value, json};

/// Share of a render's time that denoising the picture may take at more than the least quality.
const SHARE: f64 = 0.07;
/// Side of the picture by which the denoiser is timed.
const TIMED: usize = 192;
/// A finish is let to take no more of a render's time.
const MOST: f64 = 0.5;

/// How the estimate is to become the picture.
pub struct Order {
    /// What makes the denoised picture.
    pub denoiser: DenoiserChoice,
    /// The network that combines levels: a name that ships, or an ONNX file.
    pub model: Option<String>,
}

/// A finish that is ready, and the network that was named.
pub struct Ready {
    finish: Finish,
    model: Option<Network>,
    /// What is missing, where our own denoiser takes the place of the usual one.
    pub missing: Option<Error>,
}

/// Name and training of a network.
struct Network {
    name: String,
    training: String,
}

/// Finds the libraries and loads the network; the current rayon pool says how many threads they get. `levels`: as many
/// as the render will have.
///
/// # Errors
/// A library that was asked for by name is missing, or the network takes other levels.
pub fn open(order: &Order, levels: Option<usize>) -> Result<Ready> {
    let (denoiser, missing) = Denoiser::open(order.denoiser)?;
    let opened = order.model.as_deref().map(|name| open_network(name, levels)).transpose()?;
    let (model, combiner) = opened.unzip();
    Ok(Ready { finish: Finish::new(denoiser, combiner), model, missing })
}

/// A network that takes so many levels, if that is known.
fn open_network(name: &str, levels: Option<usize>) -> Result<(Network, Combiner)> {
    let model = Model::open(name)?;
    let runtime = Runtime::find().map_err(|mut error| {
        let advice = "or leave --model out: levels are not combined by the network then";
        error.hint = Some(error.hint.map_or(advice.into(), |hint| format!("{hint}; {advice}")));
        error
    })?;
    let combiner = Combiner::new(&model, &runtime)?;
    let facts = combiner.facts();
    if let Some(levels) = levels.filter(|levels| *levels != facts.levels) {
        let cause = format!("the network {name} combines {} levels, not {levels}", facts.levels);
        let error = Error::usage(cause);
        return Err(error.hint(format!("leave --model out, or render with --levels {}", facts.levels)));
    }
    let network = Network { name: name.into(), training: facts.training.clone() };
    Ok((network, combiner))
}

impl Ready {
    /// The finish itself.
    pub fn finish(&mut self) -> &mut Finish {
        &mut self.finish
    }

    /// Chooses the quality for a render that may take so many seconds, and returns how many of them the finish will
    /// take, with so many parts: by timing the denoiser on a small picture. This clock is a stop condition's: it
    /// decides when a render ends and how well its one picture is denoised, nothing else.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn reserve(&mut self, seconds: f64, pixels: usize, parts: usize) -> Result<f64> {
        let has_qualities = self.finish.has_qualities();
        let small = Size { width: TIMED, height: TIMED };
        let mut time = |quality: Quality| -> Result<f64> {
            // The first run loads what the second finds ready.
            self.finish.warm_up(small, quality)?;
            let clock = Clock::start();
            self.finish.warm_up(small, quality)?;
            Ok(clock.seconds() * pixels as f64 / small.pixels() as f64)
        };
        let fast = time(Quality::Fast)?;
        let mut picture = (Quality::Fast, fast);
        if has_qualities {
            for quality in [Quality::High, Quality::Balanced] {
                let seconds_taken = time(quality)?;
                if seconds_taken <= SHARE * seconds {
                    picture = (quality, seconds_taken);
                    break;
                }
            }
        }
        self.finish.quality = picture.0;
        // The picture, half of it for its error, and its parts.
        Ok((2.0 * picture.1 + fast * parts as f64).min(MOST * seconds))
    }

    /// Finishes a picture that is looked at for some seconds: the quickest way, without its error and its parts.
    ///
    /// # Errors
    /// See [`Finish::apply`].
    pub fn preview(&mut self, set: &mut LayerSet) -> Result<()> {
        let quality = std::mem::replace(&mut self.finish.quality, Quality::Fast);
        let applied = self.finish.apply(set, |_| false);
        self.finish.quality = quality;
        applied.map(|_| ())
    }

    /// The finish alone.
    pub fn into_finish(self) -> Finish {
        self.finish
    }

    /// For people.
    pub fn name(&self) -> String {
        let denoiser = self.finish.denoiser();
        match &self.model {
            Some(network) => format!("{}, {denoiser}", network.name),
            None => denoiser,
        }
    }

    /// What the header says of it.
    pub fn facts(&self, account: &Finished) -> Value {
        let quality = match self.finish.quality {
            Quality::High => "high",
            Quality::Balanced => "balanced",
            Quality::Fast => "fast",
        };
        json!({
            "denoiser": self.finish.denoiser(),
            "quality": quality,
            "model": self.model.as_ref().map(|network| &network.name),
            "levels": account.combined,
            "training": self.model.as_ref().map(|network| &network.training),
            "clamped": {"below_zero": account.clamped.below_zero, "too_bright": account.clamped.too_bright},
            "error_at_half": account.error.map(|error| error.noise.max(0.0).sqrt()),
        })
    }
}
