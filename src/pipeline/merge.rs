//! Merges the shards of one render to the picture that one machine would have rendered.

use super::checkpoint::first_difference;
use super::deliver::{Contents, Delivery, deliver};
use super::facts::SceneFacts;
use super::finish::{self, FinishRequest};
use super::layers;
use super::memory;
use super::shard::ShardFile;
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::film::{Naming, Selection};
use crate::render::{Rendered, Settings, ShardResult};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Options, by their names in the header, that may differ between the shards of one render.
const FREE_OPTIONS: [&str; 6] = ["shard", "layers", "exr-naming", "compression", "scene", "path"];

/// The opened files of the shards of one render (parts of its iterations), ordered by their index.
pub struct Shards {
    files: Vec<(PathBuf, ShardFile)>,
    /// Indices of shards of the render for which no file is given.
    missing: Vec<u64>,
}

/// How shards are merged to a picture, and how it is finished.
pub struct MergeRequest {
    /// How the picture is finished; `None`: it stays the unfinished estimate.
    pub finish: Option<FinishRequest>,
    /// Layers to deliver in the EXR.
    pub layers: Selection,
    /// Style of channel names, which the cryptomatte attributes repeat.
    pub naming: Naming,
    /// Whether the header leaves out clocks and the number of threads.
    pub reproducible: bool,
}

/// An event of a merge.
pub enum MergeEvent<'a> {
    /// The pixel sums of a file are about to be read.
    Reading(&'a Path),
    /// The pixel sums are merged, and the finish is about to begin.
    Finishing {
        /// The merged render.
        rendered: &'a Rendered,
        /// Why the preferred denoiser is missing, if the built-in one takes its place; `None` otherwise.
        missing: Option<&'a Error>,
    },
}

/// Whether a file is a shard, with pixel sums behind its picture.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub fn is_shard(path: &Path) -> Result<bool> {
    Ok(ShardFile::open(path)?.is_some())
}

impl Shards {
    /// Opens shards, without reading their pixels. Checks that all are of one render, that each occurs once, and,
    /// unless `partial`, that none is missing.
    ///
    /// # Errors
    /// The file that does not belong to the others and why, or the number of a missing shard.
    pub fn open(paths: &[PathBuf], partial: bool) -> Result<Shards> {
        let mut files: Vec<(PathBuf, ShardFile)> = Vec::new();
        // All shards have the same motion vectors, and one copy is kept.
        let mut motion = None;
        for path in paths {
            let Some(mut file) = ShardFile::open(path)? else {
                let error = Error::new(ErrorKind::Usage, path.display(), "is no shard of a render");
                return Err(error.hint("merge files that --shard I/N made, or whole renders of other seeds alone"));
            };
            if let Some((first, whole)) = files.first() {
                check_same_render(first, whole, path, &file)?;
            }
            let own = file.facts.motion.take();
            motion = motion.or(own);
            files.push((path.clone(), file));
        }
        let index = |file: &ShardFile| file.part.settings.shard.index;
        files.sort_by_key(|(_, file)| index(file));
        if let Some([(a, file), (b, _)]) = files.windows(2).find(|pair| index(&pair[0].1) == index(&pair[1].1)) {
            let cause = format!("is shard {} as {} is", index(file), a.display());
            return Err(Error::new(ErrorKind::Usage, b.display(), cause).hint("name each shard once"));
        }
        let count = files.first().map_or(0, |(_, file)| file.part.settings.shard.count);
        if let Some((_, first)) = files.first_mut() {
            first.facts.motion = motion;
        }
        let missing: Vec<u64> =
            (0..count).filter(|shard| files.binary_search_by_key(shard, |(_, file)| index(file)).is_err()).collect();
        if !partial {
            check_complete(&missing, count)?;
        }
        Ok(Shards { files, missing })
    }

    /// Options of the render as the user gave them, without the shard; null if there are no shards.
    pub fn arguments(&self) -> Value {
        let mut arguments = self.files.first().map_or(Value::Null, |(_, file)| file.head.arguments.clone());
        arguments["shard"] = Value::Null;
        arguments
    }

    /// Facts of the scene for layers and header, from the first shard; `None` if there are no shards.
    pub fn facts(&self) -> Option<&SceneFacts> {
        self.files.first().map(|(_, file)| &file.facts)
    }

    /// Warnings about shards that ended early, and about missing shards.
    pub fn warnings(&self) -> Vec<String> {
        let early = self.files.iter().filter_map(|(path, file)| {
            let ShardResult { settings, stats, .. } = &file.part;
            let iterations = stats.iterations;
            let total = settings.iterations_of_shard().filter(|total| iterations < *total)?;
            Some(format!("{}: ended after {iterations} of {total} iterations", path.display()))
        });
        let missing =
            self.missing.iter().map(|shard| format!("shard {shard} is missing, and the picture noisier for it"));
        early.chain(missing).collect()
    }

