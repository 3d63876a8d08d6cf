//! The finish of pictures that were rendered before: of one, or of the frames of an animation.

use crate::error::raised;
use crate::image::Image;
use crate::options::finish_request;
use crate::work::{Caller, work};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::take_plain_names;
use caustique::image::exr::ATTRIBUTE;
use caustique::options::{files_of_frames, no_frames};
use caustique::pipeline::finish::{missing_denoiser, open};
use caustique::pipeline::temporal::FrameFiles;
use caustique::pipeline::{FinishRequest, OpenFinish, RenderedFile, write_finish};
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A new image whose picture is finished as a render finishes its own. All other layers stay.
///
/// The image needs an estimate of its noise: the layers of a render, or from another renderer "Variance" (of the mean) or
/// two independent halves "Half1" and "Half2". The denoiser also uses "albedo" and "normal". Layers with Blender's names
/// (ViewLayer.Combined) get the names and axes of this package.
#[pyfunction]
#[pyo3(signature = (image, *, denoise = "auto", model = None, threads = 0))]
pub fn finish(
    py: Python<'_>,
    image: &Bound<'_, Image>,
    denoise: &str,
    model: Option<String>,
    threads: usize,
) -> PyResult<Image> {
    let request = finish_request("finish", denoise, model)?;
    let image = image.get();
    let done = work(py, threads, |caller| {
        let mut opened = open_for(caller, &request)?;
        let (mut set, mut attributes) = (image.set.clone(), image.attributes.clone());
        let left = |name: String| format!("layer \"{name}\" cannot be written under this name and is left out");
        caller.warn(&take_plain_names(&mut set).into_iter().map(left).collect::<Vec<_>>());
        let account = opened.finish().apply(&mut set, |_| true)?;
        let mut header = attributes.object().unwrap_or_else(|| json!({"version": env!("CARGO_PKG_VERSION")}));
        write_finish(&mut header, &opened, &account);
        attributes.insert(ATTRIBUTE, &header)?;
        Ok(Image { set, attributes, sums: None })
    })?;
    done.whole()
}

/// The frames of an animation, finished with up to two neighbours on each side, so that they flicker less:
///
///     for frame, image in caustique.finish_frames("shot.####.exr"):
///         image.save(f"finished.{frame:04}.exr")
///
/// `pattern` is the name of the files, in which '####' stands for the number of a frame. They need the layer "Motion";
/// renders with layers="all,Motion" and a seed of its own for each frame have all that is useful. `frames` are the numbers
/// of the frames to finish, all by default; the frames around them still count.
#[pyfunction]
#[pyo3(signature = (pattern, *, frames = None, denoise = "auto", model = None, threads = 0))]
pub fn finish_frames(
    py: Python<'_>,
    pattern: PathBuf,
    frames: Option<Vec<u32>>,
    denoise: &str,
    model: Option<String>,
    threads: usize,
) -> PyResult<FinishedFrames> {
    let request = finish_request("finish_frames", denoise, model)?;
    let paths = py.detach(|| files_of_frames(&pattern)).map_err(|cause| raised(Error::io(&pattern, &cause)))?;
    if paths.is_empty() {
        return Err(raised(no_frames(&pattern)));
    }
    let mut numbers = frames.unwrap_or_else(|| paths.keys().copied().collect());
    if let Some(missing) = numbers.iter().find(|number| !paths.contains_key(number)) {
        let error = Error::new(ErrorKind::Io, pattern.display(), format!("there is no frame {missing}"));
        return Err(raised(error.hint("render it, or leave it out of frames")));
    }
    // Each file is read once if frames are finished in ascending order.
    numbers.sort_unstable();
    numbers.dedup();
    let state = State { files: FrameFiles::new(paths), numbers: numbers.into_iter(), opened: None };
    Ok(FinishedFrames { request, threads, state: Mutex::new(state) })
}

/// Yields the number of each frame and its finished image, in ascending order.
#[pyclass(frozen, module = "caustique")]
pub struct FinishedFrames {
    request: FinishRequest,
    threads: usize,
    state: Mutex<State>,
}

struct State {
    files: FrameFiles,
    numbers: std::vec::IntoIter<u32>,
    /// The denoiser and the network; `None` before the first frame.
    opened: Option<OpenFinish>,
}

#[pymethods]
impl FinishedFrames {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<(u32, Image)>> {
        work(py, self.threads, |caller| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let State { files, numbers, opened } = &mut *state;
            let Some(number) = numbers.next() else { return Ok(None) };
            let opened = match opened {
                Some(opened) => opened,
                None => opened.insert(open_for(caller, &self.request)?),
            };
            let RenderedFile { set, attributes, remarks, .. } = files.finish(number, opened, false)?;
            caller.warn(&remarks);
            Ok(Some((number, Image { set, attributes, sums: None })))
        })?
        .whole()
    }
}

/// Opens a finish, and warns if the preferred denoiser is missing.
fn open_for(caller: &Caller, request: &FinishRequest) -> Result<OpenFinish> {
    let mut opened = open(request, None)?;
    let missing = opened.missing.take();
    caller.warn(&missing.map(|error| missing_denoiser(&error)).into_iter().collect::<Vec<_>>());
    Ok(opened)
}
