//! Errors of pictures.

use crate::error::raised;
use crate::image::picture;
use crate::value::to_python;
use caustique::image::{Floor, Outputs, atomic, compare_with_floor, heat};
use caustique::report::errors;
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// The error of a picture against a reference: the figures of `caustique compare --json`, and flip_map, (H, W) float32.
///
/// Both are Images, paths, or arrays (H, W, 3). `layer` names the layer to compare. `relative` adds 0.01 times the
/// squared mean radiance of the reference in relMSE, instead of 0.01. `png` writes a heat map of FLIP, and `page` an HTML
/// page with both pictures and the errors of their pixels, and with the estimated errors if the image has a layer "Error".
#[pyfunction]
#[pyo3(signature = (image, reference, *, layer = None, relative = false, png = None, page = None))]
pub fn compare<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    layer: Option<&str>,
    relative: bool,
    png: Option<PathBuf>,
    page: Option<PathBuf>,
) -> PyResult<Bound<'py, PyAny>> {
    let inputs = [image, reference].map(|given| given.extract::<PathBuf>().ok());
    Outputs::new(png.iter().chain(&page).cloned())
        .and_then(|outputs| outputs.check(inputs.iter().flatten().map(PathBuf::as_path)))
        .map_err(raised)?;
    let (a, b) = (picture("image", image, layer)?, picture("reference", reference, layer)?);
    let names = [("image", image), ("reference", reference)]
        .map(|(place, given)| given.extract::<PathBuf>().map_or(place.into(), |path| path.display().to_string()));
    let floor = if relative { Floor::Relative } else { Floor::Papers };
    let mut comparison = py.detach(|| compare_with_floor(&a, &b, floor)).map_err(raised)?;
    let written = py.detach(|| {
        let colours = || comparison.flip_map.iter().map(|&error| heat::magma(error));
        png.map_or(Ok(()), |path| caustique::image::png::write(&path, a.size(), colours()))?;
        let Some(path) = page else { return Ok(()) };
        let text = errors::html(&a, &b, names.each_ref().map(String::as_str), &comparison)?;
        atomic::write_bytes(&path, text.as_bytes())
    });
    written.map_err(raised)?;
    let map = std::mem::take(&mut comparison.flip_map);
    let figures = to_python(py, &json!(comparison))?;
    if let Ok(map) = Array2::from_shape_vec((a.height, a.width), map) {
        figures.set_item("flip_map", map.into_pyarray(py))?;
    }
    Ok(figures)
}
