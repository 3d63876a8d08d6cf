//! Writes scenes as the bytes of a .glb file.

use super::random::Random;
use super::world::{Later, Lens, Light, LightKind, Matter, Medium, Mesh, Panorama, Texture, Thing, ThingKind, World};
use glam::DVec3;
use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};
use std::io::Cursor;

/// The binary chunk and the objects that describe it.
#[derive(Default)]
struct Writer {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    nodes: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    /// Meshes by mesh and material index.
    meshes: Vec<((usize, usize), Value)>,
    /// Channels of the animation and their samplers.
    channels: Vec<Value>,
    samplers: Vec<Value>,
}

/// The scene as a .glb file.
pub fn glb(world: &World) -> Vec<u8> {
    let mut writer = Writer::default();
    let mut sizes = world.later.map(|later| Random::new(later.seed));
    let roots: Vec<usize> = world
        .things
        .iter()
        .map(|thing| writer.thing(world, thing, sizes.as_mut().map(|sizes| sizes.scale(0.3, 3.0))))
        .collect();
    for (index, matter) in world.materials.iter().enumerate().filter(|(_, matter)| matter.glows() && sizes.is_some()) {
        let pointer = pointer(&format!("/materials/{index}/emissiveFactor"));
        writer.appears(pointer, DVec3::ZERO, matter.emission / matter.emission.max_element());
    }
    let images: Vec<Value> = world.textures.iter().map(|texture| writer.image(texture)).collect();
    let textures: Vec<Value> = (0..images.len()).map(|i| json!({"source": i, "sampler": 0})).collect();
    let materials: Vec<Value> = world.materials.iter().map(material).collect();
    let mut extras = json!({"light_units": "radiometric"});
    if let Some(sky) = world.sky {
        extras["environment"] = json!({"color": sky});
    }
    if let Some(fog) = world.fog {
        extras["medium"] = medium(fog);
    }
    let mut document = json!({
        "asset": {"version": "2.0", "generator": "random scenes of caustique"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_transmission", "KHR_materials_volume",
            "KHR_materials_ior", "KHR_materials_specular", "KHR_materials_emissive_strength",
            "KHR_materials_clearcoat", "KHR_animation_pointer"],
        "scene": 0,
        "scenes": [{"nodes": roots, "extras": {"caustique": extras}}],
        "nodes": writer.nodes,
        "accessors": writer.accessors,
        "bufferViews": writer.views,
        "buffers": [{"byteLength": writer.binary.len()}],
    });
    // Empty lists are invalid in glTF.
    let meshes: Vec<Value> = writer.meshes.into_iter().map(|(_, mesh)| mesh).collect();
    let samplers = vec![json!({"magFilter": 9729}); usize::from(!images.is_empty())];
    for (key, list) in [
        ("meshes", meshes),
        ("materials", materials),
        ("cameras", writer.cameras),
        ("images", images),
        ("textures", textures),
        ("samplers", samplers),
    ] {
        if !list.is_empty() {
            document[key] = list.into();
        }
    }
    if !writer.channels.is_empty() {
        document["animations"] = json!([{"channels": writer.channels, "samplers": writer.samplers}]);
    }
    if !writer.lights.is_empty() {
        document["extensions"] = json!({"KHR_lights_punctual": {"lights": writer.lights}});
    }
    container(&document, writer.binary)
}

impl Writer {
    /// Writes the chain of nodes of a thing, and returns the index of the first node. `size` is the relative size at the
    /// frame of a thing that appears later.
    fn thing(&mut self, world: &World, thing: &Thing, size: Option<f64>) -> usize {
        let mut node = json!({"name": thing.name});
        if thing.hidden {
            node["extras"] = json!({"caustique": {"visible": {"camera": false}}});
        }
        match &thing.kind {
            ThingKind::Mesh { mesh, material } => node["mesh"] = self.mesh(world, *mesh, *material).into(),
            ThingKind::Light(light) => {
                self.light(light, &mut node);
                if size.is_some() {
                    let index = self.lights.len() - 1;
                    let intensity = self.lights[index]["intensity"].as_f64().expect("a number");
                    let pointer = pointer(&format!("/extensions/KHR_lights_punctual/lights/{index}/intensity"));
                    self.appears_number(pointer, 0.0, intensity);
                }
            }
            ThingKind::Camera(lens) => self.camera(lens, &mut node),
        }
        if world.things.iter().any(|thing| !(thing.unlit.is_empty() && thing.unblocked.is_empty())) {
            node["extras"]["caustique"]["collections"] = json!([format!("body {}", thing.body)]);
        }
        for (key, bodies) in [("receivers", &thing.unlit), ("blockers", &thing.unblocked)] {
            if !bodies.is_empty() {
                let exclude: Vec<String> = bodies.iter().map(|body| format!("body {body}")).collect();
                node["extras"]["caustique"][key] = json!({"exclude": exclude});
            }
        }
        let mut above: Option<usize> = None;
        let last = thing.chain.len().saturating_sub(1);
        for (depth, placement) in thing.chain.iter().enumerate().rev() {
            let mut level =
                if depth == last { node.take() } else { json!({"name": format!("{} {depth}", thing.name)}) };
            level["translation"] = json!(placement.translation);
            level["rotation"] = json!(placement.rotation.to_array());
            level["scale"] = json!(placement.scale);
            if let Some(child) = above {
                level["children"] = json!([child]);
            }
            self.nodes.push(level);
            above = Some(self.nodes.len() - 1);
            if let (Some(size), Some(_), true) = (size, thing.mesh(), depth == last) {
                let target = json!({"node": self.nodes.len() - 1, "path": "scale"});
                self.appears(target, size * placement.scale, placement.scale);
            }
        }
        above.unwrap_or_else(|| {
            self.nodes.push(node);
            self.nodes.len() - 1
        })
    }

