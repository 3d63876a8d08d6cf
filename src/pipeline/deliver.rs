//! The last step: from pixel sums to the layers and the header of the EXR, finished.

use super::facts::SceneFacts;
use super::finish::OpenFinish;
use super::layers;
use super::observer::{Event, Observer};
use super::request::Request;
use super::run::Iterated;
use super::shard::ShardSums;
use super::worst::{Visible, Worst};
use crate::error::{Error, Result};
use crate::estimator::PixelAccumulator;
use crate::film::{Layer, LayerSet, MOTION, Naming, Selection};
use crate::finish::{ERROR, Finished, FinishedError, reads};
use crate::image::SMOOTH_MATERIALS;
use crate::image::exr::{self, Attributes};
use crate::render::{Accuracy, CONFIDENCE, Clock, HistoryEntry, Rendered, TechniquePicture, cpu_seconds, peak_memory};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// Value of the header's key `error_of` if the stated error is that of the finished picture.
pub const FINISHED_PICTURE: &str = "finished picture";

/// A rendered picture with its layers and its header, ready to be written.
pub struct Delivery {
    /// The layers that the user asked for, finished. If the finish failed, the unfinished layers with all that a finish
    /// reads.
    pub set: LayerSet,
    /// Attributes of the EXR file, its JSON header included.
    pub attributes: Attributes,
    /// Pictures per sampling technique; empty unless the user asked for them.
    pub techniques: Vec<TechniquePicture>,
    /// Names of the network and the denoiser that have finished the picture; `None` if it is not finished.
    pub finished_by: Option<String>,
    /// Error of the finished picture, and the cost of halving it. `None` if the picture has no quarters (means over a
    /// quarter of the iterations).
    pub reached: Option<Reached>,
    /// The places of the picture where the error is largest, if known.
    pub worst: Option<Worst>,
    /// Seconds that making the layers and finishing the picture took.
    pub finish_seconds: f64,
    /// A warning if most of the error is light that hardly any photon has carried; `None` if not.
    pub unseen: Option<String>,
    /// Why the finish failed; `None` if it did not.
    pub finish_error: Option<Error>,
    /// Pixel sums for a merge, if the render is a shard.
    pub sums: Option<ShardSums>,
    /// Path of a checkpoint that is no longer needed once the picture is written.
    pub obsolete_checkpoint: Option<PathBuf>,
}

/// The layers of a delivered picture and the contents of its header.
pub(super) struct Contents<'a> {
    pub facts: &'a SceneFacts,
    pub selection: &'a Selection,
    pub naming: Naming,
    /// [`Head::scene`](super::checkpoint::Head::scene) and [`Head::plan`](super::checkpoint::Head::plan).
    pub scene: &'a str,
    pub plan: &'a Value,
    pub arguments: &'a Value,
    /// Whether the header leaves out clocks and the number of threads.
    pub reproducible: bool,
    /// Further keys and values of the header.
    pub more: Map<String, Value>,
    /// Whether the render is a shard, which keeps its pixel sums and may lack layers that the user asked for.
    pub is_shard: bool,
}

/// Delivers a render.
///
/// # Errors
/// The layers cannot be made. A finish that fails is no error: [`Delivery::finish_error`].
pub(super) fn deliver_render(
    request: &Request,
    Iterated { rendered, head, mut finish, obsolete_checkpoint }: Iterated,
    facts: SceneFacts,
    observer: &mut dyn Observer,
) -> Result<Delivery> {
    let part = rendered.settings.is_shard().then(|| rendered.shard_result());
    let contents = Contents {
        facts: &facts,
        selection: &request.layers,
        naming: request.naming,
        scene: &head.scene,
        plan: &head.plan,
        arguments: &request.arguments,
        reproducible: request.reproducible,
        more: Map::new(),
        is_shard: part.is_some(),
    };
    let (delivery, pixels) = deliver(contents, rendered, finish.as_mut(), Some(observer))?;
    let sums = part.map(|part| ShardSums { head, facts, part, pixels });
    Ok(Delivery { sums, obsolete_checkpoint, ..delivery })
}

