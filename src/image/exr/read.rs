//! Reads any flat EXR into layers.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Compression, IntegerBounds, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::f16;
use rayon::prelude::*;

use super::colour_space::convert_to_rec_709;
use super::{ATTRIBUTE, Attributes, Frame, Moment, zip};
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::film::{Layer, LayerSet, Plane, Sample, Size};
use crate::git_lfs;
use crate::image::Windowed;
use crate::memory;

/// Reads every channel of every part of an EXR as layers, and the string attributes of all parts.
///
/// The picture is the display window: pixels outside a part's data window are zero, pixels outside the display window are
/// dropped. Samples of type half and uint become `f32` (uint above 2^24 is rounded). The full resolution of tiled files
/// with mip maps is read. A channel `a.b.C` is the component `C` of the layer `a.b`; root channels `R G B A` (or `Y`) are
/// the layer with the empty name, any other root channel `Q` is the layer `Q` with the component `Q`. In a file of several
/// parts the part's name is prefixed to channels that do not contain it; only root channels of the first part stay at the
/// root. Pictures are converted to linear Rec. 709 from the chromaticities that the header declares. Never panics.
///
/// # Errors
/// The file cannot be opened, is malformed, deep or subsampled, or declares more pixels than its length can hold.
pub fn read(path: &Path) -> Result<(LayerSet, Attributes)> {
    read_layers(path, |_| true)
}

