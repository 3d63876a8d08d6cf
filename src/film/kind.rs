//! The table of layers. Names in files, `--layers`, `info`, merging, the finish, Blender's add-on, the USD converter and
//! the page for compositors read it; `output.rs` computes the values.

use crate::transport::LobeLayer;
use std::borrow::Cow;
use std::fmt;

/// Prefix of the name of a layer with the light of one light group.
pub const LIGHT_GROUP: &str = "LightGroup_";
/// Prefix of the name of a layer with the caustics of one light group.
pub const CAUSTIC: &str = "Caustic_";
/// Prefix of the name of a finished part, a denoised additive part of the picture: the layers of this prefix sum to the
/// picture. Layers by the lobe of the first hit and those of light groups divide the picture anew, so they have prefixes
/// of their own.
pub const COMBINED: &str = "Combined";
/// Prefix of the name of a finished layer of light by the lobe of the first hit.
const LOBE: &str = "Lobe";
/// Prefix of the name of a finished layer of a light group.
const GROUP: &str = "Finished";

/// Prefixes of the names of the cryptomatte layers of objects and of materials.
pub const CRYPTOMATTES: [&str; 2] = ["CryptoObject", "CryptoMaterial"];

/// Names of the layers of light by the lobe of the first hit, in the order in which they are finished.
pub const LOBE_LAYERS: [(LobeLayer, &str); LobeLayer::ALL.len()] = [
    (LobeLayer::Emit, "Emit"),
    (LobeLayer::Environment, "Environment"),
    (LobeLayer::VolumeDirect, "VolumeDirect"),
    (LobeLayer::VolumeIndirect, "VolumeIndirect"),
    (LobeLayer::TransmissionDirect, "TransmissionDirect"),
    (LobeLayer::TransmissionIndirect, "TransmissionIndirect"),
    (LobeLayer::GlossyDirect, "GlossyDirect"),
    (LobeLayer::GlossyIndirect, "GlossyIndirect"),
    (LobeLayer::DiffuseDirect, "DiffuseDirect"),
    (LobeLayer::DiffuseIndirect, "DiffuseIndirect"),
];
/// Names of the layers with the albedos of the diffuse, glossy and transmitting lobes at the first hit.
pub const LOBE_COLORS: [&str; 3] = ["DiffuseColor", "GlossyColor", "TransmissionColor"];

/// Name of the layer with the estimated squared bias of merging with one bandwidth.
pub const SQUARED_BIAS: &str = "SquaredBias";

/// Name of the layer with motion vectors.
pub const MOTION: &str = "Motion";

/// The suffix of a layer's name, which follows the name of the layer's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Suffix {
    /// No suffix: the kind has one layer.
    None,
    /// The number of a bandwidth level, from 1, smallest bandwidth first.
    Level,
    /// The number of a quarter of the iterations, 1 to 4, whose mean the layer holds.
    Quarter,
    /// The number of a pair of cryptomatte ranks, `00` and up, each an id and its coverage.
    Ranks,
    /// The name of a light group.
    Group,
}

/// How a layer is merged over renders with different seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// The mean of the renders' values, weighted by their iterations.
    Mean,
    /// Variances of means of independent renders: a sum weighted by the squares of each render's share of the
    /// iterations.
    Variance,
    /// Standard errors: the root of their mean square.
    Error,
    /// Counts: the sum over renders.
    Sum,
    /// The first render's values: distances, which have no mean with the background, bandwidths, and motion vectors, which
    /// all renders share.
    First,
    /// Cryptomatte ranks: coverages are added for each id.
    Matte,
}

/// Purpose for which the finish, which denoises a render's picture, reads a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// The finished picture.
    Picture,
    /// The estimate of the finished picture's error.
    Error,
    /// An additive part of the picture, which is finished as well; holds the meaning of the finished layer, in words.
    Part(&'static str),
}

