//! Names of layers in EXR files: plain and Blender's.
//!
//! Nuke splits a channel's name into at most three tokens and replaces characters that are not alphanumeric by `_`.
//! Blender takes the last token for the component, wants one letter there, and stores names in 64 bytes. Older readers
//! stop at 31 characters. So our names are `Layer.C` with `[A-Za-z][A-Za-z0-9_]*` for the layer, one letter for the
//! component, and at most 31 characters.

use super::kind::{CAUSTIC, LAYERS, LIGHT_GROUP, current_name, kind_of};
use super::layers::{Layer, LayerSet, Plane};
use crate::error::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// Name of the view layer in files with Blender's names.
pub const VIEW_LAYER: &str = "ViewLayer";

/// Naming scheme of the channels of an EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Naming {
    /// R G B A at the root, the others as Layer.C: what Nuke, tev and OIDN's tools know
    #[default]
    Plain,
    /// ViewLayer.Pass.C, as Blender writes and its render engines take
    Blender,
}

impl Naming {
    /// The naming scheme of layers that have been read from a file.
    pub fn of(set: &LayerSet) -> Naming {
        if set.layers.iter().any(|layer| layer.name.starts_with("ViewLayer.")) {
            Naming::Blender
        } else {
            Naming::Plain
        }
    }

    /// The name of the view layer in a file of Blender whose layers have been read, if it is not the usual one and the
    /// file has no other picture.
    pub fn view_layer(set: &LayerSet) -> Option<String> {
        let mut pictures = set.layers.iter().filter(|layer| layer.name.is_empty() || layer.name.ends_with("Combined"));
        let name = pictures.next()?.name.strip_suffix(".Combined")?;
        (pictures.next().is_none() && name != VIEW_LAYER).then(|| name.to_owned())
    }

    /// Name of the layer in a file, without component; `name` is its plain name.
    pub fn layer(self, name: &str) -> String {
        match self {
            Naming::Plain => name.to_owned(),
            Naming::Blender => {
                let pass = kind_of(name).and_then(|(kind, _)| kind.blender).unwrap_or(name);
                format!("{VIEW_LAYER}.{pass}")
            }
        }
    }

    /// The component of our layer that a component in a file holds, and whether its sign is flipped. Positions and
    /// normals are in glTF's world axes (y up) in memory and in plain files, and in Blender's axes (z up: x, -z, y) in
    /// files with Blender's names.
    pub fn axis<'c>(self, layer: &str, component: &'c str) -> (&'c str, bool) {
        match (self, layer, component) {
            (Naming::Blender, layer, "Y") if has_axes(layer) => ("Z", true),
            (Naming::Blender, layer, "Z") if has_axes(layer) => ("Y", false),
            _ => (component, false),
        }
    }

    /// A matrix for points in our world axes, row by row, changed to take points in the file's axes.
    pub fn from_file_axes(self, m: [f32; 16]) -> [f32; 16] {
        match self {
            Naming::Plain => m,
            // Blender's (x, y, z) is our (x, z, -y).
            Naming::Blender => std::array::from_fn(|i| match i / 4 {
                1 => -m[8 + i % 4],
                2 => m[4 + i % 4],
                _ => m[i],
            }),
        }
    }

    /// A matrix for points in the file's axes, row by row, changed to take points in our world axes.
    pub fn from_own_axes(self, m: [f32; 16]) -> [f32; 16] {
        match self {
            Naming::Plain => m,
            // Our (x, y, z) is Blender's (x, -z, y).
            Naming::Blender => std::array::from_fn(|i| match i / 4 {
                1 => m[8 + i % 4],
                2 => -m[4 + i % 4],
                _ => m[i],
            }),
        }
    }

    /// Name of the channel in a file that stores a component of a layer; `layer` is its plain name.
    pub fn channel(self, layer: &str, component: &str) -> String {
        let prefix = self.layer(layer);
        // A layer whose only plane has its name is one channel at the root: `Z`, not `Z.Z`.
        if prefix.is_empty() || prefix == component { component.to_owned() } else { format!("{prefix}.{component}") }
    }
}

