//! Compressed geometry: KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_meshopt_compression. Compressed data
//! are decoded into buffer views, so that the rest of the reader sees plain accessors.

use super::container::MESHOPT;
use super::document::{Document, at, extension, get, named};
use super::fault;
use crate::error::{Error, Result};
use draco_oxide_core::attribute::{Attribute, ComponentDataType};
use draco_oxide_core::types::PointIdx;
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

const DRACO: &str = "KHR_draco_mesh_compression";

/// Content of KHR_draco_mesh_compression.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Draco {
    buffer_view: usize,
    /// Unique ids of the attributes in the compressed data, by their names.
    attributes: BTreeMap<String, usize>,
}

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

/// Bytes of a decoded element that a compressed byte can at most stand for, as a bound on what a small file may
/// allocate: both codecs reach about a thousand for constant data.
const MAX_RATIO: u64 = 1 << 12;

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
    for mesh in 0..document.meshes.len() {
        for primitive in 0..document.meshes[mesh].primitives.len() {
            let raw = &document.part("meshes", mesh)["primitives"][primitive];
            let place =
                format!("{}, primitive {primitive}", named("mesh", document.meshes[mesh].name.as_deref(), mesh));
            if let Some(draco) = extension::<Draco>(raw, DRACO, &place)? {
                decode_primitive(document, (mesh, primitive), &draco)
                    .map_err(|e| e.within(format!("{place}, {}", DRACO)))?;
            }
        }
    }
    Ok(())
}

/// The fault of an attribute of a kind that the decoder does not give.
const BAD_ATTRIBUTE: &str = "an attribute is damaged";

/// The error about compressed data that cannot be decoded.
fn damaged(cause: impl std::fmt::Display) -> Error {
    fault("", format!("its data cannot be decoded: {cause}")).hint(
        "the file is damaged: export it again, or decompress it elsewhere with 'gltf-transform copy IN.glb OUT.glb'",
    )
}

/// Counts the memory of `bytes` decoded bytes, of `compressed` ones.
fn count_bytes(document: &Document, bytes: u64, compressed: usize) -> Result<()> {
    if bytes > (compressed as u64).saturating_mul(MAX_RATIO) {
        return Err(damaged(format!("{compressed} bytes do not hold {bytes}")));
    }
    let error = document.count_bytes(bytes, "decompressed data");
    error.map_err(|e| e.hint("render fewer or simpler meshes, or with more memory"))
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

/// Decodes a primitive that Draco has compressed, unless its accessors have data of their own. Its accessors then refer
/// to new buffer views with the decoded data.
fn decode_primitive(document: &mut Document, (mesh, primitive): (usize, usize), draco: &Draco) -> Result<()> {
    let source = &document.meshes[mesh].primitives[primitive];
    let accessors = |key: &str| {
        let found = source.attributes.iter().find(|(semantic, _)| match semantic {
            Checked::Valid(semantic) => semantic.to_string() == key,
            Checked::Invalid => false,
        });
        found.map(|(_, index)| index.value())
    };
    let targets: Vec<(usize, usize)> =
        draco.attributes.iter().filter_map(|(key, id)| Some((accessors(key)?, *id))).collect();
    let indices = source.indices.map(|indices| indices.value());
    let mut is_plain = true;
    for index in targets.iter().map(|(index, _)| *index).chain(indices) {
        let accessor = get(&document.accessors, index, "accessor")?;
        is_plain &= accessor.buffer_view.is_some() || accessor.sparse.is_some();
    }
    if is_plain {
        return Ok(());
    }
    let bytes = document.view(draco.buffer_view)?;
    let promised = |index: usize| document.accessors[index].count.0;
    let counts = targets.iter().map(|(index, _)| *index).chain(indices).map(promised);
    count_bytes(document, counts.fold(0, u64::saturating_add).saturating_mul(16), bytes.len())?;
    // A panic of the decoder must not end the program.
    let decoded = catch_unwind(AssertUnwindSafe(|| draco_oxide_decoder::decode_mesh(bytes)));
    let decoded = decoded.map_err(|_| damaged("the decoder failed"))?.map_err(damaged)?;
    let faces: Vec<u32> = decoded.faces.iter().flatten().map(|point| usize::from(*point) as u32).collect();
    let points = faces.iter().max().map_or(0, |last| *last as usize + 1);
    for (index, id) in targets {
        let attribute = decoded.attributes.iter().find(|attribute| attribute.get_id().as_usize() == id);
        let attribute = attribute.ok_or_else(|| damaged(format!("it has no attribute {id}")))?;
        let (bytes, component) = values(attribute, points)?;
        let kind = match attribute.get_num_components() {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            _ => return Err(damaged(BAD_ATTRIBUTE)),
        };
        replace(document, index, bytes, points, (component, kind));
    }
    if let Some(index) = indices {
        replace(document, index, bytes_of(&faces), faces.len(), (ComponentType::U32, Type::Scalar));
    } else {
        // Without indices, the primitive lists its triangles' vertices in the order of the faces.
        document.meshes[mesh].primitives[primitive].indices = Some(Index::new(document.accessors.len() as u32));
        let count = USize64(faces.len() as u64);
        document.accessors.push(Accessor { count, ..document.accessors[0].clone() });
        replace(
            document,
            document.accessors.len() - 1,
            bytes_of(&faces),
            faces.len(),
            (ComponentType::U32, Type::Scalar),
        );
    }
    Ok(())
}

/// The values of an attribute for points `0..points`, as bytes, and their type.
fn values(attribute: &Attribute, points: usize) -> Result<(Vec<u8>, ComponentType)> {
    let component = match attribute.get_component_type() {
        ComponentDataType::I8 => ComponentType::I8,
        ComponentDataType::U8 => ComponentType::U8,
        ComponentDataType::I16 => ComponentType::I16,
        ComponentDataType::U16 => ComponentType::U16,
        ComponentDataType::U32 => ComponentType::U32,
        ComponentDataType::F32 => ComponentType::F32,
        _ => return Err(damaged(BAD_ATTRIBUTE)),
    };
    let size = component.size() * attribute.get_num_components();
    let unique = attribute.get_data_as_bytes();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..points {
        if point >= attribute.len() {
            return Err(damaged(BAD_ATTRIBUTE));
        }
        let at = usize::from(attribute.get_unique_val_idx(PointIdx::from(point))) * size;
        let value = at.checked_add(size).and_then(|end| unique.get(at..end));
        bytes.extend_from_slice(value.ok_or_else(|| damaged(BAD_ATTRIBUTE))?);
    }
    Ok((bytes, component))
}

/// Gives the accessor `index` decoded data, in a new buffer view.
fn replace(
    document: &mut Document,
    index: usize,
    bytes: Vec<u8>,
    count: usize,
    (component, kind): (ComponentType, Type),
) {
    let view = document.views.len();
    document.views.push(View {
        buffer: Index::new(0),
        byte_length: USize64(bytes.len() as u64),
        byte_offset: None,
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: None,
    });
    document.decoded.insert(view, bytes);
    let accessor = &mut document.accessors[index];
    accessor.buffer_view = Some(Index::new(view as u32));
    accessor.byte_offset = None;
    accessor.count = USize64(count as u64);
    accessor.component_type = Checked::Valid(GenericComponentType(component));
    accessor.type_ = Checked::Valid(kind);
}
