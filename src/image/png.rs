//! PNG files: 8-bit sRGB.

use std::path::Path;

use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::image::atomic;
use crate::image::tonemap::ToneMap;
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
pub fn encode(Size { width, height }: Size, pixels: impl IntoIterator<Item = Rgb>) -> Result<Vec<u8>> {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let bytes: Vec<u8> = pixels.into_iter().flat_map(|rgb| rgb.to_array().map(byte)).collect();
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok()).filter(|&(w, h)| w > 0 && h > 0);
    let picture = size.and_then(|(w, h)| image::RgbImage::from_raw(w, h, bytes));
    let picture = picture
        .filter(|picture| picture.as_raw().len() == 3 * width * height)
        .ok_or_else(|| Error::new(ErrorKind::Image, "", format!("no picture of {width} x {height} pixels")))?;
    let mut encoded = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut encoded, image::ImageFormat::Png).map_err(|cause| Error::new(ErrorKind::Image, "", cause))?;
    Ok(encoded.into_inner())
}

/// Writes a scene-linear Rec. 709 picture after an exposure of `ev` stops and a tone curve, see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_tonemapped(path: &Path, picture: &Picture, ev: f32, curve: ToneMap) -> Result<()> {
    write(path, picture.size(), picture.iter().map(|&rgb| curve.display(rgb.into(), ev)))
}