/// [`read()`] of the layers alone whose names `wanted` accepts. The others take no memory.
///
/// # Errors
/// As for [`read()`].
pub fn read_layers(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<(LayerSet, Attributes)> {
    open(path, |file, length| {
        decode(file, length, &wanted, Extent::Display).map(|(windowed, attributes)| (windowed.set, attributes))
    })
}

/// [`read_layers()`] within the data window alone if the file is a render of this program, which has one data window: what
/// is written again keeps it. Other programs crop each frame to what it shows.
///
/// # Errors
/// As for [`read()`].
pub fn read_render(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<(LayerSet, Attributes)> {
    open(path, |file, length| {
        decode(file, length, &wanted, Extent::OwnData).map(|(windowed, attributes)| (windowed.set, attributes))
    })
}

/// [`read()`] with the layers within the data windows alone, outside which the picture is black.
///
/// # Errors
/// As for [`read()`].
pub fn read_window(path: &Path) -> Result<(Windowed, Attributes)> {
    open(path, |file, length| decode(file, length, &|_| true, Extent::Data))
}

/// The part of a picture that is read.
#[derive(Clone, Copy, PartialEq)]
enum Extent {
    /// The display window.
    Display,
    /// The part of the display window in which a part of the file has data.
    Data,
    /// As `Data` in renders of this program, as `Display` in other files.
    OwnData,
}

impl Extent {
    /// The bounds in the coordinates of the file. Without data, one pixel.
    fn bounds(self, headers: &[Header]) -> Outcome<IntegerBounds> {
        let display = headers.first().ok_or_else(|| invalid("no part"))?.shared_attributes.display_window;
        let is_own = || texts(headers).contains_key(ATTRIBUTE);
        if self == Extent::Display || (self == Extent::OwnData && !is_own()) {
            return Ok(display);
        }
        let axis = |of: fn(Vec2<i32>) -> i32, size: fn(Vec2<usize>) -> usize| {
            let [low, high] = range(of(display.position), size(display.size));
            let data = headers.iter().map(|part| range(of(part.own_attributes.layer_position), size(part.layer_size)));
            let [first, last] = data.fold([high, low], |[a, b], [start, end]| [a.min(start), b.max(end)]);
            let first = first.clamp(low, (high - 1).max(low));
            (first as i32, last.clamp(first, high).abs_diff(first).max(1) as usize)
        };
        let ((x, width), (y, height)) = (axis(|at| at.0, |size| size.0), axis(|at| at.1, |size| size.1));
        Ok(IntegerBounds { position: Vec2(x, y), size: Vec2(width, height) })
    }
}

/// The coordinates of a window along an axis: of its first pixel, and of the one after its last.
fn range(position: i32, size: usize) -> [i64; 2] {
    [i64::from(position), i64::from(position) + size as i64]
}

/// Whether a part of an EXR has pixels outside of the display window, which are not read.
///
/// # Errors
/// As for [`read_header()`].
pub fn has_overscan(path: &Path) -> Result<bool> {
    let ranges = |at: Vec2<i32>, size: Vec2<usize>| [range(at.0, size.0), range(at.1, size.1)];
    open(path, |file, _| {
        let reader = exr::block::read(file, false)?;
        let beyond = |header: &Header| {
            let display = header.shared_attributes.display_window;
            let own = ranges(header.own_attributes.layer_position, header.layer_size);
            let all = ranges(display.position, display.size);
            own.iter().zip(all).any(|(own, all)| own[0] < all[0] || own[1] > all[1])
        };
        Ok(reader.headers().iter().any(beyond))
    })
}

/// The layers of an EXR without values as [`read_render()`] reads them, and the attributes. Reads no pixels, so that a file
/// whose pixels are damaged is not recognised.
///
/// # Errors
/// As for [`read()`].
pub fn read_header(path: &Path) -> Result<(LayerSet, Attributes)> {
    open(path, |file, _| {
        let reader = exr::block::read(file, false)?;
        let headers = reader.headers();
        let bounds = Extent::OwnData.bounds(headers)?;
        let size = bounds.size;
        let layers = layers(headers.iter().map(|header| vec![Vec::new(); header.channels.list.len()]), headers);
        let attributes = attributes(headers, bounds);
        Ok((LayerSet { width: size.0, height: size.1, layers, iterations: attributes.iterations() }, attributes))
    })
}

/// Reads an open EXR of some length with `decode`.
pub(super) fn open<T>(path: &Path, decode: impl FnOnce(BufReader<File>, u64) -> Outcome<T>) -> Result<T> {
    let file = files::open(path).map_err(|cause| Error::io(path, &cause))?;
    let length = file.metadata().map_err(|cause| Error::io(path, &cause))?.len();
    if length == 0 {
        return Err(Error::new(ErrorKind::Image, path.display(), "the file is empty"));
    }
    git_lfs::check_file(path)?;
    // Assertions in the decoder fail for some malformed files.
    let outcome = catch_unwind(AssertUnwindSafe(|| decode(BufReader::new(file), length)));
    let outcome = outcome.unwrap_or_else(|_| Err(invalid("the file contradicts itself")));
    outcome.map_err(|cause| match cause {
        exr::error::Error::Io(cause) if cause.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, &cause),
        exr::error::Error::Io(_) => Error::new(ErrorKind::Image, path.display(), "the file ends too early")
            .hint("copy or render it again; it is not whole"),
        exr::error::Error::NotSupported(cause) => {
            Error::new(ErrorKind::Image, path.display(), cause).hint("save it as a flat EXR with ZIP compression")
        }
        exr::error::Error::Invalid(cause) if cause == "file identifier missing" => {
            Error::new(ErrorKind::Image, path.display(), "not a valid EXR: it does not begin as one")
                .hint("give the EXR of the render; a PNG is tone-mapped, for viewing only")
        }
        other => Error::new(ErrorKind::Image, path.display(), format!("not a valid EXR: {other}")),
    })
}

pub(super) type Outcome<T> = exr::error::Result<T>;

pub(super) fn invalid(cause: &'static str) -> exr::error::Error {
    exr::error::Error::Invalid(cause.into())
}

fn decode(
    file: BufReader<File>,
    length: u64,
    wanted: &dyn Fn(&str) -> bool,
    extent: Extent,
) -> Outcome<(Windowed, Attributes)> {
    let reader = exr::block::read(file, false)?;
    let reads = wanted_channels(reader.headers(), wanted);
    let bounds = extent.bounds(reader.headers())?;
    check_size(reader.headers(), length, bounds.size, &reads)?;
    let chunks = reader.filter_chunks(false, |_, _, block| {
        block.level == exr::math::Vec2(0, 0) && reads[block.layer].contains(&true)
    })?;
    let meta = exr::block::reader::ChunksReader::meta_data(&chunks).clone();
    let display = meta.headers[0].shared_attributes.display_window;
    let mut canvas = Canvas::new(bounds, &reads)?;
    let decompress = |chunk| {
        check_sections(&chunk, &meta.headers)?;
        UncompressedBlock::decompress_chunk(zip::unpacked(chunk, &meta.headers), &meta, false)
    };
    let (mut chunks, mut blocks) = (chunks, Vec::<Outcome<UncompressedBlock>>::new());
    loop {
        let batch = chunks.by_ref().take(4 * rayon::current_num_threads()).collect::<Outcome<Vec<Chunk>>>()?;
        // One thread copies the last batch while the others decompress the next.
        let mut paint = || blocks.drain(..).try_for_each(|block| canvas.paint(&block?, &meta.headers));
        let (painted, next) = rayon::join(&mut paint, || batch.into_par_iter().map(decompress).collect::<Vec<_>>());
        painted?;
        if next.is_empty() {
            break;
        }
        blocks = next;
    }
    let mut set = canvas.into_layers(&meta.headers, wanted);
    convert_to_rec_709(&mut set, meta.headers[0].shared_attributes.chromaticities.as_ref());
    let attributes = attributes(&meta.headers, bounds);
    set.iterations = attributes.iterations();
    let corner = [(bounds.position.0, display.position.0), (bounds.position.1, display.position.1)];
    let corner = corner.map(|(own, display)| own.abs_diff(display) as usize);
    let whole = Size { width: display.size.0, height: display.size.1 };
    Ok((Windowed { set, whole, corner }, attributes))
}

/// Whether the layer of each channel is wanted, by part and by channel.
fn wanted_channels(headers: &[Header], wanted: &dyn Fn(&str) -> bool) -> Vec<Vec<bool>> {
    let of_part = |part: usize| named(headers, part).map(|(layer, _)| wanted(&layer)).collect();
    (0..headers.len()).map(of_part).collect()
}

/// Rejects headers that declare more data than the file can hold, before anything is allocated for them. `reads`: whether
/// each channel is read, by part and by channel.
fn check_size(headers: &[Header], length: u64, canvas: Vec2<usize>, reads: &[Vec<bool>]) -> Outcome<()> {
    let window = |size: exr::math::Vec2<usize>| size.0 as u128 * size.1 as u128;
    let mut taken = 0u128;
    for (header, reads) in headers.iter().zip(reads) {
        if header.deep {
            return Err(exr::error::Error::NotSupported("the file is deep".into()));
        }
        if header.channels.list.iter().any(|channel| channel.sampling != exr::math::Vec2(1, 1)) {
            return Err(exr::error::Error::NotSupported("the file has subsampled channels".into()));
        }
        if header.chunk_count as u128 * 8 > u128::from(length) {
            return Err(invalid("more chunks than bytes"));
        }
        if window(header.layer_size) * header.channels.bytes_per_pixel as u128 > u128::from(length) * max_ratio(header)
        {
            return Err(invalid("more pixels than the file can hold"));
        }
        taken += window(canvas) * 4 * reads.iter().filter(|read| **read).count() as u128;
    }
    // The file of a small window in a large picture may be small.
    match u64::try_from(taken) {
        Ok(taken) if taken <= MAX_WINDOWED_BYTES.max(length.saturating_mul(memory::MAX_EXR_RATIO)) => {
            memory::require(taken, "its pixels").map_err(|error| exr::error::Error::NotSupported(error.cause.into()))
        }
        _ => Err(invalid("the display window is too large for its file")),
    }
}

/// Maximum compression ratio of Deflate: 258 bytes from two bits, one for the length and one for the distance.
const DEFLATE_RATIO: u128 = 1032;
/// Bytes of pixels in a display window that are always accepted, because the file may hold a small window of it.
const MAX_WINDOWED_BYTES: u64 = 1 << 30;

/// Upper bound on the compression ratio of a part: bytes of samples per byte of the file.
fn max_ratio(header: &Header) -> u128 {
    match header.compression {
        Compression::Uncompressed => 1,
        // Two bytes repeat one 128 times.
        Compression::RLE => 64,
        Compression::ZIP1 | Compression::ZIP16 => DEFLATE_RATIO,
        // PXR24 stores three of four bytes.
        Compression::PXR24 => DEFLATE_RATIO * 4 / 3,
        // Sixteen equal samples of two bytes take three bytes.
        Compression::B44 | Compression::B44A => 32,
        // Ten bits, two codes of at least one bit and a count of eight, repeat a sample of two bytes 255 times.
        Compression::PIZ => DEFLATE_RATIO,
        _ => u128::from(memory::MAX_EXR_RATIO),
    }
}

/// Checks the sizes of the sections of a DWA chunk, eleven 64-bit numbers at its start, because the decoder allocates
/// memory as they say.
pub(super) fn check_sections(chunk: &Chunk, headers: &[Header]) -> Outcome<()> {
    let Some(header) = headers.get(chunk.layer_index) else { return Err(invalid("part index")) };
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Err(exr::error::Error::NotSupported("the file is deep".into())),
    };
    let size = header.max_block_pixel_size();
    let whole = size.0.saturating_mul(size.1).saturating_mul(header.channels.bytes_per_pixel) as u64;
    let packed =
        matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) && bytes.len() as u64 != whole;
    // Sections hold the samples of the block. Run lengths may double their size, and blocks of 8 x 8 round it up.
    let limit = whole.saturating_mul(4).saturating_add(1 << 16);
    let number = |eight: &[u8]| eight.iter().rev().fold(0u64, |n, &byte| n << 8 | u64::from(byte));
    if packed && bytes.chunks_exact(8).take(11).any(|eight| number(eight) > limit) {
        return Err(invalid("a section larger than its block"));
    }
    Ok(())
}

