//! Reads the node hierarchy: transforms composed in f64, and the meshes, lights and cameras of the nodes.

use super::animation::{MovingParts, Tracks};
use super::clipping::{self, Clip};
use super::deform::Deformation;
use super::document::{Document, extension, get, named};
use super::extras::{self, EnvironmentExtras, LinkExtras, ObjectExtras, Rate, SceneExtras};
use super::files;
use super::flat::flatten;
use super::materials::{Library, tangent_coordinates};
use super::shells;
use super::topology::Solid;
use super::transform::{WorldTransforms, check_reach, compose, is_finite, is_invertible, local};
use super::{
    Pose, ReadOptions, choice, compressed, counted, deform, fault, lights, mesh, own_light, profiles, shading_frame,
    topology, uri,
};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::material::Material;
use crate::math::{DAffine3, DMat3, Rgb, Vec3, bounding_box};
use crate::memory;
use crate::scene::Description;
use crate::scene::description::{self, EnvironmentDescription, EnvironmentSource, Links, PictureDefaults, PlacedMesh};
use crate::scene::environment_file;
use crate::scene::folder::Folder;
use serde::Deserialize;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// Memory of an instance of a mesh in bytes, Embree included. Measured: 2^20 instances of a triangle take 957 MiB.
const INSTANCE_BYTES: u64 = 1000;
/// Maximum memory of a vertex in bytes, Embree included.
const VERTEX_BYTES: u64 = 128;
/// Maximum memory of a triangle in bytes, Embree included.
const TRIANGLE_BYTES: u64 = 128;

/// Parses the bytes of a file.
pub(super) fn parse<'a>(
    bytes: &'a [u8],
    path: &'a Path,
    options: &ReadOptions,
    warnings: &mut Vec<String>,
) -> Result<Document<'a>> {
    let mut document = Document::parse(bytes, Folder::of(path, options.allow_outside), warnings)?;
    compressed::decode(&mut document)?;
    choice::apply(&mut document, options)?;
    Ok(document)
}

/// Reads the bytes of a file into a description. Also returns the parts that other moments of the scene share. If an
/// animation makes the scene invalid, and no frame is given, the file is read without its animations.
pub(super) fn describe(bytes: &[u8], path: &Path, options: &ReadOptions) -> Result<(Description, Shared)> {
    let mut animated = false;
    describe_pose(bytes, path, options, &mut animated).or_else(|fault| {
        if options.frame.is_some() || !animated {
            return Err(fault);
        }
        let rest = ReadOptions { pose: Pose::Rest, ..options.clone() };
        let Ok((mut out, shared)) = describe_pose(bytes, path, &rest, &mut animated) else { return Err(fault) };
        out.warnings.insert(0, format!("its animations are ignored, because with them it cannot be read: {fault}"));
        Ok((out, shared))
    })
}

/// Reads the bytes of a file into a description, in the pose that `options` ask for. Sets `animated` if animations move
/// the scene.
fn describe_pose(
    bytes: &[u8],
    path: &Path,
    options: &ReadOptions,
    animated: &mut bool,
) -> Result<(Description, Shared)> {
    let mut warnings = Vec::new();
    let mut document = parse(bytes, path, options, &mut warnings)?;
    let tracks = Tracks::read(&document, options, &mut warnings)?;
    *animated = !tracks.is_empty();
    tracks.apply(&mut document, 0.0, &mut warnings)?;
    let moving = tracks.moving_parts();
    let mut reader = Reader::new(&document, path, options, (!tracks.is_empty()).then_some(&moving));
    reader.out.warnings = warnings;
    reader.scene()?;
    reader.out.contents = choice::contents(&document);
    let Reader { library, mut out, clips, bounds, meshes, divisors, profiles, flipped, .. } = reader;
    if library.occluded > 0 {
        let n = library.occluded;
        let plural = if n == 1 { "material has an occlusion texture" } else { "materials have occlusion textures" };
        out.warnings.push(format!("{n} {plural}, ignored: occlusion is simulated"));
    }
    out.files = vec![path.to_owned()];
    files::collect(&document.raw, document.folder, &mut out.files);
    out.materials.clone_from(&library.list);
    out.textures.clone_from(&library.textures.list);
    let factor = lights::reconsider_units(&mut out);
    clipping::check(&mut out, &clips, &bounds);
    let mut seen = HashSet::new();
    out.warnings.retain(|warning| seen.insert(warning.clone()));
    Ok((
        out,
        Shared {
            library,
            parts: meshes,
            bounds,
            divisors: divisors.map(|divisors| divisors.over(factor)),
            profiles,
            flipped,
        },
    ))
}