/// Makes the layers of a render, finishes them and writes the header. Returns also the pixel sums of a shard.
///
/// # Errors
/// Errors of [`deliver_render`].
pub(super) fn deliver(
    contents: Contents<'_>,
    rendered: Rendered,
    finish: Option<&mut OpenFinish>,
    observer: Option<&mut dyn Observer>,
) -> Result<(Delivery, Vec<PixelAccumulator>)> {
    let finishes = finish.is_some();
    let mut header = contents.header(&rendered);
    let (error, unseen, settings) = (rendered.error.relative(), rendered.error.unseen, rendered.settings.clone());
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let (mut layers, pixels) = Layers::make(&contents, rendered, finishes)?;
    observer.filter(|_| finishes).map_or(Ok(()), |observer| layers.send_estimate(&header, observer))?;
    let finished = finish.map(|finish| layers.finish(finish, contents.selection, unseen.squared)).transpose();
    let finish_seconds = clock.seconds();
    let (finished, finish_error) = finished.map_or_else(|error| (None, Some(error)), |finished| (finished, None));
    let reached = finished.as_ref().and_then(|finished| Reached::of(layers.history, finished.error));
    let error = reached.as_ref().map(Reached::error).or(error);
    let unseen = unseen.sentence(&settings).filter(|_| error.is_some_and(|error| unseen.dominates(error)));
    let set = contents.select(layers.set, finishes, finish_error.is_some())?;
    contents.complete_header(&mut header, finished.as_ref(), reached.as_ref(), unseen.as_ref());
    contents.add_costs(&mut header, cpu_seconds() - cpu_start);
    let (mut attributes, techniques) = (layers.attributes, layers.techniques);
    attributes.insert(exr::ATTRIBUTE, &header)?;
    let (finished_by, worst) = finished.map(|finished| (finished.name, finished.worst)).unzip();
    let (worst, sums, obsolete_checkpoint) = (worst.flatten(), None, None);
    let picture = Delivery {
        set,
        attributes,
        techniques,
        finished_by,
        reached,
        worst,
        finish_seconds,
        unseen,
        finish_error,
        sums,
        obsolete_checkpoint,
    };
    Ok((picture, pixels))
}

