//! Merging the shards of one render, and averaging renders of different seeds.

use crate::error::raised;
use crate::image::Image;
use crate::options::finish_request;
use crate::scene::delivered;
use crate::work::work;
use caustique::error::{Error, Result};
use caustique::film::{Naming, Selection, take_plain_names};
use caustique::image::exr;
use caustique::pipeline::finish::{missing_denoiser, open};
use caustique::pipeline::merge::{MergeEvent, MergeRequest, Shards, is_shard};
use caustique::pipeline::seeds::Seeds;
use caustique::pipeline::{FinishRequest, write_finish};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;

/// Merges shards of one render, whose files `Image.save` or `caustique render --shard` has written, to the image that one
/// process would have rendered, to the last bit of every layer. Their order does not matter. Whole renders that differ only
/// in their seed give their mean, weighted by iterations.
///
/// partial    merge the shards although some are missing, with a warning for each
/// finish, denoise, model, layers
///            as for `render`; by default as for the shards
/// reproducible
///            leave clocks, threads and the names of shards out of the header; by default as for the shards
/// threads    0 takes all cores
///
/// An error of the finish has the unfinished image as its attribute `image`.
#[pyfunction]
#[pyo3(signature = (
    paths, *, partial = false, finish = None, denoise = None, model = None, layers = None, reproducible = None,
    threads = 0
))]
#[expect(clippy::too_many_arguments, reason = "they are those of Python's signature")]
pub fn merge(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    partial: bool,
    finish: Option<bool>,
    denoise: Option<String>,
    model: Option<String>,
    layers: Option<String>,
    reproducible: Option<bool>,
    threads: usize,
) -> PyResult<Image> {
    let are_shards = py.detach(|| paths.iter().map(|path| is_shard(path)).collect::<Result<Vec<bool>>>());
    if !paths.is_empty() && !are_shards.map_err(raised)?.contains(&true) {
        return average(py, &paths, finish, denoise, model, layers.as_deref(), threads);
    }
    let shards = py.detach(|| Shards::open(&paths, partial)).map_err(raised)?;
    let arguments = shards.arguments();
    let layers = layers.or_else(|| text(&arguments, "layers")).unwrap_or_else(|| "all".into());
    let request = MergeRequest {
        finish: choose_finish(&arguments, finish, denoise, model)?,
        layers: Selection::parse(&layers).map_err(raised)?,
        naming: Naming::Plain,
        reproducible: reproducible.unwrap_or(arguments["reproducible"] == true),
    };
    let done = work(py, threads, |caller| {
        caller.warn(&shards.warnings());
        let missing = |error: &Error| caller.warn(&[missing_denoiser(error)]);
        shards.merge(&request, |event| {
            if let MergeEvent::Finishing { missing: Some(error), .. } = event {
                missing(error);
            }
        })
    })?;
    delivered(py, done.whole()?)
}

/// The mean of renders of different seeds, finished as they are.
fn average(
    py: Python<'_>,
    paths: &[PathBuf],
    finish: Option<bool>,
    denoise: Option<String>,
    model: Option<String>,
    layers: Option<&str>,
    threads: usize,
) -> PyResult<Image> {
    let layers = layers.map(Selection::parse).transpose().map_err(raised)?;
    let mean = py.detach(|| {
        let mut seeds = Seeds::default();
        for path in paths {
            let (mut set, attributes) = exr::read(path)?;
            take_plain_names(&mut set);
            seeds.add(path, set, attributes)?;
        }
        seeds.mean()
    });
    let (mut set, mut attributes) = mean.map_err(raised)?;
    let mut header = attributes.object().unwrap_or_default();
    let request = choose_finish(&header["arguments"], finish, denoise, model)?;
    let done = work(py, threads, |caller| {
        if let Some(request) = request {
            let mut opened = open(&request, None)?;
            caller.warn(&opened.missing.iter().map(missing_denoiser).collect::<Vec<_>>());
            let account = opened.finish().apply(&mut set, |_| true)?;
            write_finish(&mut header, &opened, &account);
        }
        if let Some(layers) = &layers {
            set = layers.apply(set)?;
        }
        attributes.insert(exr::ATTRIBUTE, &header)?;
        Ok(Image { set, attributes, sums: None })
    })?;
    done.whole()
}

/// The finish that this call asks for, else the finish that the shards were rendered with.
fn choose_finish(
    arguments: &Value,
    finish: Option<bool>,
    denoise: Option<String>,
    model: Option<String>,
) -> PyResult<Option<FinishRequest>> {
    let is_set = finish == Some(true) || denoise.is_some() || model.is_some();
    if finish == Some(false) || (!is_set && arguments["no-combine"] == true) {
        return Ok(None);
    }
    let denoise = denoise.or_else(|| text(arguments, "denoise")).unwrap_or_else(|| "auto".into());
    finish_request("merge", &denoise, model.or_else(|| text(arguments, "model"))).map(Some)
}

fn text(arguments: &Value, name: &str) -> Option<String> {
    arguments[name].as_str().map(String::from)
}
