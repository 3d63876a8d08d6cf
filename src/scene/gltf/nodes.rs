//! Reads the node hierarchy: transforms composed in f64, and the meshes, lights and cameras of the nodes.

use super::clipping::{self, Clip};
use super::deform::Deformation;
use super::document::{Document, extension, get, named};
use super::extras::{self, ObjectExtras, Rate, SceneExtras};
use super::flat::flatten;
use super::materials::{Library, tangent_coordinates};
use super::mesh::MAX_COORDINATE;
use super::shells;
use super::texture::Decoded;
use super::topology::Solid;
use super::transform::{WorldTransforms, compose, is_finite, is_invertible, local};
use super::{ReadOptions, animation, counted, deform, fault, lights, mesh, shading_frame, topology, uri};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::math::{DAffine3, DMat3, DVec3, Rgb};
use crate::memory;
use crate::scene::Description;
use crate::scene::description::{EnvironmentDescription, EnvironmentSource, PictureDefaults, PlacedMesh};
use crate::scene::environment_file;
use crate::scene::folder::Folder;
use serde::Deserialize;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Memory of an instance of a mesh in bytes, Embree included. Measured: 2^20 instances of a triangle take 957 MiB.
const INSTANCE_BYTES: u64 = 1000;
/// Maximum memory of a vertex in bytes, Embree included.
const VERTEX_BYTES: u64 = 128;
/// Maximum memory of a triangle in bytes, Embree included.
const TRIANGLE_BYTES: u64 = 128;

/// Reads the bytes of a file into a description. `images` holds images that have been decoded before, and receives the
/// others.
pub(super) fn describe(
    bytes: &[u8],
    path: &Path,
    options: &ReadOptions,
    images: &mut HashMap<usize, Decoded>,
) -> Result<Description> {
    let mut warnings = Vec::new();
    let folder = Folder::of(path, options.allow_outside);
    let mut document = Document::parse(bytes, folder, &mut warnings)?;
    let animated = animation::apply(&mut document, options.frame, options.after_frame, &mut warnings)?;
    let mut reader = Reader {
        document: &document,
        library: Library::new(options.glass, std::mem::take(images)),
        meshes: HashMap::new(),
        worlds: WorldTransforms::new(&document),
        bounds: Vec::new(),
        clips: Vec::new(),
        divisors: None,
        options: *options,
        scene: SceneExtras::default(),
        out: Description { source: path.to_owned(), warnings, animated, ..Description::default() },
    };
    reader.scene()?;
    let Reader { mut library, mut out, clips, bounds, .. } = reader;
    *images = std::mem::take(&mut library.textures.images);
    if library.occluded > 0 {
        let n = library.occluded;
        let plural = if n == 1 { "material has an occlusion texture" } else { "materials have occlusion textures" };
        out.warnings.push(format!("{n} {plural}, ignored: occlusion is simulated"));
    }
    out.materials = library.list;
    out.textures = library.textures.list;
    lights::reconsider_units(&mut out);
    clipping::check(&mut out, &clips, &bounds);
    let mut seen = HashSet::new();
    out.warnings.retain(|warning| seen.insert(warning.clone()));
    Ok(out)
}

/// Content of the extension KHR_node_visibility.
#[derive(Deserialize)]
struct Visibility {
    #[serde(default = "visible")]
    visible: bool,
}

fn visible() -> bool {
    true
}

/// A node's reference to a light of KHR_lights_punctual, by index.
#[derive(Deserialize)]
struct LightReference {
    light: u32,
}

/// Content of the extension EXT_mesh_gpu_instancing.
#[derive(Deserialize)]
struct Instancing {
    attributes: HashMap<String, u32>,
}

/// A primitive of a mesh with its material, both by their indices in the description.
#[derive(Clone, Copy)]
struct Part {
    mesh: u32,
    material: u32,
}

