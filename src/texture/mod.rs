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
    /// Linear RGBA of the texels at row-major indices. All are decoded alike, so the format is looked at once.
    #[inline]
    fn decode<const N: usize>(&self, indices: [usize; N], channels: u8, encoding: Encoding) -> [Vec4; N] {
        let range = |index: usize| index * usize::from(channels)..(index + 1) * usize::from(channels);
        match (self, encoding) {
            (Integers::Bytes(data), Encoding::Srgb) => {
                let table = &*SRGB_BYTES;
                indices.map(|index| {
                    let [r, g, b, a] = rgba(&data[range(index)], 255);
                    Vec4::new(table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0)
                })
            }
            (Integers::Bytes(data), Encoding::Linear) => {
                indices.map(|index| Vec4::from(rgba(&data[range(index)], 255).map(f32::from)) / 255.0)
            }
            (Integers::Bytes(data), Encoding::Glossiness(factor)) => {
                indices.map(|index| roughness(rgba(&data[range(index)], 255)[3], factor))
            }
            (Integers::Words(data), Encoding::Srgb) => {
                let (grey, table) = (channels < 3, &SRGB_WORDS[usize::from(channels < 3)]);
                indices.map(|index| {
                    let [r, g, b, a] = rgba(&data[range(index)], u16::MAX);
                    Vec4::new(table[r as usize], table[g as usize], table[b as usize], unit_word(a, grey))
                })
            }
            (Integers::Words(data), Encoding::Linear) => {
                indices.map(|index| Vec4::from(rgba(&data[range(index)], u16::MAX).map(|x| unit_word(x, channels < 3))))
            }
            (Integers::Words(data), Encoding::Glossiness(factor)) => indices.map(|index| {
                let gloss = (u32::from(rgba(&data[range(index)], u16::MAX)[3]) + 128) / 257;
                roughness(gloss as u8, factor)
            }),
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
        let [texel] = self.all([index]);
        texel
    }

    /// Linear RGBA of the texels at row-major indices.
    #[inline]
    fn all<const N: usize>(&self, indices: [usize; N]) -> [Vec4; N] {
        match self {
            Texels::Floats(data) => indices.map(|index| Vec4::from_array(data[index])),
            Texels::Integers { data, channels, encoding } => data.decode(indices, *channels, *encoding),
        }
    }
}

impl Wrap {
    /// The texel index in `0..size` for any index. Divisions are slow, and most indices are inside the image.
    #[inline]
    fn fold(self, i: i64, size: i64) -> usize {
        if (0..size).contains(&i) { i as usize } else { self.fold_outside(i, size) }
    }

    fn fold_outside(self, i: i64, size: i64) -> usize {
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
        let [left, right] = [ix, ix + 1].map(|x| self.wrap[0].fold(x, i64::from(self.width)));
        let [top, bottom] = [iy, iy + 1].map(|y| self.wrap[1].fold(y, i64::from(self.height)) * self.width as usize);
        let texels = self.texels.all([top + left, top + right, bottom + left, bottom + right]);
        let [top_left, top_right, bottom_left, bottom_right] = texels;
        top_left.lerp(top_right, tx).lerp(bottom_left.lerp(bottom_right, tx), ty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The index of an image, of the image and its mirror image, or of the nearest edge.
    #[test]
    fn indices_outside_of_the_image_are_folded() {
        for size in [1i64, 2, 5] {
            for i in -3 * size..4 * size {
                let (repeated, doubled) = ((i + 12 * size) % size, (i + 12 * size) % (2 * size));
                let fold = |wrap: Wrap| wrap.fold(i, size) as i64;
                assert_eq!(fold(Wrap::Repeat), repeated);
                assert_eq!(fold(Wrap::Mirror), if doubled < size { doubled } else { 2 * size - 1 - doubled });
                assert_eq!(fold(Wrap::Clamp), i.max(0).min(size - 1));
            }
        }
    }

    /// A lookup at every format and position between texels is the bilinear mean of the four texels around.
    #[test]
    fn lookups_interpolate_the_texels_around() {
        let (width, height, count) = (5u32, 3u32, 60);
        let bytes = Integers::Bytes((0..count).map(|i| (i * 37 % 256) as u8).collect());
        let words = Integers::Words((0..count).map(|i| (i * 7919 % 65536) as u16).collect());
        let encodings = [Encoding::Linear, Encoding::Srgb, Encoding::Glossiness(0.8)];
        let formats = [bytes, words].into_iter().flat_map(|data| {
            let data = Arc::new(data);
            encodings.map(|encoding| Texels::Integers { data: Arc::clone(&data), channels: 4, encoding })
        });
        let floats = Texels::Floats((0..15).map(|i| [i as f32, 1.0, 0.5 * i as f32, 1.0]).collect());
        for texels in formats.chain([floats]) {
            let wrap = [Wrap::Repeat, Wrap::Mirror];
            let texture = Texture { name: String::new(), width, height, texels, wrap, linear: true };
            for (x, y) in (-11..20).flat_map(|x| (-7..13).map(move |y| (x, y))) {
                let (tx, ty) = (0.25, 0.5);
                let centre = Vec2::new((x as f32 + 0.5 + tx) / width as f32, (y as f32 + 0.5 + ty) / height as f32);
                let row = |y: i64| texture.texel(x, y) * (1.0 - tx) + texture.texel(x + 1, y) * tx;
                let expected = row(y) * (1.0 - ty) + row(y + 1) * ty;
                assert!((texture.sample(centre) - expected).abs().max_element() < 1e-4, "{x} {y} {:?}", texture.texels);
            }
        }
    }
}
