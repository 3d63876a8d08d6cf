//! Every reader of untrusted files, called with the bytes of one file as the program calls it. Fuzz targets
//! (`tests/fuzz/`) and the replay of the kept corpus call the same functions.

use super::promises;
use caustique::combine::network::Network;
use caustique::combine::{Model, Runtime};
use caustique::error::Result;
use caustique::film::{Naming, Selection};
use caustique::image::exr;
use caustique::light::{Distribution, Pattern};
use caustique::math::{Vec2, Vec3};
use caustique::medium::DensityGrid;
use caustique::pipeline::merge::{MergeRequest, Shards};
use caustique::pipeline::{checkpoint, records, shard};
use caustique::render::{Candidate, Control, Method, RenderInput, Session, Settings, StopReason, render};
use caustique::scene::description::EnvironmentSource;
use caustique::scene::gltf::{self, ReadOptions};
use caustique::scene::{CameraRequest, Scene, converter, environment_file, grid_file, ies};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::LazyLock;

/// A reader: its name, and a function that reads the bytes of a file. The function may write other files to the folder.
pub type Reader = (&'static str, fn(&[u8], &Path));

/// All readers.
pub const READERS: [Reader; 19] = [
    ("glb", glb),
    ("scene", scene),
    ("gltf", gltf),
    ("png", texture),
    ("jpeg", texture),
    ("webp", texture),
    ("ktx2", texture),
    ("draco", draco),
    ("meshopt", meshopt),
    ("exr", picture),
    ("exr_environment", environment),
    ("hdr", environment),
    ("ies", profile),
    ("vol", grid),
    ("checkpoint", checkpoint),
    ("shard", shard),
    ("model", model),
    ("usd_options", usd_options),
    ("usd_fault", usd_fault),
];

/// The value of a result. Errors must have a message.
fn value_of<T>(outcome: Result<T>) -> Option<T> {
    outcome.inspect_err(|error| assert!(!error.cause.is_empty() && !error.place.is_empty(), "{error:?}")).ok()
}

/// Writes bytes to a file.
fn file(folder: &Path, name: &str, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("the folder takes files");
    path
}

/// Scene files, binary or JSON.
fn glb(bytes: &[u8], _: &Path) {
    if let Some(scene) = value_of(gltf::read_bytes(bytes, Path::new("fuzz.glb"), &ReadOptions::default())) {
        promises::check(&scene, "what was read");
    }
}

/// Scene files, the scenes built from them, and one iteration of pictures of four pixels.
fn scene(bytes: &[u8], _: &Path) {
    let read = value_of(gltf::read_bytes(bytes, Path::new("fuzz.glb"), &ReadOptions::default()));
    let Some(scene) = read.and_then(|description| value_of(Scene::build(description, 1))) else { return };
    let Ok(camera) = scene.camera(&small()) else { return };
    for method in METHODS {
        let settings = Settings {
            iterations: Some(1),
            photons: 64,
            max_depth: 16,
            ..Settings::for_candidate(Candidate::unguided(method))
        };
        let pixels = render(&scene, &camera, &settings, |_, _| Control::Continue).pixels.len();
        assert_eq!(pixels, 4);
    }
}

/// Methods that share no code of their iterations.
const METHODS: [Method; 3] = [Method::Path, Method::Sppm, Method::Vcm];

/// A picture of four pixels.
fn small() -> CameraRequest {
    CameraRequest { width: Some(2), height: Some(2), ..CameraRequest::default() }
}

/// Renders of [`METHODS`] that continue from saved states, of a triangle under a uniform sky.
static STAGES: LazyLock<Vec<RenderInput<'static>>> = LazyLock::new(|| {
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0], "extras": {"caustique": {"environment": {"color": [1, 1, 1]}}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36}],
    });
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let bytes = packed(&document, corners.as_flattened());
    let description = gltf::read_bytes(&bytes, Path::new("fuzz.glb"), &ReadOptions::default()).expect("it is a scene");
    let scene: &Scene = Box::leak(Box::new(Scene::build(description, 1).expect("it can be built")));
    let camera = Box::leak(Box::new(scene.camera(&small()).expect("there is one")));
    METHODS.map(|method| RenderInput::new(scene, camera, &Settings::for_candidate(Candidate::unguided(method)))).into()
});