/// The pixels of the display window that is read, one plane per channel of every part.
struct Canvas {
    left: i64,
    top: i64,
    width: usize,
    height: usize,
    /// Values of each pixel, indexed by part, by channel, and by pixel row by row; no values of channels that are not read.
    planes: Vec<Vec<Vec<f32>>>,
}

impl Canvas {
    /// A black canvas. `reads`: whether each channel is read, by part and by channel.
    fn new(display: exr::meta::attribute::IntegerBounds, reads: &[Vec<bool>]) -> Outcome<Self> {
        let (width, height) = (display.size.0, display.size.1);
        let pixels = width.checked_mul(height).filter(|&n| n > 0);
        let pixels = pixels.ok_or_else(|| invalid("the display window has no pixels"))?;
        let plane = |read: &bool| if *read { vec![0.0; pixels] } else { Vec::new() };
        let planes = reads.iter().map(|part| part.iter().map(plane).collect()).collect();
        Ok(Canvas { left: display.position.0.into(), top: display.position.1.into(), width, height, planes })
    }

    /// Copies the pixels of a block that lie within the display window.
    fn paint(&mut self, block: &UncompressedBlock, headers: &[Header]) -> Outcome<()> {
        let part = block.index.layer;
        let header = headers.get(part).ok_or_else(|| invalid("part index"))?;
        let origin = header.own_attributes.layer_position;
        for line in block.lines(&header.channels) {
            let at = line.location;
            let y = i64::from(origin.1) + at.position.1 as i64 - self.top;
            if y < 0 || y >= self.height as i64 {
                continue;
            }
            let x = i64::from(origin.0) + at.position.0 as i64 - self.left;
            let skip = (-x).clamp(0, at.sample_count as i64) as usize;
            let start = x.clamp(0, self.width as i64) as usize;
            let count = (at.sample_count - skip).min(self.width - start);
            let row = y as usize * self.width + start;
            let Some(out) = self.planes[part][at.channel].get_mut(row..row + count) else { continue };
            convert(line.value, skip, out, header.channels.list[at.channel].sample_type);
        }
        Ok(())
    }

