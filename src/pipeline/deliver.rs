//! From pixels to what is written: layers, finished, and the header that tells of all.

use super::facts::Facts;
use super::layers;
use super::worst::{Seen, Worst};
use super::{Ready, Watch};
use crate::error::{Error, Result};
use crate::estimator::PixelAccumulator;
use crate::film::{LayerSet, Naming, Selection};
use crate::finish::{ERROR, Finished, FinishedError, reads};
use crate::image::exr::{self, Attributes};
use crate::render::{Accuracy, CONFIDENCE, Clock, HistoryEntry, Rendered, TechniquePicture, cpu_seconds, peak_memory};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// What an error is of, where it is not the estimate's (the header's `error_of`).
pub const FINISHED_PICTURE: &str = "finished picture";

/// A picture with its layers and its header.
pub struct Delivery {
    /// The layers that were asked for, finished; unfinished with what a finish reads, where that failed.
    pub set: LayerSet,
    /// The header's attributes.
    pub attributes: Attributes,
    /// Pictures per sampling technique, if they were asked for.
    pub techniques: Vec<TechniquePicture>,
    /// What finished the picture, and what it did.
    pub finished: Option<(String, Finished)>,
    /// The error of the finished picture and what half of it costs, where its quarters tell.
    pub reached: Option<Reached>,
    /// Where that error is.
    pub worst: Option<Worst>,
    /// Seconds from the last iteration to here.
    pub finishing: f64,
    /// Which light photons have hardly brought, where that is most of the error.
    pub unseen: Option<String>,
    /// Why the picture is not finished, though that was asked for.
    pub refusal: Option<Error>,
    /// What other shards are joined with, where this is one.
    pub tail: Option<super::shard::Tail>,
    /// Checkpoint that is no longer needed once the picture is written.
    pub spent_checkpoint: Option<PathBuf>,
}

/// How a picture is written, and what is told of it.
pub(super) struct Writing<'a> {
    pub facts: &'a Facts,
    pub selection: &'a Selection,
    pub naming: Naming,
    pub plan: &'a Value,
    pub arguments: &'a Value,
    /// Leave clocks and the number of threads out of the header.
    pub reproducible: bool,
    /// What else the header is to tell.
    pub more: Map<String, Value>,
}

/// Makes the layers that were asked for, and finishes them; `watch` sees them before that. Returns the pixels, if they
/// are to be kept.
pub(super) fn deliver(
    writing: Writing<'_>,
    mut rendered: Rendered,
    (ready, watch): (Option<&mut Ready>, Option<&mut dyn Watch>),
    keep: bool,
) -> Result<(Delivery, Vec<PixelAccumulator>)> {
    let Writing { facts, selection, naming, plan, arguments, reproducible, more } = writing;
    let mut header = rendered.header((!reproducible).then_some(rayon::current_num_threads()));
    let (rejections, unseen) = (rendered.rejections(), rendered.error.unseen);
    let of_estimate = rendered.error.relative();
    let settings = rendered.settings.clone();
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let finishes = ready.is_some();
    let wanted = |name: &str| selection.wants(name) || name.is_empty() || (finishes && reads(name));
    let mut set = rendered.layers(&facts.shape, wanted)?;
    let mut attributes = layers::cryptomattes(&facts.named, &rendered, selection, naming, &mut set)?;
    attributes.frame = Some(facts.frame);
    attributes.moment = exr::Moment { number: facts.made_for.frame, rate: facts.made_for.frame_rate };
    let techniques = std::mem::take(&mut rendered.techniques);
    let history = std::mem::take(&mut rendered.stats.history);
    let seen = if finishes { Seen::of(&rendered.pixels, &facts.named) } else { Seen::default() };
    // The pixels are most of the memory, and all that is wanted of them is in the layers.
    let pixels = if keep { rendered.pixels } else { Vec::new() };
    header.insert("plan".into(), plan.clone());
    header.insert("arguments".into(), arguments.clone());
    let rejected = rejections.sentence().filter(|_| rejections.are_too_many());
    let mut warnings: Vec<&String> = facts.warnings.iter().chain(&rejected).collect();
    header.insert("warnings".into(), json!(warnings));
    if let Some(number) = facts.made_for.frame {
        header.insert("frame".into(), number.into());
    }
    if let Some(rate) = facts.made_for.frame_rate {
        header.insert("frame_rate".into(), json!(rate));
    }
    header.insert("error_of".into(), "Noisy".into());
    if let (Some(watch), true) = (watch, finishes) {
        let mut attributes = attributes.clone();
        attributes.insert(exr::ATTRIBUTE, &header)?;
        watch.estimated(&set, &attributes);
    }
    let applied = ready.map(|ready| {
        let mut account = ready.finish().apply(&mut set, |name| name == ERROR || selection.wants(name))?;
        account.error = account.error.map(|error| FinishedError { unseen: unseen.squared, ..error });
        Ok((ready.name(), ready.facts(&account), account))
    });
    let finishing = clock.seconds();
    let (mut finished, refusal) = match applied.transpose() {
        Ok(finished) => (finished, None),
        Err(error) => (None, Some(error)),
    };
    let of_finished = finished.as_ref().and_then(|(_, _, account)| Reached::of(history, account.error));
    let error = of_finished.as_ref().map(Reached::error).or(of_estimate);
    let unseen = unseen.sentence(&settings).filter(|_| error.is_some_and(|error| unseen.dominates(error)));
    if let Some(sentence) = &unseen {
        warnings.push(sentence);
        header.insert("warnings".into(), json!(warnings));
    }
    let errors = finished.as_mut().and_then(|(_, _, account)| account.error_map.take());
    let worst = errors.map(|errors| Worst::of(&errors.squared(), &errors.weight, &set, &seen));
    layers::add_dark(selection, &facts.shape, finishes, &mut set)?;
    // A render that is still to be finished keeps what that reads, and a shard has what it can have.
    if keep {
        set.layers.retain(|layer| selection.wants(&layer.name));
    } else if refusal.is_none() {
        set = selection.apply(set)?;
    }
    if let Some(reached) = &of_finished {
        reached.tell(&mut header, reproducible);
    }
    if let Some(worst) = &worst {
        header.insert("worst".into(), json!(worst));
    }
    header.insert("combined".into(), finished.as_ref().map_or(Value::Null, |(_, facts, _)| facts.clone()));
    header.extend(more);
    if !reproducible {
        add_costs(&mut header, cpu_seconds() - cpu_start);
    }
    attributes.insert(exr::ATTRIBUTE, &header)?;
    let finished = finished.map(|(name, _, account)| (name, account));
    let reached = of_finished;
    let (tail, spent_checkpoint) = (None, None);
    let delivery = Delivery {
        set,
        attributes,
        techniques,
        finished,
        reached,
        worst,
        finishing,
        unseen,
        refusal,
        tail,
        spent_checkpoint,
    };
    Ok((delivery, pixels))
}

