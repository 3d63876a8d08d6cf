//! Reads the EXR of a render to finish it.

use crate::error::Result;
use crate::film::{LayerSet, Naming, VIEW_LAYER, ascii_json, current_name, plain_name, take_plain_names};
use crate::image::exr::{self, Attributes};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::path::Path;

/// The EXR of a render of this or another program.
pub struct RenderedFile {
    /// All layers, under plain names.
    pub set: LayerSet,
    /// Attributes of the EXR header, such as the JSON object `caustique`.
    pub attributes: Attributes,
    /// Names of the file's channels, which its cryptomatte attributes also use.
    pub naming: Naming,
    /// Remarks for the user, such as on layers that are left out.
    pub remarks: Vec<String>,
}

impl RenderedFile {
    /// Reads a file. Layers whose names and text attributes that cannot be written are left out, with a remark.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read(path: &Path) -> Result<RenderedFile> {
        let mut file = RenderedFile::read_layers(path, |_| true)?;
        if exr::has_overscan(path)? {
            file.remarks.push(format!("{}: what lies outside of its display window is left out", path.display()));
        }
        Ok(file)
    }

    /// The header of a file: its layers lack their values. Reads no pixels.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read_header(path: &Path) -> Result<RenderedFile> {
        Ok(RenderedFile::of(path, exr::read_header(path)?))
    }

    /// A file with the layers alone whose plain names `wanted` accepts.
    ///
    /// # Errors
    /// As for [`exr::read`].
    pub fn read_layers(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<RenderedFile> {
        let view = Naming::view_layer(&exr::read_header(path)?.0);
        let wanted = |name: &str| wanted(&current_name(plain_name(&in_view_layer(name, view.as_deref()))));
        Ok(RenderedFile::of(path, exr::read_render(path, wanted)?))
    }

    fn of(path: &Path, (mut set, mut attributes): (LayerSet, Attributes)) -> RenderedFile {
        let view = Naming::view_layer(&set);
        if let Some(view) = &view {
            set.layers.iter_mut().for_each(|layer| layer.name = in_view_layer(&layer.name, Some(view)).into_owned());
            let names = attributes.texts.iter_mut().filter(|(name, _)| name.starts_with("cryptomatte/"));
            names.for_each(|(_, text)| *text = in_view_layer(text, Some(view)).into_owned());
        }
        let naming = Naming::of(&set);
        let remark = |name: String| {
            format!("{}: layer \"{name}\" cannot be written under this name and is left out", path.display())
        };
        let mut remarks: Vec<String> = take_plain_names(&mut set).into_iter().map(remark).collect();
        if let Some(frame) = &mut attributes.frame {
            frame.world_to_camera = naming.from_own_axes(frame.world_to_camera);
            frame.world_to_ndc = frame.world_to_ndc.map(|matrix| naming.from_own_axes(matrix));
        }
        if let Some(view) = view {
            remarks.push(format!("{}: the view layer \"{view}\" will be called {VIEW_LAYER}", path.display()));
        }
        for name in take_ascii(&mut attributes) {
            remarks.push(format!("{}: attribute \"{name}\" is not ASCII and is left out", path.display()));
        }
        RenderedFile { set, attributes, naming, remarks }
    }
}

/// The name of a layer in a file whose view layer has another name than usual, as it would be with the usual one.
fn in_view_layer<'n>(name: &'n str, view: Option<&str>) -> Cow<'n, str> {
    let pass = view.and_then(|view| name.strip_prefix(view)?.strip_prefix('.'));
    pass.map_or(Cow::Borrowed(name), |pass| format!("{VIEW_LAYER}.{pass}").into())
}

/// Makes all attributes ASCII, which EXR headers require: objects of JSON, such as the names of a cryptomatte, by escapes.
/// Removes other text that is not ASCII, and returns its names.
fn take_ascii(attributes: &mut Attributes) -> Vec<String> {
    let mut left = Vec::new();
    attributes.texts.retain(|name, text| {
        if !text.is_ascii() && serde_json::from_str::<Map<String, Value>>(text).is_ok() {
            *text = ascii_json(text);
        }
        let fits = name.is_ascii() && text.is_ascii();
        if !fits {
            left.push(name.clone());
        }
        fits
    });
    left
}