/// A kind of layers, a row of the table: one layer, or layers that differ by a suffix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerKind {
    /// Name of the layer in plain files, without the suffix; empty for the beauty.
    pub name: &'static str,
    /// Suffix of the layer's name.
    pub suffix: Suffix,
    /// Components of the layer, one letter each, such as `RGB`.
    pub components: &'static str,
    /// Unit of the layer's values, in words.
    pub unit: &'static str,
    /// Meaning of the layer's values, in words.
    pub meaning: &'static str,
    /// How the layer is merged over renders with different seeds.
    pub merge: Merge,
    /// Purpose for which the finish reads the layer; `None` if it does not.
    pub finish: Option<Use>,
    /// Whether `--layers comp` includes the layer, besides the finished parts that every render has.
    pub compositing: bool,
    /// Whether half floats suffice for the layer unless a value is too large.
    pub half: bool,
    /// Whether the layer has to be named to be written: `--layers all` leaves it out.
    pub on_request: bool,
    /// Blender's name of the layer's pass; `None` if it does not differ.
    pub blender: Option<&'static str>,
    /// Property of Blender's view layer that enables the pass; finished parts share another property.
    pub switch: Option<&'static str>,
}

const RADIANCE: &str = "W/(sr m^2)";

impl LayerKind {
    /// Defaults for layers of radiance, which are averaged over merged renders.
    const COLOUR: LayerKind = LayerKind {
        name: "",
        suffix: Suffix::None,
        components: "RGB",
        unit: RADIANCE,
        meaning: "",
        merge: Merge::Mean,
        finish: None,
        compositing: false,
        half: false,
        on_request: false,
        blender: None,
        switch: None,
    };

    /// The kind of an additive part of the picture, with the meanings of the part and of the finished part.
    const fn part(name: &'static str, meaning: &'static str, finished: &'static str) -> LayerKind {
        let switch = Some("noisy_parts");
        LayerKind { name, meaning, finish: Some(Use::Part(finished)), switch, ..LayerKind::COLOUR }
    }

    /// The kind of an additive part of the picture that holds the light of one light group.
    const fn of_group(name: &'static str, meaning: &'static str, finished: &'static str) -> LayerKind {
        LayerKind { suffix: Suffix::Group, ..LayerKind::part(name, meaning, finished) }
    }

    /// The kind of light by the lobe of the first hit, which is written only on request.
    const fn of_lobe(layer: usize, meaning: &'static str, finished: &'static str) -> LayerKind {
        let (_, name) = LOBE_LAYERS[layer];
        LayerKind { on_request: true, switch: None, ..LayerKind::part(name, meaning, finished) }
    }

    /// The kind of the albedo of lobes at the first hit, which is written only on request.
    const fn color(index: usize, blender: &'static str, meaning: &'static str) -> LayerKind {
        let (name, blender) = (LOBE_COLORS[index], Some(blender));
        LayerKind { name, unit: "1", meaning, half: true, on_request: true, blender, ..LayerKind::COLOUR }
    }

    /// The kind of photon-gathering bandwidths, one layer for each bandwidth level.
    const fn radius(name: &'static str, meaning: &'static str) -> LayerKind {
        let (suffix, merge) = (Suffix::Level, Merge::First);
        LayerKind { name, meaning, suffix, merge, components: "X", unit: "m", ..LayerKind::COLOUR }
    }

    /// The kind of a distance, position or motion, taken from the first of merged renders.
    const fn first(name: &'static str, components: &'static str, meaning: &'static str) -> LayerKind {
        LayerKind { name, components, unit: "m", meaning, merge: Merge::First, ..LayerKind::COLOUR }
    }

    /// The kind of the layers of a cryptomatte.
    const fn matte(name: &'static str, switch: &'static str, meaning: &'static str) -> LayerKind {
        LayerKind {
            name,
            suffix: Suffix::Ranks,
            components: "rgba",
            unit: "1",
            meaning,
            merge: Merge::Matte,
            compositing: true,
            switch: Some(switch),
            ..LayerKind::COLOUR
        }
    }

    /// Name of the layer of the finished part, without the suffix; `None` if the kind is not an additive part.
    pub fn finished(&self) -> Option<String> {
        Some(format!("{}{}", self.finished_prefix()?, self.name))
    }

    /// Prefix of the name of the finished part; `None` if the kind is not an additive part.
    pub fn finished_prefix(&self) -> Option<&'static str> {
        match (self.finish, self.suffix, self.on_request) {
            (Some(Use::Part(_)), Suffix::Group, _) => Some(GROUP),
            (Some(Use::Part(_)), _, true) => Some(LOBE),
            (Some(Use::Part(_)), _, false) => Some(COMBINED),
            _ => None,
        }
    }

    /// Whether a layer of this kind has the name `name`; a numbered name may lack its number.
    fn is(&self, name: &str) -> bool {
        match self.suffix {
            Suffix::None => name == self.name,
            Suffix::Level | Suffix::Quarter | Suffix::Ranks => stem(name) == self.name,
            Suffix::Group => name.starts_with(self.name),
        }
    }
}

