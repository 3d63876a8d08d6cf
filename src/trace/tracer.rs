//! The scene's triangles in Embree, addressed by the indices of [`Shapes`].

use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Shapes;
use crate::installed;
use crate::math::{Affine3A, Vec3};
use caustique_embree as embree;
use embree::GeometryId;
use std::sync::Arc;

/// A segment to trace: the points `origin + t direction` for `0 <= t <= tmax`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Point at t = 0, already moved off the surface that the ray leaves.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Largest t of the segment (m); may be infinite.
    pub tmax: f32,
    /// Random bits for the alpha cut-outs along this ray. In scenes with objects that are hidden from cameras,
    /// [`CAMERA_RAY_BIT`] is set in camera rays and cleared in others. In scenes with shadow linking, [`LINKING_BITS`]
    /// hold the linking of the objects that block the ray.
    pub token: u32,
}

/// Bit of [`Ray::token`] that marks rays from or to the camera. They pass objects that are hidden from cameras.
pub const CAMERA_RAY_BIT: u32 = 1;

/// Position of [`LINKING_BITS`] in [`Ray::token`].
pub const LINKING_SHIFT: u32 = 1;

/// Bits of [`Ray::token`] that hold a linking ([`crate::light::Linking`]): only the objects that are part of it block
/// the ray. 0: all objects do.
pub const LINKING_BITS: u32 = 0x3f << LINKING_SHIFT;

/// The nearest triangle along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray (m).
    pub t: f32,
    /// Barycentric weights of the second and third corner.
    pub barycentric: [f32; 2],
    /// Index of the instance that was hit.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh.
    pub primitive: u32,
}

/// Decides whether a hit counts, for alpha cut-outs, objects that are hidden from cameras, and objects that do not
/// block the light of a shadow ray. Arguments: instance, primitive, barycentric weights of the second and third corner,
/// token of the ray. Must be a pure function.
pub type HitFilter = Arc<dyn Fn(u32, u32, [f32; 2], u32) -> bool + Send + Sync>;

/// If all instances of a mesh together have at most this number of triangles, they are copied into the BVH of the
/// scene. Rays are faster there than through an instance's own BVH, whose box overlaps those of its neighbours.
const MAX_COPIED_TRIANGLES: usize = 1 << 17;

/// The scene's triangles committed to Embree; clones share them.
#[derive(Clone)]
pub struct Tracer {
    scene: embree::Scene,
    /// Id in `scene` of the still part of a moving scene; [`NO_STILL_PART`] if there is none.
    still: u32,
    parts: Arc<Parts>,
}

/// Stands for the id of the still part in scenes that do not move, whose meshes are all in one Embree scene.
const NO_STILL_PART: u32 = u32::MAX;

/// Embree scenes that the moments of a moving scene share.
#[derive(Default)]
struct Parts {
    /// All instances that do not move, in world space; `None` in a scene without movement.
    still: Option<embree::Scene>,
    /// Meshes that are instanced, in their own space, by their index.
    meshes: Vec<Option<embree::Scene>>,
}

fn convert(error: embree::Error) -> Error {
    let hint = error.hint();
    let mut error = Error::new(ErrorKind::Library, "Embree", error);
    error.hint = hint;
    error
}

fn column_major(m: &Affine3A) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|i| columns[i / 3][i % 3])
}

/// Data from which Embree scenes are built.
struct Source<'s> {
    device: embree::Device,
    shapes: &'s Shapes,
    filter: &'s HitFilter,
    /// For each mesh, whether hits are passed to `filter`: if those of any of its instances are. The filter accepts hits
    /// of the others.
    filtered: Vec<bool>,
    /// Id of the still part of a moving scene, or [`NO_STILL_PART`].
    still: u32,
}

