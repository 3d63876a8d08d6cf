//! Network files and their metadata.

use std::borrow::Cow;
use std::path::Path;

use super::tensor;
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::git_lfs;

/// The bytes of a neural network's ONNX file, and the name of the file for messages.
#[derive(Clone, Debug)]
pub struct Model {
    pub(super) name: String,
    pub(super) bytes: Cow<'static, [u8]>,
}

/// Purpose of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// It combines bandwidth levels by equation (6).
    Levels,
    /// It makes the picture towards which the finish moves an estimate of one level.
    Finish,
}

impl Model {
    /// The network `compact`, which ships with the program; `models/compact.txt` describes its training.
    pub fn compact() -> Self {
        Model { name: "compact".into(), bytes: Cow::Borrowed(include_bytes!("models/compact.onnx")) }
    }

    /// Reads a network made by `scripts/lab/train/export_network.py`.
    ///
    /// # Errors
    /// [`ErrorKind::Io`]: the file cannot be read. Its contents are checked by [`Network::load`](super::Network::load).
    pub fn from_file(path: &Path) -> Result<Self> {
        let bytes = files::read(path).map_err(|cause| {
            Error::io(path, &cause)
                .hint("--model takes compact, or an ONNX file made by scripts/lab/train/export_network.py")
        })?;
        git_lfs::check(&bytes, path.display())?;
        Ok(Model { name: path.display().to_string(), bytes: Cow::Owned(bytes) })
    }

    /// The network that `--model` names: `compact`, or the path of a file.
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

    /// The network's purpose by the bytes of its metadata. Options depend on it before ONNX Runtime is loaded.
    pub fn purpose(&self) -> Purpose {
        const FINISH: &[u8] = b"caustique.kind\x12\x06finish";
        let is_finish = self.bytes.windows(FINISH.len()).any(|bytes| bytes == FINISH);
        if is_finish { Purpose::Finish } else { Purpose::Levels }
    }

    /// BLAKE3 hash of the network's file, in hexadecimal digits.
    pub fn hash(&self) -> String {
        blake3::hash(&self.bytes).to_hex().to_string()
    }
}

/// Version of the input planes of networks of the finish. `finish/network.rs` makes the planes.
pub const FINISH_VERSION: usize = 2;
/// Number of these planes.
pub const FINISH_PLANES: usize = 27;

/// The form of a network's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputForm {
    /// Output tensor `features`: affinities of pairs of pixels follow from per-pixel features, see
    /// [`affinity`](super::affinity).
    Features {
        /// Number of dimensions of the feature space.
        dimensions: usize,
    },
    /// Output tensor `weights`: a weight for every pair of levels and every pixel of the window, see
    /// [`kernel`](super::kernel).
    Weights,
    /// Output tensor `picture`: the picture itself, in the exposure of the input planes.
    Picture,
}

/// Metadata of a network file: the form of its output, and the sizes of its input and window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Metadata {
    /// Form of the network's output.
    pub form: OutputForm,
    /// Number of bandwidth levels in the network's input, m; 1 for a network of the finish.
    pub levels: usize,
    /// Pixels along the side of the square window of equation (6), odd.
    pub window: usize,
    /// Distances of the window's pixels, in pixels of the image; the network has weights for each of them.
    pub dilations: Vec<usize>,
    /// Pairs of bandwidth levels whose correlated level also has a weight alone, without neighbours.
    pub identities: Vec<usize>,
    /// Pixels per cell of the network's coarsest grid; input sizes are multiples of it.
    pub stride: usize,
    /// Radius in pixels of the input that one pixel of the output depends on.
    pub halo: usize,
    /// Description of the network's training, in words.
    pub training: String,
}

/// Maximum number of floats in the network's output for one tile of the picture: 128 MiB.
const MAX_TILE_FLOATS: usize = 32 << 20;
/// Maximum number of windows of a network.
const MAX_DILATIONS: usize = 4;
/// Maximum number of pixels in a tile of the picture. The halo of a tile of this size is already relatively small.
const MAX_TILE_PIXELS: usize = 512 * 512;
/// Maximum number of pixels in a tile for networks of the finish, which take many planes for each pixel.
const MAX_FINISH_TILE_PIXELS: usize = 384 * 384;