impl Contents<'_> {
    /// The header of the picture before it is finished.
    fn header(&self, rendered: &Rendered) -> Map<String, Value> {
        let mut header = rendered.header((!self.reproducible).then_some(rayon::current_num_threads()));
        let rejections = rendered.rejections();
        let rejected = rejections.sentence().filter(|_| rejections.are_too_many());
        let warnings: Vec<&String> = self.facts.warnings.iter().chain(&rejected).collect();
        header.extend((!self.scene.is_empty()).then(|| ("scene_hash".to_owned(), self.scene.into())));
        header.insert("plan".into(), self.plan.clone());
        header.insert("arguments".into(), self.arguments.clone());
        header.insert("warnings".into(), json!(warnings));
        header.insert(SMOOTH_MATERIALS.into(), json!(self.facts.names.smooth));
        header.extend(self.facts.made_for.frame.map(|frame| ("frame".to_owned(), frame.into())));
        header.extend(self.facts.made_for.frame_rate.map(|rate| ("frame_rate".to_owned(), json!(rate))));
        header.extend(self.facts.made_for.exposure.map(|exposure| ("exposure".to_owned(), json!(exposure))));
        header.extend(self.facts.made_for.tonemap.map(|curve| ("tonemap".to_owned(), json!(curve))));
        header.extend(self.facts.made_for.contrast.map(|contrast| ("contrast".to_owned(), json!(contrast))));
        header.insert("error_of".into(), "Noisy".into());
        header
    }

    /// Adds the results of the finish to the header. `unseen`: a warning.
    fn complete_header(
        &self,
        header: &mut Map<String, Value>,
        finished: Option<&FinishedPicture>,
        reached: Option<&Reached>,
        unseen: Option<&String>,
    ) {
        if let (Some(sentence), Some(Value::Array(warnings))) = (unseen, header.get_mut("warnings")) {
            warnings.push(sentence.as_str().into());
        }
        if let Some(reached) = reached {
            reached.write(header, self.reproducible);
        }
        let worst = finished.and_then(|finished| finished.worst.as_ref());
        header.extend(worst.map(|worst| ("worst".to_owned(), json!(worst))));
        header.insert("combined".into(), finished.map_or(Value::Null, |finished| finished.header.clone()));
        header.extend(self.more.clone());
    }

    /// Adds the core-seconds of the layers and their finish to the header, unless it leaves out clocks.
    fn add_costs(&self, header: &mut Map<String, Value>, core_seconds: f64) {
        if self.reproducible {
            return;
        }
        if let Some(Value::Object(phases)) = header.get_mut("phases") {
            phases.insert("layers_and_finish".into(), core_seconds.into());
        }
        header.insert("peak_memory".into(), peak_memory().into());
    }

    /// Selects the layers that the user asked for. A render that is still to be finished keeps all that a finish reads.
    fn select(&self, mut set: LayerSet, finishes: bool, failed: bool) -> Result<LayerSet> {
        layers::add_black(self.selection, &self.facts.shape, finishes, &mut set)?;
        if self.is_shard {
            set.layers.retain(|layer| self.selection.wants(&layer.name));
        } else if !failed {
            set = self.selection.apply(set)?;
        }
        Ok(set)
    }
}

/// The layers of a render, with its technique pictures, its error history and the objects in its pixels.
struct Layers {
    set: LayerSet,
    attributes: Attributes,
    techniques: Vec<TechniquePicture>,
    history: Vec<HistoryEntry>,
    visible: Visible,
}

/// The result of finishing a picture: names of network and denoiser, the header's key `combined`, and the error.
struct FinishedPicture {
    name: String,
    header: Value,
    error: Option<FinishedError>,
    worst: Option<Worst>,
}

impl Layers {
    /// Makes the layers that the user asked for, and those that a finish reads. Returns also the pixel sums of a shard;
    /// other pixel sums are freed, because they are most of the memory.
    fn make(
        contents: &Contents<'_>,
        mut rendered: Rendered,
        finishes: bool,
    ) -> Result<(Layers, Vec<PixelAccumulator>)> {
        let Contents { facts, selection, naming, .. } = contents;
        let wanted = |name: &str| selection.wants(name) || name.is_empty() || (finishes && reads(name));
        let mut set = rendered.layers(&facts.shape, wanted)?;
        let mut attributes = layers::add_cryptomattes(&facts.names, &rendered, selection, *naming, &mut set)?;
        if let Some(motion) = facts.motion.as_ref().filter(|_| selection.wants(MOTION)) {
            set.push(Layer::interleaved(MOTION, "XYZW", motion.iter().copied()))?;
        }
        attributes.frame = Some(facts.frame);
        attributes.moment = exr::Moment { number: facts.made_for.frame, rate: facts.made_for.frame_rate };
        let techniques = std::mem::take(&mut rendered.techniques);
        let history = std::mem::take(&mut rendered.stats.history);
        let visible = if finishes { Visible::of(&rendered.pixels, &facts.names) } else { Visible::default() };
        let pixels = if contents.is_shard { rendered.pixels } else { Vec::new() };
        Ok((Layers { set, attributes, techniques, history, visible }, pixels))
    }

    /// Sends the unfinished layers, with all that a finish reads, to the observer.
    fn send_estimate(&self, header: &Map<String, Value>, observer: &mut dyn Observer) -> Result<()> {
        let mut attributes = self.attributes.clone();
        attributes.insert(exr::ATTRIBUTE, header)?;
        observer.event(Event::Estimated { set: &self.set, attributes: &attributes });
        Ok(())
    }

