//! Merging the shards of one render.

use crate::error::raised;
use crate::image::Image;
use crate::options::{self, finish_request};
use crate::scene::delivered;
use crate::work::work;
use caustique::error::Error;
use caustique::film::{Naming, Selection};
use caustique::pipeline::FinishRequest;
use caustique::pipeline::merge::{MergeEvent, MergeRequest, Shards};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;

/// Merges shards of one render, whose files `Image.save` or `caustique render --shard` has written, to the image that one
/// process would have rendered, to the last bit of every layer. Their order does not matter.
///
/// partial    merge the shards although some are missing, with a warning for each
/// finish, denoise, model, layers
///            as for `render`; by default as for the shards
/// threads    0 takes all cores
///
/// An error of the finish has the unfinished image as its attribute `image`.
#[pyfunction]
#[pyo3(signature = (
    paths, *, partial = false, finish = None, denoise = None, model = None, layers = None, threads = 0
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
    threads: usize,
) -> PyResult<Image> {
    let shards = py.detach(|| Shards::open(&paths, partial)).map_err(raised)?;
    let arguments = shards.arguments();
    let layers = layers.or_else(|| text(&arguments, "layers")).unwrap_or_else(|| "all".into());
    let request = MergeRequest {
        finish: choose_finish(&arguments, finish, denoise, model)?,
        layers: Selection::parse(&layers).map_err(raised)?,
        naming: Naming::Plain,
        reproducible: arguments["reproducible"] == true,
    };
    let done = work(py, threads, |caller| {
        caller.warn(&shards.warnings());
        let missing = |error: &Error| caller.warn(&[options::missing_denoiser(error)]);
        shards.merge(&request, |event| {
            if let MergeEvent::Finishing { missing: Some(error), .. } = event {
                missing(error);
            }
        })
    })?;
    delivered(py, done.whole()?)
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
