//! The connected parts of a closed mesh of glass: which lies inside which, and which way they look.

use super::topology::welded;
use crate::geometry::Mesh;
use crate::math::DVec3;
use rstar::RTree;
use rstar::primitives::{GeomWithData, Rectangle};
use std::collections::HashSet;

/// What has been found of the shells of a mesh.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Found {
    /// Outermost shells whose faces look inwards.
    pub(super) inverted: usize,
    /// Shells that have been turned over.
    pub(super) turned: usize,
}

/// A connected part of a closed mesh.
struct Shell {
    triangles: Vec<u32>,
    /// Negative where its faces look inwards.
    volume: f64,
    low: DVec3,
    high: DVec3,
}

/// Turns over the shells of a closed mesh that lie inside another and look the same way as that: a second surface of the
/// same glass would have no effect, so it was meant to bound a hollow.
pub(super) fn turn_inner(mesh: &mut Mesh) -> Found {
    let mut shells = shells(mesh);
    // The larger come first, so that what holds a shell is decided before it.
    shells.sort_by(|a, b| b.volume.abs().total_cmp(&a.volume.abs()));
    let boxes = shells
        .iter()
        .enumerate()
        .map(|(i, shell)| GeomWithData::new(Rectangle::from_corners(shell.low.to_array(), shell.high.to_array()), i));
    let boxes = RTree::bulk_load(boxes.collect());
    let mut found = Found::default();
    for i in 0..shells.len() {
        let start = corner(mesh, shells[i].triangles[0]);
        let around = boxes.locate_all_at_point(start.to_array()).map(|other| other.data).filter(|&other| other < i);
        // The smallest of those that hold it.
        let mut around: Vec<usize> = around.collect();
        around.sort_unstable_by_key(|&other| std::cmp::Reverse(other));
        let holder = around.into_iter().find(|&other| holds(mesh, &shells[other], &shells[i]));
        let inwards = shells[i].volume < 0.0;
        match holder {
            None => found.inverted += usize::from(inwards),
            Some(holder) if inwards == (shells[holder].volume < 0.0) => {
                turn(mesh, &shells[i].triangles);
                shells[i].volume = -shells[i].volume;
                found.turned += 1;
            }
            Some(_) => {}
        }
    }
    found
}

fn corner(mesh: &Mesh, triangle: u32) -> DVec3 {
    mesh.positions[mesh.triangles[triangle as usize][0] as usize].as_dvec3()
}

fn shells(mesh: &Mesh) -> Vec<Shell> {
    let (places, count) = welded(&[mesh]);
    let places = &places[0];
    // Each place points towards the first of its shell.
    let mut towards: Vec<u32> = (0..count as u32).collect();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| root(&mut towards, places[i as usize]));
        let first = a.min(b).min(c);
        [a, b, c].iter().for_each(|&place| towards[place as usize] = first);
    }
    let mut numbers = vec![u32::MAX; count];
    let mut shells: Vec<Shell> = Vec::new();
    for (i, t) in mesh.triangles.iter().enumerate() {
        let number = &mut numbers[root(&mut towards, places[t[0] as usize]) as usize];
        if *number == u32::MAX {
            *number = shells.len() as u32;
            shells.push(Shell { triangles: Vec::new(), volume: 0.0, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY });
        }
        let shell = &mut shells[*number as usize];
        let corners = t.map(|i| mesh.positions[i as usize].as_dvec3());
        let origin = shell.triangles.first().map_or(corners[0], |&first| corner(mesh, first));
        let [p, q, r] = corners.map(|p| p - origin);
        shell.volume += p.dot(q.cross(r)) / 6.0;
        for p in corners {
            (shell.low, shell.high) = (shell.low.min(p), shell.high.max(p));
        }
        shell.triangles.push(i as u32);
    }
    shells
}

fn root(towards: &mut [u32], mut place: u32) -> u32 {
    while towards[place as usize] != place {
        let next = towards[towards[place as usize] as usize];
        (towards[place as usize], place) = (next, next);
    }
    place
}

