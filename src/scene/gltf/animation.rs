//! Applies an animation at one time: the values of its curves are written into the document before the rest is read
//! (specification, section 3.11; KHR_animation_pointer).
//!
//! All animations of a file play together, because exporters write one for each action or track. Frame N is at N / rate
//! seconds, as in Blender's exporter.

use super::container::{self, malformed};
use super::curve::{Curve, Sampler};
use super::document::{Document, get, named};
use super::extras::{self, SceneExtras};
use super::pointer::{self, PointerError};
use super::{FrameTime, ReadOptions, fault, instant};
use crate::error::{Error, Result};
use serde::Deserialize;
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// Frames per second if neither the scene nor the user sets a rate: the default of Blender and of film.
const DEFAULT_RATE: f64 = 24.0;

#[derive(Deserialize)]
struct Animation {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    channels: Vec<Channel>,
    #[serde(default)]
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct Channel {
    sampler: usize,
    target: Value,
}

/// Stands for the time of the first key, where only the frame rate matters.
const FIRST: FrameTime = FrameTime { number: 0, rate: None, of_sequence: false };

/// A value of the document that an animation changes, and its curve over time.
struct Track {
    /// JSON pointer to the value in the document.
    pointer: String,
    /// Name of the animation and index of the channel, for messages.
    place: String,
    curve: Curve,
}

/// The animations of a document, and the frame at which it is read.
pub(super) struct Tracks {
    list: Vec<Track>,
    /// The frame to read; `None`: the time of the first key. If the scene states the time of its only frame, that time
    /// is read.
    frame: Option<FrameTime>,
    /// Time after the frame (frames) that is read as the frame: that of a shutter which opens and closes at once.
    instant: f64,
}

impl Tracks {
    /// Reads the animations of a document. Without a frame, invalid animations are skipped with a warning.
    ///
    /// # Errors
    /// A frame is given, and an animation is invalid.
    pub(super) fn read(document: &Document, options: &ReadOptions, warnings: &mut Vec<String>) -> Result<Tracks> {
        let frame = options.frame;
        let list = tracks(document, FaultPolicy { fatal: frame.is_some() }, warnings)?;
        if list.is_empty() && frame.is_some_and(|frame| !frame.of_sequence) {
            warnings.push("nothing in the scene is animated: its frames are all the same".into());
        }
        let own = if list.is_empty() { None } else { scene_extras(document)?.shutter };
        Ok(Tracks { list, frame, instant: instant(options.shutter.or(own)) })
    }

    /// Whether every frame has the same values.
    ///
    /// # Errors
    /// The keys of the scene are malformed.
    pub(super) fn are_still(&self, document: &Document) -> Result<bool> {
        Ok(scene_extras(document)?.time.is_some() || self.list.iter().all(|track| track.curve.is_constant()))
    }

    /// Whether nothing is animated.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Writes the animated values into the document, `after_frame` frames after the frame to read.
    ///
    /// # Errors
    /// A frame is given, and an animation changes a value that does not exist.
    pub(super) fn apply(&self, document: &mut Document, after_frame: f64, warnings: &mut Vec<String>) -> Result<()> {
        let Some(start) = self.list.iter().map(|track| track.curve.start()).min_by(f64::total_cmp) else {
            return Ok(());
        };
        let after_frame = self.instant + after_frame;
        let time = match (scene_extras(document)?.time, self.frame) {
            (Some(time), frame) => {
                if frame.is_some_and(|frame| !frame.of_sequence) {
                    warnings.push("its animations are the motion of one frame: its frames are all the same".into());
                }
                later(document, time, after_frame, frame, warnings)?
            }
            (None, Some(frame)) => (f64::from(frame.number) + after_frame) / rate(document, frame, warnings)?,
            (None, None) => {
                warnings.push(format!("its animations begin at {start:.3} s, which is rendered (--frames chooses)"));
                later(document, start, after_frame, None, warnings)?
            }
        };
        let faults = FaultPolicy { fatal: self.frame.is_some() };
        for Track { pointer, place, curve } in &self.list {
            let rotation = pointer.starts_with("/nodes/") && pointer.ends_with("/rotation");
            match pointer::put(&mut document.raw, pointer, &curve.value_at(time, rotation), container::is_supported) {
                Ok(()) => {}
                Err(PointerError::Missing) => {
                    let cause = format!("it moves {pointer}, which does not exist");
                    faults.handle(fault(place, cause).hint("the file is damaged: export it again"), warnings)?;
                }
                Err(PointerError::Unread) => {
                    warnings.push(format!("{place}: it moves {pointer}, which cannot be animated: it is ignored"));
                }
            }
        }
        document.reparse_animated()
    }

