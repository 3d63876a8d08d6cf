//! Invariants of the scene descriptions that readers return.

use caustique::scene::Description;

/// Checks that all indices are valid, all numbers finite and all transforms invertible.
pub fn check(scene: &Description, what: &str) {
    for instance in &scene.instances {
        assert!((instance.mesh as usize) < scene.meshes.len(), "{what}");
        assert!((instance.material as usize) < scene.materials.len(), "{what}");
        assert!((instance.object as usize) < scene.objects.len(), "{what}");
        assert!(instance.to_world.inverse().is_finite(), "{what}");
    }
    for mesh in &scene.meshes {
        let n = mesh.positions.len();
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < n), "{what}");
        assert!(mesh.positions.iter().all(|p| p.is_finite()) && mesh.normals.iter().all(|p| p.is_finite()), "{}", what);
        assert!(mesh.tangents.iter().all(|t| t.is_finite()) && mesh.colors.iter().all(|c| c.is_finite()), "{what}");
        for len in [mesh.normals.len(), mesh.tangents.len(), mesh.uvs[0].len(), mesh.uvs[1].len(), mesh.colors.len()] {
            assert!(len == 0 || len == n, "{what}");
        }
    }
    for material in &scene.materials {
        let shares = [material.metallic.factor, material.roughness.factor, material.transmission.factor];
        assert!(material.base_color.iter().chain(&shares).all(|x| (0.0..=1.0).contains(x)), "{what}");
        assert!(material.emission.is_finite() && material.ior >= 1.0, "{what}");
        assert!(material.base_color_texture.is_none_or(|t| (t.texture as usize) < scene.textures.len()), "{what}");
    }
    for light in &scene.lights {
        assert!(light.intensity.is_finite() && light.radius >= 0.0, "{what}");
    }
}
