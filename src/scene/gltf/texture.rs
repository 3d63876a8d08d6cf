//! Reads textures. Each image is decoded once, and keeps the bit depth of its file.

use super::codec::{Compressed, OTHER_SIZE};
use super::document::{Document, get, named};
use super::fault;
use super::isolated;
use crate::error::{Error, ErrorKind, Result};
use crate::texture::{Encoding, Integers, Texels, Texture, TextureRef, Wrap};
use gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use serde::Deserialize;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Cursor;
use std::sync::Arc;

/// Maximum width and height of a texture, in texels.
const MAX_SIDE: u32 = 32_768;
/// Maximum memory for decoding an image, in bytes: 16384 x 16384 RGBA.
const MAX_BYTES: u64 = 1 << 30;

/// How the numbers of an image are interpreted.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Use {
    /// Colours, sRGB-encoded.
    Color,
    /// Linear numbers.
    Data,
    /// Glossiness in the alpha channel (KHR_materials_pbrSpecularGlossiness), converted to roughness in G. The field is
    /// the bits of the f32 factor of glossiness.
    Glossiness(u32),
}

/// Content of `textureInfo` of the specification (section 5.30), with the scale of normal textures.
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

/// Content of the extension KHR_texture_transform.
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
    /// Translation, rotation and scale as one matrix. The rotation is counter-clockwise with v downwards, as in the
    /// extension's text and its example of the lower left quadrant (its column-major GLSL rotates the other way).
    fn matrix(&self) -> [[f32; 3]; 2] {
        let (s, c) = self.rotation.sin_cos();
        let [x, y] = self.scale;
        [[c * x, s * y, self.offset[0]], [-s * x, c * y, self.offset[1]]]
    }
}

/// The textures of a file, loaded when materials need them.
#[derive(Default)]
pub(super) struct Textures {
    /// The textures in use, in the order of their first use.
    pub(super) list: Vec<Texture>,
    /// Index in `list`, by the image, the sampler and the use of the texture.
    known: HashMap<(usize, Option<usize>, Use), u32>,
    /// Decoded images, by their index in the file.
    images: HashMap<usize, Decoded>,
}

/// A decoded image, before its interpretation.
#[derive(Clone)]
struct Decoded {
    width: u32,
    height: u32,
    channels: u8,
    data: Arc<Integers>,
}

impl Textures {
    /// No textures, but the decoded images of `other`.
    pub(super) fn with_images_of(other: &Textures) -> Textures {
        Textures { images: other.images.clone(), ..Textures::default() }
    }

    /// Loads the texture of a `textureInfo`, and returns a reference to it; `place` names it in messages.
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
        let texture = self.load(document, info.index, usage, warnings).map_err(|e| e.within(place))?;
        Ok(TextureRef { texture, set: set as u8, transform: matrix })
    }

    /// Loads the texture with this index in the file, and returns its index in the list of those in use.
    pub(super) fn load(
        &mut self,
        document: &Document,
        index: u32,
        usage: Use,
        warnings: &mut Vec<String>,
    ) -> Result<u32> {
        let texture = get(&document.textures, index as usize, "texture")?;
        let raw = document.part("textures", index as usize);
        let source = source(raw).ok_or_else(|| {
            let other = raw["extensions"].as_object().and_then(|e| e.keys().next());
            let cause = match other {
                Some(name) => format!("texture {index} has only an image of {name}, which cannot be decoded"),
                None => format!("texture {index} has no image"),
            };
            fault("", cause).hint("export the textures as PNG or JPEG")
        })?;
        let key = (source, texture.sampler.map(|s| s.value()), usage);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let Decoded { width, height, channels, data } = self.image(document, source, warnings)?;
        let encoding = match usage {
            Use::Color => Encoding::Srgb,
            Use::Data => Encoding::Linear,
            Use::Glossiness(factor) => Encoding::Glossiness(f32::from_bits(factor)),
        };
        let sampler = match texture.sampler {
            Some(sampler) => get(&document.samplers, sampler.value(), "sampler")?.clone(),
            None => Sampler::default(),
        };
        let described = get(&document.images, source, "image")?;
        let name = texture.name.as_ref().or(described.name.as_ref());
        let made = Texture {
            name: name.filter(|n| !n.is_empty()).cloned().unwrap_or_else(|| format!("texture {index}")),
            width,
            height,
            texels: Texels::Integers { data, channels, encoding },
            wrap: [wrap(&sampler.wrap_s), wrap(&sampler.wrap_t)],
            linear: linear(&sampler),
        };
        let known = self.list.len() as u32;
        self.list.push(made);
        self.known.insert(key, known);
        Ok(known)
    }

    fn image(&mut self, document: &Document, index: usize, warnings: &mut Vec<String>) -> Result<Decoded> {
        if let Some(image) = self.images.get(&index) {
            return Ok(image.clone());
        }
        let image = get(&document.images, index, "image")?;
        let place = named("image", image.name.as_deref(), index);
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => document.bytes_of(uri).map(Cow::Owned),
            (None, Some(view)) => document.view(view.value()).map(Cow::Borrowed),
            (None, None) => Err(fault("", "it has neither a URI nor a buffer view").hint("export the scene again")),
        };
        let decoded = bytes.and_then(|bytes| decode(document, &bytes, &place, warnings));
        let decoded = decoded.map_err(|e| e.within(place))?;
        self.images.insert(index, decoded.clone());
        Ok(decoded)
    }
}

