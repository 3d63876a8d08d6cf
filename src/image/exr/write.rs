//! Writes layers to an EXR.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::math::Vec2;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Compression as Packing, IntegerBounds, LineOrder, SampleType, Text, TimeCode,
};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::{SmallVec, f16};
use rayon::prelude::*;

use super::colour_space::ColourSpace;
use super::{Attributes, Frame, SOFTWARE, header, zip};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{COMBINED, Layer, LayerSet, Naming, Plane, Sample, check_names, former_name};
use crate::image::atomic::{self, Draft};
use serde::Serialize;

/// Text attribute with the former names of layers.
const ALIASES: &str = "caustiqueAliases";

/// Compression of an EXR. Every method is lossless.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// zlib over 16 lines: small files, widely read
    #[default]
    Zip,
    /// zlib over single lines: quick access to lines
    Zips,
    /// Wavelets: small for noisy pictures
    Piz,
    /// None: quick and large
    None,
}

/// Options for writing an EXR with [`write()`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Options {
    /// Compression of the pixels.
    pub compression: Compression,
    /// Naming scheme of the channels.
    pub naming: Naming,
    /// Whether layers for which half floats suffice are stored as such ([`crate::film::Layer::fits_half`]).
    pub half: bool,
    /// Whether each layer is a part of its own, so that readers unpack only what they need.
    pub multi_part: bool,
    /// Colour space of the pictures.
    pub colour_space: ColourSpace,
}

/// Writes all layers and attributes to `path`, atomically (see [`atomic::write`]). Compresses on the current rayon
/// pool; the bytes do not depend on its size.
///
/// # Errors
/// A picture without pixels or channels, a channel name that other programs cannot read, an attribute that is not ASCII;
/// errors of the file system.
pub fn write(path: &Path, set: &LayerSet, attributes: &Attributes, options: Options) -> Result<()> {
    write_followed(path, set, attributes, options, |_| Ok(()))
}

/// [`write()`], followed by the data that `tail` appends to the file; readers of EXR ignore it.
///
/// # Errors
/// As [`write()`], and errors of `tail`.
pub fn write_followed(
    path: &Path,
    set: &LayerSet,
    attributes: &Attributes,
    options: Options,
    tail: impl FnOnce(&mut BufWriter<&mut File>) -> std::io::Result<()>,
) -> Result<()> {
    write_by(path, set, attributes, options, |fill| {
        atomic::write(path, |file| {
            fill(file)?;
            file.seek(SeekFrom::End(0)).and_then(|_| tail(file)).map_err(|error| atomic::failure(path, &error))
        })
    })
}

/// Writes an unfinished version of the EXR `path`, beside it.
///
/// # Errors
/// As [`write()`].
pub fn write_draft(path: &Path, set: &LayerSet, attributes: &Attributes, options: Options) -> Result<Draft> {
    write_by(path, set, attributes, options, |fill| Draft::write(path, fill))
}

/// Prepares the parts of an EXR. `write` writes its file by calling the function that it gets.
fn write_by<T>(
    path: &Path,
    set: &LayerSet,
    attributes: &Attributes,
    options: Options,
    write: impl FnOnce(&dyn Fn(&mut BufWriter<&mut File>) -> Result<()>) -> Result<T>,
) -> Result<T> {
    check_names(set, options.naming).map_err(|error| error.within(path.display()))?;
    let converted = options.colour_space.converted(set);
    let set = converted.as_ref().unwrap_or(set);
    let parts = parts(set, options);
    let channels: usize = parts.iter().map(|part| part.channels.len()).sum();
    if channels == 0 || set.pixels() == 0 {
        let cause = format!("{channels} channels of {} x {} pixels are no picture", set.width, set.height);
        return Err(Error::new(ErrorKind::Image, path.display(), cause));
    }
    let header_of = |(index, part): (usize, &Part<'_>)| {
        // Readers look for texts in the first part, but for those of a cryptomatte in the part of each of its layers.
        let mut texts = if index == 0 { attributes.texts.clone() } else { matte_texts(part, &attributes.texts) };
        texts.remove(ALIASES);
        texts.extend(aliases(set, options.naming).filter(|_| index == 0).map(|text| (ALIASES.into(), text)));
        header(set, part, &Attributes { texts, ..attributes.clone() }, options)
    };
    let headers: Result<exr::meta::Headers> = parts.iter().enumerate().map(header_of).collect();
    let headers = headers.map_err(|error| error.within(path.display()))?;
    write(&|file| {
        write_chunks(file, set.width, &parts, headers.clone()).map_err(|error| failure(path, error))?;
        sort(file, parts.len()).map_err(|error| atomic::failure(path, &error))
    })
}

