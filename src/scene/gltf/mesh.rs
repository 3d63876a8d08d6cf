//! Reads primitives as triangle meshes.

use super::deform::Deformation;
use super::document::{Document, get, named};
use super::transform::MAX_COORDINATE;
use super::{container, counted, fault, shading_frame};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::math::{Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

/// Reads the primitive `primitive` of the mesh with index `index`, deformed by a node. `None` if it has nothing to
/// render, with a warning.
///
/// # Errors
/// Data of the primitive are missing, out of range or not finite.
pub(super) fn read(
    document: &Document,
    index: usize,
    primitive: usize,
    deformation: &Deformation,
    warnings: &mut Vec<String>,
) -> Result<Option<Mesh>> {
    let parent = get(&document.meshes, index, "mesh")?;
    let name = named("mesh", parent.name.as_deref(), index);
    let place = format!("{name}, primitive {primitive}");
    let plain = parent.name.clone().filter(|n| !n.is_empty()).unwrap_or(name);
    let source = get(&parent.primitives, primitive, "primitive")?;
    let raw = &document.part("meshes", index)["primitives"][primitive];
    let reader = Reader { document, source, place: &place };
    // Without a buffer view, all positions would be zero.
    let has_data = |a: &json::Accessor| a.buffer_view.is_some() || a.sparse.is_some();
    let positions = reader.accessor(&Semantic::Positions).and_then(|index| document.accessors.get(index));
    if let Some(error) = positions.filter(|a| !has_data(a)).and_then(|_| container::compression_error(raw)) {
        return Err(error.within(place));
    }
    let mode = match source.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        Checked::Valid(mode) => {
            warnings.push(format!("{place}: it is made of {}, which are not rendered", kind(mode)));
            return Ok(None);
        }
        Checked::Invalid => return Err(fault(place, "its mode is unknown").hint(EXPORT)),
    };
    let Some(positions) = reader.floats::<3>(&Semantic::Positions)? else {
        warnings.push(format!("{place}: it has no positions, so there is nothing to render"));
        return Ok(None);
    };
    let positions: Vec<Vec3> = positions.into_iter().map(Vec3::from_array).collect();
    reader.check_positions(&positions)?;
    let order = match source.indices {
        Some(indices) => document.indices(indices.value()).map_err(|e| e.within(format!("{place}, indices")))?,
        None => (0..positions.len() as u32).collect(),
    };
    if let Some(index) = order.iter().find(|i| **i as usize >= positions.len()) {
        let cause = format!("index {index} is past the {} vertices", positions.len());
        return Err(fault(place, cause).hint("re-export the mesh with 'Apply Modifiers'"));
    }
    if mode == Mode::Triangles && !order.len().is_multiple_of(3) {
        warnings.push(format!("{place}: the last {} of its indices make no triangle", order.len() % 3));
    }
    let mut mesh = Mesh { name: plain, triangles: triangles(mode, &order), positions, ..Mesh::default() };
    drop(order);
    reader.attributes(&mut mesh, warnings)?;
    deformation.apply(document, source, raw, &mut mesh, &place, warnings)?;
    reader.check_positions(&mesh.positions)?;
    Ok(Some(mesh))
}

const EXPORT: &str = "the file is damaged: export it again";

fn kind(mode: Mode) -> &'static str {
    if mode == Mode::Points { "points" } else { "lines" }
}

/// Vertex indices of each triangle of a primitive in a drawing mode (specification, section 3.7.2.1); `order` lists its
/// vertices.
fn triangles(mode: Mode, order: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let corners = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            order.windows(3).enumerate().map(corners).collect()
        }
        Mode::TriangleFan => order.windows(2).skip(1).map(|w| [w[0], w[1], order[0]]).collect(),
        _ => order.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// Removes triangles without area, which no ray can hit. Returns the number of removed triangles.
pub(super) fn drop_degenerate(mesh: &mut Mesh) -> usize {
    let before = mesh.triangles.len();
    let positions = &mesh.positions;
    mesh.triangles.retain(|t| {
        let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
        (b - a).cross(c - a).length_squared() > 0.0
    });
    before - mesh.triangles.len()
}

struct Reader<'r> {
    document: &'r Document<'r>,
    source: &'r Primitive,
    place: &'r str,
}

