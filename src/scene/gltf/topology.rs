//! Checks whether triangles bound a solid.

use crate::geometry::Mesh;
use crate::math::Vec3;
use std::collections::HashMap;

/// How a set of triangles encloses a volume: whether it is closed, and its holes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solid {
    /// Whether exactly two triangles share every edge, in opposite directions. Vertices at equal positions count as
    /// one.
    pub(super) closed: bool,
    /// Whether two triangles share every edge, but some in the same direction, because part of the faces is flipped.
    pub(super) flipped: bool,
    /// Number of edges that belong to only one triangle: the boundary of holes.
    pub(super) rim: usize,
    /// Enclosed volume (m3); negative if the front faces point inwards. Meaningless for an open surface.
    pub(super) volume: f64,
}

/// Topology of all triangles of `meshes` together. Triangles with two corners at one position are skipped.
pub(super) fn solid(meshes: &[&Mesh]) -> Solid {
    let (places, count) = weld(meshes);
    let faces = || {
        meshes.iter().zip(&places).flat_map(|(mesh, places)| {
            let welded = move |corners: &[u32; 3]| (corners.map(|i| places[i as usize]), corners.map(|i| i as usize));
            let whole = |([a, b, c], _): &([u32; 3], _)| a != b && b != c && c != a;
            mesh.triangles.iter().map(welded).filter(whole).map(move |(places, corners)| (*mesh, places, corners))
        })
    };
    let origin = meshes.iter().find_map(|m| m.positions.first()).map_or(Default::default(), |p| p.as_dvec3());
    let mut volume = 0.0;
    for (mesh, _, corners) in faces() {
        let [p, q, r] = corners.map(|i| mesh.positions[i].as_dvec3() - origin);
        volume += p.dot(q.cross(r)) / 6.0;
    }
    let edges = Edges::count(count, || faces().flat_map(|(_, [a, b, c], _)| [(a, b), (b, c), (c, a)]));
    Solid { closed: edges.opposite, flipped: edges.paired && !edges.opposite, rim: edges.single, volume }
}

/// Numbers the distinct positions of vertices. Returns, for each mesh and vertex, the number of its position, and the
/// count of positions.
pub(super) fn weld(meshes: &[&Mesh]) -> (Vec<Vec<u32>>, usize) {
    // Allocated at full size, because a growing table takes twice the memory for a while.
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(meshes.iter().map(|m| m.positions.len()).sum());
    // Adding zero turns -0.0 into 0.0.
    let key = |p: &Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut place = |p: &Vec3| {
        let next = known.len() as u32;
        *known.entry(key(p)).or_insert(next)
    };
    let places = meshes.iter().map(|mesh| mesh.positions.iter().map(&mut place).collect()).collect();
    (places, known.len())
}

/// How the triangles of a set share edges.
struct Edges {
    /// Whether exactly two triangles share every edge, and there are edges.
    paired: bool,
    /// Whether two triangles share every edge in opposite directions, and there are edges.
    opposite: bool,
    /// Number of edges that belong to one triangle only.
    single: usize,
}

impl Edges {
    /// Counts how triangles share the directed edges `edges` between `places` numbered positions. A counting sort
    /// groups edges by their lower position and their direction, so an edge takes four bytes, and only the few edges at
    /// a position are sorted.
    fn count<E: Iterator<Item = (u32, u32)>>(places: usize, edges: impl Fn() -> E) -> Edges {
        let list = |(i, j): (u32, u32)| 2 * i.min(j) as usize + usize::from(i < j);
        let mut ends = vec![0usize; 2 * places + 1];
        edges().for_each(|edge| ends[list(edge) + 1] += 1);
        // The start of each list; becomes the end while the lists are filled.
        let mut total = 0;
        for end in &mut ends {
            total += *end;
            *end = total;
        }
        let mut highs = vec![0; total];
        for edge in edges() {
            let end = &mut ends[list(edge)];
            highs[*end] = edge.0.max(edge.1);
            *end += 1;
        }
        let mut counted = Edges { paired: total > 0, opposite: total > 0, single: 0 };
        let mut start = 0;
        for end in ends.chunks_exact(2) {
            counted.add_edges_at(&mut highs[start..end[1]], end[0] - start);
            start = end[1];
        }
        counted
    }

    /// Counts the edges between one position and the higher positions `highs`. The first `down` edges lead to the lower
    /// position.
    fn add_edges_at(&mut self, highs: &mut [u32], down: usize) {
        let (down, up) = highs.split_at_mut(down);
        down.sort_unstable();
        up.sort_unstable();
        if down == up && down.is_sorted_by(|a, b| a < b) {
            return;
        }
        self.opposite = false;
        highs.sort_unstable();
        for edge in highs.chunk_by(|a, b| a == b) {
            self.paired &= edge.len() == 2;
            self.single += usize::from(edge.len() == 1);
        }
    }
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
    fn closed_open_flipped_and_inverted_surfaces_are_distinguished() {
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
        // The first tetrahedron and its flipped copy: every edge occurs twice in each direction.
        let both = solid(&[&whole, &inside_out]);
        assert!(!both.closed && !both.flipped && both.rim == 0);
        // Every triangle twice: four triangles share every edge.
        assert!(!solid(&[&whole, &whole]).closed);
        assert!(solid(&[&whole, &tetrahedron(5.0)]).closed);
        assert!(!solid(&[]).closed);
    }

    /// Vertices that are split for normals or texture seams count as one. A degenerate triangle changes nothing.
    #[test]
    fn vertices_at_one_position_are_welded() {
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
