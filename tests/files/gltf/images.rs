//! Images of textures: exact texels, their memory, and truncated files.

use super::glb::Glb;
use super::{message, read, try_read};
use caustique::texture::{Encoding, Integers, Texels};
use image::{DynamicImage, ImageFormat};
use serde_json::json;
use std::io::Cursor;
use std::sync::Arc;

/// A cube with an image for its base colour and its roughness.
pub fn wearing(image: &[u8], mime: &str) -> Glb {
    let mut file = Glb::new();
    let view = file.view(image);
    file.push("images", json!({"name": "tiles", "bufferView": view, "mimeType": mime}));
    file.push("textures", json!({"source": 0}));
    let material = json!({"pbrMetallicRoughness":
        {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}});
    let material = file.push("materials", material);
    let mesh = file.cube("cube", Some(material));
    let uv = file.floats(&[[0.5, 0.5]; 8]);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    file.node(json!({"mesh": mesh, "name": "Cube"}));
    file
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    image.write_to(&mut file, format).unwrap();
    file.into_inner()
}

/// Pseudo-random numbers, including the extremes.
fn noise(count: usize) -> Vec<u16> {
    let random = |i: usize| ((i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u16;
    [0, u16::MAX].into_iter().chain((2..).map(random)).take(count).collect()
}

/// An image of 16 x 16 texels of each PNG colour type.
fn kinds() -> Vec<DynamicImage> {
    let words = |channels: usize| noise(256 * channels);
    let bytes = |channels: usize| words(channels).into_iter().map(|x| (x >> 8) as u8).collect::<Vec<u8>>();
    let (l, la) = (bytes(1), bytes(2));
    vec![
        image::GrayImage::from_raw(16, 16, l).unwrap().into(),
        image::GrayAlphaImage::from_raw(16, 16, la).unwrap().into(),
        image::RgbImage::from_raw(16, 16, bytes(3)).unwrap().into(),
        image::RgbaImage::from_raw(16, 16, bytes(4)).unwrap().into(),
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(16, 16, words(1)).unwrap().into(),
        image::ImageBuffer::<image::LumaA<u16>, _>::from_raw(16, 16, words(2)).unwrap().into(),
        image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(16, 16, words(3)).unwrap().into(),
        image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(16, 16, words(4)).unwrap().into(),
    ]
}

/// The texels decoded to floats: sRGB bytes in f64, 16-bit values in f32.
fn expected(image: &DynamicImage, encoding: Encoding) -> Vec<[f32; 4]> {
    let deep = image.color().bytes_per_pixel() > image.color().channel_count();
    let byte = |x: u8| {
        let c = f64::from(x) / 255.0;
        (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    };
    let word = |c: f32| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let alpha = |x: u8| f32::from(x) / 255.0;
    match (encoding, deep) {
        (Encoding::Srgb, false) => {
            image.to_rgba8().pixels().map(|p| [byte(p[0]), byte(p[1]), byte(p[2]), alpha(p[3])]).collect()
        }
        (Encoding::Srgb, true) => {
            image.to_rgba32f().pixels().map(|p| [word(p[0]), word(p[1]), word(p[2]), p[3]]).collect()
        }
        (Encoding::Linear, false) => image.to_rgba8().pixels().map(|p| p.0.map(alpha)).collect(),
        (Encoding::Linear, true) => image.to_rgba32f().pixels().map(|p| p.0).collect(),
        (Encoding::Glossiness(factor), _) => {
            let roughness = |gloss: u8| (255.0 - factor * f32::from(gloss)) / 255.0;
            image.to_rgba8().pixels().map(|p| [0.0, roughness(p[3]), 1.0, 1.0]).collect()
        }
    }
}

/// Texels keep the bit depth of the file, are stored once for all textures of an image, and decode to the expected
/// floats.
#[test]
fn texels_are_exact_and_shared() {
    for image in kinds() {
        let scene = read(&wearing(&encoded(&image, ImageFormat::Png), "image/png"));
        let kept = |texels: &Texels| match texels {
            Texels::Integers { data, channels, encoding } => (Arc::clone(data), *channels, *encoding),
            Texels::Floats(_) => panic!("{:?} is kept as floats", image.color()),
        };
        let [color, data] = [0, 1].map(|i| kept(&scene.textures[i].texels));
        assert!(Arc::ptr_eq(&color.0, &data.0));
        assert_eq!((color.2, data.2, color.1), (Encoding::Srgb, Encoding::Linear, image.color().channel_count()));
        let bytes = match &*color.0 {
            Integers::Bytes(data) => data.len(),
            Integers::Words(data) => 2 * data.len(),
        };
        assert_eq!(bytes, image.as_bytes().len());
        for encoding in [Encoding::Srgb, Encoding::Linear, Encoding::Glossiness(1.0), Encoding::Glossiness(0.3)] {
            let texels = Texels::Integers { data: Arc::clone(&color.0), channels: color.1, encoding };
            for (i, expected) in expected(&image, encoding).into_iter().enumerate() {
                assert_eq!(
                    texels.at(i).to_array().map(f32::to_bits),
                    expected.map(f32::to_bits),
                    "{:?}",
                    image.color()
                );
            }
        }
    }
}

/// A JPEG of noise, and the JPEG with the size of another image in its header.
pub fn jpegs() -> [Vec<u8>; 2] {
    let data = noise(64 * 64 * 3).into_iter().map(|x| x as u8).collect();
    let whole = encoded(&image::RgbImage::from_raw(64, 64, data).unwrap().into(), ImageFormat::Jpeg);
    let frame = whole.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    let mut bomb = whole.clone();
    bomb[frame + 5..frame + 9].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
    [whole, bomb]
}

/// The JPEG decoder fills in missing texels, which gives a warning. A file whose size is impossible for its number of
/// bits is refused before decoding.
#[test]
fn jpegs_that_are_cut_off() {
    let [whole, bomb] = jpegs();
    let warnings = |bytes: &[u8]| read(&wearing(bytes, "image/jpeg")).warnings;
    assert_eq!(warnings(&whole), [""; 0]);
    let mut longer = whole.clone();
    longer.extend([0, 1, 2, 3]);
    assert_eq!(warnings(&longer), [""; 0]);
    let cut = "image \"tiles\": the image file is cut off: the missing part is grey (copy it again)";
    for share in [2, 3] {
        assert_eq!(warnings(&whole[..whole.len() / share]), [cut]);
    }
    let error = message(&try_read(&wearing(&bomb, "image/jpeg")).unwrap_err());
    let place = "pool.glb: material 0, baseColorTexture: image \"tiles\": it is cut off: ";
    assert!(error.starts_with(place) && error.contains(" bytes do not hold 16000 x 16000 texels\nhint: "), "{error}");
}
