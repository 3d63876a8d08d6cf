//! Transforms of nodes, in f64.

use super::document::{Document, get, named};
use super::fault;
use crate::error::Result;
use crate::math::{DAffine3, DMat3, DVec3, Vec3, corners};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::HashMap;

/// Maximum absolute coordinate of a vertex (m). Squared areas of larger triangles would overflow f32.
pub(super) const MAX_COORDINATE: f64 = 1e9;

/// Transform of a node relative to its parent, from a matrix, or from translation, rotation and scale (specification,
/// section 3.5.3), read from the raw JSON in f64.
pub(super) fn local(raw: &Value, place: &str) -> Result<DAffine3> {
    fn numbers<const N: usize>(raw: &Value, key: &str, place: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = raw.get(key) else { return Ok(None) };
        let list = value.as_array().map_or(&[][..], Vec::as_slice);
        let numbers: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
        let numbers = numbers.and_then(|n| <[f64; N]>::try_from(n).ok());
        numbers.map(Some).ok_or_else(|| fault(place, format!("its {key} is not {N} numbers")))
    }
    if let Some(m) = numbers::<16>(raw, "matrix", place)? {
        return affine(m).ok_or_else(|| fault(place, "the last row of its matrix is not 0, 0, 0, 1"));
    }
    let (t, r, s) =
        (numbers(raw, "translation", place)?, numbers(raw, "rotation", place)?, numbers(raw, "scale", place)?);
    compose(t, r, s).ok_or_else(|| fault(place, "its rotation is not a quaternion"))
}

/// The transform of a column-major 4 x 4 matrix. `None` if its last row is not 0, 0, 0, 1.
pub fn affine(m: [f64; 16]) -> Option<DAffine3> {
    let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    let transform = DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) };
    ([m[3], m[7], m[11], m[15]] == [0.0, 0.0, 0.0, 1.0]).then_some(transform)
}

/// Composes scale `s`, then rotation `r` (a quaternion, normalised), then translation `t`; `None` is the identity.
/// Returns `None` if the quaternion is zero.
pub(super) fn compose(t: Option<[f64; 3]>, r: Option<[f64; 4]>, s: Option<[f64; 3]>) -> Option<DAffine3> {
    let rotation = glam::DVec4::from_array(r.unwrap_or([0.0, 0.0, 0.0, 1.0])).try_normalize()?;
    let (t, s) = (DVec3::from_array(t.unwrap_or([0.0; 3])), DVec3::from_array(s.unwrap_or([1.0; 3])));
    Some(DAffine3::from_scale_rotation_translation(s, glam::DQuat::from_vec4(rotation), t))
}

pub(in crate::scene) fn is_finite(transform: &DAffine3) -> bool {
    transform.matrix3.is_finite() && transform.translation.is_finite()
}

/// Whether a transform has an inverse that f32 can represent.
pub(in crate::scene) fn is_invertible(transform: &DAffine3) -> bool {
    let inverse = transform.matrix3.inverse();
    transform.matrix3.determinant() != 0.0
        && inverse.is_finite()
        && inverse.to_cols_array().iter().all(|x| x.abs() < f64::from(f32::MAX).sqrt())
}

/// Checks that a mesh with these bounds is not placed too far from the origin.
pub(in crate::scene) fn check_reach(bounds: (Vec3, Vec3), to_world: &DAffine3, place: &str) -> Result<()> {
    let reach = |corner: Vec3| to_world.transform_point3(corner.as_dvec3()).abs().max_element();
    if corners(bounds).into_iter().all(|corner| reach(corner) <= MAX_COORDINATE) {
        return Ok(());
    }
    Err(fault(place, "it reaches too far from the origin").hint("look at its scale and position"))
}

/// World transforms of the nodes of a document, in any of its scenes.
pub(super) struct WorldTransforms<'d, 'a> {
    document: &'d Document<'a>,
    /// Index of each node's parent; `None` for a root.
    parents: Vec<Option<usize>>,
    /// Cache of world transforms by index of the node, because joints share their ancestors.
    known: RefCell<HashMap<usize, DAffine3>>,
}

impl<'d, 'a> WorldTransforms<'d, 'a> {
    pub(super) fn new(document: &'d Document<'a>) -> WorldTransforms<'d, 'a> {
        let mut parents = vec![None; document.nodes.len()];
        for (parent, node) in document.nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                if let Some(slot) = parents.get_mut(child.value()) {
                    *slot = Some(parent);
                }
            }
        }
        WorldTransforms { document, parents, known: RefCell::default() }
    }

    /// The world transform of the node with this index.
    ///
    /// # Errors
    /// The node does not exist or is its own ancestor, or a transform of an ancestor is invalid.
    pub(super) fn of(&self, node: usize) -> Result<DAffine3> {
        let mut known = self.known.borrow_mut();
        let (mut chain, mut at) = (Vec::new(), Some(node));
        while let Some(index) = at.filter(|index| !known.contains_key(index)) {
            get(&self.document.nodes, index, "node")?;
            // A longer chain than the number of nodes is a cycle.
            if chain.len() == self.parents.len() {
                let error = fault(format!("node {node}"), "it is its own ancestor");
                return Err(error.hint("the file is damaged: export it again"));
            }
            chain.push(index);
            at = self.parents[index];
        }
        let mut whole = at.and_then(|index| known.get(&index).copied()).unwrap_or(DAffine3::IDENTITY);
        for index in chain.into_iter().rev() {
            let name = self.document.nodes[index].name.as_deref();
            whole *= local(self.document.part("nodes", index), &named("node", name, index))?;
            known.insert(index, whole);
        }
        Ok(whole)
    }
}
