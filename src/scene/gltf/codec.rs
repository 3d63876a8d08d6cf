//! Decoders of compressed meshes and images, by other libraries. They believe the sizes in the data, so they run in a
//! process of their own (`isolated.rs`).

use draco_oxide_core::attribute::{Attribute, ComponentDataType};
use draco_oxide_core::types::PointIdx;
use gltf::json::accessor::ComponentType;
use image::{DynamicImage, ImageFormat};
use serde::{Deserialize, Serialize};

/// The decoded bytes, or the cause of the decoder's failure.
pub(super) type Decoded = std::result::Result<Vec<u8>, String>;

/// Compressed data, and what their decoder needs to know.
#[derive(Serialize, Deserialize)]
pub(super) enum Compressed<'a> {
    /// A mesh, and the attributes to decode, see [`decode_draco`].
    Draco(&'a [u8], Vec<(usize, usize)>),
    /// A file of Basis Universal, and the size of its image.
    Basis(&'a [u8], (u32, u32)),
    /// A file of WebP.
    WebP(&'a [u8]),
}

impl Compressed<'_> {
    /// Decodes the data in this process, which the decoder may end.
    pub(super) fn decode(&self) -> Decoded {
        match self {
            Compressed::Draco(stream, targets) => decode_draco(stream, targets),
            Compressed::Basis(file, size) => decode_basis_file(file, *size),
            Compressed::WebP(file) => decode_webp_file(file),
        }
    }
}

/// The sizes of decoded data. The vertices of the triangles follow, 4 bytes each, and then the attributes.
#[derive(Serialize, Deserialize)]
pub(super) struct Layout {
    /// Number of vertices of all triangles.
    pub corners: usize,
    /// Number of points, the length of each attribute.
    pub points: usize,
    /// For each attribute, the index of its type in [`COMPONENTS`] and its number of components.
    pub attributes: Vec<(usize, usize)>,
}

/// The fault of an attribute of a kind that the decoder does not give.
pub(super) const BAD_ATTRIBUTE: &str = "an attribute is damaged";

/// Types of components, by their index in a [`Layout`].
pub(super) const COMPONENTS: [ComponentType; 6] = [
    ComponentType::I8,
    ComponentType::U8,
    ComponentType::I16,
    ComponentType::U16,
    ComponentType::U32,
    ComponentType::F32,
];

/// Decodes compressed data to a [`Layout`], triangles, and the attributes of `targets`.
fn decode_draco(stream: &[u8], targets: &[(usize, usize)]) -> Decoded {
    let mesh = draco_oxide_decoder::decode_mesh(stream).map_err(|error| error.to_string())?;
    let faces: Vec<u32> = mesh.faces.iter().flatten().map(|point| usize::from(*point) as u32).collect();
    let points = faces.iter().max().map_or(0, |last| *last as usize + 1);
    let mut layout = Layout { corners: faces.len(), points, attributes: Vec::new() };
    let mut data = bytemuck::cast_slice(&faces).to_vec();
    for (_, id) in targets {
        let attribute = mesh.attributes.iter().find(|attribute| attribute.get_id().as_usize() == *id);
        let attribute = attribute.ok_or_else(|| format!("it has no attribute {id}"))?;
        layout.attributes.push((append_values(attribute, points, &mut data)?, attribute.get_num_components()));
    }
    let mut bytes = postcard::to_allocvec(&layout).map_err(|error| error.to_string())?;
    bytes.append(&mut data);
    Ok(bytes)
}

/// Appends the values of an attribute for points `0..points` to `bytes`, and returns the index of their type.
fn append_values(attribute: &Attribute, points: usize, bytes: &mut Vec<u8>) -> std::result::Result<usize, String> {
    let component = match attribute.get_component_type() {
        ComponentDataType::I8 => 0,
        ComponentDataType::U8 => 1,
        ComponentDataType::I16 => 2,
        ComponentDataType::U16 => 3,
        ComponentDataType::U32 => 4,
        ComponentDataType::F32 => 5,
        _ => return Err(BAD_ATTRIBUTE.into()),
    };
    let size = COMPONENTS[component].size() * attribute.get_num_components();
    let unique = attribute.get_data_as_bytes();
    for point in 0..points {
        if point >= attribute.len() {
            return Err(BAD_ATTRIBUTE.into());
        }
        let at = usize::from(attribute.get_unique_val_idx(PointIdx::from(point))) * size;
        let value = at.checked_add(size).and_then(|end| unique.get(at..end));
        bytes.extend_from_slice(value.ok_or(BAD_ATTRIBUTE)?);
    }
    Ok(component)
}

/// Decodes a file of Basis Universal to texels of four bytes, if its image has the given size.
fn decode_basis_file(bytes: &[u8], expected: (u32, u32)) -> Decoded {
    let transcode = || {
        let image = basisu::Transcoder::new(bytes)?;
        let texels = image.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE)?;
        Ok((image.base_dimensions(), texels))
    };
    let (size, texels) = transcode().map_err(|e: basisu::Error| format!("{e:?}"))?;
    if size == expected { Ok(texels) } else { Err(OTHER_SIZE.into()) }
}

/// The cause of an image of a size that its header does not say.
pub(super) const OTHER_SIZE: &str = "its size contradicts its header";

/// Decodes a file of WebP to texels of three or four bytes.
fn decode_webp_file(bytes: &[u8]) -> Decoded {
    match image::load_from_memory_with_format(bytes, ImageFormat::WebP).map_err(|e| e.to_string())? {
        DynamicImage::ImageRgb8(image) => Ok(image.into_raw()),
        DynamicImage::ImageRgba8(image) => Ok(image.into_raw()),
        _ => Err("its texels are not of 8 bits".into()),
    }
}
