//! Deforms meshes by morph targets (specification, section 3.7.2.2), then by skins (section 3.7.3.3: linear blend
//! skinning).

use super::document::{Document, get, named};
use super::transform::{WorldTransforms, affine, is_finite};
use super::{counted, fault};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use gltf::json::mesh::{MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;

const EXPORT: &str = "the file is damaged: export it again";

/// The deformation of a mesh by the morph weights and the skin of its node.
#[derive(Default)]
pub(super) struct Deformation {
    /// Weights of the mesh's morph targets; empty if all are zero.
    weights: Vec<f64>,
    /// Joint matrices of the skin, from the bind pose to world space relative to `center`; `None` without a skin.
    joints: Option<Vec<DAffine3>>,
    /// World transform of a skinned mesh: a translation to the first joint; `None` without a skin.
    pub(super) center: Option<DAffine3>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Skin {
    joints: Vec<usize>,
    #[serde(default)]
    inverse_bind_matrices: Option<usize>,
}

/// Whether a node, given by its raw JSON, deforms its mesh, so that the deformed mesh is not shared.
pub(super) fn is_deformed(raw: &Value) -> bool {
    raw.get("skin").is_some() || raw.get("weights").is_some()
}

impl Deformation {
    /// The deformation of the mesh with index `mesh` by the node with index `node`.
    ///
    /// # Errors
    /// The weights are not numbers, the skin or a joint does not exist, or a joint has no finite transform.
    pub(super) fn of(document: &Document, mesh: usize, node: usize, worlds: &WorldTransforms) -> Result<Deformation> {
        let raw = document.part("nodes", node);
        let weights = raw.get("weights").or(document.part("meshes", mesh).get("weights"));
        let weights = weights.map_or(Ok(Vec::new()), |list| {
            Vec::<f64>::deserialize(list).map_err(|e| fault("its weights", e).hint(EXPORT))
        })?;
        let Some(skin) = raw.get("skin") else { return Ok(Deformation { weights, ..Deformation::default() }) };
        let skin = skin.as_u64().and_then(|i| usize::try_from(i).ok()).unwrap_or(usize::MAX);
        let list = document.raw["skins"].as_array().map_or(&[][..], Vec::as_slice);
        let place = named("skin", get(list, skin, "skin")?["name"].as_str(), skin);
        let mut joints = joints(document, &list[skin], worlds).map_err(|e| e.within(place))?;
        let center = DAffine3::from_translation(joints.first().map_or(DVec3::ZERO, |joint| joint.translation));
        joints.iter_mut().for_each(|joint| joint.translation -= center.translation);
        Ok(Deformation { weights, joints: Some(joints), center: Some(center) })
    }

    /// Deforms a mesh by morph targets and skin; `place` names the primitive in messages.
    ///
    /// # Errors
    /// Morph targets, joints or weights do not fit the mesh.
    pub(super) fn apply(
        &self,
        document: &Document,
        primitive: &Primitive,
        raw: &Value,
        mesh: &mut Mesh,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        self.morph(document, primitive, raw, mesh, place, warnings)?;
        match &self.joints {
            Some(joints) => skin(document, primitive, joints, mesh, place, warnings),
            None => Ok(()),
        }
    }

    fn morph(
        &self,
        document: &Document,
        primitive: &Primitive,
        raw: &Value,
        mesh: &mut Mesh,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        let targets = primitive.targets.as_deref().unwrap_or_default();
        if !self.weights.is_empty() && self.weights.len() != targets.len() {
            let cause = format!("{} weights are for {} morph targets", self.weights.len(), targets.len());
            return Err(fault(place, cause).hint(EXPORT));
        }
        let mut stale_normals = false;
        for (i, (target, &weight)) in targets.iter().zip(&self.weights).enumerate().filter(|(_, (_, w))| **w != 0.0) {
            let within = |e: crate::error::Error| e.within(format!("{place}, target {i}"));
            add_target(document, target, weight, mesh).map_err(within)?;
            stale_normals |= target.positions.is_some() && target.normals.is_none() && !mesh.normals.is_empty();
            let others = raw["targets"][i].as_object().into_iter().flat_map(|target| target.keys());
            for other in others.filter(|key| !["POSITION", "NORMAL", "TANGENT"].contains(&key.as_str())) {
                warnings.push(format!("{place}: {other} of its morph targets is ignored"));
            }
        }
        mesh.normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        if stale_normals {
            warnings.push(format!("{place}: its morph targets move no normals: shading is that of the base shape"));
        }
        Ok(())
    }
}

/// Adds the displacements of a morph target, times `weight`, to a mesh.
fn add_target(document: &Document, target: &MorphTarget, weight: f64, mesh: &mut Mesh) -> Result<()> {
    let moved = |values: &mut [Vec3], deltas: Vec<[f32; 3]>| {
        for (value, delta) in values.iter_mut().zip(deltas) {
            *value = (value.as_dvec3() + weight * Vec3::from_array(delta).as_dvec3()).as_vec3();
        }
    };
    let vertices = mesh.positions.len();
    let read = |index: &gltf::json::Index<_>| document.displacements(index.value(), vertices);
    if let Some(index) = &target.positions {
        moved(&mut mesh.positions, read(index)?);
    }
    if let Some(index) = &target.normals {
        moved(&mut mesh.normals, read(index)?);
    }
    match &target.tangents {
        Some(index) => {
            for (tangent, delta) in mesh.tangents.iter_mut().zip(read(index)?) {
                let turned = tangent.truncate() + weight as f32 * Vec3::from_array(delta);
                *tangent = turned.normalize_or_zero().extend(tangent.w);
            }
        }
        // Tangents are computed from texture coordinates if the material needs them.
        None => mesh.tangents.clear(),
    }
    Ok(())
}

/// Joint matrices of the skin `raw`: for each joint, its inverse bind matrix, followed by its world transform.
fn joints(document: &Document, raw: &Value, worlds: &WorldTransforms) -> Result<Vec<DAffine3>> {
    let skin = Skin::deserialize(raw).map_err(|e| fault("", e).hint(EXPORT))?;
    let binds = skin.inverse_bind_matrices.map(|index| document.floats::<16>(index)).transpose()?;
    if binds.as_ref().is_some_and(|binds| binds.len() < skin.joints.len()) {
        return Err(fault("", "it has fewer inverse bind matrices than joints").hint(EXPORT));
    }
    let joint = |(i, &node): (usize, &usize)| {
        let bind = binds.as_ref().map_or(Some(DAffine3::IDENTITY), |binds| affine(binds[i].map(f64::from)));
        let bind = bind
            .ok_or_else(|| fault(format!("inverse bind matrix {i}"), "its last row is not 0, 0, 0, 1").hint(EXPORT))?;
        let joint = worlds.of(node)? * bind;
        if !is_finite(&joint) {
            return Err(
                fault(format!("joint {i}"), "its transform is not finite").hint("look at its scale and position")
            );
        }
        Ok(joint)
    };
    skin.joints.iter().enumerate().map(joint).collect()
}

/// Reads a vertex attribute of a skin, joints or weights, with four values per vertex; `None` if the primitive lacks
/// it.
fn skin_attribute(
    document: &Document,
    primitive: &Primitive,
    semantic: Semantic,
    vertices: usize,
    place: &str,
) -> Result<Option<Vec<[f32; 4]>>> {
    let found = primitive.attributes.iter().find(|(s, _)| matches!(s, Checked::Valid(s) if *s == semantic));
    let values = found.map(|(_, index)| document.floats::<4>(index.value())).transpose();
    let values = values.map_err(|e| e.within(format!("{place}, {}", semantic.to_string())))?;
    match values {
        Some(values) if values.len() != vertices => {
            let cause = format!("{} has {} values for {vertices} vertices", semantic.to_string(), values.len());
            Err(fault(place, cause).hint(EXPORT))
        }
        values => Ok(values),
    }
}

/// Applies linear blend skinning to a mesh.
fn skin(
    document: &Document,
    primitive: &Primitive,
    joints: &[DAffine3],
    mesh: &mut Mesh,
    place: &str,
    warnings: &mut Vec<String>,
) -> Result<()> {
    let vertices = mesh.positions.len();
    let mut blends = vec![(DAffine3::ZERO, 0.0); vertices];
    let read = |semantic| skin_attribute(document, primitive, semantic, vertices, place);
    for set in 0.. {
        let (Some(which), Some(weights)) = (read(Semantic::Joints(set))?, read(Semantic::Weights(set))?) else {
            if set == 0 {
                return Err(fault(place, "its node has a skin, but it has no joints and weights").hint(EXPORT));
            }
            break;
        };
        for ((blend, which), weights) in blends.iter_mut().zip(which).zip(weights) {
            for (joint, weight) in which.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                let Some(matrix) = joints.get(joint as usize).filter(|_| weight.is_finite()) else {
                    let cause =
                        format!("joint {joint} with weight {weight} is none of the {} of its skin", joints.len());
                    return Err(fault(place, cause).hint(EXPORT));
                };
                let weight = f64::from(weight);
                blend.0.matrix3 += matrix.matrix3 * weight;
                blend.0.translation += matrix.translation * weight;
                blend.1 += weight;
            }
        }
    }
    let mut loose = 0;
    for (i, (matrix, sum)) in blends.into_iter().enumerate() {
        let matrix = if sum > 0.0 {
            DAffine3 { matrix3: matrix.matrix3 * (1.0 / sum), translation: matrix.translation / sum }
        } else {
            loose += 1;
            joints.first().copied().unwrap_or_default()
        };
        transform_vertex(mesh, i, &matrix);
    }
    if loose > 0 {
        let loose = counted(loose, "vertex has", "vertices have");
        warnings.push(format!("{place}: {loose} no weight of any joint, and the first joint moves them"));
    }
    // A mirrored skeleton flips the winding, so that the front stays the front.
    if joints.first().is_some_and(|joint| joint.matrix3.determinant() < 0.0) {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    Ok(())
}

fn transform_vertex(mesh: &mut Mesh, i: usize, matrix: &DAffine3) {
    let p = &mut mesh.positions[i];
    *p = matrix.transform_point3(p.as_dvec3()).as_vec3();
    if let Some(n) = mesh.normals.get_mut(i) {
        *n = (cofactors(&matrix.matrix3) * n.as_dvec3()).normalize_or_zero().as_vec3();
    }
    if let Some(t) = mesh.tangents.get_mut(i) {
        let w = if matrix.matrix3.determinant() < 0.0 { -t.w } else { t.w };
        *t = (matrix.matrix3 * t.truncate().as_dvec3()).normalize_or_zero().as_vec3().extend(w);
    }
}

/// The inverse transpose of a matrix up to a positive factor, defined for singular matrices, too. It transforms
/// normals.
fn cofactors(m: &DMat3) -> DMat3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign
}