    /// Finishes the picture. `unseen`: squared relative error by light that hardly any photon has carried.
    fn finish(&mut self, finish: &mut OpenFinish, selection: &Selection, unseen: f64) -> Result<FinishedPicture> {
        let mut finished = finish.finish().apply(&mut self.set, |name| name == ERROR || selection.wants(name))?;
        finished.error = finished.error.map(|error| FinishedError { unseen, ..error });
        let worst = finished.error_map.take();
        let worst = worst.map(|map| Worst::of(&map.squared(), &map.weight, &self.set, &self.visible));
        Ok(FinishedPicture { name: finish.name(), header: finish.header(&finished), error: finished.error, worst })
    }
}

/// The error that a finished picture has reached, and how it falls with more iterations.
pub struct Reached {
    accuracy: Accuracy,
    /// The error history of the render, of which the last moment holds the error of the delivered picture.
    history: Vec<HistoryEntry>,
    last: HistoryEntry,
}

impl Reached {
    /// Adds `error`, the error of the finished picture, to the history. Returns `None` if the history has no error of
    /// finished pictures.
    fn of(mut history: Vec<HistoryEntry>, error: Option<FinishedError>) -> Option<Reached> {
        let last = history.last_mut()?;
        if error.is_some() {
            last.finished = error;
        }
        let last = *last;
        Some(Reached { accuracy: Accuracy::fit(&history)?, history, last })
    }

    /// Estimated relative error of the finished picture: the root of relMSE, without the worst 0.5 % of the pixels.
    pub fn error(&self) -> f64 {
        self.accuracy.error(self.last.iterations)
    }

    /// Bounds of the relative error, which hold for a share [`CONFIDENCE`] of all renders.
    pub fn interval(&self) -> [f64; 2] {
        self.accuracy.interval(self.last.iterations)
    }

    /// Share of the noise that a few bright samples hold, 0 to 1.
    pub fn rare(&self) -> f64 {
        self.accuracy.rare
    }

    /// Additional iterations after which the error is half of what it is; `None` if bias forbids it.
    fn iterations_to_half(&self) -> Option<f64> {
        let iterations = self.accuracy.iterations_to(0.5 * self.error())?;
        Some(iterations - self.last.iterations as f64)
    }

    /// Additional seconds after which the error is half of what it is; `None` if bias forbids it.
    pub fn seconds_to_half(&self) -> Option<f64> {
        Some(self.iterations_to_half()? * self.pace(|moment| moment.seconds))
    }

    /// Mean cost of an iteration, in the unit of `spent`. A pilot precedes the first moment of the history and is not
    /// repeated, so it does not count if the history has two moments.
    fn pace(&self, spent: impl Fn(&HistoryEntry) -> f64) -> f64 {
        let (first, last) = (self.history.first().unwrap_or(&self.last), &self.last);
        match last.iterations.saturating_sub(first.iterations) {
            0 => spent(last) / last.iterations.max(1) as f64,
            iterations => (spent(last) - spent(first)) / iterations as f64,
        }
    }

