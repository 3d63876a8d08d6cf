//! Edits of a scene's description: objects and lights that are moved, removed, or replaced by those of another file.

use super::Description;
use super::description::{PlacedMesh, PunctualLight};
use super::gltf::{check_reach, is_finite, is_invertible};
use crate::error::{Error, ErrorKind, Result};
use crate::material::Material;
use crate::math::{DAffine3, bounding_box};
use std::collections::{HashMap, HashSet};

impl Description {
    /// Places the object or the light `name` elsewhere. `to_world` transforms its own space to world space. Other nodes
    /// of the file stay, also those below its node.
    ///
    /// # Errors
    /// There is no such object or light, several have the name, or the transform is singular or too large.
    pub fn place(&mut self, name: &str, to_world: DAffine3) -> Result<()> {
        if !is_finite(&to_world) || !is_invertible(&to_world) {
            let hint = "look at its scale and position; an object that is flattened has to come in a file";
            return Err(fault(name, "its transform is not finite, or has no inverse").hint(hint));
        }
        let placed: Vec<usize> = self.instances_of(name).collect();
        let lights: Vec<usize> = positions(&self.lights, |light| light.name == name).collect();
        let places = places(placed.iter().map(|index| &self.instances[*index]));
        match places + lights.len() {
            1 => {}
            0 => return Err(self.unknown(name)),
            count => {
                let cause = format!("there are {count} objects or lights of this name, or copies of it");
                return Err(fault(name, cause).hint("give them names of their own, or load the scene again"));
            }
        }
        for &index in &placed {
            let mesh = &self.meshes[self.instances[index].mesh as usize];
            check_reach(bounding_box(mesh.positions.iter().copied()), &to_world, &format!("object \"{name}\""))?;
        }
        placed.into_iter().for_each(|index| self.instances[index].to_world = to_world);
        lights.into_iter().for_each(|index| self.lights[index].to_world = to_world);
        Ok(())
    }

    /// Removes the objects and lights `name`.
    ///
    /// # Errors
    /// There is no such object or light.
    pub fn remove(&mut self, name: &str) -> Result<()> {
        let before = (self.instances.len(), self.lights.len());
        self.instances.retain(|placed| placed.name != name);
        self.lights.retain(|light| light.name != name);
        if before == (self.instances.len(), self.lights.len()) {
            return Err(self.unknown(name));
        }
        self.prune();
        Ok(())
    }

    /// Adds the objects and lights of `part`, with their meshes, materials and textures. Those that exist under the same
    /// names are replaced, and keep their places in the order of the scene. Cameras, environment and medium of `part` are
    /// left out.
    pub fn replace_by(&mut self, mut part: Description) {
        let [meshes, materials, objects] =
            [self.meshes.len(), self.materials.len(), self.objects.len()].map(|count| count as u32);
        let textures = self.textures.len() as u32;
        part.materials.iter_mut().flat_map(Material::textures_mut).for_each(|used| used.texture += textures);
        for placed in &mut part.instances {
            (placed.mesh, placed.material) = (placed.mesh + meshes, placed.material + materials);
            placed.object += objects;
        }
        self.meshes.append(&mut part.meshes);
        self.materials.append(&mut part.materials);
        self.objects.append(&mut part.objects);
        self.textures.append(&mut part.textures);
        replace(&mut self.instances, part.instances, |placed: &PlacedMesh| &placed.name);
        replace(&mut self.lights, part.lights, |light: &PunctualLight| &light.name);
        self.prune();
    }

    /// Indices of the instances of the object `name`.
    fn instances_of<'a>(&'a self, name: &'a str) -> impl Iterator<Item = usize> + 'a {
        positions(&self.instances, move |placed| placed.name == name)
    }

    /// Drops meshes, materials, textures and object names that no instance uses, and numbers the others in the order of
    /// their first use, as in a file that is read anew.
    fn prune(&mut self) {
        let (mut meshes, mut materials, mut objects) = (Kept::default(), Kept::default(), Kept::default());
        for placed in &mut self.instances {
            placed.mesh = meshes.index(placed.mesh);
            placed.material = materials.index(placed.material);
            placed.object = objects.index(placed.object);
        }
        self.meshes = meshes.pick(&self.meshes);
        self.materials = materials.pick(&self.materials);
        self.objects = objects.pick(&self.objects);
        let mut textures = Kept::default();
        let used = self.materials.iter_mut().flat_map(Material::textures_mut);
        used.for_each(|used| used.texture = textures.index(used.texture));
        self.textures = textures.pick(&self.textures);
    }

    fn unknown(&self, name: &str) -> Error {
        let error = fault(name, "the scene has no object or light of this name");
        error.hint(format!("it has {} objects and {} lights", self.objects.len(), self.lights.len()))
    }
}

fn fault(name: &str, cause: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Scene, format!("object \"{name}\""), cause)
}

fn positions<'a, T>(list: &'a [T], wanted: impl Fn(&T) -> bool + 'a) -> impl Iterator<Item = usize> + 'a {
    list.iter().enumerate().filter(move |(_, item)| wanted(item)).map(|(index, _)| index)
}

