//! The scene's triangles in Embree, addressed by the indices of [`Shapes`].

use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Shapes;
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
    /// [`CAMERA_RAY_BIT`] is set in camera rays and cleared in others.
    pub token: u32,
}

/// Bit of [`Ray::token`] that marks rays from or to the camera. They pass objects that are hidden from cameras.
pub const CAMERA_RAY_BIT: u32 = 1;

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

impl From<embree::Hit> for Hit {
    #[inline]
    fn from(hit: embree::Hit) -> Hit {
        Hit {
            t: hit.t,
            barycentric: [hit.u, hit.v],
            instance: hit.instance.unwrap_or(hit.geometry).0,
            primitive: hit.primitive,
        }
    }
}

/// Decides whether a hit counts, for alpha cut-outs and objects that are hidden from cameras. Arguments: instance,
/// primitive, barycentric weights of the second and third corner, token of the ray. Must be a pure function.
pub type HitFilter = Arc<dyn Fn(u32, u32, [f32; 2], u32) -> bool + Send + Sync>;

/// If all instances of a mesh together have at most this number of triangles, they are copied into the BVH of the
/// scene. Rays are faster there than through an instance's own BVH, whose box overlaps those of its neighbours.
const MAX_COPIED_TRIANGLES: usize = 1 << 17;

/// The scene's triangles committed to Embree; clones share them.
#[derive(Clone)]
pub struct Tracer {
    scene: embree::Scene,
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

impl Tracer {
    /// Builds Embree's BVH with `threads` threads. `filtered` has one entry per instance: `None` leaves the instance
    /// out, `Some(true)` passes its hits to `filter`.
    ///
    /// # Errors
    /// Embree is missing or out of memory, or a coordinate is too large for it.
    pub fn build(shapes: &Shapes, filtered: &[Option<bool>], filter: &HitFilter, threads: usize) -> Result<Tracer> {
        let library = embree::Library::load().map_err(convert)?;
        let device = embree::Device::new(&library, threads).map_err(convert)?;
        // A mesh is filtered if any of its instances is. The filter accepts hits of the others.
        let mut filtered_meshes = vec![false; shapes.meshes.len()];
        for (instance, &filtered) in shapes.instances.iter().zip(filtered) {
            filtered_meshes[instance.mesh as usize] |= filtered == Some(true);
        }
        let mut copies = vec![0; shapes.meshes.len()];
        for instance in &shapes.instances {
            copies[instance.mesh as usize] += shapes.meshes[instance.mesh as usize].triangles.len();
        }
        let add_mesh =
            |builder: &mut embree::SceneBuilder, id: u32, mesh: u32, place: &dyn Fn(Vec3) -> Vec3| -> Result<()> {
                let data = &shapes.meshes[mesh as usize];
                let named = |e: embree::Error| convert(e).within(format_args!("mesh \"{}\"", data.name));
                let positions: Vec<[f32; 3]> = data.positions.iter().map(|&p| place(p).to_array()).collect();
                builder.triangles(GeometryId(id), &positions, &data.triangles).map_err(named)?;
                if filtered_meshes[mesh as usize] {
                    let accepts = Arc::clone(filter);
                    let filter: embree::Filter = Arc::new(move |c: &embree::Candidate| {
                        let instance = c.instance.unwrap_or(c.geometry).0;
                        accepts(instance, c.primitive, [c.u, c.v], c.token)
                    });
                    builder.filter(GeometryId(id), filter).map_err(named)?;
                }
                Ok(())
            };
        let mut shared: Vec<Option<embree::Scene>> = vec![None; shapes.meshes.len()];
        let mut root = embree::SceneBuilder::new(&device).map_err(convert)?;
        for (i, instance) in shapes.instances.iter().enumerate().filter(|(i, _)| filtered[*i].is_some()) {
            let id = i as u32;
            match &instance.to_world {
                _ if copies[instance.mesh as usize] <= MAX_COPIED_TRIANGLES => {
                    add_mesh(&mut root, id, instance.mesh, &|p| instance.point(p))?;
                }
                None => add_mesh(&mut root, id, instance.mesh, &|p| p)?,
                Some(placement) => {
                    let child = match &shared[instance.mesh as usize] {
                        Some(child) => child.clone(),
                        None => {
                            let mut builder = embree::SceneBuilder::new(&device).map_err(convert)?;
                            add_mesh(&mut builder, 0, instance.mesh, &|p| p)?;
                            let child = builder.commit().map_err(convert)?;
                            shared[instance.mesh as usize] = Some(child.clone());
                            child
                        }
                    };
                    root.instance(GeometryId(id), &child, &column_major(&placement.points))
                        .map_err(|e| convert(e).within(format_args!("object \"{}\"", instance.name)))?;
                }
            }
        }
        Ok(Tracer { scene: root.commit().map_err(convert)? })
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
        self.scene.intersect(&Self::ray(ray)).map(Hit::from)
    }

    /// Traces up to eight rays of similar directions and calls `each` with the number (0 to 7) and nearest hit of every
    /// ray that hits. For a hit on a shared edge, the choice of the triangle may depend on the other rays.
    #[inline]
    pub fn intersect8(&self, ray: impl Fn(usize) -> Option<Ray>, mut each: impl FnMut(usize, Hit)) {
        self.scene.intersect8(|k| ray(k).as_ref().map(Self::ray), |k, hit| each(k, hit.into()));
    }

    /// Calls `each` with every hit on the segment, in arbitrary order. Slow: meant for few and short rays.
    pub fn each_hit(&self, ray: &Ray, each: &mut dyn FnMut(Hit)) {
        self.scene.each_hit(&Self::ray(ray), &mut |hit| each(hit.into()));
    }

    /// Whether any triangle is hit on the segment, for shadow rays.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(&Self::ray(ray))
    }
}
