//! Meshes, accessors and the node hierarchy.

use super::glb::{CUBE, Glb};
use super::{message, read, try_read};
use caustique::math::{DVec3, Vec2, Vec3, Vec4};
use serde_json::json;

const QUAD: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn hierarchy_is_composed_and_meshes_are_shared() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    let matrix = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 6.0, 7.0, 1.0];
    let child =
        file.push("nodes", json!({"name": "child", "mesh": mesh, "translation": [1, 0, 0], "scale": [2, 2, 2]}));
    file.node(json!({"name": "parent", "mesh": mesh, "children": [child], "matrix": matrix}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    file.node(json!({"name": "turned", "mesh": mesh, "rotation": [0.0, half, 0.0, half],
        "translation": [100000.0001, 0, 0]}));
    let scene = read(&file);
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.objects, ["parent", "child", "turned"]);
    assert_eq!(scene.instances.iter().map(|i| (i.mesh, i.object)).collect::<Vec<_>>(), [(0, 0), (0, 1), (0, 2)]);
    // The matrix rotates X to Y: the child is at (5, 6, 7) + Y, twice as large.
    let p = scene.instances[1].to_world.transform_point3(DVec3::new(1.0, 0.0, 0.0));
    assert!((p - DVec3::new(5.0, 9.0, 7.0)).length() < 1e-12, "{p}");
    // A rotation by 90 degrees about +Y moves X to -Z. Digits beyond f32 are kept.
    let p = scene.instances[2].to_world.transform_point3(DVec3::X);
    assert!((p - DVec3::new(100000.0001, 0.0, -1.0)).length() < 1e-9, "{p}");
    let cube = &scene.meshes[0];
    assert!(cube.closed && cube.triangles.len() == 12 && cube.normals.is_empty() && cube.name == "cube");
    assert_eq!(scene.warnings, [""; 0]);
    assert_eq!(scene.materials[0].metallic, 1.0.into());
}

#[test]
fn nodes_that_are_hidden_or_without_area_are_left_out() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    let child = file.push("nodes", json!({"mesh": mesh}));
    file.node(json!({"children": [child], "extensions": {"KHR_node_visibility": {"visible": false}}}));
    file.node(json!({"name": "line", "mesh": mesh, "scale": [1, 0, 0]}));
    file.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    let scene = read(&file);
    assert!(scene.instances.is_empty());
    assert_eq!(scene.warnings, ["node \"line\": it is left out, because its scale leaves nothing of its area"]);
}

/// The upper and lower face of a cube remain, at the position of the node. The sides have no area.
#[test]
fn a_scale_of_zero_along_an_axis_flattens() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    file.node(json!({"name": "flat", "mesh": mesh, "scale": [2, 0, 3], "translation": [0, 5, 0]}));
    let scene = read(&file);
    assert_eq!(scene.warnings, [""; 0]);
    let [placed] = &scene.instances[..] else { panic!("{} instances", scene.instances.len()) };
    let flat = &scene.meshes[placed.mesh as usize];
    assert_eq!(flat.triangles.len(), 4);
    let most = |f: fn(DVec3) -> f64| {
        flat.positions.iter().map(|p| f(placed.to_world.transform_point3(p.as_dvec3()))).fold(0.0, f64::max)
    };
    assert_eq!([most(|p| p.x.abs()), most(|p| (p.y - 5.0).abs()), most(|p| p.z.abs())], [2.0, 0.0, 3.0]);
}

#[test]
fn the_default_scene_or_all_roots() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    let child = file.push("nodes", json!({"name": "a", "mesh": mesh}));
    file.push("nodes", json!({"name": "b", "mesh": mesh, "children": [child]}));
    file.push("scenes", json!({"nodes": [0]}));
    assert_eq!(read(&file).objects, [""; 0]);
    file.json["scene"] = json!(1);
    assert_eq!(read(&file).objects, ["a"]);
    file.json.as_object_mut().unwrap().remove("scenes");
    file.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(read(&file).objects, ["b", "a"]);
}

#[test]
fn copies_of_gpu_instancing() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    let moves = file.floats(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let scales = file.floats(&[[1.0; 3], [3.0; 3]]);
    file.node(json!({"name": "trees", "mesh": mesh, "translation": [0, 0, 1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves, "SCALE": scales}}}}));
    let scene = read(&file);
    assert_eq!((scene.instances.len(), scene.objects.len()), (2, 1));
    let p = scene.instances[1].to_world.transform_point3(DVec3::X);
    assert_eq!(p, DVec3::new(3.0, 2.0, 1.0));
    let short = file.floats(&[[1.0; 3]]);
    file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(short);
    assert!(message(&try_read(&file).unwrap_err()).contains("differ in length"));
}