/// A primitive of a mesh as it was read, with its material.
struct MaterialMesh {
    /// Index of the primitive in its mesh.
    primitive: usize,
    mesh: Mesh,
    /// Index of the material in the file; `None` if the primitive has none.
    file_material: Option<usize>,
    /// Index of the material in the list of those in use.
    material: u32,
    /// Topology of the primitive if it is closed alone, otherwise of the whole mesh.
    bounds: Solid,
}

struct Reader<'r> {
    document: &'r Document<'r>,
    library: Library,
    /// Primitives of the meshes that were read, by index of the mesh, and of the node if it deforms the mesh.
    meshes: HashMap<(usize, Option<usize>), Vec<Part>>,
    worlds: WorldTransforms<'r, 'r>,
    /// Bounding box, in local space, of each mesh in `out`.
    bounds: Vec<(DVec3, DVec3)>,
    /// Clip planes of the cameras, in their order.
    clips: Vec<Clip>,
    /// Divisors from the file's units of punctual lights to radiometric units; `None` until the first light is read.
    divisors: Option<lights::Divisors>,
    options: ReadOptions,
    scene: SceneExtras,
    out: Description,
}

impl Reader<'_> {
    fn scene(&mut self) -> Result<()> {
        let document = self.document;
        let index = document.default_scene()?;
        let roots = match document.scenes.get(index) {
            Some(scene) => scene.nodes.iter().map(|n| n.value()).collect(),
            None => self.root_nodes(),
        };
        let place = named("scene", document.part("scenes", index)["name"].as_str(), index);
        let raw = document.part("scenes", index);
        extras::check_keys(raw, extras::SCENE, &place, &mut self.out.warnings);
        self.scene = extras::read(raw, &place)?;
        if let Some(medium) = &self.scene.medium {
            self.out.medium = Some(medium.parameters(&place)?);
        }
        self.out.warnings.append(&mut self.scene.losses);
        self.picture(&place)?;
        self.environment(&place).map_err(|e| e.within(&place))?;
        self.walk(roots)
    }

    /// Checks the settings of the picture in the extras of the scene, and copies them to the description.
    fn picture(&mut self, place: &str) -> Result<()> {
        let SceneExtras { resolution, exposure, tonemap, crop, film_transparent, frame, frame_rate, shutter, .. } =
            self.scene;
        if resolution.is_some_and(|size| size.contains(&0)) {
            return Err(fault(place, "extras.caustique.resolution must be two numbers above zero"));
        }
        if exposure.is_some_and(|ev| !ev.is_finite()) {
            return Err(fault(place, "extras.caustique.exposure must be finite"));
        }
        let within = |[x, y, width, height]: [f64; 4]| {
            x >= 0.0 && y >= 0.0 && width > 0.0 && height > 0.0 && x + width <= 1.0 + 1e-6 && y + height <= 1.0 + 1e-6
        };
        if crop.is_some_and(|crop| !within(crop)) {
            let cause = "extras.caustique.crop must be left edge, top edge, width and height within 0 and 1";
            return Err(fault(place, cause));
        }
        if shutter.is_some_and(|[open, close]| !(open.is_finite() && close.is_finite() && open <= close)) {
            return Err(fault(
                place,
                "extras.caustique.shutter must be two finite numbers, the second not the smaller",
            ));
        }
        self.out.shutter = shutter;
        let frame_rate = frame_rate.map(Rate::fraction);
        // The numerator of EXR's attribute is signed.
        if frame_rate.is_some_and(|rate| rate.contains(&0) || rate[0] > i32::MAX as u32) {
            let cause = "extras.caustique.frame_rate must be one or two whole numbers above zero, below 2^31";
            return Err(fault(place, cause));
        }
        // A requested frame replaces the frame in the file.
        let frame = self.options.frame.map_or(frame, |frame| i32::try_from(frame.number).ok());
        self.out.picture = PictureDefaults { resolution, exposure, tonemap, film_transparent, crop, frame, frame_rate };
        Ok(())
    }

    /// Indices of the nodes without a parent, which are the roots if the file has no scene.
    fn root_nodes(&self) -> Vec<usize> {
        let nodes = &self.document.nodes;
        let mut child = vec![false; nodes.len()];
        for index in nodes.iter().flat_map(|n| n.children.iter().flatten()) {
            if let Some(flag) = child.get_mut(index.value()) {
                *flag = true;
            }
        }
        (0..nodes.len()).filter(|i| !child[*i]).collect()
    }

    fn environment(&mut self, place: &str) -> Result<()> {
        let Some(extras) = &self.scene.environment else {
            self.out.environment_unknown = self.document.is_by_blender();
            return Ok(());
        };
        let strength = extras.strength.unwrap_or(1.0);
        if !(strength.is_finite() && strength >= 0.0 && extras.rotation_deg.is_finite()) {
            return Err(fault("environment", "strength and rotation_deg must be finite, strength not negative"));
        }
        let source = match (&extras.color, &extras.file) {
            (Some(color), None) => {
                let color = Rgb::from_array(*color);
                if !(color.is_finite() && color.min_element() >= 0.0) {
                    return Err(fault("environment", "its color must be finite and not negative"));
                }
                // A black environment is none.
                if color == Rgb::ZERO {
                    return Ok(());
                }
                EnvironmentSource::Color(color)
            }
            (None, Some(file)) => {
                let file = uri::require_path(file).and_then(|file| self.document.folder.file(file.as_ref()));
                let file = file.map_err(|e| e.within("environment"))?;
                environment_file::read(&file, &mut self.out.warnings)?
            }
            _ => {
                self.out
                    .warnings
                    .push(format!("{place}: the environment has not one of color and file and is ignored"));
                return Ok(());
            }
        };
        self.out.environment_hidden_from_camera = !extras.visible.camera;
        self.out.environment_light_group.clone_from(&extras.light_group);
        self.out.environment = Some(EnvironmentDescription { source, rotation_deg: extras.rotation_deg, strength });
        Ok(())
    }

    /// Visits each node below `roots` once, in the file's order, parents first. Nodes must form trees (specification,
    /// section 3.5.2).
    fn walk(&mut self, roots: Vec<usize>) -> Result<()> {
        let document = self.document;
        let mut seen = vec![false; document.nodes.len()];
        let mut stack: Vec<(usize, DAffine3, bool)> =
            roots.into_iter().rev().map(|n| (n, DAffine3::IDENTITY, true)).collect();
        while let Some((index, parent, shown)) = stack.pop() {
            let node = get(&document.nodes, index, "node")?;
            let place = named("node", node.name.as_deref(), index);
            if std::mem::replace(&mut seen[index], true) {
                return Err(fault(place, "it is its own ancestor, or the child of two nodes")
                    .hint("the file is damaged: export it again"));
            }
            let raw = document.part("nodes", index);
            let to_world = parent * local(raw, &place)?;
            if !is_finite(&to_world) {
                return Err(fault(place, "its transform is not finite").hint("look at its scale and position"));
            }
            let shown = shown
                && extension::<Visibility>(raw, "KHR_node_visibility", &place)?
                    .is_none_or(|visibility| visibility.visible);
            self.node(index, raw, &place, to_world, shown)?;
            for child in node.children.iter().flatten().rev() {
                get(&document.nodes, child.value(), "node").map_err(|e| e.within(&place))?;
                stack.push((child.value(), to_world, shown));
            }
        }
        Ok(())
    }

    fn node(&mut self, index: usize, raw: &Value, place: &str, to_world: DAffine3, shown: bool) -> Result<()> {
        let document = self.document;
        let node = &document.nodes[index];
        let name = node.name.clone().unwrap_or_default();
        extras::check_keys(raw, extras::NODE, place, &mut self.out.warnings);
        if let Some(camera) = node.camera {
            let warnings = &mut self.out.warnings;
            let camera = lights::camera(document, camera.value(), (&name, raw), to_world, warnings);
            let (camera, clip) = camera.map_err(|e| e.within(place))?;
            self.out.cameras.push(camera);
            self.clips.push(clip);
        }
        if !shown {
            return Ok(());
        }
        if let Some(reference) = extension::<LightReference>(raw, "KHR_lights_punctual", place)? {
            let (units, file_units) = (self.options.light_units, self.scene.light_units);
            let out = &mut self.out;
            let divisors = *self.divisors.get_or_insert_with(|| {
                let (divisors, guessed) = lights::divisors(document, units, file_units, &mut out.warnings);
                out.guessed_units = guessed;
                divisors
            });
            let warnings = &mut out.warnings;
            let light = lights::light(document, reference.light as usize, (&name, raw), to_world, divisors, warnings);
            self.out.lights.push(light.map_err(|e| e.within(place))?);
        }
        if let Some(mesh) = node.mesh {
            let mesh = mesh.value();
            let mesh_name = get(&document.meshes, mesh, "mesh").map_err(|e| e.within(place))?.name.clone();
            let known = |name: &String| !name.is_empty();
            let name = Some(name).filter(known).or(mesh_name.filter(known)).unwrap_or_else(|| place.into());
            let extras = extras::read::<ObjectExtras>(raw, place)?;
            let shape = Deformation::of(document, mesh, index, &self.worlds).map_err(|e| e.within(place))?;
            // A skinned mesh ignores the transform of its node (specification, section 3.7.3.3).
            let to_world = shape.center.unwrap_or(to_world);
            let parts = self.parts(mesh, deform::is_deformed(raw).then_some(index), &shape)?;
            self.place(&parts, name, self.copies(raw, place)?, to_world, &extras, place)?;
        }
        Ok(())
    }

    /// Adds instances of the primitives of a mesh to the description, one of each for each transform in `copies`.
    fn place(
        &mut self,
        parts: &[Part],
        name: String,
        copies: Vec<DAffine3>,
        to_world: DAffine3,
        extras: &ObjectExtras,
        place: &str,
    ) -> Result<()> {
        if parts.is_empty() {
            return Ok(());
        }
        self.check_memory(copies.len(), parts.len()).map_err(|e| e.within(place))?;
        let object = self.out.objects.len() as u32;
        self.out.objects.push(name.clone());
        let mut flat = 0;
        for copy in copies {
            let to_world = to_world * copy;
            let invertible = is_invertible(&to_world);
            for &Part { mesh, material } in parts {
                self.check_reach(mesh, &to_world, place)?;
                let (mesh, to_world) = if invertible {
                    (mesh, to_world)
                } else if let Some(mesh) = self.add_flattened(mesh, &to_world.matrix3, place)? {
                    (mesh, DAffine3::from_translation(to_world.translation))
                } else {
                    flat += 1;
                    continue;
                };
                let (name, light_group) = (name.clone(), extras.light_group.clone());
                let hidden_from_camera = !extras.visible.camera;
                let placed = PlacedMesh { name, mesh, material, object, hidden_from_camera, light_group, to_world };
                self.out.instances.push(placed);
            }
        }
        if flat > 0 {
            self.out.warnings.push(format!("{place}: it is left out, because its scale leaves nothing of its area"));
        }
        Ok(())
    }

    /// Adds a flattened copy of a mesh for a transform that is singular, and returns its index. `None` if the copy has
    /// no area.
    fn add_flattened(&mut self, mesh: u32, transform: &DMat3, place: &str) -> Result<Option<u32>> {
        let Some(flat) = flatten(&self.out.meshes[mesh as usize], transform) else { return Ok(None) };
        let bytes = flat.positions.len() as u64 * VERTEX_BYTES + flat.triangles.len() as u64 * TRIANGLE_BYTES;
        let what = "meshes on nodes whose scale is zero along an axis";
        self.document.count_bytes(bytes, what).map_err(|e| e.within(place))?;
        self.bounds.push(self.bounds[mesh as usize]);
        self.out.meshes.push(flat);
        Ok(Some(self.out.meshes.len() as u32 - 1))
    }

    fn check_reach(&self, mesh: u32, to_world: &DAffine3, place: &str) -> Result<()> {
        let (low, high) = self.bounds[mesh as usize];
        let far = |i: usize| {
            let corner = DVec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), low, high);
            let reach = to_world.transform_point3(corner).abs().max_element();
            reach.is_nan() || reach > MAX_COORDINATE
        };
        if (0..8).any(far) {
            return Err(fault(place, "it reaches too far from the origin").hint("look at its scale and position"));
        }
        Ok(())
    }

    /// The primitives of a mesh with their materials, read at the first call. `owner` is the node that deforms the
    /// mesh, if one does.
    fn parts(&mut self, index: usize, owner: Option<usize>, shape: &Deformation) -> Result<Vec<Part>> {
        if let Some(parts) = self.meshes.get(&(index, owner)) {
            return Ok(parts.clone());
        }
        let (mut meshes, whole) = self.material_meshes(index, shape)?;
        let source = get(&self.document.meshes, index, "mesh")?;
        let is_glass = |material: u32| self.library.list[material as usize].is_solid_glass();
        let glass = meshes.iter_mut().filter(|part| is_glass(part.material) && part.bounds.closed).collect();
        orient_shells(glass, whole, &named("mesh", source.name.as_deref(), index), &mut self.out.warnings);
        let mut parts = Vec::new();
        for MaterialMesh { mut mesh, material, .. } in meshes {
            if mesh.tangents.is_empty()
                && let Some(coordinates) = tangent_coordinates(&self.library.list[material as usize])
            {
                shading_frame::make_tangents(&mut mesh, &coordinates);
            }
            parts.push(Part { mesh: self.out.meshes.len() as u32, material });
            let points = || mesh.positions.iter().map(|p| p.as_dvec3());
            let low = points().fold(DVec3::INFINITY, DVec3::min);
            self.bounds.push((low, points().fold(DVec3::NEG_INFINITY, DVec3::max)));
            self.out.meshes.push(mesh);
        }
        self.meshes.insert((index, owner), parts.clone());
        Ok(parts)
    }

    /// Reads the primitives of a mesh that have triangles, and the topology of all of them together.
    fn material_meshes(&mut self, index: usize, shape: &Deformation) -> Result<(Vec<MaterialMesh>, Solid)> {
        let document = self.document;
        let source = get(&document.meshes, index, "mesh")?;
        let mut read: Vec<(usize, Mesh)> = Vec::new();
        for i in 0..source.primitives.len() {
            if let Some(mesh) = mesh::read(document, index, i, shape, &mut self.out.warnings)? {
                read.push((i, mesh));
            }
        }
        // A solid may have several materials, so the surface as a whole decides whether it is closed.
        let whole = topology::solid(&read.iter().map(|(_, m)| m).collect::<Vec<_>>());
        let mut meshes = Vec::new();
        let alone = read.len() == 1;
        for (i, mut mesh) in read {
            let own = if alone { whole } else { topology::solid(&[&mesh]) };
            mesh.closed = own.closed;
            let place = format!("{}, primitive {i}", named("mesh", source.name.as_deref(), index));
            let dropped = mesh::drop_degenerate(&mut mesh);
            if dropped > 0 {
                self.out
                    .warnings
                    .push(format!("{place}: {} without area left out", counted(dropped, "triangle", "triangles")));
            }
            if mesh.triangles.is_empty() {
                self.out.warnings.push(format!("{place}: it has no triangle to render"));
                continue;
            }
            let file_material = source.primitives[i].material.map(|m| m.value());
            let bounds = if own.closed { own } else { whole };
            let material = self
                .library
                .material_for_mesh(document, file_material, &mesh, bounds, &mut self.out.warnings)
                .map_err(|e| if e.place.is_empty() { e.within(&place) } else { e })?;
            meshes.push(MaterialMesh { primitive: i, mesh, file_material, material, bounds });
        }
        Ok((meshes, whole))
    }

    /// Transforms of the copies of a node's mesh (EXT_mesh_gpu_instancing), relative to the node; only the identity
    /// without the extension.
    fn copies(&self, raw: &Value, place: &str) -> Result<Vec<DAffine3>> {
        const NAME: &str = "EXT_mesh_gpu_instancing";
        let Some(instancing) = extension::<Instancing>(raw, NAME, place)? else { return Ok(vec![DAffine3::IDENTITY]) };
        let within = |e: crate::error::Error| e.within(format!("{place}, {NAME}"));
        let index = |key: &str| instancing.attributes.get(key).map(|i| *i as usize);
        let read3 = |key: &str| index(key).map(|i| self.document.floats::<3>(i)).transpose().map_err(within);
        let (translations, scales) = (read3("TRANSLATION")?, read3("SCALE")?);
        let rotations = index("ROTATION").map(|i| self.document.floats::<4>(i)).transpose().map_err(within)?;
        let counts =
            [translations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len)];
        let n = counts.iter().flatten().copied().max().unwrap_or(0);
        if counts.iter().flatten().any(|c| *c != n) {
            return Err(within(fault("", "its attributes differ in length")));
        }
        self.check_memory(n, 1).map_err(within)?;
        let copy = |i: usize| {
            let three = |v: &Option<Vec<[f32; 3]>>| v.as_ref().map(|v| v[i].map(f64::from));
            let rotation = rotations.as_ref().map(|v| v[i].map(f64::from));
            let copy = compose(three(&translations), rotation, three(&scales)).filter(is_finite);
            copy.ok_or_else(|| within(fault("", format!("the transform of copy {i} is not finite"))))
        };
        let mut copies = memory::reserve(n, "copies").map_err(within)?;
        for i in 0..n {
            copies.push(copy(i)?);
        }
        Ok(copies)
    }

    /// Checks that there is memory for `copies` instances of a mesh of `parts` primitives, besides the present
    /// instances.
    fn check_memory(&self, copies: usize, parts: usize) -> Result<()> {
        let placed = (copies as u64).saturating_mul(parts as u64).saturating_add(self.out.instances.len() as u64);
        let bytes = placed.saturating_mul(INSTANCE_BYTES);
        if bytes < memory::MIN_CHECKED_BYTES {
            return Ok(());
        }
        memory::require(bytes, format_args!("{placed} placed meshes"))
            .map_err(|e| e.hint("place fewer copies, join them into one mesh, or render with more memory"))
    }
}

