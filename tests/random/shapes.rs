//! Creates meshes.

use super::world::Mesh;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A parallelogram from a corner and two edges. Seen from its front, the edges are counter-clockwise.
pub fn quad(corner: DVec3, a: DVec3, b: DVec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        normals: vec![],
        uvs: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from_array).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// Joins meshes.
pub fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut whole = Mesh::default();
    for mesh in meshes {
        let first = whole.positions.len() as u32;
        whole.positions.extend(mesh.positions);
        whole.normals.extend(mesh.normals);
        whole.uvs.extend(mesh.uvs);
        whole.triangles.extend(mesh.triangles.into_iter().map(|t| t.map(|index| index + first)));
    }
    whole
}

/// A closed box between two corners, with its front inside or outside.
pub fn cuboid(low: DVec3, high: DVec3, inward: bool) -> Mesh {
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3]];
    let face = |mut corners: [u32; 4]| {
        if inward {
            corners.reverse();
        }
        Mesh { positions: corners.map(corner).to_vec(), ..quad(DVec3::ZERO, DVec3::X, DVec3::Y) }
    };
    joined(faces.map(face))
}

/// A profile of (radius, height) points rotated about the vertical axis. Profiles from bottom to top face outwards.
pub fn lathe(profile: &[(f64, f64)], segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let rows = profile.len() as u32;
    for (i, &(radius, height)) in profile.iter().enumerate() {
        for j in 0..=segments {
            let phi = TAU * f64::from(j % segments) / f64::from(segments);
            mesh.positions.push(DVec3::new(radius * phi.cos(), height, radius * phi.sin()));
            mesh.uvs.push(DVec2::new(f64::from(j) / f64::from(segments), i as f64 / f64::from(rows - 1)));
        }
    }
    for i in 0..rows - 1 {
        for j in 0..segments {
            let (a, b) = (i * (segments + 1) + j, (i + 1) * (segments + 1) + j);
            if profile[i as usize].0 > 0.0 {
                mesh.triangles.push([a, b, a + 1]);
            }
            if profile[i as usize + 1].0 > 0.0 {
                mesh.triangles.push([a + 1, b, b + 1]);
            }
        }
    }
    mesh
}

/// A sphere of radius 1, smooth or faceted.
pub fn sphere(segments: u32, smooth: bool) -> Mesh {
    let rings = segments / 2;
    let angle = |i: u32| std::f64::consts::PI * f64::from(i) / f64::from(rings);
    let inner = (1..rings).map(|i| (angle(i).sin(), -angle(i).cos()));
    let profile: Vec<(f64, f64)> = std::iter::once((0.0, -1.0)).chain(inner).chain([(0.0, 1.0)]).collect();
    let mut mesh = lathe(&profile, segments);
    if smooth {
        mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    }
    mesh
}

/// A prism of radius 1 with `sides` sides that stands on the ground.
pub fn prism(height: f64, sides: u32) -> Mesh {
    lathe(&[(0.0, 0.0), (1.0, 0.0), (1.0, height), (0.0, height)], sides)
}

/// A flat disc of radius 1 that faces up.
pub fn disc(sides: u32) -> Mesh {
    lathe(&[(1.0, 0.0), (0.0, 0.0)], sides)
}

/// A triangle with sides of about 1 that faces up.
pub fn triangle() -> Mesh {
    Mesh {
        positions: vec![DVec3::new(-1.0, 0.0, 0.6), DVec3::new(1.0, 0.0, 0.6), DVec3::new(0.0, 0.0, -1.0)],
        normals: vec![],
        uvs: vec![DVec2::ZERO, DVec2::X, DVec2::Y],
        triangles: vec![[0, 1, 2]],
    }
}

/// A drinking glass of outer radius 1, and the liquid in it up to `level`, whose faces coincide with those of the
/// glass.
pub fn vessel(height: f64, wall: f64, level: f64, sides: u32) -> [Mesh; 2] {
    let (inner, floor) = (1.0 - wall, wall);
    let outside = [(0.0, 0.0), (1.0, 0.0), (1.0, height), (inner, height), (inner, floor), (0.0, floor)];
    // The glass has a ring of vertices at the surface of the liquid, so that both meshes have the same triangles there.
    let outside = [&outside[..4], &[(inner, level)], &outside[4..]].concat();
    let liquid = [(0.0, floor), (inner, floor), (inner, level), (0.0, level)];
    [lathe(&outside, sides), lathe(&liquid, sides)]
}
