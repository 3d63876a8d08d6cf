//! Splits a file into JSON and the binary chunk (specification, section 4.4), and checks version and required
//! extensions.

use super::fault;
use crate::error::{Error, Result};
use crate::git_lfs;
use serde_json::Value;
use std::collections::BTreeSet;

const DAMAGED: &str = "the file is damaged or incomplete: copy or export it again";

/// Names of the glTF extensions that the reader supports.
const SUPPORTED: [&str; 27] = [
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_volume_scatter",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// The first bytes of an EXR.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Names of the extension for buffer views that meshoptimizer has compressed.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Whether a buffer only holds place for decoded data.
pub(super) fn is_fallback(buffer: &Value) -> bool {
    MESHOPT.iter().any(|name| buffer["extensions"][name]["fallback"] == true)
}

/// Whether the reader supports the glTF extension of this name.
pub(super) fn is_supported(extension: &str) -> bool {
    SUPPORTED.contains(&extension)
}

/// Splits the bytes of a `.glb` into its JSON and its binary chunk; a `.gltf` is JSON alone, and the chunk is empty.
pub(super) fn split(bytes: &[u8]) -> Result<(Value, &[u8])> {
    git_lfs::check(bytes, "")?;
    let (json, binary) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes, &[][..]) };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    if json.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        let hint = if bytes.starts_with(&EXR_MAGIC) {
            "it is an EXR, a picture: 'caustique info' describes it; give the .glb or .gltf file of its scene"
        } else {
            "give a .glb or .gltf file"
        };
        return Err(fault("", "this is not a glTF file").hint(hint));
    }
    let mut value = serde_json::from_slice(json).map_err(|e| fault("JSON", e).hint(DAMAGED))?;
    unify_integers(&mut value);
    Ok((value, binary))
}

/// Converts floats with an integral value to integers: 4, 4.0 and 4e0 are equivalent (specification, section 2.7).
fn unify_integers(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(unify_integers),
        Value::Object(object) => object.values_mut().for_each(unify_integers),
        Value::Number(number) if number.is_f64() => {
            // Doubles above 2^53 do not represent every integer, and -0.0 must keep its sign.
            let whole =
                |x: &f64| x.fract() == 0.0 && x.abs() <= (1u64 << 53) as f64 && x.to_bits() != (-0.0f64).to_bits();
            if let Some(x) = number.as_f64().filter(whole) {
                *value = (x as i64).into();
            }
        }
        _ => {}
    }
}

/// Reads a little-endian 32-bit word at byte `at`; `None` past the end.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(word.try_into().ok()?) as usize)
}

fn chunks(bytes: &[u8]) -> Result<(&[u8], &[u8])> {
    let damaged = |cause: String| fault("", cause).hint(DAMAGED);
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(damaged(format!("the file ends inside its header, after {} bytes", bytes.len())));
    };
    if version != 2 {
        return Err(
            fault("", format!("binary glTF version {version} is not supported")).hint("export the scene as glTF 2.0")
        );
    }
    if length > bytes.len() {
        return Err(damaged(format!("the file is cut off: its header says {length} bytes, it has {}", bytes.len())));
    }
    let (mut json, mut binary, mut at) = (None, None, 12);
    while at + 8 <= length {
        let (Some(size), Some(kind)) = (word(bytes, at), bytes.get(at + 4..at + 8)) else { break };
        let start = at + 8;
        let Some(chunk) = bytes[..length].get(start..start.saturating_add(size)) else {
            return Err(damaged(format!("the chunk at byte {at} runs past the end of the file")));
        };
        match kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        // Chunks are aligned to four bytes.
        at = start + size.next_multiple_of(4);
    }
    match json {
        Some(json) => Ok((json, binary.unwrap_or(&[]))),
        None => Err(damaged("the file holds no JSON chunk".into())),
    }
}

/// Checks the version and the extensions of the document. An unsupported extension is an error if it is required, and a
/// warning otherwise.
pub(super) fn check(document: &Value, warnings: &mut Vec<String>) -> Result<()> {
    let asset = &document["asset"];
    for key in ["version", "minVersion"] {
        let Some(version) = asset[key].as_str() else {
            if key == "minVersion" {
                continue;
            }
            return Err(fault("asset", "the glTF version is missing").hint("export the scene as glTF 2.0"));
        };
        let newer = key == "minVersion" && version != "2.0";
        if newer || !(version == "2" || version.starts_with("2.")) {
            return Err(
                fault("asset", format!("glTF version {version} is not supported")).hint("export the scene as glTF 2.0")
            );
        }
    }
    let (used, required) = extensions(document);
    let unknown: Vec<&String> = required.iter().filter(|name| !is_supported(name)).collect();
    if let Some(first) = unknown.first() {
        let names: Vec<String> = unknown.iter().map(|name| format!("\"{name}\"")).collect();
        let (word, are) = if unknown.len() == 1 { ("extension", "is") } else { ("extensions", "are") };
        return Err(fault(
            "extensionsRequired",
            format!("{word} {} {are} required but not supported", names.join(", ")),
        )
        .hint(remedy(first)));
    }
    for name in used.iter().filter(|name| !is_supported(name)) {
        warnings.push(format!("extension \"{name}\" is not supported and is ignored"));
    }
    Ok(())
}

/// Names of the glTF extensions that the document uses, listed or not, and of those that it requires.
pub(super) fn extensions(document: &Value) -> (BTreeSet<String>, BTreeSet<String>) {
    let listed = |key: &str| -> BTreeSet<String> {
        let names = document[key].as_array().into_iter().flatten();
        names.filter_map(|name| name.as_str().map(str::to_owned)).collect()
    };
    let (mut used, required) = (listed("extensionsUsed"), listed("extensionsRequired"));
    collect_extensions(document, &mut used);
    (used, required)
}

/// The error for a part of the document with an unsupported compression extension; `None` for other parts.
pub(super) fn compression_error(part: &Value) -> Option<Error> {
    let names = part["extensions"].as_object()?.keys();
    let name = names.into_iter().find(|name| name.ends_with("_compression") && !is_supported(name))?;
    let cause = format!("all its data is compressed by extension \"{name}\", which is not supported");
    Some(fault("", cause).hint(remedy(name)))
}

fn remedy(extension: &str) -> &'static str {
    match extension {
        name if name.ends_with("_compression") => "decompress the file: gltf-transform copy IN.glb OUT.glb",
        _ => "export the scene without this extension",
    }
}

/// Adds the names of all glTF extensions in the document to `names`, listed or not. Extras may have keys of any name.
fn collect_extensions(value: &Value, names: &mut BTreeSet<String>) {
    match value {
        Value::Array(list) => list.iter().for_each(|item| collect_extensions(item, names)),
        Value::Object(object) => {
            for (key, item) in object {
                match (key.as_str(), item) {
                    ("extras", _) => {}
                    ("extensions", Value::Object(extensions)) => {
                        for (name, extension) in extensions {
                            names.insert(name.clone());
                            if is_supported(name) {
                                collect_extensions(extension, names);
                            }
                        }
                    }
                    _ => collect_extensions(item, names),
                }
            }
        }
        _ => {}
    }
}

/// The error for a value of the wrong JSON type at a place in the document.
pub(super) fn malformed(place: impl std::fmt::Display, cause: &serde_json::Error) -> Error {
    fault(place, cause).hint(DAMAGED)
}
