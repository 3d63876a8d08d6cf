//! Whether triangles bound a solid.

use crate::geometry::Mesh;
use crate::math::Vec3;
use std::collections::HashMap;

/// What a set of triangles bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solid {
    /// Every edge, vertices welded by position, is shared by exactly two triangles that run along it in opposite
    /// directions.
    pub(super) closed: bool,
    /// Every edge is shared by two triangles, but some run along it in the same direction: part of the faces is turned
    /// over.
    pub(super) flipped: bool,
    /// Edges of one triangle alone: the rims of holes.
    pub(super) rim: usize,
    /// Volume inside (m3); negative when the front faces look inwards. Meaningless for an open surface.
    pub(super) volume: f64,
}

/// Looks at all triangles of `meshes` together. Triangles whose corners fall together bound nothing and are passed
/// over.
pub(super) fn solid(meshes: &[&Mesh]) -> Solid {
    let mut welded: HashMap<[u32; 3], u32> = HashMap::new();
    // Negative zero is zero.
    let key = |p: Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut edges: Vec<(u32, u32, bool)> = Vec::new();
    let mut volume = 0.0;
    let origin = meshes.iter().find_map(|m| m.positions.first()).map_or(Default::default(), |p| p.as_dvec3());
    for mesh in meshes {
        let ids: Vec<u32> = mesh
            .positions
            .iter()
            .map(|&p| {
                let next = welded.len() as u32;
                *welded.entry(key(p)).or_insert(next)
            })
            .collect();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| ids[i as usize]);
            if a == b || b == c || c == a {
                continue;
            }
            for (i, j) in [(a, b), (b, c), (c, a)] {
                edges.push((i.min(j), i.max(j), i < j));
            }
            let [p, q, r] = triangle.map(|i| mesh.positions[i as usize].as_dvec3() - origin);
            volume += p.dot(q.cross(r)) / 6.0;
        }
    }
    edges.sort_unstable();
    let same = |a: &(u32, u32, bool), b: &(u32, u32, bool)| (a.0, a.1) == (b.0, b.1);
    let paired = !edges.is_empty() && edges.chunk_by(same).all(|edge| edge.len() == 2);
    let opposite = edges.chunk_by(same).all(|edge| edge.first().map(|e| e.2) != edge.last().map(|e| e.2));
    let rim = edges.chunk_by(same).filter(|edge| edge.len() == 1).count();
    Solid { closed: paired && opposite, flipped: paired && !opposite, rim, volume }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(at: f32) -> Mesh {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Mesh {
            positions: positions.map(|p| Vec3::from_array(p) + Vec3::splat(at)).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..Mesh::default()
        }
    }

    #[test]
    fn closed_open_inverted() {
        let whole = tetrahedron(0.0);
        let found = solid(&[&whole]);
        assert!(found.closed && (found.volume - 1.0 / 6.0).abs() < 1e-12);
        let mut open = whole.clone();
        open.triangles.pop();
        let found = solid(&[&open]);
        assert!(!found.closed && !found.flipped && found.rim == 3);
        let mut flipped = whole.clone();
        flipped.triangles[3].swap(0, 1);
        let found = solid(&[&flipped]);
        assert!(!found.closed && found.flipped && found.rim == 0);
        let mut inside_out = whole.clone();
        inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let found = solid(&[&inside_out]);
        assert!(found.closed && found.volume < 0.0);
        // The same triangles twice: four on every edge.
        assert!(!solid(&[&whole, &whole]).closed);
        assert!(solid(&[&whole, &tetrahedron(5.0)]).closed);
        assert!(!solid(&[]).closed);
    }

    /// Vertices split for normals or texture seams are one place; a triangle folded onto an edge changes nothing.
    #[test]
    fn split_vertices_are_welded() {
        let whole = tetrahedron(0.0);
        let mut split = Mesh::default();
        for triangle in &whole.triangles {
            let first = split.positions.len() as u32;
            split.positions.extend(triangle.map(|i| whole.positions[i as usize]));
            split.triangles.push([first, first + 1, first + 2]);
        }
        split.positions[0].x = -0.0;
        split.triangles.push([0, 1, 1]);
        assert!(solid(&[&split]).closed);
    }
}
