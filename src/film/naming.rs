//! Names of layers: what each means, how it is called in files, and which ones `--layers` picks.
//!
//! Nuke splits a channel's name into at most three tokens and turns what is not alphanumeric into `_`; Blender takes
//! the last token for the component, wants one letter there, and holds names in 64 bytes; older readers stop at 31. So
//! names of ours are `Layer.C` with `[A-Za-z][A-Za-z0-9_]*` for the layer, one letter for the component, and at most 31
//! characters.

use super::kind::{CAUSTIC, LAYERS, LIGHT_GROUP, LayerKind, Suffix, Use, finished_part, kind_of, part_names, stem};
use super::layers::{Layer, LayerSet, Sample};
use crate::error::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// How channels are called in an EXR.
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
    /// The layer's name in a file, without component.
    pub fn layer(self, name: &str) -> String {
        match self {
            Naming::Plain => name.to_owned(),
            Naming::Blender => {
                let pass = kind_of(name).and_then(|(kind, _)| kind.blender).unwrap_or(name);
                format!("ViewLayer.{pass}")
            }
        }
    }

    /// What stands in a component of a layer in a file: which component of ours, and whether its sign is changed.
    /// Positions and normals are in the world axes of glTF (y up) here and in plain files, and in Blender's (z up, (x, -z,
    /// y)) in files with its names.
    pub fn axis<'c>(self, layer: &str, component: &'c str) -> (&'c str, bool) {
        match (self, layer, component) {
            (Naming::Blender, layer, "Y") if has_axes(layer) => ("Z", true),
            (Naming::Blender, layer, "Z") if has_axes(layer) => ("Y", false),
            _ => (component, false),
        }
    }

    /// A transform of points of the world, row by row, for points in a file's axes.
    pub fn from_file_axes(self, m: [f32; 16]) -> [f32; 16] {
        match self {
            Naming::Plain => m,
            // (x, y, z) of Blender is (x, z, -y) of ours: its second row is minus our third, its third our second.
            Naming::Blender => std::array::from_fn(|i| match i / 4 {
                1 => -m[8 + i % 4],
                2 => m[4 + i % 4],
                _ => m[i],
            }),
        }
    }

    /// The channel's name in a file.
    pub fn channel(self, layer: &str, component: &str) -> String {
        let prefix = self.layer(layer);
        // A layer of one plane of the same name stands for a lone channel at the root: `Z`, not `Z.Z`.
        if prefix.is_empty() || prefix == component { component.to_owned() } else { format!("{prefix}.{component}") }
    }
}

/// Whether a layer of ours holds places or directions of the world.
pub(super) fn has_axes(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| kind.components == "XYZ")
}

/// What `describe` knows of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Components, one letter each.
    pub components: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// What the values are.
    pub meaning: &'static str,
}

/// Components, unit and meaning of a layer of ours by its plain name; `None` for a name that is not ours.
pub fn describe(name: &str) -> Option<Description> {
    let (&LayerKind { components, unit, meaning, finish, .. }, finished) = kind_of(name)?;
    let meaning = match finish {
        Some(Use::Part(meaning)) if finished => meaning,
        _ => meaning,
    };
    Some(Description { components, unit, meaning })
}

/// What `--layers` asks for.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Selection {
    /// Every layer but `Quarter1` to `Quarter4`, which few want.
    #[default]
    All,
    /// The picture alone.
    Beauty,
    /// What compositing takes: the picture, its finished parts, albedo, normal, depth and cryptomattes; half floats
    /// where they serve.
    Comp,
    /// Layers by name; `beauty` stands for the picture, and `Level` for `Level1`, `Level2`, ...
    List(Vec<String>),
}

impl Selection {
    /// Reads `all`, `comp`, `beauty` or names with commas between them. Errors: no name, or one that no layer of ours has, with
    /// the nearest.
    pub fn parse(text: &str) -> Result<Self> {
        match text {
            "all" => return Ok(Selection::All),
            "beauty" => return Ok(Selection::Beauty),
            "comp" => return Ok(Selection::Comp),
            _ => {}
        }
        let names: Vec<String> = text.split(',').map(|s| s.trim().to_owned()).filter(|s| !s.is_empty()).collect();
        if names.is_empty() {
            return Err(Error::new(ErrorKind::Usage, "--layers", "no layer is named")
                .hint("give all, comp, beauty, or names such as beauty,Noisy,albedo"));
        }
        match names.iter().find(|name| *name != "beauty" && describe(name).is_none()) {
            Some(unknown) => {
                let known = suggestions();
                Err(unknown_layer(unknown, known.iter().map(String::as_str)))
            }
            None => Ok(Selection::List(names)),
        }
    }

