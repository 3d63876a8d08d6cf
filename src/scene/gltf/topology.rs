//! Checks whether triangles bound a solid, and welds seams that rounding errors have opened.

use crate::geometry::Mesh;
use crate::math::{DVec3, Vec3};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Greatest distance of two vertices of a seam, relative to the largest coordinate: the roundings of the sines, angles
/// and transforms that a program computes the two sides of a seam with.
const SEAM_WIDTH: f64 = 16.0 * f32::EPSILON as f64;

/// Greatest distance of two vertices of a seam, relative to the longest edge of a hole at them, so that welding keeps
/// the shape of fine meshes far from the origin.
const SEAM_WIDTH_OF_EDGE: f64 = 0.01;

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
    let faces = || faces(meshes, &places);
    let origin = meshes.iter().find_map(|m| m.positions.first()).map_or(Default::default(), |p| p.as_dvec3());
    let mut volume = 0.0;
    for (mesh, _, corners) in faces() {
        let [p, q, r] = corners.map(|i| mesh.positions[i as usize].as_dvec3() - origin);
        volume += p.dot(q.cross(r)) / 6.0;
    }
    let edges = Edges::count(count, || faces().flat_map(|(_, places, _)| sides(places)));
    Solid { closed: edges.opposite, flipped: edges.paired && !edges.opposite, rim: edges.single.len(), volume }
}

