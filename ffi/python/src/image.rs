//! A picture with its layers. Planes are numpy views of its memory.

use crate::error::{raised, usage};
use crate::keywords::choice;
use crate::value::{to_json, to_python};
use caustique::error::{Error, ErrorKind};
use caustique::face::write;
use caustique::film::{Layer, LayerSet, Plane, Sample, current_name, describe};
use caustique::image::exr::{self, Attributes};
use caustique::image::png;
use caustique::image::tonemap::Look;
use caustique::memory;
use caustique::pipeline::Delivery;
use caustique::pipeline::shard::ShardSums;
use numpy::ndarray::{Array3, ArrayView2, Axis};
use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArrayLikeDyn};
use pyo3::exceptions::{PyKeyError, PyMemoryError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// A picture: named layers of float32 planes, and a header. Images are immutable.
///
/// image["Noisy"]                   a layer, (H, W, C), a copy; of layers with one plane, such as "Z", a view (H, W)
/// image["Noisy.R"]                 a plane, (H, W), a view
/// image.layers["Noisy"]["R"]       the same
/// image.picture                    the picture itself, (H, W, 3), a copy
///
/// Views are read-only, share the image's memory and keep it alive. Rows run from the top. Radiance is scene-linear
/// Rec. 709 in W/(sr m2); "Variance1" and other variances are squares of radiance; "Z", "depth" and "P" are metres.
#[pyclass(frozen, module = "caustique")]
pub struct Image {
    /// The layers of the picture.
    pub set: LayerSet,
    /// The attributes of the EXR header.
    pub attributes: Attributes,
    /// The pixel sums of a shard, a part of a render, by which it is merged with the others; `None` for other images.
    pub sums: Option<ShardSums>,
}

impl Image {
    /// The image of a render, and the error of its finish if that failed.
    pub fn of(delivery: Delivery) -> (Image, Option<Error>) {
        let Delivery { set, attributes, sums, finish_error, .. } = delivery;
        (Image { set, attributes, sums }, finish_error)
    }
}

/// Component names of a layer by its number of planes, one to four.
const COMPONENTS: [&str; 4] = ["X", "XY", "RGB", "RGBA"];
/// Names of the layers that hold vectors, X, Y and Z.
const VECTORS: [&str; 2] = ["normal", "P"];

#[pymethods]
impl Image {
    /// An image of arrays (H, W) or (H, W, C) by layer name, C up to 4; "" is the picture itself. Values are copied.
    #[staticmethod]
    #[pyo3(signature = (layers, header = None))]
    fn from_arrays(layers: &Bound<'_, PyDict>, header: Option<&Bound<'_, PyDict>>) -> PyResult<Image> {
        let mut set = LayerSet::default();
        for (name, array) in layers.iter() {
            let name: String = name.extract()?;
            let (size, layer) = layer(&name, &array)?;
            if set.layers.is_empty() {
                (set.height, set.width) = size;
            }
            set.push(layer).map_err(raised)?;
        }
        if set.pixels() == 0 {
            return Err(usage("an image without pixels", "give a layer \"\" of shape (H, W, 3)"));
        }
        let attributes = match header {
            Some(header) => Attributes::of(&to_json(header)?).map_err(raised)?,
            None => Attributes::default(),
        };
        Ok(Image { set, attributes, sums: None })
    }

    /// Height and width in pixels.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.set.height, self.set.width)
    }

    /// The planes of every layer, {layer: {component: (H, W) float32}}, read-only and without copies.
    #[getter]
    fn layers<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(this.py());
        for layer in &this.get().set.layers {
            let planes = PyDict::new(this.py());
            for plane in &layer.planes {
                planes.set_item(&plane.component, view(this, plane)?)?;
            }
            all.set_item(&layer.name, planes)?;
        }
        Ok(all)
    }

    /// The picture itself: (H, W, 3) float32, scene-linear radiance. A copy.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        check_memory(self.set.pixels().saturating_mul(6))?;
        let pixels = self.set.beauty().map_err(raised)?;
        let values: Vec<f32> = pixels.into_iter().flatten().collect();
        Ok(shaped(Array3::from_shape_vec((self.set.height, self.set.width, 3), values))?.into_pyarray(py).into_any())
    }

    /// The header, a dict: arguments, seed, plan, warnings, error against seconds, and more.
    #[getter]
    fn header<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self.attributes.object() {
            Some(object) => to_python(py, &object),
            None => Ok(PyDict::new(py).into_any()),
        }
    }

    /// Meaning and unit of each layer, {layer: "meaning [unit]"}; layers of other programs are left out.
    #[getter]
    fn descriptions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for layer in &self.set.layers {
            if let Some(description) = describe(&layer.name) {
                all.set_item(&layer.name, description.to_string())?;
            }
        }
        Ok(all)
    }

    /// Names of the layers; the picture itself is "".
    fn keys(&self) -> Vec<String> {
        self.set.layers.iter().map(|layer| layer.name.clone()).collect()
    }

    /// A layer, (H, W, C) or (H, W), or a plane such as "Noisy.R", (H, W). Single planes are views, several are stacked
    /// into a copy.
    fn __getitem__<'py>(this: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let set = &this.get().set;
        if let Some(layer) = set.get(&current_name(name)) {
            return match layer.planes.as_slice() {
                [plane] => view(this, plane),
                planes => {
                    let size = (set.height, set.width, planes.len());
                    check_memory(set.pixels().saturating_mul(planes.len()))?;
                    let mut stacked = Array3::zeros(size);
                    for (mut to, plane) in stacked.axis_iter_mut(Axis(2)).zip(planes) {
                        to.assign(&shaped(ArrayView2::from_shape((set.height, set.width), &plane.values))?);
                    }
                    Ok(stacked.into_pyarray(this.py()).into_any())
                }
            };
        }
        let (layer, component) = name.rsplit_once('.').unwrap_or(("", name));
        match set.get(&current_name(layer)).and_then(|layer| layer.plane(component)) {
            Some(plane) => view(this, plane),
            None => {
                let names: Vec<String> = set.layers.iter().map(|layer| format!("'{}'", layer.name)).collect();
                Err(PyKeyError::new_err(format!("no layer or plane '{name}'; there are {}", names.join(", "))))
            }
        }
    }

    fn __contains__(&self, name: &str) -> bool {
        let (layer, component) = name.rsplit_once('.').unwrap_or(("", name));
        let has_plane = |layer: &Layer| layer.plane(component).is_some();
        self.set.get(&current_name(name)).is_some() || self.set.get(&current_name(layer)).is_some_and(has_plane)
    }

    fn __len__(&self) -> usize {
        self.set.layers.len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.keys().into_pyobject(py)?.try_iter()?.into_any())
    }

    fn __repr__(&self) -> String {
        format!("<caustique.Image: {} x {} pixels, {} layers>", self.set.width, self.set.height, self.set.layers.len())
    }

    /// The picture as a tone-mapped PNG, which notebooks show.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let encoded = py.detach(|| png::encode_tonemapped(&self.set.beauty()?, Look::default()));
        encoded.map(|bytes| PyBytes::new(py, &bytes)).map_err(raised)
    }

    /// Writes an EXR with all layers (and the pixel sums of a shard), or a tone-mapped PNG, by the extension of `path`.
    ///
    /// compression   of the EXR: 'zip', 'zips', 'piz' or 'none'; all are lossless
    /// half          store layers for which half floats suffice as such: the picture, its finished parts, albedo, normals
    /// multi_part    store each layer as a part of the EXR, for programs that unpack all channels of a part
    /// exr_naming    names of the channels of the EXR: 'plain' or 'blender'
    /// colorspace    of the EXR: 'rec709' or 'acescg'
    /// exposure      of the PNG, stops
    /// tonemap       of the PNG: 'agx', 'filmic', 'neutral' or 'srgb'
    /// contrast      of the tone curves 'agx' and 'filmic': 'very-high', 'high', 'medium-high', 'medium', 'medium-low',
    ///               'low' or 'very-low'
    #[pyo3(signature = (
        path, *, compression = "zip", half = false, multi_part = false, exr_naming = "plain", colorspace = "rec709",
        exposure = 0.0, tonemap = "agx", contrast = "medium"
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are those of Python's signature")]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        compression: &str,
        half: bool,
        multi_part: bool,
        exr_naming: &str,
        colorspace: &str,
        exposure: f32,
        tonemap: &str,
        contrast: &str,
    ) -> PyResult<()> {
        let compression = choice("save: compression", compression)?;
        let naming = choice("save: exr_naming", exr_naming)?;
        let colour_space = choice("save: colorspace", colorspace)?;
        let tonemap = choice("save: tonemap", tonemap)?;
        let look = Look { exposure, tonemap, contrast: choice("save: contrast", contrast)? };
        let options = exr::Options { compression, naming, half, multi_part, colour_space };
        let Image { set, attributes, sums } = self;
        let written = py.detach(|| write(&path, set, attributes, sums.as_ref(), options, look));
        written.map_err(raised)
    }
}

