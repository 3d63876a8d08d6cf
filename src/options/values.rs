//! Types of option values that no other module defines.

use crate::camera::{Filter, MAX_FILTER_WIDTH};
use crate::error::{Error, Result};
use crate::render::{MAX_SHARDS, Method, Shard};
use crate::scene::{Crop, MAX_SIZE};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use serde::{Serialize, Serializer};
use std::str::FromStr;
use std::sync::LazyLock;

/// The value of `--method`; `None` is `auto`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MethodChoice(pub Option<Method>);

/// Help text of `--method auto`.
const AUTO: &str =
    "vcm with the numbers of light paths, connections and merges that a pilot finds best; path or bdpt if some are 0";

impl MethodChoice {
    /// The name of the method, or `auto`.
    pub fn name(self) -> &'static str {
        self.0.map_or("auto", Method::name)
    }
}

impl ValueEnum for MethodChoice {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<MethodChoice>> = LazyLock::new(|| {
            let methods = Method::value_variants().iter().map(|method| MethodChoice(Some(*method)));
            std::iter::once(MethodChoice(None)).chain(methods).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self.0 {
            Some(method) => method.to_possible_value(),
            None => Some(PossibleValue::new("auto").help(AUTO)),
        }
    }
}

impl Serialize for MethodChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum OnOff {
    /// On
    On,
    /// Off
    Off,
}

/// Seeds of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FrameSeed {
    /// Another for each
    #[default]
    Vary,
    /// The same for all
    Same,
}

/// The value of `--initial-bandwidth`, the rule for the largest initial bandwidth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BandwidthChoice {
    /// The bandwidth is the distance to the k-th nearest photon.
    Knn,
    /// The bandwidth is a multiple of the pixel's footprint.
    Footprint,
    /// The bandwidth is a length in scene units.
    #[serde(untagged)]
    Length(f64),
}

impl FromStr for BandwidthChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "knn" => Ok(BandwidthChoice::Knn),
            "footprint" => Ok(BandwidthChoice::Footprint),
            length => match length.parse::<f64>() {
                Ok(r) if (1e-9..=1e9).contains(&r) => Ok(BandwidthChoice::Length(r)),
                Ok(_) => Err("a length must be from 1e-9 to 1e9".into()),
                Err(_) => Err("it is neither 'knn' nor 'footprint' nor a length".into()),
            },
        }
    }
}

/// The value of `--cppm-grid NA,NS`: cells in which the chi-squared test counts photons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct GridChoice {
    /// Number of annuli into which the kernel's disc is divided.
    pub annuli: usize,
    /// Number of sectors of each annulus.
    pub sectors: usize,
}

impl FromStr for GridChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once(',').and_then(|(a, s)| Some((a.parse().ok()?, s.parse().ok()?)));
        let cells =
            |annuli: usize, sectors: usize| annuli.checked_mul(sectors).filter(|cells| (2..=64).contains(cells));
        match parts {
            Some((annuli, sectors)) if cells(annuli, sectors).is_some() => Ok(GridChoice { annuli, sectors }),
            Some(_) => Err("there must be 2 to 64 cells".into()),
            None => Err("it must be NA,NS, such as 2,6".into()),
        }
    }
}

/// The value of `--crop`: a window of the picture.
#[derive(Clone, Debug, Serialize)]
pub struct CropChoice {
    /// The text that the user has given.
    pub window: String,
    /// The window that the text describes.
    #[serde(skip)]
    pub crop: Crop,
}

impl FromStr for CropChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let fault =
            || "it must be X,Y,W,H, in pixels (320,0,640,720) or in shares of the picture (0.25,0,0.5,1)".to_string();
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let parts: [&str; 4] = parts.try_into().map_err(|_| fault())?;
        let shares = parts.iter().any(|part| part.contains('.')) || parts == ["0", "0", "1", "1"];
        let crop = if shares {
            let numbers = parts.map(|part| part.parse::<f64>().ok().filter(|x| (0.0..=1.0).contains(x)));
            let [Some(x), Some(y), Some(w), Some(h)] = numbers else { return Err(fault()) };
            Crop::Shares([x, y, w, h])
        } else {
            let numbers = parts.map(|part| part.parse::<u32>().ok());
            let [Some(x), Some(y), Some(w), Some(h)] = numbers else { return Err(fault()) };
            Crop::Pixels([x, y, w, h])
        };
        // Rejects windows that are empty or outside the largest possible picture.
        match crop.window((MAX_SIZE, MAX_SIZE)) {
            Some(_) => Ok(CropChoice { window: text.into(), crop }),
            None => Err("the window is empty or not within the picture".into()),
        }
    }
}

/// Parses `--filter`: the name of a pixel filter, and optionally its width in pixels.
///
/// # Errors
/// The name or the width is invalid.
pub fn filter(words: &[String]) -> Result<Filter> {
    let fault = |cause: String| {
        let filters = "box, gaussian or blackman-harris";
        Error::usage(cause).hint(format!(
            "give --filter {filters} and perhaps a width from 0.1 to {MAX_FILTER_WIDTH} pixels, and the scene before it"
        ))
    };
    let width = match words.get(1) {
        None => None,
        Some(text) => match text.parse::<f32>().ok().filter(|width| (0.1..=MAX_FILTER_WIDTH).contains(width)) {
            Some(width) => Some(width),
            None => return Err(fault(format!("--filter: '{text}' is no width from 0.1 to {MAX_FILTER_WIDTH} pixels"))),
        },
    };
    match words.first().map(String::as_str) {
        Some("box") => Ok(Filter::Box(width.unwrap_or(1.0))),
        Some("gaussian") => Ok(Filter::Gaussian(width.unwrap_or(1.5))),
        Some("blackman-harris") => Ok(Filter::BlackmanHarris(width.unwrap_or(1.5))),
        other => Err(fault(format!("--filter: there is no filter '{}'", other.unwrap_or_default()))),
    }
}

impl FromStr for Shard {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (Shard { index, count }).is_sound() => Ok(Shard { index, count }),
            Some((_, 0)) => Err("there is no shard of 0".into()),
            Some((_, count)) if count <= MAX_SHARDS => Err(format!("shards of {count} are 0 to {}", count - 1)),
            Some(_) => Err(format!("there are at most {MAX_SHARDS} shards")),
            None => Err("it must be I/N, such as 0/4".into()),
        }
    }
}
