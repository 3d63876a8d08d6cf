//! Effects of light transport, and sets of them.

use serde::{Serialize, Serializer};
use std::str::FromStr;

/// An effect of light transport that a scene may call for and a render may simulate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effect {
    /// Lights that the camera sees, directly or through perfect mirrors and clear glass.
    Emission,
    /// Light that exactly one surface scatters between the light and the camera.
    Direct,
    /// Light that several surfaces scatter between the light and the camera.
    Indirect,
    /// Reflections in narrow lobes, except perfect mirrors, clear glass and caustics.
    Glossy,
    /// Light focused by mirrors and glass.
    Caustic,
    /// Caustics seen through glass or in a mirror: specular, diffuse, specular.
    Sds,
    /// Absorption and scattering in participating media.
    Volume,
    /// Refraction that depends on the wavelength.
    Dispersion,
    /// Depth of field: blur outside the camera's focus.
    DepthOfField,
    /// Light from an environment (sky) at infinity.
    Environment,
    /// Surfaces that are cut out or blended by alpha.
    Alpha,
    /// Textures of materials. Without this effect, their mean values are used.
    Textures,
}

impl Effect {
    /// All effects, in the order in which lists print them.
    pub const ALL: [Effect; 12] = [
        Effect::Emission,
        Effect::Direct,
        Effect::Indirect,
        Effect::Glossy,
        Effect::Caustic,
        Effect::Sds,
        Effect::Volume,
        Effect::Dispersion,
        Effect::DepthOfField,
        Effect::Environment,
        Effect::Alpha,
        Effect::Textures,
    ];

    /// The name of the effect on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Effect::Emission => "emission",
            Effect::Direct => "direct",
            Effect::Indirect => "indirect",
            Effect::Glossy => "glossy",
            Effect::Caustic => "caustic",
            Effect::Sds => "sds",
            Effect::Volume => "volume",
            Effect::Dispersion => "dispersion",
            Effect::DepthOfField => "depth_of_field",
            Effect::Environment => "environment",
            Effect::Alpha => "alpha",
            Effect::Textures => "textures",
        }
    }

    /// Whether the effect is made of path classes, which a render can leave out. Other effects are properties of the
    /// scene: to remove one changes the scene.
    pub fn is_class(self) -> bool {
        self <= Effect::Sds
    }
}

impl Serialize for Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl FromStr for Effect {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        // `medium` is an alias.
        let name = if text == "medium" { "volume" } else { text };
        Effect::ALL.into_iter().find(|effect| effect.name() == name).ok_or_else(|| {
            let names = Effect::ALL.map(Effect::name).join(", ");
            format!("there is no effect '{text}'; there are {names}")
        })
    }
}

/// A set of effects, one bit per effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectSet(u16);

impl EffectSet {
    /// The empty set.
    pub const NONE: EffectSet = EffectSet(0);

    /// Whether the set contains an effect.
    pub fn has(self, effect: Effect) -> bool {
        self.0 & 1 << effect as u16 != 0
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The effects of the set, in the order of [`Effect::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Effect> {
        Effect::ALL.into_iter().filter(move |effect| self.has(*effect))
    }

    /// The effects of the set that are made of path classes ([`Effect::is_class`]).
    pub fn classes(self) -> EffectSet {
        self.iter().filter(|effect| effect.is_class()).collect()
    }
}

impl FromIterator<Effect> for EffectSet {
    fn from_iter<I: IntoIterator<Item = Effect>>(effects: I) -> EffectSet {
        EffectSet(effects.into_iter().fold(0, |set, effect| set | 1 << effect as u16))
    }
}

/// The value of the option `--effects`, such as `-dispersion,+volume`: effects that the user switches off or expects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switches {
    /// Effects that the render leaves out, given with a minus sign.
    pub off: EffectSet,
    /// Effects that the user expects in the scene, given with a plus sign. The plan simulates every effect of the scene
    /// anyway, and warns if one of these is not in the scene.
    pub on: EffectSet,
}

impl FromStr for Switches {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (mut off, mut on) = (Vec::new(), Vec::new());
        for word in text.split(',').map(str::trim) {
            let (list, name) = match (word.strip_prefix('-'), word.strip_prefix('+')) {
                (Some(name), _) => (&mut off, name),
                (_, Some(name)) => (&mut on, name),
                _ if word.is_empty() => return Err("an effect is missing, such as -dispersion".into()),
                _ => return Err(format!("each effect needs a sign: -{word} leaves it out, +{word} asks for it")),
            };
            list.push(name.trim().parse::<Effect>()?);
        }
        if let Some(both) = off.iter().find(|effect| on.contains(effect)) {
            return Err(format!("'{}' is switched both off and on", both.name()));
        }
        Ok(Switches { off: off.into_iter().collect(), on: on.into_iter().collect() })
    }
}

impl Serialize for Switches {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let off = self.off.iter().map(|effect| format!("-{}", effect.name()));
        let on = self.on.iter().map(|effect| format!("+{}", effect.name()));
        serializer.serialize_str(&off.chain(on).collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_are_read() {
        let switches: Switches = "-dispersion, +medium,-sds".parse().unwrap();
        assert_eq!(switches.off.iter().collect::<Vec<_>>(), [Effect::Sds, Effect::Dispersion]);
        assert!(switches.on.has(Effect::Volume) && !switches.on.has(Effect::Sds));
        assert_eq!(switches.off.classes().iter().collect::<Vec<_>>(), [Effect::Sds]);
        assert_eq!(serde_json::to_value(switches).unwrap(), "-sds,-dispersion,+volume");
        let error = |text: &str| text.parse::<Switches>().unwrap_err();
        assert_eq!(error("caustic"), "each effect needs a sign: -caustic leaves it out, +caustic asks for it");
        assert_eq!(error("-alpha,+alpha"), "'alpha' is switched both off and on");
        assert!(error("-bloom").starts_with("there is no effect 'bloom'; there are emission, direct, "));
        assert!(error("").starts_with("an effect is missing"));
    }

    #[test]
    fn path_classes_come_first_and_every_name_parses() {
        assert_eq!(Effect::ALL.iter().filter(|effect| effect.is_class()).count(), 6);
        for effect in Effect::ALL {
            assert_eq!(effect.name().parse(), Ok(effect));
        }
        assert!(EffectSet::NONE.is_empty() && !EffectSet::from_iter([Effect::Textures]).is_empty());
    }
}