/// Reads an EXR of any program with all its layers, under their names in the file.
#[pyfunction]
pub fn read(py: Python<'_>, path: PathBuf) -> PyResult<Image> {
    let (set, attributes) = py.detach(|| exr::read(&path)).map_err(raised)?;
    Ok(Image { set, attributes, sums: None })
}

/// A read-only numpy view of a plane, without a copy.
fn view<'py>(this: &Bound<'py, Image>, plane: &Plane) -> PyResult<Bound<'py, PyAny>> {
    let set = &this.get().set;
    let values = shaped(ArrayView2::from_shape((set.height, set.width), &plane.values))?;
    // SAFETY: the plane belongs to `this`, which the array keeps alive. An image is frozen: its planes are neither
    // moved nor freed before it is, and nobody writes to them, this array not either (the next line).
    let array = unsafe { PyArray2::borrow_from_array(&values, this.clone().into_any()) };
    array.call_method1("setflags", (false,))?;
    Ok(array.into_any())
}

/// Checks that there is memory for `count` single precision numbers, because Rust ends the process if an allocation fails.
///
/// # Errors
/// MemoryError.
fn check_memory(count: usize) -> PyResult<()> {
    let bytes = (count as u64).saturating_mul(4);
    let checked = if bytes < memory::MIN_CHECKED_BYTES { Ok(()) } else { memory::require(bytes, "the arrays") };
    checked.map_err(|error| PyMemoryError::new_err(error.to_string()))
}

