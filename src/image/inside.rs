//! The pixels whose camera paths hit smooth glass or a mirror first, where the eye sees noise most.

use crate::film::cryptomatte::coverage;
use crate::film::{CRYPTOMATTES, LayerSet};
use crate::image::exr::Attributes;
use serde_json::Value;

/// Key of the header's list of the materials that are smooth glass or mirrors, perfect or slightly rough.
pub const SMOOTH_MATERIALS: &str = "smooth_materials";
/// Share of a pixel that such materials cover if the pixel counts.
const MIN_COVERAGE: f32 = 0.5;

/// Whether each pixel of a file shows smooth glass or a mirror, by the cryptomatte of materials and the header; `None` if the
/// file does not have both.
pub fn smooth_pixels(set: &LayerSet, attributes: &Attributes) -> Option<Vec<bool>> {
    let header = attributes.object()?;
    let names = header[SMOOTH_MATERIALS].as_array()?.iter().filter_map(Value::as_str);
    let covered = coverage(set, CRYPTOMATTES[1], names)?;
    Some(covered.into_iter().map(|share| share > MIN_COVERAGE).collect())
}