/// Flips inner shells (connected parts) of glass solids that face the wrong way, and adds warnings about flipped and
/// inverted shells. Primitives of one material are one solid.
fn orient_shells(mut glass: Vec<&mut MaterialMesh>, whole: Solid, name: &str, warnings: &mut Vec<String>) {
    while let Some(material) = glass.first().map(|part| part.file_material) {
        let (mut same, others) = glass.into_iter().partition::<Vec<_>, _>(|part| part.file_material == material);
        glass = others;
        let numbers: Vec<String> = same.iter().map(|part| part.primitive.to_string()).collect();
        let noun = if numbers.len() == 1 { "primitive" } else { "primitives" };
        let place = format!("{name}, {noun} {}", numbers.join(", "));
        let mut open = false;
        if same.iter().any(|part| !part.mesh.closed) {
            open = !topology::solid(&same.iter().map(|part| &part.mesh).collect::<Vec<_>>()).closed;
            // Primitives of another material close the open ones.
            same.retain(|part| part.mesh.closed || !open);
        }
        let report = shells::flip_inner(&mut same.into_iter().map(|part| &mut part.mesh).collect::<Vec<_>>());
        if report.inverted > 0 || (open && whole.volume < 0.0) {
            warnings.push(format!(
                "{place}: its faces point inwards, so the inside of the glass is outside: flip its normals"
            ));
        }
        if report.flipped > 0 {
            let shells = counted(report.flipped, "closed shell lies", "closed shells lie");
            warnings.push(format!(
                "{place}: {shells} inside another with the same orientation, which would make no hollow: flipped (flip the normals of one of the two)"
            ));
        }
    }
}
