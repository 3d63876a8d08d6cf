//! Image textures as glTF defines them.

use crate::math::{DVec4, Vec2, Vec4};
use std::sync::{Arc, LazyLock};

/// How a coordinate outside `[0, 1)` is folded back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Repeat, every second tile mirrored.
    Mirror,
    /// Clamp to the edge.
    Clamp,
}

/// Texels of an image, top row first.
#[derive(Clone, Debug)]
pub enum Texels {
    /// Integers as their file has them, which textures of one image share.
    Integers {
        /// `width * height * channels` of them.
        data: Arc<Integers>,
        /// 1: grey, 2: grey and alpha, 3: RGB, 4: RGBA.
        channels: u8,
        /// What they stand for.
        encoding: Encoding,
    },
    /// Linear RGBA floats.
    Floats(Vec<[f32; 4]>),
}

/// Channels of texels.
#[derive(Clone, Debug)]
pub enum Integers {
    /// 8 bits a channel.
    Bytes(Vec<u8>),
    /// 16 bits a channel.
    Words(Vec<u16>),
}

/// What integers of texels stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    /// Numbers from 0 to 1.
    Linear,
    /// Colours encoded by sRGB; alpha is linear.
    Srgb,
    /// Glossiness in the alpha channel, 8 bits of it, times a factor: G becomes the roughness, R 0, B and A 1.
    Glossiness(f32),
}

/// An image with its wrap and filter modes.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// The texels.
    pub texels: Texels,
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// Bilinear filtering; otherwise the nearest texel.
    pub linear: bool,
}

/// A use of a texture: which image, which UV set, and KHR_texture_transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the scene's textures.
    pub texture: u32,
    /// UV set, 0 or 1.
    pub set: u8,
    /// Row-major 2x3 affine transform of (u, v).
    pub transform: [[f32; 3]; 2],
}

impl TextureRef {
    /// The transformed coordinates.
    #[inline]
    pub fn coordinates(&self, uv: [Vec2; 2]) -> Vec2 {
        let p = uv[usize::from(self.set & 1)];
        let [a, b] = self.transform;
        Vec2::new(a[0] * p.x + a[1] * p.y + a[2], b[0] * p.x + b[1] * p.y + b[2])
    }
}

/// Linear values of the 256 bytes of sRGB (IEC 61966-2-1).
static SRGB_BYTES: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let c = i as f64 / 255.0;
        (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Linear values of the 65,536 words of sRGB, in images of colours and of greys.
static SRGB_WORDS: LazyLock<[Box<[f32]>; 2]> = LazyLock::new(|| {
    let linear = |i: u16, grey: bool| {
        let c = unit_word(i, grey);
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    [false, true].map(|grey| (0..=u16::MAX).map(|i| linear(i, grey)).collect())
});

/// A word from 0 to 1; greys are rounded twice, as the `image` crate converts them.
#[inline]
fn unit_word(word: u16, grey: bool) -> f32 {
    if grey { f32::from(word) * (1.0 / 65535.0) } else { f32::from(word) / 65535.0 }
}

/// A texel's channels as RGBA.
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
    /// Linear RGBA of the texel at an index.
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

fn roughness(gloss: u8, factor: f32) -> Vec4 {
    Vec4::new(0.0, (255.0 - factor * f32::from(gloss)) / 255.0, 1.0, 1.0)
}

impl Texels {
    /// Linear RGBA of the texel at an index.
    #[inline]
    pub fn at(&self, index: usize) -> Vec4 {
        match self {
            Texels::Floats(data) => Vec4::from_array(data[index]),
            Texels::Integers { data, channels, encoding } => data.decode(index, *channels, *encoding),
        }
    }
}

impl Wrap {
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
    /// Whether some texel's alpha is below 1.
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

    /// Linear RGBA at (u, v); v runs downwards from the top row, as in glTF. Coordinates that are not finite read texel
    /// 0.
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
