//! Poses: vertices and camera of a scene at a frame of its animation, from which motion vectors are computed.

use super::{CameraRequest, Description, Scene, build};
use crate::camera::Camera;
use crate::error::Result;
use crate::geometry::Mesh;
use crate::math::{DAffine3, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Vertices and camera of a scene at one frame of its animation.
pub struct Pose {
    /// The camera, with the whole picture as its film.
    pub camera: Camera,
    /// The meshes in their own space.
    meshes: Vec<Arc<Mesh>>,
    /// Index of the mesh of each instance of the scene, and its transform to the coordinates of the scene; `None` if the
    /// instance is missing at this frame.
    places: Vec<Option<(usize, DAffine3)>>,
}

/// A point of a triangle of the scene, which moves with the triangle.
#[derive(Clone, Copy, Debug)]
pub struct TrianglePoint {
    /// Index of the instance in the scene.
    pub instance: u32,
    /// Indices of the triangle's vertices in the mesh of the instance.
    pub corners: [u32; 3],
    /// Barycentric coordinates of the point: the weight of each corner.
    pub weights: DVec3,
}

impl TrianglePoint {
    /// The point of triangle `primitive` of an instance of the scene that is nearest to `p`.
    pub fn new(scene: &Scene, instance: u32, primitive: u32, p: DVec3) -> TrianglePoint {
        let placed = &scene.shapes.instances[instance as usize];
        let mesh = &scene.shapes.meshes[placed.mesh as usize];
        let [a, b, c] = placed.corners(mesh, primitive).map(|corner| corner.as_dvec3());
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let normal = ab.cross(ac);
        let area = normal.length_squared().max(f64::MIN_POSITIVE);
        let (v, w) = (normal.dot(ap.cross(ac)) / area, normal.dot(ab.cross(ap)) / area);
        TrianglePoint { instance, corners: mesh.triangles[primitive as usize], weights: DVec3::new(1.0 - v - w, v, w) }
    }
}

impl Pose {
    /// The pose of `scene` at the frame of a description of it. Instances are found by their names.
    ///
    /// # Errors
    /// The description lacks the camera of the request.
    pub fn new(scene: &Scene, mut description: Description, request: &CameraRequest) -> Result<Pose> {
        build::add_light_spheres(&mut description);
        let camera = scene.whole_camera_among(&description.cameras, request)?;
        let mut named: HashMap<&str, Vec<(usize, DAffine3)>> = HashMap::new();
        for placed in &description.instances {
            let mut to_world = placed.to_world;
            to_world.translation -= scene.origin;
            named.entry(&placed.name).or_default().push((placed.mesh as usize, to_world));
        }
        let mut own: HashMap<&str, Vec<usize>> = HashMap::new();
        for (i, instance) in scene.shapes.instances.iter().enumerate() {
            own.entry(&instance.name).or_default().push(i);
        }
        let mut places = vec![None; scene.shapes.instances.len()];
        for (name, instances) in own {
            // With other numbers of instances it is unknown which of them is missing.
            let found = named.get(name).filter(|found| found.len() == instances.len());
            for (i, place) in instances.into_iter().zip(found.into_iter().flatten()) {
                places[i] = Some(*place);
            }
        }
        Ok(Pose { camera, meshes: description.meshes, places })
    }

    /// The position of a point of the scene in this pose, in the coordinates of the scene; `None` if its object is missing
    /// or has other vertices.
    pub fn position(&self, point: &TrianglePoint) -> Option<DVec3> {
        let (mesh, to_world) = (*self.places.get(point.instance as usize)?)?;
        let positions = &self.meshes.get(mesh)?.positions;
        let mut local = DVec3::ZERO;
        for (corner, weight) in point.corners.into_iter().zip(point.weights.to_array()) {
            local += weight * positions.get(corner as usize)?.as_dvec3();
        }
        Some(to_world.transform_point3(local))
    }
}