    fn into_layers(self, headers: &[Header], wanted: &dyn Fn(&str) -> bool) -> LayerSet {
        let mut layers = layers(self.planes, headers);
        layers.retain(|layer| wanted(&layer.name));
        LayerSet { width: self.width, height: self.height, layers, iterations: None }
    }
}

/// The layers of the planes of all channels, by part and by channel.
fn layers(planes: impl IntoIterator<Item = Vec<Vec<f32>>>, headers: &[Header]) -> Vec<Layer> {
    let mut layers: BTreeMap<String, Vec<Plane>> = BTreeMap::new();
    for (part, (planes, header)) in planes.into_iter().zip(headers).enumerate() {
        for ((values, channel), (name, component)) in
            planes.into_iter().zip(&header.channels.list).zip(named(headers, part))
        {
            let sample = if channel.sample_type == SampleType::F16 { Sample::Half } else { Sample::Float };
            let planes = layers.entry(name).or_default();
            // A channel of the same name in another part is another view; the first one is kept.
            if planes.iter().all(|plane| plane.component != component) {
                planes.push(Plane { component, sample, values });
            }
        }
    }
    let mut layers: Vec<Layer> = layers.into_iter().map(|(name, planes)| Layer { name, planes }).collect();
    layers.iter_mut().for_each(|layer| layer.planes.sort_by_key(|plane| rank(&plane.component)));
    layers
}