/// Copies of an array that exist at the same time: in single precision, in row order, by planes, and as triples per
/// pixel.
const ARRAY_COPIES: usize = 4;

/// Converts a numpy array to a layer with this name. Returns also its height and width.
fn layer(name: &str, given: &Bound<'_, PyAny>) -> PyResult<((usize, usize), Layer)> {
    let array = given.py().import("numpy")?.call_method1("asarray", (given,))?;
    check_memory(array.getattr("size")?.extract::<usize>()?.saturating_mul(ARRAY_COPIES))?;
    let array: PyArrayLikeDyn<'_, f32, AllowTypeChange> = array.extract()?;
    let array = array.as_array();
    let shape = array.shape().to_vec();
    let (height, width, depth) = match shape[..] {
        [height, width] => (height, width, 1),
        [height, width, depth @ 1..=4] => (height, width, depth),
        _ => {
            let cause = format!("layer \"{name}\": an array of shape {shape:?}");
            return Err(usage(cause, "layers are (H, W) or (H, W, C) with up to four components"));
        }
    };
    let components = match (name, depth) {
        (name, 3) if VECTORS.contains(&name) => "XYZ",
        ("Z" | "depth", 1) => "Z",
        _ => COMPONENTS[depth - 1],
    };
    let all = shaped(array.to_shape((height * width, depth)))?;
    let planes = components.chars().zip(all.columns()).map(|(component, values)| Plane {
        component: component.into(),
        sample: Sample::Float,
        values: values.to_vec(),
    });
    Ok(((height, width), Layer { name: name.into(), planes: planes.collect() }))
}

/// The picture with its estimated errors, or the layer `name`, of an image or a file, or an array (H, W, 3), without other
/// layers. `place` names the argument in errors.
pub fn picture(place: &str, given: &Bound<'_, PyAny>, name: Option<&str>) -> PyResult<LayerSet> {
    let name = name.unwrap_or("");
    let chosen = |set: &LayerSet| {
        let found =
            if name.is_empty() { set.find(caustique::film::Role::Beauty) } else { set.get(&current_name(name)) };
        let names = || set.layers.iter().map(|layer| format!("\"{}\"", layer.name)).collect::<Vec<_>>().join(", ");
        let layer =
            found.ok_or_else(|| usage(format!("{place}: no layer \"{name}\""), format!("there are {}", names())))?;
        // The page of a comparison shows the estimated errors of a picture.
        let error = set.get("Error").filter(|_| name.is_empty());
        let picture = Layer { name: String::new(), ..layer.clone() };
        let layers = std::iter::once(picture).chain(error.cloned()).collect();
        Ok(LayerSet { width: set.width, height: set.height, layers, iterations: set.iterations })
    };
    if let Ok(image) = given.cast::<Image>() {
        return chosen(&image.get().set);
    }
    if let Ok(path) = given.extract::<PathBuf>() {
        return chosen(&read(given.py(), path)?.set);
    }
    let ((height, width), layer) = layer("", given)?;
    Ok(LayerSet { width, height, layers: vec![layer], iterations: None })
}

/// The array, or a Python exception for its wrong shape.
fn shaped<T, E: std::fmt::Display>(array: Result<T, E>) -> PyResult<T> {
    array.map_err(|cause| raised(Error::new(ErrorKind::Image, "", cause)))
}

/// Width, height and pixels of an array (H, W, 3) of finite, non-negative radiance.
pub fn radiance(place: &str, array: &Bound<'_, PyAny>) -> PyResult<(u32, u32, Vec<[f32; 3]>)> {
    let ((height, width), layer) = layer(place, array)?;
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok()).filter(|&(w, h)| w > 0 && h > 0);
    let texels = layer.triples();
    match size {
        Some((width, height))
            if layer.planes.len() >= 3 && texels.iter().flatten().all(|x| *x >= 0.0 && x.is_finite()) =>
        {
            Ok((width, height, texels))
        }
        _ => Err(usage(
            format!("{place}: it is no array (H, W, 3) of numbers from zero up"),
            "radiance is finite and not negative",
        )),
    }
}
