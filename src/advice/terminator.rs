//! Warns about coarse meshes with smooth shading, on which the terminator (the edge of the shadow that a body casts on
//! itself) follows the facets.

use super::rays;
use crate::geometry::Surface;
use crate::plan::names::truncate_names;
use crate::scene::Scene;
use crate::stat::median;
use std::collections::BTreeSet;

/// Maximum number of faces of a mesh whose normals are compared.
const MAX_FACES: usize = 256;
/// Angle (degrees) between a face and the shading normals of its corners above which the steps show: that of a sphere of
/// 24 columns.
const MAX_ANGLE: f32 = 10.0;

/// A warning that names the matte objects whose faces are turned away from their shading normals, if a light without size,
/// whose shadows have sharp edges, shines on the scene.
pub(super) fn stepped_shadows(scene: &Scene) -> Option<String> {
    scene.lights.others().next()?;
    let mut objects = BTreeSet::new();
    for (index, instance) in scene.shapes.instances.iter().enumerate() {
        let material = &scene.materials.list[instance.material as usize];
        let matte = material.transmission.factor < 0.5
            && material.metallic.factor < 0.5
            && !material.unlit
            && !material.emits();
        if matte && !objects.contains(&instance.object) && median_angle(scene, index as u32) > MAX_ANGLE {
            objects.insert(instance.object);
        }
    }
    let names: Vec<String> = objects.iter().map(|&object| format!("\"{}\"", scene.objects[object as usize])).collect();
    let (noun, its) = if names.len() == 1 { ("object", "its") } else { ("objects", "their") };
    (!names.is_empty()).then(|| {
        format!(
            "{noun} {}: {its} faces are large for smooth shading, so the edge of the shadow on {its} far side follows them in steps; subdivide the mesh (there is no shadow terminator offset, as Cycles has)",
            truncate_names(&names)
        )
    })
}

/// Median over faces of the largest angle (degrees) between the face and the shading normals of its corners.
fn median_angle(scene: &Scene, index: u32) -> f32 {
    let mesh = &scene.shapes.meshes[scene.shapes.instances[index as usize].mesh as usize];
    let angle = |surface: Surface| surface.ng.dot(surface.ns).abs().min(1.0).acos().to_degrees();
    let corner = |face: usize, at: [f32; 2]| scene.shapes.surface(index, face as u32, at).map_or(0.0, angle);
    let largest = |face| [[0.0; 2], [1.0, 0.0], [0.0, 1.0]].map(|at| corner(face, at)).into_iter().fold(0.0, f32::max);
    let mut angles: Vec<f32> = rays::spread_indices(mesh.triangles.len(), MAX_FACES).map(largest).collect();
    median(&mut angles, f32::total_cmp).unwrap_or(0.0)
}