    /// Writes the error of the finished picture to the header, in place of the error of the estimate.
    fn write(&self, header: &mut Map<String, Value>, reproducible: bool) {
        let estimated = header.insert("error".into(), self.error().into());
        let before = header.insert("error_of".into(), FINISHED_PICTURE.into());
        if let Some(noisy) = estimated.filter(|_| before.is_none_or(|of| of != FINISHED_PICTURE)) {
            header.insert("error_noisy".into(), noisy);
        }
        let mut halving = json!({"error": 0.5 * self.error()});
        if let Some(more) = self.iterations_to_half() {
            halving["iterations"] = more.ceil().into();
            if !reproducible {
                halving["seconds"] = (more * self.pace(|moment| moment.seconds)).into();
                halving["core_seconds"] = (more * self.pace(|moment| moment.cpu_seconds)).into();
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
            // A picture that is finished again keeps the errors that earlier moments had.
            if moment.finished.is_some() || entry.get("finished").is_none() {
                entry["finished"] = moment.finished.map(|_| self.accuracy.error(moment.iterations)).into();
            }
        }
    }
}

/// Writes the finish of a picture that was rendered before to its header: the key `combined`, and the picture's error if it
/// has quarters.
pub fn write_finish(header: &mut Value, finish: &OpenFinish, finished: &Finished) {
    header["combined"] = finish.header(finished);
    if let Some(header) = header.as_object_mut() {
        write_error(header, finished);
    }
}

fn write_error(header: &mut Map<String, Value>, finished: &Finished) {
    let iterations = header.get("iterations").and_then(Value::as_u64).unwrap_or(1).max(1);
    let moments = header.get("history").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let timed = moments.last().is_some_and(|last| last.get("seconds").is_some_and(Value::is_number));
    let entry = |moment: &Value| HistoryEntry {
        seconds: moment["seconds"].as_f64().unwrap_or(0.0),
        cpu_seconds: moment["cpu_seconds"].as_f64().unwrap_or(0.0),
        iterations: moment["iterations"].as_u64().unwrap_or(iterations),
        light_paths: 0,
        estimate: None,
        finished: None,
    };
    let mut history: Vec<HistoryEntry> = moments.iter().map(entry).collect();
    if history.is_empty() {
        history.push(entry(&Value::Null));
    }
    let unseen = header.get("unseen").and_then(|unseen| unseen.get("error")).and_then(Value::as_f64).unwrap_or(0.0);
    let error = finished.error.map(|error| FinishedError { unseen: unseen * unseen, ..error });
    if let Some(reached) = Reached::of(history, error) {
        reached.write(header, !timed);
    }
}

/// The header of a stored picture that will be finished anew. It has no error of the picture that it was finished to, and
/// the layers lose theirs, because a finish without quarters does not replace it.
pub fn header_to_finish(attributes: &Attributes, set: &mut LayerSet) -> Value {
    let mut header = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
    if header["error_of"] == FINISHED_PICTURE
        && let Some(header) = header.as_object_mut()
    {
        set.layers.retain(|layer| layer.name != ERROR);
        header.remove("accuracy");
        header.remove("worst");
        let noisy = header.remove("error_noisy").unwrap_or(Value::Null);
        header.insert("error".into(), noisy);
        header.insert("error_of".into(), "Noisy".into());
    }
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Halving the error costs more iterations, and no second pilot.
    #[test]
    fn halving_costs_iterations_alone() {
        let moment = |iterations: u64, seconds: f64, finished: Option<FinishedError>| HistoryEntry {
            seconds,
            cpu_seconds: 2.0 * seconds,
            iterations,
            light_paths: 0,
            estimate: None,
            finished,
        };
        let error = FinishedError { noise: 0.01, deviation: 1e-6, bias: 0.0, rare: 0.0, unseen: 0.0 };
        for (history, pace) in [
            (vec![moment(1, 10.0, None), moment(101, 110.0, Some(error))], 1.0),
            (vec![moment(50, 100.0, Some(error))], 2.0),
        ] {
            let reached = Reached::of(history, Some(error)).expect("there is an error");
            let iterations = reached.iterations_to_half().expect("there is no bias");
            assert!((reached.seconds_to_half().expect("as before") / (pace * iterations) - 1.0).abs() < 1e-9);
            let mut header = Map::new();
            reached.write(&mut header, false);
            let core_seconds = header["accuracy"]["halving"]["core_seconds"].as_f64().expect("it is stated");
            assert!((core_seconds / (2.0 * pace * iterations) - 1.0).abs() < 1e-9);
        }
    }
}
