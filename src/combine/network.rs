//! A network in ONNX Runtime: it is loaded, checked against its metadata, and run on tiles.

use ort::ep::CPU;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorRef, ValueType};

use super::model::{Metadata, Model};
use super::output::{NetworkOutput, Rect};
use super::runtime::Runtime;
use super::tile::{self, Tile};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::system::SilencedStderr;

/// A neural network that is loaded for inference.
pub struct Network {
    session: Session,
    metadata: Metadata,
    name: String,
}

impl Network {
    /// Loads and checks `model` for inference with `threads` threads.
    ///
    /// # Errors
    /// [`ErrorKind::Model`]: the file is not a network, or its metadata or tensors do not fit.
    pub fn load(model: &Model, runtime: &Runtime, threads: usize) -> Result<Self> {
        let refuse = |cause: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Model, format!("model {}", model.name), one_line(cause))
                .hint("make network files with scripts/lab/train/export_network.py")
        };
        let session = open(model, runtime, threads).map_err(|cause| refuse(&cause))?;
        let metadata = {
            let metadata = session.metadata().map_err(|cause| refuse(&cause))?;
            Metadata::read(|key| metadata.custom(&format!("caustique.{key}"))).map_err(|cause| refuse(&cause))?
        };
        check_outlets(&session, &metadata).map_err(|cause| refuse(&cause))?;
        Ok(Network { session, metadata, name: model.name.clone() })
    }

    /// Metadata of the network's file: its inputs, windows and levels.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Makes a picture in tiles of about `pixels` pixels each. `input` makes the network's input of a rectangle, see
    /// [`rows`](super::tensor::rows), `colours` the pixels of a tile's core from the output, row by row.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_tiled(
        &mut self,
        size: Size,
        pixels: usize,
        input: impl Fn(Rect) -> Vec<f32>,
        colours: impl Fn(&Tile, NetworkOutput) -> Vec<[f32; 3]>,
    ) -> Result<Picture> {
        let mut image = Picture::filled(size, [0.0; 3]);
        for tile in tile::tiles(size, &self.metadata, pixels) {
            let output = self.run(&input(tile.input), tile.input)?;
            for (y, row) in colours(&tile, output).chunks(tile.core.width()).enumerate() {
                let start = (tile.core.y0 + y) * size.width + tile.core.x0;
                image[start..start + row.len()].copy_from_slice(row);
            }
        }
        Ok(image)
    }

    /// Runs the network on `input`, the tensor of `rect`.
    ///
    /// # Errors
    /// [`ErrorKind::Model`]: ONNX Runtime fails or the output has the wrong shape.
    pub fn run(&mut self, input: &[f32], rect: Rect) -> Result<NetworkOutput> {
        let Network { session, metadata, name } = self;
        let fail =
            |cause: &dyn std::fmt::Display| Error::new(ErrorKind::Model, format!("model {name}"), one_line(cause));
        let shape = [1, metadata.input_channels(), rect.height(), rect.width()];
        let tensor = TensorRef::from_array_view((shape, input)).map_err(|cause| fail(&cause))?;
        let outputs = session.run(ort::inputs!["input" => tensor]).map_err(|cause| fail(&cause))?;
        let output = outputs.get(metadata.output()).ok_or_else(|| fail(&"the output is missing"))?;
        let (shape, data) = output.try_extract_tensor::<f32>().map_err(|cause| fail(&cause))?;
        let expected = [1, metadata.output_channels(), rect.height(), rect.width()].map(|n| n as i64);
        if **shape != expected {
            return Err(fail(&format!("the output has shape {shape:?} instead of {expected:?}")));
        }
        let (dilations, identities) = (metadata.dilations.clone(), metadata.identities.clone());
        Ok(NetworkOutput { rect, window: metadata.window, dilations, identities, data: data.to_vec() })
    }
}

fn open(model: &Model, runtime: &Runtime, threads: usize) -> ort::Result<Session> {
    let mut builder = Session::builder(runtime.environment())?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads)?
        // Idle inference threads must not spin while equation (6) needs the cores.
        .with_intra_op_spinning(false)?
        // Tiles at the borders have other shapes; an arena keeps the memory of each.
        .with_memory_pattern(false)?
        .with_execution_providers([CPU::default().with_arena_allocator(false).build()])?;
    let _quiet = SilencedStderr::start();
    builder.commit_from_memory(&model.bytes)
}

fn check_outlets(session: &Session, metadata: &Metadata) -> std::result::Result<(), String> {
    let channels = |name: &str, dtype: &ValueType| match dtype {
        ValueType::Tensor { shape, .. } if shape.len() == 4 => Ok(shape[1]),
        other => Err(format!("its {name} is no image tensor but {other}")),
    };
    let find = |outlets: &[Outlet], name: &str| {
        let found = outlets.iter().find(|outlet| outlet.name() == name);
        channels(name, found.ok_or_else(|| format!("it has no tensor named {name:?}"))?.dtype())
    };
    let expected = [("input", metadata.input_channels()), (metadata.output(), metadata.output_channels())];
    let found = [find(session.inputs(), "input")?, find(session.outputs(), metadata.output())?];
    for ((name, expected), found) in expected.into_iter().zip(found) {
        // A negative number is a dynamic size.
        if found >= 0 && found != expected as i64 {
            return Err(format!("its {name} has {found} channels, its metadata imply {expected}"));
        }
    }
    Ok(())
}

/// `message` in one line; messages of ONNX Runtime can have several.
fn one_line(message: &dyn std::fmt::Display) -> String {
    message.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
