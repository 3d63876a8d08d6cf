//! Inputs of materials: factors, and textures that multiply them.

use super::evaluate::{look_up, unit, unit_color};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec4};
use crate::texture::{Texture, TextureRef};

/// A property of a material: a factor, and a texture that multiplies it. A number is in the given channel of the
/// texture; a colour is in the first three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input<T, const CHANNEL: usize = 0> {
    /// The value where the texture is 1, or everywhere without a texture.
    pub factor: T,
    /// The texture that multiplies the factor.
    pub texture: Option<TextureRef>,
}

impl<T, const CHANNEL: usize> From<T> for Input<T, CHANNEL> {
    fn from(factor: T) -> Self {
        Input { factor, texture: None }
    }
}

impl<T, const CHANNEL: usize> Input<T, CHANNEL> {
    /// The texel at a surface point; 1 in all channels without a texture.
    #[inline]
    pub(super) fn texel(&self, surface: &Surface, textures: &[Texture]) -> Vec4 {
        look_up(&self.texture, surface, textures)
    }
}

impl<const CHANNEL: usize> Input<f32, CHANNEL> {
    /// The value at a surface point, 0 to 1.
    #[inline]
    pub(super) fn at(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        let factor = unit(self.factor);
        if factor > 0.0 && self.texture.is_some() {
            factor * unit(self.texel(surface, textures)[CHANNEL])
        } else {
            factor
        }
    }
}

impl Input<Rgb> {
    /// The colour at a surface point, each channel 0 to 1.
    #[inline]
    pub(super) fn at(&self, surface: &Surface, textures: &[Texture]) -> Rgb {
        unit_color(self.factor) * unit_color(self.texel(surface, textures).truncate())
    }
}

/// An input of any type.
pub(super) trait AnyInput {
    fn texture(&self) -> &Option<TextureRef>;

    fn texture_mut(&mut self) -> &mut Option<TextureRef>;

    /// Multiplies the factor by a texel, the mean of the texture.
    fn multiply(&mut self, texel: Vec4);
}

/// Implements [`AnyInput`] for the inputs of a type, given the product of a factor and a texel.
macro_rules! any_input {
    ([$($channel:tt)*] $kind:ty, $product:expr) => {
        impl<$($channel)*> AnyInput for $kind {
            fn texture(&self) -> &Option<TextureRef> {
                &self.texture
            }

            fn texture_mut(&mut self) -> &mut Option<TextureRef> {
                &mut self.texture
            }

            fn multiply(&mut self, texel: Vec4) {
                self.factor = $product(self.factor, texel);
            }
        }
    };
}

any_input!([const CHANNEL: usize] Input<f32, CHANNEL>, |factor: f32, texel: Vec4| factor * texel[CHANNEL]);
any_input!([] Input<Rgb>, |factor: Rgb, texel: Vec4| factor * texel.truncate());
// A thickness where the texture is 0, and one where it is 1.
any_input!([] Input<[f32; 2], 1>, |[thin, thick]: [f32; 2], texel: Vec4| [thin + (thick - thin) * texel.y; 2]);