/// The table of all kinds of layers. Parts are in the order in which they are finished: the last one takes light that
/// no part accounts for.
pub static LAYERS: &[LayerKind] = &[
    LayerKind {
        meaning: "beauty: the finished picture, or the estimator's own",
        finish: None,
        compositing: true,
        half: true,
        blender: Some(COMBINED),
        components: "RGBA",
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "Noisy",
        meaning: "the estimator's picture before the finish, at the usual bandwidth",
        finish: Some(Use::Picture),
        switch: Some("noisy"),
        ..LayerKind::COLOUR
    },
    LayerKind::part(
        "Emission",
        "light that comes straight from lights and environment, in mirrors and through clear glass too",
        "Emission as finished",
    ),
    LayerKind::part("Volume", "light that media scatter to the camera", "Volume as finished"),
    LayerKind::part(
        "Caustic",
        "light that mirrors or glass sent to a rough surface, also where that is seen in mirrors or through glass",
        "Caustic as finished",
    ),
    LayerKind::part(
        "Direct",
        "light after one bounce, and highlights",
        "Direct as finished; all finished parts sum to the beauty",
    ),
    LayerKind::part(
        "Indirect",
        "light after several bounces, and what shine, coats and rough metal show, caustics excepted",
        "Indirect as finished",
    ),
    LayerKind::of_lobe(
        0,
        "lights with a surface that the camera sees directly; only if asked for by name",
        "Emit as finished",
    ),
    LayerKind::of_lobe(
        1,
        "environment and suns that the camera sees directly; only if asked for by name",
        "Environment as finished",
    ),
    LayerKind::of_lobe(
        2,
        "light of lights that a medium scatters to the camera; only if asked for by name",
        "VolumeDirect as finished",
    ),
    LayerKind::of_lobe(
        3,
        "other light that a medium scatters to the camera; only if asked for by name",
        "VolumeIndirect as finished",
    ),
    LayerKind::of_lobe(
        4,
        "light of lights that the first hit transmits to the camera; only if asked for by name",
        "TransmissionDirect as finished",
    ),
    LayerKind::of_lobe(
        5,
        "other light that the first hit transmits to the camera; only if asked for by name",
        "TransmissionIndirect as finished",
    ),
    LayerKind::of_lobe(
        6,
        "light of lights that mirrors and gloss at the first hit reflect to the camera; only if asked for by name",
        "GlossyDirect as finished",
    ),
    LayerKind::of_lobe(
        7,
        "other light that mirrors and gloss at the first hit reflect to the camera; only if asked for by name",
        "GlossyIndirect as finished",
    ),
    LayerKind::of_lobe(
        8,
        "light of lights that the first hit scatters diffusely to the camera; only if asked for by name",
        "DiffuseDirect as finished",
    ),
    LayerKind::of_lobe(
        9,
        "other light that the first hit scatters diffusely to the camera; only if asked for by name",
        "DiffuseIndirect as finished",
    ),
    LayerKind::color(0, "DiffCol", "albedo of the diffuse lobes at the first hit; only if asked for by name"),
    LayerKind::color(1, "GlossCol", "albedo of mirrors and gloss at the first hit; only if asked for by name"),
    LayerKind::color(2, "TransCol", "albedo of transmission at the first hit; only if asked for by name"),
    LayerKind::of_group(LIGHT_GROUP, "light of one group of lights", "light of one group of lights, finished"),
    LayerKind::of_group(CAUSTIC, "caustics of one group of lights", "caustics of one group of lights, finished"),
    LayerKind {
        name: "Level",
        suffix: Suffix::Level,
        meaning: "estimate of one bandwidth level, 1 the smallest",
        finish: Some(Use::Picture),
        switch: Some("levels"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "Variance",
        suffix: Suffix::Level,
        unit: "(W/(sr m^2))^2",
        meaning: "variance of the mean of one level",
        merge: Merge::Variance,
        finish: Some(Use::Picture),
        switch: Some("levels"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "Error",
        meaning: "estimated error of the beauty: the truth lies within twice as much in nine pixels of ten",
        merge: Merge::Error,
        compositing: true,
        switch: Some("error"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "albedo",
        unit: "1",
        meaning: "reflectance at the first broad hit, through glass and in mirrors of a roughness up to 0.45",
        finish: Some(Use::Picture),
        half: true,
        blender: Some("Denoising Albedo"),
        switch: Some("albedo"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "normal",
        components: "XYZ",
        unit: "1",
        meaning: "unit normal at that hit, world axes",
        finish: Some(Use::Picture),
        half: true,
        blender: Some("Normal"),
        switch: Some("use_pass_normal"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        finish: Some(Use::Picture),
        blender: Some("Denoising Depth"),
        ..LayerKind::first("depth", "Z", "distance along the path to that hit; 1e10 where there is none")
    },
    LayerKind {
        on_request: true,
        switch: Some("use_pass_vector"),
        blender: Some("Vector"),
        unit: "pixels",
        ..LayerKind::first(
            MOTION,
            "XYZW",
            "motion of what the pixel shows, in resting mirrors and clear glass that of the image: place in the previous frame \
             less that in this one, and place in this frame less that in the next, y up; only if asked for by name",
        )
    },
    LayerKind {
        compositing: true,
        blender: Some("Depth"),
        switch: Some("use_pass_z"),
        ..LayerKind::first(
            "Z",
            "Z",
            "distance along the camera's axis to the first hit of any kind; 1e10 on the background",
        )
    },
    LayerKind {
        blender: Some("Position"),
        switch: Some("use_pass_position"),
        ..LayerKind::first("P", "XYZ", "world position of that hit")
    },
    LayerKind::matte(
        CRYPTOMATTES[0],
        "use_pass_cryptomatte_object",
        "cryptomatte of objects: two ranks of id and coverage",
    ),
    LayerKind::matte(
        CRYPTOMATTES[1],
        "use_pass_cryptomatte_material",
        "cryptomatte of materials: two ranks of id and coverage",
    ),
    LayerKind::radius("Radius", "bandwidth of the last iteration, of methods that have some"),
    LayerKind::radius("CausticRadius", "bandwidth for photons of caustics, where others are gathered, too"),
    LayerKind::radius("VolumeRadius", "bandwidth for photons in media"),
    LayerKind {
        name: "Quarter",
        suffix: Suffix::Quarter,
        meaning: "Noisy by every fourth iteration: four independent pictures; only if asked for by name",
        finish: Some(Use::Error),
        on_request: true,
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: SQUARED_BIAS,
        unit: "(W/(sr m^2))^2",
        meaning: "squared bias of merging with one bandwidth, whose noise may be negative; only if asked for by name",
        finish: Some(Use::Error),
        on_request: true,
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "Rejected",
        components: "X",
        unit: "1",
        meaning: "samples that were not finite",
        merge: Merge::Sum,
        ..LayerKind::COLOUR
    },
];

/// A layer's name without its number.
pub(super) fn stem(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit())
}

/// The kind of a layer by its plain name, and whether the name belongs to a finished part; `None` for an unknown name.
/// A number may be missing: `Level` is the kind of all levels. Accepts former names, see [`current_name`].
pub fn kind_of(name: &str) -> Option<(&'static LayerKind, bool)> {
    let is = |name: &str| LAYERS.iter().find(|kind| kind.is(name));
    let finished = |prefix: &str| {
        let kind = name.strip_prefix(prefix).and_then(is)?;
        kind.finished_prefix().filter(|own| *own == prefix || prefix == COMBINED).map(|_| (kind, true))
    };
    [COMBINED, LOBE, GROUP].into_iter().find_map(finished).or_else(|| Some((is(name)?, false)))
}

/// The name of a layer that may have its former name: the names of all finished parts began with `Combined`.
pub fn current_name(name: &str) -> Cow<'_, str> {
    match (kind_of(name), name.strip_prefix(COMBINED)) {
        (Some((kind, true)), Some(part)) => format!("{}{part}", kind.finished_prefix().unwrap_or(COMBINED)).into(),
        _ => name.into(),
    }
}

/// The former name of a layer, if it had another one.
pub fn former_name(name: &str) -> Option<String> {
    let (kind, finished) = kind_of(name)?;
    let prefix = kind.finished_prefix().filter(|prefix| finished && *prefix != COMBINED)?;
    name.strip_prefix(prefix).map(|part| format!("{COMBINED}{part}"))
}

/// Names of the layers with additive parts of the picture that every render has, in the order in which they are finished.
pub fn part_names() -> impl Iterator<Item = &'static str> {
    let is_part = |kind: &&LayerKind| {
        matches!(kind.finish, Some(Use::Part(_))) && kind.suffix == Suffix::None && !kind.on_request
    };
    LAYERS.iter().filter(is_part).map(|kind| kind.name)
}

/// Whether the layer `name` is one of [`part_names`], of which the finish makes the picture.
pub fn is_effect(name: &str) -> bool {
    part_names().any(|part| part == name)
}

/// Names of the layers with the light by the lobe of the first hit, in the order in which they are finished.
pub fn lobe_names() -> impl Iterator<Item = &'static str> {
    LOBE_LAYERS.iter().map(|(_, name)| *name)
}

/// Name of the finished part of the layer `name`; `None` if the layer is not an additive part.
pub fn finished_part(name: &str) -> Option<String> {
    match kind_of(name)? {
        (kind, false) => Some(format!("{}{name}", kind.finished_prefix()?)),
        _ => None,
    }
}

/// Components, unit and meaning of a layer, for users.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerDescription {
    /// Components of the layer, one letter each, such as `RGB`.
    pub components: &'static str,
    /// Unit of the layer's values, in words.
    pub unit: &'static str,
    /// Meaning of the layer's values, in words.
    pub meaning: &'static str,
}

