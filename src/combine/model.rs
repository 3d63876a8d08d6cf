//! Network files: where they come from, and what they say about themselves.

use std::borrow::Cow;
use std::path::Path;

use super::tensor;
use crate::error::{Error, ErrorKind, Result};

/// An ONNX file in memory, with a name for messages.
#[derive(Clone, Debug)]
pub struct Model {
    pub(super) name: String,
    pub(super) bytes: Cow<'static, [u8]>,
}

impl Model {
    /// The network that ships with the program; `models/compact.txt` says how it was trained.
    pub fn compact() -> Self {
        Model { name: "compact".into(), bytes: Cow::Borrowed(include_bytes!("models/compact.onnx")) }
    }

    /// A network made by `scripts/lab/train/export_network.py`.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when the file cannot be read. What it holds is checked by [`Combiner::new`](super::Combiner::new).
    pub fn from_file(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|cause| {
            Error::io(path, &cause)
                .hint("--model takes compact, or an ONNX file made by scripts/lab/train/export_network.py")
        })?;
        Ok(Model { name: path.display().to_string(), bytes: Cow::Owned(bytes) })
    }

    /// What `--model` means: `compact`, or the path of a file.
    ///
    /// # Errors
    /// As [`from_file`](Self::from_file); `paper` without a file of that name says how to make one.
    pub fn open(name: &str) -> Result<Self> {
        match name {
            "compact" => Ok(Model::compact()),
            "paper" if !Path::new(name).exists() => {
                let cause = "the paper's network is not part of the program";
                Err(Error::new(ErrorKind::Model, "paper", cause)
                    .hint("train it with scripts/lab/train/train.py --arch paper and give the exported file"))
            }
            path => Model::from_file(Path::new(path)),
        }
    }
}

/// How a network expresses the weights of equation (6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contract {
    /// Output `features`: pairwise affinities from per-pixel features, see [`affinity`](super::affinity).
    Features {
        /// Dimensions of the feature space.
        dimensions: usize,
    },
    /// Output `weights`: a weight for every pair and every pixel of the window, see [`kernel`](super::kernel).
    Weights,
}

/// A network's own description, from its metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Facts {
    /// How weights are expressed.
    pub contract: Contract,
    /// Levels it takes, m.
    pub levels: usize,
    /// Side of the square window, odd.
    pub window: usize,
    /// Its coarsest grid has one cell per so many pixels: inputs must be multiples.
    pub stride: usize,
    /// Receptive radius, pixels.
    pub halo: usize,
    /// How, on what and how long it was trained.
    pub training: String,
}

/// Numbers a tile may hold in one network output: 32 Mi floats are 128 MiB.
const TILE_FLOATS: usize = 32 << 20;
/// A tile needs no more pixels than this: its halo is small beside it already.
const TILE_PIXELS: usize = 512 * 512;

impl Facts {
    /// Reads metadata through `get`, which returns the value of a key without its prefix `caustique.`.
    pub(super) fn read(get: impl Fn(&str) -> Option<String>) -> std::result::Result<Self, String> {
        let text = |key: &str| get(key).ok_or_else(|| format!("its metadata lacks caustique.{key}"));
        let number = |key: &str, least: usize, most: usize| {
            let value = text(key)?;
            let parsed = value.parse().ok().filter(|n| (least..=most).contains(n));
            parsed.ok_or_else(|| format!("its caustique.{key} is {value:?}, not a number from {least} to {most}"))
        };
        let version = number("normalisation", 0, u32::MAX as usize)?;
        if version != tensor::VERSION as usize {
            return Err(format!("it expects input version {version}, this program makes {}", tensor::VERSION));
        }
        let contract = match text("kind")?.as_str() {
            "features" => Contract::Features { dimensions: number("features", 1, super::affinity::MAX_DIMENSIONS)? },
            "weights" => Contract::Weights,
            other => return Err(format!("its caustique.kind is {other:?}, neither features nor weights")),
        };
        let window = number("window", 1, 63)?;
        if window % 2 == 0 {
            return Err(format!("its window of {window} pixels has no centre"));
        }
        Ok(Facts {
            contract,
            levels: number("levels", 2, 16)?,
            window,
            stride: number("stride", 1, 64)?,
            halo: number("halo", 0, 1024)?,
            training: get("training").unwrap_or_else(|| "not said".into()),
        })
    }

    /// Name of the output that the contract asks for.
    pub fn output(&self) -> &'static str {
        match self.contract {
            Contract::Features { .. } => "features",
            Contract::Weights => "weights",
        }
    }

    /// Channels of that output.
    pub fn output_channels(&self) -> usize {
        let pairs = self.levels - 1;
        match self.contract {
            Contract::Features { dimensions } => pairs * (dimensions + super::affinity::SCALARS),
            Contract::Weights => pairs * self.window * self.window,
        }
    }

    /// How far around a pixel the network's output is needed for that pixel's result.
    pub fn neighbour_radius(&self) -> usize {
        match self.contract {
            Contract::Features { .. } => self.window / 2,
            Contract::Weights => 0,
        }
    }

    /// Pixels a tile should have.
    pub(super) fn tile_pixels(&self) -> usize {
        (TILE_FLOATS / self.output_channels()).min(TILE_PIXELS)
    }
}
