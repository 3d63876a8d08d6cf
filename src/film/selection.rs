//! The layers that `--layers` selects.

use super::kind::{
    LAYERS, LOBE_COLORS, LayerKind, MOTION, Suffix, Use, current_name, describe, finished_part, is_effect, kind_of,
    lobe_names, part_names, stem,
};
use super::layers::{Layer, LayerSet, Sample};
use crate::error::{Error, ErrorKind, Result};

/// The layers to write, the value of `--layers`.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Selection {
    /// Every layer except those on request, such as `Motion` and `DiffuseDirect`.
    #[default]
    All,
    /// The beauty alone.
    Beauty,
    /// Layers for compositing: beauty, its finished parts, depth, cryptomattes and the error, as half floats where these
    /// suffice.
    Comp,
    /// Layers by name; `beauty` is the beauty, `Level` selects `Level1`, `Level2`, ..., and `all` and `comp` select what
    /// they select alone. `lobes` selects all layers by the lobe of the first hit.
    List(Vec<String>),
    /// A selection, and the layers that the temporal finish of the picture and of its finished parts needs.
    Temporal(Box<Selection>),
}

impl Selection {
    /// Parses a value of `--layers`: `all`, `comp`, `beauty` or names separated by commas.
    ///
    /// # Errors
    /// No name, or an unknown name; the hint has the nearest known one.
    pub fn parse(text: &str) -> Result<Self> {
        match text {
            "all" => return Ok(Selection::All),
            "beauty" => return Ok(Selection::Beauty),
            "comp" => return Ok(Selection::Comp),
            _ => {}
        }
        let names: Vec<String> =
            text.split(',').map(|s| current_name(s.trim()).into_owned()).filter(|s| !s.is_empty()).collect();
        if names.is_empty() {
            return Err(Error::new(ErrorKind::Usage, "--layers", "no layer is named")
                .hint("give all, comp, beauty, or names such as beauty,Noisy,albedo"));
        }
        let is_known = |name: &str| ["all", "comp", "beauty", LOBES].contains(&name) || describe(name).is_some();
        match names.iter().find(|name| !is_known(name)) {
            Some(unknown) => {
                let known = suggestions();
                Err(unknown_layer(unknown, known.iter().map(String::as_str)))
            }
            None => Ok(Selection::List(names)),
        }
    }

    /// Whether a layer with this plain name is selected.
    pub fn wants(&self, name: &str) -> bool {
        let stem = stem(name);
        match self {
            Selection::All => !kind_of(name).is_some_and(|(kind, _)| kind.on_request),
            Selection::Beauty => name.is_empty(),
            Selection::Comp => {
                let is_part = |name: &str| part_names().filter_map(finished_part).any(|part| part == name);
                is_part(name) || kind_of(name).is_some_and(|(kind, finished)| !finished && kind.compositing)
            }
            Selection::List(names) => names.iter().any(|n| match n.as_str() {
                "all" => Selection::All.wants(name),
                "comp" => Selection::Comp.wants(name),
                "beauty" => name.is_empty(),
                LOBES => is_of_lobe(name),
                n => n == name || (!stem.is_empty() && n == stem),
            }),
            Selection::Temporal(chosen) => {
                // Parts are finished together, because they sum to the picture.
                let any_part = || part_names().filter_map(finished_part).any(|part| chosen.wants(&part));
                let any_lobe = || lobe_names().filter_map(finished_part).any(|part| chosen.wants(&part));
                let any = || if is_of_lobe(name) { any_lobe() } else { any_part() };
                let part = || finished_part(name).is_some_and(|part| chosen.wants(&part) || any());
                let read = |kind: &LayerKind| matches!(kind.finish, Some(Use::Picture | Use::Error));
                let of_picture = || {
                    let read = kind_of(name).is_some_and(|(kind, finished)| !finished && read(kind));
                    read || is_effect(name)
                };
                chosen.wants(name) || name.is_empty() || name == MOTION || of_picture() || part()
            }
        }
    }

    /// Whether any layer by the lobe of the first hit is selected.
    pub fn wants_lobes(&self) -> bool {
        let finished = || lobe_names().filter_map(finished_part).any(|name| self.wants(&name));
        finished() || lobe_names().chain(LOBE_COLORS).any(|name| self.wants(name))
    }

    /// The user's selection, without layers that only the temporal finish needs.
    pub fn chosen(&self) -> &Selection {
        if let Selection::Temporal(chosen) = self { chosen } else { self }
    }

    /// The set with the selected layers only.
    ///
    /// # Errors
    /// A selected layer is missing; the hint has the nearest present one.
    pub fn apply(&self, set: LayerSet) -> Result<LayerSet> {
        let chosen = self.chosen();
        if let Selection::List(names) = chosen {
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
        let layers = match chosen {
            Selection::Comp => {
                layers.map(|layer| if layer.fits_half() { layer.stored_as(Sample::Half) } else { layer }).collect()
            }
            _ => layers.collect(),
        };
        Ok(LayerSet { layers, ..set })
    }
}

impl Layer {
    /// Whether half floats show no difference: colours and directions without very bright values. Depth needs more digits,
    /// and the ids of cryptomattes need all bits.
    pub fn fits_half(&self) -> bool {
        /// The largest finite half float.
        const MAX_HALF: f32 = 65_504.0;
        kind_of(&self.name).is_some_and(|(kind, finished)| finished || kind.half)
            && self.planes.iter().all(|plane| plane.values.iter().all(|value| value.abs() <= MAX_HALF))
    }
}

/// Name that selects all layers by the lobe of the first hit.
const LOBES: &str = "lobes";

/// Whether a layer is one by the lobe of the first hit.
fn is_of_lobe(name: &str) -> bool {
    let lobe = |name: &str| LOBE_COLORS.contains(&name) || lobe_names().any(|lobe| lobe == name);
    kind_of(name).is_some_and(|(kind, _)| lobe(kind.name))
}

/// Names of all layers, for suggestions; numbered layers by the first number, light groups left out.
fn suggestions() -> Vec<String> {
    let first = |kind: &LayerKind| match kind.suffix {
        Suffix::None if kind.name.is_empty() => Some("beauty".into()),
        Suffix::None => Some(kind.name.into()),
        Suffix::Level | Suffix::Quarter => Some(format!("{}1", kind.name)),
        Suffix::Ranks => Some(format!("{}00", kind.name)),
        Suffix::Group => None,
    };
    LAYERS.iter().filter_map(first).chain(part_names().chain(lobe_names()).filter_map(finished_part)).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Naming, Plane, check_names};

    #[test]
    fn every_suggested_name_is_described_and_well_formed() {
        let mut set = LayerSet::new(1, 1);
        for name in &suggestions() {
            let name = if name == "beauty" { "" } else { name };
            let components = describe(name).expect(name).components;
            let planes =
                components.chars().map(|c| Plane { component: c.into(), sample: Sample::Float, values: vec![0.0] });
            set.push(Layer { name: name.into(), planes: planes.collect() }).unwrap();
        }
        check_names(&set, Naming::Plain).unwrap();
        check_names(&set, Naming::Blender).unwrap();
    }
}