/// Index of the image of a texture: a PNG or JPEG if it has one, which other programs may show instead of a compressed
/// image, else the image of an extension.
fn source(texture: &Value) -> Option<usize> {
    let extensions = ["KHR_texture_basisu", "EXT_texture_webp"].map(|name| &texture["extensions"][name]["source"]);
    let index = |value: &Value| usize::try_from(value.as_u64()?).ok();
    std::iter::once(&texture["source"]).chain(extensions).find_map(index)
}

/// Decodes the first level of a Basis Universal image (ETC1S or UASTC in a KTX2 file).
fn decode_basis(document: &Document, bytes: &[u8]) -> Result<Decoded> {
    let broken = |cause: String| {
        Error::new(ErrorKind::Image, "", format!("it cannot be decoded: {cause}")).hint(
            "decode the textures: gltf-transform ktxdecompress IN.glb OUT.glb, or save the image again as PNG or JPEG",
        )
    };
    // Width and height in the header (KTX 2.0, section 3).
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let (width, height) = word(20).zip(word(24)).ok_or_else(|| broken("its header is cut off".into()))?;
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(broken(format!("{width} x {height} texels are none or too many")));
    }
    let texels = u64::from(width) * u64::from(height);
    document
        .count_bytes(texels.saturating_mul(5), format_args!("{width} x {height} texels"))
        .map_err(|e| e.hint("save the image smaller, or render with more memory"))?;
    let texels = isolated::decode(4 * texels, Compressed::Basis(bytes, (width, height)))?.map_err(broken)?;
    if texels.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err(broken(OTHER_SIZE.into()));
    }
    Ok(Decoded { width, height, channels: 4, data: Arc::new(Integers::Bytes(texels)) })
}

/// The first bytes of a KTX2 file.
const KTX2: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Decodes an image. A truncated JPEG keeps the texels in the file, with a warning.
fn decode(document: &Document, bytes: &[u8], place: &str, warnings: &mut Vec<String>) -> Result<Decoded> {
    const HINT: &str = "save the image again as PNG or JPEG";
    let broken = |cause: String| Error::new(ErrorKind::Image, "", cause).hint(HINT);
    if bytes.starts_with(KTX2) {
        return decode_basis(document, bytes);
    }
    let format = image::guess_format(bytes);
    let Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) = format else {
        return Err(broken("it is neither PNG, JPEG, WebP nor KTX2".into()));
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let truncated = check_size(document, bytes, format)?;
    if format == ImageFormat::WebP {
        return decode_webp(bytes)?.map_err(|cause| broken(format!("it cannot be decoded: {cause}")));
    }
    // A panic of a decoder must not end the program.
    let decoded = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| reader.decode()));
    let decoded = decoded.map_err(|_| broken("it cannot be decoded: the decoder failed".into()))?;
    let image = decoded.map_err(|e| broken(format!("it cannot be decoded: {e}")))?;
    if image.width() == 0 || image.height() == 0 {
        return Err(broken("it has no texels".into()));
    }
    if truncated {
        warnings.push(format!("{place}: the image file is cut off: the missing part is grey (copy it again)"));
    }
    let (width, height, channels) = (image.width(), image.height(), image.color().channel_count());
    let data = match image {
        DynamicImage::ImageLuma8(image) => Integers::Bytes(image.into_raw()),
        DynamicImage::ImageLumaA8(image) => Integers::Bytes(image.into_raw()),
        DynamicImage::ImageRgb8(image) => Integers::Bytes(image.into_raw()),
        DynamicImage::ImageRgba8(image) => Integers::Bytes(image.into_raw()),
        DynamicImage::ImageLuma16(image) => Integers::Words(image.into_raw()),
        DynamicImage::ImageLumaA16(image) => Integers::Words(image.into_raw()),
        DynamicImage::ImageRgb16(image) => Integers::Words(image.into_raw()),
        DynamicImage::ImageRgba16(image) => Integers::Words(image.into_raw()),
        _ => return Err(broken("its texels are neither of 8 nor of 16 bits".into())),
    };
    Ok(Decoded { width, height, channels, data: Arc::new(data) })
}