    /// The parts of the document that the animations change.
    pub(super) fn moving_parts(&self) -> MovingParts {
        let mut parts = MovingParts::default();
        for Track { pointer, .. } in &self.list {
            let mut words = pointer.split('/').skip(1);
            let list = words.next().unwrap_or_default();
            let index = words.next().and_then(|word| word.parse().ok());
            match (list, index) {
                ("nodes", Some(node)) if words.next() == Some("weights") => drop(parts.meshes_of_nodes.insert(node)),
                ("nodes", Some(node)) => drop(parts.nodes.insert(node)),
                ("meshes", Some(mesh)) => drop(parts.meshes.insert(mesh)),
                ("materials", index) => {
                    parts.materials = true;
                    let emits = ["/emissiveFactor", "/emissiveStrength"].iter().any(|key| pointer.ends_with(key));
                    parts.emissions.extend(index.filter(|_| emits));
                }
                _ => {}
            }
        }
        parts
    }
}

/// The parts of a document that its animations change.
#[derive(Default)]
pub(super) struct MovingParts {
    /// Indices of the nodes whose transforms or other values change.
    nodes: HashSet<usize>,
    /// Indices of the nodes whose morph weights change.
    meshes_of_nodes: HashSet<usize>,
    /// Indices of the meshes whose morph weights change.
    meshes: HashSet<usize>,
    /// Whether any material changes.
    pub(super) materials: bool,
    /// Indices of the materials whose surfaces change the light that they emit.
    pub(super) emissions: HashSet<usize>,
}

impl MovingParts {
    /// Whether animations change values of the node `node` itself, such as its transform.
    pub(super) fn moves(&self, node: usize) -> bool {
        self.nodes.contains(&node)
    }

