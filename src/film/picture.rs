//! Pictures in memory: three floats per pixel, and a size.

use crate::stat::floor;
use rayon::prelude::*;
use std::ops::{Deref, DerefMut};

/// Width and height of a picture in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Pixels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Size {
    /// Number of pixels.
    pub fn pixels(self) -> usize {
        self.width * self.height
    }
}

impl From<(u32, u32)> for Size {
    fn from((width, height): (u32, u32)) -> Size {
        Size { width: width as usize, height: height as usize }
    }
}

/// A picture in memory: scene-linear RGB, or a vector such as the normal, at every pixel. Dereferences to the pixels,
/// row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    size: Size,
    pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture from `size.pixels()` pixels, row by row from the top.
    pub fn new(size: Size, pixels: Vec<[f32; 3]>) -> Picture {
        debug_assert_eq!(size.pixels(), pixels.len());
        Picture { size, pixels }
    }

    /// A picture of one colour.
    pub fn filled(size: Size, colour: [f32; 3]) -> Picture {
        Picture::new(size, vec![colour; size.pixels()])
    }

    /// A picture whose pixels are functions of their index, evaluated in parallel.
    pub fn from_fn(size: Size, pixel: impl Fn(usize) -> [f32; 3] + Sync + Send) -> Picture {
        Picture::new(size, (0..size.pixels()).into_par_iter().map(pixel).collect())
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The picture with `function` applied to every channel of every pixel.
    #[must_use]
    pub fn map(&self, function: impl Fn(f32) -> f32 + Sync + Send) -> Picture {
        Picture::from_fn(self.size, |i| self[i].map(&function))
    }

    /// The picture whose channels are `function` of the channels of two pictures of equal size, pixel by pixel.
    #[must_use]
    pub fn zip(&self, other: &Picture, function: impl Fn(f32, f32) -> f32 + Sync + Send) -> Picture {
        Picture::from_fn(self.size, |i| std::array::from_fn(|c| function(self[i][c], other[i][c])))
    }

    /// The mean of two pictures of equal size, pixel by pixel.
    #[must_use]
    pub fn average(&self, other: &Picture) -> Picture {
        self.zip(other, |a, b| 0.5 * (a + b))
    }

    /// Half the absolute difference of two pictures of equal size, by channel: the standard error of their mean, by two
    /// samples.
    #[must_use]
    pub fn half_difference(&self, other: &Picture) -> Picture {
        self.zip(other, |a, b| 0.5 * (a - b).abs())
    }

    /// Whether every value of the picture is zero.
    pub fn is_black(&self) -> bool {
        self.iter().flatten().all(|value| *value == 0.0)
    }

    /// The constant that is added to the squared value of this picture as the reference of relative errors
    /// ([`floor::relative_to_mean`]).
    pub fn relative_floor(&self) -> f64 {
        self.relative_floor_with(0)
    }

    /// The [`Self::relative_floor`] of this picture and this number of black pixels around it.
    pub fn relative_floor_with(&self, black: usize) -> f64 {
        floor::relative_to_mean(self.iter().map(|rgb| channel_mean(*rgb)).chain(std::iter::repeat_n(0.0, black)))
    }
}

impl Deref for Picture {
    type Target = [[f32; 3]];

    fn deref(&self) -> &[[f32; 3]] {
        &self.pixels
    }
}

impl DerefMut for Picture {
    fn deref_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }
}

impl IntoIterator for Picture {
    type Item = [f32; 3];
    type IntoIter = std::vec::IntoIter<[f32; 3]>;

    fn into_iter(self) -> Self::IntoIter {
        self.pixels.into_iter()
    }
}

impl<'a> IntoIterator for &'a Picture {
    type Item = &'a [f32; 3];
    type IntoIter = std::slice::Iter<'a, [f32; 3]>;

    fn into_iter(self) -> Self::IntoIter {
        self.pixels.iter()
    }
}

impl<'a> IntoIterator for &'a mut Picture {
    type Item = &'a mut [f32; 3];
    type IntoIter = std::slice::IterMut<'a, [f32; 3]>;

    fn into_iter(self) -> Self::IntoIter {
        self.pixels.iter_mut()
    }
}

/// Mean of a pixel's three channels.
pub fn channel_mean(pixel: [f32; 3]) -> f64 {
    pixel.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
}
