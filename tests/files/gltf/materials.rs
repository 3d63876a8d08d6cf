//! Materials, textures, and whether glass is solid or thin.

use super::glb::{Glb, png};
use super::{message, read, try_read};
use caustique::material::{Alpha, Material};
use caustique::math::{Rgb, Vec2};
use caustique::scene::Description;
use caustique::scene::gltf::{Glass, ReadOptions, read_bytes};
use caustique::texture::{Integers, Texels, Wrap};
use serde_json::{Value, json};
use std::path::Path;

/// A cube of this material with texture coordinates. `texture` stands for the only texture of the file.
fn wearing(material: Value) -> Glb {
    let mut file = Glb::new();
    file.png(2, &[[255, 0, 0, 255], [0, 188, 0, 128]]);
    let material = file.push("materials", material);
    let mesh = file.cube("cube", Some(material));
    let uv = file.floats(&[[0.5, 0.5]; 8]);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uv);
    file.node(json!({"mesh": mesh, "name": "Cube"}));
    file
}

fn material(json: Value) -> (Material, Vec<String>) {
    let scene = read(&wearing(json));
    (scene.materials[0].clone(), scene.warnings)
}

#[test]
fn every_field_is_read() {
    let t = |set: u32| json!({"index": 0, "texCoord": set});
    let (m, warnings) = material(json!({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "baseColorTexture": t(0), "metallicFactor": 0.5,
            "roughnessFactor": 0.6, "metallicRoughnessTexture": t(1)},
        "normalTexture": {"index": 0, "scale": -2.0}, "emissiveFactor": [1, 0.5, 0], "emissiveTexture": t(0),
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 12},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 0.9, "transmissionTexture": t(0)},
            "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 0.5, "attenuationColor": [1, 0.5, 0.25]},
            "KHR_materials_specular": {"specularFactor": 0.8, "specularTexture": t(0), "specularColorFactor": [2, 1, 0.5],
                "specularColorTexture": t(0)},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.6, "iridescenceTexture": t(0), "iridescenceIor": 1.4,
                "iridescenceThicknessMinimum": 50, "iridescenceThicknessMaximum": 600,
                "iridescenceThicknessTexture": t(1)},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.7, "clearcoatTexture": t(0), "clearcoatRoughnessFactor": 0.3,
                "clearcoatRoughnessTexture": t(0), "clearcoatNormalTexture": {"index": 0, "scale": 0.5}},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.3,
                "diffuseTransmissionTexture": t(0), "diffuseTransmissionColorFactor": [0.5, 1, 0],
                "diffuseTransmissionColorTexture": t(0)},
            "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenColorTexture": t(0), "sheenRoughnessFactor": 0.4,
                "sheenRoughnessTexture": t(0)},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1.5, "anisotropyTexture": t(0)},
            "KHR_materials_dispersion": {"dispersion": 0.36},
            "KHR_materials_unlit": {},
        },
        "extras": {"caustique": {"priority": 3, "diffuse_roughness_texture": t(0), "coat_ior": 2,
            "coat_ior_texture": t(1), "coat_color_texture": t(1)}, "maker": "us"},
    }));
    assert_eq!(warnings, Vec::<String>::new());
    assert_eq!((m.name.as_str(), m.double_sided, m.alpha, m.unlit), ("all", true, Alpha::Mask(0.25), true));
    assert!(!m.culled);
    assert_eq!((m.base_color, m.metallic.factor, m.roughness.factor), ([0.1, 0.2, 0.3, 0.4], 0.5, 0.6));
    // Colours and data use two textures of one image.
    let set = |t: Option<caustique::texture::TextureRef>| t.map(|t| (t.texture, t.set));
    assert_eq!(set(m.base_color_texture), Some((0, 0)));
    assert_eq!(set(m.roughness.texture), Some((1, 1)));
    assert_eq!((set(m.emission_texture), m.normal_texture.map(|t| t.1)), (Some((0, 0)), Some(-2.0)));
    assert_eq!((m.emission, m.ior, m.transmission.factor), (Rgb::new(12.0, 6.0, 0.0), 1.33, 0.9));
    let sigma_a = m.medium.unwrap().sigma_a;
    assert!((sigma_a - Rgb::new(0.0, 2.0 * 2f32.ln(), 4.0 * 2f32.ln())).length() < 1e-6, "{sigma_a}");
    assert!(!m.thin && m.priority == 3);
    assert_eq!((m.specular.factor, m.specular_color.factor), (0.8, Rgb::new(2.0, 1.0, 0.5)));
    assert_eq!((set(m.specular.texture), set(m.specular_color.texture)), (Some((1, 0)), Some((0, 0))));
    assert_eq!((m.diffuse_transmission.factor, m.diffuse_transmission_color.factor), (0.3, Rgb::new(0.5, 1.0, 0.0)));
    let behind = (set(m.diffuse_transmission.texture), set(m.diffuse_transmission_color.texture));
    assert_eq!(behind, (Some((1, 0)), Some((0, 0))));
    assert_eq!(m.clearcoat_normal_texture.map(|(_, scale)| scale), Some(0.5));
    assert_eq!((m.iridescence.factor, m.iridescence_ior, m.iridescence_thickness.factor), (0.6, 1.4, [50.0, 600.0]));
    assert_eq!((set(m.iridescence.texture), set(m.iridescence_thickness.texture)), (Some((1, 0)), Some((1, 1))));
    assert_eq!((m.clearcoat.factor, m.clearcoat_roughness.factor), (0.7, 0.3));
    assert_eq!((m.diffuse_roughness.factor, set(m.diffuse_roughness.texture)), (1.0, Some((1, 0))));
    assert_eq!((m.clearcoat_ior.factor, set(m.clearcoat_ior.texture)), (2.0, Some((1, 1))));
    assert_eq!((m.clearcoat_color.factor, set(m.clearcoat_color.texture)), (Rgb::ONE, Some((0, 1))));
    assert_eq!((m.sheen_color.factor, m.sheen_roughness.factor), (Rgb::new(0.1, 0.2, 0.3), 0.4));
    assert_eq!((set(m.sheen_color.texture), set(m.sheen_roughness.texture)), (Some((0, 0)), Some((1, 0))));
    assert_eq!((m.anisotropy, m.anisotropy_rotation, m.dispersion), (0.5, 1.5, 0.36));
    assert!(m.clearcoat.texture.is_some() && m.clearcoat_roughness.texture.is_some() && m.anisotropy_texture.is_some());
}