/// A scene in JSON and, behind a zero byte, the content of the files `a.bin`, `a.png`, `a.jpg`, `a.hdr` and `a.exr`
/// beside it.
fn gltf(bytes: &[u8], folder: &Path) {
    let (json, beside) = match bytes.iter().position(|byte| *byte == 0) {
        Some(at) => (&bytes[..at], &bytes[at + 1..]),
        None => (bytes, &[][..]),
    };
    for name in ["a.bin", "a.png", "a.jpg", "a.hdr", "a.exr"] {
        file(folder, name, beside);
    }
    let path = file(folder, "fuzz.gltf", json);
    if let Some(scene) = value_of(gltf::read(&path, &ReadOptions::default())) {
        promises::check(&scene, "what was read");
    }
}

/// A texture with all encodings: colours, numbers and glossiness.
fn texture(bytes: &[u8], _: &Path) {
    let texture = serde_json::json!({"index": 0});
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"normalTexture": texture, "emissiveTexture": texture, "extensions":
            {"KHR_materials_pbrSpecularGlossiness": {"specularGlossinessTexture": texture}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": 0}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 1}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 36, "byteLength": bytes.len()}, {"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36 + bytes.len()}],
    });
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let scene = gltf::read_bytes(
        &packed(&document, &[corners.as_flattened(), bytes].concat()),
        Path::new("fuzz.glb"),
        &ReadOptions::default(),
    );
    if let Some(scene) = value_of(scene) {
        promises::check(&scene, "what was read");
        assert!(scene.textures.iter().all(|texture| texture.mean().is_finite()), "texels");
    }
}

/// A mesh in Draco's compression, with positions and normals.
fn draco(bytes: &[u8], _: &Path) {
    let compression = serde_json::json!({"KHR_draco_mesh_compression":
        {"bufferView": 0, "attributes": {"POSITION": 0, "NORMAL": 1}}});
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 1, "extensions": compression.clone()},
            {"attributes": {"POSITION": 2}, "indices": 3, "extensions": compression}]}],
        "accessors": [
            {"componentType": 5126, "type": "VEC3", "count": 4}, {"componentType": 5125, "type": "SCALAR", "count": 6},
            {"componentType": 5126, "type": "VEC3", "count": 4}, {"componentType": 5125, "type": "SCALAR", "count": 6}],
        "bufferViews": [{"buffer": 0, "byteLength": bytes.len()}], "buffers": [{"byteLength": bytes.len()}],
    });
    if let Some(scene) =
        value_of(gltf::read_bytes(&packed(&document, bytes), Path::new("fuzz.glb"), &ReadOptions::default()))
    {
        promises::check(&scene, "what was read");
    }
}

/// Buffer views in meshoptimizer's compression: vertices with each filter, triangles and indices.
fn meshopt(bytes: &[u8], _: &Path) {
    for (mode, stride, filter) in [
        ("ATTRIBUTES", 12, "NONE"),
        ("ATTRIBUTES", 12, "EXPONENTIAL"),
        ("ATTRIBUTES", 4, "OCTAHEDRAL"),
        ("ATTRIBUTES", 8, "QUATERNION"),
        ("ATTRIBUTES", 8, "COLOR"),
        ("TRIANGLES", 4, "NONE"),
        ("INDICES", 2, "NONE"),
    ] {
        let view = serde_json::json!({"buffer": 0, "byteLength": bytes.len(), "byteStride": stride, "count": 6,
            "mode": mode, "filter": filter});
        let document = serde_json::json!({
            "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"componentType": 5126, "type": "VEC3", "count": 6, "bufferView": 0}],
            "bufferViews": [{"buffer": 0, "byteLength": 72, "extensions": {"EXT_meshopt_compression": view}}],
            "buffers": [{"byteLength": bytes.len()}],
        });
        let read = gltf::read_bytes(&packed(&document, bytes), Path::new("fuzz.glb"), &ReadOptions::default());
        if let Some(scene) = value_of(read) {
            promises::check(&scene, "what was read");
        }
    }
}

/// A `.glb` file of a document and its binary chunk.
fn packed(document: &serde_json::Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 28 + json.len() + binary.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let head = [word(0x4654_6c67), word(2), word(total), word(json.len()), word(0x4e4f_534a)];
    let mut bytes = head.as_flattened().to_vec();
    bytes.extend(&json);
    bytes.extend([word(binary.len()), word(0x004e_4942)].as_flattened());
    bytes.extend(binary);
    bytes
}

/// A picture, as `info`, `compare` and `combine` read it.
fn picture(bytes: &[u8], folder: &Path) {
    if let Some((layers, attributes)) = value_of(exr::read(&file(folder, "fuzz.exr", bytes))) {
        let pixels = layers.width * layers.height;
        assert!(layers.layers.iter().flat_map(|layer| &layer.planes).all(|plane| plane.values.len() == pixels));
        attributes.object();
    }
}

