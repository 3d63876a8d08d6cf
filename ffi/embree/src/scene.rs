//! Scenes: built from triangle meshes and instances, then immutable.

use std::collections::HashMap;
use std::sync::Arc;

use crate::api::{self, Handle, RawBounds, Trace};
use crate::device::Device;
use crate::error::Error;
use crate::filter::{self, Filter};
use crate::geometry::{Bounds, GeometryId, MAX_COORDINATE, MAX_GEOMETRY_ID};
use crate::transform;

/// Builds a scene from triangle meshes and instances of other scenes.
///
/// Scenes are built in Embree's robust mode: rays do not pass between triangles that share an edge. At corners a gap of
/// about the rounding error remains: one or two in a hundred rays aimed exactly at the corners of a tessellated sphere
/// miss it.
///
/// The triangle that is hit by a ray through a shared edge depends neither on the number of threads nor on the run.
/// Therefore the build quality is medium: according to Embree's documentation, only the builder for high quality is not
/// deterministic, and robust scenes do not use it anyway.
pub struct SceneBuilder {
    owned: Owned,
    geometries: HashMap<GeometryId, BuilderGeometry>,
    has_instances: bool,
    has_filters: bool,
    /// Largest absolute coordinate of a ray that the scene accepts.
    max_ray_coordinate: f32,
}

/// A geometry that was added to a scene builder.
enum BuilderGeometry {
    /// A triangle mesh.
    Mesh(Geometry),
    /// A mesh without triangles, which is not passed to Embree.
    Empty,
    /// An instance of another scene.
    Instance(Geometry),
}

/// An Embree scene and the objects that it points to. The fields are dropped in this order.
struct Owned {
    raw: RawScene,
    /// Filters whose addresses Embree holds. An `Arc` keeps the address stable.
    filters: Vec<Arc<Filter>>,
    children: Vec<Scene>,
}

struct RawScene {
    raw: Handle,
    device: Device,
}

/// An Embree geometry, of which this value holds one reference.
struct Geometry {
    raw: Handle,
    device: Device,
}

// SAFETY: Embree's objects have atomic reference counts and belong to no thread. Changes need `&mut`.
unsafe impl Send for RawScene {}
// SAFETY: as above. Through `&` a committed scene is only read.
unsafe impl Sync for RawScene {}
// SAFETY: as for `RawScene`.
unsafe impl Send for Geometry {}
// SAFETY: as for `RawScene`.
unsafe impl Sync for Geometry {}

impl Drop for RawScene {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_scene` and is released once.
        unsafe { (self.device.common().release_scene)(self.raw) }
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_geometry` and is released once.
        unsafe { (self.device.common().release_geometry)(self.raw) }
    }
}

impl Geometry {
    fn new(device: &Device, kind: u32) -> Result<Geometry, Error> {
        // SAFETY: the device is alive and the kind is one of Embree's.
        let raw = unsafe { (device.common().new_geometry)(device.raw(), kind) };
        let raw = device.check_handle(raw, "make a geometry")?;
        Ok(Geometry { raw, device: device.clone() })
    }

    /// Copies `items` to a new buffer of the geometry, which Embree pads as its vector loads require.
    fn fill<T: Copy>(&self, buffer: u32, format: u32, items: &[[T; 3]]) -> Result<(), Error> {
        const { assert!(size_of::<[T; 3]>() == 12) };
        let during = "make a buffer";
        // SAFETY: the geometry is alive; Embree allocates at least `items.len()` items of 12 bytes.
        let memory = unsafe { (self.device.common().new_buffer)(self.raw, buffer, 0, format, 12, items.len()) };
        let memory = self.device.check_handle(memory, during)?;
        // SAFETY: `memory` has room for the items, is aligned to 16, and nothing else refers to it.
        unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), memory as *mut [T; 3], items.len()) };
        Ok(())
    }
}

impl SceneBuilder {
    /// Creates a builder of an empty scene.
    ///
    /// # Errors
    ///
    /// [`Error::Embree`] when memory is short.
    pub fn new(device: &Device) -> Result<SceneBuilder, Error> {
        let during = "make a scene";
        let common = device.common();
        // SAFETY: the device is alive.
        let raw = device.check_handle(unsafe { (common.new_scene)(device.raw()) }, during)?;
        let raw = RawScene { raw, device: device.clone() };
        // SAFETY: the scene was just made.
        unsafe {
            (common.set_scene_flags)(raw.raw, api::SCENE_FLAG_ROBUST | api::SCENE_FLAG_RAY_FILTER);
            (common.set_scene_quality)(raw.raw, api::BUILD_QUALITY_MEDIUM);
        }
        device.check(during)?;
        let owned = Owned { raw, filters: Vec::new(), children: Vec::new() };
        Ok(SceneBuilder {
            owned,
            geometries: HashMap::new(),
            has_instances: false,
            has_filters: false,
            max_ray_coordinate: MAX_COORDINATE,
        })
    }

