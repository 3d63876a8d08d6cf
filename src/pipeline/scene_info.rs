//! Objects, materials, lights and the rest of a scene as JSON, for `caustique info --json` and Python's `Scene.info`.

use crate::light::Light;
use crate::math::Vec3;
use crate::scene::Scene;
use crate::scene::description::FileContents;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The contents of a scene that was read from `path`.
pub fn scene_info(path: &Path, scene: &Scene) -> Value {
    let shapes = &scene.shapes;
    let stored: usize = shapes.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let materials: Vec<&str> = scene.materials.list.iter().map(|m| m.name.as_str()).collect();
    let cameras: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    let textures = scene.materials.textures.iter();
    let textures = textures.map(|t| json!({"name": t.name, "width": t.width, "height": t.height}));
    let mut lights = Map::new();
    for emitter in scene.lights.emitters() {
        let count = lights.get(emitter.name()).and_then(Value::as_u64).unwrap_or(0);
        lights.insert(emitter.name().into(), (count + 1).into());
    }
    let FileContents { scenes, scene: shown, animations, variants, extensions, .. } = &scene.contents;
    json!({
        "scene": path.display().to_string(),
        "scenes": scenes,
        "scene_shown": shown.map(|index| &scenes[index]),
        "animations": animations,
        "variants": variants,
        "extensions": extensions,
        "objects": scene.objects,
        "triangles_of_objects": triangles_of_objects(scene),
        "meshes": shapes.meshes.len(),
        "instances": shapes.instances.len(),
        "triangles": shapes.triangles(),
        "triangles_stored": stored,
        "materials": materials,
        "textures": scene.materials.textures.len(),
        "texture_sizes": textures.collect::<Vec<Value>>(),
        "lights": lights,
        "light_names": light_names(scene),
        "cameras": cameras,
        "dimensions": dimensions(scene),
        "radius": scene.lights.sky().radius,
        "warnings": scene.warnings,
    })
}

/// Number of triangles of each object.
fn triangles_of_objects(scene: &Scene) -> Vec<usize> {
    let mut counts = vec![0; scene.objects.len()];
    for instance in &scene.shapes.instances {
        counts[instance.object as usize] += scene.shapes.meshes[instance.mesh as usize].triangles.len();
    }
    counts
}

/// Names of the lights: points, spots and suns, objects that emit light, and the environment.
fn light_names(scene: &Scene) -> Vec<String> {
    let mut names: Vec<String> = (0..scene.lights.emitters().len()).map(|index| scene.light_name(index)).collect();
    // All triangles of an object have its name.
    names.dedup();
    names
}

/// Extents of the scene along X, Y and Z (m).
fn dimensions(scene: &Scene) -> [f32; 3] {
    let (low, high) = scene.shapes.bounds();
    (high - low).max(Vec3::ZERO).to_array()
}
