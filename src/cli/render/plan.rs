//! The plan in the header: the method and why, and for each effect whether the scene calls for it and whether it is simulated.

use super::options::{Method, RenderArgs};
use crate::cli::say;
use caustique::camera::Camera;
use caustique::error::{Error, Kind, Result};
use caustique::light::Emitter;
use caustique::material::Material;
use caustique::render;
use caustique::scene::Scene;
use serde_json::{Value, json};

/// Wider lobes focus no light and show no reflections.
const WIDEST_ROUGHNESS: f32 = 0.45;

/// Every effect by name: what calls for it (nothing: the scene has none of it), and whether the method simulates it.
pub fn plan(args: &RenderArgs, scene: &Scene, camera: &Camera) -> Value {
    let mut worn = vec![false; scene.materials.list.len()];
    for instance in &scene.shapes.instances {
        worn[instance.material as usize] = true;
    }
    let worn: Vec<&Material> =
        scene.materials.list.iter().zip(worn).filter(|(_, worn)| *worn).map(|(material, _)| material).collect();
    let by_material = |has: fn(&Material) -> bool| -> Vec<String> {
        worn.iter().filter(|material| has(material)).map(|material| format!("material \"{}\"", material.name)).collect()
    };
    let when = |present: bool, reason: &str| if present { vec![reason.to_string()] } else { vec![] };
    let emitters = scene.lights.emitters();
    let lamps = emitters.iter().any(|emitter| matches!(emitter, Emitter::Triangle { .. }));
    let environment = scene.lights.sky().environment.is_some();
    let lit = |because: Vec<String>| if emitters.is_empty() { vec![] } else { because };
    let caustic = lit(by_material(focuses));
    let media =
        when(scene.medium.is_some(), "the scene's medium").into_iter().chain(by_material(|m| m.medium.is_some()));

    let method = args.method.chosen();
    // Segments of the shortest path that shows it; `--max-depth` cuts longer ones.
    let deep = |segments: u32| args.max_depth.is_none_or(|most| most >= segments);
    let surfaces = lit(when(!worn.is_empty(), "light falls on surfaces"));
    let effects = [
        ("emission", when(lamps || environment, "light sources can be seen"), deep(1)),
        ("direct", surfaces.clone(), deep(2)),
        ("indirect", surfaces, deep(3)),
        ("glossy", lit(by_material(narrow)), deep(2)),
        ("caustic", caustic.clone(), deep(3) && reaches(method, "caustic", scene)),
        ("sds", caustic, deep(4) && reaches(method, "sds", scene)),
        ("volume", media.collect(), deep(if scene.survey.scattering { 2 } else { 1 })),
        ("dispersion", by_material(Material::disperses), true),
        ("depth_of_field", when(camera.has_lens(), "the camera has an aperture"), true),
        ("environment", when(environment, "light comes from all around"), true),
        ("alpha", when(scene.survey.alpha, "materials have cut-outs or blend"), true),
        ("textures", when(!scene.materials.textures.is_empty(), "materials have textures"), true),
    ];
    let effects = effects.map(|(name, because, possible)| {
        let present = !because.is_empty();
        json!({"name": name, "present": present, "simulated": present && possible, "because": because})
    });
    let because = match args.method {
        Method::Auto => {
            "auto: the one method here that reaches every class of light paths, caustics behind glass and in mirrors too"
        }
        _ => "asked for",
    };
    json!({"method": method.name(), "because": because, "effects": effects})
}

/// Whether the method finds all light of such an effect. A lamp without size is not hit by any path: without photons it shows no light behind
/// glass, where it could be neither connected to nor run into.
fn reaches(method: render::Method, effect: &str, scene: &Scene) -> bool {
    let sizeless = scene.lights.emitters().iter().any(Emitter::is_delta);
    match (method, effect) {
        (render::Method::Path, _) => !sizeless,
        (render::Method::Light, "sds") => false,
        (render::Method::Bdpt, "sds") => !sizeless,
        _ => true,
    }
}

/// Whether the method can do without what media scatter, or finds it.
///
/// # Errors
/// Media scatter, and the method gathers photons on surfaces only.
pub fn check_media(args: &RenderArgs, scene: &Scene) -> Result<()> {
    let method = args.method.chosen();
    if !scene.survey.scattering || !matches!(method, render::Method::Pm | render::Method::Bpm) {
        return Ok(());
    }
    let cause = format!("--method {} does not render media that scatter light", method.name());
    let error = Error::new(Kind::Usage, args.scene.path.display(), cause);
    Err(error.hint("choose --method sppm, cppm, vcm, bdpt or path"))
}

/// Warns of effects that the scene calls for and the method chosen does not find.
pub fn tell_missed(args: &RenderArgs, plan: &Value) {
    let method = args.method.chosen();
    for effect in plan["effects"].as_array().into_iter().flatten() {
        let name = effect["name"].as_str().unwrap_or_default();
        if matches!(name, "caustic" | "sds")
            && effect["present"] == true
            && effect["simulated"] == false
            && args.max_depth.is_none()
        {
            let scene = args.scene.path.display();
            say(&format!(
                "warning: {scene}: --method {} does not find all light of the effect '{name}'",
                method.name()
            ));
        }
    }
}

/// Reflects or bends light into narrow lobes.
fn narrow(material: &Material) -> bool {
    material.roughness < WIDEST_ROUGHNESS || material.metallic_roughness_texture.is_some() || material.clearcoat > 0.0
}

/// Mirrors and glass, narrow enough to focus light.
fn focuses(material: &Material) -> bool {
    narrow(material) && (material.transmission > 0.0 || material.metallic >= 0.5)
}
