//! Images and textures: decoded once, kept once per use (colour or data) and sampler.

use super::document::{Document, get, named};
use super::fault;
use crate::error::{Error, Kind, Result};
use crate::texture::{Texels, Texture, TextureRef, Wrap};
use gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::fmt::Display;
use std::io::Cursor;
use std::rc::Rc;

/// Largest width or height of a texture.
const MOST_TEXELS: u32 = 32_768;
/// Most memory that decoding one image may take: 16384 x 16384 RGBA.
const MOST_BYTES: u64 = 1 << 30;

/// What an image is read for.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Use {
    /// Colours, sRGB-encoded.
    Color,
    /// Numbers.
    Data,
    /// Glossiness in the alpha channel (KHR_materials_pbrSpecularGlossiness), turned into roughness in G.
    Glossiness,
}

/// `textureInfo` of the specification (section 5.30), with a normal texture's scale.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Info {
    pub(super) index: u32,
    #[serde(default)]
    tex_coord: u32,
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    extensions: Option<Value>,
}

fn one() -> f32 {
    1.0
}

/// KHR_texture_transform.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Transform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<u32>,
}

impl Default for Transform {
    fn default() -> Self {
        Transform { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

impl Transform {
    /// Translation, rotation and scale as one matrix. Counter-clockwise with v running down, as the extension's text
    /// and its example of the lower left quadrant have it (its GLSL, read by columns, turns the other way).
    fn matrix(&self) -> [[f32; 3]; 2] {
        let (s, c) = self.rotation.sin_cos();
        let [x, y] = self.scale;
        [[c * x, s * y, self.offset[0]], [-s * x, c * y, self.offset[1]]]
    }
}

/// Loads textures as materials call for them.
#[derive(Default)]
pub(super) struct Textures {
    /// Those called for.
    pub(super) list: Vec<Texture>,
    /// By image, sampler and use.
    known: HashMap<(usize, Option<usize>, Use), u32>,
    images: HashMap<usize, Rc<DynamicImage>>,
}

impl Textures {
    /// A use of a texture.
    pub(super) fn reference(
        &mut self,
        document: &Document,
        info: &Info,
        usage: Use,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<TextureRef> {
        let name = "KHR_texture_transform";
        let transform = match info.extensions.as_ref().and_then(|e| e.get(name)) {
            Some(value) => Transform::deserialize(value)
                .map_err(|e| super::container::malformed(format!("{place}, {name}"), &e))?,
            None => Transform::default(),
        };
        let matrix = transform.matrix();
        if !matrix.iter().flatten().all(|x| x.is_finite()) {
            return Err(fault(place, format!("the numbers of {name} are not finite")));
        }
        let mut set = transform.tex_coord.unwrap_or(info.tex_coord);
        if set > 1 {
            warnings.push(format!("{place}: texture coordinates {set} are not read, 0 take their place"));
            set = 0;
        }
        let texture = self.load(document, info.index, usage).map_err(|e| e.within(place))?;
        Ok(TextureRef { texture, set: set as u8, transform: matrix })
    }

    fn load(&mut self, document: &Document, index: u32, usage: Use) -> Result<u32> {
        let texture = get(&document.textures, index as usize, "texture")?;
        let raw = document.part("textures", index as usize);
        if raw.get("source").is_none() {
            let other = raw["extensions"].as_object().and_then(|e| e.keys().next());
            let cause = match other {
                Some(name) => format!("texture {index} has only an image of {name}, which cannot be decoded"),
                None => format!("texture {index} has no image"),
            };
            return Err(fault("", cause).hint("export the textures as PNG or JPEG"));
        }
        let source = texture.source.value();
        let key = (source, texture.sampler.map(|s| s.value()), usage);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let image = self.image(document, source)?;
        // Four bytes or four floats a texel, for each sampler and use of it.
        let count = u64::from(image.width()) * u64::from(image.height());
        room(document, count * if is_deep(&image) { 16 } else { 4 }, "the textures of an image")?;
        let sampler = match texture.sampler {
            Some(sampler) => get(&document.samplers, sampler.value(), "sampler")?.clone(),
            None => Sampler::default(),
        };
        let described = get(&document.images, source, "image")?;
        let name = texture.name.as_ref().or(described.name.as_ref());
        let made = Texture {
            name: name.filter(|n| !n.is_empty()).cloned().unwrap_or_else(|| format!("texture {index}")),
            width: image.width(),
            height: image.height(),
            texels: texels(&image, usage),
            wrap: [wrap(&sampler.wrap_s), wrap(&sampler.wrap_t)],
            linear: linear(&sampler),
        };
        let known = self.list.len() as u32;
        self.list.push(made);
        self.known.insert(key, known);
        Ok(known)
    }

    fn image(&mut self, document: &Document, index: usize) -> Result<Rc<DynamicImage>> {
        if let Some(image) = self.images.get(&index) {
            return Ok(Rc::clone(image));
        }
        let image = get(&document.images, index, "image")?;
        let place = named("image", image.name.as_deref(), index);
        let decoded = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => document.bytes_of(uri).and_then(|bytes| decode(document, &bytes)),
            (None, Some(view)) => document.view(view.value()).and_then(|bytes| decode(document, bytes)),
            (None, None) => Err(fault("", "it has neither a URI nor a buffer view").hint("export the scene again")),
        };
        let decoded = Rc::new(decoded.map_err(|e| e.within(place))?);
        self.images.insert(index, Rc::clone(&decoded));
        Ok(decoded)
    }
}

fn decode(document: &Document, bytes: &[u8]) -> Result<DynamicImage> {
    const HINT: &str = "save the image again as PNG or JPEG";
    let broken = |cause: String| Error::new(Kind::Image, "", cause).hint(HINT);
    let format = image::guess_format(bytes);
    let Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) = format else {
        return Err(broken("it is neither PNG nor JPEG".into()));
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_TEXELS);
    limits.max_image_height = Some(MOST_TEXELS);
    limits.max_alloc = Some(MOST_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    check_room(document, bytes, format)?;
    // A decoder's own fault must not end the program.
    let decoded = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| reader.decode()));
    let decoded = decoded.map_err(|_| broken("it cannot be decoded: the decoder failed".into()))?;
    let image = decoded.map_err(|e| broken(format!("it cannot be decoded: {e}")))?;
    if image.width() == 0 || image.height() == 0 {
        return Err(broken("it has no texels".into()));
    }
    Ok(image)
}

/// Checks that the image fits as it is decoded and as it is kept: a few bytes can stand for a gigabyte of one colour.
fn check_room(document: &Document, bytes: &[u8], format: ImageFormat) -> Result<()> {
    // What is wrong with it, or larger than any image is taken, the decoder tells.
    let Ok(decoder) = ImageReader::with_format(Cursor::new(bytes), format).into_decoder() else { return Ok(()) };
    let (width, height) = decoder.dimensions();
    let deep = decoder.color_type().bytes_per_pixel() > decoder.color_type().channel_count();
    // Four bytes, or four floats twice on the way, beside what is decoded.
    let texels = u64::from(width) * u64::from(height);
    let needed = decoder.total_bytes().saturating_add(texels * if deep { 32 } else { 4 });
    if width > MOST_TEXELS || height > MOST_TEXELS {
        Ok(())
    } else {
        room(document, needed, format_args!("{width} x {height} texels"))
    }
}

/// Asks for memory of texels.
fn room(document: &Document, bytes: u64, what: impl Display) -> Result<()> {
    document.take(bytes, what).map_err(|e| e.hint("save the image smaller, or render with more memory"))
}

/// Whether an image has more than eight bits a channel.
fn is_deep(image: &DynamicImage) -> bool {
    !matches!(
        image,
        DynamicImage::ImageLuma8(_)
            | DynamicImage::ImageLumaA8(_)
            | DynamicImage::ImageRgb8(_)
            | DynamicImage::ImageRgba8(_)
    )
}

/// Texels as the renderer keeps them: 8 bits stay 8 bits, more become floats.
fn texels(image: &DynamicImage, usage: Use) -> Texels {
    if is_deep(image) && usage != Use::Glossiness {
        let mut data: Vec<[f32; 4]> = image.to_rgba32f().pixels().map(|p| p.0).collect();
        if usage == Use::Color {
            data.iter_mut().for_each(|t| t[..3].iter_mut().for_each(|x| *x = srgb_to_linear(*x)));
        }
        return Texels::Floats(data);
    }
    let mut data = image.to_rgba8().into_raw();
    if usage == Use::Glossiness {
        data.chunks_exact_mut(4).for_each(|t| t.copy_from_slice(&[0, 255 - t[3], 255, 255]));
    }
    Texels::Bytes { data, srgb: usage == Use::Color }
}

/// IEC 61966-2-1.
fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

fn wrap(mode: &Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// A texture is looked at from near and far: the nearest texel only where the file asks for it when magnified.
fn linear(sampler: &Sampler) -> bool {
    match (&sampler.mag_filter, &sampler.min_filter) {
        (Some(Checked::Valid(mag)), _) => *mag == MagFilter::Linear,
        (_, Some(Checked::Valid(min))) => *min != MinFilter::Nearest,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The extension's example: the lower left quadrant of the image, turned.
    #[test]
    fn transform_of_the_specification() {
        let transform =
            Transform { offset: [0.0, 1.0], rotation: std::f32::consts::FRAC_PI_2, scale: [0.5, 0.5], tex_coord: None };
        let reference = TextureRef { texture: 0, set: 0, transform: transform.matrix() };
        for u in [0.0, 0.3, 1.0] {
            for v in [0.0, 0.6, 1.0] {
                let p = reference.coordinates([crate::math::Vec2::new(u, v); 2]);
                assert!((-1e-6..=0.500001).contains(&p.x) && (0.499999..=1.000001).contains(&p.y), "{p}");
            }
        }
    }
}
