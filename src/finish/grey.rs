//! Pixels without colour. Open Image Denoise mixes the channels and tints grey pictures: single pixels by 9/255 after 8
//! iterations.

use super::bound::REACH;
use super::estimate::ROUNDING;
use super::window::window;
use crate::film::{Picture, channel_mean};
use rayon::prelude::*;

/// Makes a pixel of a denoised picture grey if all pixels around it are grey in the estimate `mean`.
pub fn keep_grey(denoised: &mut Picture, mean: &Picture) {
    let size = mean.size();
    let has_color = |rgb: &[f32; 3]| {
        let most = rgb.iter().copied().fold(0.0, f32::max);
        rgb.iter().any(|value| (value - rgb[0]).abs() > ROUNDING * most)
    };
    let colored: Vec<bool> = mean.par_iter().map(has_color).collect();
    denoised.par_iter_mut().enumerate().for_each(|(index, rgb)| {
        if !window(size, index, REACH).any(|around| colored[around]) {
            *rgb = [channel_mean(*rgb) as f32; 3];
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;

    /// Grey estimates give grey pixels of equal brightness; pixels near a coloured one keep their colours.
    #[test]
    fn only_pixels_far_from_any_color_are_grey() {
        let size = Size { width: 40, height: 3 };
        let column = 5;
        let mean = Picture::from_fn(size, |i| if i % size.width == column { [0.5, 0.5, 0.6] } else { [0.3; 3] });
        let mut denoised = Picture::filled(size, [0.2, 0.3, 0.4]);
        keep_grey(&mut denoised, &mean);
        for (i, rgb) in denoised.iter().enumerate() {
            let near = (i % size.width).abs_diff(column) <= REACH;
            assert_eq!(*rgb, if near { [0.2, 0.3, 0.4] } else { [0.3; 3] }, "pixel {i}");
        }
    }
}
