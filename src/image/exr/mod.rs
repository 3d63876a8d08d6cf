//! OpenEXR, in and out.
//!
//! Written: one part of scan lines, channels sorted by name, attributes sorted by name, chunks in order of lines; the
//! same layers and attributes give the same bytes whatever the number of threads. Read: any flat EXR that the `exr`
//! crate decodes.

mod header;
mod read;
mod write;
mod zip;

use std::collections::BTreeMap;

pub use read::read;
pub use write::{Compression, Options, write, write_followed};

/// Name and version of the program, for headers.
const SOFTWARE: &str = concat!("caustique ", env!("CARGO_PKG_VERSION"));

use crate::error::{Error, ErrorKind, Result};
use crate::film::ascii_json;
use serde::{Deserialize, Serialize};

/// Name of the attribute that holds our JSON object.
pub const ATTRIBUTE: &str = "caustique";

/// What a header says besides its channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    /// String attributes by name, ASCII only: Python's OpenEXR refuses a whole file for one byte above 127.
    pub texts: BTreeMap<String, String>,
    /// Where the picture is in a larger one, and what camera has seen it. Not read from files.
    pub frame: Option<Frame>,
    /// Where the picture is in a film. Not read from files.
    pub moment: Moment,
}

/// Where a picture is in a film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Its number: OpenEXR's `imageCounter`.
    pub number: Option<i32>,
    /// Frames in a second, as a fraction of two numbers above zero: OpenEXR's `framesPerSecond`.
    pub rate: Option<[u32; 2]>,
}

impl Moment {
    /// Hours, minutes, seconds and frames at which the picture is shown, frame 0 at midnight and frames counted without
    /// leaps, as SMPTE 12M does it. `None` without a number or a rate, and for what a time code cannot say: more than
    /// 30 frames in a second, frames before the first or of another day.
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

/// A picture as a part of a larger one, the display window, and its camera. Matrices are OpenEXR's: row by row, for row
/// vectors on their left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Width and height of the display window (pixels).
    pub display: [u32; 2],
    /// Left and top edge of the picture in it (pixels).
    pub corner: [u32; 2],
    /// World to camera: x to the right, y up, z along the view.
    pub world_to_camera: [f32; 16],
    /// World to the display window: x to the right and y down, both from 0 to 1.
    pub world_to_ndc: [f32; 16],
}

impl Attributes {
    /// The attribute `caustique` with this object.
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

    /// The object in the attribute `caustique`; `None` if the file is not ours.
    pub fn object(&self) -> Option<serde_json::Value> {
        serde_json::from_str(self.texts.get(ATTRIBUTE)?).ok()
    }
}
