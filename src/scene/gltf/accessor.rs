//! Reads accessors (specification, section 3.6.2; KHR_mesh_quantization, section 2.8). Every range is checked before
//! memory is allocated.

use super::document::{Document, at, get};
use super::fault;
use crate::error::Result;
use crate::memory;
use gltf::json::accessor::ComponentType;
use gltf::json::accessor::sparse::Sparse;
use gltf::json::validation::Checked;

const DAMAGED: &str = "the file is damaged: export it again";

/// Elements of a buffer view: `size` bytes each, `stride` bytes apart.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    /// Finds `count` elements of `size` bytes, `stride` bytes apart, from byte `offset` of a buffer view. An error if
    /// they are not within the view.
    fn new(view: &'a [u8], offset: u64, count: u64, size: usize, stride: Option<usize>) -> Result<Elements<'a>> {
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(
                fault("", format!("a stride of {stride} bytes is too small for elements of {size}")).hint(DAMAGED)
            );
        }
        let needed = match count {
            0 => Some(offset),
            _ => (stride as u64).checked_mul(count - 1).and_then(|n| n.checked_add(size as u64)?.checked_add(offset)),
        };
        let have = view.len() as u64;
        if needed.is_none_or(|needed| needed > have) {
            let needed = needed.map_or("more bytes than can be".into(), |n| format!("{n} bytes"));
            return Err(fault("", format!("{count} elements take {needed}, its buffer view has {have}")).hint(DAMAGED));
        }
        // The casts are exact, because both are at most the length of `view`.
        Ok(Elements { bytes: &view[offset as usize..], stride, size, count: count as usize })
    }

    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        (0..self.count).map(|i| &self.bytes[i * self.stride..][..self.size])
    }
}

fn unsigned(component: ComponentType, bytes: &[u8]) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a, ..]) => u32::from(a),
        (ComponentType::U16, &[a, b, ..]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}

/// Converts a component to a float; normalised integers by the equations of section 3.6.2.2.
fn float(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let (value, largest) = match (component, bytes) {
        (ComponentType::F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]),
        (ComponentType::I8, &[a, ..]) => (f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a, ..]) => (f32::from(a), 255.0),
        (ComponentType::I16, &[a, b, ..]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b, ..]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
        _ => (0.0, 1.0),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

impl Document<'_> {
    /// Number of components (1 to 16) in each element of the accessor with this index.
    pub(super) fn width(&self, index: usize) -> Result<usize> {
        match get(&self.accessors, index, "accessor")?.type_ {
            Checked::Valid(kind) => Ok(kind.multiplicity()),
            Checked::Invalid => Err(fault(at("accessor", index), "its type is unknown").hint(DAMAGED)),
        }
    }

    /// Reads an accessor of vectors of `N` floats, which may be non-finite.
    pub(super) fn floats<const N: usize>(&self, index: usize) -> Result<Vec<[f32; N]>> {
        let normalized = get(&self.accessors, index, "accessor")?.normalized;
        self.elements(
            index,
            N,
            [0.0; N],
            &|component, bytes| {
                let size = component.size();
                std::array::from_fn(|i| float(component, normalized, &bytes[i * size..]))
            },
            false,
        )
    }

    /// Reads the displacements of a morph target, one per vertex of a mesh of `vertices` vertices. The file may leave
    /// out their data, because the number of vertices was already checked.
    pub(super) fn displacements(&self, index: usize, vertices: usize) -> Result<Vec<[f32; 3]>> {
        let count = get(&self.accessors, index, "accessor")?.count.0;
        if count != vertices as u64 {
            return Err(fault(at("accessor", index), format!("{count} displacements are for {vertices} vertices"))
                .hint(DAMAGED));
        }
        let left = self.zeros_left.replace(count);
        let deltas = self.floats::<3>(index);
        self.zeros_left.set(left);
        deltas
    }

    /// Reads an accessor of vertex indices.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>> {
        self.elements(index, 1, 0, &unsigned, true)
    }

    fn elements<T: Copy>(
        &self,
        index: usize,
        width: usize,
        zero: T,
        decode: &dyn Fn(ComponentType, &[u8]) -> T,
        integers: bool,
    ) -> Result<Vec<T>> {
        let place = || at("accessor", index);
        let accessor = get(&self.accessors, index, "accessor")?;
        let Checked::Valid(component) = accessor.component_type else {
            return Err(fault(place(), "its component type is unknown").hint(DAMAGED));
        };
        let component = component.0;
        let signed = matches!(component, ComponentType::I8 | ComponentType::I16 | ComponentType::F32);
        if (integers && signed) || (!integers && component == ComponentType::U32) {
            return Err(fault(place(), format!("components of type {component:?} cannot serve here")).hint(DAMAGED));
        }
        let have = self.width(index)?;
        if have != width {
            return Err(fault(place(), format!("its elements have {have} components instead of {width}")).hint(DAMAGED));
        }
        let (count, size) = (accessor.count.0, width * component.size());
        // Called only after the count was checked against the data.
        let allocate = |count: usize| {
            let bytes = count as u64 * size_of::<T>() as u64;
            let error = self.count_bytes(bytes, "its elements");
            error.map_err(|e| e.hint("render fewer or simpler meshes, or with more memory"))?;
            memory::reserve(count, "elements")
        };
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let bytes = self.view(view.value()).map_err(|e| e.within(place()))?;
                let stride = get(&self.views, view.value(), "buffer view")?.byte_stride.map(|s| s.0);
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let elements = Elements::new(bytes, offset, count, size, stride).map_err(|e| e.within(place()))?;
                let mut values = allocate(elements.count).map_err(|e| e.within(place()))?;
                values.extend(elements.iter().map(|bytes| decode(component, bytes)));
                values
            }
            None => {
                let Some(left) = self.zeros_left.get().checked_sub(count) else {
                    let cause = format!("{count} elements are promised without any data");
                    return Err(fault(place(), cause).hint(DAMAGED));
                };
                self.zeros_left.set(left);
                let mut values = allocate(count as usize).map_err(|e| e.within(place()))?;
                values.resize(count as usize, zero);
                values
            }
        };
        if let Some(sparse) = &accessor.sparse {
            self.replace_sparse(sparse, &mut values, size, &|bytes| decode(component, bytes))
                .map_err(|e| e.within(place()))?;
        }
        Ok(values)
    }

    /// Replaces the elements that a sparse accessor lists; `size` is the size of an element in bytes.
    fn replace_sparse<T>(
        &self,
        sparse: &Sparse,
        values: &mut [T],
        size: usize,
        decode: &dyn Fn(&[u8]) -> T,
    ) -> Result<()> {
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err(fault("", "the component type of its sparse indices is unknown").hint(DAMAGED));
        };
        let part =
            |view: usize, offset: u64, size: usize| Elements::new(self.view(view)?, offset, sparse.count.0, size, None);
        let (i, v) = (&sparse.indices, &sparse.values);
        let keys = part(i.buffer_view.value(), i.byte_offset.0, kind.0.size())?;
        let replacements = part(v.buffer_view.value(), v.byte_offset.0, size)?;
        let count = values.len();
        for (key, bytes) in keys.iter().zip(replacements.iter()) {
            let key = unsigned(kind.0, key);
            match values.get_mut(key as usize) {
                Some(value) => *value = decode(bytes),
                None => {
                    let cause = format!("sparse index {key} is past its {count} elements");
                    return Err(fault("", cause).hint(DAMAGED));
                }
            }
        }
        Ok(())
    }
}
