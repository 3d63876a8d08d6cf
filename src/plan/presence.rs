//! Which effects a scene calls for, and because of what, from the scene and the camera alone.

use super::effect::Effect;
use super::names::{Worn, cut, cut_list, lights, worn_in};
use crate::camera::Camera;
use crate::material::{Alpha, Material};
use crate::scene::Scene;

/// What calls for each effect, by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Presence {
    because: [Vec<String>; Effect::ALL.len()],
}

impl Presence {
    /// Looks at what the scene wears and what lights it. An effect is present rather too often than too seldom: whether
    /// its light comes through is for a render to find out.
    pub fn of(scene: &Scene, camera: &Camera) -> Presence {
        let all = lights(scene, |_| true);
        let lit = |reasons: Vec<String>| if all.is_empty() { vec![] } else { reasons };
        let worn = worn_in(scene);
        let objects: Vec<String> = worn.iter().flat_map(|worn| worn.objects.iter().cloned()).collect();
        let under = format!("under {}", cut(&all));
        let glossy = |worn: &Worn| worn.material.is_glossy() && !worn.material.is_clear();
        let shines = |worn: &Worn| glossy(worn).then(|| worn.label());
        let focuses = |worn: &&Worn| worn.material.focuses();
        let caustic = |worn: &Worn| format!("{} {under}", worn.label());
        let seen = |worn: &Worn| {
            let how = if worn.material.transmission > 0.0 { "through" } else { "in" };
            format!("caustics seen {how} {}", worn.label())
        };
        let environment = scene.lights.sky().environment.is_some();
        let property = |effect| property(effect, &worn);
        let because = Effect::ALL.map(|effect| {
            cut_list(match effect {
                // A sun with a disc shows it; what is smaller than any disc nobody sees.
                Effect::Emission => lights(scene, |emitter| !emitter.is_delta()),
                Effect::Direct if objects.is_empty() => vec![],
                Effect::Direct => all.clone(),
                Effect::Indirect if objects.is_empty() => vec![],
                Effect::Indirect => lit(vec![format!("{} {under}", cut(&objects))]),
                Effect::Glossy => lit(worn.iter().filter_map(shines).collect()),
                Effect::Caustic => lit(worn.iter().filter(focuses).map(caustic).collect()),
                // Whatever focuses can also stand between the eye and what it, or another, focuses on.
                Effect::Sds => lit(worn.iter().filter(focuses).map(seen).collect()),
                Effect::Volume => scene.medium.map(|_| SPACE.to_string()).into_iter().chain(property(effect)).collect(),
                Effect::DepthOfField => Vec::from_iter(camera.has_lens().then(|| "the camera's aperture".into())),
                Effect::Environment => Vec::from_iter(environment.then(|| ENVIRONMENT.into())),
                Effect::Dispersion | Effect::Alpha | Effect::Textures => property(effect),
            })
        });
        Presence { because }
    }

    /// What calls for an effect; nothing: the scene has none of it.
    pub fn because(&self, effect: Effect) -> &[String] {
        &self.because[effect as usize]
    }

    /// Whether the scene calls for an effect.
    pub fn has(&self, effect: Effect) -> bool {
        !self.because(effect).is_empty()
    }
}

/// The medium that fills the space, as a reason.
pub(super) const SPACE: &str = "the scene's medium";
/// Light from all around, as a reason.
pub(super) const ENVIRONMENT: &str = "the environment";

/// Materials that call for an effect that is a property of materials.
pub(super) fn property(effect: Effect, worn: &[Worn]) -> Vec<String> {
    let calls: fn(&Material) -> bool = match effect {
        Effect::Volume => |material| material.is_solid_glass() && material.medium.is_some(),
        Effect::Dispersion => Material::disperses,
        Effect::Alpha => |material| material.alpha != Alpha::Opaque,
        Effect::Textures => |material| material.textures().next().is_some(),
        _ => return vec![],
    };
    let inside = if effect == Effect::Volume { "the medium of " } else { "" };
    worn.iter().filter(|worn| calls(worn.material)).map(|worn| format!("{inside}{}", worn.label())).collect()
}
