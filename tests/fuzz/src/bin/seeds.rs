//! Writes small valid files for every fuzz target: `seeds PROGRAM FOLDER`, where the program is caustique.

#[path = "../../../files/gltf/everything.rs"]
mod everything;
#[path = "../../../files/gltf/glb.rs"]
mod glb;
#[path = "../../../support/onnx.rs"]
mod onnx;

use caustique::pipeline::{checkpoint, records::Record, shard};
use glb::Glb;
use image::{DynamicImage, ImageFormat};
use serde_json::json;
use std::error::Error;
use std::io::Cursor;
use std::path::PathBuf;
use std::process::Command;
use std::{env, fs};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// A folder with one subfolder of seeds per target.
struct Seeds(PathBuf);

impl Seeds {
    fn add(&self, target: &str, name: &str, bytes: &[u8]) -> Outcome {
        let folder = self.0.join(target);
        fs::create_dir_all(&folder)?;
        Ok(fs::write(folder.join(name), bytes)?)
    }
}

fn main() -> Outcome {
    let words: Vec<String> = env::args().skip(1).collect();
    let [program, folder] = &words[..] else { return Err("seeds PROGRAM FOLDER".into()) };
    let seeds = Seeds(folder.into());
    scenes(&seeds)?;
    textures(&seeds)?;
    compressed(&seeds)?;
    environments(&seeds)?;
    pictures(&seeds)?;
    states(&seeds, program)?;
    seeds.add("model", "features", &onnx::network("features", &[]))?;
    seeds.add("model", "weights", &onnx::network("weights", &[]))?;
    seeds.add("model", "finish", &onnx::network("finish", &[]))?;
    seeds.add("usd_options", "some", br#"["--width=640", "--output=a.exr"]"#)?;
    seeds.add("usd_fault", "fault", b"noise\n{\"prim\": \"/a\", \"fault\": \"it is odd\", \"hint\": null}\n")?;
    Ok(())
}

/// A cube with a light and a camera.
fn plain() -> Glb {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    file.node(json!({"mesh": mesh}));
    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}));
    file.node(json!({"camera": 0, "translation": [0, 0, 9]}));
    file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"color": [1, 1, 1]}}});
    file
}

fn scenes(seeds: &Seeds) -> Outcome {
    for (name, file) in [("plain", plain()), ("everything", everything::everything())] {
        seeds.add("glb", name, &file.bytes())?;
        seeds.add("scene", name, &file.bytes())?;
        let mut beside = file.clone();
        beside.json["buffers"][0]["uri"] = "a.bin".into();
        seeds.add("gltf", name, &[beside.json.to_string().as_bytes(), b"\0", &file.binary].concat())?;
    }
    for name in ["a.png", "a.jpg"] {
        let mut file = plain();
        file.json["buffers"][0]["uri"] = "data:;base64,AAAA".into();
        file.json["images"] = json!([{"uri": name}]);
        file.json["textures"] = json!([{"source": 0}]);
        file.json["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
        file.json["meshes"][0]["primitives"][0] = json!({"attributes": {}, "material": 0});
        let format = if name == "a.png" { ImageFormat::Png } else { ImageFormat::Jpeg };
        let image = encoded(&DynamicImage::new_rgb8(2, 2), format)?;
        seeds.add("gltf", name, &[file.json.to_string().as_bytes(), b"\0", &image].concat())?;
    }
    for name in ["a.hdr", "a.exr"] {
        let document = json!({"asset": {"version": "2.0"}, "scenes": [{"extras":
            {"caustique": {"environment": {"file": name, "rotation_deg": 30}}}}]});
        let image = if name == "a.hdr" { hdr()? } else { exr_of(exr::prelude::Compression::ZIP16)? };
        seeds.add("gltf", name, &[document.to_string().as_bytes(), b"\0", &image].concat())?;
    }
    Ok(())
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Outcome<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format)?;
    Ok(bytes.into_inner())
}

/// Texels with different values.
fn gradient(width: u32, height: u32) -> DynamicImage {
    image::RgbaImage::from_fn(width, height, |x, y| image::Rgba([(40 * x) as u8, (50 * y) as u8, 7, 200])).into()
}

/// The kept inputs of readers whose formats nothing here can write.
fn compressed(seeds: &Seeds) -> Outcome {
    for target in ["webp", "ktx2", "draco", "meshopt"] {
        for entry in fs::read_dir(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../corpus").join(target))? {
            let path = entry?.path();
            seeds.add(target, &path.file_name().unwrap_or_default().to_string_lossy(), &fs::read(&path)?)?;
        }
    }
    Ok(())
}