/// Number of different places of instances. The primitives of one object share a place.
fn places<'a>(instances: impl Iterator<Item = &'a PlacedMesh>) -> usize {
    let place = |placed: &PlacedMesh| (placed.object, placed.to_world.to_cols_array().map(f64::to_bits));
    instances.map(place).collect::<HashSet<_>>().len()
}

/// Replaces the items of a list by new ones of the same name, at the place of the first that is replaced. New names come
/// last.
fn replace<T>(list: &mut Vec<T>, new: Vec<T>, name: impl Fn(&T) -> &String) {
    let mut by_name: HashMap<String, Vec<T>> = HashMap::new();
    let mut order = Vec::new();
    for item in new {
        let of_name = by_name.entry(name(&item).clone()).or_default();
        if of_name.is_empty() {
            order.push(name(&item).clone());
        }
        of_name.push(item);
    }
    let replaced: HashSet<String> = order.iter().cloned().collect();
    for item in std::mem::take(list) {
        if replaced.contains(name(&item)) {
            list.extend(by_name.remove(name(&item)).unwrap_or_default());
        } else {
            list.push(item);
        }
    }
    list.extend(order.into_iter().flat_map(|name| by_name.remove(&name).unwrap_or_default()));
}

/// Items of a list that are kept, with their new indices by the order of their first use.
#[derive(Default)]
struct Kept {
    new: HashMap<u32, u32>,
    old: Vec<u32>,
}

impl Kept {
    /// The new index of the item that had the index `old`, which is kept.
    fn index(&mut self, old: u32) -> u32 {
        *self.new.entry(old).or_insert_with(|| {
            self.old.push(old);
            self.old.len() as u32 - 1
        })
    }

    fn pick<T: Clone>(&self, list: &[T]) -> Vec<T> {
        self.old.iter().filter_map(|&old| list.get(old as usize).cloned()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mesh;
    use crate::math::DVec3;
    use crate::texture::{Texels, Texture, TextureRef, Wrap};
    use std::sync::Arc;

    fn described(names: &[&str]) -> Description {
        let mut out = Description::default();
        for (index, name) in names.iter().enumerate() {
            let index = index as u32;
            let name = (*name).to_owned();
            let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into).to_vec();
            out.meshes.push(Arc::new(Mesh { name: name.clone(), positions, ..Mesh::default() }));
            let texture = TextureRef { texture: index, set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
            let material = Material { name: name.clone(), base_color_texture: Some(texture), ..Material::default() };
            out.materials.push(material);
            let texels = Texels::Floats(vec![[0.5; 4]]);
            let wrap = [Wrap::Repeat; 2];
            out.textures.push(Texture { name: name.clone(), width: 1, height: 1, texels, wrap, linear: true });
            out.objects.push(name.clone());
            out.instances.push(PlacedMesh {
                name,
                mesh: index,
                material: index,
                object: index,
                hidden_from_camera: false,
                shadow_catcher: false,
                holdout: false,
                light_group: None,
                links: None,
                moves: false,
                to_world: DAffine3::IDENTITY,
            });
        }
        out
    }

    /// The names by which instances find their meshes, materials, textures and objects.
    fn names(of: &Description) -> Vec<[String; 4]> {
        let found = of.instances.iter().map(|placed| {
            let material = &of.materials[placed.material as usize];
            let texture = material.base_color_texture.expect("a texture").texture as usize;
            let mesh = of.meshes[placed.mesh as usize].name.clone();
            [mesh, material.name.clone(), of.textures[texture].name.clone(), of.objects[placed.object as usize].clone()]
        });
        found.collect()
    }

    #[test]
    fn edited_descriptions_are_those_of_edited_files() {
        let mut scene = described(&["a", "b", "c"]);
        scene.place("b", DAffine3::from_translation(DVec3::X)).expect("b is there");
        scene.replace_by(described(&["d", "b"]));
        let expected = ["a", "b", "c", "d"].map(|name| [(); 4].map(|()| name.to_owned()));
        assert_eq!(names(&scene), expected);
        assert_eq!(scene.instances[1].to_world, DAffine3::IDENTITY, "the file of the part places it");
        scene.remove("a").expect("a is there");
        assert_eq!(names(&scene), expected[1..]);
        assert_eq!([scene.meshes.len(), scene.materials.len(), scene.textures.len(), scene.objects.len()], [3; 4]);
    }

    #[test]
    fn impossible_edits_are_refused() {
        let mut scene = described(&["a", "twice", "twice"]);
        let refused = |scene: &mut Description, name: &str, to_world| {
            scene.place(name, to_world).expect_err("it cannot be placed").to_string()
        };
        assert!(refused(&mut scene, "z", DAffine3::IDENTITY).contains("no object or light"));
        assert!(refused(&mut scene, "twice", DAffine3::IDENTITY).contains("2 objects"));
        assert!(refused(&mut scene, "a", DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).contains("no inverse"));
        assert!(refused(&mut scene, "a", DAffine3::from_translation(DVec3::splat(2e9))).contains("too far"));
        assert!(scene.remove("z").is_err());
    }
}
