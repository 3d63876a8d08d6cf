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
    let (places, count) = welded(meshes);
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
    let rims = Rims::of(count, || faces().flat_map(|(_, [a, b, c], _)| [(a, b), (b, c), (c, a)]));
    Solid { closed: rims.opposite, flipped: rims.paired && !rims.opposite, rim: rims.alone, volume }
}

/// A number for the place of each vertex, the same for all vertices there, and how many there are.
pub(super) fn welded(meshes: &[&Mesh]) -> (Vec<Vec<u32>>, usize) {
    // Room for all at once: a table that grows is there twice.
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(meshes.iter().map(|m| m.positions.len()).sum());
    // Negative zero is zero.
    let key = |p: &Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut place = |p: &Vec3| {
        let next = known.len() as u32;
        *known.entry(key(p)).or_insert(next)
    };
    let places = meshes.iter().map(|mesh| mesh.positions.iter().map(&mut place).collect()).collect();
    (places, known.len())
}

/// How triangles meet in the edges between their places.
struct Rims {
    /// There are edges, and each is of two triangles.
    paired: bool,
    /// The same, and these run along it in opposite directions.
    opposite: bool,
    /// Edges of one triangle.
    alone: usize,
}

impl Rims {
    /// Edges by their lower place and their direction, in lists of the higher places that stand one after the other (a
    /// counting sort): four bytes an edge, and no sort but that of the few edges at a place.
    fn of<E: Iterator<Item = (u32, u32)>>(places: usize, edges: impl Fn() -> E) -> Rims {
        let list = |(i, j): (u32, u32)| 2 * i.min(j) as usize + usize::from(i < j);
        let mut ends = vec![0usize; 2 * places + 1];
        edges().for_each(|edge| ends[list(edge) + 1] += 1);
        // Where lists begin, until they are filled.
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
        let mut rims = Rims { paired: total > 0, opposite: total > 0, alone: 0 };
        let mut start = 0;
        for end in ends.chunks_exact(2) {
            rims.at_place(&mut highs[start..end[1]], end[0] - start);
            start = end[1];
        }
        rims
    }

    /// Adds the edges from one place up to higher ones, the first `down` of which are run along downwards.
    fn at_place(&mut self, highs: &mut [u32], down: usize) {
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
            self.alone += usize::from(edge.len() == 1);
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
        // A second tetrahedron turned over on the first, so that edges run twice each way.
        let both = solid(&[&whole, &inside_out]);
        assert!(!both.closed && !both.flipped && both.rim == 0);
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