/// How far a render has come.
pub struct Reached {
    accuracy: Accuracy,
    /// The last moment judged with the picture as it is.
    history: Vec<HistoryEntry>,
    last: HistoryEntry,
}

impl Reached {
    /// By a history and what the finish has told at its end; `None` where nothing is known.
    fn of(mut history: Vec<HistoryEntry>, error: Option<FinishedError>) -> Option<Reached> {
        let last = history.last_mut()?;
        if error.is_some() {
            last.finished = error;
        }
        let last = *last;
        Some(Reached { accuracy: Accuracy::of(&history)?, history, last })
    }

    /// Estimated relative error of the finished picture: the root of relMSE, trimmed of the worst half per cent of the
    /// pixels.
    pub fn error(&self) -> f64 {
        self.accuracy.error(self.last.iterations)
    }

    /// Between what that lies in [`CONFIDENCE`] of all pictures.
    pub fn interval(&self) -> [f64; 2] {
        self.accuracy.interval(self.last.iterations)
    }

    /// Share of the noise that few bright samples hold, 0 to 1.
    pub fn rare(&self) -> f64 {
        self.accuracy.rare
    }

    /// How many times what the render has cost half of the error costs beside it; `None` where bias forbids it.
    pub fn halving(&self) -> Option<f64> {
        let iterations = self.accuracy.iterations_to(0.5 * self.error())?;
        Some(iterations / self.last.iterations as f64 - 1.0)
    }

    /// Seconds for half of the error, on top of those that the render has taken.
    pub fn seconds_to_half(&self) -> Option<f64> {
        Some(self.halving()? * self.last.seconds)
    }

    /// In place of the estimate's error, in the header.
    fn tell(&self, header: &mut Map<String, Value>, reproducible: bool) {
        if let Some(noisy) = header.insert("error".into(), self.error().into()) {
            header.insert("error_noisy".into(), noisy);
        }
        header.insert("error_of".into(), FINISHED_PICTURE.into());
        let mut halving = json!({"error": 0.5 * self.error()});
        if let Some(more) = self.halving() {
            halving["iterations"] = (more * self.last.iterations as f64).ceil().into();
            if !reproducible {
                halving["seconds"] = (more * self.last.seconds).into();
                halving["core_seconds"] = (more * self.last.cpu_seconds).into();
            }
        }
        let metric = "root of relMSE, trimmed of the worst 0.5 % of the pixels";
        let accuracy = json!({
            "metric": metric,
            "interval": self.interval(),
            "confidence": CONFIDENCE,
            "rare": self.rare(),
            "unseen": self.accuracy.squared_unseen.sqrt(),
            "bias": self.accuracy.squared_bias.sqrt(),
            "exponent": self.accuracy.exponent,
            "halving": halving,
        });
        header.insert("accuracy".into(), accuracy);
        let moments = header.get_mut("history").and_then(Value::as_array_mut).into_iter().flatten();
        for (entry, moment) in moments.zip(&self.history) {
            entry["finished"] = moment.finished.map(|_| self.accuracy.error(moment.iterations)).into();
        }
    }
}

/// What the finish of a stored picture has told of its error, in its header; nothing where the picture has no quarters.
pub fn tell_stored(header: &mut Map<String, Value>, account: &Finished) {
    let iterations = header.get("iterations").and_then(Value::as_u64).unwrap_or(1).max(1);
    let last = header.get("history").and_then(Value::as_array).and_then(|moments| moments.last());
    let number = |key: &str| last.and_then(|last| last.get(key)).and_then(Value::as_f64);
    let timed = number("seconds").is_some();
    let unseen = header.get("unseen").and_then(|unseen| unseen.get("error")).and_then(Value::as_f64).unwrap_or(0.0);
    let error = account.error.map(|error| FinishedError { unseen: unseen * unseen, ..error });
    let history = HistoryEntry {
        seconds: number("seconds").unwrap_or(0.0),
        cpu_seconds: number("cpu_seconds").unwrap_or(0.0),
        iterations,
        light_paths: 0,
        estimate: None,
        finished: error,
    };
    if let Some(reached) = Reached::of(vec![history], error) {
        reached.tell(header, !timed);
    }
}

/// What the layers and their finish have cost.
fn add_costs(header: &mut Map<String, Value>, core_seconds: f64) {
    if let Some(Value::Object(phases)) = header.get_mut("phases") {
        phases.insert("layers_and_finish".into(), core_seconds.into());
    }
    header.insert("peak_memory".into(), peak_memory().into());
}
