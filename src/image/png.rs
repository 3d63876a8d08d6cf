//! PNG files: 8-bit sRGB.

use std::path::Path;

use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::image::atomic;
use crate::image::tonemap::Look;
use crate::math::Rgb;

/// Writes `pixels`, display values from 0 to 1, row by row from the top, as an 8-bit RGB PNG, atomically (see
/// [`atomic::write`]). NaN becomes black.
///
/// # Errors
/// The number of pixels is zero or not that of `size`; errors of the file system.
pub fn write(path: &Path, size: Size, pixels: impl IntoIterator<Item = Rgb>) -> Result<()> {
    let bytes = encode(size, pixels).map_err(|error| error.within(path.display()))?;
    atomic::write_bytes(path, &bytes)
}

/// The bytes of the PNG that [`write()`] writes.
///
/// # Errors
/// The number of pixels is zero or not that of the size.
pub fn encode(size: Size, pixels: impl IntoIterator<Item = Rgb>) -> Result<Vec<u8>> {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let bytes: Vec<u8> = pixels.into_iter().flat_map(|rgb| rgb.to_array().map(byte)).collect();
    encode_bytes::<image::Rgb<u8>>(size, bytes, 3 * size.width * size.height)
}

/// The PNG of the bytes of pixels. `length`: the number of bytes that pictures of this size have.
fn encode_bytes<P>(Size { width, height }: Size, bytes: Vec<u8>, length: usize) -> Result<Vec<u8>>
where
    P: image::Pixel<Subpixel = u8> + image::PixelWithColorType,
{
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok()).filter(|&(w, h)| w > 0 && h > 0);
    let picture = size.and_then(|(w, h)| image::ImageBuffer::<P, _>::from_raw(w, h, bytes));
    let picture = picture
        .filter(|picture| picture.as_raw().len() == length)
        .ok_or_else(|| Error::new(ErrorKind::Image, "", format!("no picture of {width} x {height} pixels")))?;
    let mut encoded = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut encoded, image::ImageFormat::Png).map_err(|cause| Error::new(ErrorKind::Image, "", cause))?;
    Ok(encoded.into_inner())
}

/// Writes a scene-linear Rec. 709 picture with a transparent background under a look. Colours are multiplied by `alpha`, as in an EXR; those of the PNG are not.
///
/// # Errors
/// The number of pixels is zero or not that of `alpha`; errors of the file system.
pub fn write_transparent(path: &Path, picture: &Picture, alpha: &[f32], look: Look) -> Result<()> {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let pixel = |(&rgb, &alpha): (&[f32; 3], &f32)| {
        let color = look.display(Rgb::from_array(rgb) / if alpha > 0.0 { alpha } else { 1.0 });
        color.to_array().into_iter().chain([alpha]).map(byte).collect::<Vec<u8>>()
    };
    let bytes = picture.iter().zip(alpha).flat_map(pixel).collect();
    let Size { width, height } = picture.size();
    let encoded = encode_bytes::<image::Rgba<u8>>(picture.size(), bytes, 4 * width * height);
    atomic::write_bytes(path, &encoded.map_err(|error| error.within(path.display()))?)
}

/// Writes a scene-linear Rec. 709 picture under a look, see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_tonemapped(path: &Path, picture: &Picture, look: Look) -> Result<()> {
    write(path, picture.size(), picture.iter().map(|&rgb| look.display(rgb.into())))
}

/// The bytes of the PNG that [`write_tonemapped()`] writes.
///
/// # Errors
/// The picture has no pixels.
pub fn encode_tonemapped(picture: &Picture, look: Look) -> Result<Vec<u8>> {
    encode(picture.size(), picture.iter().map(|&rgb| look.display(rgb.into())))
}
