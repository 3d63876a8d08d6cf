//! The table of layers. `output.rs` gives a layer its values; names in files, `--layers`, `info`, merging, the finish,
//! Blender's add-on, the USD converter and the page for compositors follow this table.

/// Beginning of the names of layers of a group of lights.
pub const LIGHT_GROUP: &str = "LightGroup_";
/// Beginning of the names of layers of its caustics.
pub const CAUSTIC: &str = "Caustic_";
/// Beginning of the names of finished parts.
pub const COMBINED: &str = "Combined";

/// Beginnings of the names of cryptomattes: of objects and of materials.
pub const CRYPTOMATTES: [&str; 2] = ["CryptoObject", "CryptoMaterial"];

/// What follows a kind's name in the names of its layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Suffix {
    /// Nothing: there is one layer.
    None,
    /// The number of a bandwidth level, from 1.
    Level,
    /// The number of a quarter of the iterations, 1 to 4.
    Quarter,
    /// The number of a pair of cryptomatte ranks, `00` and up.
    Ranks,
    /// The name of a light group.
    Group,
}

/// How a layer of renders with different seeds is put together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// The mean.
    Mean,
    /// Variances of the mean: independent ones add by squares of weights.
    Variance,
    /// Standard errors: their mean square.
    Error,
    /// Counts: their sum.
    Sum,
    /// The first render's: distances, which the background has none of, and bandwidths.
    First,
    /// Ids and their shares.
    Matte,
}

/// What the finish reads a layer for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// The picture.
    Picture,
    /// The error of the picture.
    Error,
    /// A part of the picture, which is finished, too: its meaning then.
    Part(&'static str),
}

/// A kind of layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerKind {
    /// Name in plain files, without the suffix; empty for the picture.
    pub name: &'static str,
    /// What follows the name.
    pub suffix: Suffix,
    /// Components, one letter each.
    pub components: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// What the values are.
    pub meaning: &'static str,
    /// How renders with different seeds are merged.
    pub merge: Merge,
    /// What the finish reads it for.
    pub finish: Option<Use>,
    /// Whether compositing takes it (`--layers comp`), as it takes finished parts.
    pub compositing: bool,
    /// Whether half floats hold it as well as anybody sees, where no value is too large.
    pub half: bool,
    /// Whether `--layers all` leaves it out.
    pub on_request: bool,
    /// Blender's name of the pass, where it is another.
    pub blender: Option<&'static str>,
    /// Switch of Blender's view layer that asks for the pass; finished parts have one of their own.
    pub switch: Option<&'static str>,
}

const RADIANCE: &str = "W/(sr m^2)";

impl LayerKind {
    /// Radiance, averaged over renders.
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

    /// An additive part of the picture, and its meaning when finished.
    const fn part(name: &'static str, meaning: &'static str, finished: &'static str) -> LayerKind {
        let switch = Some("noisy_parts");
        LayerKind { name, meaning, finish: Some(Use::Part(finished)), switch, ..LayerKind::COLOUR }
    }

    /// The same of a group of lights.
    const fn of_group(name: &'static str, meaning: &'static str, finished: &'static str) -> LayerKind {
        LayerKind { suffix: Suffix::Group, ..LayerKind::part(name, meaning, finished) }
    }

    /// A bandwidth of each level.
    const fn radius(name: &'static str, meaning: &'static str) -> LayerKind {
        let (suffix, merge) = (Suffix::Level, Merge::First);
        LayerKind { name, meaning, suffix, merge, components: "X", unit: "m", ..LayerKind::COLOUR }
    }

    /// A distance or place that the first render tells.
    const fn first(name: &'static str, components: &'static str, meaning: &'static str) -> LayerKind {
        LayerKind { name, components, unit: "m", meaning, merge: Merge::First, ..LayerKind::COLOUR }
    }

    /// Cryptomattes.
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

    /// Name of the finished part, without the suffix; `None` for a layer that is no part.
    pub fn finished(&self) -> Option<String> {
        matches!(self.finish, Some(Use::Part(_))).then(|| format!("{COMBINED}{}", self.name))
    }

    /// Whether its layer or one of its layers has this name; the number may be missing.
    fn is(&self, name: &str) -> bool {
        match self.suffix {
            Suffix::None => name == self.name,
            Suffix::Level | Suffix::Quarter | Suffix::Ranks => stem(name) == self.name,
            Suffix::Group => name.starts_with(self.name),
        }
    }
}

/// Kinds of layers, the parts in the order in which they are finished: the last takes the light of no part.
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
        switch: Some("error"),
        ..LayerKind::COLOUR
    },
    LayerKind {
        name: "albedo",
        unit: "1",
        meaning: "reflectance at the first hit that is not a perfect mirror or clear glass",
        finish: Some(Use::Picture),
        compositing: true,
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
        compositing: true,
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

/// The kind of a layer of ours by its plain name, and whether it is the finished part; `None` for a name that is not
/// ours. A number may be missing: `Level` stands for all levels.
pub fn kind_of(name: &str) -> Option<(&'static LayerKind, bool)> {
    let is = |name: &str| LAYERS.iter().find(|kind| kind.is(name));
    let finished = name.strip_prefix(COMBINED).and_then(is).filter(|kind| kind.finished().is_some());
    finished.map(|kind| (kind, true)).or_else(|| Some((is(name)?, false)))
}

/// Names of the additive parts, in the order in which they are finished.
pub fn part_names() -> impl Iterator<Item = &'static str> {
    let is_part = |kind: &&LayerKind| matches!(kind.finish, Some(Use::Part(_))) && kind.suffix == Suffix::None;
    LAYERS.iter().filter(is_part).map(|kind| kind.name)
}

/// The layer of the finished part; `None` for layers that are no parts.
pub fn finished_part(name: &str) -> Option<String> {
    match kind_of(name)? {
        (LayerKind { finish: Some(Use::Part(_)), .. }, false) => Some(format!("{COMBINED}{name}")),
        _ => None,
    }
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
        assert_eq!(known("CombinedCaustic_key2"), Some((CAUSTIC, true)));
        assert_eq!(known("CryptoObject00"), Some((CRYPTOMATTES[0], false)));
        for name in ["Combined", "CombinedNoisy", "Combined1", "3", "albedo2", "Diffuse"] {
            assert_eq!(known(name), None, "{name}");
        }
        assert_eq!(part_names().collect::<Vec<_>>(), ["Emission", "Volume", "Caustic", "Direct", "Indirect"]);
        assert_eq!(finished_part("LightGroup_key"), Some("CombinedLightGroup_key".into()));
        assert_eq!((finished_part("CombinedDirect"), finished_part("Noisy")), (None, None));
    }
}
