//! Values of options that no other module defines.

use crate::camera::{Filter, MAX_FILTER_WIDTH};
use crate::error::{Error, Result};
use crate::scene::{Crop, MAX_SIZE};
use clap::ValueEnum;
use serde::Serialize;
use std::str::FromStr;

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