/// Decodes a WebP image. Its frames repeat the size of the image, which their decoder believes.
fn decode_webp(bytes: &[u8]) -> Result<std::result::Result<Decoded, String>> {
    let size = |bytes| ImageReader::with_format(Cursor::new(bytes), ImageFormat::WebP).into_decoder();
    let (width, height) = match size(bytes) {
        Ok(decoder) => decoder.dimensions(),
        Err(error) => return Ok(Err(error.to_string())),
    };
    if width.max(height) > MAX_SIDE || width.min(height) == 0 {
        return Ok(Err(format!("{width} x {height} texels are none or too many")));
    }
    let texels = u64::from(width) * u64::from(height);
    let decoded = isolated::decode(4 * texels, Compressed::WebP(bytes))?;
    Ok(decoded.and_then(|data| {
        let channels = (data.len() as u64 / texels) as u8;
        let fits = matches!(channels, 3 | 4) && data.len() as u64 == texels * u64::from(channels);
        fits.then(|| Decoded { width, height, channels, data: Arc::new(Integers::Bytes(data)) })
            .ok_or_else(|| OTHER_SIZE.into())
    }))
}

/// Checks that the decoded image fits in memory, because a few bytes can expand to a gigabyte. Returns whether the file
/// of a JPEG is truncated, which its decoder does not report.
fn check_size(document: &Document, bytes: &[u8], format: ImageFormat) -> Result<bool> {
    // The decoder itself rejects invalid and too large images.
    let Ok(decoder) = ImageReader::with_format(Cursor::new(bytes), format).into_decoder() else { return Ok(false) };
    let (width, height) = decoder.dimensions();
    if width > MAX_SIDE || height > MAX_SIDE {
        return Ok(false);
    }
    let mut needed = decoder.total_bytes();
    let jpeg = (format == ImageFormat::Jpeg).then(|| JpegMarkers::scan(bytes));
    if let Some(jpeg) = &jpeg {
        // A block of 8 x 8 texels takes at least one bit; half of a file may be missing.
        let blocks = u64::from(width.div_ceil(8)) * u64::from(height.div_ceil(8));
        if (bytes.len() as u64).saturating_mul(16) < blocks {
            let cause = format!("it is cut off: {} bytes do not hold {width} x {height} texels", bytes.len());
            return Err(Error::new(ErrorKind::Image, "", cause).hint("copy or save the image again"));
        }
        if jpeg.progressive {
            // The decoder keeps 16-bit coefficients of all blocks.
            needed = needed.saturating_mul(3);
        }
    }
    document
        .count_bytes(needed, format_args!("{width} x {height} texels"))
        .map_err(|e| e.hint("save the image smaller, or render with more memory"))?;
    Ok(jpeg.is_some_and(|jpeg| !jpeg.ends))
}

/// Properties of a JPEG file, read from its markers (ITU T.81, annex B).
struct JpegMarkers {
    progressive: bool,
    /// Whether the file has its end marker.
    ends: bool,
}

impl JpegMarkers {
    fn scan(bytes: &[u8]) -> JpegMarkers {
        let mut jpeg = JpegMarkers { progressive: false, ends: false };
        let mut at = 2;
        // A zero byte follows 0xff in entropy-coded data. Restart markers (D0 to D7) have no length.
        let is_marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0x01 | 0xd0..=0xd7 | 0xff);
        while let Some(found) = bytes.get(at..).and_then(|rest| rest.windows(2).position(is_marker)) {
            at += found;
            match bytes[at + 1] {
                0xd9 => return JpegMarkers { ends: true, ..jpeg },
                0xc2 | 0xc6 | 0xca | 0xce => jpeg.progressive = true,
                _ => {}
            }
            let Some(&[high, low]) = bytes.get(at + 2..at + 4) else { break };
            at += 2 + usize::from(u16::from_be_bytes([high, low]));
        }
        jpeg
    }
}

fn wrap(mode: &Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// Whether a texture is filtered linearly. There are no mipmaps, so the magnification filter decides, if the file has
/// one.
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

    /// The example of the extension: the rotated lower left quadrant of the image.
    #[test]
    fn the_transform_of_the_specification_maps_to_the_lower_left_quadrant() {
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
