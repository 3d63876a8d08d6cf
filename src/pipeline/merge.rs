//! Shards of one render, joined to the picture that one machine would have made.

use super::checkpoint::difference;
use super::deliver::{Delivery, Writing, deliver};
use super::facts::Facts;
use super::finish;
use super::layers;
use super::shard::Open;
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::film::Naming;
use crate::render::{Rendered, Settings, ShardResult};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Options that shards of one render may have had otherwise: what each is written as, and which one it is.
const FREE: [&str; 6] = ["shard", "layers", "exr-naming", "compression", "scene", "path"];

/// Shards that belong together, in their order.
pub struct Shards {
    files: Vec<(PathBuf, Open)>,
    missing: Vec<u64>,
}

/// How the picture is made of them.
pub struct Order {
    /// How the estimate becomes the picture; `None`: not at all.
    pub finish: Option<finish::Order>,
    /// Layers that are wanted, see [`super::Order::layers`].
    pub layers: String,
    /// Names of channels, which the attributes of cryptomattes repeat.
    pub naming: Naming,
    /// Leave clocks and the number of threads out of the header.
    pub reproducible: bool,
}

/// What happens next.
pub enum Step<'a> {
    /// The pixels of a file are read.
    Reads(&'a Path),
    /// All are joined; what the finish is to do without, if anything.
    Finishes(&'a Rendered, Option<&'a Error>),
}

/// Whether a file is a shard of a render.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub fn is_shard(path: &Path) -> Result<bool> {
    Ok(Open::of(path)?.is_some())
}

impl Shards {
    /// Opens shards, and makes sure that they are all of one render, each there once and, unless `partial`, none
    /// missing. Their pixels are not read yet.
    ///
    /// # Errors
    /// The file that does not belong there and why, or the number of the one that is missing.
    pub fn open(paths: &[PathBuf], partial: bool) -> Result<Shards> {
        let mut files: Vec<(PathBuf, Open)> = Vec::new();
        for path in paths {
            let Some(open) = Open::of(path)? else {
                let error = Error::new(ErrorKind::Usage, path.display(), "is no shard of a render");
                return Err(error.hint("merge files that --shard I/N made, or whole renders of other seeds alone"));
            };
            if let Some((first, whole)) = files.first() {
                check((first, whole), (path, &open))?;
            }
            files.push((path.clone(), open));
        }
        files.sort_by_key(|(_, open)| open.part.settings.shard.index);
        let index = |open: &Open| open.part.settings.shard.index;
        if let Some([(a, open), (b, _)]) = files.windows(2).find(|pair| index(&pair[0].1) == index(&pair[1].1)) {
            let cause = format!("is shard {} as {} is", index(open), a.display());
            return Err(Error::new(ErrorKind::Usage, b.display(), cause).hint("name each shard once"));
        }
        let count = files.first().map_or(0, |(_, open)| open.part.settings.shard.count);
        let missing: Vec<u64> =
            (0..count).filter(|shard| files.binary_search_by_key(shard, |(_, open)| index(open)).is_err()).collect();
        if let (false, Some(shard)) = (partial, missing.first()) {
            let cause = match missing.len() {
                1 => format!("shard {shard} of {count} is missing"),
                many => format!("shard {shard} of {count} is missing, and {} more", many - 1),
            };
            let hint = format!("render it with --shard {shard}/{count}, or give --partial to do without");
            return Err(Error::usage(cause).hint(hint));
        }
        Ok(Shards { files, missing })
    }

    /// What was asked for, but for the shard; null without any.
    pub fn arguments(&self) -> Value {
        let mut arguments = self.files.first().map_or(Value::Null, |(_, open)| open.head.arguments.clone());
        arguments["shard"] = Value::Null;
        arguments
    }

    /// What is known of the scene; `None` without any.
    pub fn facts(&self) -> Option<&Facts> {
        self.files.first().map(|(_, open)| &open.facts)
    }

