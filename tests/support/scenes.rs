//! Scenes made in code, for closed-form tests.

use caustique::camera::Camera;
use caustique::geometry::Mesh;
use caustique::material::Material;
use caustique::math::{DAffine3, DMat3, DVec3, Rgb, Vec3};
use caustique::path_class::ClassSet;
use caustique::scene::description::{
    CameraDescription, Description, EnvironmentDescription, PlacedMesh, Projection, PunctualKind, PunctualLight,
};
use caustique::scene::{CameraRequest, Scene};
use caustique::transport::{CameraPaths, Indirect, InitialMedia};

/// A diffuse material with this reflectance and emission, without a Fresnel layer.
pub fn matte(reflectance: f32, emission: f32) -> Material {
    Material {
        base_color: [reflectance, reflectance, reflectance, 1.0],
        metallic: 0.0.into(),
        specular: 0.0.into(),
        emission: Rgb::splat(emission),
        ..Material::default()
    }
}

/// Perfectly smooth solid glass.
pub fn glass(ior: f32) -> Material {
    Material {
        metallic: 0.0.into(),
        roughness: 0.0.into(),
        transmission: 1.0.into(),
        thin: false,
        ior,
        ..Material::default()
    }
}

/// A perfect mirror.
pub fn mirror() -> Material {
    Material { metallic: 1.0.into(), roughness: 0.0.into(), ..Material::default() }
}

/// Adds a mesh with its own material.
pub fn add(description: &mut Description, name: &str, mesh: Mesh, material: Material) {
    add_at(description, name, mesh, material, DAffine3::IDENTITY);
}

/// Adds a mesh with its own material and a transform.
pub fn add_at(description: &mut Description, name: &str, mesh: Mesh, material: Material, to_world: DAffine3) {
    description.instances.push(PlacedMesh {
        name: name.into(),
        mesh: description.meshes.len() as u32,
        material: description.materials.len() as u32,
        object: description.objects.len() as u32,
        hidden_from_camera: false,
        shadow_catcher: false,
        holdout: false,
        light_group: None,
        links: None,
        moves: false,
        to_world,
    });
    description.objects.push(name.into());
    description.meshes.push(Mesh { name: name.into(), ..mesh }.into());
    description.materials.push(Material { name: name.into(), ..material });
}

/// A parallelogram from a corner and two edges. Seen from its front, the edges are counter-clockwise.
pub fn quad(corner: Vec3, a: Vec3, b: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A closed axis-aligned box with its front inside (`inward`) or outside.
pub fn cuboid(low: Vec3, high: Vec3, inward: bool) -> Mesh {
    let corner = |i: u32| Vec3::select(glam_mask(i), high, low);
    let positions = (0..8).map(corner).collect();
    let mut triangles = vec![];
    for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        for t in [[a, b, c], [a, c, d]] {
            triangles.push(if inward { [t[0], t[2], t[1]] } else { t });
        }
    }
    Mesh { positions, triangles, closed: true, ..Mesh::default() }
}

fn glam_mask(i: u32) -> glam::BVec3 {
    glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0)
}