/// Whether the layer `name` holds world positions or directions, which depend on the axes.
fn has_axes(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| kind.components == "XYZ")
}

/// Replaces Blender's names and axes in `set` by ours. Removes layers whose names we cannot write, and returns their
/// names.
pub fn take_plain_names(set: &mut LayerSet) -> Vec<String> {
    for layer in &mut set.layers {
        if let Some(plain) = blender_pass(&layer.name) {
            layer.name = plain.into();
            to_our_axes(layer);
        } else {
            layer.name = current_name(plain_name(&layer.name)).into_owned();
        }
    }
    let fits = |layer: &Layer| {
        let empty = |plane: &Plane| Plane { component: plane.component.clone(), sample: plane.sample, values: vec![] };
        let planes = layer.planes.iter().map(empty).collect();
        let alone = LayerSet { layers: vec![Layer { name: layer.name.clone(), planes }], ..LayerSet::default() };
        check_names(&alone, Naming::Plain).is_ok()
    };
    let (kept, left): (Vec<Layer>, Vec<Layer>) = std::mem::take(&mut set.layers).into_iter().partition(fits);
    set.layers = kept;
    left.into_iter().map(|layer| layer.name).collect()
}

/// Our name of the layer that has the name `name` in a file, in plain or Blender's naming.
pub fn plain_name(name: &str) -> &str {
    blender_pass(name).unwrap_or_else(|| name.strip_prefix("ViewLayer.").unwrap_or(name))
}

/// Our name of a layer that has another one in Blender; `None` for all other layers.
fn blender_pass(name: &str) -> Option<&'static str> {
    let mut known = LAYERS.iter().filter(|kind| kind.blender.is_some()).map(|kind| kind.name);
    known.find(|plain| Naming::Blender.layer(plain) == name)
}

/// Converts positions and normals from Blender's axes: (x, y, z) becomes (x, z, -y).
fn to_our_axes(layer: &mut Layer) {
    if !has_axes(&layer.name) {
        return;
    }
    for plane in &mut layer.planes {
        match plane.component.as_str() {
            "Y" => {
                plane.component = "Z".into();
                plane.values.iter_mut().for_each(|value| *value = -*value);
            }
            "Z" => plane.component = "Y".into(),
            _ => {}
        }
    }
    layer.planes.sort_by(|a, b| a.component.cmp(&b.component));
}

/// Checks that Nuke and Blender can read the name of every channel, see the head of this file.
///
/// # Errors
/// The first channel that breaks a rule, with the rule; more channels than Nuke holds.
pub fn check_names(set: &LayerSet, naming: Naming) -> Result<()> {
    let mut seen = std::collections::HashSet::new();
    for layer in &set.layers {
        for plane in &layer.planes {
            let name = naming.channel(&layer.name, &plane.component);
            let fault = fault(layer, &plane.component, naming, name.len())
                .or_else(|| (!seen.insert(name.clone())).then_some("two channels have this name"));
            if let Some(cause) = fault {
                return Err(Error::new(ErrorKind::Image, format!("channel \"{name}\""), cause));
            }
        }
    }
    if seen.len() > 1023 {
        return Err(Error::new(ErrorKind::Image, "", "more than the 1023 channels that Nuke can hold"));
    }
    Ok(())
}

fn fault(layer: &Layer, component: &str, naming: Naming, length: usize) -> Option<&'static str> {
    let mut letters = layer.name.chars();
    let starts_well = letters.next().is_none_or(|c| c.is_ascii_alphabetic());
    if !starts_well || !letters.all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Some("a layer's name is a letter, then letters, digits or _");
    }
    if component.len() != 1 || !component.chars().all(|c| "RGBAXYZWUVrgba".contains(c)) {
        return Some("a component is one of R G B A, X Y Z W, U V, r g b a");
    }
    if layer.planes.len() > 4 {
        return Some("Nuke holds at most four components a layer");
    }
    // The user chooses the names of light groups.
    let group = layer.name.contains(LIGHT_GROUP) || layer.name.contains(CAUSTIC);
    let limit = if naming == Naming::Plain && !group { 31 } else { 63 };
    (length > limit).then_some("the name is too long for other programs")
}
