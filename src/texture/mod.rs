//! Image textures as glTF defines them.

use crate::math::{DVec4, Vec2, Vec4};

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

/// Texels of an image, decoded to 8 bits (sRGB or linear) or to floats.
#[derive(Clone, Debug)]
pub enum Texels {
    /// RGBA, 8 bits per channel; `srgb`: colour channels are sRGB-encoded.
    Bytes {
        /// `width * height * 4` bytes, top row first.
        data: Vec<u8>,
        /// Whether colour channels are sRGB-encoded.
        srgb: bool,
    },
    /// Linear RGBA floats.
    Floats(Vec<[f32; 4]>),
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

/// sRGB byte to linear, all 256 of them.
fn srgb_table() -> &'static [f32; 256] {
    static TABLE: std::sync::LazyLock<[f32; 256]> = std::sync::LazyLock::new(|| {
        std::array::from_fn(|i| {
            let c = i as f64 / 255.0;
            (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
        })
    });
    &TABLE
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
    #[inline]
    fn texel(&self, x: i64, y: i64) -> Vec4 {
        let x = self.wrap[0].fold(x, i64::from(self.width));
        let y = self.wrap[1].fold(y, i64::from(self.height));
        let i = y * self.width as usize + x;
        match &self.texels {
            Texels::Floats(data) => Vec4::from_array(data[i]),
            Texels::Bytes { data, srgb } => {
                let t = &data[4 * i..4 * i + 4];
                if *srgb {
                    let table = srgb_table();
                    Vec4::new(table[t[0] as usize], table[t[1] as usize], table[t[2] as usize], f32::from(t[3]) / 255.0)
                } else {
                    Vec4::new(f32::from(t[0]), f32::from(t[1]), f32::from(t[2]), f32::from(t[3])) / 255.0
                }
            }
        }
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