#[test]
fn defaults_and_legacy_values() {
    let (m, _) = material(json!({}));
    assert!(m.culled && !m.double_sided);
    let glass = json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}}});
    assert!(!material(glass).0.culled, "the back faces of glass are seen");
    assert_eq!(
        (m.name.as_str(), m.base_color, m.metallic.factor, m.roughness.factor, m.ior),
        ("material 0", [1.0; 4], 1.0, 1.0, 1.5)
    );
    assert_eq!((m.alpha, m.transmission.factor, m.specular.factor, m.thin), (Alpha::Opaque, 0.0, 1.0, true));
    let (m, _) = material(json!({"alphaMode": "BLEND", "extensions": {"KHR_materials_ior": {"ior": 0}}}));
    assert_eq!((m.alpha, m.ior), (Alpha::Blend, f32::INFINITY));
}

#[test]
fn numbers_out_of_range_are_moved_with_a_warning() {
    let (m, warnings) = material(json!({"name": "odd", "pbrMetallicRoughness": {"metallicFactor": 1.5},
        "occlusionTexture": {"index": 0},
        "extensions": {"KHR_materials_ior": {"ior": 0.5},
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [0, 1, 1]},
            "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": 0.9},
            "KHR_materials_subsurface": {}}}));
    assert_eq!((m.metallic.factor, m.ior, m.iridescence_ior), (1.0, 1.0, 1.0));
    assert!((m.medium.unwrap().sigma_a.x - 1e6f32.ln()).abs() < 1e-3);
    assert_eq!(
        warnings,
        [
            "extension \"KHR_materials_subsurface\" is not supported and is ignored",
            "material \"odd\": metallicFactor is 1.5; 1 is used",
            "material \"odd\": an index of refraction of 0.5 is raised to 1",
            "material \"odd\": an iridescenceIor of 0.9 is raised to 1",
            "material \"odd\": attenuationColor is raised to 0.000001, absorption is finite",
            "1 material has an occlusion texture, ignored: occlusion is simulated",
        ]
    );
}

