//! A network in ONNX Runtime: it is loaded, checked against its metadata, and run on tiles.

use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorRef, ValueType};

use super::model::{Metadata, Model, WeightForm};
use super::output::{NetworkOutput, Rect};
use super::runtime::Runtime;
use super::tensor;
use crate::error::{Error, ErrorKind, Result};
use crate::system::SilencedStderr;

/// The network's weights for equation (6) over one tile, in one of two forms.
#[derive(Debug)]
pub enum Weights {
    /// Affinities from features, see [`affinity`](super::affinity).
    Features(NetworkOutput),
    /// Explicit weights for every pixel of the window, see [`kernel`](super::kernel).
    Kernel(NetworkOutput),
}

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

    /// Runs the network on `input`, the tensor of `rect` from [`tensor::fill`].
    ///
    /// # Errors
    /// [`ErrorKind::Model`]: ONNX Runtime fails or the output has the wrong shape.
    pub fn run(&mut self, input: &[f32], rect: Rect) -> Result<Weights> {
        let Network { session, metadata, name } = self;
        let fail =
            |cause: &dyn std::fmt::Display| Error::new(ErrorKind::Model, format!("model {name}"), one_line(cause));
        let shape = [1, tensor::channels(metadata.levels), rect.height(), rect.width()];
        let tensor = TensorRef::from_array_view((shape, input)).map_err(|cause| fail(&cause))?;
        let outputs = session.run(ort::inputs!["input" => tensor]).map_err(|cause| fail(&cause))?;
        let output = outputs.get(metadata.output()).ok_or_else(|| fail(&"the output is missing"))?;
        let (shape, data) = output.try_extract_tensor::<f32>().map_err(|cause| fail(&cause))?;
        let expected = [1, metadata.output_channels(), rect.height(), rect.width()].map(|n| n as i64);
        if **shape != expected {
            return Err(fail(&format!("the output has shape {shape:?} instead of {expected:?}")));
        }
        let (dilations, identities) = (metadata.dilations.clone(), metadata.identities.clone());
        let output = NetworkOutput { rect, window: metadata.window, dilations, identities, data: data.to_vec() };
        Ok(match metadata.form {
            WeightForm::Features { .. } => Weights::Features(output),
            WeightForm::Weights => Weights::Kernel(output),
        })
    }
}

fn open(model: &Model, runtime: &Runtime, threads: usize) -> ort::Result<Session> {
    let mut builder = Session::builder(runtime.environment())?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads)?
        // Idle inference threads must not spin while equation (6) needs the cores.
        .with_intra_op_spinning(false)?;
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
    let expected = [("input", tensor::channels(metadata.levels)), (metadata.output(), metadata.output_channels())];
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