fn textures(seeds: &Seeds) -> Outcome {
    let image = gradient(6, 5);
    let kinds: [(&str, DynamicImage); 6] = [
        ("rgba8", image.clone()),
        ("rgb8", image.to_rgb8().into()),
        ("grey8", image.to_luma8().into()),
        ("grey-alpha8", image.to_luma_alpha8().into()),
        ("rgb16", image.to_rgb16().into()),
        ("grey16", image.to_luma16().into()),
    ];
    for (name, image) in &kinds {
        seeds.add("png", name, &encoded(image, ImageFormat::Png)?)?;
    }
    for (name, image) in &kinds[1..3] {
        seeds.add("jpeg", name, &encoded(image, ImageFormat::Jpeg)?)?;
    }
    Ok(())
}

fn hdr() -> Outcome<Vec<u8>> {
    encoded(&gradient(16, 8).to_rgb32f().into(), ImageFormat::Hdr)
}

/// A picture with channels of all types.
fn exr_of(compression: exr::prelude::Compression) -> Outcome<Vec<u8>> {
    use exr::prelude::*;
    let (width, height) = (16, 8);
    let values: Vec<f32> = (0..width * height).map(|i| (i % 13) as f32 * 0.25).collect();
    let channels = [
        AnyChannel::new("R", FlatSamples::F32(values.clone())),
        AnyChannel::new("G", FlatSamples::F16(values.iter().map(|x| f16::from_f32(*x)).collect())),
        AnyChannel::new("B", FlatSamples::F32(values.clone())),
        AnyChannel::new("id.X", FlatSamples::U32(values.iter().map(|x| *x as u32).collect())),
    ];
    let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    let mut bytes = Cursor::new(std::vec::Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

fn environments(seeds: &Seeds) -> Outcome {
    seeds.add("hdr", "runs", &hdr()?)?;
    let flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x40\x40\x40\x81";
    seeds.add("hdr", "flat", flat)
}

fn pictures(seeds: &Seeds) -> Outcome {
    use exr::prelude::Compression;
    for (name, compression) in [
        ("none", Compression::Uncompressed),
        ("rle", Compression::RLE),
        ("zips", Compression::ZIP1),
        ("zip", Compression::ZIP16),
        ("piz", Compression::PIZ),
        ("pxr24", Compression::PXR24),
        ("b44", Compression::B44),
        ("b44a", Compression::B44A),
    ] {
        let bytes = exr_of(compression)?;
        seeds.add("exr", name, &bytes)?;
        seeds.add("exr_environment", name, &bytes)?;
    }
    Ok(())
}

/// A checkpoint and a shard of a small render, as whole files and as the contents of their records.
fn states(seeds: &Seeds, program: &str) -> Outcome {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("a.glb"), plain().bytes())?;
    let common = ["render", "a.glb", "--width", "2", "--height", "2", "--no-combine", "--progress", "none"];
    let render = |words: &[&str]| -> Outcome {
        let done = Command::new(program).current_dir(folder.path()).args(common).args(words).status()?;
        if done.success() { Ok(()) } else { Err("the render failed".into()) }
    };
    for method in ["path", "sppm", "vcm"] {
        let words = ["--method", method, "--iterations", "2", "-o", "a.exr"];
        render(&[&words[..], &["--checkpoint", "state"]].concat())?;
        render(&[&words[..], &["--shard", "0/2"]].concat())?;
        let state = fs::read(folder.path().join("state"))?;
        seeds.add("checkpoint", method, &contents(&state[checkpoint::MAGIC.len()..])?)?;
        seeds.add("checkpoint", &format!("{method}-whole"), &state)?;
        let picture = fs::read(folder.path().join("a.exr"))?;
        let tail = u64::from_le_bytes(picture[picture.len() - 16..picture.len() - 8].try_into()?) as usize;
        seeds.add("shard", method, &contents(&picture[picture.len() - tail..])?)?;
        seeds.add("shard", &format!("{method}-whole"), &picture)?;
        assert!(picture.ends_with(shard::MARK));
        seeds.add("exr", method, &picture)?;
        fs::remove_file(folder.path().join("state"))?;
    }
    Ok(())
}

/// The contents of records in the format of the targets: the first ends at a zero byte, the second starts with its
/// length, the third is the rest.
fn contents(mut file: &[u8]) -> Outcome<Vec<u8>> {
    let mut all = Vec::new();
    while let Some(record) = Record::read(&mut file)? {
        all.push(record.unpack()?);
    }
    let [head, state, pixels] = &all[..] else { return Err("not three records".into()) };
    let length = u16::try_from(state.len())?.to_le_bytes();
    Ok([&head[..], b"\0", &length, state, pixels].concat())
}