    /// What is to be known of them before they are joined: shards that ended early, and those that are missing.
    pub fn warnings(&self) -> Vec<String> {
        let early = self.files.iter().filter_map(|(path, open)| {
            let ShardResult { settings, stats, .. } = &open.part;
            let iterations = stats.iterations;
            let total = settings.iterations_of_shard().filter(|total| iterations < *total)?;
            Some(format!("{}: ended after {iterations} of {total} iterations", path.display()))
        });
        let missing =
            self.missing.iter().map(|shard| format!("shard {shard} is missing, and the picture noisier for it"));
        early.chain(missing).collect()
    }

    /// Joins them. At most the pixels of one picture and some blocks of another are in memory at once.
    ///
    /// # Errors
    /// A file is damaged; a layer that is not there is asked for; the finish cannot be opened.
    pub fn merge(self, order: &Order, mut watch: impl FnMut(Step<'_>)) -> Result<Delivery> {
        let arguments = self.arguments();
        let none = || Error::usage("there is no shard");
        let Shards { mut files, missing } = self;
        let parts: Vec<ShardResult> = files.iter().map(|(_, open)| open.part.clone()).collect();
        let part = ShardResult::merge(&parts).ok_or_else(none)?;
        let (facts, plan) =
            files.first().map(|(_, open)| (open.facts.clone(), open.head.plan.clone())).ok_or_else(none)?;
        let selection = layers::selection(&order.layers, &facts.shape, order.finish.is_some())?;
        let levels = part.settings.levels.count;
        let mut ready = order.finish.as_ref().map(|finish| finish::open(finish, Some(levels))).transpose()?;
        let mut pixels: Vec<PixelAccumulator> = Vec::new();
        for (path, open) in &mut files {
            watch(Step::Reads(path));
            join(path, open, &mut pixels)?;
        }
        let names: Vec<String> = files.iter().map(|(path, _)| path.display().to_string()).collect();
        let mut more = Map::new();
        if !(order.reproducible && missing.is_empty()) {
            more.insert("merged".into(), json!({"shards": names, "missing": missing}));
        }
        let writing = Writing {
            facts: &facts,
            selection: &selection,
            naming: order.naming,
            plan: &plan,
            arguments: &arguments,
            reproducible: order.reproducible,
            more,
        };
        let rendered = part.with_pixels(pixels);
        watch(Step::Finishes(&rendered, ready.as_ref().and_then(|ready| ready.missing.as_ref())));
        deliver(writing, rendered, (ready.as_mut(), None), false).map(|(delivery, _)| delivery)
    }
}

/// Adds the pixels of a file to those of the others.
fn join(path: &Path, open: &mut Open, pixels: &mut Vec<PixelAccumulator>) -> Result<()> {
    let first = pixels.is_empty();
    let mut at = 0;
    open.pixels(path, |block| {
        let count = block.len();
        if first {
            pixels.extend(block);
        } else {
            let own = pixels[at..at + count].par_iter_mut().with_min_len(256);
            own.zip(block).for_each(|(own, other)| own.join(other));
        }
        at += count;
    })
}

/// Whether two shards are of one render.
fn check((first, whole): (&Path, &Open), (path, open): (&Path, &Open)) -> Result<()> {
    let error = |cause: String| Error::new(ErrorKind::Usage, path.display(), cause);
    let first = first.display();
    if open.head.scene != whole.head.scene {
        return Err(error(format!("is of another scene than {first}")).hint("merge shards of one render"));
    }
    if let Some((key, there, here)) = difference(&whole.head.arguments, &open.head.arguments, &FREE) {
        let cause = format!("was rendered with another --{key} than {first}: {here} here, {there} there");
        return Err(error(cause).hint("merge shards of one render"));
    }
    let of = |part: &ShardResult| {
        let Settings { shard, method, levels, .. } = part.settings;
        (part.size, shard.count, method, levels)
    };
    if of(&open.part) != of(&whole.part) || open.head.candidate != whole.head.candidate {
        let [here, there] = [open, whole].map(|of| {
            let ShardResult { settings, size: (width, height), .. } = &of.part;
            format!("one of {} shards by {} at {width} x {height}", settings.shard.count, settings.method.name())
        });
        let cause = format!("is {here}, {first} is {there}");
        return Err(error(cause).hint("render all shards with the same I/N, size and --method"));
    }
    Ok(())
}