#[test]
fn specular_glossiness_is_translated() {
    let (m, warnings) = material(json!({"name": "old", "extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.4, 0.3, 1], "specularFactor": [0.2, 0.1, 0.05],
        "specularGlossinessTexture": {"index": 0}}}}));
    assert_eq!((m.base_color, m.metallic.factor, m.ior), ([0.5, 0.4, 0.3, 1.0], 0.0, f32::INFINITY));
    assert_eq!((m.specular_color.factor, m.roughness.factor), (Rgb::new(0.2, 0.1, 0.05), 1.0));
    assert_eq!(
        warnings,
        ["material \"old\": KHR_materials_pbrSpecularGlossiness is translated, so highlights differ a little"]
    );
    for factor in [1.0f32, 0.5, 0.0] {
        let scene = read(&wearing(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "glossinessFactor": factor, "specularGlossinessTexture": {"index": 0}}}})));
        let rough = scene.materials[0].roughness.texture.unwrap();
        let texel = scene.textures[rough.texture as usize].sample(Vec2::new(0.75, 0.5));
        let roughness = scene.materials[0].roughness.factor * texel.y;
        assert!((roughness - (1.0 - factor * 128.0 / 255.0)).abs() < 1e-6, "{roughness}");
        assert_eq!(scene.warnings.len(), 1);
    }
}

fn glass_on(mesh: impl Fn(&mut Glb, usize), glass: Glass, extensions: Value) -> (Vec<bool>, Vec<String>) {
    let mut file = Glb::new();
    let material = file.push("materials", json!({"name": "glass", "extensions": extensions}));
    mesh(&mut file, material);
    for i in 0..file.json["meshes"].as_array().unwrap().len() {
        file.node(json!({"mesh": i}));
    }
    let options = ReadOptions { glass, ..ReadOptions::default() };
    let scene = read_bytes(&file.bytes(), Path::new("x.glb"), &options).unwrap();
    let solid = |i: &caustique::scene::description::PlacedMesh| scene.materials[i.material as usize].is_solid();
    (scene.instances.iter().map(solid).collect(), scene.warnings)
}

/// `--glass` decides about glass without a volume extension.
#[test]
fn glass_is_solid_where_the_mesh_is_closed() {
    let clear = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    let both = |file: &mut Glb, material: usize| {
        file.cube("closed", Some(material));
        file.mesh("open", &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2], Some(material));
    };
    let (solid, warnings) = glass_on(both, Glass::Auto, clear.clone());
    assert_eq!(solid, [true, false]);
    assert_eq!(
        warnings,
        [
            "material \"glass\": it transmits light but has no volume extension; closed meshes such as \"closed\" are taken \
             for solid glass (--glass solid or thin decides)",
            "material \"glass\": it is solid on closed meshes, thin on open ones such as \"open\" (--glass solid or thin \
             decides)",
        ]
    );
    let (solid, warnings) = glass_on(both, Glass::Solid, clear.clone());
    assert_eq!(solid, [true, true]);
    assert_eq!(
        warnings,
        [
            "mesh \"open\": its material \"glass\" is solid, but the mesh is not closed (3 edges have one face only): light may get lost inside; close the holes, or take its thickness away"
        ]
    );
    assert_eq!(glass_on(both, Glass::Thin, clear.clone()), (vec![false, false], vec![]));
    // A volume extension overrides the option.
    for (thickness, solid) in [(0.0, false), (0.2, true)] {
        let mut volume = clear.clone();
        volume["KHR_materials_volume"] = json!({"thicknessFactor": thickness});
        for glass in [Glass::Auto, Glass::Solid, Glass::Thin] {
            assert_eq!(
                glass_on(
                    |f, m| {
                        f.cube("c", Some(m));
                    },
                    glass,
                    volume.clone()
                ),
                (vec![solid], vec![])
            );
        }
    }
}