/// A sphere of latitude-longitude triangles with smooth normals and its front outside.
pub fn sphere(center: Vec3, radius: f32, segments: u32) -> Mesh {
    let rings = segments / 2;
    let mut mesh = Mesh { closed: true, ..Mesh::default() };
    for i in 0..=rings {
        for j in 0..segments {
            let theta = std::f64::consts::PI * f64::from(i) / f64::from(rings);
            let phi = std::f64::consts::TAU * f64::from(j) / f64::from(segments);
            let n = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()).as_vec3();
            mesh.positions.push(center + n * radius);
            mesh.normals.push(n);
        }
    }
    for i in 0..rings {
        for j in 0..segments {
            let k = (j + 1) % segments;
            let (a, b, c, d) = (i * segments + j, i * segments + k, (i + 1) * segments + j, (i + 1) * segments + k);
            if i > 0 {
                mesh.triangles.push([a, b, c]);
            }
            if i + 1 < rings {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
    mesh
}

/// A pinhole camera at `eye` that looks at `target`.
pub fn look_at(eye: DVec3, target: DVec3, yfov_deg: f32) -> CameraDescription {
    let back = (eye - target).normalize();
    let up = if back.y.abs() > 0.99 { DVec3::Z } else { DVec3::Y };
    let right = up.cross(back).normalize();
    CameraDescription {
        name: "camera".into(),
        to_world: DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: eye },
        projection: Projection::Perspective { yfov: yfov_deg.to_radians(), aspect: Some(1.0) },
        aperture_radius: 0.0,
        focus_distance: 1.0,
        shift: [0.0; 2],
    }
}

/// A point light.
pub fn point_light(p: DVec3, intensity: f32) -> PunctualLight {
    PunctualLight {
        name: "point".into(),
        to_world: DAffine3::from_translation(p),
        intensity: Rgb::splat(intensity),
        kind: PunctualKind::Point,
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    }
}

/// Camera paths of all classes of light and any length.
pub fn camera_paths<'a>(scene: &'a Scene, camera: &'a Camera) -> CameraPaths<'a> {
    let interior = InitialMedia::of(scene, camera).camera;
    let (indirect, classes) = (Indirect::Photons, ClassSet::ALL);
    CameraPaths { scene, camera, interior, max_depth: u32::MAX, splits: 0, indirect, classes, lobes: false, stop: None }
}

/// Builds a valid scene; panics if it is invalid.
pub fn build(description: Description) -> Scene {
    match Scene::build(description, 1) {
        Ok(scene) => scene,
        Err(error) => panic!("{error}"),
    }
}

/// A view of `size x size` pixels.
pub fn square(size: u32) -> CameraRequest {
    CameraRequest { width: Some(size), height: Some(size), ..CameraRequest::default() }
}

/// A room with a lamp below the ceiling.
pub fn lit_room(walls: Material) -> Description {
    let mut description = Description::default();
    add(&mut description, "room", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true), walls);
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.9, 0.0), 50.0));
    description
}

/// Balls of rough metal in a room of plastic: layered lobes, wide and narrow.
pub fn glossy_balls() -> Description {
    let plastic = Material {
        base_color: [0.6, 0.4, 0.3, 1.0],
        metallic: 0.0.into(),
        roughness: 0.3.into(),
        ..Material::default()
    };
    let mut description = lit_room(plastic);
    let metal = |roughness| Material {
        base_color: [0.9, 0.7, 0.4, 1.0],
        metallic: 1.0.into(),
        roughness,
        ..Material::default()
    };
    add(&mut description, "narrow", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), metal(0.35.into()));
    add(&mut description, "wide", sphere(Vec3::new(0.45, 0.4, 0.3), 0.4, 64), metal(0.7.into()));
    description
}

/// A room from -1 to 1 in x and z, 1 m high, with a diffuse floor and with `walls`. The wall at x = 1 has a window, from
/// 0.5 to 0.9 m and from -0.3 to 0.3 in z. The camera sees the floor from -0.5 to 0.5.
pub fn window_room(walls: Material, sky: Option<EnvironmentDescription>) -> Description {
    let mut room = Description { environment: sky, ..Description::default() };
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add(&mut room, "floor", floor, matte(0.8, 0.0));
    let wall =
        |x: [f32; 2], y: [f32; 2], z: [f32; 2]| cuboid(Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1]), false);
    let (all, side, window) = ([-1.0, 1.0], [0.0, 1.0], [1.0, 1.001]);
    for (name, mesh) in [
        ("ceiling", wall(all, [1.0, 1.1], all)),
        ("left", wall([-1.1, -1.0], side, all)),
        ("front", wall(all, side, [1.0, 1.1])),
        ("back", wall(all, side, [-1.1, -1.0])),
        ("below", wall(window, [0.0, 0.5], all)),
        ("above", wall(window, [0.9, 1.0], all)),
        ("before", wall(window, side, [0.3, 1.0])),
        ("behind", wall(window, side, [-1.0, -0.3])),
    ] {
        add(&mut room, name, mesh, walls.clone());
    }
    let yfov = 2.0 * (0.5f32 / 0.95).atan().to_degrees();
    room.cameras.push(look_at(DVec3::new(0.0, 0.95, 0.0), DVec3::ZERO, yfov));
    room
}