#[test]
fn strips_fans_and_soups() {
    let mut file = Glb::new();
    let strip = file.floats(&[QUAD[0], QUAD[1], QUAD[3], QUAD[2]]);
    let fan = file.floats(&QUAD);
    let soup = file.floats(&[QUAD[0], QUAD[1], QUAD[2], QUAD[0]]);
    let part = |a: usize, mode: u32| json!({"attributes": {"POSITION": a}, "mode": mode});
    let parts = [part(strip, 5), part(fan, 6), part(soup, 4), part(soup, 1), part(soup, 0)];
    let mesh = file.push("meshes", json!({"name": "sheets", "primitives": parts}));
    file.node(json!({"mesh": mesh}));
    let scene = read(&file);
    let area = |m: &caustique::geometry::Mesh| -> f32 {
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| m.positions[i as usize]);
            (b - a).cross(c - a).z * 0.5
        };
        m.triangles.iter().map(cross).sum()
    };
    assert_eq!(scene.meshes.iter().map(|mesh| area(mesh)).collect::<Vec<_>>(), [1.0, 1.0, 0.5]);
    assert_eq!(scene.objects, ["sheets"]);
    assert_eq!(
        scene.warnings,
        [
            "mesh \"sheets\", primitive 2: the last 1 of its indices make no triangle",
            "mesh \"sheets\", primitive 3: it is made of lines, which are not rendered",
            "mesh \"sheets\", primitive 4: it is made of points, which are not rendered",
        ]
    );
}

#[test]
fn attributes_of_vertices() {
    let mut file = Glb::new();
    let p = file.floats(&QUAD);
    let n = file.floats(&[[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [0.0; 3], [f32::NAN, 0.0, 0.0]]);
    let t = file.floats(&[[2.0, 0.0, 0.0, -1.0]; 4]);
    let uv = file.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [f32::INFINITY, 0.0]]);
    let c = file.floats(&[[0.5, 0.25, 2.0]; 4]);
    let i = file.indices(&[0, 1, 2, 0, 2, 3, 0, 0, 1]);
    let attributes = json!({"POSITION": p, "NORMAL": n, "TANGENT": t, "TEXCOORD_0": uv, "TEXCOORD_1": uv, "COLOR_0": c,
        "JOINTS_0": c, "_OWN": c});
    let mesh = file.push(
        "meshes",
        json!({"name": "m", "primitives": [{"attributes": attributes, "indices": i,
        "targets": [{"POSITION": p}]}]}),
    );
    file.node(json!({"mesh": mesh}));
    let scene = read(&file);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!(mesh.tangents, [Vec4::new(1.0, 0.0, 0.0, -1.0); 4]);
    assert_eq!(mesh.uvs[1], [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO]);
    assert_eq!(mesh.colors, [Vec4::new(0.5, 0.25, 1.0, 1.0); 4]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(!mesh.closed);
    assert_eq!(
        scene.warnings,
        [
            "mesh \"m\", primitive 0: NORMAL is not finite at 1 vertex: replaced",
            "mesh \"m\", primitive 0: NORMAL has no direction at 2 vertices: made from the faces",
            "mesh \"m\", primitive 0: TEXCOORD_0 is not finite at 1 vertex: replaced",
            "mesh \"m\", primitive 0: TEXCOORD_1 is not finite at 1 vertex: replaced",
            "mesh \"m\", primitive 0: 1 triangle without area left out",
        ]
    );
}

/// KHR_mesh_quantization: bytes and shorts, normalized or not, with strides.
#[test]
fn quantized_attributes() {
    let mut file = Glb::new();
    let shorts: Vec<u8> =
        [[0i16, 0, 0, 9], [100, 0, 0, 9], [0, 100, -100, 9]].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let view = file.view(&shorts);
    file.json["bufferViews"][view]["byteStride"] = json!(8);
    let p = file.push("accessors", json!({"bufferView": view, "componentType": 5122, "type": "VEC3", "count": 3}));
    let view = file.view(&[0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 0x80, 0]);
    file.json["bufferViews"][view]["byteStride"] = json!(4);
    let n = file.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5120, "type": "VEC3", "count": 3, "normalized": true}),
    );
    let view = file.view(&[0, 255, 51, 102, 0, 0]);
    let uv = file.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5121, "type": "VEC2", "count": 3, "normalized": true}),
    );
    let view = file.view(&[0, 1, 2]);
    let i = file.push("accessors", json!({"bufferView": view, "componentType": 5121, "type": "SCALAR", "count": 3}));
    let primitive = json!({"attributes": {"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv}, "indices": i});
    let mesh = file.push("meshes", json!({"primitives": [primitive]}));
    file.node(json!({"mesh": mesh}));
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let scene = read(&file);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X * 100.0, Vec3::new(0.0, 100.0, -100.0)]);
    // The smallest byte means -1, not less.
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, -Vec3::Z]);
    assert_eq!(mesh.uvs[0], [Vec2::new(0.0, 1.0), Vec2::new(0.2, 0.4), Vec2::ZERO]);
}

