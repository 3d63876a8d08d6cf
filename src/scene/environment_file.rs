//! Reading environment images: latitude-longitude OpenEXR and Radiance HDR files.

use super::description::EnvironmentSource;
use crate::error::{Error, ErrorKind, Result};
use crate::git_lfs;
use crate::math::Vec3;
use crate::memory;
use crate::spectrum::primaries::to_rec_709;
use exr::prelude::{ReadChannels, ReadLayers};
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Maximum number of texels of an environment image: 16384 x 8192, 1.5 GiB.
const MAX_TEXELS: u64 = 1 << 27;
/// Memory per texel of an environment image in bytes, with its sampling distribution.
const TEXEL_BYTES: u64 = 32;
/// Value that replaces an infinite texel: the largest half float, beyond which images overflow to infinity.
const MAX_HALF: f32 = 65_504.0;

/// A decoded image: width, height, and RGB texels with the top row first.
type Pixels = (u32, u32, Vec<[f32; 3]>);

/// Reads the radiance of an environment from an OpenEXR or Radiance HDR file, recognised by its first bytes. An OpenEXR
/// file with other chromaticities in its header is converted to Rec. 709. Texels that are negative or not finite are clamped, with a warning.
///
/// # Errors
/// The file cannot be opened, is in another format, is damaged, or is too large.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<EnvironmentSource> {
    let io = |e: std::io::Error| Error::io(path, &e).hint("check the path of the environment image");
    let meta = std::fs::metadata(path).map_err(io)?;
    if !meta.is_file() {
        return Err(io(std::io::Error::other("it is not a regular file")));
    }
    git_lfs::check_file(path)?;
    let mut start = Vec::new();
    std::io::Read::read_to_end(&mut std::io::Read::take(File::open(path).map_err(io)?, 10), &mut start).map_err(io)?;
    let failed = |cause: String| {
        Error::new(ErrorKind::Image, path.display(), cause)
            .hint("save the environment as a latitude-longitude OpenEXR or Radiance HDR image")
    };
    let decode: fn(&Path) -> std::result::Result<Pixels, String> = match start.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => read_exr,
        [b'#', b'?', ..] => read_hdr,
        _ => return Err(failed("it is neither OpenEXR nor Radiance HDR".into())),
    };
    // A panic of a decoder must not end the program.
    let pixels = catch_unwind(AssertUnwindSafe(|| decode(path))).unwrap_or_else(|_| Err("the decoder failed".into()));
    let (width, height, mut texels) = pixels.map_err(|e| failed(format!("it cannot be read: {e}")))?;
    let clamped = clamp(&mut texels);
    if clamped > 0 {
        warnings.push(format!("{}: {clamped} texels are negative or not finite and are clamped", path.display()));
    }
    Ok(EnvironmentSource::Image { width, height, texels })
}

/// Replaces texels that are negative or not finite. Returns the number of texels that changed.
fn clamp(texels: &mut [[f32; 3]]) -> usize {
    let mut count = 0;
    for texel in texels {
        // `max` turns NaN into 0.
        let clamped = texel.map(|x| if x == f32::INFINITY { MAX_HALF } else { x.max(0.0) });
        count += usize::from(clamped != *texel);
        *texel = clamped;
    }
    count
}

fn check_size(width: u64, height: u64) -> std::result::Result<(), String> {
    match width.checked_mul(height) {
        Some(texels @ 1..=MAX_TEXELS) => memory::require(TEXEL_BYTES * texels, "its texels").map_err(|e| e.cause),
        _ => Err(format!("{width} x {height} texels are none or too many")),
    }
}

fn read_exr(path: &Path) -> std::result::Result<Pixels, String> {
    let text = |e: exr::error::Error| e.to_string();
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(text)?;
    let length = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    for header in &meta.headers {
        let texels = (header.layer_size.width() as u64).saturating_mul(header.layer_size.height() as u64);
        if texels > length.saturating_mul(memory::MAX_EXR_RATIO) {
            return Err("it has more texels than the file can hold".into());
        }
        check_size(header.layer_size.width() as u64, header.layer_size.height() as u64)?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0f32; 3]; size.width() * size.height()]),
            |(width, texels), at, (r, g, b): (f32, f32, f32)| texels[at.y() * *width + at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        // A panic in a thread of the decoder could not be caught.
        .non_parallel()
        .from_file(path)
        .map_err(text)?;
    let size = image.layer_data.size;
    let mut texels = image.layer_data.channel_data.pixels.1;
    if let Some(matrix) = image.attributes.chromaticities.as_ref().and_then(to_rec_709) {
        for texel in &mut texels {
            *texel = (matrix * Vec3::from_array(*texel).as_dvec3()).as_vec3().to_array();
        }
    }
    Ok((size.width() as u32, size.height() as u32, texels))
}

fn read_hdr(path: &Path) -> std::result::Result<Pixels, String> {
    let mut file = BufReader::new(File::open(path).map_err(|e| e.to_string())?);
    // Other programs than Radiance write other names, such as #?RGBE, which the strict decoder refuses.
    let by_radiance = file.fill_buf().map_err(|e| e.to_string())?.starts_with(b"#?RADIANCE");
    let decoder = HdrDecoder::with_strictness(file, by_radiance).map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height))?;
    let mut texels = vec![[0.0f32; 3]; width as usize * height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut texels)).map_err(|e| e.to_string())?;
    Ok((width, height, texels))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiance files of other programs start with other names.
    #[test]
    fn radiance_files_of_other_programs_are_read() {
        let temporary = tempfile::tempdir().expect("a folder");
        let path = temporary.path().join("sky.hdr");
        for program in ["RADIANCE", "RGBE", "any"] {
            let head = format!("#?{program}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n");
            let texels = [128u8, 128, 128, 129, 64, 64, 64, 129];
            std::fs::write(&path, [head.as_bytes(), &texels].concat()).expect("it can be written");
            let EnvironmentSource::Image { width: 2, height: 1, texels } =
                read(&path, &mut Vec::new()).unwrap_or_else(|error| panic!("{program}: {error}"))
            else {
                panic!("{program}: it is an image of two texels")
            };
            assert!(texels[0][0] == 2.0 * texels[1][0] && (texels[0][0] - 1.0).abs() < 0.01, "{program}: {texels:?}");
        }
    }
}