impl Source<'_> {
    fn builder(&self) -> Result<embree::SceneBuilder> {
        embree::SceneBuilder::new(&self.device).map_err(convert)
    }

    /// Adds the triangles of a mesh, with the vertices at `place`.
    fn add(&self, builder: &mut embree::SceneBuilder, id: u32, mesh: u32, place: impl Fn(Vec3) -> Vec3) -> Result<()> {
        let data = &self.shapes.meshes[mesh as usize];
        let named = |e: embree::Error| convert(e).within(format_args!("mesh \"{}\"", data.name));
        let positions: Vec<[f32; 3]> = data.positions.iter().map(|&p| place(p).to_array()).collect();
        builder.triangles(GeometryId(id), &positions, &data.triangles).map_err(named)?;
        if self.filtered[mesh as usize] {
            let (accepts, still) = (Arc::clone(self.filter), self.still);
            let filter: embree::Filter = Arc::new(move |c: &embree::Candidate| {
                accepts(instance_index(c.instance, c.geometry, still), c.primitive, [c.u, c.v], c.token)
            });
            builder.filter(GeometryId(id), filter).map_err(named)?;
        }
        Ok(())
    }

    /// The Embree scene of a mesh in its own space.
    fn mesh(&self, mesh: u32) -> Result<embree::Scene> {
        let mut builder = self.builder()?;
        self.add(&mut builder, 0, mesh, |p| p)?;
        builder.commit().map_err(convert)
    }
}

/// Index of the instance that was hit, from Embree's ids of instance and geometry.
#[inline]
fn instance_index(instance: Option<GeometryId>, geometry: GeometryId, still: u32) -> u32 {
    instance.filter(|id| id.0 != still).unwrap_or(geometry).0
}

/// Folder within the project in which Embree may be installed.
const FOLDER: &str = ".deps/embree";

/// Loads Embree: of the package that holds this code, of the system, or from `.deps` (see [`installed`]).
///
/// # Errors
/// As [`embree::Library::load`].
pub fn library() -> std::result::Result<embree::Library, embree::Error> {
    embree::Library::load(&installed::folders(FOLDER))
}

/// Where Embree was found, in words (see [`installed::origin`]).
pub fn origin(library: &embree::Library) -> &'static str {
    installed::origin(embree::LIBRARY_VARIABLE, FOLDER, library.path())
}

impl Tracer {
    /// Builds Embree's BVH with `threads` threads. `filtered` has one entry per instance: `None` leaves the instance
    /// out, `Some(true)` passes its hits to `filter`. Instances that move are kept apart from the others.
    ///
    /// # Errors
    /// Embree is missing or out of memory, or a coordinate is too large for it.
    pub fn build(shapes: &Shapes, filtered: &[Option<bool>], filter: &HitFilter, threads: usize) -> Result<Tracer> {
        let library = library().map_err(convert)?;
        let device = embree::Device::new(&library, threads).map_err(convert)?;
        Tracer::assemble(device, shapes, filtered, filter, Parts::default())
    }

    /// The tracer of a moving scene at another moment. Instances that do not move, and meshes among those of `before`,
    /// the shapes of this tracer, are shared.
    ///
    /// # Errors
    /// Embree is out of memory, or a coordinate is too large for it.
    pub fn at_moment(
        &self,
        before: &Shapes,
        shapes: &Shapes,
        filtered: &[Option<bool>],
        filter: &HitFilter,
    ) -> Result<Tracer> {
        let same = |mesh: usize| before.meshes.get(mesh).is_some_and(|own| Arc::ptr_eq(own, &shapes.meshes[mesh]));
        let known = |mesh: usize| self.parts.meshes.get(mesh).filter(|_| same(mesh)).cloned().flatten();
        let meshes = (0..shapes.meshes.len()).map(known).collect();
        let parts = Parts { still: self.parts.still.clone(), meshes };
        Tracer::assemble(self.scene.device().clone(), shapes, filtered, filter, parts)
    }

