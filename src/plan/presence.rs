//! Effects that a scene calls for, and the reasons, from scene and camera alone.

use super::names::{UsedMaterial, lights, truncate_names, truncate_reasons, used_in_scene};
use crate::camera::Camera;
use crate::light::Light;
use crate::material::{Alpha, Material};
use crate::path_class::Effect;
use crate::scene::Scene;

/// The effects that a scene calls for: for each effect, the names of the materials, lights and so on that need it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Presence {
    because: [Vec<String>; Effect::ALL.len()],
}

impl Presence {
    /// Inspects the materials and lights of a scene. The result may contain effects that the picture does not show,
    /// because no ray is traced.
    pub fn of(scene: &Scene, camera: &Camera) -> Presence {
        let all = lights(scene, |_| true);
        let lit = |reasons: Vec<String>| if all.is_empty() { vec![] } else { reasons };
        let used = used_in_scene(scene);
        let objects: Vec<String> = used.iter().flat_map(|used| used.objects.iter().cloned()).collect();
        let under = format!("under {}", truncate_names(&all));
        let glossy = |used: &UsedMaterial| used.material.is_glossy() && !used.material.is_clear();
        let shines = |used: &UsedMaterial| glossy(used).then(|| used.label());
        let focuses = |used: &&UsedMaterial| used.material.focuses();
        let caustic = |used: &UsedMaterial| format!("{} {under}", used.label());
        let seen = |used: &UsedMaterial| {
            let how = if used.material.transmission.factor > 0.0 { "through" } else { "in" };
            format!("caustics seen {how} {}", used.label())
        };
        let environment = scene.lights.sky().shines();
        let property = |effect| material_reasons(effect, &used);
        let because = Effect::ALL.map(|effect| {
            truncate_reasons(match effect {
                // Suns with a disc and bulbs are visible; other delta lights are not.
                Effect::Emission => lights(scene, |emitter| !emitter.is_delta() || emitter.bulb().is_some()),
                Effect::Direct if objects.is_empty() => vec![],
                Effect::Direct => all.clone(),
                Effect::Indirect if objects.is_empty() => vec![],
                Effect::Indirect => lit(vec![format!("{} {under}", truncate_names(&objects))]),
                Effect::Glossy => lit(used.iter().filter_map(shines).collect()),
                Effect::Caustic => lit(used.iter().filter(focuses).map(caustic).collect()),
                // An object that focuses light can also be between the camera and a caustic.
                Effect::Sds => lit(used.iter().filter(focuses).map(seen).collect()),
                Effect::Volume => scene.medium.map(|_| SPACE.to_string()).into_iter().chain(property(effect)).collect(),
                Effect::DepthOfField => Vec::from_iter(camera.has_lens().then(|| "the camera's aperture".into())),
                Effect::Environment => Vec::from_iter(environment.then(|| ENVIRONMENT.into())),
                Effect::Dispersion | Effect::Alpha | Effect::Textures => property(effect),
            })
        });
        Presence { because }
    }

    /// Names of the materials, lights and so on that call for an effect; empty if the scene does not have the effect.
    pub fn because(&self, effect: Effect) -> &[String] {
        &self.because[effect as usize]
    }

    /// Whether the scene calls for an effect.
    pub fn has(&self, effect: Effect) -> bool {
        !self.because(effect).is_empty()
    }
}

/// Name of the medium outside all solids, as a reason why a scene calls for an effect.
pub(super) const SPACE: &str = "the scene's medium";
/// Name of the environment, as a reason why a scene calls for an effect.
pub(super) const ENVIRONMENT: &str = "the environment";

/// Names of the materials in `used` that call for an effect; empty if the effect is not a property of materials.
pub(super) fn material_reasons(effect: Effect, used: &[UsedMaterial]) -> Vec<String> {
    let calls: fn(&Material) -> bool = match effect {
        Effect::Volume => |material| material.is_solid() && material.medium.is_some(),
        Effect::Dispersion => Material::disperses,
        Effect::Alpha => |material| material.alpha != Alpha::Opaque,
        Effect::Textures => |material| material.textures().next().is_some(),
        _ => return vec![],
    };
    let inside = |material: &Material| match (effect, &material.grids) {
        (Effect::Volume, Some(_)) => "the heterogeneous medium of ",
        (Effect::Volume, None) => "the medium of ",
        _ => "",
    };
    let used = used.iter().filter(|used| calls(used.material));
    used.map(|used| format!("{}{}", inside(used.material), used.label())).collect()
}