    /// Whether the shape of the mesh `mesh` at the node `node` changes; `skinned`: the node has a skin, whose joints may
    /// move.
    pub(super) fn deforms(&self, mesh: usize, node: usize, skinned: bool) -> bool {
        self.meshes.contains(&mesh) || self.meshes_of_nodes.contains(&node) || (skinned && !self.nodes.is_empty())
    }
}

/// Treatment of invalid animations: as errors or as warnings.
#[derive(Clone, Copy)]
struct FaultPolicy {
    /// Whether invalid animations are errors, not warnings.
    fatal: bool,
}

impl FaultPolicy {
    /// Returns the error about an invalid animation, or turns it into a warning.
    fn handle(self, error: Error, warnings: &mut Vec<String>) -> Result<()> {
        if self.fatal {
            return Err(error);
        }
        warnings.push(format!("{error}; it is ignored (--frames would reject the file)"));
        Ok(())
    }
}

/// The time `frames` frames after `start` (seconds).
fn later(
    document: &Document,
    start: f64,
    frames: f64,
    frame: Option<FrameTime>,
    warnings: &mut Vec<String>,
) -> Result<f64> {
    if frames == 0.0 {
        return Ok(start);
    }
    Ok(start + frames / rate(document, frame.unwrap_or(FIRST), warnings)?)
}

fn scene_extras(document: &Document) -> Result<SceneExtras> {
    let index = document.scene_index()?;
    let raw = document.part("scenes", index);
    extras::read(raw, &named("scene", raw["name"].as_str(), index))
}

/// Frames per second: the scene's rate, else that of `frame`, else the default.
fn rate(document: &Document, frame: FrameTime, warnings: &mut Vec<String>) -> Result<f64> {
    let extras = scene_extras(document)?;
    let is_valid = |rate: &f64| rate.is_finite() && *rate > 0.0;
    // The reader of the scene's extras rejects an invalid rate.
    let rate = extras.frame_rate.map(|rate| {
        let [frames, seconds] = rate.fraction().map(f64::from);
        frames / seconds
    });
    Ok(rate.filter(is_valid).or(frame.rate.filter(is_valid)).unwrap_or_else(|| {
        warnings.push(format!(
            "the file has no frame rate: {DEFAULT_RATE} frames per second are assumed (--frame-rate sets them)"
        ));
        DEFAULT_RATE
    }))
}

/// The animated values of all animations. If several animations change one value, the first one does.
fn tracks(document: &Document, faults: FaultPolicy, warnings: &mut Vec<String>) -> Result<Vec<Track>> {
    let list = document.raw["animations"].as_array().map_or(&[][..], Vec::as_slice);
    // The name of the animation that moves each pointer.
    let mut movers: HashMap<String, String> = HashMap::new();
    let mut tracks = Vec::new();
    for (i, raw) in list.iter().enumerate().filter(|(i, _)| document.playing.plays(*i)) {
        let animation = match Animation::deserialize(raw) {
            Ok(animation) => animation,
            Err(e) => {
                faults.handle(malformed(format!("animation {i}"), &e), warnings)?;
                continue;
            }
        };
        let name = named("animation", animation.name.as_deref(), i);
        for (k, channel) in animation.channels.iter().enumerate() {
            let place = format!("{name}, channel {k}");
            let pointer = match target(document, &channel.target) {
                Ok(Some(pointer)) => pointer,
                Ok(None) => {
                    warnings.push(format!("{place}: it names nothing that moves, and is ignored"));
                    continue;
                }
                Err(e) => {
                    faults.handle(e.within(&place), warnings)?;
                    continue;
                }
            };
            match movers.get(&pointer) {
                Some(first) if *first == name => {
                    let error = fault(&place, format!("it moves {pointer}, as another of its channels does"));
                    faults.handle(error, warnings)?;
                    continue;
                }
                Some(first) => {
                    let both = format!("{first} and {name} move the same value: {first} is used");
                    warnings.push(format!("{both} (--animation chooses one)"));
                    continue;
                }
                None => movers.insert(pointer.clone(), name.clone()),
            };
            match curve(document, &animation.samplers, channel.sampler, &pointer) {
                Ok(curve) => tracks.push(Track { curve, pointer, place }),
                Err(e) => faults.handle(e.within(&place), warnings)?,
            }
        }
    }
    Ok(tracks)
}

/// Reads the curve of an animation channel, sampler `index`, and checks that its values have the number of components
/// that the value at `pointer` needs.
fn curve(document: &Document, samplers: &[Sampler], index: usize, pointer: &str) -> Result<Curve> {
    let curve =
        Curve::read(document, get(samplers, index, "sampler")?).map_err(|e| e.within(format!("sampler {index}")))?;
    let wanted = match pointer.rsplit_once('/') {
        Some((node, "translation" | "scale")) if node.starts_with("/nodes/") => 3,
        Some((node, "rotation")) if node.starts_with("/nodes/") => 4,
        _ => curve.width,
    };
    if curve.width != wanted {
        let cause = format!("its values have {} numbers instead of {wanted}", curve.width);
        return Err(fault(format!("sampler {index}"), cause).hint("the file is damaged: export it again"));
    }
    Ok(curve)
}

/// JSON pointer to the value that an animation channel changes; `None` if the channel's target is missing or unknown.
fn target(document: &Document, target: &Value) -> Result<Option<String>> {
    let path = target["path"].as_str().unwrap_or_default();
    if path == "pointer" {
        return Ok(target["extensions"]["KHR_animation_pointer"]["pointer"].as_str().map(str::to_owned));
    }
    let Some(node) = target["node"].as_u64() else { return Ok(None) };
    let node = usize::try_from(node).unwrap_or(usize::MAX);
    let name = get(&document.nodes, node, "node")?.name.as_deref();
    if document.part("nodes", node).get("matrix").is_some() && path != "weights" {
        return Err(fault(named("node", name, node), format!("its {path} moves, but it has a matrix"))
            .hint("export its translation, rotation and scale instead"));
    }
    let known = ["translation", "rotation", "scale", "weights"].contains(&path);
    Ok(known.then(|| format!("/nodes/{node}/{path}")))
}