/// The former names of layers that had others, as the text of a JSON object from each former name to the current one.
fn aliases(set: &LayerSet, naming: Naming) -> Option<String> {
    let alias = |layer: &Layer| {
        let former = former_name(&layer.name)?;
        Some((naming.layer(&former), naming.layer(&layer.name).into()))
    };
    let aliases: serde_json::Map<String, serde_json::Value> = set.layers.iter().filter_map(alias).collect();
    (!aliases.is_empty()).then(|| serde_json::Value::from(aliases).to_string())
}

/// The channels of a part of the file, sorted by name.
struct Part<'a> {
    name: String,
    channels: Vec<(String, Source<'a>)>,
}

/// One part with all channels, or one part for each layer with planes, the picture first: many programs show only the first
/// part.
fn parts(set: &LayerSet, options: Options) -> Vec<Part<'_>> {
    let mut parts: Vec<Part<'_>> = Vec::new();
    let (picture, others): (Vec<&Layer>, Vec<&Layer>) =
        set.layers.iter().filter(|layer| !layer.planes.is_empty()).partition(|layer| layer.name.is_empty());
    for layer in picture.into_iter().chain(others) {
        let half = options.half && layer.fits_half();
        let channels: Vec<_> = layer
            .planes
            .iter()
            .map(|plane| {
                let (component, negated) = options.naming.axis(&layer.name, &plane.component);
                let plane_of_axis = layer.plane(component).unwrap_or(plane);
                let sample = if half { Sample::Half } else { plane_of_axis.sample };
                let source = Source { plane: plane_of_axis, sample, negated };
                (options.naming.channel(&layer.name, &plane.component), source)
            })
            .collect();
        match parts.last_mut().filter(|_| !options.multi_part) {
            Some(part) => part.channels.extend(channels),
            None => parts.push(Part { name: part_name(&layer.name, &channels[0].0), channels }),
        }
    }
    parts.iter_mut().for_each(|part| part.channels.sort_by(|(a, _), (b, _)| a.cmp(b)));
    parts
}

/// Name of a layer's part: the name of its channels without the component; for the picture, the pass that Blender shows.
fn part_name(layer: &str, channel: &str) -> String {
    let name = channel.rsplit_once('.').map_or(layer, |(name, _)| name);
    if name.is_empty() { COMBINED.into() } else { name.into() }
}

/// The texts about the cryptomatte that a part belongs to: those whose keys share the beginning of the key whose text is
/// the name of the part without its number.
fn matte_texts(part: &Part<'_>, texts: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    let matte = part.name.trim_end_matches(|c: char| c.is_ascii_digit());
    let beginning = |(key, name): (&String, &String)| {
        key.strip_suffix("name").filter(|key| key.starts_with("cryptomatte/") && name == matte).map(str::to_owned)
    };
    let beginnings: Vec<String> = texts.iter().filter_map(beginning).collect();
    let of_matte = |(key, _): &(&String, &String)| beginnings.iter().any(|beginning| key.starts_with(beginning));
    texts.iter().filter(of_matte).map(|(key, text)| (key.clone(), text.clone())).collect()
}

/// Source of the values of one channel of the EXR.
#[derive(Clone, Copy)]
struct Source<'a> {
    plane: &'a Plane,
    /// Number format of the values in the file.
    sample: Sample,
    /// Whether the values are negated in the file.
    negated: bool,
}

fn sort(file: &mut BufWriter<&mut File>, parts: usize) -> std::io::Result<()> {
    file.flush()?;
    header::sort_attributes(*file.get_mut(), parts)
}

fn failure(path: &Path, error: exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(cause) => atomic::failure(path, &cause),
        other => Error::new(ErrorKind::Image, path.display(), other),
    }
}

