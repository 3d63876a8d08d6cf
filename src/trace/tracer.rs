//! The scene's triangles in Embree, addressed by our own indices.

use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Shapes;
use crate::math::{Affine3A, Vec3};
use caustique_embree as embree;
use embree::GeometryId;
use std::sync::Arc;

/// A segment to be traced: points `origin + t direction`, `0 <= t <= tmax`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where t = 0; already moved off the surface it leaves.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Largest t; may be infinite.
    pub tmax: f32,
    /// Random bits that decide about alpha cut-outs along this ray, and in scenes that hide something from cameras
    /// whether this is a camera's ([`CAMERA_RAY_BIT`]).
    pub token: u32,
}

/// The bit of a token by which a camera's own rays, and rays to its lens, pass what is hidden from cameras.
pub const CAMERA_RAY_BIT: u32 = 1;

/// The nearest triangle along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Barycentric coordinates of the second and third corner.
    pub barycentric: [f32; 2],
    /// Index of the instance.
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

/// Whether a ray with `token` meets triangle `primitive` of `instance` at barycentric `(u, v)`: alpha cut-outs, and
/// what is hidden from cameras. A pure function.
pub type HitFilter = Arc<dyn Fn(u32, u32, [f32; 2], u32) -> bool + Send + Sync>;

/// Up to so many triangles of all the instances of a mesh together stand in the one tree of the scene, copied: rays are
/// faster there than through an instance's own tree, whose box overlaps its neighbours'.
const MOST_COPIED: usize = 1 << 17;

/// Geometry committed to Embree; clones share it.
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
    /// Commits those of `shapes` for which there is an answer in `asked`, by instance: whether hits of it are put to
    /// the test `meets`.
    ///
    /// # Errors
    /// Embree is missing or out of memory, or a coordinate is too large for it.
    pub fn build(shapes: &Shapes, asked: &[Option<bool>], meets: &HitFilter, threads: usize) -> Result<Tracer> {
        let library = embree::Library::load().map_err(convert)?;
        let device = embree::Device::new(&library, threads).map_err(convert)?;
        // A mesh is filtered if any instance of it is: the test itself then accepts the opaque ones.
        let mut filtered = vec![false; shapes.meshes.len()];
        for (instance, &asked) in shapes.instances.iter().zip(asked) {
            filtered[instance.mesh as usize] |= asked == Some(true);
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
                if filtered[mesh as usize] {
                    let meets = Arc::clone(meets);
                    let filter: embree::Filter = Arc::new(move |c: &embree::Candidate| {
                        let instance = c.instance.unwrap_or(c.geometry).0;
                        meets(instance, c.primitive, [c.u, c.v], c.token)
                    });
                    builder.filter(GeometryId(id), filter).map_err(named)?;
                }
                Ok(())
            };
        let mut shared: Vec<Option<embree::Scene>> = vec![None; shapes.meshes.len()];
        let mut root = embree::SceneBuilder::new(&device).map_err(convert)?;
        for (i, instance) in shapes.instances.iter().enumerate().filter(|(i, _)| asked[*i].is_some()) {
            let id = i as u32;
            match &instance.to_world {
                _ if copies[instance.mesh as usize] <= MOST_COPIED => {
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

    /// The nearest hit, or none.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.scene.intersect(&Self::ray(ray)).map(Hit::from)
    }

    /// Calls `each` with the nearest hits of up to eight rays that go much the same way. Which rays are given together
    /// may decide between triangles that share an edge.
    #[inline]
    pub fn intersect8(&self, ray: impl Fn(usize) -> Option<Ray>, mut each: impl FnMut(usize, Hit)) {
        self.scene.intersect8(|k| ray(k).as_ref().map(Self::ray), |k, hit| each(k, hit.into()));
    }

    /// Calls `each` with every hit on the segment, in no order. For few and short rays.
    pub fn each_hit(&self, ray: &Ray, each: &mut dyn FnMut(Hit)) {
        self.scene.each_hit(&Self::ray(ray), &mut |hit| each(hit.into()));
    }

    /// Whether anything lies on the segment.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(&Self::ray(ray))
    }
}