    /// Builds the scene from the present `parts` and the parts that are missing.
    fn assemble(
        device: embree::Device,
        shapes: &Shapes,
        filtered: &[Option<bool>],
        filter: &HitFilter,
        mut parts: Parts,
    ) -> Result<Tracer> {
        let mut filtered_meshes = vec![false; shapes.meshes.len()];
        let mut copies = vec![0; shapes.meshes.len()];
        for (instance, &filtered) in shapes.instances.iter().zip(filtered) {
            filtered_meshes[instance.mesh as usize] |= filtered == Some(true);
            copies[instance.mesh as usize] += shapes.meshes[instance.mesh as usize].triangles.len();
        }
        let moves = shapes.instances.iter().any(|instance| instance.moves);
        let still = if moves { shapes.instances.len() as u32 } else { NO_STILL_PART };
        let source = Source { device, shapes, filter, filtered: filtered_meshes, still };
        parts.meshes.resize(shapes.meshes.len(), None);
        let mut root = source.builder()?;
        let mut still_part = if moves && parts.still.is_none() { Some(source.builder()?) } else { None };
        let mut still_instances = 0;
        for (i, instance) in shapes.instances.iter().enumerate().filter(|(i, _)| filtered[*i].is_some()) {
            let (id, copied) = (i as u32, copies[instance.mesh as usize] <= MAX_COPIED_TRIANGLES);
            match &instance.to_world {
                Some(placement) if instance.moves || !copied => {
                    let mesh = &mut parts.meshes[instance.mesh as usize];
                    let child = match mesh {
                        Some(child) => child.clone(),
                        None => mesh.insert(source.mesh(instance.mesh)?).clone(),
                    };
                    match root.instance(GeometryId(id), &child, &column_major(&placement.points)) {
                        // Embree cannot instance a mesh that is almost flattened.
                        Err(embree::Error::BadTransform { .. }) if copied => {
                            source.add(&mut root, id, instance.mesh, |p| instance.point(p))?;
                        }
                        placed => {
                            placed.map_err(|e| convert(e).within(format_args!("object \"{}\"", instance.name)))?
                        }
                    }
                }
                _ if !moves => source.add(&mut root, id, instance.mesh, |p| instance.point(p))?,
                _ => {
                    if let Some(builder) = &mut still_part {
                        still_instances += 1;
                        source.add(builder, id, instance.mesh, |p| instance.point(p))?;
                    }
                }
            }
        }
        if let Some(builder) = still_part.filter(|_| still_instances > 0) {
            parts.still = Some(builder.commit().map_err(convert)?);
        }
        if let Some(part) = &parts.still {
            root.instance(GeometryId(still), part, &column_major(&Affine3A::IDENTITY)).map_err(convert)?;
        }
        Ok(Tracer { scene: root.commit().map_err(convert)?, still, parts: Arc::new(parts) })
    }

    #[inline]
    fn hit(&self, hit: embree::Hit) -> Hit {
        Hit {
            t: hit.t,
            barycentric: [hit.u, hit.v],
            instance: instance_index(hit.instance, hit.geometry, self.still),
            primitive: hit.primitive,
        }
    }

    #[inline]
    fn ray(ray: &Ray) -> embree::Ray {
        embree::Ray {
            origin: ray.origin.to_array(),
            direction: ray.direction.to_array(),
            tmin: 0.0,
            tmax: ray.tmax,
            token: ray.token,
        }
    }

    /// The nearest hit on the segment; `None` if there is none.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.scene.intersect(&Self::ray(ray)).map(|hit| self.hit(hit))
    }

    /// Traces up to eight rays of similar directions and calls `each` with the number (0 to 7) and nearest hit of every
    /// ray that hits. For a hit on a shared edge, the choice of the triangle may depend on the other rays.
    #[inline]
    pub fn intersect8(&self, ray: impl Fn(usize) -> Option<Ray>, mut each: impl FnMut(usize, Hit)) {
        self.scene.intersect8(|k| ray(k).as_ref().map(Self::ray), |k, hit| each(k, self.hit(hit)));
    }

    /// Calls `each` with every hit on the segment, in arbitrary order. Slow: meant for few and short rays.
    pub fn each_hit(&self, ray: &Ray, each: &mut dyn FnMut(Hit)) {
        self.scene.each_hit(&Self::ray(ray), &mut |hit| each(self.hit(hit)));
    }

    /// Whether any triangle is hit on the segment, for shadow rays.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(&Self::ray(ray))
    }
}