/// The triangles of all meshes whose corners have different positions: the mesh, the numbers of the positions and of
/// the vertices.
fn faces<'a>(
    meshes: &'a [&Mesh],
    places: &'a [Vec<u32>],
) -> impl Iterator<Item = (&'a Mesh, [u32; 3], [u32; 3])> + use<'a> {
    meshes.iter().zip(places).flat_map(|(&mesh, places)| {
        let welded = move |&corners: &[u32; 3]| (mesh, corners.map(|i| places[i as usize]), corners);
        mesh.triangles.iter().map(welded).filter(|(_, [a, b, c], _)| a != b && b != c && c != a)
    })
}

/// The directed edges of a triangle.
fn sides([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}

/// Moves vertices at the rims of holes to one position if they are as close as rounding errors leave the two sides of a
/// seam, where the last column of a sphere meets the first for example. Other vertices keep their positions, so closed
/// surfaces do not change, however close they are. Triangles that this leaves without area are removed.
pub(super) fn weld_seams(meshes: &mut [&mut Mesh]) {
    let all: Vec<&Mesh> = meshes.iter().map(|mesh| &**mesh).collect();
    let (places, count) = weld(&all);
    let rim = Edges::count(count, || faces(&all, &places).flat_map(|(_, places, _)| sides(places))).single;
    if rim.is_empty() {
        return;
    }
    let mut positions = vec![Vec3::ZERO; count];
    for (mesh, places) in all.iter().zip(&places) {
        mesh.positions.iter().zip(places).for_each(|(&p, &place)| positions[place as usize] = p);
    }
    let moved = seam_positions(&positions, &rim);
    if moved.is_empty() {
        return;
    }
    for (mesh, places) in meshes.iter_mut().zip(&places) {
        for (p, place) in mesh.positions.iter_mut().zip(places) {
            *p = moved.get(place).copied().unwrap_or(*p);
        }
        let is_moved = |i: u32| moved.contains_key(&places[i as usize]);
        let positions = &mesh.positions;
        mesh.triangles.retain(|t| {
            let collapsed = |i: usize, j: usize| positions[t[i] as usize] == positions[t[j] as usize];
            !t.iter().any(|&i| is_moved(i)) || !(collapsed(0, 1) || collapsed(1, 2) || collapsed(2, 0))
        });
    }
}

/// New positions of vertices at seams, by the number of their position. `rim` are edges with one face.
fn seam_positions(positions: &[Vec3], rim: &[[u32; 2]]) -> HashMap<u32, Vec3> {
    let largest = positions.iter().fold(0.0, |largest: f32, p| largest.max(p.abs().max_element()));
    let width = SEAM_WIDTH * f64::from(largest);
    let at = |place: u32| positions[place as usize].as_dvec3();
    let mut longest: HashMap<u32, f64> = HashMap::with_capacity(rim.len());
    for &[a, b] in rim {
        let length = at(a).distance(at(b));
        for place in [a, b] {
            let longest = longest.entry(place).or_default();
            *longest = longest.max(length);
        }
    }
    let mut order: Vec<(u32, f64)> = longest.into_iter().collect();
    order.sort_unstable_by_key(|&(place, _)| place);
    // A grid with one vertex per cell, the first. Vertices within `width` of a position are in at most eight cells.
    let cell = |p: DVec3| (p / (2.0 * width)).floor().to_array().map(|x| x as i64);
    let mut first: HashMap<[i64; 3], (u32, f64)> = HashMap::with_capacity(order.len());
    let mut moved = HashMap::new();
    for (place, edge) in order {
        let p = at(place);
        let (low, high) = (cell(p - width), cell(p + width));
        let around = (0..8).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] }));
        let near = |&&(other, other_edge): &&(u32, f64)| {
            at(other).distance(p) <= width.min(SEAM_WIDTH_OF_EDGE * edge.min(other_edge))
        };
        if let Some(&(other, _)) = around.filter_map(|cell| first.get(&cell)).find(near) {
            moved.insert(place, positions[other as usize]);
        } else if let Entry::Vacant(empty) = first.entry(cell(p)) {
            empty.insert((place, edge));
        }
    }
    moved
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
    /// Edges that belong to one triangle only.
    single: Vec<[u32; 2]>,
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
        let mut counted = Edges { paired: total > 0, opposite: total > 0, single: Vec::new() };
        let mut start = 0;
        for (low, end) in (0u32..).zip(ends.chunks_exact(2)) {
            counted.add_edges_at(low, &mut highs[start..end[1]], end[0] - start);
            start = end[1];
        }
        counted
    }

    /// Counts the edges between the position `low` and the higher positions `highs`. The first `down` edges lead to the
    /// lower position.
    fn add_edges_at(&mut self, low: u32, highs: &mut [u32], down: usize) {
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
            if let &[high] = edge {
                self.single.push([low, high]);
            }
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

    /// Random numbers in [0, 1).
    fn random_numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut count = 0;
        move || {
            count += 1;
            (crate::random::mix(seed << 32 | count) >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// The sphere of three.js: its last column of vertices repeats the first, and each pole is a row of vertices.
    fn sphere(columns: u32, rows: u32, mut place: impl FnMut(DVec3) -> Vec3) -> Mesh {
        let mut mesh = Mesh::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let phi = f64::from(column) / f64::from(columns) * std::f64::consts::TAU;
                let theta = f64::from(row) / f64::from(rows) * std::f64::consts::PI;
                let p = DVec3::new(-phi.cos() * theta.sin(), theta.cos(), phi.sin() * theta.sin());
                mesh.positions.push(place(p));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let b = row * (columns + 1) + column;
                let (a, c, d) = (b + 1, b + columns + 1, b + columns + 2);
                if row > 0 {
                    mesh.triangles.push([a, b, d]);
                }
                if row + 1 < rows {
                    mesh.triangles.push([b, c, d]);
                }
            }
        }
        mesh
    }

    /// Seams of spheres close, whatever the size, place, resolution and rounding errors of the sphere, whether it is one
    /// mesh or two, and its triangles stay.
    #[test]
    fn seams_that_rounding_errors_have_opened_are_welded() {
        for seed in 0..100 {
            let mut random = random_numbers(seed);
            let mut between = |low: f64, high: f64| low + (high - low) * random();
            let (columns, rows) = (between(3.0, 60.0) as u32, between(2.0, 40.0) as u32);
            let radius = 10f64.powf(between(-6.0, 6.0));
            let center = DVec3::new(between(-3.0, 3.0), between(-3.0, 3.0), 0.0) * radius;
            // The rounding errors of three.js itself, or up to four roundings in addition.
            let error = if seed % 2 == 0 { 0.0 } else { 4.0 * f64::from(f32::EPSILON) * radius };
            let center = if seed % 4 < 2 { DVec3::ZERO } else { center };
            let mut moved = |p: DVec3| {
                let [x, y, z] = [0; 3].map(|_| between(-error, error));
                (center + p * radius + DVec3::new(x, y, z)).as_vec3()
            };
            let mut mesh = sphere(columns, rows, &mut moved);
            assert!(!solid(&[&mesh]).closed, "{seed}: the seam is open");
            let before = mesh.clone();
            let cut = mesh.triangles.len() / 2;
            let mut rest = Mesh { triangles: mesh.triangles.split_off(cut), ..mesh.clone() };
            weld_seams(&mut [&mut mesh, &mut rest]);
            assert!(solid(&[&mesh, &rest]).closed, "{seed}");
            assert_eq!([&mesh.triangles[..], &rest.triangles[..]].concat(), before.triangles, "{seed}");
            let width =
                2.0 * SEAM_WIDTH as f32 * before.positions.iter().fold(0.0, |w: f32, p| w.max(p.abs().max_element()));
            let moved = before.positions.iter().zip(&mesh.positions).map(|(a, b)| a.distance(*b));
            assert!(moved.fold(0.0, f32::max) <= width, "{seed}");
        }
    }

    /// A box of which faces are missing.
    fn open_box(low: Vec3, high: Vec3, missing: usize) -> Mesh {
        let corner = |i: usize| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let cut = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        let triangles = quads[missing..].iter().copied().flat_map(cut).collect();
        Mesh { positions: (0..8).map(corner).collect(), triangles, ..Mesh::default() }
    }

    /// Separate surfaces keep their positions, however close they are: walls of closed solids, solids that touch or nearly
    /// touch, sheets that are not closed, and meshes that are so fine that their edges are as short as rounding errors.
    #[test]
    fn separate_surfaces_are_not_welded() {
        let unchanged = |meshes: &[Mesh], what: &str| {
            let mut welded = meshes.to_vec();
            weld_seams(&mut welded.iter_mut().collect::<Vec<_>>());
            for (before, after) in meshes.iter().zip(&welded) {
                assert_eq!((&before.positions, &before.triangles), (&after.positions, &after.triangles), "{what}");
            }
        };
        for seed in 0..200 {
            let mut random = random_numbers(seed);
            let size = 10f64.powf(12.0 * random() - 6.0) as f32;
            let low = Vec3::new(random() as f32, random() as f32, random() as f32) * size;
            let thin = |thickness: f32| Vec3::new(size, size, thickness * size);
            for thickness in [1e-4, 1e-5, 1e-6] {
                unchanged(&[open_box(low, low + thin(thickness), 0)], "a thin wall");
            }
            let whole = open_box(low, low + size, 0);
            let gap = [0.0, 1e-7, 1e-5][seed as usize % 3] * size;
            let beside = low + Vec3::X * (size + gap);
            unchanged(&[whole.clone(), open_box(beside, beside + size, 0)], "two cubes");
            // Four walls of a box without ends, and its two ends: sheets 1e-4 of their size apart.
            unchanged(&[open_box(low, low + Vec3::new(1e-4 * size, size, size), 2)], "an open wall");
            let sheet = |z: f32| open_box(low, low + Vec3::new(size, size, z), 5);
            unchanged(&[sheet(1e-4 * size), sheet(2e-4 * size)], "two sheets");
            // A sheet of 9 by 9 vertices far from the origin; the distances of vertices are few roundings.
            let step = (1 + seed as u32 % 20) as f32 * f32::EPSILON * size;
            let at = |i: u32| Vec3::new(size + (i % 9) as f32 * step, size + (i / 9) as f32 * step, size);
            let quad = |i: u32| (i % 9 < 8).then_some([[i, i + 1, i + 10], [i, i + 10, i + 9]]);
            let triangles = (0..72).filter_map(quad).flatten().collect();
            unchanged(&[Mesh { positions: (0..81).map(at).collect(), triangles, ..Mesh::default() }], "a fine sheet");
        }
    }

    /// Rims of millions of vertices in one place take no longer than elsewhere.
    #[test]
    fn crowded_rims_do_not_take_quadratic_time() {
        let mut random = random_numbers(1);
        let mut point = || Vec3::new(1.0, 1.0 + 1e-6 * random() as f32, 1e-6 * random() as f32);
        let positions: Vec<Vec3> = (0..150_000).map(|_| point()).collect();
        let triangles = (0..50_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        weld_seams(&mut [&mut Mesh { positions, triangles, ..Mesh::default() }]);
    }
}
