//! The scenes of this project load completely and without warnings.

use caustique::scene::gltf::{ReadOptions, read};
use std::path::Path;

/// Minimum numbers of triangles, instances, cameras and lights of each scene.
const SCENES: [(&str, [usize; 4]); 8] = [
    ("cornell", [20_000, 9, 1, 0]),
    ("fog", [20_000, 10, 1, 2]),
    ("gems", [2_000, 20, 1, 2]),
    ("interior", [100_000, 300, 1, 2]),
    ("lamp", [10_000, 5, 1, 0]),
    ("pool", [10_000, 5, 1, 1]),
    ("stadium", [10_000, 50, 1, 50]),
    ("torus", [10_000, 6, 1, 1]),
];

#[test]
fn our_scenes_load() {
    for (name, least) in SCENES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("glb");
        let scene = read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let triangles: usize = scene.instances.iter().map(|i| scene.meshes[i.mesh as usize].triangles.len()).sum();
        let found = [triangles, scene.instances.len(), scene.cameras.len(), scene.lights.len()];
        let closed = scene.meshes.iter().filter(|m| m.closed).count();
        let solids = scene.materials.iter().filter(|m| m.is_solid()).count();
        println!(
            "{name}: {found:?}, {} meshes ({closed} closed), {} materials ({solids} solid glass), {} textures, \
             environment {}, medium {:?}",
            scene.meshes.len(),
            scene.materials.len(),
            scene.textures.len(),
            scene.environment.is_some(),
            scene.medium
        );
        // Warnings would mean that a scene of this project has a mistake.
        assert_eq!(scene.warnings, Vec::<String>::new(), "{name}");
        assert!(found.iter().zip(least).all(|(have, least)| *have >= least), "{name}: {found:?}, not {least:?}");
    }
}