/// The parts of a description that the moments of a scene share.
pub(super) struct Shared {
    library: Library,
    parts: HashMap<(usize, Option<usize>), Vec<Part>>,
    bounds: Vec<(Vec3, Vec3)>,
    divisors: Option<lights::Divisors>,
    profiles: profiles::Profiles,
    /// Indices of the meshes in the file with inner shells of glass that were flipped.
    flipped: HashSet<usize>,
}

/// A moment of a scene that was read before.
#[derive(Clone, Copy)]
pub(super) struct Moment<'r> {
    pub(super) shared: &'r Shared,
    pub(super) moving: &'r MovingParts,
    /// The meshes of the scene that was built from the file.
    pub(super) meshes: &'r [Arc<Mesh>],
    /// Whether objects that are missing in that scene are left out; otherwise they are an error.
    pub(super) partial: bool,
}

/// Describes a moment of a scene, which `document` is set to. Without moving materials, the description has none.
pub(super) fn describe_moment(
    document: &Document,
    path: &Path,
    options: &ReadOptions,
    moment: Moment<'_>,
) -> Result<Description> {
    let mut reader = Reader::new(document, path, options, Some(moment.moving));
    reader.moment = Some(moment);
    reader.bounds.clone_from(&moment.shared.bounds);
    reader.divisors = moment.shared.divisors;
    reader.profiles = moment.shared.profiles.clone();
    reader.out.meshes = moment.meshes.to_vec();
    reader.scene()?;
    let mut out = reader.out;
    if moment.moving.materials {
        let (materials, textures) = moment.shared.library.reread(document)?;
        (out.materials, out.textures) = (materials, textures.list);
    }
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

/// Properties that a node passes on to its children.
#[derive(Clone)]
struct Inherited {
    to_world: DAffine3,
    shown: bool,
    moves: bool,
    /// Names of the collections that the node is in, by itself or by its parents.
    collections: Arc<Vec<String>>,
}

impl Inherited {
    /// Adds the collections of a node, and returns its light linking; `None` if it has none.
    fn link(&mut self, LinkExtras { collections, receivers, blockers }: LinkExtras) -> Option<Arc<Links>> {
        if !collections.is_empty() {
            Arc::make_mut(&mut self.collections).extend(collections);
        }
        let links = Links { collections: self.collections.to_vec(), receivers, blockers };
        (links != Links::default()).then(|| Arc::new(links))
    }
}

/// An object of the scene that is placed once or several times.
struct Object<'o> {
    name: String,
    extras: &'o ObjectExtras,
    links: Option<Arc<Links>>,
    /// Whether its place or shape depends on the time while the shutter is open.
    moves: bool,
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
    /// The parts of the document that animations change; `None` if nothing is animated.
    moving: Option<&'r MovingParts>,
    /// The moment to read, with the parts that it shares with the scene that was read before; `None`: all is read.
    moment: Option<Moment<'r>>,
    library: Library,
    /// Primitives of the meshes that were read, by index of the mesh, and of the node if it deforms the mesh.
    meshes: HashMap<(usize, Option<usize>), Vec<Part>>,
    worlds: WorldTransforms<'r, 'r>,
    /// Bounding box, in local space, of each mesh in `out`.
    bounds: Vec<(Vec3, Vec3)>,
    /// Clip planes of the cameras, in their order.
    clips: Vec<Clip>,
    /// Divisors from the file's units of punctual lights to radiometric units; `None` until the first light is read.
    divisors: Option<lights::Divisors>,
    profiles: profiles::Profiles,
    /// Indices of the meshes in the file with inner shells of glass that were flipped.
    flipped: HashSet<usize>,
    options: ReadOptions,
    scene: SceneExtras,
    out: Description,
}