/// Layer and component of each channel of a part.
fn named(headers: &[Header], part: usize) -> impl Iterator<Item = (String, String)> {
    let header = &headers[part];
    let prefix = if headers.len() > 1 { header.own_attributes.layer_name.as_ref() } else { None };
    let prefix = prefix.map(Text::to_string).unwrap_or_default();
    header.channels.list.iter().map(move |channel| split(&prefix, part == 0, &channel.name.to_string()))
}

/// Converts the samples of one line to f32, without the first `skip` samples.
fn convert(bytes: &[u8], skip: usize, out: &mut [f32], sample: SampleType) {
    let four = |bytes: &[u8]| [bytes[0], bytes[1], bytes[2], bytes[3]];
    match sample {
        SampleType::F16 => {
            for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(2).skip(skip)) {
                *value = f16::from_ne_bytes([bytes[0], bytes[1]]).to_f32();
            }
        }
        SampleType::F32 => {
            for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(4).skip(skip)) {
                *value = f32::from_ne_bytes(four(bytes));
            }
        }
        SampleType::U32 => {
            for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(4).skip(skip)) {
                *value = u32::from_ne_bytes(four(bytes)) as f32;
            }
        }
    }
}

/// Layer name and component of a channel, see [`read`].
fn split(part: &str, first: bool, channel: &str) -> (String, String) {
    let (group, component) = channel.rsplit_once('.').unwrap_or(("", channel));
    let at_root = part.is_empty() || (first && group.is_empty());
    let known = group == part || group.starts_with(&format!("{part}."));
    let name = match (group, at_root || known) {
        ("", true) if is_picture(component) => String::new(),
        ("", true) => component.to_owned(),
        (group, true) => group.to_owned(),
        ("", false) => part.to_owned(),
        (group, false) => format!("{part}.{group}"),
    };
    (name, component.to_owned())
}

fn is_picture(component: &str) -> bool {
    ["R", "G", "B", "A", "Y", "r", "g", "b", "a", "red", "green", "blue", "alpha"].contains(&component)
}

/// Sort key of components within a layer: R G B A, X Y Z W, U V, then by name.
fn rank(component: &str) -> (usize, String) {
    let letter = component.chars().next().map_or(' ', |c| c.to_ascii_uppercase());
    ("RGBAXYZWUV".find(letter).unwrap_or(usize::MAX), component.to_owned())
}

/// All attributes of a file of which the pixels within `bounds` are read.
fn attributes(headers: &[Header], bounds: IntegerBounds) -> Attributes {
    let own = |header: &Header| {
        let own = &header.own_attributes;
        let display = header.shared_attributes.display_window;
        let frame = own.world_to_camera.map(|world_to_camera| Frame {
            display: [display.size.0 as u32, display.size.1 as u32],
            corner: [bounds.position.0.abs_diff(display.position.0), bounds.position.1.abs_diff(display.position.1)],
            world_to_camera,
            world_to_ndc: own.world_to_normalized_device,
        });
        let number = match own.other.get(&Text::from("imageCounter")) {
            Some(AttributeValue::I32(number)) => Some(*number),
            _ => None,
        };
        let rate = own.frames_per_second.and_then(|(frames, seconds)| Some([u32::try_from(frames).ok()?, seconds]));
        (frame, Moment { number, rate: rate.filter(|rate| !rate.contains(&0)) })
    };
    let (frame, moment) = headers.first().map(own).unwrap_or_default();
    Attributes { texts: texts(headers), frame, moment }
}

/// The string attributes of all parts by name. Text that is not UTF-8 counts as Latin-1.
fn texts(headers: &[Header]) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for header in headers {
        for (name, value) in header.own_attributes.other.iter().chain(&header.shared_attributes.other) {
            if let AttributeValue::Text(text) = value {
                let decoded = || String::from_utf8(text.as_slice().to_vec()).unwrap_or_else(|_| text.to_string());
                found.entry(name.to_string()).or_insert_with(decoded);
            }
        }
    }
    found
}