fn header(set: &LayerSet, part: &Part<'_>, attributes: &Attributes, options: Options) -> Result<Header> {
    use exr::meta::BlockDescription::ScanLines;
    let channels: SmallVec<[ChannelDescription; 5]> = part
        .channels
        .iter()
        .map(|(name, source)| {
            let sample = if source.sample == Sample::Half { SampleType::F16 } else { SampleType::F32 };
            ChannelDescription::named(name.as_str(), sample)
        })
        .collect();
    let compression = match options.compression {
        Compression::Zip => Packing::ZIP16,
        Compression::Zips => Packing::ZIP1,
        Compression::Piz => Packing::PIZ,
        Compression::None => Packing::Uncompressed,
    };
    let mut other = HashMap::new();
    for (name, value) in &attributes.texts {
        let error = |cause| Error::new(ErrorKind::Image, format!("attribute \"{name}\""), cause);
        let key = Text::new_or_none(name).ok_or_else(|| error("its name is not ASCII"))?;
        let text =
            Text::new_or_none(value).filter(|_| value.is_ascii()).ok_or_else(|| error("its text is not ASCII"))?;
        other.insert(key, AttributeValue::Text(text));
    }
    if let Some(number) = attributes.moment.number {
        other.insert(Text::from("imageCounter"), AttributeValue::I32(number));
    }
    let mut own = LayerAttributes { other, software_name: Some(Text::from(SOFTWARE)), ..LayerAttributes::default() };
    own.layer_name = Text::new_or_none(&part.name).filter(|_| options.multi_part);
    let mut header = Header::new(Text::default(), (set.width, set.height), channels).with_encoding(
        compression,
        ScanLines,
        LineOrder::Increasing,
    );
    header.shared_attributes.chromaticities = Some(options.colour_space.chromaticities());
    if let Some(Frame { display: [width, height], corner: [x, y], world_to_camera, world_to_ndc }) = attributes.frame {
        header.shared_attributes.display_window = IntegerBounds::from_dimensions(Vec2(width as usize, height as usize));
        own.layer_position = Vec2(x as i32, y as i32);
        own.world_to_camera = Some(options.naming.from_file_axes(world_to_camera));
        own.world_to_normalized_device = world_to_ndc.map(|matrix| options.naming.from_file_axes(matrix));
    }
    own.frames_per_second = attributes.moment.rate.map(|[frames, seconds]| (frames as i32, seconds));
    header.shared_attributes.time_code =
        attributes.moment.time_code().map(|[hours, minutes, seconds, frame]| TimeCode {
            hours,
            minutes,
            seconds,
            frame,
            drop_frame: false,
            color_frame: false,
            field_phase: false,
            binary_group_flags: [false; 3],
            binary_groups: [0; 8],
        });
    Ok(header.with_attributes(own))
}

/// Compresses batches of blocks, groups of scan lines, in parallel and writes them in order.
fn write_chunks(
    file: &mut BufWriter<&mut File>,
    width: usize,
    parts: &[Part<'_>],
    headers: exr::meta::Headers,
) -> exr::error::UnitResult {
    exr::block::write(file, headers, true, |meta, chunks| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        let compress = |&(number, index): &(usize, BlockIndex)| {
            let block = UncompressedBlock::from_lines(&meta.headers[index.layer].channels, index, |line| {
                let at = line.location;
                let Source { plane, sample, negated } = parts[index.layer].channels[at.channel].1;
                let start = at.position.y() * width + at.position.x();
                fill(line.value, &plane.values[start..start + at.sample_count], sample, negated);
            });
            (number, pack(block, &meta.headers))
        };
        let mut packed: Vec<(usize, exr::error::Result<Chunk>)> = Vec::new();
        let mut write = |packed: Vec<(usize, exr::error::Result<Chunk>)>| {
            packed.into_iter().try_for_each(|(number, chunk)| chunks.write_chunk(number, chunk?))
        };
        // A few blocks per thread keep all threads busy with little memory. One thread writes the last batch while the
        // others compress the next.
        for batch in blocks.chunks(2 * rayon::current_num_threads()) {
            let last = std::mem::take(&mut packed);
            let (written, next) = rayon::join(|| write(last), || batch.par_iter().map(compress).collect());
            written?;
            packed = next;
        }
        write(packed)
    })
}

/// Compresses a block, a group of scan lines.
fn pack(block: UncompressedBlock, headers: &[Header]) -> exr::error::Result<Chunk> {
    let zipped = matches!(headers[0].compression, Packing::ZIP1 | Packing::ZIP16);
    // The samples of a block are in the machine's byte order, our ZIP needs little-endian.
    if zipped && cfg!(target_endian = "little") {
        return Ok(zip::chunk(block, &headers[0]));
    }
    block.compress_to_chunk(headers)
}

/// Writes the samples of one line in the machine's byte order.
fn fill(bytes: &mut [u8], values: &[f32], sample: Sample, negated: bool) {
    let signed = |value: f32| if negated { -value } else { value };
    match sample {
        Sample::Float => {
            for (out, value) in bytes.chunks_exact_mut(4).zip(values) {
                out.copy_from_slice(&signed(*value).to_ne_bytes());
            }
        }
        Sample::Half => {
            for (out, &value) in bytes.chunks_exact_mut(2).zip(values) {
                out.copy_from_slice(&f16::from_f32(signed(value)).to_ne_bytes());
            }
        }
    }
}