    /// Adds a triangle mesh and copies its data. Degenerate triangles are allowed and never hit. A mesh without
    /// triangles is allowed, too.
    ///
    /// # Errors
    ///
    /// [`Error::BadVertex`], [`Error::BadIndex`], [`Error::DuplicateId`], [`Error::IdTooLarge`], or [`Error::Embree`]
    /// when memory is short. The builder stays usable after an error.
    pub fn triangles(&mut self, id: GeometryId, positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Result<(), Error> {
        self.check_id(id)?;
        // This form rejects NaN.
        let fits = |position: &[f32; 3]| position.iter().all(|x| x.abs() <= MAX_COORDINATE);
        if let Some(vertex) = positions.iter().position(|position| !fits(position)) {
            return Err(Error::BadVertex { geometry: id, vertex, position: positions[vertex] });
        }
        let vertices = positions.len();
        for (triangle, corners) in indices.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= vertices) {
                return Err(Error::BadIndex { geometry: id, triangle, index, vertices });
            }
        }
        if indices.is_empty() {
            self.geometries.insert(id, BuilderGeometry::Empty);
            return Ok(());
        }
        let mesh = Geometry::new(self.device(), api::GEOMETRY_TYPE_TRIANGLE)?;
        mesh.fill(api::BUFFER_TYPE_VERTEX, api::FORMAT_FLOAT3, positions)?;
        mesh.fill(api::BUFFER_TYPE_INDEX, api::FORMAT_UINT3, indices)?;
        self.geometries.insert(id, BuilderGeometry::Mesh(mesh));
        Ok(())
    }

    /// Adds an instance of a committed scene. `local_to_world` is the column-major 3x4 matrix of the affine transform:
    /// the images of the x, y and z axes, then the translation.
    ///
    /// # Errors
    ///
    /// [`Error::BadTransform`], [`Error::NestedInstance`], [`Error::OtherDevice`], [`Error::DuplicateId`],
    /// [`Error::IdTooLarge`], or [`Error::Embree`] when memory is short.
    pub fn instance(&mut self, id: GeometryId, child: &Scene, local_to_world: &[f32; 12]) -> Result<(), Error> {
        self.check_id(id)?;
        if !child.shared.owned.raw.device.is(self.device()) {
            return Err(Error::OtherDevice(id));
        }
        if child.shared.has_instances {
            return Err(Error::NestedInstance(id));
        }
        let Some(limit) = transform::max_ray_coordinate(local_to_world, child.bounds()) else {
            return Err(Error::BadTransform { geometry: id, local_to_world: *local_to_world });
        };
        let instance = Geometry::new(self.device(), api::GEOMETRY_TYPE_INSTANCE)?;
        let common = self.device().common();
        // SAFETY: geometry and child are alive (the child is kept with the scene); the matrix is of the format
        // named, and copied.
        unsafe {
            (common.set_instanced_scene)(instance.raw, child.raw);
            let format = api::FORMAT_FLOAT3X4_COLUMN_MAJOR;
            (common.set_transform)(instance.raw, 0, format, local_to_world.as_ptr());
        }
        self.device().check("make an instance")?;
        self.owned.children.push(child.clone());
        self.max_ray_coordinate = self.max_ray_coordinate.min(limit);
        self.has_instances = true;
        self.has_filters |= child.filtered;
        self.geometries.insert(id, BuilderGeometry::Instance(instance));
        Ok(())
    }

    /// Sets the filter of the mesh `id`, which decides on every hit of all queries. It replaces an earlier filter of
    /// the mesh. It must be a pure function (see [`Filter`]). If it panics, the panic continues in the call that traces
    /// the ray.
    ///
    /// # Errors
    ///
    /// [`Error::NoSuchMesh`] unless `id` was passed to [`SceneBuilder::triangles`] before.
    pub fn filter(&mut self, id: GeometryId, filter: Filter) -> Result<(), Error> {
        let mesh = match self.geometries.get(&id) {
            Some(BuilderGeometry::Mesh(mesh)) => mesh,
            Some(BuilderGeometry::Empty) => return Ok(()),
            Some(BuilderGeometry::Instance(_)) | None => return Err(Error::NoSuchMesh(id)),
        };
        let filter = Arc::new(filter);
        let common = self.owned.raw.device.common();
        // SAFETY: the mesh is alive; the filter is kept as long as the scene, at an address that stays.
        unsafe {
            (common.set_user_data)(mesh.raw, Arc::as_ptr(&filter).cast());
            (common.set_intersect_filter)(mesh.raw, filter::call);
            (common.set_occluded_filter)(mesh.raw, filter::call);
        }
        self.owned.filters.push(filter);
        self.has_filters = true;
        self.device().check("set a filter")
    }

    /// Builds the scene's acceleration structure, with the device's threads.
    ///
    /// # Errors
    ///
    /// [`Error::Embree`] when memory is short.
    pub fn commit(self) -> Result<Scene, Error> {
        let device = self.owned.raw.device.clone();
        let common = device.common();
        let scene = self.owned.raw.raw;
        for (id, geometry) in &self.geometries {
            if let BuilderGeometry::Mesh(geometry) | BuilderGeometry::Instance(geometry) = geometry {
                // SAFETY: both are alive; the scene takes its own reference to the geometry.
                unsafe {
                    (common.commit_geometry)(geometry.raw);
                    (common.attach_geometry)(scene, geometry.raw, id.0);
                }
            }
        }
        // SAFETY: the scene is alive and all its geometries are committed.
        unsafe { (common.commit_scene)(scene) };
        if let Err(error) = device.check("build a scene") {
            // Embree may end the process when it destroys a scene whose construction has failed.
            std::mem::forget(self.owned);
            return Err(error);
        }
        let shared = Shared { owned: self.owned, has_instances: self.has_instances };
        let trace = device.library().trace();
        // SAFETY: the device is alive.
        let eight = unsafe { (common.device_property)(device.raw(), api::DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) } != 0;
        let packets = eight && !self.has_filters;
        Ok(Scene {
            raw: scene,
            trace,
            packets,
            filtered: self.has_filters,
            max_ray_coordinate: self.max_ray_coordinate,
            shared: Arc::new(shared),
        })
    }

    fn device(&self) -> &Device {
        &self.owned.raw.device
    }

    fn check_id(&self, id: GeometryId) -> Result<(), Error> {
        if id > MAX_GEOMETRY_ID {
            return Err(Error::IdTooLarge(id));
        }
        match self.geometries.contains_key(&id) {
            true => Err(Error::DuplicateId(id)),
            false => Ok(()),
        }
    }
}