impl Reader<'_> {
    fn accessor(&self, semantic: &Semantic) -> Option<usize> {
        let found = self.source.attributes.iter().find(|(s, _)| matches!(s, Checked::Valid(s) if s == semantic));
        found.map(|(_, index)| index.value())
    }

    fn floats<const N: usize>(&self, semantic: &Semantic) -> Result<Option<Vec<[f32; N]>>> {
        let Some(index) = self.accessor(semantic) else { return Ok(None) };
        let place = || format!("{}, {}", self.place, semantic.to_string());
        self.document.floats::<N>(index).map(Some).map_err(|e| e.within(place()))
    }

    fn check_positions(&self, positions: &[Vec3]) -> Result<()> {
        for (i, p) in positions.iter().enumerate() {
            let cause = if !p.is_finite() {
                "is not finite"
            } else if f64::from(p.abs().max_element()) > MAX_COORDINATE {
                "is too far from the origin"
            } else {
                continue;
            };
            let [x, y, z] = p.to_array();
            return Err(fault(self.place, format!("the position of vertex {i} {cause}: ({x}, {y}, {z})"))
                .hint("look at the mesh in the program that made it, and export it again"));
        }
        Ok(())
    }

    /// Reads an attribute of a primitive with one value per vertex. Non-finite values are replaced by `fallback`, with
    /// a warning.
    fn vertex_values<const N: usize>(
        &self,
        semantic: &Semantic,
        vertices: usize,
        fallback: [f32; N],
        warnings: &mut Vec<String>,
    ) -> Result<Vec<[f32; N]>> {
        let Some(mut values) = self.floats::<N>(semantic)? else { return Ok(Vec::new()) };
        if values.len() != vertices {
            let cause = format!("{} has {} values for {vertices} vertices", semantic.to_string(), values.len());
            return Err(fault(self.place, cause).hint(EXPORT));
        }
        let mut bad = 0;
        for value in values.iter_mut().filter(|v| v.iter().any(|x| !x.is_finite())) {
            *value = fallback;
            bad += 1;
        }
        if bad > 0 {
            let (what, at) = (semantic.to_string(), counted(bad, "vertex", "vertices"));
            warnings.push(format!("{}: {what} is not finite at {at}: replaced", self.place));
        }
        Ok(values)
    }

    fn attributes(&self, mesh: &mut Mesh, warnings: &mut Vec<String>) -> Result<()> {
        let n = mesh.positions.len();
        let normals = self.vertex_values::<3>(&Semantic::Normals, n, [0.0; 3], warnings)?;
        mesh.normals = normals.into_iter().map(|v| Vec3::from_array(v).normalize_or_zero()).collect();
        let repaired = shading_frame::repair_normals(mesh);
        if repaired > 0 {
            let at = counted(repaired, "vertex", "vertices");
            warnings.push(format!("{}: NORMAL has no direction at {at}: made from the faces", self.place));
        }
        for set in 0..2 {
            let values = self.vertex_values::<2>(&Semantic::TexCoords(set), n, [0.0; 2], warnings)?;
            mesh.uvs[set as usize] = values.into_iter().map(Vec2::from_array).collect();
        }
        if let Some(index) = self.accessor(&Semantic::Colors(0)) {
            let width = self.document.width(index).map_err(|e| e.within(format!("{}, COLOR_0", self.place)))?;
            let color = Semantic::Colors(0);
            mesh.colors = if width == 3 {
                let values = self.vertex_values::<3>(&color, n, [1.0; 3], warnings)?;
                values.into_iter().map(|c| Vec3::from_array(c).extend(1.0)).collect()
            } else {
                let values = self.vertex_values::<4>(&color, n, [1.0; 4], warnings)?;
                values.into_iter().map(Vec4::from_array).collect()
            };
            for c in &mut mesh.colors {
                *c = c.clamp(Vec4::ZERO, Vec4::ONE);
            }
        }
        // The specification requires that tangents without normals are ignored.
        if !mesh.normals.is_empty() {
            let tangents = self.vertex_values::<4>(&Semantic::Tangents, n, [0.0; 4], warnings)?;
            mesh.tangents = tangents.into_iter().map(Vec4::from_array).collect();
            let unit = |t: &mut Vec4| {
                let length = t.truncate().length();
                *t = (t.truncate() / length).extend(if t.w < 0.0 { -1.0 } else { 1.0 });
                length > 0.0
            };
            if !mesh.tangents.iter_mut().all(unit) {
                warnings
                    .push(format!("{}: some tangents have no direction: all are made from the texture", self.place));
                mesh.tangents = Vec::new();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The formulas of the specification: strips {i, i + (1 + i % 2), i + (2 - i % 2)}, fans {i + 1, i + 2, 0}.
    #[test]
    fn strips_and_fans_become_triangles() {
        let order = [10, 11, 12, 13, 14];
        assert_eq!(triangles(Mode::TriangleStrip, &order), [[10, 11, 12], [11, 13, 12], [12, 13, 14]]);
        assert_eq!(triangles(Mode::TriangleFan, &order), [[11, 12, 10], [12, 13, 10], [13, 14, 10]]);
        assert_eq!(triangles(Mode::Triangles, &order), [[10, 11, 12]]);
        assert!(triangles(Mode::TriangleFan, &[]).is_empty());
        assert!(triangles(Mode::TriangleStrip, &[1, 2]).is_empty());
    }
}
