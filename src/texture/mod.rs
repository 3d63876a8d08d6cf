//! Image textures as glTF defines them.

use crate::math::{DVec4, Vec2, Vec4};
use std::sync::{Arc, LazyLock};

/// How texture coordinates outside `[0, 1)` are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Repeats the image.
    #[default]
    Repeat,
    /// Repeats the image and mirrors every second copy.
    Mirror,
    /// Extends the edge texels.
    Clamp,
}

/// Texels of an image, top row first.
#[derive(Clone, Debug)]
pub enum Texels {
    /// Texels as the integers of the image file. Textures of one image share them.
    Integers {
        /// `width * height * channels` integers.
        data: Arc<Integers>,
        /// Number of channels: 1 is grey, 2 grey and alpha, 3 RGB, 4 RGBA.
        channels: u8,
        /// How the integers are converted to linear values.
        encoding: Encoding,
    },
    /// Texels as linear RGBA floats.
    Floats(Vec<[f32; 4]>),
}

/// Channels of texels as integers, one after the other.
#[derive(Clone, Debug)]
pub enum Integers {
    /// 8 bits per channel.
    Bytes(Vec<u8>),
    /// 16 bits per channel.
    Words(Vec<u16>),
}

/// How the integers of a texel are converted to linear values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    /// The largest integer means 1, and values are linear.
    Linear,
    /// sRGB-encoded colours and linear alpha.
    Srgb,
    /// Glossiness in alpha (8 bits), multiplied by this factor. A lookup returns 1 - glossiness in G, 0 in R, and 1 in
    /// B and A.
    Glossiness(f32),
}

/// An image with its wrap and filter modes.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name of the texture for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// The texels of the image, top row first.
    pub texels: Texels,
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// Whether lookups filter bilinearly. If not, they take the nearest texel.
    pub linear: bool,
}

/// A reference to a texture, with its set of texture coordinates and their transform (KHR_texture_transform).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index of the texture in the scene's textures.
    pub texture: u32,
    /// Index of the set of texture coordinates, 0 or 1.
    pub set: u8,
    /// Row-major 2x3 affine transform of (u, v).
    pub transform: [[f32; 3]; 2],
}

impl TextureRef {
    /// The transformed texture coordinates for a lookup; `uv` has the coordinates of both sets.
    #[inline]
    pub fn coordinates(&self, uv: [Vec2; 2]) -> Vec2 {
        let p = uv[usize::from(self.set & 1)];
        let [a, b] = self.transform;
        Vec2::new(a[0] * p.x + a[1] * p.y + a[2], b[0] * p.x + b[1] * p.y + b[2])
    }
}