#[test]
fn sparse_accessors() {
    let mut file = Glb::new();
    let keys = file.view(&[1, 0, 2, 0]);
    let values: Vec<u8> = [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = file.view(&values);
    let sparse =
        json!({"count": 2, "indices": {"bufferView": keys, "componentType": 5123}, "values": {"bufferView": values}});
    let p = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse}));
    let mesh = file.push("meshes", json!({"name": "m", "primitives": [{"attributes": {"POSITION": p}}]}));
    file.node(json!({"mesh": mesh}));
    assert_eq!(read(&file).meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    file.json["accessors"][p]["count"] = json!(2);
    assert_eq!(
        message(&try_read(&file).unwrap_err()),
        "pool.glb: mesh \"m\", primitive 0, POSITION: accessor 0: sparse index 2 is past its 2 elements\n\
         hint: the file is damaged: export it again"
    );
}

/// A solid of two materials is closed as a whole, although each part is open.
#[test]
fn solids_of_several_primitives() {
    let mut file = Glb::new();
    let glass = json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}});
    let glass = file.push("materials", glass);
    let mesh = file.cube("bottle", Some(glass));
    let (body, label) = CUBE.split_at(30);
    let (body, label) = (file.indices(body), file.indices(label));
    let positions = file.json["meshes"][mesh]["primitives"][0]["attributes"].clone();
    file.json["meshes"][mesh]["primitives"] = json!([
        {"attributes": positions, "indices": body, "material": glass}, {"attributes": positions, "indices": label}]);
    file.node(json!({"mesh": mesh}));
    let scene = read(&file);
    assert_eq!(scene.meshes.iter().map(|m| m.closed).collect::<Vec<_>>(), [false, false]);
    assert!(scene.materials[scene.instances[0].material as usize].is_solid());
    assert_eq!((scene.instances[0].object, scene.instances[1].object), (0, 0));
}

/// Tangents along increasing u, with glTF's handedness w, so that the bitangent points to decreasing v. A mirrored half
/// gets its own vertices.
#[test]
fn tangents_for_normal_maps() {
    let mut file = Glb::new();
    let texture = file.png(1, &[[128, 128, 255, 255]]);
    let material = file.push("materials", json!({"normalTexture": {"index": texture, "scale": 0.5}}));
    // Two quads side by side. The right one shows the image mirrored.
    let p = file.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
    ]);
    let n = file.floats(&[[0.0, 0.0, 1.0]; 6]);
    let uv = file.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]);
    let i = file.indices(&[0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2]);
    let attributes = json!({"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv});
    let mesh =
        file.push("meshes", json!({"primitives": [{"attributes": attributes, "indices": i, "material": material}]}));
    file.node(json!({"mesh": mesh}));
    let scene = read(&file);
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.tangents.len(), mesh.normals.len(), mesh.uvs[0].len()), (8, 8, 8, 8));
    for (t, expected) in [([0, 1], 1.0), ([2, 3], -1.0)] {
        for corner in t.iter().flat_map(|t: &usize| mesh.triangles[*t]) {
            let tangent = mesh.tangents[corner as usize];
            assert!((tangent - Vec4::new(expected, 0.0, 0.0, expected)).length() < 1e-6, "{corner}: {tangent}");
            // The bitangent is +Y, towards decreasing v, on both halves.
            let bitangent = Vec3::Z.cross(tangent.truncate()) * tangent.w;
            assert!((bitangent - Vec3::Y).length() < 1e-6);
        }
    }
    assert_eq!(scene.materials[0].normal_texture.map(|(_, scale)| scale), Some(0.5));
}

/// The relief of a normal map follows a texture transform that rotates by 90 degrees and stretches, and one that
/// mirrors.
#[test]
fn tangents_follow_the_transform_of_the_normal_map() {
    let quarter = std::f64::consts::FRAC_PI_2;
    for (transform, tangent) in [
        (json!({"rotation": quarter, "scale": [3, 0.5]}), Vec4::new(0.0, -1.0, 0.0, 1.0)),
        (json!({"rotation": 2.0 * quarter}), Vec4::new(-1.0, 0.0, 0.0, 1.0)),
        (json!({"scale": [-1, 1]}), Vec4::new(-1.0, 0.0, 0.0, -1.0)),
    ] {
        let mut file = Glb::new();
        let texture = file.png(1, &[[128, 128, 255, 255]]);
        let info = json!({"index": texture, "extensions": {"KHR_texture_transform": transform}});
        let material = file.push("materials", json!({"normalTexture": info}));
        let p = file.floats(&QUAD);
        let n = file.floats(&[[0.0, 0.0, 1.0]; 4]);
        let uv = file.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        let i = file.indices(&[0, 1, 2, 0, 2, 3]);
        let attributes = json!({"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv});
        let primitive = json!({"attributes": attributes, "indices": i, "material": material});
        let mesh = file.push("meshes", json!({"primitives": [primitive]}));
        file.node(json!({"mesh": mesh}));
        file.json["extensionsUsed"] = json!(["KHR_texture_transform"]);
        for found in &read(&file).meshes[0].tangents {
            assert!((*found - tangent).length() < 1e-6, "{transform}: {found} is not {tangent}");
        }
    }
}