impl fmt::Display for LayerDescription {
    /// Writes `meaning [unit]`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.meaning, self.unit)
    }
}

/// Description of a layer by its plain name; `None` for an unknown name.
pub fn describe(name: &str) -> Option<LayerDescription> {
    let (&LayerKind { components, unit, meaning, finish, .. }, finished) = kind_of(name)?;
    let meaning = match finish {
        Some(Use::Part(meaning)) if finished => meaning,
        _ => meaning,
    };
    Some(LayerDescription { components, unit, meaning })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every layer has one kind, and every kind a name, a unit and a meaning.
    #[test]
    fn layers_are_found_by_name() {
        for (index, kind) in LAYERS.iter().enumerate() {
            let (found, finished) = kind_of(kind.name).expect("it is in the table");
            assert!(std::ptr::eq(found, kind) && !finished, "{}", kind.name);
            assert!(LAYERS[..index].iter().all(|other| other.name != kind.name), "{}", kind.name);
            assert!(!kind.components.is_empty() && !kind.unit.is_empty() && !kind.meaning.is_empty(), "{}", kind.name);
        }
        let known = |name: &str| kind_of(name).map(|(kind, finished)| (kind.name, finished));
        assert_eq!(known("Level3"), Some(("Level", false)));
        assert_eq!(known("CombinedCaustic"), Some(("Caustic", true)));
        for name in ["FinishedCaustic_key2", "CombinedCaustic_key2"] {
            assert_eq!((known(name), &*current_name(name)), (Some((CAUSTIC, true)), "FinishedCaustic_key2"));
        }
        for (current, former) in [
            ("LobeDiffuseDirect", Some("CombinedDiffuseDirect")),
            ("FinishedLightGroup_key", Some("CombinedLightGroup_key")),
            ("CombinedDirect", None),
            ("DiffuseDirect", None),
        ] {
            assert_eq!(former_name(current).as_deref(), former);
            assert_eq!(current_name(former.unwrap_or(current)), current);
        }
        assert_eq!(known("CryptoObject00"), Some((CRYPTOMATTES[0], false)));
        for name in
            ["Combined", "CombinedNoisy", "Combined1", "LobeDirect", "FinishedDirect", "3", "albedo2", "Diffuse"]
        {
            assert_eq!(known(name), None, "{name}");
        }
        assert_eq!(part_names().collect::<Vec<_>>(), ["Emission", "Volume", "Caustic", "Direct", "Indirect"]);
        assert_eq!(finished_part("LightGroup_key"), Some("FinishedLightGroup_key".into()));
        assert_eq!((finished_part("CombinedDirect"), finished_part("Noisy")), (None, None));
    }
}
