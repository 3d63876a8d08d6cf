//! Geometry that Draco has compressed (KHR_draco_mesh_compression). Its decoder runs in a process of its own: it believes
//! the sizes in the data, and indexes without checks.

use super::codec::{BAD_ATTRIBUTE, COMPONENTS, Compressed, Layout};
use super::document::{Document, extension, get, named};
use super::isolated::{self, count_bytes, damaged};
use crate::error::{Error, Result};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index};
use serde::Deserialize;
use std::collections::{BTreeMap, HashSet};

const DRACO: &str = "KHR_draco_mesh_compression";

/// Bytes that each element of an accessor counts as: those of a vector of four floats.
const ELEMENT_BYTES: u64 = 16;

/// Content of KHR_draco_mesh_compression.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Draco {
    buffer_view: usize,
    /// Unique ids of the attributes in the compressed data, by their names.
    attributes: BTreeMap<String, usize>,
}

/// A primitive to decode.
struct Job {
    mesh: usize,
    primitive: usize,
    /// The primitive and the extension, for errors.
    place: String,
    /// Index of the buffer view with the compressed data.
    view: usize,
    /// Indices of the accessors that receive attributes, and the attributes' unique ids.
    targets: Vec<(usize, usize)>,
    /// Index of the accessor that receives the vertices of the triangles.
    indices: Option<usize>,
}

/// Decodes the primitives of a document that Draco has compressed. A primitive whose accessors have data of their own
/// keeps them. The accessors of the others then refer to new buffer views with the decoded data.
///
/// # Errors
/// Compressed data are damaged.
pub(super) fn decode(document: &mut Document) -> Result<()> {
    let (jobs, bytes) = jobs(document)?;
    if jobs.is_empty() {
        return Ok(());
    }
    let data = jobs.iter().map(|job| {
        let stream = document.view(job.view).map_err(|error| error.within(&job.place))?;
        Ok(Compressed::Draco(stream, job.targets.clone()))
    });
    let decoded = isolated::decode_each(bytes, &data.collect::<Result<Vec<_>>>()?)?;
    for (job, decoded) in jobs.iter().zip(decoded) {
        let outcome = decoded.map_err(damaged).and_then(|bytes| apply(document, job, &bytes));
        outcome.map_err(|error| error.within(&job.place))?;
    }
    Ok(())
}

/// The primitives to decode, and the bytes that their accessors promise.
fn jobs(document: &Document) -> Result<(Vec<Job>, u64)> {
    let (mut jobs, mut bytes, mut decoded) = (Vec::new(), 0u64, HashSet::new());
    for (mesh, described) in document.meshes.iter().enumerate() {
        for primitive in 0..described.primitives.len() {
            let raw = &document.part("meshes", mesh)["primitives"][primitive];
            let place = format!("{}, primitive {primitive}", named("mesh", described.name.as_deref(), mesh));
            let Some(draco) = extension::<Draco>(raw, DRACO, &place)? else { continue };
            let place = format!("{place}, {DRACO}");
            let job = job(document, mesh, primitive, &draco, place.clone(), &mut decoded);
            if let Some((job, promised)) = job.map_err(|error: Error| error.within(place))? {
                bytes = bytes.saturating_add(promised);
                jobs.push(job);
            }
        }
    }
    Ok((jobs, bytes))
}

/// The job of a primitive, and the bytes that its accessors promise; `None` if they have data, or share those in
/// `decoded`, which others receive.
fn job(
    document: &Document,
    mesh: usize,
    primitive: usize,
    draco: &Draco,
    place: String,
    decoded: &mut HashSet<usize>,
) -> Result<Option<(Job, u64)>> {
    let source = &document.meshes[mesh].primitives[primitive];
    let accessor = |key: &str| {
        let found = source.attributes.iter().find(|(semantic, _)| match semantic {
            Checked::Valid(semantic) => semantic.to_string() == key,
            Checked::Invalid => false,
        });
        found.map(|(_, index)| index.value())
    };
    let targets: Vec<(usize, usize)> =
        draco.attributes.iter().filter_map(|(key, id)| Some((accessor(key)?, *id))).collect();
    let indices = source.indices.map(|indices| indices.value());
    let all = || targets.iter().map(|(index, _)| *index).chain(indices);
    let (mut is_plain, mut elements) = (true, 0u64);
    for index in all() {
        let accessor = get(&document.accessors, index, "accessor")?;
        is_plain &= accessor.buffer_view.is_some() || accessor.sparse.is_some() || decoded.contains(&index);
        elements = elements.saturating_add(accessor.count.0);
    }
    if is_plain {
        return Ok(None);
    }
    let bytes = elements.saturating_mul(ELEMENT_BYTES);
    count_bytes(document, bytes, document.view(draco.buffer_view)?.len())?;
    decoded.extend(all());
    Ok(Some((Job { mesh, primitive, place, view: draco.buffer_view, targets, indices }, bytes)))
}

/// Gives the accessors of a primitive the data that the decoder has made.
fn apply(document: &mut Document, job: &Job, bytes: &[u8]) -> Result<()> {
    let broken = || damaged(BAD_ATTRIBUTE);
    let (layout, mut rest) = postcard::take_from_bytes::<Layout>(bytes).map_err(|_| broken())?;
    let mut take = |count: usize, size: usize| {
        let (taken, left) = rest.split_at_checked(count.checked_mul(size)?)?;
        rest = left;
        Some(taken.to_vec())
    };
    let Layout { corners, points, attributes } = layout;
    let faces = take(corners, size_of::<u32>()).ok_or_else(broken)?;
    for ((index, _), (component, width)) in job.targets.iter().zip(attributes) {
        let component = *COMPONENTS.get(component).ok_or_else(broken)?;
        let kind = match width {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            _ => return Err(broken()),
        };
        let values = take(points, component.size() * width).ok_or_else(broken)?;
        replace(document, *index, values, points, component, kind);
    }
    let indices = job.indices.unwrap_or_else(|| {
        // Without indices, the primitive lists its triangles' vertices in the order of the faces.
        let index = document.accessors.len();
        document.meshes[job.mesh].primitives[job.primitive].indices = Some(Index::new(index as u32));
        document.accessors.push(Accessor { count: USize64(corners as u64), ..document.accessors[0].clone() });
        index
    });
    replace(document, indices, faces, corners, ComponentType::U32, Type::Scalar);
    Ok(())
}

/// Gives the accessor `index` decoded data, in a new buffer view.
fn replace(document: &mut Document, index: usize, bytes: Vec<u8>, count: usize, component: ComponentType, kind: Type) {
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
