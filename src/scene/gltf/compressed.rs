//! Compressed geometry: KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_meshopt_compression. Compressed data
//! are decoded into buffer views, so that the rest of the reader sees plain accessors.

use super::container::MESHOPT;
use super::document::{Document, at, extension};
use super::draco;
use super::isolated::{count_bytes, damaged};
use crate::error::Result;
use serde::Deserialize;

/// Content of EXT_meshopt_compression and KHR_meshopt_compression.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Meshopt {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Filter {
    /// Whether the filter is for elements of `stride` bytes.
    fn allows(self, stride: usize) -> bool {
        match self {
            Filter::None | Filter::Exponential => true,
            Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
            Filter::Quaternion => stride == 8,
        }
    }
}

/// Decodes the compressed buffer views and primitives of a document. A primitive whose accessors have data of their own
/// keeps them.
///
/// # Errors
/// Compressed data are damaged.
pub(super) fn decode(document: &mut Document) -> Result<()> {
    for index in 0..document.views.len() {
        for name in MESHOPT {
            let place = at("buffer view", index);
            let Some(meshopt) = extension::<Meshopt>(document.part("bufferViews", index), name, &place)? else {
                continue;
            };
            let bytes = decode_view(document, &meshopt).map_err(|e| e.within(format!("{place}, {name}")))?;
            document.decoded.insert(index, bytes);
        }
    }
    draco::decode(document)
}

/// The bytes of a buffer view that meshoptimizer has compressed.
fn decode_view(document: &Document, meshopt: &Meshopt) -> Result<Vec<u8>> {
    let Meshopt { buffer, byte_offset, byte_length, byte_stride: stride, count, mode, filter } = *meshopt;
    let bytes = document.buffer_range(buffer, byte_offset, byte_length)?;
    count_bytes(document, (stride as u64).saturating_mul(count as u64), bytes.len())?;
    let sound = match mode {
        Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride) && filter.allows(stride),
        Mode::Triangles => matches!(stride, 2 | 4) && count.is_multiple_of(3),
        Mode::Indices => matches!(stride, 2 | 4),
    };
    if !sound {
        return Err(damaged(format!("a stride of {stride} bytes for {count} elements is not allowed")));
    }
    let text = |e: meshopt::Error| damaged(e);
    Ok(match (mode, stride) {
        (Mode::Attributes, _) => filtered(vertices(bytes, count, stride)?, stride, filter),
        (Mode::Triangles, 2) => bytes_of(&meshopt::decode_index_buffer::<u16>(bytes, count).map_err(text)?),
        (Mode::Triangles, _) => bytes_of(&meshopt::decode_index_buffer::<u32>(bytes, count).map_err(text)?),
        (Mode::Indices, 2) => bytes_of(&meshopt::decode_index_sequence::<u16>(bytes, count).map_err(text)?),
        (Mode::Indices, _) => bytes_of(&meshopt::decode_index_sequence::<u32>(bytes, count).map_err(text)?),
    })
}

fn bytes_of<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

/// An element of `N` words.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Words([0; N])
    }
}

/// Decodes `count` vertices of `stride` bytes, a multiple of 4 up to 256.
fn vertices(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>> {
    fn of<const N: usize>(bytes: &[u8], count: usize) -> Result<Vec<u8>> {
        let decoded = meshopt::decode_vertex_buffer::<Words<N>>(bytes, count).map_err(damaged)?;
        Ok(decoded.iter().flat_map(|Words(words)| words.iter().flat_map(|word| word.to_le_bytes())).collect())
    }
    macro_rules! choose {
        ($($n:literal)*) => { match stride / 4 { $($n => of::<$n>(bytes, count),)* _ => Err(damaged(stride)) } };
    }
    choose!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39
        40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

/// Undoes the filter of decoded vertices.
fn filtered(bytes: Vec<u8>, stride: usize, filter: Filter) -> Vec<u8> {
    fn elements<T: bytemuck::Pod>(bytes: &[u8], apply: impl Fn(&mut [T])) -> Vec<u8> {
        let mut values: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
        apply(&mut values);
        bytes_of(&values)
    }
    match (filter, stride) {
        (Filter::None, _) => bytes,
        (Filter::Octahedral, 4) => elements(&bytes, meshopt::decode_filter_oct::<i8>),
        (Filter::Octahedral, _) => elements(&bytes, meshopt::decode_filter_oct::<i16>),
        (Filter::Quaternion, _) => elements(&bytes, meshopt::decode_filter_quat),
        (Filter::Exponential, _) => elements(&bytes, meshopt::decode_filter_exp::<1>),
        (Filter::Color, 4) => elements(&bytes, meshopt::decode_filter_color::<u8>),
        (Filter::Color, _) => elements(&bytes, meshopt::decode_filter_color::<u16>),
    }
}