    /// Merges the shards and delivers the picture. Memory holds the pixels of one picture and some blocks of another.
    ///
    /// # Errors
    /// A file is damaged; the render has no such layer; the finish cannot be opened.
    pub fn merge(self, request: &MergeRequest, mut observe: impl FnMut(MergeEvent<'_>)) -> Result<Delivery> {
        let arguments = self.arguments();
        let none = || Error::usage("there is no shard");
        let Shards { mut files, missing } = self;
        let parts: Vec<ShardResult> = files.iter().map(|(_, file)| file.part.clone()).collect();
        let part = ShardResult::merge(&parts).ok_or_else(none)?;
        let (facts, head) = files.first().map(|(_, file)| (file.facts.clone(), file.head.clone())).ok_or_else(none)?;
        layers::check(&request.layers, &facts.shape, request.finish.is_some(), facts.motion.is_some())?;
        let levels = Some(part.settings.levels.count);
        let mut finish = request.finish.as_ref().map(|wanted| finish::open(wanted, levels)).transpose()?;
        let denoiser = request.finish.as_ref().map(|finish| finish.denoiser);
        memory::check_merge(&part, &facts.shape, &request.layers, denoiser)?;
        let (width, height) = part.size;
        let mut pixels: Vec<PixelAccumulator> = crate::memory::reserve(width as usize * height as usize, "pixels")?;
        for (path, file) in &mut files {
            observe(MergeEvent::Reading(path));
            add_pixels(path, file, &mut pixels)?;
        }
        let names: Vec<String> = files.iter().map(|(path, _)| path.display().to_string()).collect();
        let mut more = Map::new();
        if !(request.reproducible && missing.is_empty()) {
            more.insert("merged".into(), json!({"shards": names, "missing": missing}));
        }
        let MergeRequest { layers: selection, naming, reproducible, .. } = request;
        let contents = Contents {
            facts: &facts,
            selection,
            naming: *naming,
            scene: &head.scene,
            plan: &head.plan,
            arguments: &arguments,
            reproducible: *reproducible,
            more,
            is_shard: false,
        };
        let rendered = part.with_pixels(pixels);
        let missing = finish.as_ref().and_then(|finish| finish.missing.as_ref());
        observe(MergeEvent::Finishing { rendered: &rendered, missing });
        deliver(contents, rendered, finish.as_mut(), None).map(|(delivery, _)| delivery)
    }
}

/// Fails if shards are missing among the `count` shards of the render.
fn check_complete(missing: &[u64], count: u64) -> Result<()> {
    let Some(shard) = missing.first() else { return Ok(()) };
    let cause = match missing.len() {
        1 => format!("shard {shard} of {count} is missing"),
        many => format!("shard {shard} of {count} is missing, and {} more", many - 1),
    };
    let hint = format!("render it with --shard {shard}/{count}, or give --partial to do without");
    Err(Error::usage(cause).hint(hint))
}

/// Adds the pixel sums of a shard's file to `pixels`, the sums of the files before it.
fn add_pixels(path: &Path, file: &mut ShardFile, pixels: &mut Vec<PixelAccumulator>) -> Result<()> {
    let first = pixels.is_empty();
    let mut at = 0;
    file.pixels(path, |block| {
        let count = block.len();
        if first {
            pixels.extend(block);
        } else {
            let sums = pixels[at..at + count].par_iter_mut().with_min_len(256);
            sums.zip(block).for_each(|(sum, other)| sum.join(other));
        }
        at += count;
    })
}

/// Fails if the second shard is not of the render of the first.
fn check_same_render(first: &Path, whole: &ShardFile, path: &Path, file: &ShardFile) -> Result<()> {
    let error = |cause: String| Error::new(ErrorKind::Usage, path.display(), cause);
    let first = first.display();
    if file.head.scene != whole.head.scene {
        return Err(error(format!("is of another scene than {first}")).hint("merge shards of one render"));
    }
    if let Some((key, there, here)) = first_difference(&whole.head.arguments, &file.head.arguments, &FREE_OPTIONS) {
        let cause = format!("was rendered with another --{key} than {first}: {here} here, {there} there");
        return Err(error(cause).hint("merge shards of one render"));
    }
    let identity = |part: &ShardResult| {
        let Settings { shard, method, levels, .. } = part.settings;
        (part.size, shard.count, method, levels)
    };
    if identity(&file.part) != identity(&whole.part) || file.head.candidate != whole.head.candidate {
        let [here, there] = [file, whole].map(|of| {
            let ShardResult { settings, size: (width, height), .. } = &of.part;
            format!("one of {} shards by {} at {width} x {height}", settings.shard.count, settings.method.name())
        });
        let cause = format!("is {here}, {first} is {there}");
        return Err(error(cause).hint("render all shards with the same I/N, size and --method"));
    }
    Ok(())
}