    fn view(&mut self, bytes: impl IntoIterator<Item = u8>) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let start = self.binary.len();
        self.binary.extend(bytes);
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": self.binary.len() - start}));
        self.views.len() - 1
    }

    fn accessor(&mut self, floats: &[f32], kind: &str, width: usize) -> usize {
        let view = self.view(floats.iter().flat_map(|x| x.to_le_bytes()));
        let mut accessor =
            json!({"bufferView": view, "componentType": 5126, "count": floats.len() / width, "type": kind});
        let bound = |fold: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width).filter_map(|i| floats.iter().skip(i).step_by(width).copied().reduce(fold)).collect()
        };
        accessor["min"] = json!(bound(f32::min));
        accessor["max"] = json!(bound(f32::max));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds a channel that holds one value at the frame, and another one from [`Later::START`] on.
    fn appears(&mut self, target: Value, before: DVec3, after: DVec3) {
        let values = [before, after].map(|v| v.as_vec3().to_array());
        self.channel(target, values.as_flattened(), "VEC3", 3);
    }

    fn appears_number(&mut self, target: Value, before: f64, after: f64) {
        self.channel(target, &[before as f32, after as f32], "SCALAR", 1);
    }

    fn channel(&mut self, target: Value, values: &[f32], kind: &str, width: usize) {
        let input = self.accessor(&[0.0, Later::START as f32], "SCALAR", 1);
        let output = self.accessor(values, kind, width);
        self.channels.push(json!({"sampler": self.samplers.len(), "target": target}));
        self.samplers.push(json!({"input": input, "output": output, "interpolation": "STEP"}));
    }

    fn mesh(&mut self, world: &World, mesh: usize, material: usize) -> usize {
        if let Some(known) = self.meshes.iter().position(|(key, _)| *key == (mesh, material)) {
            return known;
        }
        let Mesh { positions, normals, uvs, triangles } = &world.meshes[mesh];
        let three = |v: &[DVec3]| v.iter().flat_map(|p| p.as_vec3().to_array()).collect::<Vec<f32>>();
        let mut attributes = json!({"POSITION": self.accessor(&three(positions), "VEC3", 3)});
        if !normals.is_empty() {
            attributes["NORMAL"] = self.accessor(&three(normals), "VEC3", 3).into();
        }
        if !uvs.is_empty() {
            let floats: Vec<f32> = uvs.iter().flat_map(|uv| uv.as_vec2().to_array()).collect();
            attributes["TEXCOORD_0"] = self.accessor(&floats, "VEC2", 2).into();
        }
        let view = self.view(triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
        self.accessors
            .push(json!({"bufferView": view, "componentType": 5125, "count": 3 * triangles.len(), "type": "SCALAR"}));
        let indices = self.accessors.len() - 1;
        let primitive = json!({"attributes": attributes, "indices": indices, "material": material});
        let name = format!("mesh {}", self.meshes.len());
        self.meshes.push(((mesh, material), json!({"name": name, "primitives": [primitive]})));
        self.meshes.len() - 1
    }

    fn light(&mut self, light: &Light, node: &mut Value) {
        let strength = light.color.max_element().max(f64::MIN_POSITIVE);
        let mut entry = json!({"color": light.color / strength, "intensity": strength});
        let extras = match light.kind {
            LightKind::Point { radius } => {
                entry["type"] = "point".into();
                json!({"radius": radius})
            }
            LightKind::Spot { inner, outer, radius } => {
                entry["type"] = "spot".into();
                entry["spot"] = json!({"innerConeAngle": inner, "outerConeAngle": outer});
                json!({"radius": radius})
            }
            LightKind::Sun { angle } => {
                entry["type"] = "directional".into();
                json!({"angle_deg": angle})
            }
        };
        node["extras"] = json!({"caustique": extras});
        node["extensions"] = json!({"KHR_lights_punctual": {"light": self.lights.len()}});
        self.lights.push(entry);
    }

    fn camera(&mut self, lens: &Lens, node: &mut Value) {
        let near = 1e-3 * lens.focus;
        self.cameras.push(if lens.orthographic {
            let sides = json!({"xmag": lens.view, "ymag": lens.view, "znear": near, "zfar": 1e4 * lens.focus});
            json!({"type": "orthographic", "orthographic": sides})
        } else {
            json!({"type": "perspective", "perspective": {"yfov": lens.view, "aspectRatio": 1.0, "znear": near}})
        });
        node["camera"] = (self.cameras.len() - 1).into();
        if lens.aperture > 0.0 {
            let extras = json!({"aperture_radius": lens.aperture, "focus_distance": lens.focus});
            node["extras"] = json!({"caustique": extras});
        }
        if let Some(panorama) = lens.panorama {
            node["extras"] = json!({"caustique": {"panorama": match panorama {
                Panorama::Equirectangular { longitude, latitude } => {
                    json!({"longitude_deg": longitude, "latitude_deg": latitude})
                }
                Panorama::Fisheye { fov, equisolid } => {
                    json!({"fisheye": if equisolid { "equisolid" } else { "equidistant" }, "fov_deg": fov})
                }
            }}});
        }
    }

    fn image(&mut self, texture: &Texture) -> Value {
        let height = texture.texels.len() as u32 / texture.width;
        let mut png = Cursor::new(Vec::new());
        RgbImage::from_raw(texture.width, height, texture.texels.as_flattened().to_vec())
            .expect("as many texels as the texture has")
            .write_to(&mut png, ImageFormat::Png)
            .expect("memory takes bytes");
        let view = self.view(png.into_inner());
        json!({"bufferView": view, "mimeType": "image/png"})
    }
}

