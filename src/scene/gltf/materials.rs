//! The materials that a scene uses. A material is listed once, or twice if its closed meshes are solid and its open
//! ones thin.

use super::document::{Document, get, named};
use super::material::{self, Loaded};
use super::texture::Textures;
use super::topology::Solid;
use super::{Glass, counted};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::material::Material;
use crate::texture::TextureRef;
use std::collections::HashMap;

/// The materials of a file, loaded when meshes need them.
pub(super) struct Library {
    glass: Glass,
    /// The materials in use, in the order of their first use.
    pub(super) list: Vec<Material>,
    pub(super) textures: Textures,
    /// Materials that were read, by their index in the file (`None` is the default material).
    loaded: HashMap<Option<usize>, Loaded>,
    /// Index in `list`, by the index in the file and by whether the mesh is solid.
    known: HashMap<(Option<usize>, bool), u32>,
    /// Number of materials with an occlusion texture, which is ignored.
    pub(super) occluded: usize,
}

impl Library {
    /// An empty library.
    pub(super) fn new(glass: Glass) -> Library {
        let (list, textures) = (Vec::new(), Textures::default());
        Library { glass, list, textures, loaded: HashMap::new(), known: HashMap::new(), occluded: 0 }
    }

    /// The materials in use, in the same order, and their textures, as a changed document describes them.
    ///
    /// # Errors
    /// A material is invalid.
    pub(super) fn reread(&self, document: &Document) -> Result<(Vec<Material>, Textures)> {
        let mut textures = Textures::with_images_of(&self.textures);
        let mut list = self.list.clone();
        let mut known: Vec<_> = self.known.iter().collect();
        known.sort_by_key(|&(_, at)| at);
        for (&(index, solid), &at) in known {
            let Some(index) = index else { continue };
            let place = place(document, Some(index))?;
            let Loaded { material, .. } = material::read(document, index, &place, &mut textures, &mut Vec::new())?;
            list[at as usize] = Material { thin: !solid, ..material };
        }
        Ok((list, textures))
    }

    /// Index in `list` of the material `index` for a mesh. `bounds` is the topology of the mesh, which decides whether
    /// glass is solid.
    pub(super) fn material_for_mesh(
        &mut self,
        document: &Document,
        index: Option<usize>,
        mesh: &Mesh,
        bounds: Solid,
        warnings: &mut Vec<String>,
    ) -> Result<u32> {
        let closed = bounds.closed;
        let place = place(document, index)?;
        if !self.loaded.contains_key(&index) {
            let loaded = match index {
                Some(i) => material::read(document, i, &place, &mut self.textures, warnings)?,
                None => Loaded { material: default(), solid: None, occlusion: false },
            };
            self.occluded += usize::from(loaded.occlusion);
            self.loaded.insert(index, loaded);
        }
        let loaded = &self.loaded[&index];
        let transmits = loaded.material.transmission.factor > 0.0;
        let solid = if transmits {
            loaded.solid.unwrap_or(match self.glass {
                Glass::Auto => closed,
                Glass::Solid => true,
                Glass::Thin => false,
            })
        } else {
            // Paper and leaves are thin without a thickness.
            loaded.material.transmits() && loaded.solid == Some(true)
        };
        if solid && !closed {
            warnings.push(format!("mesh \"{}\": its {place} is solid, but {}", mesh.name, reason_not_closed(bounds)));
        }
        check_coordinates(&loaded.material, mesh, &place, warnings);
        if let Some(&known) = self.known.get(&(index, solid)) {
            return Ok(known);
        }
        if transmits && loaded.solid.is_none() && self.glass == Glass::Auto {
            let split = self.known.contains_key(&(index, !solid));
            match (solid, split) {
                (true, _) => warnings.push(format!(
                    "{place}: it transmits light but has no volume extension; closed meshes such as \"{}\" are taken for \
                     solid glass (--glass solid or thin decides)",
                    mesh.name
                )),
                (false, true) => warnings.push(format!(
                    "{place}: it is solid on closed meshes, thin on open ones such as \"{}\" (--glass solid or thin decides)",
                    mesh.name
                )),
                (false, false) => {}
            }
        }
        let mut material = loaded.material.clone();
        material.thin = !solid;
        let known = self.list.len() as u32;
        self.list.push(material);
        self.known.insert((index, solid), known);
        Ok(known)
    }
}

/// Why a mesh is not closed, with the consequence and a remedy, as the end of a warning. `bounds` is its topology.
fn reason_not_closed(bounds: Solid) -> String {
    match (bounds.flipped, bounds.rim) {
        (true, _) => "part of its faces is flipped: recalculate its normals".to_string(),
        (false, 0) => "edges join more than two of its faces: light may get lost inside".into(),
        (false, rim) => format!(
            "the mesh is not closed ({}): light may get lost inside; close the holes, or take its thickness away",
            counted(rim, "edge has one face only", "edges have one face only")
        ),
    }
}

fn place(document: &Document, index: Option<usize>) -> Result<String> {
    let Some(i) = index else { return Ok("default material".into()) };
    let list = document.raw["materials"].as_array().map_or(&[][..], Vec::as_slice);
    Ok(named("material", get(list, i, "material")?["name"].as_str(), i))
}

/// The default material of the specification (section 3.9.1), for primitives without a material.
fn default() -> Material {
    Material { name: "default".into(), culled: true, ..Material::default() }
}

fn check_coordinates(material: &Material, mesh: &Mesh, place: &str, warnings: &mut Vec<String>) {
    for set in 0..2 {
        if mesh.uvs[set].is_empty() && material.textures().any(|t| usize::from(t.set) == set) {
            warnings.push(format!(
                "mesh \"{}\": it lacks the texture coordinates {set} that its {place} reads; one texel covers it",
                mesh.name
            ));
        }
    }
}

/// The texture coordinates that define the tangents of a material, with the transform of the normal map, which also
/// rotates its tangent space (specification, section 3.9.3). `None` if the material needs no tangents.
pub(super) fn tangent_coordinates(material: &Material) -> Option<TextureRef> {
    let set = material.anisotropy_texture.map_or(0, |t| t.set);
    let plain = TextureRef { texture: 0, set, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    let maps = material.normal_texture.or(material.clearcoat_normal_texture);
    maps.map(|(t, _)| t).or((material.anisotropy > 0.0).then_some(plain))
}
