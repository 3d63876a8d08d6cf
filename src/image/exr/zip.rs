//! OpenEXR's ZIP compression (OpenEXR Technical Introduction, "Data Compression"): even bytes before odd ones, each as
//! the difference from its predecessor, in a zlib stream.
//!
//! The `exr` crate uses miniz_oxide, which takes three times as long as libdeflate for files within half a percent of the
//! size.

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::meta::header::Header;
use libdeflater::{CompressionLvl, Compressor};

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
            let back = UncompressedBlock::decompress_chunk(chunk, &meta, true).expect("it is as the format says");
            assert!(back.data == data);
        }
    }
}