/// Whether a shell holds another whole, as far as a few of its corners tell: shells that cut each other do not.
fn holds(mesh: &Mesh, outer: &Shell, inner: &Shell) -> bool {
    const CORNERS: usize = 3;
    let step = inner.triangles.len().div_ceil(CORNERS);
    inner.low.cmpgt(outer.low).all()
        && inner.high.cmplt(outer.high).all()
        && inner.triangles.iter().step_by(step).all(|&t| is_inside(mesh, outer, corner(mesh, t)))
}

/// Whether a ray from `p` along +X meets an odd number of the shell's triangles. Edges and corners count for one of the
/// triangles that share them.
fn is_inside(mesh: &Mesh, shell: &Shell, p: DVec3) -> bool {
    let met = |&t: &u32| {
        let [a, b, c] = mesh.triangles[t as usize].map(|i| mesh.positions[i as usize].as_dvec3() - p);
        let crossed = [(a, b), (b, c), (c, a)].into_iter().filter(|&(from, to)| crosses(from, to)).count();
        let n = (b - a).cross(c - a);
        // Where the ray meets the triangle's plane: x n.x = a.n.
        crossed % 2 == 1 && (a.dot(n) > 0.0) == (n.x > 0.0)
    };
    shell.triangles.iter().filter(|t| met(t)).count() % 2 == 1
}

/// Whether the edge, seen along X, passes above the origin from one side to the other.
fn crosses(from: DVec3, to: DVec3) -> bool {
    // In one order, so that both triangles find the same.
    let (low, high) = if from.y < to.y { (from, to) } else { (to, from) };
    low.y <= 0.0 && high.y > 0.0 && low.z * high.y > high.z * low.y
}

fn turn(mesh: &mut Mesh, triangles: &[u32]) {
    let mut vertices = HashSet::new();
    for &t in triangles {
        let triangle = &mut mesh.triangles[t as usize];
        triangle.swap(1, 2);
        vertices.extend(triangle.iter().map(|&i| i as usize));
    }
    for i in vertices {
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

    /// Octahedra, by centre, radius and whether they look inwards, in one mesh.
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
        shells(mesh).iter().map(|shell| shell.volume > 0.0).collect()
    }

    /// A hollow ball with a ball in its hollow: the shells look out, in, out.
    #[test]
    fn inner_shells_are_turned_by_nesting() {
        let (o, right) = (Vec3::new(0.1, 0.2, 0.3), [false, true, false]);
        for mask in 0..8u32 {
            let inwards: Vec<bool> = (0..3).map(|i| mask >> i & 1 == 1).collect();
            let all = [(o, 3.0, inwards[0]), (o + 0.1, 2.0, inwards[1]), (o, 1.0, inwards[2])];
            let mut mesh = octahedra(&all);
            let found = turn_inner(&mut mesh);
            // The outermost says which way is out.
            let expected = right.map(|inwards_of_right| inwards_of_right != inwards[0]);
            let turned = inwards.iter().zip(expected).filter(|(was, is)| **was != *is).count();
            assert_eq!(found, Found { inverted: usize::from(inwards[0]), turned }, "{mask}");
            assert_eq!(volumes(&mesh), expected.map(|inwards| !inwards));
            let along = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                (b - a).cross(c - a).dot(mesh.normals[t[0] as usize]) > 0.0
            };
            assert!(mesh.triangles.iter().all(along), "normals are turned along");
        }
    }

    /// Shells beside each other, and shells that cut each other, stay as they are; each is diagnosed by itself.
    #[test]
    fn shells_that_are_not_nested_stay() {
        let beside = [(Vec3::ZERO, 3.0, false), (Vec3::X * 9.0, 1.0, true), (Vec3::Y * 2.5, 1.0, false)];
        let mut mesh = octahedra(&beside);
        let before = mesh.triangles.clone();
        assert_eq!(turn_inner(&mut mesh), Found { inverted: 1, turned: 0 });
        assert_eq!(mesh.triangles, before);
    }
}