impl Metadata {
    /// Reads the network's metadata through `get`, which returns the value of a key without its prefix `caustique.`.
    pub(super) fn read(get: impl Fn(&str) -> Option<String>) -> std::result::Result<Self, String> {
        let text = |key: &str| get(key).ok_or_else(|| format!("its metadata lacks caustique.{key}"));
        let number = |key: &str, least: usize, most: usize| {
            let value = text(key)?;
            let parsed = value.parse().ok().filter(|n| (least..=most).contains(n));
            parsed.ok_or_else(|| format!("its caustique.{key} is {value:?}, not a number from {least} to {most}"))
        };
        let kind = text("kind")?;
        let (key, made) =
            if kind == "finish" { ("version", FINISH_VERSION) } else { ("normalisation", tensor::VERSION as usize) };
        let version = number(key, 0, u32::MAX as usize)?;
        if version != made {
            return Err(format!("it expects input version {version}, this program makes {made}"));
        }
        let form = match kind.as_str() {
            "features" => OutputForm::Features { dimensions: number("features", 1, super::affinity::MAX_DIMENSIONS)? },
            "weights" => OutputForm::Weights,
            "finish" => OutputForm::Picture,
            other => return Err(format!("its caustique.kind is {other:?}, not features, weights or finish")),
        };
        let of_picture = Metadata {
            form,
            levels: 1,
            window: 1,
            dilations: vec![1],
            identities: Vec::new(),
            stride: number("stride", 1, 64)?,
            halo: number("halo", 0, 1024)?,
            training: get("training").unwrap_or_else(|| "not said".into()),
        };
        if form == OutputForm::Picture {
            return Ok(of_picture);
        }
        let window = number("window", 1, 63)?;
        if window % 2 == 0 {
            return Err(format!("its window of {window} pixels has no centre"));
        }
        let pairs = get("pairs").unwrap_or_else(|| "multi".into());
        if pairs != "multi" {
            return Err(format!("it combines the pictures {pairs:?}, this program those of \"multi\""));
        }
        let levels = number("levels", 2, 16)?;
        // Networks of earlier versions have neither key.
        let list = |key: &str, default: &str, least: usize, most: usize| {
            let value = get(key).unwrap_or_else(|| default.into());
            let one = |text: &str| text.parse().ok().filter(|n| (least..=most).contains(n));
            let parsed: Option<Vec<usize>> = value.split(',').filter(|text| !text.is_empty()).map(one).collect();
            parsed.ok_or_else(|| format!("its caustique.{key} is {value:?}, not numbers from {least} to {most}"))
        };
        let (dilations, identities) = (list("dilations", "1", 1, 16)?, list("identities", "", 0, levels - 2)?);
        if dilations.is_empty() || dilations.len() > MAX_DILATIONS {
            return Err(format!("it has {} dilations, not 1 to {MAX_DILATIONS}", dilations.len()));
        }
        if form == OutputForm::Weights && (dilations != [1] || !identities.is_empty()) {
            return Err("it has dilations or identities, which need the kind features".into());
        }
        Ok(Metadata { levels, window, dilations, identities, ..of_picture })
    }

    /// Number of channels of the network's input tensor, `input`.
    pub fn input_channels(&self) -> usize {
        match self.form {
            OutputForm::Picture => FINISH_PLANES,
            _ => tensor::channels(self.levels),
        }
    }

    /// Name of the network's output tensor: `features`, `weights` or `picture`.
    pub fn output(&self) -> &'static str {
        match self.form {
            OutputForm::Features { .. } => "features",
            OutputForm::Weights => "weights",
            OutputForm::Picture => "picture",
        }
    }

    /// Number of channels of the network's output tensor.
    pub fn output_channels(&self) -> usize {
        let pairs = self.levels - 1;
        match self.form {
            OutputForm::Features { dimensions } => {
                self.dilations.len() * pairs * (dimensions + super::affinity::SCALARS) + self.identities.len()
            }
            OutputForm::Weights => pairs * self.window * self.window,
            OutputForm::Picture => 3,
        }
    }

    /// Radius in pixels of the network output that the result at a pixel depends on.
    pub fn neighbour_radius(&self) -> usize {
        match self.form {
            OutputForm::Features { .. } => self.window / 2 * self.dilations.iter().copied().max().unwrap_or(1),
            OutputForm::Weights | OutputForm::Picture => 0,
        }
    }

    /// Number of pixels of the tiles in which the network is run.
    pub(crate) fn tile_pixels(&self) -> usize {
        match self.form {
            OutputForm::Picture => MAX_FINISH_TILE_PIXELS,
            _ => (MAX_TILE_FLOATS / self.output_channels()).min(MAX_TILE_PIXELS),
        }
    }
}
