//! OpenEXR's ZIP compression (OpenEXR Technical Introduction, "Data Compression"): even bytes before odd ones, each as
//! the difference from its predecessor, in a zlib stream.
//!
//! The `exr` crate uses miniz_oxide, which takes three times as long as libdeflate for files within half a percent of the
//! size.

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock};
use exr::meta::attribute::Compression;
use exr::meta::header::Header;
use libdeflater::{CompressionLvl, Compressor, Decompressor};

/// Compresses a block of scan lines, whose samples are little-endian, with zlib.
pub(super) fn chunk(block: UncompressedBlock, header: &Header) -> Chunk {
    let top = block.index.pixel_position.y() as i32 + header.own_attributes.layer_position.y();
    let packed = compress(&block.data);
    Chunk {
        layer_index: block.index.layer,
        compressed_block: CompressedBlock::ScanLine(CompressedScanLineBlock {
            y_coordinate: top,
            compressed_pixels_le: packed.unwrap_or(block.data),
        }),
    }
}

/// Compression level of zlib: higher ones take up to a third more time for half a percent fewer bytes.
const LEVEL: i32 = 1;

/// The bytes compressed by zlib; `None` if they are not fewer, in which case OpenEXR stores the block uncompressed.
fn compress(bytes: &[u8]) -> Option<Vec<u8>> {
    let differences = differences(bytes);
    let mut packed = vec![0; bytes.len()];
    let level = CompressionLvl::new(LEVEL).unwrap_or_default();
    let length = Compressor::new(level).zlib_compress(&differences, &mut packed).ok()?;
    packed.truncate(length);
    (length < bytes.len()).then_some(packed)
}

/// The chunk of a file with its bytes decompressed, if the file is compressed by ZIP and the bytes are those of a whole
/// block. Otherwise the chunk itself: the `exr` crate takes bytes of a block's size as uncompressed, and reports errors.
pub(super) fn unpacked(mut chunk: Chunk, headers: &[Header]) -> Chunk {
    let header = headers
        .get(chunk.layer_index)
        .filter(|header| matches!(header.compression, Compression::ZIP1 | Compression::ZIP16));
    let Some(length) = header.and_then(|header| block_length(header, &chunk.compressed_block)) else { return chunk };
    let (CompressedBlock::ScanLine(CompressedScanLineBlock { compressed_pixels_le: bytes, .. })
    | CompressedBlock::Tile(CompressedTileBlock { compressed_pixels_le: bytes, .. })) = &mut chunk.compressed_block
    else {
        return chunk;
    };
    if bytes.len() < length
        && let Some(samples) = decompress(bytes, length)
    {
        *bytes = samples;
    }
    chunk
}

/// Number of bytes of a block before compression; `None` if its position is not in the picture.
fn block_length(header: &Header, block: &CompressedBlock) -> Option<usize> {
    let tile = header.get_block_data_indices(block).ok()?;
    let pixels = header.get_absolute_block_pixel_coordinates(tile).ok()?;
    pixels.validate(Some(header.layer_size)).ok()?;
    Some(pixels.size.area() * header.channels.bytes_per_pixel)
}

/// The `length` bytes of a block from its zlib stream; `None` if the stream is malformed or holds another number.
fn decompress(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut apart = vec![0; length];
    let written = Decompressor::new().zlib_decompress(packed, &mut apart).ok()?;
    if written != length {
        return None;
    }
    for i in 1..length {
        apart[i] = apart[i - 1].wrapping_add(apart[i]).wrapping_sub(128);
    }
    let (even, odd) = apart.split_at(length.div_ceil(2));
    let mut bytes = vec![0; length];
    for ((pair, even), odd) in bytes.chunks_exact_mut(2).zip(even).zip(odd) {
        pair.copy_from_slice(&[*even, *odd]);
    }
    if length % 2 == 1 {
        bytes[length - 1] = even[even.len() - 1];
    }
    Some(bytes)
}

/// OpenEXR's prediction before compression: even bytes, then odd ones; from each except the first its predecessor is
/// subtracted and 128 added.
fn differences(bytes: &[u8]) -> Vec<u8> {
    let mut apart = vec![0; bytes.len()];
    let (even, odd) = apart.split_at_mut(bytes.len().div_ceil(2));
    let pairs = bytes.chunks_exact(2);
    if let ([last], Some(end)) = (pairs.remainder(), even.last_mut()) {
        *end = *last;
    }
    for ((pair, even), odd) in pairs.zip(even).zip(odd) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    for i in (1..apart.len()).rev() {
        apart[i] = apart[i].wrapping_sub(apart[i - 1]).wrapping_add(128);
    }
    apart
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::block::BlockIndex;
    use exr::math::Vec2;
    use exr::meta::attribute::{ChannelDescription, Compression, LineOrder, SampleType, Text};
    use exr::meta::{BlockDescription, MetaData};

    /// The `exr` crate reads back compressed blocks, and noise, which is stored uncompressed.
    #[test]
    fn blocks_survive_compression() {
        let size = Vec2(13, 7);
        let channels = [("R", SampleType::F16), ("Z", SampleType::F32)];
        let channels = channels.map(|(name, sample)| ChannelDescription::named(name, sample));
        let header = Header::new(Text::from("layer"), size, channels.into_iter().collect()).with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        let requirements = MetaData::validate(std::slice::from_ref(&header), true).expect("it is a header");
        let meta = MetaData { requirements, headers: std::iter::once(header).collect() };
        let mut state = 1u64;
        let mut noise = |_| {
            state = crate::random::mix(state.wrapping_add(1));
            state as u8
        };
        let wave = |i: usize| (i / 9 * 31) as u8;
        let length = size.area() * 6;
        let pictures = [(0..length).map(wave).collect::<Vec<u8>>(), (0..length).map(&mut noise).collect()];
        for (data, shrinks) in pictures.into_iter().zip([true, false]) {
            let index = BlockIndex { layer: 0, pixel_position: Vec2(0, 0), pixel_size: size, level: Vec2(0, 0) };
            let chunk = chunk(UncompressedBlock { index, data: data.clone() }, &meta.headers[0]);
            let CompressedBlock::ScanLine(lines) = &chunk.compressed_block else { panic!("scan lines") };
            assert_eq!(lines.compressed_pixels_le.len() < length, shrinks);
            let whole = unpacked(chunk.clone(), &meta.headers);
            let CompressedBlock::ScanLine(lines) = &whole.compressed_block else { panic!("scan lines") };
            assert!(lines.compressed_pixels_le == data);
            let back = UncompressedBlock::decompress_chunk(chunk, &meta, true).expect("it is as the format says");
            assert!(back.data == data);
        }
        // Odd numbers of bytes, and streams of another length than the block.
        for length in [1, 2, 5, 257] {
            let bytes: Vec<u8> = (0..length).map(wave).collect();
            let mut packed = vec![0; 2 * length + 64];
            let level = CompressionLvl::new(LEVEL).unwrap_or_default();
            let written = Compressor::new(level).zlib_compress(&differences(&bytes), &mut packed).expect("it fits");
            assert_eq!(decompress(&packed[..written], length), Some(bytes));
            assert!([length - 1, length + 1].iter().all(|other| decompress(&packed[..written], *other).is_none()));
        }
    }
}
