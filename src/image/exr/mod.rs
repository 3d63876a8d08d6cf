//! OpenEXR, in and out.
//!
//! Written: one part of scan lines, channels sorted by name, attributes sorted by name, chunks in order of lines; the
//! same layers and attributes give the same bytes whatever the number of threads. Read: any flat EXR that the `exr`
//! crate decodes.

mod header;
mod read;
mod write;

use std::collections::BTreeMap;

pub use read::read;
pub use write::{Compression, Options, write};

use crate::error::{Error, Kind, Result};
use crate::film::ascii_json;

/// Name of the attribute that holds our JSON object.
pub const ATTRIBUTE: &str = "caustique";

/// String attributes of a header by name, ASCII only: Python's OpenEXR refuses a whole file for one byte above 127.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Attributes(pub BTreeMap<String, String>);

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
            .map_err(|cause| Error::new(Kind::Image, format!("attribute \"{name}\""), cause))?;
        self.0.insert(name.to_owned(), ascii_json(&json));
        Ok(())
    }

    /// The object in the attribute `caustique`; `None` if the file is not ours.
    pub fn object(&self) -> Option<serde_json::Value> {
        serde_json::from_str(self.0.get(ATTRIBUTE)?).ok()
    }
}