/// A committed scene: immutable, shared by its clones, and safe to trace from many threads at once. It keeps its
/// instanced scenes, its filters and its device alive.
#[derive(Clone)]
pub struct Scene {
    // Outside of the `Arc`, so that a ray costs one indirection less.
    pub(crate) raw: Handle,
    pub(crate) trace: Trace,
    pub(crate) filtered: bool,
    /// Whether rays may be traced in packets of eight. Not with filters, which expect single rays.
    pub(crate) packets: bool,
    /// Largest absolute coordinate of a ray that the scene accepts.
    pub(crate) max_ray_coordinate: f32,
    shared: Arc<Shared>,
}

struct Shared {
    owned: Owned,
    has_instances: bool,
}

// SAFETY: `raw` is owned by `shared`, and tracing a committed scene only reads it; see `RawScene`.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    /// The smallest axis-aligned box that contains the scene; `None` if the scene is empty.
    pub fn bounds(&self) -> Option<Bounds> {
        let device = &self.shared.owned.raw.device;
        let mut bounds = RawBounds { lower: [f32::INFINITY; 4], upper: [f32::NEG_INFINITY; 4] };
        // SAFETY: the scene is committed, `bounds` has the size and alignment of `RTCBounds`.
        unsafe { (device.common().scene_bounds)(self.raw, &mut bounds) };
        let ([x, y, z, _], [a, b, c, _]) = (bounds.lower, bounds.upper);
        (x <= a && y <= b && z <= c).then_some(Bounds { min: [x, y, z], max: [a, b, c] })
    }

    /// The Embree device that the scene was built with.
    pub fn device(&self) -> &Device {
        &self.shared.owned.raw.device
    }
}