/// The target of a channel of KHR_animation_pointer.
fn pointer(to: &str) -> Value {
    json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}})
}

fn medium(medium: Medium) -> Value {
    json!({"sigma_a": medium.sigma_a, "sigma_s": medium.sigma_s, "g": medium.g})
}

fn material(matter: &Matter) -> Value {
    let strength = matter.emission.max_element();
    let mut extensions = json!({
        "KHR_materials_specular": {"specularFactor": matter.specular},
        "KHR_materials_ior": {"ior": matter.ior},
    });
    if strength > 0.0 {
        extensions["KHR_materials_emissive_strength"] = json!({"emissiveStrength": strength});
    }
    if matter.is_glass() {
        extensions["KHR_materials_transmission"] = json!({"transmissionFactor": matter.transmission});
        extensions["KHR_materials_volume"] = json!({"thicknessFactor": if matter.solid { 1.0 } else { 0.0 }});
    }
    if matter.clearcoat > 0.0 {
        extensions["KHR_materials_clearcoat"] = json!({"clearcoatFactor": matter.clearcoat});
    }
    let mut extras = json!({});
    if let Some(inside) = matter.medium {
        extras["medium"] = medium(inside);
    }
    if matter.priority != 0 {
        extras["priority"] = matter.priority.into();
    }
    let mut material = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": matter.base.extend(matter.alpha),
            "metallicFactor": matter.metallic,
            "roughnessFactor": matter.roughness,
        },
        "emissiveFactor": if strength > 0.0 { matter.emission / strength } else { DVec3::ZERO },
        "doubleSided": true,
        "extensions": extensions,
        "extras": {"caustique": extras},
    });
    if matter.alpha < 1.0 {
        material["alphaMode"] = "BLEND".into();
    }
    if let Some(texture) = matter.texture {
        material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
    }
    if let Some((scale, texture)) = matter.bumps {
        material["normalTexture"] = json!({"index": texture, "scale": scale});
    }
    material
}

/// A .glb file of a document and its binary chunk.
fn container(document: &Value, mut binary: Vec<u8>) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 28 + json.len() + binary.len();
    let words = |list: &[usize]| list.iter().flat_map(|n| (*n as u32).to_le_bytes()).collect::<Vec<u8>>();
    let head = words(&[0x4654_6c67, 2, total, json.len(), 0x4e4f_534a]);
    [head, json, words(&[binary.len(), 0x004e_4942]), binary].concat()
}