/// Linear value of each 8-bit sRGB value (IEC 61966-2-1).
static SRGB_BYTES: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let c = i as f64 / 255.0;
        (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Linear value of each 16-bit sRGB value: in colour images, and in grey images.
static SRGB_WORDS: LazyLock<[Box<[f32]>; 2]> = LazyLock::new(|| {
    let linear = |i: u16, grey: bool| {
        let c = unit_word(i, grey);
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    [false, true].map(|grey| (0..=u16::MAX).map(|i| linear(i, grey)).collect())
});

/// Converts a 16-bit value to `[0, 1]`. Values of grey images are rounded twice, as in the `image` crate.
#[inline]
fn unit_word(word: u16, grey: bool) -> f32 {
    if grey { f32::from(word) * (1.0 / 65535.0) } else { f32::from(word) / 65535.0 }
}

/// Red, green, blue and alpha of a texel of 1 to 4 channels. `opaque` is the alpha of texels without one.
#[inline]
fn rgba<T: Copy>(texel: &[T], opaque: T) -> [T; 4] {
    match *texel {
        [l] => [l, l, l, opaque],
        [l, a] => [l, l, l, a],
        [r, g, b] => [r, g, b, opaque],
        [r, g, b, a, ..] => [r, g, b, a],
        [] => [opaque; 4],
    }
}

impl Integers {
    /// Linear RGBA of the texel at a row-major index.
    #[inline]
    fn decode(&self, index: usize, channels: u8, encoding: Encoding) -> Vec4 {
        let range = index * usize::from(channels)..(index + 1) * usize::from(channels);
        match (self, encoding) {
            (Integers::Bytes(data), Encoding::Srgb) => {
                let ([r, g, b, a], table) = (rgba(&data[range], 255), &*SRGB_BYTES);
                Vec4::new(table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0)
            }
            (Integers::Bytes(data), Encoding::Linear) => Vec4::from(rgba(&data[range], 255).map(f32::from)) / 255.0,
            (Integers::Bytes(data), Encoding::Glossiness(factor)) => roughness(rgba(&data[range], 255)[3], factor),
            (Integers::Words(data), Encoding::Srgb) => {
                let grey = channels < 3;
                let ([r, g, b, a], table) = (rgba(&data[range], u16::MAX), &SRGB_WORDS[usize::from(grey)]);
                Vec4::new(table[r as usize], table[g as usize], table[b as usize], unit_word(a, grey))
            }
            (Integers::Words(data), Encoding::Linear) => {
                Vec4::from(rgba(&data[range], u16::MAX).map(|x| unit_word(x, channels < 3)))
            }
            (Integers::Words(data), Encoding::Glossiness(factor)) => {
                let gloss = (u32::from(rgba(&data[range], u16::MAX)[3]) + 128) / 257;
                roughness(gloss as u8, factor)
            }
        }
    }
}

/// Linear RGBA of a texel with [`Encoding::Glossiness`] from its glossiness `gloss` (8 bits).
fn roughness(gloss: u8, factor: f32) -> Vec4 {
    Vec4::new(0.0, (255.0 - factor * f32::from(gloss)) / 255.0, 1.0, 1.0)
}

impl Texels {
    /// Linear RGBA of the texel at a row-major index.
    #[inline]
    pub fn at(&self, index: usize) -> Vec4 {
        match self {
            Texels::Floats(data) => Vec4::from_array(data[index]),
            Texels::Integers { data, channels, encoding } => data.decode(index, *channels, *encoding),
        }
    }
}

impl Wrap {
    /// The texel index in `0..size` for an index outside of the image.
    #[inline]
    fn fold(self, i: i64, size: i64) -> usize {
        (match self {
            Wrap::Repeat => i.rem_euclid(size),
            Wrap::Clamp => i.clamp(0, size - 1),
            Wrap::Mirror => {
                let k = i.rem_euclid(2 * size);
                if k < size { k } else { 2 * size - 1 - k }
            }
        }) as usize
    }
}

impl Texture {
    /// Whether any texel has an alpha below 1.
    pub fn has_alpha(&self) -> bool {
        (0..self.width as usize * self.height as usize).any(|index| self.texels.at(index).w < 1.0)
    }

    #[inline]
    fn texel(&self, x: i64, y: i64) -> Vec4 {
        let x = self.wrap[0].fold(x, i64::from(self.width));
        let y = self.wrap[1].fold(y, i64::from(self.height));
        self.texels.at(y * self.width as usize + x)
    }

    /// Mean of all texels, linear RGBA.
    pub fn mean(&self) -> Vec4 {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let sum = texels.fold(DVec4::ZERO, |sum, (x, y)| sum + self.texel(x, y).as_dvec4());
        (sum / (width * height) as f64).as_vec4()
    }

    /// Linear RGBA at (u, v), where v = 0 is the top row, as in glTF. Coordinates that are not finite return the first
    /// texel.
    #[inline]
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        if !uv.is_finite() {
            return self.texel(0, 0);
        }
        let x = uv.x * self.width as f32;
        let y = uv.y * self.height as f32;
        if !self.linear {
            return self.texel(x.floor() as i64, y.floor() as i64);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x.floor(), y.floor());
        let (ix, iy) = (fx as i64, fy as i64);
        let (tx, ty) = (x - fx, y - fy);
        let top = self.texel(ix, iy).lerp(self.texel(ix + 1, iy), tx);
        let bottom = self.texel(ix, iy + 1).lerp(self.texel(ix + 1, iy + 1), tx);
        top.lerp(bottom, ty)
    }
}