/// An image of an environment.
fn environment(bytes: &[u8], folder: &Path) {
    let read = environment_file::read(&file(folder, "fuzz.sky", bytes), &mut Vec::new());
    if let Some(EnvironmentSource::Image { width, height, texels }) = value_of(read) {
        assert_eq!(texels.len(), width as usize * height as usize);
        assert!(texels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
    }
}

/// A photometric profile.
fn profile(bytes: &[u8], _: &Path) {
    let read = ies::parse(bytes, &mut Vec::new()).map_err(|error| error.within("fuzz.ies"));
    if let Some(photometry) = value_of(read) {
        assert!(photometry.peak() > 0.0 && photometry.peak().is_finite());
        let turn = ies::Turn { degrees: 30.0, clockwise: true };
        let shape = photometry.profile(turn).map(|profile| Distribution::new(Pattern::Profile(profile).into(), None));
        if let Some(shape) = shape.flatten() {
            assert!(shape.sample(Vec2::splat(0.5)).is_none_or(|(d, pdf)| d.is_finite() && pdf > 0.0));
        }
    }
}

/// A grid of a heterogeneous medium.
fn grid(bytes: &[u8], folder: &Path) {
    if let Some(grid) = value_of(grid_file::read(&file(folder, "fuzz.vol", bytes), &mut Vec::new())) {
        assert!(grid.color_at(Vec3::splat(0.7)).is_finite());
        assert!(grid.channels() == 3 || DensityGrid::new(grid).is_some_and(|density| density.highest() >= 0.0));
    }
}

/// Records with correct hashes, without which every mutant would be refused. The content of the first record ends at a
/// zero byte, the second starts with its length in two bytes, the third is the rest.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    let head = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let rest = bytes.get(head + 1..).unwrap_or_default();
    let length = rest.get(..2).map_or(0, |two| usize::from(two[0]) | usize::from(two[1]) << 8);
    let rest = rest.get(2..).unwrap_or_default();
    let (state, pixels) = rest.split_at(length.min(rest.len()));
    let mut out = Vec::new();
    for content in [&bytes[..head], state, pixels] {
        records::Record::new(content).write(&mut out).expect("memory");
    }
    records::write_end(&mut out).expect("memory");
    out
}

/// A checkpoint, or the contents of its records. The render continues for one iteration.
fn checkpoint(bytes: &[u8], folder: &Path) {
    let whole = bytes.starts_with(checkpoint::MAGIC);
    let bytes = if whole { bytes.to_vec() } else { [&checkpoint::MAGIC[..], &sealed(bytes)].concat() };
    let path = file(folder, "fuzz.checkpoint", &bytes);
    if value_of(checkpoint::read(&path)).is_none() {
        return;
    }
    for stage in STAGES.iter() {
        let (_, state) = checkpoint::read(&path).expect("it was read before");
        if let Some(mut session) = Session::resume(stage, state) {
            session.step();
            assert_eq!(session.finish(StopReason::Interrupted).pixels.len(), 4);
        }
    }
}

/// A shard, or the contents of the records behind its picture. It is merged alone.
fn shard(bytes: &[u8], folder: &Path) {
    let mut bytes = if bytes.ends_with(shard::MARK) { bytes.to_vec() } else { sealed(bytes) };
    if !bytes.ends_with(shard::MARK) {
        let length = bytes.len() as u64 + 16;
        bytes.write_all(&length.to_le_bytes()).and_then(|()| bytes.write_all(shard::MARK)).expect("memory");
    }
    let request = MergeRequest { finish: None, layers: Selection::All, naming: Naming::Plain, reproducible: true };
    if let Some(shards) = value_of(Shards::open(&[file(folder, "fuzz.exr", &bytes)], true)) {
        shards.warnings();
        value_of(shards.merge(&request, |_| {}));
    }
}

/// A network.
fn model(bytes: &[u8], folder: &Path) {
    let runtime = Runtime::find().expect("ONNX Runtime is installed");
    let model = Model::from_file(&file(folder, "fuzz.onnx", bytes)).expect("it can be read");
    value_of(Network::load(&model, &runtime, 1));
}

/// The options that the USD converter reports.
fn usd_options(bytes: &[u8], _: &Path) {
    value_of(converter::answer::options(bytes, Path::new("fuzz.usda")));
}

/// The message of the USD converter when it fails.
fn usd_fault(bytes: &[u8], _: &Path) {
    value_of::<()>(Err(converter::answer::failure(bytes, Path::new("fuzz.usda"), "scripts/usd")));
}