/// A hollow cube whose inner and outer faces have the same orientation is made hollow, with a warning.
#[test]
fn inner_shells_that_look_outwards_are_turned_over() {
    let clear = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1}});
    let hollow = |inwards: bool| {
        let corner = |i: u32, size: f32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { size } else { -size });
        let corners: Vec<[f32; 3]> = (0..16).map(|i| corner(i % 8, if i < 8 { 1.0 } else { 0.5 })).collect();
        let mut inner = super::glb::CUBE.map(|i| i + 8);
        if inwards {
            inner.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
        }
        let mut file = Glb::new();
        let material = file.push("materials", json!({"name": "glass", "extensions": clear}));
        let mesh = file.mesh("hollow", &corners, &[super::glb::CUBE, inner].concat(), Some(material));
        file.node(json!({"mesh": mesh}));
        read(&file)
    };
    let (right, turned) = (hollow(true), hollow(false));
    assert_eq!(right.warnings, [""; 0]);
    assert_eq!(
        turned.warnings,
        ["mesh \"hollow\", primitive 0: 1 closed shell lies inside another with the same orientation, which would \
             make no hollow: flipped (flip the normals of one of the two)"]
    );
    let area = |scene: &Description, t: usize| {
        let mesh = &scene.meshes[0];
        let [a, b, c] = mesh.triangles[t].map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a)
    };
    assert!((0..24).all(|t| area(&right, t) == area(&turned, t)));
}

/// Inner shells that are primitives of one mesh are found, too, if they have one material: a drink in a glass stays.
#[test]
fn inner_shells_of_other_primitives_are_turned_over() {
    let clear = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1}});
    let volumes = |inner_material: usize| {
        let mut file = Glb::new();
        for name in ["glass", "drink"] {
            file.push("materials", json!({"name": name, "extensions": clear}));
        }
        for (size, material) in [(1.0, 0), (0.5, inner_material)] {
            let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { size } else { -size });
            file.mesh("hollow", &(0..8).map(corner).collect::<Vec<_>>(), &super::glb::CUBE, Some(material));
        }
        let inner = file.json["meshes"][1]["primitives"][0].take();
        file.json["meshes"][0]["primitives"].as_array_mut().expect("a list").push(inner);
        file.json["meshes"].as_array_mut().expect("a list").pop();
        file.node(json!({"mesh": 0}));
        let scene = read(&file);
        let volume = |mesh: &caustique::geometry::Mesh| -> f32 {
            mesh.triangles
                .iter()
                .map(|t| t.map(|i| mesh.positions[i as usize]))
                .map(|[a, b, c]| a.dot(b.cross(c)))
                .sum()
        };
        (scene.meshes.iter().map(|mesh| volume(mesh) > 0.0).collect::<Vec<_>>(), scene.warnings)
    };
    let turned = "mesh \"hollow\", primitives 0, 1: 1 closed shell lies inside another with the same orientation, \
                  which would make no hollow: flipped (flip the normals of one of the two)";
    assert_eq!(volumes(0), (vec![true, false], vec![turned.to_owned()]));
    assert_eq!(volumes(1), (vec![true, true], vec![]));
}

/// Solid emissive glass with alpha decides at each face, with a warning.
#[test]
fn emissive_glass_with_alpha_is_reported() {
    let clear = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1}});
    let warnings = |alpha: f32, glow: f32| {
        let mut file = Glb::new();
        let material = file.push(
            "materials",
            json!({"name": "glass", "extensions": clear, "alphaMode": "BLEND",
            "emissiveFactor": [glow, glow, glow], "pbrMetallicRoughness": {"baseColorFactor": [1.0, 1.0, 1.0, alpha]}}),
        );
        let cube = file.cube("lamp", Some(material));
        file.node(json!({"mesh": cube}));
        caustique::scene::Scene::build(read(&file), 1).expect("a scene").warnings
    };
    let walls = |alpha: f32, glow: f32| warnings(alpha, glow).iter().filter(|w| w.contains("one by one")).count();
    assert_eq!([walls(0.5, 1.0), walls(1.0, 1.0), walls(0.5, 0.0)], [1, 0, 0]);
}

