//! Reading and writing OpenEXR.
//!
//! The writer makes one part of scan lines, with channels and attributes sorted by name and chunks in order of lines:
//! equal layers and attributes give equal bytes with any number of threads. The reader takes every flat EXR that the
//! `exr` crate decodes.

mod colour_space;
mod header;
mod read;
mod whole;
mod write;
mod zip;

use std::collections::BTreeMap;

pub use colour_space::ColourSpace;
pub use read::{has_overscan, read, read_header, read_layers, read_render, read_window};
pub use whole::check_whole;
pub use write::{Compression, Options, write, write_draft, write_followed};

/// Name and version of the program, for the headers of EXR files.
const SOFTWARE: &str = concat!("caustique ", env!("CARGO_PKG_VERSION"));

use crate::error::{Error, ErrorKind, Result};
use crate::film::ascii_json;
use serde::{Deserialize, Serialize};

/// Name of the header attribute that holds our JSON object about the render.
pub const ATTRIBUTE: &str = "caustique";

/// The attributes in the header of an EXR, besides its channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    /// String attributes by name, ASCII only: Python's OpenEXR refuses a whole file for one byte above 127.
    pub texts: BTreeMap<String, String>,
    /// Position of the picture in a larger one, and the camera; `None` in files that lack its matrix.
    pub frame: Option<Frame>,
    /// Frame number and frame rate.
    pub moment: Moment,
}

/// Frame number and frame rate of a picture of an animation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Frame number: OpenEXR's `imageCounter`.
    pub number: Option<i32>,
    /// Frames per second, as a fraction of two numbers above zero: OpenEXR's `framesPerSecond`.
    pub rate: Option<[u32; 2]>,
}

impl Moment {
    /// SMPTE 12M time code without drop frames: hours, minutes, seconds, frames, with frame 0 at midnight. `None` without
    /// a number or a rate, at more than 30 frames per second, and for negative frames or frames after 24 hours.
    pub fn time_code(self) -> Option<[u8; 4]> {
        let (number, [frames, of_seconds]) = (u32::try_from(self.number?).ok()?, self.rate?);
        let rate = frames.checked_add(of_seconds / 2)?.checked_div(of_seconds)?;
        if !(1..=30).contains(&rate) {
            return None;
        }
        let seconds = number / rate;
        let parts = [seconds / 3600, seconds / 60 % 60, seconds % 60, number % rate];
        (parts[0] < 24).then(|| parts.map(|part| part as u8))
    }
}

/// Position of a picture in the display window of a larger one, and its camera. Matrices are in OpenEXR's convention:
/// row by row, multiplied by row vectors from the left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Width and height of the display window (pixels).
    pub display: [u32; 2],
    /// Left and top edge of the picture in the display window (pixels).
    pub corner: [u32; 2],
    /// World to camera: x to the right, y up, z along the view.
    pub world_to_camera: [f32; 16],
    /// World to the display window: x to the right and y down, both from 0 to 1; `None` for a panorama.
    pub world_to_ndc: Option<[f32; 16]>,
}

impl Attributes {
    /// Attributes with the JSON `object` under [`ATTRIBUTE`].
    pub fn of(object: &impl serde::Serialize) -> Result<Self> {
        let mut attributes = Attributes::default();
        attributes.insert(ATTRIBUTE, object)?;
        Ok(attributes)
    }

    /// Adds an attribute that holds `object` as JSON, non-ASCII characters escaped.
    pub fn insert(&mut self, name: &str, object: &impl serde::Serialize) -> Result<()> {
        let json = serde_json::to_string(object)
            .map_err(|cause| Error::new(ErrorKind::Image, format!("attribute \"{name}\""), cause))?;
        self.texts.insert(name.to_owned(), ascii_json(&json));
        Ok(())
    }

    /// The JSON object about the render in the attribute `caustique`; `None` if caustique has not written the file.
    pub fn object(&self) -> Option<serde_json::Value> {
        serde_json::from_str(self.texts.get(ATTRIBUTE)?).ok()
    }

    /// Number of iterations of the render; `None` if caustique has not written the file.
    pub fn iterations(&self) -> Option<u64> {
        self.object()?["iterations"].as_u64()
    }
}