    /// Whether a layer of this plain name is asked for.
    pub fn wants(&self, name: &str) -> bool {
        let stem = stem(name);
        match self {
            Selection::All => !kind_of(name).is_some_and(|(kind, _)| kind.on_request),
            Selection::Beauty => name.is_empty(),
            Selection::Comp => kind_of(name).is_some_and(|(kind, finished)| finished || kind.compositing),
            Selection::List(names) => {
                names.iter().any(|n| n == name || (n == "beauty" && name.is_empty()) || (!stem.is_empty() && n == stem))
            }
        }
    }

    /// The picture with the layers asked for. Errors: one that the picture lacks, with the nearest it has.
    pub fn apply(&self, set: LayerSet) -> Result<LayerSet> {
        if let Selection::List(names) = self {
            let present = |name: &String| {
                let only = Selection::List(vec![name.clone()]);
                set.layers.iter().any(|layer| only.wants(&layer.name))
            };
            if let Some(missing) = names.iter().find(|name| !present(name)) {
                let shown =
                    |layer: &Layer| if layer.name.is_empty() { "beauty".to_owned() } else { layer.name.clone() };
                let present: Vec<String> = set.layers.iter().map(shown).collect();
                return Err(unknown_layer(missing, present.iter().map(String::as_str)));
            }
        }
        let layers = set.layers.into_iter().filter(|layer| self.wants(&layer.name));
        let layers = match self {
            Selection::Comp => {
                layers.map(|layer| if serves_as_half(&layer) { layer.stored_as(Sample::Half) } else { layer }).collect()
            }
            _ => layers.collect(),
        };
        Ok(LayerSet { layers, ..set })
    }
}

/// Whether half floats hold a layer as well as anybody sees: colours and directions, where none is too bright. Depth
/// wants more digits, and the ids of cryptomattes are no numbers.
fn serves_as_half(layer: &Layer) -> bool {
    const LARGEST: f32 = 65_504.0;
    kind_of(&layer.name).is_some_and(|(kind, finished)| finished || kind.half)
        && layer.planes.iter().all(|plane| plane.values.iter().all(|value| value.abs() <= LARGEST))
}

/// Names to suggest from: of numbered layers the first.
fn suggestions() -> Vec<String> {
    let first = |kind: &LayerKind| match kind.suffix {
        Suffix::None if kind.name.is_empty() => Some("beauty".into()),
        Suffix::None => Some(kind.name.into()),
        Suffix::Level | Suffix::Quarter => Some(format!("{}1", kind.name)),
        Suffix::Ranks => Some(format!("{}00", kind.name)),
        Suffix::Group => None,
    };
    LAYERS.iter().filter_map(first).chain(part_names().filter_map(finished_part)).collect()
}

fn unknown_layer<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Error {
    let known: Vec<&str> = known.collect();
    let error = Error::new(ErrorKind::Usage, "--layers", format!("no layer \"{name}\""));
    let distance = |known: &str| strsim::levenshtein(&name.to_lowercase(), &known.to_lowercase());
    let nearest = known.iter().map(|k| (distance(k), k)).min_by_key(|(d, _)| *d);
    match nearest {
        Some((d, k)) if d <= 1 + name.chars().count() / 3 => error.hint(format!("did you mean \"{k}\"?")),
        _ => error.hint(format!("there are {}", known.join(", "))),
    }
}

/// Checks that every channel has a name that Nuke and Blender read unharmed (see the head of this file).
///
/// Errors: the first channel that breaks a rule, with the rule.
pub fn check(set: &LayerSet, naming: Naming) -> Result<()> {
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
    if component.len() != 1 || !component.chars().all(|c| "RGBAXYZUVrgba".contains(c)) {
        return Some("a component is one of R G B A, X Y Z, U V, r g b a");
    }
    if layer.planes.len() > 4 {
        return Some("Nuke holds at most four components a layer");
    }
    // Names of groups are the user's.
    let group = layer.name.contains(LIGHT_GROUP) || layer.name.contains(CAUSTIC);
    let limit = if naming == Naming::Plain && !group { 31 } else { 63 };
    (length > limit).then_some("the name is too long for other programs")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_suggested_name_is_described_and_well_formed() {
        let mut set = LayerSet::new(1, 1);
        for name in &suggestions() {
            let name = if name == "beauty" { "" } else { name };
            let components = describe(name).expect(name).components;
            let planes = components.chars().map(|c| super::super::layers::Plane {
                component: c.into(),
                sample: super::super::layers::Sample::Float,
                values: vec![0.0],
            });
            set.push(Layer { name: name.into(), planes: planes.collect() }).unwrap();
        }
        check(&set, Naming::Plain).unwrap();
        check(&set, Naming::Blender).unwrap();
    }
}