#[test]
fn glass_that_is_inside_out_is_reported() {
    let clear = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1}});
    let turned = |file: &mut Glb, material: usize| {
        let mesh = file.cube("inverted", Some(material));
        let mut indices = super::glb::CUBE;
        indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
        file.json["meshes"][mesh]["primitives"][0]["indices"] = file.indices(&indices).into();
        indices[..3].swap(0, 1);
        let mesh = file.cube("torn", Some(material));
        file.json["meshes"][mesh]["primitives"][0]["indices"] = file.indices(&indices).into();
    };
    assert_eq!(
        glass_on(turned, Glass::Auto, clear).1,
        [
            "mesh \"inverted\", primitive 0: its faces point inwards, so the inside of the glass is outside: flip its \
             normals",
            "mesh \"torn\": its material \"glass\" is solid, but part of its faces is flipped: recalculate its normals",
        ]
    );
}

#[test]
fn textures_keep_wrap_filter_transform_and_encoding() {
    let transform = json!({"KHR_texture_transform": {"offset": [0.25, 0.5], "scale": [2, 4], "texCoord": 1}});
    let mut file = wearing(json!({"pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0, "extensions": transform}, "metallicRoughnessTexture": {"index": 0}}}));
    file.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    file.json["textures"][0]["sampler"] = json!(0);
    let scene = read(&file);
    let reference = scene.materials[0].base_color_texture.unwrap();
    assert_eq!((reference.set, reference.transform), (1, [[2.0, 0.0, 0.25], [0.0, 4.0, 0.5]]));
    let [color, data] = &scene.textures[..] else { panic!("{}", scene.textures.len()) };
    assert_eq!((color.wrap, color.linear, color.name.as_str()), ([Wrap::Clamp, Wrap::Mirror], false, "tiles"));
    // An sRGB value of 188 is 0.503 in linear light.
    assert!((color.sample(Vec2::new(0.75, 0.5)).y - 0.5029).abs() < 1e-3);
    assert!((data.sample(Vec2::new(0.75, 0.5)).y - 188.0 / 255.0).abs() < 1e-6);
}

/// 16-bit images keep their depth, and JPEG is read. Images may be files, with percent-encoded names, or data URIs.
#[test]
fn images_may_be_files_or_data_uris() {
    let folder = tempfile::tempdir().unwrap();
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(1, 1, vec![40_000u16]).unwrap();
    deep.save(folder.path().join("deep map.png")).unwrap();
    let flat = image::RgbImage::from_raw(1, 1, vec![200, 100, 50]).unwrap();
    flat.save(folder.path().join("flat.jpg")).unwrap();
    let mut file = wearing(json!({"pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}, "emissiveTexture": {"index": 2}}));
    file.json["images"] = json!([{"uri": "flat.jpg"}, {"uri": "deep%20map.png"},
        {"uri": format!("data:image/png;base64,{}", base64(&png(1, &[[255, 255, 255, 255]])))}]);
    file.json["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 2}]);
    let path = folder.path().join("scene.glb");
    let scene = read_bytes(&file.bytes(), &path, &ReadOptions::default()).unwrap();
    let [white, flat, deep] = [2, 0, 1].map(|i| &scene.textures[[0, 1, 2][i]]);
    let find = |linear: f32| scene.textures.iter().any(|t| (t.sample(Vec2::splat(0.5)).x - linear).abs() < 0.02);
    assert!(find(1.0) && find(0.5776) && find(40_000.0 / 65_535.0), "{white:?} {flat:?} {deep:?}");
    let deep =
        |texels: &Texels| matches!(texels, Texels::Integers { data, .. } if matches!(**data, Integers::Words(_)));
    assert!(scene.textures.iter().any(|t| deep(&t.texels)));
    std::fs::remove_file(folder.path().join("flat.jpg")).unwrap();
    let error = read_bytes(&file.bytes(), &path, &ReadOptions::default()).unwrap_err();
    let folder = folder.path().display();
    assert_eq!(
        message(&error),
        format!(
            "{folder}/scene.glb: material 0, baseColorTexture: image 0: the file {folder}/flat.jpg cannot be read: No such file or \
             directory (os error 2)\nhint: put the file there, or export as .glb, which holds buffers and textures itself"
        )
    );
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |c: &[u8]| {
        let bits = c.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - c.len()));
        (0..4).map(|i| if i <= c.len() { LETTERS[(bits >> (18 - 6 * i) & 63) as usize] as char } else { '=' }).collect()
    };
    bytes.chunks(3).map::<String, _>(group).collect()
}

#[test]
fn extras_of_materials() {
    let glass = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    let medium = json!({"sigma_a": [1, 2, 3], "sigma_s": [4, 5, 6], "g": 0.5});
    let (m, warnings) = material(json!({"extensions": glass, "extras": {"caustique": {"medium": medium}}}));
    let found = m.medium.unwrap();
    assert_eq!((found.sigma_a, found.sigma_s, found.g), (Rgb::new(1.0, 2.0, 3.0), Rgb::new(4.0, 5.0, 6.0), 0.5));
    assert!(!m.thin && warnings.is_empty());
    let (m, warnings) = material(json!({"name": "wall", "extras": {"caustique": {"medium": medium, "prioritty": 2}}}));
    assert_eq!(m.medium, None);
    assert_eq!(
        warnings,
        [
            "material \"wall\": extras.caustique has no key \"prioritty\" (did you mean \"priority\"?)",
            "material \"wall\": its medium is ignored: no light is transmitted",
        ]
    );
    let (m, warnings) = material(json!({"extras": {"caustique": {"diffuse_roughness": 0.25}}}));
    assert!(m.diffuse_roughness == 0.25.into() && warnings.is_empty());
    let (m, warnings) = material(json!({"name": "wall", "extras": {"caustique": {"diffuse_roughness": 2}}}));
    assert_eq!(m.diffuse_roughness, 1.0.into());
    assert_eq!(warnings, ["material \"wall\": extras.caustique.diffuse_roughness is 2; 1 is used"]);
    let coat = json!({"KHR_materials_clearcoat": {"clearcoatFactor": 1}});
    let keys = json!({"coat_ior": 0.5, "coat_color": [1, 0.25, 0]});
    let (m, warnings) = material(json!({
        "name": "wood", "extensions": coat, "emissiveFactor": [1, 1, 1], "extras": {"caustique": keys}}));
    assert_eq!((m.clearcoat_ior.factor, m.clearcoat_color.factor), (1.0, Rgb::new(1.0, 0.25, 0.0)));
    assert_eq!(warnings, ["material \"wood\": its coat_ior of 0.5 is raised to 1"]);
    // At an index of 1, the mean path is 2; it is passed once.
    assert!((m.emission - Rgb::new(1.0, 0.25, 0.0)).length() < 1e-6, "{}", m.emission);
    let sheen = json!({"KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1]}});
    let (m, _) = material(json!({"extensions": sheen, "extras": {"caustique": {"sheen_model": "fibers"}}}));
    assert_eq!(m.sheen_model, caustique::bsdf::SheenModel::Fibers);
    assert_eq!(material(json!({"extensions": sheen})).0.sheen_model, caustique::bsdf::SheenModel::Charlie);
    let bad = |medium: Value| {
        let file = wearing(json!({"name": "fog", "extensions": glass, "extras": {"caustique": {"medium": medium}}}));
        message(&try_read(&file).unwrap_err())
    };
    assert_eq!(bad(json!({"g": 1})), "pool.glb: material \"fog\": g of a medium must lie between -1 and 1, it is 1");
    assert_eq!(
        bad(json!({"sigma_s": [-1, 0, 0]})),
        "pool.glb: material \"fog\": sigma_a and sigma_s of a medium must be finite and not negative"
    );
    assert!(bad(json!({"sigma_s": 4})).starts_with("pool.glb: material \"fog\", extras.caustique: invalid type"));
}
