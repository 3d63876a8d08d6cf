//! Nesting and orientation of the connected parts (shells) of closed glass, in one mesh or several.

use super::topology::weld;
use crate::geometry::Mesh;
use crate::math::DVec3;
use rstar::RTree;
use rstar::primitives::{GeomWithData, Rectangle};
use std::collections::HashSet;

/// Numbers of shells (connected parts of closed glass) that face inwards or were flipped.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ShellReport {
    /// Number of outermost shells whose faces point inwards.
    pub(super) inverted: usize,
    /// Number of inner shells that were flipped.
    pub(super) flipped: usize,
}

/// Reference to a triangle: index of its mesh, and of the triangle in the mesh.
type Face = (u32, u32);

/// A connected part of the surface of closed glass.
struct Shell {
    triangles: Vec<Face>,
    /// Enclosed volume (m3); negative if the faces point inwards.
    volume: f64,
    low: DVec3,
    high: DVec3,
}

/// Flips each shell (connected part of closed glass) that is inside another and has the same orientation. A second
/// surface of the same glass would have no effect, so the shell was meant to bound a hollow. Together, `meshes` are
/// closed.
pub(super) fn flip_inner(meshes: &mut [&mut Mesh]) -> ShellReport {
    let mut shells = shells(&meshes.iter().map(|mesh| &**mesh).collect::<Vec<_>>());
    // From the largest to the smallest, so that the orientation of an outer shell is final before its inner shells.
    shells.sort_by(|a, b| b.volume.abs().total_cmp(&a.volume.abs()));
    let boxes = shells
        .iter()
        .enumerate()
        .map(|(i, shell)| GeomWithData::new(Rectangle::from_corners(shell.low.to_array(), shell.high.to_array()), i));
    let boxes = RTree::bulk_load(boxes.collect());
    let mut report = ShellReport::default();
    for i in 0..shells.len() {
        let all: Vec<&Mesh> = meshes.iter().map(|mesh| &**mesh).collect();
        let start = corners(&all, shells[i].triangles[0])[0];
        let around = boxes.locate_all_at_point(start.to_array()).map(|other| other.data).filter(|&other| other < i);
        // The smallest shell that contains this one.
        let mut around: Vec<usize> = around.collect();
        around.sort_unstable_by_key(|&other| std::cmp::Reverse(other));
        let outer = around.into_iter().find(|&other| contains(&all, &shells[other], &shells[i]));
        let inwards = shells[i].volume < 0.0;
        match outer {
            None => report.inverted += usize::from(inwards),
            Some(outer) if inwards == (shells[outer].volume < 0.0) => {
                flip(meshes, &shells[i].triangles);
                shells[i].volume = -shells[i].volume;
                report.flipped += 1;
            }
            Some(_) => {}
        }
    }
    report
}

fn corners(meshes: &[&Mesh], (mesh, triangle): Face) -> [DVec3; 3] {
    let mesh = meshes[mesh as usize];
    mesh.triangles[triangle as usize].map(|i| mesh.positions[i as usize].as_dvec3())
}

fn shells(meshes: &[&Mesh]) -> Vec<Shell> {
    let (places, count) = weld(meshes);
    let faces = || {
        (0u32..).zip(meshes).zip(&places).flat_map(|((number, mesh), places)| {
            (0u32..).zip(&mesh.triangles).map(move |(i, t)| ((number, i), t.map(|i| places[i as usize])))
        })
    };
    // Union-find over positions: the root of a position is the lowest position of its shell.
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for (_, places) in faces() {
        let [a, b, c] = places.map(|place| root(&mut parents, place));
        let first = a.min(b).min(c);
        [a, b, c].iter().for_each(|&place| parents[place as usize] = first);
    }
    let mut numbers = vec![u32::MAX; count];
    let mut shells: Vec<Shell> = Vec::new();
    for (face, places) in faces() {
        let number = &mut numbers[root(&mut parents, places[0]) as usize];
        if *number == u32::MAX {
            *number = shells.len() as u32;
            shells.push(Shell { triangles: Vec::new(), volume: 0.0, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY });
        }
        let shell = &mut shells[*number as usize];
        let own = corners(meshes, face);
        let origin = shell.triangles.first().map_or(own, |&first| corners(meshes, first))[0];
        let [p, q, r] = own.map(|p| p - origin);
        shell.volume += p.dot(q.cross(r)) / 6.0;
        for p in own {
            (shell.low, shell.high) = (shell.low.min(p), shell.high.max(p));
        }
        shell.triangles.push(face);
    }
    shells
}

/// Root of the set that contains `place` in a union-find forest, with path halving.
fn root(parents: &mut [u32], mut place: u32) -> u32 {
    while parents[place as usize] != place {
        let next = parents[parents[place as usize] as usize];
        (parents[place as usize], place) = (next, next);
    }
    place
}

/// Whether the shell `outer` contains all of `inner`, tested at a few corners. Shells that intersect do not contain
/// each other.
fn contains(meshes: &[&Mesh], outer: &Shell, inner: &Shell) -> bool {
    const CORNERS: usize = 3;
    let step = inner.triangles.len().div_ceil(CORNERS);
    inner.low.cmpgt(outer.low).all()
        && inner.high.cmplt(outer.high).all()
        && inner.triangles.iter().step_by(step).all(|&t| is_inside(meshes, outer, corners(meshes, t)[0]))
}

