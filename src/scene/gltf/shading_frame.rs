//! Computes normals and tangents that a file lacks.

use crate::geometry::Mesh;
use crate::math::{Vec2, Vec3, Vec4};
use crate::texture::TextureRef;

/// Replaces zero normals by the area-weighted mean normal of the adjacent faces. Returns the number of replaced
/// normals.
pub(super) fn repair_normals(mesh: &mut Mesh) -> usize {
    if mesh.normals.iter().all(|n| *n != Vec3::ZERO) {
        return 0;
    }
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        t.iter().for_each(|&i| sums[i as usize] += (b - a).cross(c - a));
    }
    let mut repaired = 0;
    for (n, sum) in mesh.normals.iter_mut().zip(&sums).filter(|(n, _)| **n == Vec3::ZERO) {
        *n = sum.normalize_or(Vec3::Z);
        repaired += 1;
    }
    repaired
}

/// Computes the tangents of a mesh, in the direction of increasing u of `coordinates`: the angle-weighted mean over the
/// adjacent faces, made perpendicular to the normal. As in MikkTSpace (<http://www.mikktspace.com>), which glTF
/// prescribes, faces that are mirrored in the texture do not contribute to the tangents of others: a vertex between
/// both kinds is split.
pub(super) fn make_tangents(mesh: &mut Mesh, coordinates: &TextureRef) {
    let set = usize::from(coordinates.set);
    if mesh.uvs[set].is_empty() {
        return;
    }
    let uv_of = |mesh: &Mesh, i: u32| coordinates.coordinates([mesh.uvs[set][i as usize]; 2]);
    let mut twin: Vec<Option<u32>> = vec![None; mesh.positions.len()];
    // Handedness of the first face at each vertex.
    let mut side: Vec<Option<bool>> = vec![None; mesh.positions.len()];
    let mut triangles = std::mem::take(&mut mesh.triangles);
    for t in &mut triangles {
        let mirrored = area(t.map(|i| uv_of(mesh, i))) < 0.0;
        for i in t {
            let first = *side[*i as usize].get_or_insert(mirrored);
            if first != mirrored {
                *i = *twin[*i as usize].get_or_insert_with(|| split(mesh, *i));
            }
        }
    }
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    let mut signs = vec![1.0; mesh.positions.len()];
    for t in &triangles {
        let p = t.map(|i| mesh.positions[i as usize]);
        let uv = t.map(|i| uv_of(mesh, i));
        let (e1, e2, d1, d2) = (p[1] - p[0], p[2] - p[0], uv[1] - uv[0], uv[2] - uv[0]);
        let sign = if area(uv) < 0.0 { -1.0 } else { 1.0 };
        let Some(along_u) = ((e1 * d2.y - e2 * d1.y) * sign).try_normalize() else { continue };
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let angle = if a == Vec3::ZERO || b == Vec3::ZERO { 0.0 } else { a.angle_between(b) };
            sums[t[k] as usize] += along_u * angle;
            // v increases downwards in the image, and glTF's bitangent, w cross(n, t), points to decreasing v.
            signs[t[k] as usize] = -sign;
        }
    }
    mesh.triangles = triangles;
    let flat = mesh.normals.is_empty();
    let perpendicular = |(i, sum): (usize, &Vec3)| {
        let n = if flat { Vec3::ZERO } else { mesh.normals[i] };
        let t = (*sum - n * n.dot(*sum))
            .try_normalize()
            .unwrap_or_else(|| if flat { Vec3::X } else { n.any_orthonormal_vector() });
        t.extend(signs[i])
    };
    mesh.tangents = sums.iter().enumerate().map(perpendicular).collect::<Vec<Vec4>>();
}

/// Twice the signed area of a triangle in texture space.
fn area([a, b, c]: [Vec2; 3]) -> f32 {
    (b - a).perp_dot(c - a)
}

/// Appends a copy of vertex `i` to the mesh, and returns the index of the copy.
fn split(mesh: &mut Mesh, i: u32) -> u32 {
    fn repeat<T: Copy>(values: &mut Vec<T>, i: usize) {
        if let Some(&value) = values.get(i) {
            values.push(value);
        }
    }
    let i = i as usize;
    repeat(&mut mesh.positions, i);
    repeat(&mut mesh.normals, i);
    repeat(&mut mesh.colors, i);
    mesh.uvs.iter_mut().for_each(|uv| repeat(uv, i));
    mesh.positions.len() as u32 - 1
}
