//! The effects by name, and sets of them.

use serde::{Serialize, Serializer};
use std::str::FromStr;

/// Something that a scene may call for and a render may simulate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effect {
    /// Sources of light that can be seen.
    Emission,
    /// Light that comes straight from its source.
    Direct,
    /// Light that surfaces have scattered before.
    Indirect,
    /// Narrow lobes: what shines and reflects, but for perfect mirrors and clear glass, and for caustics.
    Glossy,
    /// Light that mirrors and glass have focused.
    Caustic,
    /// The same seen through glass or in a mirror: specular, diffuse, specular.
    Sds,
    /// Media that absorb or scatter.
    Volume,
    /// Colours that refract differently.
    Dispersion,
    /// Blur out of the camera's focus.
    DepthOfField,
    /// Light from all around.
    Environment,
    /// Cut-outs and blending.
    Alpha,
    /// Textures.
    Textures,
}

impl Effect {
    /// All of them, in the order in which they are listed.
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

    /// Its name on the command line and in files.
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

    /// Whether it is a class of light paths; the others are properties of the scene, and without them it is another
    /// scene.
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
        // What fills space is called a medium, too.
        let name = if text == "medium" { "volume" } else { text };
        Effect::ALL.into_iter().find(|effect| effect.name() == name).ok_or_else(|| {
            let names = Effect::ALL.map(Effect::name).join(", ");
            format!("there is no effect '{text}'; there are {names}")
        })
    }
}

/// A set of effects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectSet(u16);

impl EffectSet {
    /// Nothing.
    pub const NONE: EffectSet = EffectSet(0);

    /// Whether it holds an effect.
    pub fn has(self, effect: Effect) -> bool {
        self.0 & 1 << effect as u16 != 0
    }

    /// Whether it holds nothing.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The effects, in their order.
    pub fn iter(self) -> impl Iterator<Item = Effect> {
        Effect::ALL.into_iter().filter(move |effect| self.has(*effect))
    }

    /// Those that are classes of light paths.
    pub fn classes(self) -> EffectSet {
        self.iter().filter(|effect| effect.is_class()).collect()
    }
}

impl FromIterator<Effect> for EffectSet {
    fn from_iter<I: IntoIterator<Item = Effect>>(effects: I) -> EffectSet {
        EffectSet(effects.into_iter().fold(0, |set, effect| set | 1 << effect as u16))
    }
}

/// Effects asked for against the plan: `-dispersion,+volume`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switches {
    /// To be left out.
    pub off: EffectSet,
    /// Asked for by name; the plan has everything that the scene calls for, so this only asserts it.
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
    fn classes_come_first_and_names_are_found() {
        assert_eq!(Effect::ALL.iter().filter(|effect| effect.is_class()).count(), 6);
        for effect in Effect::ALL {
            assert_eq!(effect.name().parse(), Ok(effect));
        }
        assert!(EffectSet::NONE.is_empty() && !EffectSet::from_iter([Effect::Textures]).is_empty());
    }
}