/// Whether `p` is inside a shell: a ray along +X hits an odd number of triangles. A hit on an edge or corner counts for
/// exactly one of the triangles that share it.
fn is_inside(meshes: &[&Mesh], shell: &Shell, p: DVec3) -> bool {
    let met = |&face: &Face| {
        let [a, b, c] = corners(meshes, face).map(|corner| corner - p);
        let crossed = [(a, b), (b, c), (c, a)].into_iter().filter(|&(from, to)| crosses(from, to)).count();
        let n = (b - a).cross(c - a);
        // The ray hits the triangle's plane at x n.x = a.n.
        crossed % 2 == 1 && (a.dot(n) > 0.0) == (n.x > 0.0)
    };
    shell.triangles.iter().filter(|t| met(t)).count() % 2 == 1
}

/// Whether an edge, projected along X, crosses the half-line y = 0, z > 0.
fn crosses(from: DVec3, to: DVec3) -> bool {
    // Ordered ends, so that both triangles of the edge get the same result.
    let (low, high) = if from.y < to.y { (from, to) } else { (to, from) };
    low.y <= 0.0 && high.y > 0.0 && low.z * high.y > high.z * low.y
}

/// Flips the winding, normals and tangents of triangles.
fn flip(meshes: &mut [&mut Mesh], triangles: &[Face]) {
    let mut vertices = HashSet::new();
    for &(mesh, triangle) in triangles {
        let triangle = &mut meshes[mesh as usize].triangles[triangle as usize];
        triangle.swap(1, 2);
        vertices.extend(triangle.map(|i| (mesh as usize, i as usize)));
    }
    for (mesh, i) in vertices {
        let mesh = &mut *meshes[mesh];
        if let Some(n) = mesh.normals.get_mut(i) {
            *n = -*n;
        }
        if let Some(t) = mesh.tangents.get_mut(i) {
            t.w = -t.w;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    /// A mesh of octahedra, each given by centre, radius and whether its faces point inwards.
    fn octahedra(all: &[(Vec3, f32, bool)]) -> Mesh {
        let mut mesh = Mesh::default();
        for &(center, radius, inwards) in all {
            let first = mesh.positions.len() as u32;
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                for sign in [1.0, -1.0] {
                    mesh.positions.push(center + axis * (sign * radius));
                    mesh.normals.push(axis * if inwards { -sign } else { sign });
                }
            }
            for corner in 0..8u32 {
                let [x, y, z] = [0, 1, 2].map(|axis| first + 2 * axis + (corner >> axis & 1));
                let even = corner.count_ones() % 2 == 0;
                mesh.triangles.push(if even != inwards { [x, y, z] } else { [x, z, y] });
            }
        }
        mesh
    }

    fn volumes(mesh: &Mesh) -> Vec<bool> {
        shells(&[mesh]).iter().map(|shell| shell.volume > 0.0).collect()
    }

    /// A hollow ball with a ball in its hollow: the faces of the shells point outwards, inwards, outwards.
    #[test]
    fn inner_shells_get_alternating_orientations() {
        let (o, right) = (Vec3::new(0.1, 0.2, 0.3), [false, true, false]);
        for mask in 0..8u32 {
            let inwards: Vec<bool> = (0..3).map(|i| mask >> i & 1 == 1).collect();
            let all = [(o, 3.0, inwards[0]), (o + 0.1, 2.0, inwards[1]), (o, 1.0, inwards[2])];
            let mut mesh = octahedra(&all);
            let report = flip_inner(&mut [&mut mesh]);
            // The outermost shell keeps its orientation.
            let expected = right.map(|inwards_of_right| inwards_of_right != inwards[0]);
            let flipped = inwards.iter().zip(expected).filter(|(was, is)| **was != *is).count();
            assert_eq!(report, ShellReport { inverted: usize::from(inwards[0]), flipped }, "{mask}");
            assert_eq!(volumes(&mesh), expected.map(|inwards| !inwards));
            let along = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                (b - a).cross(c - a).dot(mesh.normals[t[0] as usize]) > 0.0
            };
            assert!(mesh.triangles.iter().all(along), "normals are flipped, too");
        }
    }

    /// Shells next to each other, and shells that intersect, do not change; each is checked by itself.
    #[test]
    fn shells_that_are_not_nested_do_not_change() {
        let beside = [(Vec3::ZERO, 3.0, false), (Vec3::X * 9.0, 1.0, true), (Vec3::Y * 2.5, 1.0, false)];
        let mut mesh = octahedra(&beside);
        let before = mesh.triangles.clone();
        assert_eq!(flip_inner(&mut [&mut mesh]), ShellReport { inverted: 1, flipped: 0 });
        assert_eq!(mesh.triangles, before);
    }

    /// Shells that are split over several meshes are flipped like those of one mesh.
    #[test]
    fn shells_in_several_meshes_are_flipped_like_in_one() {
        let mut whole = octahedra(&[(Vec3::ZERO, 3.0, false), (Vec3::ZERO, 2.0, false), (Vec3::X * 9.0, 1.0, true)]);
        let belongs = |divisor: usize, part: usize, i: usize| i / divisor % 2 == part;
        let divided = |mesh: &Mesh, divisor: usize| {
            [0, 1].map(|part| {
                let triangles = mesh.triangles.iter().enumerate().filter(|(i, _)| belongs(divisor, part, *i));
                Mesh { triangles: triangles.map(|(_, t)| *t).collect(), ..mesh.clone() }
            })
        };
        // Split between shells, and within each shell.
        let parts = [8, 3].map(|divisor| (divisor, divided(&whole, divisor)));
        let report = flip_inner(&mut [&mut whole]);
        assert_eq!(report, ShellReport { inverted: 1, flipped: 1 });
        for (divisor, [mut a, mut b]) in parts {
            assert_eq!(flip_inner(&mut [&mut a, &mut b]), report);
            let expected = divided(&whole, divisor);
            assert_eq!([a.triangles, b.triangles], expected.map(|mesh| mesh.triangles), "{divisor}");
        }
    }
}