impl<'r> Reader<'r> {
    fn new(
        document: &'r Document<'r>,
        path: &Path,
        options: &ReadOptions,
        moving: Option<&'r MovingParts>,
    ) -> Reader<'r> {
        Reader {
            document,
            moving,
            moment: None,
            library: Library::new(options.glass),
            meshes: HashMap::new(),
            worlds: WorldTransforms::new(document),
            bounds: Vec::new(),
            clips: Vec::new(),
            divisors: None,
            profiles: profiles::Profiles::default(),
            flipped: HashSet::new(),
            options: options.clone(),
            scene: SceneExtras::default(),
            out: Description { source: path.to_owned(), ..Description::default() },
        }
    }

    fn scene(&mut self) -> Result<()> {
        let document = self.document;
        let index = document.scene_index()?;
        let roots = match document.scenes.get(index) {
            Some(scene) => scene.nodes.iter().map(|n| n.value()).collect(),
            None => self.root_nodes(),
        };
        let place = named("scene", document.part("scenes", index)["name"].as_str(), index);
        let raw = document.part("scenes", index);
        extras::check_keys(raw, &[extras::SCENE], &place, &mut self.out.warnings);
        self.scene = extras::read(raw, &place)?;
        if let Some(medium) = &self.scene.medium {
            if medium.density.is_some() || medium.emission.is_some() {
                let cause = "the medium that fills the scene has no grids";
                return Err(fault(place, cause).hint("give the medium to the material of a closed mesh"));
            }
            self.out.medium = Some(medium.parameters(&place)?);
        }
        self.out.warnings.append(&mut self.scene.losses);
        self.picture(&place)?;
        // The environment of a scene does not move.
        if self.moment.is_none() {
            self.environment(&place).map_err(|e| e.within(&place))?;
        }
        self.walk(roots)
    }

    /// Checks the settings of the picture in the extras of the scene, and copies them to the description.
    fn picture(&mut self, place: &str) -> Result<()> {
        let SceneExtras {
            resolution,
            exposure,
            tonemap,
            contrast,
            crop,
            film_transparent,
            frame,
            frame_rate,
            shutter,
            ..
        } = self.scene;
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
        let shutter = self.options.shutter.or(shutter);
        self.out.shutter = shutter.filter(|[open, close]| open < close);
        self.out.animated = self.moving.is_some();
        let frame_rate = frame_rate.map(Rate::fraction);
        // The numerator of EXR's attribute is signed.
        if frame_rate.is_some_and(|rate| rate.contains(&0) || rate[0] > i32::MAX as u32) {
            let cause = "extras.caustique.frame_rate must be one or two whole numbers above zero, below 2^31";
            return Err(fault(place, cause));
        }
        // A requested frame replaces the frame in the file.
        let frame = self.options.frame.map_or(frame, |frame| i32::try_from(frame.number).ok());
        self.out.picture =
            PictureDefaults { resolution, exposure, tonemap, contrast, film_transparent, crop, frame, frame_rate };
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

    /// Reads the environment, and what cameras see instead of it.
    fn environment(&mut self, place: &str) -> Result<()> {
        let Some(extras) = &self.scene.environment else {
            self.out.environment_unknown = self.document.is_by_blender();
            return Ok(());
        };
        let folder = self.document.folder;
        if let Some(background) = &extras.background {
            self.out.background =
                read_environment(folder, "environment.background", background, place, &mut self.out.warnings)?;
        }
        let found = read_environment(folder, "environment", extras, place, &mut self.out.warnings)?;
        let Some(environment) = found else { return Ok(()) };
        // A black environment is none.
        if matches!(environment.source, EnvironmentSource::Color(Rgb::ZERO)) {
            self.out.environment_is_black = true;
            return Ok(());
        }
        self.out.environment_hidden_from_camera = !extras.visible.camera;
        self.out.environment_light_group.clone_from(&extras.light_group);
        self.out.environment = Some(environment);
        Ok(())
    }

    /// Visits each node below `roots` once, in the file's order, parents first. Nodes must form trees (specification,
    /// section 3.5.2).
    fn walk(&mut self, roots: Vec<usize>) -> Result<()> {
        let document = self.document;
        let mut seen = vec![false; document.nodes.len()];
        let moving = self.moving_parts();
        let root = Inherited { to_world: DAffine3::IDENTITY, shown: true, moves: false, collections: Arc::default() };
        let mut stack: Vec<(usize, Inherited)> = roots.into_iter().rev().map(|n| (n, root.clone())).collect();
        while let Some((index, parent)) = stack.pop() {
            let node = get(&document.nodes, index, "node")?;
            let place = named("node", node.name.as_deref(), index);
            if std::mem::replace(&mut seen[index], true) {
                return Err(fault(place, "it is its own ancestor, or the child of two nodes")
                    .hint("the file is damaged: export it again"));
            }
            let raw = document.part("nodes", index);
            let to_world = parent.to_world * local(raw, &place)?;
            if !is_finite(&to_world) {
                return Err(fault(place, "its transform is not finite").hint("look at its scale and position"));
            }
            let shown = parent.shown
                && extension::<Visibility>(raw, "KHR_node_visibility", &place)?
                    .is_none_or(|visibility| visibility.visible);
            let moves = parent.moves || moving.is_some_and(|moving| moving.moves(index));
            let mut inherited = Inherited { to_world, shown, moves, ..parent };
            let links = inherited.link(extras::read(raw, &place)?);
            self.node(index, raw, &place, &inherited, links)?;
            for child in node.children.iter().flatten().rev() {
                get(&document.nodes, child.value(), "node").map_err(|e| e.within(&place))?;
                stack.push((child.value(), inherited.clone()));
            }
        }
        // A file without a camera is a model more than a scene, and its surfaces that glow are no lights.
        let (nodes, surfaces) = ((0..seen.len()).filter(|index| seen[*index]), !self.out.cameras.is_empty());
        self.out.has_light = self.moment.is_none() && own_light::has_light(document, self.moving, nodes, surfaces);
        Ok(())
    }

    fn node(
        &mut self,
        index: usize,
        raw: &Value,
        place: &str,
        &Inherited { to_world, shown, moves, .. }: &Inherited,
        links: Option<Arc<Links>>,
    ) -> Result<()> {
        let document = self.document;
        let node = &document.nodes[index];
        let name = node.name.clone().unwrap_or_default();
        let known = [extras::NODE, extras::CAMERA, extras::LIGHT];
        extras::check_keys(raw, &known, place, &mut self.out.warnings);
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
        let reference = extension::<LightReference>(raw, "KHR_lights_punctual", place)?;
        if reference.is_some() || profiles::has_light(raw) {
            let before = self.out.lights.len();
            self.lights(reference, (&name, raw), place, to_world).map_err(|e| e.within(place))?;
            self.out.lights[before..].iter_mut().for_each(|light| light.links.clone_from(&links));
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
            let deforms = self.deforms(mesh, index, raw);
            let owner = deform::is_deformed(raw).then_some(index);
            let parts = match self.moment {
                Some(moment) => self.parts_at_moment(moment, mesh, owner, &shape, deforms, &name)?,
                None => self.parts(mesh, owner, &shape)?,
            };
            let object = Object { name, extras: &extras, links, moves: moves || deforms };
            self.place(&parts, object, self.copies(raw, place)?, to_world, place)?;
        }
        Ok(())
    }

    /// Adds the lights of a node, which is given by its name and raw JSON, to the description.
    fn lights(
        &mut self,
        reference: Option<LightReference>,
        node: (&str, &Value),
        place: &str,
        to_world: DAffine3,
    ) -> Result<()> {
        let (document, units, file_units) = (self.document, self.options.light_units, self.scene.light_units);
        let out = &mut self.out;
        let divisors = *self.divisors.get_or_insert_with(|| {
            let (divisors, guessed) = lights::divisors(document, units, file_units, &mut out.warnings);
            out.guessed_units = guessed;
            divisors
        });
        if let Some(LightReference { light }) = reference {
            let (index, warnings) = (light as usize, &mut out.warnings);
            let assets = lights::LightAssets { profiles: &mut self.profiles, textures: &mut self.library.textures };
            out.lights.push(lights::light(document, index, node, to_world, divisors, assets, warnings)?);
        }
        let (divisor, profiles, warnings) = (divisors.point(), &mut self.profiles, &mut out.warnings);
        out.lights.extend(profiles::light(document, node, place, to_world, divisor, profiles, warnings)?);
        Ok(())
    }

    /// Adds instances of the primitives of a mesh to the description, one of each for each transform in `copies`.
    fn place(
        &mut self,
        parts: &[Part],
        Object { name, extras, links, moves }: Object<'_>,
        copies: Vec<DAffine3>,
        to_world: DAffine3,
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
                check_reach(self.bounds[mesh as usize], &to_world, place)?;
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
                let (shadow_catcher, holdout) = (extras.shadow_catcher, extras.holdout);
                self.out.instances.push(PlacedMesh {
                    name,
                    mesh,
                    material,
                    object,
                    hidden_from_camera,
                    shadow_catcher,
                    holdout,
                    light_group,
                    links: links.clone(),
                    moves,
                    to_world,
                });
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
        self.out.meshes.push(Arc::new(flat));
        Ok(Some(self.out.meshes.len() as u32 - 1))
    }

    /// The primitives of a mesh with their materials, read at the first call. `owner` is the node that deforms the
    /// mesh, if one does.
    fn parts(&mut self, index: usize, owner: Option<usize>, shape: &Deformation) -> Result<Vec<Part>> {
        if let Some(parts) = self.meshes.get(&(index, owner)) {
            return Ok(parts.clone());
        }
        let (mut meshes, whole) = self.material_meshes(index, shape)?;
        let source = get(&self.document.meshes, index, "mesh")?;
        let is_glass = |material: u32| self.library.list[material as usize].is_solid();
        let glass = meshes.iter_mut().filter(|part| is_glass(part.material) && part.bounds.closed).collect();
        if orient_shells(glass, whole, &named("mesh", source.name.as_deref(), index), &mut self.out.warnings) {
            self.flipped.insert(index);
        }
        let mut parts = Vec::new();
        for MaterialMesh { mut mesh, material, .. } in meshes {
            add_tangents(&mut mesh, &self.library.list[material as usize]);
            parts.push(Part { mesh: self.out.meshes.len() as u32, material });
            self.bounds.push(bounds(&mesh));
            self.out.meshes.push(Arc::new(mesh));
        }
        self.meshes.insert((index, owner), parts.clone());
        Ok(parts)
    }

    /// The parts of the document that differ between moments; `None` if no other moment is rendered.
    fn moving_parts(&self) -> Option<&'r MovingParts> {
        self.moving.filter(|_| self.moment.is_some() || self.out.blur().is_some())
    }

    /// Whether the shape of a mesh at a node differs between moments.
    fn deforms(&self, mesh: usize, node: usize, raw: &Value) -> bool {
        self.moving_parts().is_some_and(|moving| moving.deforms(mesh, node, raw.get("skin").is_some()))
    }

    /// The primitives of a mesh at another moment. They are read again if the mesh `deforms`.
    fn parts_at_moment(
        &mut self,
        Moment { shared, partial, .. }: Moment<'r>,
        index: usize,
        owner: Option<usize>,
        shape: &Deformation,
        deforms: bool,
        name: &str,
    ) -> Result<Vec<Part>> {
        let missing = || if partial { Ok(Vec::new()) } else { Err(description::missing_at_moments(name)) };
        let Some(known) = shared.parts.get(&(index, owner)) else { return missing() };
        if !deforms || self.meshes.contains_key(&(index, owner)) {
            return Ok(known.clone());
        }
        let mut meshes = self.deformed(index, shape, known)?;
        if meshes.len() != known.len() {
            return missing();
        }
        if shared.flipped.contains(&index) {
            let is_glass = |part: &MaterialMesh| shared.library.list[part.material as usize].is_solid();
            let glass = meshes.iter_mut().filter(|part| is_glass(part) && part.bounds.closed).collect();
            orient_shells(glass, CLOSED, name, &mut Vec::new());
        }
        for (MaterialMesh { mut mesh, .. }, &Part { mesh: at, material }) in meshes.into_iter().zip(known) {
            add_tangents(&mut mesh, &shared.library.list[material as usize]);
            self.bounds[at as usize] = bounds(&mesh);
            self.out.meshes[at as usize] = Arc::new(mesh);
        }
        self.meshes.insert((index, owner), known.clone());
        Ok(known.clone())
    }

    /// Reads the primitives of a mesh that have triangles at another moment. `known` are its primitives before.
    fn deformed(&mut self, index: usize, shape: &Deformation, known: &[Part]) -> Result<Vec<MaterialMesh>> {
        let document = self.document;
        let source = get(&document.meshes, index, "mesh")?;
        let mut meshes = Vec::new();
        for primitive in 0..source.primitives.len() {
            let Some(mut mesh) = mesh::read(document, index, primitive, shape, &mut Vec::new())? else { continue };
            mesh::drop_degenerate(&mut mesh);
            let Some(part) = known.get(meshes.len()).filter(|_| !mesh.triangles.is_empty()) else { continue };
            mesh.closed = self.out.meshes[part.mesh as usize].closed;
            let file_material = source.primitives[primitive].material.map(|m| m.value());
            let bounds = Solid { closed: mesh.closed, ..CLOSED };
            meshes.push(MaterialMesh { primitive, mesh, file_material, material: part.material, bounds });
        }
        topology::weld_seams(&mut meshes.iter_mut().map(|part| &mut part.mesh).collect::<Vec<_>>());
        Ok(meshes)
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
        topology::weld_seams(&mut read.iter_mut().map(|(_, mesh)| mesh).collect::<Vec<_>>());
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

/// Reads the colour or the image of the key `key`; `None`, with a warning, if it has neither or both.
fn read_environment(
    folder: Folder,
    key: &str,
    extras: &EnvironmentExtras,
    place: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<EnvironmentDescription>> {
    let strength = extras.strength.unwrap_or(1.0);
    if !(strength.is_finite() && strength >= 0.0 && extras.rotation_deg.is_finite()) {
        return Err(fault(key, "strength and rotation_deg must be finite, strength not negative"));
    }
    let source = match (&extras.color, &extras.file) {
        (Some(color), None) => {
            let color = Rgb::from_array(*color);
            if !(color.is_finite() && color.min_element() >= 0.0) {
                return Err(fault(key, "its color must be finite and not negative"));
            }
            EnvironmentSource::Color(color)
        }
        (None, Some(file)) => {
            let file = uri::require_path(file).and_then(|file| folder.file(file.as_ref()));
            let file = file.map_err(|e| e.within(key))?;
            environment_file::read(&file, warnings)?
        }
        _ => {
            warnings.push(format!("{place}: the {key} has not one of color and file and is ignored"));
            return Ok(None);
        }
    };
    Ok(Some(EnvironmentDescription { source, rotation_deg: extras.rotation_deg, strength }))
}

/// Topology of a closed surface, where its volume and holes do not matter.
const CLOSED: Solid = Solid { closed: true, flipped: false, rim: 0, volume: 0.0 };

/// Makes the tangents of a mesh if its material needs them and the file lacks them.
fn add_tangents(mesh: &mut Mesh, material: &Material) {
    if mesh.tangents.is_empty()
        && let Some(coordinates) = tangent_coordinates(material)
    {
        shading_frame::make_tangents(mesh, &coordinates);
    }
}

/// Bounding box of a mesh, in its own space.
fn bounds(mesh: &Mesh) -> (Vec3, Vec3) {
    bounding_box(mesh.positions.iter().copied())
}

/// Flips inner shells (connected parts) of glass solids that face the wrong way, and adds warnings about flipped and
/// inverted shells. Primitives of one material are one solid. Returns whether any shell was flipped.
fn orient_shells(mut glass: Vec<&mut MaterialMesh>, whole: Solid, name: &str, warnings: &mut Vec<String>) -> bool {
    let mut any_flipped = false;
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
        any_flipped |= report.flipped > 0;
        if report.flipped > 0 {
            let shells = counted(report.flipped, "closed shell lies", "closed shells lie");
            warnings.push(format!(
                "{place}: {shells} inside another with the same orientation, which would make no hollow: flipped (flip the normals of one of the two)"
            ));
        }
    }
    any_flipped
}
